// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Footprints by an exponential a pixel. Compiled once for every instruction set, hence the guard that foreach_target.h
// turns over.
#if defined(BIGUS_CPU_DIRECT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BIGUS_CPU_DIRECT_INL_H
#undef BIGUS_CPU_DIRECT_INL_H
#else
#define BIGUS_CPU_DIRECT_INL_H
#endif

#include <algorithm>
#include <cmath>

#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/Lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

/// A row of a footprint: the pixels inside |U (p - m)|^2 <= cut, and w there. The ridge, where eta1 = 0, is found in
/// double and kept as a pixel and a fraction: along a needle u11 du and u12 dv are large and cancel.
template <class T>
struct DirectRow
{
  using D = hn::ScalableTag<T>;
  using V = hn::Vec<D>;
  int begin = 0, end = 0;
  std::int64_t ridge = 0;  // pixel
  T fraction = 0, eta2, u11, constant;

  HWY_INLINE DirectRow(const SplatRows<T>& s, int i, int row) : u11(s.At(kU11, i))
  {
    const double dv = static_cast<double>(row - s.At(kRow, i)) - s.At(kMv, i);
    eta2 = static_cast<T>(s.At(kU22, i) * dv);
    constant = s.At(kLogAmplitude, i) - T(0.5) * eta2 * eta2;
    const T rest = s.At(kCut, i) - eta2 * eta2;
    if (!(rest > 0))
    {
      return;
    }
    const double centre = s.At(kColumn, i) + (s.At(kMu, i) - s.At(kU12, i) / static_cast<double>(u11) * dv);
    const double bounded = std::min(std::max(centre, -1e15), 1e15);
    ridge = static_cast<std::int64_t>(std::floor(bounded + 0.5));
    fraction = static_cast<T>(bounded - static_cast<double>(ridge));
    // eta1^2 <= rest  <=>  |column - centre| <= half. Limits are clamped as floating point, where infinity is harmless;
    // what is no number, of a footprint far away, becomes the first column.
    const double half = std::sqrt(static_cast<double>(rest)) / u11;
    const auto clip = [&s, i](double column) {
      return static_cast<int>(std::min<double>(s.At(kColumnEnd, i), std::max<double>(s.At(kColumnBegin, i), column)));
    };
    begin = clip(std::ceil(centre - half));
    end = std::max(begin, clip(std::floor(centre + half) + 1));
  }
  HWY_INLINE V Eta1(int column) const
  {
    const D d;
    // Whole numbers first: what a pixel gets must not depend on its lane.
    const V whole = hn::Iota(d, static_cast<T>(column - ridge));
    return hn::Mul(hn::Set(d, u11), hn::Sub(whole, hn::Set(d, fraction)));
  }
  HWY_INLINE V Weight(V eta1, int column) const
  {
    const D d;
    const V w = hn::Exp(d, hn::MulAdd(hn::Mul(hn::Set(d, T(-0.5)), eta1), eta1, hn::Set(d, constant)));
    return hn::IfThenElseZero(hn::FirstN(d, static_cast<std::size_t>(end - column)), w);
  }
};

template <class T>
static HWY_NOINLINE void AddDirect(const SplatRows<T>& s, int i, int rowBegin, int rowEnd, const PixelRows<T>& image,
                                   T value)
{
  const hn::ScalableTag<T> d;
  const int lanes = Lanes<T>::Count();
  for (int row = rowBegin; row < rowEnd; ++row)
  {
    const DirectRow<T> line(s, i, row);
    T* out = image.Row(row);
    for (int column = line.begin; column < line.end; column += lanes)
    {
      const auto w = line.Weight(line.Eta1(column), column);
      hn::StoreU(hn::MulAdd(hn::Set(d, value), w, hn::LoadU(d, out + column)), d, out + column);
    }
  }
}

/// Moments by an exponential a pixel. Sums are of powers of eta from the start.
template <class T>
static HWY_NOINLINE void GatherDirect(const SplatRows<T>& s, int i, const PixelRows<T>& derivative, T* HWY_RESTRICT out)
{
  const hn::ScalableTag<T> d;
  const int lanes = Lanes<T>::Count();
  auto m0 = hn::Zero(d), m1 = hn::Zero(d), m2 = hn::Zero(d), m11 = hn::Zero(d), m12 = hn::Zero(d), m22 = hn::Zero(d),
       error = hn::Zero(d);
  for (int row = s.At(kRowBegin, i); row < s.At(kRowEnd, i); ++row)
  {
    const DirectRow<T> line(s, i, row);
    const T* in = derivative.Row(row);
    auto row0 = hn::Zero(d), row1 = hn::Zero(d);
    for (int column = line.begin; column < line.end; column += lanes)
    {
      const auto eta1 = line.Eta1(column);
      const auto gw = hn::Mul(line.Weight(eta1, column), hn::LoadU(d, in + column));
      const auto gw1 = hn::Mul(gw, eta1);
      row0 = hn::Add(row0, gw);
      row1 = hn::Add(row1, gw1);
      m11 = hn::MulAdd(gw1, eta1, m11);
      error = hn::Add(error, hn::Abs(gw));
    }
    const auto eta2 = hn::Set(d, line.eta2);
    const auto row2 = hn::Mul(row0, eta2);
    m0 = hn::Add(m0, row0);
    m1 = hn::Add(m1, row1);
    m2 = hn::Add(m2, row2);
    m12 = hn::MulAdd(row1, eta2, m12);
    m22 = hn::MulAdd(row2, eta2, m22);
  }
  const hn::Vec<hn::ScalableTag<T>> sums[kMomentRows] = {m0, m1, m2, m11, m12, m22, error};
  for (int m = 0; m < kMomentRows; ++m)
  {
    out[m * kBlock] = hn::GetLane(hn::SumOfLanes(d, sums[m]));
  }
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_DIRECT_INL_H
