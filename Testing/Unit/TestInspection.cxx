// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Damaged copies of a phantom's sweep: what was done to them is known, so that what is found can be counted.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iostream>
#include <map>
#include <numeric>
#include <random>
#include <tuple>

#include "Core/Inspection/Inspection.h"
#include "Core/Numerics/Format.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/OptionList.h"
#include "Support/Errors.h"
#include "Support/Random.h"

namespace
{

using bigus::FindingKind;
using bigus::Format;
using bigus::Inspect;
using bigus::InspectedSweep;
using bigus::KeptKinds;
using bigus::Sweep;
using bigus::test::Random;

/// A sweep whose frames can be changed and put in another order.
struct Frames
{
  int width = 0, height = 0;
  std::vector<std::vector<double>> images;  // grey levels
  std::vector<Eigen::Matrix4d> poses;
  std::vector<double> times;

  std::shared_ptr<const Sweep> AsSweep() const
  {
    auto sweep = std::make_shared<Sweep>();
    sweep->width = width;
    sweep->height = height;
    auto pixels = std::make_shared<std::vector<std::uint8_t>>();
    for (const std::vector<double>& image : images)
    {
      std::transform(image.begin(), image.end(), std::back_inserter(*pixels),
                     [](double level)
                     { return static_cast<std::uint8_t>(std::lround(std::clamp(level, 0.0, 255.0))); });
    }
    sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
    sweep->imageToReference = poses;
    sweep->timestamps = times;
    return sweep;
  }

  void Repeat(std::size_t at, std::size_t count)
  {
    images.insert(images.begin() + at, count, std::vector<double>(images[at]));
    poses.insert(poses.begin() + at, count, Eigen::Matrix4d(poses[at]));
    times.resize(images.size());
    for (std::size_t k = 0; k < times.size(); ++k)
    {
      times[k] = 0.05 * static_cast<double>(k);
    }
  }

  void AddNoise(Random& random, double levels)
  {
    for (std::vector<double>& image : images)
    {
      for (double& level : image)
      {
        level += levels * random.Normal();
      }
    }
  }
};

Frames FramesOf(const Sweep& sweep)
{
  Frames result{sweep.width, sweep.height, {}, sweep.imageToReference, sweep.timestamps};
  std::vector<float> image(sweep.PixelsPerFrame());
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    sweep.CopyFrame(k, image.data());
    result.images.emplace_back(image.begin(), image.end());
    for (double& level : result.images.back())
    {
      level *= 255;
    }
  }
  return result;
}

Frames PhantomFrames(std::uint64_t seed, double spacing = 0.5, int frames = 32)
{
  static std::map<std::tuple<std::uint64_t, double, int>, Frames> made;
  if (const auto found = made.find({seed, spacing, frames}); found != made.end())
  {
    return found->second;
  }
  bigus::PhantomOptions options;
  options.seed = seed;
  options.frames = frames;
  options.width = 96;
  options.height = 80;
  options.pixelSize = 0.5;
  options.frameSpacing = spacing;
  options.scattererDensity = 4;
  const Frames result = FramesOf(bigus::Phantom(options).MakeSweep());
  made[{seed, spacing, frames}] = result;
  return result;
}

std::vector<int> From(int first, int count)
{
  std::vector<int> list(count);
  std::iota(list.begin(), list.end(), first);
  return list;
}

/// The image larger by a factor about the middle of its upper side, bilinear; black where there was nothing.
std::vector<double> Scaled(const std::vector<double>& image, int width, int height, double factor)
{
  std::vector<double> scaled(image.size(), 0);
  const double middle = 0.5 * (width - 1);
  for (int y = 0; y < height; ++y)
  {
    for (int x = 0; x < width; ++x)
    {
      const double i = middle + (x - middle) / factor, j = y / factor;
      if (i < 0 || j < 0 || i >= width - 1 || j >= height - 1)
      {
        continue;
      }
      const int i0 = static_cast<int>(i), j0 = static_cast<int>(j);
      const double u = i - i0, v = j - j0, *pixel = &image[static_cast<std::size_t>(j0) * width + i0];
      scaled[static_cast<std::size_t>(y) * width + x] =
          (1 - v) * ((1 - u) * pixel[0] + u * pixel[1]) + v * ((1 - u) * pixel[width] + u * pixel[width + 1]);
    }
  }
  return scaled;
}

std::vector<FindingKind> KindsOf(const InspectedSweep& inspected)
{
  std::vector<FindingKind> kinds;
  for (const bigus::Finding& finding : inspected.findings)
  {
    kinds.push_back(finding.kind);
  }
  return kinds;
}

using Kinds = std::vector<FindingKind>;

TEST(Inspection, GoodSweepsAreTheSameObject)
{
  for (const auto& [seed, spacing] : {std::pair(1, 0.5), {1, 0.1}, {2, 1.0}})
  {
    for (const double noise : {0.0, 2.0})
    {
      Frames frames = PhantomFrames(seed, spacing);
      Random random(static_cast<unsigned>(seed));
      frames.AddNoise(random, noise);
      const auto sweep = frames.AsSweep();
      const InspectedSweep inspected = Inspect(sweep);
      EXPECT_EQ(inspected.sweep, sweep) << "seed " << seed << ", spacing " << spacing << ", noise " << noise;
      EXPECT_TRUE(inspected.findings.empty())
          << bigus::Describe(inspected.findings.front(), From(0, sweep->NumberOfFrames()));
      EXPECT_EQ(inspected.frames, From(0, 32));
    }
  }
}

