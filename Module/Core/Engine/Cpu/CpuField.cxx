// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/Cpu/CpuField.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "Core/Engine/BlockField.h"
#include "Core/Engine/MortonOrder.h"
#include "Core/Model/Error.h"

namespace bigus
{

template <class T>
void CpuField<T>::Set(const GaussianField& field, const std::vector<int>* parents)
{
  field.Validate();
  Require(field.Size() <= std::numeric_limits<std::uint32_t>::max(), "CPU engine: ", field.Size(),
          " Gaussians are more than 2^32 - 1.");
  std::vector<std::uint32_t> order = MortonOrder(field.means);
  const std::size_t blocks = bigus::NumberOfBlocks(field.Size());
  InheritAdam(order, blocks, parents);
  order_ = std::move(order);
  beam_ = field.beam;
  transfer_ = field.transfer;
  blocks_.assign(blocks, {});
  places_.assign(blocks, {});
  groupsAreStale_ = true;
  sharp_.clear();
  sharp_.resize(blocks);
  tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t b) { FillBlock(field, b); });
}

template <class T>
GaussianField CpuField<T>::Get() const
{
  GaussianField field;
  field.beam = beam_;
  field.transfer = transfer_;
  field.Resize(order_.size());
  tbb::parallel_for(
      std::size_t(0), order_.size(),
      [&](std::size_t slot)
      { UnpackGaussian(blocks_[slot / kBlock], slot % kBlock, places_[slot / kBlock], order_[slot], field); });
  return field;
}

template <class T>
BlockState<T> CpuField<T>::State() const
{
  BlockState<T> state;
  state.beam = beam_;
  state.transfer = transfer_;
  state.order = order_;
  for (const BlockPlace& place : places_)
  {
    state.centres.push_back(place.centre);
  }
  state.gaussians = blocks_;
  for (std::size_t b = 0; b < sharp_.size(); ++b)
  {
    if (sharp_[b])
    {
      state.sharp.emplace_back(static_cast<std::uint32_t>(b), *sharp_[b]);
    }
  }
  state.adam = adam_;
  state.guarded = guarded_;
  return state;
}

template <class T>
void CpuField<T>::SetState(BlockState<T> state)
{
  beam_ = state.beam;
  transfer_ = state.transfer;
  places_.clear();
  for (std::size_t b = 0; b < state.gaussians.size(); ++b)
  {
    places_.push_back(state.Place(b));
  }
  order_ = std::move(state.order);
  blocks_ = std::move(state.gaussians);
  adam_ = std::move(state.adam);
  guarded_ = state.guarded;
  groupsAreStale_ = true;
  sharp_.clear();
  sharp_.resize(blocks_.size());
  tbb::parallel_for(std::size_t(0), blocks_.size(), [&](std::size_t b) { Measure(b); });
  for (const auto& [b, block] : state.sharp)
  {
    if (sharp_[b])
    {
      *sharp_[b] = block;
    }
  }
}

template <class T>
void CpuField<T>::FillBlock(const GaussianField& field, std::size_t b)
{
  places_[b] = PlaceOf(field, order_, b);
  PackBlock(field, order_, b, places_[b], blocks_[b]);
  Measure(b);
  if (sharp_[b])
  {
    PackBlock(field, order_, b, places_[b], *sharp_[b]);  // what float has lost
  }
}

template <class T>
void CpuField<T>::Measure(std::size_t b)
{
  BlockPlace& place = places_[b];
  const BlockBounds<T> bounds = kernels_.boundsOf(blocks_[b], place.count);
  const auto range = [&](int axis, double centre, double& middle, double& half)
  {
    const double low = bounds.low[axis], high = bounds.high[axis];
    middle = centre + 0.5 * (low + high);
    half = 0.5 * (high - low);
  };
  range(0, place.centre.x, place.middle.x, place.half.x);
  range(1, place.centre.y, place.middle.y, place.half.y);
  range(2, place.centre.z, place.middle.z, place.half.z);
  place.variance = std::exp(2.0 * bounds.logScale);
  place.logMagnitude = std::log(static_cast<double>(bounds.magnitude));  // of 0: -infinity, never seen
  if (sizeof(T) == sizeof(double) || !(bounds.logAspect > kLogSharp))
  {
    sharp_[b].reset();
    return;
  }
  if (!sharp_[b])
  {
    sharp_[b].reset(new GaussianBlock<double>);
  }
  const GaussianBlock<T>& from = blocks_[b];
  GaussianBlock<double>& to = *sharp_[b];
  std::copy_n(from.mean[0], 3 * kBlock, to.mean[0]);
  std::copy_n(from.logScale[0], 3 * kBlock, to.logScale[0]);
  std::copy_n(from.reflectivity, kBlock, to.reflectivity);
  for (int k = 0; k < kBlock; ++k)
  {
    const Eigen::Vector4d q =
        Eigen::Vector4d(from.rotation[0][k], from.rotation[1][k], from.rotation[2][k], from.rotation[3][k])
            .normalized();
    for (int part = 0; part < 4; ++part)
    {
      to.rotation[part][k] = q[part];
    }
  }
}

