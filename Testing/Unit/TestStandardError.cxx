// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The standard error of a slice: its formula against a slow one, and what it says against errors that are known.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
#include "Core/StandardError/StandardError.h"
#include "Core/Trainer/Trainer.h"

namespace bigus::standard_error_test
{
namespace
{

constexpr double kDegree = 3.14159265358979323846 / 180;
const std::vector<double> kPlaces = {0.0, 0.6, 1.0, 1.9, 2.3, 3.3, 3.5};   // mm
const std::vector<double> kGreys = {0.2, 0.5, 0.3, 0.7, 0.45, 0.6, 0.25};  // of the whole frame
constexpr int kWidth = 41, kHeight = 33;

/// Parallel frames, each of one grey.
Sweep GreySweep()
{
  Sweep sweep;
  sweep.width = kWidth;
  sweep.height = kHeight;
  sweep.pixelType = Sweep::PixelType::Float32;
  auto pixels = std::make_shared<std::vector<float>>();
  for (std::size_t k = 0; k < kPlaces.size(); ++k)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 0) = pose(1, 1) = 0.5;
    pose(2, 3) = kPlaces[k];
    sweep.imageToReference.push_back(pose);
    pixels->insert(pixels->end(), kWidth * kHeight, static_cast<float>(kGreys[k]));
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

/// A field that shows black everywhere, so that residuals are the frames themselves.
StandardError OfBlack(double tracker)
{
  const Sweep sweep = GreySweep();
  return StandardError(GaussianField(), sweep, AllFrames(sweep), tracker);
}

/// A plane amid the frames, turned by so many degrees about x, y and z.
SlicePlane Plane(double x, double y, double z, double pixel = 0.5)
{
  const Eigen::Matrix3d turn = (Eigen::AngleAxisd(x * kDegree, Eigen::Vector3d::UnitX()) *
                                Eigen::AngleAxisd(y * kDegree, Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(z * kDegree, Eigen::Vector3d::UnitZ()))
                                   .toRotationMatrix();
  SlicePlane plane;
  plane.width = 27;
  plane.height = 23;
  plane.columnStep = pixel * turn.col(0);
  plane.rowStep = pixel * turn.col(1);
  plane.origin = Eigen::Vector3d(10, 8, 1.6) - 13 * plane.columnStep - 11 * plane.rowStep;
  return plane;
}

double Ramp(int i, int j)
{
  return 0.3 + 0.01 * i - 0.004 * j;
}

std::vector<float> Ramps(const SlicePlane& plane)
{
  std::vector<float> image;
  for (int p = 0; p < plane.width * plane.height; ++p)
  {
    image.push_back(static_cast<float>(Ramp(p % plane.width, p / plane.width)));
  }
  return image;
}

std::vector<float> Sigma(const StandardError& error, const SlicePlane& plane)
{
  const std::vector<float> image = Ramps(plane);
  std::vector<float> sigma(image.size());
  error.Evaluate(plane, image.data(), sigma.data());
  return sigma;
}

double Between(std::size_t before, double at, std::size_t behind, const std::vector<double>& values)
{
  const double t = (kPlaces[behind] - at) / (kPlaces[behind] - kPlaces[before]);
  return t * values[before] + (1 - t) * values[behind];
}

double Apart(double before, double at, double behind)
{
  return (at - before) * (behind - at) / (behind - before);
}

/// R of the frames 1 to 5: each left out, and interpolated between its neighbours.
std::vector<double> Rates()
{
  std::vector<double> apart, rates(kPlaces.size(), 0);
  for (std::size_t k = 1; k + 1 < kPlaces.size(); ++k)
  {
    apart.push_back(Apart(kPlaces[k - 1], kPlaces[k], kPlaces[k + 1]));
  }
  std::vector<double> sorted = apart;
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t k = 1; k + 1 < kPlaces.size(); ++k)
  {
    const double error = kGreys[k] - Between(k - 1, kPlaces[k], k + 1, kGreys);
    rates[k] = error * error / std::max(apart[k - 1], 0.5 * sorted[2]);
  }
  return rates;
}

/// A beam and what is across the plane that it is seen in.
struct View
{
  Eigen::Vector3d beam, normal;
};

/// How much of log-compressed speckle is another: both views see echoes of the same scatterers, through a beam of 0.4 mm
/// in the plane and 0.8 mm across it, at phases that differ by 2 k times how much deeper they lie.
double Another(const View& frame, const View& plane)
{
  const Eigen::Vector3d width = frame.normal.cross(frame.beam), planeWidth = plane.normal.cross(plane.beam);
  const double wave = std::sqrt(2.0) / (2.5 * kDegree * 0.8);  // 2 k
  double both = 0, one = 0, other = 0;
  for (double u = -2.4; u < 2.45; u += 0.15)
  {
    for (double v = -2.4; v < 2.45; v += 0.15)
    {
      const Eigen::Vector3d x = u * width + v * frame.normal;
      const auto seen = [&x](const Eigen::Vector3d& w, const Eigen::Vector3d& n)
      { return std::exp(-std::pow(x.dot(w) / 0.4, 2) / 2 - std::pow(x.dot(n) / 0.8, 2) / 2); };
      const double a = seen(width, frame.normal), b = seen(planeWidth, plane.normal);
      both += a * b * std::cos(wave * x.dot(plane.beam));
      one += a * a;
      other += b * b;
    }
  }
  const double intensities = both * both / (one * other);
  double sum = 0, norm = 0, power = 1;
  for (int n = 1; n <= 2000; ++n)
  {
    power *= intensities;
    sum += power / n / n;
    norm += 1.0 / n / n;
  }
  return 1 - sum / norm;
}

/// The model of Core/StandardError/README.md, pixel by pixel, for these frames; -1: not known.
double Expected(const SlicePlane& plane, int i, int j, double tracker, double w, bool isLit)
{
  const Eigen::Vector3d x = plane.Point(i, j);
  std::size_t behind = 1;
  while (behind < kPlaces.size() && kPlaces[behind] < x[2])
  {
    ++behind;
  }
  if (!isLit || x[2] < 0 || behind == kPlaces.size())
  {
    return -1;
  }
  const std::size_t before = behind - 1;
  const double d1 = x[2] - kPlaces[before], d2 = kPlaces[behind] - x[2], t = d2 / (d1 + d2);
  const double q = d1 * d2 / (d1 + d2) / (d1 + d2);
  const double residual = t * kGreys[before] * kGreys[before] + (1 - t) * kGreys[behind] * kGreys[behind];
  const std::vector<double> rates = Rates();
  const double w1 = before == 0 ? 0 : t, w2 = behind == 6 ? 0 : 1 - t;
  const double rate = (w1 * rates[before] + w2 * rates[behind]) / (w1 + w2);
  double sum = 0, squares = 0, count = 0;
  const int half = static_cast<int>(std::lround(3 * 0.5 / plane.columnStep.norm()));
  for (int v = std::max(0, j - half); v <= std::min(plane.height - 1, j + half); ++v)
  {
    for (int u = std::max(0, i - half); u <= std::min(plane.width - 1, i + half); ++u)
    {
      const double z = plane.Point(u, v)[2];
      const bool counts = z > 0 && z <= kPlaces.back();
      sum += counts ? Ramp(u, v) : 0;
      squares += counts ? Ramp(u, v) * Ramp(u, v) : 0;
      count += counts ? 1 : 0;
    }
  }
  const double own = squares / count - sum / count * (sum / count);
  const double slope = (0.01 * 0.01 + 0.004 * 0.004) / plane.columnStep.squaredNorm();
  const double variance =
      (1 - w) * ((1 - 2 * q) * residual + 0.7 * rate * d1 * d2 / (d1 + d2)) + 0.8 * w * own + tracker * tracker * slope;
  return std::sqrt(std::max(variance, 0.25 / 255 / 255));
}

TEST(StandardError, IsItsFormula)
{
  // A byte tells a variance to half a tenth of a factor of 2; a texture of none is kept as 1e-6 of variance, below the floor.
  const double rounding = std::exp2(0.5 * 0.05) - 1 + 1e-3;
  for (const double tracker : {0.0, 0.2})
  {
    const StandardError error = OfBlack(tracker);
    for (const SlicePlane& plane :
         {Plane(0, 0, 0), Plane(0, 12, 0), Plane(0, 90, 0), Plane(2, 0, 0), Plane(-3, 5, 4, 0.3), Plane(0, 30, 0, 1)})
    {
      const std::vector<float> sigma = Sigma(error, plane);
      int known = 0;
      const double w =
          Another({Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ()}, {plane.rowStep.normalized(), plane.Normal()});
      for (int p = 0; p < plane.width * plane.height; ++p)
      {
        const int i = p % plane.width, j = p / plane.width;
        const Eigen::Vector3d x = plane.Point(i, j);
        const bool isLit = x[0] >= 0 && x[1] >= 0 && x[0] <= 20 && x[1] <= 16;
        const double expected = Expected(plane, i, j, tracker, w, isLit);
        ASSERT_EQ(std::isnan(sigma[p]), expected < 0) << i << ' ' << j << " z " << x[2];
        if (expected >= 0)
        {
          ++known;
          ASSERT_NEAR(sigma[p], expected, rounding * expected) << i << ' ' << j << " z " << x[2];
        }
      }
      EXPECT_GT(known, 50);
    }
  }
}

TEST(StandardError, OnAFrameIsItsResidual)
{
  const Sweep sweep = GreySweep();
  const StandardError error = OfBlack(0);
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    const std::vector<float> sigma = Sigma(error, sweep.Plane(k));
    EXPECT_NEAR(sigma[kWidth * 16 + 20], kGreys[k], 0.02 * kGreys[k]) << k;  // the first and the last, too
  }
}

/// Parallel frames 0 to 4, then frames that rock by a degree to one side and the other. 1 mm apart at their middle.
Eigen::Matrix4d RockingPose(double z, double degrees)
{
  const Eigen::AngleAxisd turn(degrees * kDegree, Eigen::Vector3d::UnitX());
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.col(0).head<3>() = 0.5 * Eigen::Vector3d::UnitX();
  pose.col(1).head<3>() = 0.5 * (turn * Eigen::Vector3d::UnitY());
  pose.col(2).head<3>() = turn * Eigen::Vector3d::UnitZ();
  pose.col(3).head<3>() = Eigen::Vector3d(0, 0, z) - pose.col(0).head<3>() * 20 - pose.col(1).head<3>() * 16;
  return pose;
}

TEST(StandardError, DoesNotCountTwiceHowTheProbeRocked)
{
  Sweep sweep = GreySweep();
  auto pixels = std::make_shared<std::vector<float>>();
  sweep.imageToReference.clear();
  for (int k = 0; k < 11; ++k)
  {
    sweep.imageToReference.push_back(RockingPose(k, k < 5 ? 0 : k % 2 ? 1 : -1));
    pixels->insert(pixels->end(), kWidth * kHeight, k % 3 ? 0.4f : 0.5f);
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  const StandardError error(GaussianField(), sweep, AllFrames(sweep), 0);
  const auto atMiddle = [&](double z, double degrees)
  {
    const SlicePlane plane = SlicePlane::FromImageToReference(RockingPose(z, degrees), kWidth, kHeight);
    std::vector<float> chequered(plane.NumberOfPixels()), sigma(chequered.size());
    for (std::size_t p = 0; p < chequered.size(); ++p)
    {
      chequered[p] = p % 2 ? 0.0f : 1.0f;
    }
    error.Evaluate(plane, chequered.data(), sigma.data());
    return sigma[16 * kWidth + 20];
  };
  EXPECT_GT(atMiddle(2.4, 2), 1.01 * atMiddle(2.4, 0));  // steady frames tell nothing of what is turned by 2 degrees
  // Frame 8 was predicted from frames turned by just as much.
  EXPECT_NEAR(atMiddle(8.4, 1), atMiddle(8.4, -1), 1e-4);
  EXPECT_GT(atMiddle(8.4, 4), 1.01 * atMiddle(8.4, -1));
}

/// Frames of one grey that light a fan, whose apex is at (0, kApex) mm; the middle of the first row is at (0, 0).
constexpr double kApex = -15, kGrey = 0.5;

bool IsInFan(double x, double y)
{
  const double range = std::hypot(x, y - kApex);
  return range >= 20 && range <= 70 && std::abs(std::atan2(x, y - kApex)) <= 35 * kDegree && y >= 0;
}

Sweep FanSweep()
{
  Sweep sweep;
  sweep.width = 161;
  sweep.height = 121;
  sweep.pixelType = Sweep::PixelType::Float32;
  auto pixels = std::make_shared<std::vector<float>>();
  auto mask = std::make_shared<std::vector<std::uint8_t>>();
  for (std::size_t p = 0; p < sweep.PixelsPerFrame(); ++p)
  {
    mask->push_back(IsInFan(0.5 * (p % 161) - 40, 0.5 * (p / 161)) ? 1 : 0);
  }
  for (int k = 0; k < 41; ++k)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 0) = pose(1, 1) = 0.5;
    pose(0, 3) = -40;
    pose(2, 3) = k - 20;
    sweep.imageToReference.push_back(pose);
    pixels->insert(pixels->end(), sweep.PixelsPerFrame(), static_cast<float>(kGrey));
  }
  sweep.mask = mask;
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

TEST(StandardError, GoesByTheBeamsOfAFan)
{
  const Sweep sweep = FanSweep();
  const StandardError error(GaussianField(), sweep, AllFrames(sweep), 0);
  const std::pair<double, double> planes[] = {{0, 45}, {18, 45}, {0, 10}, {1, 0}, {12, 0}};  // mm across, degrees
  for (const auto& [across, degrees] : planes)
  {
    SlicePlane plane = sweep.Plane(20);
    plane.columnStep = 0.5 * Eigen::Vector3d(std::cos(degrees * kDegree), 0, std::sin(degrees * kDegree));
    plane.width = 201;  // the probe is where the middle of the first row is
    plane.origin = Eigen::Vector3d(across, 0, 0) - 100 * plane.columnStep;
    std::vector<float> image, sigma(plane.NumberOfPixels());
    for (std::size_t p = 0; p < plane.NumberOfPixels(); ++p)
    {
      image.push_back(p % plane.width % 2 ? 0.2f : 0.4f);
    }
    error.Evaluate(plane, image.data(), sigma.data());
    int aligned = 0, other = 0;
    for (int j = 3; j < plane.height - 3; j += 3)
    {
      for (int i = 3; i < plane.width - 3; i += 2)
      {
        const Eigen::Vector3d at = plane.Point(i, j);
        const double z = at[2] - std::floor(at[2]);
        if (!IsInFan(at[0] - 3, at[1] - 3) || !IsInFan(at[0] + 3, at[1] - 3) || !IsInFan(at[0] - 3, at[1] + 3) ||
            !IsInFan(at[0] + 3, at[1] + 3) || std::abs(at[2]) > 18)
        {
          continue;  // the window of 7 x 7 pixels may end there
        }
        const Eigen::Vector3d apex(0, kApex, at[2]), ownApex(across, kApex, 0);
        const double w = Another({(at - apex).normalized(), Eigen::Vector3d::UnitZ()},
                                 {(at - ownApex).normalized(), plane.Normal()});
        const double own = 0.04 * 3 * 4 / 49;  // 3 or 4 columns of 7 are 0.2 brighter
        const double expected = (1 - w) * (1 - 2 * z * (1 - z)) * kGrey * kGrey + 0.8 * w * own;
        const double said = static_cast<double>(sigma[j * plane.width + i]) * sigma[j * plane.width + i];
        ASSERT_NEAR(said, expected, 0.04 * expected + 0.003) << across << ' ' << degrees << " at " << at.transpose();
        aligned += w < 0.2 ? 1 : 0;
        other += w > 0.5 ? 1 : 0;
      }
    }
    EXPECT_GT(aligned + other, 50) << across << ' ' << degrees;
  }
}

/// Parallel frames 1 mm apart show one chequered pattern and noise of their own.
TEST(StandardError, CountsAsSpeckleWhatFramesDoNotShare)
{
  for (const auto& [pattern, noise] : {std::pair(0.0, 0.1), {0.1, 0.1}, {0.12, 0.06}})
  {
    Sweep sweep = GreySweep();
    sweep.imageToReference.clear();
    auto pixels = std::make_shared<std::vector<float>>();
    std::mt19937 random(3);
    std::normal_distribution<double> own(0, noise);
    for (int k = 0; k < 14; ++k)
    {
      Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
      pose(0, 0) = pose(1, 1) = 0.5;
      pose(2, 3) = k;
      sweep.imageToReference.push_back(pose);
      for (std::size_t p = 0; p < sweep.PixelsPerFrame(); ++p)
      {
        pixels->push_back(static_cast<float>(0.5 + (p % 2 ? pattern : -pattern) + own(random)));
      }
    }
    sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
    const StandardError error(GaussianField(), sweep, AllFrames(sweep), 0);
    SlicePlane plane = Plane(30, 0, 0);  // seen from such another direction no speckle is the same
    plane.origin[2] += 5;
    const std::vector<float> flat(plane.NumberOfPixels(), 0.5f);
    std::vector<float> sigma(flat.size());
    error.Evaluate(plane, flat.data(), sigma.data());
    double variance = 0;
    for (const float one : sigma)
    {
      variance += static_cast<double>(one) * one / static_cast<double>(sigma.size());
    }
    EXPECT_NEAR(variance, noise * noise, 0.1 * noise * noise) << pattern << ' ' << noise;  // the slice itself is flat
  }
}

TEST(StandardError, TellsWhatIsMostlyGuessed)
{
  const StandardError error = OfBlack(0);
  SlicePlane among = Plane(0, 0, 0);
  among.origin[2] = 0;  // on the first frame, of grey 0.2: so large is the error of black
  const SlicePlane beyond = Plane(0, 90, 0);
  std::vector<float> contrast(among.NumberOfPixels());
  for (std::size_t p = 0; p < contrast.size(); ++p)
  {
    contrast[p] = p % 2 ? 0.0f : 1.0f;
  }
  EXPECT_FALSE(error.IsMostlyGuessed(among, contrast.data()));  // varies by 0.5
  EXPECT_TRUE(error.IsMostlyGuessed(among, std::vector<float>(contrast.size(), 0.5f).data()));
  EXPECT_TRUE(
      error.IsMostlyGuessed(beyond, contrast.data()));  // most of it lies before the first frame or behind the last
  const std::vector<float> black(contrast.size(), 0.0f);
  SlicePlane away = among;
  away.origin[2] += 100;
  EXPECT_FALSE(error.IsMostlyGuessed(away, black.data()));  // nothing is shown there
}

TEST(StandardError, SaysNothingWhereNothingIsLit)
{
  Sweep sweep = GreySweep();
  auto mask = std::make_shared<std::vector<std::uint8_t>>(sweep.PixelsPerFrame(), 1);
  for (std::size_t p = 0; p < mask->size(); ++p)
  {
    (*mask)[p] = p % kWidth < 30 ? 1 : 0;
  }
  sweep.mask = mask;
  const StandardError error(GaussianField(), sweep, AllFrames(sweep), 0);
  const std::vector<float> sigma = Sigma(error, sweep.Plane(3));
  for (std::size_t p = 0; p < sigma.size(); ++p)
  {
    EXPECT_EQ(std::isnan(sigma[p]), (*mask)[p] == 0) << p;
  }
}

TEST(StandardError, OfAPartIsThatOfTheWhole)
{
  const StandardError error = OfBlack(0.1);
  const SlicePlane plane = Plane(-3, 5, 4, 0.3);
  const std::vector<float> image = Ramps(plane), whole = Sigma(error, plane);
  const int margin = error.Margin(plane);
  const Engine::Window window{4, 3, 20, 18};
  std::vector<float> part, sigma(window.columns * window.rows);
  for (int p = 0; p < window.columns * window.rows; ++p)
  {
    part.push_back(
        image[(window.firstRow + p / window.columns) * plane.width + window.firstColumn + p % window.columns]);
  }
  error.Evaluate(plane, window, part.data(), sigma.data());
  for (int j = margin; j < window.rows - margin; ++j)
  {
    for (int i = margin; i < window.columns - margin; ++i)
    {
      const float a = sigma[j * window.columns + i],
                  b = whole[(window.firstRow + j) * plane.width + window.firstColumn + i];
      EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << i << ' ' << j;
    }
  }
}

/// Noise blurred over 4 x 4 pixels, another in each frame, whose mean over n x n pixels is known. Frames lie so far apart
/// that each is another picture.
TEST(StandardError, OfAMeanCountsThatNeighboursErrAlike)
{
  constexpr int kSide = 128, kBlur = 4, kFrames = 24;
  Sweep sweep;
  sweep.width = sweep.height = kSide;
  sweep.pixelType = Sweep::PixelType::Float32;
  auto pixels = std::make_shared<std::vector<float>>();
  std::mt19937 random(11);
  std::normal_distribution<double> noise(0, 0.2 / kBlur);
  for (int k = 0; k < kFrames; ++k)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 0) = pose(1, 1) = 0.5;
    pose(2, 3) = k;
    sweep.imageToReference.push_back(pose);
    constexpr int kNoise = kSide + kBlur - 1;
    std::vector<double> white(kNoise * kNoise);
    std::generate(white.begin(), white.end(), [&] { return noise(random); });
    for (int p = 0; p < kSide * kSide; ++p)
    {
      double sum = 0.5;
      for (int at = 0; at < kBlur * kBlur; ++at)
      {
        sum += white[(p / kSide + at / kBlur) * kNoise + p % kSide + at % kBlur];
      }
      pixels->push_back(static_cast<float>(sum));
    }
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  const StandardError error(GaussianField(), sweep, AllFrames(sweep), 0);
  const SlicePlane frame = sweep.Plane(0);
  for (const int n : {2, 4, 8, 16, 32, 64})
  {
    // Along one axis pixels h < 4 apart correlate by 1 - h / 4.
    double sum = n;
    for (int h = 1; h < std::min(n, kBlur); ++h)
    {
      sum += 2 * (n - h) * (1 - static_cast<double>(h) / kBlur);
    }
    const double share = sum / (n * n);  // of the variance along one axis, and of the standard error along both
    SlicePlane square = frame;
    square.width = square.height = n;
    const std::vector<float> sigma(square.NumberOfPixels(), 0.3f);
    // Independent are squares of at least 4 x 4 pixels, and a third of the 22 frames, whose errors share neighbours.
    const double known = 22.0 / 3 * std::pow(kSide / std::max(n, kBlur), 2);
    const double all = std::pow(error.OfMean(square, sigma.data()), 2);
    const double kept = std::sqrt(all - 0.5 * 0.5) / 0.3;  // black is too dark by 0.5 as a whole
    EXPECT_NEAR(kept, share, 3 * share / std::sqrt(2 * known)) << n;
  }
  SlicePlane fine = frame;  // the same area in twice as many pixels along each axis
  fine.columnStep /= 2;
  fine.rowStep /= 2;
  const std::vector<float> sigma(frame.NumberOfPixels(), 0.3f);
  std::vector<unsigned char> corner(sigma.size(), 0);
  for (int p = 0; p < 64 * 64; ++p)
  {
    corner[p / 64 * kSide + p % 64] = 1;
  }
  EXPECT_NEAR(error.OfMean(fine, sigma.data()), error.OfMean(frame, sigma.data(), corner.data()), 1e-12);
}