TEST(Inspection, ASlowPartOfASweepIsNoRest)
{
  const Frames slow = PhantomFrames(1, 0.05, 40), fast = PhantomFrames(1, 0.5, 20);
  Frames both = slow;
  for (std::size_t k = 0; k < fast.images.size(); ++k)  // goes on where the slow part ended
  {
    Eigen::Matrix4d pose = fast.poses[k];
    pose(2, 3) += slow.poses.back()(2, 3) - fast.poses[0](2, 3) + 0.5;
    both.images.push_back(fast.images[k]);
    both.poses.push_back(pose);
    both.times.push_back(slow.times.back() + 0.05 * static_cast<double>(k + 1));
  }
  EXPECT_EQ(KindsOf(Inspect(both.AsSweep())), Kinds{});
}

TEST(Inspection, AProbeThatSetsOutSlowlyRepeatsNothing)
{
  bigus::PhantomOptions options;
  options.frames = 64;
  options.passes = 2;
  options.width = options.height = 96;
  options.pixelSize = 0.4;
  options.wander = options.tilt = 0;
  options.scattererDensity = 4;
  options.trackingNoise = options.trackingRotationNoise = 0.1;
  for (options.seed = 1; options.seed <= 3; ++options.seed)
  {
    const InspectedSweep inspected = Inspect(std::make_shared<const Sweep>(bigus::Phantom(options).MakeSweep()));
    EXPECT_EQ(KindsOf(inspected), Kinds{}) << options.seed;
  }
}

TEST(Inspection, FramesAreOrderedByTimeWhereThePathSaysSo)
{
  Frames frames = PhantomFrames(1), shuffled = frames;
  std::vector<int> order = From(0, 32);
  Random random(5);
  for (std::size_t k = order.size() - 1; k > 0; --k)
  {
    std::swap(order[k], order[random.Integer(0, static_cast<int>(k))]);
  }
  for (int k = 0; k < 32; ++k)
  {
    shuffled.images[k] = frames.images[order[k]];
    shuffled.poses[k] = frames.poses[order[k]];
    shuffled.times[k] = frames.times[order[k]];
  }
  const InspectedSweep inspected = Inspect(shuffled.AsSweep());
  EXPECT_EQ(KindsOf(inspected), Kinds{FindingKind::Order});
  EXPECT_EQ(inspected.sweep->imageToReference, frames.poses);
  EXPECT_EQ(inspected.sweep->timestamps, frames.times);
  for (int k = 0; k < 32; ++k)
  {
    EXPECT_EQ(order[inspected.frames[k]], k);
  }
  // A sweep listed backwards has the same path either way; times tell.
  Frames backwards = frames;
  std::reverse(backwards.images.begin(), backwards.images.end());
  std::reverse(backwards.poses.begin(), backwards.poses.end());
  std::reverse(backwards.times.begin(), backwards.times.end());
  const InspectedSweep forwards = Inspect(backwards.AsSweep());
  ASSERT_EQ(KindsOf(forwards), Kinds{FindingKind::Order});
  EXPECT_TRUE(forwards.findings[0].isApplied);
  EXPECT_EQ(forwards.sweep->imageToReference, frames.poses);
  // Times that make the path longer are the worse witness.
  Frames wrong = frames;
  for (int k = 0; k < 32; ++k)
  {
    wrong.times[k] = frames.times[order[k]];
  }
  const InspectedSweep doubted = Inspect(wrong.AsSweep());
  ASSERT_EQ(KindsOf(doubted), Kinds{FindingKind::Order});
  EXPECT_FALSE(doubted.findings[0].isApplied);
  EXPECT_EQ(doubted.frames, From(0, 32));
}

/// What a damage should lead to: the kind, and the frames that are named.
struct Damage
{
  FindingKind kind;
  std::string strength;
  std::function<std::vector<int>(Frames&, Random&, int at)> make;  ///< `at` is 0 to 31
  bool isCertain = true;                                           ///< must be found; else it is only counted
};

/// Every grey level of the frames from `first` on and columns from `left` on, changed.
void Change(Frames& frames, int first, int count, int left, int right, const std::function<double(double)>& to)
{
  for (int k = first; k < first + count; ++k)
  {
    for (std::size_t pixel = 0; pixel < frames.images[k].size(); ++pixel)
    {
      const int x = static_cast<int>(pixel) % frames.width;
      double& level = frames.images[k][pixel];
      level = x >= left && x < right ? to(level) : level;
    }
  }
}

Damage Rest(double jitter, double noise)
{
  return {FindingKind::Rest, "12 frames, poses jitter by " + Format("%g", jitter) + " mm",
          [=](Frames& frames, Random& random, int at)
          {
            frames.Repeat(at, 12);
            for (int k = at; k <= at + 12; ++k)
            {
              for (int axis = 0; axis < 3; ++axis)
              {
                frames.poses[k](axis, 3) += jitter * random.Normal();
              }
            }
            frames.AddNoise(random, noise);
            return From(at, 13);
          }};
}

/// `share` of the width shows what is left of the levels.
Damage Dark(double share, double left)
{
  return {FindingKind::Contact,
          Format("%g", 100 * left) + " % of the light on " + Format("%g", 100 * share) + " % of the width",
          [=](Frames& frames, Random& random, int at)
          {
            const int first = std::min(at, 27);
            Change(frames, first, 5, 0, static_cast<int>(share * frames.width),
                   [=](double level) { return left * level; });
            frames.AddNoise(random, 0.5);
            return From(first, 5);
          },
          left <= 0.05};
}

Damage Noise(double share, double levels)
{
  return {FindingKind::Contact,
          "noise of " + Format("%g", levels) + " levels on " + Format("%g", 100 * share) + " % of the width",
          [=](Frames& frames, Random& random, int at)
          {
            const int first = std::min(at, 27), left = static_cast<int>((1 - share) * frames.width);
            Change(frames, first, 4, left, frames.width, [&](double) { return std::abs(levels * random.Normal()); });
            return From(first, 4);
          }};
}

