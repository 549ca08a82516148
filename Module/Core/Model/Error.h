// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One exception type for everything a caller can get wrong. The message names what was found and what to do.
#pragma once

#include <stdexcept>
#include <string>
#include <type_traits>

namespace bigus
{

class Error : public std::runtime_error
{
public:
  explicit Error(const std::string& message) : std::runtime_error(message) {}
};

/// The parts one after the other; numbers as std::to_string writes them.
template <class... Parts>
std::string MessageText(const Parts&... parts)
{
  std::string text;
  const auto add = [&text](const auto& part)
  {
    using Part = std::decay_t<decltype(part)>;
    if constexpr (std::is_arithmetic_v<Part> && !std::is_same_v<Part, char>)
    {
      text += std::to_string(part);
    }
    else
    {
      text += part;
    }
  };
  (add(parts), ...);
  return text;
}

/// Throws Error unless `holds`. The message's parts are evaluated in any case, so none may rest on what must hold.
template <class... Parts>
void Require(bool holds, const Parts&... message)
{
  if (!holds)
  {
    throw Error(MessageText(message...));
  }
}

}  // namespace bigus
