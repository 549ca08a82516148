// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Vectors on the device, for conjugate gradients. Private to Cuda.
#pragma once

#include "Forward.h"

namespace bigus
{
namespace cuda
{

constexpr int kVectorThreads = 256;
constexpr int kDotBlocks = 256;  // fixed, and so is the order of a sum

__global__ void __launch_bounds__(kVectorThreads)
    DotPartly(const float* p, const float* q, std::size_t count, double* sums)
{
  double sum = 0;
  for (std::size_t i = static_cast<std::size_t>(blockIdx.x) * kVectorThreads + threadIdx.x; i < count;
       i += static_cast<std::size_t>(kDotBlocks) * kVectorThreads)
  {
    sum += static_cast<double>(p[i]) * static_cast<double>(q[i]);
  }
  sum = BlockSum<kVectorThreads>(sum);
  if (threadIdx.x == 0)
  {
    sums[blockIdx.x] = sum;
  }
}

/// y = alpha x + beta y
__global__ void __launch_bounds__(kVectorThreads)
    Combine(float alpha, const float* x, float beta, float* y, std::size_t count)
{
  const std::size_t i = static_cast<std::size_t>(blockIdx.x) * kVectorThreads + threadIdx.x;
  if (i < count)
  {
    y[i] = alpha * x[i] + beta * y[i];
  }
}

class DeviceVector
{
public:
  DeviceVector(std::size_t size, cudaStream_t stream) : stream_(stream)
  {
    const char* advice = "Solve fewer Gaussians";
    values_.Resize(size, "vectors of the reflectivity solve", advice);
    sums_.Resize(kDotBlocks + 1, "sums", advice);
    values_.Clear(stream);
  }
  DeviceVector(const DeviceVector& other) : DeviceVector(other.values_.size(), other.stream_)
  {
    AddScaled(*this, 1.0, other);
  }
  DeviceVector(DeviceVector&&) = default;

  float* data() const { return values_.data(); }

  friend double Dot(const DeviceVector& p, const DeviceVector& q)
  {
    Launch("a dot product", DotPartly, kDotBlocks, 1, kVectorThreads, p.stream_, p.data(), q.data(), p.values_.size(),
           p.sums_.data());
    Launch("a dot product", SumInOrder, 1, 1, kSumThreads, p.stream_, p.sums_.data(), std::size_t(kDotBlocks),
           p.sums_.data() + kDotBlocks);
    double sum = 0;
    p.sums_.Download(&sum, kDotBlocks, 1, p.stream_);
    return sum;
  }
  friend void AddScaled(DeviceVector& y, double alpha, const DeviceVector& x) { y.Set(alpha, x, 1.0); }
  friend void ScaleAndAdd(DeviceVector& y, double beta, const DeviceVector& x) { y.Set(1.0, x, beta); }

private:
  void Set(double alpha, const DeviceVector& x, double beta)
  {
    Launch("a sum of vectors", Combine, (values_.size() + kVectorThreads - 1) / kVectorThreads, 1, kVectorThreads,
           stream_, static_cast<float>(alpha), x.data(), static_cast<float>(beta), data(), values_.size());
  }

  cudaStream_t stream_;
  DeviceArray<float> values_;
  DeviceArray<double> sums_;
};

}  // namespace cuda
}  // namespace bigus
