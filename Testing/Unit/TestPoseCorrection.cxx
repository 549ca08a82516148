// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "Core/Deciding/PoseCorrection.h"
#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Poses/PoseError.h"
#include "Core/Trainer/Trainer.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::CorrectPoses;
using bigus::Phantom;
using bigus::PhantomOptions;
using bigus::PoseCorrection;
using bigus::Sweep;

PhantomOptions SmallWorld(int frames = 40)
{
  PhantomOptions world;
  world.frames = frames;
  world.width = world.height = 96;
  world.pixelSize = 0.3;
  return world;
}

std::vector<Eigen::Matrix4d> TruePoses(const Phantom& phantom, int frames)
{
  std::vector<Eigen::Matrix4d> poses;
  for (int k = 0; k < frames; ++k)
  {
    poses.push_back(phantom.TruePlane(k).ImageToReference());
  }
  return poses;
}

double ErrorOf(const Sweep& sweep, const std::vector<Eigen::Matrix4d>& poses, const std::vector<Eigen::Matrix4d>& truth)
{
  return bigus::MeasurePoseError(poses, truth, sweep.width, sweep.height).distance;
}

TEST(PoseCorrection, NoiseIsTakenOutWherePicturesConfirmIt)
{
  PhantomOptions world = SmallWorld(48);
  world.trackingNoise = 0.2;
  world.trackingRotationNoise = 0.3;
  const Phantom phantom(world);
  const Sweep sweep = phantom.MakeSweep();
  const auto truth = TruePoses(phantom, 48);
  const PoseCorrection found = CorrectPoses(sweep, bigus::AllFrames(sweep));
  EXPECT_GE(found.strength, 1) << found.decision.evidence;
  EXPECT_LT(ErrorOf(sweep, found.trajectory.imageToReference, truth),
            0.5 * ErrorOf(sweep, sweep.imageToReference, truth));
  EXPECT_EQ(found.decision.what, "poses");
  EXPECT_NE(found.decision.choice.find("smoothed"), std::string::npos) << found.decision.choice;
  EXPECT_NE(found.decision.evidence.find("dB"), std::string::npos) << found.decision.evidence;
  EXPECT_EQ(bigus::AtCorrectedPoses(sweep, found).imageToReference, found.trajectory.imageToReference);
  EXPECT_EQ(bigus::AtCorrectedPoses(sweep, found).pixels, sweep.pixels);
}

