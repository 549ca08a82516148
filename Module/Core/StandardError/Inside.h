// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What preparing and evaluating a standard error share. Private to this room.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "Core/StandardError/StandardError.h"

namespace bigus
{

constexpr double kMostTurn = 1 - 1e-6;  // of which something is left to be turned further
constexpr int kHalfWindow = 3;          // pixels of a frame: texture and errors are averaged over 7 x 7

/// Tenths of a factor of 2 above 2^-20, 1 to 255.
std::uint8_t CodeOfVariance(double variance);

/// Sums over windows of (2 half + 1)^2 pixels, as far as they lie in the picture; each in the same order wherever it lies.
std::vector<double> BoxSums(const std::vector<double>& values, int width, int height, int half);

/// The variance in such windows of what is known (1, else 0); 0 where nothing is.
std::vector<double> WindowVariances(const std::vector<double>& values, const std::vector<double>& known, int width,
                                    int height, int half);

/// The nearest frame before and behind a point; frame -1: none.
struct StandardError::Beside
{
  std::array<int, 2> frame{-1, -1};
  std::array<double, 2> distance{std::numeric_limits<double>::infinity(),
                                 std::numeric_limits<double>::infinity()};  // mm
  std::array<float, 2> column{}, row{};                                     // of the foot

  bool IsKnown() const { return frame[0] >= 0 && (frame[1] >= 0 || distance[0] == 0); }
  /// How much the frame before weighs, 1 on it.
  double Nearness() const { return distance[0] == 0 ? 1 : distance[1] / (distance[0] + distance[1]); }
  /// m = d1 d2 / (d1 + d2), mm: a random walk's variance between two known ends, per unit of its rate.
  double Apart() const { return distance[0] == 0 ? 0 : distance[0] * Nearness(); }
};

}  // namespace bigus
