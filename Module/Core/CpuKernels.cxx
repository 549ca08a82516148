#include "CpuKernels.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Core/CpuKernels.cxx"
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

/// The pixels of one row inside |U (p - m)|^2 <= cut, and eta there: eta1 = slope * column + offset.
struct RowSpan
{
  int begin, end;
  float dv, eta2;
};

/// What SpanOf needs of a splat, with the divisions done once.
struct Shape
{
  float inverseU11, skew;
  explicit Shape(const VisibleSplat& s) : inverseU11(1.0f / s.splat.u11), skew(s.splat.u12 * inverseU11) {}
};

static inline RowSpan SpanOf(const VisibleSplat& s, const Shape& shape, int row)
{
  RowSpan span;
  span.dv = static_cast<float>(row) - s.splat.mv;
  span.eta2 = s.splat.u22 * span.dv;
  const float rest = s.cut - span.eta2 * span.eta2;
  if (!(rest > 0))
  {
    span.begin = span.end = 0;
    return span;
  }
  // eta1^2 <= rest  <=>  |column - centre| <= half. Limits are clamped as floats, where infinity is harmless.
  const float half = std::sqrt(rest) * shape.inverseU11;
  const float centre = s.splat.mu - shape.skew * span.dv;
  const float low = static_cast<float>(s.columnBegin), high = static_cast<float>(s.columnEnd);
  span.begin = static_cast<int>(std::min(std::max(std::ceil(centre - half), low), high));
  span.end = static_cast<int>(std::max(std::min(std::floor(centre + half) + 1.0f, high), low));
  return span;
}

/// One footprint, by an exponential a pixel.
static void AddDirect(const VisibleSplat& s, int rowBegin, int rowEnd, const PixelRows& scattering,
                      const PixelRows& coverage)
{
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto iota = hn::Iota(d, 0.0f);
  const Shape shape(s);
  const auto u11 = hn::Set(d, s.splat.u11);
  const auto value = hn::Set(d, s.value);
  const auto mu = hn::Set(d, s.splat.mu);
  for (int row = rowBegin; row < rowEnd; ++row)
  {
    const RowSpan span = SpanOf(s, shape, row);
    const auto shift = hn::Set(d, s.splat.u12 * span.dv);
    const auto constant = hn::Set(d, s.logAmplitude - 0.5f * span.eta2 * span.eta2);
    float* out = scattering.Row(row);
    float* support = coverage.data ? coverage.Row(row) : nullptr;
    for (int column = span.begin; column < span.end; column += lanes)
    {
      const auto u = hn::Add(hn::Set(d, static_cast<float>(column)), iota);
      const auto eta1 = hn::MulAdd(u11, hn::Sub(u, mu), shift);
      auto w = hn::Exp(d, hn::MulAdd(hn::Set(d, -0.5f), hn::Mul(eta1, eta1), constant));
      w = hn::IfThenElseZero(hn::FirstN(d, static_cast<std::size_t>(span.end - column)), w);
      hn::StoreU(hn::MulAdd(value, w, hn::LoadU(d, out + column)), d, out + column);
      if (support)
      {
        hn::StoreU(hn::Add(w, hn::LoadU(d, support + column)), d, support + column);
      }
    }
  }
}

/// w and q of a SIMD vector of columns at one row, and the columns' distance from the centre.
template <class V>
struct Column
{
  V du, w, q;
};

template <class D>
static inline Column<hn::Vec<D>> StartColumn(D d, const VisibleSplat& s, int column, float dv)
{
  Column<hn::Vec<D>> out;
  const auto u = hn::Add(hn::Set(d, static_cast<float>(column)), hn::Iota(d, 0.0f));
  out.du = hn::Sub(u, hn::Set(d, s.splat.mu));
  const auto eta1 = hn::MulAdd(hn::Set(d, s.splat.u11), out.du, hn::Set(d, s.splat.u12 * dv));
  const float eta2 = s.splat.u22 * dv;
  const float curvature = s.splat.u12 * s.splat.u12 + s.splat.u22 * s.splat.u22;
  const auto f =
      hn::MulAdd(hn::Mul(hn::Set(d, -0.5f), eta1), eta1, hn::Set(d, s.logAmplitude - 0.5f * eta2 * eta2));
  const auto step =
      hn::NegMulAdd(hn::Set(d, s.splat.u12), eta1, hn::Set(d, -s.splat.u22 * eta2 - 0.5f * curvature));
  // Lanes beyond the footprint hold 0 from the start: there q might be infinite.
  const auto inside = hn::FirstN(d, static_cast<std::size_t>(s.columnEnd - column));
  out.w = hn::IfThenElseZero(inside, hn::Exp(d, f));
  out.q = hn::IfThenElseZero(inside, hn::Exp(d, step));
  return out;
}

