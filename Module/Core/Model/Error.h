// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One exception type for everything a caller can get wrong. The message names what was found and what to do.
#pragma once

#include <stdexcept>
#include <string>

namespace bigus
{

class Error : public std::runtime_error
{
public:
  explicit Error(const std::string& message) : std::runtime_error(message) {}
};

}  // namespace bigus
