// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The term of a Loss that looks at spectra: the focal frequency loss. Private to Core.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace bigus
{

/// Made once for frames of one size and mask.
class SpectrumLoss
{
public:
  /// `counted` is 0 where a pixel does not count, else 1; empty when all do.
  SpectrumLoss(int width, int height, std::vector<std::uint8_t> counted);

  /// Returns weight times the loss of one frame and adds weight * dL/dI to `derivative`; see ImageLoss::Evaluate.
  template <class Real>
  double Evaluate(double weight, const Real* image, const Real* truth, std::size_t stride, Real* derivative) const;

private:
  int width_, height_;
  std::vector<std::uint8_t> counted_;  // [height][width]; empty: all
  std::size_t countedPixels_;
};

}  // namespace bigus
