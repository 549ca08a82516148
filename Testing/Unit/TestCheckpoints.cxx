// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A training that stops anywhere and goes on ends with the bits of one that never stopped.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Numerics/Checksum.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Trainer/Trainer.h"
#include "Support/Errors.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::Checkpoints;
using bigus::GaussianField;
using bigus::TrainerOptions;
using bigus::TrainingProgress;
using bigus::TrainingResult;
using bigus::test::RenderedSweep;

TrainerOptions Small()
{
  TrainerOptions options;
  options.automatic = false;
  options.gaussians = 300;
  options.iterations = 60;
  options.holdOut = 4;
  return options;
}

void ExpectSame(const TrainingResult& a, const TrainingResult& b)
{
  EXPECT_TRUE(a.field.means == b.field.means && a.field.scales == b.field.scales &&
              a.field.rotations == b.field.rotations && a.field.reflectivities == b.field.reflectivities &&
              a.field.transfer.gamma == b.field.transfer.gamma);
  EXPECT_EQ(a.field.beam.elevationSigma, b.field.beam.elevationSigma);
  EXPECT_EQ(a.field.beam.probeElevationSigma, b.field.beam.probeElevationSigma);
  EXPECT_EQ(a.field.beam.trainedNormals, b.field.beam.trainedNormals);
  EXPECT_EQ(a.imageToReference, b.imageToReference);
  EXPECT_EQ(a.iterations, b.iterations);
  ASSERT_EQ(a.view.has_value(), b.view.has_value());
  if (a.view)
  {
    EXPECT_TRUE(a.view->terms == b.view->terms && a.view->views.poses == b.view->views.poses);
  }
  ASSERT_EQ(a.log.size(), b.log.size());
  for (std::size_t line = 0; line < a.log.size(); ++line)
  {
    EXPECT_EQ(a.log[line].iteration, b.log[line].iteration);
    EXPECT_EQ(a.log[line].loss, b.log[line].loss);
    EXPECT_EQ(a.log[line].validationPsnr, b.log[line].validationPsnr);
  }
  ASSERT_EQ(a.decisions.size(), b.decisions.size());
  for (std::size_t k = 0; k < a.decisions.size(); ++k)
  {
    EXPECT_EQ(a.decisions[k].what, b.decisions[k].what);
    EXPECT_EQ(a.decisions[k].choice, b.decisions[k].choice);
    EXPECT_EQ(a.decisions[k].evidence, b.decisions[k].evidence);
  }
}

/// When a training is stopped: at a step, or at the n-th call of its callback.
struct Stop
{
  int step = 0, call = 0;
};

/// The state of a training that is stopped; nothing if it ends before.
std::optional<std::string> StateWhenStopped(const std::shared_ptr<const bigus::Sweep>& sweep,
                                            const TrainerOptions& options, Stop stop, const std::string& from = {},
                                            const GaussianField* start = nullptr)
{
  std::string kept;
  Checkpoints checkpoints;
  checkpoints.save = [&kept](const std::string& state) { kept = state; };
  checkpoints.resume = from;
  const auto goOn = [&stop](const TrainingProgress& now)
  {
    const bool isTraining = now.phase == TrainingProgress::Phase::Training;
    return stop.step > 0 ? !isTraining || now.record.iteration < stop.step : --stop.call > 0;
  };
  const TrainingResult part = bigus::Train(sweep, options, start, goOn, checkpoints);
  return part.finished ? std::nullopt : std::make_optional(kept);
}

TrainingResult Resumed(const std::shared_ptr<const bigus::Sweep>& sweep, const TrainerOptions& options,
                       const std::string& state, const GaussianField* start = nullptr)
{
  Checkpoints checkpoints;
  checkpoints.resume = state;
  return bigus::Train(sweep, options, start, {}, checkpoints);
}

