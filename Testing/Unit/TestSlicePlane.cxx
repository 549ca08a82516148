// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// SlicePlane: the map from pixels to millimetres, its inverse, and what is refused.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "Core/Model/Error.h"
#include "Core/Model/SlicePlane.h"
#include "Support/Errors.h"
#include "Support/Random.h"

using bigus::Error;
using bigus::MakeThirdAxis;
using bigus::SlicePlane;
using bigus::test::Message;
using bigus::test::Random;

namespace
{

/// Any steps, also far from orthogonal, but not near parallel.
SlicePlane RandomPlane(Random& random)
{
  SlicePlane plane;
  do
  {
    plane.columnStep = random.Vector(1);
    plane.rowStep = random.Vector(1);
  } while (plane.columnStep.cross(plane.rowStep).norm() < 0.05);
  plane.origin = 100 * random.Vector(1);
  plane.width = random.Integer(1, 900);
  plane.height = random.Integer(1, 900);
  return plane;
}

}  // namespace

TEST(SlicePlane, ReadsATrackedSequencesMatrix)
{
  Eigen::Matrix4d m;
  m << 0.3, 0.0, 5.0, 10, 0.0, 0.2, 6.0, 20, 0.0, 0.0, 7.0, 30, 0, 0, 0, 1;
  const SlicePlane plane = SlicePlane::FromImageToReference(m, 640, 480);
  EXPECT_EQ(plane.width, 640);
  EXPECT_EQ(plane.height, 480);
  EXPECT_EQ(plane.NumberOfPixels(), 640u * 480u);
  // The third column does not matter: images are at k = 0.
  EXPECT_LT((plane.Point(2, 3) - Eigen::Vector3d(10.6, 20.6, 30)).norm(), 1e-12);
  EXPECT_LT((plane.Normal() - Eigen::Vector3d::UnitZ()).norm(), 1e-15);
  EXPECT_NEAR(plane.PixelSize(), std::sqrt(0.06), 1e-15);
}

TEST(SlicePlane, AThirdAxisIsMadeWhereThereIsNone)
{
  Random random(4);
  for (int k = 0; k < 50; ++k)
  {
    const Eigen::Matrix4d good = RandomPlane(random).ImageToReference();
    Eigen::Matrix4d kept = good, zero = good, flat = good, turned = good, left = good;
    kept.col(2) *= 3;
    zero.col(2).setZero();
    flat.col(2) = good.col(0);
    turned.col(2) *= -3;
    left.col(2) *= -1;
    const Eigen::Matrix4d given = kept;
    EXPECT_FALSE(MakeThirdAxis(kept, false));
    EXPECT_EQ(kept, given);
    EXPECT_FALSE(MakeThirdAxis(left, true));
    for (Eigen::Matrix4d* pose : {&zero, &flat, &turned})
    {
      EXPECT_TRUE(MakeThirdAxis(*pose, false));
      EXPECT_LT((*pose - good).norm(), 1e-12);
    }
  }
}

TEST(SlicePlane, PointsAgreeWithTheMatrix)
{
  Random random(1);
  for (int k = 0; k < 200; ++k)
  {
    const SlicePlane plane = RandomPlane(random);
    const Eigen::Matrix4d m = plane.ImageToReference();
    const double i = 500 * random.Uniform(-1, 1), j = 500 * random.Uniform(-1, 1), z = 5 * random.Uniform(-1, 1);
    const Eigen::Vector4d expected = m * Eigen::Vector4d(i, j, z, 1);
    EXPECT_LT((plane.Point(i, j, z) - expected.head<3>()).norm(), 1e-10);
    EXPECT_EQ(expected[3], 1.0);
    EXPECT_GT(m.determinant(), 0);

    const SlicePlane back = SlicePlane::FromImageToReference(m, plane.width, plane.height);
    EXPECT_EQ(back.origin, plane.origin);
    EXPECT_EQ(back.columnStep, plane.columnStep);
    EXPECT_EQ(back.rowStep, plane.rowStep);
  }
}

