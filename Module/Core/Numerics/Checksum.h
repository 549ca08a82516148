// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A checksum of 64 bits against accidents: not against somebody who wants two files to have the same.
#pragma once

#include <cinttypes>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>

#include "Core/Numerics/Random.h"

namespace bigus
{

class Checksum
{
public:
  /// Every word of 8 bytes goes through a bijection of what was before, so no change within one word is missed, and a
  /// change in several is with a chance of 2^-64. The last word is filled with zeros, so the count goes in first.
  Checksum& Add(const void* bytes, std::size_t count)
  {
    AddWord(count);
    const auto* at = static_cast<const unsigned char*>(bytes);
    for (; count >= sizeof(std::uint64_t); count -= sizeof(std::uint64_t), at += sizeof(std::uint64_t))
    {
      std::uint64_t word;
      std::memcpy(&word, at, sizeof(word));
      AddWord(word);
    }
    std::uint64_t rest = 0;
    if (count > 0)
    {
      std::memcpy(&rest, at, count);
    }
    AddWord(rest);
    return *this;
  }

  std::uint64_t Value() const { return sum_; }
  /// 16 hexadecimal digits.
  std::string Text() const
  {
    char text[17];
    std::snprintf(text, sizeof(text), "%016" PRIx64, sum_);
    return text;
  }

private:
  void AddWord(std::uint64_t word) { sum_ = Mix(sum_ ^ word); }

  std::uint64_t sum_ = 0;
};

}  // namespace bigus
