// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A Gaussian seen by a slice plane through a beam, and the way back: the mathematics for scalar numbers.
#pragma once

#include <cmath>

/// In front of every formula: compiled for host and device, and inlined, so that results nobody uses cost
/// nothing.
#ifdef __CUDACC__
#define BIGUS_FORMULA __host__ __device__ __forceinline__
#else
#define BIGUS_FORMULA inline __attribute__((always_inline))
#endif

namespace bigus
{

/// 1 / sqrt(value) of a positive number.
template <class Real>
BIGUS_FORMULA Real InverseRoot(Real value)
{
  using std::sqrt;
  return Real(1) / sqrt(value);
}

#include "Core/Formula/Splat-inl.h"

}  // namespace bigus
