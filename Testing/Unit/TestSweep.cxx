// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sweeps: reading pixels as intensities, box reduction with poses that follow, subsets, validation, hold-out.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "Core/Model/Error.h"
#include "Core/Model/Sweep.h"
#include "Support/Errors.h"
#include "Support/Sweeps.h"

using bigus::Error;
using bigus::SplitHoldOut;
using bigus::Sweep;
using bigus::test::FrameOf;
using bigus::test::Message;
using bigus::test::Random;

namespace
{

Eigen::Matrix4d ObliquePose(double shift)
{
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.block<3, 3>(0, 0) = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix() *
                        Eigen::Vector3d(0.3, 0.2, 1).asDiagonal();
  m.block<3, 1>(0, 3) = Eigen::Vector3d(10 + shift, -20, 30);
  return m;
}

template <class Pixel>
Sweep MakeSweep(int width, int height, int frames, std::shared_ptr<std::vector<Pixel>> pixels)
{
  Sweep sweep;
  sweep.width = width;
  sweep.height = height;
  sweep.pixelType = std::is_same<Pixel, float>::value ? Sweep::PixelType::Float32 : Sweep::PixelType::UInt8;
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  for (int k = 0; k < frames; ++k)
  {
    sweep.imageToReference.push_back(ObliquePose(k));
    sweep.timestamps.push_back(0.1 * k);
  }
  return sweep;
}

Sweep RandomBytes(int width, int height, int frames)
{
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(width) * height * frames);
  Random random(7);
  for (auto& p : *pixels)
  {
    p = static_cast<std::uint8_t>(random.Below(256));
  }
  return MakeSweep<std::uint8_t>(width, height, frames, pixels);
}

Sweep RandomFloats(int width, int height, int frames)
{
  auto pixels = std::make_shared<std::vector<float>>(static_cast<std::size_t>(width) * height * frames);
  Random random(8);
  for (auto& p : *pixels)
  {
    p = static_cast<float>(random.Uniform());
  }
  return MakeSweep<float>(width, height, frames, pixels);
}

}  // namespace

TEST(Sweep, BytesAreReadAsFractionsOf255)
{
  const Sweep sweep = RandomBytes(5, 4, 3);
  const auto* bytes = static_cast<const std::uint8_t*>(sweep.pixels.get());
  for (int f = 0; f < 3; ++f)
  {
    const std::vector<float> image = FrameOf(sweep, f);
    for (int p = 0; p < 20; ++p)
    {
      EXPECT_FLOAT_EQ(image[p], bytes[f * 20 + p] / 255.0);
    }
  }
  auto ends = std::make_shared<std::vector<std::uint8_t>>(std::vector<std::uint8_t>{0, 255});
  EXPECT_EQ(FrameOf(MakeSweep<std::uint8_t>(2, 1, 1, ends), 0), (std::vector<float>{0.0f, 1.0f}));
}

TEST(Sweep, FloatsAreReadAsTheyAre)
{
  const Sweep sweep = RandomFloats(5, 4, 3);
  const auto* values = static_cast<const float*>(sweep.pixels.get());
  EXPECT_EQ(FrameOf(sweep, 2), std::vector<float>(values + 40, values + 60));
}

TEST(Sweep, AFrameThatIsNotThereIsRefused)
{
  const Sweep sweep = RandomBytes(2, 2, 3);
  float image[4];
  EXPECT_NE(Message([&] { sweep.CopyFrame(3, image); }).find("frame 3"), std::string::npos);
  EXPECT_NE(Message([&] { sweep.CopyFrame(-1, image); }).find("frame -1"), std::string::npos);
  EXPECT_NE(Message([&] { sweep.Subset({0, 9}); }).find("frame 9"), std::string::npos);
}

