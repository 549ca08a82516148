// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus phantom: a made-up tracked sweep, and the exact truth at any other plane.
#include <algorithm>
#include <cctype>
#include <map>
#include <memory>
#include <numeric>
#include <type_traits>

#include "Command.h"
#include "Core/Phantom/PhantomOptionList.h"
#include "Core/Training/OptionList.h"
#include "Files.h"
#include "Inputs.h"
#include "Outputs.h"
#include "Pipeline.h"
#include "vtkBigusPhantomSource.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"

namespace bigus::command
{

namespace
{

struct PhantomArguments
{
  PhantomOptions phantom;
  std::string output;
  PlaneOptions truth;  ///< with poses: image these planes instead of making a sweep
  bool truePoses = false;
  std::string truePosesFile;  ///< CSV
  std::string labels;         ///< what a person would draw on the frames
};

using Compute = bool (vtkBigusPhantomSource::*)(vtkMatrix4x4*, int, int, vtkImageData*);

/// What `compute` says of planes.
vtkSmartPointer<vtkImageData> MakeTruth(vtkBigusPhantomSource* source, Compute compute,
                                        const std::vector<SlicePlane>& planes, const std::vector<double>& timestamps,
                                        Console& console)
{
  const auto stack = NewStack(planes, timestamps, true);
  const int count = static_cast<int>(planes.size());
  vtkNew<vtkMatrix4x4> pose;
  vtkNew<vtkImageData> truth;
  for (int k = 0; k < count; ++k)
  {
    const SlicePlane& plane = planes[k];
    pose->DeepCopy(Eigen::Matrix<double, 4, 4, Eigen::RowMajor>(plane.ImageToReference()).data());
    RequireDone((source->*compute)(pose, plane.width, plane.height, truth));
    SetImage(stack, k, truth);
    console.Progress("Imaging", (k + 1.0) / count);
    if (IsInterrupted())
    {
      throw Interrupted();
    }
  }
  return stack;
}

/// The sweep, with the poses that the tracker recorded or with the true ones.
vtkSmartPointer<vtkImageData> MakeSweep(vtkBigusPhantomSource* source, bool truePoses, const std::string& truePosesFile,
                                        std::vector<SlicePlane>& truePlanes, Console& console)
{
  Update(source, console, "Imaging");
  vtkImageData* sweep = source->GetOutput();
  vtkDataArray* const poses = sweep->GetFieldData()->GetArray("TrueImageToReference");
  for (vtkIdType k = 0; k < poses->GetNumberOfTuples(); ++k)
  {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose;
    poses->GetTuple(k, pose.data());
    truePlanes.push_back(SlicePlane::FromImageToReference(pose, sweep->GetDimensions()[0], sweep->GetDimensions()[1]));
  }
  if (!truePosesFile.empty())
  {
    const int* size = sweep->GetDimensions();
    WritePosesCsv(sweep->GetFieldData()->GetArray("TrueImageToReference"), size[0], size[1], truePosesFile, {});
  }
  vtkFieldData* arrays = sweep->GetFieldData();
  const vtkSmartPointer<vtkAbstractArray> truth = arrays->GetAbstractArray("TrueImageToReference");
  arrays->RemoveArray("TrueImageToReference");
  if (truePoses)
  {
    truth->SetName("ImageToReference");
    arrays->AddArray(truth);  // in place of the array that has this name
  }
  return sweep;
}

ExitCode MakePhantom(Console& console, const PhantomArguments& options)
{
  RequireDistinct({options.truth.poses, options.truth.chain.config},
                  {options.output, options.truePosesFile, options.labels});
  RequireWritable(options.output);
  if (!options.labels.empty())
  {
    RequireStackName(options.labels);
    RequireWritable(options.labels);
  }
  if (!options.truePosesFile.empty())
  {
    RequireWritable(options.truePosesFile);
  }
  RequireStackName(options.output);
  const auto start = std::chrono::steady_clock::now();
  vtkNew<vtkBigusPhantomSource> source;
  source->SetOptions(options.phantom);
  vtkSmartPointer<vtkImageData> stack;
  std::vector<int> numbers;  // of PNG files
  std::vector<SlicePlane> truePlanes;
  if (!options.truth.poses.empty())
  {
    const Planes planes = ReadPlanes(options.truth, console);
    stack = MakeTruth(source, &vtkBigusPhantomSource::ComputeTruth, planes.planes, planes.timestamps, console);
    truePlanes = planes.planes;
    numbers = planes.numbers;
  }
  else
  {
    stack = MakeSweep(source, options.truePoses, options.truePosesFile, truePlanes, console);
    numbers.resize(stack->GetDimensions()[2]);
    std::iota(numbers.begin(), numbers.end(), 0);
  }
  const double seconds = SecondsSince(start);
  const std::vector<std::string> files = WriteStack(stack, options.output, numbers, console);
  if (!options.labels.empty())
  {
    WriteStack(MakeTruth(source, &vtkBigusPhantomSource::ComputeLabels, truePlanes, {}, console), options.labels,
               numbers, console);
  }

  const int* size = stack->GetDimensions();
  const Json answer = {{"output", files},
                       {"true_poses", options.truePosesFile.empty() ? Json() : Json(options.truePosesFile)},
                       {"labels", options.labels.empty() ? Json() : Json(options.labels)},
                       {"frames", size[2]},
                       {"width", size[0]},
                       {"height", size[1]},
                       {"elevation_sigma", options.phantom.elevationSigma},
                       {"scatterers_per_resolution_cell", source->GetScatterersPerResolutionCell()},
                       {"seed", options.phantom.seed},
                       {"seconds", seconds}};
  console.Print(NameOf(files) + ": " +
                Words(std::string("{frames}") + (size[2] == 1 ? " frame" : " frames") +
                          " of {width} x {height} pixels; beam thickness (standard deviation) {elevation_sigma:2} mm",
                      answer));
  console.Report(answer);
  return Success;
}

/// A choice by the names of its values, counted from 0.
template <class Choice>
void AddChoice(CLI::App& app, const char* name, Choice& choice, const std::vector<std::string>& names,
               const std::string& help, const char* type, const char* group)
{
  const auto apply = [&choice, names](const std::string& given)
  { choice = static_cast<Choice>(std::find(names.begin(), names.end(), given) - names.begin()); };
  app.add_option_function<std::string>(name, apply, help)
      ->transform(CLI::IsMember(names, CLI::ignore_case).description(""))
      ->type_name(type)
      ->group(group);
}

/// The options of a phantom by the list that Core keeps of them.
void AddPhantomOptions(CLI::App& app, PhantomOptions& options)
{
  // Other names that are shorter.
  static const std::map<std::string, std::string> kShort = {{"ScattererDensity", "scatterers"},
                                                            {"DroppedShare", "dropped"},
                                                            {"TrackingRotationNoise", "rotation-noise"},
                                                            {"TrackingRotationDrift", "rotation-drift"},
                                                            {"TrackingRotationQuantum", "rotation-quantum"},
                                                            {"OutlierShare", "outliers"}};
  AddChoice(app, "--scene", options.scene, {"organ", "speckle", "points"},
            "organ (default): vessels, cyst, tumour, bone; speckle; points", "SCENE", "World");
  AddChoice(app, "--probe", options.probe, {"linear", "convex", "sector"}, "linear (default), convex or sector", "KIND",
            "Probe and image");
  ForEachPhantomOption(options,
                       [&app](const PhantomNumber& number, auto& value)
                       {
                         const auto found = kShort.find(number.name);
                         const std::string name = found == kShort.end() ? SpellOption(number.name, '-') : found->second;
                         std::string unit = *number.unit ? number.unit : "n";
                         std::transform(unit.begin(), unit.end(), unit.begin(), [](char c) { return std::toupper(c); });
                         CLI::Option* option =
                             app.add_option("--" + name, value, number.help)
                                 ->check(NumberIn(number.zeroIsProbes ? 0 : number.least, number.most))
                                 ->type_name(unit)
                                 ->group(number.group);
                         if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>)
                         {
                           option->capture_default_str();
                         }
                       });
}

}  // namespace

