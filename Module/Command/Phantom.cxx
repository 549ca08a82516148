// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus phantom: a made-up tracked sweep, and the exact truth at any other plane.
#include <algorithm>
#include <functional>
#include <iomanip>
#include <limits>
#include <memory>
#include <numeric>

#include "Command.h"
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
  vtkNew<vtkBigusPhantomSource> source;
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
  vtkSmartPointer<vtkImageData> stack;
  std::vector<int> numbers;  // of PNG files
  std::vector<SlicePlane> truePlanes;
  if (!options.truth.poses.empty())
  {
    const Planes planes = ReadPlanes(options.truth, console);
    stack = MakeTruth(options.source, &vtkBigusPhantomSource::ComputeTruth, planes.planes, planes.timestamps, console);
    truePlanes = planes.planes;
    numbers = planes.numbers;
  }
  else
  {
    stack = MakeSweep(options.source, options.truePoses, options.truePosesFile, truePlanes, console);
    numbers.resize(stack->GetDimensions()[2]);
    std::iota(numbers.begin(), numbers.end(), 0);
  }
  const double seconds = SecondsSince(start);
  const std::vector<std::string> files = WriteStack(stack, options.output, numbers, console);
  if (!options.labels.empty())
  {
    WriteStack(MakeTruth(options.source, &vtkBigusPhantomSource::ComputeLabels, truePlanes, {}, console),
               options.labels, numbers, console);
  }

  const int* size = stack->GetDimensions();
  const Json answer = {{"output", files},
                       {"true_poses", options.truePosesFile.empty() ? Json() : Json(options.truePosesFile)},
                       {"labels", options.labels.empty() ? Json() : Json(options.labels)},
                       {"frames", size[2]},
                       {"width", size[0]},
                       {"height", size[1]},
                       {"elevation_sigma", options.source->GetElevationSigma()},
                       {"scatterers_per_resolution_cell", options.source->GetScatterersPerResolutionCell()},
                       {"seed", options.source->GetSeed()},
                       {"seconds", seconds}};
  console.Print(NameOf(files) + ": " +
                Words(std::string("{frames}") + (size[2] == 1 ? " frame" : " frames") +
                          " of {width} x {height} pixels; beam thickness (standard deviation) {elevation_sigma:2} mm",
                      answer));
  console.Report(answer);
  return Success;
}

using Source = vtkBigusPhantomSource;

/// Adds options of one group, each for a property of the source.
struct Group
{
  CLI::App* app;
  Source* source;
  const char* name;

  /// Of the type of its default `value`.
  template <class Set, class T>
  void Number(const char* option, Set set, T value, const char* help, double low, double high, const char* unit) const
  {
    const auto apply = [source = source, set](const T& given) { std::invoke(set, source, given); };
    app->add_option_function<T>(option, apply, help)
        ->default_str(CLI::detail::to_string(value))
        ->check(NumberIn(low, high))
        ->type_name(unit)
        ->group(name);
  }

  /// A property whose values are counted from 0 in the order of their names.
  void Choice(const char* option, void (Source::*set)(int), const std::vector<std::string>& names, const char* help,
              const char* type) const
  {
    const auto apply = [source = source, set, names](const std::string& given)
    { (source->*set)(static_cast<int>(std::find(names.begin(), names.end(), given) - names.begin())); };
    app->add_option_function<std::string>(option, apply, help)
        ->transform(CLI::IsMember(names, CLI::ignore_case).description(""))
        ->type_name(type)
        ->group(name);
  }

  /// Three numbers.
  void Vector(const char* option, void (Source::*set)(const double*), const char* help, double bound,
              const char* unit) const
  {
    const auto apply = [source = source, set](const std::vector<double>& given) { (source->*set)(given.data()); };
    app->add_option_function<std::vector<double>>(option, apply, help)
        ->expected(3)
        ->check(NumberIn(-bound, bound))
        ->type_name(unit)
        ->group(name);
  }
};

// How a property of the source is set, and its default.
#define PROPERTY(name) &Source::Set##name, add.source->Get##name()

void AddWorld(const Group& add)
{
  add.Choice("--scene", &Source::SetScene, {"organ", "speckle", "points"},
             "organ (default): vessels, cyst, tumour, bone; speckle; points", "SCENE");
  add.Number("--seed", PROPERTY(Seed), "Seed of scatterers, hand and tracker; the anatomy stays", 0, 9007199254740992.0,
             "S");
  add.Number("--scatterers", PROPERTY(ScattererDensity), "Scatterers per mm^3 of parenchyma", 1, 1000, "N");
  add.Number("--attenuation", PROPERTY(Attenuation), "One way, in parenchyma, dB / (cm MHz)", 0, 3, "DB");
}

