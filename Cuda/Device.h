// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// CUDA as this folder uses it: checked calls, arrays on the device, launches. Private to Cuda.
//
// CudaRuntime.h is found by include path: Nvcc/CudaRuntime.h for nvcc, or an emulation on the CPU, which is how the
// kernels are tested on machines without a device.
#pragma once

#include <CudaRuntime.h>

#include <cstddef>
#include <cstring>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "Core/Model/Error.h"

namespace bigus::cuda
{

inline std::string Megabytes(std::size_t bytes)
{
  return std::to_string((bytes + (std::size_t(1) << 20) - 1) >> 20) + " MiB";
}

/// Throws Error, naming what failed, unless a call of the runtime succeeded.
inline void Check(cudaError_t status, const char* what)
{
  if (status != cudaSuccess)
  {
    cudaGetLastError();  // or the next call would report it again
    throw Error(std::string("CUDA engine: ") + what + " failed: " + cudaGetErrorString(status) +
                ". Choose the engine 'cpu' to compute without the device.");
  }
}

/// Launches a kernel over `blocks` x `rows` thread blocks; does nothing when there are none.
template <class... Parameters, class... Arguments>
void Launch(const char* name, void (*kernel)(Parameters...), std::size_t blocks, std::size_t rows, int threads,
            cudaStream_t stream, Arguments&&... arguments)
{
  if (blocks == 0 || rows == 0)
  {
    return;
  }
  Require(blocks <= 0x7fffffffu && rows <= 0xffffu, "CUDA engine: ", blocks, " x ", rows,
          " thread blocks are more than a device takes; render fewer pixels or frames at a time.");
  const dim3 grid(static_cast<unsigned int>(blocks), static_cast<unsigned int>(rows), 1);
  LaunchKernel<Parameters...>(kernel, grid, threads, stream, static_cast<Parameters>(arguments)...);
  Check(cudaGetLastError(), name);
}

/// An array on the device that grows when it must and is never copied by accident.
template <class T>
class DeviceArray
{
public:
  DeviceArray() = default;
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;
  DeviceArray(DeviceArray&& other) noexcept { swap(other); }
  DeviceArray& operator=(DeviceArray&& other) noexcept
  {
    swap(other);
    return *this;
  }
  ~DeviceArray() { cudaFree(data_); }

  void swap(DeviceArray& other) noexcept
  {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  T* data() const { return data_; }
  std::size_t size() const { return size_; }
  std::size_t Bytes() const { return capacity_ * sizeof(T); }

  /// Room for `size` elements, whose values are undefined. Returns whether the array has moved. `what` and `advice`
  /// go into the message when the device has no such room.
  bool Resize(std::size_t size, const char* what, const char* advice)
  {
    const bool moves = size > capacity_;
    if (moves)
    {
      cudaFree(data_);
      data_ = nullptr;
      size_ = capacity_ = 0;
      void* memory = nullptr;
      const cudaError_t status = size > static_cast<std::size_t>(-1) / sizeof(T)
                                     ? cudaErrorMemoryAllocation
                                     : cudaMalloc(&memory, size * sizeof(T));
      if (status == cudaErrorMemoryAllocation)
      {
        cudaGetLastError();
        std::size_t free = 0, total = 0;
        cudaMemGetInfo(&free, &total);
        throw Error("CUDA engine: " + std::string(what) + " need " + Megabytes(size * sizeof(T)) +
                    " of device memory and " + Megabytes(free) + " of " + Megabytes(total) + " are free. " + advice +
                    ", or choose the engine 'cpu'.");
      }
      Check(status, "allocating device memory");
      data_ = static_cast<T*>(memory);
      capacity_ = size;
    }
    size_ = size;
    return moves;
  }

  void Clear(cudaStream_t stream)
  {
    if (size_ > 0)
    {
      Check(cudaMemsetAsync(data_, 0, size_ * sizeof(T), stream), "clearing device memory");
    }
  }

  /// Host memory may be reused after: the runtime copies what is not page-locked before it returns.
  void Upload(const T* from, std::size_t count, cudaStream_t stream)
  {
    if (count > 0)
    {
      Check(cudaMemcpyAsync(data_, from, count * sizeof(T), cudaMemcpyHostToDevice, stream), "uploading");
    }
  }
  /// Waits for all that was queued before.
  void Download(T* to, std::size_t first, std::size_t count, cudaStream_t stream) const
  {
    if (count > 0)
    {
      Check(cudaMemcpyAsync(to, data_ + first, count * sizeof(T), cudaMemcpyDeviceToHost, stream), "downloading");
      Check(cudaStreamSynchronize(stream), "a kernel");
    }
  }

private:
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

/// Work on a stream, recorded once and repeated at the cost of one launch.
class Recording
{
public:
  Recording() = default;
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;
  ~Recording() { Forget(); }

  bool Empty() const { return !graph_; }
  void Forget()
  {
    if (graph_)
    {
      cudaGraphExecDestroy(graph_);
      graph_ = nullptr;
    }
  }

  /// Nothing that `enqueue` queues is done yet. It must not allocate.
  template <class Enqueue>
  void Record(cudaStream_t stream, Enqueue&& enqueue)
  {
    Forget();
    Check(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "recording a step");
    cudaGraph_t graph = nullptr;
    try
    {
      enqueue();
    }
    catch (...)
    {
      cudaStreamEndCapture(stream, &graph);
      cudaGraphDestroy(graph);
      throw;
    }
    Check(cudaStreamEndCapture(stream, &graph), "recording a step");
    const cudaError_t status = cudaGraphInstantiate(&graph_, graph, 0);
    cudaGraphDestroy(graph);
    Check(status, "recording a step");
  }
  void Launch(cudaStream_t stream) { Check(cudaGraphLaunch(graph_, stream), "a recorded step"); }

private:
  cudaGraphExec_t graph_ = nullptr;
};

}  // namespace bigus::cuda
