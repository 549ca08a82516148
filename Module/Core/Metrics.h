// Image quality: PSNR, SSIM and the speckle score BFS, defined exactly in README.md of this folder.
#pragma once

#include <cstddef>

namespace bigus
{

/// Images are intensities in [0, 1], row by row. Sums are in double; results do not depend on the number of
/// threads.

/// Peak signal-to-noise ratio, dB: 10 log10(1 / mean squared error); +infinity for identical images.
double Psnr(const float* image, const float* truth, std::size_t numberOfPixels);

enum class SsimWindows
{
  Valid,  ///< only 11 x 11 windows wholly inside the image (what we report, and what scikit-image computes)
  Same    ///< one window a pixel, zeros beyond the edge (what splatting papers report)
};

/// Mean structural similarity: Gaussian window 11 x 11, sigma 1.5, K1 = 0.01, K2 = 0.03, range 1, population
/// variance. An image smaller than 11 x 11 throws Error for Valid.
double Ssim(const float* image, const float* truth, int width, int height,
            SsimWindows windows = SsimWindows::Valid);

/// Backscatter fidelity score (paper eq 15). The paper does not define its terms: these are this project's
/// own. Each lies in [0, 1], 1 for an image whose speckle has the statistics of the truth's.
struct BackscatterFidelity
{
  double score = 0;                 ///< 0.4 meanContrast + 0.4 contrastDistribution + 0.2 rayleigh
  double meanContrast = 0;          ///< s_mu
  double contrastDistribution = 0;  ///< exp(-W1 / sigma_W)
  double rayleigh = 0;              ///< s_Ray
};

/// Speckle contrast std / mean over 7 x 7 patches, stride 3; patches whose truth mean is below 0.02 are
/// skipped in both images. With no patch left (or no room for one) the images agree on "no speckle": all
/// terms are 1.
BackscatterFidelity Bfs(const float* image, const float* truth, int width, int height);

}  // namespace bigus
