// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Metrics/Metrics.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
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

/// Two images of one size.
struct ImagePair
{
  const float *image, *truth;
  int width, height;
};

/// The sum over a row of windows, whose centres lie at row `centre` and `margin` pixels and more from the image's sides.
double SumSsim(const ImagePair& pair, const std::array<double, kSsimTaps>& kernel, int centre, int margin)
{
  // The window is separable: first down the columns, for the weighted sums of x, y, x^2, y^2 and xy ...
  constexpr int kMoments = 5;
  const std::size_t padded = static_cast<std::size_t>(pair.width) + 2 * kSsimRadius;
  std::vector<double> columns(kMoments * padded, 0.0);  // zero beyond the image's left and right edges
  for (int t = 0; t < kSsimTaps; ++t)
  {
    const int y = centre + t - kSsimRadius;
    if (y < 0 || y >= pair.height)
    {
      continue;
    }
    const float* a = pair.image + static_cast<std::size_t>(y) * pair.width;
    const float* b = pair.truth + static_cast<std::size_t>(y) * pair.width;
    const double w = kernel[t];
    double* out = columns.data() + kSsimRadius;
    for (int x = 0; x < pair.width; ++x)
    {
      const double ax = a[x], bx = b[x];
      out[x] += w * ax;
      out[x + padded] += w * bx;
      out[x + 2 * padded] += w * (ax * ax);
      out[x + 3 * padded] += w * (bx * bx);
      out[x + 4 * padded] += w * (ax * bx);
    }
  }
  // ... then along the row.
  double sum = 0;
  for (int x = margin; x < pair.width - margin; ++x)
  {
    double m[kMoments] = {};
    for (int k = 0; k < kMoments; ++k)
    {
      for (int t = 0; t < kSsimTaps; ++t)
      {
        m[k] += kernel[t] * columns[k * padded + x + t];
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

double Ssim(const float* image, const float* truth, int width, int height, SsimWindows windows)
{
  Require(width >= 1 && height >= 1, "SSIM: the images are ", width, " x ", height,
          " pixels; both sides must be at least 1.");
  const bool valid = windows == SsimWindows::Valid;
  if (valid && (width < kSsimTaps || height < kSsimTaps))
  {
    throw Error("SSIM: the images are " + std::to_string(width) + " x " + std::to_string(height) +
                " pixels, less than one window of 11 x 11; use larger images or windows of the same size.");
  }
  const std::array<double, kSsimTaps> kernel = SsimKernel();
  const int margin = valid ? kSsimRadius : 0;  // of window centres, from the edge
  std::vector<double> rows(height - 2 * margin);
  tbb::parallel_for(0, static_cast<int>(rows.size()),
                    [&](int row) {
                      rows[row] = SumSsim({image, truth, width, height}, kernel, row + margin, margin);
                    });
  return SumInOrder(rows) / (static_cast<double>(rows.size()) * (width - 2 * margin));
}

}  // namespace bigus
