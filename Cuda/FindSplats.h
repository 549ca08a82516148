// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From Gaussians to the footprints that the planes of a batch see. Private to Cuda.
//
// A warp takes a few pairs of a block of Gaussians and a plane, without barriers: whole blocks are tested first, a lane
// each, and what a plane sees of a block is written as one list in the Gaussians' order. Tiles of images then look for
// their splats by testing boxes, of groups of blocks, blocks and splats (Forward.h): nothing is sorted, and where a list
// lies in memory changes no result.
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
constexpr int kTileSide = 16;  // pixels; a thread block renders one tile
constexpr int kRun = 8;        // rows that a recurrence walks, from their middle both ways
constexpr int kGroup = 32;     // blocks whose boxes are tested together
constexpr int kFindWarps = 4;  // of a thread block that finds splats

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
  int view;            // whose image it is in
  float reflectivity;  // its Gaussian's
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
  int pairs;            // of a block and a plane, that a warp looks at: at most kWarp
  DeviceSplat* splats;  // [capacity]
  unsigned long long capacity;
  unsigned long long* used;  // room for splats that was asked for, whether or not there was as much
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
  const Footprint<T> f =
      FootprintOf(s, CutFor(MagnitudeOf(task.truncation, gaussian), static_cast<T>(tolerance)), lowest);
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
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
  return __reduce_min_sync(kAllLanes, value);
#else
  for (int step = kWarp / 2; step > 0; step /= 2)
  {
    value = min(value, __shfl_xor_sync(kAllLanes, value, step));
  }
  return value;
#endif
}
__device__ inline int WarpMax(int value)
{
  return -WarpMin(-value);
}

/// visit(bit) for every lane whose condition holds, in order, by the whole warp.
template <class Visit>
__device__ void ForLanes(bool condition, Visit&& visit)
{
  for (unsigned int left = __ballot_sync(kAllLanes, condition); left != 0; left &= left - 1)
  {
    visit(__ffs(static_cast<int>(left)) - 1);
  }
}

/// The tiles of OverlapCounts that a box of pixels touches.
__device__ inline Box TilesOf(const OverlapCounts& overlaps, const PixelBox& box)
{
  const PixelBox tiles = overlaps.grid.TilesOf(box);
  return {static_cast<int>(tiles.columnBegin), static_cast<int>(tiles.columnEnd), static_cast<int>(tiles.rowBegin),
          static_cast<int>(tiles.rowEnd)};
}

/// Where the tolerance is shared: counts by tiles the Gaussians that can contribute more than the floor; see
/// Truncation. Launched as (blocks / kBlock, views) of kBlock threads: each tests one block, its warp looks into those
/// that are reached.
__global__ void __launch_bounds__(kBlock) CountOverlaps(FindTask task)
{
  const int b = blockIdx.x * kBlock + threadIdx.x, f = blockIdx.y, lane = threadIdx.x % kWarp;
  const Camera& camera = task.cameras[task.frames[f]];
  const PixelBox plane{task.plane.columnBegin, task.plane.columnEnd, task.plane.rowBegin, task.plane.rowEnd};
  Reach reach;
  Box tiles{0, 0, 0, 0};
  float slab = 0;
  const bool reached = b < task.field.blocks &&
                       Reaches<float>(task.field.places[b], camera, task.truncation.LogMagnitude(task.field.places[b]),
                                      task.truncation.logFloor, reach) &&
                       Overlap(reach.box, plane);
  if (reached)
  {
    tiles = TilesOf(task.overlaps, reach.box);
    slab = static_cast<float>(min(reach.slab, 1e30));
  }
  ForLanes(reached,
           [&](int from)
           {
             const int block = b - lane + from;
             const BlockPlace& place = task.field.places[block];
             std::int32_t column, row;
             const View<float> view = LocalView<float>(camera, place, column, row);
             const float farthest = __shfl_sync(kAllLanes, slab, from);
             int count = 0;
             for (int i = lane; i < kBlock; i += kWarp)
             {
               const bool inside =
                   i < place.count && SquaredDistance(LoadGaussian(task.field.gaussians[block], i), view) <= farthest;
               count += __popc(__ballot_sync(kAllLanes, inside));
             }
             const int left = __shfl_sync(kAllLanes, tiles.columnBegin, from);
             const int top = __shfl_sync(kAllLanes, tiles.rowBegin, from);
             const int across = __shfl_sync(kAllLanes, tiles.columnEnd, from) - left;
             const int all = across * (__shfl_sync(kAllLanes, tiles.rowEnd, from) - top);
             for (int t = lane; t < all && count > 0; t += kWarp)
             {
               const std::size_t line = static_cast<std::size_t>(f) * task.overlaps.grid.rows + top + t / across;
               atomicAdd(task.overlaps.counts + line * task.overlaps.grid.columns + left + t % across,
                         static_cast<unsigned int>(count));
             }
           });
}