/// Two crossing sweeps of one world, one after the other; a calibration error of 2 degrees about the normal.
TEST(PoseCorrection, ConstantErrorsAreTakenOutWhereSweepsCross)
{
  Sweep sweep;
  std::vector<Eigen::Matrix4d> truth;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>();
  for (const double angle : {0.0, 90.0})
  {
    PhantomOptions world = SmallWorld(48);
    world.pixelSize = 0.5;
    world.scattererDensity = 8;
    world.sweepAngle = angle;
    world.calibrationRotation = {0, 0, 2};
    const Phantom phantom(world);
    const Sweep part = phantom.MakeSweep();
    const auto* first = static_cast<const std::uint8_t*>(part.pixels.get());
    pixels->insert(pixels->end(), first, first + part.PixelsPerFrame() * 48);
    sweep.width = part.width;
    sweep.height = part.height;
    for (int k = 0; k < 48; ++k)
    {
      sweep.imageToReference.push_back(part.imageToReference[k]);
      sweep.timestamps.push_back(part.timestamps[k] + (angle > 0 ? 10 : 0));
      truth.push_back(phantom.TruePlane(k).ImageToReference());
    }
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  const PoseCorrection found = CorrectPoses(sweep, bigus::AllFrames(sweep));
  EXPECT_TRUE(found.constant.IsSignificant()) << found.constant.evidence;
  EXPECT_NE(found.decision.choice.find("image moved on the probe"), std::string::npos) << found.decision.choice;
  EXPECT_NE(found.decision.evidence.find(found.constant.evidence), std::string::npos) << found.decision.evidence;
  EXPECT_TRUE(found.trajectory.IsChanged());
  const auto bending = [&](const std::vector<Eigen::Matrix4d>& poses)
  { return bigus::MeasurePoseError(poses, truth, sweep.width, sweep.height).bending; };
  EXPECT_LT(bending(found.trajectory.imageToReference), 0.3 * bending(sweep.imageToReference));
  EXPECT_NEAR(found.trajectory.rotation[5], 2, 0.4);
  const PoseCorrection kept = CorrectPoses(sweep, bigus::AllFrames(sweep), {0.0});
  EXPECT_EQ(kept.trajectory.imageToReference, sweep.imageToReference);

  // A training that corrects nothing else is repeated by its settled options.
  EXPECT_EQ(found.strength, 0);
  bigus::TrainerOptions options;
  options.gaussians = 300;
  options.iterations = 3;
  options.virtualPlanes = 0;
  options.elevationSigma = 0.5;
  const auto shared = std::make_shared<const Sweep>(sweep);
  const bigus::TrainingResult first = Train(shared, options);
  EXPECT_EQ(first.imageToReference, found.trajectory.imageToReference);
  const bigus::TrainingResult again = Train(shared, first.settled);
  EXPECT_EQ(again.imageToReference, first.imageToReference);
  EXPECT_EQ(again.field.means, first.field.means);
  EXPECT_EQ(again.field.reflectivities, first.field.reflectivities);
}

/// There and back over the same places, with noise and with drift, which no smoothing takes out.
PhantomOptions ThereAndBack()
{
  PhantomOptions world;
  world.frames = 64;
  world.passes = 2;
  world.width = world.height = 128;
  world.pixelSize = 0.4;
  world.wander = world.tilt = 0;
  world.scattererDensity = 8;
  world.trackingNoise = world.trackingRotationNoise = 0.1;
  world.trackingDrift = world.trackingRotationDrift = 1;
  return world;
}

/// There and back by hand, with noise of 0.2 mm and 0.3 degrees.
PhantomOptions Hand()
{
  PhantomOptions world = ThereAndBack();
  world.width = world.height = 96;
  world.tilt = PhantomOptions().tilt;
  world.wander = PhantomOptions().wander;
  world.trackingDrift = world.trackingRotationDrift = 0;
  world.trackingNoise = 0.2;
  world.trackingRotationNoise = 0.3;
  return world;
}

/// Smoothed only, and the error of its poses.
std::pair<PoseCorrection, double> Corrected(PhantomOptions world, double correlation, std::optional<double> strength)
{
  world.noiseCorrelation = correlation;
  const Phantom phantom(world);
  const Sweep sweep = phantom.MakeSweep();
  bigus::PoseCorrectionOptions options;
  options.isRefined = false;
  options.strength = strength;
  const PoseCorrection found = CorrectPoses(sweep, bigus::AllFrames(sweep), options);
  return {found, ErrorOf(sweep, found.trajectory.imageToReference, TruePoses(phantom, world.frames))};
}

TEST(PoseCorrection, FramesAreAlignedWhereTheProbeComesBack)
{
  const Phantom phantom(ThereAndBack());
  const Sweep sweep = phantom.MakeSweep();
  const auto truth = TruePoses(phantom, 64);
  bigus::PoseCorrectionOptions smoothOnly;
  smoothOnly.isRefined = false;
  const std::vector<int> all = bigus::AllFrames(sweep);
  const PoseCorrection smooth = CorrectPoses(sweep, all, smoothOnly), aligned = CorrectPoses(sweep, all);
  EXPECT_FALSE(smooth.alignment.isAsked);
  ASSERT_TRUE(aligned.alignment.isTaken) << aligned.decision.evidence;
  EXPECT_EQ(aligned.strength, smooth.strength);
  EXPECT_NE(aligned.decision.choice.find("aligned"), std::string::npos) << aligned.decision.choice;
  EXPECT_LT(ErrorOf(sweep, aligned.trajectory.imageToReference, truth),
            0.95 * ErrorOf(sweep, smooth.trajectory.imageToReference, truth));
  EXPECT_NEAR(aligned.trajectory.displacement[20],
              bigus::CornerDistance(aligned.trajectory.imageToReference[20], sweep.imageToReference[20], sweep.width,
                                    sweep.height),
              1e-9);
}

// An error along the normal that comes and goes within each pass, which is no delay, no noise and no motion in the plane.
TEST(PoseCorrection, SlowErrorsAlongTheNormalAreFoundWhereTheProbeComesBack)
{
  PhantomOptions world = ThereAndBack();
  world.trackingDrift = world.trackingRotationDrift = 0;
  const Phantom phantom(world);
  Sweep sweep = phantom.MakeSweep();
  for (int k = 0; k < 64; ++k)
  {
    sweep.imageToReference[k](2, 3) += 0.4 * std::sin(0.2 * k);
  }
  const auto truth = TruePoses(phantom, 64);
  bigus::PoseCorrectionOptions smoothOnly;
  smoothOnly.isRefined = false;
  const std::vector<int> all = bigus::AllFrames(sweep);
  const PoseCorrection smooth = CorrectPoses(sweep, all, smoothOnly), aligned = CorrectPoses(sweep, all);
  ASSERT_TRUE(aligned.alignment.isTaken) << aligned.decision.evidence;
  EXPECT_LT(ErrorOf(sweep, aligned.trajectory.imageToReference, truth),
            0.9 * ErrorOf(sweep, smooth.trajectory.imageToReference, truth))
      << aligned.decision.evidence;
}

// Where the probe turns back, and in its sways, pictures of neighbours confirm a path that is a little too smooth: of these
// sweeps the best strengths are 2, 4 and 1.
TEST(PoseCorrection, WhiteNoiseIsSmoothedLittleMoreThanItAsksFor)
{
  for (const std::uint64_t seed : {1, 2, 3})
  {
    PhantomOptions world = Hand();
    world.seed = seed;
    const auto [found, error] = Corrected(world, 0, std::nullopt);
    EXPECT_LE(found.strength, 4) << found.decision.evidence;
    EXPECT_LT(error, 0.65 * Corrected(world, 0, 0).second);
  }
}

// What a step takes out of correlated noise has the sign of what is still to be taken out, and poses do not ask for it.
TEST(PoseCorrection, CorrelatedNoiseIsSmoothedMoreThanPosesAskFor)
{
  for (const std::uint64_t seed : {1, 2, 3})
  {
    PhantomOptions world = Hand();
    world.seed = seed;
    const auto [found, error] = Corrected(world, 10, std::nullopt);
    EXPECT_GE(found.strength, 4) << found.decision.evidence;
    EXPECT_LE(found.strength, 16) << found.decision.evidence;
    // Little can be gained, and little is lost.
    EXPECT_LT(error, 1.1 * Corrected(world, 10, 0).second);
    // Every step begins where the last that was taken ended, and the last of these is what is chosen.
    double now = 0;
    for (const bigus::PoseStep& step : found.steps)
    {
      EXPECT_EQ(step.from, now);
      now = step.isTaken ? step.to : now;
    }
    EXPECT_EQ(now, found.strength);
  }
}

// Neighbours do not see that the turn is rounded off; frames of the other way do.
TEST(PoseCorrection, AStraightPathThereAndBackIsNotSmoothedAway)
{
  for (const double correlation : {0.0, 10.0})
  {
    PhantomOptions world = SmallWorld(96);
    world.passes = 2;
    world.scattererDensity = 8;
    world.tilt = world.wander = 0;
    world.trackingNoise = 0.2;
    world.trackingRotationNoise = 0.3;
    world.seed = 4;
    const auto [found, error] = Corrected(world, correlation, std::nullopt);
    EXPECT_LT(error, 0.3) << found.decision.evidence;  // by neighbours alone 0.9; as tracked 0.36, 0.32
    const bigus::PoseStep& last = found.steps.back();
    EXPECT_TRUE(!last.isTaken && last.revisitShare + last.revisitError < 0.5) << found.decision.evidence;
  }
}

// A probe that really shakes: to the poses alone that is noise, and only pictures tell.
TEST(PoseCorrection, AShakingProbeIsLeftAsTracked)
{
  for (const double correlation : {0.0, 3.0, 10.0})
  {
    PhantomOptions world = SmallWorld(48);
    world.scattererDensity = 8;
    world.shake = 0.2;
    world.shakeRotation = 0.3;
    world.shakeCorrelation = correlation;
    const Sweep slow = Phantom(world).MakeSweep();
    const PoseCorrection kept = CorrectPoses(slow, bigus::AllFrames(slow));
    EXPECT_EQ(kept.trajectory.imageToReference, slow.imageToReference) << kept.decision.evidence;
  }
  PhantomOptions world = SmallWorld(48);
  world.shake = 0.2;
  world.shakeRotation = 0.3;
  const Sweep sweep = Phantom(world).MakeSweep();
  ASSERT_TRUE(bigus::SmoothTrajectory(sweep).IsChanged());
  const PoseCorrection found = CorrectPoses(sweep, bigus::AllFrames(sweep));
  EXPECT_EQ(found.strength, 0) << found.decision.evidence;
  EXPECT_EQ(found.trajectory.imageToReference, sweep.imageToReference);
  EXPECT_EQ(found.decision.choice, "as tracked");
  EXPECT_NEAR(found.trajectory.translationNoise, 0.2, 0.06) << "of the shaking";
}

TEST(PoseCorrection, ExactPosesAndStepsAreLeftAsTracked)
{
  const Sweep exact = Phantom(SmallWorld(24)).MakeSweep();
  EXPECT_EQ(CorrectPoses(exact, bigus::AllFrames(exact)).trajectory.imageToReference, exact.imageToReference);
  PhantomOptions world = SmallWorld(24);
  world.tilt = world.wander = world.speedVariation = 0;
  const Sweep stepped = Phantom(world).MakeSweep();
  EXPECT_EQ(CorrectPoses(stepped, bigus::AllFrames(stepped)).trajectory.imageToReference, stepped.imageToReference);
}

// Pictures came evenly, poses are those of the times at which they arrived.
TEST(PoseCorrection, FramesNumbersAreTheClockWherePicturesCameEvenly)
{
  PhantomOptions world = SmallWorld(48);
  const Phantom phantom(world);
  Sweep sweep = phantom.MakeSweep();
  const auto truth = sweep.imageToReference;
  for (int k = 1; k + 1 < 48; ++k)
  {
    const double late = 0.3 * (k % 3 == 0) + 0.25 * (k % 5 == 1) - 0.3 * (k % 4 == 2);  // of a frame
    const int next = late > 0 ? k + 1 : k - 1;
    sweep.timestamps[k] += late / world.frameRate;
    sweep.imageToReference[k] += std::abs(late) * (truth[next] - truth[k]);
  }
  ASSERT_TRUE(HasUsableTimes(sweep));
  const PoseCorrection found = CorrectPoses(sweep, bigus::AllFrames(sweep));
  EXPECT_EQ(found.trajectory.clock, bigus::FrameClock::Numbers) << found.decision.evidence;
  EXPECT_LT(ErrorOf(sweep, found.trajectory.imageToReference, truth),
            0.6 * ErrorOf(sweep, sweep.imageToReference, truth));
  // A given strength uses the same clock.
  EXPECT_EQ(CorrectPoses(sweep, bigus::AllFrames(sweep), {found.strength}).trajectory.imageToReference,
            found.trajectory.imageToReference);
}

TEST(PoseCorrection, ExactPosesAreLeftWhereFramesWereDropped)
{
  const Sweep whole = Phantom(SmallWorld(60)).MakeSweep();
  std::vector<int> kept;
  for (int k = 0; k < 60; ++k)
  {
    if (k % 5 != 1 && k % 7 != 3)
    {
      kept.push_back(k);
    }
  }
  const Sweep sweep = whole.Subset(kept);
  const PoseCorrection found = CorrectPoses(sweep, bigus::AllFrames(sweep));
  EXPECT_EQ(found.trajectory.imageToReference, sweep.imageToReference) << found.decision.evidence;
}

TEST(PoseCorrection, HeldOutPixelsHaveNoPartAndThreadsDoNotMatter)
{
  const Sweep sweep = Phantom(ThereAndBack()).MakeSweep();
  const int count = sweep.NumberOfFrames();
  const auto [frames, heldOut] = bigus::SplitHoldOut(count, 8);
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(count * sweep.PixelsPerFrame());
  std::copy_n(static_cast<const std::uint8_t*>(sweep.pixels.get()), pixels->size(), pixels->begin());
  for (const int frame : heldOut)
  {
    for (std::size_t p = 0; p < sweep.PixelsPerFrame(); ++p)
    {
      (*pixels)[frame * sweep.PixelsPerFrame() + p] = p % 3 ? 255 : 0;
    }
  }
  Sweep poisoned = sweep;
  poisoned.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  const auto correct = [frames = frames](const Sweep& what, int threads)
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return CorrectPoses(what, frames);
  };
  const PoseCorrection one = correct(sweep, 1), three = correct(sweep, 3), held = correct(poisoned, 2);
  ASSERT_GT(one.strength, 0) << one.decision.evidence;
  ASSERT_TRUE(one.alignment.isTaken) << one.decision.evidence;
  for (const PoseCorrection* other : {&three, &held})
  {
    EXPECT_EQ(other->trajectory.imageToReference, one.trajectory.imageToReference);
    EXPECT_EQ(other->decision.evidence, one.decision.evidence);
    EXPECT_EQ(other->decision.choice, one.decision.choice);
  }

  // The same through the trainer.
  bigus::TrainerOptions options;
  options.holdOut = 8;
  options.gaussians = 500;
  options.iterations = 10;
  options.virtualPlanes = 0;
  options.elevationSigma = 0.5;
  const bigus::TrainingResult a = Train(std::make_shared<const Sweep>(sweep), options);
  const bigus::TrainingResult b = Train(std::make_shared<const Sweep>(poisoned), options);
  EXPECT_EQ(a.imageToReference, one.trajectory.imageToReference);
  EXPECT_EQ(b.imageToReference, a.imageToReference);
  EXPECT_EQ(b.field.means, a.field.means);
  EXPECT_EQ(b.field.reflectivities, a.field.reflectivities);
  EXPECT_EQ(*a.settled.poseSmoothing, one.strength);
}

