// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Random fields and planes, and comparisons of fields.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "Support/Random.h"

namespace bigus::test
{

/// A plane of random orientation through `centre` with pixels of about `pixel` mm, not quite square.
inline SlicePlane RandomPlane(Random& random, const Eigen::Vector3d& centre, double pixel, int width, int height)
{
  const Eigen::Matrix3d rotation = RotationMatrix(random.UnitQuaternion());
  SlicePlane plane;
  plane.columnStep = pixel * rotation.col(0);
  plane.rowStep = pixel * random.Uniform(0.8, 1.25) * rotation.col(1);
  plane.width = width;
  plane.height = height;
  plane.origin = centre - 0.5 * (width - 1) * plane.columnStep - 0.5 * (height - 1) * plane.rowStep;
  return plane;
}

/// Gaussians with scales from low to high mm in a ball of the given radius, reflectivities in [-0.4, 1],
/// gamma 0.5.
inline GaussianField RandomField(Random& random, std::size_t count, double radius, double low, double high,
                                 double elevationSigma)
{
  GaussianField field;
  field.Resize(count);
  field.transfer.gamma = 0.5;
  field.beam.elevationSigma = elevationSigma;
  for (std::size_t i = 0; i < count; ++i)
  {
    field.means[i] = random.Vector(radius);
    field.scales[i] = {random.LogUniform(low, high), random.LogUniform(low, high), random.LogUniform(low, high)};
    field.rotations[i] = random.UnitQuaternion();
    field.reflectivities[i] = random.Uniform(-0.4, 1.0);
  }
  return field;
}

/// Whether every number of two fields is the same.
inline bool SameField(const GaussianField& a, const GaussianField& b)
{
  return a.means == b.means && a.scales == b.scales && a.rotations == b.rotations &&
         a.reflectivities == b.reflectivities && a.transfer.gamma == b.transfer.gamma &&
         a.beam.elevationSigma == b.beam.elevationSigma;
}

/// Number after number.
inline std::vector<double> Flat(const std::vector<Eigen::Vector3d>& values)
{
  std::vector<double> flat;
  for (const Eigen::Vector3d& v : values)
  {
    flat.insert(flat.end(), {v[0], v[1], v[2]});
  }
  return flat;
}

inline std::vector<double> Flat(const FieldGradient& gradient)
{
  std::vector<double> flat = gradient.reflectivities;
  for (const auto* group : {&gradient.means, &gradient.logScales, &gradient.rotations})
  {
    const std::vector<double> numbers = Flat(*group);
    flat.insert(flat.end(), numbers.begin(), numbers.end());
  }
  return flat;
}

/// |value - reference| / |reference| of a whole group.
inline double RelativeError(const std::vector<double>& reference, const std::vector<double>& value)
{
  double squared = 0, difference = 0;
  for (std::size_t i = 0; i < reference.size(); ++i)
  {
    squared += reference[i] * reference[i];
    difference += (reference[i] - value[i]) * (reference[i] - value[i]);
  }
  return std::sqrt(difference / squared);
}

}  // namespace bigus::test