/// The most Gaussians that overlap on any of some tiles of a plane, and at least 1: by a warp, in every lane.
__device__ inline int FindMost(const FindTask& task, int f, const Box& tiles)
{
  const int across = tiles.columnEnd - tiles.columnBegin, down = tiles.rowEnd - tiles.rowBegin;
  int most = 1;
  for (int t = threadIdx.x % kWarp; t < (across > 0 && down > 0 ? across * down : 0); t += kWarp)
  {
    const std::size_t row = static_cast<std::size_t>(f) * task.overlaps.grid.rows + tiles.rowBegin + t / across;
    const std::size_t at = row * task.overlaps.grid.columns + tiles.columnBegin + t % across;
    most = max(most, static_cast<int>(min(task.overlaps.counts[at], 0x7fffffffu)));
  }
  return WarpMax(most);
}

/// How a plane sees a block of Gaussians.
struct PlaneOfBlock
{
  View<float> view;
  std::int32_t column, row;  // of the view's origin
  float slab;                // mm^2, see Reach
  double tolerance;          // what each Gaussian may drop
};

/// Whether a Gaussian can matter on a plane: only if mu_z^2 <= k^2 t, and t <= s_max^2 + sigma_E^2. A thousandth more
/// than the bound, so that its own rounding drops nothing.
__device__ inline bool MayMatter(const FindTask& task, const Gaussian<float>& g, const PlaneOfBlock& plane)
{
  const float squared = SquaredDistance(g, plane.view);
  if (!(squared <= plane.slab))
  {
    return false;
  }
  const float farthest = 1.001f * CutFor(MagnitudeOf(task.truncation, g), static_cast<float>(plane.tolerance));
  const float scale = std::exp(max(max(g.logScale.x, g.logScale.y), g.logScale.z));
  return squared <= farthest * (scale * scale + plane.view.elevationVariance) && farthest > 0;
}

/// The Gaussians of a block that may matter on a plane, in their order, into `list`: by a warp. Returns how many.
__device__ inline int FindCandidates(const FindTask& task, int b, const PlaneOfBlock& plane, unsigned char* list)
{
  const int lane = threadIdx.x % kWarp, present = task.field.places[b].count;
  int found = 0;
#pragma unroll
  for (int i = lane; i < kBlock; i += kWarp)
  {
    const bool may = i < present && MayMatter(task, LoadGaussian(task.field.gaussians[b], i), plane);
    const unsigned int ballot = __ballot_sync(kAllLanes, may);
    if (may)
    {
      list[found + __popc(ballot & ((1u << lane) - 1))] = static_cast<unsigned char>(i);
    }
    found += __popc(ballot);
  }
  __syncwarp();
  return found;
}

/// Writes what view f sees of block b, by a warp. Room is taken for all candidates at once; what is left of it stands
/// for nothing. `list` and `masks` are the warp's own.
__device__ inline void SeeBlock(const FindTask& task, int b, int f, const PlaneOfBlock& plane, unsigned char* list,
                                unsigned int (&masks)[kBlock / kWarp])
{
  constexpr int kNone = 0x7fffffff;
  const int lane = threadIdx.x % kWarp;
  if (lane < kBlock / kWarp)
  {
    masks[lane] = 0;
  }
  const int room = FindCandidates(task, b, plane, list);
  Seen seen{};
  if (room > 0 && lane == 0)
  {
    seen.offset = atomicAdd(task.used, static_cast<unsigned long long>(room));
  }
  seen.offset = __shfl_sync(kAllLanes, seen.offset, 0);
  const bool fits = seen.offset + room <= task.capacity;
  Box box{kNone, -kNone, kNone, -kNone};
  for (int first = 0; first < room; first += kWarp)
  {
    DeviceSplat splat;
    bool visible = false;
    if (first + lane < room)
    {
      const int i = list[first + lane];
      const Gaussian<float> gaussian = LoadGaussian(task.field.gaussians[b], i);
      visible = IsSharp(gaussian)
                    ? FindSharpSplat(task, task.cameras[task.frames[f]], b, i, plane.tolerance, splat)
                    : FindSplat(task, gaussian, plane.view, plane.column, plane.row, plane.tolerance, splat);
      splat.view = f;
      splat.reflectivity = gaussian.reflectivity;
      if (visible)
      {
        atomicOr(&masks[i / kWarp], 1u << (i % kWarp));
        box = {min(box.columnBegin, splat.box.columnBegin), max(box.columnEnd, splat.box.columnEnd),
               min(box.rowBegin, splat.box.rowBegin), max(box.rowEnd, splat.box.rowEnd)};
      }
    }
    const unsigned int ballot = __ballot_sync(kAllLanes, visible);
    if (visible && fits)
    {
      task.splats[seen.offset + seen.count + __popc(ballot & ((1u << lane) - 1))] = splat;
    }
    seen.count += __popc(ballot);
  }
  for (int k = seen.count + lane; k < room && fits; k += kWarp)
  {
    task.splats[seen.offset + k] = {};
  }
  const Box all{WarpMin(box.columnBegin), WarpMax(box.columnEnd), WarpMin(box.rowBegin), WarpMax(box.rowEnd)};
  __syncwarp();
  if (lane == 0)
  {
    for (int k = 0; k < kBlock / kWarp; ++k)
    {
      seen.mask[k] = masks[k];
    }
    task.seen[static_cast<std::size_t>(b) * task.views + f] = seen;
    task.boxes[static_cast<std::size_t>(f) * task.groups * kGroup + b] = seen.count > 0 ? all : Box{0, 0, 0, 0};
  }
  __syncwarp();
}