TEST(PoseCorrection, WhatIsGivenIsObeyedAndFewFramesAreNoEvidence)
{
  PhantomOptions world = SmallWorld(24);
  world.trackingNoise = 0.2;
  const Sweep sweep = Phantom(world).MakeSweep();
  const std::vector<int> all = bigus::AllFrames(sweep);
  const PoseCorrection kept = CorrectPoses(sweep, all, {0.0});
  EXPECT_EQ(kept.trajectory.imageToReference, sweep.imageToReference);
  EXPECT_EQ(kept.decision.evidence, "given");
  const PoseCorrection given = CorrectPoses(sweep, all, {3.0});
  EXPECT_EQ(given.strength, 3);
  EXPECT_EQ(given.trajectory.imageToReference, SmoothTrajectory(sweep, {3, bigus::FrameClock::Times}).imageToReference);
  const PoseCorrection few = CorrectPoses(sweep, {1, 4, 7, 9, 12, 15, 20});
  EXPECT_EQ(few.trajectory.imageToReference, sweep.imageToReference);
  EXPECT_NE(few.decision.evidence.find("7 frames"), std::string::npos) << few.decision.evidence;

  bigus::TrainerOptions options;
  options.gaussians = 300;
  options.iterations = 5;
  options.automatic = false;
  const auto shared = std::make_shared<const Sweep>(sweep);
  const bigus::TrainingResult plain = Train(shared, options);
  EXPECT_EQ(plain.imageToReference, sweep.imageToReference);
  EXPECT_EQ(*plain.settled.poseSmoothing, 0);
  EXPECT_TRUE(plain.decisions.empty());
  options.poseSmoothing = 3;
  const bigus::TrainingResult smoothed = Train(shared, options);
  EXPECT_EQ(smoothed.imageToReference, given.trajectory.imageToReference);
  EXPECT_NE(smoothed.field.means, plain.field.means);
}

