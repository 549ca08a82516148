// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The plain predictors on synthetic sweeps whose intensity is known everywhere.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "Core/Evaluation/Baselines.h"
#include "Core/Evaluation/Compounding.h"
#include "Core/Model/Error.h"
#include "Support/Errors.h"
#include "Support/Sweeps.h"

using bigus::Compounding;
using bigus::Error;
using bigus::SlicePlane;
using bigus::Sweep;
using bigus::test::FrameOf;
using bigus::test::Message;

namespace
{

using Function = std::function<double(const Eigen::Vector3d&)>;

/// Linear in space, within [0, 1] over the sweeps below.
const Eigen::Vector3d slope(0.004, -0.003, 0.006);
double Linear(const Eigen::Vector3d& x)
{
  return 0.5 + slope.dot(x);
}

/// A frame of 0.5 mm pixels around `centre`, turned by `rotation`.
Eigen::Matrix4d Pose(const Eigen::Vector3d& centre, const Eigen::Matrix3d& rotation, int width, int height)
{
  SlicePlane plane;
  plane.columnStep = 0.5 * rotation.col(0);
  plane.rowStep = 0.5 * rotation.col(1);
  plane.origin = centre - 0.5 * (width - 1) * plane.columnStep - 0.5 * (height - 1) * plane.rowStep;
  return plane.ImageToReference();
}

Sweep MakeSweep(int width, int height, const std::vector<Eigen::Matrix4d>& poses, const Function& intensity)
{
  Sweep sweep;
  sweep.width = width;
  sweep.height = height;
  sweep.pixelType = Sweep::PixelType::Float32;
  sweep.imageToReference = poses;
  auto pixels = std::make_shared<std::vector<float>>();
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    for (int j = 0; j < height; ++j)
    {
      for (int i = 0; i < width; ++i)
      {
        pixels->push_back(static_cast<float>(intensity(sweep.Plane(k).Point(i, j))));
      }
    }
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  sweep.Validate();
  return sweep;
}

const Eigen::Matrix3d oblique = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, -2, 3).normalized()).toRotationMatrix();

/// Parallel planes, unevenly spaced, in an oblique direction.
Sweep Parallel(const Function& intensity, int width = 41, int height = 33)
{
  std::vector<Eigen::Matrix4d> poses;
  for (double z : {0.0, 0.6, 1.0, 1.9, 2.3, 3.3, 3.5})
  {
    poses.push_back(Pose(z * oblique.col(2), oblique, width, height));
  }
  return MakeSweep(width, height, poses, intensity);
}

/// A fan: planes turned 3 degrees from one to the next about an axis beside the images.
Sweep Fan(const Function& intensity, int width = 41, int height = 33)
{
  std::vector<Eigen::Matrix4d> poses;
  for (int k = -4; k <= 4; ++k)
  {
    const Eigen::AngleAxisd turn(k * 0.05, Eigen::Vector3d::UnitX());
    poses.push_back(Pose(turn * Eigen::Vector3d(0, 15, 0), turn.toRotationMatrix(), width, height));
  }
  return MakeSweep(width, height, poses, intensity);
}

std::vector<int> AllBut(const Sweep& sweep, int frame)
{
  std::vector<int> frames;
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    if (k != frame)
    {
      frames.push_back(k);
    }
  }
  return frames;
}

std::vector<float> Nearest(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane)
{
  std::vector<float> image(plane.NumberOfPixels(), -1.0f);
  bigus::PredictNearest(sweep, training, plane, image.data());
  return image;
}

std::vector<float> Average(const Sweep& sweep, const std::vector<int>& training, int frame)
{
  std::vector<float> image(sweep.PixelsPerFrame(), -1.0f);
  bigus::PredictNeighbourAverage(sweep, training, frame, image.data());
  return image;
}

std::vector<float> Interpolated(const Sweep& sweep, const std::vector<int>& training, int frame)
{
  std::vector<float> image(sweep.PixelsPerFrame(), -1.0f);
  bigus::PredictPoseInterpolation(sweep, training, frame, image.data());
  return image;
}

std::vector<float> Interpolated(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane)
{
  std::vector<float> image(plane.NumberOfPixels(), -1.0f);
  bigus::PredictPoseInterpolation(sweep, training, plane, image.data());
  return image;
}

