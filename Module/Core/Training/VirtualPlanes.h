// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Planes between the frames of a sweep, as a regulariser: what the field should look like where nobody looked.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "Core/Model/Sweep.h"
#include "Core/Training/FrameInterpolation.h"

namespace bigus
{

/// A sweep of `frames` (in that order) followed by `perGap` planes evenly spaced in every gap between neighbours. A
/// virtual plane's pose is interpolated between its neighbours' and its pixels are guessed from them. Gaps that are breaks
/// in the sweep (LongestGaps), and those from one sequence to the next, get none. Pixels of the
/// result are of the sweep's type, its mask is the sweep's. Its times count in frames: that of a plane a third of the
/// way from frame 4 to frame 5 is 4.33. perGap >= 1. `goOn` (may be empty) is asked now and then, with the share that is
/// done; when it says false the result is null.
std::shared_ptr<const Sweep> AddVirtualPlanes(const Sweep& sweep, const std::vector<int>& frames, int perGap,
                                              const FrameInterpolation& interpolation = {},
                                              const std::function<bool(double)>& goOn = {});

}  // namespace bigus
