// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus info: what is in a sequence or a field, and what can compute here.
#include <algorithm>
#include <memory>

#include "Command.h"
#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"
#include "Core/Poses/PoseDoubts.h"
#include "Core/Poses/Trajectory.h"
#include "Data/FieldData.h"
#include "Inputs.h"
#include "Pipeline.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusSequenceReader.h"
#include "vtkFieldData.h"
#include "vtkNew.h"
#include "vtkPolyData.h"
#include "vtkStringArray.h"

namespace bigus::command
{

namespace
{

struct Options
{
  SequenceOptions sequence;
  bool devices = false;
};

/// A name and its value, in columns.
std::string Line(const std::string& name, const std::string& value)
{
  return name + std::string(name.size() < 18 ? 18 - name.size() : 1, ' ') + value;
}

std::string Box(const double* bounds)
{
  std::string text;
  for (int axis = 0; axis < 3; ++axis)
  {
    text += std::string(axis ? ", " : "") + "xyz"[axis] + " " + FormatNumber(bounds[2 * axis], 1) + " to " +
            FormatNumber(bounds[2 * axis + 1], 1);
  }
  return text + " mm";
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

ExitCode ShowField(Console& console, const std::string& path)
{
  const vtkSmartPointer<vtkPolyData> data = ReadFieldData(path, console);
  const GaussianField field = FieldFromPolyData(data);
  const std::size_t n = field.Size();

  double bounds[6] = {};
  if (n > 0)
  {
    data->GetBounds(bounds);
  }
  std::vector<double> sizes;  // the middle one of each Gaussian's three standard deviations
  std::size_t negative = 0;
  double low = 0, high = 0, total = 0;
  for (std::size_t i = 0; i < n; ++i)
  {
    std::array<double, 3> scale = {field.scales[i][0], field.scales[i][1], field.scales[i][2]};
    std::sort(scale.begin(), scale.end());
    sizes.push_back(scale[1]);
    const double r = field.reflectivities[i];
    low = std::min(low, r);
    high = std::max(high, r);
    negative += r < 0;
    total += std::abs(r);
  }
  const auto percentile = [&sizes](double share)
  {
    if (sizes.empty())
    {
      return 0.0;
    }
    const auto at = sizes.begin() + static_cast<std::ptrdiff_t>(share * (sizes.size() - 1));
    std::nth_element(sizes.begin(), at, sizes.end());
    return *at;
  };
  const double small = percentile(0.05), middle = percentile(0.5), large = percentile(0.95);

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

  console.Print(Line("Field", path));
  console.Print(Line("Gaussians", std::to_string(n)));
  console.Print(Line("Centres", n ? Box(bounds) : "-"));
  console.Print(Line("Scale", FormatNumber(middle, 3) + " mm (5 to 95 %: " + FormatNumber(small, 3) + " to " +
                                  FormatNumber(large, 3) + "; the middle of three axes)"));
  console.Print(Line("Reflectivity", FormatNumber(low, 3) + " to " + FormatNumber(high, 3) + ", " +
                                         FormatNumber(n ? 100.0 * negative / n : 0, 1) + " % negative"));
  console.Print(Line("Gamma", FormatNumber(field.transfer.gamma, 4)));
  console.Print(Line("Beam thickness", FormatNumber(field.beam.elevationSigma, 3) + " mm (standard deviation)"));
  for (const auto& [key, value] : provenance.items())
  {
    console.Print(Line(key == provenance.begin().key() ? "Made by" : "", key + " = " + value.get<std::string>()));
  }
  console.Report({{"kind", "field"},
                  {"gaussians", n},
                  {"bounds", {bounds[0], bounds[1], bounds[2], bounds[3], bounds[4], bounds[5]}},
                  {"scale_percentiles", {{"5", small}, {"50", middle}, {"95", large}}},
                  {"reflectivity",
                   {{"minimum", low},
                    {"maximum", high},
                    {"mean_magnitude", n ? total / n : 0},
                    {"negative_share", n ? double(negative) / n : 0}}},
                  {"gamma", field.transfer.gamma},
                  {"elevation_sigma", field.beam.elevationSigma},
                  {"provenance", provenance}});
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
  console.Print(Line("Tracker's noise", path.isStepped
                                            ? "none: motion in equal steps"
                                            : NoiseText(path.translationNoise, path.rotationNoise, path.cornerNoise)));
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

/// What is doubtful about poses, those that were rejected among them.
Json ShowDoubts(Console& console, const Sweep& sweep, vtkBigusSequenceReader* reader)
{
  std::vector<std::string> doubts = DoubtsAboutPoses(sweep);
  for (int i = 0; i < reader->GetNumberOfRejectionReasons(); ++i)
  {
    if (std::string(reader->GetRejectionReason(i)).find("reflected") != std::string::npos)
    {
      const int count = reader->GetRejectionCount(i);
      doubts.push_back("The matrices of " + std::to_string(count) + (count == 1 ? " frame" : " frames") +
                       " mirror the image: an axis is reversed, and the frames are not used.");
    }
  }
  if (const std::string cropped = reader->GetCroppedFrame(); !cropped.empty())
  {
    doubts.push_back("The transforms name " + cropped + ": where the images are the cropped ones, give --image-from " +
                     cropped + ".");
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

/// A volume, or pictures without any transform.
ExitCode ShowImages(Console& console, const std::string& path, vtkBigusSequenceReader* reader)
{
  int size[2];
  reader->GetFrameSize(size);
  const int count = reader->GetNumberOfFramesInFile();
  console.Print(Line("Images", path));
  console.Print(Line(
      "Format", std::string(reader->GetFormat()) + ", " + reader->GetEncoding() + ", " + reader->GetElementType()));
  console.Print(Line("Size", std::to_string(count) + (count == 1 ? " image" : " images") + " of " +
                                 std::to_string(size[0]) + " x " + std::to_string(size[1]) + " pixels"));
  console.Print(Line("Poses",
                     "none: a volume, or a sequence without transforms. 'bigus metrics' compares it; to train on "
                     "it give a Plus configuration or poses in a CSV"));
  const Json unused = ShowUnusedFields(console, reader);
  console.Report(
      {{"kind", "images"}, {"images", count}, {"width", size[0]}, {"height", size[1]}, {"not_taken_along", unused}});
  return Success;
}

ExitCode ShowSequence(Console& console, const SequenceOptions& options)
{
  const auto reader = NewSequenceReader(options);
  std::string fault;  // when no frame is usable the report says why
  try
  {
    UpdateInformation(reader);
  }
  catch (const Error& error)
  {
    fault = error.what();
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
  }
  if (reader->GetNumberOfFramesInFile() > 0 && reader->GetNumberOfTransforms() == 0)
  {
    return ShowImages(console, options.path, reader);
  }

  const int inFile = reader->GetNumberOfFramesInFile(), accepted = reader->GetNumberOfAcceptedFrames();
  int size[2];
  double pixel[2], spacing[3], bounds[6];
  reader->GetFrameSize(size);
  reader->GetPixelSize(pixel);
  reader->GetPlaneSpacing(spacing);
  reader->GetBounds(bounds);

  Json transforms = Json::array(), rejected = Json::array();
  console.Print(Line("Sequence", options.path));
  console.Print(Line(
      "Format", std::string(reader->GetFormat()) + ", " + reader->GetEncoding() + ", " + reader->GetElementType()));
  const std::string chain = reader->GetTransformChain() ? reader->GetTransformChain() : "";
  console.Print(Line("Frames", std::to_string(inFile) + " of " + std::to_string(size[0]) + " x " +
                                   std::to_string(size[1]) + " pixels, " +
                                   (chain.empty() ? "poses unknown" : std::to_string(accepted) + " usable")));
  console.Print(Line("Orientation", reader->GetOrientation()));
  for (int i = 0; i < reader->GetNumberOfTransforms(); ++i)
  {
    transforms.push_back({{"name", reader->GetTransformName(i)}, {"source", reader->GetTransformSource(i)}});
    console.Print(Line(i ? "" : "Transforms",
                       std::string(reader->GetTransformName(i)) + " (" + reader->GetTransformSource(i) + ")"));
  }
  console.Print(Line("Chain used", chain.empty() ? "none: the transforms do not lead from " + options.chain.from +
                                                       " to " + options.chain.to
                                                 : chain));
  if (accepted > 0)
  {
    console.Print(Line("Pixel", FormatNumber(pixel[0], 4) + " x " + FormatNumber(pixel[1], 4) + " mm"));
    console.Print(Line("Plane spacing", FormatNumber(spacing[1], 3) + " mm (" + FormatNumber(spacing[0], 3) + " to " +
                                            FormatNumber(spacing[2], 3) + "), path " +
                                            FormatNumber(reader->GetPathLength(), 1) + " mm"));
    console.Print(Line("Extent", Box(bounds)));
    if (reader->GetHasTimestamps())
    {
      console.Print(Line("Duration", FormatNumber(reader->GetDuration(), 2) + " s"));
    }
  }
  for (int i = 0; i < reader->GetNumberOfRejectionReasons(); ++i)
  {
    rejected.push_back({{"reason", reader->GetRejectionReason(i)}, {"frames", reader->GetRejectionCount(i)}});
  }
  if (reader->GetNumberOfRejectedFrames() > 0)
  {
    console.Print(Line("Rejected", reader->GetRejectionSummary()));
  }

  const Json unused = ShowUnusedFields(console, reader);
  const Sweep poses = accepted > 0 ? ReadPosesOnly(options, console) : Sweep();
  const Json tracker = ShowTracker(console, poses), doubts = ShowDoubts(console, poses, reader);

  Json answer = {{"kind", "sequence"},
                 {"format", reader->GetFormat()},
                 {"encoding", reader->GetEncoding()},
                 {"element_type", reader->GetElementType()},
                 {"orientation", reader->GetOrientation()},
                 {"frames_in_file", inFile},
                 {"frames", accepted},
                 {"width", size[0]},
                 {"height", size[1]},
                 {"transforms", transforms},
                 {"chain", chain},
                 {"pixel_size", {pixel[0], pixel[1]}},
                 {"plane_spacing", {{"minimum", spacing[0]}, {"median", spacing[1]}, {"maximum", spacing[2]}}},
                 {"path_length", reader->GetPathLength()},
                 {"bounds", {bounds[0], bounds[1], bounds[2], bounds[3], bounds[4], bounds[5]}},
                 {"duration", reader->GetHasTimestamps() ? Json(reader->GetDuration()) : Json(nullptr)},
                 {"rejected", rejected},
                 {"not_taken_along", unused},
                 {"tracker", tracker},
                 {"doubts", doubts}};
  if (!fault.empty())
  {
    fault = WithRemedy(fault);
    answer["error"] = fault;
    console.Note("bigus: " + fault);
  }
  console.Report(answer);
  return fault.empty() ? Success : InputFault;
}

ExitCode Show(Console& console, const Options& options)
{
  const std::string& path = options.sequence.path;
  if (options.devices)
  {
    return ShowDevices(console);
  }
  RequireFile(path);
  vtkNew<vtkBigusFieldReader> fieldReader;
  return fieldReader->CanReadFile(path.c_str()) ? ShowField(console, path) : ShowSequence(console, options.sequence);
}

}  // namespace

void AddInfo(Program& program)
{
  auto options = std::make_shared<Options>();
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
