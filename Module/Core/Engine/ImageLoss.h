// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The terms of a Loss that need whole images: DSSIM, focal frequency loss and contrast, defined in README.md
// of this folder. Private to Core.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "Core/Engine/Loss.h"

namespace bigus
{

/// Made once for frames of one size.
class ImageLoss
{
public:
  /// `counted` is 0 where a pixel does not count, else 1; empty when all do. Only windows whose pixels all
  /// count do, so a pixel that does not has no part in any term.
  ImageLoss(int width, int height, std::vector<std::uint8_t> counted);

  /// Throws Error when a term has no window to look at.
  void Check(const Loss& loss) const;

  /// Which windows count, by their first pixel, [height - 10][width - 10]; empty: all. And how many do.
  const std::vector<std::uint8_t>& Windows() const { return windows_; }
  std::size_t CountedWindows() const { return countedWindows_; }

  /// Returns weight times the loss of one frame and adds weight * dL/dI to `derivative`. All images have rows
  /// `stride` numbers apart. Works on all threads; the bits do not depend on their number. Needs Check.
  template <class Real>
  double Evaluate(const Loss& loss, double weight, const Real* image, const Real* truth, std::size_t stride,
                  Real* derivative) const;

private:
  template <class Real>
  double EvaluateWindows(const Loss& loss, double weight, const Real* image, const Real* truth, std::size_t stride,
                         Real* derivative) const;
  template <class Real>
  double EvaluateSpectrum(double weight, const Real* image, const Real* truth, std::size_t stride,
                          Real* derivative) const;

  int width_, height_;
  std::vector<std::uint8_t> counted_;  // [height][width]; empty: all
  std::vector<std::uint8_t> windows_;  // by their first pixel, [height - 10][width - 10]; empty: all count
  std::size_t countedPixels_, countedWindows_;
};

}  // namespace bigus
