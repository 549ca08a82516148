// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Random numbers against published values and their distributions, transforms against their definition, descents against
// known minima.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Fourier.h"
#include "Core/Numerics/LevenbergMarquardt.h"
#include "Core/Numerics/Random.h"
#include "Core/Numerics/Statistics.h"

using bigus::kPi;
using bigus::RandomNumbers;

namespace
{

template <class Real>
std::vector<std::complex<Real>> RandomSignal(std::size_t n)
{
  RandomNumbers random(n);
  std::vector<std::complex<Real>> signal;
  for (std::size_t j = 0; j < n; ++j)
  {
    const double re = random.Uniform(-1, 1);
    signal.push_back(std::complex<Real>(std::complex<double>(re, random.Uniform(-1, 1))));
  }
  return signal;
}

/// The largest difference between Transform and the sum that defines it, over the root of n: what n terms of random
/// sign add up to.
template <class Real>
double TransformError(int n)
{
  const std::vector<std::complex<Real>> in = RandomSignal<Real>(n);
  std::vector<std::complex<Real>> out(n);
  const bigus::FourierTable<Real> table(n);
  bigus::Fourier<Real>(table).Transform(in.data(), out.data());
  double worst = 0;
  for (std::int64_t k = 0; k < n; ++k)
  {
    std::complex<double> sum = 0;
    for (std::int64_t j = 0; j < n; ++j)
    {
      sum += std::complex<double>(in[j]) * std::polar(1.0, -2 * kPi * static_cast<double>(j * k % n) / n);
    }
    worst = std::max(worst, std::abs(std::complex<double>(out[k]) - sum));
  }
  return worst / std::sqrt(n);
}

}  // namespace

TEST(Numerics, MixGivesThePublishedSequenceOfSplitmix64)
{
  // Of seed 1234567, as printed by the authors' C program.
  const std::uint64_t expected[] = {6457827717110365317ull, 3203168211198807973ull, 9817491932198370423ull,
                                    4593380528125082431ull, 16408922859458223821ull};
  std::uint64_t counter = 1234567;
  for (std::uint64_t bits : expected)
  {
    EXPECT_EQ(bigus::Mix(counter), bits);
    counter += bigus::kCounterStep;
  }
}

TEST(Numerics, UniformNumbersFillTheirRangeEvenly)
{
  RandomNumbers random(1);
  constexpr int kCells = 10, kDraws = 100000;
  std::vector<int> count(kCells);
  for (int k = 0; k < kDraws; ++k)
  {
    const double x = random.Uniform(-2, 3);
    ASSERT_GE(x, -2);
    ASSERT_LT(x, 3);
    ++count[static_cast<int>((x + 2) / 5 * kCells)];
  }
  for (int cell : count)
  {
    EXPECT_NEAR(cell, kDraws / kCells, 5 * std::sqrt(kDraws / kCells));
  }
}

TEST(Numerics, NormalNumbersHaveTheMomentsOfTheirDistribution)
{
  RandomNumbers random(2);
  constexpr int kDraws = 200000;
  double first = 0, second = 0, fourth = 0;
  for (int k = 0; k < kDraws; ++k)
  {
    const double x = random.Normal();
    first += x / kDraws;
    second += x * x / kDraws;
    fourth += x * x * x * x / kDraws;
  }
  // Five standard errors: the variances of x, x^2 and x^4 are 1, 2 and 96.
  EXPECT_NEAR(first, 0, 5 * std::sqrt(1.0 / kDraws));
  EXPECT_NEAR(second, 1, 5 * std::sqrt(2.0 / kDraws));
  EXPECT_NEAR(fourth, 3, 5 * std::sqrt(96.0 / kDraws));
}

TEST(Numerics, SequencesOfNeighbouringSeedsShareNoNumber)
{
  RandomNumbers one(1), two(2);
  std::vector<std::uint64_t> first, second;
  for (int k = 0; k < 100; ++k)
  {
    first.push_back(one.Bits());
    second.push_back(two.Bits());
  }
  for (std::uint64_t bits : first)
  {
    EXPECT_EQ(std::count(second.begin(), second.end(), bits), 0);
  }
}

TEST(Numerics, TransformsOfAnyLengthAreTheirDefinition)
{
  // Of one number, of small factors, of a prime that OpenCV does itself and of those that take the detour.
  for (int n : {1, 2, 3, 32, 45, 61, 67, 2 * 67, 127, 480, 509})
  {
    EXPECT_LT(TransformError<double>(n), 1e-12) << n;
    EXPECT_LT(TransformError<float>(n), 2e-5) << n;
  }
}

