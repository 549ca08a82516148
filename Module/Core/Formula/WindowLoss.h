// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What one window of 11 x 11 pixels adds to the loss: terms that compare weighted means. Private to Core and Cuda.
#pragma once

#include <cmath>

#include "Core/Formula/Scalars.h"
#include "Core/Formula/Splat.h"
#include "Core/Formula/SsimWindow.h"

namespace bigus
{

/// sigma is taken as sqrt(variance + this), so that it has a derivative where the image is constant. It is the variance
/// of rounding to 8 bits, (1/255)^2 / 12: less contrast than that no 8-bit frame can show, and more is not changed by
/// it.
constexpr double kRoundingVariance = 1.0 / (255.0 * 255.0 * 12.0);

/// A window's loss and its slopes by the means of x, x^2 and xy, each held while the others change.
template <class Real>
struct WindowLoss
{
  Real value, slopeX, slopeXX, slopeXY;
};

/// With A1 = 2 mx my + c1, A2 = 2 cov + c2, B1 = mx^2 + my^2 + c1, B2 = var x + var y + c2:
///   S = A1 A2 / (B1 B2),   dS/dmx = 2 my (A2 - A1) / (B1 B2) - 2 mx S (1 / B1 - 1 / B2),
///   dS/dmxx = -S / B2,     dS/dmxy = 2 A1 / (B1 B2).
/// Loss 1 - S.
template <class Real>
BIGUS_FORMULA void AddDssim(Real weight, Real x, Real y, Real xx, Real yy, Real xy, WindowLoss<Real>& out)
{
  constexpr Real c1 = static_cast<Real>(kSsimC1), c2 = static_cast<Real>(kSsimC2);
  const Real a1 = 2 * x * y + c1, a2 = 2 * (xy - x * y) + c2;
  const Real b1 = x * x + y * y + c1;
  const Real b2 = (xx - x * x) + (yy - y * y) + c2;
  const Real inverse = 1 / (b1 * b2), ssim = a1 * a2 * inverse;
  out.value += weight * (1 - ssim);
  out.slopeX -= weight * 2 * (y * (a2 - a1) - x * ssim * (b2 - b1)) * inverse;
  out.slopeXX += weight * ssim * b1 * inverse;
  out.slopeXY -= weight * 2 * a1 * inverse;
}

/// Loss (sx - sy)^2 with s = sqrt(var + c): dL/dmxx = (sx - sy) / sx, dL/dmx = -2 mx dL/dmxx.
template <class Real>
BIGUS_FORMULA void AddContrast(Real weight, Real x, Real y, Real xx, Real yy, WindowLoss<Real>& out)
{
  using std::sqrt;
  constexpr Real c = static_cast<Real>(kRoundingVariance);
  // Rounding can leave a variance below 0.
  const Real sx = sqrt(max(xx - x * x, Real(0)) + c), sy = sqrt(max(yy - y * y, Real(0)) + c);
  const Real slope = weight * (sx - sy) / sx;
  out.value += weight * (sx - sy) * (sx - sy);
  out.slopeXX += slope;
  out.slopeX -= 2 * x * slope;
}

}  // namespace bigus