std::vector<float> Cubic(const Sweep& sweep, const std::vector<int>& training, int frame)
{
  std::vector<float> image(sweep.PixelsPerFrame(), -1.0f);
  bigus::PredictCubicInterpolation(sweep, training, frame, image.data());
  return image;
}

std::vector<float> Cubic(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane)
{
  std::vector<float> image(plane.NumberOfPixels(), -1.0f);
  bigus::PredictCubicInterpolation(sweep, training, plane, image.data());
  return image;
}

std::vector<float> Resliced(const Compounding& volume, const SlicePlane& plane)
{
  std::vector<float> image(plane.NumberOfPixels(), -1.0f);
  volume.Predict(plane, image.data());
  return image;
}

/// The largest difference from `intensity` over the plane's pixels, leaving out `margin` of them at every
/// edge.
double LargestError(const std::vector<float>& image, const SlicePlane& plane, const Function& intensity, int margin = 0)
{
  double largest = 0;
  for (int j = margin; j < plane.height - margin; ++j)
  {
    for (int i = margin; i < plane.width - margin; ++i)
    {
      const double found = image[static_cast<std::size_t>(j) * plane.width + i];
      largest = std::max(largest, std::abs(found - intensity(plane.Point(i, j))));
    }
  }
  return largest;
}

/// A plane at right angles to the planes of Parallel(), wholly between its first and last.
SlicePlane Crossing()
{
  SlicePlane plane;
  plane.columnStep = 0.25 * oblique.col(0);
  plane.rowStep = 0.25 * oblique.col(2);
  plane.origin = -4 * oblique.col(0) + 0.1 * oblique.col(2);
  plane.width = 33;
  plane.height = 13;
  return plane;
}

}  // namespace

TEST(NearestFrame, IsTheOneWithTheNearestPose)
{
  const Sweep sweep = Parallel(Linear);
  EXPECT_EQ(Nearest(sweep, AllFrames(sweep), sweep.Plane(3)), FrameOf(sweep, 3));
  EXPECT_EQ(Nearest(sweep, AllBut(sweep, 1), sweep.Plane(1)), FrameOf(sweep, 2));  // 0.4 mm away; frame 0 is 0.6
  EXPECT_EQ(Nearest(sweep, AllBut(sweep, 3), sweep.Plane(3)), FrameOf(sweep, 4));
  EXPECT_EQ(Nearest(sweep, {0, 6}, sweep.Plane(3)), FrameOf(sweep, 6));
  EXPECT_EQ(Nearest(sweep, {5}, sweep.Plane(0)), FrameOf(sweep, 5));

  const Sweep fan = Fan(Linear);
  EXPECT_EQ(Nearest(fan, {0, 1, 7}, fan.Plane(5)), FrameOf(fan, 7));
  SlicePlane outside = fan.Plane(8);
  outside.origin += 100 * outside.Normal();
  EXPECT_EQ(Nearest(fan, AllFrames(fan), outside), FrameOf(fan, 8));
}

TEST(NearestFrame, NeedsAPlaneOfTheSameSize)
{
  const Sweep sweep = Parallel(Linear);
  SlicePlane plane = sweep.Plane(0);
  plane.width = 40;
  EXPECT_NE(Message([&] { Nearest(sweep, AllFrames(sweep), plane); }).find("40 x 33"), std::string::npos);
}

TEST(NeighbourAverage, IsTheMeanOfTheFramesBeforeAndAfter)
{
  const Sweep sweep = Parallel([](const Eigen::Vector3d& x) { return 0.5 + 0.4 * std::sin(x.sum()); });
  const auto mean = [&](int a, int b)
  {
    std::vector<float> m = FrameOf(sweep, a);
    const std::vector<float> other = FrameOf(sweep, b);
    for (std::size_t p = 0; p < m.size(); ++p)
    {
      m[p] = (m[p] + other[p]) / 2;
    }
    return m;
  };
  EXPECT_EQ(Average(sweep, AllBut(sweep, 3), 3), mean(2, 4));
  EXPECT_EQ(Average(sweep, AllFrames(sweep), 3), mean(2, 4));  // never the frame itself
  EXPECT_EQ(Average(sweep, {0, 1, 6}, 3), mean(1, 6));
  EXPECT_EQ(Average(sweep, AllBut(sweep, 0), 0), FrameOf(sweep, 1));
  EXPECT_EQ(Average(sweep, AllBut(sweep, 6), 6), FrameOf(sweep, 5));
  EXPECT_EQ(Average(sweep, {2}, 5), FrameOf(sweep, 2));
}

