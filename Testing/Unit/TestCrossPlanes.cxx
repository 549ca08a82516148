// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Power along a sweep, beside waves and noise whose power is known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "Core/Evaluation/Baselines.h"
#include "Core/Evaluation/CrossPlanes.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "Support/Random.h"
#include "Support/Sweeps.h"

using bigus::CrossPlane;
using bigus::CrossScores;
using bigus::PowerAlong;
using bigus::SlicePlane;
using bigus::Sweep;
using bigus::test::BlackSweep;

namespace
{

/// 20 frames 0.8 mm apart, with grey noise.
std::shared_ptr<Sweep> NoisySweep()
{
  auto sweep = BlackSweep(20, 24, 16, 0.4, 0.8);
  bigus::test::Random random(5);
  for (std::size_t p = 0; p < sweep->PixelsPerFrame() * 20; ++p)
  {
    bigus::test::Pixels(*sweep)[p] = static_cast<float>(random.Uniform(0.2, 0.8));
  }
  return sweep;
}

/// Of pictures of the cross-planes, four rows a gap; `intensity` is of a plane's pixel i, j.
PowerAlong PowerOf(const Sweep& sweep, const std::function<double(const SlicePlane&, int, int)>& intensity)
{
  const auto draw = [&](const SlicePlane& plane, float* picture)
  {
    for (int j = 0; j < plane.height; ++j)
    {
      for (int i = 0; i < plane.width; ++i)
      {
        *picture++ = static_cast<float>(intensity(plane, i, j));
      }
    }
  };
  return bigus::CrossPlaneScorer(sweep, AllFrames(sweep)).Score(draw).value().power;
}

}  // namespace

TEST(PowerAlong, OfAWaveIsHalfItsSquareInItsBand)
{
  const auto sweep = NoisySweep();
  for (int i : {0, 3})  // across the sweep it may be anything
  {
    const auto wave = [&](double gaps)
    {
      return PowerOf(*sweep, [gaps, i](const SlicePlane&, int column, int j)
                     { return 0.5 + 0.1 * std::sin(2 * bigus::kPi * j / (4 * gaps) + i * column); });
    };
    for (double gaps : {2.7, 4.0})  // long waves: what frames show
    {
      EXPECT_NEAR(wave(gaps).within, 0.005, 2e-4) << gaps;
      EXPECT_LT(wave(gaps).beyond, 1e-5) << gaps;
    }
    for (double gaps : {1.0, 0.8, 0.6})  // shorter than two gaps: what they cannot
    {
      EXPECT_NEAR(wave(gaps).beyond, 0.005, 2e-4) << gaps;
      EXPECT_LT(wave(gaps).within, 1e-5) << gaps;
    }
  }
  const PowerAlong still = PowerOf(*sweep, [](const SlicePlane&, int i, int) { return 0.3 + 0.05 * i; });
  EXPECT_LT(still.within + still.beyond, 1e-12);
}

TEST(PowerAlong, OfWhiteNoiseIsSpreadEvenly)
{
  bigus::test::Random random(3);
  PowerAlong mean;
  for (int k = 0; k < 20; ++k)
  {
    const PowerAlong power = PowerOf(*NoisySweep(), [&](const SlicePlane&, int, int) { return random.Uniform(0, 1); });
    mean.within += power.within / 20;
    mean.beyond += power.beyond / 20;
  }
  // Of 32 frequencies of both signs 1 to 4 are within, 6 to 16 beyond; the taper costs the lowest some of the mean.
  EXPECT_NEAR(mean.beyond, 21.0 / 32 / 12, 0.002);
  EXPECT_NEAR(mean.within, 8.0 / 32 / 12, 0.002);
}

TEST(PowerAlong, CountsWholeWindowsOnly)
{
  // From the fourteenth frame on the first columns are not seen: what pictures show there does not count.
  const auto sweep = NoisySweep();
  const double seen = sweep->Plane(12).origin[2], left = sweep->Plane(0).Point(4, 0)[0];
  const auto power = [&]
  {
    return PowerOf(*sweep,
                   [&](const SlicePlane& plane, int i, int j)
                   {
                     const Eigen::Vector3d x = plane.Point(i, j);
                     return x[0] < left - 0.01 && x[2] > seen + 0.01 && j % 2 == 0 ? 1.0 : 0.5;
                   })
        .beyond;
  };
  EXPECT_GT(power(), 1e-4);
  for (int frame = 13; frame < 20; ++frame)
  {
    sweep->imageToReference[frame](0, 3) += 4 * 0.4;
  }
  EXPECT_LT(power(), 1e-12);
}

