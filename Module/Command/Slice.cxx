// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus slice: the field seen at any planes.
#include <algorithm>
#include <memory>
#include <numeric>

#include "Command.h"
#include "Core/Model/FrameDistance.h"
#include "Data/Provenance.h"
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

struct Options
{
  RenderOptions render;
  std::string output, volume, coverage, distance;
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
  if (sweep->width != plane.width || sweep->height != plane.height)
  {
    throw Error("--lit: slices are " + std::to_string(plane.width) + " x " + std::to_string(plane.height) +
                " pixels, but the images of " + options.poses + " " + std::to_string(sweep->width) + " x " +
                std::to_string(sweep->height) + "; their sizes must agree.");
  }
  std::vector<int> all(sweep->NumberOfFrames());
  std::iota(all.begin(), all.end(), 0);
  return sweep->LitBy(all);
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
vtkSmartPointer<vtkImageData> Distances(const Options& options, const Planes& planes, Console& console)
{
  SequenceOptions sequence;
  sequence.path = options.recorded;
  sequence.chain = options.planes.chain;
  const Sweep sweep = ReadPosesOnly(sequence, console);
  std::vector<int> frames(sweep.NumberOfFrames());
  std::iota(frames.begin(), frames.end(), 0);
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

ExitCode Slice(Console& console, Options& options)
{
  const bool bytes = options.render.IsBytes();
  RequireDistinct({options.render.field, options.planes.poses, options.planes.chain.config, options.recorded},
                  {options.output, options.volume, options.coverage, options.distance});
  if (!options.volume.empty())
  {
    RequireVolumeName(options.volume);
    RequireWritable(options.volume);
  }
  for (const std::string& path : {options.output, options.coverage, options.distance})
  {
    if (!path.empty())
    {
      RequireStackName(path);
      RequireWritable(path);
    }
  }
  for (const std::string& path : {options.output, options.coverage, options.distance})
  {
    if (HasSuffix(path, ".png") && (!bytes || path != options.output))
    {
      throw OutputError("Cannot write '" + path + "': PNG holds 8-bit intensities; name it .mha or .nrrd.");
    }
  }

  const vtkSmartPointer<vtkPolyData> field = ReadFieldData(options.render.field, console);
  NoteTrackedPlanes(field, options.planes.poses, options.planes.chain, console);
  const Planes planes = ReadPlanes(options.planes, console);
  const SlicePlane& first = planes.planes.front();
  const int count = static_cast<int>(planes.planes.size());
  if (!options.volume.empty() && count > 1)
  {
    throw Error("--volume holds one slice, and " + options.planes.poses + " has " + std::to_string(count) +
                " planes; choose one with --frames.");
  }
  const Sweep probe = options.lit ? LitSweep(options.planes, first, console) : Sweep();
  const auto stack = NewStack(planes.planes, planes.timestamps, bytes);
  const auto coverage = options.coverage.empty() ? nullptr : NewStack(planes.planes, planes.timestamps, false);
  const auto distance = options.distance.empty() ? nullptr : Distances(options, planes, console);

  vtkNew<vtkMatrix4x4> axes;
  vtkNew<vtkBigusReslice> reslice;
  Configure(reslice, field, options.render);
  reslice->SetElevationSigma(options.elevationSigma);
  reslice->SetOutputToFrame(axes, first.width, first.height);
  reslice->SetMaximumOutputPixels(VTK_ID_MAX);  // ReadPlanes has its own bound
  reslice->SetGenerateCoverageOutput(coverage != nullptr);
  const auto start = std::chrono::steady_clock::now();
  for (int k = 0; k < count; ++k)
  {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = planes.planes[k].ImageToReference();
    axes->DeepCopy(pose.data());
    Update(reslice, console, "Slicing", {k, count});
    Blacken(reslice->GetOutput(), probe);
    SetImage(stack, k, reslice->GetOutput());
    if (coverage)
    {
      SetImage(coverage, k, reslice->GetCoverageOutput());
    }
  }
  const double seconds = SecondsSince(start);

  std::vector<std::string> files;
  if (!options.output.empty())
  {
    files = WriteStack(stack, options.output, planes.numbers, console);
  }
  if (!options.volume.empty())
  {
    WriteVolume(Placed(stack, first), options.volume, options.planes.world, console);
    files.push_back(options.volume);
  }
  if (coverage)
  {
    WriteStack(coverage, options.coverage, planes.numbers, console);
  }
  if (distance)
  {
    WriteStack(distance, options.distance, planes.numbers, console);
  }
  const double sigma = options.elevationSigma >= 0 ? options.elevationSigma : TrainedSigma(field);
  console.Print(NameOf(files) + ": " + std::to_string(count) + (count == 1 ? " slice of " : " slices of ") +
                std::to_string(first.width) + " x " + std::to_string(first.height) + " pixels, " +
                FormatNumber(1000 * seconds / count, 1) + " ms each on " + reslice->GetDevice());
  console.Report({{"output", files},
                  {"slices", count},
                  {"rejected", planes.rejected},
                  {"width", first.width},
                  {"height", first.height},
                  {"elevation_sigma", sigma},
                  {"trained_poses", TrainedPoses(field).empty() ? Json() : Json(TrainedPoses(field))},
                  {"seconds", seconds},
                  {"device", reslice->GetDevice()}});
  return Success;
}

}  // namespace

void AddSlice(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app =
      program.app.add_subcommand("slice",
                                 "See a field at any planes\n"
                                 "  bigus slice field.vtp --poses sweep.igs.mha -o again.igs.mha\n"
                                 "  bigus slice field.vtp --poses plane.mrk.json --spacing 0.2 -o slice.png\n"
                                 "A plane that misses the field gives a black image.");
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
  AddRenderOptions(*app, options->render, "Pixels");
  RunWhenChosen(app, program, [options](Console& console) { return Slice(console, *options); });
}

}  // namespace bigus::command
