// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Metrics/BackscatterFidelity.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "Core/Metrics/SpecklePatches.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr double kRayleighContrast = 0.5227;  // std / mean of a Rayleigh distribution: sqrt(4 / pi - 1)
constexpr double kRayleighWidth = 0.1;        // a patch within this of it counts as fully developed speckle

}  // namespace

BackscatterFidelity Bfs(const float* image, const float* truth, int width, int height)
{
  SpecklePatches patches = MeasurePatches(image, truth, width, height);
  BackscatterFidelity out{1, 1, 1, 1};
  if (patches.truth.empty())
  {
    return out;
  }
  std::vector<double> foundRayleigh, expectedRayleigh;  // where the truth is fully developed speckle
  for (std::size_t k = 0; k < patches.truth.size(); ++k)
  {
    if (std::abs(patches.truth[k] - kRayleighContrast) < kRayleighWidth)
    {
      foundRayleigh.push_back(patches.image[k]);
      expectedRayleigh.push_back(patches.truth[k]);
    }
  }
  const double mean = Mean(patches.truth);
  out.meanContrast = std::max(0.0, 1 - RatioOrInfinity(std::abs(Mean(patches.image) - mean), mean));
  if (!foundRayleigh.empty())
  {
    out.rayleigh = std::exp(-std::abs(Mean(foundRayleigh) - Mean(expectedRayleigh)) / kRayleighContrast);
  }
  std::sort(patches.image.begin(), patches.image.end());
  std::sort(patches.truth.begin(), patches.truth.end());
  out.contrastDistribution = std::exp(
      -RatioOrInfinity(SortedDistance(patches.image, patches.truth), std::sqrt(MeanSquare(patches.truth, mean))));
  out.score = 0.4 * out.meanContrast + 0.4 * out.contrastDistribution + 0.2 * out.rayleigh;
  return out;
}

}  // namespace bigus
