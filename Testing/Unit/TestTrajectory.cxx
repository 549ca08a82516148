// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>

#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Random.h"
#include "Core/Numerics/SmoothingSpline.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Poses/PoseError.h"
#include "Core/Poses/Trajectory.h"
#include "Support/Errors.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::FrameClock;
using bigus::SmoothTrajectory;
using bigus::Sweep;
using bigus::Trajectory;

/// A sweep without pixels.
Sweep PosesOnly(const std::vector<Eigen::Matrix4d>& poses, int width = 200, int height = 160)
{
  Sweep sweep;
  sweep.width = width;
  sweep.height = height;
  sweep.imageToReference = poses;
  return sweep;
}

Eigen::Matrix3d Turn(const Eigen::Vector3d& degrees)
{
  const double angle = degrees.norm() * bigus::kRadiansPerDegree;
  return angle > 0 ? Eigen::AngleAxisd(angle, degrees.normalized()).toRotationMatrix()
                   : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}

/// The pose of an image of 0.2 mm pixels that a probe at `place`, turned by `degrees`, would record.
Eigen::Matrix4d PoseAt(const Eigen::Vector3d& place, const Eigen::Vector3d& degrees)
{
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topLeftCorner<3, 3>() = Turn(degrees) * Eigen::Vector3d(0.2, 0.2, 1).asDiagonal();
  pose.topRightCorner<3, 1>() = place;
  return pose;
}

/// A hand's motion: forward by about 0.5 mm a frame, swaying and turning a little.
Eigen::Matrix4d HandAt(double frame)
{
  const double a = 0.11 * frame, b = 0.17 * frame;
  return PoseAt({0.5 * std::sin(a), 0.4 * std::cos(b), 0.5 * frame + 0.6 * std::sin(0.13 * frame)},
                {2 * std::sin(b), 1.5 * std::cos(a), std::sin(a + 1)});
}

std::vector<Eigen::Matrix4d> Motion(int frames, const std::function<Eigen::Matrix4d(double)>& at)
{
  std::vector<Eigen::Matrix4d> poses;
  for (int k = 0; k < frames; ++k)
  {
    poses.push_back(at(k));
  }
  return poses;
}

/// What a tracker of a marker at `marker` (mm, in the image's axes, from pixel (0, 0)) makes of true poses.
std::vector<Eigen::Matrix4d> Tracked(const std::vector<Eigen::Matrix4d>& truth, double millimetres, double degrees,
                                     std::uint64_t seed, const Eigen::Vector3d& marker = {10, -60, 15})
{
  bigus::RandomNumbers random(seed);
  const auto vector = [&random] { return Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()); };
  std::vector<Eigen::Matrix4d> recorded;
  for (const Eigen::Matrix4d& pose : truth)
  {
    Eigen::Matrix3d axes = pose.topLeftCorner<3, 3>();
    axes.col(0).normalize();
    axes.col(2) = axes.col(0).cross(axes.col(1)).normalized();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    const Eigen::Vector3d at = pose.topRightCorner<3, 1>() + axes * marker;
    const Eigen::Matrix3d turn = Turn(degrees * vector());
    Eigen::Matrix4d next = pose;
    next.topLeftCorner<3, 3>() = turn * pose.topLeftCorner<3, 3>();
    next.topRightCorner<3, 1>() = at + turn * (pose.topRightCorner<3, 1>() - at) + millimetres * vector();
    recorded.push_back(next);
  }
  return recorded;
}

double ErrorOf(const std::vector<Eigen::Matrix4d>& poses, const std::vector<Eigen::Matrix4d>& truth)
{
  return bigus::MeasurePoseError(poses, truth, 200, 160).distance;
}

int Outliers(const Trajectory& trajectory)
{
  return static_cast<int>(std::count(trajectory.isOutlier.begin(), trajectory.isOutlier.end(), 1));
}

// ---- the spline ----

