// One pixel's training loss on intensity. Written for scalars and SIMD vectors, like Splat-inl.h: no include
// guard.

/// One pixel's loss and its derivative dL/dS at scattering s.
template <class Real>
struct PixelLoss
{
  Real loss;
  Real derivative;  ///< dL/dI dI/dS
};

/// Where S <= 0 the rectifier's true derivative is zero, which would leave a pixel that should be lit dark
/// for ever. There we use the derivative at S = 0+, but only in the direction that raises S: a pixel that is
/// rightly black stays untouched. For S > 0 the derivative is exact.
template <class Real>
inline PixelLoss<Real> EvaluateLoss(LossKind kind, Real gamma, Real s, Real truth)
{
  using std::abs;
  using std::exp;
  const Real zero = Real(0);
  const Real fade = Select(s > zero, exp(zero - gamma * s), Real(1));  // 1 - I
  const Real error = (Real(1) - fade) - truth;
  const Real slope = gamma * fade;  // dI/dS, one-sided at 0
  const Real size = kind == LossKind::L1 ? abs(error) : error * error;
  const Real towards = kind == LossKind::L1
                           ? Select(error > zero, Real(1), Select(error < zero, Real(-1), zero))
                           : Real(2) * error;
  const Real descent = towards * slope;
  return {size, Select(s > zero, descent, Select(error < zero, descent, zero))};
}
