// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Adam (Kingma and Ba, 2015), one Gaussian at a time, with a step size for each group of parameters.
#pragma once

#include <cmath>

#include "Core/Formula/LearningRates.h"
#include "Core/Formula/PixelLoss.h"
#include "Core/Formula/Splat.h"
#include "Core/Model/GaussianField.h"

namespace bigus
{

/// Where a Gaussian's parameters begin in arrays of their gradients and averages.
enum Parameter
{
  kMeanAt = 0,
  kLogScaleAt = 3,
  kTurnAt = 6,
  kReflectivityAt = 9,
  kParametersPerGaussian = 10
};

// What a new gradient counts in the mean of squares: beta 0.99. A Gaussian is seen by a few frames a pass, so the usual
// 0.999 would remember a hundred passes, gradients among them that are long gone, and hold back every step.
constexpr double kSecondShare = 0.01;
constexpr double kLogSecondDecay = -0.010050335853501441;  // ln(1 - kSecondShare)
// What it counts in the mean: half at first, because the mean of ten gradients points to where a young Gaussian was; then
// kYoungUpdates over its updates; at last a tenth (beta 0.9), because the mean of more gradients has less noise.
constexpr double kYoungShare = 0.5, kFirstShare = 0.1;
constexpr double kYoungUpdates = 40;
constexpr double kLogYoungDecay = -0.693147180559945309;  // ln(1 - kYoungShare)
constexpr double kLargestGradient = 1e15;                 // its square is far from the largest float

/// Step sizes and limits as kernels use them.
struct AdamStep
{
  double mean, logScale, rotation, reflectivity;
  double minimumLogScale, maximumLogScale;
  double minimumReflectivity, maximumReflectivity;
  double settling, settled;

  AdamStep(const LearningRates& rates, const ParameterLimits& limits)
      : mean(rates.mean),
        logScale(rates.logScale),
        rotation(rates.rotation),
        reflectivity(rates.reflectivity),
        minimumLogScale(std::log(limits.minimumScale)),
        maximumLogScale(std::log(limits.maximumScale)),
        minimumReflectivity(limits.positiveReflectivity ? 0.0 : -GaussianField::kLargestReflectivity),
        maximumReflectivity(GaussianField::kLargestReflectivity),
        settling(rates.settling),
        settled(rates.settled)
  {
  }
};

#include "Core/Formula/Adam-inl.h"

}  // namespace bigus
