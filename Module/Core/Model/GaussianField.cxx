// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/GaussianField.h"

#include <Eigen/Geometry>
#include <cmath>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

/// How far the square of a unit vector's length may lie from 1: what a text file with seven digits leaves.
constexpr double kUnitLength = 1e-5;

std::string At(const char* array, std::size_t i)
{
  return std::string(array) + "[" + std::to_string(i) + "]";
}

}  // namespace

void GaussianField::Resize(std::size_t n)
{
  means.resize(n, Eigen::Vector3d::Zero());
  scales.resize(n, Eigen::Vector3d::Ones());
  rotations.resize(n, Eigen::Vector4d(1, 0, 0, 0));
  reflectivities.resize(n, 0.0);
}

void GaussianField::Append(const GaussianField& more)
{
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  append(means, more.means);
  append(scales, more.scales);
  append(rotations, more.rotations);
  append(reflectivities, more.reflectivities);
}

void GaussianField::Validate() const
{
  const std::size_t n = means.size();
  Require(scales.size() == n && rotations.size() == n && reflectivities.size() == n, "Gaussian field: ", n, " means, ",
          scales.size(), " scales, ", rotations.size(), " rotations and ", reflectivities.size(),
          " reflectivities; all four arrays must have the same length.");
  Require(std::isfinite(transfer.gamma) && transfer.gamma > 0, "Gaussian field: gamma is ", transfer.gamma,
          "; it must be positive and finite.");
  Require(beam.elevationSigma >= 0 && beam.elevationSigma <= kLargestScale, "Gaussian field: the elevation sigma is ",
          beam.elevationSigma, " mm; it must lie between 0 and 1e12.");
  Require(beam.probeElevationSigma >= 0 && beam.probeElevationSigma <= kLargestScale,
          "Gaussian field: the probe's elevation sigma is ", beam.probeElevationSigma,
          " mm; it must lie between 0 and 1e12.");
  for (const Eigen::Vector3d& normal : beam.trainedNormals)
  {
    Require(std::abs(normal.squaredNorm() - 1) <= kUnitLength,
            "Gaussian field: a normal of the planes trained on has the length ", normal.norm(),
            "; it must have length 1.");
  }
  for (std::size_t i = 0; i < n; ++i)
  {
    ValidateGaussian(i, means[i], scales[i], rotations[i], reflectivities[i]);
  }
}

void ValidateGaussian(std::size_t index, const Eigen::Vector3d& mean, const Eigen::Vector3d& scale,
                      const Eigen::Vector4d& rotation, double reflectivity)
{
  if (!mean.allFinite() || mean.cwiseAbs().maxCoeff() > GaussianField::kLargestCoordinate)
  {
    throw Error("Gaussian field: " + At("Points", index) + " is not finite or farther than 1e12 mm from the origin.");
  }
  if (!scale.allFinite() || !(scale.minCoeff() >= GaussianField::kSmallestScale) ||
      !(scale.maxCoeff() <= GaussianField::kLargestScale))
  {
    throw Error("Gaussian field: " + At("Scale", index) + " is (" + std::to_string(scale[0]) + ", " +
                std::to_string(scale[1]) + ", " + std::to_string(scale[2]) +
                ") mm; standard deviations must be from 1e-12 to 1e12 mm (not logarithms).");
  }
  const double length = rotation.stableNorm();
  if (!rotation.allFinite() || !(length > 0) || !std::isfinite(length))
  {
    throw Error("Gaussian field: " + At("Rotation", index) + " is not a quaternion (w, x, y, z) of non-zero length.");
  }
  if (!(std::abs(reflectivity) <= GaussianField::kLargestReflectivity))
  {
    throw Error("Gaussian field: " + At("Reflectivity", index) + " is not finite or larger than 1e20.");
  }
}

Eigen::Matrix3d RotationMatrix(const Eigen::Vector4d& wxyz)
{
  const Eigen::Vector4d q = wxyz.stableNormalized();
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

Eigen::Vector4d Quaternion(const Eigen::Matrix3d& rotation)
{
  const Eigen::Quaterniond q(rotation);
  const Eigen::Vector4d wxyz(q.w(), q.x(), q.y(), q.z());
  return wxyz[0] < 0 ? Eigen::Vector4d(-wxyz) : wxyz;
}

}  // namespace bigus
