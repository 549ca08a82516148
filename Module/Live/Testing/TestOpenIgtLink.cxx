// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Messages of the OpenIGTLink protocol. test_live.py compares with messages that are made there.
#include <gtest/gtest.h>

#include <limits>

#include "Core/Model/Error.h"
#include "Live/OpenIgtLink.h"
#include "Live/Testing/TrackedFrame.h"
#include "Support/Random.h"

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

/// A whole message with another body.
IgtHeader HeaderOf(const std::vector<std::uint8_t>& message, const std::vector<std::uint8_t>& body)
{
  IgtHeader header = ParseIgtHeader(message.data());
  header.bodyBytes = body.size();
  header.checksum = 0;
  return header;
}

TEST(OpenIgtLink, ColoursBecomeTheGreyOfFiles)
{
  const std::vector<std::uint8_t> message = PackIgtImage("Image", 1, Picture());
  const std::vector<std::uint8_t> colours = {200, 100, 50, 255, 0, 0, 0, 255, 0, 0, 0, 255};
  for (const int components : {3, 4})
  {
    std::vector<std::uint8_t> body = BodyOf(message);
    body[2] = static_cast<std::uint8_t>(components);
    body.resize(body.size() - 12);
    for (std::size_t k = 0; k < 12; ++k)
    {
      const auto colour = colours.begin() + 3 * (k % 4);
      body.insert(body.end(), colour, colour + 3);
      body.insert(body.end(), static_cast<std::size_t>(components - 3), 9);
    }
    const std::vector<std::uint8_t> greys = ParseIgtImage(HeaderOf(message, body), body).pixels;
    ASSERT_EQ(greys.size(), 12u);
    // 0.299, 0.587 and 0.114, rounded.
    EXPECT_EQ((std::vector<std::uint8_t>{greys.begin(), greys.begin() + 4}),
              (std::vector<std::uint8_t>{124, 76, 150, 29}));
    EXPECT_EQ(greys[11], 29);
    body.pop_back();
    EXPECT_THROW(ParseIgtImage(HeaderOf(message, body), body), Error);
  }
}

/// CRC-64 of ECMA-182, bit by bit.
std::uint64_t PlainChecksum(const std::vector<std::uint8_t>& bytes)
{
  std::uint64_t sum = 0;
  for (const std::uint8_t byte : bytes)
  {
    sum ^= std::uint64_t(byte) << 56;
    for (int bit = 0; bit < 8; ++bit)
    {
      sum = sum >> 63 ? sum << 1 ^ 0x42F0E1EBA9EA3693u : sum << 1;
    }
  }
  return sum;
}

TEST(OpenIgtLink, ChecksumsOfEveryLengthAreThoseOfTheDefinition)
{
  const std::string check = "123456789";
  ASSERT_EQ(PlainChecksum({check.begin(), check.end()}), 0x6C40DF5F0B497347u);  // as tables of CRCs give it
  Random random(3);
  for (int width = 1; width <= 70; ++width)
  {
    IgtImage image = Picture();
    image.width = width;
    image.height = 1;
    image.pixels.resize(static_cast<std::size_t>(width));
    for (std::uint8_t& pixel : image.pixels)
    {
      pixel = static_cast<std::uint8_t>(random.Integer(0, 255));
    }
    const std::vector<std::uint8_t> message = PackIgtImage("Image", 1, image);
    EXPECT_EQ(ParseIgtHeader(message.data()).checksum, PlainChecksum(BodyOf(message))) << width;
  }
}

TEST(OpenIgtLink, TextsReadBackAndDamagedOnesAreRefused)
{
  const std::string text = R"({"plane": [1, 2]})";
  const std::vector<std::uint8_t> message = PackIgtString("View", 3, text);
  const IgtHeader header = ParseIgtHeader(message.data());
  EXPECT_EQ(header.type, "STRING");
  EXPECT_EQ(ParseIgtString(header, BodyOf(message)), text);
  for (const std::size_t bytes : {std::size_t(0), std::size_t(3), text.size() + 3, text.size() + 5})
  {
    std::vector<std::uint8_t> body = BodyOf(message);
    body.resize(bytes, 'x');
    IgtHeader other = header;
    other.bodyBytes = bytes;
    other.checksum = 0;
    EXPECT_THROW(ParseIgtString(other, body), Error) << bytes;
  }
  EXPECT_THROW(PackIgtString("View", 3, std::string(65536, 'x')), Error);
}

