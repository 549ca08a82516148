// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Metrics/Texture.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "Core/Metrics/SpecklePatches.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr int kHistogramBins = 65536;

TextureStatistics::Contrast Summarise(const std::vector<double>& sorted)
{
  TextureStatistics::Contrast out;
  out.mean = Mean(sorted);
  out.std = std::sqrt(MeanSquare(sorted, out.mean));
  out.q05 = Quantile(sorted, 0.05);
  out.q25 = Quantile(sorted, 0.25);
  out.q50 = Quantile(sorted, 0.5);
  out.q75 = Quantile(sorted, 0.75);
  out.q95 = Quantile(sorted, 0.95);
  return out;
}

std::vector<char> LitPixels(const SpecklePatches& patches, int width, int height)
{
  std::vector<char> lit(static_cast<std::size_t>(width) * height, 0);
  for (std::size_t k = 0; k < patches.x.size(); ++k)
  {
    for (int dy = 0; dy < kPatchSide; ++dy)
    {
      std::fill_n(lit.begin() + static_cast<std::ptrdiff_t>(patches.y[k] + dy) * width + patches.x[k], kPatchSide, 1);
    }
  }
  return lit;
}

TextureStatistics::Intensity MeasureIntensity(const float* image, const std::vector<char>& lit, double medianContrast)
{
  const auto power = [](double d, int n)
  {
    double out = d;
    for (int k = 1; k < n; ++k)
    {
      out *= d;
    }
    return out;
  };
  double sum = 0, count = 0;
  for (std::size_t p = 0; p < lit.size(); ++p)
  {
    sum += lit[p] ? image[p] : 0;
    count += lit[p];
  }
  TextureStatistics::Intensity out;
  out.mean = sum / count;
  double second = 0, third = 0, fourth = 0;
  for (std::size_t p = 0; p < lit.size(); ++p)
  {
    const double d = lit[p] ? image[p] - out.mean : 0;
    second += power(d, 2);
    third += power(d, 3);
    fourth += power(d, 4);
  }
  second /= count;
  third /= count;
  fourth /= count;
  out.std = std::sqrt(second);
  out.snr = RatioOrInfinity(out.mean, out.std);
  out.localSnr = 1 / medianContrast;
  if (second > 0)
  {
    out.skewness = third / (second * out.std);
    out.kurtosis = fourth / (second * second) - 3;
  }
  return out;
}

/// Wasserstein-1 distance of two histograms: the area between their distribution functions.
double HistogramDistance(const float* a, const float* b, const std::vector<char>& lit)
{
  std::vector<std::int64_t> excess(kHistogramBins, 0);  // of a's pixels over b's
  std::int64_t count = 0;
  const auto bin = [](float value)
  { return std::clamp(static_cast<int>(value * kHistogramBins), 0, kHistogramBins - 1); };
  for (std::size_t p = 0; p < lit.size(); ++p)
  {
    if (lit[p])
    {
      ++excess[bin(a[p])];
      --excess[bin(b[p])];
      ++count;
    }
  }
  std::int64_t below = 0, area = 0;
  for (std::int64_t e : excess)
  {
    below += e;
    area += std::abs(below);
  }
  return static_cast<double>(area) / (static_cast<double>(count) * kHistogramBins);
}

}  // namespace

TextureComparison CompareTexture(const float* image, const float* truth, int width, int height)
{
  SpecklePatches patches = MeasurePatches(image, truth, width, height);
  TextureComparison out;
  if (patches.truth.empty())
  {
    return out;
  }
  const std::vector<char> lit = LitPixels(patches, width, height);
  std::sort(patches.image.begin(), patches.image.end());
  std::sort(patches.truth.begin(), patches.truth.end());
  out.image.contrast = Summarise(patches.image);
  out.truth.contrast = Summarise(patches.truth);
  out.image.intensity = MeasureIntensity(image, lit, out.image.contrast.q50);
  out.truth.intensity = MeasureIntensity(truth, lit, out.truth.contrast.q50);
  if (out.truth.contrast.mean > 0)
  {
    out.contrastRatio = out.image.contrast.mean / out.truth.contrast.mean;
  }
  out.contrastDistance = SortedDistance(patches.image, patches.truth);
  out.intensityDistance = HistogramDistance(image, truth, lit);
  const SpectraComparison spectra = CompareSpectra(image, truth, width, height, lit);
  out.image.power = spectra.image;
  out.truth.power = spectra.truth;
  out.spectrumDifference = spectra.difference;
  out.highFrequencyPower = spectra.highFrequencyPower;
  return out;
}

TextureComparison MeanTexture(const std::vector<TextureComparison>& frames)
{
  TextureComparison mean;
  if (frames.empty())
  {
    return mean;
  }
  const double share = 1 / static_cast<double>(frames.size());
  std::vector<double> sums;
  for (const TextureComparison& frame : frames)
  {
    std::size_t k = 0;
    ForEachNumber(frame,
                  [&](const std::string&, double number)
                  {
                    sums.resize(std::max(sums.size(), k + 1), 0.0);
                    sums[k++] += share * number;
                  });
    for (int b = 0; b < kSpectrumBins; ++b)
    {
      mean.image.power[b] += share * frame.image.power[b];
      mean.truth.power[b] += share * frame.truth.power[b];
    }
  }
  std::size_t k = 0;
  ForEachNumber(mean, [&](const std::string&, double& number) { number = sums[k++]; });
  return mean;
}

}  // namespace bigus