TEST(PoseInterpolation, IsExactWhereIntensityIsLinear)
{
  for (const Sweep& sweep : {Parallel(Linear), Fan(Linear)})
  {
    for (int frame = 1; frame + 1 < sweep.NumberOfFrames(); ++frame)
    {
      // At the edges the line to a tilted neighbour misses its image by a pixel or so.
      EXPECT_LT(LargestError(Interpolated(sweep, AllBut(sweep, frame), frame), sweep.Plane(frame), Linear, 2), 1e-6);
      EXPECT_LT(
          LargestError(Interpolated(sweep, AllBut(sweep, frame), sweep.Plane(frame)), sweep.Plane(frame), Linear, 2),
          1e-6);
    }
  }
  const Sweep sweep = Parallel(Linear);
  EXPECT_LT(LargestError(Interpolated(sweep, AllFrames(sweep), Crossing()), Crossing(), Linear), 1e-6);
}

TEST(PoseInterpolation, DoesNotMindReflectedFrames)
{
  const Sweep sweep = Fan(Linear);
  // Every other frame has its rows stored from the bottom up: another normal, the same picture in space.
  std::vector<Eigen::Matrix4d> poses = sweep.imageToReference;
  for (std::size_t k = 0; k < poses.size(); k += 2)
  {
    poses[k].col(3) += (sweep.height - 1) * poses[k].col(1);
    poses[k].col(1) *= -1;
  }
  const Sweep reflected = MakeSweep(sweep.width, sweep.height, poses, Linear);
  for (int frame : {3, 4})
  {
    EXPECT_LT(LargestError(Interpolated(reflected, AllBut(reflected, frame), frame), reflected.Plane(frame), Linear, 2),
              1e-6);
    EXPECT_LT(LargestError(Interpolated(reflected, AllBut(reflected, frame), reflected.Plane(frame)),
                           reflected.Plane(frame), Linear, 2),
              1e-6);
  }
}

TEST(PoseInterpolation, ReproducesATrainingFrameAtItsOwnPlane)
{
  const Sweep sweep = Parallel([](const Eigen::Vector3d& x) { return 0.5 + 0.4 * std::sin(9 * x.sum()); });
  const std::vector<float> truth = FrameOf(sweep, 3);
  const std::vector<float> image = Interpolated(sweep, AllFrames(sweep), sweep.Plane(3));
  for (std::size_t p = 0; p < truth.size(); ++p)
  {
    EXPECT_NEAR(image[p], truth[p], 1e-6);
  }
}

TEST(PoseInterpolation, TakesTheFrameThatSeesThePointWhenTheOtherDoesNot)
{
  // Frame 1 is shifted half its width sideways, so only half of it lies beside both neighbours' images.
  std::vector<Eigen::Matrix4d> poses = {Pose({0, 0, 0}, Eigen::Matrix3d::Identity(), 20, 10),
                                        Pose({5, 0, 1}, Eigen::Matrix3d::Identity(), 20, 10),
                                        Pose({10, 0, 2}, Eigen::Matrix3d::Identity(), 20, 10)};
  const Sweep sweep = MakeSweep(20, 10, poses, [](const Eigen::Vector3d& x) { return x[2] / 2; });
  for (const std::vector<float>& image : {Interpolated(sweep, {0, 2}, 1), Interpolated(sweep, {0, 2}, sweep.Plane(1))})
  {
    EXPECT_FLOAT_EQ(image[0], 0.0f);   // seen by frame 0 only
    EXPECT_FLOAT_EQ(image[19], 1.0f);  // by frame 2 only
  }
  poses[2](0, 3) += 100;
  poses[0](0, 3) -= 100;
  const Sweep apart = MakeSweep(20, 10, poses, [](const Eigen::Vector3d&) { return 0.7; });
  EXPECT_EQ(Interpolated(apart, {0, 2}, 1), std::vector<float>(200, 0.0f));
  EXPECT_EQ(Interpolated(apart, {0, 2}, apart.Plane(1)), std::vector<float>(200, 0.0f));
}

