// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/Revisits.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "Core/Numerics/Constants.h"

namespace bigus
{
namespace
{

constexpr double kAway = 3;               // mm: a place that the probe left so far and came back to is seen anew
constexpr double kWidestGap = 2;          // mm between the two frames that a third is predicted from
constexpr std::size_t kMostRevisits = 2;  // of a frame: the nearest in the plane
constexpr double kMostLooks =
    2.5e7;  // frames times those among which each looks for its place: of 5,000 frames all, of more some

/// Degrees that frames of a revisit may be turned against each other in their plane. Speckle and shadows turn with the
/// beam, so pictures that are turned by 4 degrees seem to fit best where they are turned by 1: at exact poses of a
/// phantom there and back alignment is wrong by 3 degrees there, and by 0.1 degrees where they are turned by 1.
constexpr double kMostTurned = 1;
constexpr double kMostTilted = 20;  // degrees between their normals

}  // namespace

Revisits FindRevisits(const std::vector<SlicePlane>& planes, const std::vector<int>& frames,
                      const std::vector<int>& stroke)
{
  const int n = static_cast<int>(planes.size());
  const double parallel = std::cos(kMostTilted * kRadiansPerDegree);
  const double straight = std::cos(kMostTurned * kRadiansPerDegree);
  const auto isAlike = [&](int a, int b)
  {
    const Eigen::Vector3d normal = planes[a].Normal(), along = planes[b].columnStep;
    const Eigen::Vector3d seen = (along - along.dot(normal) * normal).normalized();
    return normal.dot(planes[b].Normal()) >= parallel && planes[a].columnStep.normalized().dot(seen) >= straight;
  };
  Revisits all;
  std::vector<Eigen::Vector3d> centres;
  for (const SlicePlane& plane : planes)
  {
    centres.push_back(CentreOf(plane));
  }
  const int step = 1 + static_cast<int>(static_cast<double>(n) * n / kMostLooks);
  for (int a = 0; a < n; a += step)
  {
    std::vector<std::pair<double, int>> found;  // distance of the centre, frame before
    const Eigen::Vector3d centre = centres[a], normal = planes[a].Normal();
    for (const int side : {-1, 1})
    {
      double away = 0, heightC = a + side >= 0 && a + side < n ? normal.dot(centres[a + side] - centre) : 0;
      bool follows = true;
      for (int b = a + side, c = b + side; b >= 0 && c >= 0 && b < n && c < n; b = c, c += side)
      {
        const double heightB = std::exchange(heightC, normal.dot(centres[c] - centre));
        away = std::max(away, std::abs(heightB));
        follows = follows && stroke[frames[b]] == stroke[frames[a]];
        if (stroke[frames[b]] != stroke[frames[c]] || (heightB > 0) == (heightC > 0) || (follows && away < kAway))
        {
          continue;
        }
        all.comesBack = true;
        if (std::abs(heightB - heightC) > kWidestGap || !isAlike(a, b) || !isAlike(a, c))
        {
          continue;
        }
        found.emplace_back((centres[b] - centre - heightB * normal).norm(), std::min(b, c));
      }
    }
    std::sort(found.begin(), found.end());
    for (std::size_t k = 0; k < std::min(found.size(), kMostRevisits); ++k)
    {
      all.found.push_back({a, found[k].second});
    }
  }
  return all;
}

}  // namespace bigus
