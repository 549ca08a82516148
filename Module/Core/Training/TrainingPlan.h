// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One training with every choice made. Private to Core.
#pragma once

#include <cstddef>

#include "Core/Training/TrainerOptions.h"

namespace bigus
{

/// The settings, and for every choice that options leave open what was chosen. Made by PlanByGeometry.
struct TrainingPlan : TrainingSettings
{
  bool sparse = false;     ///< the frames' planes lie far apart (IsSparse)
  bool continued = false;  ///< from a field that was trained before, and not from seeds
  std::size_t gaussians = 0;
  std::size_t maximumGaussians = 0;  ///< that may be decided
  double elevationSigma = 0;         ///< mm, of the planes trained on
  double probeElevationSigma = 0;    ///< mm; 0 where it is not known
  int virtualPlanes = 0;             ///< in every gap
  FrameInterpolation interpolation;
  int iterations = 0;
  Loss loss;
  double pixelSize = 0;                       ///< mm, of the frames to train on
  double minimumScale = 0, maximumScale = 0;  ///< mm
};

}  // namespace bigus
