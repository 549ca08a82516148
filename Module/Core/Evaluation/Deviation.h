// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How scores vary over pictures. Private to this room.
#pragma once

#include <cmath>
#include <vector>

#include "Core/Numerics/Statistics.h"

namespace bigus
{

/// Population standard deviation; 0 where a picture was met exactly, whose PSNR is infinite.
inline double Deviation(const std::vector<double>& values)
{
  const double mean = Mean(values);
  return std::isfinite(mean) ? std::sqrt(MeanSquare(values, mean)) : 0;
}

}  // namespace bigus
