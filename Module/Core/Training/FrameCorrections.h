// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Errors of the training frames themselves, found while training: their brightness and their poses. Private to Core.
#pragma once

#include <Eigen/Dense>
#include <memory>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/TrainingPlan.h"

namespace bigus
{

/// What was found for the frames that are trained on, one by one. Empty where it was not looked for.
struct Corrections
{
  std::vector<Eigen::Matrix4d> imageToReference;
  std::vector<double> gains, offsets;  ///< intensity, to be undone: (T - offset) / gain
};

// Everywhere `present` begins with the `frames` of `recorded`, in their order; virtual planes after them stay as they
// are.

/// A first guess at frames' gains, from neighbours alone, removed: a field that began with bands of brightness keeps
/// them between frames.
std::shared_ptr<const Sweep> Levelled(const Sweep& recorded, const std::vector<int>& frames, const Sweep& present);

/// Every recorded frame compared with the field that the engine holds: its pose, its gain and its offset, where the plan
/// asks for it.
Corrections FindCorrections(Engine& engine, const Sweep& recorded, const std::vector<int>& frames, const Sweep& present,
                            const TrainingPlan& plan);

/// `present` with the poses that were found, and with the recorded pixels less gains and offsets.
std::shared_ptr<const Sweep> Corrected(const Corrections& found, const Sweep& recorded, const std::vector<int>& frames,
                                       const Sweep& present);

}  // namespace bigus
