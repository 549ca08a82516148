// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "Core/Model/Error.h"
#include "Core/Training/Seeding.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::SeedPlacement;

/// 20 frames of 64 x 64 pixels: columns 0-7 black, then dim (0.1) to column 35, then bright (0.8).
std::shared_ptr<bigus::Sweep> Steps()
{
  auto sweep = bigus::test::BlackSweep(20, 64, 64, 0.3, 0.5);
  float* pixels = bigus::test::Pixels(*sweep);
  for (std::size_t p = 0; p < sweep->PixelsPerFrame() * 20; ++p)
  {
    const int column = static_cast<int>(p % 64);
    pixels[p] = column < 8 ? 0.0f : (column < 36 ? 0.1f : 0.8f);
  }
  return sweep;
}

TEST(Seeding, SeedsLieInTheSweptVolumeAndCountExactly)
{
  const auto sweep = Steps();
  for (SeedPlacement placement : {SeedPlacement::Harris, SeedPlacement::Intensity, SeedPlacement::Random})
  {
    for (std::size_t count : {std::size_t(1), std::size_t(777), std::size_t(20000)})
    {
      const bigus::GaussianField field = bigus::Seed(*sweep, AllFrames(*sweep), {0.3}, {placement, count, 4});
      ASSERT_EQ(field.Size(), count);
      field.Validate();
      for (const Eigen::Vector3d& mean : field.means)
      {
        // Column 8 is the first lit one; half a pixel and half a gap beyond the samples still belong to them.
        EXPECT_GE(mean[0], 0.3 * (7.5 - 31.5) - 1e-9);
        EXPECT_LE(mean[0], 0.3 * 32 + 1e-9);
        EXPECT_LE(std::abs(mean[1]), 0.3 * 32 + 1e-9);
        EXPECT_LE(std::abs(mean[2]), 0.5 * 9.5 + 1e-9);
      }
    }
  }
}

TEST(Seeding, DensityFollowsIntensity)
{
  const auto sweep = Steps();
  const bigus::GaussianField field =
      bigus::Seed(*sweep, AllFrames(*sweep), {0.3}, {SeedPlacement::Intensity, 20000, 1});
  double dim = 0, bright = 0;
  for (const Eigen::Vector3d& mean : field.means)
  {
    (mean[0] / 0.3 + 31.5 < 35.5 ? dim : bright) += 1;
  }
  // Equal columns (28 each) with densities 0.3 I + 0.025: 0.265 to 0.055. Blocks that straddle the step blur
  // it.
  EXPECT_NEAR(bright / dim, 0.265 / 0.055, 0.15 * 0.265 / 0.055);
}

// Where a probe turns about its image, or slides in its plane, the centre's gaps are noise: no measure of a seed.
TEST(Seeding, SeedsHaveAThicknessWhereTheCentreDoesNotMove)
{
  for (const bool turns : {true, false})
  {
    for (const double noise : {1e-9, 0.003})
    {
      const auto sweep = Steps();
      for (int k = 0; k < sweep->NumberOfFrames(); ++k)
      {
        Eigen::Matrix4d& pose = sweep->imageToReference[k];
        pose(0, 3) += turns ? 0 : 0.5 * k;
        pose(2, 3) = k % 2 ? noise : -noise;
        if (turns)
        {
          pose.topRows<3>() = Eigen::AngleAxisd(0.05 * k, Eigen::Vector3d::UnitY()).toRotationMatrix() *
                              Eigen::Matrix<double, 3, 4>(pose.topRows<3>());
        }
      }
      const bigus::GaussianField field =
          bigus::Seed(*sweep, AllFrames(*sweep), {0}, {SeedPlacement::Intensity, 500, 1});
      for (const Eigen::Vector3d& scales : field.scales)
      {
        EXPECT_GT(scales.minCoeff(), 0.03) << turns << " " << noise;  // a tenth of a pixel
        EXPECT_LT(scales.maxCoeff(), 6) << turns << " " << noise;
      }
    }
  }
}

TEST(Seeding, PlacementIsMoreEvenThanChance)
{
  auto sweep = bigus::test::BlackSweep(24, 96, 96, 0.3, 0.3);
  std::fill_n(bigus::test::Pixels(*sweep), sweep->PixelsPerFrame() * 24, 0.5f);
  const auto variance = [&](SeedPlacement placement)
  {
    const bigus::GaussianField field = bigus::Seed(*sweep, AllFrames(*sweep), {0.3}, {placement, 8000, 2});
    std::vector<int> boxes(6 * 6 * 3, 0);  // 16 x 16 pixels x 8 frames: 74 seeds each on average
    for (const Eigen::Vector3d& mean : field.means)
    {
      const int x = std::clamp(static_cast<int>((mean[0] / 0.3 + 48) / 16), 0, 5);
      const int y = std::clamp(static_cast<int>((mean[1] / 0.3 + 48) / 16), 0, 5);
      const int z = std::clamp(static_cast<int>((mean[2] / 0.3 + 12) / 8), 0, 2);
      ++boxes[(z * 6 + y) * 6 + x];
    }
    double sum = 0;
    for (int count : boxes)
    {
      sum += std::pow(count - 8000.0 / 108, 2) / 108;
    }
    return sum;
  };
  const double chance = variance(SeedPlacement::Random);
  EXPECT_NEAR(chance / 74, 1.0, 0.4);  // Poisson: variance = mean; 108 boxes tell it to 14 % (one sigma)
  EXPECT_LT(variance(SeedPlacement::Intensity), 0.5 * chance);
}

