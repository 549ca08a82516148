// Planes between the frames of a sparse sweep, as a regulariser: what the field should look like where nobody
// looked.
#pragma once

#include <memory>
#include <vector>

#include "Sweep.h"

namespace bigus
{

/// A sweep of `frames` (in that order, weight 1) followed by `perGap` planes evenly spaced in every gap
/// between neighbours, with weight 0.6. A virtual plane's pose is interpolated between its neighbours' and
/// its pixels are the pose-aware interpolation of the frames (see Baselines.h), blurred by half a pixel:
/// interpolation leaves noise that no neighbouring plane shares. Gaps wider than four times the median are
/// breaks in the sweep and get none. Pixels of the result are float; its mask is the sweep's. perGap >= 1.
std::shared_ptr<const Sweep> AddVirtualPlanes(const Sweep& sweep, const std::vector<int>& frames, int perGap);

}  // namespace bigus