TEST(Sweep, ReductionAveragesBlocks)
{
  for (int n : {2, 3, 5})
  {
    for (const Sweep& sweep : {RandomBytes(13, 11, 4), RandomFloats(13, 11, 4)})
    {
      const Sweep small = sweep.Reduced(n);
      ASSERT_NO_THROW(small.Validate());
      ASSERT_EQ(small.width, 13 / n);
      ASSERT_EQ(small.height, 11 / n);
      ASSERT_EQ(small.NumberOfFrames(), 4);
      ASSERT_EQ(small.pixelType, Sweep::PixelType::Float32);
      EXPECT_EQ(small.timestamps, sweep.timestamps);
      for (int f = 0; f < 4; ++f)
      {
        const std::vector<float> in = FrameOf(sweep, f);
        const std::vector<float> out = FrameOf(small, f);
        for (int y = 0; y < small.height; ++y)
        {
          for (int x = 0; x < small.width; ++x)
          {
            double sum = 0;
            for (int dy = 0; dy < n; ++dy)
            {
              for (int dx = 0; dx < n; ++dx)
              {
                sum += in[(y * n + dy) * 13 + x * n + dx];
              }
            }
            EXPECT_NEAR(out[y * small.width + x], sum / (n * n), 1e-6);
          }
        }
      }
    }
  }
}

TEST(Sweep, ReducedPosesPutPixelsAtTheCentreOfTheirBlock)
{
  const Sweep sweep = RandomBytes(13, 11, 3);
  for (int n : {2, 3, 4})
  {
    const Sweep small = sweep.Reduced(n);
    for (int f = 0; f < 3; ++f)
    {
      for (int y = 0; y < small.height; ++y)
      {
        for (int x = 0; x < small.width; ++x)
        {
          Eigen::Vector3d mean = Eigen::Vector3d::Zero();
          for (int d = 0; d < n * n; ++d)
          {
            mean += sweep.Plane(f).Point(x * n + d % n, y * n + d / n) / (n * n);
          }
          EXPECT_LT((small.Plane(f).Point(x, y) - mean).norm(), 1e-12);
        }
      }
      EXPECT_NEAR(small.Plane(f).PixelSize(), n * sweep.Plane(f).PixelSize(), 1e-12);
      EXPECT_LT((small.imageToReference[f].col(2) - sweep.imageToReference[f].col(2)).norm(), 1e-15);
    }
  }
}

TEST(Sweep, ReductionByOneSharesThePixels)
{
  const Sweep sweep = RandomBytes(4, 4, 2);
  EXPECT_EQ(sweep.Reduced(1).pixels, sweep.pixels);
  EXPECT_EQ(sweep.Reduced(1).pixelType, Sweep::PixelType::UInt8);
}

TEST(Sweep, SomeFramesAreReducedAsInTheWholeSweep)
{
  Sweep sweep = RandomBytes(13, 11, 5);
  sweep.timestamps = {0.0, 0.1, 0.2, 0.3, 0.4};
  sweep.sequences = {0, 0, 1, 1, 2};
  for (const int n : {1, 3})
  {
    const Sweep all = sweep.Reduced(n), some = sweep.ReducedOf({1, 4}, n);
    ASSERT_EQ(some.NumberOfFrames(), 2);
    EXPECT_EQ(FrameOf(some, 0), FrameOf(all, 1));
    EXPECT_EQ(FrameOf(some, 1), FrameOf(all, 4));
    EXPECT_EQ(some.imageToReference[1], all.imageToReference[4]);
    EXPECT_EQ(some.timestamps, (std::vector<double>{0.1, 0.4}));
    EXPECT_EQ(some.sequences, (std::vector<int>{0, 2}));
    EXPECT_THROW(sweep.ReducedOf({5}, n), Error);
  }
}

