// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The thickness of planes in every direction, and what of a sweep's geometry it rests on.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Beam.h"
#include "Core/Model/SweepGeometry.h"
#include "Support/Fields.h"
#include "Support/Random.h"
#include "Support/Sweeps.h"

namespace bigus
{
namespace
{

Eigen::Vector3d TurnedNormal(double degrees)
{
  return Eigen::AngleAxisd(degrees * EIGEN_PI / 180, Eigen::Vector3d::UnitY()) * Eigen::Vector3d::UnitZ();
}

TEST(Beam, WithoutAProbeEveryPlaneIsAsThickAsThoseTrainedOn)
{
  Beam beam;
  beam.elevationSigma = 0.3;
  beam.trainedNormals = {Eigen::Vector3d::UnitZ()};
  EXPECT_DOUBLE_EQ(beam.Variance(TurnedNormal(90)), 0.09);
  beam.probeElevationSigma = 0.2;  // thinner than the planes trained on
  EXPECT_DOUBLE_EQ(beam.Variance(TurnedNormal(90)), 0.09);
  beam.probeElevationSigma = 0.8;
  beam.trainedNormals.clear();
  EXPECT_DOUBLE_EQ(beam.Variance(TurnedNormal(90)), 0.09);
}

// The field of a point holds a Gaussian of variance sigma_p^2 - sigma_t^2 along the trained normal e. What a plane with
// the normal n lacks of sigma_p^2 in its own direction is the rest of n^T (that tensor) n.
TEST(Beam, APlaneGetsWhatTheFieldLacksOfTheProbesThickness)
{
  Beam beam;
  beam.elevationSigma = 0.3;
  beam.probeElevationSigma = 0.8;
  beam.trainedNormals = {TurnedNormal(0)};
  const Eigen::Matrix3d held = (0.64 - 0.09) * TurnedNormal(0) * TurnedNormal(0).transpose();
  for (const double degrees : {0.0, 20.0, 45.0, 90.0, 135.0, 180.0})
  {
    const Eigen::Vector3d n = TurnedNormal(degrees);
    EXPECT_NEAR(beam.Variance(n), 0.64 - n.dot(held * n), 1e-12) << degrees;
  }
  beam.trainedNormals.push_back(TurnedNormal(90));
  EXPECT_NEAR(beam.Variance(TurnedNormal(90)), 0.09, 1e-12);
  EXPECT_NEAR(beam.Variance(TurnedNormal(45)), 0.09 + 0.55 / 2, 1e-12);
}

TEST(Beam, EnginesRenderEveryPlaneAtItsThickness)
{
  test::Random random(11);
  GaussianField field = test::RandomField(random, 200, 6, 0.3, 1.5, 0.2);
  field.beam.probeElevationSigma = 1.1;
  field.beam.trainedNormals = {Eigen::Vector3d::UnitZ(), TurnedNormal(60)};
  for (const char* name : {"reference", "cpu", "cpu-double"})
  {
    const auto engine = Engine::Create(name), plain = Engine::Create("reference");
    engine->SetField(field);
    for (int k = 0; k < 4; ++k)
    {
      const SlicePlane plane = test::RandomPlane(random, {0, 0, 0}, 0.4, 32, 24);
      GaussianField same = field;
      same.beam = Beam{std::sqrt(field.beam.Variance(plane.Normal()))};
      plain->SetField(same);
      std::vector<float> image(32 * 24), expected(image.size());
      engine->Render(plane, ViewOutput::Intensity, image.data());
      plain->Render(plane, ViewOutput::Intensity, expected.data());
      for (std::size_t p = 0; p < image.size(); ++p)
      {
        // The engine's tolerance, 1e-4, and its rounding in float.
        ASSERT_NEAR(image[p], expected[p], std::string(name) == "reference" ? 1e-6 : 2e-4) << name << ' ' << k;
      }
    }
  }
}

/// Frames of 64 x 64 pixels of 0.5 mm, `spacing` mm apart along z.
std::shared_ptr<Sweep> Parallel(int frames, double spacing)
{
  return test::BlackSweep(frames, 64, 64, 0.5, spacing);
}

std::vector<int> All(const Sweep& sweep)
{
  std::vector<int> all;
  for (int f = 0; f < sweep.NumberOfFrames(); ++f)
  {
    all.push_back(f);
  }
  return all;
}

/// The sweep's first frame turned about an axis through its middle, so many degrees a frame.
std::shared_ptr<Sweep> Turning(int frames, double degrees, const Eigen::Vector3d& axis)
{
  const auto sweep = Parallel(frames, 0);
  const Eigen::Vector3d middle = sweep->Plane(0).Point(31.5, 31.5);
  for (int f = 0; f < frames; ++f)
  {
    const Eigen::Affine3d turn = Eigen::Translation3d(middle) * Eigen::AngleAxisd(f * degrees * EIGEN_PI / 180, axis) *
                                 Eigen::Translation3d(-middle);
    sweep->imageToReference[f] = turn.matrix() * sweep->imageToReference[0];
  }
  return sweep;
}

TEST(SweepGeometry, DistinctNormalsStandForAllWithinFiveDegrees)
{
  const auto parallel = Parallel(20, 0.4);
  EXPECT_EQ(DistinctNormals(*parallel, All(*parallel)).size(), 1u);
  const auto turning = Turning(41, 1, Eigen::Vector3d::UnitX());  // 0 to 40 degrees
  const auto normals = DistinctNormals(*turning, All(*turning));
  EXPECT_GE(normals.size(), 7u);
  EXPECT_LE(normals.size(), 9u);
  for (int f = 0; f < 41; ++f)
  {
    double nearest = 0;
    for (const Eigen::Vector3d& normal : normals)
    {
      nearest = std::max(nearest, std::abs(normal.dot(turning->Plane(f).Normal())));
    }
    EXPECT_GE(nearest, std::cos(5.0 * EIGEN_PI / 180) - 1e-9) << f;
  }
}

TEST(SweepGeometry, OnlyPlanesExactlyAboveOneAnotherAreAVolume)
{
  const auto volume = Parallel(20, 0.4);
  EXPECT_TRUE(IsVolume(*volume, All(*volume)));
  EXPECT_TRUE(IsVolume(*volume, {0, 1, 3, 4, 6, 9}));  // some held out
  EXPECT_FALSE(IsVolume(*volume, {0, 1}));
  const auto shifted = Parallel(20, 0.4);
  shifted->imageToReference[7](0, 3) += 0.01;
  EXPECT_FALSE(IsVolume(*shifted, All(*shifted)));
  const auto missing = Parallel(20, 0.4);  // slices that are not in the sweep at all
  for (int f = 7; f < 20; ++f)
  {
    missing->imageToReference[f](2, 3) += 0.4 * (1 + f % 3);
  }
  EXPECT_TRUE(IsVolume(*missing, All(*missing)));
  const auto rounded = Parallel(20, 0.4);  // as text with five digits leaves poses
  for (int f = 0; f < 20; ++f)
  {
    rounded->imageToReference[f](0, 3) += f % 2 ? 1e-5 : -1e-5;
  }
  EXPECT_TRUE(IsVolume(*rounded, All(*rounded)));
  const auto tilted = Turning(20, 0.01, Eigen::Vector3d::UnitX());
  EXPECT_FALSE(IsVolume(*tilted, All(*tilted)));
}

TEST(SweepGeometry, FramesCrossWhereTheyMeetAtALargeAngle)
{
  const auto parallel = Parallel(20, 0.4);
  EXPECT_FALSE(FramesCross(*parallel, All(*parallel)));
  const auto narrow = Turning(20, 1, Eigen::Vector3d::UnitX());  // meet, at 19 degrees and less
  EXPECT_FALSE(FramesCross(*narrow, All(*narrow)));
  const auto wide = Turning(20, 9, Eigen::Vector3d::UnitY());
  EXPECT_TRUE(FramesCross(*wide, All(*wide)));
  // At right angles, but beside each other: a fan seen from the outside of a curve.
  const auto apart = Turning(20, 9, Eigen::Vector3d::UnitY());
  for (int f = 0; f < 20; ++f)
  {
    apart->imageToReference[f].block<3, 1>(0, 3) += 100 * f * apart->Plane(f).Normal();
  }
  EXPECT_FALSE(FramesCross(*apart, All(*apart)));
}

}  // namespace
}  // namespace bigus