TEST(SlicePlane, WorldToSliceInvertsPoint)
{
  Random random(2);
  for (int k = 0; k < 200; ++k)
  {
    const SlicePlane plane = RandomPlane(random);
    const Eigen::Vector3d ijz(300 * random.Uniform(-1, 1), 300 * random.Uniform(-1, 1), 20 * random.Uniform(-1, 1));
    const Eigen::Vector3d found = plane.WorldToSlice() * (plane.Point(ijz[0], ijz[1], ijz[2]) - plane.origin);
    EXPECT_LT((found - ijz).norm(), 1e-8);
  }
}

TEST(SlicePlane, WorldToSliceOfOrthogonalStepsIsTheModelsT)
{
  SlicePlane plane;
  const Eigen::Matrix3d r = Eigen::AngleAxisd(1.1, Eigen::Vector3d(3, -1, 2).normalized()).toRotationMatrix();
  plane.columnStep = 0.3 * r.col(0);
  plane.rowStep = 0.2 * r.col(1);
  Eigen::Matrix3d t;
  t.row(0) = plane.columnStep.transpose() / plane.columnStep.squaredNorm();
  t.row(1) = plane.rowStep.transpose() / plane.rowStep.squaredNorm();
  t.row(2) = r.col(2).transpose();
  EXPECT_LT((plane.WorldToSlice() - t).norm(), 1e-12);
}

TEST(SlicePlane, NormalIsUnitAndPerpendicular)
{
  Random random(3);
  for (int k = 0; k < 100; ++k)
  {
    const SlicePlane plane = RandomPlane(random);
    EXPECT_NEAR(plane.Normal().norm(), 1, 1e-14);
    EXPECT_NEAR(plane.Normal().dot(plane.columnStep), 0, 1e-14);
    EXPECT_NEAR(plane.Normal().dot(plane.rowStep), 0, 1e-14);
  }
}

TEST(SlicePlane, ValidationRefusesWhatHasNoPlane)
{
  const SlicePlane good;
  EXPECT_NO_THROW(good.Validate("view"));
  const auto message = [&](auto change) -> std::string
  {
    SlicePlane plane = good;
    change(plane);
    return Message([&] { plane.Validate("frame 12"); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const auto refused = [](const std::string& text, const std::string& word)
  { return text.find("frame 12") == 0 && text.find(word) != std::string::npos; };
  EXPECT_TRUE(refused(message([](SlicePlane& p) { p.width = 0; }), "0 x 1"));
  EXPECT_TRUE(refused(message([](SlicePlane& p) { p.height = -1; }), "1 x -1"));
  EXPECT_TRUE(refused(message([&](SlicePlane& p) { p.origin[1] = nan; }), "not finite"));
  EXPECT_TRUE(refused(message([&](SlicePlane& p) { p.columnStep[2] = infinity; }), "not finite"));
  EXPECT_TRUE(refused(message([&](SlicePlane& p) { p.rowStep[0] = nan; }), "not finite"));
  EXPECT_TRUE(refused(message([](SlicePlane& p) { p.columnStep.setZero(); }), "singular"));
  EXPECT_TRUE(refused(message([](SlicePlane& p) { p.rowStep *= 1e-7; }), "mm"));
  EXPECT_TRUE(refused(message([](SlicePlane& p) { p.rowStep *= 1e7; }), "mm"));
  EXPECT_TRUE(refused(message([](SlicePlane& p) { p.rowStep = -3 * p.columnStep; }), "parallel"));
  // Reflected steps are a plane like any other: the beam does not see the sign of the normal.
  EXPECT_EQ(message([](SlicePlane& p) { p.rowStep *= -1; }), "");
  EXPECT_EQ(message([](SlicePlane& p) { p.rowStep += 5 * p.columnStep; }), "");
}
