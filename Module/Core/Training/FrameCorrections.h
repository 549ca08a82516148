// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Errors of the training frames themselves, found while training: their brightness and their poses. Private to Core.
#pragma once

#include <memory>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/TrainingPlan.h"

namespace bigus
{

// In both, `present` begins with the `frames` of `recorded`, in their order; virtual planes after them stay as they
// are.

/// A first guess at frames' gains, from neighbours alone, removed: a field that began with bands of brightness keeps
/// them between frames.
std::shared_ptr<const Sweep> Levelled(const Sweep& recorded, const std::vector<int>& frames, const Sweep& present);

/// Every recorded frame compared with the field that the engine holds: its pose refined, and its gain and offset
/// removed, where the plan asks for it.
std::shared_ptr<const Sweep> Corrected(Engine& engine, const Sweep& recorded, const std::vector<int>& frames,
                                       const Sweep& present, const TrainingPlan& plan);

}  // namespace bigus
