// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From footprints to images, and what training makes of them. Private to Cuda.
//
// The warps of a thread block render a tile of 16 x 16 pixels together: each adds every fourth block of Gaussians to
// sums of its own, which are added up at the end. A lane has a column of 8 rows, so that a recurrence replaces seven of
// eight exponentials. Splats come in the order of their blocks, so sums are the same bits in every run; each pixel is
// written once.
#pragma once

#include "Core/Formula/Adam.h"
#include "Core/Formula/PixelLoss.h"
#include "FindSplats.h"

namespace bigus::cuda
{

/// What FindSplats found.
struct Lists
{
  int views, groups;
  const Seen* seen;
  const Box* boxes;
  const Box* groupBoxes;
  const DeviceSplat* splats;
  const unsigned long long* used;  // more than capacity: there was no room, and nothing must be made of it
  unsigned long long capacity;
};

/// What footprints are multiplied with: their Gaussians' reflectivity, or 1.
struct OwnReflectivity
{
  __device__ float operator()(const DeviceSplat& s) const { return s.reflectivity; }
};
struct One
{
  __device__ float operator()(const DeviceSplat&) const { return 1.0f; }
};

/// p / q to two roundings.
__device__ inline float Divide(float p, float q)
{
#if defined(__CUDA_ARCH__)
  return __fdividef(p, q);
#else
  return p / q;
#endif
}

/// Whether the ellipse |U (p - m)|^2 <= cut meets a tile: exact. Where the centre is outside, the tile's point
/// that is nearest in this metric lies on an edge that faces the centre.
__device__ inline bool Touches(const DeviceSplat& s, const Box& tile)
{
  if (!Meet(s.box, tile))
  {
    return false;
  }
  const float left = static_cast<float>(tile.columnBegin - s.column) - s.mu;
  const float right = static_cast<float>(tile.columnEnd - 1 - s.column) - s.mu;
  const float top = static_cast<float>(tile.rowBegin - s.row) - s.mv;
  const float bottom = static_cast<float>(tile.rowEnd - 1 - s.row) - s.mv;
  const float u = left > 0 ? left : (right < 0 ? right : 0.0f), v = top > 0 ? top : (bottom < 0 ? bottom : 0.0f);
  if (u == 0 && v == 0)
  {
    return true;
  }
  const auto squared = [&](float du, float dv)
  {
    const float eta1 = s.u11 * du + s.u12 * dv, eta2 = s.u22 * dv;
    return eta1 * eta1 + eta2 * eta2;
  };
  float nearest = kWholeCut<float> * 2;
  if (u != 0)
  {
    const float best = Divide(-s.u11 * s.u12 * u, s.u12 * s.u12 + s.u22 * s.u22);
    nearest = squared(u, min(max(best, top), bottom));
  }
  if (v != 0)
  {
    nearest = min(nearest, squared(min(max(Divide(-s.u12 * v, s.u11), left), right), v));
  }
  // A thousandth more, so that rounding drops nothing. A needle's products cancel: its box must do.
  return nearest <= 1.001f * s.cut || s.rowFactor == 0;
}

/// w at a pixel by an exponential; 0 outside the footprint. The ridge, where eta1 = 0, is found in double: along a
/// needle u11 du and u12 dv are large and cancel.
struct DirectRow
{
  float eta2, rest, constant;
  double ridge;  // columns from the centre's pixel

