// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A pixel's loss and its derivative with respect to the scattering field S, for scalar numbers. Private to Core and
// Cuda.
#pragma once

#include <cmath>

#include "Core/Formula/Scalars.h"

namespace bigus
{

#include "Core/Formula/PixelLoss-inl.h"

}  // namespace bigus
