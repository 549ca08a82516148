// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Pixels beyond the memory limit lie in files, hold what was written, and train the same field.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <numeric>
#include <string>
#include <thread>

#include "Core/Model/Error.h"
#include "Core/Model/PixelMemory.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Trainer/Trainer.h"

namespace
{

constexpr std::size_t kMegabyte = 1 << 20;

/// Takes the limit back, and TMPDIR.
class PixelMemory : public testing::Test
{
protected:
  PixelMemory()
  {
    if (const char* folder = std::getenv("TMPDIR"))
    {
      folder_ = folder;
    }
  }
  ~PixelMemory() override
  {
    bigus::LimitPixelMemory(0);
    folder_.empty() ? unsetenv("TMPDIR") : setenv("TMPDIR", folder_.c_str(), 1);
  }

private:
  std::string folder_;
};

TEST_F(PixelMemory, WhatLiesInAFileStaysWhenItsPagesAreLetGo)
{
  bigus::LimitPixelMemory(1);  // everything is more than that
  const auto small = bigus::AllocatePixels<int>(16);
  EXPECT_EQ(bigus::PixelBytesInFiles(), 0u);  // not worth a file
  const std::size_t count = 8 * kMegabyte / sizeof(int);
  auto pixels = bigus::AllocatePixels<int>(count);
  EXPECT_EQ(bigus::PixelBytesInFiles(), 8 * kMegabyte);
  EXPECT_TRUE(std::all_of(pixels.get(), pixels.get() + count, [](int pixel) { return pixel == 0; }));
  std::iota(pixels.get(), pixels.get() + count, 7);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  int expected = 7;
  EXPECT_TRUE(std::all_of(pixels.get(), pixels.get() + count, [&](int pixel) { return pixel == expected++; }));
  pixels.reset();
  EXPECT_EQ(bigus::PixelBytesInFiles(), 0u);
}

TEST_F(PixelMemory, HalfOfTheLimitIsFilledFirst)
{
  bigus::LimitPixelMemory(8 * kMegabyte);
  const auto first = bigus::AllocatePixels<char>(3 * kMegabyte);
  EXPECT_EQ(bigus::PixelBytesInFiles(), 0u);
  const auto second = bigus::AllocatePixels<char>(3 * kMegabyte);
  EXPECT_EQ(bigus::PixelBytesInFiles(), 3 * kMegabyte);
}

TEST_F(PixelMemory, AFolderThatTakesNoFileIsNamed)
{
  bigus::LimitPixelMemory(1);
  setenv("TMPDIR", "/nowhere/at/all", 1);
  try
  {
    bigus::AllocatePixels<char>(2 * kMegabyte);
    FAIL() << "no error";
  }
  catch (const bigus::Error& error)
  {
    EXPECT_NE(std::string(error.what()).find("/nowhere/at/all"), std::string::npos) << error.what();
  }
  EXPECT_EQ(bigus::PixelBytesInFiles(), 0u);
}

TEST_F(PixelMemory, AFieldIsTheSameBitsWhereverItsSweepLies)
{
  bigus::PhantomOptions options;
  options.frames = 40;
  options.width = options.height = 192;
  bigus::TrainerOptions training;
  training.automatic = false;
  training.gaussians = 300;
  training.iterations = 3;
  training.virtualPlanes = 2;
  training.holdOut = 4;
  bigus::GaussianField fields[2];
  for (const bool isLimited : {false, true})
  {
    bigus::LimitPixelMemory(isLimited ? 1 : 0);
    const auto sweep = std::make_shared<const bigus::Sweep>(bigus::Phantom(options).MakeSweep());
    EXPECT_EQ(bigus::PixelBytesInFiles(), isLimited ? 40u * 192 * 192 : 0u);
    fields[isLimited] = bigus::Train(sweep, training).field;
  }
  EXPECT_EQ(fields[0].means, fields[1].means);
  EXPECT_EQ(fields[0].scales, fields[1].scales);
  EXPECT_EQ(fields[0].rotations, fields[1].rotations);
  EXPECT_EQ(fields[0].reflectivities, fields[1].reflectivities);
}

}  // namespace
