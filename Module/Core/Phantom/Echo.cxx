// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/Echo.h"

#include <algorithm>
#include <cmath>

#include "Core/Numerics/Constants.h"
#include "Core/Phantom/Scatterers.h"
#include "Core/Phantom/World.h"

namespace bigus
{
namespace
{

constexpr double kSpeedOfSound = 1.54;  // mm / us

using Complex = std::complex<float>;

/// Two-way gain along every line relative to parenchyma, averaged over the elevation profile and applied to the grid.
void Attenuate(const PhantomOptions& options, const Aperture& aperture, std::vector<Complex>& grid)
{
  constexpr double kStep = 0.3;  // mm along a line
  constexpr int kStride = 3;     // lines: one lateral standard deviation at the deepest range
  constexpr double kNode[5] = {0, 1.3556261799742659, -1.3556261799742659, 2.8569700138728056, -2.8569700138728056};
  constexpr double kWeight[5] = {8.0 / 15, 0.2220759220056126, 0.2220759220056126, 0.0112574113277207,
                                 0.0112574113277207};  // Gauss and Hermite, exact to degree 9
  // Natural logarithm of amplitude, both ways, per mm: dB / (cm MHz) times MHz.
  const double perMillimetre = 2 * options.attenuation * options.frequency / 10 * std::log(10.0) / 20;

  const int columns = (aperture.lines - 1 + kStride - 1) / kStride + 1;
  const double deepest = aperture.gridRange + (aperture.ranges - 1) * aperture.rangeStep;
  const int rows = static_cast<int>(std::ceil((deepest - aperture.firstRange) / kStep)) + 2;
  std::vector<float> gain(static_cast<std::size_t>(rows) * columns, 0.0f);
  for (int column = 0; column < columns; ++column)
  {
    const double line = aperture.gridLine + column * kStride * aperture.lineStep;
    for (int q = 0; q < 5; ++q)
    {
      double exponent = 0;
      for (int row = 0; row < rows; ++row)
      {
        gain[static_cast<std::size_t>(row) * columns + column] += static_cast<float>(kWeight[q] * std::exp(-exponent));
        const Eigen::Vector3d point =
            aperture.ToWorld({aperture.firstRange + (row + 0.5) * kStep, line}, kNode[q] * options.elevationSigma);
        exponent += (PropertiesOf(OrganAt(point)).attenuation - 1) * perMillimetre * kStep;
      }
    }
  }

  for (int r = 0; r < aperture.ranges; ++r)
  {
    const double depth = std::max(aperture.gridRange + r * aperture.rangeStep - aperture.firstRange, 0.0) / kStep;
    const int row = static_cast<int>(depth);
    const float down = static_cast<float>(depth - row);
    const float* above = &gain[static_cast<std::size_t>(row) * columns];
    const float* below = above + columns;
    Complex* samples = &grid[static_cast<std::size_t>(r) * aperture.lines];
    for (int l = 0; l < aperture.lines; ++l)
    {
      const int column = l / kStride;
      const int next = std::min(column + 1, columns - 1);
      const float right = static_cast<float>(l % kStride) / kStride;
      const float left = (1 - down) * above[column] + down * below[column];
      samples[l] *= left + right * ((1 - down) * above[next] + down * below[next] - left);
    }
  }
}

/// Taps 0 .. n of a symmetric filter that turns bilinearly deposited impulses into Gaussians of peak 1 and of standard
/// deviation `sigma` samples once they are read bilinearly: each of the two adds 1/6 to the variance.
std::vector<float> GaussianTaps(double sigma)
{
  const double variance = sigma * sigma - 1.0 / 3;
  std::vector<float> taps(static_cast<std::size_t>(std::ceil(kReach * sigma)) + 1);
  for (std::size_t k = 0; k < taps.size(); ++k)
  {
    taps[k] = static_cast<float>(sigma / std::sqrt(variance) * std::exp(-0.5 * k * k / variance));
  }
  return taps;
}

/// out[i] += factor * in[i] for n complex numbers.
void AddScaled(Complex* out, const Complex* in, float factor, int n)
{
  float* o = reinterpret_cast<float*>(out);
  const float* s = reinterpret_cast<const float*>(in);
  for (int i = 0; i < 2 * n; ++i)
  {
    o[i] += factor * s[i];
  }
}

/// Impulses, [ranges][lines]: exact elevation weight and carrier phase, bilinear place. The profile in range and line comes
/// after.
std::vector<Complex> Impulses(const PhantomOptions& options, const Aperture& aperture)
{
  const int lines = aperture.lines;
  std::vector<Complex> grid(static_cast<std::size_t>(lines) * aperture.ranges);
  const double elevation = -0.5 / (options.elevationSigma * options.elevationSigma);
  const double twiceWavenumber = 4 * kPi * options.frequency / kSpeedOfSound;
  ForEachScatterer(options, aperture,
                   [&](const Scatterer& s)
                   {
                     const BeamPoint& p = s.place;
                     const double r = (p.range - aperture.gridRange) / aperture.rangeStep;
                     const double l = (p.line - aperture.gridLine) / aperture.lineStep;
                     if (!(r >= 0 && l >= 0 && r < aperture.ranges - 1 && l < lines - 1))
                     {
                       return;
                     }
                     const int ri = static_cast<int>(r), li = static_cast<int>(l);
                     const float rf = static_cast<float>(r - ri), lf = static_cast<float>(l - li);
                     const double amplitude = s.amplitude * std::exp(elevation * s.elevation * s.elevation);
                     const double phase = -twiceWavenumber * p.range;
                     const Complex echo(static_cast<float>(amplitude * std::cos(phase)),
                                        static_cast<float>(amplitude * std::sin(phase)));
                     Complex* at = &grid[static_cast<std::size_t>(ri) * lines + li];
                     at[0] += (1 - rf) * (1 - lf) * echo;
                     at[1] += (1 - rf) * lf * echo;
                     at[lines] += rf * (1 - lf) * echo;
                     at[lines + 1] += rf * lf * echo;
                   });
  return grid;
}

}  // namespace

std::vector<Complex> SumEchoes(const PhantomOptions& options, const Aperture& aperture)
{
  const int lines = aperture.lines;
  std::vector<Complex> grid = Impulses(options, aperture);
  if (options.scene == PhantomScene::Organ)
  {
    Attenuate(options, aperture, grid);
  }

  const std::vector<float> axial = GaussianTaps(kOversampling);
  std::vector<Complex> echoes(grid.size());
  std::vector<Complex> row(lines);
  for (int r = aperture.firstLitRange; r <= aperture.lastLitRange; ++r)
  {
    std::fill(row.begin(), row.end(), Complex(0));
    for (int k = 1 - static_cast<int>(axial.size()); k < static_cast<int>(axial.size()); ++k)
    {
      if (r + k >= 0 && r + k < aperture.ranges)
      {
        AddScaled(row.data(), &grid[static_cast<std::size_t>(r + k) * lines], axial[std::abs(k)], lines);
      }
    }
    const double range = aperture.gridRange + r * aperture.rangeStep;
    const std::vector<float> lateral = GaussianTaps(options.lateralSigma / aperture.MillimetresPerLine(range));
    Complex* out = &echoes[static_cast<std::size_t>(r) * lines];
    for (int k = 1 - static_cast<int>(lateral.size()); k < static_cast<int>(lateral.size()); ++k)
    {
      const int from = std::max(aperture.firstLitLine, -k);
      const int to = std::min(aperture.lastLitLine, lines - 1 - k);
      AddScaled(out + from, &row[from + k], lateral[std::abs(k)], to - from + 1);
    }
  }
  return echoes;
}

void ScanConvert(const Aperture& aperture, const std::vector<Complex>& echoes, Complex* image)
{
  for (int j = 0; j < aperture.height; ++j)
  {
    for (int i = 0; i < aperture.width; ++i)
    {
      const BeamPoint p = aperture.PixelToBeam(i, j);
      Complex& pixel = image[static_cast<std::size_t>(j) * aperture.width + i];
      if (!aperture.IsLit(p))
      {
        pixel = 0;
        continue;
      }
      const double r = (p.range - aperture.gridRange) / aperture.rangeStep;
      const double l = (p.line - aperture.gridLine) / aperture.lineStep;
      const int ri = std::clamp(static_cast<int>(r), aperture.firstLitRange, aperture.lastLitRange - 1);
      const int li = std::clamp(static_cast<int>(l), aperture.firstLitLine, aperture.lastLitLine - 1);
      const float rf = static_cast<float>(r - ri), lf = static_cast<float>(l - li);
      const Complex* at = &echoes[static_cast<std::size_t>(ri) * aperture.lines + li];
      const Complex above = (1 - lf) * at[0] + lf * at[1];
      const Complex below = (1 - lf) * at[aperture.lines] + lf * at[aperture.lines + 1];
      pixel = (1 - rf) * above + rf * below;
    }
  }
}

}  // namespace bigus
