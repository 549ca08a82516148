// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The terms of a Loss that look at windows of 11 x 11 pixels: DSSIM and contrast. Private to Core and Cuda.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "Core/Engine/Loss.h"

namespace bigus
{

/// Made once for frames of one size and mask.
class WindowLosses
{
public:
  /// `counted` is 0 where a pixel does not count, else 1; empty when all do. Only windows whose pixels all count do, so
  /// a pixel that does not has no part in any term.
  WindowLosses(int width, int height, const std::vector<std::uint8_t>& counted);

  /// Throws Error when a term has no window to look at.
  void Check(const Loss& loss) const;

  /// Which windows count, by their first pixel, [height - 10][width - 10]; empty: all. And how many do.
  const std::vector<std::uint8_t>& Windows() const { return windows_; }
  std::size_t CountedWindows() const { return countedWindows_; }

  /// See ImageLoss::Evaluate.
  template <class Real>
  double Evaluate(const Loss& loss, double weight, const Real* image, const Real* truth, std::size_t stride,
                  Real* derivative) const;

private:
  int width_, height_;
  std::vector<std::uint8_t> windows_;
  std::size_t countedWindows_ = 0;
};

}  // namespace bigus
