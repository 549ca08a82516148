// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Numbers as people read them, with a point in every locale.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <string>

namespace bigus
{

/// A number by printf's pattern.
inline std::string Format(const char* pattern, double value)
{
  char text[64];
  std::snprintf(text, sizeof text, pattern, value);
  // snprintf follows the C locale's decimal separator.
  std::replace(text, text + sizeof text, ',', '.');
  return text;
}

/// The shortest text that reads back as the same bits, whatever the locale.
inline std::string ExactNumber(double value)
{
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

/// Fixed number of decimals; "infinite" as such, "-" for what is no number.
inline std::string FormatNumber(double value, int decimals)
{
  if (std::isnan(value))
  {
    return "-";
  }
  if (std::isinf(value))
  {
    return value > 0 ? "infinite" : "-infinite";
  }
  std::string text(std::snprintf(nullptr, 0, "%.*f", decimals, value), ' ');
  std::snprintf(text.data(), text.size() + 1, "%.*f", decimals, value);
  std::replace(text.begin(), text.end(), ',', '.');
  return text;
}

}  // namespace bigus
