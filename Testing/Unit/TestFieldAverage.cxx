// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The mean of fields is nearer to what they jitter about than any of them.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>

#include "Core/Model/GaussianField.h"
#include "Core/Training/FieldAverage.h"
#include "Support/Fields.h"
#include "Support/Random.h"

namespace
{

using bigus::FieldAverage;
using bigus::GaussianField;
using bigus::test::Random;

constexpr int kFields = 400;
constexpr double kJitter = 0.02;

/// Every number displaced evenly within kJitter, places in mm, scales and r as shares, rotations in radian.
GaussianField Jittered(const GaussianField& field, Random& random)
{
  GaussianField moved = field;
  const auto any = [&random] { return random.Uniform(-kJitter, kJitter); };
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    moved.means[i] += Eigen::Vector3d(any(), any(), any());
    moved.scales[i] = moved.scales[i].cwiseProduct(Eigen::Vector3d(1 + any(), 1 + any(), 1 + any()));
    moved.reflectivities[i] *= 1 + any();
    const Eigen::Vector4d& q = field.rotations[i];
    const Eigen::Quaterniond turned = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized() *
                                      Eigen::Quaterniond(1, any() / 2, any() / 2, any() / 2).normalized();
    const double sign = random.Uniform(-1, 1) < 0 ? -1 : 1;  // the same rotation
    moved.rotations[i] = sign * Eigen::Vector4d(turned.w(), turned.x(), turned.y(), turned.z());
  }
  return moved;
}

TEST(FieldAverage, ComesNearTheMiddle)
{
  Random random(7);
  const GaussianField middle = bigus::test::RandomField(random, 50, 5.0, 0.2, 1.0, 0.1);
  FieldAverage average;
  for (int k = 0; k < kFields; ++k)
  {
    average.Add(Jittered(middle, random));
  }
  EXPECT_EQ(average.count, kFields);
  average.mean.Validate();
  // A number that is even within +-j has the standard deviation j / sqrt(3), and its mean over n that of j / sqrt(3 n).
  // Of 500 numbers none is five standard deviations off. A mean of rotations is short of second order by j^2.
  const double bound = 5 * kJitter / std::sqrt(3.0 * kFields);
  for (std::size_t i = 0; i < middle.Size(); ++i)
  {
    EXPECT_LT((average.mean.means[i] - middle.means[i]).cwiseAbs().maxCoeff(), bound);
    EXPECT_LT((average.mean.scales[i].cwiseQuotient(middle.scales[i]).array() - 1).abs().maxCoeff(), bound);
    EXPECT_LT(std::abs(average.mean.reflectivities[i] / middle.reflectivities[i] - 1), bound);
    const Eigen::Matrix3d turn =
        bigus::RotationMatrix(average.mean.rotations[i]).transpose() * bigus::RotationMatrix(middle.rotations[i]);
    EXPECT_LT(Eigen::AngleAxisd(turn).angle(), std::sqrt(3.0) * bound + kJitter * kJitter);
  }
}

}  // namespace
