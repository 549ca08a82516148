// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How thick the beam is out of plane, from how fast speckle changes when the plane moves.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// What EstimateElevationSigma found. `sigma` is meant only when `reliable`; otherwise it is the best fit
/// there was (0: none) and `reason` says what is wrong.
struct ElevationEstimate
{
  double sigma = 0;          ///< mm, standard deviation of the two-way amplitude profile across the plane
  double standardError = 0;  ///< mm, from leaving out an eighth of the sweep at a time
  bool reliable = false;
  std::string reason;               ///< empty when reliable
  std::vector<double> distance;     ///< mm between planes, increasing: the curve's bins
  std::vector<double> correlation;  ///< [distance] measured correlation of log-compressed speckle
  std::vector<double> fitted;       ///< [distance] the model's, averaged over the same patches
  std::size_t pairs = 0;            ///< pairs of frames compared
};

/// Estimates the elevation thickness from the frames named (log-compressed images, as scanners show them).
/// Speckle of two planes z apart has coherence exp(-z^2 / (4 sigma^2)); its correlation over plane distance,
/// fitted, gives sigma. It needs speckle of at least a pixel's size, neighbouring planes nearer than about
/// sigma and others farther than that; what is missing is told in `reason`. The derivation is in
/// ElevationEstimate.md.
///
/// Of more than 400 frames the 400 in the middle are used: a second or two of one core at most.
/// Deterministic, the same bits for any number of threads. Throws Error for a frame that is not there.
ElevationEstimate EstimateElevationSigma(const Sweep& sweep, const std::vector<int>& frames);

}  // namespace bigus
