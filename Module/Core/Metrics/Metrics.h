// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Image quality: PSNR and SSIM, defined exactly in README.md of this folder.
#pragma once

#include <cstddef>

namespace bigus
{

/// Images are intensities in [0, 1], row by row. Sums are in double; results do not depend on the number of threads.

/// Peak signal-to-noise ratio, dB: 10 log10(1 / mean squared error); +infinity for identical images.
double Psnr(const float* image, const float* truth, std::size_t numberOfPixels);

/// Mean structural similarity: Gaussian window 11 x 11, sigma 1.5, K1 = 0.01, K2 = 0.03, range 1, population
/// variance. Windows lie wholly inside the image: one smaller than 11 x 11 throws Error.
double Ssim(const float* image, const float* truth, int width, int height);

}  // namespace bigus
