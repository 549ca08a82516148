// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Functions of plain numbers that SIMD vectors also have, so that formulas are written once for both; for host and
// device. Private to Core and Cuda.
#pragma once

#include <type_traits>

#include "Core/Formula/Splat.h"

namespace bigus
{

/// condition ? a : b
template <class Real>
BIGUS_FORMULA Real Select(bool condition, Real a, Real b)
{
  return condition ? a : b;
}

template <class Real>
BIGUS_FORMULA std::enable_if_t<std::is_arithmetic_v<Real>, Real> min(Real a, Real b)
{
  return b < a ? b : a;
}

template <class Real>
BIGUS_FORMULA std::enable_if_t<std::is_arithmetic_v<Real>, Real> max(Real a, Real b)
{
  return a < b ? b : a;
}

}  // namespace bigus
