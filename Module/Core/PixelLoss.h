// A pixel's loss and its derivative with respect to the scattering field S, for scalar numbers. Private to
// Core and Cuda.
#pragma once

#include <cmath>

namespace bigus
{

/// condition ? a : b, a function so that SIMD vectors can have one too.
template <class Real>
inline Real Select(bool condition, Real a, Real b)
{
  return condition ? a : b;
}

#include "Loss-inl.h"

}  // namespace bigus
