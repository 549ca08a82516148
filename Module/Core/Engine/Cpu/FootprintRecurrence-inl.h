// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Footprints by a recurrence.
//
// Along a column, one row further down,
//
//     w <- w q,   q <- q c,   c = exp(-(u12^2 + u22^2)):
//
// two multiplications a pixel instead of an exponential, and as much upwards. It starts between two rows, half a row
// from each, with the weight W there and the slope b = -d ln w / dv of a column. With E = exp(-b / 2) the two rows have
//
//     w = W E^(+-1) exp(-c' / 8),   q = E^(+-2) c,   c' = u12^2 + u22^2,
//
// so E and 1 / E, which are one exponential, give all four. From there it runs `reach` rows up and as many down, both at
// once, since each step waits for the one before. A footprint taller than that has several starts, 2 reach rows apart,
// counted from its own centre: so what a pixel gets does not depend on which pixels are computed. After n rows the
// relative error is about n^2 / 2 + n |ln q| roundings, 1e-5 at worst after 16; a footprint that ends within 32, at k
// standard deviations, has fallen so far by then that no error exceeds 0.4 (32 / k)^2 roundings of its peak.
//
// Compiled once for every instruction set, hence the guard that foreach_target.h turns over.
#if defined(BIGUS_CPU_RECURRENCE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BIGUS_CPU_RECURRENCE_INL_H
#undef BIGUS_CPU_RECURRENCE_INL_H
#else
#define BIGUS_CPU_RECURRENCE_INL_H
#endif

#include <algorithm>
#include <cmath>

#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/Exp-inl.h"
#include "Core/Engine/Cpu/Lanes-inl.h"
#include "Core/Engine/Cpu/Project-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

template <class T>
struct Stretch
{
  int start;       // w and q are computed between this row and the one above
  int begin, end;  // rows wanted
  int columnBegin, columnEnd;
};

/// What a recurrence between two rows begins with, exponents in units of kExponentUnit. With du the offset of a column
/// from the centre, eta1 = u11 du + shift, and ln w = constant - eta1^2 / 2, -b / 2 = slope - u12 eta1 / 2.
template <class T>
struct RecurrenceStart
{
  T u11, mu, column, shift, constant, slope, tilt, rowFactor;

  /// Of a footprint of one stretch: it was found with the footprint.
  HWY_INLINE RecurrenceStart(const SplatRows<T>& s, int i)
      : u11(s.At(kU11, i)),
        mu(s.At(kMu, i)),
        column(static_cast<T>(s.At(kColumn, i))),
        shift(s.At(kShift, i)),
        constant(s.At(kConstant, i)),
        slope(s.At(kSlope, i)),
        tilt(T(-0.5) * kExponentUnit<T> * s.At(kU12, i)),
        rowFactor(s.At(kRowFactor, i))
  {
  }
  /// Above some row.
  HWY_INLINE RecurrenceStart(const SplatRows<T>& s, int i, int row) : RecurrenceStart(s, i)
  {
    SetRow(kExponentUnit<T>, s.At(kU12, i), s.At(kU22, i), s.At(kLogAmplitude, i), RowOffset(s, i, row), shift,
           constant, slope);
  }
  /// From the centre to the line above a row.
  static HWY_INLINE T RowOffset(const SplatRows<T>& s, int i, int row)
  {
    return static_cast<T>(row - s.At(kRow, i)) - s.At(kMv, i) - T(0.5);
  }
};

