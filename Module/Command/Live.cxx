// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus live: a field that grows while frames arrive.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <tuple>
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
#include "IgtConnection.h"
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

/// Newest looks whose times are kept.
constexpr std::size_t kMostLooks = 100000;

/// Pixels of a side of the picture that is sent back.
constexpr int kLargestSlice = 2048;

struct Options
{
  SequenceOptions sequence;
  std::string transform, plane;  ///< devices of an OpenIGTLink server
  std::vector<int> sliceSize{256, 256};
  double pause = 3;  ///< s
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
  explicit Looker(LiveSession& session) : session_(session) {}

  /// The picture now.
  const std::vector<float>& Look(const Eigen::Matrix4d& imageToReference, int width, int height)
  {
    image_.resize(static_cast<std::size_t>(width) * height);
    const Clock::time_point start = Clock::now();
    session_.Render(SlicePlane::FromImageToReference(imageToReference, width, height), ViewOutput::Intensity,
                    image_.data());
    if (latencies_.size() == kMostLooks)
    {
      latencies_.erase(latencies_.begin(), latencies_.begin() + kMostLooks / 2);
    }
    latencies_.push_back(1000 * SecondsSince(start));
    return image_;
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

/// Frames that a server sends, until it stops.
class Server
{
public:
  Server(const Options& options, LiveSession& session, Looker& looker, Console& console)
      : options_(options), session_(session), looker_(looker), console_(console)
  {
  }

  /// Returns when no frame came for as long as a pause, the server closed, or the program is interrupted.
  void Follow()
  {
    IgtConnection connection(IgtAddress::Parse(options_.sequence.path));
    console_.Note("Connected to " + options_.sequence.path + ". Following until no frame comes for " +
                  FormatNumber(options_.pause, 1) + " s, or Ctrl-C.");
    const Clock::time_point begin = Clock::now();
    Clock::time_point lastFrame = begin;
    IgtConnection::Message message;
    while (!IsInterrupted() && (frames_ == 0 || SecondsSince(lastFrame) < options_.pause))
    {
      IgtConnection::Event event;
      try
      {
        event = connection.Receive(kLook, message);
      }
      catch (const Error& error)  // where the next message begins is not known
      {
        ++refused_;
        console_.Note(std::string("bigus: ") + error.what() + " What came so far is kept.");
        break;
      }
      if (event == IgtConnection::Event::Closed)
      {
        console_.Note("The server closed the connection.");
        break;
      }
      if (event == IgtConnection::Event::Silence)
      {
        continue;
      }
      try
      {
        if (message.header.type == "IMAGE" && TakeImage(message, SecondsSince(begin)))
        {
          lastFrame = Clock::now();
        }
        else if (message.header.type == "TRANSFORM" && message.header.device == options_.transform)
        {
          pose_ = ParseIgtTransform(message.header, message.body);
          poseTime_ = message.header.timestamp;
        }
        else if (message.header.type == "TRANSFORM" && message.header.device == options_.plane)
        {
          SendSlice(connection, ParseIgtTransform(message.header, message.body), message.header.timestamp);
        }
      }
      catch (const Error& error)
      {
        ++refused_;
        if (error.what() != lastError_)
        {
          console_.Note(std::string("bigus: ") + error.what());
          lastError_ = error.what();
        }
      }
      console_.Progress("Following", 0, std::to_string(session_.GetState().gaussians) + " Gaussians");
    }
  }

  /// Messages that were no frame, plane or pose.
  std::size_t Refused() const { return refused_; }

private:
  bool TakeImage(const IgtConnection::Message& message, double now)
  {
    IgtImage image = ParseIgtImage(message.header, message.body);
    LiveFrame frame;
    frame.timestamp = message.header.timestamp > 0 ? message.header.timestamp : now;
    if (!options_.transform.empty())
    {
      constexpr double kTogether = 0.05;  // s: what the tracker said this near to the picture belongs to it
      if (!pose_ || std::abs(poseTime_ - message.header.timestamp) > kTogether)
      {
        throw Error("an IMAGE came without a TRANSFORM of '" + options_.transform + "' at its time.");
      }
      image.imageToWorld = *pose_;
    }
    frame.width = image.width;
    frame.height = image.height;
    frame.pixels = std::move(image.pixels);
    frame.imageToReference = image.imageToWorld;
    const Eigen::Matrix4d pose = frame.imageToReference;
    session_.Add(std::move(frame));
    ++frames_;
    if (Clock::now() >= nextLook_)
    {
      looker_.Look(pose, image.width, image.height);
      nextLook_ = Clock::now() + std::chrono::milliseconds(100);
    }
    return true;
  }

  void SendSlice(IgtConnection& connection, const Eigen::Matrix4d& imageToWorld, double timestamp)
  {
    IgtImage slice;
    slice.width = options_.sliceSize[0];
    slice.height = options_.sliceSize[1];
    slice.imageToWorld = imageToWorld;
    const std::vector<float>& picture = looker_.Look(imageToWorld, slice.width, slice.height);
    slice.pixels.resize(picture.size());
    std::transform(picture.begin(), picture.end(), slice.pixels.begin(),
                   [](float value) { return static_cast<std::uint8_t>(std::lround(255 * value)); });
    connection.Send(PackIgtImage("BigusSlice", timestamp, slice));
  }

  const Options& options_;
  LiveSession& session_;
  Looker& looker_;
  Console& console_;
  std::size_t frames_ = 0, refused_ = 0;
  std::string lastError_;
  std::optional<Eigen::Matrix4d> pose_;
  double poseTime_ = 0;
  Clock::time_point nextLook_;
};

/// Hands over the sweep's frames when they are due.
void Replay(const Sweep& sweep, const std::vector<int>& frames, const Options& options, LiveSession& session,
            Looker& looker, Console& console)
{
  const std::vector<double> times = ArrivalTimes(sweep, options);
  const Clock::time_point start = Clock::now();
  double nextLook = kLook;
  for (const int frame : frames)
  {
    const LiveFrame live = FrameOf(sweep, frame, times[frame]);
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
      looker.Look(live.imageToReference, live.width, live.height);
      nextLook = SecondsSince(start) + kLook;
      console.Progress("Following", times[frame] / std::max(times.back(), 1e-9),
                       std::to_string(session.GetState().gaussians) + " Gaussians");
    }
  }
}

ExitCode Live(Console& console, Options options)
{
  RequireDistinct({options.sequence.path, options.sequence.chain.config}, {options.output});
  RequireWritable(options.output);
  RequireFieldName(options.output);
  options.live.training.engine = options.engine;
  options.live.training.seed = static_cast<std::uint64_t>(options.seed);
  const bool isServer = IgtAddress::IsOne(options.sequence.path);
  std::shared_ptr<const Sweep> sweep;
  std::vector<int> frames, heldOut;
  if (isServer)
  {
    if (options.holdOut > 0)
    {
      throw Error("--hold-out needs a sequence that is replayed; frames of a server are all followed.");
    }
    IgtAddress::Parse(options.sequence.path);
  }
  else
  {
    sweep = ReadSweep(options.sequence, console);
    RequireTimes(*sweep, options);
    std::tie(frames, heldOut) = SplitHoldOut(sweep->NumberOfFrames(), options.holdOut);
  }

  LiveSession session(options.live);
  Looker looker(session);
  const Clock::time_point start = Clock::now();
  std::size_t notFrames = 0;
  if (isServer)
  {
    Server server(options, session, looker, console);
    server.Follow();
    notFrames = server.Refused();
  }
  else
  {
    Replay(*sweep, frames, options, session, looker, console);
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
                std::to_string(state.refused + notFrames) + " refused");
  console.Print("  steps     " + std::to_string(state.steps) + " while frames came, " +
                std::to_string(result.training.iterations) + " in " + FormatNumber(result.training.seconds, 1) +
                " s afterwards");
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
                  {"refused", state.refused + notFrames},
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
  CLI::App* app =
      program.app.add_subcommand("live",
                                 "Follow the probe: a field that grows while frames arrive\n"
                                 "  bigus live sweep.igs.mha -o field.vtp\n"
                                 "  bigus live igtl://localhost:18944 -o field.vtp --transform ImageToReference\n"
                                 "A sequence is replayed as it was recorded. An OpenIGTLink server, such as "
                                 "PlusServer, sends frames as IMAGE.");
  AddSequenceOptions(*app, options->sequence, "SOURCE",
                     "Tracked frames: .igs.mha .mha .mhd .nrrd .seq.nrrd .csv, or a server: igtl://HOST:PORT");
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
  const char* server = "Of a server";
  app->add_option("--transform", options->transform,
                  "TRANSFORM that takes pixels to mm; without one an IMAGE says itself where it lies")
      ->type_name("DEVICE")
      ->group(server);
  app->add_option(
         "--plane", options->plane,
         "TRANSFORM that takes the pixels of a slice to mm: whenever it comes, the slice is sent back, as the IMAGE "
         "of BigusSlice")
      ->type_name("DEVICE")
      ->group(server);
  app->add_option("--slice-size", options->sliceSize, "Pixels of that slice")
      ->expected(2)
      ->check(WholeNumberIn(1, kLargestSlice))
      ->type_name("W H")
      ->capture_default_str()
      ->group(server);
  app->add_option("--pause", options->pause, "Seconds without a frame after which the probe counts as lifted")
      ->check(NumberIn(0.1, 1e6))
      ->type_name("S")
      ->capture_default_str()
      ->group(server);
  app->add_option("--engine", options->engine, "What computes")->type_name("NAME")->capture_default_str();
  app->add_option("--seed", options->seed, "Of random numbers")
      ->check(WholeNumberIn(0, 1e9))
      ->type_name("N")
      ->capture_default_str();
  RunWhenChosen(app, program, [options](Console& console) { return Live(console, *options); });
}

}  // namespace bigus::command
