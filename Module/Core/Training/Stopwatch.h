// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>

namespace bigus
{

/// Seconds since it was made, and what went before.
class Stopwatch
{
public:
  explicit Stopwatch(double before = 0) : before_(before) {}

  double Seconds() const
  {
    return before_ + std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

private:
  double before_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace bigus
