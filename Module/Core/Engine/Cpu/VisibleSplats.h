// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The footprints that a batch of planes sees of a field. Private to Core.
#pragma once

#include <tbb/parallel_for.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "Core/Engine/Cpu/CpuField.h"
#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/FlushDenormals.h"
#include "Core/Engine/Engine.h"
#include "Core/Formula/BlockReach.h"
#include "Core/Formula/Truncation.h"

namespace bigus
{

class TileCounts;

template <class T>
class VisibleSplats
{
public:
  /// What one view sees of one block: `count` footprints, all in rows [rowBegin, rowEnd).
  struct List
  {
    std::size_t offset;
    int count, rowBegin, rowEnd;
  };

  /// Finds what the cameras see inside the window of their width x height images.
  void Find(CpuField<T>& field, const std::vector<Camera>& cameras, int width, int height, const Engine::Window& window,
            const Accuracy& accuracy, FootprintsFor purpose);

  std::size_t Views() const { return views_; }
  /// The block that a slot of the seen blocks stands for.
  std::size_t Block(std::size_t slot) const { return blocks_[slot]; }
  const List& ListOf(std::size_t slot, std::size_t view) const { return lists_[slot * views_ + view]; }
  SplatRows<T> Splats(const List& list) const
  {
    return {reals_.get() + kSplatReals * list.offset, wholes_.get() + kSplatWholes * list.offset, list.count,
            list.count};
  }

  /// body(slot) for every block that was seen, on all threads.
  template <class Body>
  void ForBlocks(Body&& body) const
  {
    tbb::parallel_for(std::size_t(0), blocks_.size(),
                      [&](std::size_t slot)
                      {
                        const FlushDenormals flush;
                        body(slot);
                      });
  }

  /// Adds all that a view sees to some rows of its image: footprints times valuesOf(block), which gives kBlock numbers
  /// or null for 1.
  template <class ValuesOf>
  void AddTo(std::size_t view, int rowBegin, int rowEnd, const PixelRows<T>& rows, ValuesOf&& valuesOf) const
  {
    for (std::size_t slot = 0; slot < blocks_.size(); ++slot)
    {
      const List& list = ListOf(slot, view);
      if (list.count > 0 && list.rowBegin < rowEnd && list.rowEnd > rowBegin)
      {
        kernels_.addFootprints(Splats(list), valuesOf(blocks_[slot]), rowBegin, rowEnd, rows);
      }
    }
  }

  std::size_t Bytes() const;

private:
  /// Fills blocks_ with those that can be seen and, where the tolerance is shared, counts their Gaussians by tiles.
  std::vector<TileCounts> FindBlocks(CpuField<T>& field, const std::vector<Camera>& cameras, int width, int height,
                                     const Truncation& truncation);
  /// Projects a block, in double if it is sharp; each of its Gaussians may drop `share`. Returns how many footprints
  /// were found.
  int Project(const CpuField<T>& field, std::size_t b, const Camera& camera, const Engine::Window& window, double slab,
              double share, const Truncation& truncation, bool direct, SplatBuffer<T>& found) const;

  const Kernels<T> kernels_ = KernelsOfThisMachine<T>();
  const Kernels<double> doubleKernels_ = KernelsOfThisMachine<double>();
  std::vector<std::uint32_t> blocks_;
  std::vector<List> lists_;  // [blocks_][views_]
  std::size_t views_ = 0;
  std::unique_ptr<T[]> reals_;  // of lists, see SplatRows
  std::unique_ptr<Whole<T>[]> wholes_;
  std::size_t capacity_ = 0, needed_ = 0;
};

}  // namespace bigus
