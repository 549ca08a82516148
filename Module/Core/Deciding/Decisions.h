// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a scene needs, found out before training: every choice a caller left open, made on validation frames.
// Private to Core.
#pragma once

#include <memory>
#include <vector>

#include "Core/Deciding/Decision.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/TrainerOptions.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

/// Makes the choices that `options` leaves open, with what it cost and why. Frames to train on are split into
/// frames to try on and validation frames (the caller's held-out frames are not among them); short trainings
/// on at most 32 consecutive frames are compared on the latter, a choice at a time. Something costly or
/// unusual is taken when it gains more than 0.03 dB, more than half the standard error of the gain, and on at
/// least half of the frames. With fewer than 8 frames nothing can be compared, and all is left to
/// PlanByGeometry. When `progress` returns false the choices made so far stand.
std::vector<Decision> Decide(std::shared_ptr<const Sweep> sweep, const std::vector<int>& frames,
                             TrainerOptions& options, const ProgressCallback& progress);

}  // namespace bigus
