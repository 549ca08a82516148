// One pixel's training loss on intensity. Written for scalars and SIMD vectors, like Splat-inl.h: no include
// guard.

/// One pixel's loss and its derivative dL/dS at scattering s.
template <class Real>
struct PixelLoss
{
  Real loss;
  Real derivative;  ///< dL/dI dI/dS
};

/// The loss l1 |I - truth| + l2 (I - truth)^2 of a pixel of the given weight. `others` is what the terms that
/// look at whole images (ImageLoss.h) add to dL/dI; it enters the derivative only.
///
/// Where S <= 0 the rectifier's true derivative is zero, which would leave a pixel that should be lit dark
/// for ever. There we use the derivative at S = 0+, but only in the direction that raises S: a pixel that is
/// rightly black stays untouched. For S > 0 the derivative is exact.
template <class Real>
inline PixelLoss<Real> EvaluateLoss(Real l1, Real l2, Real gamma, Real s, Real truth, Real weight,
                                    Real others)
{
  using std::abs;
  using std::exp;
  const Real zero = Real(0);
  const Real fade = Select(s > zero, exp(zero - gamma * s), Real(1));  // 1 - I
  const Real error = (Real(1) - fade) - truth;
  const Real slope = gamma * fade;  // dI/dS, one-sided at 0
  const Real square = l2 * error;
  const Real size = l1 * abs(error) + square * error;
  const Real sign = Select(error > zero, l1, Select(error < zero, zero - l1, zero));
  const Real towards = weight * (sign + (square + square)) + others;  // dL/dI
  const Real descent = towards * slope;
  return {weight * size, Select(s > zero, descent, Select(towards < zero, descent, zero))};
}
