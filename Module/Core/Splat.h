// A Gaussian seen by a slice plane through a beam, and the way back: the mathematics for scalar numbers.
#pragma once

#include <cmath>

#ifdef __CUDACC__
#define BIGUS_HOST_DEVICE __host__ __device__
#else
#define BIGUS_HOST_DEVICE
#endif

namespace bigus
{

#include "Splat-inl.h"

}  // namespace bigus
