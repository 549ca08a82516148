// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "Core/Phantom/Phantom.h"
#include "Core/Poses/PoseDoubts.h"

namespace bigus
{
namespace
{

/// Poses without pictures.
Sweep StraightPoses()
{
  PhantomOptions options;
  options.frames = 20;
  options.width = options.height = 200;
  const Phantom phantom(options);
  Sweep sweep;
  sweep.width = sweep.height = 200;
  for (int k = 0; k < options.frames; ++k)
  {
    sweep.imageToReference.push_back(phantom.RecordedPlane(k).ImageToReference());
  }
  return sweep;
}

/// The doubts once every pose went through `change(frame, pose)`.
template <class Change>
std::vector<std::string> Doubts(Change change)
{
  Sweep sweep = StraightPoses();
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    change(k, sweep.imageToReference[k]);
  }
  return DoubtsAboutPoses(sweep, bigus::AllFrames(sweep));
}

void ExpectOne(const std::vector<std::string>& doubts, const std::string& words)
{
  ASSERT_EQ(doubts.size(), 1u) << (doubts.empty() ? "" : doubts[0]);
  EXPECT_NE(doubts[0].find(words), std::string::npos) << doubts[0];
}

TEST(PoseDoubts, AUsualSweepRaisesNone)
{
  EXPECT_TRUE(Doubts([](int, Eigen::Matrix4d&) {}).empty());
  EXPECT_TRUE(DoubtsAboutPoses(Sweep(), {}).empty());
}

TEST(PoseDoubts, WrongUnitsAreNamed)
{
  ExpectOne(Doubts([](int, Eigen::Matrix4d& pose) { pose.topRows<3>() *= 1e-3; }), "not in metres");
  ExpectOne(Doubts([](int, Eigen::Matrix4d& pose) { pose.topRows<3>() *= 1e3; }), "too large for ultrasound");
  ExpectOne(Doubts([](int, Eigen::Matrix4d& pose) { pose.topLeftCorner<3, 3>() *= 50; }), "too large");
  ExpectOne(Doubts([](int, Eigen::Matrix4d& pose) { pose.topRows<3>() *= 10; }), "too large");
  ExpectOne(Doubts([](int, Eigen::Matrix4d& pose) { pose.block<3, 1>(0, 3) *= 1e4; }), "path");
  ExpectOne(Doubts([](int, Eigen::Matrix4d& pose) { pose.block<3, 1>(0, 3) *= 1e-3; }), "short");
}

TEST(PoseDoubts, ShearAndScaleAreNamed)
{
  ExpectOne(Doubts([](int k, Eigen::Matrix4d& pose) { pose.col(1) += (k < 5 ? 0.1 : 0) * pose.col(0); }),
            "5 of 20 frames shear");
  ExpectOne(Doubts([](int k, Eigen::Matrix4d& pose) { pose.leftCols<2>() *= 1 + 0.01 * k; }), "one scale");
}

TEST(PoseDoubts, CoplanarFramesAreNamed)
{
  const Eigen::Matrix4d first = StraightPoses().imageToReference[0];
  ExpectOne(Doubts([&](int, Eigen::Matrix4d& pose) { pose = first; }), "no volume");
  // In the plane, but elsewhere in it.
  ExpectOne(Doubts(
                [&](int k, Eigen::Matrix4d& pose)
                {
                  pose = first;
                  pose.col(3) += k * first.col(0);
                }),
            "no volume");
  const std::vector<Eigen::Matrix4d> poses = StraightPoses().imageToReference;
  ExpectOne(Doubts([&](int k, Eigen::Matrix4d& pose) { pose = poses[k - k % 2]; }), "10 of 20 frames lie in the plane");
}

/// Turns of 30 degrees in all about an axis through pixel (i, j): across the image, or along its columns.
std::vector<std::string> DoubtsOfTurning(double i, double j, const Eigen::Vector3d& axis, double noise,
                                         double scale = 1)
{
  const Eigen::Matrix4d first = StraightPoses().imageToReference[0];
  const Eigen::Vector3d pivot = (first * Eigen::Vector4d(i, j, 0, 1)).head<3>();
  return Doubts(
      [&](int k, Eigen::Matrix4d& pose)
      {
        const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.026 * k, axis).toRotationMatrix();
        pose = first;
        pose.topLeftCorner<3, 3>() = turn * first.topLeftCorner<3, 3>();
        pose.block<3, 1>(0, 3) = pivot + turn * (first.block<3, 1>(0, 3) - pivot);
        pose.block<3, 1>(0, 3) += Eigen::Vector3d::Constant(k % 2 ? noise : -noise);
        pose.block<3, 1>(0, 3) *= scale;
      });
}

TEST(PoseDoubts, AProbeThatTurnsMovesAtItsCorners)
{
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0)})
  {
    for (const double noise : {0.0, 0.0005})
    {
      const auto doubts = DoubtsOfTurning(99.5, 99.5, axis, noise);
      EXPECT_TRUE(doubts.empty()) << doubts[0];
    }
    const auto doubts = DoubtsOfTurning(0, 0, axis, 0);  // an axis through pixel (0, 0): motors do that
    EXPECT_TRUE(doubts.empty()) << doubts[0];
    ExpectOne(DoubtsOfTurning(-100, -100, axis, 0, 1e-3), "metres");
  }
}

TEST(PoseDoubts, MatricesTheWrongWayRoundAreNamed)
{
  for (const double third : {1.0, 0.2})
  {
    for (const double pixel : {0.2, 1.4})
    {
      const auto posesOf = [&](bool isInverse)
      {
        return Doubts(
            [&](int k, Eigen::Matrix4d& pose)
            {
              const Eigen::Matrix3d turn(Eigen::AngleAxisd(0.02 * k + 0.1, Eigen::Vector3d(1, 2, 3).normalized()));
              pose.setIdentity();
              pose.topLeftCorner<3, 3>() = turn * Eigen::Vector3d(pixel, 0.8 * pixel, third).asDiagonal();
              pose.block<3, 1>(0, 3) = Eigen::Vector3d(k, 20, 30);
              pose = isInverse ? Eigen::Matrix4d(pose.inverse()) : pose;
            });
      };
      EXPECT_TRUE(posesOf(false).empty()) << pixel << " " << third << " " << posesOf(false)[0];
      ExpectOne(posesOf(true), "the wrong way round");
    }
  }
}

TEST(PoseDoubts, OneTimeOrTimesThatFallAreNamed)
{
  EXPECT_FALSE(DoubtAboutTimes({}));
  EXPECT_FALSE(DoubtAboutTimes({3}));
  EXPECT_FALSE(DoubtAboutTimes({1, 1, 2, 2}));
  EXPECT_NE(DoubtAboutTimes({2, 2, 2}).value_or("").find("same time"), std::string::npos);
  EXPECT_NE(DoubtAboutTimes({3, 2, 1}).value_or("").find("earlier"), std::string::npos);
}

}  // namespace
}  // namespace bigus