void AddProbe(const Group& add)
{
  add.Choice("--probe", &Source::SetProbe, {"linear", "convex", "sector"}, "linear (default), convex or sector",
             "KIND");
  const int* size = add.source->GetFrameSize();
  add.Number(
      "--width", [](Source* s, int width) { s->SetFrameSize(width, s->GetFrameSize()[1]); }, size[0],
      "Pixels across; 0: 256 (linear) or 384", 0, 8192, "N");
  add.Number(
      "--height", [](Source* s, int height) { s->SetFrameSize(s->GetFrameSize()[0], height); }, size[1],
      "Pixels in depth", 8, 8192, "N");
  add.Number("--pixel-size", PROPERTY(PixelSize), "Side of a pixel", 0.01, 5, "MM");
  add.Number("--probe-radius", PROPERTY(ProbeRadius), "Radius of the fan's start; 0: 25 (convex) or 4", 0, 500, "MM");
  add.Number("--half-angle", PROPERTY(HalfAngle), "The fan's reach to each side; 0: 32 (convex) or 44", 0, 80, "DEG");
  add.Number("--frequency", PROPERTY(Frequency), "Of the axial carrier", 0.5, 50, "MHZ");
  add.Number("--axial-sigma", PROPERTY(AxialSigma), "Resolution along the beam, standard deviation", 0.02, 5, "MM");
  add.Number("--lateral-sigma", PROPERTY(LateralSigma), "Resolution across the beam", 0.02, 5, "MM");
  add.Number("--elevation-sigma", PROPERTY(ElevationSigma), "Thickness of the beam out of plane", 0.05, 10, "MM");
  add.Number("--dynamic-range", PROPERTY(DynamicRange), "Between black and white", 10, 120, "DB");
  add.Number("--white-level", PROPERTY(WhiteLevel), "Above parenchyma, shown white", -40, 100, "DB");
}

void AddTrajectory(const Group& add)
{
  add.Number("--frames", PROPERTY(NumberOfFrames), "Frames of the sweep", 1, 100000, "N");
  add.Number("--frame-spacing", PROPERTY(FrameSpacing), "Mean travel between frames", 0, 20, "MM");
  add.Number("--speed-variation", PROPERTY(SpeedVariation), "Share by which the spacing varies", 0, 0.95, "SHARE");
  add.Number("--tilt", PROPERTY(Tilt), "Bound of the probe's three angles", 0, 45, "DEG");
  add.Number("--wander", PROPERTY(Wander), "Bound of motion sideways and in depth", 0, 20, "MM");
  add.Number("--sweep-angle", PROPERTY(SweepAngle), "Turns the whole sweep about the depth axis", -360, 360, "DEG");
  add.Number("--shake", PROPERTY(Shake), "Standard deviation by which the probe itself shakes, which frames show", 0,
             10, "MM");
  add.Number("--shake-rotation", PROPERTY(ShakeRotation), "The same of its angles", 0, 20, "DEG");
  add.Number("--shake-correlation", PROPERTY(ShakeCorrelation),
             "Pictures over which it is correlated by 1/e; 0: each by itself", 0, 1000, "N");
  add.Number("--frame-rate", PROPERTY(FrameRate), "Frames a second", 0.1, 10000, "HZ");
  add.Number("--passes", PROPERTY(Passes), "Goes over the path so often, there and back", 1, 100, "N");
  add.Number("--dropped", PROPERTY(DroppedShare), "Share of the pictures taken that are lost", 0, 0.9, "SHARE");
}

void AddTracker(const Group& add)
{
  add.Number("--tracking-noise", PROPERTY(TrackingNoise), "Standard deviation of recorded positions", 0, 10, "MM");
  add.Number("--rotation-noise", PROPERTY(TrackingRotationNoise), "Standard deviation of recorded angles", 0, 20,
             "DEG");
  add.Number("--noise-correlation", PROPERTY(NoiseCorrelation),
             "Frames over which the tracker's noise is correlated by 1/e; 0: each frame errs by itself", 0, 1000,
             "FRAMES");
  add.Number("--tracking-drift", PROPERTY(TrackingDrift), "Bound of a slow drift of positions", 0, 100, "MM");
  add.Number("--rotation-drift", PROPERTY(TrackingRotationDrift), "Bound of a slow drift of angles", 0, 20, "DEG");
  add.Number("--outliers", PROPERTY(OutlierShare), "Share of frames recorded far off", 0, 0.5, "SHARE");
  add.Number("--outlier-size", PROPERTY(OutlierSize), "How far off they are", 0, 100, "MM");
  add.Number("--tracking-delay", PROPERTY(TrackingDelay), "A frame has the pose of so long before it was taken", -1, 1,
             "S");
  add.Number("--tracking-quantum", PROPERTY(TrackingQuantum), "Positions are rounded to multiples; 0: not", 0, 10,
             "MM");
  add.Number("--rotation-quantum", PROPERTY(TrackingRotationQuantum), "So are angles; 0: not", 0, 20, "DEG");
  add.Vector("--calibration-shift", &Source::SetCalibrationShift,
             "Error of the image on the probe: along its rows, down, along its normal", 100, "MM");
  add.Vector("--calibration-rotation", &Source::SetCalibrationRotation,
             "The same about the image's centre, axis times angle in these axes", 45, "DEG");
}

#undef PROPERTY

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

  vtkBigusPhantomSource* source = options->source;
  const char* tracker = "Errors of the tracker, which move recorded poses only";
  AddWorld({app, source, "World"});
  AddProbe({app, source, "Probe and image"});
  AddTrajectory({app, source, "Trajectory and tracking"});
  AddTracker({app, source, tracker});
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
