// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus live: a field that grows while frames arrive.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <future>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "Command.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Model/Error.h"
#include "Core/Trainer/Provenance.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "Files.h"
#include "Inputs.h"
#include "Live/IgtConnection.h"
#include "Live/LiveSession.h"
#include "Live/LiveSources.h"
#include "vtkNew.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

using Clock = std::chrono::steady_clock;

/// Seconds after the last frame when the field counts as that of the moment when the probe was lifted.
constexpr double kLifted = 0.5;

/// Pixels of a side of the picture that is sent back.
constexpr int kLargestSlice = 2048;

struct Options
{
  LiveSource source;
  std::string output, status;
  bool follow = false;  ///< the source is a table that grows
  double rate = 0;      ///< frames a second; 0: as recorded
  double finish = 10;   ///< s
  int holdOut = 0;
  LiveOptions live;
  double memory = 0;  ///< GB of --memory; 0: as much as LiveOptions has
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
  Require(!sweep.timestamps.empty() && std::is_sorted(sweep.timestamps.begin(), sweep.timestamps.end()),
          options.source.sequence.path,
          ": its frames have no times, or these do not increase, so they cannot be replayed as recorded. Set --rate "
          "to a number of frames a second.");
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

/// Hands over the sweep's frames when they are due.
void Replay(const Sweep& sweep, const std::vector<int>& frames, const Options& options, LiveSession& session,
            Looker& looker, SliceServer& slices, LiveStatus& status, Console& console)
{
  const std::vector<double> times = ArrivalTimes(sweep, options);
  const Clock::time_point start = Clock::now();
  double nextLook = kLook;
  for (const int frame : frames)
  {
    const LiveFrame live = FrameOf(sweep, frame, times[frame]);
    const double share = times[frame] / std::max(times.back(), 1e-9);
    status.Tell("following", {}, share);
    while (SecondsSince(start) < times[frame] && !IsInterrupted())
    {
      slices.Wait(-1, std::min(kLook, std::max(0.0, times[frame] - SecondsSince(start))));
    }
    if (IsInterrupted())
    {
      break;
    }
    looker.MoveProbe(live.imageToReference, live.width, live.height);
    session.Add(live);
    if (SecondsSince(start) >= nextLook)
    {
      looker.LookAtProbe();
      nextLook = SecondsSince(start) + kLook;
      console.Progress("Following", share, std::to_string(session.GetState().gaussians) + " Gaussians");
    }
  }
}

/// Trains on all frames together, while clients are served.
LiveResult Finish(double seconds, LiveSession& session, SliceServer& slices, LiveStatus& status,
                  const LiveEvents& events, Console& console)
{
  std::atomic<double> fraction{0};
  auto finished = std::async(std::launch::async,
                             [&]
                             {
                               return session.Finish(seconds,
                                                     [&fraction](const TrainingProgress& now)
                                                     {
                                                       fraction = now.fraction;
                                                       return !IsInterrupted();
                                                     });
                             });
  // An interrupted program does not wait for clients, but for the field.
  while (finished.wait_for(std::chrono::milliseconds(IsInterrupted() ? 100 : 0)) != std::future_status::ready)
  {
    slices.Wait(-1, kLook);
    console.Progress("Finishing", fraction);
    status.Tell("finishing", events, fraction);
  }
  return finished.get();
}

/// That outputs can be written, and that what is followed takes what is asked for.
void RequireOptions(const Options& options, bool isServer, bool isReplayed)
{
  const SequenceOptions& sequence = options.source.sequence;
  RequireDistinct({sequence.path, sequence.chain.config}, {options.output, options.status});
  RequireWritable(options.output);
  if (!options.status.empty())
  {
    RequireWritable(options.status);
  }
  RequireFieldName(options.output);
  Require(isReplayed || options.holdOut <= 0,
          "--hold-out needs a sequence that is replayed; frames that arrive are all followed.");
  if (!isReplayed && (sequence.reduce > 1 || !sequence.clipRectangle.empty() || !sequence.clipFan.empty()))
  {
    throw Error(
        "--reduce and --clip-... need a sequence that is replayed; frames that arrive are taken as they are. Have "
        "the sender make them smaller, or cut them.");
  }
  if (isServer)
  {
    IgtAddress::Parse(sequence.path);
  }
  else
  {
    RequireFile(sequence.path);
  }
}

/// Writes the finished field, with what the command knows of its making.
void WriteField(const LiveResult& result, const Options& options, Console& console)
{
  vtkNew<vtkPolyData> output;
  FieldToPolyData(result.training.field, output);
  std::vector<std::string> provenance;
  AddTrainingProvenance(provenance, result.training, *result.sweep, false);
  ReplaceProvenance(output, provenance);
  SetProvenance(output, "program", std::string("bigus ") + BIGUS_VERSION);
  SetProvenance(output, "world", options.source.sequence.chain.to);
  WriteFieldData(output, options.output, true, console);
}

void PrintSummary(const LiveResult& result, const LiveSession::State& state, const LiveEvents& events, double followed,
                  const Options& options, Console& console)
{
  console.Print(options.output + ": " + std::to_string(result.training.field.Size()) + " Gaussians");
  console.Print("  frames    " + std::to_string(state.frames) + " in " + FormatNumber(followed, 1) + " s; " +
                std::to_string(state.passedOver) + " passed over, " + std::to_string(state.dropped) + " dropped, " +
                std::to_string(state.refused + events.refused) + " refused" +
                (events.reconnects > 0 ? "; connected again " + std::to_string(events.reconnects) + " times" : ""));
  console.Print("  steps     " + std::to_string(state.steps) + " while frames came, " +
                std::to_string(result.training.iterations) + " in " + FormatNumber(result.training.seconds, 1) +
                " s afterwards");
}

ExitCode Live(Console& console, Options options)
{
  options.live.memory = options.memory > 0 ? options.memory * 1e9 : options.live.memory;
  options.live.training.engine = options.engine;
  options.live.training.seed = static_cast<std::uint64_t>(options.seed);
  const std::string& path = options.source.sequence.path;
  const bool isServer = IgtAddress::IsOne(path), isReplayed = !isServer && !options.follow;
  RequireOptions(options, isServer, isReplayed);
  std::shared_ptr<const Sweep> sweep;
  std::vector<int> frames, heldOut;
  if (isReplayed)
  {
    sweep = ReadSweep(options.source.sequence, console);
    RequireTimes(*sweep, options);
    std::tie(frames, heldOut) = SplitHoldOut(sweep->NumberOfFrames(), options.holdOut);
  }

  LiveSession session(options.live);
  Looker looker(session);
  LiveStatus status(options.status, session, looker, console);
  SliceServer slices(options.source.listen, options.source.plane, options.source.sliceSize, looker, status);
  const Clock::time_point start = Clock::now();
  LiveEvents events;
  if (isReplayed)
  {
    Replay(*sweep, frames, options, session, looker, slices, status, console);
  }
  else
  {
    events = isServer ? FollowServer(options.source, session, looker, slices, status, console)
                      : FollowTable(options.source, session, looker, slices, status, console);
  }
  console.EndProgress();
  slices.Wait(-1, kLifted);
  const double followed = SecondsSince(start);
  const GaussianField liveField = session.Field();
  const LiveSession::State state = session.GetState();
  if (IsInterrupted() && state.frames == 0)
  {
    throw Interrupted();
  }
  const std::string& refusal = state.refused > 0 ? state.lastError : events.lastRefusal;
  Require(state.frames != 0 || refusal.empty(), path,
          ": no frame of it could be followed. The last refusal: ", refusal);

  const LiveResult result = Finish(options.finish, session, slices, status, events, console);
  console.EndProgress();
  const std::vector<int> numbers = AllFrames(*result.sweep);
  for (const Finding& finding : result.training.findings)
  {
    console.Note("bigus: warning: " + Describe(finding, numbers));
  }
  const GaussianField& field = result.training.field;
  WriteField(result, options, console);
  status.Tell("ended", events, 1);

  PrintSummary(result, state, events, followed, options, console);
  console.Print("  slices    came in " + looker.Text());
  const Sweep lit = sweep ? sweep->LitBy(frames) : Sweep();
  const Json atLift =
      Score("held-out frames when the probe was lifted  ", liveField, lit, heldOut, options.engine, console);
  const Json finished =
      Score("held-out frames when finished              ", field, lit, heldOut, options.engine, console);
  console.Report({{"gaussians", field.Size()},
                  {"frames", state.frames},
                  {"seconds", followed},
                  {"passed_over", state.passedOver},
                  {"dropped", state.dropped},
                  {"refused", state.refused + events.refused},
                  {"reconnects", events.reconnects},
                  {"steps", state.steps},
                  {"latency", looker.ToJson()},
                  {"findings", FindingsJson(result.training.findings, numbers)},
                  {"held_out_at_lift", atLift},
                  {"held_out", finished}});
  return IsInterrupted() ? InterruptedCode() : Success;
}

void AddLive(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app =
      program.app.add_subcommand("live",
                                 "Follow the probe: a field that grows while frames arrive\n"
                                 "  bigus live sweep.igs.mha -o field.vtp\n"
                                 "  bigus live igtl://localhost:18944 -o field.vtp --transform ImageToReference\n"
                                 "  bigus live recording/poses.csv --follow -o field.vtp\n"
                                 "A sequence is replayed as it was recorded. An OpenIGTLink server, such as "
                                 "PlusServer, sends frames as IMAGE or TRACKEDFRAME. --follow takes the rows of a "
                                 "CSV of poses while it is written.");
  LiveSource& source = options->source;
  AddSequenceOptions(*app, source.sequence, "SOURCE",
                     "Tracked frames: .igs.mha .mha .mhd .nrrd .seq.nrrd .csv, or a server: igtl://HOST:PORT");
  AddReduceOption(*app, source.sequence.reduce);
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
  const char* server = "Of a server";
  app->add_flag("--follow", options->follow,
                "The CSV of poses is being written: take each row, and its PNG, as it comes");
  app->add_option("--device", source.device,
                  "IMAGE or TRACKEDFRAME whose pictures are followed; needed where several send pictures, and "
                  "--transform does not tell")
      ->type_name("DEVICE")
      ->group(server);
  app->add_option("--transform", source.transform,
                  "TRANSFORM that takes pixels to mm; without one an IMAGE says itself where it lies")
      ->type_name("DEVICE")
      ->group(server);
  app->add_option(
         "--plane", source.plane,
         "TRANSFORM that takes the pixels of a slice to mm: whenever it comes, the slice is sent back, as the IMAGE "
         "of BigusSlice")
      ->type_name("DEVICE")
      ->group(server);
  app->add_option("--slice-size", source.sliceSize, "Pixels of a slice that is sent")
      ->expected(2)
      ->check(WholeNumberIn(1, kLargestSlice))
      ->type_name("W H")
      ->capture_default_str();
  app->add_option("--listen", source.listen,
                  "Port of this machine at which several OpenIGTLink clients ask for slices by TRANSFORM")
      ->check(WholeNumberIn(1, 65535))
      ->type_name("PORT");
  app->add_option("--reconnect", source.reconnect, "Seconds for which a server that went away is waited for; 0: not")
      ->check(NumberIn(0, 1e6))
      ->type_name("S")
      ->capture_default_str()
      ->group(server);
  app->add_option("--pause", source.pause,
                  "Seconds without a frame of a server, or a row, after which the probe counts as lifted")
      ->check(NumberIn(0.1, 1e6))
      ->type_name("S")
      ->capture_default_str();
  app->add_option("--status", options->status, "File of JSON that tells scripts every second how the program is")
      ->type_name("FILE");
  app->add_option("--engine", options->engine, "What computes")->type_name("NAME")->capture_default_str();
  app->add_option("--seed", options->seed, "Of random numbers")
      ->check(WholeNumberIn(0, 1e9))
      ->type_name("N")
      ->capture_default_str();
  RunWhenChosen(app, program,
                [options, &program](Console& console)
                {
                  options->memory = program.options.memory;
                  return Live(console, *options);
                });
}

[[maybe_unused]] const std::size_t row =
    AddVerb({50, "bigus live sweep.igs.mha -o live.vtp", "the same while frames arrive", AddLive});

}  // namespace

}  // namespace bigus::command
