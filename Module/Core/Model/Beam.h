// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The elevation profile of the probe: how thick the slice is that one image sees.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <vector>

namespace bigus
{

/// Gaussian elevation profile, normalised to unit area: N(z; 0, sigma^2). sigma = 0 is the infinitely thin plane, reached
/// exactly.
///
/// A field trained under a thinner beam than the probe's, sigma_t < sigma_p, holds the thickness of the probe's slices
/// along the normals e_k of the planes that it was trained on: sigma_p^2 - sigma_t^2 of variance. Across those normals it
/// does not. So a plane with the normal n is rendered with what the field lacks there,
///
///   sigma(n)^2 = sigma_t^2 + (sigma_p^2 - sigma_t^2) (1 - max_k (n . e_k)^2),
///
/// which is sigma_t on the planes trained on and sigma_p at right angles to all of them.
struct Beam
{
  double elevationSigma = 0.3;  ///< sigma_t: that of the planes trained on, standard deviation, mm, >= 0
  /// sigma_p, mm, >= 0. Where it is not above elevationSigma, as 0 for a probe that is not known, every plane has
  /// elevationSigma.
  double probeElevationSigma = 0;
  /// e_k, unit vectors, a few that stand for all; none: as for sigma_p = 0.
  std::vector<Eigen::Vector3d> trainedNormals = {};

  /// sigma(n)^2, mm^2, of a plane with this unit normal.
  double Variance(const Eigen::Vector3d& normal) const
  {
    const double trained = elevationSigma * elevationSigma, probe = probeElevationSigma * probeElevationSigma;
    if (trainedNormals.empty() || !(probe > trained))
    {
      return trained;
    }
    double along = 0;
    for (const Eigen::Vector3d& e : trainedNormals)
    {
      along = std::max(along, normal.dot(e) * normal.dot(e));
    }
    return trained + (probe - trained) * std::max(0.0, 1 - along);
  }
};

}  // namespace bigus
