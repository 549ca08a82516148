// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field as the CPU engine holds it: blocks of neighbours, where they are, and what the optimizer keeps of them. Private
// to Core.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "Core/Engine/BlockState.h"
#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Formula/BlockReach.h"
#include "Core/Formula/GaussianBlock.h"
#include "Core/Model/GaussianField.h"

namespace bigus
{

template <class T>
class CpuField
{
public:
  static constexpr std::size_t kGroup = 32;  // neighbouring blocks tested together first: large fields have many blocks

  /// See Engine::SetField.
  void Set(const GaussianField& field, const std::vector<int>* parents);
  GaussianField Get() const;

  /// All but the scores, which are the engine's.
  BlockState<T> State() const;
  void SetState(BlockState<T> state);

  std::size_t Size() const { return order_.size(); }
  std::size_t NumberOfBlocks() const { return blocks_.size(); }
  const std::vector<std::uint32_t>& Order() const { return order_; }
  const Beam& GetBeam() const { return beam_; }
  const TransferFunction& Transfer() const { return transfer_; }

  const GaussianBlock<T>& Block(std::size_t b) const { return blocks_[b]; }
  const BlockPlace& Place(std::size_t b) const { return places_[b]; }
  /// Begins to fetch a block that will be used next: fields are larger than caches.
  void Prefetch(std::size_t b) const { PrefetchBytes(&blocks_[b], sizeof(blocks_[b])); }
  void PrefetchAverages(std::size_t b) const
  {
    if (!adam_.empty())
    {
      PrefetchBytes(&adam_[b], sizeof(adam_[b]));
    }
  }
  /// The block in double where it holds needles, which are projected in double; else null.
  const GaussianBlock<double>* Sharp(std::size_t b) const { return sharp_[b].get(); }
  /// Places of kGroup blocks each, brought up to date with those of their blocks.
  const std::vector<BlockPlace>& Groups();

  /// By slot, [NumberOfBlocks()][kBlock], 0 where no Gaussian is.
  std::vector<T> Reflectivities() const;
  void SetReflectivities(const std::vector<T>& bySlot);

  /// Before Update is called for any block.
  void PrepareStep();
  /// One step of the Gaussians of a block that its gradient says were seen. Blocks may be updated at the same time.
  void Update(std::size_t b, const GradientBlock<T>& gradient, const AdamStep& step);
  /// See Engine::GuardedUpdates.
  std::uint64_t GuardedUpdates() const { return guarded_; }

  std::size_t Bytes() const;

private:
  static void PrefetchBytes(const void* begin, std::size_t size)
  {
    constexpr std::size_t kCacheLine = 64;
    for (std::size_t at = 0; at < size; at += kCacheLine)
    {
      __builtin_prefetch(static_cast<const char*>(begin) + at);
    }
  }

  void FillBlock(const GaussianField& field, std::size_t b);
  /// Brings a block's place, and its parameters in double if it has needles, up to date with its Gaussians.
  void Measure(std::size_t b);
  /// The optimizer's averages for a new order of a restructured field. Must be called while order_ is still the old.
  void InheritAdam(const std::vector<std::uint32_t>& order, std::size_t blocks, const std::vector<int>* parents);

  const Kernels<T> kernels_ = KernelsOfThisMachine<T>();
  std::vector<std::uint32_t> order_;  // slot -> index in the field
  std::vector<GaussianBlock<T>> blocks_;
  std::vector<BlockPlace> places_, groups_;  // of blocks, and of kGroup blocks
  bool groupsAreStale_ = true;
  std::vector<std::unique_ptr<GaussianBlock<double>>> sharp_;  // of float blocks with needles
  std::vector<AdamBlock<T>> adam_;                             // empty until the first step
  std::atomic<std::uint64_t> guarded_{0};
  Beam beam_;
  TransferFunction transfer_;
};

}  // namespace bigus
