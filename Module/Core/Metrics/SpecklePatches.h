// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The patches over which speckle is measured. Private to this room.
#pragma once

#include <vector>

namespace bigus
{

constexpr int kPatchSide = 7;           // pixels
constexpr int kPatchStride = 3;         // pixels
constexpr double kDarkestPatch = 0.02;  // mean intensity of the truth; a darker patch shows no tissue and is skipped
constexpr double kSmallestMean = 1e-6;  // intensity that a mean is taken for at least, to divide by

/// The patches of an image and its truth that are not skipped, in order.
struct SpecklePatches
{
  std::vector<int> x, y;             // first pixels
  std::vector<double> image, truth;  // speckle contrasts, std / mean
};

/// Throws Error for a size below 1 x 1.
SpecklePatches MeasurePatches(const float* image, const float* truth, int width, int height);

/// Of two sorted samples of equal size: the Wasserstein-1 distance is the mean difference in order of size.
double SortedDistance(const std::vector<double>& a, const std::vector<double>& b);

}  // namespace bigus