TEST(Sweep, InterleavedFramesTogetherHaveEveryPixelAtItsPlace)
{
  for (const int n : {1, 2, 3})
  {
    for (const Sweep& sweep : {RandomBytes(12, 6, 2), RandomFloats(12, 6, 2)})
    {
      const Sweep parts = sweep.Interleaved({1, 0}, n);
      ASSERT_NO_THROW(parts.Validate());
      ASSERT_EQ(parts.NumberOfFrames(), 2 * n * n);
      EXPECT_EQ(parts.pixelType, sweep.pixelType);
      for (int frame = 0; frame < 2; ++frame)
      {
        const std::vector<float> whole = FrameOf(sweep, frame);
        std::vector<int> seen(whole.size(), 0);
        for (int k = (1 - frame) * n * n; k < (2 - frame) * n * n; ++k)
        {
          EXPECT_EQ(parts.timestamps[k], sweep.timestamps[frame]);
          const std::vector<float> part = FrameOf(parts, k);
          for (std::size_t p = 0; p < part.size(); ++p)
          {
            const int x = static_cast<int>(p) % parts.width, y = static_cast<int>(p) / parts.width;
            const Eigen::Vector4d place =
                sweep.imageToReference[frame].inverse() * parts.Plane(k).Point(x, y).homogeneous();
            const auto pixel = static_cast<std::size_t>(std::lround(place[1]) * 12 + std::lround(place[0]));
            EXPECT_LT((place - Eigen::Vector4d(std::round(place[0]), std::round(place[1]), 0, 1)).norm(), 1e-9);
            EXPECT_EQ(part[p], whole[pixel]);
            ++seen[pixel];
          }
        }
        EXPECT_EQ(seen, std::vector<int>(whole.size(), 1));
      }
    }
  }
}

TEST(Sweep, InterleavingLeavesNoPixelOutOfBothOfTwoFrames)
{
  const Sweep sweep = RandomBytes(5, 7, 2);
  const Sweep parts = sweep.Interleaved({0, 1}, 2);
  ASSERT_EQ(parts.width, 2);
  ASSERT_EQ(parts.height, 3);
  std::vector<int> columns(5, 0), rows(7, 0);
  for (int k = 0; k < parts.NumberOfFrames(); ++k)
  {
    for (int along = 0; along < 3; ++along)
    {
      const Eigen::Vector4d place =
          sweep.imageToReference[k / 4].inverse() * parts.Plane(k).Point(std::min(along, 1), along).homogeneous();
      ++columns.at(std::lround(place[0]));
      ++rows.at(std::lround(place[1]));
    }
  }
  EXPECT_EQ(std::count(columns.begin(), columns.end(), 0), 0);
  EXPECT_EQ(std::count(rows.begin(), rows.end(), 0), 0);
}

TEST(Sweep, AnInterleavedPixelIsLitWhereAnyIsThatItStandsFor)
{
  Sweep sweep = RandomBytes(5, 4, 2);
  auto mask = std::make_shared<std::vector<std::uint8_t>>(20, std::uint8_t(0));
  (*mask)[1 * 5 + 3] = 255;
  (*mask)[3 * 5 + 4] = 1;  // left over in the first frame, and in the second in place of column 0
  sweep.mask = mask;
  const Sweep one = sweep.Interleaved({0}, 2), both = sweep.Interleaved({0, 1}, 2);
  EXPECT_EQ(*one.mask, (std::vector<std::uint8_t>{0, 1, 0, 0}));
  EXPECT_EQ(*both.mask, (std::vector<std::uint8_t>{0, 1, 0, 1}));
}

TEST(Sweep, InterleavingThatDoesNotFitIsRefused)
{
  const Sweep sweep = RandomBytes(5, 4, 1);
  for (int n : {0, -3, 5, 1 << 30})
  {
    EXPECT_NE(Message([&] { sweep.Interleaved({0}, n); }).find(std::to_string(n)), std::string::npos) << n;
  }
  EXPECT_THROW(sweep.Interleaved({1}, 2), Error);
}

TEST(Sweep, AReducedPixelIsLitWhereAnyOfItsPixelsWas)
{
  Sweep sweep = RandomBytes(5, 4, 1);
  auto mask = std::make_shared<std::vector<std::uint8_t>>(20, std::uint8_t(0));
  (*mask)[1 * 5 + 3] = 255;  // block (1, 0)
  (*mask)[3 * 5 + 4] = 1;    // in the partial block that is dropped
  sweep.mask = mask;
  const Sweep small = sweep.Reduced(2);
  EXPECT_FALSE(small.IsLit(0));
  EXPECT_TRUE(small.IsLit(1));
  EXPECT_FALSE(small.IsLit(2));
  EXPECT_FALSE(small.IsLit(3));
}