TEST(OpenIgtLink, ArraysAreAsTheProtocolHasThem)
{
  const std::vector<std::uint8_t> body = BodyOf(PackIgtArray("View", 0, {1, 2}, {1.0f, -2.5f}));
  const std::vector<std::uint8_t> expected = {10, 2, 0, 1, 0, 2, 0x3F, 0x80, 0, 0, 0xC0, 0x20, 0, 0};  // IEEE 754
  EXPECT_EQ(body, expected);
  EXPECT_THROW(PackIgtArray("View", 0, {1, 3}, {1.0f}), Error);
  EXPECT_THROW(PackIgtArray("View", 0, {65536, 0}, {}), Error);
}

struct Message
{
  explicit Message(const std::string& bytes)
      : header(ParseIgtHeader(reinterpret_cast<const std::uint8_t*>(bytes.data()))),
        body(bytes.begin() + kIgtHeaderBytes, bytes.end())
  {
  }
  IgtHeader header;
  std::vector<std::uint8_t> body;
};

TEST(OpenIgtLink, TrackedFramesOfAllVersionsOfPlus)
{
  const std::map<std::string, std::string> fields = {{"ProbeToTrackerTransform", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"},
                                                     {"ProbeToTrackerTransformStatus", "OK"}};
  const Message old(TrackedFrameMessage(fields, false));
  EXPECT_EQ(old.header.timestamp, 1.5);
  const IgtTrackedFrame early = ParseIgtTrackedFrame(old.header, old.body);
  EXPECT_EQ(early.image.width, 4);
  EXPECT_EQ(early.image.height, 3);
  EXPECT_EQ(early.image.pixels, (std::vector<std::uint8_t>{10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21}));
  EXPECT_EQ(early.fields, fields);
  EXPECT_FALSE(early.hasPose);

  const Message now(TrackedFrameMessage(fields, true));
  const IgtTrackedFrame late = ParseIgtTrackedFrame(now.header, now.body);
  EXPECT_EQ(late.image.pixels, (std::vector<std::uint8_t>{18, 19, 20, 21, 14, 15, 16, 17, 10, 11, 12, 13}));  // from MN
  EXPECT_EQ(late.fields, fields);
  EXPECT_TRUE(late.hasPose);
  EXPECT_EQ(late.image.imageToWorld, Eigen::Matrix4d(Eigen::Vector4d(2, 2, 2, 1).asDiagonal()));
}

TEST(OpenIgtLink, TrackedFramesOfColours)
{
  Message message(TrackedFrameMessage({}, false));
  std::vector<std::uint8_t>& body = message.body;
  body[3] = 3;    // components
  body[5] = 5;    // colours, in Plus
  body[15] = 36;  // bytes
  const std::vector<std::uint8_t> pixels(body.end() - 12, body.end());
  body.resize(body.size() - 12);
  for (const std::uint8_t pixel : pixels)
  {
    body.insert(body.end(), 3, pixel);
  }
  message.header.bodyBytes = body.size();
  EXPECT_EQ(ParseIgtTrackedFrame(message.header, body).image.pixels,
            (std::vector<std::uint8_t>{10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21}));
  body[5] = 1;
  EXPECT_THROW(ParseIgtTrackedFrame(message.header, body), Error);
}

TEST(OpenIgtLink, EveryCutOfATrackedFrameIsFound)
{
  for (const bool isNew : {false, true})
  {
    const Message whole(TrackedFrameMessage({{"ProbeToTrackerTransform", "1"}}, isNew));
    for (std::size_t size = 0; size < whole.body.size(); ++size)
    {
      IgtHeader header = whole.header;
      header.bodyBytes = size;
      EXPECT_THROW(
          ParseIgtTrackedFrame(header, {whole.body.begin(), whole.body.begin() + static_cast<std::ptrdiff_t>(size)}),
          Error);
    }
    // The numbers before picture and text: none can be another one, but kind 0, and orders that have several numbers.
    for (std::size_t k = 0; k < 20; ++k)
    {
      Message changed = whole;
      changed.body[k] ^= 0x10;
      EXPECT_THROW(ParseIgtTrackedFrame(changed.header, changed.body), Error) << "byte " << k;
    }
  }
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
