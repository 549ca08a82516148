// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field on the device, with the optimizer's averages: upload, download, what a restructured field inherits. Private to
// Cuda.
#pragma once

#include <tbb/parallel_for.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "Backward.h"
#include "Core/Engine/BlockState.h"
#include "Core/Engine/MortonOrder.h"
#include "Workspace.h"

namespace bigus::cuda
{

/// The optimizer's averages for a restructured field. Launched as (blocks, 1) of kBlock threads.
__global__ void __launch_bounds__(kBlock)
    Inherit(const std::int64_t* slots, std::size_t count, const AdamBlock<float>* from, AdamBlock<float>* to)
{
  const std::size_t slot = static_cast<std::size_t>(blockIdx.x) * kBlock + threadIdx.x;
  AdamBlock<float>& out = to[blockIdx.x];
  const std::int64_t parent = slot < count ? slots[slot] : -1;
  const AdamBlock<float>* in = parent >= 0 ? from + parent / kBlock : nullptr;
  const int i = threadIdx.x, k = static_cast<int>(parent % kBlock);
  for (int p = 0; p < kParametersPerGaussian; ++p)
  {
    out.first[p][i] = in ? in->first[p][k] : 0.0f;
    out.second[p][i] = in ? in->second[p][k] : 0.0f;
  }
  out.updates[i] = in ? in->updates[k] : 0.0f;
}

class CudaField
{
public:
  explicit CudaField(Workspace& work) : work_(work) {}

  /// See Engine::SetField.
  void Set(const GaussianField& field, const std::vector<int>* parents)
  {
    field.Validate();
    Require(field.Size() <= std::numeric_limits<std::uint32_t>::max(), "CUDA engine: ", field.Size(),
            " Gaussians are more than 2^32 - 1.");
    std::vector<std::uint32_t> order = MortonOrder(field.means);
    const std::size_t blocks = NumberOfBlocks(field.Size());
    InheritAdam(order, blocks, parents);
    beam_ = field.beam;
    transfer_ = field.transfer;
    work_.step.Forget();
    try
    {
      UploadField(field, order);
    }
    catch (...)
    {
      work_.Grow(gaussians_, 0, "", "");  // rather no field than half of one
      order_.clear();
      throw;
    }
    order_ = std::move(order);
    Launch("measuring blocks", MeasureBlocks, blocks, 1, kBlock, work_.stream, View());
  }

  GaussianField Get() const
  {
    std::vector<GaussianBlock<float>> gaussians(gaussians_.size());
    std::vector<BlockPlace> places(places_.size());
    gaussians_.Download(gaussians.data(), 0, gaussians.size(), work_.stream);
    places_.Download(places.data(), 0, places.size(), work_.stream);
    GaussianField field;
    field.beam = beam_;
    field.transfer = transfer_;
    field.Resize(order_.size());
    tbb::parallel_for(
        std::size_t(0), order_.size(),
        [&](std::size_t slot)
        { UnpackGaussian(gaussians[slot / kBlock], slot % kBlock, places[slot / kBlock], order_[slot], field); });
    return field;
  }

  /// All but the scores, which are the engine's.
  BlockState<float> State() const
  {
    BlockState<float> state;
    state.beam = beam_;
    state.transfer = transfer_;
    state.order = order_;
    std::vector<BlockPlace> places(places_.size());
    places_.Download(places.data(), 0, places.size(), work_.stream);
    for (const BlockPlace& place : places)
    {
      state.centres.push_back(place.centre);
    }
    state.gaussians.resize(gaussians_.size());
    gaussians_.Download(state.gaussians.data(), 0, state.gaussians.size(), work_.stream);
    std::vector<int> slots(sharpSlots_.size());
    sharpSlots_.Download(slots.data(), 0, slots.size(), work_.stream);
    for (std::size_t b = 0; b < slots.size(); ++b)
    {
      if (slots[b] >= 0)
      {
        state.sharp.emplace_back(static_cast<std::uint32_t>(b), GaussianBlock<double>{});
        sharp_.Download(&state.sharp.back().second, slots[b], 1, work_.stream);
      }
    }
    state.adam.resize(hasAdam_ ? adam_.size() : 0);
    adam_.Download(state.adam.data(), 0, state.adam.size(), work_.stream);
    state.guarded = work_.ReadResults().guarded;
    return state;
  }

  void SetState(const BlockState<float>& state)
  {
    const std::size_t blocks = state.gaussians.size();
    std::vector<BlockPlace> places;
    for (std::size_t b = 0; b < blocks; ++b)
    {
      places.push_back(state.Place(b));
    }
    std::vector<int> slots(blocks, -1);
    std::vector<GaussianBlock<double>> sharp;
    for (const auto& [b, block] : state.sharp)
    {
      slots[b] = static_cast<int>(sharp.size());
      sharp.push_back(block);
    }
    beam_ = state.beam;
    transfer_ = state.transfer;
    order_ = state.order;
    work_.step.Forget();
    UploadBlocks(state.gaussians, places, slots, sharp);
    Launch("measuring blocks", MeasureBlocks, blocks, 1, kBlock, work_.stream, View());
    hasAdam_ = !state.adam.empty();
    if (hasAdam_)
    {
      work_.Grow(adam_, blocks, "optimizer state", kFewerGaussians);
      adam_.Upload(state.adam.data(), blocks, work_.stream);
    }
    work_.SetGuarded(state.guarded);
  }

