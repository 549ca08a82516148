// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From the Gaussians of a block to the footprints that a plane sees. Compiled once for every instruction set, hence the
// guard that foreach_target.h turns over.
#if defined(BIGUS_CPU_PROJECT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BIGUS_CPU_PROJECT_INL_H
#undef BIGUS_CPU_PROJECT_INL_H
#else
#define BIGUS_CPU_PROJECT_INL_H
#endif

#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/Exp-inl.h"
#include "Core/Engine/Cpu/Lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

/// Rows that a recurrence runs from its start: as many as hold a whole footprint, or else fewer, where w is still large
/// at the end and so is the error (see FootprintRecurrence-inl.h).
constexpr int kLongestReach = 32, kReachInside = 16;

/// How a recurrence starts between two rows, dv rows from the centre: see FootprintRecurrence-inl.h. `unit`: kExponentUnit
/// of the type in which it runs. Real is T or a vector of it.
template <class T, class Real>
static HWY_INLINE void SetRow(T unit, Real u12, Real u22, Real logAmplitude, Real dv, Real& shift, Real& constant,
                              Real& slope)
{
  const Real eta2 = u22 * dv, curvature = u12 * u12 + u22 * u22;
  shift = u12 * dv;
  constant = Real(unit) * (logAmplitude - Real(T(0.5)) * eta2 * eta2 - Real(T(0.125)) * curvature);
  slope = Real(T(-0.5) * unit) * u22 * eta2;
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
                              Lanes<T> cut)
{
  const Lanes<T> scale =
      exp(max(max(Lanes<T>::Load(block.logScale[0] + first), Lanes<T>::Load(block.logScale[1] + first)),
              Lanes<T>::Load(block.logScale[2] + first)));
  // A thousandth more than the bound, so that its own rounding drops nothing.
  const Lanes<T> reach = cut * (scale * scale + Lanes<T>(elevationVariance)) * Lanes<T>(T(1.001));
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

  // Those near the plane, moved together so that no lane is projected in vain. Whole vectors are written at `found` and
  // at `kept`, which never exceed `first`: so none ends beyond kBlock.
  static_assert(kBlock % hn::MaxLanes(d) == 0);
  alignas(64) T near[kRows + 1][SplatBuffer<T>::kStride];  // k^2 in place of the reflectivity; index in the block
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
    const L magnitude = max(abs(L::Load(block.reflectivity + first)), L(task.leastMagnitude));
    const L cut = CutFor(magnitude, task.tolerance);
    inside = hn::And(inside, InSlab(block, first, squaredDistance, task.view.elevationVariance, cut));
    const ChosenLanes<T> chosen(inside);
    for (int row = 0; row < kRows - 1; ++row)
    {
      chosen.Store(hn::LoadU(d, rows[row] + first), near[row] + found);
    }
    chosen.Store(cut.v, near[kRows - 1] + found);
    chosen.Store(hn::Iota(d, static_cast<T>(first)), near[kRows] + found);
    found += chosen.Count();
  }

  const View<L> view = Broadcast(task.view);
  const L originColumn(static_cast<T>(task.originColumn)), originRow(static_cast<T>(task.originRow));
  const L firstColumn(static_cast<T>(task.columnBegin)), lastColumn(static_cast<T>(task.columnEnd));
  const L firstRow(static_cast<T>(task.rowBegin)), lastRow(static_cast<T>(task.rowEnd));
  const L zero(T(0)), one(T(1)), lowest(task.lowestExponent);
  L smallestRow = lastRow, largestRow = firstRow;
  int kept = 0;
  for (int first = 0; first < found; first += lanes)
  {
    const auto at = [&](int row) { return L::Load(near[row] + first); };
    const Splat<L> s = Project(GaussianOf(at), view).splat;
    const Footprint<L> f = FootprintOf(s, at(kRows - 1), task.lowestExponent);
    const auto clip = [](L value, L low, L high) { return min(max(value, low), high); };
    const L columnBegin = clip(originColumn + f.columnBegin, firstColumn, lastColumn);
    const L columnEnd = clip(originColumn + f.columnEnd, firstColumn, lastColumn);
    const L rowBegin = clip(originRow + (f.row - f.half), firstRow, lastRow);
    const L rowEnd = clip(originRow + (f.row + f.half), firstRow, lastRow);

    // How many rows a recurrence (see there) may run, and how it starts at the centre where one stretch is enough.
    L reach = zero;
    for (const T rows : {T(kReachInside / 4), T(kReachInside / 2), T(kReachInside)})
    {
      reach = Select(WeightsHold(f, min(L(rows), f.half)), L(rows), reach);
    }
    const auto whole = hn::And(f.half <= L(T(kLongestReach)), WeightsHold(f, f.half));
    reach = Select(whole, L(T(kLongestReach)), reach);
    const L last = s.u22 * (reach - one);
    reach = Select(f.cut < last * last, L(T(kOneStretch)), reach);
    reach = task.direct ? zero : Select(RatiosHold(f, task.lowestExponent), reach, zero);
    L shift, constant, slope;
    SetRow(task.exponentUnit, s.u12, s.u22, f.logAmplitude, L(T(-0.5)) - f.mv, shift, constant, slope);

    auto visible = hn::And(columnBegin < columnEnd, rowBegin < rowEnd);
    visible = hn::And(visible, hn::And(f.cut > zero, f.logAmplitude > lowest));
    visible = hn::And(visible, hn::FirstN(d, static_cast<std::size_t>(found - first)));
    smallestRow = Select(visible, min(smallestRow, rowBegin), smallestRow);
    largestRow = Select(visible, max(largestRow, rowEnd), largestRow);
    const ChosenLanes<T> chosen(visible);
    const auto store = [&](SplatReal field, L value) HWY_ATTR { chosen.Store(value.v, out.reals[field] + kept); };
    store(kU11, s.u11);
    store(kU12, s.u12);
    store(kU22, s.u22);
    store(kMu, f.mu);
    store(kMv, f.mv);
    store(kLogAmplitude, f.logAmplitude);
    store(kCut, f.cut);
    store(kRowFactor, exp(max(-f.curvature, lowest)));
    store(kShift, shift);
    store(kConstant, constant);
    store(kSlope, slope);
    const auto storeWhole = [&](SplatWhole field, L value) HWY_ATTR
    { chosen.Store(hn::ConvertTo(hn::RebindToSigned<decltype(d)>(), value.v), out.wholes[field] + kept); };
    storeWhole(kColumn, originColumn + f.column);
    storeWhole(kRow, originRow + f.row);
    storeWhole(kColumnBegin, columnBegin);
    storeWhole(kColumnEnd, columnEnd);
    storeWhole(kRowBegin, rowBegin);
    storeWhole(kRowEnd, rowEnd);
    storeWhole(kReach, reach);
    storeWhole(kGaussian, at(kRows));
    kept += chosen.Count();
  }
  out.rowBegin = static_cast<int>(hn::GetLane(hn::MinOfLanes(d, smallestRow.v)));
  out.rowEnd = static_cast<int>(hn::GetLane(hn::MaxOfLanes(d, largestRow.v)));
  return kept;
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_PROJECT_INL_H