/// The stretch that starts at `start`, of the rows [begin, end). Its columns are those of the footprint in all rows
/// that it might have, so that they too do not depend on which are wanted.
template <class T>
static HWY_INLINE Stretch<T> StretchAt(const SplatRows<T>& s, int i, int start, int begin, int end)
{
  const int columnBegin = s.At(kColumnBegin, i), columnEnd = s.At(kColumnEnd, i), reach = s.At(kReach, i);
  if (reach == kOneStretch)
  {
    return {start, begin, end, columnBegin, columnEnd};
  }
  const T middle = static_cast<T>(start - s.At(kRow, i)), mv = s.At(kMv, i), u11 = s.At(kU11, i);
  const T top = middle - static_cast<T>(reach) - mv, bottom = middle + static_cast<T>(reach - 1) - mv;
  const T nearest = s.At(kU22, i) * (top > 0 ? top : (bottom < 0 ? -bottom : T(0)));
  const T half = std::sqrt(std::max(s.At(kCut, i) - nearest * nearest, T(0))) / u11;
  const T slope = -s.At(kU12, i) / u11;
  // What is no number, of a footprint far away, becomes the first column.
  const auto column = [&](T offset)
  {
    return static_cast<int>(std::min(static_cast<T>(columnEnd),
                                     std::max(static_cast<T>(columnBegin), static_cast<T>(s.At(kColumn, i)) + offset)));
  };
  const T low = s.At(kMu, i) + std::min(slope * top, slope * bottom) - half;
  const T high = s.At(kMu, i) + std::max(slope * top, slope * bottom) + half;
  return {start, begin, end, column(std::floor(low)), column(std::ceil(high) + 1)};
}

/// walk(stretch) for every stretch of the footprint in rows [begin, end).
template <class T, class Walk>
static HWY_INLINE void ForStretches(const SplatRows<T>& s, int i, int begin, int end, Walk&& walk)
{
  const int centre = s.At(kRow, i), reach = s.At(kReach, i) == kOneStretch ? kLongestReach : s.At(kReach, i);
  int start = centre;
  if (begin < centre - reach || end > centre + reach)
  {
    // Floor of the quotient: a centre far below the image has stretches of negative number.
    const int ahead = begin - centre + reach;
    start += (ahead >= 0 ? ahead / (2 * reach) : -((2 * reach - 1 - ahead) / (2 * reach))) * 2 * reach;
  }
  for (int row = begin; row < end; start += 2 * reach)
  {
    const int last = std::min(start + reach, end);
    walk(StretchAt(s, i, start, row, last));
    row = last;
  }
}

/// w and its ratios to the next row and the row before, for C vectors of columns; 0 beyond the footprint's box and
/// where w would underflow.
template <class T, int C>
struct Columns
{
  using D = hn::ScalableTag<T>;
  using V = hn::Vec<D>;
  V du[C], down[C], downRatio[C], up[C], upRatio[C];

  HWY_INLINE Columns(const RecurrenceStart<T>& s, int columnEnd, int column, T value)
  {
    const D d;
    const int lanes = Lanes<T>::Count();
    const T dx = static_cast<T>(column) - s.column;
    const V c = hn::Set(d, s.rowFactor), lowest = hn::Set(d, kLowestExponent<T> * kExponentUnit<T>);
    for (int k = 0; k < C; ++k)
    {
      // Whole numbers first: what a pixel gets must not depend on its lane.
      du[k] = hn::Sub(hn::Add(hn::Iota(d, static_cast<T>(k * lanes)), hn::Set(d, dx)), hn::Set(d, s.mu));
      const V eta1 = hn::MulAdd(hn::Set(d, s.u11), du[k], hn::Set(d, s.shift));
      const V exponent =
          hn::MulAdd(hn::Mul(hn::Set(d, T(-0.5) * kExponentUnit<T>), eta1), eta1, hn::Set(d, s.constant));
      auto inside = hn::Gt(exponent, lowest);
      if (k == C - 1)
      {
        const int left = columnEnd - column - k * lanes;
        inside = hn::And(inside, hn::FirstN(d, static_cast<std::size_t>(left)));
      }
      V more, less;
      FootprintExps(d, hn::IfThenElseZero(inside, hn::MulAdd(hn::Set(d, s.tilt), eta1, hn::Set(d, s.slope))), more,
                    less);
      const V w = hn::IfThenElseZero(inside, hn::Mul(hn::Set(d, value), FootprintExp(d, exponent)));
      down[k] = hn::Mul(w, more);
      up[k] = hn::Mul(w, less);
      downRatio[k] = hn::Mul(hn::Mul(more, more), c);
      upRatio[k] = hn::Mul(hn::Mul(less, less), c);
    }
  }
  HWY_INLINE void StepDown(V c)
  {
    for (int k = 0; k < C; ++k)
    {
      down[k] = hn::Mul(down[k], downRatio[k]);
      downRatio[k] = hn::Mul(downRatio[k], c);
    }
  }
  HWY_INLINE void StepUp(V c)
  {
    for (int k = 0; k < C; ++k)
    {
      up[k] = hn::Mul(up[k], upRatio[k]);
      upRatio[k] = hn::Mul(upRatio[k], c);
    }
  }
};