/// The same by kriging with a linear drift: integrated Wiener processes have the covariance drive (s^2 t / 2 - s^3 / 6)
/// for s <= t.
TEST(SmoothingSpline, IsTheMeanOfAnIntegratedWienerProcess)
{
  const std::vector<double> times = {0, 0.4, 1.5, 1.7, 3.1, 4, 4.2, 6};
  const std::vector<double> weights = {1, 1, 0.3, 1, 2, 1, 1e-3, 1};
  const int n = 8;
  Eigen::MatrixXd values(n, 2);
  bigus::RandomNumbers random(5);
  for (int k = 0; k < n; ++k)
  {
    values.row(k) << random.Normal(), 3 * times[k] + random.Normal();
  }
  std::vector<double> constants;
  for (const double drive : {1e-4, 0.02, 1.0, 50.0})
  {
    Eigen::MatrixXd path(n, n), drift(n, 2);
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
    for (int a = 0; a < n; ++a)
    {
      drift.row(a) << 1, times[a];
      covariance(a, a) = 1 / weights[a];
      for (int b = 0; b < n; ++b)
      {
        const double s = std::min(times[a], times[b]), t = std::max(times[a], times[b]);
        path(a, b) = drive * (s * s * t / 2 - s * s * s / 6);
      }
    }
    covariance += path;
    const Eigen::MatrixXd inverse = covariance.inverse();
    const Eigen::MatrixXd information = drift.transpose() * inverse * drift;
    const Eigen::MatrixXd line = information.inverse() * (drift.transpose() * inverse * values);
    const Eigen::MatrixXd left = values - drift * line;
    const Eigen::MatrixXd mean = drift * line + path * inverse * left;
    const bigus::SmoothedCurve curve = bigus::Smooth(times, values, weights, drive);
    EXPECT_LT((curve.values - mean).cwiseAbs().maxCoeff(), 1e-6) << drive;
    EXPECT_NEAR(curve.squares, (left.transpose() * inverse * left).trace(), 1e-6 * curve.squares) << drive;
    constants.push_back(curve.logDeterminant - std::log(covariance.determinant()) -
                        std::log(information.determinant()));
    // What a value's own estimate gains when the value grows.
    for (int k = 0; k < n; ++k)
    {
      Eigen::MatrixXd changed = values;
      changed(k, 0) += 1;
      EXPECT_NEAR(curve.leverage[k], bigus::Smooth(times, changed, weights, drive).values(k, 0) - curve.values(k, 0),
                  1e-6);
    }
  }
  for (const double constant : constants)
  {
    EXPECT_NEAR(constant, constants[0], 1e-6);
  }
}

// ---- noise ----

TEST(Trajectory, TakesOutMostOfTheNoiseAndTellsHowMuchThereWas)
{
  for (const std::uint64_t seed : {1, 2, 3})
  {
    const auto truth = Motion(160, HandAt);
    const auto recorded = Tracked(truth, 0.2, 0.3, seed);
    const Trajectory found = SmoothTrajectory(PosesOnly(recorded));
    EXPECT_NEAR(found.translationNoise, 0.2, 0.03) << seed;
    EXPECT_NEAR(found.rotationNoise, 0.3, 0.03) << seed;
    // The marker as seen from the image's centre, which is 19.9 and 15.9 mm from pixel (0, 0).
    EXPECT_LT((found.pivot - Eigen::Vector3d(10 - 19.9, -60 - 15.9, 15)).norm(), 12) << found.pivot.transpose();
    EXPECT_LT(ErrorOf(found.imageToReference, truth), 0.42 * ErrorOf(recorded, truth)) << seed;
    EXPECT_EQ(Outliers(found), 0);
    EXPECT_EQ(found.stroke.back(), 0);
    EXPECT_FALSE(found.isStepped);
    EXPECT_TRUE(found.IsChanged());
    double moved = 0;
    for (int k = 0; k < 160; ++k)
    {
      moved += found.displacement[k] / 160;
    }
    EXPECT_NEAR(moved, ErrorOf(recorded, found.imageToReference), 1e-9);
  }
}