Damage Repeated(int count, double compression)
{
  return {FindingKind::Repeat,
          std::to_string(count) + " times, compressed anew by " + Format("%g", compression) + " levels",
          [=](Frames& frames, Random& random, int at)
          {
            const int first = std::min(at, 31 - count);
            const std::vector<double> frozen = frames.images[first];
            frames.AddNoise(random, 1);
            for (int k = first; k <= first + count; ++k)
            {
              frames.images[k] = frozen;
              for (double& level : frames.images[k])
              {
                level += compression * random.Normal();
              }
            }
            return From(first + 1, count);
          },
          compression < 2};
}

Damage Jump(int count, double way)
{
  return {FindingKind::Tracking, std::to_string(count) + " frames, " + Format("%g", way) + " mm away",
          [=](Frames& frames, Random& random, int at)
          {
            const int first = std::min(at, 32 - count);
            const double angle = 6.28 * random.Uniform(0, 1);
            for (int k = first; k < first + count; ++k)
            {
              frames.poses[k](0, 3) += way * std::cos(angle);
              frames.poses[k](2, 3) += way * std::sin(angle);
            }
            return From(first, count);
          },
          way >= 10};
}

Damage Stale(int count)
{
  return {FindingKind::Tracking, "the same pose " + std::to_string(count) + " times more",
          [=](Frames& frames, Random&, int at)
          {
            const int first = std::min(at, 31 - count);
            for (int k = first + 1; k <= first + count; ++k)
            {
              frames.poses[k] = frames.poses[first];
            }
            return From(first + 1, count);
          }};
}

Damage Gain(double levels)
{
  return {FindingKind::Gain, Format("%+g", levels) + " levels",
          [=](Frames& frames, Random&, int at)
          {
            const int first = std::clamp(at, 8, 24);
            Change(frames, first, 32 - first, 0, frames.width,
                   [=](double level) { return level > 4 ? level + levels : level; });
            return From(first, 1);
          },
          std::abs(levels) >= 15};
}

Damage Depth(double factor)
{
  return {FindingKind::Depth, "larger by " + Format("%g", factor),
          [=](Frames& frames, Random&, int at)
          {
            const int first = std::clamp(at, 4, 28);
            for (int k = first; k < 32; ++k)
            {
              frames.images[k] = Scaled(frames.images[k], frames.width, frames.height, factor);
            }
            return From(first, 1);
          },
          factor < 0.8 || factor > 1.25};
}

std::vector<Damage> Damages()
{
  std::vector<Damage> all = {Rest(0, 1), Rest(0, 4), Rest(0.02, 1), Rest(0.02, 4), Rest(0.2, 1), Rest(0.2, 4)};
  for (const double share : {1.0, 0.5, 0.25})
  {
    all.insert(all.end(), {Dark(share, 0), Dark(share, 0.05), Dark(share, 0.2), Noise(share, 10), Noise(share, 30)});
  }
  for (const int count : {1, 3, 9})
  {
    all.insert(all.end(), {Repeated(count, 0), Repeated(count, 0.6), Repeated(count, 1.5), Repeated(count, 3)});
  }
  all.insert(all.end(), {Jump(1, 3), Jump(1, 30), Jump(1, 10), Jump(3, 10), Jump(3, 300), Jump(6, 60), Jump(8, 40),
                         Stale(2), Stale(5)});
  all.insert(all.end(), {Gain(6), Gain(15), Gain(-20), Depth(0.7), Depth(0.9), Depth(1.1), Depth(1.4)});
  return all;
}

/// Frames of one row of the table.
struct Count
{
  int copies = 0, damaged = 0, found = 0, wrong = 0;
};

TEST(Inspection, DamagedCopiesAreFoundFrameByFrame)
{
  std::map<std::string, Count> table;
  for (const Damage& damage : Damages())
  {
    Count& row = table[bigus::NameOf(damage.kind) + (" | " + damage.strength)];
    for (const int at : {0, 15, 31})
    {
      for (const unsigned seed : {1, 2})
      {
        Frames frames = PhantomFrames(seed);
        Random random(100 * seed + 7);
        const std::vector<int> expected = damage.make(frames, random, at);
        const InspectedSweep inspected = Inspect(frames.AsSweep());
        std::vector<int> named, hits;
        for (const bigus::Finding& finding : inspected.findings)
        {
          EXPECT_TRUE(finding.kind == damage.kind || !damage.isCertain) << bigus::Describe(finding, From(0, 50));
          EXPECT_EQ(finding.isApplied, finding.kind < FindingKind::Gain);
          named.insert(named.end(), finding.frames.begin(), finding.frames.end());
        }
        std::set_intersection(expected.begin(), expected.end(), named.begin(), named.end(), std::back_inserter(hits));
        const int one = damage.kind == FindingKind::Rest;  // of those that rest stays, whichever
        ++row.copies;
        row.damaged += static_cast<int>(expected.size()) - one;
        row.found += static_cast<int>(hits.size());
        row.wrong += static_cast<int>(named.size() - hits.size());
        EXPECT_TRUE(!damage.isCertain || (hits.size() + one == expected.size() && named.size() == hits.size()))
            << bigus::NameOf(damage.kind) << ", " << damage.strength << ", at " << at << ", seed " << seed << ": "
            << testing::PrintToString(named) << " for " << testing::PrintToString(expected);
      }
    }
  }
  int copies = 0;
  for (const auto& [name, row] : table)  // the table of README.md
  {
    std::cout << "| " << name << " | " << row.copies << " | " << row.found << " of " << row.damaged << " | "
              << row.wrong << " |\n";
    copies += row.copies;
  }
  EXPECT_GE(copies, 200);
}

// The hand is quick beside a rest, and no tracker.
TEST(Inspection, ARestAmidAShortSweepIsNoJump)
{
  for (const int at : {0, 2, 4, 9, 11})
  {
    Frames frames = PhantomFrames(4, 0.7, 12);
    Random random(9);
    frames.Repeat(at, 20);
    for (int k = at; k <= at + 20; ++k)
    {
      frames.poses[k](2, 3) += 0.02 * random.Normal();
    }
    frames.AddNoise(random, 1);
    EXPECT_EQ(KindsOf(Inspect(frames.AsSweep())), Kinds{FindingKind::Rest}) << at;
  }
}

