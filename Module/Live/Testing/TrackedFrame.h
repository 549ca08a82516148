// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A small TRACKEDFRAME with known content.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace bigus::test
{

/// A TRACKEDFRAME of PlusServer without a checksum: 4 x 3 pixels 10, 11, ... and these fields. `isNew`: with the order (that
/// of MN) and the matrix of versions since 2.5, which scales by 2.
inline std::string TrackedFrameMessage(const std::map<std::string, std::string>& fields, bool isNew)
{
  std::string text = "<TrackedFrame Timestamp=\"1.5\" ImageDataValid=\"true\" FrameSize=\"4 3 1\">\n";
  for (const auto& [name, value] : fields)
  {
    text += "<FrameField Name=\"" + name + "\" Value=\"" + value + "\" />\n";
  }
  text += "</TrackedFrame>\n";
  const auto big = [](std::uint64_t value, int bytes)
  {
    std::string out;
    for (int k = bytes - 1; k >= 0; --k)
    {
      out += static_cast<char>(value >> (8 * k) & 0xFF);
    }
    return out;
  };
  std::string body = big(3, 2) + big(1, 2) + big(1, 2) + big(4, 2) + big(3, 2) + big(1, 2) + big(12, 4);
  body += big(text.size(), 4);
  if (isNew)
  {
    body += big(8, 2);
    for (int n = 0; n < 16; ++n)
    {
      const unsigned char two[] = {0, 0, 0, 0x40}, one[] = {0, 0, 0x80, 0x3F}, zero[4] = {};
      const unsigned char* bytes = n == 15 ? one : n % 5 == 0 ? two : zero;
      body.append(reinterpret_cast<const char*>(bytes), 4);
    }
  }
  body += text;
  for (int k = 0; k < 12; ++k)
  {
    body += static_cast<char>(10 + k);
  }
  const auto padded = [](std::string name, std::size_t size)
  {
    name.resize(size, '\0');
    return name;
  };
  return big(1, 2) + padded("TRACKEDFRAME", 12) + padded("Tracked", 20) + big(std::uint64_t(3) << 31, 8) +
         big(body.size(), 8) + big(0, 8) + body;
}

}  // namespace bigus::test
