// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Scores at planes whose picture is known, beside closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "KnownPlanes.h"

using bigus::KnownPlane;
using bigus::PlaneScores;
using bigus::ScorePlanes;
using bigus::SlicePlane;

namespace
{

KnownPlane Grey(int width, int height)
{
  KnownPlane known;
  known.plane.width = width;
  known.plane.height = height;
  known.truth.assign(known.plane.NumberOfPixels(), 0.5f);
  known.scored.assign(known.plane.NumberOfPixels(), 1);
  return known;
}

}  // namespace

TEST(ScorePlanes, IsMeanAndDeviationOverPlanesOfWhatCounts)
{
  KnownPlane half = Grey(40, 30);
  for (std::size_t p = 0; p < half.scored.size(); ++p)
  {
    half.scored[p] = p % 40 < 20;
  }
  const std::vector<KnownPlane> planes = {Grey(32, 32), half};
  const PlaneScores scores = ScorePlanes(planes,
                                         [](const SlicePlane& plane, float* image)
                                         {
                                           for (std::size_t p = 0; p < plane.NumberOfPixels(); ++p)
                                           {
                                             // Off by 0.1; on the second plane by 0.01 where it counts.
                                             image[p] = plane.width == 32 ? 0.6f : p % 40 < 20 ? 0.51f : 1.0f;
                                           }
                                         });
  EXPECT_EQ(scores.planes, 2);
  EXPECT_NEAR(scores.scoredShare, (32 * 32 + 600) / (32 * 32 + 1200.0), 1e-12);
  EXPECT_NEAR(scores.psnr, 30, 1e-4);  // of 20 and 40 dB
  EXPECT_NEAR(scores.psnrStd, 10, 1e-4);
  // A constant stays what it is up to the border of what counts: nothing leaks in from beyond.
  EXPECT_NEAR(scores.structure, 30, 1e-3);
  EXPECT_NEAR(scores.structureStd, 10, 1e-3);
}

TEST(ScorePlanes, StructureIsWhatAGaussianLeavesOfAWave)
{
  // The transform of a Gaussian: a wave of frequency f keeps exp(-2 (pi f sigma)^2) of its amplitude.
  const KnownPlane known = Grey(3000, 30);
  for (double period : {10.0, 20.0, 40.0})
  {
    const PlaneScores scores =
        ScorePlanes({known},
                    [period](const SlicePlane& plane, float* image)
                    {
                      for (std::size_t p = 0; p < plane.NumberOfPixels(); ++p)
                      {
                        const double x = static_cast<double>(p % plane.width);
                        image[p] = static_cast<float>(0.5 + 0.1 * std::sin(2 * bigus::kPi * x / period));
                      }
                    });
    const double kept = std::exp(-2 * std::pow(bigus::kPi * bigus::kStructureSigma / period, 2));
    EXPECT_NEAR(scores.psnr, 10 * std::log10(2 / 0.01), 1e-3);
    EXPECT_NEAR(scores.structure, 10 * std::log10(2 / (0.01 * kept * kept)), 0.15) << period;
  }
}

TEST(ScorePlanes, OfTheTruthIsPerfectAndOfNothingIsRefused)
{
  KnownPlane known = Grey(20, 20);
  const auto perfect = [](const SlicePlane& plane, float* image)
  { std::fill(image, image + plane.NumberOfPixels(), 0.5f); };
  const PlaneScores scores = ScorePlanes({known}, perfect);
  EXPECT_EQ(scores.psnr, std::numeric_limits<double>::infinity());
  EXPECT_EQ(scores.psnrStd, 0);
  EXPECT_THROW(ScorePlanes({}, perfect), bigus::Error);
  known.scored.assign(known.scored.size(), 0);
  EXPECT_THROW(ScorePlanes({known}, perfect), bigus::Error);
}