// Bits that are missing, and white tissue, are said. What grey levels tell is asked as of any sweep.
TEST(Inspection, ADimOrAWhiteSweepIsLookedAtAsOthersAre)
{
  Frames white = PhantomFrames(1, 0.1);
  const auto bytes = white.AsSweep();
  const std::size_t size = bytes->PixelsPerFrame();
  for (const bool hasBlack : {false, true})
  {
    auto tenBits = std::make_shared<Sweep>(*bytes);  // of 16
    auto pixels = std::make_shared<std::vector<float>>(32 * size);
    for (int k = 0; k < 32; ++k)
    {
      bytes->CopyFrame(k, pixels->data() + k * size);
    }
    std::transform(pixels->begin(), pixels->end(), pixels->begin(),
                   [](float value) { return std::round(1023 * value) / 65535; });
    if (hasBlack)
    {
      std::fill_n(pixels->begin() + 20 * size, size, 0.0f);
    }
    tenBits->pixelType = Sweep::PixelType::Float32;
    tenBits->pixels = std::shared_ptr<const void>(pixels, pixels->data());
    const InspectedSweep inspected = Inspect(tenBits);
    EXPECT_EQ(KindsOf(inspected),
              hasBlack ? (Kinds{FindingKind::Contact, FindingKind::Levels}) : Kinds{FindingKind::Levels});
    EXPECT_EQ(inspected.frames.size(), hasBlack ? 31u : 32u);
  }
  Change(white, 0, 32, 0, white.width, [](double level) { return 2.5 * level + 20; });
  EXPECT_EQ(KindsOf(Inspect(white.AsSweep())), Kinds{FindingKind::Levels});
}

// What is dark in a byte is dark in more bits, where a byte would show none of it.
TEST(Inspection, EightBitsThatWereStoredInSixteenAreSaid)
{
  for (const double most : {5.0, 85.0, 255.0})
  {
    auto wide = std::make_shared<Sweep>(*PhantomFrames(1, 0.1).AsSweep());
    auto pixels = std::make_shared<std::vector<float>>(32 * wide->PixelsPerFrame());
    for (int k = 0; k < 32; ++k)
    {
      wide->CopyFrame(k, pixels->data() + k * wide->PixelsPerFrame());
    }
    std::transform(pixels->begin(), pixels->end(), pixels->begin(),
                   [most](float value) { return std::round(most * value) / 65535; });
    wide->pixelType = Sweep::PixelType::Float32;
    wide->pixels = std::shared_ptr<const void>(pixels, pixels->data());
    const InspectedSweep inspected = Inspect(wide);
    ASSERT_EQ(KindsOf(inspected), Kinds{FindingKind::Levels}) << most;
    EXPECT_NE(inspected.findings[0].evidence.find("--pixel-range"), std::string::npos);
  }
}

// What a training refuses is no good sweep.
TEST(Inspection, NothingToLearnIsSaid)
{
  for (const double level : {0.0, 5.0, 77.0, 255.0})
  {
    Frames frames = PhantomFrames(1);
    for (std::vector<double>& image : frames.images)
    {
      std::fill(image.begin(), image.end(), level);
    }
    const InspectedSweep inspected = Inspect(frames.AsSweep());
    const auto levels = std::find_if(inspected.findings.begin(), inspected.findings.end(),
                                     [](const bigus::Finding& one) { return one.kind == FindingKind::Levels; });
    ASSERT_NE(levels, inspected.findings.end()) << level;
    EXPECT_NE(levels->evidence.find(level == 0 ? "all pixels are black" : "one grey level"), std::string::npos);
  }
  Frames one = PhantomFrames(1);
  one.images.resize(1);
  one.poses.resize(1);
  one.times.resize(1);
  const InspectedSweep alone = Inspect(one.AsSweep());
  ASSERT_EQ(KindsOf(alone), Kinds{FindingKind::Poses});
  EXPECT_NE(alone.findings[0].evidence.find("one usable frame"), std::string::npos);
}

/// The sweep with its frames in another order, without times.
std::shared_ptr<const Sweep> Listed(Frames frames, const std::vector<int>& order)
{
  const Frames recorded = frames;
  frames.times.clear();
  for (std::size_t k = 0; k < order.size(); ++k)
  {
    frames.images[k] = recorded.images[order[k]];
    frames.poses[k] = recorded.poses[order[k]];
  }
  return frames.AsSweep();
}

TEST(Inspection, AWrongOrderWithoutTimesIsDoubted)
{
  for (const std::uint64_t seed : {1, 2, 3})
  {
    const Frames frames = PhantomFrames(seed);
    std::vector<int> shuffled = From(0, 32), twoStrokes, turned = From(0, 32);
    std::mt19937_64 random(seed);
    for (std::size_t k = 31; k > 0; --k)
    {
      std::swap(shuffled[k], shuffled[random() % (k + 1)]);
    }
    std::reverse(turned.begin(), turned.end());
    for (const int stroke : {0, 1})  // every other frame there, the others on the way back
    {
      for (int k = stroke; k < 32; k += 2)
      {
        twoStrokes.push_back(stroke ? 32 - k : k);
      }
    }
    for (const auto& [order, isWrong] :
         {std::pair(shuffled, true), {From(0, 32), false}, {twoStrokes, false}, {turned, false}})
    {
      const InspectedSweep inspected = Inspect(Listed(frames, order));
      const bool isSaid = std::any_of(inspected.findings.begin(), inspected.findings.end(),
                                      [](const bigus::Finding& one)
                                      { return one.evidence.find("in a wrong order") != std::string::npos; });
      EXPECT_EQ(isSaid, isWrong) << seed;
      EXPECT_EQ(inspected.frames, From(0, 32)) << seed;
    }
  }
}

