// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Metrics/PowerSpectrum.h"

#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>

#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Fourier.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr int kWindowSide = 2 * kSpectrumBins;  // pixels
constexpr int kWindowPixels = kWindowSide * kWindowSide;
constexpr int kWindowStride = kSpectrumBins;  // pixels
constexpr double kSmallestPower = 1e-9;       // a thousandth of what rounding to 8 bits leaves: as good as none

/// What the windows share.
struct Rings
{
  std::array<double, kWindowSide> taper;                      // Hann: sin^2(pi (n + 1/2) / 32)
  std::array<std::array<int, kWindowSide>, kWindowSide> bin;  // of frequency (u, v), -1 for none
  PowerSpectrum samples = {};                                 // frequencies in a bin
  double energy = 0;                                          // sum of squares of the two-dimensional taper

  Rings()
  {
    double squares = 0;
    for (int n = 0; n < kWindowSide; ++n)
    {
      const double s = std::sin(kPi * (n + 0.5) / kWindowSide);
      taper[n] = s * s;
      squares += taper[n] * taper[n];
    }
    energy = squares * squares;
    const auto signedFrequency = [](int k) { return k <= kWindowSide / 2 ? k : k - kWindowSide; };
    for (int v = 0; v < kWindowSide; ++v)
    {
      for (int u = 0; u < kWindowSide; ++u)
      {
        // The ring |f| = (b + 1 +- 1/2) / 32; the mean, and the corners beyond Nyquist's frequency, are in none.
        const int ring = static_cast<int>(std::lround(Eigen::Vector2d(signedFrequency(u), signedFrequency(v)).norm()));
        bin[v][u] = ring >= 1 && ring <= kSpectrumBins ? ring - 1 : -1;
        if (bin[v][u] >= 0)
        {
          samples[bin[v][u]] += 1;
        }
      }
    }
  }

  static const Rings& Get()
  {
    static const Rings rings;
    return rings;
  }
};

/// Power of two real images, summed over the frequencies of each bin.
struct WindowPower
{
  PowerSpectrum image = {}, truth = {};
};

/// Adds the periodograms of both images in one window. Two real signals are the real and imaginary part of a complex
/// one, whose transform Z holds theirs as (Z(k) + conj Z(-k)) / 2 and (Z(k) - conj Z(-k)) / 2i.
void AddWindow(const float* image, const float* truth, int width, int x0, int y0, WindowPower& power)
{
  using Complex = std::complex<double>;
  const Rings& rings = Rings::Get();
  const auto pixel = [&](int x, int y)
  {
    const std::size_t p = (static_cast<std::size_t>(y0) + y) * width + x0 + x;
    return Complex(image[p], truth[p]);
  };
  Complex mean = 0;
  for (int y = 0; y < kWindowSide; ++y)
  {
    for (int x = 0; x < kWindowSide; ++x)
    {
      mean += pixel(x, y) / static_cast<double>(kWindowPixels);
    }
  }
  std::array<Complex, kWindowPixels> tapered, z;
  for (int y = 0; y < kWindowSide; ++y)
  {
    for (int x = 0; x < kWindowSide; ++x)
    {
      tapered[y * kWindowSide + x] = (pixel(x, y) - mean) * (rings.taper[x] * rings.taper[y]);
    }
  }
  FourierTransform(tapered.data(), z.data(), kWindowSide, kWindowSide);
  for (int v = 0; v < kWindowSide; ++v)
  {
    for (int u = 0; u < kWindowSide; ++u)
    {
      const int b = rings.bin[v][u];
      if (b >= 0)
      {
        const Complex plus = z[v * kWindowSide + u];
        const Complex minus =
            std::conj(z[(kWindowSide - v) % kWindowSide * kWindowSide + (kWindowSide - u) % kWindowSide]);
        power.image[b] += std::norm(plus + minus) / 4;
        power.truth[b] += std::norm(plus - minus) / 4;
      }
    }
  }
}

bool IsLit(const std::vector<char>& lit, int width, int x0, int y0)
{
  for (int y = y0; y < y0 + kWindowSide; ++y)
  {
    const auto row = lit.begin() + static_cast<std::ptrdiff_t>(y) * width + x0;
    if (std::find(row, row + kWindowSide, 0) != row + kWindowSide)
    {
      return false;
    }
  }
  return true;
}

}  // namespace

SpectraComparison CompareSpectra(const float* image, const float* truth, int width, int height,
                                 const std::vector<char>& lit)
{
  const int down = height < kWindowSide ? 0 : (height - kWindowSide) / kWindowStride + 1;
  std::vector<WindowPower> rows(down);
  std::vector<double> windows(down, 0.0);
  tbb::parallel_for(0, down,
                    [&](int row)
                    {
                      const int y = row * kWindowStride;
                      for (int x = 0; x + kWindowSide <= width; x += kWindowStride)
                      {
                        if (IsLit(lit, width, x, y))
                        {
                          windows[row] += 1;
                          AddWindow(image, truth, width, x, y, rows[row]);
                        }
                      }
                    });

  const Rings& rings = Rings::Get();
  SpectraComparison out;
  const double count = SumInOrder(windows);
  for (int row = 0; row < down && count > 0; ++row)
  {
    for (int b = 0; b < kSpectrumBins; ++b)
    {
      const double scale = 1 / (count * rings.samples[b] * rings.energy);
      out.image[b] += rows[row].image[b] * scale;
      out.truth[b] += rows[row].truth[b] * scale;
    }
  }
  double fineImage = 0, fineTruth = 0;  // above half of Nyquist's frequency
  for (int b = 0; b < kSpectrumBins; ++b)
  {
    const double a = std::max(out.image[b], kSmallestPower);
    const double t = std::max(out.truth[b], kSmallestPower);
    out.difference += std::abs(10 * std::log10(a / t)) / kSpectrumBins;
    if (b >= kSpectrumBins / 2)
    {
      fineImage += rings.samples[b] * a;
      fineTruth += rings.samples[b] * t;
    }
  }
  out.highFrequencyPower = fineImage / fineTruth;
  return out;
}

}  // namespace bigus
