// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The beam's thickness, estimated from phantoms that know it, and refused where a sweep cannot tell.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Probe/ElevationEstimate.h"

using namespace bigus;

namespace
{

/// A small linear phantom with 50 scatterers in a resolution cell: fully developed speckle. Tilt and wander
/// as by default.
PhantomOptions Options(double sigma, double spacing, std::uint64_t seed)
{
  PhantomOptions o;
  o.scene = PhantomScene::Speckle;
  o.seed = seed;
  o.width = o.height = 128;
  o.frames = 40;
  o.elevationSigma = sigma;
  o.frameSpacing = spacing;
  o.scattererDensity = 40 / sigma;
  return o;
}

ElevationEstimate Estimate(const PhantomOptions& options)
{
  const Sweep sweep = Phantom(options).MakeSweep();
  const ElevationEstimate e = EstimateElevationSigma(sweep, AllFrames(sweep));
  std::printf("  sigma %g mm, spacing %.2f mm, seed %d%s%s: %.3f mm (%+.1f %%) +- %.3f, %zu pairs%s%s\n",
              options.elevationSigma, options.frameSpacing, static_cast<int>(options.seed),
              options.scene == PhantomScene::Organ ? ", organ" : "", options.trackingNoise > 0 ? ", jitter" : "",
              e.sigma, 100 * (e.sigma / options.elevationSigma - 1), e.standardError, e.pairs,
              e.reliable ? "" : "; refused: ", e.reason.c_str());
  return e;
}

void ExpectWithin(const ElevationEstimate& e, double sigma, double share)
{
  EXPECT_TRUE(e.reliable) << e.reason;
  EXPECT_NEAR(e.sigma, sigma, share * sigma);
  EXPECT_LT(e.standardError, 0.1 * sigma);
}

void ExpectRefused(const ElevationEstimate& e, const std::string& because)
{
  EXPECT_FALSE(e.reliable) << e.sigma;
  EXPECT_NE(e.reason.find(because), std::string::npos) << e.reason;
}

/// Parallel planes of 64 x 64 pixels of 0.3 mm, 0.4 mm apart.
Sweep Made(int frames, const std::function<std::uint8_t(int frame, int x, int y)>& value)
{
  Sweep sweep;
  sweep.width = sweep.height = 64;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>();
  for (int k = 0; k < frames; ++k)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 0) = pose(1, 1) = 0.3;
    pose(2, 3) = 0.4 * k;
    sweep.imageToReference.push_back(pose);
    for (int y = 0; y < 64; ++y)
    {
      for (int x = 0; x < 64; ++x)
      {
        pixels->push_back(value(k, x, y));
      }
    }
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

TEST(ElevationEstimate, FindsTheKnownThickness)
{
  for (const double sigma : {1.0, 2.0, 3.0, 4.0})
  {
    for (const int seed : {1, 2, 3})
    {
      ExpectWithin(Estimate(Options(sigma, 0.5, seed)), sigma, 0.1);
    }
    ExpectWithin(Estimate(Options(sigma, 0.25 * sigma, 4)), sigma, 0.1);
  }
}

TEST(ElevationEstimate, FindsItAmongVesselsAndBone)
{
  for (const double sigma : {1.0, 4.0})
  {
    PhantomOptions options = Options(sigma, 0.5, 1);
    options.scene = PhantomScene::Organ;
    options.pixelSize = 0.25;
    options.width = options.height = 160;
    ExpectWithin(Estimate(options), sigma, 0.1);
  }
}

TEST(ElevationEstimate, FindsItThoughTheTrackerJitters)
{
  for (const int seed : {1, 2, 3})
  {
    PhantomOptions options = Options(1, 0.3, seed);
    options.trackingNoise = 0.1;  // half an axial standard deviation of the pulse
    ExpectWithin(Estimate(options), 1, 0.1);
  }
}

TEST(ElevationEstimate, TheCurveFallsAsTheModelSays)
{
  PhantomOptions options = Options(1.5, 0.4, 1);
  options.tilt = options.wander = 0;  // parallel planes: coherence exp(-d^2 / (4 sigma^2)) and nothing else
  const ElevationEstimate e = Estimate(options);
  ExpectWithin(e, 1.5, 0.05);
  ASSERT_EQ(e.distance.size(), e.correlation.size());
  ASSERT_EQ(e.distance.size(), e.fitted.size());
  // Two log-compressed images of coherence rho correlate as Li2(rho^2) / Li2(1); Li2 by numerical integration
  // of -ln(1 - t) / t.
  const auto dilogarithm = [](double x)
  {
    double sum = 0;
    constexpr int steps = 100000;
    for (int k = 0; k < steps; ++k)
    {
      const double t = (k + 0.5) / steps * x;
      sum -= std::log1p(-t) / t * x / steps;
    }
    return sum;
  };
  for (std::size_t k = 0; k < e.distance.size(); ++k)
  {
    const double d = e.distance[k];
    const double expected = dilogarithm(std::exp(-d * d / (2 * 1.5 * 1.5))) / dilogarithm(1);
    EXPECT_NEAR(e.correlation[k], expected, 0.05) << d;
    EXPECT_NEAR(e.correlation[k], e.fitted[k], 0.04) << d;
  }
}

TEST(ElevationEstimate, SameBitsForAnyNumberOfThreadsAndEitherPixelType)
{
  const Sweep sweep = Phantom(Options(1, 0.5, 1)).MakeSweep();
  const ElevationEstimate many = EstimateElevationSigma(sweep, AllFrames(sweep));
  {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const ElevationEstimate alone = EstimateElevationSigma(sweep, AllFrames(sweep));
    EXPECT_EQ(many.sigma, alone.sigma);
    EXPECT_EQ(many.correlation, alone.correlation);
  }
  Sweep floats = sweep;
  auto pixels = std::make_shared<std::vector<float>>(sweep.PixelsPerFrame() * sweep.NumberOfFrames());
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    sweep.CopyFrame(k, pixels->data() + k * sweep.PixelsPerFrame());
  }
  floats.pixelType = Sweep::PixelType::Float32;
  floats.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  EXPECT_NEAR(EstimateElevationSigma(floats, AllFrames(floats)).sigma, many.sigma, 1e-4);
}

