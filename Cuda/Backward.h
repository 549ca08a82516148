// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From what images want back to Gaussians: gathered, not scattered. Private to Cuda.
//
// First every splat gathers, wherever its Gaussian is: eight lanes walk a footprint (a whole warp a large one), read one
// number a pixel, keep the sums in registers and write them beside the splat. Then each Gaussian's own thread applies
// the chain rule to its splats, adds up its gradient in the order of the planes, and at the end takes Adam's step. No
// atomics on numbers, the same bits in every run.
#pragma once

#include "Forward.h"

namespace bigus::cuda
{

constexpr int kGatherThreads = 128;
constexpr int kGatherLanes = 8;
constexpr int kLargeFootprint = 4096;  // pixels of its box
constexpr int kChunk = 32;             // planes whose lists a thread block loads together

/// Sums over pixels of derivative * w * powers of eta: see Moments.
constexpr int kMoments = kMomentRows;

/// The same of one splat, in memory. Two loads of 16 bytes.
struct alignas(16) SplatMoments
{
  float sums[kMoments + 1];
};

/// Sums over a footprint's pixels by `Lanes` neighbouring lanes, in all of them: of the first `Count` moments. All
/// lanes of a warp must call it; those with nothing to do give an invalid splat.
template <int Lanes, int Count>
__device__ void GatherSplat(const DeviceSplat& s, bool valid, const float* image, int width, int height,
                            float (&moments)[kMoments])
{
  const int lane = threadIdx.x % Lanes;
  // Of the offset (u, v) from the centre; or, a pixel at a time, of eta from the start.
  float one = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0, error = 0;
  const bool recurs = s.rowFactor > 0;
  const int rowBegin = max(s.box.rowBegin, 0), rowEnd = min(s.box.rowEnd, height);
  const int columnBegin = max(s.box.columnBegin, 0), columnEnd = min(s.box.columnEnd, width);
  if (valid && recurs)
  {
    constexpr int kHalf = kRun / 2;
    const float slope = -s.u12 / s.u11;
    for (int row = rowBegin; row < rowEnd; row += kRun)
    {
      // The footprint's columns in these rows: eta1^2 <= cut - eta2^2 about the ridge u = slope v.
      const float top = static_cast<float>(row - s.row) - s.mv;
      const float bottom = static_cast<float>(min(row + kRun, rowEnd) - 1 - s.row) - s.mv;
      const float nearest = s.u22 * (top > 0 ? top : (bottom < 0 ? bottom : 0.0f));
      const float half = sqrtf(max(s.cut - nearest * nearest, 0.0f)) / s.u11;
      const float low = s.mu + min(slope * top, slope * bottom) - half;
      const float high = s.mu + max(slope * top, slope * bottom) + half;
      const auto limit = [&](float offset)
      {
        const float bounded = min(max(offset, -1e9f), 1e9f);
        return min(max(s.column + static_cast<int>(bounded), columnBegin), columnEnd);
      };
      const int end = limit(ceilf(high) + 1);
      const int start = row + kHalf;
      const float dv = static_cast<float>(start - s.row) - s.mv, middle = dv - 0.5f;
      for (int column = limit(floorf(low)) + lane; column < end; column += Lanes)
      {
        const float du = static_cast<float>(column - s.column) - s.mu;
        ColumnWalk walk(s, 1.0f, du, dv);
        const float* below = image + static_cast<std::size_t>(start) * width + column;
        float column0 = 0, column1 = 0, column2 = 0;
#pragma unroll
        for (int n = 0; n < kHalf; ++n)
        {
          const float a = start + n < rowEnd ? walk.down * below[static_cast<std::ptrdiff_t>(n) * width] : 0.0f;
          const float b = start - 1 - n < rowEnd ? walk.up * below[-static_cast<std::ptrdiff_t>(n + 1) * width] : 0.0f;
          column0 += a + b;
          if (Count > 1)
          {
            column1 += (a - b) * (n + 0.5f);
            column2 += (a + b) * ((n + 0.5f) * (n + 0.5f));
          }
          if (Count > 6)
          {
            error += fabsf(a) + fabsf(b);
          }
          walk.Step(s.rowFactor);
        }
        one += column0;
        if (Count > 1)
        {
          const float columnU = du * column0, columnV = middle * column0 + column1;
          u += columnU;
          v += columnV;
          uu += columnU * du;
          uv += columnV * du;
          vv += middle * (columnV + column1) + column2;
        }
      }
    }
  }
  else if (valid)
  {
    const double slope = s.u12 / static_cast<double>(s.u11);
    for (int row = rowBegin; row < rowEnd; ++row)
    {
      const DirectRow line(s, slope, row);
      if (!(line.rest > 0))
      {
        continue;
      }
      const double half = std::sqrt(static_cast<double>(line.rest)) / s.u11;
      const auto limit = [&](double offset)
      {
        const double column = s.column + offset;
        return static_cast<int>(min(max(column, static_cast<double>(columnBegin)), static_cast<double>(columnEnd)));
      };
      const int end = limit(floor(line.ridge + half) + 1);
      float row0 = 0, row1 = 0;
      for (int column = limit(ceil(line.ridge - half)) + lane; column < end; column += Lanes)
      {
        const float eta1 = line.Eta1(s, column);
        const float gw = line.Weight(eta1) * image[static_cast<std::size_t>(row) * width + column];
        row0 += gw;
        row1 += gw * eta1;
        uu += gw * eta1 * eta1;
        error += fabsf(gw);
      }
      one += row0;
      u += row1;
      v += row0 * line.eta2;
      uv += row1 * line.eta2;
      vv += row0 * line.eta2 * line.eta2;
    }
  }
  float sums[kMoments] = {one, u, v, uu, uv, vv, error};
#pragma unroll
  for (int m = 0; m < Count; ++m)
  {
    for (int step = Lanes / 2; step > 0; step /= 2)
    {
      sums[m] += __shfl_xor_sync(kAllLanes, sums[m], step);
    }
    moments[m] = sums[m];
  }
  if (Count > 1 && recurs)
  {
    // U, applied to the sums: eta1 = a u + b v, eta2 = e v.
    const float a = s.u11, b = s.u12, e = s.u22;
    moments[1] = a * sums[1] + b * sums[2];
    moments[2] = e * sums[2];
    moments[3] = a * a * sums[3] + 2 * a * b * sums[4] + b * b * sums[5];
    moments[4] = e * (a * sums[4] + b * sums[5]);
    moments[5] = e * e * sums[5];
  }
}

struct GatherTask
{
  Lists lists;
  const float* images;  // [views][height][width] dL/dS
  int width, height;
  SplatMoments* moments;  // [capacity]
};

/// Launched as (any number, 1) of kGatherThreads: a team of lanes takes one splat after another.
template <int Count>
__global__ void __launch_bounds__(kGatherThreads, 8) GatherMoments(GatherTask task)
{
  constexpr std::size_t kTeams = kGatherThreads / kGatherLanes;
  const std::size_t used = *task.lists.used, all = used <= task.lists.capacity ? used : 0;
  const int lane = threadIdx.x % kWarp;
  const auto gather = [&](auto lanes, std::size_t at, bool valid)
  {
    constexpr int kLanes = decltype(lanes)::value;
    const DeviceSplat& s = task.lists.splats[at];
    const float* image = task.images + static_cast<std::size_t>(valid ? s.view : 0) * task.width * task.height;
    float sums[kMoments] = {};
    GatherSplat<kLanes, Count>(s, valid, image, task.width, task.height, sums);
    if (valid && lane % kLanes == 0)
    {
      SplatMoments out{};
#pragma unroll
      for (int m = 0; m < Count; ++m)
      {
        out.sums[m] = sums[m];
      }
      task.moments[at] = out;
    }
  };
  for (std::size_t first = blockIdx.x * kTeams; first < all; first += gridDim.x * kTeams)
  {
    const std::size_t k = first + threadIdx.x / kGatherLanes;
    const Box box = task.lists.splats[min(k, all - 1)].box;
    const bool valid = k < all && box.columnEnd > box.columnBegin;  // else room that was not needed
    const bool large =
        valid &&
        static_cast<std::int64_t>(box.columnEnd - box.columnBegin) * (box.rowEnd - box.rowBegin) > kLargeFootprint;
    gather(std::integral_constant<int, kGatherLanes>(), min(k, all - 1), valid && !large);
    ForLanes(large && lane % kGatherLanes == 0, [&](int from)
             { gather(std::integral_constant<int, kWarp>(), k - lane / kGatherLanes + from / kGatherLanes, true); });
  }
}

/// Where Gaussian i is in a list, or -1.
__device__ inline int RankIn(const Seen& seen, int i)
{
  if (!(seen.mask[i / kWarp] >> (i % kWarp) & 1))
  {
    return -1;
  }
  int rank = __popc(seen.mask[i / kWarp] & ((1u << (i % kWarp)) - 1));
  for (int k = 0; k < i / kWarp; ++k)
  {
    rank += __popc(seen.mask[k]);
  }
  return rank;
}

struct BackwardTask
{
  Lists lists;
  const SplatMoments* moments;  // [capacity] what GatherMoments left
  Field field;
  const Camera* cameras;
  const int* frames;  // [views]
  const StepParameters* parameters;
  AdamBlock<float>* adam;          // [blocks] a step is taken; or null
  GradientBlock<float>* gradient;  // [blocks] the gradient is stored; or null
  ScoreBlock<float>* scores;       // [blocks] or null
  unsigned long long* guarded;     // updates that were guarded, see Engine
};

/// The smallest and the largest over a block's Gaussians of `value`, of which the calling thread has one: in every
/// thread of the thread block. `room` is shared.
__device__ inline void Extremes(float value, bool present, float (&room)[2][kBlock / kWarp], float& low, float& high)
{
  float least = present ? value : HUGE_VALF, most = present ? value : -HUGE_VALF;
  for (int step = kWarp / 2; step > 0; step /= 2)
  {
    least = min(least, __shfl_xor_sync(kAllLanes, least, step));
    most = max(most, __shfl_xor_sync(kAllLanes, most, step));
  }
  __syncthreads();
  if (threadIdx.x % kWarp == 0)
  {
    room[0][threadIdx.x / kWarp] = least;
    room[1][threadIdx.x / kWarp] = most;
  }
  __syncthreads();
  low = room[0][0];
  high = room[1][0];
  for (int k = 1; k < kBlock / kWarp; ++k)
  {
    low = min(low, room[0][k]);
    high = max(high, room[1][k]);
  }
}

/// Brings a block's place up to date with its Gaussians, by a thread block of kBlock.
__device__ inline void Measure(const Gaussian<float>& g, BlockPlace& place)
{
  __shared__ float room[2][kBlock / kWarp];
  const bool present = static_cast<int>(threadIdx.x) < place.count;
  BlockPlace changed = place;
  const auto range = [&](float value, double centre, double& middle, double& half)
  {
    float low, high;
    Extremes(value, present, room, low, high);
    middle = centre + 0.5 * (static_cast<double>(low) + static_cast<double>(high));
    half = 0.5 * (static_cast<double>(high) - static_cast<double>(low));
  };
  range(g.mean.x, place.centre.x, changed.middle.x, changed.half.x);
  range(g.mean.y, place.centre.y, changed.middle.y, changed.half.y);
  range(g.mean.z, place.centre.z, changed.middle.z, changed.half.z);
  float low, high;
  Extremes(max(max(g.logScale.x, g.logScale.y), g.logScale.z), present, room, low, high);
  changed.variance = exp(2.0 * static_cast<double>(high));
  Extremes(std::abs(g.reflectivity), present, room, low, high);
  changed.logMagnitude = log(static_cast<double>(high));  // of 0: -infinity, never seen
  if (threadIdx.x == 0)
  {
    place = changed;
  }
}

/// Launched as (blocks, 1) of kBlock threads.
__global__ void __launch_bounds__(kBlock) MeasureBlocks(Field field)
{
  Measure(LoadGaussian(field.gaussians[blockIdx.x], threadIdx.x), field.places[blockIdx.x]);
}

__device__ inline void StoreGaussian(const Gaussian<float>& g, GaussianBlock<float>& block, int i)
{
  block.mean[0][i] = g.mean.x;
  block.mean[1][i] = g.mean.y;
  block.mean[2][i] = g.mean.z;
  block.logScale[0][i] = g.logScale.x;
  block.logScale[1][i] = g.logScale.y;
  block.logScale[2][i] = g.logScale.z;
  for (int k = 0; k < 4; ++k)
  {
    block.rotation[k][i] = g.rotation[k];
  }
  block.reflectivity[i] = g.reflectivity;
}

/// Adam's step for Gaussian i. Returns 1 when the gradient had to be guarded against.
__device__ inline int Update(Gaussian<float>& gaussian, AdamBlock<float>& block, int i,
                             const GaussianGradient<float>& gradient, const AdamStep& step)
{
  AdamState<float> state;
#pragma unroll
  for (int k = 0; k < kParametersPerGaussian; ++k)
  {
    state.first[k] = block.first[k][i];
    state.second[k] = block.second[k][i];
  }
  state.updates = block.updates[i];
  const float bad = UpdateGaussian(gaussian, state, gradient, step);
#pragma unroll
  for (int k = 0; k < kParametersPerGaussian; ++k)
  {
    block.first[k][i] = state.first[k];
    block.second[k][i] = state.second[k];
  }
  block.updates[i] = state.updates;
  return bad > 0;
}

/// The end of a step for one block, by the threads that have its Gaussians: Adam, and the block's new place.
__device__ inline void Spend(Gaussian<float>& gaussian, const GaussianGradient<float>& gradient, bool visited,
                             const Field& field, AdamBlock<float>* adam, const AdamStep& step,
                             unsigned long long* guarded)
{
  const int b = blockIdx.x, i = threadIdx.x;
  if (visited)
  {
    if (Update(gaussian, adam[b], i, gradient, step))
    {
      atomicAdd(guarded, 1ull);
    }
    StoreGaussian(gaussian, field.gaussians[b], i);
  }
  if (!__syncthreads_or(visited))
  {
    return;
  }
  Measure(gaussian, field.places[b]);
  if (i == 0)
  {
    field.sharpSlots[b] = -1;  // from now on what is in float is all there is
  }
}

/// Launched as (blocks, 1) of kBlock threads.
__global__ void __launch_bounds__(kBlock) Backward(BackwardTask task)
{
  __shared__ View<float> views[kChunk];
  __shared__ Seen seen[kChunk];
  if (*task.lists.used > task.lists.capacity)
  {
    return;
  }
  const int b = blockIdx.x, i = threadIdx.x;
  const bool present = i < task.field.places[b].count;
  Gaussian<float> gaussian = LoadGaussian(task.field.gaussians[b], i);
  GaussianGradient<float> gradient{};
  float error = 0, visits = 0;
  for (int first = 0; first < task.lists.views; first += kChunk)
  {
    const int count = min(kChunk, task.lists.views - first);
    __syncthreads();
    if (i < count)
    {
      const Seen& list = task.lists.seen[static_cast<std::size_t>(b) * task.lists.views + first + i];
      seen[i].count = 0;
      if (list.count > 0)
      {
        seen[i] = list;  // of a plane that sees nothing, only the count was written
        std::int32_t column, row;
        views[i] = LocalView<float>(task.cameras[task.frames[first + i]], task.field.places[b], column, row);
      }
    }
    __syncthreads();
    for (int j = 0; j < count; ++j)
    {
      const int k = present && seen[j].count > 0 ? RankIn(seen[j], i) : -1;
      if (k < 0)
      {
        continue;
      }
      const SplatMoments m = task.moments[seen[j].offset + k];
      const Moments<float> moments{m.sums[kMoment0],
                                   m.sums[kMoment1],
                                   m.sums[kMoment2],
                                   m.sums[kMoment11],
                                   m.sums[kMoment12],
                                   m.sums[kMoment22],
                                   0.0f};
      const GaussianGradient<float> g = ProjectAdjoint(gaussian, Project(gaussian, views[j]), moments);
      gradient.mean = MultiplyAdd(1.0f, g.mean, gradient.mean);
      gradient.logScale = MultiplyAdd(1.0f, g.logScale, gradient.logScale);
      gradient.rotation = MultiplyAdd(1.0f, g.rotation, gradient.rotation);
      gradient.reflectivity += g.reflectivity;
      visits += 1;
      error += task.scores ? m.sums[kMomentError] : 0.0f;
    }
  }
  const bool visited = visits > 0;
  if (task.gradient)
  {
    GradientBlock<float>& out = task.gradient[b];
    float values[kParametersPerGaussian];
    ToArray(gradient, values);
#pragma unroll
    for (int k = 0; k < kParametersPerGaussian; ++k)
    {
      out.values[k][i] = values[k];
    }
    out.visits[i] = visits;
  }
  if (task.scores && visited)
  {
    ScoreBlock<float>& out = task.scores[b];
    out.error[i] += error;
    out.descent[0][i] -= gradient.mean.x;
    out.descent[1][i] -= gradient.mean.y;
    out.descent[2][i] -= gradient.mean.z;
    out.visits[i] += visits;
  }
  if (task.adam)
  {
    Spend(gaussian, gradient, visited, task.field, task.adam, task.parameters->adam, task.guarded);
  }
}

/// A step along a stored gradient. Launched as Backward.
__global__ void __launch_bounds__(kBlock) TakeStep(BackwardTask task)
{
  const int b = blockIdx.x, i = threadIdx.x;
  const GradientBlock<float>& in = task.gradient[b];
  Gaussian<float> gaussian = LoadGaussian(task.field.gaussians[b], i);
  float values[kParametersPerGaussian];
#pragma unroll
  for (int k = 0; k < kParametersPerGaussian; ++k)
  {
    values[k] = in.values[k][i];
  }
  const GaussianGradient<float> gradient = FromArray(values);
  const bool visited = i < task.field.places[b].count && in.visits[i] > 0;
  Spend(gaussian, gradient, visited, task.field, task.adam, task.parameters->adam, task.guarded);
}

}  // namespace bigus::cuda
