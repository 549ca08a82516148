// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// An order of points in which neighbours in space are neighbours in memory. Private to Core and Cuda.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

namespace bigus
{

/// Indices of the points along a Morton (Z-order) curve, equal codes in their own order. The curve's cubic cells cover
/// where the bulk of the points is; the few far out count as lying on its border, so that one stray point a kilometre
/// away does not leave all others in one cell.
std::vector<std::uint32_t> MortonOrder(const std::vector<Eigen::Vector3d>& points);

}  // namespace bigus
