// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Metrics/Metrics.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "Core/Formula/SsimWindow.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
double Psnr(const float* image, const float* truth, std::size_t numberOfPixels)
{
  Require(numberOfPixels != 0, "PSNR: the images have no pixels.");
  constexpr std::size_t kBlock = 4096;  // pixels summed by one task
  std::vector<double> parts((numberOfPixels + kBlock - 1) / kBlock);
  tbb::parallel_for(std::size_t(0), parts.size(),
                    [&](std::size_t b)
                    {
                      const std::size_t end = std::min(numberOfPixels, (b + 1) * kBlock);
                      double sum = 0;
                      for (std::size_t p = b * kBlock; p < end; ++p)
                      {
                        const double d = static_cast<double>(image[p]) - truth[p];
                        sum += d * d;
                      }
                      parts[b] = sum;
                    });
  return -10 * std::log10(SumInOrder(parts) / static_cast<double>(numberOfPixels));
}

namespace
{

/// Two images of one size, row by row.
struct ImagePair
{
  const float *image, *truth;
  int width;
};

/// The sum over a row of windows, which begin at row `top`.
double SumSsim(const ImagePair& pair, const std::array<double, kSsimTaps>& kernel, std::size_t top)
{
  // The window is separable: first down the columns, for the weighted sums of x, y, x^2, y^2 and xy ...
  constexpr int kMoments = 5;
  const auto width = static_cast<std::size_t>(pair.width);
  std::vector<double> columns(kMoments * width, 0.0);
  for (int t = 0; t < kSsimTaps; ++t)
  {
    const float* a = pair.image + (top + t) * width;
    const float* b = pair.truth + (top + t) * width;
    const double w = kernel[t];
    double* out = columns.data();
    for (std::size_t x = 0; x < width; ++x)
    {
      const double ax = a[x], bx = b[x];
      out[x] += w * ax;
      out[x + width] += w * bx;
      out[x + 2 * width] += w * (ax * ax);
      out[x + 3 * width] += w * (bx * bx);
      out[x + 4 * width] += w * (ax * bx);
    }
  }
  // ... then along the row.
  double sum = 0;
  for (std::size_t x = 0; x + kSsimTaps <= width; ++x)
  {
    double m[kMoments] = {};
    for (int k = 0; k < kMoments; ++k)
    {
      for (int t = 0; t < kSsimTaps; ++t)
      {
        m[k] += kernel[t] * columns[k * width + x + t];
      }
    }
    const double varianceA = m[2] - m[0] * m[0];
    const double varianceB = m[3] - m[1] * m[1];
    const double covariance = m[4] - m[0] * m[1];
    sum += (2 * m[0] * m[1] + kSsimC1) * (2 * covariance + kSsimC2) /
           ((m[0] * m[0] + m[1] * m[1] + kSsimC1) * (varianceA + varianceB + kSsimC2));
  }
  return sum;
}

}  // namespace

double Ssim(const float* image, const float* truth, int width, int height)
{
  Require(width >= kSsimTaps && height >= kSsimTaps, "SSIM: the images are ", width, " x ", height,
          " pixels, less than one window of 11 x 11; use larger images.");
  const std::array<double, kSsimTaps> kernel = SsimKernel();
  std::vector<double> rows(height - 2 * kSsimRadius);
  tbb::parallel_for(std::size_t(0), rows.size(),
                    [&](std::size_t row) {
                      rows[row] = SumSsim({image, truth, width}, kernel, row);
                    });
  return SumInOrder(rows) / (static_cast<double>(rows.size()) * (width - 2 * kSsimRadius));
}

}  // namespace bigus