/// A training that is stopped and goes on ends with the bits of one that never stopped.
void ExpectStopsDoNotMatter(const TrainerOptions& options, const std::vector<Stop>& stops,
                            const std::shared_ptr<const bigus::Sweep>& sweep = RenderedSweep())
{
  const TrainingResult whole = bigus::Train(sweep, options);
  for (const Stop& stop : stops)
  {
    SCOPED_TRACE("stopped at step " + std::to_string(stop.step) + " or call " + std::to_string(stop.call));
    const std::optional<std::string> state = StateWhenStopped(sweep, options, stop);
    ASSERT_TRUE(state);
    ASSERT_FALSE(state->empty());
    const TrainingResult resumed = Resumed(sweep, options, *state);
    EXPECT_TRUE(resumed.finished);
    ExpectSame(resumed, whole);
  }
}

TEST(Checkpoints, AStoppedTrainingGoesOnWithTheSameBits)
{
  for (const int threads : {1, 2})
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    ExpectStopsDoNotMatter(Small(), {{0, 1}, {0, 5}, {1}, {2}, {17}, {40}, {59}});
  }
}

/// Also while seeds are found and virtual planes are made.
TEST(Checkpoints, AStopAtAnyCallGoesOnWithTheSameBits)
{
  const auto sweep = RenderedSweep();
  TrainerOptions options = Small();
  options.iterations = 12;
  options.virtualPlanes = 2;
  const TrainingResult whole = bigus::Train(sweep, options);
  int call = 1;
  for (;; ++call)
  {
    SCOPED_TRACE("stopped at call " + std::to_string(call));
    const std::optional<std::string> state = StateWhenStopped(sweep, options, {0, call});
    if (!state)
    {
      break;
    }
    ExpectSame(Resumed(sweep, options, *state), whole);
  }
  EXPECT_GT(call, 12 + 3);  // planes report as well
}

TEST(Checkpoints, EveryEngineGoesOn)
{
  for (const char* engine : {"cpu-double", "reference"})
  {
    TrainerOptions options = Small();
    options.engine = engine;
    options.gaussians = 60;
    options.iterations = 12;
    options.virtualPlanes = 0;
    ExpectStopsDoNotMatter(options, {{5}});
  }
}

TEST(Checkpoints, ValidationAndDensificationGoOn)
{
  TrainerOptions options = Small();
  options.validation = 4;
  options.patience = 20;
  options.reflectivityRate = 0.8;  // coarse steps, so that the best field is not the last
  options.densification.interval = 7;
  options.densification.percentile = 60;
  ExpectStopsDoNotMatter(options, {{3}, {7}, {20}, {33}});
}

// Validation frames that stop to gain bring the last part forward. A stop amid that part goes on in it.
TEST(Checkpoints, AnEndThatValidationBroughtForwardGoesOn)
{
  TrainerOptions options = Small();
  options.iterations = 400;
  options.validation = 4;
  options.patience = 1;
  options.reflectivityRate = 0.8;  // coarse steps, so that some do not gain
  const int last = bigus::Train(RenderedSweep(), options).iterations;
  ASSERT_LT(last, 400);
  ExpectStopsDoNotMatter(options, {{last - 1}, {last - 20}});
}

TEST(Checkpoints, CorrectedFramesGoOn)
{
  TrainerOptions options = Small();
  options.iterations = 30;
  options.virtualPlanes = 1;
  options.frameGains = true;
  options.poseSmoothing = 1;
  ExpectStopsDoNotMatter(options, {{5}, {12}, {25}});
}

TEST(Checkpoints, ReducedAndInterleavedFramesGoOn)
{
  TrainerOptions options = Small();
  options.virtualPlanes = 0;
  ExpectStopsDoNotMatter(options, {{5}, {14}, {15}, {16}, {40}}, RenderedSweep(71, 65));
}

TEST(Checkpoints, NeedlesGoOn)
{
  // Thin Gaussians are held in double beside float until they are moved.
  const auto sweep = RenderedSweep();
  TrainerOptions options = Small();
  options.iterations = 10;
  options.batch = 1;
  GaussianField start = bigus::Train(sweep, options).field;
  for (std::size_t i = 0; i < start.Size(); i += 3)
  {
    start.scales[i][2] = start.scales[i][0] / 1000;
  }
  const TrainingResult whole = bigus::Train(sweep, options, &start);
  const std::optional<std::string> state = StateWhenStopped(sweep, options, {4}, {}, &start);
  ASSERT_TRUE(state);
  ExpectSame(Resumed(sweep, options, *state, &start), whole);
}

