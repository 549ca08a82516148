// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Errors of the training frames' brightness, found while training. Private to Core.
#pragma once

#include <memory>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// What was found for the frames that are trained on, one by one. Empty before it was looked for.
struct Corrections
{
  std::vector<double> gains, offsets;  ///< intensity, to be undone: (T - offset) / gain
};

// Everywhere `present` begins with the `frames` of `recorded`, in their order; virtual planes after them stay as they
// are.

/// A first guess at frames' gains, from neighbours alone, removed: a field that began with bands of brightness keeps
/// them between frames.
std::shared_ptr<const Sweep> Levelled(const Sweep& recorded, const std::vector<int>& frames, const Sweep& present);

/// Gain and offset of every frame against the field that the engine holds, by least squares, drawn to (1, 0) as far as
/// the field does not explain the frame. The mean gain and offset of all frames stay 1 and 0, since they belong to the
/// scene.
Corrections FindCorrections(Engine& engine, const Sweep& recorded, const std::vector<int>& frames);

/// `present` with the recorded pixels less gains and offsets.
std::shared_ptr<const Sweep> Corrected(const Corrections& found, const Sweep& recorded, const std::vector<int>& frames,
                                       const Sweep& present);

}  // namespace bigus