TEST(Sweep, ABlockThatDoesNotFitIsRefused)
{
  const Sweep sweep = RandomBytes(5, 4, 1);
  for (int n : {0, -3, 5, 1 << 30})
  {
    EXPECT_NE(Message([&] { sweep.Reduced(n); }).find(std::to_string(n)), std::string::npos) << n;
  }
  EXPECT_EQ(sweep.Reduced(4).PixelsPerFrame(), 1u);
}

TEST(Sweep, SubsetKeepsOrderPixelsAndPoses)
{
  for (Sweep sweep : {RandomBytes(6, 5, 4), RandomFloats(6, 5, 4)})
  {
    sweep.mask = std::make_shared<std::vector<std::uint8_t>>(30, std::uint8_t(1));
    const std::vector<int> frames = {3, 0, 3};
    const Sweep part = sweep.Subset(frames);
    ASSERT_NO_THROW(part.Validate());
    ASSERT_EQ(part.NumberOfFrames(), 3);
    for (int k = 0; k < 3; ++k)
    {
      EXPECT_EQ(FrameOf(part, k), FrameOf(sweep, frames[k]));
      EXPECT_EQ(part.imageToReference[k], sweep.imageToReference[frames[k]]);
      EXPECT_EQ(part.timestamps[k], sweep.timestamps[frames[k]]);
    }
    EXPECT_EQ(part.mask, sweep.mask);
  }
  EXPECT_EQ(RandomBytes(6, 5, 4).Subset({}).NumberOfFrames(), 0);
}

TEST(Sweep, SubsetOutlivesItsSource)
{
  Sweep part;
  std::vector<float> expected;
  {
    const Sweep sweep = RandomBytes(6, 5, 4);
    expected = FrameOf(sweep, 2);
    part = sweep.Subset({2});
  }
  EXPECT_EQ(FrameOf(part, 0), expected);
}

TEST(Sweep, IsLitWhereSomeFrameIsAndInItsShadows)
{
  // Three frames of 11 x 9 pixels showing a fan with a notch at its top, a shadow down to its end and a dark hole.
  const auto isInFan = [](int i, int j) { return j >= 1 && std::abs(i - 5) <= j && !(i == 5 && j == 1); };
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(11 * 9 * 3);
  for (int p = 0; p < 11 * 9 * 3; ++p)
  {
    const int i = p % 11, j = p / 11 % 9;
    const bool isDark = (i == 6 && j >= 4) || (i == 4 && j == 5);
    (*pixels)[p] = isInFan(i, j) && !isDark ? 50 : 0;
  }
  (*pixels)[11 * 9 * 2] = 7;  // frame 2 lights the corner
  const Sweep sweep = MakeSweep(11, 9, 3, pixels);
  const Sweep lit = sweep.LitBy({0, 1});
  EXPECT_EQ(lit.pixels, sweep.pixels);
  EXPECT_EQ(lit.NumberOfFrames(), 3);
  std::vector<float> image(11 * 9, 0.5f);
  lit.BlackenUnlit(image.data());
  for (int p = 0; p < 11 * 9; ++p)
  {
    EXPECT_EQ(lit.IsLit(p), isInFan(p % 11, p / 11)) << p;
    EXPECT_EQ(image[p], lit.IsLit(p) ? 0.5f : 0.0f) << p;
  }
  Sweep masked = sweep;  // as a mask of what is 0 in every frame has it
  auto mask = std::make_shared<std::vector<std::uint8_t>>(pixels->begin(), pixels->begin() + 11 * 9);
  masked.mask = mask;
  EXPECT_EQ(*masked.LitBy({0, 1}).mask, *lit.mask);
  EXPECT_TRUE(sweep.LitBy({2}).IsLit(0));
  EXPECT_FALSE(sweep.LitBy({0, 1, 2}).IsLit(10));
  EXPECT_THROW(sweep.LitBy({0, 3}), Error);
}

