// Scattering to intensity and back, its derivative, and the gamma a sweep's brightness asks for.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "Core/PixelLoss.h"
#include "Core/TransferFunction.h"

using bigus::EvaluateLoss;
using bigus::LossKind;
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

TEST(Loss, IsTheErrorsSizeOrSquare)
{
  const TransferFunction transfer{0.8};
  for (double s : {-1.0, 0.0, 0.4, 2.0})
  {
    for (double truth : {0.0, 0.3, 1.0})
    {
      const double error = transfer.Intensity(s) - truth;
      EXPECT_NEAR(EvaluateLoss(LossKind::L1, transfer.gamma, s, truth).loss, std::abs(error), 1e-15);
      EXPECT_NEAR(EvaluateLoss(LossKind::L2, transfer.gamma, s, truth).loss, error * error, 1e-15);
    }
  }
}

TEST(Loss, DerivativeIsExactWhereThePixelIsLit)
{
  const TransferFunction transfer{0.8};
  const double step = 1e-6;
  for (LossKind kind : {LossKind::L1, LossKind::L2})
  {
    for (double s : {0.01, 0.4, 2.0, 5.0})
    {
      for (double truth : {0.0, 0.25, 0.9, 1.0})
      {
        const double slope = (EvaluateLoss(kind, transfer.gamma, s + step, truth).loss -
                              EvaluateLoss(kind, transfer.gamma, s - step, truth).loss) /
                             (2 * step);
        EXPECT_NEAR(EvaluateLoss(kind, transfer.gamma, s, truth).derivative, slope, 1e-8);
      }
    }
  }
}

TEST(Loss, ADarkPixelIsPulledUpWhenItShouldBeLitAndLeftAloneWhenItShouldNot)
{
  const TransferFunction transfer{0.8};
  for (LossKind kind : {LossKind::L1, LossKind::L2})
  {
    for (double s : {-3.0, -1e-6, 0.0})
    {
      EXPECT_LT(EvaluateLoss(kind, transfer.gamma, s, 0.4).derivative, 0);
      // The one-sided derivative at S = 0+, however far below zero S is.
      EXPECT_NEAR(EvaluateLoss(kind, transfer.gamma, s, 0.4).derivative,
                  EvaluateLoss(kind, transfer.gamma, 1e-12, 0.4).derivative, 1e-9);
      EXPECT_EQ(EvaluateLoss(kind, transfer.gamma, s, 0.0).derivative, 0);
    }
  }
}
