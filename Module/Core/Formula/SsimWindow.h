// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The window and constants of SSIM (Wang et al. 2004), for the score and for the loss. Private to Core and Cuda.
#pragma once

#include <array>
#include <cmath>

namespace bigus
{

constexpr int kSsimRadius = 5;
constexpr int kSsimTaps = 2 * kSsimRadius + 1;
constexpr double kSsimC1 = 0.01 * 0.01;  // (K1 range)^2
constexpr double kSsimC2 = 0.03 * 0.03;

/// The window's factor along one axis: a Gaussian of 1.5 pixels, of sum 1.
inline std::array<double, kSsimTaps> SsimKernel()
{
  std::array<double, kSsimTaps> kernel;
  double sum = 0;
  for (int t = 0; t < kSsimTaps; ++t)
  {
    const double d = t - kSsimRadius;
    kernel[t] = std::exp(-d * d / (2 * 1.5 * 1.5));
    sum += kernel[t];
  }
  for (double& k : kernel)
  {
    k /= sum;
  }
  return kernel;
}

}  // namespace bigus
