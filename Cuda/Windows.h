// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The terms of a loss that look at windows of 11 x 11 pixels: DSSIM and contrast. Private to Cuda.
//
// A thread block takes 16 x 16 windows with the 26 x 26 pixels they see, filters along rows and then down columns,
// and leaves three slopes a window; a second kernel brings the slopes back to pixels the same way. See ImageLoss.
#pragma once

#include "Core/Formula/WindowLoss.h"
#include "Forward.h"

namespace bigus::cuda
{

constexpr int kWindowSide = 16;
constexpr int kWindowThreads = kWindowSide * kWindowSide;
constexpr int kSeenSide = kWindowSide + kSsimTaps - 1;

struct WindowTask
{
  const int* frames;  // [views]
  Frames sweep;
  float kernel[kSsimTaps];
  float dssim, contrast;
  float share;                  // of one window in the loss
  const std::uint8_t* windows;  // [down][across] by their first pixel, 1 where a window counts; null: all do
  int across, down;             // windows
  const float* intensities;     // [views][height][width]
  float* slopes;                // [views][3][down][across]
  float* others;                // [views][height][width] dL/dI
  double* losses;               // [views][thread blocks]
};

/// One row of kSeenSide numbers filtered to kWindowSide.
__device__ inline float FilterAt(const float (&kernel)[kSsimTaps], const float* in, int step)
{
  float sum = kernel[kSsimRadius] * in[kSsimRadius * step];
  for (int t = 0; t < kSsimRadius; ++t)
  {
    sum += kernel[t] * (in[t * step] + in[(kSsimTaps - 1 - t) * step]);
  }
  return sum;
}

/// Launched as (thread blocks of windows, views) of kWindowThreads.
__global__ void __launch_bounds__(kWindowThreads) FindSlopes(WindowTask task)
{
  __shared__ float image[kSeenSide * kSeenSide], truth[kSeenSide * kSeenSide];
  __shared__ float rows[5][kSeenSide * kWindowSide];
  const int wide = (task.across + kWindowSide - 1) / kWindowSide;
  const int left = static_cast<int>(blockIdx.x) % wide * kWindowSide;
  const int top = static_cast<int>(blockIdx.x) / wide * kWindowSide;
  const int width = task.sweep.width, height = task.sweep.height, frame = task.frames[blockIdx.y];
  const std::size_t first = blockIdx.y * static_cast<std::size_t>(width) * height;
  for (int k = threadIdx.x; k < kSeenSide * kSeenSide; k += kWindowThreads)
  {
    const int column = left + k % kSeenSide, row = top + k / kSeenSide;
    const bool inside = column < width && row < height;
    const std::size_t pixel = static_cast<std::size_t>(row) * width + column;
    image[k] = inside ? task.intensities[first + pixel] : 0.0f;
    truth[k] = inside ? task.sweep.Truth(frame, pixel) : 0.0f;
  }
  __syncthreads();
  for (int k = threadIdx.x; k < kSeenSide * kWindowSide; k += kWindowThreads)
  {
    const int from = k / kWindowSide * kSeenSide + k % kWindowSide;
    float x[kSsimTaps], y[kSsimTaps], product[kSsimTaps];
    for (int t = 0; t < kSsimTaps; ++t)
    {
      x[t] = image[from + t];
      y[t] = truth[from + t];
    }
    rows[0][k] = FilterAt(task.kernel, x, 1);
    rows[1][k] = FilterAt(task.kernel, y, 1);
    for (int t = 0; t < kSsimTaps; ++t)
    {
      product[t] = x[t] * x[t];
    }
    rows[2][k] = FilterAt(task.kernel, product, 1);
    for (int t = 0; t < kSsimTaps; ++t)
    {
      product[t] = y[t] * y[t];
    }
    rows[3][k] = FilterAt(task.kernel, product, 1);
    for (int t = 0; t < kSsimTaps; ++t)
    {
      product[t] = x[t] * y[t];
    }
    rows[4][k] = FilterAt(task.kernel, product, 1);
  }
  __syncthreads();
  const int column = left + static_cast<int>(threadIdx.x) % kWindowSide;
  const int row = top + static_cast<int>(threadIdx.x) / kWindowSide;
  double loss = 0;
  if (column < task.across && row < task.down)
  {
    float mean[5];
    for (int m = 0; m < 5; ++m)
    {
      mean[m] = FilterAt(task.kernel, rows[m] + threadIdx.x, kWindowSide);
    }
    const std::size_t window = static_cast<std::size_t>(row) * task.across + column;
    const float share = !task.windows || task.windows[window] ? task.share : 0.0f;
    WindowLoss<float> result{0, 0, 0, 0};
    if (task.dssim > 0)
    {
      AddDssim(task.dssim * share, mean[0], mean[1], mean[2], mean[3], mean[4], result);
    }
    if (task.contrast > 0)
    {
      AddContrast(task.contrast * share, mean[0], mean[1], mean[2], mean[3], result);
    }
    const std::size_t plane = static_cast<std::size_t>(task.across) * task.down;
    float* slopes = task.slopes + blockIdx.y * 3 * plane + window;
    slopes[0] = result.slopeX;
    slopes[plane] = result.slopeXX;
    slopes[2 * plane] = result.slopeXY;
    loss = result.value;
  }
  loss = BlockSum<kWindowThreads>(loss);
  if (threadIdx.x == 0)
  {
    task.losses[static_cast<std::size_t>(blockIdx.y) * gridDim.x + blockIdx.x] = loss;
  }
}

/// Every pixel from the windows it lies in: dL/dx = sum_windows kernel (dL/dmx + 2 x dL/dmxx + y dL/dmxy). Launched
/// as (thread blocks of pixels, views) of kWindowThreads.
__global__ void __launch_bounds__(kWindowThreads) SpreadSlopes(WindowTask task)
{
  __shared__ float slopes[3][kSeenSide * kSeenSide];
  __shared__ float rows[3][kSeenSide * kWindowSide];
  const int width = task.sweep.width, height = task.sweep.height, frame = task.frames[blockIdx.y];
  const int wide = (width + kWindowSide - 1) / kWindowSide;
  const int left = static_cast<int>(blockIdx.x) % wide * kWindowSide;
  const int top = static_cast<int>(blockIdx.x) / wide * kWindowSide;
  const std::size_t plane = static_cast<std::size_t>(task.across) * task.down;
  for (int k = threadIdx.x; k < kSeenSide * kSeenSide; k += kWindowThreads)
  {
    const int column = left + k % kSeenSide - (kSsimTaps - 1), row = top + k / kSeenSide - (kSsimTaps - 1);
    const bool inside = column >= 0 && column < task.across && row >= 0 && row < task.down;
    const std::size_t window = static_cast<std::size_t>(inside ? row : 0) * task.across + (inside ? column : 0);
    for (int m = 0; m < 3; ++m)
    {
      slopes[m][k] = inside ? task.slopes[(blockIdx.y * 3 + m) * plane + window] : 0.0f;
    }
  }
  __syncthreads();
  for (int k = threadIdx.x; k < kSeenSide * kWindowSide; k += kWindowThreads)
  {
    for (int m = 0; m < 3; ++m)
    {
      rows[m][k] = FilterAt(task.kernel, slopes[m] + k / kWindowSide * kSeenSide + k % kWindowSide, 1);
    }
  }
  __syncthreads();
  const int column = left + static_cast<int>(threadIdx.x) % kWindowSide;
  const int row = top + static_cast<int>(threadIdx.x) / kWindowSide;
  if (column < width && row < height)
  {
    float sum[3];
    for (int m = 0; m < 3; ++m)
    {
      sum[m] = FilterAt(task.kernel, rows[m] + threadIdx.x, kWindowSide);
    }
    const std::size_t pixel = static_cast<std::size_t>(row) * width + column;
    const std::size_t at = blockIdx.y * static_cast<std::size_t>(width) * height + pixel;
    task.others[at] = sum[0] + 2 * task.intensities[at] * sum[1] + task.sweep.Truth(frame, pixel) * sum[2];
  }
}

}  // namespace bigus::cuda
