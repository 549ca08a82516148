// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <dlfcn.h>

#include <memory>

#include "FourierLibrary.h"

namespace bigus::cuda
{

const FourierLibrary* FourierLibrary::Find()
{
  static const std::unique_ptr<FourierLibrary> library = []
  {
    std::unique_ptr<FourierLibrary> found;
    for (const char* name : {"libcufft.so.12", "libcufft.so.11", "libcufft.so"})
    {
      void* const handle = dlopen(name, RTLD_NOW | RTLD_LOCAL);
      if (!handle)
      {
        continue;
      }
      found = std::make_unique<FourierLibrary>();
      const auto load = [handle](auto& function, const char* symbol)
      {
        function = reinterpret_cast<std::decay_t<decltype(function)>>(dlsym(handle, symbol));
        return function != nullptr;
      };
      if (load(found->planMany, "cufftPlanMany") && load(found->setStream, "cufftSetStream") &&
          load(found->realToComplex, "cufftExecR2C") && load(found->complexToReal, "cufftExecC2R") &&
          load(found->destroy, "cufftDestroy"))
      {
        return found;
      }
      found.reset();
    }
    return found;
  }();
  return library.get();
}

}  // namespace bigus::cuda
