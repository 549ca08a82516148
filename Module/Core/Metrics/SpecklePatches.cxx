// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Metrics/SpecklePatches.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

struct PatchStatistics
{
  double mean, contrast;
};

PatchStatistics MeasurePatch(const float* image, int width, int x, int y)
{
  constexpr double n = kPatchSide * kPatchSide;
  const float* corner = image + static_cast<std::size_t>(y) * width + x;
  double sum = 0;
  for (int dy = 0; dy < kPatchSide; ++dy)
  {
    for (int dx = 0; dx < kPatchSide; ++dx)
    {
      sum += corner[static_cast<std::size_t>(dy) * width + dx];
    }
  }
  const double mean = sum / n;
  double squares = 0;
  for (int dy = 0; dy < kPatchSide; ++dy)
  {
    for (int dx = 0; dx < kPatchSide; ++dx)
    {
      const double d = corner[static_cast<std::size_t>(dy) * width + dx] - mean;
      squares += d * d;
    }
  }
  return {mean, std::sqrt(squares / n) / std::max(mean, kSmallestMean)};
}

}  // namespace

SpecklePatches MeasurePatches(const float* image, const float* truth, int width, int height)
{
  Require(width >= 1 && height >= 1, "Texture: the images are ", width, " x ", height,
          " pixels; both sides must be at least 1.");
  const int down = height < kPatchSide ? 0 : (height - kPatchSide) / kPatchStride + 1;
  const int across = width < kPatchSide ? 0 : (width - kPatchSide) / kPatchStride + 1;
  std::vector<SpecklePatches> rows(down);
  tbb::parallel_for(0, down,
                    [&](int row)
                    {
                      for (int column = 0; column < across; ++column)
                      {
                        const int x = column * kPatchStride;
                        const int y = row * kPatchStride;
                        const PatchStatistics t = MeasurePatch(truth, width, x, y);
                        if (t.mean >= kDarkestPatch)
                        {
                          rows[row].x.push_back(x);
                          rows[row].y.push_back(y);
                          rows[row].image.push_back(MeasurePatch(image, width, x, y).contrast);
                          rows[row].truth.push_back(t.contrast);
                        }
                      }
                    });
  SpecklePatches all;
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  for (const SpecklePatches& row : rows)
  {
    append(all.x, row.x);
    append(all.y, row.y);
    append(all.image, row.image);
    append(all.truth, row.truth);
  }
  return all;
}

double SortedDistance(const std::vector<double>& a, const std::vector<double>& b)
{
  double distance = 0;
  for (std::size_t k = 0; k < a.size(); ++k)
  {
    distance += std::abs(a[k] - b[k]) / static_cast<double>(a.size());
  }
  return distance;
}

}  // namespace bigus