  /// As kernels see it.
  Field View() const
  {
    return {static_cast<int>(gaussians_.size()), gaussians_.data(), places_.data(), sharpSlots_.data(), sharp_.data()};
  }

  std::size_t Size() const { return order_.size(); }
  std::size_t Blocks() const { return gaussians_.size(); }
  const std::vector<std::uint32_t>& Order() const { return order_; }  ///< slot -> index in the field
  const Beam& GetBeam() const { return beam_; }
  const TransferFunction& Transfer() const { return transfer_; }
  AdamBlock<float>* Adam() { return adam_.data(); }

  /// Clears the optimizer's averages unless they are those of this field.
  void PrepareAdam()
  {
    if (!hasAdam_)
    {
      work_.Grow(adam_, gaussians_.size(), "optimizer state", kFewerGaussians);
      adam_.Clear(work_.stream);
      hasAdam_ = true;
    }
  }

  std::size_t Bytes() const
  {
    return gaussians_.Bytes() + places_.Bytes() + sharpSlots_.Bytes() + sharp_.Bytes() + adam_.Bytes();
  }

private:
  void UploadField(const GaussianField& field, const std::vector<std::uint32_t>& order)
  {
    const std::size_t blocks = NumberOfBlocks(order.size());
    std::vector<GaussianBlock<float>> gaussians(blocks);
    std::vector<BlockPlace> places(blocks);
    tbb::parallel_for(std::size_t(0), blocks,
                      [&](std::size_t b)
                      {
                        places[b] = PlaceOf(field, order, b);
                        PackBlock(field, order, b, places[b], gaussians[b]);
                      });
    std::vector<int> sharpSlots(blocks, -1);
    std::vector<GaussianBlock<double>> sharp;
    for (std::size_t b = 0; b < blocks; ++b)
    {
      if (HasNeedle(field, order, b, places[b].count))
      {
        sharpSlots[b] = static_cast<int>(sharp.size());
        sharp.emplace_back();
        PackBlock(field, order, b, places[b], sharp.back());
      }
    }
    UploadBlocks(gaussians, places, sharpSlots, sharp);
  }

  void UploadBlocks(const std::vector<GaussianBlock<float>>& gaussians, const std::vector<BlockPlace>& places,
                    const std::vector<int>& sharpSlots, const std::vector<GaussianBlock<double>>& sharp)
  {
    const auto fill = [this](auto& array, const auto& from)
    {
      work_.Grow(array, from.size(), "Gaussians", kFewerGaussians);
      array.Upload(from.data(), from.size(), work_.stream);
    };
    fill(gaussians_, gaussians);
    fill(places_, places);
    fill(sharpSlots_, sharpSlots);
    fill(sharp_, sharp);
  }

  static bool HasNeedle(const GaussianField& field, const std::vector<std::uint32_t>& order, std::size_t b, int count)
  {
    for (int k = 0; k < count; ++k)
    {
      const Eigen::Vector3d& s = field.scales[order[b * kBlock + k]];
      if (s.maxCoeff() > 0.99 * kSharp * s.minCoeff())
      {
        return true;
      }
    }
    return false;
  }

  void InheritAdam(const std::vector<std::uint32_t>& order, std::size_t blocks, const std::vector<int>* parents)
  {
    if (!parents)
    {
      hasAdam_ = false;
      work_.ClearReports();
      return;
    }
    const std::vector<std::int64_t> slots = InheritedSlots(order_, order, *parents);
    if (!hasAdam_)
    {
      return;
    }
    DeviceArray<std::int64_t> inherited;
    inherited.Resize(slots.size(), "optimizer state", kFewerGaussians);
    inherited.Upload(slots.data(), slots.size(), work_.stream);
    DeviceArray<AdamBlock<float>> adam;
    adam.Resize(blocks, "optimizer state", kFewerGaussians);
    Launch("inheriting the optimizer's state", Inherit, blocks, 1, kBlock, work_.stream, inherited.data(), slots.size(),
           adam_.data(), adam.data());
    Check(cudaStreamSynchronize(work_.stream), "inheriting the optimizer's state");
    adam_ = std::move(adam);
    work_.step.Forget();
  }

  Workspace& work_;
  std::vector<std::uint32_t> order_;
  Beam beam_;
  TransferFunction transfer_;
  bool hasAdam_ = false;
  DeviceArray<GaussianBlock<float>> gaussians_;
  DeviceArray<BlockPlace> places_;
  DeviceArray<int> sharpSlots_;
  DeviceArray<GaussianBlock<double>> sharp_;
  DeviceArray<AdamBlock<float>> adam_;
};

}  // namespace bigus::cuda
