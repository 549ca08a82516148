// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Footprints added to an image, and sums over them: by recurrence where it is exact enough, else pixel by pixel.
// Compiled once for every instruction set, hence the guard that foreach_target.h turns over.
#if defined(BIGUS_CPU_FOOTPRINTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BIGUS_CPU_FOOTPRINTS_INL_H
#undef BIGUS_CPU_FOOTPRINTS_INL_H
#else
#define BIGUS_CPU_FOOTPRINTS_INL_H
#endif

#include <algorithm>

#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/FootprintDirect-inl.h"
#include "Core/Engine/Cpu/FootprintRecurrence-inl.h"
#include "Core/Engine/Cpu/Lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

template <class T>
static void AddFootprints(const bigus::VisibleSplat<T>* splats, int count, const T* values, int rowBegin, int rowEnd,
                          const PixelRows<T>& image)
{
  const int lanes = Lanes<T>::Count();
  for (int i = 0; i < count; ++i)
  {
    const bigus::VisibleSplat<T>& s = splats[i];
    const int begin = std::max(rowBegin, static_cast<int>(s.rowBegin));
    const int end = std::min(rowEnd, static_cast<int>(s.rowEnd));
    if (begin >= end)
    {
      continue;
    }
    const T value = values ? values[static_cast<int>(s.gaussian)] : T(1);
    const Stretch<T> stretch{static_cast<int>(s.row), begin, end, static_cast<int>(s.columnBegin),
                             static_cast<int>(s.columnEnd)};
    if (s.reach == 0)
    {
      AddDirect(s, begin, end, image, value);
    }
    else if (stretch.columnEnd - stretch.columnBegin <= 2 * lanes && IsShort(s))
    {
      // Most of them: kept free of all else.
      if (stretch.columnEnd - stretch.columnBegin <= lanes)
      {
        AddColumns<T, 1>(s, stretch, stretch.columnBegin, image, value);
      }
      else
      {
        AddColumns<T, 2>(s, stretch, stretch.columnBegin, image, value);
      }
    }
    else
    {
      AddStretches(s, begin, end, image, value);
    }
  }
}

template <class T, bool WithError>
static void GatherAll(const bigus::VisibleSplat<T>* splats, int count, const PixelRows<T>& derivative,
                      MomentBlock<T>& moments)
{
  const hn::ScalableTag<T> d;
  const int lanes = Lanes<T>::Count();
  for (int i = 0; i < count; ++i)
  {
    const bigus::VisibleSplat<T>& s = splats[i];
    T* HWY_RESTRICT out = moments.values[0] + i;
    const Stretch<T> stretch{static_cast<int>(s.row), static_cast<int>(s.rowBegin), static_cast<int>(s.rowEnd),
                             static_cast<int>(s.columnBegin), static_cast<int>(s.columnEnd)};
    if (s.reach == 0)
    {
      GatherDirect(s, derivative, out);
      continue;
    }
    OffsetSums<T> sums = NoSums<T>();
    if (IsShort(s))
    {
      for (int column = stretch.columnBegin; column < stretch.columnEnd; column += lanes)
      {
        GatherColumns<T, WithError>(s, stretch, column, derivative, sums);
      }
    }
    else
    {
      GatherStretches<T, WithError>(s, derivative, sums);
    }
    const auto sum = [&d](auto v) HWY_ATTR { return hn::GetLane(hn::SumOfLanes(d, v)); };
    const T u = sum(sums.u), v = sum(sums.v), uu = sum(sums.uu), uv = sum(sums.uv), vv = sum(sums.vv);
    const T a = s.u11, b = s.u12, e = s.u22;  // U, applied to the sums: eta1 = a u + b v, eta2 = e v
    out[kMoment0 * kBlock] = sum(sums.one);
    out[kMoment1 * kBlock] = a * u + b * v;
    out[kMoment2 * kBlock] = e * v;
    out[kMoment11 * kBlock] = a * a * uu + 2 * a * b * uv + b * b * vv;
    out[kMoment12 * kBlock] = e * (a * uv + b * vv);
    out[kMoment22 * kBlock] = e * e * vv;
    out[kMomentError * kBlock] = WithError ? sum(sums.error) : T(0);
  }
}

template <class T>
static void GatherMoments(const bigus::VisibleSplat<T>* splats, int count, const PixelRows<T>& derivative,
                          bool withError, MomentBlock<T>& moments)
{
  withError ? GatherAll<T, true>(splats, count, derivative, moments)
            : GatherAll<T, false>(splats, count, derivative, moments);
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_FOOTPRINTS_INL_H
