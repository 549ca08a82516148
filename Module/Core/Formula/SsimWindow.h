// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The window and constants of SSIM (Wang et al. 2004), for the score and for the loss. Private to Core and Cuda.
#pragma once

#include <array>
#include <cmath>

namespace bigus
{

constexpr int ssimRadius = 5;
constexpr int ssimTaps = 2 * ssimRadius + 1;
constexpr double ssimC1 = 0.01 * 0.01;  // (K1 range)^2
constexpr double ssimC2 = 0.03 * 0.03;

/// The window's factor along one axis: a Gaussian of 1.5 pixels, of sum 1.
inline std::array<double, ssimTaps> SsimKernel()
{
  std::array<double, ssimTaps> kernel;
  double sum = 0;
  for (int t = 0; t < ssimTaps; ++t)
  {
    const double d = t - ssimRadius;
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
