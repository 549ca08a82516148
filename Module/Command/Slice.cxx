// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus slice: the field seen at any planes.
#include <algorithm>
#include <memory>

#include "Command.h"
#include "Core/Model/FrameDistance.h"
#include "Core/StandardError/StandardError.h"
#include "Data/FieldData.h"
#include "Exit.h"
#include "Files.h"
#include "Inputs.h"
#include "Outputs.h"
#include "Pipeline.h"
#include "RenderOptions.h"
#include "vtkBigusReslice.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

struct SliceOptions
{
  RenderOptions render;
  std::string output, volume, coverage, distance, standardError, standardErrorVolume, labels;
  std::string recorded;  ///< sequence or CSV: the frames that `distance` is measured to
  PlaneOptions planes;
  double elevationSigma = -1;  ///< mm; negative = the field's
  bool lit = false;            ///< black where no frame of the sequence is lit
};

/// The sequence whose planes these are, masked where none of its frames is lit.
Sweep LitSweep(const PlaneOptions& options, const SlicePlane& plane, Console& console)
{
  SequenceOptions sequence;
  sequence.path = options.poses;
  sequence.chain = options.chain;
  sequence.reduce = options.reduce;
  const std::shared_ptr<const Sweep> sweep = ReadSweep(sequence, console);
  Require(sweep->width == plane.width && sweep->height == plane.height, "--lit: slices are ", plane.width, " x ",
          plane.height, " pixels, but the images of ", options.poses, " ", sweep->width, " x ", sweep->height,
          "; their sizes must agree.");
  return sweep->LitBy(AllFrames(*sweep));
}

/// Standard deviation of the beam that the planes trained on have in the field, mm.
double TrainedSigma(vtkPolyData* field)
{
  return field->GetFieldData()->GetArray("ElevationSigma")->GetTuple1(0);
}

/// Blackens the pixels that no frame of the sweep lights.
void Blacken(vtkImageData* image, const Sweep& sweep)
{
  vtkDataArray* pixels = image->GetPointData()->GetScalars();
  for (vtkIdType pixel = 0; sweep.mask && pixel < pixels->GetNumberOfTuples(); ++pixel)
  {
    if (!sweep.IsLit(pixel))
    {
      pixels->SetTuple1(pixel, 0);
    }
  }
}

/// How far every pixel of the planes lies from the nearest frame that was recorded, mm.
vtkSmartPointer<vtkImageData> Distances(const SliceOptions& options, const Planes& planes, Console& console)
{
  SequenceOptions sequence;
  sequence.path = options.recorded;
  sequence.chain = options.planes.chain;
  const Sweep sweep = ReadPosesOnly(sequence);
  const std::vector<int> frames = AllFrames(sweep);
  for (const int frame : frames)
  {
    sweep.Plane(frame).Validate(options.recorded + ", frame " + std::to_string(frame));
  }
  const auto stack = NewStack(planes.planes, planes.timestamps, false);
  auto* pixels = static_cast<float*>(stack->GetScalarPointer());
  const int count = static_cast<int>(planes.planes.size());
  for (int k = 0; k < count; ++k)
  {
    DistanceToFrames(sweep, frames, planes.planes[k], pixels);
    pixels += planes.planes[k].NumberOfPixels();
    console.Progress("Measuring", (k + 1.0) / count);
    if (IsInterrupted())
    {
      throw Interrupted();
    }
  }
  return stack;
}

/// One slice as a volume that lies where its plane lies, as thick as a pixel is wide.
vtkSmartPointer<vtkImageData> Placed(vtkImageData* stack, const SlicePlane& plane)
{
  auto volume = vtkSmartPointer<vtkImageData>::New();
  volume->ShallowCopy(stack);
  const double width = plane.columnStep.norm(), height = plane.rowStep.norm();
  volume->SetOrigin(plane.origin.data());
  volume->SetSpacing(width, height, width);
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> direction;
  direction << plane.columnStep / width, plane.rowStep / height, plane.columnStep.cross(plane.rowStep).normalized();
  volume->SetDirectionMatrix(direction.data());
  return volume;
}

