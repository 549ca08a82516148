// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How far the planes of a sweep lie apart, and how large its pixels are.
#pragma once

#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// What the seeder and the trainer's defaults derive from a sweep's geometry, all mm.
struct SweepGeometry
{
  double pixelSize = 0;      ///< geometric mean of the pixel sides
  double medianSpacing = 0;  ///< between neighbouring planes, at the image centre, along the normal
  double smallestSpacing = 0;
  double largestSpacing = 0;
};
SweepGeometry MeasureGeometry(const Sweep& sweep, const std::vector<int>& frames);

/// Distance along the normal of frame `from` between its pixel (i, j) and the same pixel of frame `to`, mm.
double GapBetween(const Sweep& sweep, int from, int to, double i, double j);

}  // namespace bigus
