// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus phantom: a made-up tracked sweep, and the exact truth at any other plane.
#include "Core/Phantom/Phantom.h"

#include <map>
#include <memory>

#include "Command.h"
#include "Files.h"
#include "Inputs.h"
#include "Outputs.h"
#include "vtkBigusConvert.h"
#include "vtkImageData.h"

namespace bigus::command
{

namespace
{

struct Options
{
  PhantomOptions phantom;
  std::string output;
  PlaneOptions truth;  ///< with poses: image these planes instead of making a sweep
  bool truePoses = false;
};

ExitCode MakePhantom(Console& console, const Options& options)
{
  RequireDistinct({options.truth.poses, options.truth.chain.config}, {options.output});
  RequireWritable(options.output);
  RequireStackName(options.output);
  const Phantom phantom(options.phantom);
  const auto start = std::chrono::steady_clock::now();

  vtkSmartPointer<vtkImageData> stack;
  std::vector<int> numbers;  // of PNG files
  if (!options.truth.poses.empty())
  {
    const Planes planes = ReadPlanes(options.truth, console);
    numbers = planes.numbers;
    stack = NewStack(planes.planes, planes.timestamps, true);
    const std::size_t pixels = planes.planes[0].NumberOfPixels();
    for (std::size_t k = 0; k < planes.planes.size(); ++k)
    {
      phantom.Frame(planes.planes[k], static_cast<std::uint8_t*>(stack->GetScalarPointer()) + k * pixels);
      console.Progress("Imaging", (k + 1.0) / planes.planes.size());
      if (IsInterrupted())
      {
        throw Interrupted();
      }
    }
  }
  else
  {
    Sweep sweep = phantom.MakeSweep(
        [&console](double fraction)
        {
          console.Progress("Imaging", fraction);
          return !IsInterrupted();
        });
    if (IsInterrupted())
    {
      throw Interrupted();
    }
    for (int k = 0; k < sweep.NumberOfFrames(); ++k)
    {
      numbers.push_back(k);
      if (options.truePoses)
      {
        sweep.imageToReference[k] = phantom.TruePlane(k).ImageToReference();
      }
    }
    stack = vtkSmartPointer<vtkImageData>::New();
    SweepToImage(sweep, stack);
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const std::vector<std::string> files = WriteStack(stack, options.output, numbers, console);

  const int* size = stack->GetDimensions();
  console.Print(NameOf(files) + ": " + std::to_string(size[2]) + (size[2] == 1 ? " frame of " : " frames of ") +
                std::to_string(size[0]) + " x " + std::to_string(size[1]) +
                " pixels; beam thickness (standard deviation) " + FormatNumber(options.phantom.elevationSigma, 2) +
                " mm");
  console.Report({{"output", files},
                  {"frames", size[2]},
                  {"width", size[0]},
                  {"height", size[1]},
                  {"elevation_sigma", options.phantom.elevationSigma},
                  {"scatterers_per_resolution_cell", phantom.ScatterersPerResolutionCell()},
                  {"seed", options.phantom.seed},
                  {"seconds", seconds}});
  return Success;
}

}  // namespace

void AddPhantom(Program& program)
{
  auto options = std::make_shared<Options>();
  PhantomOptions& phantom = options->phantom;
  CLI::App* app = program.app.add_subcommand(
      "phantom",
      "Make a synthetic tracked sweep with known truth\n"
      "  bigus phantom -o sweep.igs.mha --probe convex --frames 80\n"
      "  bigus phantom -o truth.png --truth plane.csv --size 256 256 --spacing 0.2     (what is really "
      "there)\n"
      "World: x right, y down from the skin (depth), z along the sweep, mm. The same options and seed give "
      "the same\n"
      "world, so --truth with a sweep's options shows what that sweep's probe would see at other planes.");
  app->add_option("-o,--output", options->output, "Sequence to write: .igs.mha .mha .nrrd, or .png (numbered)")
      ->required()
      ->type_name("OUT");

  const auto number = [app](const char* name, auto& variable, const char* help, double low, double high,
                            const char* unit, const char* group)
  {
    app->add_option(name, variable, help)
        ->check(NumberIn(low, high))
        ->type_name(unit)
        ->capture_default_str()
        ->group(group);
  };
  const char* world = "World";
  static const std::map<std::string, PhantomScene> scenes = {
      {"organ", PhantomScene::Organ}, {"speckle", PhantomScene::Speckle}, {"points", PhantomScene::Points}};
  app->add_option("--scene", phantom.scene, "organ (default): vessels, cyst, tumour, bone; speckle; points")
      ->transform(CLI::Transformer(scenes, CLI::ignore_case).description(""))
      ->type_name("SCENE")
      ->group(world);
  app->add_option("--seed", phantom.seed, "Seed of scatterers, hand and tracker; the anatomy stays")
      ->check(NumberIn(0, 18446744073709549568.0))
      ->type_name("S")
      ->capture_default_str()
      ->group(world);
  number("--scatterers", phantom.scattererDensity, "Scatterers per mm^3 of parenchyma", 1, 1000, "N", world);
  number("--attenuation", phantom.attenuation, "One way, in parenchyma, dB / (cm MHz)", 0, 3, "DB", world);

  const char* probe = "Probe and image";
  static const std::map<std::string, ProbeKind> probes = {
      {"linear", ProbeKind::Linear}, {"convex", ProbeKind::Convex}, {"sector", ProbeKind::Sector}};
  app->add_option("--probe", phantom.probe, "linear (default), convex or sector")
      ->transform(CLI::Transformer(probes, CLI::ignore_case).description(""))
      ->type_name("KIND")
      ->group(probe);
  number("--width", phantom.width, "Pixels across; 0: 256 (linear) or 384", 0, 8192, "N", probe);
  number("--height", phantom.height, "Pixels in depth", 8, 8192, "N", probe);
  number("--pixel-size", phantom.pixelSize, "Side of a pixel", 0.01, 5, "MM", probe);
  number("--probe-radius", phantom.probeRadius, "Radius of the fan's start; 0: 25 (convex) or 4", 0, 500, "MM", probe);
  number("--half-angle", phantom.halfAngle, "The fan's reach to each side; 0: 32 (convex) or 44", 0, 80, "DEG", probe);
  number("--frequency", phantom.frequency, "Of the axial carrier", 0.5, 50, "MHZ", probe);
  number("--axial-sigma", phantom.axialSigma, "Resolution along the beam, standard deviation", 0.02, 5, "MM", probe);
  number("--lateral-sigma", phantom.lateralSigma, "Resolution across the beam", 0.02, 5, "MM", probe);
  number("--elevation-sigma", phantom.elevationSigma, "Thickness of the beam out of plane", 0.05, 10, "MM", probe);
  number("--dynamic-range", phantom.dynamicRange, "Between black and white", 10, 120, "DB", probe);
  number("--white-level", phantom.whiteLevel, "Above parenchyma, shown white", -40, 100, "DB", probe);

  const char* hand = "Trajectory and tracking";
  number("--frames", phantom.frames, "Frames of the sweep", 1, 100000, "N", hand);
  number("--frame-spacing", phantom.frameSpacing, "Mean travel between frames", 0, 20, "MM", hand);
  number("--speed-variation", phantom.speedVariation, "Share by which the spacing varies", 0, 0.95, "SHARE", hand);
  number("--tilt", phantom.tilt, "Bound of the probe's three angles", 0, 45, "DEG", hand);
  number("--wander", phantom.wander, "Bound of motion sideways and in depth", 0, 20, "MM", hand);
  number("--sweep-angle", phantom.sweepAngle, "Turns the whole sweep about the depth axis", -360, 360, "DEG", hand);
  number("--frame-rate", phantom.frameRate, "Frames a second", 0.1, 10000, "HZ", hand);
  number("--tracking-noise", phantom.trackingNoise, "Standard deviation of recorded positions", 0, 10, "MM", hand);
  number("--rotation-noise", phantom.trackingRotationNoise, "Standard deviation of recorded angles", 0, 20, "DEG",
         hand);
  app->add_flag("--true-poses", options->truePoses, "Write where frames really were, not what the tracker said")
      ->group(hand);

  AddPlaneOptions(*app, options->truth, "--truth", "--truth-frames", "Image these planes instead of making a sweep",
                  false);

  Console& console = program.console;
  app->callback([&program, &console, options]
                { program.job = [&console, options] { return MakePhantom(console, *options); }; });
}

}  // namespace bigus::command
