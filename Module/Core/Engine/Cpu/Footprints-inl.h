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
static void AddFootprints(const SplatRows<T>& splats, const T* values, int rowBegin, int rowEnd,
                          const PixelRows<T>& image)
{
  const int lanes = Lanes<T>::Count();
  for (int i = 0; i < splats.count; ++i)
  {
    const int begin = std::max(rowBegin, splats.At(kRowBegin, i)), end = std::min(rowEnd, splats.At(kRowEnd, i));
    if (begin >= end)
    {
      continue;
    }
    const T value = values ? values[splats.At(kGaussian, i)] : T(1);
    const Stretch<T> stretch{splats.At(kRow, i), begin, end, splats.At(kColumnBegin, i), splats.At(kColumnEnd, i)};
    const int reach = splats.At(kReach, i), columns = stretch.columnEnd - stretch.columnBegin;
    if (reach == kOneStretch && columns <= 2 * lanes)
    {
      // Most of them: kept free of all else.
      const RecurrenceStart<T> start(splats, i);
      if (columns <= lanes)
      {
        AddColumns<T, 1>(start, stretch, stretch.columnBegin, image, value);
      }
      else
      {
        AddColumns<T, 2>(start, stretch, stretch.columnBegin, image, value);
      }
    }
    else if (reach == 0)
    {
      AddDirect(splats, i, begin, end, image, value);
    }
    else
    {
      AddStretches(splats, i, begin, end, image, value);
    }
  }
}

/// Lane j: the sum of the lanes of vector j of as many vectors as lanes that lie one after the other. (N: of the first N
/// vectors, so many neighbouring lanes for each.)
template <class T, int N = static_cast<int>(hn::MaxLanes(hn::ScalableTag<T>()))>
static HWY_INLINE hn::Vec<hn::ScalableTag<T>> SumsOf(const T* vectors)
{
  const hn::ScalableTag<T> d;
  if constexpr (N == 1)
  {
    return hn::Load(d, vectors);
  }
  else
  {
#if HWY_TARGET != HWY_SCALAR
    const auto low = SumsOf<T, N / 2>(vectors);
    const auto high = SumsOf<T, N / 2>(vectors + N / 2 * Lanes<T>::Count());
    return hn::Add(hn::ConcatEven(d, high, low), hn::ConcatOdd(d, high, low));
#endif
  }
}

/// Moments of as many splats as a vector has lanes, from those at `first` on.
template <class T, bool WithError>
static HWY_INLINE void GatherSome(const SplatRows<T>& splats, int first, const PixelRows<T>& derivative,
                                  MomentBlock<T>& moments)
{
  using L = Lanes<T>;
  const hn::ScalableTag<T> d;
  constexpr int kMost = static_cast<int>(hn::MaxLanes(d));
  const int lanes = L::Count(), last = std::min(first + lanes, splats.count);
  alignas(64) T parts[kMomentRows][kMost * kMost];
  bool direct = false;
  for (int i = first; i < last; ++i)
  {
    const Stretch<T> stretch{splats.At(kRow, i), splats.At(kRowBegin, i), splats.At(kRowEnd, i),
                             splats.At(kColumnBegin, i), splats.At(kColumnEnd, i)};
    const int reach = splats.At(kReach, i);
    OffsetSums<T> sums = NoSums<T>();
    if (reach == kOneStretch)
    {
      const RecurrenceStart<T> start(splats, i);
      const T offset = T(-0.5) - splats.At(kMv, i);
      for (int column = stretch.columnBegin; column < stretch.columnEnd; column += lanes)
      {
        GatherColumns<T, WithError>(start, offset, stretch, column, derivative, sums);
      }
    }
    else if (reach == 0)
    {
      direct = true;
    }
    else
    {
      GatherStretches<T, WithError>(splats, i, derivative, sums);
    }
    const auto keep = [&](int row, auto sum) HWY_ATTR { hn::StoreU(sum, d, parts[row] + (i - first) * lanes); };
    keep(kMoment0, sums.one);
    keep(kMoment1, sums.u);
    keep(kMoment2, sums.v);
    keep(kMoment11, sums.uu);
    keep(kMoment12, sums.uv);
    keep(kMoment22, sums.vv);
    if (WithError)
    {
      keep(kMomentError, sums.error);
    }
  }
  const auto sum = [&](int row) HWY_ATTR { return L(SumsOf<T>(parts[row])); };
  const auto at = [&](SplatReal field) HWY_ATTR { return L::Load(splats[field] + first); };
  const L a = at(kU11), b = at(kU12), e = at(kU22);  // U, applied to the sums: eta1 = a u + b v, eta2 = e v
  const L u = sum(kMoment1), v = sum(kMoment2), uu = sum(kMoment11), uv = sum(kMoment12), vv = sum(kMoment22);
  const auto store = [&](int row, L value) HWY_ATTR { value.Store(moments.values[row] + first); };
  store(kMoment0, sum(kMoment0));
  store(kMoment1, a * u + b * v);
  store(kMoment2, e * v);
  store(kMoment11, a * a * uu + L(T(2)) * a * b * uv + b * b * vv);
  store(kMoment12, e * (a * uv + b * vv));
  store(kMoment22, e * e * vv);
  if (WithError)
  {
    store(kMomentError, sum(kMomentError));
  }
  for (int i = first; i < last && direct; ++i)
  {
    if (splats.At(kReach, i) == 0)
    {
      GatherDirect(splats, i, derivative, moments.values[0] + i);
    }
  }
}

template <class T>
static void GatherMoments(const SplatRows<T>& splats, const PixelRows<T>& derivative, bool withError,
                          MomentBlock<T>& moments)
{
  for (int first = 0; first < splats.count; first += Lanes<T>::Count())
  {
    withError ? GatherSome<T, true>(splats, first, derivative, moments)
              : GatherSome<T, false>(splats, first, derivative, moments);
  }
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_FOOTPRINTS_INL_H