void AddPhantom(Program& program)
{
  auto options = std::make_shared<PhantomArguments>();
  CLI::App* app = program.app.add_subcommand(
      "phantom",
      "Make a synthetic tracked sweep with known truth\n"
      "  bigus phantom -o sweep.igs.mha --probe convex --frames 80\n"
      "  bigus phantom -o truth.png --truth plane.csv --size 256 256 --spacing 0.2     (what is really there)\n"
      "World: x right, y down from the skin (depth), z along the sweep, mm. The same options and seed give the same\n"
      "world, so --truth with a sweep's options shows what that sweep's probe would see at other planes.");
  app->add_option("-o,--output", options->output, "Sequence to write: .igs.mha .mha .nrrd, or .png (numbered)")
      ->required()
      ->type_name("OUT");

  app->add_option("--labels", options->labels,
                  "Also write what a person would draw on the frames, for 'bigus label': 1 vessel, 2 cyst, 3 bone, "
                  "4 tumour. .mha, .nrrd or .png (numbered)")
      ->type_name("OUT");

  AddPhantomOptions(*app, options->phantom);
  const std::string tracker = app->get_option("--tracking-noise")->get_group();
  app->add_flag("--true-poses", options->truePoses, "Write where frames really were, not what the tracker said")
      ->group(tracker);
  CLI::Option* truePosesFile =
      app->add_option("--write-true-poses", options->truePosesFile, "The same beside the sweep, as a CSV of poses")
          ->type_name("CSV")
          ->group(tracker);

  AddPlaneOptions(*app, options->truth, "--truth", "--truth-frames", "Image these planes instead of making a sweep",
                  false);
  truePosesFile->excludes(app->get_option("--truth"));

  RunWhenChosen(app, program, [options](Console& console) { return MakePhantom(console, *options); });
}

}  // namespace bigus::command
