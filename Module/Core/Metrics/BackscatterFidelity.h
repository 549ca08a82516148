// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Backscatter fidelity score: whether the speckle of an image has the statistics of the truth's.
#pragma once

namespace bigus
{

/// Paper eq 15, which leaves its terms open; README.md of this folder defines them. Each lies in [0, 1], 1 for an image
/// whose speckle has the statistics of the truth's.
struct BackscatterFidelity
{
  double score = 0;                 ///< 0.4 meanContrast + 0.4 contrastDistribution + 0.2 rayleigh
  double meanContrast = 0;          ///< s_mu
  double contrastDistribution = 0;  ///< s_W = exp(-W1 / sigma_W)
  double rayleigh = 0;              ///< s_Ray
};

/// By the speckle contrast, std / mean, of patches of 7 x 7 pixels, stride 3; those whose truth mean is below 0.02 are
/// skipped in both images. With no patch left (or no room for one) the images agree on "no speckle": all terms are 1.
/// Images are intensities in [0, 1], row by row. Results do not depend on the number of threads. Throws Error for a
/// size below 1 x 1.
BackscatterFidelity Bfs(const float* image, const float* truth, int width, int height);

}  // namespace bigus