TEST(Numerics, ATransformInTwoDimensionsIsOneOfRowsAndThenOfColumns)
{
  constexpr int kWidth = 12, kHeight = 10;
  const auto in = RandomSignal<double>(kWidth * kHeight);
  std::vector<std::complex<double>> out(in.size());
  bigus::FourierTransform(in.data(), out.data(), kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v)
  {
    for (int u = 0; u < kWidth; ++u)
    {
      std::complex<double> sum = 0;
      for (int y = 0; y < kHeight; ++y)
      {
        for (int x = 0; x < kWidth; ++x)
        {
          const double turns = static_cast<double>(u * x) / kWidth + static_cast<double>(v * y) / kHeight;
          sum += in[y * kWidth + x] * std::polar(1.0, -2 * kPi * turns);
        }
      }
      EXPECT_LT(std::abs(out[v * kWidth + u] - sum), 1e-12) << u << ", " << v;
    }
  }
}

TEST(Numerics, StatisticsOfAFewNumbers)
{
  const std::vector<double> values = {1, 2, 4, 9};
  EXPECT_EQ(bigus::SumInOrder(values), 16);
  EXPECT_EQ(bigus::Mean(values), 4);
  EXPECT_EQ(bigus::MeanSquare(values, 4), (9 + 4 + 0 + 25) / 4.0);
  EXPECT_EQ(bigus::Quantile(values, 0), 1);
  EXPECT_EQ(bigus::Quantile(values, 0.5), 3);
  EXPECT_EQ(bigus::Quantile(values, 1), 9);
  EXPECT_EQ(bigus::Quantile({5}, 0.3), 5);
  EXPECT_EQ(bigus::RatioOrInfinity(3, 2), 1.5);
  EXPECT_EQ(bigus::RatioOrInfinity(3, 0), std::numeric_limits<double>::infinity());
  EXPECT_EQ(bigus::RatioOrInfinity(0, 0), 0);
}

namespace
{

/// Rosenbrock's valley: the residuals 10 (y - x^2) and 1 - x vanish at (1, 1). x may be bounded from above.
struct Valley
{
  struct State
  {
    double cost;
  };
  double highest = 10;

  static Eigen::Vector2d Residuals(const Eigen::Vector2d& q) { return {10 * (q[1] - q[0] * q[0]), 1 - q[0]}; }
  State Evaluate(const Eigen::Vector2d& q) const { return {Residuals(q).squaredNorm()}; }
  std::pair<Eigen::Matrix2d, Eigen::Vector2d> Linearise(const Eigen::Vector2d& q, const State&) const
  {
    Eigen::Matrix2d jacobian;
    jacobian << -20 * q[0], 10, -1, 0;
    return {jacobian.transpose() * jacobian, jacobian.transpose() * Residuals(q)};
  }
  Eigen::Vector2d Bounded(const Eigen::Vector2d& q) const { return {std::min(q[0], highest), q[1]}; }
  bool IsConverged(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double, double) const
  {
    return (to - from).norm() < 1e-12;
  }
};

}  // namespace

TEST(Numerics, LevenbergMarquardtFollowsACurvedValleyToItsMinimum)
{
  const Valley valley;
  Eigen::Vector2d q(-1.2, 1);
  Valley::State state = valley.Evaluate(q);
  const int iterations = bigus::MinimiseByLevenbergMarquardt(valley, {}, q, state);
  EXPECT_LT((q - Eigen::Vector2d(1, 1)).norm(), 1e-9);
  EXPECT_LT(state.cost, 1e-18);
  EXPECT_LT(iterations, 60);
}

TEST(Numerics, LevenbergMarquardtStaysInsideBoundsAndNeverRaisesTheCost)
{
  Valley valley;
  valley.highest = 0.5;
  Eigen::Vector2d q(-1.2, 1);
  Valley::State state = valley.Evaluate(q);
  const double before = state.cost;
  bigus::LevenbergMarquardtOptions options;
  for (options.iterations = 0; options.iterations < 60; ++options.iterations)
  {
    Eigen::Vector2d at(-1.2, 1);
    Valley::State there = valley.Evaluate(at);
    EXPECT_LE(bigus::MinimiseByLevenbergMarquardt(valley, options, at, there), options.iterations);
    EXPECT_LE(there.cost, state.cost);
    EXPECT_EQ(there.cost, valley.Evaluate(at).cost);
    EXPECT_LE(at[0], 0.5);
    q = at;
    state = there;
  }
  EXPECT_LT(state.cost, 0.5 * before);
  EXPECT_NEAR(q[0], 0.5, 1e-6);  // the valley's floor rises towards smaller x
}
