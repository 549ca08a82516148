// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field in a training's saved state. Private to Core and Cuda.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "Core/Formula/Adam.h"
#include "Core/Model/GaussianField.h"
#include "Core/Numerics/StateBytes.h"

namespace bigus
{

template <class Vector>
void SaveVectors(const std::vector<Vector>& vectors, StateWriter& to)
{
  to.Number<std::uint64_t>(vectors.size());
  for (const Vector& vector : vectors)
  {
    to.Numbers(vector.data(), vector.size());
  }
}

/// Vectors and matrices of fixed size.
template <class Vector>
std::vector<Vector> LoadVectors(StateReader& from)
{
  std::vector<Vector> vectors(from.Count(sizeof(double) * Vector::SizeAtCompileTime));
  for (Vector& vector : vectors)
  {
    from.Numbers(vector.data(), Vector::SizeAtCompileTime);
  }
  return vectors;
}

/// Throws Error unless averages of a gradient and of its square can be Adam's. Of gradients that are at most
/// kLargestGradient the first is at most sqrt(33.4) times the root of the second (Cauchy and Schwarz, with the weights of
/// both: b <- s^2 / 0.01 + (1 - s)^2 / 0.99 b for the share s from 0.1 to 0.5), but for squares that are too small for a
/// float. Others would make a step of any length.
template <class T>
void RequireAverages(const T* first, const T* second, std::size_t count)
{
  constexpr double kRounding = 1.01, kMostRoots = 7, kSmallest = 1e-15;
  for (std::size_t i = 0; i < count; ++i)
  {
    const double mean = std::abs(static_cast<double>(first[i])), square = second[i];
    StateReader::Require(
        square >= 0 && mean <= kRounding * kLargestGradient && mean <= kMostRoots * std::sqrt(square) + kSmallest,
        "averages of no gradient");
  }
}

inline void SaveBeam(const Beam& beam, StateWriter& to)
{
  to.Number(beam.elevationSigma);
  to.Number(beam.probeElevationSigma);
  SaveVectors(beam.trainedNormals, to);
}

inline Beam LoadBeam(StateReader& from)
{
  const double trained = from.Number<double>(), probe = from.Number<double>();
  return {trained, probe, LoadVectors<Eigen::Vector3d>(from)};
}

inline void SaveField(const GaussianField& field, StateWriter& to)
{
  SaveBeam(field.beam, to);
  to.Number(field.transfer.gamma);
  SaveVectors(field.means, to);
  SaveVectors(field.scales, to);
  SaveVectors(field.rotations, to);
  to.Array(field.reflectivities);
}

/// Throws Error unless the field is valid.
inline GaussianField LoadField(StateReader& from)
{
  GaussianField field;
  field.beam = LoadBeam(from);
  field.transfer.gamma = from.Number<double>();
  field.means = LoadVectors<Eigen::Vector3d>(from);
  field.scales = LoadVectors<Eigen::Vector3d>(from);
  field.rotations = LoadVectors<Eigen::Vector4d>(from);
  field.reflectivities = from.Array<double>();
  field.Validate();
  return field;
}

}  // namespace bigus