TEST(ElevationEstimate, RefusesSparseSweeps)
{
  EXPECT_FALSE(Estimate(Options(1, 3, 1)).reliable);
  EXPECT_FALSE(Estimate(Options(2, 6, 2)).reliable);
}

TEST(ElevationEstimate, TakesSweepsLongerThanItsCurve)
{
  // Parallel planes to 94 mm apart, by 2.4 mm: the curve ends at 40 mm, and frames that are moved along their
  // normals may pass it.
  for (std::uint64_t seed = 1; seed <= 3; ++seed)
  {
    PhantomOptions options = Options(2, 2.4, seed);
    options.scattererDensity = 5;
    options.trackingNoise = 0.3;
    options.width = options.height = 96;
    const ElevationEstimate e = Estimate(options);
    ASSERT_FALSE(e.distance.empty());
    EXPECT_LT(e.distance.back(), 60);
    EXPECT_TRUE(std::is_sorted(e.distance.begin(), e.distance.end()));
  }
}

TEST(ElevationEstimate, RefusesSweepsTooShort)
{
  const Sweep sweep = Phantom(Options(4, 0.05, 1)).MakeSweep();  // 2 mm in all
  const ElevationEstimate e = EstimateElevationSigma(sweep, AllFrames(sweep));
  ExpectRefused(e, "too near");
  ExpectRefused(EstimateElevationSigma(sweep, {0, 1}), "2 frames");
  ExpectRefused(EstimateElevationSigma(sweep, {}), "0 frames");
  EXPECT_THROW(EstimateElevationSigma(sweep, {0, 1, 2, 40}), Error);
  EXPECT_THROW(EstimateElevationSigma(sweep, {-1, 1, 2, 3}), Error);
}

TEST(ElevationEstimate, RefusesImagesWithoutSpeckle)
{
  std::mt19937_64 random(1);
  const auto estimate = [](const Sweep& sweep) { return EstimateElevationSigma(sweep, AllFrames(sweep)); };
  ExpectRefused(estimate(Made(20, [](int, int, int) { return 0; })), "neither black nor white");
  ExpectRefused(estimate(Made(20, [](int, int, int) { return 255; })), "neither black nor white");
  ExpectRefused(estimate(Made(20, [](int, int, int) { return 90; })), "no speckle");
  ExpectRefused(estimate(Made(20, [](int, int x, int y) { return 60 + x + y / 2; })), "no speckle");
  ExpectRefused(estimate(Made(20, [&](int, int, int) { return 50 + random() % 100; })), "finer than a pixel");
  // One still image, whatever the pose.
  const Sweep sweep = Phantom(Options(1, 0.5, 1)).MakeSweep();
  Sweep still = Made(
      20, [&](int, int x, int y) { return static_cast<const std::uint8_t*>(sweep.pixels.get())[y * sweep.width + x]; });
  ExpectRefused(estimate(still), "too near");
}

}  // namespace
