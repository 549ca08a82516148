// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus live: a field that grows while frames arrive.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "Command.h"
#include "Core/Deciding/Provenance.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Live/LiveSession.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"
#include "Core/Model/FieldRounding.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "Files.h"
#include "Inputs.h"
#include "vtkNew.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

using Clock = std::chrono::steady_clock;

/// Seconds between two looks at the field, while frames arrive and while it is finished.
constexpr double kLook = 0.1;

/// Seconds after the last frame when the field counts as that of the moment when the probe was lifted.
constexpr double kLifted = 0.5;

struct Options
{
  SequenceOptions sequence;
  std::string output;
  double rate = 0;     ///< frames a second; 0: as recorded
  double finish = 10;  ///< s
  int holdOut = 0;
  LiveOptions live;
  std::string engine = "auto";
  double seed = 1;
};

/// When each frame comes, s after the first.
std::vector<double> ArrivalTimes(const Sweep& sweep, const Options& options)
{
  std::vector<double> times;
  for (int frame = 0; frame < sweep.NumberOfFrames(); ++frame)
  {
    times.push_back(options.rate > 0 ? frame / options.rate : sweep.timestamps[frame] - sweep.timestamps[0]);
  }
  return times;
}

void RequireTimes(const Sweep& sweep, const Options& options)
{
  if (options.rate > 0)
  {
    return;
  }
  if (sweep.timestamps.empty() || !std::is_sorted(sweep.timestamps.begin(), sweep.timestamps.end()))
  {
    throw Error(
        options.sequence.path +
        ": its frames have no times, or these do not increase, so they cannot be replayed as recorded. Set --rate "
        "to a number of frames a second.");
  }
}

LiveFrame FrameOf(const Sweep& sweep, int frame, double time)
{
  LiveFrame live;
  live.width = sweep.width;
  live.height = sweep.height;
  live.imageToReference = sweep.imageToReference[frame];
  live.timestamp = time;
  std::vector<float> pixels(sweep.PixelsPerFrame());
  sweep.CopyFrame(frame, pixels.data());
  live.pixels.resize(pixels.size());
  std::transform(pixels.begin(), pixels.end(), live.pixels.begin(),
                 [](float value) { return static_cast<std::uint8_t>(std::lround(255 * value)); });
  return live;
}

