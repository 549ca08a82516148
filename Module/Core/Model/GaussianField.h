// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The model of a scene: signed anisotropic Gaussians in space, structure of arrays.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <string>
#include <vector>

#include "Core/Model/Beam.h"
#include "Core/Model/TransferFunction.h"

namespace bigus
{

/// N Gaussians r_i exp(-1/2 (x - mu)^T Sigma^-1 (x - mu)), Sigma = R diag(s)^2 R^T (paper eq 1), with the beam and the
/// transfer function they were trained under. Arrays are of equal length. Values are kept in double; engines move them
/// near the origin and compute in float.
struct GaussianField
{
  std::vector<Eigen::Vector3d> means;      ///< [N] mu, mm, world frame
  std::vector<Eigen::Vector3d> scales;     ///< [N] s, standard deviations, mm, > 0; fast engines take what lies
                                           ///< beyond 1e-9 and 1e7 mm as those
  std::vector<Eigen::Vector4d> rotations;  ///< [N] quaternion w, x, y, z; any length but zero (normalised on use)
  std::vector<double> reflectivities;      ///< [N] r, signed, dimensionless
  Beam beam;
  TransferFunction transfer;

  /// A Gaussian in a file or an engine: 3 + 3 + 4 + 1 numbers of 4 bytes.
  static constexpr std::size_t kBytesOfGaussian = 44;

  /// Engines compute in float; beyond these, squares or sums of many Gaussians might overflow.
  static constexpr double kLargestReflectivity = 1e20;
  static constexpr double kLargestCoordinate = 1e12;  ///< mm
  /// Beyond these the reference's squares of squares leave the range of a double, and its pictures would be no numbers.
  static constexpr double kSmallestScale = 1e-12;  ///< mm
  static constexpr double kLargestScale = 1e12;    ///< mm

  std::size_t Size() const { return means.size(); }
  void Resize(std::size_t n);

  /// Adds the Gaussians of another field behind its own; beam and transfer function stay.
  void Append(const GaussianField& more);

  /// The Gaussians of these numbers, in this order, under the same beam and transfer function.
  template <class Number>
  GaussianField Pick(const std::vector<Number>& numbers) const
  {
    GaussianField some;
    some.beam = beam;
    some.transfer = transfer;
    some.Resize(numbers.size());
    for (std::size_t k = 0; k < numbers.size(); ++k)
    {
      some.means[k] = means[numbers[k]];
      some.scales[k] = scales[numbers[k]];
      some.rotations[k] = rotations[numbers[k]];
      some.reflectivities[k] = reflectivities[numbers[k]];
    }
    return some;
  }

  /// Throws Error naming the array, the index and the value, unless lengths agree, all values are finite,
  /// quaternions are not zero, scales, reflectivities and coordinates lie within the limits above, gamma > 0 and
  /// both thicknesses of the beam from 0 to kLargestScale, its normals of length 1. An empty field is valid.
  void Validate() const;
};

/// The part of GaussianField::Validate that looks at one Gaussian, for fields that are kept in other arrays.
void ValidateGaussian(std::size_t index, const Eigen::Vector3d& mean, const Eigen::Vector3d& scale,
                      const Eigen::Vector4d& rotation, double reflectivity);

/// R of a quaternion (w, x, y, z) of any non-zero length.
Eigen::Matrix3d RotationMatrix(const Eigen::Vector4d& wxyz);

/// The quaternion (w, x, y, z), w >= 0, of a rotation matrix.
Eigen::Vector4d Quaternion(const Eigen::Matrix3d& rotation);

}  // namespace bigus
