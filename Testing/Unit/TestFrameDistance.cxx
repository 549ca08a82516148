// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How far a slice's pixels lie from recorded frames: beside known numbers and a search over the frames' points.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "Core/Model/Error.h"
#include "Core/Model/FrameDistance.h"
#include "Support/Errors.h"
#include "Support/Sweeps.h"

using bigus::DistanceToFrames;
using bigus::SlicePlane;
using bigus::Sweep;
using bigus::test::BlackSweep;
using bigus::test::Message;

TEST(FrameDistance, APlaneAcrossTheSweepShowsItsGap)
{
  // Frames at z = -4.5 to 4.5, 1 mm apart; four are left out: a gap from -1.5 to 3.5.
  const auto sweep = BlackSweep(10, 21, 11, 0.5, 1.0);
  const std::vector<int> frames = {0, 1, 2, 3, 8, 9};
  SlicePlane across;
  across.origin = {0, -2, -6};
  across.columnStep = {0, 0, 0.25};
  across.rowStep = {0, 0.5, 0};
  across.width = 49;
  across.height = 9;
  std::vector<float> distances(across.NumberOfPixels());
  DistanceToFrames(*sweep, frames, across, distances.data());
  for (int p = 0; p < static_cast<int>(distances.size()); ++p)
  {
    const double z = -6 + 0.25 * (p % across.width);
    double expected = std::numeric_limits<double>::infinity();
    for (const int frame : frames)
    {
      expected = std::min(expected, std::abs(z - (frame - 4.5)));
    }
    EXPECT_NEAR(distances[p], expected, 1e-5) << "z " << z;
  }
  EXPECT_NEAR(*std::max_element(distances.begin(), distances.end()), 2.5, 1e-5) << "half the gap";
}

TEST(FrameDistance, IsTheNearestPointOfTheFramesRectangles)
{
  // Two tilted frames and a plane that reaches far beyond them.
  auto sweep = BlackSweep(2, 15, 11, 0.7, 3.0);
  for (int frame = 0; frame < 2; ++frame)
  {
    Eigen::Matrix4d turn = Eigen::Matrix4d::Identity();
    turn.topLeftCorner<3, 3>() =
        Eigen::AngleAxisd(0.3 + frame, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
    sweep->imageToReference[frame] = turn * sweep->imageToReference[frame];
  }
  SlicePlane plane;
  plane.origin = {-9, 2, -8};
  plane.columnStep = Eigen::Vector3d(1, 0.2, 0.5);
  plane.rowStep = Eigen::Vector3d(-0.3, 1, 0.7);
  plane.width = 19;
  plane.height = 13;
  std::vector<float> distances(plane.NumberOfPixels());
  DistanceToFrames(*sweep, AllFrames(*sweep), plane, distances.data());

  constexpr int kFine = 8;  // points a pixel and direction: the nearest is at most half a diagonal away, 0.062 mm
  for (int p = 0; p < static_cast<int>(distances.size()); ++p)
  {
    const Eigen::Vector3d x = plane.Point(p % plane.width, p / plane.width);
    double nearest = std::numeric_limits<double>::infinity();
    for (int frame = 0; frame < 2; ++frame)
    {
      const SlicePlane at = sweep->Plane(frame);
      for (int j = 0; j <= kFine * at.height; ++j)
      {
        for (int i = 0; i <= kFine * at.width; ++i)
        {
          nearest = std::min(nearest, (at.Point(double(i) / kFine - 0.5, double(j) / kFine - 0.5) - x).norm());
        }
      }
    }
    EXPECT_LE(distances[p], nearest + 1e-5);
    EXPECT_GE(distances[p], nearest - 0.0625);
  }
}

TEST(FrameDistance, NeedsAFrame)
{
  const auto sweep = BlackSweep(2, 4, 4, 1.0, 1.0);
  float distance = 0;
  EXPECT_NE(Message([&] { DistanceToFrames(*sweep, {}, SlicePlane(), &distance); }).find("frame"), std::string::npos);
}
