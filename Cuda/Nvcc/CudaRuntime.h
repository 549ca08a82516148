// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CUDA runtime, for nvcc. The tests put an emulation of it on the CPU in its place: a header of the same name, found
// in their own include path, with the same functions.
#pragma once

#include <cuda_runtime.h>

#define BIGUS_APART __noinline__

namespace bigus::cuda
{

template <class... Parameters>
void LaunchKernel(void (*kernel)(Parameters...), dim3 grid, int threads, cudaStream_t stream, Parameters... arguments)
{
  kernel<<<grid, dim3(threads, 1, 1), 0, stream>>>(arguments...);
}

}  // namespace bigus::cuda
