// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/MortonOrder.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace bigus
{
namespace
{

/// Spreads the lower 21 bits of x three apart.
std::uint64_t Spread(std::uint64_t x)
{
  x = (x | x << 32) & 0x001f00000000ffffull;
  x = (x | x << 16) & 0x001f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

}  // namespace

std::vector<std::uint32_t> MortonOrder(const std::vector<Eigen::Vector3d>& points)
{
  if (points.empty())
  {
    return {};
  }
  // The bulk: between the 1st and the 99th percentile of a sample along each axis, and a tenth more on either side.
  constexpr std::size_t kSample = 4096;
  const std::size_t stride = (points.size() + kSample - 1) / kSample;
  Eigen::Vector3d low, high;
  std::vector<double> sample;
  for (int axis = 0; axis < 3; ++axis)
  {
    sample.clear();
    for (std::size_t i = 0; i < points.size(); i += stride)
    {
      sample.push_back(points[i][axis]);
    }
    std::sort(sample.begin(), sample.end());
    low[axis] = sample[sample.size() / 100];
    high[axis] = sample[sample.size() - 1 - sample.size() / 100];
  }
  const Eigen::Vector3d margin = 0.1 * (high - low);
  low -= margin;
  const double side = std::max((high + margin - low).maxCoeff(), 1e-300);
  const double cells = static_cast<double>(1 << 21);

  std::vector<std::pair<std::uint64_t, std::uint32_t>> codes(points.size());
  tbb::parallel_for(std::size_t(0), points.size(),
                    [&](std::size_t i)
                    {
                      std::uint64_t code = 0;
                      for (int axis = 0; axis < 3; ++axis)
                      {
                        const double cell = std::floor((points[i][axis] - low[axis]) / side * cells);
                        code |= Spread(static_cast<std::uint64_t>(std::clamp(cell, 0.0, cells - 1))) << axis;
                      }
                      codes[i] = {code, static_cast<std::uint32_t>(i)};
                    });
  tbb::parallel_sort(codes.begin(), codes.end());
  std::vector<std::uint32_t> order(points.size());
  std::transform(codes.begin(), codes.end(), order.begin(), [](const auto& code) { return code.second; });
  return order;
}

}  // namespace bigus
