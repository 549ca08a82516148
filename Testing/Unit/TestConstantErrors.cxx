// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Delay and calibration error, estimated from pictures of phantoms for which both are known.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Poses/PoseError.h"
#include "Core/Probe/ConstantErrors.h"

namespace bigus
{
namespace
{

struct TrackerErrors
{
  double delay = 0;                   // seconds
  Eigen::Vector3d shift{0, 0, 0};     // mm
  Eigen::Vector3d rotation{0, 0, 0};  // degrees
};

PhantomOptions Options(double angle, int passes, const TrackerErrors& errors)
{
  PhantomOptions options;
  options.frames = passes > 1 ? 96 : 48;
  options.width = options.height = 96;
  options.pixelSize = 0.5;
  options.scattererDensity = 8;
  options.sweepAngle = angle;
  options.passes = passes;
  options.trackingDelay = errors.delay;
  Eigen::Map<Eigen::Vector3d>(options.calibrationShift.data()) = errors.shift;
  Eigen::Map<Eigen::Vector3d>(options.calibrationRotation.data()) = errors.rotation;
  return options;
}

/// Sweeps of the directions given, one after another. Pixels do not depend on the tracker and are made once.
Sweep Make(const std::vector<double>& angles, int passes, const TrackerErrors& errors,
           std::vector<Eigen::Matrix4d>* truth = nullptr)
{
  static std::map<std::pair<double, int>, Sweep> made;
  Sweep all;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>();
  for (const double angle : angles)
  {
    auto known = made.find({angle, passes});
    if (known == made.end())
    {
      known = made.emplace(std::make_pair(angle, passes), Phantom(Options(angle, passes, {})).MakeSweep()).first;
    }
    const Sweep& sweep = known->second;
    const auto* first = static_cast<const std::uint8_t*>(sweep.pixels.get());
    pixels->insert(pixels->end(), first, first + sweep.PixelsPerFrame() * sweep.NumberOfFrames());
    all.width = sweep.width;
    all.height = sweep.height;
    const Phantom phantom(Options(angle, passes, errors));
    const double start = all.timestamps.empty() ? 0 : all.timestamps.back() + 2;
    for (int k = 0; k < sweep.NumberOfFrames(); ++k)
    {
      all.imageToReference.push_back(phantom.RecordedPlane(k).ImageToReference());
      all.timestamps.push_back(start + phantom.Timestamps()[k]);
      if (truth)
      {
        truth->push_back(phantom.TruePlane(k).ImageToReference());
      }
    }
  }
  all.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return all;
}

/// How far the sweep is bent, before and after.
std::pair<double, double> Bending(const Sweep& sweep, const ConstantErrors& errors,
                                  const std::vector<Eigen::Matrix4d>& truth)
{
  return {MeasurePoseError(sweep.imageToReference, truth, sweep.width, sweep.height).bending,
          MeasurePoseError(WithoutConstantErrors(sweep, errors), truth, sweep.width, sweep.height).bending};
}

void ExpectWithinErrors(const ConstantError& found, double truth)
{
  if (found.isObservable)
  {
    EXPECT_LE(std::abs(found.value - truth), 2 * found.standardError);
  }
  else
  {
    EXPECT_EQ(found.value, 0);
  }
}

TEST(ConstantErrors, ExactCrossingSweepsAreLeftAlone)
{
  const Sweep sweep = Make({0, 90}, 1, {});
  const ConstantErrors found = EstimateConstantErrors(sweep, AllFrames(sweep));
  EXPECT_FALSE(found.IsSignificant()) << found.evidence;
  EXPECT_GT(found.comparisons, 1000);
  ExpectWithinErrors(found.delay, 0);
  int observable = 0;
  for (int axis = 0; axis < 3; ++axis)
  {
    ExpectWithinErrors(found.shift[axis], 0);
    ExpectWithinErrors(found.rotation[axis], 0);
    observable += found.shift[axis].isObservable + found.rotation[axis].isObservable;
  }
  EXPECT_GE(observable, 3);
  // Both probes point down: a shift in depth moves everything together.
  EXPECT_FALSE(found.shift[1].isObservable);
  EXPECT_EQ(WithoutConstantErrors(sweep, found), sweep.imageToReference);
}

TEST(ConstantErrors, CrossingSweepsTellTheCalibration)
{
  for (const int axis : {0, 2})
  {
    TrackerErrors errors;
    errors.rotation[axis] = 1;
    std::vector<Eigen::Matrix4d> truth;
    const Sweep sweep = Make({0, 90}, 1, errors, &truth);
    const ConstantErrors found = EstimateConstantErrors(sweep, AllFrames(sweep));
    EXPECT_TRUE(found.IsSignificant()) << found.evidence;
    EXPECT_TRUE(found.rotation[axis].isObservable);
    EXPECT_NEAR(found.rotation[axis].value, -1, 0.3);
    EXPECT_LT(found.rotation[axis].standardError, 0.3);
    for (int other = 0; other < 3; ++other)
    {
      EXPECT_TRUE(found.shift[other].isObservable || found.shift[other].value == 0) << other;
      EXPECT_TRUE(found.rotation[other].isObservable || found.rotation[other].value == 0) << other;
    }
    EXPECT_TRUE(found.delay.isObservable || found.delay.value == 0);
    EXPECT_TRUE(found.calibrationStep.isTaken);
    EXPECT_GT(found.calibrationStep.share - 0.5, 2 * found.calibrationStep.shareError);
    EXPECT_GT(found.calibrationStep.gain, 0);
    EXPECT_FALSE(found.delayStep.isTaken);
    EXPECT_NEAR(found.delay.value, 0, 2 * found.delay.standardError);
    const auto [before, after] = Bending(sweep, found, truth);
    EXPECT_LT(after, 0.5 * before);
  }
  TrackerErrors large;
  large.shift = {3, 0, -3};
  large.rotation = {3, -3, 3};
  std::vector<Eigen::Matrix4d> truth;
  const Sweep sweep = Make({0, 90}, 1, large, &truth);
  const ConstantErrors found = EstimateConstantErrors(sweep, AllFrames(sweep));
  EXPECT_TRUE(found.IsSignificant()) << found.evidence;
  EXPECT_NEAR(found.rotation[0].value, -3, 0.5);
  EXPECT_NEAR(found.rotation[2].value, -3, 0.5);
  const auto [before, after] = Bending(sweep, found, truth);
  EXPECT_LT(after, 0.2 * before);
}

TEST(ConstantErrors, AProbeThatComesBackTellsTheDelay)
{
  for (const double delay : {0.06, -0.06})
  {
    TrackerErrors errors;
    errors.delay = delay;
    std::vector<Eigen::Matrix4d> truth;
    const Sweep sweep = Make({0}, 2, errors, &truth);
    const ConstantErrors found = EstimateConstantErrors(sweep, AllFrames(sweep));
    EXPECT_TRUE(found.IsSignificant()) << found.evidence;
    EXPECT_TRUE(found.delay.isObservable);
    EXPECT_NEAR(found.delay.value, delay, 0.005);
    const auto [before, after] = Bending(sweep, found, truth);
    EXPECT_LT(after, 0.2 * before);
  }
  const Sweep exact = Make({0}, 2, {});
  const ConstantErrors found = EstimateConstantErrors(exact, AllFrames(exact));
  EXPECT_FALSE(found.IsSignificant()) << found.evidence;
  EXPECT_NEAR(found.delay.value, 0, 0.005);
  EXPECT_EQ(WithoutConstantErrors(exact, found), exact.imageToReference);
}

TEST(ConstantErrors, AProbeThatLingersFirstTellsTheDelay)
{
  TrackerErrors errors;
  errors.delay = 0.06;
  const Sweep moving = Make({0}, 2, errors);
  constexpr int kLingers = 120;  // more than moves, at a hundredth of the speed
  std::vector<int> frames(kLingers, 0);
  const std::vector<int> all = AllFrames(moving);
  frames.insert(frames.end(), all.begin(), all.end());
  Sweep sweep = moving.Subset(frames);
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    const double before = std::max(0, kLingers - k);
    sweep.timestamps[k] -= 0.05 * before;
    sweep.imageToReference[k](2, 3) -= 0.005 * before;
  }
  const ConstantErrors found = EstimateConstantErrors(sweep, AllFrames(sweep));
  EXPECT_TRUE(found.delay.isObservable) << found.evidence;
  EXPECT_NEAR(found.delay.value, 0.06, 0.01);
}

// Two frames late where the probe comes back, or 2 mm and 2 degrees off where sweeps cross: found within what is said of them.
TEST(ConstantErrors, WhatIsFoundIsWithinItsStatedErrors)
{
  TrackerErrors late, off;
  late.delay = 2 / PhantomOptions().frameRate;
  off.shift = {2, 0, -2};
  off.rotation = {2, -2, 2};
  for (const TrackerErrors& errors : {late, off})
  {
    std::vector<Eigen::Matrix4d> truth;
    const Sweep sweep = errors.delay > 0 ? Make({0}, 2, errors, &truth) : Make({0, 90}, 1, errors, &truth);
    const ConstantErrors found = EstimateConstantErrors(sweep, AllFrames(sweep));
    EXPECT_EQ(found.delayStep.isTaken, errors.delay > 0) << found.evidence;
    EXPECT_EQ(found.calibrationStep.isTaken, errors.delay == 0) << found.evidence;
    ExpectWithinErrors(found.delay, errors.delay);
    // What takes a motion about the centre out is its inverse.
    const double degrees = errors.rotation.norm();
    const Eigen::Vector3d axis = degrees > 0 ? errors.rotation.normalized() : Eigen::Vector3d::UnitX();
    const Eigen::Vector3d shift = -(Eigen::AngleAxisd(-degrees * kRadiansPerDegree, axis) * errors.shift);
    for (int k = 0; k < 3; ++k)
    {
      ExpectWithinErrors(found.shift[k], found.shift[k].isObservable ? shift[k] : 0);
      ExpectWithinErrors(found.rotation[k], -errors.rotation[k]);
    }
    const auto [before, after] = Bending(sweep, found, truth);
    EXPECT_LT(after, 0.2 * before) << found.evidence;
  }
}

TEST(ConstantErrors, OneStraightSweepTellsNothing)
{
  TrackerErrors errors;
  errors.delay = 0.1;
  errors.shift = {2, 2, 2};
  errors.rotation = {2, 2, 2};
  const Sweep sweep = Make({0}, 1, errors);
  const ConstantErrors found = EstimateConstantErrors(sweep, AllFrames(sweep));
  EXPECT_FALSE(found.IsSignificant());
  EXPECT_EQ(found.comparisons, 0);
  EXPECT_FALSE(found.delay.isObservable);
  EXPECT_TRUE(std::isinf(found.delay.standardError));
  for (int axis = 0; axis < 3; ++axis)
  {
    EXPECT_FALSE(found.shift[axis].isObservable);
    EXPECT_FALSE(found.rotation[axis].isObservable);
  }
  EXPECT_EQ(WithoutConstantErrors(sweep, found), sweep.imageToReference);
}

TEST(ConstantErrors, PixelsOfOtherFramesAreNotRead)
{
  TrackerErrors errors;
  errors.rotation[2] = 2;
  Sweep sweep = Make({0, 90}, 1, errors);
  std::vector<int> training;
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    if (k % 8 != 4)
    {
      training.push_back(k);
    }
  }
  const ConstantErrors found = EstimateConstantErrors(sweep, training);
  EXPECT_TRUE(found.IsSignificant()) << found.evidence;
  const auto* first = static_cast<const std::uint8_t*>(sweep.pixels.get());
  auto changed =
      std::make_shared<std::vector<std::uint8_t>>(first, first + sweep.PixelsPerFrame() * sweep.NumberOfFrames());
  for (int k = 4; k < sweep.NumberOfFrames(); k += 8)
  {
    std::memset(changed->data() + k * sweep.PixelsPerFrame(), 200, sweep.PixelsPerFrame());
  }
  sweep.pixels = std::shared_ptr<const void>(changed, changed->data());
  const ConstantErrors again = EstimateConstantErrors(sweep, training);
  // All frames go with the correction, those whose pixels were not read, too.
  EXPECT_EQ(WithoutConstantErrors(sweep, again), WithoutConstantErrors(sweep, found));
  EXPECT_NE(WithoutConstantErrors(sweep, found)[4], sweep.imageToReference[4]);
  EXPECT_EQ(again.rotation[2].standardError, found.rotation[2].standardError);
}

