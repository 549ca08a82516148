// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Random numbers of the kinds that tests ask for; everything follows from a seed.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>

#include "Core/Numerics/Random.h"

namespace bigus::test
{

class Random : public RandomNumbers
{
public:
  using RandomNumbers::RandomNumbers;

  /// Every order of magnitude in [low, high) is equally likely; low > 0.
  double LogUniform(double low, double high) { return std::exp(Uniform(std::log(low), std::log(high))); }
  bool Chance(double probability) { return Uniform() < probability; }
  /// A whole number from low to high, both included.
  int Integer(int low, int high) { return low + static_cast<int>(Below(static_cast<std::uint64_t>(high - low + 1))); }

  /// Each coordinate in [low, high).
  Eigen::Vector3d Vector(double low, double high)
  {
    const double x = Uniform(low, high), y = Uniform(low, high), z = Uniform(low, high);
    return {x, y, z};
  }
  Eigen::Vector3d Vector(double half) { return Vector(-half, half); }

  /// Of length 1; every rotation is equally likely.
  Eigen::Vector4d UnitQuaternion()
  {
    const double w = Normal(), x = Normal(), y = Normal(), z = Normal();
    return Eigen::Vector4d(w, x, y, z).normalized();
  }

  /// Of a pixel in fully developed speckle of this mean intensity: Rayleigh distributed.
  double Rayleigh(double mean) { return mean * std::sqrt(-2 * std::log1p(-Uniform()) / (kPi / 2)); }
};

}  // namespace bigus::test