TEST(StandardError, OfAMeanIsThatOfAPixelWhereAllErrAlike)
{
  const StandardError error = OfBlack(0);
  SlicePlane plane = Plane(0, 0, 0);
  plane.width = plane.height = 8;
  const std::vector<float> sigma(plane.NumberOfPixels(), 0.3f);
  // Each frame errs by its own grey as a whole, and so does the black field.
  double squares = 0;
  for (const double grey : kGreys)
  {
    squares += grey * grey / static_cast<double>(kGreys.size());
  }
  EXPECT_NEAR(error.OfMean(plane, sigma.data()), std::sqrt(0.3 * 0.3 + squares), 1e-6);
  // Within a gap between frames, usually 0.6 mm, slices err alike; in other gaps they err otherwise.
  const std::vector<float> four(4 * sigma.size(), 0.3f);
  EXPECT_NEAR(error.OfMean(plane, four.data(), nullptr, 4, 0.1), std::sqrt(0.3 * 0.3 + squares), 1e-6);
  EXPECT_NEAR(error.OfMean(plane, four.data(), nullptr, 4, 1.2), std::sqrt(0.3 * 0.3 / 6 + squares), 1e-6);
  const std::vector<float> unknown(sigma.size(), std::numeric_limits<float>::quiet_NaN());
  EXPECT_TRUE(std::isnan(error.OfMean(plane, unknown.data())));
}