/// Throws OutputError, before anything is rendered, where something could not be written.
void RequireOutputs(const SliceOptions& options)
{
  RequireDistinct({options.render.field, options.planes.poses, options.planes.chain.config, options.recorded},
                  {options.output, options.volume, options.coverage, options.distance, options.standardError,
                   options.standardErrorVolume, options.labels});
  for (const std::string& path : {options.volume, options.standardErrorVolume})
  {
    if (!path.empty())
    {
      RequireVolumeName(path);
      RequireWritable(path);
    }
  }
  for (const std::string& path :
       {options.output, options.coverage, options.distance, options.standardError, options.labels})
  {
    if (!path.empty())
    {
      RequireStackName(path);
      RequireWritable(path);
    }
  }
  for (const std::string& path : {options.output, options.coverage, options.distance, options.standardError})
  {
    if (HasSuffix(path, ".png") && (!options.render.IsBytes() || path != options.output))
    {
      throw OutputError("Cannot write '" + path + "': PNG holds 8-bit intensities; name it .mha or .nrrd.");
    }
  }
}

/// Stacks of images, one a plane; null where they were not asked for.
struct Images
{
  vtkSmartPointer<vtkImageData> slices, coverage, distance, standardError, labels;
};

/// At most so many of the planes, evenly chosen, as grids.
std::vector<PointGrid> GridsOf(const std::vector<SlicePlane>& planes)
{
  constexpr std::size_t kMost = 64;
  std::vector<PointGrid> grids;
  for (std::size_t k = 0; k < std::min(planes.size(), kMost); ++k)
  {
    const SlicePlane& plane = planes[k * planes.size() / std::min(planes.size(), kMost)];
    Eigen::Matrix3d steps;
    steps << plane.columnStep, plane.rowStep, plane.Normal();
    grids.push_back({plane.origin, steps, {plane.width, plane.height, 1}});
  }
  return grids;
}

std::vector<float> Intensities(vtkImageData* slice)
{
  vtkDataArray* pixels = slice->GetPointData()->GetScalars();
  const double white = pixels->GetDataType() == VTK_UNSIGNED_CHAR ? 255 : 1;
  std::vector<float> intensities(pixels->GetNumberOfTuples());
  for (std::size_t p = 0; p < intensities.size(); ++p)
  {
    intensities[p] = static_cast<float>(pixels->GetTuple1(static_cast<vtkIdType>(p)) / white);
  }
  return intensities;
}

/// Renders the planes, black where `probe` is a sweep that lights nothing. `guessed` gets the numbers of those that are
/// mostly guessed, where `kept` tells. Returns seconds.
double Render(vtkBigusReslice* reslice, const Planes& planes, const Sweep& probe, const Images& images,
              const StandardError* kept, Json& guessed, Json& nearness, Console& console)
{
  const int count = static_cast<int>(planes.planes.size());
  vtkNew<vtkMatrix4x4> axes;
  reslice->SetOutputToFrame(axes, planes.planes.front().width, planes.planes.front().height);
  reslice->SetMaximumOutputPixels(VTK_ID_MAX);  // ReadPlanes has its own bound
  reslice->SetGenerateCoverageOutput(images.coverage != nullptr);
  const auto start = std::chrono::steady_clock::now();
  for (int k = 0; k < count; ++k)
  {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = planes.planes[k].ImageToReference();
    axes->DeepCopy(pose.data());
    Update(reslice, console, "Slicing", {k, count});
    if (reslice->GetViewNearness() >= 0)
    {
      nearness.push_back(reslice->GetViewNearness());
    }
    if (kept && kept->IsMostlyGuessed(planes.planes[k], Intensities(reslice->GetOutput()).data()))
    {
      guessed.push_back(planes.numbers[k]);
    }
    if (images.standardError)
    {
      SetImage(images.standardError, k, reslice->GetStandardErrorOutput());
    }
    if (images.labels)
    {
      SetImage(images.labels, k, reslice->GetLabelOutput());
    }
    Blacken(reslice->GetOutput(), probe);
    SetImage(images.slices, k, reslice->GetOutput());
    if (images.coverage)
    {
      SetImage(images.coverage, k, reslice->GetCoverageOutput());
    }
  }
  return SecondsSince(start);
}