template <class T, int C>
static HWY_INLINE void AddColumns(const RecurrenceStart<T>& s, const Stretch<T>& stretch, int column,
                                  const PixelRows<T>& image, T value)
{
  const hn::ScalableTag<T> d;
  const int lanes = Lanes<T>::Count();
  const auto c = hn::Set(d, s.rowFactor);
  Columns<T, C> columns(s, stretch.columnEnd, column, value);
  const auto add = [&](const auto* w, T* out)
  {
    for (int k = 0; k < C; ++k)
    {
      hn::StoreU(hn::Add(w[k], hn::LoadU(d, out + k * lanes)), d, out + k * lanes);
    }
  };
  const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(image.stride);
  const int rowsDown = stretch.end - stretch.start, rowsUp = stretch.start - stretch.begin;
  if (rowsDown == rowsUp)
  {
    T *below = image.Row(stretch.start) + column, *above = below - stride;
    for (int n = 0; n < rowsDown; ++n)
    {
      add(columns.down, below);
      columns.StepDown(c);
      add(columns.up, above);
      columns.StepUp(c);
      below += stride;
      above -= stride;
    }
    return;
  }
  for (int row = stretch.start; row < stretch.end; ++row)
  {
    if (row >= stretch.begin)
    {
      add(columns.down, image.Row(row) + column);
    }
    columns.StepDown(c);
  }
  for (int row = stretch.start - 1; row >= stretch.begin; --row)
  {
    if (row < stretch.end)
    {
      add(columns.up, image.Row(row) + column);
    }
    columns.StepUp(c);
  }
}

/// Any footprint. Vectors of columns side by side hide each other's latency.
template <class T>
static HWY_NOINLINE void AddStretches(const SplatRows<T>& splats, int i, int begin, int end, const PixelRows<T>& image,
                                      T value)
{
  const int lanes = Lanes<T>::Count();
  ForStretches(splats, i, begin, end,
               [&](const Stretch<T>& stretch) HWY_ATTR
               {
                 const RecurrenceStart<T> s(splats, i, stretch.start);
                 for (int column = stretch.columnBegin; column < stretch.columnEnd;)
                 {
                   const int left = stretch.columnEnd - column;
                   if (left <= lanes)
                   {
                     AddColumns<T, 1>(s, stretch, column, image, value);
                     column += lanes;
                   }
                   else if (left <= 2 * lanes || left > 3 * lanes)
                   {
                     AddColumns<T, 2>(s, stretch, column, image, value);
                     column += 2 * lanes;
                   }
                   else
                   {
                     AddColumns<T, 3>(s, stretch, column, image, value);
                     column += 3 * lanes;
                   }
                 }
               });
}

/// Sums over footprint pixels of derivative * w * powers of the offset (u, v) from the centre, lane by lane.
template <class T>
struct OffsetSums
{
  using V = hn::Vec<hn::ScalableTag<T>>;
  V one, u, v, uu, uv, vv, error;
};

template <class T>
static HWY_INLINE OffsetSums<T> NoSums()
{
  const auto zero = hn::Zero(hn::ScalableTag<T>());
  return {zero, zero, zero, zero, zero, zero, zero};
}

/// Rows are counted from the line between the two at a start, t = n + 1/2 down and -t up: what a pair of rows gives to
/// even and odd powers of t are a sum and a difference.
template <class T>
struct RowOffsets
{
  T t[kLongestReach], squared[kLongestReach];
  constexpr RowOffsets() : t(), squared()
  {
    for (int n = 0; n < kLongestReach; ++n)
    {
      t[n] = n + T(0.5);
      squared[n] = t[n] * t[n];
    }
  }
};
template <class T>
constexpr RowOffsets<T> kRowOffsets{};

