// Training losses on intensity, and their derivative with respect to the scattering field S.
#pragma once

#include <cmath>

namespace bigus
{

enum class LossKind
{
  L1,  ///< |I - I_gt|
  L2   ///< (I - I_gt)^2
};

/// condition ? a : b, a function so that SIMD vectors can have one too.
template <class Real>
inline Real Select(bool condition, Real a, Real b)
{
  return condition ? a : b;
}

#include "Loss-inl.h"

}  // namespace bigus
