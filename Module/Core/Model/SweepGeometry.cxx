// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/SweepGeometry.h"

#include <algorithm>
#include <cmath>

namespace bigus
{

double GapBetween(const Sweep& sweep, int from, int to, double i, double j)
{
  const SlicePlane plane = sweep.Plane(from);
  return std::abs((sweep.Plane(to).Point(i, j) - plane.Point(i, j)).dot(plane.Normal()));
}

SweepGeometry MeasureGeometry(const Sweep& sweep, const std::vector<int>& frames)
{
  SweepGeometry geometry;
  std::vector<double> spacings;
  for (std::size_t k = 0; k + 1 < frames.size(); ++k)
  {
    spacings.push_back(GapBetween(sweep, frames[k], frames[k + 1], 0.5 * (sweep.width - 1), 0.5 * (sweep.height - 1)));
  }
  geometry.pixelSize = frames.empty() ? 0.0 : sweep.Plane(frames[0]).PixelSize();
  if (!spacings.empty())
  {
    std::sort(spacings.begin(), spacings.end());
    geometry.medianSpacing = spacings[spacings.size() / 2];
    geometry.smallestSpacing = spacings.front();
    geometry.largestSpacing = spacings.back();
  }
  return geometry;
}

}  // namespace bigus