TEST(PoseCorrection, ItCanBeStoppedAndThenKeepsEveryPose)
{
  PhantomOptions world = SmallWorld(24);
  world.trackingNoise = 0.2;
  const auto sweep = std::make_shared<const Sweep>(Phantom(world).MakeSweep());
  std::vector<double> seen;
  const auto stopAt = [&seen](std::size_t call)
  {
    return [&seen, call](double fraction)
    {
      seen.push_back(fraction);
      return seen.size() < call;
    };
  };
  ASSERT_FALSE(CorrectPoses(*sweep, bigus::AllFrames(*sweep), {}, stopAt(1000)).aborted);
  const std::size_t calls = seen.size();
  ASSERT_GE(calls, 2u);
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_LE(seen.back(), 1);
  for (const std::size_t call : {std::size_t(1), calls})
  {
    seen.clear();
    const PoseCorrection stopped = CorrectPoses(*sweep, bigus::AllFrames(*sweep), {}, stopAt(call));
    EXPECT_TRUE(stopped.aborted);
    EXPECT_EQ(stopped.trajectory.imageToReference, sweep->imageToReference);
    EXPECT_EQ(stopped.strength, 0);
  }

  bigus::TrainerOptions options;
  options.gaussians = 300;
  const bigus::TrainingResult result =
      Train(sweep, options, nullptr, [](const bigus::TrainingProgress&) { return false; });
  EXPECT_TRUE(result.aborted);
  EXPECT_EQ(result.imageToReference, sweep->imageToReference);
  EXPECT_GT(result.field.Size(), 0u);
}

}  // namespace