/// Returns the names of the files that hold slices.
std::vector<std::string> WriteImages(const Images& images, const Planes& planes, const SliceOptions& options,
                                     Console& console)
{
  std::vector<std::string> files;
  if (!options.output.empty())
  {
    files = WriteStack(images.slices, options.output, planes.numbers, console);
  }
  if (!options.volume.empty())
  {
    WriteVolume(Placed(images.slices, planes.planes.front()), options.volume, options.planes.world, console);
    files.push_back(options.volume);
  }
  if (images.coverage)
  {
    WriteStack(images.coverage, options.coverage, planes.numbers, console);
  }
  if (images.distance)
  {
    WriteStack(images.distance, options.distance, planes.numbers, console);
  }
  if (!options.standardError.empty())
  {
    WriteStack(images.standardError, options.standardError, planes.numbers, console);
  }
  if (!options.standardErrorVolume.empty())
  {
    WriteVolume(Placed(images.standardError, planes.planes.front()), options.standardErrorVolume, options.planes.world,
                console);
  }
  if (images.labels)
  {
    WriteStack(images.labels, options.labels, planes.numbers, console);
  }
  return files;
}

/// Which slices are mostly guessed, in words.
std::string Guessed(const Json& numbers, std::size_t count)
{
  constexpr std::size_t kMost = 10;
  std::string list;
  for (std::size_t k = 0; k < std::min(numbers.size(), kMost); ++k)
  {
    list += (k > 0 ? ", " : "") + std::to_string(numbers[k].get<int>());
  }
  return "  mostly guessed: " +
         (count == 1 ? "this slice" : "planes " + list + (numbers.size() > kMost ? ", ..." : "")) +
         "; the frames trained on tell less of it than it shows";
}

ExitCode Slice(Console& console, SliceOptions& options)
{
  RequireOutputs(options);
  const vtkSmartPointer<vtkPolyData> field = ReadFieldData(options.render.field, console);
  NoteTrackedPlanes(field, options.planes.poses, options.planes.chain, console);
  const Planes planes = ReadPlanes(options.planes, console);
  const SlicePlane& first = planes.planes.front();
  const std::size_t count = planes.planes.size();
  for (const auto& [path, name] :
       {std::pair(options.volume, "--volume"), std::pair(options.standardErrorVolume, "--standard-error-volume")})
  {
    Require(path.empty() || count <= 1, name, " holds one slice, and ", options.planes.poses, " has ", count,
            " planes; choose one with --frames.");
  }
  const Sweep probe = options.lit ? LitSweep(options.planes, first, console) : Sweep();
  Images images;
  images.slices = NewStack(planes.planes, planes.timestamps, options.render.IsBytes());
  images.coverage = options.coverage.empty() ? nullptr : NewStack(planes.planes, planes.timestamps, false);
  images.distance = options.distance.empty() ? nullptr : Distances(options, planes, console);

  vtkNew<vtkBigusReslice> reslice;
  Configure(reslice, field, options.render);
  reslice->SetElevationSigma(options.elevationSigma);
  const std::string bytes = StandardErrorOf(field);
  if (!options.standardError.empty() || !options.standardErrorVolume.empty())
  {
    RequireStandardError(field, options.render);
    images.standardError = NewStack(planes.planes, planes.timestamps, false);
  }
  reslice->SetGenerateStandardErrorOutput(images.standardError != nullptr);
  images.labels = options.labels.empty() ? nullptr : NewStack(planes.planes, planes.timestamps, true);
  reslice->SetGenerateLabelOutput(images.labels != nullptr);
  const auto kept = bytes.empty() || options.render.IsScattering() || !options.render.label.empty()
                        ? nullptr
                        : std::make_unique<StandardError>(bytes);
  Json guessed = Json::array(), nearness = Json::array();
  const double seconds = Render(reslice, planes, probe, images, kept.get(), guessed, nearness, console);
  const std::vector<std::string> files = WriteImages(images, planes, options, console);
  const std::string trainedPoses = TrainedPoses(field);
  const bool meets = NoteMisses(field, GridsOf(planes.planes), options.planes.world, console);
  const Json answer = {{"output", files},
                       {"slices", count},
                       {"rejected", planes.rejected},
                       {"width", first.width},
                       {"height", first.height},
                       {"meets_field", meets},
                       {"elevation_sigma", options.elevationSigma >= 0 ? options.elevationSigma : TrainedSigma(field)},
                       {"trained_poses", trainedPoses.empty() ? Json() : Json(trainedPoses)},
                       {"mostly_guessed", kept ? guessed : Json()},
                       {"view_nearness", nearness.empty() ? Json() : nearness},
                       {"seconds", seconds},
                       {"device", reslice->GetDevice()}};
  console.Print(
      NameOf(files) + ": " +
      Words(std::string("{slices}") + (count == 1 ? " slice" : " slices") + " of {width} x {height} pixels, ", answer) +
      FormatNumber(1000 * seconds / static_cast<double>(count), 1) + " ms each on " + reslice->GetDevice());
  if (!guessed.empty())
  {
    console.Print(Guessed(guessed, count));
  }
  if (!nearness.empty())
  {
    const auto seen = std::count_if(nearness.begin(), nearness.end(), [](double value) { return value > 0; });
    console.Print("  " + std::to_string(seen) + " of " + std::to_string(count) +
                  " near recorded directions: there echoes depend on the direction; elsewhere each is as usual");
  }
  console.Report(answer);
  return Success;
}

}  // namespace

