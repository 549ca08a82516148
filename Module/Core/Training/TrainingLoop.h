// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One training with every choice made: what Train ends with, and what decisions are tried on. Private to Core.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Engine/Exchange.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/Course.h"
#include "Core/Training/Report.h"
#include "Core/Training/Schedule.h"
#include "Core/Training/Targets.h"
#include "Core/Training/TrainingPlan.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

/// What training begins with.
struct Start
{
  GaussianField field;
  /// Seeds, which may have r < 0 where the plan wants none; training clips them. A field to continue from is not
  /// clipped before its first step.
  bool seeded = true;
};

/// What training ends with.
struct Fitted
{
  GaussianField field;
  std::vector<TrainingRecord> log;
  int iterations = 0;
  bool aborted = false;   ///< the callback said stop; the field is the best so far
  bool finished = false;  ///< all steps were taken, or validation said stop
};

/// When and where the state of a training is kept, as bytes for TrainingLoop::Resume. Both may be empty.
struct Keeping
{
  std::function<bool()> due;  ///< asked after every step; answers the same in all processes
  /// Called when it is due, and at the end of a training that is not finished, with what writes the state.
  std::function<void(const std::function<void(StateWriter&)>& write)> keep;
};

/// One training: Begin (with what SeedStart gives, say) or Resume, then Run.
class TrainingLoop
{
public:
  /// Trains on `frames` of the sweep as `plan` says. `withVirtualPlanes` spares making virtual planes again: it is what
  /// AddVirtualPlanes gives for the same frames and plan; null makes them. The processes of an `exchange`, which must outlive
  /// the loop, train one field together: all make the same calls, and `progress` answers the same in all.
  TrainingLoop(std::shared_ptr<const Sweep> sweep, std::vector<int> frames, TrainingPlan plan,
               ProgressCallback progress, std::shared_ptr<const Sweep> withVirtualPlanes = nullptr,
               Exchange& exchange = Exchange::Alone());

  /// Seeds over the volume of the frames, so bright that their renderings are near the frames.
  Start SeedStart();

  /// Trains from `start`, which is of the plan's beam.
  void Begin(Start start);

  /// Goes on where a loop of the same sweep, frames and plan was when it gave this state to its Keeping, and ends with
  /// the same bits. The time that a limit bounds goes on, too. Throws Error for bytes that are no such state.
  void Resume(std::string_view state);

  /// Trains on from where Begin, Resume or the run before left off, up to the fraction `until` of training: its end, or
  /// one of the first stage, up to kFirstStage. That sees recorded frames alone, so it rests on no choice about virtual
  /// planes. `validationFrames` (may be empty) serve early stop.
  Fitted Run(const std::vector<int>& validationFrames, double until = 1);

  /// The field for a caller who stops amid training, after at least one step. The steps of then are so large that the
  /// field jitters, so it takes a few more, ever smaller ones, and the mean of the last. Nothing goes on from here.
  GaussianField Settle(const std::vector<int>& validationFrames);

  /// What follows is by this plan, which may differ in the interpolation, the probe's beam and the time limit: seconds
  /// from now on.
  void Replan(TrainingPlan plan);

  /// From now on the state is kept.
  void SetKeeping(Keeping keeping) { keeping_ = std::move(keeping); }
  /// Gives the state to its Keeping, where it has one. After a run that finished, for what comes after the loop's steps:
  /// one that resumes with it takes none.
  void Keep() const;

  /// What it trains on.
  const Targets& targets() const { return targets_; }

  /// For what the caller renders afterwards.
  Engine& engine() { return *engine_; }

private:
  struct Lap;

  int FirstCoarsenessFor(std::size_t gaussians) const;
  GaussianField Load(Start start);
  void SetTargets();
  CourseBounds Bounds() const;
  Moment Now(double fraction) const { return {course_.iteration, fraction, course_.passes, course_.isFirstStage}; }
  bool HasEnded() const;
  bool EnterSecondStage(Lap& lap);
  void CorrectFrames(double fraction);
  Moment TakeStep(Lap& lap, double fraction);
  double Step(const std::vector<int>& batch, double stepsInAll, const Loss& loss, const LearningRates& rates);
  void AddLogLine(const std::vector<int>& validationFrames, const Moment& now);
  void Tell(const Lap& lap, double fraction);
  void Save(StateWriter& to) const;
  void TakeAverage(const std::vector<int>& validationFrames);
  Fitted Result(bool isFinished) const;

  Exchange& exchange_;
  std::shared_ptr<const Sweep> sweep_;
  std::vector<int> frames_;
  TrainingPlan plan_;
  Report report_;
  Keeping keeping_;
  std::unique_ptr<Engine> engine_;
  Targets targets_;
  Course course_;
  double secondsOfSecondStage_ = 0;  // at the first stage's pace
};

}  // namespace bigus
