// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CUDA engine compiled for the emulator: one more engine for every test that takes them all.
#include "Emulator.h"

// The sources themselves, which nvcc compiles elsewhere.
#include "Cuda/CudaEngine.cu"

namespace
{

const bool kRegistered = []
{
  bigus::Engine::Register("cuda-emulated", bigus::CreateCudaEngine, false);
  return true;
}();

}  // namespace
