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

/// e^x, in float as if x were within [-87, 88], where e^x is a normal number.
template <class D>
static HWY_INLINE hn::Vec<D> QuickExp(D d, hn::Vec<D> x)
{
  if constexpr (sizeof(hn::TFromD<D>) == 8)
  {
    return hn::Exp(d, x);
  }
  else
  {
    return BoundedExp(d, hn::Min(hn::Max(x, hn::Set(d, -87.0f)), hn::Set(d, 88.0f)));
  }
}

/// ln x of a normal number; infinity counts as the largest. In float x = 2^k (1 + t) with |t| <= 0.42, and ln(1 + t) is
/// the polynomial of least relative error, 4e-9.
template <class D>
static HWY_INLINE hn::Vec<D> QuickLog(D d, hn::Vec<D> x)
{
  if constexpr (sizeof(hn::TFromD<D>) == 8)
  {
    return hn::Log(d, x);
  }
  else
  {
    const hn::RebindToSigned<D> di;
    const auto bits = hn::BitCast(di, x);
    const auto power = hn::ShiftRight<23>(hn::Sub(bits, hn::Set(di, 0x3f3504f3)));  // from the root of 1/2
    const auto k = hn::ConvertTo(d, power);
    const auto t = hn::Sub(hn::BitCast(d, hn::Sub(bits, hn::ShiftLeft<23>(power))), hn::Set(d, 1.0f));
    auto p = hn::Set(d, -0.0762179345f);
    for (const float c : {0.129044458f, -0.132429868f, 0.141818225f, -0.166090816f, 0.200019747f, -0.250015825f,
                          0.333333254f, -0.499999881f})
    {
      p = hn::MulAdd(p, t, hn::Set(d, c));
    }
    const auto ofRest = hn::MulAdd(hn::Mul(p, t), t, hn::Mul(k, hn::Set(d, -2.12194440e-4f)));
    return hn::MulAdd(k, hn::Set(d, 0.693359375f), hn::Add(t, ofRest));
  }
}

/// 1 / sqrt(x) of a normal number, relative error below 1.5e-7; large for 0. In float: halving the exponent as a whole
/// number gives 3 % (1.8e-3 after a step of Newton), and the series of (1 - e)^(-1/2) to the third power the rest.
/// Estimates that processors have differ between makers, and roots and divisions take three times as long.
template <class D>
static HWY_INLINE hn::Vec<D> QuickInverseRoot(D d, hn::Vec<D> x)
{
  if constexpr (sizeof(hn::TFromD<D>) == 8)
  {
    return hn::Div(hn::Set(d, 1.0), hn::Sqrt(x));
  }
  else
  {
    const hn::RebindToSigned<D> di;
    auto y = hn::BitCast(d, hn::Sub(hn::Set(di, 0x5f375a86), hn::ShiftRight<1>(hn::BitCast(di, x))));
    const auto half = hn::Mul(x, hn::Set(d, 0.5f));
    y = hn::Mul(y, hn::NegMulAdd(half, hn::Mul(y, y), hn::Set(d, 1.5f)));
    const auto e = hn::NegMulAdd(hn::Mul(x, y), y, hn::Set(d, 1.0f));
    auto series = hn::MulAdd(e, hn::Set(d, 0.3125f), hn::Set(d, 0.375f));
    series = hn::MulAdd(e, series, hn::Set(d, 0.5f));
    return hn::MulAdd(hn::Mul(y, e), series, y);
  }
}

/// x = whole + rest, |rest| <= 1/2, in float; `whole` where an exponent of two has its bits.
template <class D>
static HWY_INLINE hn::Vec<D> RestOf(D d, hn::Vec<D> x, hn::Vec<hn::RebindToSigned<D>>& whole)
{
  const auto shifter = hn::Set(d, 12582912.0f);  // see SplitExp
  const auto shifted = hn::Add(x, shifter);
  whole = hn::ShiftLeft<23>(hn::BitCast(hn::RebindToSigned<D>(), shifted));
  return hn::Sub(x, hn::Sub(shifted, shifter));
}

/// e^(x / kExponentUnit) for |x| <= -kLowestExponent kExponentUnit, relative error below 1.2e-7. In float 2^rest is the
/// polynomial of least relative error, 2e-9.
template <class D>
static HWY_INLINE hn::Vec<D> FootprintExp(D d, hn::Vec<D> x)
{
  if constexpr (sizeof(hn::TFromD<D>) == 8)
  {
    return hn::Exp(d, x);
  }
  else
  {
    const hn::RebindToSigned<D> di;
    hn::Vec<decltype(di)> whole;
    const auto r = RestOf(d, x, whole);
    auto p = hn::Set(d, 0.00015353362f);
    p = hn::MulAdd(p, r, hn::Set(d, 0.00133988739f));
    p = hn::MulAdd(p, r, hn::Set(d, 0.00961843692f));
    p = hn::MulAdd(p, r, hn::Set(d, 0.0555033237f));
    p = hn::MulAdd(p, r, hn::Set(d, 0.240226477f));
    p = hn::MulAdd(p, r, hn::Set(d, 0.693147182f));
    p = hn::MulAdd(p, r, hn::Set(d, 1.0f));
    return hn::BitCast(d, hn::Add(hn::BitCast(di, p), whole));
  }
}

/// The same of x and of -x. In float they share the even and the odd part of a polynomial of relative error 1e-8.
template <class D>
static HWY_INLINE void FootprintExps(D d, hn::Vec<D> x, hn::Vec<D>& ofPlus, hn::Vec<D>& ofMinus)
{
  if constexpr (sizeof(hn::TFromD<D>) == 8)
  {
    ofPlus = hn::Exp(d, x);
    ofMinus = hn::Exp(d, hn::Neg(x));
  }
  else
  {
    const hn::RebindToSigned<D> di;
    hn::Vec<decltype(di)> whole;
    const auto r = RestOf(d, x, whole), rr = hn::Mul(r, r);
    auto even = hn::MulAdd(hn::Set(d, 0.000154668887f), rr, hn::Set(d, 0.00961803738f));
    even = hn::MulAdd(even, rr, hn::Set(d, 0.240226507f));
    even = hn::MulAdd(even, rr, hn::Set(d, 1.0f));
    auto odd = hn::MulAdd(hn::Set(d, 0.00133907772f), rr, hn::Set(d, 0.0555035733f));
    odd = hn::MulAdd(odd, rr, hn::Set(d, 0.693147182f));
    ofPlus = hn::BitCast(d, hn::Add(hn::BitCast(di, hn::MulAdd(odd, r, even)), whole));
    ofMinus = hn::BitCast(d, hn::Sub(hn::BitCast(di, hn::NegMulAdd(odd, r, even)), whole));
  }
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_EXP_INL_H
