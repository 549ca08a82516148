// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "Ceilings.h"
#include "Cuda/Device.h"

namespace bigus::bench
{
namespace
{

using namespace cuda;

constexpr int kThreads = 256, kChains = 8, kSteps = 4096;

/// Independent chains of multiply-adds, as many as hide their latency.
__global__ void __launch_bounds__(kThreads) MultiplyAdd(float a, float* out)
{
  float values[kChains];
  for (int k = 0; k < kChains; ++k)
  {
    values[k] = threadIdx.x + k;
  }
  for (int step = 0; step < kSteps; ++step)
  {
#pragma unroll
    for (int k = 0; k < kChains; ++k)
    {
      values[k] = values[k] * a + 1.0f;
    }
  }
  float sum = 0;
  for (int k = 0; k < kChains; ++k)
  {
    sum += values[k];
  }
  out[static_cast<std::size_t>(blockIdx.x) * kThreads + threadIdx.x] = sum;
}

__global__ void __launch_bounds__(kThreads) Copy(const float4* in, float4* out, std::size_t count)
{
  const std::size_t i = static_cast<std::size_t>(blockIdx.x) * kThreads + threadIdx.x;
  if (i < count)
  {
    out[i] = in[i];
  }
}

/// Seconds of the fastest of some runs.
template <class Run>
double Fastest(Run&& run)
{
  cudaEvent_t begin, end;
  Check(cudaEventCreate(&begin), "measuring");
  Check(cudaEventCreate(&end), "measuring");
  double fastest = 1e30;
  for (int i = 0; i < 10; ++i)
  {
    Check(cudaEventRecord(begin), "measuring");
    run();
    Check(cudaEventRecord(end), "measuring");
    Check(cudaEventSynchronize(end), "measuring");
    float milliseconds = 0;
    Check(cudaEventElapsedTime(&milliseconds, begin, end), "measuring");
    fastest = std::min(fastest, 1e-3 * milliseconds);
  }
  cudaEventDestroy(begin);
  cudaEventDestroy(end);
  return fastest;
}

}  // namespace

Ceilings MeasureCeilings()
{
  cudaDeviceProp properties;
  Check(cudaGetDeviceProperties(&properties, 0), "asking for the device");
  const std::size_t blocks = static_cast<std::size_t>(properties.multiProcessorCount) * 32;
  const std::size_t quads = std::min<std::size_t>(properties.totalGlobalMem / 8, std::size_t(1) << 30) / sizeof(float4);
  DeviceArray<float> sums;
  sums.Resize(blocks * kThreads, "sums", "Free some");
  DeviceArray<float4> from, to;
  from.Resize(quads, "copies", "Free some");
  to.Resize(quads, "copies", "Free some");
  from.Clear(nullptr);
  const double arithmetic =
      Fastest([&] { Launch("measuring", MultiplyAdd, blocks, 1, kThreads, nullptr, 0.999f, sums.data()); });
  const double copying = Fastest(
      [&] {
        Launch("measuring", Copy, (quads + kThreads - 1) / kThreads, 1, kThreads, nullptr, from.data(), to.data(),
               quads);
      });
  return {static_cast<double>(blocks) * kThreads * kChains * kSteps / arithmetic,
          2.0 * quads * sizeof(float4) / copying};
}

}  // namespace bigus::bench
