// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One pixel's training loss on intensity. Written for scalars and SIMD vectors, like Splat-inl.h: no include guard.

/// A pixel's loss and its derivative.
template <class Real>
struct PixelLoss
{
  Real loss;
  Real derivative;
};

/// The loss l1 |error| + l2 error^2, error = I - truth, of a pixel of the given weight, and dL/dI. `others` is what the
/// terms that look at whole images (ImageLoss.h) add to dL/dI; it enters the derivative only.
template <class Real>
BIGUS_FORMULA PixelLoss<Real> EvaluateError(Real l1, Real l2, Real error, Real weight, Real others)
{
  using std::abs;
  const Real zero = Real(0);
  const Real square = l2 * error;
  const Real size = l1 * abs(error) + square * error;
  const Real sign = Select(error > zero, l1, Select(error < zero, zero - l1, zero));
  return {weight * size, weight * (sign + (square + square)) + others};
}

/// The same of a pixel of scattering s, with dL/dS.
///
/// Where S <= 0 the rectifier's true derivative is zero, which would leave a pixel that should be lit dark for ever.
/// There we use the derivative at S = 0+, but only in the direction that raises S: a pixel that is rightly black stays
/// untouched. For S > 0 the derivative is exact.
template <class Real>
BIGUS_FORMULA PixelLoss<Real> EvaluateLoss(Real l1, Real l2, Real gamma, Real s, Real truth, Real weight, Real others)
{
  using std::exp;
  const Real zero = Real(0);
  const Real fade = Select(s > zero, exp(zero - gamma * s), Real(1));  // 1 - I
  const PixelLoss<Real> value = EvaluateError(l1, l2, (Real(1) - fade) - truth, weight, others);
  const Real descent = value.derivative * (gamma * fade);  // dI/dS, one-sided at 0
  return {value.loss, Select(s > zero, descent, Select(value.derivative < zero, descent, zero))};
}