TEST(Seeding, HarrisFindsTexture)
{
  auto sweep = bigus::test::BlackSweep(8, 64, 64, 0.3, 0.5);
  float* pixels = bigus::test::Pixels(*sweep);
  for (std::size_t p = 0; p < sweep->PixelsPerFrame() * 8; ++p)
  {
    const int column = static_cast<int>(p % 64), row = static_cast<int>(p / 64 % 64);
    pixels[p] = column < 32 ? 0.5f : ((column / 4 + row / 4) % 2 ? 0.2f : 0.8f);  // flat, then a chequerboard
  }
  const bigus::GaussianField field = bigus::Seed(*sweep, AllFrames(*sweep), {0.3}, {SeedPlacement::Harris, 4000, 1});
  double flat = 0;
  for (const Eigen::Vector3d& mean : field.means)
  {
    flat += mean[0] < -0.3;
  }
  EXPECT_GT(flat, 40);           // the floor: flat tissue is not forgotten
  EXPECT_LT(flat, 0.25 * 4000);  // but corners come first
}

TEST(Seeding, GammaAndReflectivityInvertTheTransferFunction)
{
  auto sweep = bigus::test::BlackSweep(6, 32, 32, 0.3, 0.5);
  std::fill_n(bigus::test::Pixels(*sweep), sweep->PixelsPerFrame() * 6, 0.4f);
  const bigus::GaussianField field = bigus::Seed(*sweep, AllFrames(*sweep), {0.3}, {SeedPlacement::Intensity, 100, 1});
  EXPECT_NEAR(field.transfer.gamma, -std::log(1 - 0.4), 1e-6);
  for (double r : field.reflectivities)
  {
    EXPECT_NEAR(r, 1.0, 1e-5);
  }
}

TEST(Seeding, IsRepeatableAndSeeded)
{
  const auto sweep = Steps();
  const auto seeds = [&](std::uint64_t seed) {
    return bigus::Seed(*sweep, AllFrames(*sweep), {0.3}, {SeedPlacement::Intensity, 500, seed}).means;
  };
  EXPECT_EQ(seeds(1), seeds(1));
  EXPECT_NE(seeds(1), seeds(2));
}

TEST(Seeding, NothingIsSeededAcrossABreak)
{
  auto sweep = bigus::test::BlackSweep(20, 32, 32, 0.3, 0.5);
  std::fill_n(bigus::test::Pixels(*sweep), sweep->PixelsPerFrame() * 20, 0.5f);
  for (int f = 10; f < 20; ++f)
  {
    sweep->imageToReference[f](2, 3) += 40;  // a second stroke, 40 mm further
  }
  const bigus::GaussianField field = bigus::Seed(*sweep, AllFrames(*sweep), {0.3}, {SeedPlacement::Intensity, 3000, 1});
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    const double z = field.means[i][2];
    EXPECT_TRUE(z < 1.0 || z > 39.0) << z;
    EXPECT_LT(field.scales[i][2], 2.0);  // sized by the usual gap, not by the jump
  }
}

TEST(Seeding, RefusesBlackFramesAndSenselessCounts)
{
  const auto black = bigus::test::BlackSweep(4, 16, 16, 0.3, 0.5);
  EXPECT_THROW(bigus::Seed(*black, {0, 1}, {0.3}, {SeedPlacement::Intensity, 10, 1}), bigus::Error);
  const auto sweep = Steps();
  EXPECT_THROW(bigus::Seed(*sweep, {0, 1}, {0.3}, {SeedPlacement::Intensity, 0, 1}), bigus::Error);
  EXPECT_THROW(bigus::Seed(*sweep, {}, {0.3}, {SeedPlacement::Intensity, 10, 1}), bigus::Error);
}

TEST(Seeding, OneFrameIsEnough)
{
  const auto sweep = Steps();
  const bigus::GaussianField field = bigus::Seed(*sweep, {5}, {0.4}, {SeedPlacement::Intensity, 300, 1});
  EXPECT_EQ(field.Size(), 300u);
  field.Validate();
}

}  // namespace
