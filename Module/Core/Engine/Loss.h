// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What training makes small.
#pragma once

#include <string>

namespace bigus
{

/// A weighted sum of losses between a rendered frame I and a recorded one I_gt, each a mean over the frame's
/// pixels (or windows); Losses.md of this folder defines the terms. Weights lie in [0, 1e6], and one of them
/// must not be 0.
struct Loss
{
  double l1 = 1;        ///< |I - I_gt|
  double l2 = 0;        ///< (I - I_gt)^2
  double dssim = 0;     ///< 1 - SSIM; windows and constants are those of Metrics.h
  double ffl = 0;       ///< focal frequency loss, alpha 1
  double contrast = 0;  ///< (sigma - sigma_gt)^2 of SSIM's windows: speckle's strength, whatever its place

  /// Whether a pixel's loss depends on that pixel alone.
  bool IsPixelwise() const { return dssim == 0 && ffl == 0 && contrast == 0; }

  /// Throws Error naming the term, its weight and its range.
  void Validate() const;

  /// "l1", "0.8*l1+0.2*dssim": terms by the names above, in either case, each with an optional factor; a term
  /// named twice counts with the sum of its factors. Throws Error showing the text and the names.
  static Loss Parse(const std::string& text);
  /// The text that Parse reads back to the same weights.
  std::string ToString() const;
};

}  // namespace bigus