/// Rows [row, last) of one stretch between fresh starts, and the row at which w and q are computed.
struct Stretch
{
  int start, row, last;
};

static inline Stretch StretchAt(const VisibleSplat& s, int row, int end)
{
  const int block = row / kRecurrenceRows * kRecurrenceRows;
  return {std::max(block, s.firstRow), row, std::min(block + kRecurrenceRows, end)};
}

void AddFootprintsImpl(const VisibleSplat* splats, std::size_t count, int rowBegin, int rowEnd,
                       const PixelRows& scattering, const PixelRows& coverage)
{
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (std::size_t i = 0; i < count; ++i)
  {
    const VisibleSplat& s = splats[i];
    const int begin = std::max(rowBegin, s.rowBegin), end = std::min(rowEnd, s.rowEnd);
    if (s.direct)
    {
      AddDirect(s, begin, end, scattering, coverage);
      continue;
    }
    const auto value = hn::Set(d, s.value);
    const auto c = hn::Set(d, s.rowFactor);
    for (int next = begin; next < end;)
    {
      const Stretch stretch = StretchAt(s, next, end);
      const float dv = static_cast<float>(stretch.start) - s.splat.mv;
      for (int column = s.columnBegin; column < s.columnEnd; column += lanes)
      {
        auto [du, w, q] = StartColumn(d, s, column, dv);
        for (int row = stretch.start; row < stretch.row; ++row)
        {
          w = hn::Mul(w, q);
          q = hn::Mul(q, c);
        }
        float* out = scattering.Row(stretch.row) + column;
        if (coverage.data)
        {
          float* support = coverage.Row(stretch.row) + column;
          for (int row = stretch.row; row < stretch.last; ++row)
          {
            hn::StoreU(hn::MulAdd(value, w, hn::LoadU(d, out)), d, out);
            hn::StoreU(hn::Add(w, hn::LoadU(d, support)), d, support);
            out += scattering.stride;
            support += coverage.stride;
            w = hn::Mul(w, q);
            q = hn::Mul(q, c);
          }
          continue;
        }
        for (int row = stretch.row; row < stretch.last; ++row)
        {
          hn::StoreU(hn::MulAdd(value, w, hn::LoadU(d, out)), d, out);
          out += scattering.stride;
          w = hn::Mul(w, q);
          q = hn::Mul(q, c);
        }
      }
      next = stretch.last;
    }
  }
}

/// Moments of one footprint, by an exponential a pixel. Sums are of powers of eta from the start.
static Moments<float> GatherDirect(const VisibleSplat& s, const PixelRows& derivative)
{
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto iota = hn::Iota(d, 0.0f);
  const Shape shape(s);
  const auto u11 = hn::Set(d, s.splat.u11);
  const auto mu = hn::Set(d, s.splat.mu);
  auto m0 = hn::Zero(d), m1 = hn::Zero(d), m2 = hn::Zero(d), m11 = hn::Zero(d), m12 = hn::Zero(d),
       m22 = hn::Zero(d), error = hn::Zero(d);
  for (int row = s.rowBegin; row < s.rowEnd; ++row)
  {
    const RowSpan span = SpanOf(s, shape, row);
    const auto shift = hn::Set(d, s.splat.u12 * span.dv);
    const auto constant = hn::Set(d, s.logAmplitude - 0.5f * span.eta2 * span.eta2);
    const float* in = derivative.Row(row);
    auto row0 = hn::Zero(d), row1 = hn::Zero(d);
    for (int column = span.begin; column < span.end; column += lanes)
    {
      const auto u = hn::Add(hn::Set(d, static_cast<float>(column)), iota);
      const auto eta1 = hn::MulAdd(u11, hn::Sub(u, mu), shift);
      auto w = hn::Exp(d, hn::MulAdd(hn::Set(d, -0.5f), hn::Mul(eta1, eta1), constant));
      w = hn::IfThenElseZero(hn::FirstN(d, static_cast<std::size_t>(span.end - column)), w);
      const auto gw = hn::Mul(w, hn::LoadU(d, in + column));
      const auto gw1 = hn::Mul(gw, eta1);
      row0 = hn::Add(row0, gw);
      row1 = hn::Add(row1, gw1);
      m11 = hn::MulAdd(gw1, eta1, m11);
      error = hn::Add(error, hn::Abs(gw));
    }
    const auto eta2 = hn::Set(d, span.eta2);
    const auto row2 = hn::Mul(row0, eta2);
    m0 = hn::Add(m0, row0);
    m1 = hn::Add(m1, row1);
    m2 = hn::Add(m2, row2);
    m12 = hn::MulAdd(row1, eta2, m12);
    m22 = hn::MulAdd(row2, eta2, m22);
  }
  const auto sum = [&d](const auto& v) { return hn::GetLane(hn::SumOfLanes(d, v)); };
  return {sum(m0), sum(m1), sum(m2), sum(m11), sum(m12), sum(m22), sum(error)};
}

