// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How far a training step moves what, and between which bounds.
#pragma once

namespace bigus
{

/// Adam's step sizes; each in the unit of its parameter. Zero freezes the group.
struct LearningRates
{
  double mean = 0;          ///< mm
  double logScale = 0;      ///< natural logarithm of mm
  double rotation = 0;      ///< radian
  double reflectivity = 0;  ///< dimensionless
  /// A Gaussian's own n-th step since it was new is shorter by exp(-settling n), and at the least by `settled`. So in one
  /// field new Gaussians learn while old ones rest. 0: all steps are alike.
  double settling = 0;
  double settled = 0;  ///< 0 to 1
};

/// Bounds on what a step moves: a Gaussian that no frame of the batch saw is left as it is.
struct ParameterLimits
{
  double minimumScale = 1e-6;         ///< mm
  double maximumScale = 1e6;          ///< mm
  bool positiveReflectivity = false;  ///< clamp r at 0 (the ablation of signed reflectivity)
};

}  // namespace bigus