  /// `slope` is u12 / u11.
  __device__ DirectRow(const DeviceSplat& s, double slope, int row)
  {
    const double dv = static_cast<double>(row - s.row) - s.mv;
    eta2 = static_cast<float>(s.u22 * dv);
    rest = s.cut - eta2 * eta2;
    constant = s.logAmplitude - 0.5f * eta2 * eta2;
    ridge = s.mu - slope * dv;
  }
  __device__ float Eta1(const DeviceSplat& s, int column) const
  {
    return s.u11 * static_cast<float>(static_cast<double>(column - s.column) - ridge);
  }
  __device__ float Weight(float eta1) const { return eta1 * eta1 <= rest ? Exp(constant - 0.5f * eta1 * eta1) : 0.0f; }
};

/// Recurrence. Along a column, one row further down,
///
///     w <- w q,   q <- q c,   q = exp(ln w(v + 1) - ln w(v)),   c = exp(-(u12^2 + u22^2)),
///
/// and upwards with c / q instead of q. Started in the middle of a run, it takes kRun / 2 steps each way: the
/// relative error stays within some ten roundings.
struct ColumnWalk
{
  float down, downRatio, up, upRatio;

  /// Of the column at du from the centre; `dv` is the row `start` from the centre, the first one down.
  __device__ ColumnWalk(const DeviceSplat& s, float value, float du, float dv)
  {
    const float eta1 = s.u11 * du + s.u12 * dv, eta2 = s.u22 * dv;
    const float exponent = s.logAmplitude - 0.5f * (eta1 * eta1 + eta2 * eta2);
    const float curvature = s.u12 * s.u12 + s.u22 * s.u22;
    const float logRatio = -(s.u12 * eta1 + s.u22 * eta2) - 0.5f * curvature;
    // Where w matters it does not underflow (see FindSplat). Elsewhere its ratios may overflow, and stand for nothing.
    const float bounded = exponent > kLowestExponent<float> ? logRatio : 0.0f;
    const float ratio = Exp(-curvature - bounded);
    down = value * Exp(exponent);
    downRatio = Exp(bounded);
    up = down * ratio;
    upRatio = ratio * s.rowFactor;
  }
  __device__ void Step(float c)
  {
    down *= downRatio;
    downRatio *= c;
    up *= upRatio;
    upRatio *= c;
  }
};

constexpr int kForwardWarps = 4;
constexpr int kRowsOfWarp = kRun / kForwardWarps;

/// A lane's pixels: rows [row, row + kRun) of a column.
struct Strip
{
  int column, row;

  __device__ explicit Strip(const Box& tile)
      : column(tile.columnBegin + static_cast<int>(threadIdx.x) % kTileSide),
        row(tile.rowBegin + static_cast<int>(threadIdx.x) % kWarp / kTileSide * kRun)
  {
  }
  /// The first of the rows that the calling lane has at the end, see AddUp.
  __device__ int OwnRow() const { return row + static_cast<int>(threadIdx.x) / kWarp * kRowsOfWarp; }
};

__device__ inline void AddSplat(const DeviceSplat& s, float value, const Strip& strip, float (&sums)[kRun])
{
  if (s.rowFactor > 0)
  {
    constexpr int kHalf = kRun / 2;
    ColumnWalk walk(s, value, static_cast<float>(strip.column - s.column) - s.mu,
                    static_cast<float>(strip.row + kHalf - s.row) - s.mv);
#pragma unroll
    for (int n = 0; n < kHalf; ++n)
    {
      sums[kHalf + n] += walk.down;
      sums[kHalf - 1 - n] += walk.up;
      walk.Step(s.rowFactor);
    }
    return;
  }
  const double slope = s.u12 / static_cast<double>(s.u11);
#pragma unroll
  for (int n = 0; n < kRun; ++n)
  {
    const DirectRow line(s, slope, strip.row + n);
    sums[n] += value * line.Weight(line.Eta1(s, strip.column));
  }
}

/// Adds what a view sees of the calling warp's share of the blocks to its sums of a tile. Of each group that meets the
/// tile a warp has every kForwardWarps'th block, so it tests those of several groups together.
template <class Values>
__device__ void AddTile(const Lists& lists, const Values& values, int view, const Box& tile, const Strip& strip,
                        float (&sums)[kRun])
{
  constexpr int kShare = kGroup / kForwardWarps;
  const int lane = threadIdx.x % kWarp, warp = threadIdx.x / kWarp;
  const Box* groupBoxes = lists.groupBoxes + static_cast<std::size_t>(view) * lists.groups;
  const Box* boxes = lists.boxes + static_cast<std::size_t>(view) * lists.groups * kGroup;
  for (int firstGroup = 0; firstGroup < lists.groups; firstGroup += kWarp)
  {
    const int ownGroup = firstGroup + lane;
    unsigned int met =
        __ballot_sync(kAllLanes, ownGroup < lists.groups && Meet(groupBoxes[min(ownGroup, lists.groups - 1)], tile));
    while (met != 0)
    {
      int block = -1;
      for (int k = 0; k < kWarp / kShare && met != 0; ++k, met &= met - 1)
      {
        if (lane / kShare == k)
        {
          block = (firstGroup + __ffs(static_cast<int>(met)) - 1) * kGroup + lane % kShare * kForwardWarps + warp;
        }
      }
      ForLanes(block >= 0 && Meet(boxes[max(block, 0)], tile),
               [&](int from)
               {
                 const std::size_t of = __shfl_sync(kAllLanes, block, from);
                 const Seen& seen = lists.seen[of * lists.views + view];
                 const DeviceSplat* splats = lists.splats + seen.offset;
                 for (int first = 0; first < seen.count; first += kWarp)
                 {
                   ForLanes(first + lane < seen.count && Touches(splats[first + lane], tile),
                            [&](int k)
                            {
                              const DeviceSplat& s = splats[first + k];
                              AddSplat(s, values(s), strip, sums);
                            });
                 }
               });
    }
  }
}

/// The tiles of a window of pixels; tiles are counted from pixel (0, 0) of the plane, so that what a pixel gets
/// does not depend on the window.
struct Tiles
{
  int columnBegin, rowBegin, columns, rows;  // in tiles