TEST(Checkpoints, DecisionsGoOn)
{
  TrainerOptions options;
  options.holdOut = 4;
  options.iterations = 40;
  options.maximumGaussians = 2000;
  ExpectStopsDoNotMatter(options, {{0, 1}, {0, 9}, {0, 30}, {0, 60}, {0, 90}, {20}});
}

TEST(Checkpoints, MayStopAgainAndAgain)
{
  const auto sweep = RenderedSweep();
  TrainerOptions options;
  options.holdOut = 4;
  options.iterations = 40;
  options.maximumGaussians = 1500;
  const TrainingResult whole = bigus::Train(sweep, options);
  std::string state;
  int stops = 0;
  for (; stops < 100; ++stops)
  {
    const std::optional<std::string> next = StateWhenStopped(sweep, options, {0, 30}, state);
    if (!next)
    {
      break;
    }
    state = *next;
  }
  EXPECT_GE(stops, 3);
  EXPECT_LT(stops, 100);
  ExpectSame(Resumed(sweep, options, state), whole);
}

/// A training that goes on, and how often it reports.
TrainingResult Resumed(const std::shared_ptr<const bigus::Sweep>& sweep, const TrainerOptions& options,
                       const std::string& state, int& calls)
{
  Checkpoints checkpoints;
  checkpoints.resume = state;
  calls = 0;
  return bigus::Train(
      sweep, options, nullptr, [&calls](const TrainingProgress&) { return ++calls > 0; }, checkpoints);
}

/// Directions are learnt after the last step. A stop there loses what was learnt of them, and not that there are any.
TEST(Checkpoints, AStopWhileDirectionsAreLearntGoesOn)
{
  const auto sweep = RenderedSweep();
  for (int frame = 0; frame < sweep->NumberOfFrames(); ++frame)
  {
    auto&& axes = sweep->imageToReference[frame].topLeftCorner<3, 3>();
    axes = Eigen::AngleAxisd(frame % 2 ? 0.1 : -0.1, Eigen::Vector3d::UnitX()) * axes.eval();
  }
  TrainerOptions options = Small();
  constexpr int kSteps = 12;  // of the field, and as many of directions
  options.iterations = kSteps;
  options.virtualPlanes = 0;
  options.viewDependence = true;
  int calls = 0;
  const TrainingResult whole = Resumed(sweep, options, {}, calls);
  ASSERT_TRUE(whole.view);
  for (int call = 1; call <= calls; ++call)
  {
    SCOPED_TRACE("stopped at call " + std::to_string(call));
    const std::optional<std::string> state = StateWhenStopped(sweep, options, {0, call});
    ASSERT_TRUE(state) << "finished without what it was asked for";
    int callsLeft = 0;
    ExpectSame(Resumed(sweep, options, *state, callsLeft), whole);
    if (call > calls - kSteps)
    {
      EXPECT_LE(callsLeft, 1 + kSteps) << "steps of the field are taken again";
    }
  }
}

/// Two sweeps whose planes meet at so many degrees.
std::shared_ptr<const bigus::Sweep> TwoSweeps(double degrees)
{
  bigus::PhantomOptions made;
  made.width = made.height = 32;
  made.pixelSize = 0.5;
  made.frames = 24;
  const auto one = std::make_shared<const bigus::Sweep>(bigus::Phantom(made).MakeSweep());
  made.sweepAngle = degrees;
  return bigus::Join({one, std::make_shared<const bigus::Sweep>(bigus::Phantom(made).MakeSweep())});
}

