// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One training with every choice made: what Train ends with, and what decisions are tried on. Private to
// Core.
#pragma once

#include "Core/Training/Trainer.h"

namespace bigus
{

/// Trains on `frames`, with every optional of `options` set except the scales; `validationFrames` (may be
/// empty) serve early stop. The options' own hold-out, validation and automatic are not looked at.
/// `withVirtualPlanes` spares making them again: AddVirtualPlanes of the same frames and options; null makes
/// them. `solved` (may be null) spares seeding and solving again: where it has no Gaussians it gets what
/// training starts from, signed; else training starts from it.
TrainingResult Fit(std::shared_ptr<const Sweep> sweep, const std::vector<int>& frames,
                   const std::vector<int>& validationFrames, const TrainerOptions& options, const GaussianField* start,
                   const std::function<bool(const TrainingProgress&)>& progress,
                   std::shared_ptr<const Sweep> withVirtualPlanes = nullptr, GaussianField* solved = nullptr);

/// The elements of `values` at `indices`.
inline std::vector<int> Pick(const std::vector<int>& values, const std::vector<int>& indices)
{
  std::vector<int> picked;
  for (int index : indices)
  {
    picked.push_back(values[index]);
  }
  return picked;
}

}  // namespace bigus
