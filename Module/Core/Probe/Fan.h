// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where the beams of a convex or a sector probe come from, by the shape of what it lights.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>
#include <vector>

namespace bigus
{

/// The point where the beams of a fan meet, in pixels (column, row); its row lies above all that is lit. `lit`
/// [height][width] is not 0 where the probe lights pixels (Sweep::LitBy), which are pixelWidth x pixelHeight mm.
/// Nothing for parallel beams, and where the shape does not tell: a fan has two straight sides that meet at 10 to 170
/// degrees, and ends above or below on a circle about that point, or its sides are long and lean alike. Parts of it may lie
/// outside the picture.
std::optional<Eigen::Vector2d> FindApex(const std::vector<std::uint8_t>& lit, int width, int height, double pixelWidth,
                                        double pixelHeight);

}  // namespace bigus
