// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Evaluation/CrossPlanes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <string>

#include "Core/Evaluation/Baselines.h"
#include "Core/Model/Error.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Fourier.h"

namespace bigus
{
namespace
{

constexpr int kWindowGaps = 8;
constexpr int kWindow = kWindowGaps * kSamplesPerGap;  // pixels
constexpr int kStride = kWindow / 2;
constexpr int kNyquist = kWindowGaps / 2;  // index of the frequency 1 / (2 d)
constexpr int kPlanesEach = 3;
constexpr int kMostColumns = 128;         // columns are measured one by one; more of them say little more
constexpr std::size_t kMostFrames = 400;  // in a path of metres, planes along all of it would take hours
constexpr double kMostRows = 16;          // of a cross-plane, for each frame: work in proportion to what was recorded
constexpr double kStepRounding = 1e-6;    // steps: a last pixel on the last frame stays

/// Hann's taper over a window, of mean square 1.
std::array<double, kWindow> Taper()
{
  std::array<double, kWindow> taper;
  double squares = 0;
  for (int n = 0; n < kWindow; ++n)
  {
    const double s = std::sin(kPi * (n + 0.5) / kWindow);
    taper[n] = s * s;
    squares += taper[n] * taper[n];
  }
  for (double& value : taper)
  {
    value *= std::sqrt(kWindow / squares);
  }
  return taper;
}

struct PowerSum
{
  PowerAlong power;
  double windows = 0;

  void Add(const PowerSum& other)
  {
    power.within += other.power.within;
    power.beyond += other.power.beyond;
    windows += other.windows;
  }
};

PowerSum SumPowerAlong(const float* picture, const std::uint8_t* counted, int width, int height)
{
  using Complex = std::complex<double>;
  static const std::array<double, kWindow> taper = Taper();
  static const FourierTable<double> table(kWindow);
  Fourier<double> fourier(table);
  PowerSum sum;
  for (int i = 0; i < width; ++i)
  {
    for (int first = 0; first + kWindow <= height; first += kStride)
    {
      std::array<Complex, kWindow> samples, transform;
      Complex mean = 0;
      bool whole = true;
      for (int n = 0; n < kWindow && whole; ++n)
      {
        const std::size_t p = (static_cast<std::size_t>(first) + n) * width + i;
        whole = counted[p] != 0;
        samples[n] = picture[p];
        mean += samples[n] / static_cast<double>(kWindow);
      }
      if (!whole)
      {
        continue;
      }
      for (int n = 0; n < kWindow; ++n)
      {
        samples[n] = (samples[n] - mean) * taper[n];
      }
      fourier.Transform(samples.data(), transform.data());
      for (int k = 1; k <= kWindow / 2; ++k)
      {
        // Parseval: frequencies k and -k of a real signal hold the same; the last stands alone.
        const double share = (k < kWindow / 2 ? 2.0 : 1.0) * std::norm(transform[k]) / (kWindow * kWindow);
        (k <= kNyquist ? sum.power.within : sum.power.beyond) += k == kNyquist + 1 ? 0 : share;
      }
      sum.windows += 1;
    }
  }
  return sum;
}

/// Nothing where no window fits.
std::optional<PowerAlong> MeanPower(const std::vector<CrossPlane>& planes,
                                    const std::function<void(const SlicePlane&, float*)>& predict)
{
  PowerSum sum;
  for (const CrossPlane& cross : planes)
  {
    std::vector<float> picture(cross.plane.NumberOfPixels());
    predict(cross.plane, picture.data());
    sum.Add(SumPowerAlong(picture.data(), cross.enclosed.data(), cross.plane.width, cross.plane.height));
  }
  return sum.windows > 0 ? std::optional(PowerAlong{sum.power.within / sum.windows, sum.power.beyond / sum.windows})
                         : std::nullopt;
}

}  // namespace

std::vector<CrossPlane> MakeCrossPlanes(const Sweep& sweep, const std::vector<int>& frames, int each, double step,
                                        int stride)
{
  Require(frames.size() >= 2 && each >= 1 && step > 0 && stride >= 1, "Cross-planes: ", frames.size(), " frames, ",
          each, " planes and ", step, " mm were given; two frames, one plane and a positive step are the least.");
  const auto half = static_cast<std::ptrdiff_t>(frames.size() / 2);
  const SlicePlane middle = sweep.Plane(frames[half]);
  const Eigen::Vector3d normal = middle.Normal();
  const double longest = kBreak * MeasureGeometry(sweep, frames).usualSpacing;
  double first = 0, last = 0;  // mm along the normal
  for (std::ptrdiff_t k = 0; k < static_cast<std::ptrdiff_t>(frames.size()); ++k)
  {
    const Eigen::Vector3d centre = CentreOf(sweep.Plane(frames[k]));
    const double z = normal.dot(centre - middle.origin);
    if (std::abs(z) <= longest * static_cast<double>(std::abs(k - half)))
    {
      first = std::min(first, z);
      last = std::max(last, z);
    }
  }
  const double most = 0.5 * kMostRows * static_cast<double>(frames.size()) * step;
  first = std::max(first, -most);
  last = std::min(last, most);
  const int height = static_cast<int>(std::floor((last - first) / step + kStepRounding)) + 1;
  std::vector<CrossPlane> planes;
  for (int k = 0; k < 2 * each; ++k)
  {
    const bool axial = k < each;
    const double across = (k % each + 0.5) / each * ((axial ? sweep.width : sweep.height) - 1);
    CrossPlane cross;
    cross.plane.origin = (axial ? middle.Point(across, 0) : middle.Point(0, across)) + first * normal;
    cross.plane.columnStep = stride * (axial ? middle.rowStep : middle.columnStep);
    cross.plane.rowStep = step * normal;
    cross.plane.width = ((axial ? sweep.height : sweep.width) - 1) / stride + 1;
    cross.plane.height = height;
    cross.enclosed.resize(cross.plane.NumberOfPixels());
    FindEnclosed(sweep, frames, cross.plane, cross.enclosed.data());
    planes.push_back(std::move(cross));
  }
  return planes;
}

CrossPlaneScorer::CrossPlaneScorer(const Sweep& sweep, const std::vector<int>& training)
{
  const std::vector<int> given = LongestSequence(sweep, training);
  const auto spare = static_cast<std::ptrdiff_t>(given.size() - std::min(given.size(), kMostFrames)) / 2;
  const std::vector<int> frames(given.begin() + spare, given.end() - spare);
  const double gap = frames.size() < 2 ? 0 : MeasureGeometry(sweep, frames).usualSpacing;
  if (gap > 0)
  {
    const int stride = (std::max(sweep.width, sweep.height) - 1) / kMostColumns + 1;
    planes_ = MakeCrossPlanes(sweep, frames, kPlanesEach, gap / kSamplesPerGap, stride);
    linear_ = MeanPower(planes_, [&](const SlicePlane& plane, float* picture)
                        { PredictPoseInterpolation(sweep, frames, plane, picture); });
  }
}

std::optional<CrossScores> CrossPlaneScorer::Score(const std::function<void(const SlicePlane&, float*)>& predict) const
{
  if (!linear_ || !(linear_->within > 0 && linear_->beyond > 0))
  {
    return std::nullopt;
  }
  CrossScores scores{*MeanPower(planes_, predict), *linear_};
  scores.detail = scores.power.within / scores.linear.within;
  scores.scratches = scores.power.beyond / scores.linear.beyond;
  return scores;
}

}  // namespace bigus
