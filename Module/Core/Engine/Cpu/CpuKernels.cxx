// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/Cpu/CpuKernels.h"

#include <algorithm>
#include <cmath>
#include <cstring>

// Vectors of unknown size cannot be kept in structures, as is done here.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Core/Engine/Cpu/CpuKernels.cxx"
// foreach_target.h comes first: it compiles the rest once for every instruction set.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
#include <hwy/contrib/math/math-inl.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace bigus
{
namespace HWY_NAMESPACE
{

namespace hn = hwy::HWY_NAMESPACE;

// ---------------------------------------------------------------------------------------------------------------
// A SIMD vector as a number, for the formulas of Splat-inl.h, PixelLoss-inl.h and Adam-inl.h.

template <class T>
struct Lanes
{
  using D = hn::ScalableTag<T>;
  using V = hn::Vec<D>;
  V v;
  Lanes() = default;
  HWY_INLINE Lanes(V vector) : v(vector) {}
  HWY_INLINE Lanes(T scalar) : v(hn::Set(D(), scalar)) {}
  static int Count() { return static_cast<int>(hn::Lanes(D())); }
  static HWY_INLINE Lanes Load(const T* p) { return hn::LoadU(D(), p); }
  HWY_INLINE void Store(T* p) const { hn::StoreU(v, D(), p); }

  friend HWY_INLINE Lanes operator+(Lanes a, Lanes b) { return hn::Add(a.v, b.v); }
  friend HWY_INLINE Lanes operator-(Lanes a, Lanes b) { return hn::Sub(a.v, b.v); }
  friend HWY_INLINE Lanes operator*(Lanes a, Lanes b) { return hn::Mul(a.v, b.v); }
  friend HWY_INLINE Lanes operator/(Lanes a, Lanes b) { return hn::Div(a.v, b.v); }
  friend HWY_INLINE Lanes operator-(Lanes a) { return hn::Neg(a.v); }
  friend HWY_INLINE Lanes& operator+=(Lanes& a, Lanes b) { return a = a + b; }
  friend HWY_INLINE auto operator<(Lanes a, Lanes b) { return hn::Lt(a.v, b.v); }
  friend HWY_INLINE auto operator>(Lanes a, Lanes b) { return hn::Gt(a.v, b.v); }
  friend HWY_INLINE auto operator<=(Lanes a, Lanes b) { return hn::Le(a.v, b.v); }
  friend HWY_INLINE auto operator>=(Lanes a, Lanes b) { return hn::Ge(a.v, b.v); }
  friend HWY_INLINE auto operator==(Lanes a, Lanes b) { return hn::Eq(a.v, b.v); }
  friend HWY_INLINE Lanes sqrt(Lanes a) { return hn::Sqrt(a.v); }
  friend HWY_INLINE Lanes exp(Lanes a) { return hn::Exp(D(), a.v); }
  friend HWY_INLINE Lanes log(Lanes a) { return hn::Log(D(), a.v); }
  friend HWY_INLINE Lanes abs(Lanes a) { return hn::Abs(a.v); }
  friend HWY_INLINE Lanes floor(Lanes a) { return hn::Floor(a.v); }
  friend HWY_INLINE Lanes ceil(Lanes a) { return hn::Ceil(a.v); }
  friend HWY_INLINE Lanes min(Lanes a, Lanes b) { return hn::Min(a.v, b.v); }
  friend HWY_INLINE Lanes max(Lanes a, Lanes b) { return hn::Max(a.v, b.v); }
};

template <class M, class T>
HWY_INLINE Lanes<T> Select(M condition, Lanes<T> a, Lanes<T> b)
{
  return hn::IfThenElse(condition, a.v, b.v);
}

#include "Core/Formula/PixelLoss-inl.h"
#include "Core/Formula/Splat-inl.h"
// Use the types above.
#include "Core/Formula/Adam-inl.h"
#include "Core/Formula/Footprint-inl.h"

/// One number in every lane.
template <class T>
static HWY_INLINE View<Lanes<T>> Broadcast(const bigus::View<T>& v)
{
  const auto vector = [](const bigus::Vector3<T>& p) { return Vector3<Lanes<T>>{p.x, p.y, p.z}; };
  return {vector(v.origin), vector(v.a),     vector(v.b), vector(v.n),
          vector(v.dualA),  vector(v.dualB), v.area,      v.elevationVariance};
}

// ---------------------------------------------------------------------------------------------------------------
// Exponents.

/// e^x = power (1 + q) for |x| <= -kLowestExponent, in float: Cody-Waite reduction by a power of two and a
/// Taylor polynomial of q on [-ln 2 / 2, ln 2 / 2], relative error below 1.2e-7.
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

// ---------------------------------------------------------------------------------------------------------------
// Projection.

/// Rows that a recurrence runs from its start: as many as hold a whole footprint, or else fewer, where w is
/// still large at the end and so is the error (see Recurrence).
constexpr int kLongestReach = 32, kReachInside = 16;

template <class T>
static HWY_INLINE Gaussian<Lanes<T>> LoadGaussian(const T (*HWY_RESTRICT rows)[kBlock], int first)
{
  const auto at = [&](int row) { return Lanes<T>::Load(rows[row] + first); };
  return {{at(0), at(1), at(2)}, {at(3), at(4), at(5)}, {at(6), at(7), at(8), at(9)}, at(10)};
}

/// The block's arrays one after the other: mean, logScale, rotation, reflectivity.
constexpr int kRows = 11;
template <class T>
static HWY_INLINE const T (*RowsOf(const GaussianBlock<T>& block))[kBlock]
{
  static_assert(sizeof(GaussianBlock<T>) == kRows * kBlock * sizeof(T));
  return block.mean;
}

/// mu_z^2, mm^2.
template <class T>
static HWY_INLINE Lanes<T> SquaredDistance(const GaussianBlock<T>& block, int first, const bigus::View<T>& view)
{
  const auto offset = [&](int axis, T origin) { return Lanes<T>::Load(block.mean[axis] + first) - Lanes<T>(origin); };
  const Lanes<T> z = Lanes<T>(view.n.x) * offset(0, view.origin.x) + Lanes<T>(view.n.y) * offset(1, view.origin.y) +
                     Lanes<T>(view.n.z) * offset(2, view.origin.z);
  return z * z;
}

/// The slab test: a Gaussian matters on a plane only if mu_z^2 <= k^2 t, and t <= s_max^2 + sigma_E^2.
template <class T>
static HWY_INLINE auto InSlab(const GaussianBlock<T>& block, int first, Lanes<T> squaredDistance, T elevationVariance,
                              Lanes<T> magnitude, T tolerance)
{
  const Lanes<T> scale =
      exp(max(max(Lanes<T>::Load(block.logScale[0] + first), Lanes<T>::Load(block.logScale[1] + first)),
              Lanes<T>::Load(block.logScale[2] + first)));
  // A thousandth more than the bound, so that its own rounding drops nothing.
  const Lanes<T> reach =
      CutFor(magnitude, tolerance) * (scale * scale + Lanes<T>(elevationVariance)) * Lanes<T>(T(1.001));
  return hn::And(squaredDistance <= reach, reach > Lanes<T>(T(0)));
}

template <class T>
static int CountInSlab(const GaussianBlock<T>& block, int count, const bigus::View<T>& view, T slab)
{
  const hn::ScalableTag<T> d;
  std::size_t inside = 0;
  for (int first = 0; first < count; first += Lanes<T>::Count())
  {
    const auto valid = hn::FirstN(d, static_cast<std::size_t>(count - first));
    inside += hn::CountTrue(d, hn::And(valid, SquaredDistance(block, first, view) <= Lanes<T>(slab)));
  }
  return static_cast<int>(inside);
}

template <class T>
static int ProjectBlock(const GaussianBlock<T>& block, int count, const ProjectionTask<T>& task, SplatBuffer<T>& out)
{
  using L = Lanes<T>;
  const hn::ScalableTag<T> d;
  const int lanes = L::Count();
  const T(*rows)[kBlock] = RowsOf(block);

  // Those near the plane, moved together so that no lane is projected in vain.
  alignas(64) T near[kRows + 1][SplatBuffer<T>::kStride];
  int found = 0;
  for (int first = 0; first < count; first += lanes)
  {
    const L squaredDistance = SquaredDistance(block, first, task.view);
    const auto valid = hn::FirstN(d, static_cast<std::size_t>(count - first));
    auto inside = hn::And(valid, squaredDistance <= L(task.slab));
    if (hn::AllFalse(d, inside))
    {
      continue;
    }
    const L magnitude = task.commonMagnitude > 0
                            ? L(task.commonMagnitude)
                            : max(abs(L::Load(block.reflectivity + first)), L(task.leastMagnitude));
    inside =
        hn::And(inside, InSlab(block, first, squaredDistance, task.view.elevationVariance, magnitude, task.tolerance));
    for (int row = 0; row < kRows; ++row)
    {
      hn::CompressStore(hn::LoadU(d, rows[row] + first), inside, d, near[row] + found);
    }
    found += static_cast<int>(hn::CompressStore(hn::Iota(d, static_cast<T>(first)), inside, d, near[kRows] + found));
  }

  const View<L> view = Broadcast(task.view);
  const L originColumn(static_cast<T>(task.originColumn)), originRow(static_cast<T>(task.originRow));
  const L firstColumn(static_cast<T>(task.columnBegin)), lastColumn(static_cast<T>(task.columnEnd));
  const L firstRow(static_cast<T>(task.rowBegin)), lastRow(static_cast<T>(task.rowEnd));
  const L zero(T(0)), one(T(1)), lowest(task.lowestExponent);
  int kept = 0;
  for (int first = 0; first < found; first += lanes)
  {
    const auto at = [&](int row) { return L::Load(near[row] + first); };
    const Gaussian<L> gaussian{{at(0), at(1), at(2)}, {at(3), at(4), at(5)}, {at(6), at(7), at(8), at(9)}, at(10)};
    const Splat<L> s = Project(gaussian, view).splat;
    const L magnitude =
        task.commonMagnitude > 0 ? L(task.commonMagnitude) : max(abs(gaussian.reflectivity), L(task.leastMagnitude));
    const Footprint<L> f = FootprintOf(s, magnitude, task.tolerance, task.lowestExponent);
    const auto clip = [](L value, L low, L high) { return min(max(value, low), high); };
    const L columnBegin = clip(originColumn + f.columnBegin, firstColumn, lastColumn);
    const L columnEnd = clip(originColumn + f.columnEnd, firstColumn, lastColumn);
    const L rowBegin = clip(originRow + (f.row - f.half), firstRow, lastRow);
    const L rowEnd = clip(originRow + (f.row + f.half), firstRow, lastRow);

    // How many rows a recurrence (see there) may run.
    L reach = zero;
    for (const T rows : {T(kReachInside / 4), T(kReachInside / 2), T(kReachInside)})
    {
      reach = Select(WeightsHold(f, min(L(rows), f.half)), L(rows), reach);
    }
    const auto whole = hn::And(f.half <= L(T(kLongestReach)), WeightsHold(f, f.half));
    reach = Select(whole, L(T(kLongestReach)), reach);
    reach = task.direct ? zero : Select(RatiosHold(f, task.lowestExponent), reach, zero);

    auto visible = hn::And(columnBegin < columnEnd, rowBegin < rowEnd);
    visible = hn::And(visible, hn::And(f.cut > zero, f.logAmplitude > lowest));
    visible = hn::And(visible, hn::FirstN(d, static_cast<std::size_t>(found - first)));
    L fields[kSplatFields];
    fields[kU11] = s.u11;
    fields[kU12] = s.u12;
    fields[kU22] = s.u22;
    fields[kMu] = f.mu;
    fields[kMv] = f.mv;
    fields[kLogAmplitude] = f.logAmplitude;
    fields[kCut] = f.cut;
    fields[kRowFactor] = exp(max(-f.curvature, lowest));
    fields[kColumn] = originColumn + f.column;
    fields[kRow] = originRow + f.row;
    fields[kColumnBegin] = columnBegin;
    fields[kColumnEnd] = columnEnd;
    fields[kRowBegin] = rowBegin;
    fields[kRowEnd] = rowEnd;
    fields[kReach] = reach;
    fields[kGaussian] = at(kRows);
    for (int k = 0; k < kSplatFields; ++k)
    {
      hn::CompressStore(fields[k].v, visible, d, out.fields[k] + kept);
    }
    kept += static_cast<int>(hn::CountTrue(d, visible));
  }
  return kept;
}

// ---------------------------------------------------------------------------------------------------------------
// Footprints by an exponential a pixel.

/// A row of a footprint: the pixels inside |U (p - m)|^2 <= cut, and w there. The ridge, where eta1 = 0, is
/// found in double and kept as a pixel and a fraction: along a needle u11 du and u12 dv are large and cancel.
template <class T>
struct DirectRow
{
  using D = hn::ScalableTag<T>;
  using V = hn::Vec<D>;
  int begin = 0, end = 0;
  std::int64_t ridge = 0;  // pixel
  T fraction = 0, eta2, u11, constant;

  HWY_INLINE DirectRow(const bigus::VisibleSplat<T>& s, int row) : u11(s.u11)
  {
    const double dv = static_cast<double>(row) - s.row - s.mv;
    eta2 = static_cast<T>(s.u22 * dv);
    constant = s.logAmplitude - T(0.5) * eta2 * eta2;
    const T rest = s.cut - eta2 * eta2;
    if (!(rest > 0))
    {
      return;
    }
    const double centre = static_cast<double>(s.column) + (s.mu - s.u12 / static_cast<double>(s.u11) * dv);
    const double bounded = std::min(std::max(centre, -1e15), 1e15);
    ridge = static_cast<std::int64_t>(std::floor(bounded + 0.5));
    fraction = static_cast<T>(bounded - static_cast<double>(ridge));
    // eta1^2 <= rest  <=>  |column - centre| <= half. Limits are clamped as floating point, where infinity is
    // harmless.
    const double half = std::sqrt(static_cast<double>(rest)) / s.u11;
    const auto clip = [&s](double column)
    { return static_cast<int>(std::min<double>(std::max<double>(column, s.columnBegin), s.columnEnd)); };
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
static void AddDirect(const bigus::VisibleSplat<T>& s, int rowBegin, int rowEnd, const PixelRows<T>& image, T value)
{
  const hn::ScalableTag<T> d;
  const int lanes = Lanes<T>::Count();
  for (int row = rowBegin; row < rowEnd; ++row)
  {
    const DirectRow<T> line(s, row);
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
static void GatherDirect(const bigus::VisibleSplat<T>& s, const PixelRows<T>& derivative, T* HWY_RESTRICT out)
{
  const hn::ScalableTag<T> d;
  const int lanes = Lanes<T>::Count();
  auto m0 = hn::Zero(d), m1 = hn::Zero(d), m2 = hn::Zero(d), m11 = hn::Zero(d), m12 = hn::Zero(d), m22 = hn::Zero(d),
       error = hn::Zero(d);
  for (int row = static_cast<int>(s.rowBegin); row < static_cast<int>(s.rowEnd); ++row)
  {
    const DirectRow<T> line(s, row);
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

// ---------------------------------------------------------------------------------------------------------------
// Recurrence. Along a column, one row further down,
//
//     w <- w q,   q <- q c,   q = exp(ln w(v + 1) - ln w(v)),   c = exp(-(u12^2 + u22^2)),
//
// and upwards with c / q instead of q: two multiplications a pixel instead of an exponential. w and q are
// computed at a start row; from there it runs `reach` rows up and as many down, both at once, since each step
// waits for the one before. A footprint taller than that has several starts, 2 reach rows apart, counted from
// its own centre: so what a pixel gets does not depend on which pixels are computed. After n rows the
// relative error is about n^2 / 2 + n |ln q| roundings, 1e-5 at worst after 16; a footprint that ends within
// 32, at k standard deviations, has fallen so far by then that no error exceeds 0.4 (32 / k)^2 roundings of
// its peak.

template <class T>
struct Stretch
{
  int start;       // w and q are computed at this row
  int begin, end;  // rows wanted
  int columnBegin, columnEnd;
};

/// Whether one stretch holds the whole footprint.
template <class T>
static HWY_INLINE bool IsShort(const bigus::VisibleSplat<T>& s)
{
  const T eta2 = s.u22 * (s.reach - 1);
  return s.cut < eta2 * eta2;
}

/// The stretch that starts at `start`, of the rows [begin, end). Its columns are those of the footprint in
/// all rows that it might have, so that they too do not depend on which are wanted.
template <class T>
static HWY_INLINE Stretch<T> StretchAt(const bigus::VisibleSplat<T>& s, int start, int begin, int end)
{
  const int columnBegin = static_cast<int>(s.columnBegin), columnEnd = static_cast<int>(s.columnEnd);
  if (IsShort(s))
  {
    return {start, begin, end, columnBegin, columnEnd};
  }
  const T middle = static_cast<T>(start) - s.row;
  const T top = middle - s.reach - s.mv, bottom = middle + s.reach - 1 - s.mv;
  const T nearest = s.u22 * (top > 0 ? top : (bottom < 0 ? -bottom : T(0)));
  const T half = std::sqrt(std::max(s.cut - nearest * nearest, T(0))) / s.u11;
  const T slope = -s.u12 / s.u11;
  const auto column = [&](T offset)
  { return static_cast<int>(std::min(std::max(s.column + offset, s.columnBegin), s.columnEnd)); };
  const T low = s.mu + std::min(slope * top, slope * bottom) - half;
  const T high = s.mu + std::max(slope * top, slope * bottom) + half;
  return {start, begin, end, column(std::floor(low)), column(std::ceil(high) + 1)};
}

/// walk(stretch) for every stretch of the footprint in rows [begin, end).
template <class T, class Walk>
static HWY_INLINE void ForStretches(const bigus::VisibleSplat<T>& s, int begin, int end, Walk&& walk)
{
  const int centre = static_cast<int>(s.row), reach = static_cast<int>(s.reach);
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
    walk(StretchAt(s, start, row, last));
    row = last;
  }
}

/// w and its ratios to the next row and the row before, for C vectors of columns; 0 beyond the footprint's
/// box and where w would underflow.
template <class T, int C>
struct Columns
{
  using D = hn::ScalableTag<T>;
  using V = hn::Vec<D>;
  V du[C], down[C], downRatio[C], up[C], upRatio[C];

  HWY_INLINE Columns(const bigus::VisibleSplat<T>& s, const Stretch<T>& stretch, int column, T value)
  {
    const D d;
    const int lanes = Lanes<T>::Count();
    const T dv = static_cast<T>(stretch.start) - s.row - s.mv;
    const T eta2 = s.u22 * dv;
    const T curvature = s.u12 * s.u12 + s.u22 * s.u22;
    const T dx = static_cast<T>(column) - s.column;
    const V shift = hn::Set(d, s.u12 * dv), constant = hn::Set(d, s.logAmplitude - T(0.5) * eta2 * eta2);
    const V step = hn::Set(d, -s.u22 * eta2 - T(0.5) * curvature);
    const V c = hn::Set(d, s.rowFactor), one = hn::Set(d, T(1));
    const V lowest = hn::Set(d, kLowestExponent<T>);
    for (int k = 0; k < C; ++k)
    {
      // Whole numbers first: what a pixel gets must not depend on its lane.
      du[k] = hn::Sub(hn::Iota(d, dx + static_cast<T>(k * lanes)), hn::Set(d, s.mu));
      const V eta1 = hn::MulAdd(hn::Set(d, s.u11), du[k], shift);
      const V exponent = hn::MulAdd(hn::Mul(hn::Set(d, T(-0.5)), eta1), eta1, constant);
      const V logRatio = hn::NegMulAdd(hn::Set(d, s.u12), eta1, step);
      auto inside = hn::Gt(exponent, lowest);
      if (k == C - 1)
      {
        const int left = stretch.columnEnd - column - k * lanes;
        inside = hn::And(inside, hn::FirstN(d, static_cast<std::size_t>(left)));
      }
      const V w = hn::IfThenElseZero(inside, hn::Mul(hn::Set(d, value), BoundedExp(d, exponent)));
      downRatio[k] = hn::IfThenElse(inside, BoundedExp(d, logRatio), one);
      V ratio;
      if constexpr (sizeof(T) == 4)
      {
        // c / q, but an exponential is faster than a division.
        ratio = hn::IfThenElse(inside, BoundedExp(d, hn::Sub(hn::Set(d, -curvature), logRatio)), one);
      }
      else
      {
        ratio = hn::Div(c, downRatio[k]);
      }
      down[k] = w;
      up[k] = hn::Mul(w, ratio);
      upRatio[k] = hn::Mul(ratio, c);
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
static HWY_INLINE void AddColumns(const bigus::VisibleSplat<T>& s, const Stretch<T>& stretch, int column,
                                  const PixelRows<T>& image, T value)
{
  const hn::ScalableTag<T> d;
  const int lanes = Lanes<T>::Count();
  const auto c = hn::Set(d, s.rowFactor);
  Columns<T, C> columns(s, stretch, column, value);
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
static HWY_NOINLINE void AddStretches(const bigus::VisibleSplat<T>& s, int begin, int end, const PixelRows<T>& image,
                                      T value)
{
  const int lanes = Lanes<T>::Count();
  ForStretches(s, begin, end,
               [&](const Stretch<T>& stretch) HWY_ATTR
               {
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

/// Rows are counted from the line between the two at a start, t = n + 1/2 down and -t up: what a pair of rows
/// gives to even and odd powers of t are a sum and a difference.
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
static HWY_INLINE void GatherColumns(const bigus::VisibleSplat<T>& s, const Stretch<T>& stretch, int column,
                                     const PixelRows<T>& derivative, OffsetSums<T>& sums)
{
  using V = hn::Vec<hn::ScalableTag<T>>;
  const hn::ScalableTag<T> d;
  const V c = hn::Set(d, s.rowFactor);
  Columns<T, 1> columns(s, stretch, column, T(1));
  V column0 = hn::Zero(d), column1 = hn::Zero(d), column2 = hn::Zero(d);
  const int rowsDown = stretch.end - stretch.start, rowsUp = stretch.start - stretch.begin;
  if (rowsDown == rowsUp)
  {
    const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(derivative.stride);
    const T *below = derivative.Row(stretch.start) + column, *above = below - stride;
    for (int n = 0; n < rowsDown; ++n)
    {
      const V a = hn::Mul(columns.down[0], hn::LoadU(d, below));
      const V b = hn::Mul(columns.up[0], hn::LoadU(d, above));
      const V sum = hn::Add(a, b);
      column0 = hn::Add(column0, sum);
      column1 = hn::MulAdd(hn::Sub(a, b), hn::Set(d, kRowOffsets<T>.t[n]), column1);
      column2 = hn::MulAdd(sum, hn::Set(d, kRowOffsets<T>.squared[n]), column2);
      if (WithError)
      {
        sums.error = hn::Add(sums.error, hn::Add(hn::Abs(a), hn::Abs(b)));
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
  const V middle = hn::Set(d, static_cast<T>(stretch.start) - s.row - s.mv - T(0.5)), du = columns.du[0];
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
static HWY_NOINLINE void GatherStretches(const bigus::VisibleSplat<T>& s, const PixelRows<T>& derivative,
                                         OffsetSums<T>& sums)
{
  ForStretches(s, static_cast<int>(s.rowBegin), static_cast<int>(s.rowEnd),
               [&](const Stretch<T>& stretch) HWY_ATTR
               {
                 for (int column = stretch.columnBegin; column < stretch.columnEnd; column += Lanes<T>::Count())
                 {
                   GatherColumns<T, WithError>(s, stretch, column, derivative, sums);
                 }
               });
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

// ---------------------------------------------------------------------------------------------------------------
// Chain rule and optimizer.

template <class T>
static void AddAdjoints(const GaussianBlock<T>& block, const bigus::View<T>& scalarView,
                        const bigus::VisibleSplat<T>* splats, int count, const MomentBlock<T>& moments,
                        GradientBlock<T>& gradient, ScoreBlock<T>* scores)
{
  using L = Lanes<T>;
  const hn::ScalableTag<T> d;
  const hn::RebindToSigned<hn::ScalableTag<T>> di;
  using Index = hn::TFromD<decltype(di)>;
  const int lanes = L::Count();
  const View<L> view = Broadcast(scalarView);
  const T(*rows)[kBlock] = RowsOf(block);
  for (int first = 0; first < count; first += lanes)
  {
    alignas(64) Index indices[16] = {};
    const int active = std::min(lanes, count - first);
    for (int i = 0; i < active; ++i)
    {
      indices[i] = static_cast<Index>(splats[first + i].gaussian);
    }
    const auto index = hn::Load(di, indices);
    const auto at = [&](int row) { return L(hn::GatherIndex(d, rows[row], index)); };
    const Gaussian<L> gaussian{{at(0), at(1), at(2)}, {at(3), at(4), at(5)}, {at(6), at(7), at(8), at(9)}, at(10)};
    Moments<L> m;
    const auto moment = [&](int row) { return L::Load(moments.values[row] + first); };
    m.m0 = moment(kMoment0);
    m.m1 = moment(kMoment1);
    m.m2 = moment(kMoment2);
    m.m11 = moment(kMoment11);
    m.m12 = moment(kMoment12);
    m.m22 = moment(kMoment22);
    const GaussianGradient<L> g = ProjectAdjoint(gaussian, Project(gaussian, view), m);
    alignas(64) T lane[kParametersPerGaussian][16];
    L values[kParametersPerGaussian];
    ToArray(g, values);
    for (int k = 0; k < kParametersPerGaussian; ++k)
    {
      values[k].Store(lane[k]);
    }
    for (int i = 0; i < active; ++i)
    {
      for (int k = 0; k < kParametersPerGaussian; ++k)
      {
        gradient.values[k][indices[i]] += lane[k][i];
      }
      gradient.visits[indices[i]] += 1;
      if (scores)
      {
        scores->error[indices[i]] += moments.values[kMomentError][first + i];
        scores->visits[indices[i]] += 1;
        for (int k = 0; k < 3; ++k)
        {
          scores->descent[k][indices[i]] -= lane[kMeanAt + k][i];
        }
      }
    }
  }
}

template <class T>
static int UpdateBlock(GaussianBlock<T>& block, AdamBlock<T>& state, const GradientBlock<T>& gradient, int count,
                       const AdamStep& step)
{
  using L = Lanes<T>;
  const hn::ScalableTag<T> d;
  const int lanes = L::Count();
  T(*rows)[kBlock] = block.mean;
  std::size_t guarded = 0;
  for (int first = 0; first < count; first += lanes)
  {
    auto touched = L::Load(gradient.visits + first) > L(T(0));
    touched = hn::And(touched, hn::FirstN(d, static_cast<std::size_t>(count - first)));
    if (hn::AllFalse(d, touched))
    {
      continue;
    }
    Gaussian<L> gaussian = LoadGaussian<T>(RowsOf(block), first);
    AdamState<L> adam;
    L g[kParametersPerGaussian];
    for (int k = 0; k < kParametersPerGaussian; ++k)
    {
      g[k] = L::Load(gradient.values[k] + first);
      adam.first[k] = L::Load(state.first[k] + first);
      adam.second[k] = L::Load(state.second[k] + first);
    }
    adam.updates = L::Load(state.updates + first);
    const L bad = UpdateGaussian(gaussian, adam, FromArray(g), step);
    guarded += hn::CountTrue(d, hn::And(touched, bad > L(T(0))));
    const L changed[kRows] = {gaussian.mean.x,      gaussian.mean.y,      gaussian.mean.z,      gaussian.logScale.x,
                              gaussian.logScale.y,  gaussian.logScale.z,  gaussian.rotation[0], gaussian.rotation[1],
                              gaussian.rotation[2], gaussian.rotation[3], gaussian.reflectivity};
    const auto store = [&](L value, T* p) { hn::StoreU(hn::IfThenElse(touched, value.v, hn::LoadU(d, p)), d, p); };
    for (int row = 0; row < kRows; ++row)
    {
      store(changed[row], rows[row] + first);
    }
    for (int k = 0; k < kParametersPerGaussian; ++k)
    {
      store(adam.first[k], state.first[k] + first);
      store(adam.second[k], state.second[k] + first);
    }
    store(adam.updates, state.updates + first);
  }
  return static_cast<int>(guarded);
}

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
  alignas(64) T aspects[kBlock] = {};
  for (int first = 0; first < count; first += L::Count())
  {
    const L x = L::Load(block.logScale[0] + first), y = L::Load(block.logScale[1] + first),
            z = L::Load(block.logScale[2] + first);
    (max(max(x, y), z) - min(min(x, y), z)).Store(aspects + first);
  }
  extreme(aspects, low, bounds.logAspect);
  return bounds;
}

// ---------------------------------------------------------------------------------------------------------------
// Pixels.

template <class T>
static void ToIntensity(const T* scattering, std::size_t count, T gamma, T* out)
{
  const hn::ScalableTag<T> d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d))
  {
    const auto s = hn::Max(hn::LoadU(d, scattering + i), hn::Zero(d));
    const auto exponent = hn::Max(hn::Mul(hn::Set(d, -gamma), s), hn::Set(d, kLowestExponent<T>));
    hn::StoreU(hn::Neg(BoundedExpm1(d, exponent)), d, out + i);
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

template <class T>
static Kernels<T> Table()
{
  return {CountInSlab<T>, ProjectBlock<T>, AddFootprints<T>, GatherMoments<T>, AddAdjoints<T>,
          UpdateBlock<T>, BoundsOf<T>,     ToIntensity<T>,   ToDerivative<T>,  hwy::TargetName(HWY_TARGET)};
}
Kernels<float> FloatTable()
{
  return Table<float>();
}
Kernels<double> DoubleTable()
{
  return Table<double>();
}

}  // namespace HWY_NAMESPACE
}  // namespace bigus
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bigus
{

HWY_EXPORT(FloatTable);
HWY_EXPORT(DoubleTable);

template <>
Kernels<float> KernelsOfThisMachine()
{
  return HWY_DYNAMIC_DISPATCH(FloatTable)();
}
template <>
Kernels<double> KernelsOfThisMachine()
{
  return HWY_DYNAMIC_DISPATCH(DoubleTable)();
}

}  // namespace bigus
#endif  // HWY_ONCE