TEST(CrossPlanes, LieAlongTheSweepWithinItsFrames)
{
  const auto sweep = NoisySweep();
  const std::vector<CrossPlane> planes = bigus::MakeCrossPlanes(*sweep, AllFrames(*sweep), 2, 0.2);
  ASSERT_EQ(planes.size(), 4u);
  for (std::size_t k = 0; k < 4; ++k)
  {
    const SlicePlane& plane = planes[k].plane;
    EXPECT_EQ(plane.width, k < 2 ? 16 : 24);
    EXPECT_EQ(plane.height, 77);  // 19 gaps of four steps, and one
    EXPECT_NEAR(std::abs(plane.Normal()[k < 2 ? 0 : 1]), 1, 1e-12);
    EXPECT_NEAR(plane.Point(0, 0)[2], -7.6, 1e-12);
    EXPECT_NEAR(plane.Point(0, 76)[2], 7.6, 1e-9);
    for (int j = 1; j < 76; ++j)
    {
      ASSERT_EQ(planes[k].enclosed[j * plane.width + 3], 1) << j;
    }
  }
  EXPECT_NEAR(planes[0].plane.Point(3, 0)[0], -0.25 * 23 * 0.4, 1e-12);  // quarters of the frame
  EXPECT_NEAR(planes[3].plane.Point(3, 0)[1], 0.25 * 15 * 0.4, 1e-12);
  EXPECT_THROW(bigus::MakeCrossPlanes(*sweep, {3}, 2, 0.2), bigus::Error);
}

TEST(CrossPlanes, DoNotReachForAFrameThatStrays)
{
  for (const int stray : {0, 4, 12})
  {
    auto sweep = std::make_shared<Sweep>(*NoisySweep());
    sweep->imageToReference[stray](2, 3) += 1e9;
    const std::vector<CrossPlane> planes = bigus::MakeCrossPlanes(*sweep, AllFrames(*sweep), 1, 0.2);
    EXPECT_EQ(planes[0].plane.height, stray == 0 ? 73 : 77) << stray;
    EXPECT_TRUE(bigus::CrossPlaneScorer(*sweep, AllFrames(*sweep)).Score([](const SlicePlane&, float*) {})) << stray;
  }
  auto sweep = std::make_shared<Sweep>(*NoisySweep());
  sweep->imageToReference[10](2, 3) += 1e9;  // the middle one, which planes start from
  EXPECT_EQ(bigus::MakeCrossPlanes(*sweep, AllFrames(*sweep), 1, 0.2)[0].plane.height, 1);
}

TEST(CrossPlanes, AreScoredBesideLinearInterpolation)
{
  const auto sweep = NoisySweep();
  const std::vector<int> frames = AllFrames(*sweep);
  const bigus::CrossPlaneScorer scorer(*sweep, frames);
  const auto score = [&](double contrast, double wave)
  {
    return scorer
        .Score(
            [&](const SlicePlane& plane, float* picture)
            {
              PredictPoseInterpolation(*sweep, frames, plane, picture);
              for (std::size_t p = 0; p < plane.NumberOfPixels(); ++p)
              {
                const double z = plane.Point(0, static_cast<double>(p / plane.width))[2];
                picture[p] = static_cast<float>(contrast * picture[p] + wave * std::sin(2 * bigus::kPi * z / 0.8));
              }
            })
        .value();
  };
  const CrossScores same = score(1, 0);
  EXPECT_NEAR(same.detail, 1, 1e-6);
  EXPECT_NEAR(same.scratches, 1, 1e-6);
  const CrossScores faint = score(0.5, 0);
  EXPECT_NEAR(faint.detail, 0.25, 1e-3);
  EXPECT_NEAR(faint.scratches, 0.25, 1e-3);
  const CrossScores ridged = score(1, 0.1);  // a bright line between every two frames
  EXPECT_NEAR(ridged.detail, 1, 0.01);
  EXPECT_NEAR(ridged.power.beyond - ridged.linear.beyond, 0.005, 5e-4);
  EXPECT_GT(ridged.scratches, 2);
  const auto black = [](const SlicePlane&, float*) {};
  EXPECT_FALSE(bigus::CrossPlaneScorer(*sweep, {0, 1, 2, 3, 4, 5, 6, 7}).Score(black));  // seven gaps
  EXPECT_FALSE(bigus::CrossPlaneScorer(*BlackSweep(20, 24, 16, 0.4, 0.8), frames).Score(black));
}

TEST(CrossPlanes, OfALongSweepTheMiddleIsLookedAt)
{
  const auto noise = [](int frames)
  {
    auto sweep = BlackSweep(frames, 12, 10, 0.4, 0.8);
    bigus::test::Random random(7);
    for (std::size_t p = 0; p < sweep->PixelsPerFrame() * frames; ++p)
    {
      bigus::test::Pixels(*sweep)[p] = static_cast<float>(random.Uniform(0.2, 0.8));
    }
    return sweep;
  };
  const auto sweep = noise(520);
  std::vector<int> middle;
  for (int frame = 60; frame < 460; ++frame)
  {
    middle.push_back(frame);
  }
  const auto fainter = [&](const SlicePlane& plane, float* image)
  {
    PredictPoseInterpolation(*sweep, middle, plane, image);
    std::transform(image, image + plane.NumberOfPixels(), image, [](float pixel) { return 0.8f * pixel; });
  };
  const std::optional<CrossScores> all = bigus::CrossPlaneScorer(*sweep, AllFrames(*sweep)).Score(fainter);
  const std::optional<CrossScores> part = bigus::CrossPlaneScorer(*sweep, middle).Score(fainter);
  ASSERT_TRUE(all && part);
  EXPECT_EQ(all->linear.within, part->linear.within);
  EXPECT_EQ(all->detail, part->detail);
}