/// Whether directions count is asked by short trainings, once; where sweeps cross each is then trained by itself.
TEST(Checkpoints, AStopWhileDirectionsAreAskedForGoesOn)
{
  for (const double degrees : {15.0, 90.0})
  {
    const auto sweep = TwoSweeps(degrees);
    TrainerOptions options;
    options.gaussians = 2000;
    options.iterations = 60;
    options.poseSmoothing = 0;
    options.elevationSigma = 0;
    options.virtualPlanes = 1;
    options.interpolation = bigus::FrameInterpolation{};
    int calls = 0;
    const TrainingResult whole = Resumed(sweep, options, {}, calls);
    ASSERT_TRUE(whole.view) << degrees;
    for (const int call : {calls, calls - 70, calls / 2, calls / 3})
    {
      SCOPED_TRACE("stopped at call " + std::to_string(call) + " of " + std::to_string(calls));
      const std::optional<std::string> state = StateWhenStopped(sweep, options, {0, call});
      ASSERT_TRUE(state) << "finished without what it was asked for";
      int callsLeft = 0;
      ExpectSame(Resumed(sweep, options, *state, callsLeft), whole);
      if (call >= calls - 70)
      {
        EXPECT_LT(callsLeft, calls / 2) << "nothing was kept";
      }
    }
  }
}

TEST(Checkpoints, AStopAtTheLastStepStopsNothing)
{
  const auto sweep = RenderedSweep();
  const auto stop = [](const TrainingProgress& now) { return now.record.iteration < 60; };
  const TrainingResult stopped = bigus::Train(sweep, Small(), nullptr, stop);
  EXPECT_TRUE(stopped.finished);
  EXPECT_FALSE(stopped.aborted);
  ExpectSame(stopped, bigus::Train(sweep, Small()));
}

TEST(Checkpoints, AreSavedWhileNothingStops)
{
  const auto sweep = RenderedSweep();
  const TrainingResult whole = bigus::Train(sweep, Small());
  std::vector<std::string> states;
  Checkpoints checkpoints;
  checkpoints.interval = 0;
  checkpoints.save = [&states](const std::string& state) { states.push_back(state); };
  const TrainingResult kept = bigus::Train(sweep, Small(), nullptr, {}, checkpoints);
  EXPECT_TRUE(kept.finished);
  ExpectSame(kept, whole);
  ASSERT_GE(states.size(), 60u);  // one when all is decided, and one a step but the last
  ExpectSame(Resumed(sweep, Small(), states[30]), whole);
  checkpoints.interval = 1e6;
  states.clear();
  bigus::Train(sweep, Small(), nullptr, {}, checkpoints);
  EXPECT_EQ(states.size(), 1u);
}

TEST(Checkpoints, ATimeLimitMayBeProlonged)
{
  const auto sweep = RenderedSweep();
  TrainerOptions options = Small();
  options.iterations = 10000000;
  options.timeLimit = 0.5;
  std::string kept;
  Checkpoints checkpoints;
  checkpoints.save = [&kept](const std::string& state) { kept = state; };
  const TrainingResult limited = bigus::Train(sweep, options, nullptr, {}, checkpoints);
  EXPECT_FALSE(limited.finished);
  EXPECT_FALSE(limited.aborted);
  checkpoints.resume = kept;
  const TrainingResult nothingMore = bigus::Train(sweep, options, nullptr, {}, checkpoints);
  EXPECT_EQ(nothingMore.iterations, limited.iterations);
  EXPECT_EQ(nothingMore.field.means, limited.field.means);
  options.timeLimit = limited.seconds + 0.5;  // a busy machine may have been late by more than that
  const TrainingResult longer = bigus::Train(sweep, options, nullptr, {}, checkpoints);
  EXPECT_GT(longer.iterations, limited.iterations);
  EXPECT_FALSE(longer.finished);
}

/// A checkpoint of a small training, in its middle.
const std::string& AState()
{
  static const std::string state = *StateWhenStopped(RenderedSweep(), Small(), {30});
  return state;
}

