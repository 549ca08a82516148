// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a scene needs, found out before training: choices that a caller left open, made on validation frames. Private to
// Core.
#pragma once

#include <vector>

#include "Core/Deciding/Decision.h"
#include "Core/Deciding/PoseCorrection.h"
#include "Core/Deciding/TrialKeeper.h"
#include "Core/Model/Sequences.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/TrainerOptions.h"
#include "Core/Training/TrainingPlan.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

/// Improves `plan`, which is PlanByGeometry's for these frames, where `asked` leaves a choice open: virtual planes,
/// their interpolation, the beam and the number of Gaussians, in this order. Returns a record of each. Short trainings
/// on a part of the frames are compared on others of them (Trials.h) by the rules of DecisionRules.h. With fewer than
/// kFewestFrames frames the plan stays as it is. When `progress` returns false the choices made so far stand. `keeper` has the
/// scores of trials that were made before. Of `exchange` see TrainingLoop.
std::vector<Decision> Decide(const Sweep& sweep, const std::vector<int>& frames, const TrainerOptions& asked,
                             TrainingPlan& plan, const ProgressCallback& progress, TrialKeeper& keeper,
                             Exchange& exchange);

/// Of a sequence of which pictures cannot tell whether its poses should be smoothed (PoseCorrection::IsUndecided): poses
/// smoothed by the strength of the first step, 1, where a short training at them predicts validation frames better than one
/// at `undecided`, else those, as also when `progress` returns false.
PoseCorrection DecidePoses(const Sequence& sequence, PoseCorrection undecided, const TrainerOptions& asked,
                           const ProgressCallback& progress, TrialKeeper& keeper, Exchange& exchange);

}  // namespace bigus
