// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the geometry of a sweep alone asks for.
#include <gtest/gtest.h>

#include <cmath>

#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Constants.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/VirtualPlanes.h"
#include "Support/Random.h"
#include "Support/Sweeps.h"

namespace bigus
{
namespace
{

/// A sweep of lit frames, planes `spacing` mm apart with pixels of `pixel` mm.
TrainingPlan PlanFor(double spacing, double pixel, const TrainerOptions& options = {})
{
  const auto sweep = test::BlackSweep(20, 16, 16, pixel, spacing);
  std::fill_n(test::Pixels(*sweep), 20 * sweep->PixelsPerFrame(), 0.5f);
  return PlanByGeometry(options, *sweep, bigus::AllFrames(*sweep));
}

bool Sparse(double spacing, double pixel)
{
  SweepGeometry geometry;
  geometry.usualSpacing = spacing;
  geometry.pixelSize = pixel;
  return IsSparse(geometry);
}

TEST(GeometryDefaults, SparseIsFartherThanABeamAndThanTwoPixels)
{
  EXPECT_FALSE(Sparse(0.999, 0.2));
  EXPECT_TRUE(Sparse(1.001, 0.2));
  EXPECT_FALSE(Sparse(1.999, 1.0));
  EXPECT_TRUE(Sparse(2.001, 1.0));
  EXPECT_FALSE(Sparse(0, 0.2));  // one frame
}

/// Frames whose gaps are given, mm.
std::shared_ptr<Sweep> SweepOf(const std::vector<double>& gaps)
{
  const auto sweep = test::BlackSweep(static_cast<int>(gaps.size()) + 1, 16, 16, 0.3, 0.5);
  double z = 0;
  for (std::size_t k = 0; k <= gaps.size(); ++k)
  {
    sweep->imageToReference[k](2, 3) = z;
    z += k < gaps.size() ? gaps[k] : 0;
  }
  return sweep;
}

double UsualSpacing(const std::vector<double>& gaps)
{
  const auto sweep = SweepOf(gaps);
  return MeasureGeometry(*sweep, AllFrames(*sweep)).usualSpacing;
}

TEST(GeometryDefaults, AProbeThatLingersDoesNotMakeASweepDense)
{
  std::vector<double> gaps(60, 0.02), fast(20, 0.5);
  gaps.insert(gaps.end(), fast.begin(), fast.end());
  EXPECT_NEAR(UsualSpacing(gaps), 0.5, 1e-9);
  gaps.push_back(30);  // a break is no part of the path
  gaps.insert(gaps.end(), fast.begin(), fast.end());
  EXPECT_NEAR(UsualSpacing(gaps), 0.5, 1e-9);
  // Where most of the path is slow, its few fast gaps tell nothing.
  std::vector<double> slow(60, 0.2);
  slow.insert(slow.end(), 5, 1.0);
  EXPECT_NEAR(UsualSpacing(slow), 0.2, 1e-9);
  // Nor do the uneven gaps of a hand: the median, as it is.
  EXPECT_NEAR(UsualSpacing({0.1, 0.5, 0.3, 0.45, 0.05, 0.6, 0.35}), 0.35, 1e-9);
  EXPECT_NEAR(UsualSpacing({0.5, 0.5, 40, 0.5}), 0.5, 1e-9);
}

TEST(GeometryDefaults, AFastPartOfASlowSweepIsNoBreak)
{
  std::vector<double> gaps(60, 0.2);
  gaps.insert(gaps.end(), 5, 1.0);
  gaps.push_back(30);
  gaps.insert(gaps.end(), 5, 1.0);
  const auto sweep = SweepOf(gaps);
  const std::vector<double> longest = LongestGaps(*sweep, AllFrames(*sweep));
  ASSERT_EQ(longest.size(), gaps.size());
  for (std::size_t k = 0; k < gaps.size(); ++k)
  {
    EXPECT_EQ(gaps[k] > longest[k], gaps[k] == 30) << k;
  }
  const auto planes = AddVirtualPlanes(*sweep, AllFrames(*sweep), 1);
  EXPECT_EQ(planes->imageToReference.size(), 2 * gaps.size());  // a frame more than gaps, and one break
}

// Median spacing and pixel size of the sweeps that the defaults were found on, mm, in full and at half resolution.
TEST(GeometryDefaults, KnownSweepsAreWhatTheyWereFoundToBe)
{
  for (const double reduce : {1.0, 2.0})
  {
    EXPECT_FALSE(Sparse(0.477, reduce * 0.315)) << "liver";
    EXPECT_FALSE(Sparse(0.954, reduce * 0.315)) << "liver, half its frames";
    EXPECT_TRUE(Sparse(1.678, reduce * 0.206)) << "brain";
    EXPECT_TRUE(Sparse(1.638, reduce * 0.082)) << "spine";
    EXPECT_FALSE(Sparse(0.5, reduce * 0.2)) << "phantom";
  }
}

TEST(GeometryDefaults, PlanesLieAPixelApartAndTheBeamIsThin)
{
  const TrainingPlan dense = PlanFor(0.9, 0.3), sparse = PlanFor(1.1, 0.3);
  EXPECT_FALSE(dense.sparse);
  EXPECT_TRUE(sparse.sparse);
  EXPECT_EQ(dense.virtualPlanes, 2);
  EXPECT_EQ(sparse.virtualPlanes, 3);
  EXPECT_EQ(PlanFor(0.2, 0.3).virtualPlanes, 2);
  EXPECT_EQ(PlanFor(30, 0.3).virtualPlanes, 7);
  EXPECT_EQ(dense.elevationSigma, 0);
  EXPECT_EQ(sparse.elevationSigma, 0);
  EXPECT_EQ(sparse.probeElevationSigma, 0);  // not known
  EXPECT_EQ(dense.iterations, 580);          // 80 passes over 20 frames and 38 planes, 8 a step
  EXPECT_EQ(sparse.iterations, 288);         // 30 over 20 frames and 57 planes
  EXPECT_DOUBLE_EQ(dense.minimumScale, 0.5 * 0.3);
  EXPECT_DOUBLE_EQ(dense.maximumScale, 48 * 0.3);
}

TEST(GeometryDefaults, WhatIsGivenStays)
{
  TrainerOptions options;
  options.gaussians = 7;
  options.elevationSigma = 0.6;
  options.virtualPlanes = 3;
  options.iterations = 5;
  options.interpolation = FrameInterpolation{FrameInterpolation::Path::Probe, true};
  options.batch = 3;
  options.frameGains = true;
  const TrainingPlan plan = PlanFor(1.5, 0.3, options);
  EXPECT_EQ(plan.gaussians, 7u);
  EXPECT_EQ(plan.elevationSigma, 0.6);
  EXPECT_EQ(plan.virtualPlanes, 3);
  EXPECT_EQ(plan.iterations, 5);
  EXPECT_EQ(plan.interpolation.ToString(), "probe+flow");
  EXPECT_EQ(plan.batch, 3);
  EXPECT_TRUE(plan.frameGains);
}

TEST(GeometryDefaults, KeptContrastAsksForContrastBetweenFrames)
{
  TrainerOptions options;
  options.preset = Preset::Texture;
  const TrainingPlan plan = PlanFor(1.5, 0.3, options);
  EXPECT_EQ(plan.virtualPlanes, PlanFor(1.5, 0.3).virtualPlanes);
  EXPECT_TRUE(plan.interpolation.keepContrast);
}

/// Frames that turn about the depth axis through a place `offset` columns from the image's middle, each place `noise` mm off.
std::shared_ptr<Sweep> TurningSweep(int frames, double degrees, double offset, double noise)
{
  const auto sweep = test::BlackSweep(frames, 61, 41, 0.4, 0);
  test::Random random(3);
  for (int k = 0; k < frames; ++k)
  {
    const double angle = degrees * k * kRadiansPerDegree;
    Eigen::Matrix4d turn = Eigen::Matrix4d::Identity();
    turn(0, 0) = turn(2, 2) = std::cos(angle);
    turn(0, 2) = std::sin(angle);
    turn(2, 0) = -turn(0, 2);
    sweep->imageToReference[k](0, 3) += 0.4 * offset;
    sweep->imageToReference[k] = turn * sweep->imageToReference[k];
    for (int axis = 0; axis < 3; ++axis)
    {
      sweep->imageToReference[k](axis, 3) += noise * random.Normal();
    }
  }
  return sweep;
}

// A probe that turns about its own image's middle leaves that where it is. What it sweeps is what the mean place does: of
// columns x, a quarter of the width on average, sin(3 degrees) |x|.
TEST(GeometryDefaults, GapsOfAProbeThatTurnsAboutItsImageAreThoseOfTheMeanPlace)
{
  const double mean = 0.25 * 0.4 * 60 * std::sin(3 * kRadiansPerDegree);
  for (const double noise : {0.0, 1e-9, 0.003})
  {
    const auto sweep = TurningSweep(60, 3, 0, noise);
    const std::vector<int> all = AllFrames(*sweep);
    const SweepGeometry geometry = MeasureGeometry(*sweep, all);
    EXPECT_NEAR(geometry.usualSpacing, mean, 0.02 * mean) << noise;
    EXPECT_GT(geometry.smallestSpacing, 0.9 * mean) << noise;
    EXPECT_NEAR(PathLength(*sweep, all), 59 * mean, 0.02 * 59 * mean) << noise;
    // No place of a frame lies beyond a break.
    EXPECT_GT(LongestGaps(*sweep, all)[0], GapBetween(*sweep, 0, 1, 60, 20)) << noise;
    EXPECT_EQ(AddVirtualPlanes(*sweep, all, 2, {})->NumberOfFrames(), 60 + 2 * 59) << noise;
  }
}

TEST(GeometryDefaults, OtherSweepsAreMeasuredAtTheImagesCentre)
{
  // About an edge of the image, and about a place between that and its middle.
  for (const double offset : {30.0, 15.0})
  {
    const auto turns = TurningSweep(60, 1, offset, 0);
    for (const double gap : GapsBetween(*turns, AllFrames(*turns)))
    {
      EXPECT_NEAR(gap, 0.4 * offset * std::sin(kRadiansPerDegree), 1e-9) << offset;
    }
  }
  const auto straight = SweepOf({0.5, 0.25, 1.0});
  EXPECT_EQ(GapsBetween(*straight, AllFrames(*straight)), (std::vector<double>{0.5, 0.25, 1.0}));
  // One sequence that turns beside one that does not; what lies between two is measured as before.
  auto both = std::make_shared<Sweep>(*SweepOf({0.5, 0.5}));
  const auto turns = TurningSweep(3, 3, 0, 0);
  both->width = turns->width;
  both->height = turns->height;
  both->imageToReference.insert(both->imageToReference.end(), turns->imageToReference.begin(),
                                turns->imageToReference.end());
  both->sequences = {0, 0, 0, 1, 1, 1};
  const std::vector<double> gaps = GapsBetween(*both, AllFrames(*both));
  EXPECT_EQ(gaps[0], 0.5);
  EXPECT_GT(gaps[3], 0.2);
}

}  // namespace
}  // namespace bigus
