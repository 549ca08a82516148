// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Metrics/Texture.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <unsupported/Eigen/FFT>
#include <utility>
#include <vector>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

constexpr int patchSide = 7;
constexpr int patchStride = 3;
constexpr double darkestPatch = 0.02;        // mean intensity
constexpr double rayleighContrast = 0.5227;  // std / mean of a Rayleigh distribution: sqrt(4 / pi - 1)
constexpr double rayleighWidth = 0.1;

constexpr int windowSide = 2 * spectrumBins;  // pixels, of a spectrum
constexpr int windowStride = spectrumBins;
constexpr double smallestPower = 1e-9;  // a thousandth of what rounding to 8 bits leaves: as good as none
constexpr int histogramBins = 65536;

double Mean(const std::vector<double>& values)
{
  double sum = 0;
  for (double value : values)
  {
    sum += value;
  }
  return sum / static_cast<double>(values.size());
}

/// Mean of (value - centre)^2.
double MeanSquare(const std::vector<double>& values, double centre)
{
  double squares = 0;
  for (double value : values)
  {
    squares += (value - centre) * (value - centre);
  }
  return squares / static_cast<double>(values.size());
}

/// A difference as a share of `scale`; where that is 0, any difference is infinite.
double Share(double difference, double scale)
{
  if (scale > 0)
  {
    return difference / scale;
  }
  return difference == 0 ? 0 : std::numeric_limits<double>::infinity();
}

struct PatchStatistics
{
  double mean, contrast;
};

PatchStatistics MeasurePatch(const float* image, int width, int x, int y)
{
  constexpr double n = patchSide * patchSide;
  const float* corner = image + static_cast<std::size_t>(y) * width + x;
  double sum = 0;
  for (int dy = 0; dy < patchSide; ++dy)
  {
    for (int dx = 0; dx < patchSide; ++dx)
    {
      sum += corner[static_cast<std::size_t>(dy) * width + dx];
    }
  }
  const double mean = sum / n;
  double squares = 0;
  for (int dy = 0; dy < patchSide; ++dy)
  {
    for (int dx = 0; dx < patchSide; ++dx)
    {
      const double d = corner[static_cast<std::size_t>(dy) * width + dx] - mean;
      squares += d * d;
    }
  }
  return {mean, std::sqrt(squares / n) / std::max(mean, 1e-6)};
}

/// The patches that are not skipped, in order.
struct Patches
{
  std::vector<int> x, y;             // first pixels
  std::vector<double> image, truth;  // contrasts
};

Patches MeasurePatches(const float* image, const float* truth, int width, int height)
{
  if (width < 1 || height < 1)
  {
    throw Error("Texture: the images are " + std::to_string(width) + " x " + std::to_string(height) +
                " pixels; both sides must be at least 1.");
  }
  const int down = height < patchSide ? 0 : (height - patchSide) / patchStride + 1;
  const int across = width < patchSide ? 0 : (width - patchSide) / patchStride + 1;
  std::vector<Patches> rows(down);
  tbb::parallel_for(0, down,
                    [&](int row)
                    {
                      for (int column = 0; column < across; ++column)
                      {
                        const int x = column * patchStride;
                        const int y = row * patchStride;
                        const PatchStatistics t = MeasurePatch(truth, width, x, y);
                        if (t.mean >= darkestPatch)
                        {
                          rows[row].x.push_back(x);
                          rows[row].y.push_back(y);
                          rows[row].image.push_back(MeasurePatch(image, width, x, y).contrast);
                          rows[row].truth.push_back(t.contrast);
                        }
                      }
                    });
  Patches all;
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  for (const Patches& row : rows)
  {
    append(all.x, row.x);
    append(all.y, row.y);
    append(all.image, row.image);
    append(all.truth, row.truth);
  }
  return all;
}

/// Of two sorted samples of equal size, the Wasserstein-1 distance is the mean difference in order of size.
double SortedDistance(const std::vector<double>& a, const std::vector<double>& b)
{
  double distance = 0;
  for (std::size_t k = 0; k < a.size(); ++k)
  {
    distance += std::abs(a[k] - b[k]) / static_cast<double>(a.size());
  }
  return distance;
}