TEST(Sweep, WhatWasMaskedIsNotLitWhateverFramesShow)
{
  Sweep sweep = MakeSweep(9, 8, 3, std::make_shared<std::vector<std::uint8_t>>(9 * 8 * 3, std::uint8_t(50)));
  EXPECT_EQ(sweep.LitBy({1}).mask, nullptr) << "all is lit";
  auto mask = std::make_shared<std::vector<std::uint8_t>>(9 * 8, std::uint8_t(255));
  (*mask)[31] = 0;  // inside
  sweep.mask = mask;
  const Sweep lit = sweep.LitBy({1});
  for (std::size_t p = 0; p < 9 * 8; ++p)
  {
    EXPECT_EQ(lit.IsLit(p), p != 31) << p;
  }
}

TEST(Sweep, ValidationNamesWhatIsWrong)
{
  const Sweep good = RandomBytes(4, 3, 3);
  EXPECT_NO_THROW(good.Validate());

  const auto broken = [&](auto change)
  {
    Sweep sweep = good;
    change(sweep);
    return Message([&] { sweep.Validate(); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(broken([](Sweep& s) { s.imageToReference.clear(); }).find("no frame"), std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.width = 0; }).find("0 x 3"), std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.height = -2; }).find("4 x -2"), std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.pixels.reset(); }).find("no pixels"), std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.timestamps.pop_back(); }).find("2 timestamps"), std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.mask = std::make_shared<std::vector<std::uint8_t>>(5); }).find("mask has 5"),
            std::string::npos);
  EXPECT_NE(broken([&](Sweep& s) { s.imageToReference[1](0, 3) = nan; }).find("frame 1"), std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.imageToReference[1](2, 3) = -2e9; }).find("frame 1: it lies farther than 1e9 mm"),
            std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.imageToReference[2].col(1) = 2 * s.imageToReference[2].col(0); }).find("frame 2"),
            std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.imageToReference[0].col(0).setZero(); }).find("frame 0"), std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.imageToReference[1].transposeInPlace(); }).find("last row"), std::string::npos);
  EXPECT_NE(broken([&](Sweep& s) { s.timestamps[1] = nan; }).find("frame 1: the timestamp"), std::string::npos);
  EXPECT_NE(broken([](Sweep& s) { s.width = s.height = std::numeric_limits<int>::max(); }).find("address"),
            std::string::npos);
  EXPECT_EQ(broken([](Sweep& s) { s.timestamps.clear(); }), "");
}

TEST(Sweep, ValidationFindsTheFirstBadFloatPixel)
{
  for (float bad : {-0.01f, 1.01f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()})
  {
    auto pixels = std::make_shared<std::vector<float>>(300 * 200 * 5, 0.5f);
    (*pixels)[3 * 60000 + 7 * 300 + 11] = bad;
    (*pixels)[4 * 60000 + 299] = bad;
    const std::string message = Message([&] { MakeSweep<float>(300, 200, 5, pixels).Validate(); });
    EXPECT_EQ(message.find("frame 3: pixel (11, 7)"), 0u) << message;
  }
}

TEST(Sweep, HoldOutTakesTheMiddleOfEveryKFrames)
{
  for (int n : {0, 1, 5, 40, 140})
  {
    for (int k : {2, 3, 4, 8, 1000})
    {
      const auto [training, held] = SplitHoldOut(n, k);
      std::set<int> all(training.begin(), training.end());
      for (int frame : held)
      {
        EXPECT_EQ(frame % k, k / 2);
        EXPECT_TRUE(all.insert(frame).second);
      }
      for (int frame : training)
      {
        EXPECT_NE(frame % k, k / 2);
      }
      EXPECT_EQ(static_cast<int>(all.size()), n);
      EXPECT_TRUE(std::is_sorted(training.begin(), training.end()));
      EXPECT_TRUE(std::is_sorted(held.begin(), held.end()));
    }
  }
  EXPECT_EQ(SplitHoldOut(140, 8).second.front(), 4);
  EXPECT_EQ(SplitHoldOut(140, 8).second.size(), 17u);
  EXPECT_EQ(SplitHoldOut(40, 4).second.size(), 10u);
  EXPECT_EQ(SplitHoldOut(5, 0).first.size(), 5u);
  EXPECT_TRUE(SplitHoldOut(5, 0).second.empty());
  EXPECT_THROW(SplitHoldOut(5, 1), Error);
  EXPECT_THROW(SplitHoldOut(5, -4), Error);
}
