// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CUDA engine compiled for the emulator: one more engine for every test that takes them all.
// The sources themselves, which nvcc compiles elsewhere.
#include "Cuda/CudaEngine.cu"

namespace bigus
{
namespace cuda
{

const FourierLibrary* FourierLibrary::Find()
{
  static const FourierLibrary library{emulator::PlanMany, emulator::SetStream, emulator::RealToComplex,
                                      emulator::ComplexToReal, emulator::Destroy};
  return emulator::HasFourier() ? &library : nullptr;
}

}  // namespace cuda
}  // namespace bigus

namespace
{

const bool kRegistered = []
{
  bigus::Engine::Register("cuda-emulated", bigus::CreateCudaEngine, false);
  return true;
}();

}  // namespace