TEST(PoseInterpolation, BeyondTheSweepTakesTheNearestFrame)
{
  const Sweep sweep = Parallel([](const Eigen::Vector3d& x) { return 0.5 + 0.4 * std::sin(x.sum()); });
  SlicePlane beyond = sweep.Plane(6);
  beyond.origin += 3 * beyond.Normal();
  const std::vector<float> last = FrameOf(sweep, 6);
  const std::vector<float> image = Interpolated(sweep, AllFrames(sweep), beyond);
  const std::vector<float> end = Interpolated(sweep, AllBut(sweep, 6), 6);
  const std::vector<float> single = Interpolated(sweep, {5}, sweep.Plane(0));
  for (std::size_t p = 0; p < last.size(); ++p)
  {
    EXPECT_NEAR(image[p], last[p], 1e-6);
    EXPECT_NEAR(end[p], FrameOf(sweep, 5)[p], 1e-6);
    EXPECT_NEAR(single[p], FrameOf(sweep, 5)[p], 1e-6);
  }
  SlicePlane aside = sweep.Plane(3);
  aside.origin += 100 * aside.columnStep;
  EXPECT_EQ(Interpolated(sweep, AllFrames(sweep), aside), std::vector<float>(aside.NumberOfPixels(), 0.0f));
}

TEST(PoseInterpolation, CubicSamplesLieOnTheCurveBetweenPixels)
{
  // Keys' kernel repeats any parabola: frames half a pixel aside are met exactly, where bilinear samples are
  // not.
  const Function parabola = [](const Eigen::Vector3d& x)
  { return 0.3 + 0.02 * x[0] * x[0] - 0.01 * x[0] * x[1] + 0.015 * x[1] * x[1]; };
  std::vector<Eigen::Matrix4d> poses;
  for (double aside : {0.0, 0.25, 0.0})
  {
    poses.push_back(Pose({aside, -aside, 0}, Eigen::Matrix3d::Identity(), 15, 13));
    poses.back()(2, 3) = static_cast<double>(poses.size());
  }
  const Sweep sweep = MakeSweep(15, 13, poses, parabola);
  const auto predict = [&](bigus::PixelInterpolation sampling, bool byPlane)
  {
    std::vector<float> image(sweep.PixelsPerFrame());
    if (byPlane)
    {
      bigus::PredictPoseInterpolation(sweep, {0, 2}, sweep.Plane(1), image.data(), sampling);
    }
    else
    {
      bigus::PredictPoseInterpolation(sweep, {0, 2}, 1, image.data(), sampling);
    }
    return LargestError(image, sweep.Plane(1), parabola, 2);
  };
  for (bool byPlane : {false, true})
  {
    EXPECT_LT(predict(bigus::PixelInterpolation::Cubic, byPlane), 1e-6);
    EXPECT_GT(predict(bigus::PixelInterpolation::Linear, byPlane), 1e-3);
  }
}

TEST(CubicInterpolation, IsExactForParabolasAcrossUnevenPlanes)
{
  const Function parabola = [](const Eigen::Vector3d& x)
  {
    const Eigen::Vector3d p = oblique.transpose() * x;
    return 0.4 + 0.03 * p[2] - 0.02 * p[2] * p[2] + 0.01 * p[0] - 0.001 * p[1] * p[1] + 0.002 * p[0] * p[2];
  };
  const Sweep sweep = Parallel(parabola);
  for (int frame : {2, 3, 4})
  {
    EXPECT_LT(LargestError(Cubic(sweep, AllBut(sweep, frame), frame), sweep.Plane(frame), parabola, 2), 1e-6);
    EXPECT_GT(LargestError(Interpolated(sweep, AllBut(sweep, frame), frame), sweep.Plane(frame), parabola, 2), 1e-3);
  }
  // Tilted planes: the line meets them elsewhere, and a linear function is still met.
  const Sweep fan = Fan(Linear);
  for (int frame = 1; frame < 8; ++frame)
  {
    EXPECT_LT(LargestError(Cubic(fan, AllBut(fan, frame), frame), fan.Plane(frame), Linear, 4), 1e-6);
  }
}