TEST(Trajectory, StrongerSmoothingMovesFurther)
{
  const auto recorded = Tracked(Motion(60, HandAt), 0.2, 0.3, 7);
  const Sweep sweep = PosesOnly(recorded);
  bigus::TrajectorySmoother smoother(sweep, FrameClock::Times);
  std::vector<Trajectory> paths;
  for (const double strength : {0.0, 0.5, 1.0, 2.0, 4.0})
  {
    paths.push_back(smoother.At(strength));
  }
  EXPECT_FALSE(paths[0].IsChanged());
  double last = 0;
  for (std::size_t k = 1; k < paths.size(); ++k)
  {
    const double moved = ErrorOf(paths[k].imageToReference, recorded);
    EXPECT_GT(moved, last);
    last = moved;
  }
  const Trajectory alone = SmoothTrajectory(PosesOnly(recorded), {2, FrameClock::Times});
  EXPECT_EQ(alone.imageToReference, paths[3].imageToReference);
  EXPECT_EQ(smoother.At(2).imageToReference, paths[3].imageToReference);
  bigus::test::ExpectRefused([&] { smoother.At(-1); }, {"strength"});
}

TEST(Trajectory, DoesNotDependOnTheWorldNorOnItsUnitOfTime)
{
  const auto recorded = Tracked(Motion(50, HandAt), 0.2, 0.3, 4);
  Eigen::Matrix4d world = Eigen::Matrix4d::Identity();
  world.topLeftCorner<3, 3>() = Turn({100, -60, 140});
  world.topRightCorner<3, 1>() << 500, -80, 1200;
  Sweep here = PosesOnly(recorded), there = here;
  for (int k = 0; k < 50; ++k)
  {
    there.imageToReference[k] = world * here.imageToReference[k];
    here.timestamps.push_back(0.05 * k);
    there.timestamps.push_back(1e9 + 0.1 * k);
  }
  const Trajectory a = SmoothTrajectory(here), b = SmoothTrajectory(there);
  for (int k = 0; k < 50; ++k)
  {
    EXPECT_LT((world * a.imageToReference[k] - b.imageToReference[k]).cwiseAbs().maxCoeff(), 1e-4) << k;
  }
  EXPECT_NEAR(a.translationNoise, b.translationNoise, 1e-5);
}

