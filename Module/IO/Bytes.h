// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The order of a number's bytes.
#pragma once

#include <algorithm>
#include <cstddef>

namespace bigus
{

constexpr bool kThisMachineIsBigEndian = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__;

/// Reverses the bytes of each of the elements that lie one after the other in `count` bytes.
inline void SwapBytes(unsigned char* bytes, std::size_t count, std::size_t elementBytes)
{
  for (std::size_t i = 0; i + elementBytes <= count; i += elementBytes)
  {
    std::reverse(bytes + i, bytes + i + elementBytes);
  }
}

}  // namespace bigus
