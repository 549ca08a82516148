// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The radially averaged power spectrum of an image beside the truth's.
#pragma once

#include <array>
#include <vector>

namespace bigus
{

constexpr int kSpectrumBins = 16;

/// Radial frequency of a bin, cycles a pixel: 1/32 to 1/2, which is Nyquist's.
constexpr double SpectrumFrequency(int bin)
{
  return (bin + 1) / 32.0;
}

using PowerSpectrum = std::array<double, kSpectrumBins>;

struct SpectraComparison
{
  /// Power at SpectrumFrequency(bin), radially averaged over the lit windows of 32 x 32 pixels: white noise of variance
  /// v has power v everywhere. All 0 where no window fits.
  PowerSpectrum image = {}, truth = {};
  double difference = 0;  ///< dB: mean over bins of |10 log10(power / truth's power)|
  /// Power above half of Nyquist's frequency, as a share of the truth's.
  double highFrequencyPower = 1;
};

/// Welch's estimate over windows all of whose pixels are lit, stride 16. `lit` has width * height elements, 0 or 1.
/// Results do not depend on the number of threads.
SpectraComparison CompareSpectra(const float* image, const float* truth, int width, int height,
                                 const std::vector<char>& lit);

}  // namespace bigus
