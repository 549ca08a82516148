// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One training with every choice made: what Train ends with, and what decisions are tried on. Private to Core.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Engine/Exchange.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/FrameCorrections.h"
#include "Core/Training/Stopwatch.h"
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

/// The sweep with a mask of the pixels that count in the loss. Beside the lit area frames contradict each other:
/// tissue outside one's fan lies inside its neighbour's. So what is dark within an SSIM window of lit pixels does not
/// count. Further out it is black, lest Gaussians reach where no frame looks; nor does it count if `ignoreMasked`.
std::shared_ptr<const Sweep> WithCountedPixels(const Sweep& sweep, bool ignoreMasked);

/// The step sizes that a training of such a field begins with.
LearningRates FirstRates(const TrainingPlan& plan, const GaussianField& field);

/// One training: Begin (with what SeedStart gives, say) or Resume, then Run.
class TrainingLoop
{
public:
  /// Trains on `frames` of the sweep as `plan` says. `withVirtualPlanes` spares making virtual planes again: it is what
  /// AddVirtualPlanes gives for the same frames and plan; null makes them. With an `exchange`, which must outlive the
  /// loop, processes train one field together: all make the same calls, and `progress` answers the same in all.
  TrainingLoop(std::shared_ptr<const Sweep> sweep, std::vector<int> frames, TrainingPlan plan,
               ProgressCallback progress, std::shared_ptr<const Sweep> withVirtualPlanes = nullptr,
               Exchange* exchange = nullptr);
  ~TrainingLoop();

  /// Seeds over the volume of the frames, scaled and solved so that their renderings are near the frames.
  Start SeedStart();

  /// Trains from `start`, which is of the plan's beam.
  void Begin(Start start);

  /// Goes on where a loop of the same sweep, frames and plan was when it gave this state to its Keeping, and ends with
  /// the same bits. The time that a limit bounds goes on, too. Throws Error for bytes that are no such state.
  void Resume(std::string_view state);

  /// Where a run ends. The first stage sees recorded frames alone, so it rests on no choice about virtual planes.
  enum class Until
  {
    FirstStage,
    End
  };

  /// Trains on from where Begin, Resume or a run until the first stage's end left off. `validationFrames` (may be empty)
  /// serve early stop.
  Fitted Run(const std::vector<int>& validationFrames, Until until = Until::End);

  /// The field for a caller who stops amid training, after at least one step. The steps of then are so large that the
  /// field jitters, so it takes a few more, ever smaller ones, and the mean of the last. Nothing goes on from here.
  GaussianField Settle(const std::vector<int>& validationFrames);

  /// Of two fields the one that shows a few training frames better, `a` where both are as good. Nothing goes on from here.
  GaussianField Nearer(GaussianField a, const GaussianField& b);

  /// False where what training sees changes on the way, by gains or poses of frames found in it: then there is one stage.
  static bool HasFirstStage(const TrainingPlan& plan);

  /// What follows is by this plan, which may differ in the interpolation, the probe's beam and the time limit: seconds
  /// from now on.
  void Replan(TrainingPlan plan);

  /// From now on the state is kept.
  void SetKeeping(Keeping keeping) { keeping_ = std::move(keeping); }

  /// For what the caller renders afterwards.
  Engine& engine() { return *engine_; }

private:
  struct Course;
  struct Targets
  {
    int planes = 0;      // virtual ones in every gap
    int coarseness = 1;  // the frames' sides are divided by it
    int pixelStep = 1;   // pixels that lie so far apart are frames of their own, see Sweep::Interleaved; 1 with planes
    bool flow = true;    // if the plan's interpolation has it
  };

  int FirstCoarsenessFor(std::size_t gaussians) const;
  void TargetFrames(int coarseness);
  bool TargetPlanes(const Targets& targets, double most = 0);
  std::optional<Targets> TargetPlanesInTime(double secondsOfPass);
  void UploadTargets();
  ParameterLimits Limits() const;
  GaussianField Load(Start start);
  double Fraction(int iteration, double trainingStart) const;
  double RateLeft(double fraction) const;
  double StepsInAll(double fraction) const;
  double ContinuedRate(double fraction) const;
  double Growth() const;
  double SecondsLeft(int iteration, double pace) const;
  double Step(const std::vector<int>& batch, double steps, const Loss& loss, const LearningRates& rates);
  void Correct(const Corrections& found);
  void Save(StateWriter& to) const;
  void SavePart(StateWriter& to) const;
  void Restructure(const DensificationOptions& densification);
  bool Proceed(TrainingProgress::Phase phase, double fraction);
  double Seconds() const;

  Exchange* exchange_;
  Stopwatch watch_;
  std::shared_ptr<const Sweep> sweep_;
  std::vector<int> frames_;
  TrainingPlan plan_;
  ProgressCallback progress_;
  Keeping keeping_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<Course> course_;                  // null before Begin and Resume
  std::shared_ptr<const Sweep> withVirtualPlanes_;  // as given
  std::shared_ptr<const Sweep> targetSweep_;        // what the engine trains on: the frames, perhaps reduced or
  std::vector<int> targets_;                        // corrected, then virtual planes; and which of its frames
  bool isFirstStage_ = false;
  int coarseness_ = 1;  // the sides of what is trained on are divided by it
  TrainingProgress report_;
  double secondsOfSecondStage_ = 0;  // at the first stage's pace
  bool aborted_ = false;
};

}  // namespace bigus
