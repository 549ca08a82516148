// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus-cuda-bench: how fast an engine is at what the CUDA engine is for, beside what its device could do at most. Needs
// Core alone; see Cuda/README.md.

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Model/Error.h"
#include "Core/Trainer/Trainer.h"
#include "Testing/Benchmarks/Speed/Ceilings.h"
#include "Testing/Benchmarks/Speed/Workloads.h"

namespace
{

using namespace bigus;
using namespace bigus::bench;

struct Options
{
  std::string engine = "cuda", sweep;
  bool quick = false;
  int repeats = 15;
  std::size_t gaussians = 140000;
  std::vector<double> seconds;
  int holdOut = 0;
  double elevationSigma = 0;
  std::optional<int> virtualPlanes;
};

constexpr char kUsage[] =
    "bigus-cuda-bench [--engine NAME] [--quick] [--repeats N]\n"
    "    times slices and training passes on made-up fields\n"
    "bigus-cuda-bench --sweep FILE.txt --seconds S [--seconds S ...] [--gaussians N] [--hold-out K]\n"
    "                 [--elevation-sigma MM] [--virtual-planes N] [--engine NAME]\n"
    "    trains on a sweep for so many seconds each and scores the field; FILE is what export_sweep.py writes\n";

double Number(const std::string& text, const std::string& option)
{
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !(value >= 0 && value < 1e9))
  {
    throw Error(option + " is '" + text + "'; give a number of 0 or more.");
  }
  return value;
}

Options Parse(int argc, char** argv)
{
  Options options;
  for (int i = 1; i < argc; ++i)
  {
    const std::string option = argv[i];
    const auto value = [&]() -> std::string
    {
      if (++i >= argc)
      {
        throw Error(option + " needs a value.\n" + kUsage);
      }
      return argv[i];
    };
    if (option == "--engine")
    {
      options.engine = value();
    }
    else if (option == "--sweep")
    {
      options.sweep = value();
    }
    else if (option == "--quick")
    {
      options.quick = true;
    }
    else if (option == "--repeats")
    {
      options.repeats = std::max(1, static_cast<int>(Number(value(), option)));
    }
    else if (option == "--gaussians")
    {
      options.gaussians = static_cast<std::size_t>(Number(value(), option));
    }
    else if (option == "--seconds")
    {
      options.seconds.push_back(Number(value(), option));
    }
    else if (option == "--hold-out")
    {
      options.holdOut = static_cast<int>(Number(value(), option));
    }
    else if (option == "--elevation-sigma")
    {
      options.elevationSigma = Number(value(), option);
    }
    else if (option == "--virtual-planes")
    {
      options.virtualPlanes = static_cast<int>(Number(value(), option));
    }
    else if (option == "--help" || option == "-h")
    {
      std::cout << kUsage;
      std::exit(0);
    }
    else
    {
      throw Error("There is no option '" + option + "'.\n" + kUsage);
    }
  }
  return options;
}

struct Times
{
  double median, low, high;  // milliseconds
};

Times Measure(int repeats, const std::function<void()>& run)
{
  run();  // allocates, and warms caches
  std::vector<double> times;
  for (int i = 0; i < repeats; ++i)
  {
    const auto begin = std::chrono::steady_clock::now();
    run();
    times.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  }
  std::sort(times.begin(), times.end());
  return {times[times.size() / 2], times.front(), times.back()};
}

/// What a piece of work must spend at least.
struct Work
{
  double multiplyAdds = 0, bytes = 0;
};

void PrintRow(const std::string& what, const Times& times, const Work& work, const Ceilings* ceilings)
{
  std::printf("| %s | %.3f (%.3f to %.3f) |", what.c_str(), times.median, times.low, times.high);
  if (!ceilings)
  {
    std::printf(" | |\n");
    return;
  }
  const double floor =
      1e3 * std::max(work.multiplyAdds / ceilings->multiplyAddsPerSecond, work.bytes / ceilings->bytesPerSecond);
  std::printf(" %.3f | %.0f %% |\n", floor, 100 * floor / times.median);
  std::fflush(stdout);
}

