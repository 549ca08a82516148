// Training losses on intensity, and their derivative with respect to the scattering field S.
#pragma once

#include <cmath>

#include "TransferFunction.h"

namespace bigus
{

enum class LossKind
{
  L1,  ///< |I - I_gt|
  L2   ///< (I - I_gt)^2
};

/// One pixel's loss and its derivative dL/dS at scattering s.
template <class Real>
struct PixelLoss
{
  Real loss;
  Real derivative;  ///< dL/dI dI/dS
};

/// Where S <= 0 the rectifier's true derivative is zero, which would leave a pixel that should be lit dark for ever.
/// There we use the derivative at S = 0+, but only in the direction that raises S: a pixel that is rightly black
/// stays untouched. For S > 0 the derivative is exact.
template <class Real>
PixelLoss<Real> EvaluateLoss(LossKind kind, const TransferFunction& transfer, Real s, Real truth)
{
  const Real gamma = static_cast<Real>(transfer.gamma);
  const Real fade = s > Real(0) ? std::exp(-gamma * s) : Real(1);  // 1 - I
  const Real error = (Real(1) - fade) - truth;
  const Real slope = gamma * fade;  // dI/dS, one-sided at 0
  const bool dark = s <= Real(0) && error >= Real(0);
  if (kind == LossKind::L1)
  {
    const Real sign = error > Real(0) ? Real(1) : (error < Real(0) ? Real(-1) : Real(0));
    return { std::abs(error), dark ? Real(0) : sign * slope };
  }
  return { error * error, dark ? Real(0) : Real(2) * error * slope };
}

}  // namespace bigus
