// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The first Gaussians: where, how large, which way up, how bright.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Model/SweepGeometry.h"

namespace bigus
{

enum class SeedPlacement
{
  Harris,     ///< density from the Harris corner response plus a uniform floor (BIGUS, section 2.3)
  Intensity,  ///< density 0.3 I + 0.025, spread evenly (blue noise); the default
  Random      ///< uniform in the swept volume, isotropic (the plain start, for comparison)
};

struct SeedingOptions
{
  SeedPlacement placement = SeedPlacement::Intensity;
  std::size_t count = 100000;  ///< Gaussians, 1 to 2^26
  std::uint64_t seed = 1;
  bool sparse = false;  ///< planes lie so far apart (IsSparse) that seeds should not reach their neighbours
};

/// Seeds a field over the volume that `frames` sweep. Reflectivity comes from inverting the transfer function at the
/// seed; gamma from the frames' mean. Throws Error when the frames hold no lit pixel.
GaussianField Seed(const Sweep& sweep, const std::vector<int>& frames, const Beam& beam, const SeedingOptions& options);

/// Scales all reflectivities of the engine's `field` by the one factor that brings rendered scattering closest to the
/// frames' (least squares): neighbouring seeds overlap, so inverting the transfer function at each overshoots.
void ScaleReflectivities(Engine& engine, const Sweep& sweep, const std::vector<int>& frames, GaussianField& field);

}  // namespace bigus
