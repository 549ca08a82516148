// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The emulated CUDA engine as one more engine, for every test that takes them all.
#include "Cuda/CudaEngine.h"

namespace
{

const bool kRegistered = []
{
  bigus::Engine::Register("cuda-emulated", bigus::CreateCudaEngine, false);
  return true;
}();

}  // namespace
