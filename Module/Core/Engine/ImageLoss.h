// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The terms of a Loss that need whole images: DSSIM, contrast and focal frequency loss, defined in Losses.md. Private to
// Core and Cuda.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "Core/Engine/Loss.h"
#include "Core/Engine/SpectrumLoss.h"
#include "Core/Engine/WindowLosses.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// 1 where a pixel has a part in the loss, else 0; empty when all have.
std::vector<std::uint8_t> CountedPixels(const Sweep& sweep);

/// Made once for frames of one size and mask.
class ImageLoss
{
public:
  /// `counted` as CountedPixels returns it.
  ImageLoss(int width, int height, const std::vector<std::uint8_t>& counted)
      : windows_(width, height, counted), spectrum_(width, height, counted)
  {
  }

  /// Throws Error when a term has no window to look at.
  void Check(const Loss& loss) const { windows_.Check(loss); }

  /// See WindowLosses.
  const std::vector<std::uint8_t>& Windows() const { return windows_.Windows(); }
  std::size_t CountedWindows() const { return windows_.CountedWindows(); }

  /// Returns weight times the loss of one frame and adds weight * dL/dI to `derivative`. All images have rows `stride`
  /// numbers apart. Works on all threads; the bits do not depend on their number. Needs Check.
  template <class Real>
  double Evaluate(const Loss& loss, double weight, const Real* image, const Real* truth, std::size_t stride,
                  Real* derivative) const;

private:
  WindowLosses windows_;
  SpectrumLoss spectrum_;
};

}  // namespace bigus
