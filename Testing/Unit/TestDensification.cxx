// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>

#include "Core/Training/Densification.h"
#include "Support/Fields.h"

namespace
{

bigus::GaussianField Field(std::size_t count, double scale)
{
  bigus::test::Random random(9);
  bigus::GaussianField field = bigus::test::RandomField(random, count, 10, scale, 2 * scale, 0.3);
  for (double& r : field.reflectivities)
  {
    r = r < 0 ? r - 0.1 : r + 0.1;
  }
  return field;
}

bigus::Engine::Scores Scores(std::size_t count)
{
  bigus::Engine::Scores scores;
  for (std::size_t i = 0; i < count; ++i)
  {
    scores.error.push_back(static_cast<double>(i));
    scores.descent.push_back({0.1, 1.0, -0.3});
    scores.visits.push_back(1);
  }
  return scores;
}

/// Zeroth to second moments of sum r G: mass, centre and covariance.
struct MassMoments
{
  double mass = 0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
};

MassMoments MomentsOf(const bigus::GaussianField& field)
{
  MassMoments m;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    const Eigen::Matrix3d r = bigus::RotationMatrix(field.rotations[i]);
    const Eigen::Matrix3d sigma = r * field.scales[i].cwiseAbs2().asDiagonal() * r.transpose();
    const double mass = field.reflectivities[i] * field.scales[i].prod();
    m.mass += mass;
    m.first += mass * field.means[i];
    m.second += mass * (sigma + field.means[i] * field.means[i].transpose());
  }
  return m;
}

TEST(Densification, ASplitKeepsMassCentreAndCovariance)
{
  const bigus::GaussianField field = Field(1, 3.0);  // large beside a pixel of 0.3 mm
  bigus::DensificationOptions options;
  options.percentile = 0;
  options.cap = 10;
  bigus::Engine::Scores scores = Scores(1);
  scores.error[0] = 1;
  const bigus::Restructured out = bigus::Densify(field, scores, 0.3, options);
  ASSERT_EQ(out.field.Size(), 2u);
  EXPECT_EQ(out.parents, (std::vector<int>{-1, -1}));
  EXPECT_GT((out.field.means[0] - out.field.means[1]).norm(), 1.0);
  const MassMoments before = MomentsOf(field), after = MomentsOf(out.field);
  EXPECT_NEAR(after.mass, before.mass, 1e-12 * std::abs(before.mass));
  EXPECT_LT((after.first - before.first).norm(), 1e-12 * before.first.norm());
  EXPECT_LT((after.second - before.second).norm(), 1e-12 * before.second.norm());
}

TEST(Densification, ACloneSharesItsReflectivity)
{
  const bigus::GaussianField field = Field(1, 0.2);  // at most 0.4 mm, below two pixels of 0.3 mm
  bigus::DensificationOptions options;
  options.percentile = 0;
  options.cap = 10;
  bigus::Engine::Scores scores = Scores(1);
  scores.error[0] = 1;
  const bigus::Restructured out = bigus::Densify(field, scores, 0.3, options);
  ASSERT_EQ(out.field.Size(), 2u);
  EXPECT_EQ(out.parents, (std::vector<int>{0, -1}));
  EXPECT_DOUBLE_EQ(out.field.reflectivities[0] + out.field.reflectivities[1], field.reflectivities[0]);
  // The clone lies down the descent direction, well inside its twin.
  const Eigen::Vector3d step = out.field.means[1] - out.field.means[0];
  EXPECT_GT(step.dot(scores.descent[0]), 0);
  EXPECT_LT(step.norm(), 0.3 * field.scales[0].maxCoeff());
}

TEST(Densification, TakesTheWorstAboveThePercentileAndStopsAtTheCap)
{
  const bigus::GaussianField field = Field(100, 3.0);
  bigus::DensificationOptions options;
  options.percentile = 90;
  options.cap = 1000;
  const bigus::Restructured out = bigus::Densify(field, Scores(100), 0.3, options);
  EXPECT_EQ(std::count(out.parents.begin(), out.parents.end(), -1), 20);  // splits
  EXPECT_EQ(out.field.Size(), 110u);
  for (int worst = 90; worst < 100; ++worst)
  {
    EXPECT_EQ(std::count(out.parents.begin(), out.parents.end(), worst), 0) << worst;
  }
  options.cap = 103;
  EXPECT_EQ(bigus::Densify(field, Scores(100), 0.3, options).field.Size(), 103u);
  options.cap = 50;
  EXPECT_EQ(bigus::Densify(field, Scores(100), 0.3, options).field.Size(), 100u);
}

TEST(Densification, ErrorCountsPerFrameThatSawIt)
{
  const bigus::GaussianField field = Field(2, 3.0);
  bigus::Engine::Scores scores = Scores(2);
  scores.error = {3.0, 4.0};
  scores.visits = {1, 100};
  bigus::DensificationOptions options;
  options.percentile = 50;
  options.cap = 10;
  const bigus::Restructured out = bigus::Densify(field, scores, 0.3, options);
  EXPECT_EQ(out.parents, (std::vector<int>{-1, -1, 1}));
}

TEST(Densification, PrunesTheUnseenAndTheNegligible)
{
  bigus::GaussianField field = Field(10, 1.0);
  bigus::Engine::Scores scores = Scores(10);
  scores.visits[3] = 0;
  field.reflectivities[7] = 1e-6;
  bigus::DensificationOptions options;
  const bigus::Restructured out = bigus::Densify(field, scores, 0.3, options);
  EXPECT_EQ(out.parents, (std::vector<int>{0, 1, 2, 4, 5, 6, 8, 9}));
}

}  // namespace
