// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What bounds the effect of a block. Compiled once for every instruction set, hence the guard that foreach_target.h
// turns over.
#if defined(BIGUS_CPU_BOUNDS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BIGUS_CPU_BOUNDS_INL_H
#undef BIGUS_CPU_BOUNDS_INL_H
#else
#define BIGUS_CPU_BOUNDS_INL_H
#endif

#include <algorithm>
#include <cmath>

#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/Lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

template <class T>
static BlockBounds<T> BoundsOf(const GaussianBlock<T>& block, int count)
{
  using L = Lanes<T>;
  const hn::ScalableTag<T> d;
  // Beyond `count` a lane repeats the first Gaussian, which changes no minimum and no maximum.
  const auto load = [&](const T* row, int first)
  {
    const auto valid = hn::FirstN(d, static_cast<std::size_t>(count - first));
    return hn::IfThenElse(valid, hn::LoadU(d, row + first), hn::Set(d, row[0]));
  };
  BlockBounds<T> bounds;
  const auto extreme = [&](const T* row, T& low, T& high)
  {
    auto smallest = hn::Set(d, row[0]), largest = smallest;
    for (int first = 0; first < count; first += L::Count())
    {
      smallest = hn::Min(smallest, load(row, first));
      largest = hn::Max(largest, load(row, first));
    }
    low = hn::GetLane(hn::MinOfLanes(d, smallest));
    high = hn::GetLane(hn::MaxOfLanes(d, largest));
  };
  T low, high;
  for (int axis = 0; axis < 3; ++axis)
  {
    extreme(block.mean[axis], bounds.low[axis], bounds.high[axis]);
    extreme(block.logScale[axis], low, high);
    bounds.logScale = axis == 0 ? high : std::max(bounds.logScale, high);
  }
  extreme(block.reflectivity, low, high);
  bounds.magnitude = std::max(std::abs(low), std::abs(high));
  L logAspect(T(0));
  for (int first = 0; first < count; first += L::Count())
  {
    const L x(load(block.logScale[0], first)), y(load(block.logScale[1], first)), z(load(block.logScale[2], first));
    logAspect = max(logAspect, max(max(x, y), z) - min(min(x, y), z));
  }
  bounds.logAspect = hn::GetLane(hn::MaxOfLanes(d, logAspect.v));
  return bounds;
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_BOUNDS_INL_H
