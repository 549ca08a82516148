// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How far a slice's pixels lie from what was recorded.
#pragma once

#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// The distance from every pixel of `plane` to the nearest of the sweep's `frames`, mm: `distances` gets [height][width]
/// floats. A frame is the rectangle that its pixels fill, lit or not. Half the spacing of the frames is the most that a
/// slice between neighbouring frames shows; half of a gap is what it shows in the middle of the gap. No pixel of the
/// sweep is read. Throws Error when `frames` is empty. Where a frame's steps are not orthogonal a pixel beside the
/// frame gets the distance to the foot in the frame's own coordinates, which is at least the distance.
void DistanceToFrames(const Sweep& sweep, const std::vector<int>& frames, const SlicePlane& plane, float* distances);

}  // namespace bigus
