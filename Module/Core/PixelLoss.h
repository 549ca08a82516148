// A pixel's loss and its derivative with respect to the scattering field S, for scalar numbers. Private to
// Core and Cuda.
#pragma once

#include <cmath>

#include "Scalars.h"

namespace bigus
{

#include "Loss-inl.h"

}  // namespace bigus
