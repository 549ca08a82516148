// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From sums over footprints to gradients of Gaussians, and a step along them. Compiled once for every instruction set,
// hence the guard that foreach_target.h turns over.
#if defined(BIGUS_CPU_CHAINRULE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BIGUS_CPU_CHAINRULE_INL_H
#undef BIGUS_CPU_CHAINRULE_INL_H
#else
#define BIGUS_CPU_CHAINRULE_INL_H
#endif

#include <algorithm>

#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/Lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

/// Which Gaussians of a block the splats are of, vector by vector.
template <class T>
struct SplatsInBlock
{
  alignas(64) T seen[kBlock] = {};          // 1 where a Gaussian has a splat
  alignas(64) Whole<T> place[kBlock] = {};  // which splat, among those of its vector

  explicit SplatsInBlock(const SplatRows<T>& splats)
  {
    const Whole<T>* gaussian = splats[kGaussian];
    const int lanes = Lanes<T>::Count();
    int vector = -1, first = 0;
    for (int i = 0; i < splats.count; ++i)
    {
      const int k = static_cast<int>(gaussian[i]);
      if (k / lanes != vector)
      {
        vector = k / lanes;
        first = i;
      }
      seen[k] = T(1);
      place[k] = i - first;
    }
  }
  /// body(first Gaussian, mask of those seen, first splat) for every vector of Gaussians.
  template <class Body>
  HWY_INLINE void ForVectors(Body&& body) const
  {
    const hn::ScalableTag<T> d;
    int splat = 0;
    for (int first = 0; first < kBlock; first += Lanes<T>::Count())
    {
      const auto mask = hn::Gt(hn::Load(d, seen + first), hn::Zero(d));
      if (const int count = static_cast<int>(hn::CountTrue(d, mask)))
      {
        body(first, mask, splat);
        splat += count;
      }
    }
  }
};

template <class T>
static void AddAdjoints(const GaussianBlock<T>& block, const bigus::View<T>& scalarView, const SplatRows<T>& splats,
                        const MomentBlock<T>& moments, GradientBlock<T>& gradient, ScoreBlock<T>* scores)
{
  using L = Lanes<T>;
  const hn::ScalableTag<T> d;
  const View<L> view = Broadcast(scalarView);
  const T(*rows)[kBlock] = RowsOf(block);
  const SplatsInBlock<T> where(splats);
  // The Gaussians moved together, one for each splat; then their gradients.
  alignas(64) T lane[kRows][SplatBuffer<T>::kStride];
  where.ForVectors(
      [&](int first, auto seen, int splat) HWY_ATTR
      {
        const ChosenLanes<T> chosen(seen);
        for (int row = 0; row < kRows; ++row)
        {
          chosen.Store(hn::Load(d, rows[row] + first), lane[row] + splat);
        }
      });
  for (int first = 0; first < splats.count; first += L::Count())
  {
    const Gaussian<L> gaussian = GaussianOf([&](int row) { return L::Load(lane[row] + first); });
    Moments<L> m;
    const auto moment = [&](int row) { return L::Load(moments.values[row] + first); };
    m.m0 = moment(kMoment0);
    m.m1 = moment(kMoment1);
    m.m2 = moment(kMoment2);
    m.m11 = moment(kMoment11);
    m.m12 = moment(kMoment12);
    m.m22 = moment(kMoment22);
    L values[kParametersPerGaussian];
    ToArray(ProjectAdjoint(gaussian, Project(gaussian, view), m), values);
    for (int k = 0; k < kParametersPerGaussian; ++k)
    {
      values[k].Store(lane[k] + first);
    }
  }
  // And apart again.
  where.ForVectors(
      [&](int first, auto seen, int splat) HWY_ATTR
      {
        const auto indices = hn::IndicesFromVec(d, hn::Load(hn::RebindToSigned<decltype(d)>(), where.place + first));
        const auto of = [&](const T* row) HWY_ATTR
        { return hn::IfThenElseZero(seen, hn::TableLookupLanes(hn::LoadU(d, row + splat), indices)); };
        const auto add = [&](auto value, T* to) HWY_ATTR { hn::Store(hn::Add(hn::Load(d, to), value), d, to); };
        const auto one = hn::IfThenElseZero(seen, hn::Set(d, T(1)));
        for (int k = 0; k < kParametersPerGaussian; ++k)
        {
          add(of(lane[k]), gradient.values[k] + first);
        }
        add(one, gradient.visits + first);
        if (scores)
        {
          add(of(moments.values[kMomentError]), scores->error + first);
          add(one, scores->visits + first);
          for (int k = 0; k < 3; ++k)
          {
            add(hn::Neg(of(lane[kMeanAt + k])), scores->descent[k] + first);
          }
        }
      });
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
    Gaussian<L> gaussian = GaussianOf([&](int row) { return L::Load(rows[row] + first); });
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

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_CHAINRULE_INL_H