TEST(StandardError, ComesBackFromItsBytesAndNoOthers)
{
  const StandardError error = OfBlack(0.1);
  const std::string bytes = error.ToBytes();
  EXPECT_EQ(StandardError(bytes).ToBytes(), bytes);
  const std::string leaping = OfBlack(1e10).ToBytes();  // a path on which the tracker leapt
  EXPECT_EQ(StandardError(leaping).ToBytes(), leaping);
  // Those of the first release had no squares, which follow the version, three sizes, the tracker's noise, and sequences,
  // shares and turns of each frame.
  const std::size_t squares =
      4 * sizeof(std::uint32_t) + sizeof(double) + 3 * (sizeof(std::uint64_t) + kPlaces.size() * sizeof(float));
  std::string first = bytes;
  first[0] = 1;
  first.erase(squares, sizeof(std::uint64_t) + (error.Squares().size() + 1) * sizeof(float));
  EXPECT_EQ(Sigma(StandardError(first), Plane(0, 0, 0)), Sigma(error, Plane(0, 0, 0)));
  EXPECT_TRUE(std::isnan(StandardError(first).OfMean(Plane(0, 0, 0), Sigma(error, Plane(0, 0, 0)).data())));
  const SlicePlane plane = Plane(0, 12, 0);
  const std::vector<float> a = Sigma(error, plane), b = Sigma(StandardError(bytes), plane);
  for (std::size_t p = 0; p < a.size(); ++p)
  {
    EXPECT_TRUE(a[p] == b[p] || (std::isnan(a[p]) && std::isnan(b[p])));
  }
  for (std::size_t size = 0; size < bytes.size(); size += 1 + size / 16)
  {
    EXPECT_THROW(StandardError(bytes.substr(0, size)), Error) << size;
  }
  EXPECT_THROW(StandardError(bytes + "x"), Error);
  for (std::size_t at = 0; at < 100; ++at)  // of the header: another number is refused, or a standard error of its own
  {
    for (const char value : {'\0', '\xff', '\x7f'})
    {
      std::string damaged = bytes;
      damaged[at] = value;
      try
      {
        Sigma(StandardError(damaged), plane);
      }
      catch (const Error& refused)
      {
        EXPECT_NE(std::string(refused.what()).find("StandardError"), std::string::npos);
      }
    }
  }
}