  __device__ Box At(int tile) const
  {
    const int column = (columnBegin + tile % columns) * kTileSide, row = (rowBegin + tile / columns) * kTileSide;
    return {column, column + kTileSide, row, row + kTileSide};
  }
  std::size_t Count() const { return static_cast<std::size_t>(columns) * rows; }
};

/// The sums of a tile's warps, in their order: of rows [kRowsOfWarp w, kRowsOfWarp (w + 1)) of its strip for a lane of
/// warp w. By the whole thread block.
__device__ inline void AddUp(const float (&sums)[kRun], float (&totals)[kRowsOfWarp])
{
  __shared__ float parts[kForwardWarps][kRun][kWarp];
  const int lane = threadIdx.x % kWarp, warp = threadIdx.x / kWarp;
  __syncthreads();  // an earlier call's have been read
#pragma unroll
  for (int n = 0; n < kRun; ++n)
  {
    parts[warp][n][lane] = sums[n];
  }
  __syncthreads();
#pragma unroll
  for (int n = 0; n < kRowsOfWarp; ++n)
  {
    totals[n] = 0;
    for (int k = 0; k < kForwardWarps; ++k)
    {
      totals[n] += parts[k][kRowsOfWarp * warp + n][lane];
    }
  }
}

/// I of a pixel that scatters s.
__device__ inline float ToIntensity(float gamma, float s)
{
  return -expm1f(-gamma * max(s, 0.0f));
}

struct RenderTask
{
  Lists lists;
  Tiles tiles;
  Box window;      // pixels wanted
  bool intensity;  // I instead of S
  float gamma;
  float* image;     // [views][rows][columns] of the window
  float* coverage;  // the same, or null
};

/// Launched as (tiles, views) of kForwardWarps warps.
__global__ void __launch_bounds__(kForwardWarps* kWarp) RenderTiles(RenderTask task)
{
  if (*task.lists.used > task.lists.capacity)
  {
    return;  // there was no room for the splats
  }
  const int view = blockIdx.y;
  const Box box = task.tiles.At(blockIdx.x);
  const Strip strip(box);
  float sums[kRun] = {}, totals[kRowsOfWarp], weights[kRowsOfWarp] = {};
  if (task.coverage)
  {
    AddTile(task.lists, One(), view, box, strip, sums);
    AddUp(sums, weights);
    for (float& sum : sums)
    {
      sum = 0;
    }
  }
  AddTile(task.lists, OwnReflectivity(), view, box, strip, sums);
  AddUp(sums, totals);
  const Box& window = task.window;
  const std::size_t columns = window.columnEnd - window.columnBegin, rows = window.rowEnd - window.rowBegin;
#pragma unroll
  for (int n = 0; n < kRowsOfWarp; ++n)
  {
    const int column = strip.column - window.columnBegin, row = strip.OwnRow() + n - window.rowBegin;
    if (column < 0 || row < 0 || column >= static_cast<int>(columns) || row >= static_cast<int>(rows))
    {
      continue;
    }
    const std::size_t pixel = (view * rows + row) * columns + column;
    task.image[pixel] = task.intensity ? ToIntensity(task.gamma, totals[n]) : totals[n];
    if (task.coverage)
    {
      task.coverage[pixel] = weights[n];
    }
  }
}

/// The frames of a sweep on the device, in the type they came in.
struct Frames
{
  int width, height;
  const std::uint8_t* bytes;    // [frames][height][width], or null
  const float* floats;          // the same where bytes is null
  const std::uint8_t* counted;  // [height][width] 1 where a pixel has a part in the loss; null: everywhere

