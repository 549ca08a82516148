// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What an engine that holds its field in blocks saves and loads: see Engine::SaveState. Private to Core and Cuda.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "Core/Engine/BlockField.h"
#include "Core/Engine/FieldState.h"
#include "Core/Numerics/StateBytes.h"

namespace bigus
{

/// A block in double, of Gaussians too thin for float, and its number among all blocks.
using SharpBlock = std::pair<std::uint32_t, GaussianBlock<double>>;

template <class T>
struct BlockState
{
  Beam beam;
  TransferFunction transfer;
  std::vector<std::uint32_t> order;         ///< slot -> index in the field
  std::vector<Vector3<double>> centres;     ///< of blocks, mm
  std::vector<GaussianBlock<T>> gaussians;  ///< blocks
  std::vector<SharpBlock> sharp;            ///< of some blocks
  std::vector<AdamBlock<T>> adam;           ///< of all blocks, or none
  std::vector<ScoreBlock<T>> scores;        ///< of all blocks, or none
  bool keepsScores = false;
  std::uint64_t guarded = 0;  ///< updates

  /// Where block b is, to be measured.
  BlockPlace Place(std::size_t b) const
  {
    BlockPlace place{};
    place.centre = centres[b];
    place.count = static_cast<int>(std::min<std::size_t>(kBlock, order.size() - b * kBlock));
    return place;
  }

  void Save(StateWriter& to) const
  {
    SaveBeam(beam, to);
    to.Number(transfer.gamma);
    constexpr std::size_t kRest = 4096;  // bytes, of numbers and counts
    to.Reserve(kRest + order.size() * sizeof(order[0]) + centres.size() * sizeof(centres[0]) +
               gaussians.size() * sizeof(gaussians[0]) + sharp.size() * sizeof(sharp[0]) +
               adam.size() * sizeof(adam[0]) + scores.size() * sizeof(scores[0]));
    to.Array(order);
    for (const Vector3<double>& centre : centres)
    {
      const double at[3] = {centre.x, centre.y, centre.z};
      to.Numbers(at, 3);
    }
    SaveBlocks(gaussians, to);
    to.Number<std::uint64_t>(sharp.size());
    for (const auto& [b, block] : sharp)
    {
      to.Number(b);
      to.Numbers(block.mean[0], NumbersIn<GaussianBlock<double>, double>());
    }
    to.Flag(!adam.empty());
    SaveBlocks(adam, to);
    to.Flag(keepsScores);
    to.Flag(!scores.empty());
    SaveBlocks(scores, to);
    to.Number(guarded);
  }

  /// Throws Error unless all of it is the state of a sound field.
  static BlockState Load(StateReader& from)
  {
    BlockState state;
    state.beam = LoadBeam(from);
    state.transfer.gamma = from.Number<double>();
    state.order = from.Array<std::uint32_t>();
    std::vector<bool> seen(state.order.size());
    for (const std::uint32_t i : state.order)
    {
      StateReader::Require(i < seen.size() && !seen[i], "a Gaussian twice");
      seen[i] = true;
    }
    const std::size_t blocks = NumberOfBlocks(state.order.size());
    std::vector<double> centres(3 * blocks);
    from.Numbers(centres.data(), centres.size());
    for (std::size_t b = 0; b < blocks; ++b)
    {
      state.centres.push_back({centres[3 * b], centres[3 * b + 1], centres[3 * b + 2]});
    }
    LoadBlocks(state.gaussians, blocks, from);
    state.RequireSoundField();
    state.LoadSharp(from);
    LoadBlocks(state.adam, from.Flag() ? blocks : 0, from);
    for (const AdamBlock<T>& block : state.adam)
    {
      RequireAverages(block.first[0], block.second[0], kParametersPerGaussian * kBlock);
      StateReader::Require(
          std::all_of(block.updates, block.updates + kBlock, [](T updates) { return updates >= T(0); }),
          "a negative count");
    }
    state.keepsScores = from.Flag();
    LoadBlocks(state.scores, from.Flag() ? blocks : 0, from);
    state.guarded = from.Number<std::uint64_t>();
    return state;
  }

private:
  template <class Block, class Number = T>
  static constexpr std::size_t NumbersIn()
  {
    static_assert(sizeof(Block) % (kBlock * sizeof(Number)) == 0, "arrays alone, and nothing between them");
    return sizeof(Block) / sizeof(Number);
  }

  template <class Block>
  static void SaveBlocks(const std::vector<Block>& blocks, StateWriter& to)
  {
    to.Numbers(reinterpret_cast<const T*>(blocks.data()), blocks.size() * NumbersIn<Block>());
  }

  template <class Block>
  static void LoadBlocks(std::vector<Block>& blocks, std::size_t count, StateReader& from)
  {
    StateReader::Require(count * sizeof(Block) <= from.Left(), "fewer Gaussians than it says");
    blocks.resize(count);
    from.Numbers(reinterpret_cast<T*>(blocks.data()), count * NumbersIn<Block>());
  }

  void RequireSoundField() const
  {
    GaussianField field;
    field.beam = beam;
    field.transfer = transfer;
    field.Resize(order.size());
    for (std::size_t slot = 0; slot < order.size(); ++slot)
    {
      UnpackGaussian(gaussians[slot / kBlock], slot % kBlock, Place(slot / kBlock), order[slot], field);
    }
    field.Validate();
    for (std::size_t slot = order.size(); slot < gaussians.size() * kBlock; ++slot)
    {
      StateReader::Require(gaussians[slot / kBlock].reflectivity[slot % kBlock] == T(0), "a Gaussian too many");
    }
  }

  void LoadSharp(StateReader& from)
  {
    constexpr std::size_t kNumbers = NumbersIn<GaussianBlock<double>, double>();
    sharp.resize(from.Count(sizeof(std::uint32_t) + kNumbers * sizeof(double)));
    std::uint32_t next = 0;
    for (auto& [b, block] : sharp)
    {
      b = from.Number<std::uint32_t>();
      StateReader::Require(b >= next && b < gaussians.size(), "a block out of its order");
      next = b + 1;
      from.Numbers(block.mean[0], kNumbers);
      // They are what float has lost, and so no further from it than float's last digits.
      const T* coarse = gaussians[b].mean[0];
      const double* fine = block.mean[0];
      for (std::size_t i = 0; i < kNumbers; ++i)
      {
        constexpr double kLastDigits = 1e-6;
        StateReader::Require(std::abs(fine[i] - coarse[i]) <= kLastDigits * (1 + std::abs(fine[i])),
                             "Gaussians that contradict each other");
      }
    }
  }
};

}  // namespace bigus