// One doubt, and that of what is wrong: pictures would only give another name to it.
TEST(Inspection, MetresAndOnePoseForAllAreNoCentimetres)
{
  for (const bool isOnePose : {false, true})
  {
    Frames frames = PhantomFrames(1);
    for (Eigen::Matrix4d& pose : frames.poses)
    {
      pose = isOnePose ? frames.poses[0] : pose;
      pose.block<3, 1>(0, 3) *= isOnePose ? 1 : 1e-3;
    }
    for (const bigus::Finding& finding : Inspect(frames.AsSweep(), KeptKinds::Parse("all")).findings)
    {
      EXPECT_EQ(finding.evidence.find("centimetres"), std::string::npos) << finding.evidence;
    }
  }
}

// Speckle is as long along the path as across pictures, within a factor of three, so ten times less or more is doubted.
TEST(Inspection, TranslationsInCentimetresAreDoubted)
{
  for (const double factor : {0.1, 1.0, 20.0})
  {
    Frames frames = PhantomFrames(1);
    for (Eigen::Matrix4d& pose : frames.poses)
    {
      pose.block<3, 1>(0, 3) *= factor;
    }
    const auto sweep = frames.AsSweep();
    const InspectedSweep inspected = Inspect(sweep);
    EXPECT_EQ(inspected.sweep, sweep) << factor;
    EXPECT_EQ(KindsOf(inspected), factor == 1 ? Kinds{} : Kinds{FindingKind::Poses}) << factor;
    if (factor < 1)
    {
      EXPECT_NE(inspected.findings[0].evidence.find("centimetres"), std::string::npos);
    }
  }
  // A probe that rocks about the skin: the first row moves little, and rightly so.
  bigus::PhantomOptions options;
  options.frames = 32;
  options.width = 96;
  options.height = 80;
  options.pixelSize = 0.5;
  options.scattererDensity = 4;
  options.frameSpacing = 0.02;
  options.tilt = 12;
  options.speedVariation = 0;
  EXPECT_EQ(KindsOf(Inspect(std::make_shared<const Sweep>(bigus::Phantom(options).MakeSweep()))), Kinds{});
}

/// Whether only poses are doubted, because pictures do not slide as they say.
bool IsDirectionDoubted(const Frames& frames)
{
  const InspectedSweep inspected = Inspect(frames.AsSweep());
  return KindsOf(inspected) == Kinds{FindingKind::Poses} &&
         inspected.findings[0].evidence.find("pictures slide") != std::string::npos;
}

// Where the probe moves out of its picture, a transform that leads the other way says that it moves within.
TEST(Inspection, TransformsThatLeadTheOtherWayAreDoubted)
{
  const Frames made = PhantomFrames(1, 0.5, 48);
  Eigen::Isometry3d world = Eigen::Isometry3d::Identity();
  world.linear() = Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitX()).toRotationMatrix();
  world.translation() = Eigen::Vector3d(30, -80, 120);
  Frames right = made, inverse = made, transposed = made;
  for (std::size_t k = 0; k < made.poses.size(); ++k)
  {
    const Eigen::Matrix4d pixels = Eigen::Vector4d(0.5, 0.5, 1, 1).asDiagonal();  // mm a pixel
    Eigen::Isometry3d pose(Eigen::Matrix4d(world.matrix() * made.poses[k] * pixels.inverse()));
    right.poses[k] = pose.matrix() * pixels;
    inverse.poses[k] = pose.inverse().matrix() * pixels;
    pose.linear().transposeInPlace();
    transposed.poses[k] = pose.matrix() * pixels;
  }
  EXPECT_EQ(KindsOf(Inspect(right.AsSweep())), Kinds{});
  EXPECT_TRUE(IsDirectionDoubted(inverse));
  EXPECT_TRUE(IsDirectionDoubted(transposed));
}

// A window that slides along wider pictures, as a probe does that is moved sideways.
TEST(Inspection, PicturesThatSlideMustSlideAsPosesSay)
{
  const Frames wide = PhantomFrames(2);
  const int width = 64;
  for (const double side : {1.0, -1.0})
  {
    Frames frames = wide;
    frames.width = width;
    for (std::size_t k = 0; k < wide.images.size(); ++k)
    {
      frames.images[k].clear();
      for (int row = 0; row < wide.height; ++row)
      {
        const auto first = wide.images[k].begin() + row * wide.width + static_cast<std::ptrdiff_t>(k);
        frames.images[k].insert(frames.images[k].end(), first, first + width);
      }
      frames.poses[k].col(3) += side * static_cast<double>(k) * frames.poses[k].col(0);
    }
    if (side > 0)
    {
      EXPECT_EQ(KindsOf(Inspect(frames.AsSweep())), Kinds{});
    }
    else
    {
      EXPECT_TRUE(IsDirectionDoubted(frames));
    }
  }
}

// A jump near an end of the sweep is not taken for the path, nor what the path goes on with for a jump.
TEST(Inspection, AJumpNearAnEndIsFoundWhereItIs)
{
  for (const int count : {1, 2})
  {
    for (const int first : {1, 2, 27, 29, 30 - count + 1})
    {
      Frames frames = PhantomFrames(3);
      for (int k = first; k < first + count; ++k)
      {
        frames.poses[k](1, 3) += 9;
      }
      const InspectedSweep inspected = Inspect(frames.AsSweep());
      ASSERT_EQ(KindsOf(inspected), Kinds{FindingKind::Tracking}) << first << " " << count;
      EXPECT_EQ(inspected.findings[0].frames, From(first, count)) << first << " " << count;
    }
  }
}