/// Fills seen, boxes and splats. Launched as (pairs of a block and a view / (task.pairs kFindWarps), 1) of kFindWarps
/// warps. Six thread blocks a multiprocessor: without that bound an earlier form took a fifth longer (64 slices, H100).
__global__ void __launch_bounds__(kFindWarps* kWarp, 6) FindSplats(FindTask task)
{
  __shared__ unsigned char lists[kFindWarps][kBlock];
  __shared__ unsigned int masks[kFindWarps][kBlock / kWarp];
  const int lane = threadIdx.x % kWarp, warp = threadIdx.x / kWarp;
  const std::size_t pairs = static_cast<std::size_t>(task.field.blocks) * task.views;
  const std::size_t first = (static_cast<std::size_t>(blockIdx.x) * kFindWarps + warp) * task.pairs;
  const PixelBox window{task.window.columnBegin, task.window.columnEnd, task.window.rowBegin, task.window.rowEnd};
  const std::size_t pair = first + lane;
  const bool isMine = lane < task.pairs && pair < pairs;
  const int b = static_cast<int>(isMine ? pair / task.views : 0), f = static_cast<int>(isMine ? pair % task.views : 0);
  const BlockPlace& place = task.field.places[b];
  const Camera& camera = task.cameras[task.frames[f]];
  const double logMagnitude = task.truncation.LogMagnitude(place);
  Reach reach;
  bool reached = isMine && Reaches<float>(place, camera, logMagnitude, task.truncation.logFloor, reach);
  double tolerance = task.truncation.Share(1);
  if (task.truncation.isShared)
  {
    const Box tiles = reached ? TilesOf(task.overlaps, reach.box) : Box{0, 0, 0, 0};
    ForLanes(reached,
             [&](int from)
             {
               const Box of{__shfl_sync(kAllLanes, tiles.columnBegin, from),
                            __shfl_sync(kAllLanes, tiles.columnEnd, from), __shfl_sync(kAllLanes, tiles.rowBegin, from),
                            __shfl_sync(kAllLanes, tiles.rowEnd, from)};
               const int most = FindMost(task, __shfl_sync(kAllLanes, f, from), of);
               tolerance = lane == from ? task.truncation.Share(most) : tolerance;
             });
    reached = reached && Reaches<float>(place, camera, logMagnitude, log(tolerance), reach);
  }
  reached = reached && Overlap(reach.box, window);
  const float slab = reached ? static_cast<float>(min(reach.slab, 1e30)) : 0.0f;
  if (isMine && !reached)
  {
    task.seen[pair].count = 0;
    task.boxes[static_cast<std::size_t>(f) * task.groups * kGroup + b] = {0, 0, 0, 0};
  }
  ForLanes(reached,
           [&](int from)
           {
             const int block = __shfl_sync(kAllLanes, b, from), view = __shfl_sync(kAllLanes, f, from);
             PlaneOfBlock plane;
             plane.view =
                 LocalView<float>(task.cameras[task.frames[view]], task.field.places[block], plane.column, plane.row);
             plane.slab = __shfl_sync(kAllLanes, slab, from);
             plane.tolerance = __shfl_sync(kAllLanes, tolerance, from);
             SeeBlock(task, block, view, plane, lists[warp], masks[warp]);
           });
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