template <class T>
std::vector<T> CpuField<T>::Reflectivities() const
{
  std::vector<T> bySlot(blocks_.size() * kBlock);
  for (std::size_t b = 0; b < blocks_.size(); ++b)
  {
    std::copy_n(blocks_[b].reflectivity, kBlock, bySlot.data() + b * kBlock);
  }
  return bySlot;
}

template <class T>
void CpuField<T>::SetReflectivities(const std::vector<T>& bySlot)
{
  tbb::parallel_for(std::size_t(0), blocks_.size(),
                    [&](std::size_t b)
                    {
                      const T* values = bySlot.data() + b * kBlock;
                      std::copy_n(values, kBlock, blocks_[b].reflectivity);
                      if (sharp_[b])
                      {
                        std::copy_n(values, kBlock, sharp_[b]->reflectivity);
                      }
                      double largest = 0;
                      for (int k = 0; k < places_[b].count; ++k)
                      {
                        largest = std::max(largest, std::abs(static_cast<double>(values[k])));
                      }
                      places_[b].logMagnitude = std::log(largest);
                    });
  groupsAreStale_ = true;
}

template <class T>
const std::vector<BlockPlace>& CpuField<T>::Groups()
{
  if (!groupsAreStale_)
  {
    return groups_;
  }
  groups_.resize((blocks_.size() + kGroup - 1) / kGroup);
  tbb::parallel_for(std::size_t(0), groups_.size(),
                    [&](std::size_t g)
                    {
                      BlockPlace group = places_[g * kGroup];
                      Vector3<double> low = MultiplyAdd(-1.0, group.half, group.middle);
                      Vector3<double> high = MultiplyAdd(1.0, group.half, group.middle);
                      for (std::size_t b = g * kGroup; b < std::min((g + 1) * kGroup, blocks_.size()); ++b)
                      {
                        const BlockPlace& place = places_[b];
                        const Vector3<double> from = MultiplyAdd(-1.0, place.half, place.middle);
                        const Vector3<double> to = MultiplyAdd(1.0, place.half, place.middle);
                        low = {min(low.x, from.x), min(low.y, from.y), min(low.z, from.z)};
                        high = {max(high.x, to.x), max(high.y, to.y), max(high.z, to.z)};
                        group.variance = max(group.variance, place.variance);
                        group.logMagnitude = max(group.logMagnitude, place.logMagnitude);
                      }
                      group.half = Scaled(0.5, MultiplyAdd(-1.0, low, high));
                      group.middle = MultiplyAdd(1.0, group.half, low);
                      groups_[g] = group;
                    });
  groupsAreStale_ = false;  // not before: memory may run out above
  return groups_;
}

template <class T>
void CpuField<T>::InheritAdam(const std::vector<std::uint32_t>& order, std::size_t blocks,
                              const std::vector<int>* parents)
{
  if (!parents)
  {
    adam_ = {};
    guarded_ = 0;
    return;
  }
  const std::vector<std::int64_t> slots = InheritedSlots(order_, order, *parents);
  if (adam_.empty())
  {
    return;
  }
  std::vector<AdamBlock<T>> adam(blocks, AdamBlock<T>{});
  for (std::size_t slot = 0; slot < slots.size(); ++slot)
  {
    if (slots[slot] < 0)
    {
      continue;
    }
    const AdamBlock<T>& from = adam_[slots[slot] / kBlock];
    AdamBlock<T>& to = adam[slot / kBlock];
    const std::size_t i = slots[slot] % kBlock, k = slot % kBlock;
    for (int p = 0; p < kParametersPerGaussian; ++p)
    {
      to.first[p][k] = from.first[p][i];
      to.second[p][k] = from.second[p][i];
    }
    to.updates[k] = from.updates[i];
  }
  adam_ = std::move(adam);
}

template <class T>
void CpuField<T>::PrepareStep()
{
  adam_.resize(blocks_.size());
  groupsAreStale_ = true;
}

template <class T>
void CpuField<T>::Update(std::size_t b, const GradientBlock<T>& gradient, const AdamStep& step)
{
  const int guarded = kernels_.updateBlock(blocks_[b], adam_[b], gradient, places_[b].count, step);
  if (guarded > 0)
  {
    guarded_ += guarded;
  }
  Measure(b);
}

template <class T>
std::size_t CpuField<T>::Bytes() const
{
  const auto bytes = [](const auto& v) { return v.capacity() * sizeof(v[0]); };
  std::size_t sharp = 0;
  for (const auto& block : sharp_)
  {
    sharp += block ? sizeof(*block) : 0;
  }
  return sharp + bytes(sharp_) + bytes(order_) + bytes(blocks_) + bytes(places_) + bytes(groups_) + bytes(adam_);
}

template class CpuField<float>;
template class CpuField<double>;

}  // namespace bigus
