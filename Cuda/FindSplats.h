// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From Gaussians to the footprints that the planes of a batch see. Private to Cuda.
//
// A thread block takes one block of Gaussians and all planes: whole blocks are tested first, and what a plane
// sees of a block is written as one list in the Gaussians' order. Tiles of images then look for their splats by
// testing boxes, of groups of blocks, blocks and splats (Forward.h): nothing is sorted, and where a list lies in
// memory changes no result.
#pragma once

#include "Core/Formula/BlockReach.h"
#include "Core/Formula/Scalars.h"
#include "Core/Formula/Splat.h"
#include "Core/Formula/Truncation.h"
#include "Device.h"

namespace bigus
{

#include "Core/Formula/Footprint-inl.h"

namespace cuda
{

constexpr unsigned int kAllLanes = 0xffffffffu;
constexpr int kWarp = 32;
constexpr int kTileSide = 16;  // pixels; a warp renders one tile
constexpr int kRun = 8;        // rows that a recurrence walks, from their middle both ways
constexpr int kGroup = 32;     // blocks whose boxes are tested together
constexpr int kChunk = 32;     // planes that a thread block looks at together

/// Half-open ranges of pixels of a plane. One load.
struct alignas(16) Box
{
  int columnBegin, columnEnd, rowBegin, rowEnd;
};

/// Without branches: a branch would wait for one number after the other.
__device__ inline bool Meet(const Box p, const Box q)
{
  return (p.columnEnd > q.columnBegin) & (p.columnBegin < q.columnEnd) & (p.rowEnd > q.rowBegin) &
         (p.rowBegin < q.rowEnd);
}

/// A footprint in an image, w(p) = exp(logAmplitude - |U (p - m)|^2 / 2), m = (column + mu, row + mv); see
/// Footprint. Four loads of 16 bytes.
struct alignas(16) DeviceSplat
{
  float u11, u12, u22, logAmplitude;
  float mu, mv, cut;
  float rowFactor;  // exp(-(u12^2 + u22^2)), or 0: by an exponential a pixel
  int column, row;
  int gaussian;        // index in its block
  float reflectivity;  // its own
  Box box;             // pixels that matter, of those to be computed
};

/// What one plane sees of one block: splats[offset, offset + count), in the order of their Gaussians; bit i % 32
/// of mask[i / 32] says that Gaussian i is among them.
struct Seen
{
  unsigned long long offset;
  int count;
  int padding;
  unsigned int mask[kBlock / kWarp];
};

/// A field on the device.
struct Field
{
  int blocks;
  GaussianBlock<float>* gaussians;     // [blocks]
  BlockPlace* places;                  // [blocks]
  int* sharpSlots;                     // [blocks] index in `sharp`, or -1: widen what is in `gaussians`
  const GaussianBlock<double>* sharp;  // blocks with needles, as they came
};

/// How many Gaussians may overlap, by tiles of each plane: see Truncation.
struct OverlapCounts
{
  unsigned int* counts;  // [views][grid.rows][grid.columns]
  OverlapGrid grid;
};

struct FindTask
{
  Field field;
  const Camera* cameras;
  const int* frames;  // [views] camera of each view
  int views;
  Box window;  // pixels to be computed, whole tiles
  Box plane;   // all pixels
  Truncation truncation;
  bool direct;  // no recurrences
  OverlapCounts overlaps;
  Seen* seen;       // [blocks][views]
  Box* boxes;       // [views][blocks rounded up to whole groups]
  Box* groupBoxes;  // [views][groups]
  int groups;
  DeviceSplat* splats;  // [capacity]
  unsigned long long capacity;
  unsigned long long* used;  // splats found, whether or not there was room for them
};

/// e^x for x >= kLowestExponent; anything from 0 to that below. Denormal numbers, which the fast instruction would need
/// help with, do not occur.
__device__ inline float Exp(float x)
{
#if defined(__CUDA_ARCH__)
  float result;
  asm("ex2.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(x * 1.4426950408889634f));
  return result;
#else
  return std::exp(x);
#endif
}

template <class T>
__device__ Gaussian<T> LoadGaussian(const GaussianBlock<T>& block, int i)
{
  return {{block.mean[0][i], block.mean[1][i], block.mean[2][i]},
          {block.logScale[0][i], block.logScale[1][i], block.logScale[2][i]},
          {block.rotation[0][i], block.rotation[1][i], block.rotation[2][i], block.rotation[3][i]},
          block.reflectivity[i]};
}

template <class T>
__device__ T MagnitudeOf(const Truncation& truncation, const Gaussian<T>& gaussian)
{
  return max(std::abs(gaussian.reflectivity), static_cast<T>(truncation.leastMagnitude));
}

/// Projects one Gaussian in T and finds its footprint in the window; false when it has none.
template <class T>
__device__ bool FindSplat(const FindTask& task, const Gaussian<T>& gaussian, const View<T>& view, int originColumn,
                          int originRow, double tolerance, DeviceSplat& out)
{
  const T lowest = static_cast<T>(kLowestExponent<float>);
  const Splat<T> s = Project(gaussian, view).splat;
  const Footprint<T> f = FootprintOf(s, MagnitudeOf(task.truncation, gaussian), static_cast<T>(tolerance), lowest);
  const int column = originColumn + static_cast<int>(f.column), row = originRow + static_cast<int>(f.row);
  const int half = static_cast<int>(f.half);
  out.box = {max(originColumn + static_cast<int>(f.columnBegin), task.window.columnBegin),
             min(originColumn + static_cast<int>(f.columnEnd), task.window.columnEnd),
             max(row - half, task.window.rowBegin), min(row + half, task.window.rowEnd)};
  out.u11 = static_cast<float>(s.u11);
  out.u12 = static_cast<float>(s.u12);
  out.u22 = static_cast<float>(s.u22);
  out.logAmplitude = static_cast<float>(f.logAmplitude);
  out.mu = static_cast<float>(f.mu);
  out.mv = static_cast<float>(f.mv);
  out.cut = static_cast<float>(f.cut);
  out.column = column;
  out.row = row;
  // A recurrence starts at most kRun / 2 rows away.
  const bool recurs = !task.direct && WeightsHold(f, T(kRun / 2)) && RatiosHold(f, lowest);
  out.rowFactor = recurs ? static_cast<float>(std::exp(-f.curvature)) : 0.0f;
  return out.box.columnBegin < out.box.columnEnd && out.box.rowBegin < out.box.rowEnd && f.cut > T(0) &&
         f.logAmplitude > lowest;
}

/// The same of a needle, whose projection cancels too much for float. Rare, so kept out of the way of the rest.
__device__ BIGUS_APART bool FindSharpSplat(const FindTask& task, const Camera& camera, int block, int i,
                                           double tolerance, DeviceSplat& out)
{
  const BlockPlace& place = task.field.places[block];
  Gaussian<double> gaussian;
  const int slot = task.field.sharpSlots[block];
  if (slot >= 0)
  {
    gaussian = LoadGaussian(task.field.sharp[slot], i);
  }
  else
  {
    const Gaussian<float> narrow = LoadGaussian(task.field.gaussians[block], i);
    gaussian.mean = {narrow.mean.x, narrow.mean.y, narrow.mean.z};
    gaussian.logScale = {narrow.logScale.x, narrow.logScale.y, narrow.logScale.z};
    gaussian.reflectivity = narrow.reflectivity;
    double length = 0;
    for (int k = 0; k < 4; ++k)
    {
      gaussian.rotation[k] = narrow.rotation[k];
      length += gaussian.rotation[k] * gaussian.rotation[k];
    }
    for (int k = 0; k < 4; ++k)
    {
      gaussian.rotation[k] /= std::sqrt(length);
    }
  }
  std::int32_t column, row;
  const View<double> view = LocalView<double>(camera, place, column, row);
  return FindSplat(task, gaussian, view, column, row, tolerance, out);
}

/// mu_z^2, mm^2.
__device__ inline float SquaredDistance(const Gaussian<float>& g, const View<float>& view)
{
  const float z = Dot(view.n, MultiplyAdd(-1.0f, view.origin, g.mean));
  return z * z;
}

__device__ inline bool IsSharp(const Gaussian<float>& g)
{
  const Vector3<float>& s = g.logScale;
  return max(max(s.x, s.y), s.z) - min(min(s.x, s.y), s.z) > static_cast<float>(kLogSharp);
}

/// The smallest and the largest of a warp's values, in every lane.
__device__ inline int WarpMin(int value)
{
  for (int step = kWarp / 2; step > 0; step /= 2)
  {
    value = min(value, __shfl_xor_sync(kAllLanes, value, step));
  }
  return value;
}
__device__ inline int WarpMax(int value)
{
  for (int step = kWarp / 2; step > 0; step /= 2)
  {
    value = max(value, __shfl_xor_sync(kAllLanes, value, step));
  }
  return value;
}

/// The tiles of OverlapCounts that a box of pixels touches.
__device__ inline Box TilesOf(const OverlapCounts& overlaps, const PixelBox& box)
{
  const PixelBox tiles = overlaps.grid.TilesOf(box);
  return {static_cast<int>(tiles.columnBegin), static_cast<int>(tiles.columnEnd), static_cast<int>(tiles.rowBegin),
          static_cast<int>(tiles.rowEnd)};
}

/// Where the tolerance is shared: counts by tiles the Gaussians that can contribute more than the floor; see
/// Truncation. Launched as (blocks, views) of kBlock threads.
__global__ void __launch_bounds__(kBlock) CountOverlaps(FindTask task)
{
  const int b = blockIdx.x, f = blockIdx.y, i = threadIdx.x;
  const BlockPlace& place = task.field.places[b];
  const Camera& camera = task.cameras[task.frames[f]];
  const PixelBox plane{task.plane.columnBegin, task.plane.columnEnd, task.plane.rowBegin, task.plane.rowEnd};
  Reach reach;
  if (!Reaches<float>(place, camera, task.truncation.LogMagnitude(place), task.truncation.logFloor, reach) ||
      !Overlap(reach.box, plane))
  {
    return;  // all threads alike
  }
  std::int32_t column, row;
  const View<float> view = LocalView<float>(camera, place, column, row);
  const float slab = static_cast<float>(min(reach.slab, 1e30));
  const bool inside = i < place.count && SquaredDistance(LoadGaussian(task.field.gaussians[b], i), view) <= slab;
  __shared__ int counts[kBlock / kWarp];
  const unsigned int ballot = __ballot_sync(kAllLanes, inside);
  if (i % kWarp == 0)
  {
    counts[i / kWarp] = __popc(ballot);
  }
  __syncthreads();
  int count = 0;
  for (int k = 0; k < kBlock / kWarp; ++k)
  {
    count += counts[k];
  }
  const Box tiles = TilesOf(task.overlaps, reach.box);
  const int across = tiles.columnEnd - tiles.columnBegin, all = across * (tiles.rowEnd - tiles.rowBegin);
  for (int t = i; t < all && count > 0; t += kBlock)
  {
    const std::size_t tile = (static_cast<std::size_t>(f) * task.overlaps.grid.rows + tiles.rowBegin + t / across) *
                                 task.overlaps.grid.columns +
                             tiles.columnBegin + t % across;
    atomicAdd(task.overlaps.counts + tile, static_cast<unsigned int>(count));
  }
}

/// The most Gaussians that overlap on any tile within this thread block's reach, for kChunk planes from `first` on.
/// By the whole thread block; the results are good after the next barrier.
__device__ inline void FindMost(const FindTask& task, const BlockPlace& place, int first, Box (&tiles)[kChunk],
                                unsigned int (&most)[kChunk])
{
  const int i = threadIdx.x;
  if (i < kChunk)
  {
    Reach reach;
    const bool reached =
        first + i < task.views && Reaches<float>(place, task.cameras[task.frames[first + i]],
                                                 task.truncation.LogMagnitude(place), task.truncation.logFloor, reach);
    tiles[i] = reached ? TilesOf(task.overlaps, reach.box) : Box{0, 0, 0, 0};
    most[i] = 1;
  }
  __syncthreads();
  for (int j = 0; j < kChunk; ++j)
  {
    const int across = tiles[j].columnEnd - tiles[j].columnBegin, down = tiles[j].rowEnd - tiles[j].rowBegin;
    unsigned int mine = 0;
    for (int t = i; t < (across > 0 && down > 0 ? across * down : 0); t += kBlock)
    {
      const std::size_t row =
          static_cast<std::size_t>(first + j) * task.overlaps.grid.rows + tiles[j].rowBegin + t / across;
      mine = max(mine, task.overlaps.counts[row * task.overlaps.grid.columns + tiles[j].columnBegin + t % across]);
    }
    if (mine > 1)
    {
      atomicMax(&most[j], mine);
    }
  }
}

/// Fills seen, boxes and splats. Launched as (blocks, 1) of kBlock threads, of which each has its Gaussian.
__global__ void __launch_bounds__(kBlock) FindSplats(FindTask task)
{
  constexpr int kWarps = kBlock / kWarp;
  __shared__ View<float> views[kChunk];
  __shared__ int columns[kChunk], rows[kChunk];
  __shared__ float slabs[kChunk];  // negative: not reached
  __shared__ double tolerances[kChunk];
  __shared__ Box tiles[kChunk];
  __shared__ unsigned int most[kChunk];
  // Twice, for one plane and the next: so that no thread overwrites what another still reads.
  __shared__ unsigned int masks[2][kWarps];
  __shared__ Box warpBoxes[2][kWarps];
  __shared__ unsigned long long offsets[2];

  const int b = blockIdx.x, i = threadIdx.x, lane = i % kWarp, warp = i / kWarp;
  const BlockPlace& place = task.field.places[b];
  const bool present = i < place.count;
  const Gaussian<float> gaussian = LoadGaussian(task.field.gaussians[b], i);
  const bool sharp = present && IsSharp(gaussian);
  const double logMagnitude = task.truncation.LogMagnitude(place);
  const float scale = std::exp(max(max(gaussian.logScale.x, gaussian.logScale.y), gaussian.logScale.z));
  const PixelBox window{task.window.columnBegin, task.window.columnEnd, task.window.rowBegin, task.window.rowEnd};

  int turn = 0;
  for (int first = 0; first < task.views; first += kChunk)
  {
    __syncthreads();
    if (task.truncation.isShared)
    {
      FindMost(task, place, first, tiles, most);
      __syncthreads();
    }
    const int f = first + i;
    if (i < kChunk && f < task.views)
    {
      const Camera& camera = task.cameras[task.frames[f]];
      tolerances[i] = task.truncation.Share(most[i]);
      Reach reach;
      const bool reached =
          Reaches<float>(place, camera, logMagnitude, log(tolerances[i]), reach) && Overlap(reach.box, window);
      slabs[i] = reached ? static_cast<float>(min(reach.slab, 1e30)) : -1.0f;
      if (reached)
      {
        views[i] = LocalView<float>(camera, place, columns[i], rows[i]);
      }
      else
      {
        task.seen[static_cast<std::size_t>(b) * task.views + f].count = 0;
        task.boxes[static_cast<std::size_t>(f) * task.groups * kGroup + b] = {0, 0, 0, 0};
      }
    }
    __syncthreads();
    for (int j = 0; j < min(kChunk, task.views - first); ++j)
    {
      if (slabs[j] < 0)
      {
        continue;
      }
      DeviceSplat splat;
      bool visible = false;
      // A Gaussian matters on a plane only if mu_z^2 <= k^2 t, and t <= s_max^2 + sigma_E^2. A thousandth more
      // than the bound, so that its own rounding drops nothing.
      const float squared = SquaredDistance(gaussian, views[j]);
      const float farthest = 1.001f * CutFor(MagnitudeOf(task.truncation, gaussian), static_cast<float>(tolerances[j]));
      if (present && squared <= slabs[j] && squared <= farthest * (scale * scale + views[j].elevationVariance) &&
          farthest > 0)
      {
        visible = sharp ? FindSharpSplat(task, task.cameras[task.frames[first + j]], b, i, tolerances[j], splat)
                        : FindSplat(task, gaussian, views[j], columns[j], rows[j], tolerances[j], splat);
      }
      const unsigned int mask = __ballot_sync(kAllLanes, visible);
      const int none = 0x7fffffff;
      const Box box{WarpMin(visible ? splat.box.columnBegin : none), WarpMax(visible ? splat.box.columnEnd : -none),
                    WarpMin(visible ? splat.box.rowBegin : none), WarpMax(visible ? splat.box.rowEnd : -none)};
      turn ^= 1;
      if (lane == 0)
      {
        masks[turn][warp] = mask;
        warpBoxes[turn][warp] = box;
      }
      __syncthreads();
      if (i == 0)
      {
        Seen seen;
        Box all{none, -none, none, -none};
        seen.count = 0;
        seen.padding = 0;
        for (int k = 0; k < kWarps; ++k)
        {
          seen.mask[k] = masks[turn][k];
          seen.count += __popc(masks[turn][k]);
          const Box& part = warpBoxes[turn][k];
          all = {min(all.columnBegin, part.columnBegin), max(all.columnEnd, part.columnEnd),
                 min(all.rowBegin, part.rowBegin), max(all.rowEnd, part.rowEnd)};
        }
        seen.offset = seen.count > 0 ? atomicAdd(task.used, static_cast<unsigned long long>(seen.count)) : 0;
        offsets[turn] = seen.offset;
        task.seen[static_cast<std::size_t>(b) * task.views + first + j] = seen;
        task.boxes[static_cast<std::size_t>(first + j) * task.groups * kGroup + b] =
            seen.count > 0 ? all : Box{0, 0, 0, 0};
      }
      __syncthreads();
      if (visible)
      {
        unsigned long long at = offsets[turn] + __popc(mask & ((1u << lane) - 1));
        for (int k = 0; k < warp; ++k)
        {
          at += __popc(masks[turn][k]);
        }
        if (at < task.capacity)
        {
          splat.gaussian = i;
          splat.reflectivity = gaussian.reflectivity;
          task.splats[at] = splat;
        }
      }
    }
  }
}

/// Boxes of groups of blocks. Launched as (groups, views) of kGroup threads.
__global__ void __launch_bounds__(kGroup) FindGroups(FindTask task)
{
  const std::size_t f = blockIdx.y, group = blockIdx.x;
  const int b = static_cast<int>(group) * kGroup + threadIdx.x;
  const std::size_t at = f * task.groups * kGroup + b;
  const Box box = b < task.field.blocks ? task.boxes[at] : Box{0, 0, 0, 0};
  if (b >= task.field.blocks)
  {
    task.boxes[at] = box;  // the last group's
  }
  const bool any = box.columnBegin < box.columnEnd;
  const int none = 0x7fffffff;
  const Box all{WarpMin(any ? box.columnBegin : none), WarpMax(any ? box.columnEnd : -none),
                WarpMin(any ? box.rowBegin : none), WarpMax(any ? box.rowEnd : -none)};
  if (threadIdx.x == 0)
  {
    task.groupBoxes[f * task.groups + group] = all;
  }
}

}  // namespace cuda
}  // namespace bigus
