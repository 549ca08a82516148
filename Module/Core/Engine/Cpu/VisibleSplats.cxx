// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/Cpu/VisibleSplats.h"

#include <algorithm>
#include <atomic>
#include <cmath>

namespace bigus
{

/// How many Gaussians may overlap, by tiles of an image. Adding is safe from several threads; sums of whole numbers do
/// not depend on their order.
class TileCounts
{
public:
  TileCounts(int width, int height)
      : grid_(OverlapGrid::For(width, height)),
        counts_(new std::atomic<std::uint32_t>[static_cast<std::size_t>(grid_.columns) * grid_.rows] {})
  {
  }
  void Add(const PixelBox& box, int count)
  {
    ForTiles(box, [count](std::atomic<std::uint32_t>& n) { n.fetch_add(count, std::memory_order_relaxed); });
  }
  std::uint32_t Most(const PixelBox& box) const
  {
    std::uint32_t most = 0;
    ForTiles(box, [&most](const std::atomic<std::uint32_t>& n)
             { most = std::max(most, n.load(std::memory_order_relaxed)); });
    return most;
  }

private:
  template <class Body>
  void ForTiles(const PixelBox& box, Body&& body) const
  {
    const PixelBox tiles = grid_.TilesOf(box);
    for (std::int64_t row = tiles.rowBegin; row < tiles.rowEnd; ++row)
    {
      for (std::int64_t column = tiles.columnBegin; column < tiles.columnEnd; ++column)
      {
        body(counts_[static_cast<std::size_t>(row) * grid_.columns + column]);
      }
    }
  }

