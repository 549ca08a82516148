// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Error-attributed densification (paper section 2.3 and eq 14): more Gaussians where error persists, fewer where none is
// needed.
#pragma once

#include <cstddef>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"

namespace bigus
{

/// Off by default: on held-out frames it gains -0.00 dB on the brain sweep and +0.09 dB on a phantom
/// (Testing/Benchmarks, E3).
struct DensificationOptions
{
  int interval = 0;        ///< iterations between restructurings; 0 = never
  double percentile = 95;  ///< Gaussians with an error score above this percentile are densified, 0 to 100
  std::size_t cap = 0;     ///< no growth beyond this many Gaussians; 0 = none at all (the trainer: twice the seeds)
};

struct Restructured
{
  GaussianField field;
  std::vector<int> parents;  ///< [new size] index in the old field, or -1 for a child with fresh optimizer state
};

/// One restructuring of `field` by the scores gathered since the last; pixelSize in mm. Gaussians that no frame saw
/// (inactive) or whose |r| is negligible are pruned. Of the rest, those whose error score per frame lies above the
/// percentile are densified, worst first, until the cap. One larger than two pixels is split in two along its axis
/// nearest to the descent direction, keeping mass and covariance. A smaller one is cloned, the clone a quarter of a
/// standard deviation down the descent direction; each of the pair has half of r. Children of a split and clones start
/// with a fresh optimizer state. Nothing is random.
Restructured Densify(const GaussianField& field, const Engine::Scores& scores, double pixelSize,
                     const DensificationOptions& options);

/// The same of the field that an engine trains, which gathers scores anew from then on. One that would be empty stays as it is.
void Densify(Engine& engine, double pixelSize, const DensificationOptions& options);

/// Removes Gaussians that no plane shows: a footprint's peak is at most |r|, which changes I by at most
/// gamma |r|, and below the tolerance training does not render it either. One stays, whatever it is: a field
/// is never empty.
void RemoveInvisible(GaussianField& field, double tolerance);

}  // namespace bigus
