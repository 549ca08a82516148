// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus info: what is in a sequence or a field, and what can compute here.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "Command.h"
#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Poses/PoseDoubts.h"
#include "Core/Poses/Trajectory.h"
#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "IO/FieldFile.h"
#include "IO/Formats/VolumeGrid.h"
#include "Inputs.h"
#include "Pipeline.h"
#include "vtkBigusSequenceReader.h"
#include "vtkFieldData.h"
#include "vtkNew.h"
#include "vtkPolyData.h"
#include "vtkStringArray.h"

namespace bigus::command
{

namespace
{

struct InfoOptions
{
  SequenceOptions sequence;
  bool devices = false;
};

/// A name and its value, in columns.
std::string Line(const std::string& name, const std::string& value)
{
  return name + std::string(name.size() < 18 ? 18 - name.size() : 1, ' ') + value;
}

std::string Box(const Json& bounds)
{
  return Words("x {0:1} to {1:1}, y {2:1} to {3:1}, z {4:1} to {5:1} mm", bounds);
}

ExitCode ShowDevices(Console& console)
{
  Json engines = Json::array(), missing = Json::array();
  console.Print("Engines (--engine NAME; auto takes the fastest)");
  for (const std::string& name : Engine::Names())
  {
    std::string device;
    try
    {
      device = Engine::Create(name)->Device();
    }
    catch (const Error& error)
    {
      device = std::string("not usable: ") + error.what();
    }
    engines.push_back({{"name", name}, {"device", device}});
    console.Print("  " + Line(name, device));
  }
  for (const auto& [name, reason] : Engine::Missing())
  {
    missing.push_back({{"name", name}, {"reason", reason}});
    console.Print("  " + Line(name, "not usable: " + reason));
  }
  console.Report({{"kind", "devices"}, {"engines", engines}, {"missing", missing}});
  return Success;
}

std::size_t NegativeGaussians(const GaussianField& field)
{
  return std::count_if(field.reflectivities.begin(), field.reflectivities.end(), [](double r) { return r < 0; });
}

Json ReflectivityJson(const GaussianField& field)
{
  double low = 0, high = 0, total = 0;
  for (const double r : field.reflectivities)
  {
    low = std::min(low, r);
    high = std::max(high, r);
    total += std::abs(r);
  }
  const std::size_t n = field.Size();
  return {{"minimum", low},
          {"maximum", high},
          {"mean_magnitude", n ? total / n : 0},
          {"negative_share", n ? double(NegativeGaussians(field)) / n : 0}};
}

/// Of the middle one of each Gaussian's three standard deviations.
Json ScalePercentiles(const GaussianField& field)
{
  std::vector<double> sizes;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    std::array<double, 3> scale = {field.scales[i][0], field.scales[i][1], field.scales[i][2]};
    std::sort(scale.begin(), scale.end());
    sizes.push_back(scale[1]);
  }
  return {{"5", OrderStatistic(sizes, 0.05)}, {"50", OrderStatistic(sizes, 0.5)}, {"95", OrderStatistic(sizes, 0.95)}};
}

Json ProvenanceJson(vtkPolyData* data)
{
  Json provenance = Json::object();
  if (auto* lines = vtkStringArray::SafeDownCast(data->GetFieldData()->GetAbstractArray("Provenance")))
  {
    for (vtkIdType i = 0; i < lines->GetNumberOfValues(); ++i)
    {
      const std::string line = lines->GetValue(i);
      const std::size_t mark = line.find('=');
      provenance[line.substr(0, mark)] = mark == std::string::npos ? "" : line.substr(mark + 1);
    }
  }
  return provenance;
}

ExitCode ShowField(Console& console, const std::string& path)
{
  const vtkSmartPointer<vtkPolyData> data = ReadFieldData(path, console);
  const GaussianField field = FieldFromPolyData(data);
  const std::optional<ViewDependence> view = ViewFromPolyData(data);
  const std::size_t n = field.Size();
  std::array<double, 6> bounds = {};
  if (n > 0)
  {
    data->GetBounds(bounds.data());
  }
  Json labels = Json::array();
  std::string names;
  for (const Label& label : LabelNamesOf(data))
  {
    labels.push_back({{"value", label.value}, {"name", label.name}});
    names += (names.empty() ? "" : ", ") + label.name + " (" + std::to_string(label.value) + ")";
  }
  const Json answer = {{"kind", "field"},
                       {"gaussians", n},
                       {"bounds", bounds},
                       {"scale_percentiles", ScalePercentiles(field)},
                       {"reflectivity", ReflectivityJson(field)},
                       {"gamma", field.transfer.gamma},
                       {"elevation_sigma", field.beam.elevationSigma},
                       {"standard_error_bytes", StandardErrorOf(data).size()},
                       {"view_poses", view ? Json(view->views.poses.size()) : Json()},
                       {"labels", labels},
                       {"provenance", ProvenanceJson(data)}};

  console.Print(Line("Field", path));
  console.Print(Line("Gaussians", "{gaussians}"), answer);
  console.Print(Line("Centres", n ? Box(answer["bounds"]) : "-"));
  console.Print(Line("Scale", "{50:3} mm (5 to 95 %: {5:3} to {95:3}; the middle of three axes)"),
                answer["scale_percentiles"]);
  console.Print(Line("Reflectivity", Words("{minimum:3} to {maximum:3}, ", answer["reflectivity"]) +
                                         FormatNumber(n ? 100.0 * NegativeGaussians(field) / n : 0, 1) +
                                         " % negative"));
  console.Print(Line("Gamma", "{gamma:4}"), answer);
  console.Print(Line("Beam thickness", "{elevation_sigma:3} mm (standard deviation)"), answer);
  console.Print(Line("Standard error", StandardErrorOf(data).empty() ? "not kept" : "kept"));
  if (view)
  {
    console.Print(Line("Directions", "echoes depend on the direction, near {view_poses} recorded frames"), answer);
  }
  if (!names.empty())
  {
    console.Print(Line("Labels", names));
  }
  std::string name = "Made by";
  for (const auto& [key, value] : answer["provenance"].items())
  {
    console.Print(Line(name, key + " = " + value.get<std::string>()));
    name = "";
  }
  console.Report(answer);
  return Success;
}

/// What the poses alone tell of the tracker: one line and one JSON value each.
Json ShowTracker(Console& console, const Sweep& sweep)
{
  constexpr std::size_t kMostListed = 12;  // outliers named to people; --json has all
  const Trajectory path = SmoothTrajectory(sweep);
  Json outliers = Json::array();
  std::string listed;
  for (std::size_t k = 0; k < path.isOutlier.size(); ++k)
  {
    if (path.isOutlier[k])
    {
      listed += outliers.size() > kMostListed    ? ""
                : outliers.size() == kMostListed ? ", ..."
                                                 : (listed.empty() ? "frame " : ", ") + std::to_string(k);
      outliers.push_back(k);
    }
  }
  console.Print(Line("Noise by the path", path.isStepped
                                              ? "none: motion in equal steps"
                                              : NoiseText(path.translationNoise, path.rotationNoise, path.cornerNoise) +
                                                    "; 'bigus poses' asks the pictures, too"));
  if (!outliers.empty())
  {
    console.Print(Line("Outliers", std::to_string(outliers.size()) + ": " + listed));
  }
  return {{"translation_noise", path.translationNoise},
          {"rotation_noise", path.rotationNoise},
          {"corner_noise", path.cornerNoise},
          {"outliers", outliers},
          {"stepped", path.isStepped}};
}

/// What is doubtful about poses.
Json ShowDoubts(Console& console, const Sweep& sweep, vtkBigusSequenceReader* reader)
{
  std::vector<std::string> doubts = DoubtsAboutPoses(sweep, AllFrames(sweep));
  if (const std::optional<std::string> doubt = DoubtAboutTimes(sweep.timestamps))
  {
    doubts.push_back(*doubt);
  }
  if (const int made = reader->GetNumberOfMadeAxes(); made > 0)
  {
    doubts.push_back("The matrices of " + std::to_string(made) + (made == 1 ? " frame" : " frames") +
                     " have a third column that is zero, or mirror: the third was made from the first two.");
  }
  if (const std::string cropped = reader->GetCroppedFrame(); !cropped.empty())
  {
    doubts.push_back("The transforms name " + cropped + ": where the images are the cropped ones, give --image-from " +
                     cropped + ".");
  }
  if (const std::string spacing = reader->GetSpacingDoubt(); !spacing.empty())
  {
    doubts.push_back(WithRemedy(spacing) + ".");
  }
  for (const std::string& doubt : doubts)
  {
    console.Print(Line("Doubtful", doubt));
  }
  return doubts;
}

/// What the header says besides, names of people among it: nothing of it gets into what is written.
Json ShowUnusedFields(Console& console, vtkBigusSequenceReader* reader)
{
  constexpr int kMostListed = 24;  // to people; --json has all
  Json fields = Json::array();
  for (int i = 0; i < reader->GetNumberOfUnusedFields(); ++i)
  {
    const std::string name = reader->GetUnusedFieldName(i), value = reader->GetUnusedFieldValue(i);
    const int count = reader->GetUnusedFieldCount(i);
    fields.push_back({{"name", name}, {"value", value}, {"count", count}});
    if (i < kMostListed)
    {
      console.Print(Line(i ? "" : "Not taken along",
                         name + " = " + value + (count > 1 ? " (and " + std::to_string(count - 1) + " more)" : "")));
    }
  }
  if (reader->GetNumberOfUnusedFields() > kMostListed)
  {
    console.Print(Line("", "and " + std::to_string(reader->GetNumberOfUnusedFields() - kMostListed) + " other fields"));
  }
  return fields;
}

void PrintFormat(vtkBigusSequenceReader* reader, Console& console)
{
  console.Print(Line(
      "Format", std::string(reader->GetFormat()) + ", " + reader->GetEncoding() + ", " + reader->GetElementType()));
}

/// Where a volume lies by its header, null where that does not say so: a picture, for one.
Json ShowPlace(Console& console, const std::string& path)
{
  try
  {
    const VolumeGrid grid = ReadVolumeGrid(path, true);
    Eigen::AlignedBox3d box;
    for (int corner = 0; corner < 8; ++corner)
    {
      const Eigen::Vector3d index(corner & 1 ? grid.size[0] - 1 : 0, corner & 2 ? grid.size[1] - 1 : 0,
                                  corner & 4 ? grid.size[2] - 1 : 0);
      box.extend(grid.origin + grid.steps * index);
    }
    const Json place = {
        {"world", "lps"},
        {"spacing", {grid.steps.col(0).norm(), grid.steps.col(1).norm(), grid.steps.col(2).norm()}},
        {"bounds", {box.min()[0], box.max()[0], box.min()[1], box.max()[1], box.min()[2], box.max()[2]}}};
    console.Print(Line("As a volume", "voxels of {spacing/0:3} x {spacing/1:3} x {spacing/2:3} mm"), place);
    console.Print(Line("Extent", Box(place["bounds"]) + ", patient system LPS"));
    return place;
  }
  catch (const Error&)
  {
    return nullptr;
  }
}

/// A volume, or pictures without any transform.
ExitCode ShowImages(Console& console, const std::string& path, vtkBigusSequenceReader* reader)
{
  int size[2];
  reader->GetFrameSize(size);
  const int count = reader->GetNumberOfFramesInFile();
  Json answer = {{"kind", "images"}, {"images", count}, {"width", size[0]}, {"height", size[1]}};
  console.Print(Line("Images", path));
  PrintFormat(reader, console);
  console.Print(
      Line("Size", std::string("{images}") + (count == 1 ? " image" : " images") + " of {width} x {height} pixels"),
      answer);
  answer["place"] = ShowPlace(console, path);
  console.Print(Line("Poses",
                     "none: a volume, or a sequence without transforms. 'bigus metrics' compares it; to train on "
                     "it give a Plus configuration or poses in a CSV"));
  answer["not_taken_along"] = ShowUnusedFields(console, reader);
  console.Report(answer);
  return Success;
}

/// Reads all but pixels. Returns the fault that leaves no frame usable, which is a part of the report; throws Error for a
/// file that is neither a sequence nor a volume or a picture.
std::string ReadHeader(vtkBigusSequenceReader* reader)
{
  try
  {
    UpdateInformation(reader);
    return "";
  }
  catch (const Error& error)
  {
    const std::string fault = error.what();
    if (reader->GetNumberOfFramesInFile() == 0)
    {
      // A volume or a picture, which have no poses and are no fault?
      reader->RequirePosesOff();
      try
      {
        UpdateInformation(reader);
      }
      catch (const Error&)
      {
        throw Error(fault);
      }
    }
    return fault;
  }
}

/// What the file says of its frames, transforms and poses.
Json HeaderJson(vtkBigusSequenceReader* reader)
{
  int size[2];
  std::array<double, 2> pixel{};
  std::array<double, 3> spacing{};
  std::array<double, 6> bounds{};
  reader->GetFrameSize(size);
  reader->GetPixelSize(pixel.data());
  reader->GetPlaneSpacing(spacing.data());
  reader->GetBounds(bounds.data());
  Json transforms = Json::array(), rejected = Json::array();
  for (int i = 0; i < reader->GetNumberOfTransforms(); ++i)
  {
    transforms.push_back({{"name", reader->GetTransformName(i)}, {"source", reader->GetTransformSource(i)}});
  }
  for (int i = 0; i < reader->GetNumberOfRejectionReasons(); ++i)
  {
    rejected.push_back({{"reason", reader->GetRejectionReason(i)}, {"frames", reader->GetRejectionCount(i)}});
  }
  return {{"kind", "sequence"},
          {"format", reader->GetFormat()},
          {"encoding", reader->GetEncoding()},
          {"element_type", reader->GetElementType()},
          {"orientation", reader->GetOrientation()},
          {"frames_in_file", reader->GetNumberOfFramesInFile()},
          {"frames", reader->GetNumberOfAcceptedFrames()},
          {"width", size[0]},
          {"height", size[1]},
          {"transforms", transforms},
          {"chain", reader->GetTransformChain() ? reader->GetTransformChain() : ""},
          {"pixel_size", pixel},
          {"plane_spacing", {{"minimum", spacing[0]}, {"median", spacing[1]}, {"maximum", spacing[2]}}},
          {"path_length", reader->GetPathLength()},
          {"bounds", bounds},
          {"duration", reader->GetHasTimestamps() ? Json(reader->GetDuration()) : Json(nullptr)},
          {"rejected", rejected}};
}

void PrintHeader(const Json& answer, const SequenceOptions& options, vtkBigusSequenceReader* reader, Console& console)
{
  const std::string chain = answer["chain"];
  console.Print(Line("Sequence", options.path));
  PrintFormat(reader, console);
  console.Print(Line("Frames", std::string("{frames_in_file} of {width} x {height} pixels, ") +
                                   (chain.empty() ? "poses unknown" : "{frames} usable")),
                answer);
  console.Print(Line("Orientation", "{orientation}"), answer);
  std::string name = "Transforms";
  for (const Json& transform : answer["transforms"])
  {
    console.Print(Line(name, "{name} ({source})"), transform);
    name = "";
  }
  console.Print(Line("Chain used", chain.empty() ? "none: the transforms do not lead from " + options.chain.from +
                                                       " to " + options.chain.to
                                                 : chain));
  if (answer["frames"] > 0)
  {
    console.Print(Line("Pixel", "{pixel_size/0:4} x {pixel_size/1:4} mm"), answer);
    console.Print(Line("Plane spacing",
                       "{plane_spacing/median:3} mm ({plane_spacing/minimum:3} to {plane_spacing/maximum:3}), path "
                       "{path_length:1} mm"),
                  answer);
    console.Print(Line("Extent", Box(answer["bounds"])));
    if (!answer["duration"].is_null())
    {
      console.Print(Line("Duration", "{duration:2} s"), answer);
    }
  }
  if (reader->GetNumberOfRejectedFrames() > 0)
  {
    console.Print(Line("Rejected", reader->GetRejectionSummary()));
  }
}

ExitCode ShowSequence(Console& console, const SequenceOptions& options)
{
  const auto reader = NewSequenceReader(options);
  std::string fault = ReadHeader(reader);
  if (reader->GetNumberOfFramesInFile() > 0 && reader->GetNumberOfTransforms() == 0)
  {
    // Poses were asked for: a configuration that gives none, or cannot be read, is the fault.
    Require(fault.empty() || options.chain.config.empty(), fault);
    return ShowImages(console, options.path, reader);
  }
  Json answer = HeaderJson(reader);
  PrintHeader(answer, options, reader, console);
  answer["not_taken_along"] = ShowUnusedFields(console, reader);
  const Sweep poses = answer["frames"] > 0 ? ReadPosesOnly(options) : Sweep();
  answer["tracker"] = ShowTracker(console, poses);
  answer["doubts"] = ShowDoubts(console, poses, reader);
  if (!fault.empty())
  {
    fault = WithRemedy(fault);
    answer["error"] = fault;
    console.Note("bigus: " + fault);
  }
  console.Report(answer);
  return fault.empty() ? Success : InputFault;
}

ExitCode Show(Console& console, const InfoOptions& options)
{
  const std::string& path = options.sequence.path;
  if (options.devices)
  {
    return ShowDevices(console);
  }
  RequireFile(path);
  return IsPolyData(path) ? ShowField(console, path) : ShowSequence(console, options.sequence);
}

}  // namespace

void AddInfo(Program& program)
{
  auto options = std::make_shared<InfoOptions>();
  CLI::App* app = program.app.add_subcommand("info",
                                             "Say what is in a sequence or a field\n"
                                             "  bigus info sweep.igs.mha\n"
                                             "  bigus info plus.mha --config Plus.xml\n"
                                             "  bigus info field.vtp --json\n"
                                             "  bigus info --devices                   what can compute here");
  AddSequenceOptions(*app, options->sequence, "FILE", "Sequence (.mha .mhd .nrrd .csv) or field (.vtp .pvtp .ply)");
  CLI::Option* file = app->get_option("FILE")->required(false);
  app->add_flag("--devices", options->devices, "List engines, and why others cannot be used")->excludes(file);

  Console& console = program.console;
  app->callback(
      [&program, &console, options]
      {
        if (options->sequence.path.empty() && !options->devices)
        {
          throw CLI::RequiredError("FILE or --devices");
        }
        program.job = [&console, options] { return Show(console, *options); };
      });
}

}  // namespace bigus::command