TEST(CubicInterpolation, TakesWhatFramesThereAre)
{
  const Sweep sweep = Parallel(Linear);
  for (const std::vector<int>& training : {std::vector<int>{2, 4}, {1, 2, 4}, {2, 4, 5}})
  {
    EXPECT_LT(LargestError(Cubic(sweep, training, 3), sweep.Plane(3), Linear), 1e-6);
  }
  const std::vector<float> end = Cubic(sweep, {0, 1, 2}, 5), last = FrameOf(sweep, 2);
  for (std::size_t p = 0; p < end.size(); ++p)
  {
    ASSERT_NEAR(end[p], last[p], 1e-6);
  }
  // Two frames at one place: no slope can be had across them, and no division by zero either.
  std::vector<Eigen::Matrix4d> poses;
  for (double z : {0.0, 0.0, 0.5, 1.0, 1.0})
  {
    poses.push_back(Pose({0, 0, z}, Eigen::Matrix3d::Identity(), 12, 12));
  }
  const Sweep twice = MakeSweep(12, 12, poses, Linear);
  EXPECT_LT(LargestError(Cubic(twice, {0, 1, 3, 4}, 2), twice.Plane(2), Linear), 1e-6);
}

TEST(CubicInterpolation, AtAnyPlaneIsExactForParabolasBetweenTheInnerFrames)
{
  const Function parabola = [](const Eigen::Vector3d& x)
  {
    const Eigen::Vector3d p = oblique.transpose() * x;
    return 0.4 + 0.03 * p[2] - 0.02 * p[2] * p[2] + 0.01 * p[0] - 0.001 * p[1] * p[1] + 0.002 * p[0] * p[2];
  };
  const Sweep sweep = Parallel(parabola);
  SlicePlane plane = Crossing();
  plane.origin += 0.6 * oblique.col(2);  // from 0.7 mm, past the second frame, to 3.1 mm
  plane.height = 10;
  EXPECT_LT(LargestError(Cubic(sweep, AllFrames(sweep), plane), plane, parabola), 1e-6);
  EXPECT_GT(LargestError(Interpolated(sweep, AllFrames(sweep), plane), plane, parabola), 1e-3);
  // A frame's own plane: by the sequence and by what encloses its points it is the same two frames.
  const std::vector<float> bySequence = Cubic(sweep, AllBut(sweep, 3), 3);
  const std::vector<float> byPlane = Cubic(sweep, AllBut(sweep, 3), sweep.Plane(3));
  EXPECT_EQ(bySequence, byPlane);
  const Sweep fan = Fan(Linear);
  EXPECT_LT(LargestError(Cubic(fan, AllBut(fan, 4), fan.Plane(4)), fan.Plane(4), Linear, 4), 1e-6);
}

TEST(FindEnclosed, IsWhatLiesBetweenTwoFramesInsideBothAndLit)
{
  Sweep sweep = Parallel(Linear);  // 41 x 33 pixels of 0.5 mm, at 0 to 3.5 mm
  const auto lies = [&](double x, double y, double z)
  {
    SlicePlane plane;
    plane.origin = oblique * Eigen::Vector3d(x, y, z);
    std::uint8_t enclosed = 9;
    bigus::FindEnclosed(sweep, {0, 1, 4}, plane, &enclosed);
    return enclosed == 1;
  };
  EXPECT_TRUE(lies(0, 0, 0.3));
  EXPECT_TRUE(lies(9.99, -7.99, 2.2));
  EXPECT_FALSE(lies(0, 0, 2.4));  // behind frame 4
  EXPECT_FALSE(lies(0, 0, -0.1));
  EXPECT_FALSE(lies(10.1, 0, 1));  // the last pixels' centres lie at 10 and 8 mm
  EXPECT_FALSE(lies(0, 8.1, 1));
  auto mask = std::make_shared<std::vector<std::uint8_t>>(sweep.PixelsPerFrame(), 1);
  (*mask)[16 * 41 + 24] = 0;  // 2 mm to the right of the middle
  sweep.mask = mask;
  EXPECT_FALSE(lies(2, 0, 1));
  EXPECT_TRUE(lies(2.5, 0, 1));
}

constexpr double kHalfLevel = 0.5 / 65534 + 1e-7;  // voxels hold 65535 levels; 1e-7: float
constexpr double kLevel = 2 * kHalfLevel;          // what is between two is rounded once more

