// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Messages of the OpenIGTLink protocol. Testing/Command/test_live.py compares with messages that are made there.
#include <gtest/gtest.h>

#include <limits>

#include "Core/Model/Error.h"
#include "IO/Formats/OpenIgtLink.h"

namespace bigus::test
{
namespace
{

IgtImage Picture()
{
  IgtImage image;
  image.width = 4;
  image.height = 3;
  image.pixels = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 255};
  image.imageToWorld << 0, 0.5, 0, 10,  //
      0.25, 0, 0, -20,                  //
      0, 0, 1, 30,                      //
      0, 0, 0, 1;
  return image;
}

std::vector<std::uint8_t> BodyOf(const std::vector<std::uint8_t>& message)
{
  return {message.begin() + kIgtHeaderBytes, message.end()};
}

TEST(OpenIgtLink, WhatIsPackedReadsBack)
{
  const std::vector<std::uint8_t> message = PackIgtImage("Image", 1234.75, Picture());
  const IgtHeader header = ParseIgtHeader(message.data());
  EXPECT_EQ(header.type, "IMAGE");
  EXPECT_EQ(header.device, "Image");
  EXPECT_EQ(header.timestamp, 1234.75);
  const IgtImage image = ParseIgtImage(header, BodyOf(message));
  EXPECT_EQ(image.pixels, Picture().pixels);
  EXPECT_TRUE(image.imageToWorld.isApprox(Picture().imageToWorld, 1e-6));
  const std::vector<std::uint8_t> pose = PackIgtTransform("Probe", 2, Picture().imageToWorld);
  EXPECT_EQ(ParseIgtTransform(ParseIgtHeader(pose.data()), BodyOf(pose)), Picture().imageToWorld);
}

TEST(OpenIgtLink, AnyTimeCanBeSent)
{
  for (const double time : {-1.0, 4294967296.0, 1e300, std::numeric_limits<double>::quiet_NaN()})
  {
    const std::vector<std::uint8_t> message = PackIgtTransform("Probe", time, Eigen::Matrix4d::Identity());
    const double read = ParseIgtHeader(message.data()).timestamp;
    EXPECT_GE(read, 0);
    EXPECT_LE(read, 4294967296.0);
  }
}

TEST(OpenIgtLink, EveryCutAndEveryChangedByteIsFound)
{
  const std::vector<std::uint8_t> message = PackIgtImage("Image", 1, Picture()), body = BodyOf(message);
  const IgtHeader header = ParseIgtHeader(message.data());
  for (std::size_t size = 0; size < body.size(); ++size)
  {
    EXPECT_THROW(ParseIgtImage(header, {body.begin(), body.begin() + static_cast<std::ptrdiff_t>(size)}), Error);
  }
  for (std::size_t k = 0; k < body.size(); ++k)
  {
    std::vector<std::uint8_t> changed = body;
    changed[k] ^= 0x10;
    EXPECT_THROW(ParseIgtImage(header, changed), Error) << "byte " << k;
  }
  std::vector<std::uint8_t> huge = message;
  huge[42] = 1;  // 2^56 bytes
  EXPECT_THROW(ParseIgtHeader(huge.data()), Error);
}

}  // namespace
}  // namespace bigus::test
