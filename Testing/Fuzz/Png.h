// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// PNG files by hand, so that fuzzing gets past their checksums.
#pragma once

#include <cstdint>
#include <string>

#include "IO/SmallFiles.h"

namespace bigus::fuzz
{

inline std::string BigEndian(std::uint32_t n)
{
  return {static_cast<char>(n >> 24), static_cast<char>(n >> 16), static_cast<char>(n >> 8), static_cast<char>(n)};
}

inline std::uint32_t Checksum(const std::string& body)
{
  return static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size())));
}

inline std::string Chunk(const std::string& type, const std::string& data)
{
  return BigEndian(static_cast<std::uint32_t>(data.size())) + type + data + BigEndian(Checksum(type + data));
}

constexpr const char* kPngMagic = "\x89PNG\r\n\x1a\n";

/// An image of zeros; `colour` is PNG's colour type, `depth` the bits of a channel.
inline std::string Png(std::uint32_t width, std::uint32_t height, int colour = 0, int depth = 8, int channels = 1)
{
  const std::size_t row = 1 + std::size_t(width) * channels * depth / 8;
  return kPngMagic +
         Chunk("IHDR", BigEndian(width) + BigEndian(height) +
                           std::string{static_cast<char>(depth), static_cast<char>(colour), 0, 0, 0}) +
         Chunk("IDAT", test::Compressed(std::string(row * height, '\0'))) + Chunk("IEND", "");
}

/// The same bytes with every chunk's checksum set right, as far as chunks can be followed.
inline std::string WithRightChecksums(std::string bytes)
{
  std::size_t at = 8;
  while (at + 12 <= bytes.size())
  {
    std::uint32_t length = 0;
    for (int i = 0; i < 4; ++i)
    {
      length = length << 8 | static_cast<unsigned char>(bytes[at + i]);
    }
    if (length > bytes.size() - at - 12)
    {
      break;
    }
    bytes.replace(at + 8 + length, 4, BigEndian(Checksum(bytes.substr(at + 4, 4 + length))));
    at += 12 + length;
  }
  return bytes;
}

}  // namespace bigus::fuzz