TEST(Trajectory, KeepsScaleAndShear)
{
  auto recorded = Tracked(Motion(40, HandAt), 0.2, 0.3, 2);
  Eigen::Matrix4d calibration = Eigen::Matrix4d::Identity();
  calibration.topLeftCorner<3, 3>() << 1, 0.2, 0.1, 0.05, 1.3, 0, 0, 0, -0.08;
  for (Eigen::Matrix4d& pose : recorded)
  {
    pose *= calibration;
  }
  const Trajectory found = SmoothTrajectory(PosesOnly(recorded));
  ASSERT_TRUE(found.IsChanged());
  for (int k = 0; k < 40; ++k)
  {
    const Eigen::Matrix3d before = recorded[k].topLeftCorner<3, 3>();
    const Eigen::Matrix3d after = found.imageToReference[k].topLeftCorner<3, 3>();
    EXPECT_LT((before.transpose() * before - after.transpose() * after).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_NEAR(before.determinant(), after.determinant(), 1e-12);
    EXPECT_EQ(found.imageToReference[k].row(3), recorded[k].row(3));
  }
}

TEST(Trajectory, FollowsAProbeThatTurnsAllTheWayRound)
{
  const auto truth = Motion(140, [](double frame) { return PoseAt({0.02 * frame, 0, 0}, {0, 4 * frame, 0}); });
  const auto recorded = Tracked(truth, 0.1, 0.3, 3);
  const Trajectory found = SmoothTrajectory(PosesOnly(recorded));
  EXPECT_EQ(found.stroke.back(), 0);
  EXPECT_LT(ErrorOf(found.imageToReference, truth), 0.5 * ErrorOf(recorded, truth));
  EXPECT_NEAR(found.rotationNoise, 0.3, 0.04);
}

// ---- outliers ----

TEST(Trajectory, FramesFarOffAreFoundAndHardlyHarmTheRest)
{
  for (const std::uint64_t seed : {11, 12, 13})
  {
    const auto truth = Motion(120, HandAt);
    const auto clean = Tracked(truth, 0.2, 0.3, seed);
    auto recorded = clean;
    std::vector<int> off = {0, 17, 40, 41, 77, 103};
    bigus::RandomNumbers random(seed);
    for (const int k : off)
    {
      const Eigen::Vector3d way(random.Normal(), random.Normal(), random.Normal());
      recorded[k].topRightCorner<3, 1>() += 2 * way.normalized();
    }
    const Trajectory found = SmoothTrajectory(PosesOnly(recorded)), without = SmoothTrajectory(PosesOnly(clean));
    for (const int k : off)
    {
      EXPECT_EQ(found.isOutlier[k], 1) << k;
    }
    EXPECT_LE(Outliers(found), 7);
    EXPECT_EQ(found.stroke.back(), 0);
    EXPECT_LT(ErrorOf(found.imageToReference, truth), 1.15 * ErrorOf(without.imageToReference, truth));
    EXPECT_NEAR(found.translationNoise, 0.2, 0.04);
  }
}

// ---- what is kept, bit for bit ----

TEST(Trajectory, ExactPosesAreKept)
{
  const auto exact = Motion(80, HandAt);
  const Trajectory found = SmoothTrajectory(PosesOnly(exact));
  EXPECT_EQ(found.imageToReference, exact);
  EXPECT_LT(found.cornerNoise, 0.01);
  EXPECT_FALSE(found.IsChanged());
  EXPECT_EQ(Outliers(found), 0);
}

TEST(Trajectory, AmongExactPosesOnlyThoseFarOffAreMoved)
{
  const auto truth = Motion(80, HandAt);
  auto recorded = truth;
  for (const int k : {0, 23, 60})
  {
    recorded[k](1, 3) += 2;
  }
  const Trajectory found = SmoothTrajectory(PosesOnly(recorded));
  for (int k = 0; k < 80; ++k)
  {
    const bool isOff = k == 0 || k == 23 || k == 60;
    EXPECT_EQ(found.isOutlier[k] != 0, isOff) << k;
    EXPECT_EQ(found.imageToReference[k] == recorded[k], !isOff) << k;
    EXPECT_LT(bigus::CornerDistance(found.imageToReference[k], truth[k], 200, 160), 0.02) << k;
  }
}

TEST(Trajectory, StepsOfAMotorAreKept)
{
  // Dwelling, double steps, and a corner from where the probe moves along another axis, too.
  const auto steps = Motion(60,
                            [](double frame)
                            {
                              const int k = static_cast<int>(frame);
                              const int done = k / 3 + k / 7;
                              return PoseAt({k > 30 ? 0.5 * (k - 30) : 0.0, 0, 0.4 * done}, {0, 0, 0});
                            });
  const Trajectory found = SmoothTrajectory(PosesOnly(steps));
  EXPECT_TRUE(found.isStepped);
  EXPECT_EQ(found.imageToReference, steps);
  const auto even = Motion(30, [](double frame) { return PoseAt({0, 0, 0.3 * frame}, {0, 0, 0}); });
  EXPECT_EQ(SmoothTrajectory(PosesOnly(even)).imageToReference, even);
}

TEST(Trajectory, AFewPosesAndStrengthZeroAreKept)
{
  const auto recorded = Tracked(Motion(40, HandAt), 0.2, 0.3, 1);
  const Trajectory kept = SmoothTrajectory(PosesOnly(recorded), {0, FrameClock::Times});
  EXPECT_EQ(kept.imageToReference, recorded);
  EXPECT_TRUE(kept.IsNoiseKnown());
  EXPECT_NEAR(kept.translationNoise, 0.2, 0.06) << "what is known of the tracker is told all the same";
  for (const int frames : {1, 2, 7})
  {
    const std::vector<Eigen::Matrix4d> few(recorded.begin(), recorded.begin() + frames);
    const Trajectory found = SmoothTrajectory(PosesOnly(few));
    EXPECT_EQ(found.imageToReference, few);
    EXPECT_FALSE(found.IsNoiseKnown());
    EXPECT_TRUE(std::isnan(found.rotationNoise) && std::isnan(found.cornerNoise));
  }
}

// ---- strokes ----

TEST(Trajectory, NothingIsSmoothedAcrossAJump)
{
  const auto first = Motion(40, HandAt);
  auto truth = first;
  for (int k = 0; k < 40; ++k)
  {
    Eigen::Matrix4d pose = HandAt(39 - k);
    pose(0, 3) += 15;
    truth.push_back(pose);
  }
  const auto recorded = Tracked(truth, 0.1, 0.1, 6);
  const Trajectory found = SmoothTrajectory(PosesOnly(recorded));
  for (int k = 0; k < 80; ++k)
  {
    EXPECT_EQ(found.stroke[k], k < 40 ? 0 : 1) << k;
    EXPECT_LT(found.displacement[k], 0.8) << k;
  }
  EXPECT_LT(ErrorOf(found.imageToReference, truth), 0.6 * ErrorOf(recorded, truth));
}

TEST(Trajectory, NothingIsSmoothedAcrossAReversal)
{
  const auto truth = Motion(80, [](double k) { return PoseAt({0, 0, k < 40 ? 0.5 * k : 0.5 * (79 - k)}, {0, 0, 0}); });
  const auto recorded = Tracked(truth, 0.05, 0.05, 8);
  const Trajectory found = SmoothTrajectory(PosesOnly(recorded));
  ASSERT_EQ(found.stroke.back(), 1);
  EXPECT_NEAR(static_cast<double>(std::count(found.stroke.begin(), found.stroke.end(), 0)), 40, 1);
  EXPECT_LT(bigus::CornerDistance(found.imageToReference[39], truth[39], 200, 160), 0.3);
  EXPECT_LT(ErrorOf(found.imageToReference, truth), 0.5 * ErrorOf(recorded, truth));
}

TEST(Trajectory, AProbeThatLingersCutsNothingOfWhatIsFaster)
{
  const auto truth = Motion(130,
                            [](double k)
                            {
                              const double fast = std::max(0.0, k - 90);
                              return PoseAt({2 * std::sin(0.15 * fast), 0, 0.02 * k + fast}, {0, 0, 0});
                            });
  const Trajectory found = SmoothTrajectory(PosesOnly(Tracked(truth, 0.002, 0.002, 3)));
  EXPECT_EQ(found.stroke, std::vector<int>(130, 0));
}

// ---- time ----

TEST(Trajectory, RecordedTimesTellOfDroppedFrames)
{
  bigus::RandomNumbers random(9);
  std::vector<Eigen::Matrix4d> truth;
  std::vector<double> times;
  for (int k = 0; k < 160; ++k)
  {
    if (random.Uniform() < 0.7)
    {
      truth.push_back(HandAt(k));
      times.push_back(100 + 0.05 * k);
    }
  }
  Sweep sweep = PosesOnly(Tracked(truth, 0.1, 0.1, 5));
  sweep.timestamps = times;
  ASSERT_TRUE(HasUsableTimes(sweep));
  const Trajectory byTimes = SmoothTrajectory(sweep, {1, FrameClock::Times});
  const Trajectory byNumbers = SmoothTrajectory(sweep, {1, FrameClock::Numbers});
  EXPECT_EQ(byTimes.clock, FrameClock::Times);
  EXPECT_EQ(byNumbers.clock, FrameClock::Numbers);
  EXPECT_LT(ErrorOf(byTimes.imageToReference, truth), 0.85 * ErrorOf(byNumbers.imageToReference, truth));
}

TEST(Trajectory, UnusableTimesAreNotUsed)
{
  const auto recorded = Tracked(Motion(30, HandAt), 0.1, 0.1, 5);
  const Sweep plain = PosesOnly(recorded);
  EXPECT_FALSE(HasUsableTimes(plain));
  const Trajectory expected = SmoothTrajectory(plain);
  EXPECT_EQ(expected.clock, FrameClock::Numbers);
  const auto with = [&](const std::function<double(int)>& time)
  {
    Sweep sweep = plain;
    for (int k = 0; k < 30; ++k)
    {
      sweep.timestamps.push_back(time(k));
    }
    return sweep;
  };
  for (const Sweep& sweep : {with([](int) { return 0.0; }), with([](int k) { return k == 9 ? 7.5 : k; }),
                             with([](int k) { return k == 3 ? std::numeric_limits<double>::quiet_NaN() : k; }),
                             with([](int k) { return k < 15 ? k : 1e9 + k; })})
  {
    EXPECT_FALSE(HasUsableTimes(sweep));
    EXPECT_EQ(SmoothTrajectory(sweep).imageToReference, expected.imageToReference);
  }
}

TEST(Trajectory, RefusesWhatMakesNoSense)
{
  Sweep sweep = PosesOnly(Tracked(Motion(30, HandAt), 0.1, 0.1, 5));
  for (const double strength : {-1.0, 1001.0, std::numeric_limits<double>::quiet_NaN()})
  {
    bigus::test::ExpectRefused([&] { SmoothTrajectory(sweep, {strength, FrameClock::Times}); }, {"strength"});
  }
  sweep.imageToReference[4](1, 3) = std::numeric_limits<double>::infinity();
  bigus::test::ExpectRefused([&] { SmoothTrajectory(sweep); }, {"frame 4"});
}

/// A straight path, whose smoothing by any strength is a line of least squares, which keeps 2 of its n records: white noise
/// s is left as s sqrt(2 / n).
TEST(Trajectory, TellsWhatSmoothingLeavesOfWhiteNoise)
{
  constexpr int kFrames = 40, kSeeds = 30;
  constexpr double kNoise = 0.2;
  const std::vector<Eigen::Matrix4d> truth = Motion(kFrames,
                                                    [](double frame) {
                                                      return PoseAt({0.03 * frame, 0, 0.5 * frame}, {0, 0, 0});
                                                    });
  for (const double strength : {1.0, 4.0, 16.0})
  {
    double told = 0, left = 0;
    for (int seed = 1; seed <= kSeeds; ++seed)
    {
      const Trajectory smooth = SmoothTrajectory(PosesOnly(Tracked(truth, kNoise, 0, seed)), {strength});
      told += smooth.translationLeft * smooth.translationLeft / kSeeds;
      for (int k = 0; k < kFrames; ++k)
      {
        const Eigen::Vector3d error = (smooth.imageToReference[k] - truth[k]).topRightCorner<3, 1>();
        left += error.squaredNorm() / 3 / kFrames / kSeeds;
      }
    }
    const double expected = kNoise * std::sqrt(2.0 / kFrames);
    // 3 axes of 2 numbers in every seed are known: a twentieth of the root, with its standard error.
    EXPECT_NEAR(std::sqrt(left), expected, 0.25 * expected) << strength;
    EXPECT_NEAR(std::sqrt(told), std::sqrt(left), 0.2 * std::sqrt(left)) << strength;
  }
}

}  // namespace
