// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where a fan's beams meet: found for probes that are known, and for nothing else.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <tuple>
#include <vector>

#include "Core/Numerics/Constants.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Probe/Fan.h"

namespace bigus::fan_test
{
namespace
{

using Mask = std::vector<std::uint8_t>;

Mask Lit(int width, int height, const std::function<bool(int, int)>& isLit)
{
  Mask mask;
  for (int p = 0; p < width * height; ++p)
  {
    mask.push_back(isLit(p % width, p / width) ? 1 : 0);
  }
  return mask;
}

TEST(Fan, IsFoundWhereItsSidesAreInThePicture)
{
  for (const auto& [probe, size, radius, degrees] : {std::tuple(ProbeKind::Convex, 256, 25.0, 32.0),
                                                     {ProbeKind::Convex, 128, 25.0, 32.0},
                                                     {ProbeKind::Convex, 128, 60.0, 15.0},
                                                     {ProbeKind::Sector, 256, 4.0, 44.0},
                                                     {ProbeKind::Sector, 128, 4.0, 60.0}})
  {
    PhantomOptions options;
    options.probe = probe;
    options.width = options.height = size;
    options.pixelSize = 38.0 / size;
    options.probeRadius = radius;
    options.halfAngle = degrees;
    const Phantom phantom(options);
    const auto apex = FindApex(phantom.Mask(phantom.TruePlane(0)), size, size, options.pixelSize, options.pixelSize);
    ASSERT_TRUE(apex) << size << ' ' << radius;
    EXPECT_NEAR((*apex)[0], 0.5 * (size - 1), 0.1) << size << ' ' << radius;
    const double above = radius * std::cos(degrees * kRadiansPerDegree) / options.pixelSize;
    EXPECT_NEAR((*apex)[1], -above, 0.3 + 0.02 * above) << size << ' ' << radius;
  }
}

TEST(Fan, IsFoundBesideTheMiddleOfPixelsThatAreNoSquares)
{
  constexpr double kAcross = 0.3, kDown = 0.5, kColumn = 90.25, kRow = -20.5;  // mm; pixels
  const auto isLit = [&](int i, int j)
  {
    const double x = (i - kColumn) * kAcross, y = (j - kRow) * kDown, r = std::hypot(x, y);
    // One side is cut off by the scanner's screen, and there is a shadow.
    return i < 150 && r > 15 && r < 55 && std::abs(std::atan2(x, y)) < 0.6 && (r < 40 || i < 70 || i > 85);
  };
  const auto apex = FindApex(Lit(200, 120, isLit), 200, 120, kAcross, kDown);
  ASSERT_TRUE(apex);
  EXPECT_NEAR((*apex)[0], kColumn, 1);
  EXPECT_NEAR((*apex)[1], kRow, 1);
}

TEST(Fan, IsFoundBySidesAloneWhereTheyAreLong)
{
  // Beams of a linear probe that are steered outwards end at one depth. An echo beside the picture is none of them.
  const auto isLit = [](int i, int j)
  { return (j > 20 && j < 100 && std::abs(i - 80) < 20 + 0.5 * j + (j * 7 % 3 - 1) * 0.5) || i == 158; };
  const auto apex = FindApex(Lit(160, 120, isLit), 160, 120, 0.2, 0.2);
  ASSERT_TRUE(apex);
  EXPECT_NEAR((*apex)[0], 80, 1);
  EXPECT_NEAR((*apex)[1], -40, 3);
}

TEST(Fan, IsNotFoundInOtherShapes)
{
  const auto rectangle = [](int i, int j) { return i > 20 && i < 140 && j > 10 && j < 110; };
  const auto all = [](int, int) { return true; };
  const auto lozenge = [](int i, int j) { return std::abs(i - 80) + std::abs(j - 60) < 50; };
  const auto disc = [](int i, int j) { return std::hypot(i - 80, j - 60) < 50; };
  const auto tower = [](int i, int j)
  { return (j > 70 && i > 30 + j / 10 && i < 120) || (j > 20 && i > 60 && i < 80); };
  const auto none = [](int, int) { return false; };
  const std::vector<std::function<bool(int, int)>> shapes = {rectangle, all, lozenge, disc, tower, none};
  for (std::size_t k = 0; k < shapes.size(); ++k)
  {
    EXPECT_FALSE(FindApex(Lit(160, 120, shapes[k]), 160, 120, 0.2, 0.2)) << k;
  }
}

}  // namespace
}  // namespace bigus::fan_test
