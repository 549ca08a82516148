// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The few parts of CUDA that the folder Cuda uses, on the CPU: so its kernels run, and are tested, on machines without
// a device. Every thread of a thread block is a fibre; the lanes of a warp run until all have come to the same
// exchange, the warps until all have come to the same barrier. One thread block runs on one thread of the CPU, several
// at once.
//
// It is stricter than a device in what tests can make use of: a warp or a thread block of which some threads wait and
// others have returned is reported, device memory starts as NaN, and warps and lanes run in changing orders, so that a
// barrier too few shows.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <type_traits>

#define __global__
#define __device__
#define __host__
#define __launch_bounds__(...)
#define __shared__ static thread_local
#define CUDART_VERSION 12000

struct float2
{
  float x, y;
};

struct dim3
{
  unsigned int x, y, z;
  constexpr explicit dim3(unsigned int nx = 1, unsigned int ny = 1, unsigned int nz = 1) : x(nx), y(ny), z(nz) {}
};

extern thread_local dim3 threadIdx, blockIdx, blockDim, gridDim;

enum cudaError_t
{
  cudaSuccess = 0,
  cudaErrorMemoryAllocation = 2,
  cudaErrorInsufficientDriver = 35,
  cudaErrorNoDevice = 100,
  cudaErrorStreamCaptureUnsupported = 900
};
enum cudaMemcpyKind
{
  cudaMemcpyHostToDevice,
  cudaMemcpyDeviceToHost,
  cudaMemcpyDeviceToDevice
};
enum cudaStreamCaptureMode
{
  cudaStreamCaptureModeThreadLocal
};
struct EmulatedStream;
using cudaStream_t = EmulatedStream*;
struct EmulatedGraph;
using cudaGraph_t = EmulatedGraph*;
using cudaGraphExec_t = EmulatedGraph*;
struct cudaDeviceProp
{
  char name[256];
  int major, minor;
  std::size_t totalGlobalMem;
};

namespace bigus
{
namespace emulator
{

/// Runs a kernel, given as a call of it, for every thread of a grid; or records it.
void Run(dim3 grid, int threads, cudaStream_t stream, std::function<void()> kernel);

/// What every lane of the calling one's warp gives, by lane. All of them must call.
const std::uint64_t* Exchange(std::uint64_t value);

/// Whether any thread of the block gives true. All of them must call.
bool Barrier(bool value);

/// Device memory there is; more is refused. For tests of what happens then.
void SetMemory(std::size_t bytes);
std::size_t MemoryUsed();

/// cuFFT's functions of these names, and whether they are to be found.
int PlanMany(int* plan, int rank, int* size, int* inEmbed, int inStride, int inDistance, int* outEmbed, int outStride,
             int outDistance, int type, int batch);
int SetStream(int plan, cudaStream_t stream);
int RealToComplex(int plan, float* in, float* out);
int ComplexToReal(int plan, float* in, float* out);
int Destroy(int plan);
bool HasFourier();
void SetHasFourier(bool has);

template <class T>
T ExchangeWith(T value, int lane)
{
  static_assert(sizeof(T) <= sizeof(std::uint64_t) && std::is_trivially_copyable_v<T>, "one number at a time");
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof(T));
  const std::uint64_t* all = Exchange(bits);
  std::memcpy(&value, all + lane, sizeof(T));
  return value;
}

}  // namespace emulator
}  // namespace bigus

inline void __syncthreads()
{
  bigus::emulator::Barrier(false);
}
inline int __syncthreads_or(int condition)
{
  return bigus::emulator::Barrier(condition != 0);
}

inline void __syncwarp()
{
  bigus::emulator::Exchange(0);
}

inline unsigned int __ballot_sync(unsigned int, bool condition)
{
  const std::uint64_t* all = bigus::emulator::Exchange(condition);
  unsigned int ballot = 0;
  for (int lane = 0; lane < 32; ++lane)
  {
    ballot |= static_cast<unsigned int>(all[lane] & 1) << lane;
  }
  return ballot;
}
template <class T>
T __shfl_sync(unsigned int, T value, int lane)
{
  return bigus::emulator::ExchangeWith(value, lane);
}
template <class T>
T __shfl_xor_sync(unsigned int, T value, int mask)
{
  return bigus::emulator::ExchangeWith(value, static_cast<int>(threadIdx.x % 32) ^ mask);
}

inline int __popc(unsigned int bits)
{
  return __builtin_popcount(bits);
}
inline int __ffs(int bits)
{
  return __builtin_ffs(bits);
}

template <class T>
T atomicAdd(T* at, T value)
{
  return __atomic_fetch_add(at, value, __ATOMIC_RELAXED);
}
inline unsigned int atomicOr(unsigned int* at, unsigned int bits)
{
  return __atomic_fetch_or(at, bits, __ATOMIC_RELAXED);
}

cudaError_t cudaMalloc(void** memory, std::size_t bytes);
cudaError_t cudaFree(void* memory);
cudaError_t cudaMemGetInfo(std::size_t* free, std::size_t* total);
inline cudaError_t cudaGetDeviceCount(int* count)
{
  *count = 1;
  return cudaSuccess;
}
cudaError_t cudaGetDeviceProperties(cudaDeviceProp* properties, int device);
inline cudaError_t cudaGetLastError()
{
  return cudaSuccess;
}
inline const char* cudaGetErrorString(cudaError_t status)
{
  return status == cudaSuccess                 ? "no error"
         : status == cudaErrorMemoryAllocation ? "out of memory"
                                               : "operation not permitted when stream is capturing";
}
cudaError_t cudaStreamCreate(cudaStream_t* stream);
cudaError_t cudaStreamDestroy(cudaStream_t stream);
cudaError_t cudaStreamSynchronize(cudaStream_t stream);
cudaError_t cudaMemcpyAsync(void* to, const void* from, std::size_t bytes, cudaMemcpyKind kind, cudaStream_t stream);
cudaError_t cudaMemsetAsync(void* to, int value, std::size_t bytes, cudaStream_t stream);
cudaError_t cudaStreamBeginCapture(cudaStream_t stream, cudaStreamCaptureMode mode);
cudaError_t cudaStreamEndCapture(cudaStream_t stream, cudaGraph_t* graph);
cudaError_t cudaGraphInstantiate(cudaGraphExec_t* executable, cudaGraph_t graph, unsigned long long flags);
cudaError_t cudaGraphLaunch(cudaGraphExec_t executable, cudaStream_t stream);
cudaError_t cudaGraphDestroy(cudaGraph_t graph);
cudaError_t cudaGraphExecDestroy(cudaGraphExec_t executable);