  __device__ float Truth(int frame, std::size_t pixel) const
  {
    const std::size_t at = static_cast<std::size_t>(frame) * width * height + pixel;
    return bytes ? static_cast<float>(bytes[at]) * (1.0f / 255.0f) : floats[at];
  }
  __device__ float Counts(std::size_t pixel) const { return !counted || counted[pixel] ? 1.0f : 0.0f; }
};

/// What changes from one training step to the next: kept on the device, so that a recorded step can be repeated.
struct StepParameters
{
  AdamStep adam{LearningRates(), ParameterLimits()};
  float l1 = 0, l2 = 0;
  float gamma = 1;
  float share = 0;  // of one pixel in the loss
};

/// Sums of `Sum` over the calling warp, in its first lane; the order is fixed.
template <class Sum>
__device__ Sum WarpSum(Sum value)
{
  for (int step = kWarp / 2; step > 0; step /= 2)
  {
    value += __shfl_xor_sync(kAllLanes, value, step);
  }
  return value;
}

/// The sum over a thread block of so many threads, in its first one; the order is fixed. All must call, and once.
template <int Threads>
__device__ double BlockSum(double value)
{
  __shared__ double parts[Threads / kWarp];
  value = WarpSum(value);
  if (threadIdx.x % kWarp == 0)
  {
    parts[threadIdx.x / kWarp] = value;
  }
  __syncthreads();
  double sum = 0;
  for (int k = 0; k < (threadIdx.x == 0 ? Threads / kWarp : 0); ++k)
  {
    sum += parts[k];
  }
  return sum;
}

struct TrainTask
{
  Lists lists;
  Tiles tiles;
  const int* frames;  // [views]
  Frames sweep;
  const StepParameters* parameters;
  bool derivative;  // at once, where the loss is of single pixels; else S
  float* images;    // [views][height][width] dL/dS, or S
  double* losses;   // [views][tiles]
};

/// Renders frames, and with a loss of single pixels what is to be propagated back. Launched as RenderTiles.
__global__ void __launch_bounds__(kForwardWarps* kWarp) TrainTiles(TrainTask task)
{
  if (*task.lists.used > task.lists.capacity)
  {
    return;  // there was no room for the splats
  }
  const int view = blockIdx.y, frame = task.frames[view];
  const Box box = task.tiles.At(blockIdx.x);
  const Strip strip(box);
  float sums[kRun] = {}, totals[kRowsOfWarp];
  AddTile(task.lists, OwnReflectivity(), view, box, strip, sums);
  AddUp(sums, totals);
  const StepParameters& p = *task.parameters;
  const int width = task.sweep.width, height = task.sweep.height;
  double loss = 0;
#pragma unroll
  for (int n = 0; n < kRowsOfWarp; ++n)
  {
    const int row = strip.OwnRow() + n;
    if (strip.column >= width || row >= height)
    {
      continue;
    }
    const std::size_t pixel = static_cast<std::size_t>(row) * width + strip.column;
    const std::size_t at = static_cast<std::size_t>(view) * width * height + pixel;
    float value = totals[n];
    if (task.derivative)
    {
      const PixelLoss<float> result = EvaluateLoss(p.l1, p.l2, p.gamma, value, task.sweep.Truth(frame, pixel),
                                                   p.share * task.sweep.Counts(pixel), 0.0f);
      value = result.derivative;
      loss += result.loss;
    }
    task.images[at] = value;
  }
  if (task.derivative)
  {
    loss = BlockSum<kForwardWarps * kWarp>(loss);
    if (threadIdx.x == 0)
    {
      task.losses[static_cast<std::size_t>(view) * task.tiles.columns * task.tiles.rows + blockIdx.x] = loss;
    }
  }
}

/// Where a loss looks at whole images: I of every pixel first ...
struct PixelTask
{
  const int* frames;
  Frames sweep;
  const StepParameters* parameters;
  float* images;        // [views][height][width] S; becomes dL/dS
  float* intensities;   // the same, I
  const float* others;  // the same, dL/dI of the terms that look at whole images
  double* losses;       // [views][thread blocks]
};

constexpr int kPixelThreads = 256;

/// Launched as (pixels / kPixelThreads, views).
__global__ void __launch_bounds__(kPixelThreads) ToIntensities(PixelTask task)
{
  const std::size_t pixels = static_cast<std::size_t>(task.sweep.width) * task.sweep.height;
  const std::size_t pixel = static_cast<std::size_t>(blockIdx.x) * kPixelThreads + threadIdx.x;
  if (pixel >= pixels)
  {
    return;
  }
  const std::size_t at = blockIdx.y * pixels + pixel;
  task.intensities[at] = ToIntensity(task.parameters->gamma, task.images[at]);
}

/// ... and then what is to be propagated back. Launched as ToIntensities.
__global__ void __launch_bounds__(kPixelThreads) ToDerivatives(PixelTask task)
{
  const std::size_t pixels = static_cast<std::size_t>(task.sweep.width) * task.sweep.height;
  const std::size_t pixel = static_cast<std::size_t>(blockIdx.x) * kPixelThreads + threadIdx.x;
  double loss = 0;
  if (pixel < pixels)
  {
    const StepParameters& p = *task.parameters;
    const std::size_t at = blockIdx.y * pixels + pixel;
    const int frame = task.frames[blockIdx.y];
    const PixelLoss<float> value = EvaluateLoss(p.l1, p.l2, p.gamma, task.images[at], task.sweep.Truth(frame, pixel),
                                                p.share * task.sweep.Counts(pixel), task.others[at]);
    task.images[at] = value.derivative;
    loss = value.loss;
  }
  loss = BlockSum<kPixelThreads>(loss);
  if (threadIdx.x == 0)
  {
    task.losses[static_cast<std::size_t>(blockIdx.y) * gridDim.x + blockIdx.x] = loss;
  }
}

constexpr int kSumThreads = 256;

/// out = the sum of in[0, count), always in the same order. Launched as one thread block of kSumThreads.
__global__ void __launch_bounds__(kSumThreads) SumInOrder(const double* in, std::size_t count, double* out)
{
  double sum = 0;
  for (std::size_t i = threadIdx.x; i < count; i += kSumThreads)
  {
    sum += in[i];
  }
  sum = BlockSum<kSumThreads>(sum);
  if (threadIdx.x == 0)
  {
    *out = sum;
  }
}

}  // namespace bigus::cuda
