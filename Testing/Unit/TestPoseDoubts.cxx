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

}  // namespace
}  // namespace bigus