/// Moments of one footprint by the recurrence. Sums are of powers of pixel offsets; U is applied to them at
/// the end, which is accurate because splats for which it were not are `direct`.
static Moments<float> GatherRecurrent(const VisibleSplat& s, const PixelRows& derivative)
{
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto c = hn::Set(d, s.rowFactor);
  const auto one = hn::Set(d, 1.0f);
  auto sum0 = hn::Zero(d), sumU = hn::Zero(d), sumV = hn::Zero(d), sumUU = hn::Zero(d), sumUV = hn::Zero(d),
       sumVV = hn::Zero(d), error = hn::Zero(d);
  for (int next = s.rowBegin; next < s.rowEnd;)
  {
    const Stretch stretch = StretchAt(s, next, s.rowEnd);
    const float dv = static_cast<float>(stretch.start) - s.splat.mv;
    for (int column = s.columnBegin; column < s.columnEnd; column += lanes)
    {
      auto [du, w, q] = StartColumn(d, s, column, dv);
      for (int row = stretch.start; row < stretch.row; ++row)
      {
        w = hn::Mul(w, q);
        q = hn::Mul(q, c);
      }
      const float* in = derivative.Row(stretch.row) + column;
      auto v = hn::Set(d, static_cast<float>(stretch.row) - s.splat.mv);
      auto column0 = hn::Zero(d), columnV = hn::Zero(d);
      for (int row = stretch.row; row < stretch.last; ++row)
      {
        const auto gw = hn::Mul(w, hn::LoadU(d, in));
        const auto gwv = hn::Mul(gw, v);
        column0 = hn::Add(column0, gw);
        columnV = hn::Add(columnV, gwv);
        sumVV = hn::MulAdd(gwv, v, sumVV);
        error = hn::Add(error, hn::Abs(gw));
        in += derivative.stride;
        v = hn::Add(v, one);
        w = hn::Mul(w, q);
        q = hn::Mul(q, c);
      }
      const auto columnU = hn::Mul(column0, du);
      sum0 = hn::Add(sum0, column0);
      sumU = hn::Add(sumU, columnU);
      sumV = hn::Add(sumV, columnV);
      sumUU = hn::MulAdd(columnU, du, sumUU);
      sumUV = hn::MulAdd(columnV, du, sumUV);
    }
    next = stretch.last;
  }
  const auto sum = [&d](const auto& v) { return hn::GetLane(hn::SumOfLanes(d, v)); };
  const float u = sum(sumU), v = sum(sumV), uu = sum(sumUU), uv = sum(sumUV), vv = sum(sumVV);
  const float a = s.splat.u11, b = s.splat.u12, e = s.splat.u22;
  return {sum(sum0),  a * u + b * v, e * v, a * a * uu + 2 * a * b * uv + b * b * vv, e * (a * uv + b * vv),
          e * e * vv, sum(error)};
}

void GatherMomentsImpl(const VisibleSplat* splats, std::size_t count, const PixelRows& derivative,
                       Moments<float>* moments)
{
  for (std::size_t i = 0; i < count; ++i)
  {
    moments[i] =
        splats[i].direct ? GatherDirect(splats[i], derivative) : GatherRecurrent(splats[i], derivative);
  }
}

const char* SimdNameImpl()
{
  return hwy::TargetName(HWY_TARGET);
}

}  // namespace HWY_NAMESPACE
}  // namespace bigus
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bigus
{

HWY_EXPORT(AddFootprintsImpl);
HWY_EXPORT(GatherMomentsImpl);
HWY_EXPORT(SimdNameImpl);

void AddFootprints(const VisibleSplat* splats, std::size_t count, int rowBegin, int rowEnd,
                   const PixelRows& scattering, const PixelRows& coverage)
{
  HWY_DYNAMIC_DISPATCH(AddFootprintsImpl)(splats, count, rowBegin, rowEnd, scattering, coverage);
}

void GatherMoments(const VisibleSplat* splats, std::size_t count, const PixelRows& derivative,
                   Moments<float>* moments)
{
  HWY_DYNAMIC_DISPATCH(GatherMomentsImpl)(splats, count, derivative, moments);
}

const char* SimdName()
{
  return HWY_DYNAMIC_DISPATCH(SimdNameImpl)();
}

}  // namespace bigus
#endif  // HWY_ONCE