// Where poses stand for two or three frames each it is not known which are right, and all pictures are news: that is said.
// There and back, fewer than half of them stand, for the hand slows down where it turns.
TEST(Inspection, ATrackerSlowerThanTheVideoIsSaid)
{
  const Frames once = PhantomFrames(3, 0.5, 40);
  Frames thereAndBack = once;
  Random random(5);
  for (int k = 38; k >= 0; --k)
  {
    thereAndBack.images.push_back(once.images[k]);
    thereAndBack.poses.push_back(once.poses[k]);
    thereAndBack.times.push_back(thereAndBack.times.back() + 0.05);
  }
  thereAndBack.AddNoise(random, 1);
  for (const Frames* const recorded : {&once, static_cast<const Frames*>(&thereAndBack)})
  {
    for (const int held : {2, 3})
    {
      Frames frames = *recorded;
      const int all = static_cast<int>(frames.poses.size());
      for (int k = 0; k < all; ++k)
      {
        frames.poses[k] = recorded->poses[k < 4 ? k : k - k % held];  // the first are as they should be
      }
      const InspectedSweep inspected = Inspect(frames.AsSweep());
      EXPECT_EQ(inspected.frames, From(0, all)) << held;
      ASSERT_FALSE(inspected.findings.empty()) << held;
      EXPECT_EQ(inspected.findings[0].kind, FindingKind::Tracking) << held;
      EXPECT_FALSE(inspected.findings[0].isApplied) << held;
      EXPECT_NE(inspected.findings[0].evidence.find("slower than the pictures"), std::string::npos) << held;
    }
  }
}

TEST(Inspection, MirroredPicturesAreSaid)
{
  for (const bool isAcross : {true, false})
  {
    Frames frames = PhantomFrames(2);
    for (std::size_t k = 12; k < 20; ++k)
    {
      const std::vector<double> image = frames.images[k];
      for (int p = 0; p < 96 * 80; ++p)
      {
        const int x = p % 96, y = p / 96;
        frames.images[k][p] = image[isAcross ? y * 96 + 95 - x : (79 - y) * 96 + x];
      }
    }
    const InspectedSweep inspected = Inspect(frames.AsSweep());
    ASSERT_EQ(KindsOf(inspected), Kinds{FindingKind::Depth}) << isAcross;
    EXPECT_EQ(inspected.findings[0].frames, (std::vector<int>{12, 20})) << isAcross;
    EXPECT_NE(inspected.findings[0].evidence.find("mirrored"), std::string::npos);
    EXPECT_FALSE(inspected.findings[0].isApplied);
  }
}

TEST(Inspection, TextOfTheScreenIsFilled)
{
  for (const unsigned seed : {1, 2, 3})
  {
    for (const double level : {180.0, 235.0, 255.0})
    {
      Frames frames = PhantomFrames(seed);
      Random random(seed);
      std::vector<std::size_t> text;
      for (int y = 4; y < 11; ++y)
      {
        for (int x = 10; x < 60; ++x)
        {
          if (random.Chance(0.45))
          {
            text.push_back(static_cast<std::size_t>(y) * 96 + x);
          }
        }
      }
      Frames shown = frames;
      shown.AddNoise(random, 0.5);
      for (std::vector<double>& image : shown.images)
      {
        for (const std::size_t pixel : text)
        {
          image[pixel] = level;
        }
      }
      const auto sweep = shown.AsSweep();
      const InspectedSweep inspected = Inspect(sweep);
      ASSERT_EQ(KindsOf(inspected), Kinds{FindingKind::Overlay}) << seed << " " << level;
      EXPECT_EQ(inspected.sweep->mask, nullptr);
      // Filled from its surroundings the picture is nearer to the truth than with the text; elsewhere nothing changes.
      std::vector<float> before(sweep->PixelsPerFrame()), after(before.size());
      sweep->CopyFrame(7, before.data());
      inspected.sweep->CopyFrame(7, after.data());
      const std::vector<double>& truth = frames.images[7];
      double errorBefore = 0, errorAfter = 0;
      for (std::size_t pixel = 0; pixel < before.size(); ++pixel)
      {
        const std::size_t y = pixel / 96, x = pixel % 96;
        errorBefore += std::pow(255 * before[pixel] - truth[pixel], 2);
        errorAfter += std::pow(255 * after[pixel] - truth[pixel], 2);
        if (y > 13 || x > 62)
        {
          EXPECT_EQ(before[pixel], after[pixel]) << x << " " << y;
        }
      }
      EXPECT_LT(errorAfter, (level < 200 ? 1 : 0.5) * errorBefore) << seed << " " << level;
    }
  }
}

// Skin that hardly changes, once averaged, looks as steady as text; text was looked for before.
TEST(Inspection, NoTextIsFoundInAveragedPixels)
{
  Frames frames = PhantomFrames(1);
  for (std::vector<double>& image : frames.images)
  {
    for (int p = 0; p < 96 * 80; ++p)
    {
      const int x = p % 96, y = p / 96;
      image[p] = y >= 4 && y < 8 && x >= 20 && x < 60 ? 220 : image[p];
    }
  }
  const auto sweep = frames.AsSweep();
  EXPECT_EQ(KindsOf(Inspect(sweep)), Kinds{FindingKind::Overlay});
  EXPECT_EQ(KindsOf(Inspect(std::make_shared<const Sweep>(sweep->Reduced(2)))), Kinds{});
  EXPECT_EQ(sweep->Reduced(2).Reduced(2).Subset({1, 2}).averaged, 4);
}