TEST(Checkpoints, ACutOrChangedCheckpointIsRefused)
{
  const auto sweep = RenderedSweep();
  const std::string& state = AState();
  ASSERT_GT(state.size(), 10000u);
  for (std::size_t size = 1; size < state.size(); size += size < 2000 ? 1 : 997)
  {
    EXPECT_THROW(Resumed(sweep, Small(), state.substr(0, size)), bigus::Error) << size;
  }
  for (std::size_t at = 0; at < state.size(); at += at < 2000 ? 1 : 997)
  {
    std::string changed = state;
    changed[at] ^= static_cast<char>(1 << at % 8);
    EXPECT_THROW(Resumed(sweep, Small(), changed), bigus::Error) << at;
  }
  EXPECT_THROW(Resumed(sweep, Small(), state + "x"), bigus::Error);
  EXPECT_THROW(Resumed(sweep, Small(), "a text"), bigus::Error);
}

/// Magic, format, order of bytes; then size and checksum of what follows.
constexpr std::size_t kChecksumAt = 24, kBodyAt = 32;

TEST(Checkpoints, AForgedCheckpointGivesAnErrorOrASoundField)
{
  // Somebody who knows the checksum can write anything.
  const auto sweep = RenderedSweep();
  bigus::test::Random random(5);
  int refused = 0, trained = 0;
  for (int forgery = 0; forgery < 240; ++forgery)
  {
    std::string state = AState();
    for (int change = 0; change < 1 + forgery % 3; ++change)
    {
      // Every second one in the last third, where numbers of the field are.
      const double low = forgery % 2 ? 0.66 * static_cast<double>(state.size()) : double(kBodyAt);
      const auto at = static_cast<std::size_t>(random.Uniform(low, static_cast<double>(state.size())));
      state[at] = static_cast<char>(forgery % 5 ? state[at] ^ 1 << forgery % 8 : random.Uniform(-128, 127));
    }
    const std::uint64_t checksum = bigus::Checksum().Add(state.data() + kBodyAt, state.size() - kBodyAt).Value();
    std::memcpy(state.data() + kChecksumAt, &checksum, sizeof(checksum));
    Checkpoints checkpoints;
    checkpoints.resume = state;
    try
    {
      int calls = 8;
      const auto field = bigus::Train(
                             sweep, Small(), nullptr, [&](const TrainingProgress&) { return --calls > 0; }, checkpoints)
                             .field;
      EXPECT_NO_THROW(field.Validate());
      ++trained;
    }
    catch (const bigus::Error&)
    {
      ++refused;
    }
  }
  EXPECT_GT(refused, 30);
  EXPECT_GT(trained, 30);
}

TEST(Checkpoints, AnotherTrainingIsNamed)
{
  const auto expectRefused = [](const std::shared_ptr<const bigus::Sweep>& sweep, const TrainerOptions& options,
                                const char* difference) {
    bigus::test::ExpectRefused([&] { Resumed(sweep, options, AState()); }, {"another training", difference});
  };
  TrainerOptions options = Small();
  options.seed = 7;
  expectRefused(RenderedSweep(), options, "seed was 1 and is 7");
  options = Small();
  options.engine = "cpu-double";
  expectRefused(RenderedSweep(), options, "engine was");
  auto sweep = RenderedSweep();
  bigus::test::Pixels(*sweep)[1234] *= 0.999f;
  expectRefused(sweep, Small(), "checksum of the pixels");
  sweep = RenderedSweep();
  sweep->imageToReference[3](2, 3) += 1e-9;
  expectRefused(sweep, Small(), "checksum of the poses");
  sweep = bigus::test::BlackSweep(12, 48, 40, 0.4, 0.4);
  for (int frame = 0; frame < 12; ++frame)  // none shows what another does
  {
    bigus::test::Pixels(*sweep)[frame * 48 * 40 + frame] = 1;
  }
  expectRefused(sweep, Small(), "was 24 frames of 48 x 40 pixels and is 12 frames");
  options = Small();
  options.timeLimit = 1000;  // may be another
  EXPECT_NO_THROW(Resumed(RenderedSweep(), options, AState()));
}

}  // namespace