/// Of one footprint pixel: two multiplications of the recurrence and one addition; on the way back the same and the
/// sums. Of one splat: 64 bytes, written and read once each way.
constexpr double kForwardOperations = 3, kBackwardOperations = 8, kSplatBytes = 64, kGaussianBytes = 44;

Work Rendering(const GaussianField& field, const SlicePlane& plane)
{
  PlainRenderer plain(field);
  std::vector<float> image;
  plain.Render(plane, Accuracy().tolerance, 1, image);
  return {kForwardOperations * static_cast<double>(plain.Pairs()),
          kSplatBytes * 2 * static_cast<double>(plain.Splats()) + kGaussianBytes * static_cast<double>(field.Size()) +
              4.0 * static_cast<double>(plane.NumberOfPixels())};
}

void MeasureSpeed(const Options& options)
{
  const std::unique_ptr<Engine> engine = Engine::Create(options.engine);
  std::unique_ptr<Ceilings> ceilings;
  if (options.engine == "cuda")
  {
    ceilings = std::make_unique<Ceilings>(MeasureCeilings());
    std::printf("ceilings measured: %.3g multiply-adds/s, %.3g bytes/s\n", ceilings->multiplyAddsPerSecond,
                ceilings->bytesPerSecond);
  }
  std::printf("engine: %s; medians of %d runs (smallest to largest), milliseconds, with the way to the host\n\n",
              engine->Device().c_str(), options.repeats);
  std::printf("| what | ms | floor ms | share of it |\n|---|---|---|---|\n");
  const std::size_t large = options.quick ? 20000 : 2000000, small = options.quick ? 2000 : 140000;
  const int width = options.quick ? 128 : 512, frames = options.quick ? 8 : 160, side = options.quick ? 64 : 160;
  for (const FootprintSize& size : {kPixelSized, kFourPixels})
  {
    const GaussianField field = MakeField(FieldAround(width, large, size));
    engine->SetField(field);
    const std::string name = std::to_string(large / 1000) + "k " + size.name + " Gaussians, " + std::to_string(width) +
                             " x " + std::to_string(width) + " pixels";
    const SlicePlane plane = MakePlane(width, true);
    const Work work = Rendering(field, plane);
    std::vector<float> image(plane.NumberOfPixels());
    PrintRow("one slice of " + name,
             Measure(options.repeats, [&] { engine->Render(plane, ViewOutput::Intensity, image.data()); }), work,
             ceilings.get());
    constexpr int kStack = 64;
    std::vector<SlicePlane> stack;
    for (int k = 0; k < kStack; ++k)
    {
      stack.push_back(plane);
      stack.back().origin += kWorkloadPixel * (k - kStack / 2) * plane.Normal();
    }
    image.resize(kStack * plane.NumberOfPixels());
    PrintRow("64 slices of " + name,
             Measure(options.repeats, [&] { engine->RenderStack(stack, ViewOutput::Intensity, image.data()); }),
             {kStack * work.multiplyAdds, kStack * work.bytes}, ceilings.get());
  }
  for (const int batch : {frames, 16})
  {
    const TrainingPass pass = MakeTrainingPass(small, frames, side, std::min(batch, frames));
    engine->SetFrames(pass.sweep);
    engine->SetField(pass.field);
    engine->SetAccuracy(pass.accuracy);
    Work work;
    for (int frame = 0; frame < frames; ++frame)
    {
      const Work forward = Rendering(pass.field, pass.sweep->Plane(frame));
      work.multiplyAdds += forward.multiplyAdds / kForwardOperations * (kForwardOperations + kBackwardOperations);
      work.bytes += 2 * forward.bytes;
    }
    PrintRow("a training pass of " + std::to_string(small / 1000) + "k Gaussians over " + std::to_string(frames) +
                 " frames of " + std::to_string(side) + " x " + std::to_string(side) + ", " +
                 std::to_string(std::min(batch, frames)) + " a step",
             Measure(options.repeats,
                     [&]
                     {
                       for (const std::vector<int>& step : pass.batches)
                       {
                         engine->TrainStep(step, Loss(), pass.rates, pass.limits);
                       }
                     }),
             work, ceilings.get());
  }
}