  OverlapGrid grid_;
  std::unique_ptr<std::atomic<std::uint32_t>[]> counts_;
};

template <class T>
std::vector<TileCounts> VisibleSplats<T>::FindBlocks(CpuField<T>& field, const std::vector<Camera>& cameras, int width,
                                                     int height, const Truncation& truncation)
{
  std::vector<TileCounts> overlaps;
  for (std::size_t f = 0; f < (truncation.isShared ? cameras.size() : 0); ++f)
  {
    overlaps.emplace_back(width, height);
  }
  const std::vector<BlockPlace>& groups = field.Groups();
  std::vector<std::uint8_t> reached(field.NumberOfBlocks());
  const auto lookInto = [&](std::size_t b)
  {
    const BlockPlace& place = field.Place(b);
    const double logMagnitude = truncation.LogMagnitude(place);
    for (std::size_t f = 0; f < cameras.size() && (truncation.isShared || !reached[b]); ++f)
    {
      Reach reach;
      if (!Reaches<T>(place, cameras[f], logMagnitude, truncation.logFloor, reach) ||
          !Overlap(reach.box, PixelBox{0, width, 0, height}))
      {
        continue;
      }
      reached[b] = 1;
      if (truncation.isShared)
      {
        std::int32_t column, row;
        const View<T> view = LocalView<T>(cameras[f], place, column, row);
        const T slab = static_cast<T>(std::min(reach.slab, 1e30));
        overlaps[f].Add(reach.box, kernels_.countInSlab(field.Block(b), place.count, view, slab));
      }
    }
  };
  tbb::parallel_for(std::size_t(0), groups.size(),
                    [&](std::size_t g)
                    {
                      const double logMagnitude = truncation.LogMagnitude(groups[g]);
                      Reach reach;
                      if (std::none_of(cameras.begin(), cameras.end(),
                                       [&](const Camera& camera) {
                                         return Reaches<T>(groups[g], camera, logMagnitude, truncation.logFloor, reach);
                                       }))
                      {
                        return;
                      }
                      for (std::size_t b = g * CpuField<T>::kGroup;
                           b < std::min((g + 1) * CpuField<T>::kGroup, field.NumberOfBlocks()); ++b)
                      {
                        lookInto(b);
                      }
                    });
  blocks_.clear();
  for (std::size_t b = 0; b < reached.size(); ++b)
  {
    if (reached[b])
    {
      blocks_.push_back(static_cast<std::uint32_t>(b));
    }
  }
  return overlaps;
}

template <class T>
int VisibleSplats<T>::Project(const CpuField<T>& field, std::size_t b, const Camera& camera,
                              const Engine::Window& window, double slab, double share, const Truncation& truncation,
                              bool direct, SplatBuffer<T>& found) const
{
  const BlockPlace& place = field.Place(b);
  const auto task = [&](auto number)
  {
    using U = decltype(number);
    ProjectionTask<U> out;
    out.view = LocalView<U>(camera, place, out.originColumn, out.originRow);
    out.columnBegin = window.firstColumn;
    out.columnEnd = window.firstColumn + window.columns;
    out.rowBegin = window.firstRow;
    out.rowEnd = window.firstRow + window.rows;
    out.slab = static_cast<U>(std::min(slab, 1e30));
    out.tolerance = static_cast<U>(share);
    out.leastMagnitude = static_cast<U>(truncation.leastMagnitude);
    out.direct = direct;
    out.lowestExponent = kLowestExponent<T>;
    out.exponentUnit = kExponentUnit<T>;
    return out;
  };
  if (!field.Sharp(b))
  {
    return kernels_.projectBlock(field.Block(b), place.count, task(T()), found);
  }
  SplatBuffer<double> exact;
  const int count = doubleKernels_.projectBlock(*field.Sharp(b), place.count, task(double()), exact);
  for (int f = 0; f < kSplatReals; ++f)
  {
    std::copy_n(exact.reals[f], count, found.reals[f]);
  }
  for (int f = 0; f < kSplatWholes; ++f)
  {
    std::copy_n(exact.wholes[f], count, found.wholes[f]);
  }
  found.rowBegin = exact.rowBegin;
  found.rowEnd = exact.rowEnd;
  return count;
}

template <class T>
void VisibleSplats<T>::Find(CpuField<T>& field, const std::vector<Camera>& cameras, int width, int height,
                            const Engine::Window& window, const Accuracy& accuracy, FootprintsFor purpose)
{
  const Truncation truncation =
      Truncation::For(purpose, accuracy.tolerance / field.Transfer().gamma, accuracy.perSplat, field.Size());
  const PixelBox pixels{window.firstColumn, window.firstColumn + window.columns, window.firstRow,
                        window.firstRow + window.rows};
  const std::vector<TileCounts> overlaps = FindBlocks(field, cameras, width, height, truncation);
  views_ = cameras.size();
  lists_.resize(blocks_.size() * cameras.size());
  std::atomic<std::size_t> used;
  do
  {
    // Where a list begins depends on the order in which blocks finish; what it holds does not. When room runs out the
    // pass goes on to learn how much is needed, and is repeated.
    if (used = 0; needed_ > capacity_)
    {
      capacity_ = 0;  // also where memory runs out below
      reals_.reset();
      wholes_.reset();
      const std::size_t most = needed_ + needed_ / 32;
      constexpr std::size_t kVector = 16;  // numbers that may be read behind the last
      reals_.reset(new T[kSplatReals * most + kVector]);
      wholes_.reset(new Whole<T>[kSplatWholes * most + kVector]);
      capacity_ = most;
    }
    ForBlocks(
        [&](std::size_t slot)
        {
          const std::size_t b = blocks_[slot];
          if (slot + 1 < blocks_.size())
          {
            field.Prefetch(blocks_[slot + 1]);
          }
          const BlockPlace& place = field.Place(b);
          const double logMagnitude = truncation.LogMagnitude(place);
          Reach reach;
          std::uint32_t most = 1;
          for (std::size_t f = 0; f < overlaps.size(); ++f)  // none where the tolerance is not shared
          {
            if (Reaches<T>(place, cameras[f], logMagnitude, truncation.logFloor, reach))
            {
              most = std::max(most, overlaps[f].Most(reach.box));
            }
          }
          const double share = truncation.Share(most), logShare = std::log(share);
          SplatBuffer<T> found;
          for (std::size_t f = 0; f < cameras.size(); ++f)
          {
            List& list = lists_[slot * cameras.size() + f];
            list = {0, 0, 0, 0};
            if (!Reaches<T>(place, cameras[f], logMagnitude, logShare, reach) || !Overlap(reach.box, pixels))
            {
              continue;
            }
            list.count = Project(field, b, cameras[f], window, reach.slab, share, truncation, accuracy.direct, found);
            if (list.count == 0)
            {
              continue;
            }
            list.rowBegin = found.rowBegin;
            list.rowEnd = found.rowEnd;
            list.offset = used.fetch_add(list.count, std::memory_order_relaxed);
            if (list.offset + list.count <= capacity_)
            {
              for (int k = 0; k < kSplatReals; ++k)
              {
                std::copy_n(found.reals[k], list.count, reals_.get() + kSplatReals * list.offset + k * list.count);
              }
              for (int k = 0; k < kSplatWholes; ++k)
              {
                std::copy_n(found.wholes[k], list.count, wholes_.get() + kSplatWholes * list.offset + k * list.count);
              }
            }
          }
        });
    needed_ = used;
  } while (needed_ > capacity_);
}

template <class T>
std::size_t VisibleSplats<T>::Bytes() const
{
  return blocks_.capacity() * sizeof(blocks_[0]) + lists_.capacity() * sizeof(lists_[0]) +
         capacity_ * (kSplatReals * sizeof(T) + kSplatWholes * sizeof(Whole<T>));
}

template class VisibleSplats<float>;
template class VisibleSplats<double>;

}  // namespace bigus