double Quantile(std::vector<double> values, double q)
{
  if (values.empty())
  {
    return std::nan("");
  }
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

/// How long slices take to come while the session works.
class Looker
{
public:
  Looker(LiveSession& session, int width, int height) : session_(session), width_(width), height_(height) {}

  void Look(const Eigen::Matrix4d& imageToReference)
  {
    image_.resize(static_cast<std::size_t>(width_) * height_);
    const Clock::time_point start = Clock::now();
    session_.Render(SlicePlane::FromImageToReference(imageToReference, width_, height_), ViewOutput::Intensity,
                    image_.data());
    latencies_.push_back(1000 * SecondsSince(start));
  }

  Json ToJson() const
  {
    return {{"slices", latencies_.size()},
            {"median_ms", Quantile(latencies_, 0.5)},
            {"q95_ms", Quantile(latencies_, 0.95)},
            {"largest_ms", Quantile(latencies_, 1)}};
  }
  std::string Text() const
  {
    return FormatNumber(Quantile(latencies_, 0.5), 1) + " ms (median), " + FormatNumber(Quantile(latencies_, 0.95), 1) +
           " ms (95 % below), " + FormatNumber(Quantile(latencies_, 1), 1) + " ms (longest)";
  }

private:
  LiveSession& session_;
  int width_, height_;
  std::vector<float> image_;
  std::vector<double> latencies_;
};

Json Score(const std::string& name, const GaussianField& field, const Sweep& sweep, const std::vector<int>& frames,
           const std::string& engine, Console& console)
{
  if (frames.empty() || field.Size() == 0)
  {
    return nullptr;
  }
  const FrameScores scores = ScoreField(field, sweep, frames, engine);
  console.Print("  " + name + FormatNumber(scores.psnr, 2) + " dB, SSIM " + FormatNumber(scores.ssim, 4));
  return {{"psnr", scores.psnr}, {"ssim", scores.ssim}};
}

ExitCode Live(Console& console, Options options)
{
  RequireDistinct({options.sequence.path, options.sequence.chain.config}, {options.output});
  RequireWritable(options.output);
  RequireFieldName(options.output);
  options.live.training.engine = options.engine;
  options.live.training.seed = static_cast<std::uint64_t>(options.seed);
  const std::shared_ptr<const Sweep> sweep = ReadSweep(options.sequence, console);
  RequireTimes(*sweep, options);
  const auto [frames, heldOut] = SplitHoldOut(sweep->NumberOfFrames(), options.holdOut);
  const std::vector<double> times = ArrivalTimes(*sweep, options);

  LiveSession session(options.live);
  Looker looker(session, sweep->width, sweep->height);
  const Clock::time_point start = Clock::now();
  double nextLook = kLook;
  for (const int frame : frames)
  {
    const LiveFrame live = FrameOf(*sweep, frame, times[frame]);
    while (SecondsSince(start) < times[frame] && !IsInterrupted())
    {
      std::this_thread::sleep_for(
          std::chrono::duration<double>(std::min(kLook, std::max(0.0, times[frame] - SecondsSince(start)))));
    }
    if (IsInterrupted())
    {
      break;
    }
    session.Add(live);
    if (SecondsSince(start) >= nextLook)
    {
      looker.Look(live.imageToReference);
      nextLook = SecondsSince(start) + kLook;
      const LiveSession::State state = session.GetState();
      console.Progress("Following", times[frame] / std::max(times.back(), 1e-9),
                       std::to_string(state.gaussians) + " Gaussians");
    }
  }
  console.EndProgress();
  std::this_thread::sleep_for(std::chrono::duration<double>(kLifted));
  const double followed = SecondsSince(start);
  const GaussianField liveField = session.Field();
  const LiveSession::State state = session.GetState();

  const LiveResult result = session.Finish(options.finish,
                                           [&](const TrainingProgress& now)
                                           {
                                             console.Progress("Finishing", now.fraction);
                                             return !IsInterrupted();
                                           });
  console.EndProgress();
  vtkNew<vtkPolyData> output;
  const GaussianField& field = result.training.field;
  FieldToPolyData(field, output);
  std::vector<std::string> provenance;
  AddTrainingProvenance(provenance, result.training, *result.sweep, false);
  ReplaceProvenance(output, provenance);
  SetProvenance(output, "program", std::string("bigus ") + BIGUS_VERSION);
  SetProvenance(output, "world", options.sequence.chain.to);
  WriteFieldData(output, options.output, true, console);

  console.Print(options.output + ": " + std::to_string(field.Size()) + " Gaussians");
  console.Print("  frames    " + std::to_string(state.frames) + " in " + FormatNumber(followed, 1) + " s; " +
                std::to_string(state.passedOver) + " passed over, " + std::to_string(state.dropped) + " dropped, " +
                std::to_string(state.refused) + " refused");
  console.Print("  steps     " + std::to_string(state.steps) + " while frames came, " +
                std::to_string(result.training.iterations) + " in " + FormatNumber(result.training.seconds, 1) +
                " s afterwards");
  console.Print("  slices    came in " + looker.Text());
  Sweep lit = sweep->LitBy(frames);
  const Json atLift =
      Score("held-out frames when the probe was lifted  ", liveField, lit, heldOut, options.engine, console);
  const Json finished =
      Score("held-out frames when finished              ", field, lit, heldOut, options.engine, console);
  console.Report({{"gaussians", field.Size()},
                  {"frames", state.frames},
                  {"seconds", followed},
                  {"passed_over", state.passedOver},
                  {"dropped", state.dropped},
                  {"refused", state.refused},
                  {"steps", state.steps},
                  {"latency", looker.ToJson()},
                  {"held_out_at_lift", atLift},
                  {"held_out", finished}});
  return IsInterrupted() ? InterruptedCode() : Success;
}

}  // namespace

void AddLive(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app = program.app.add_subcommand("live",
                                             "Follow the probe: a field that grows while frames arrive\n"
                                             "  bigus live sweep.igs.mha -o field.vtp\n"
                                             "A sequence is replayed as it was recorded.");
  AddSequenceOptions(*app, options->sequence, "SEQUENCE", "Tracked frames: .igs.mha .mha .mhd .nrrd .seq.nrrd .csv");
  AddReduceOption(*app, options->sequence.reduce);
  app->add_option("-o,--output", options->output, "Field to write: .vtp or .ply")
      ->check(FileToWrite(kFieldEndings))
      ->required()
      ->type_name("FIELD");
  app->add_option("--rate", options->rate, "Frames a second; 0: as recorded")
      ->check(NumberIn(0, 1000))
      ->type_name("N")
      ->capture_default_str();
  app->add_option("--finish", options->finish, "Seconds of training on all frames when no more come")
      ->check(NumberIn(0.1, 1e6))
      ->type_name("S")
      ->capture_default_str();
  app->add_option("--hold-out", options->holdOut, "Keep frames with index % K == K / 2 for a score")
      ->check(WholeNumberIn(0, 1e6))
      ->type_name("K")
      ->capture_default_str();
  app->add_option("--engine", options->engine, "What computes")->type_name("NAME")->capture_default_str();
  app->add_option("--seed", options->seed, "Of random numbers")
      ->check(WholeNumberIn(0, 1e9))
      ->type_name("N")
      ->capture_default_str();
  RunWhenChosen(app, program, [options](Console& console) { return Live(console, *options); });
}

}  // namespace bigus::command
