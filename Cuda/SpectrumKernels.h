// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The focal frequency loss, with the transforms of cuFFT. Private to Cuda.
#pragma once

#include <memory>

#include "Forward.h"
#include "FourierLibrary.h"

namespace bigus::cuda
{

/// Transforms of stacks of images of one size, [views][height][width] to [views][height][width / 2 + 1] complex
/// numbers and back, neither normalised.
class Fourier
{
public:
  Fourier(const FourierLibrary& library, int width, int height, int views, cudaStream_t stream)
      : library_(library), width_(width), height_(height), views_(views)
  {
    constexpr int kRealToComplex = 0x2a, kComplexToReal = 0x2c;  // CUFFT_R2C and CUFFT_C2R
    int size[2] = {height, width};
    Require(library.planMany(&forward_, 2, size, nullptr, 1, 0, nullptr, 1, 0, kRealToComplex, views));
    hasForward_ = true;
    Require(library.planMany(&backward_, 2, size, nullptr, 1, 0, nullptr, 1, 0, kComplexToReal, views));
    hasBackward_ = true;
    Require(library.setStream(forward_, stream));
    Require(library.setStream(backward_, stream));
  }
  Fourier(const Fourier&) = delete;
  Fourier& operator=(const Fourier&) = delete;
  ~Fourier()
  {
    if (hasForward_)
    {
      library_.destroy(forward_);
    }
    if (hasBackward_)
    {
      library_.destroy(backward_);
    }
  }

  bool IsFor(int width, int height, int views) const { return width == width_ && height == height_ && views == views_; }
  void Forward(float* in, float* out) { Require(library_.realToComplex(forward_, in, out)); }
  void Backward(float* in, float* out) { Require(library_.complexToReal(backward_, in, out)); }

private:
  void Require(int status) const
  {
    if (status != 0)
    {
      throw Error("CUDA engine: cuFFT failed with status " + std::to_string(status) + " on " + std::to_string(views_) +
                  " images of " + std::to_string(width_) + " x " + std::to_string(height_) +
                  " pixels. Leave the term ffl out, use a smaller batch, or choose the engine 'cpu'.");
    }
  }

  const FourierLibrary& library_;
  int width_, height_, views_;
  int forward_ = 0, backward_ = 0;
  bool hasForward_ = false, hasBackward_ = false;
};

struct SpectrumTask
{
  const int* frames;  // [views]
  Frames sweep;
  float share;               // of one pixel in the loss, ffl times 1 / counted pixels / views
  const float* intensities;  // [views][height][width]
  float* differences;        // the same; becomes the derivative
  float2* spectrum;          // [views][height][width / 2 + 1]
  float* others;             // [views][height][width] dL/dI, added to
  double* losses;            // [views]
};

/// I - truth where pixels count, else 0. Launched as ToIntensities.
__global__ void __launch_bounds__(kPixelThreads) FindDifferences(SpectrumTask task)
{
  const std::size_t pixels = static_cast<std::size_t>(task.sweep.width) * task.sweep.height;
  const std::size_t pixel = static_cast<std::size_t>(blockIdx.x) * kPixelThreads + threadIdx.x;
  if (pixel < pixels)
  {
    const std::size_t at = blockIdx.y * pixels + pixel;
    const float truth = task.sweep.Truth(task.frames[blockIdx.y], pixel);
    task.differences[at] = task.sweep.Counts(pixel) > 0 ? task.intensities[at] - truth : 0.0f;
  }
}

/// The loss sum w |dF|^2 with w = |dF| / largest held, and w dF in place of dF. dF is orthonormal: the transform over
/// sqrt(pixels). Launched as (1, views) of kSumThreads.
__global__ void __launch_bounds__(kSumThreads) WeighSpectrum(SpectrumTask task)
{
  __shared__ float mosts[kSumThreads / kWarp];
  const int width = task.sweep.width, height = task.sweep.height, columns = width / 2 + 1;
  const int count = columns * height;
  float2* spectrum = task.spectrum + static_cast<std::size_t>(blockIdx.y) * count;
  float most = 0;
  for (int k = threadIdx.x; k < count; k += kSumThreads)
  {
    most = max(most, spectrum[k].x * spectrum[k].x + spectrum[k].y * spectrum[k].y);
  }
  for (int step = kWarp / 2; step > 0; step /= 2)
  {
    most = max(most, __shfl_xor_sync(kAllLanes, most, step));
  }
  if (threadIdx.x % kWarp == 0)
  {
    mosts[threadIdx.x / kWarp] = most;
  }
  __syncthreads();
  for (float other : mosts)
  {
    most = max(most, other);
  }
  most = sqrtf(most);
  double sum = 0;
  for (int k = threadIdx.x; k < count && most > 0; k += kSumThreads)
  {
    const float2 f = spectrum[k];
    const float square = f.x * f.x + f.y * f.y, w = sqrtf(square) / most;
    const int column = k % columns;
    const double twice = column == 0 || 2 * column == width ? 1 : 2;  // the others hold their conjugates
    sum += twice * static_cast<double>(w) * square;
    spectrum[k] = {w * f.x, w * f.y};
  }
  sum = BlockSum<kSumThreads>(sum);
  if (threadIdx.x == 0)
  {
    const double pixels = static_cast<double>(width) * height;
    task.losses[blockIdx.y] = task.share * sum / pixels;
  }
}

/// dL/dI: twice the inverse transform of w dF. Launched as ToIntensities.
__global__ void __launch_bounds__(kPixelThreads) AddSpectrum(SpectrumTask task)
{
  const std::size_t pixels = static_cast<std::size_t>(task.sweep.width) * task.sweep.height;
  const std::size_t pixel = static_cast<std::size_t>(blockIdx.x) * kPixelThreads + threadIdx.x;
  if (pixel < pixels)
  {
    const std::size_t at = blockIdx.y * pixels + pixel;
    const float slope = 2 * task.share / static_cast<float>(pixels);
    task.others[at] += slope * task.sweep.Counts(pixel) * task.differences[at];
  }
}

}  // namespace bigus::cuda