TEST(ConstantErrors, SameBitsForAnyNumberOfThreads)
{
  TrackerErrors errors;
  errors.rotation[2] = 2;
  const Sweep sweep = Make({0, 90}, 1, errors);
  std::vector<ConstantErrors> found;
  for (const std::size_t threads : {1, 3})
  {
    tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    found.push_back(EstimateConstantErrors(sweep, AllFrames(sweep)));
  }
  EXPECT_EQ(found[0].rotation[2].value, found[1].rotation[2].value);
  EXPECT_EQ(found[0].shift[0].value, found[1].shift[0].value);
  EXPECT_EQ(found[0].rotation[2].standardError, found[1].rotation[2].standardError);
  EXPECT_EQ(found[0].calibrationStep.share, found[1].calibrationStep.share);
  EXPECT_EQ(found[0].calibrationStep.shareError, found[1].calibrationStep.shareError);
}

TEST(ConstantErrors, WithoutTimesThereIsNoDelay)
{
  TrackerErrors errors;
  errors.rotation[2] = 2;
  Sweep sweep = Make({0, 90}, 1, errors);
  sweep.timestamps.clear();
  const ConstantErrors found = EstimateConstantErrors(sweep, AllFrames(sweep));
  EXPECT_FALSE(found.delay.isObservable);
  EXPECT_TRUE(std::isinf(found.delay.standardError));
  EXPECT_NEAR(found.rotation[2].value, -2, 0.3);
}

// Places between pixels say no more than these, however many are looked at.
TEST(ConstantErrors, FewerPixelsThanPlacesTellNothing)
{
  const Sweep sweep = Make({0, 90}, 1, {});
  const Sweep tiny = sweep.Reduced(12).Subset({22, 23, 24, 70, 71, 72});
  EXPECT_EQ(EstimateConstantErrors(tiny, AllFrames(tiny)).comparisons, 0);
  EXPECT_GT(EstimateConstantErrors(sweep.Reduced(3), AllFrames(sweep)).comparisons, 0);
}

TEST(ConstantErrors, RefusesFramesThatAreNotThere)
{
  const Sweep sweep = Make({0}, 1, {});
  EXPECT_THROW(EstimateConstantErrors(sweep, {0, 48}), Error);
  EXPECT_EQ(EstimateConstantErrors(sweep, {}).comparisons, 0);
  EXPECT_EQ(EstimateConstantErrors(sweep, {5}).comparisons, 0);
}

}  // namespace
}  // namespace bigus
