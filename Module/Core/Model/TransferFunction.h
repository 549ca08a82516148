// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From scattering S to displayed intensity I and back (paper eq 13).
#pragma once

#include <algorithm>
#include <cmath>

namespace bigus
{

/// I = 1 - exp(-gamma max(S, 0)), so S <= 0 is black and I stays below 1.
struct TransferFunction
{
  double gamma = 1.0;  ///< > 0; the mean scattering is 1 where I = 1 - exp(-gamma)

  template <class Real>
  Real Intensity(Real s) const
  {
    return -std::expm1(-static_cast<Real>(gamma) * std::max(s, Real(0)));
  }

  /// S for a given I; I is clamped to [0, 1 - 1/510], half a grey level below white, to stay finite.
  template <class Real>
  Real Scattering(Real intensity) const
  {
    const Real i = std::min(std::max(intensity, Real(0)), Real(1.0 - 1.0 / 510.0));
    return -std::log1p(-i) / static_cast<Real>(gamma);
  }

  /// gamma = -ln(1 - mean intensity): puts the mean scattering near 1 (paper, below eq 13).
  /// The mean is clamped to [1e-3, 0.9], so that an almost black or white sweep still trains.
  static TransferFunction FromMeanIntensity(double meanIntensity)
  {
    return {-std::log1p(-std::min(std::max(meanIntensity, 1e-3), 0.9))};
  }
};

}  // namespace bigus
