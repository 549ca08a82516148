// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The measure of pose error against displacements whose size is known.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Poses/PoseError.h"

namespace bigus
{
namespace
{

constexpr int kErrorWidth = 81, kErrorHeight = 61;

/// A tilting sweep.
std::vector<Eigen::Matrix4d> TiltingPoses()
{
  PhantomOptions options;
  options.frames = 20;
  options.tilt = 10;
  options.width = kErrorWidth;
  options.height = kErrorHeight;
  const Phantom phantom(options);
  std::vector<Eigen::Matrix4d> poses;
  for (int k = 0; k < options.frames; ++k)
  {
    poses.push_back(phantom.TruePlane(k).ImageToReference());
  }
  return poses;
}

TEST(PoseError, IsZeroForThePosesThemselves)
{
  const PoseError error = MeasurePoseError(TiltingPoses(), TiltingPoses(), kErrorWidth, kErrorHeight);
  EXPECT_EQ(error.distance, 0);
  EXPECT_NEAR(error.angle, 0, 1e-5);
  EXPECT_NEAR(error.bending, 0, 1e-9);
}

TEST(PoseError, AMotionOfTheWholeSweepBendsNothing)
{
  const Eigen::Affine3d motion = Eigen::Translation3d(3, -4, 12) *
                                 Eigen::AngleAxisd(5 * kRadiansPerDegree, Eigen::Vector3d(1, 2, -1).normalized());
  std::vector<Eigen::Matrix4d> moved = TiltingPoses(), shifted = moved;
  for (std::size_t k = 0; k < moved.size(); ++k)
  {
    moved[k] = motion * moved[k];
    shifted[k].col(3).head<3>() += Eigen::Vector3d(3, -4, 12);
  }
  const PoseError shift = MeasurePoseError(shifted, TiltingPoses(), kErrorWidth, kErrorHeight);
  EXPECT_NEAR(shift.distance, 13, 1e-9);
  EXPECT_NEAR(shift.angle, 0, 1e-5);
  EXPECT_NEAR(shift.bending, 0, 1e-9);
  const PoseError turn = MeasurePoseError(moved, TiltingPoses(), kErrorWidth, kErrorHeight);
  EXPECT_NEAR(turn.angle, 5, 1e-5);
  EXPECT_NEAR(turn.bending, 0, 1e-9);
}

TEST(PoseError, AveragesOverFramesAndCorners)
{
  // One frame in twenty turned by 2 degrees about its middle: its corners move by twice the sine of half the angle
  // times their distance from the middle, 10 mm for 80 x 60 steps of 0.2 mm.
  std::vector<Eigen::Matrix4d> poses = TiltingPoses();
  const Eigen::Vector3d middle = (poses[7] * Eigen::Vector4d(40, 30, 0, 1)).head<3>();
  const Eigen::Vector3d normal = poses[7].block<3, 1>(0, 2);
  poses[7] = Eigen::Affine3d(Eigen::Translation3d(middle) * Eigen::AngleAxisd(2 * kRadiansPerDegree, normal) *
                             Eigen::Translation3d(-middle)) *
             poses[7];
  const PoseError error = MeasurePoseError(poses, TiltingPoses(), kErrorWidth, kErrorHeight);
  EXPECT_NEAR(error.distance, 2 * std::sin(kRadiansPerDegree) * 10 / 20, 1e-9);
  EXPECT_NEAR(error.angle, 2.0 / 20, 1e-6);
  EXPECT_GT(error.bending, 0.9 * error.distance);
}

TEST(PoseError, RefusesSequencesThatDoNotMatch)
{
  std::vector<Eigen::Matrix4d> fewer = TiltingPoses();
  fewer.pop_back();
  EXPECT_THROW(MeasurePoseError(fewer, TiltingPoses(), kErrorWidth, kErrorHeight), Error);
  EXPECT_THROW(MeasurePoseError({}, {}, kErrorWidth, kErrorHeight), Error);
}

}  // namespace
}  // namespace bigus
