// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Poses that are sound as numbers but hardly those of a probe: wrong units, sheared images, frames in one plane.
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

}  // namespace bigus
