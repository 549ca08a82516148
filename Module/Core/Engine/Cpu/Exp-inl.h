// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Exponentials of bounded arguments. Compiled once for every instruction set, hence the guard that foreach_target.h
// turns over.
#if defined(BIGUS_CPU_EXP_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BIGUS_CPU_EXP_INL_H
#undef BIGUS_CPU_EXP_INL_H
#else
#define BIGUS_CPU_EXP_INL_H
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

namespace hn = hwy::HWY_NAMESPACE;

/// e^x = power (1 + q) for |x| <= -kLowestExponent, in float: Cody-Waite reduction by a power of two and a Taylor
/// polynomial of q on [-ln 2 / 2, ln 2 / 2], relative error below 1.2e-7.
template <class D>
static HWY_INLINE hn::Vec<D> SplitExp(D d, hn::Vec<D> x, hn::Vec<D>& power)
{
  const hn::RebindToSigned<D> di;
  // 1.5 * 2^23 pushes the fraction out of a float: what is left in its last bits is the nearest whole number.
  const auto shifter = hn::Set(d, 12582912.0f);
  const auto shifted = hn::MulAdd(x, hn::Set(d, 1.44269504f), shifter);
  const auto k = hn::Sub(shifted, shifter);
  auto r = hn::NegMulAdd(k, hn::Set(d, 0.693359375f), x);
  r = hn::NegMulAdd(k, hn::Set(d, -2.12194440e-4f), r);
  auto p = hn::Set(d, 1.0f / 5040);
  p = hn::MulAdd(p, r, hn::Set(d, 1.0f / 720));
  p = hn::MulAdd(p, r, hn::Set(d, 1.0f / 120));
  p = hn::MulAdd(p, r, hn::Set(d, 1.0f / 24));
  p = hn::MulAdd(p, r, hn::Set(d, 1.0f / 6));
  p = hn::MulAdd(p, r, hn::Set(d, 0.5f));
  power = hn::BitCast(d, hn::Add(hn::ShiftLeft<23>(hn::BitCast(di, shifted)), hn::Set(di, 127 << 23)));
  return hn::MulAdd(hn::Mul(p, r), r, r);
}

/// e^x and e^x - 1 for |x| <= -kLowestExponent, without the checks a library needs beyond.
template <class D>
static HWY_INLINE hn::Vec<D> BoundedExp(D d, hn::Vec<D> x)
{
  if constexpr (sizeof(hn::TFromD<D>) == 8)
  {
    return hn::Exp(d, x);
  }
  else
  {
    hn::Vec<D> power;
    const auto q = SplitExp(d, x, power);
    return hn::MulAdd(power, q, power);
  }
}
template <class D>
static HWY_INLINE hn::Vec<D> BoundedExpm1(D d, hn::Vec<D> x)
{
  if constexpr (sizeof(hn::TFromD<D>) == 8)
  {
    return hn::Expm1(d, x);
  }
  else
  {
    hn::Vec<D> power;
    const auto q = SplitExp(d, x, power);
    return hn::MulAdd(power, q, hn::Sub(power, hn::Set(d, 1.0f)));
  }
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_EXP_INL_H
