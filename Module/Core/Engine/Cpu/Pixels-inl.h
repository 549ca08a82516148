// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From scattering to intensity, and from intensity to the loss. Compiled once for every instruction set, hence the
// guard that foreach_target.h turns over.
#if defined(BIGUS_CPU_PIXELS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BIGUS_CPU_PIXELS_INL_H
#undef BIGUS_CPU_PIXELS_INL_H
#else
#define BIGUS_CPU_PIXELS_INL_H
#endif

#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/Exp-inl.h"
#include "Core/Engine/Cpu/Lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

template <class T>
static void ToIntensity(const T* scattering, std::size_t count, T gamma, T* out)
{
  const hn::ScalableTag<T> d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d))
  {
    const auto s = hn::Max(hn::LoadU(d, scattering + i), hn::Zero(d));
    const auto exponent = hn::Max(hn::Mul(hn::Set(d, -gamma), s), hn::Set(d, kLowestExponent<T>));
    hn::StoreU(hn::Sub(hn::Zero(d), BoundedExpm1(d, exponent)), d, out + i);  // 0 - 0 is 0, where -0 would show
  }
}

template <class T>
static double ToDerivative(T l1, T l2, T gamma, const T* truth, const T* weights, const T* others, std::size_t count,
                           T* HWY_RESTRICT scattering)
{
  using L = Lanes<T>;
  L sum(T(0));
  for (std::size_t i = 0; i < count; i += L::Count())
  {
    const PixelLoss<L> loss =
        HWY_NAMESPACE::EvaluateLoss(L(l1), L(l2), L(gamma), L::Load(scattering + i), L::Load(truth + i),
                                    L::Load(weights + i), others ? L::Load(others + i) : L(T(0)));
    loss.derivative.Store(scattering + i);
    sum = sum + loss.loss;
  }
  const hn::ScalableTag<T> d;
  return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, sum.v)));
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_PIXELS_INL_H
