// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

namespace bigus
{

/// A picture in colours to look at.
struct Page
{
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< [height][width][3], the first row is the top one
};

}  // namespace bigus
