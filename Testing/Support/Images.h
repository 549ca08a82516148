// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Small images for tests of metrics: patterns that numpy can make again, bit for bit.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "Support/Random.h"

namespace bigus::test
{

struct Image
{
  int width, height;
  std::vector<float> pixels;

  Image(int w, int h, const std::function<double(int, int)>& value) : width(w), height(h)
  {
    for (int y = 0; y < h; ++y)
    {
      for (int x = 0; x < w; ++x)
      {
        pixels.push_back(static_cast<float>(value(x, y)));
      }
    }
  }
  double At(int x, int y) const { return pixels[static_cast<std::size_t>(y) * width + x]; }
  bool Has(int x, int y) const { return x >= 0 && x < width && y >= 0 && y < height; }
};

// Patterns that any language computes to the same bits: quotients of small integers.
inline Image Noise(int w, int h)
{
  return {w, h, [](int x, int y) { return (37 * x + 91 * y + 13 * x * y) % 251 / 250.0; }};
}
inline Image Ramp(int w, int h)
{
  return {w, h, [](int x, int y) { return (2 * x + 3 * y) % 400 / 399.0; }};
}
inline Image Mixed(int w, int h)
{
  return {w, h, [](int x, int y) {
            return (3 * ((37 * x + 91 * y + 13 * x * y) % 251) + (17 * x + 5 * y) % 7 * 40) / 1000.0;
          }};
}
inline Image Constant(int w, int h, double value)
{
  return {w, h, [value](int, int) { return value; }};
}

/// Every pixel in [0, 1), independent.
inline Image RandomImage(int w, int h, std::uint64_t seed)
{
  Random random(seed);
  return {w, h, [&](int, int) { return random.Uniform(); }};
}

/// Fully developed speckle of this mean, not clamped: every pixel Rayleigh distributed, independent.
inline Image Speckle(int w, int h, double mean, std::uint64_t seed)
{
  Random random(seed);
  return {w, h, [&](int, int) { return random.Rayleigh(mean); }};
}

}  // namespace bigus::test
