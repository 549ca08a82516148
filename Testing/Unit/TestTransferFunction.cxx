// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Scattering to intensity and back, and the gamma a sweep's brightness asks for.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "Core/Model/TransferFunction.h"

using bigus::TransferFunction;

TEST(TransferFunction, IsOneMinusAnExponential)
{
  for (double gamma : {0.05, 0.5, 1.0, 3.0})
  {
    const TransferFunction transfer{gamma};
    for (double s : {0.0, 1e-9, 0.01, 0.5, 1.0, 7.0})
    {
      EXPECT_NEAR(transfer.Intensity(s), 1 - std::exp(-gamma * s), 1e-15);
    }
    // Where 1 - exp would cancel, the result still has all its digits.
    EXPECT_NEAR(transfer.Intensity(1e-12) / (gamma * 1e-12), 1, 1e-10);
    EXPECT_NEAR(transfer.Intensity(1e-7f) / static_cast<float>(gamma * 1e-7), 1, 1e-5);
  }
}

TEST(TransferFunction, IsBlackBelowZeroAndNeverAboveWhite)
{
  const TransferFunction transfer{0.7};
  EXPECT_EQ(transfer.Intensity(-1e-9), 0);
  EXPECT_EQ(transfer.Intensity(-1e9), 0);
  EXPECT_EQ(transfer.Intensity(-std::numeric_limits<float>::max()), 0);
  EXPECT_LE(transfer.Intensity(1e9), 1);
  EXPECT_LE(transfer.Intensity(std::numeric_limits<float>::max()), 1);
  EXPECT_LT(transfer.Intensity(20.0), 1);
}

TEST(TransferFunction, RisesWithScattering)
{
  const TransferFunction transfer{0.7};
  double last = -1;
  for (double s = 0; s < 10; s += 0.01)
  {
    EXPECT_GT(transfer.Intensity(s), last);
    last = transfer.Intensity(s);
  }
}

TEST(TransferFunction, ScatteringInvertsIntensity)
{
  for (double gamma : {0.05, 0.7, 2.0})
  {
    const TransferFunction transfer{gamma};
    for (int level = 0; level < 255; ++level)
    {
      EXPECT_NEAR(transfer.Intensity(transfer.Scattering(level / 255.0)), level / 255.0, 1e-14);
    }
  }
}

TEST(TransferFunction, ScatteringOfWhiteIsHalfALevelBelowIt)
{
  const TransferFunction transfer{1.0};
  EXPECT_NEAR(transfer.Scattering(1.0), std::log(510.0), 1e-12);
  EXPECT_EQ(transfer.Scattering(1.0), transfer.Scattering(17.0));
  EXPECT_EQ(transfer.Scattering(-0.5), 0);
  EXPECT_TRUE(std::isfinite(transfer.Scattering(1.0f)));
}

TEST(TransferFunction, GammaPutsTheMeanScatteringAtOne)
{
  for (double mean : {0.01, 0.1, 0.5, 0.85})
  {
    const TransferFunction transfer = TransferFunction::FromMeanIntensity(mean);
    EXPECT_NEAR(transfer.gamma, -std::log(1 - mean), 1e-14);
    EXPECT_NEAR(transfer.Intensity(1.0), mean, 1e-14);
    EXPECT_NEAR(transfer.Scattering(mean), 1, 1e-13);
  }
}

TEST(TransferFunction, GammaOfBlackOrWhiteStillTrains)
{
  EXPECT_EQ(TransferFunction::FromMeanIntensity(0).gamma, TransferFunction::FromMeanIntensity(1e-3).gamma);
  EXPECT_EQ(TransferFunction::FromMeanIntensity(-1).gamma, TransferFunction::FromMeanIntensity(1e-3).gamma);
  EXPECT_EQ(TransferFunction::FromMeanIntensity(1).gamma, TransferFunction::FromMeanIntensity(0.9).gamma);
  EXPECT_GT(TransferFunction::FromMeanIntensity(0).gamma, 0);
  EXPECT_TRUE(std::isfinite(TransferFunction::FromMeanIntensity(1).gamma));
}
