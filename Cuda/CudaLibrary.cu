// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What Core asks of the library of the CUDA engine.
#include <string>

#include "CudaEngine.h"
#include "Device.h"

/// Sets `factory` and returns null; or returns why there can be no CUDA engine here, and the CPU computes. A library that
/// was left beside the Core of another version would crash, so it is not used.
extern "C" __attribute__((visibility("default"))) const char* bigusCudaEngine(const char* version,
                                                                              bigus::Engine::Factory* factory)
{
  static std::string reason;
  if (std::string(version) != BIGUS_VERSION)
  {
    reason = std::string("libBIGUSCuda is of version " BIGUS_VERSION ", libBIGUSCore beside it of ") + version +
             "; take both from one build";
    return reason.c_str();
  }
  int devices = 0;
  cudaError_t status = cudaGetDeviceCount(&devices);
  if (status == cudaSuccess && devices > 0)
  {
    status = cudaFree(nullptr);  // makes the device ready, or finds that it cannot be
  }
  if (status == cudaSuccess && devices > 0)
  {
    *factory = bigus::CreateCudaEngine;
    return nullptr;
  }
  cudaGetLastError();  // the runtime keeps the error for the next call otherwise
  reason = status == cudaSuccess || status == cudaErrorNoDevice ? "there is no CUDA device"
           : status == cudaErrorInsufficientDriver
               ? "there is no NVIDIA driver, or one too old for CUDA " + std::to_string(CUDART_VERSION / 1000) + "." +
                     std::to_string(CUDART_VERSION % 1000 / 10)
               : std::string("the CUDA device does not start: ") + cudaGetErrorString(status);
  return reason.c_str();
}
