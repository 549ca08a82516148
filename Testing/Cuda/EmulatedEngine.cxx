// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CUDA engine compiled for the emulator.
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
