// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sums and what follows from them. All add in the order of the elements and in double, so that a result does not depend
// on which thread made which part.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace bigus
{

template <class Real>
double SumInOrder(const std::vector<Real>& values)
{
  double sum = 0;
  for (Real value : values)
  {
    sum += value;
  }
  return sum;
}

/// Not a number for no values.
inline double Mean(const std::vector<double>& values)
{
  return SumInOrder(values) / static_cast<double>(values.size());
}

/// Mean of (value - centre)^2: the variance when `centre` is the mean.
inline double MeanSquare(const std::vector<double>& values, double centre)
{
  double squares = 0;
  for (double value : values)
  {
    squares += (value - centre) * (value - centre);
  }
  return squares / static_cast<double>(values.size());
}

/// Population standard deviation; 0 where the mean is not finite, as of PSNRs where a picture was met exactly.
inline double Deviation(const std::vector<double>& values)
{
  const double mean = Mean(values);
  return std::isfinite(mean) ? std::sqrt(MeanSquare(values, mean)) : 0;
}

/// numerator / denominator of numbers that are not negative; where the denominator is 0, infinite, or 0 for 0 / 0.
inline double RatioOrInfinity(double numerator, double denominator)
{
  if (denominator > 0)
  {
    return numerator / denominator;
  }
  return numerator == 0 ? 0 : std::numeric_limits<double>::infinity();
}

/// Of an even number of values the upper of the two in the middle; 0 for no values.
inline double Median(std::vector<double> values)
{
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return values.empty() ? 0 : *middle;
}

/// The value below which lies a share (0 to 1) of the others, rounded down; 0 for no values.
inline double OrderStatistic(std::vector<double> values, double share)
{
  if (values.empty())
  {
    return 0;
  }
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Linear between the order statistics, which lie at 0, 1 / (n - 1), ... 1; `sorted` is ascending and not empty.
inline double Quantile(const std::vector<double>& sorted, double share)
{
  const double position = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (position - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

/// `count` of the values, evenly spread over them, or all.
template <class Value>
std::vector<Value> EvenlySpread(const std::vector<Value>& values, std::size_t count)
{
  std::vector<Value> some;
  count = std::min(count, values.size());
  for (std::size_t k = 0; k < count; ++k)
  {
    some.push_back(values[(2 * k + 1) * values.size() / (2 * count)]);
  }
  return some;
}

}  // namespace bigus
