// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields: what is refused and how it is said, and quaternions.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Model/GaussianField.h"
#include "Support/Errors.h"
#include "Support/Random.h"

using bigus::Error;
using bigus::GaussianField;

namespace
{

/// What Validate says of a sound field of four Gaussians after `change`; "" when it finds nothing wrong.
std::string Complaint(const std::function<void(GaussianField&)>& change)
{
  GaussianField field;
  field.Resize(4);
  change(field);
  return bigus::test::Message([&] { field.Validate(); });
}

bool Names(const std::string& complaint, const std::string& word)
{
  return complaint.find(word) != std::string::npos;
}

const double notANumber = std::numeric_limits<double>::quiet_NaN();
const double infinity = std::numeric_limits<double>::infinity();

}  // namespace

TEST(GaussianField, ResizingAddsUnitGaussiansOfNoReflectivity)
{
  GaussianField field;
  EXPECT_EQ(field.Size(), 0u);
  EXPECT_NO_THROW(field.Validate());
  field.Resize(2);
  field.means[1] = Eigen::Vector3d(1, 2, 3);
  field.Resize(3);
  EXPECT_EQ(field.Size(), 3u);
  EXPECT_EQ(field.means[1], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(field.means[2], Eigen::Vector3d::Zero());
  EXPECT_EQ(field.scales[2], Eigen::Vector3d::Ones());
  EXPECT_EQ(field.rotations[2], Eigen::Vector4d(1, 0, 0, 0));
  EXPECT_EQ(field.reflectivities[2], 0);
  EXPECT_NO_THROW(field.Validate());
}

TEST(GaussianField, SoundFieldsPass)
{
  EXPECT_EQ(Complaint([](GaussianField&) {}), "");
  EXPECT_EQ(Complaint([](GaussianField& f) { f.reflectivities[1] = -5; }), "");
  EXPECT_EQ(Complaint([](GaussianField& f) { f.rotations[1] = Eigen::Vector4d(0, -3e-5, 0, 2e-5); }), "");
  EXPECT_EQ(Complaint([](GaussianField& f) { f.rotations[1] = Eigen::Vector4d(1e-200, 0, 0, 0); }), "");
  EXPECT_EQ(Complaint([](GaussianField& f) { f.scales[1] = Eigen::Vector3d(1e-9, 1e9, 1); }), "");
  EXPECT_EQ(Complaint([](GaussianField& f) { f.beam.elevationSigma = 0; }), "");
}

TEST(GaussianField, ScalesWhoseSquaresLeaveTheRangeOfDoublesAreRefused)
{
  for (const double bad : {1e-300, 1e-13, 1e13, 1e300})
  {
    EXPECT_TRUE(Names(Complaint([bad](GaussianField& f) { f.scales[2][1] = bad; }), "Scale[2]")) << bad;
  }
}

TEST(GaussianField, ArraysOfDifferentLengthAreRefused)
{
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.means.pop_back(); }), "3 means"));
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.scales.pop_back(); }), "3 scales"));
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.rotations.pop_back(); }), "3 rotations"));
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.reflectivities.push_back(1); }), "5 reflectivities"));
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.means.clear(); }), "0 means"));
}

TEST(GaussianField, ValuesThatAreNotFiniteAreRefusedByNameAndIndex)
{
  for (double bad : {notANumber, infinity, -infinity})
  {
    for (int c = 0; c < 3; ++c)
    {
      EXPECT_TRUE(Names(Complaint([&](GaussianField& f) { f.means[2][c] = bad; }), "Points[2]"));
      EXPECT_TRUE(Names(Complaint([&](GaussianField& f) { f.scales[3][c] = bad; }), "Scale[3]"));
      EXPECT_TRUE(Names(Complaint([&](GaussianField& f) { f.rotations[0][c + 1] = bad; }), "Rotation[0]"));
    }
    EXPECT_TRUE(Names(Complaint([&](GaussianField& f) { f.reflectivities[1] = bad; }), "Reflectivity[1]"));
    EXPECT_TRUE(Names(Complaint([&](GaussianField& f) { f.transfer.gamma = bad; }), "gamma"));
    EXPECT_TRUE(Names(Complaint([&](GaussianField& f) { f.beam.elevationSigma = bad; }), "elevation sigma"));
  }
}

TEST(GaussianField, ValuesOutOfRangeAreRefusedByNameAndIndex)
{
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.scales[1][2] = 0; }), "Scale[1]"));
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.scales[1][0] = -2.5; }), "-2.5"));
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.rotations[3].setZero(); }), "Rotation[3]"));
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.transfer.gamma = 0; }), "gamma"));
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.transfer.gamma = -1; }), "gamma"));
  EXPECT_TRUE(Names(Complaint([](GaussianField& f) { f.beam.elevationSigma = -0.1; }), "elevation sigma"));
}

TEST(GaussianField, ABadGammaIsRefusedEvenWhenThereIsNoGaussian)
{
  EXPECT_TRUE(Names(Complaint(
                        [](GaussianField& f)
                        {
                          f.Resize(0);
                          f.transfer.gamma = notANumber;
                        }),
                    "gamma"));
}

TEST(Rotation, OfAQuaternionIsTheTurnItSays)
{
  const double half = 0.5 * 0.3;
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -2) / 3;
  const Eigen::Vector4d q(std::cos(half), axis[0] * std::sin(half), axis[1] * std::sin(half), axis[2] * std::sin(half));
  const Eigen::Matrix3d expected = Eigen::AngleAxisd(0.3, axis).toRotationMatrix();
  for (double length : {1.0, 1e-160, 3e5, -2.0, 1e160})
  {
    EXPECT_LT((bigus::RotationMatrix(length * q) - expected).norm(), 1e-14) << length;
  }
}

TEST(Rotation, AndBackKeepsTheMatrix)
{
  bigus::test::Random random(1);
  for (int k = 0; k < 500; ++k)
  {
    const Eigen::Matrix3d r = bigus::RotationMatrix(random.UnitQuaternion());
    EXPECT_LT((r * r.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
    EXPECT_NEAR(r.determinant(), 1, 1e-14);
    const Eigen::Vector4d q = bigus::Quaternion(r);
    EXPECT_GE(q[0], 0);
    EXPECT_NEAR(q.norm(), 1, 1e-14);
    EXPECT_LT((bigus::RotationMatrix(q) - r).norm(), 1e-14);
  }
  // Half turns, where w is 0.
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 0, 1)})
  {
    const Eigen::Matrix3d r = 2 * axis * axis.transpose() - Eigen::Matrix3d::Identity();
    EXPECT_LT((bigus::RotationMatrix(bigus::Quaternion(r)) - r).norm(), 1e-14);
  }
}
