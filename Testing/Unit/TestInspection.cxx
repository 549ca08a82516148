// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Damaged copies of a phantom's sweep: what was done to them is known, so that what is found can be counted.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <tuple>

#include "Core/Inspection/Inspection.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/OptionList.h"
#include "Support/Errors.h"
#include "Support/Random.h"

namespace
{

using bigus::FindingKind;
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
  const Sweep sweep = bigus::Phantom(options).MakeSweep();
  Frames result{sweep.width, sweep.height, {}, sweep.imageToReference, sweep.timestamps};
  std::vector<float> image(sweep.PixelsPerFrame());
  for (int k = 0; k < frames; ++k)
  {
    sweep.CopyFrame(k, image.data());
    result.images.emplace_back(image.begin(), image.end());
    for (double& level : result.images.back())
    {
      level *= 255;
    }
  }
  made[{seed, spacing, frames}] = result;
  return result;
}

std::vector<int> From(int first, int count)
{
  std::vector<int> list(count);
  std::iota(list.begin(), list.end(), first);
  return list;
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
  for (const std::uint64_t seed : {1, 2})
  {
    for (const double spacing : {0.1, 0.5, 1.0})
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

/// What a damage should lead to: the kind, and the frames that are gone.
struct Damage
{
  std::string name;
  FindingKind kind;
  std::function<std::vector<int>(Frames&, Random&)> make;
};

std::vector<Damage> Damages()
{
  std::vector<Damage> all;
  for (const int at : {0, 15, 31})
  {
    for (const double jitter : {0.0, 0.02, 0.2})
    {
      for (const double noise : {1.0, 4.0})
      {
        const int count = 12;
        all.push_back({"rest at " + std::to_string(at) + ", jitter " + std::to_string(jitter), FindingKind::Rest,
                       [=](Frames& frames, Random& random)
                       {
                         frames.Repeat(at, count);
                         for (int k = at; k <= at + count; ++k)
                         {
                           for (int axis = 0; axis < 3; ++axis)
                           {
                             frames.poses[k](axis, 3) += jitter * random.Normal();
                           }
                         }
                         frames.AddNoise(random, noise);
                         return From(at, count + 1);
                       }});
      }
    }
    for (const double left : {0.0, 0.05})
    {
      const int first = std::min(at, 27);
      all.push_back({"lost contact at " + std::to_string(first), FindingKind::Contact,
                     [=](Frames& frames, Random& random)
                     {
                       for (int k = first; k < first + 5; ++k)
                       {
                         std::transform(frames.images[k].begin(), frames.images[k].end(), frames.images[k].begin(),
                                        [&](double level) { return left * level; });
                       }
                       frames.AddNoise(random, 0.5);
                       return From(first, 5);
                     }});
    }
    for (const double noise : {10.0, 30.0})
    {
      const int first = std::min(at, 27);
      all.push_back({"noise of the receiver at " + std::to_string(first), FindingKind::Contact,
                     [=](Frames& frames, Random& random)
                     {
                       for (int k = first; k < first + 4; ++k)
                       {
                         for (double& level : frames.images[k])
                         {
                           level = std::abs(noise * random.Normal());
                         }
                       }
                       return From(first, 4);
                     }});
    }
    for (const double compression : {0.0, 0.6})
    {
      for (const int count : {1, 3, 9})
      {
        const int first = std::min(at, 31 - count);
        all.push_back({"picture of " + std::to_string(first) + " again " + std::to_string(count) + " times",
                       FindingKind::Repeat,
                       [=](Frames& frames, Random& random)
                       {
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
                       }});
      }
    }
  }
  return all;
}

TEST(Inspection, DamagedCopiesAreFoundFrameByFrame)
{
  int cases = 0, wrong = 0;
  for (const Damage& damage : Damages())
  {
    for (const unsigned seed : {1, 2, 3})
    {
      Frames frames = PhantomFrames(seed);
      Random random(100 * seed + 7);
      std::vector<int> expected = damage.make(frames, random);
      const InspectedSweep inspected = Inspect(frames.AsSweep());
      std::vector<int> gone;
      for (const bigus::Finding& finding : inspected.findings)
      {
        EXPECT_EQ(finding.kind, damage.kind) << damage.name << ", seed " << seed;
        EXPECT_TRUE(finding.isApplied);
        gone.insert(gone.end(), finding.frames.begin(), finding.frames.end());
      }
      if (damage.kind == FindingKind::Rest && gone.size() + 1 == expected.size())  // one of them stays, whichever
      {
        std::vector<int> stays;
        std::set_difference(expected.begin(), expected.end(), gone.begin(), gone.end(), std::back_inserter(stays));
        EXPECT_EQ(stays.size(), 1u);
        gone = expected;
      }
      ++cases;
      wrong += gone != expected;
      EXPECT_EQ(gone, expected) << damage.name << ", seed " << seed;
    }
  }
  RecordProperty("cases", cases);
  RecordProperty("wrong", wrong);
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
  EXPECT_EQ(KeptKinds::Parse("overlay+contact+rest+order+repeat").ToString(), "all");
  EXPECT_EQ(KeptKinds::Parse("none").ToString(), "none");
  const std::string message = bigus::test::Message([] { KeptKinds::Parse("contact+dust"); });
  EXPECT_NE(message.find("'dust'"), std::string::npos) << message;
  EXPECT_NE(message.find("overlay"), std::string::npos) << message;
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

}  // namespace