template <class T, bool WithError>
static HWY_INLINE void GatherColumns(const RecurrenceStart<T>& s, T startOffset, const Stretch<T>& stretch, int column,
                                     const PixelRows<T>& derivative, OffsetSums<T>& sums)
{
  using V = hn::Vec<hn::ScalableTag<T>>;
  const hn::ScalableTag<T> d;
  const V c = hn::Set(d, s.rowFactor);
  Columns<T, 1> columns(s, stretch.columnEnd, column, T(1));
  V column0 = hn::Zero(d), column1 = hn::Zero(d), column2 = hn::Zero(d);
  const int rowsDown = stretch.end - stretch.start, rowsUp = stretch.start - stretch.begin;
  if (rowsDown == rowsUp)
  {
    const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(derivative.stride);
    const T *below = derivative.Row(stretch.start) + column, *above = below - stride;
    for (int n = 0; n < rowsDown; ++n)
    {
      const V down = columns.down[0], g = hn::LoadU(d, below), ofAbove = hn::Mul(columns.up[0], hn::LoadU(d, above));
      const V sum = hn::MulAdd(down, g, ofAbove), difference = hn::MulSub(down, g, ofAbove);
      column0 = hn::Add(column0, sum);
      column1 = hn::MulAdd(difference, hn::Set(d, kRowOffsets<T>.t[n]), column1);
      column2 = hn::MulAdd(sum, hn::Set(d, kRowOffsets<T>.squared[n]), column2);
      if (WithError)
      {
        sums.error = hn::Add(sums.error, hn::Add(hn::Abs(hn::Mul(down, g)), hn::Abs(ofAbove)));
      }
      columns.StepDown(c);
      columns.StepUp(c);
      below += stride;
      above -= stride;
    }
  }
  else
  {
    const auto take = [&](V a, int n, T sign) HWY_ATTR
    {
      column0 = hn::Add(column0, a);
      column1 = hn::MulAdd(a, hn::Set(d, sign * kRowOffsets<T>.t[n]), column1);
      column2 = hn::MulAdd(a, hn::Set(d, kRowOffsets<T>.squared[n]), column2);
      if (WithError)
      {
        sums.error = hn::Add(sums.error, hn::Abs(a));
      }
    };
    for (int n = 0; n < rowsDown; ++n)
    {
      const int row = stretch.start + n;
      if (row >= stretch.begin)
      {
        take(hn::Mul(columns.down[0], hn::LoadU(d, derivative.Row(row) + column)), n, T(1));
      }
      columns.StepDown(c);
    }
    for (int n = 0; n < rowsUp; ++n)
    {
      const int row = stretch.start - 1 - n;
      if (row < stretch.end)
      {
        take(hn::Mul(columns.up[0], hn::LoadU(d, derivative.Row(row) + column)), n, T(-1));
      }
      columns.StepUp(c);
    }
  }
  const V middle = hn::Set(d, startOffset), du = columns.du[0];
  const V columnV = hn::MulAdd(middle, column0, column1);
  const V columnU = hn::Mul(du, column0);
  sums.one = hn::Add(sums.one, column0);
  sums.u = hn::Add(sums.u, columnU);
  sums.v = hn::Add(sums.v, columnV);
  sums.uu = hn::MulAdd(columnU, du, sums.uu);
  sums.uv = hn::MulAdd(columnV, du, sums.uv);
  sums.vv = hn::Add(sums.vv, hn::MulAdd(middle, hn::Add(columnV, column1), column2));
}

template <class T, bool WithError>
static HWY_NOINLINE void GatherStretches(const SplatRows<T>& splats, int i, const PixelRows<T>& derivative,
                                         OffsetSums<T>& sums)
{
  ForStretches(splats, i, splats.At(kRowBegin, i), splats.At(kRowEnd, i),
               [&](const Stretch<T>& stretch) HWY_ATTR
               {
                 const RecurrenceStart<T> s(splats, i, stretch.start);
                 const T offset = RecurrenceStart<T>::RowOffset(splats, i, stretch.start);
                 for (int column = stretch.columnBegin; column < stretch.columnEnd; column += Lanes<T>::Count())
                 {
                   GatherColumns<T, WithError>(s, offset, stretch, column, derivative, sums);
                 }
               });
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_RECURRENCE_INL_H