/// "width height frames", then ImageToReference, 16 numbers a frame, row by row; and pixels, a byte each, in the file of
/// the same name ending in .raw.
std::shared_ptr<const Sweep> ReadSweep(const std::string& path)
{
  const auto fail = [&path](const std::string& what)
  { throw Error(path + ": " + what + " Write it by export_sweep.py."); };
  std::ifstream text(path);
  auto sweep = std::make_shared<Sweep>();
  long width = 0, height = 0, frames = 0;
  if (!(text >> width >> height >> frames) || width < 1 || height < 1 || frames < 1 || width > 8192 || height > 8192 ||
      frames > 100000 || width * height * frames > (1l << 32))
  {
    fail("the first line does not say width, height and frames.");
  }
  sweep->width = static_cast<int>(width);
  sweep->height = static_cast<int>(height);
  for (long frame = 0; frame < frames; ++frame)
  {
    Eigen::Matrix4d pose;
    for (int k = 0; k < 16; ++k)
    {
      if (!(text >> pose(k / 4, k % 4)))
      {
        fail("the pose of frame " + std::to_string(frame) + " is not 16 numbers.");
      }
    }
    sweep->imageToReference.push_back(pose);
  }
  const std::string rawPath = path.substr(0, path.find_last_of('.')) + ".raw";
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(width * height * frames));
  std::ifstream raw(rawPath, std::ios::binary);
  if (!raw.read(reinterpret_cast<char*>(pixels->data()), static_cast<std::streamsize>(pixels->size())))
  {
    fail("'" + rawPath + "' does not hold " + std::to_string(pixels->size()) + " bytes.");
  }
  sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
  sweep->Validate();
  return sweep;
}

void MeasureTraining(const Options& options)
{
  const std::shared_ptr<const Sweep> sweep = ReadSweep(options.sweep);
  std::printf(
      "| Gaussians | seconds | steps | PSNR of training frames | of held-out frames |\n|---|---|---|---|---|\n");
  for (const double seconds : options.seconds)
  {
    TrainerOptions trainer;
    trainer.engine = options.engine;
    trainer.automatic = false;
    trainer.gaussians = options.gaussians;
    trainer.elevationSigma = options.elevationSigma;
    trainer.holdOut = options.holdOut;
    trainer.timeLimit = seconds;
    trainer.iterations = 10000000;
    trainer.batch = 16;
    trainer.virtualPlanes = options.virtualPlanes;
    if (options.holdOut == 0)
    {
      trainer.loss = Loss::Parse("l2");
      trainer.tolerance = 1e-5;
      trainer.meanRate = 0.15;
      trainer.reflectivityRate = 0.025;
    }
    const TrainingResult result = Train(sweep, trainer);
    const FrameScores training = ScoreField(result.field, *sweep, result.trainingFrames, options.engine);
    const double heldOut =
        result.heldOutFrames.empty() ? 0 : ScoreField(result.field, *sweep, result.heldOutFrames, options.engine).psnr;
    std::printf("| %zu | %.1f | %d | %.2f | %.2f |\n", result.field.Size(), result.seconds, result.iterations,
                training.psnr, heldOut);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv)
{
  try
  {
    const Options options = Parse(argc, argv);
    if (options.sweep.empty())
    {
      MeasureSpeed(options);
    }
    else
    {
      MeasureTraining(options);
    }
    return 0;
  }
  catch (const std::exception& error)
  {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
