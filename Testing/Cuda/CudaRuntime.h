// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the CUDA engine includes as the CUDA runtime when its sources are compiled for the emulator.
#pragma once

#include <tuple>

#include "Emulator.h"

#define BIGUS_APART __attribute__((noinline))

namespace bigus
{
namespace cuda
{

template <class... Parameters>
void LaunchKernel(void (*kernel)(Parameters...), dim3 grid, int threads, cudaStream_t stream, Parameters... arguments)
{
  emulator::Run(grid, threads, stream,
                [kernel, values = std::make_tuple(arguments...)] { std::apply(kernel, values); });
}

}  // namespace cuda
}  // namespace bigus
