#include "CudaDevices.h"

namespace bigus
{

std::vector<CudaDevice> CudaDevices()
{
  std::vector<CudaDevice> devices;
  int count = 0;
  if (cudaGetDeviceCount(&count) != cudaSuccess)
  {
    cudaGetLastError();  // the runtime keeps the error for the next call otherwise
    return devices;
  }
  for (int i = 0; i < count; ++i)
  {
    cudaDeviceProp properties;
    if (cudaGetDeviceProperties(&properties, i) != cudaSuccess)
    {
      cudaGetLastError();
      return {};
    }
    devices.push_back({properties.name,
                       std::to_string(properties.major) + "." + std::to_string(properties.minor),
                       properties.totalGlobalMem});
  }
  return devices;
}

}  // namespace bigus
