// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdio>
#include <string>

namespace bigus
{

/// A number by printf's pattern, with a point in every locale.
inline std::string Format(const char* pattern, double value)
{
  char text[64];
  std::snprintf(text, sizeof text, pattern, value);
  // snprintf follows the C locale's decimal separator; a log does not.
  std::replace(text, text + sizeof text, ',', '.');
  return text;
}

}  // namespace bigus