TEST(Compounding, OfAConstantIsThatConstantWithoutHoles)
{
  const Function constant = [](const Eigen::Vector3d&) { return 0.375; };
  for (const Sweep& sweep : {Parallel(constant), Fan(constant)})
  {
    for (double voxel : {0.0, 0.3, 0.5, 0.9})
    {
      const Compounding volume(sweep, AllFrames(sweep), voxel);
      for (int frame = 0; frame < sweep.NumberOfFrames(); ++frame)
      {
        EXPECT_LT(LargestError(Resliced(volume, sweep.Plane(frame)), sweep.Plane(frame), constant, 1), kHalfLevel);
      }
      const Compounding without(sweep, AllBut(sweep, 3), voxel);
      EXPECT_LT(LargestError(Resliced(without, sweep.Plane(3)), sweep.Plane(3), constant, 4), kHalfLevel);
    }
  }
  const Sweep sweep = Parallel(constant);
  const Compounding volume(sweep, AllFrames(sweep), 0.4);
  EXPECT_LT(LargestError(Resliced(volume, Crossing()), Crossing(), constant), kHalfLevel);
}

TEST(Compounding, OfALinearFunctionIsRightToAVoxel)
{
  for (const Sweep& sweep : {Parallel(Linear), Fan(Linear)})
  {
    for (double voxel : {0.3, 0.5, 0.9})
    {
      const Compounding volume(sweep, AllBut(sweep, 3), voxel);
      const SlicePlane plane = sweep.Plane(3);
      const std::vector<float> image = Resliced(volume, plane);
      EXPECT_LT(LargestError(image, plane, Linear, 4), 2 * voxel * slope.norm());
    }
    // With every frame there, and voxels below the spacing, nothing is shifted to one side.
    const Compounding volume(sweep, AllFrames(sweep), 0.4);
    const SlicePlane plane = sweep.Plane(3);
    const std::vector<float> image = Resliced(volume, plane);
    double bias = 0;
    int count = 0;
    for (int j = 6; j < plane.height - 6; ++j)
    {
      for (int i = 6; i < plane.width - 6; ++i, ++count)
      {
        bias += image[static_cast<std::size_t>(j) * plane.width + i] - Linear(plane.Point(i, j));
      }
    }
    EXPECT_LT(std::abs(bias / count), 0.15 * 0.4 * slope.norm());
  }
}

TEST(Compounding, PutsAPointWhereItIs)
{
  // One bright pixel: its centre of mass in the volume is its place in space.
  const Sweep empty = Parallel([](const Eigen::Vector3d&) { return 0.0; });
  auto pixels = std::make_shared<std::vector<float>>(7 * empty.PixelsPerFrame(), 0.0f);
  (*pixels)[3 * empty.PixelsPerFrame() + 14 * 41 + 25] = 1.0f;
  Sweep sweep = empty;
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  const Eigen::Vector3d place = sweep.Plane(3).Point(25, 14);
  const Compounding volume(sweep, AllFrames(sweep), 0.25);
  double sum = 0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (int k = -20; k <= 20; ++k)
  {
    SlicePlane plane;
    plane.origin = place + Eigen::Vector3d(-2, -2, 0.1 * k);
    plane.columnStep *= 0.1;
    plane.rowStep *= 0.1;
    plane.width = plane.height = 41;
    const std::vector<float> image = Resliced(volume, plane);
    for (int p = 0; p < 41 * 41; ++p)
    {
      sum += image[p];
      moment += image[p] * plane.Point(p % 41, p / 41);
    }
  }
  ASSERT_GT(sum, 0);
  // The oblique grid, and across the planes the neighbours' unequal distances, shift it by less than a voxel.
  const Eigen::Vector3d shift = oblique.transpose() * (moment / sum - place);
  EXPECT_LT(shift.head<2>().norm(), 0.1);
  EXPECT_LT(std::abs(shift[2]), 0.25);
}

