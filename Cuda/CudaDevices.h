// Which CUDA devices this process can use.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace bigus
{

struct CudaDevice
{
  std::string name;               ///< as the driver calls it
  std::string computeCapability;  ///< "9.0"
  std::size_t memoryBytes;        ///< all of its memory
};

/// In the driver's order. Without a driver, without a device, or on any error of the runtime: none.
std::vector<CudaDevice> CudaDevices();

}  // namespace bigus
