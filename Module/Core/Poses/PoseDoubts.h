// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Poses and times that are sound as numbers but hardly those of a probe: wrong units, sheared images, frames in one plane.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// One plain sentence for each doubt about `frames`, none for a usual sweep. Looks at size and poses, at no pixel.
std::vector<std::string> DoubtsAboutPoses(const Sweep& sweep, const std::vector<int>& frames);

/// Of several sequences: a clause where two have the same poses, or one lies far from all others; none for a usual sweep.
std::optional<std::string> DoubtAboutSequences(const Sweep& sweep);

/// Whether one of them says that the path is none of a probe's: wrong units, matrices the wrong way round, frames in one
/// plane.
bool IsPathDoubtful(const Sweep& sweep, const std::vector<int>& frames);

/// A plain sentence where all frames have one time, or the last an earlier one than the first; nothing where there are no
/// times.
std::optional<std::string> DoubtAboutTimes(const std::vector<double>& times);

}  // namespace bigus