/// Linear between the order statistics, which lie at 0, 1 / (n - 1), ... 1.
double Quantile(const std::vector<double>& sorted, double share)
{
  const double position = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (position - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

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

std::vector<char> LitPixels(const Patches& patches, int width, int height)
{
  std::vector<char> lit(static_cast<std::size_t>(width) * height, 0);
  for (std::size_t k = 0; k < patches.x.size(); ++k)
  {
    for (int dy = 0; dy < patchSide; ++dy)
    {
      std::fill_n(lit.begin() + static_cast<std::ptrdiff_t>(patches.y[k] + dy) * width + patches.x[k], patchSide, 1);
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
  out.snr = Share(out.mean, out.std);
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
  std::vector<std::int64_t> excess(histogramBins, 0);  // of a's pixels over b's
  std::int64_t count = 0;
  const auto bin = [](float value)
  { return std::clamp(static_cast<int>(value * histogramBins), 0, histogramBins - 1); };
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
  return static_cast<double>(area) / (static_cast<double>(count) * histogramBins);
}

using Complex = std::complex<double>;

/// Power of two real images at the pixels of one window's spectrum, radially added up: [image, truth][bin].
using WindowPower = std::array<std::array<double, spectrumBins>, 2>;

/// What the windows share.
struct Spectrum
{
  std::array<double, windowSide> taper;                     // Hann: sin^2(pi (n + 1/2) / 32)
  std::array<std::array<int, windowSide>, windowSide> bin;  // of frequency (u, v), -1 for none
  std::array<double, spectrumBins> samples = {};            // frequencies in a bin
  double energy = 0;                                        // sum of squares of the two-dimensional taper

  Spectrum()
  {
    double squares = 0;
    for (int n = 0; n < windowSide; ++n)
    {
      const double s = std::sin(std::acos(-1.0) * (n + 0.5) / windowSide);
      taper[n] = s * s;
      squares += taper[n] * taper[n];
    }
    energy = squares * squares;
    const auto signedFrequency = [](int k) { return k <= windowSide / 2 ? k : k - windowSide; };
    for (int v = 0; v < windowSide; ++v)
    {
      for (int u = 0; u < windowSide; ++u)
      {
        // The ring |f| = (b + 1 +- 1/2) / 32; the mean, and the corners beyond Nyquist's frequency, are in
        // none.
        const int ring = static_cast<int>(std::lround(std::hypot(signedFrequency(u), signedFrequency(v))));
        bin[v][u] = ring >= 1 && ring <= spectrumBins ? ring - 1 : -1;
        if (bin[v][u] >= 0)
        {
          samples[bin[v][u]] += 1;
        }
      }
    }
  }

  static const Spectrum& Get()
  {
    static const Spectrum spectrum;
    return spectrum;
  }

  /// Periodograms of both images at once: two real signals are the real and imaginary part of a complex one,
  /// whose transform Z holds theirs as (Z(k) + conj Z(-k)) / 2 and (Z(k) - conj Z(-k)) / 2i.
  WindowPower Measure(Eigen::FFT<double>& fft, const float* image, const float* truth, int width, int x0, int y0) const
  {
    const std::size_t first = static_cast<std::size_t>(y0) * width + x0;
    Complex mean = 0;
    for (int y = 0; y < windowSide; ++y)
    {
      for (int x = 0; x < windowSide; ++x)
      {
        const std::size_t p = first + static_cast<std::size_t>(y) * width + x;
        mean += Complex(image[p], truth[p]) / static_cast<double>(windowSide * windowSide);
      }
    }
    std::array<std::array<Complex, windowSide>, windowSide> z;  // after the rows, transposed: [u][y]
    std::array<Complex, windowSide> in, out;
    for (int y = 0; y < windowSide; ++y)
    {
      for (int x = 0; x < windowSide; ++x)
      {
        const std::size_t p = first + static_cast<std::size_t>(y) * width + x;
        in[x] = (Complex(image[p], truth[p]) - mean) * (taper[x] * taper[y]);
      }
      fft.fwd(out.data(), in.data(), windowSide);
      for (int u = 0; u < windowSide; ++u)
      {
        z[u][y] = out[u];
      }
    }
    for (auto& column : z)
    {
      in = column;
      fft.fwd(column.data(), in.data(), windowSide);
    }
    WindowPower power = {};
    for (int v = 0; v < windowSide; ++v)
    {
      for (int u = 0; u < windowSide; ++u)
      {
        const int b = bin[v][u];
        if (b >= 0)
        {
          const Complex plus = z[u][v];
          const Complex minus = std::conj(z[(windowSide - u) % windowSide][(windowSide - v) % windowSide]);
          power[0][b] += std::norm(plus + minus) / 4;
          power[1][b] += std::norm(plus - minus) / 4;
        }
      }
    }
    return power;
  }
};

bool IsLit(const std::vector<char>& lit, int width, int x0, int y0)
{
  for (int y = y0; y < y0 + windowSide; ++y)
  {
    const auto row = lit.begin() + static_cast<std::ptrdiff_t>(y) * width + x0;
    if (std::find(row, row + windowSide, 0) != row + windowSide)
    {
      return false;
    }
  }
  return true;
}

/// Welch's estimate: the mean periodogram over the lit windows.
WindowPower MeasureSpectra(const float* image, const float* truth, int width, int height, const std::vector<char>& lit)
{
  const Spectrum& spectrum = Spectrum::Get();
  const int down = height < windowSide ? 0 : (height - windowSide) / windowStride + 1;
  std::vector<WindowPower> rows(down, WindowPower{});
  std::vector<double> windows(down, 0.0);
  tbb::parallel_for(0, down,
                    [&](int row)
                    {
                      const int y = row * windowStride;
                      Eigen::FFT<double> fft;  // keeps its tables
                      for (int x = 0; x + windowSide <= width; x += windowStride)
                      {
                        if (!IsLit(lit, width, x, y))
                        {
                          continue;
                        }
                        windows[row] += 1;
                        const WindowPower power = spectrum.Measure(fft, image, truth, width, x, y);
                        for (int b = 0; b < spectrumBins; ++b)
                        {
                          rows[row][0][b] += power[0][b];
                          rows[row][1][b] += power[1][b];
                        }
                      }
                    });
  WindowPower total = {};
  double count = 0;
  for (int row = 0; row < down; ++row)
  {
    count += windows[row];
  }
  for (int row = 0; row < down && count > 0; ++row)
  {
    for (int b = 0; b < spectrumBins; ++b)
    {
      const double scale = 1 / (count * spectrum.samples[b] * spectrum.energy);
      total[0][b] += rows[row][0][b] * scale;
      total[1][b] += rows[row][1][b] * scale;
    }
  }
  return total;
}

void CompareSpectra(TextureComparison& out)
{
  const Spectrum& spectrum = Spectrum::Get();
  double image = 0, truth = 0;  // above half of Nyquist's frequency
  out.spectrumDifference = 0;
  for (int b = 0; b < spectrumBins; ++b)
  {
    const double a = std::max(out.image.power[b], smallestPower);
    const double t = std::max(out.truth.power[b], smallestPower);
    out.spectrumDifference += std::abs(10 * std::log10(a / t)) / spectrumBins;
    if (b >= spectrumBins / 2)
    {
      image += spectrum.samples[b] * a;
      truth += spectrum.samples[b] * t;
    }
  }
  out.highFrequencyPower = image / truth;
}

}  // namespace

BackscatterFidelity Bfs(const float* image, const float* truth, int width, int height)
{
  Patches patches = MeasurePatches(image, truth, width, height);
  BackscatterFidelity out{1, 1, 1, 1};
  if (patches.truth.empty())
  {
    return out;
  }
  std::vector<double> foundRayleigh, expectedRayleigh;  // where the truth is fully developed speckle
  for (std::size_t k = 0; k < patches.truth.size(); ++k)
  {
    if (std::abs(patches.truth[k] - rayleighContrast) < rayleighWidth)
    {
      foundRayleigh.push_back(patches.image[k]);
      expectedRayleigh.push_back(patches.truth[k]);
    }
  }
  const double mean = Mean(patches.truth);
  out.meanContrast = std::max(0.0, 1 - Share(std::abs(Mean(patches.image) - mean), mean));
  if (!foundRayleigh.empty())
  {
    out.rayleigh = std::exp(-std::abs(Mean(foundRayleigh) - Mean(expectedRayleigh)) / rayleighContrast);
  }
  std::sort(patches.image.begin(), patches.image.end());
  std::sort(patches.truth.begin(), patches.truth.end());
  out.contrastDistribution =
      std::exp(-Share(SortedDistance(patches.image, patches.truth), std::sqrt(MeanSquare(patches.truth, mean))));
  out.score = 0.4 * out.meanContrast + 0.4 * out.contrastDistribution + 0.2 * out.rayleigh;
  return out;
}

TextureComparison CompareTexture(const float* image, const float* truth, int width, int height)
{
  Patches patches = MeasurePatches(image, truth, width, height);
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
  const WindowPower power = MeasureSpectra(image, truth, width, height, lit);
  out.image.power = power[0];
  out.truth.power = power[1];
  CompareSpectra(out);
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
    for (int b = 0; b < spectrumBins; ++b)
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
