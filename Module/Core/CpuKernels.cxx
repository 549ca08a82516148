#include "CpuKernels.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Core/CpuKernels.cxx"
// clang-format off: foreach_target.h has to come first, it compiles the rest once for every instruction set.
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

void AddFootprintsImpl(const VisibleSplat* splats, std::size_t count, int rowBegin, int rowEnd,
                       const PixelRows& scattering, const PixelRows& coverage)
{
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto iota = hn::Iota(d, 0.0f);
  const auto minusHalf = hn::Set(d, -0.5f);
  for (std::size_t i = 0; i < count; ++i)
  {
    const VisibleSplat& s = splats[i];
    const int begin = std::max(rowBegin, s.rowBegin), end = std::min(rowEnd, s.rowEnd);
    const Shape shape(s);
    const auto u11 = hn::Set(d, s.splat.u11);
    const auto value = hn::Set(d, s.value);
    const auto mu = hn::Set(d, s.splat.mu);
    for (int row = begin; row < end; ++row)
    {
      const RowSpan span = SpanOf(s, shape, row);
      const auto shift = hn::Set(d, s.splat.u12 * span.dv);
      const auto constant = hn::Set(d, s.logAmplitude - 0.5f * span.eta2 * span.eta2);
      float* out = scattering.data + (row - scattering.firstRow) * scattering.stride - scattering.firstColumn;
      float* support =
          coverage.data ? coverage.data + (row - coverage.firstRow) * coverage.stride - coverage.firstColumn
                        : nullptr;
      for (int column = span.begin; column < span.end; column += lanes)
      {
        const auto u = hn::Add(hn::Set(d, static_cast<float>(column)), iota);
        const auto eta1 = hn::MulAdd(u11, hn::Sub(u, mu), shift);
        auto w = hn::Exp(d, hn::MulAdd(minusHalf, hn::Mul(eta1, eta1), constant));
        w = hn::IfThenElseZero(hn::FirstN(d, static_cast<std::size_t>(span.end - column)), w);
        hn::StoreU(hn::MulAdd(value, w, hn::LoadU(d, out + column)), d, out + column);
        if (support)
        {
          hn::StoreU(hn::Add(w, hn::LoadU(d, support + column)), d, support + column);
        }
      }
    }
  }
}

void GatherMomentsImpl(const VisibleSplat* splats, std::size_t count, const PixelRows& derivative,
                       Moments<float>* moments)
{
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto iota = hn::Iota(d, 0.0f);
  const auto minusHalf = hn::Set(d, -0.5f);
  for (std::size_t i = 0; i < count; ++i)
  {
    const VisibleSplat& s = splats[i];
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
      const float* in =
          derivative.data + (row - derivative.firstRow) * derivative.stride - derivative.firstColumn;
      auto row0 = hn::Zero(d), row1 = hn::Zero(d);
      for (int column = span.begin; column < span.end; column += lanes)
      {
        const auto u = hn::Add(hn::Set(d, static_cast<float>(column)), iota);
        const auto eta1 = hn::MulAdd(u11, hn::Sub(u, mu), shift);
        auto w = hn::Exp(d, hn::MulAdd(minusHalf, hn::Mul(eta1, eta1), constant));
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
    Moments<float>& out = moments[i];
    out.m0 = hn::GetLane(hn::SumOfLanes(d, m0));
    out.m1 = hn::GetLane(hn::SumOfLanes(d, m1));
    out.m2 = hn::GetLane(hn::SumOfLanes(d, m2));
    out.m11 = hn::GetLane(hn::SumOfLanes(d, m11));
    out.m12 = hn::GetLane(hn::SumOfLanes(d, m12));
    out.m22 = hn::GetLane(hn::SumOfLanes(d, m22));
    out.error = hn::GetLane(hn::SumOfLanes(d, error));
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