/// A convex probe's sweep, or a linear probe's in the middle of a screen, and which pixels it lights.
Frames FramesOnScreen(bool isFan, std::vector<std::uint8_t>& lit)
{
  if (!isFan)
  {
    Frames frames = PhantomFrames(1);
    frames.width = 140;
    frames.height = 110;
    lit.assign(140 * 110, 0);
    for (std::vector<double>& image : frames.images)
    {
      std::vector<double> screen(140 * 110, 0);
      for (int y = 0; y < 80; ++y)
      {
        std::copy_n(image.begin() + 96 * y, 96, screen.begin() + 140 * (y + 20) + 30);
        std::fill_n(lit.begin() + 140 * (y + 20) + 30, 96, std::uint8_t(1));
      }
      image = screen;
    }
    return frames;
  }
  bigus::PhantomOptions options;
  options.probe = bigus::ProbeKind::Convex;
  options.frames = 12;
  options.width = 96;
  options.height = 80;
  options.pixelSize = 0.7;
  options.scattererDensity = 4;
  const Sweep sweep = bigus::Phantom(options).MakeSweep();
  lit = *sweep.mask;
  return FramesOf(sweep);
}

/// Of the pixels beside the picture the share that is black in every frame, and of those within the share that is as
/// recorded.
std::pair<double, double> BlackAndKept(const InspectedSweep& inspected, const std::vector<std::uint8_t>& lit)
{
  const std::size_t pixels = lit.size();
  std::vector<float> before(pixels), after(pixels);
  std::vector<std::uint8_t> isBlack(pixels, 1), isKept(pixels, 1);
  for (int k = 0; k < inspected.sweep->NumberOfFrames(); ++k)
  {
    inspected.recorded->CopyFrame(inspected.frames[k], before.data());
    inspected.sweep->CopyFrame(k, after.data());
    for (std::size_t p = 0; p < pixels; ++p)
    {
      isBlack[p] = isBlack[p] && after[p] == 0;
      isKept[p] = isKept[p] && after[p] == before[p];
    }
  }
  double beside = 0, black = 0, within = 0, kept = 0;
  for (std::size_t p = 0; p < pixels; ++p)
  {
    (lit[p] ? within : beside) += 1;
    black += !lit[p] && isBlack[p];
    kept += lit[p] && isKept[p];
  }
  return {black / beside, kept / within};
}

// A hull of pixels may have either side of the rim, which is one pixel wide: 5 % of the corners here. The phantom's
// pictures are dim at their edges.
TEST(Inspection, WhatIsBesideAPictureBecomesBlack)
{
  for (const bool isFan : {true, false})
  {
    std::vector<std::uint8_t> lit;
    const Frames clean = FramesOnScreen(isFan, lit);
    EXPECT_EQ(KindsOf(Inspect(clean.AsSweep())), Kinds{}) << "black corners";
    for (const auto& [ground, noise] :
         {std::pair(0.0, 0.6), {0.0, 2.0}, {3.0, 1.0}, {20.0, 0.0}, {28.0, 2.0}, {60.0, 2.0}})
    {
      Random random(7);
      Frames frames = clean;
      for (std::vector<double>& image : frames.images)
      {
        for (std::size_t p = 0; p < image.size(); ++p)
        {
          image[p] = (lit[p] ? image[p] : ground) + noise * random.Normal();
        }
        for (int y = 2; y < 6; ++y)  // a number, beside the picture, that is another in every frame
        {
          image[static_cast<std::size_t>(y) * frames.width + 3 + random.Integer(0, 5)] = 235;
        }
      }
      const auto sweep = frames.AsSweep();
      const InspectedSweep inspected = Inspect(sweep);
      ASSERT_EQ(KindsOf(inspected), Kinds{FindingKind::Fan}) << isFan << " " << ground << " " << noise;
      const auto [black, kept] = BlackAndKept(inspected, lit);
      EXPECT_GT(black, 0.95) << isFan << " " << ground << " " << noise;
      EXPECT_GT(kept, 0.98) << isFan << " " << ground << " " << noise;
      EXPECT_EQ(Inspect(sweep, KeptKinds::Parse("fan")).sweep, sweep);
    }
  }
}

// Few echoes amid the noise of a receiver, as wires in water give, are no picture: all of a frame was lit.
TEST(Inspection, WiresInWaterAreNoFan)
{
  Random random(5);
  Frames frames = PhantomFrames(1);
  for (std::size_t k = 0; k < frames.images.size(); ++k)
  {
    for (std::size_t p = 0; p < frames.images[k].size(); ++p)
    {
      const int x = static_cast<int>(p) % 96, y = static_cast<int>(p) / 96, at = 20 + static_cast<int>(k) / 2;
      const bool isWire = std::abs(x - at) < 3 && (y % 25 > 18);
      frames.images[k][p] = (isWire ? random.Uniform(80, 250) : 1) + 1.5 * random.Normal();
    }
  }
  const InspectedSweep inspected = Inspect(frames.AsSweep());
  EXPECT_TRUE(std::none_of(inspected.findings.begin(), inspected.findings.end(),
                           [](const bigus::Finding& finding) { return finding.kind == FindingKind::Fan; }));
}

TEST(Inspection, ADarkPictureIsNotBesideAFan)
{
  Frames frames = PhantomFrames(1);  // dark but for its middle, and there is noise everywhere
  Random random(3);
  for (std::vector<double>& image : frames.images)
  {
    for (std::size_t p = 0; p < image.size(); ++p)
    {
      const std::size_t x = p % 96;
      image[p] = x < 24 ? 0.1 * image[p] + std::abs(4 * random.Normal()) : image[p];
    }
  }
  const auto sweep = frames.AsSweep();
  for (const bigus::Finding& finding : Inspect(sweep).findings)
  {
    EXPECT_NE(finding.kind, FindingKind::Fan);
  }
}