void AddSlice(Program& program)
{
  auto options = std::make_shared<SliceOptions>();
  CLI::App* app =
      program.app.add_subcommand("slice",
                                 "See a field at any planes\n"
                                 "  bigus slice field.vtp --poses sweep.igs.mha -o again.igs.mha\n"
                                 "  bigus slice field.vtp --poses plane.mrk.json --spacing 0.2 -o slice.png\n"
                                 "A plane that misses the field gives a black image and a warning.");
  app->add_option("-o,--output", options->output,
                  "Images to write: .mha or .nrrd (with poses), .png (numbered if many)")
      ->check(FileToWrite(".mha,.nrrd,.png"))
      ->type_name("OUT");
  app->add_option("--volume", options->volume,
                  "One slice as a volume that lies where its plane lies, for 3D Slicer and ITK: .nrrd, .mha or .vti")
      ->check(VolumeToWrite(kVolumeEndings))
      ->type_name("OUT");
  app->parse_complete_callback(
      [options]
      {
        if (options->output.empty() && options->volume.empty())
        {
          throw CLI::RequiredError("--output or --volume");
        }
      });
  AddPlaneOptions(*app, options->planes, "--poses", "--frames",
                  "Planes: those of a sequence or a CSV of poses, a markup plane or line, a linear transform", true);
  app->add_option("--elevation-sigma", options->elevationSigma,
                  "Beam thickness, standard deviation; 0 an infinitely thin plane; default: the field's")
      ->check(NumberIn(0, 100))
      ->type_name("MM");
  app->add_flag("--lit", options->lit,
                "Black where no frame of the SEQUENCE is lit, as the probe's own pictures are and held-out "
                "frames are scored; reads its images")
      ->excludes(app->get_option("--size"), app->get_option("--spacing"));
  app->add_option("--coverage", options->coverage,
                  "Also write the footprints' sum, 0 where no Gaussian is: .mha, .nrrd")
      ->check(FileToWrite(".mha,.nrrd"))
      ->type_name("OUT");
  CLI::Option* distance =
      app->add_option("--distance", options->distance,
                      "Also write how far every pixel lies from the nearest frame of --recorded, mm, which tells where "
                      "a plane runs through a gap: .mha, .nrrd")
          ->check(FileToWrite(".mha,.nrrd"))
          ->type_name("OUT");
  CLI::Option* recorded = app->add_option("--recorded", options->recorded,
                                          "The frames that the field was trained on: their poses; images are not read")
                              ->needs(distance)
                              ->check(FileToRead(kSequenceEndings))
                              ->type_name("SEQUENCE|CSV");
  distance->needs(recorded);
  app->add_option(
         "--standard-error", options->standardError,
         "Also write how far what a probe would show may be from every pixel, a standard deviation in units of "
         "intensity (1 is white), NaN where the training frames do not tell: .mha, .nrrd. The field must keep it, as 'train' "
         "lets it")
      ->check(FileToWrite(".mha,.nrrd"))
      ->type_name("OUT");
  app->add_option("--standard-error-volume", options->standardErrorVolume,
                  "The same of one slice, as --volume writes it: .nrrd, .mha or .vti")
      ->check(VolumeToWrite(kVolumeEndings))
      ->type_name("OUT");
  app->add_option(
         "--labels", options->labels,
         "Also write the value of the label that each pixel has, as 'bigus label' gave them to the field: .mha, .nrrd")
      ->check(FileToWrite(".mha,.nrrd"))
      ->type_name("OUT");
  AddRenderOptions(*app, options->render, "Pixels");
  RunWhenChosen(app, program, [options](Console& console) { return Slice(console, *options); });
}

}  // namespace bigus::command
