// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Random numbers that are the same bits with every compiler and standard library: splitmix64 (Steele, Lea, Flood:
// "Fast splittable pseudorandom number generators", 2014). The distributions of <random> differ between libraries.
#pragma once

#include <cmath>
#include <cstdint>

#include "Core/Numerics/Constants.h"

namespace bigus
{

/// What the counter of splitmix64 advances by: 2^64 over the golden ratio.
constexpr std::uint64_t kCounterStep = 0x9e3779b97f4a7c15ull;

/// 64 well mixed bits of a counter. A chain Mix(Mix(seed) + k) is a random number that can be had without those before.
constexpr std::uint64_t Mix(std::uint64_t x)
{
  x += kCounterStep;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

/// In (0, 1), from 32 bits: never 0, so it has a logarithm.
constexpr double OpenUniform(std::uint32_t bits)
{
  return (bits + 0.5) * 0x1p-32;
}

/// A standard normal number from 64 bits (Box and Muller).
inline double Normal(std::uint64_t bits)
{
  const double radius = std::sqrt(-2 * std::log(OpenUniform(static_cast<std::uint32_t>(bits >> 32))));
  return radius * std::cos(2 * kPi * OpenUniform(static_cast<std::uint32_t>(bits)));
}

/// A sequence of random numbers that follows from its seed.
class RandomNumbers
{
public:
  explicit RandomNumbers(std::uint64_t seed) : state_(Mix(seed)) {}

  std::uint64_t Bits()
  {
    const std::uint64_t bits = Mix(state_);
    state_ += kCounterStep;
    return bits;
  }

  /// In [low, high).
  double Uniform(double low = 0, double high = 1)
  {
    return low + (high - low) * static_cast<double>(Bits() >> 11) * 0x1p-53;
  }

  /// A whole number in [0, count); count > 0. Uneven by count / 2^64 at most.
  std::uint64_t Below(std::uint64_t count) { return Bits() % count; }

  /// Of mean 0 and standard deviation 1.
  double Normal() { return bigus::Normal(Bits()); }

private:
  std::uint64_t state_;
};

}  // namespace bigus
