// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One training with every choice made: what Train ends with, and what decisions are tried on. Private to Core.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
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
  bool aborted = false;  ///< the callback said stop; the field is the best so far
};

/// One training: upload the frames once, seed and solve, then run. SeedAndSolve and Run may be called more than once.
class TrainingLoop
{
public:
  /// Trains on `frames` of the sweep as `plan` says. `withVirtualPlanes` spares making virtual planes again: it is what
  /// AddVirtualPlanes gives for the same frames and plan; null makes them.
  TrainingLoop(std::shared_ptr<const Sweep> sweep, std::vector<int> frames, TrainingPlan plan,
               ProgressCallback progress, std::shared_ptr<const Sweep> withVirtualPlanes = nullptr);

  /// Seeds over the volume of the frames, scaled and solved so that their renderings are near the frames.
  Start SeedAndSolve();

  /// Trains from `start`, which is of the plan's beam. `validationFrames` (may be empty) serve early stop.
  Fitted Run(Start start, const std::vector<int>& validationFrames);

  /// For what the caller renders afterwards.
  Engine& engine() { return *engine_; }

private:
  void UploadTargets();
  ParameterLimits Limits() const;
  LearningRates FirstRates(const GaussianField& field) const;
  GaussianField Load(Start start);
  double Fraction(int iteration, double trainingStart) const;
  void Correct();
  void Restructure(const DensificationOptions& densification);
  bool Proceed(TrainingProgress::Phase phase, double fraction);

  Stopwatch watch_;
  std::shared_ptr<const Sweep> sweep_;
  std::vector<int> frames_;
  TrainingPlan plan_;
  ProgressCallback progress_;
  std::unique_ptr<Engine> engine_;
  std::shared_ptr<const Sweep> targetSweep_;  // what the engine trains on: the frames, perhaps corrected, then
  std::vector<int> targets_;                  // virtual planes; and which of its frames
  TrainingProgress report_;
  bool aborted_ = false;
};

}  // namespace bigus
