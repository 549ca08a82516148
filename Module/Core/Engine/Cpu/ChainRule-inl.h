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

template <class T>
static void AddAdjoints(const GaussianBlock<T>& block, const bigus::View<T>& scalarView,
                        const bigus::VisibleSplat<T>* splats, int count, const MomentBlock<T>& moments,
                        GradientBlock<T>& gradient, ScoreBlock<T>* scores)
{
  using L = Lanes<T>;
  const int lanes = L::Count();
  const View<L> view = Broadcast(scalarView);
  const T(*rows)[kBlock] = RowsOf(block);
  for (int first = 0; first < count; first += lanes)
  {
    int indices[16] = {};
    const int active = std::min(lanes, count - first);
    for (int i = 0; i < active; ++i)
    {
      indices[i] = static_cast<int>(splats[first + i].gaussian);
    }
    // Number by number, because GatherIndex takes a fifth more time for the whole function (AVX2 on Zen 4).
    alignas(64) T chosen[kRows][16];
    for (int row = 0; row < kRows; ++row)
    {
      for (int i = 0; i < lanes; ++i)
      {
        chosen[row][i] = rows[row][indices[i]];
      }
    }
    const auto at = [&](int row) { return L::Load(chosen[row]); };
    const Gaussian<L> gaussian = GaussianOf(at);
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