TEST(StandardError, DoesNotDependOnTheNumberOfThreads)
{
  std::string one;
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    one = OfBlack(0.1).ToBytes();
  }
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 5);
  EXPECT_EQ(OfBlack(0.1).ToBytes(), one);
}

/// Frames of the phantom at these planes.
Sweep Truth(const Phantom& phantom, const std::vector<SlicePlane>& planes)
{
  Sweep sweep;
  sweep.width = planes.front().width;
  sweep.height = planes.front().height;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(sweep.PixelsPerFrame() * planes.size());
  for (std::size_t k = 0; k < planes.size(); ++k)
  {
    phantom.Frame(planes[k], pixels->data() + k * sweep.PixelsPerFrame());
    sweep.imageToReference.push_back(planes[k].ImageToReference());
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

/// 0.8 to 1.25, and 92 to 98 % within two: what the model promises of tissue.
void ExpectRight(const StandardErrorScores& scores, const std::string& where)
{
  EXPECT_GT(scores.varianceRatio, 0.8) << where;
  EXPECT_LT(scores.varianceRatio, 1.25) << where;
  EXPECT_GT(scores.within2, 0.92) << where;
  EXPECT_LT(scores.within2, 0.98) << where;
}

TEST(StandardError, IsThatOfAMadeUpSweep)
{
  PhantomOptions world;
  world.frames = 48;
  world.width = world.height = 128;
  world.pixelSize = 0.3;
  const Phantom phantom(world);
  const auto sweep = std::make_shared<const Sweep>(phantom.MakeSweep());
  TrainerOptions options;
  options.holdOut = 4;
  options.gaussians = 12000;
  options.iterations = 300;
  options.elevationSigma = 0;
  options.poseSmoothing = 0;
  const TrainingResult trained = Train(sweep, options);
  std::vector<int> training = trained.trainingFrames;
  training.insert(training.end(), trained.validationFrames.begin(), trained.validationFrames.end());
  std::sort(training.begin(), training.end());
  const StandardError error(trained.field, *sweep, training, 0);
  const auto inGaps = ScoreStandardError(error, trained.field, *sweep, trained.heldOutFrames);
  ExpectRight(inGaps.model, "in gaps");
  EXPECT_GT(inGaps.known, 0.9);
  EXPECT_LT(inGaps.model.sparsification, 0.9);  // 1 is chance
  EXPECT_GT(inGaps.model.correlation, 0.1);
  EXPECT_EQ(inGaps.constant.sparsification, 1);
  for (const StandardErrorScores& peer : {inGaps.constant, inGaps.distance, inGaps.texture})
  {
    EXPECT_NEAR(peer.varianceRatio, 1, 1e-5);  // its scale is that of these frames
    EXPECT_GT(peer.sparsification, inGaps.model.sparsification);
  }

  std::vector<SlicePlane> across;
  const SlicePlane middle = sweep->Plane(sweep->NumberOfFrames() / 2);
  for (const double x : {-8.0, -4.0, 0.0, 4.0, 8.0})
  {
    SlicePlane plane = middle;
    plane.columnStep = middle.columnStep.norm() * middle.Normal();
    plane.origin = middle.Point(64, 0) + x * middle.columnStep.normalized() - 64 * plane.columnStep;
    across.push_back(plane);
  }
  const Sweep turned = Truth(phantom, across);
  const auto atRightAngles = ScoreStandardError(error, trained.field, turned, AllFrames(turned));
  ExpectRight(atRightAngles.model, "at 90 degrees");
  for (const StandardErrorReport& report : {inGaps, atRightAngles})
  {
    double stated = 0, squares = 0, count = 0, last = 0;
    for (const StandardErrorBin& bin : report.reliability)
    {
      EXPECT_GT(bin.sigma, last);
      last = bin.sigma;
      stated += bin.count * bin.sigma * bin.sigma;
      squares += bin.count * bin.error * bin.error;
      count += bin.count;
    }
    EXPECT_NEAR(stated / squares, report.model.varianceRatio, 1e-9);  // all pixels, each in one bin
    EXPECT_NEAR(std::sqrt(squares / count), report.rmse, 1e-9);
    ASSERT_GE(report.reliability.size(), 3u);
    ASSERT_GE(report.means.size(), 2u);
    for (const MeanErrorScore& score : {report.means[0], report.means[1]})
    {
      // Were pixels independent, 64 and 1024 of them would be said to err by a tenth of that, and less.
      EXPECT_GT(score.varianceRatio, 0.5) << score.side;
      EXPECT_LT(score.varianceRatio, 2) << score.side;
    }
  }
}

}  // namespace
}  // namespace bigus::standard_error_test