TEST(Compounding, FillsTheGapsBetweenPlanes)
{
  std::vector<Eigen::Matrix4d> poses;
  for (double z : {0.0, 3.0, 6.0, 30.0})  // and one beyond a break
  {
    poses.push_back(Pose({0, 0, z}, Eigen::Matrix3d::Identity(), 21, 21));
  }
  const Sweep sweep = MakeSweep(21, 21, poses, [](const Eigen::Vector3d& x) { return 0.2 + 0.01 * x[2]; });
  SlicePlane middle = sweep.Plane(0);
  const auto centre = [&](double voxel, double z)
  {
    middle.origin[2] = z;
    return Resliced(Compounding(sweep, {0, 1, 2, 3}, voxel), middle)[10 * 21 + 10];
  };
  for (double z : {0.5, 1.0, 1.5, 2.5, 5.0})  // layers 0, 6 and 12 are pasted: what lies between them is linear
  {
    EXPECT_NEAR(centre(0.5, z), 0.2 + 0.01 * z, kLevel) << z;
    EXPECT_NEAR(centre(0.25, z), 0.2 + 0.01 * z, kLevel) << z;
  }
  EXPECT_EQ(centre(0.5, 18.0), 0.0f);  // not across the break: 24 mm is more than four median spacings
}

TEST(Compounding, TakesOnlyLitPixels)
{
  // Lit is the left half, with 0.5; whatever a frame has at the right is no tissue.
  Sweep sweep = Parallel([](const Eigen::Vector3d&) { return 0.5; });
  auto pixels = std::make_shared<std::vector<float>>(7 * sweep.PixelsPerFrame(), 0.5f);
  auto mask = std::make_shared<std::vector<std::uint8_t>>(sweep.PixelsPerFrame(), 1);
  for (std::size_t p = 0; p < pixels->size(); ++p)
  {
    if (p % 41 > 20)
    {
      (*pixels)[p] = 0;
      (*mask)[p % sweep.PixelsPerFrame()] = 0;
    }
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  sweep.mask = mask;
  const std::vector<float> image = Resliced(Compounding(sweep, AllFrames(sweep), 0.4), sweep.Plane(3));
  for (std::size_t p = 0; p < image.size(); ++p)
  {
    if ((*mask)[p])
    {
      EXPECT_NEAR(image[p], 0.5, kHalfLevel) << p;
    }
  }
  EXPECT_EQ(image[16 * 41 + 30], 0.0f);
}

TEST(Compounding, ChoosesItsVoxelsByTrainingFrames)
{
  const auto sweepOf = [](double frequency, double heldOut)
  {
    return Parallel(
        [=](const Eigen::Vector3d& x) {
          return std::abs((oblique.transpose() * x)[2] - heldOut) < 1e-3 ? 0.0 : 0.5 + 0.4 * std::sin(frequency * x[0]);
        });
  };
  const Sweep fine = sweepOf(4, -99);
  const std::vector<int> training = AllBut(fine, 3);
  const double chosen = Compounding(fine, training).VoxelSize();
  EXPECT_LT(chosen, 0.5 * 2);  // half a wave has 0.8 mm: larger voxels have none of it
  EXPECT_GE(chosen, 0.5);
  // What a held-out frame shows decides nothing.
  const double z = (oblique.transpose() * fine.Plane(3).origin)[2];
  EXPECT_EQ(Compounding(sweepOf(4, z), training).VoxelSize(), chosen);
}

TEST(Compounding, OfASingleFrameReproducesIt)
{
  const Sweep sweep = Parallel(Linear);
  const Compounding volume(sweep, {2});
  EXPECT_NEAR(volume.VoxelSize(), 0.5, 1e-12);  // no spacing: the pixel size
  EXPECT_LT(LargestError(Resliced(volume, sweep.Plane(2)), sweep.Plane(2), Linear, 1), 1.0 * slope.norm());
}

TEST(Compounding, IsBlackWhereThePlaneMissesTheVolume)
{
  const Sweep sweep = Parallel([](const Eigen::Vector3d&) { return 1.0; });
  const Compounding volume(sweep, AllFrames(sweep));
  SlicePlane plane = sweep.Plane(3);
  plane.origin += Eigen::Vector3d(0, 0, 200);
  EXPECT_EQ(Resliced(volume, plane), std::vector<float>(plane.NumberOfPixels(), 0.0f));
  plane.origin = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(Resliced(volume, plane), std::vector<float>(plane.NumberOfPixels(), 0.0f));
}

TEST(Compounding, KeepsToItsMemory)
{
  const Sweep sweep = Parallel(Linear);
  const std::string message = Message([&] { Compounding(sweep, AllFrames(sweep), 0.01); });
  EXPECT_NE(message.find("0.01"), std::string::npos) << message;
  EXPECT_NE(Message([&] { Compounding(sweep, AllFrames(sweep), 1e-30); }).find("choose larger"), std::string::npos);
  EXPECT_NE(Message([&] { Compounding(sweep, AllFrames(sweep), 0.5, 1000); }).find("1000 are allowed"),
            std::string::npos);
  EXPECT_NE(Message([&] { Compounding(sweep, AllFrames(sweep), -1); }).find("-1"), std::string::npos);
  EXPECT_NE(Message([&] { Compounding(sweep, AllFrames(sweep), std::numeric_limits<double>::quiet_NaN()); }), "");

  // The voxel size for some bytes: they suffice, and hardly smaller voxels would need more.
  for (std::size_t bytes : {std::size_t(40), std::size_t(4000), std::size_t(4400000)})
  {
    const double voxel = Compounding::VoxelSizeForMemory(sweep, AllFrames(sweep), bytes);
    EXPECT_LE(Compounding(sweep, AllFrames(sweep), voxel).MemoryUse(), bytes);
    EXPECT_GT(Compounding(sweep, AllFrames(sweep), voxel * 0.998).MemoryUse(), bytes);
  }
  EXPECT_NE(Message([&] { Compounding::VoxelSizeForMemory(sweep, AllFrames(sweep), 15); }).find("15"),
            std::string::npos);

  // A size of its own choice grows until it fits.
  const Compounding coarse(sweep, AllFrames(sweep), 0, 1000);
  EXPECT_EQ(Message([&] { Compounding(sweep, AllFrames(sweep), coarse.VoxelSize(), 1000); }), "");
  EXPECT_GT(coarse.VoxelSize(), 1.0);
  Sweep strayed = sweep;
  strayed.imageToReference[6](0, 3) += 1e9;
  const double size = Compounding(strayed, AllFrames(strayed), 0, 100000).VoxelSize();
  EXPECT_EQ(Message([&] { Compounding(strayed, AllFrames(strayed), size, 100000); }), "");
}

TEST(Compounding, KeepsToWhatTheFramesHold)
{
  const Sweep sweep = Parallel(Linear);
  const std::size_t most = 512 * 7 * sweep.PixelsPerFrame();  // bytes
  for (const Eigen::Vector3d& away :
       {Eigen::Vector3d(0, 0, 1e4), Eigen::Vector3d(0, 0, 1e8), Eigen::Vector3d(1e6, 1e6, 0)})
  {
    Sweep strayed = sweep;
    strayed.imageToReference[6].block<3, 1>(0, 3) += away;
    EXPECT_LE(Compounding(strayed, AllFrames(strayed)).MemoryUse(), most) << away.transpose();
  }
}

TEST(Compounding, DoesNotDependOnTheNumberOfThreads)
{
  const Sweep sweep = Fan([](const Eigen::Vector3d& x) { return 0.5 + 0.4 * std::sin(7 * x.sum()); }, 81, 65);
  // Large enough for several slabs.
  EXPECT_NE(Message([&] { Compounding(sweep, AllBut(sweep, 3), 0.16, std::size_t(3) << 20); }), "");
  const auto predict = [&]
  {
    const Compounding volume(sweep, AllBut(sweep, 3), 0.16);
    return Resliced(volume, sweep.Plane(3));
  };
  std::vector<float> one;
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    one = predict();
  }
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 5);
  EXPECT_EQ(predict(), one);
}

TEST(Baselines, RefuseTrainingFramesThatAreNone)
{
  const Sweep sweep = Parallel(Linear);
  for (const std::vector<int>& training : {std::vector<int>{}, {0, 7}, {-1, 2}, {2, 1}, {2, 2}})
  {
    EXPECT_THROW(Nearest(sweep, training, sweep.Plane(0)), Error);
    EXPECT_THROW(Average(sweep, training, 3), Error);
    EXPECT_THROW(Interpolated(sweep, training, 3), Error);
    EXPECT_THROW(Interpolated(sweep, training, sweep.Plane(3)), Error);
    EXPECT_THROW(Compounding(sweep, training), Error);
  }
}