TEST(Inspection, KeptKindsAreFoundAndLeft)
{
  Frames frames = PhantomFrames(1);
  frames.images[10].assign(frames.images[10].size(), 0);
  const auto sweep = frames.AsSweep();
  const InspectedSweep kept = Inspect(sweep, KeptKinds::Parse("contact+overlay"));
  EXPECT_EQ(kept.sweep, sweep);
  ASSERT_EQ(KindsOf(kept), Kinds{FindingKind::Contact});
  EXPECT_FALSE(kept.findings[0].isApplied);
  EXPECT_EQ(kept.findings[0].frames, From(10, 1));
  EXPECT_EQ(Inspect(sweep).frames.size(), 31u);
  EXPECT_EQ(KeptKinds::Parse("contact+overlay").ToString(), "contact+overlay");
  EXPECT_EQ(KeptKinds::Parse("overlay+contact+rest+tracking+order+repeat+fan").ToString(), "all");
  EXPECT_EQ(KeptKinds::Parse("none").ToString(), "none");
  const std::string message = bigus::test::Message([] { KeptKinds::Parse("contact+dust"); });
  EXPECT_NE(message.find("'dust'"), std::string::npos) << message;
  EXPECT_NE(message.find("overlay"), std::string::npos) << message;
}

// Two scenes, one after the other, so that neighbours are alike but for once, on frames of any size.
// Parts of small pictures are alike by chance, so they seemed to be larger by 0.5 and 0.71 where a probe moves fast, and a
// quarter of their speckle seemed to be noise.
TEST(Inspection, NothingIsFoundInSmallPicturesByChance)
{
  bigus::PhantomOptions options;
  options.frames = 48;
  options.passes = 2;
  options.width = options.height = 32;
  options.pixelSize = 0.4;
  for (const unsigned seed : {1, 7, 11})
  {
    options.seed = seed;
    const InspectedSweep inspected = Inspect(std::make_shared<const Sweep>(bigus::Phantom(options).MakeSweep()));
    EXPECT_EQ(KindsOf(inspected), Kinds{}) << seed;
  }
}

TEST(Inspection, FramesMayBeSmall)
{
  for (const auto& [width, height] : {std::pair(1, 1), {2, 9}, {4, 4}, {5, 4}, {4, 40}, {40, 5}, {30, 31}, {33, 20}})
  {
    Random random(3);
    Frames frames{width, height, {}, {}, {}};
    std::vector<double> scene(static_cast<std::size_t>(width) * height);
    for (int k = 0; k < 24; ++k)
    {
      for (double& level : scene)
      {
        level = k % 12 ? level + random.Uniform(-4, 4) : random.Uniform(40, 200);
      }
      frames.images.push_back(scene);
      frames.poses.push_back(Eigen::Matrix4d::Identity());
      frames.poses.back()(2, 3) = 0.5 * k;
    }
    EXPECT_NO_THROW(Inspect(frames.AsSweep())) << width << " x " << height;
  }
}

TEST(Inspection, ASceneThatNeverChangesIsLeftAlone)
{
  Frames frames = PhantomFrames(1);
  for (std::vector<double>& image : frames.images)
  {
    image = frames.images[0];
  }
  EXPECT_EQ(Inspect(frames.AsSweep()).frames, From(0, 32));  // one picture alone would be left
}

TEST(Inspection, WhatHeldOutFramesShowHasNoPart)
{
  Frames frames = PhantomFrames(1);
  for (const int black : {5, 6, 20})
  {
    frames.images[black].assign(frames.images[black].size(), 0);
  }
  const InspectedSweep inspected = Inspect(frames.AsSweep(), {}, 4);  // holds out 2, 6, 10, ...
  ASSERT_EQ(KindsOf(inspected), Kinds{FindingKind::Contact});
  EXPECT_EQ(inspected.findings[0].frames, (std::vector<int>{5, 20}));
  std::vector<int> heldOut;
  for (const int frame : inspected.heldOut)
  {
    heldOut.push_back(inspected.frames[frame]);
  }
  EXPECT_EQ(heldOut, (std::vector<int>{2, 6, 10, 14, 18, 22, 26, 30}));
}

TEST(Inspection, TrainingNumbersFramesAsRecorded)
{
  Frames frames = PhantomFrames(1);
  for (const int black : {5, 6, 20})
  {
    frames.images[black].assign(frames.images[black].size(), 0);
  }
  const auto sweep = frames.AsSweep();
  bigus::TrainerOptions options;
  options.automatic = false;
  options.gaussians = 500;
  options.iterations = 10;
  options.virtualPlanes = 0;
  options.holdOut = 4;
  const bigus::TrainingResult result = bigus::Train(sweep, options);
  ASSERT_EQ(result.findings.size(), 1u);
  std::vector<int> used = result.trainingFrames;
  used.insert(used.end(), result.heldOutFrames.begin(), result.heldOutFrames.end());
  std::sort(used.begin(), used.end());
  std::vector<int> expected = From(0, 32);
  for (const int black : {20, 5})  // 6 is held out
  {
    expected.erase(expected.begin() + black);
  }
  EXPECT_EQ(used, expected);
  EXPECT_EQ(result.imageToReference, frames.poses);
  bigus::SetOption(options, "Keep", "contact");
  EXPECT_EQ(bigus::Train(sweep, options).trainingFrames.size(), 24u);
}

TEST(Inspection, SequencesGivenTwiceOrFarApartAreDoubted)
{
  const auto said = [](const Frames& other)
  {
    std::string text;
    for (const bigus::Finding& finding :
         bigus::Inspect(bigus::Join({PhantomFrames(1).AsSweep(), other.AsSweep()}), {}, 0).findings)
    {
      text += finding.evidence;
    }
    return text;
  };
  Frames other = PhantomFrames(1);
  EXPECT_NE(said(other).find("given twice"), std::string::npos) << said(other);
  const auto move = [&other](double distance)
  {
    for (Eigen::Matrix4d& pose : other.poses)
    {
      pose(0, 3) += distance;
    }
  };
  move(30);
  EXPECT_EQ(said(other), "");
  move(500);
  EXPECT_NE(said(other).find("from the nearest other"), std::string::npos) << said(other);
}

}  // namespace
