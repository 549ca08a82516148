// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Texture: whether an image has the truth's speckle, wherever its grains lie. Defined exactly in README.md of
// this folder.
#pragma once

#include <string>
#include <vector>

#include "Core/Metrics/PowerSpectrum.h"

namespace bigus
{

/// Images are intensities in [0, 1], row by row. Patches are 7 x 7 pixels, stride 3; those whose truth mean is below
/// 0.02 are skipped in both images. Pixels in a patch that is not skipped are lit. Sums are in double; results do not
/// depend on the number of threads. A size below 1 x 1 throws Error.

/// The texture of one image. Where there is nothing to measure every number is 0.
struct TextureStatistics
{
  /// Speckle contrast std / mean over patches: 0.523 for fully developed (Rayleigh) speckle, less where it was averaged
  /// or compressed.
  struct Contrast
  {
    double mean = 0, std = 0;                            ///< over patches
    double q05 = 0, q25 = 0, q50 = 0, q75 = 0, q95 = 0;  ///< quantiles, linearly interpolated
  };
  /// First-order statistics of lit pixels.
  struct Intensity
  {
    double mean = 0, std = 0;
    double snr = 0;       ///< mean / std, 1.913 for Rayleigh; infinite where std is 0
    double localSnr = 0;  ///< median over patches of their mean / std; infinite for flat patches
    double skewness = 0;  ///< 0.631 for Rayleigh
    double kurtosis = 0;  ///< excess over a normal distribution's, 0.245 for Rayleigh
  };
  Contrast contrast;
  Intensity intensity;
  /// Power at SpectrumFrequency(bin), radially averaged over the lit windows of 32 x 32 pixels: white noise of variance
  /// v has power v everywhere. All 0 where no window fits.
  PowerSpectrum power = {};
};

/// An image beside the truth, both over what the truth lights.
struct TextureComparison
{
  TextureStatistics image, truth;
  double contrastRatio = 1;       ///< mean contrast of the image / of the truth; 1 where the truth's is 0
  double contrastDistance = 0;    ///< Wasserstein-1 distance of the contrasts
  double intensityDistance = 0;   ///< Wasserstein-1 distance of the lit pixels' histograms (65536 bins), in intensity
  double spectrumDifference = 0;  ///< dB: mean over bins of |10 log10(power / truth's power)|
  /// Power above half of Nyquist's frequency, as a share of the truth's: 0 is smooth, 1 as fine, above 1 grainier.
  double highFrequencyPower = 1;
};

TextureComparison CompareTexture(const float* image, const float* truth, int width, int height);

/// Number by number (spectra included), the mean over frames; of none, a comparison of nothing.
TextureComparison MeanTexture(const std::vector<TextureComparison>& frames);

/// Every number of a comparison but the spectra, by the name it has in tables: visit("ContrastRatio", number). One list
/// for all who average, print or export them. `Texture` is TextureComparison, const or not.
template <class Texture, class Visit>
void ForEachNumber(Texture& texture, const Visit& visit)
{
  visit("ContrastRatio", texture.contrastRatio);
  visit("ContrastDistance", texture.contrastDistance);
  visit("IntensityDistance", texture.intensityDistance);
  visit("SpectrumDifference", texture.spectrumDifference);
  visit("HighFrequencyPower", texture.highFrequencyPower);
  const auto visitOne = [&visit](const std::string& whose, auto& statistics)
  {
    visit(whose + "ContrastMean", statistics.contrast.mean);
    visit(whose + "ContrastStd", statistics.contrast.std);
    visit(whose + "ContrastQ05", statistics.contrast.q05);
    visit(whose + "ContrastQ25", statistics.contrast.q25);
    visit(whose + "ContrastQ50", statistics.contrast.q50);
    visit(whose + "ContrastQ75", statistics.contrast.q75);
    visit(whose + "ContrastQ95", statistics.contrast.q95);
    visit(whose + "Mean", statistics.intensity.mean);
    visit(whose + "Std", statistics.intensity.std);
    visit(whose + "Snr", statistics.intensity.snr);
    visit(whose + "LocalSnr", statistics.intensity.localSnr);
    visit(whose + "Skewness", statistics.intensity.skewness);
    visit(whose + "Kurtosis", statistics.intensity.kurtosis);
  };
  visitOne("Image", texture.image);
  visitOne("Truth", texture.truth);
}

}  // namespace bigus
