// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field, a plane and a gradient as the formulas take them, one Gaussian at a time; BlockField.h has them in blocks.
// Private to Core.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Formula/Splat.h"
#include "Core/Model/Error.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"

namespace bigus
{

template <class Real>
Vector3<Real> ToVector3(const Eigen::Vector3d& v)
{
  return {static_cast<Real>(v[0]), static_cast<Real>(v[1]), static_cast<Real>(v[2])};
}

template <class Real>
Eigen::Vector3d FromVector3(const Vector3<Real>& v)
{
  return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

/// Poses are reduced to the engine's origin in double before any kernel sees them.
template <class Real>
View<Real> MakeView(const SlicePlane& plane, const Beam& beam, const Eigen::Vector3d& engineOrigin)
{
  const Eigen::Matrix3d t = plane.WorldToSlice();
  View<Real> view;
  view.origin = ToVector3<Real>(plane.origin - engineOrigin);
  view.a = ToVector3<Real>(plane.columnStep);
  view.b = ToVector3<Real>(plane.rowStep);
  view.n = ToVector3<Real>(plane.Normal());
  view.dualA = ToVector3<Real>(t.row(0));
  view.dualB = ToVector3<Real>(t.row(1));
  view.area = static_cast<Real>(plane.columnStep.cross(plane.rowStep).norm());
  view.elevationVariance = static_cast<Real>(beam.Variance(plane.Normal()));
  return view;
}

template <class Real>
std::vector<Gaussian<Real>> PackField(const GaussianField& field, const Eigen::Vector3d& engineOrigin)
{
  std::vector<Gaussian<Real>> packed(field.Size());
  for (std::size_t i = 0; i < packed.size(); ++i)
  {
    const Eigen::Vector4d q = field.rotations[i].stableNormalized();
    packed[i].mean = ToVector3<Real>(field.means[i] - engineOrigin);
    packed[i].logScale = ToVector3<Real>(field.scales[i].array().log().matrix());
    for (int k = 0; k < 4; ++k)
    {
      packed[i].rotation[k] = static_cast<Real>(q[k]);
    }
    packed[i].reflectivity = static_cast<Real>(field.reflectivities[i]);
  }
  return packed;
}

template <class Real>
GaussianField UnpackField(const std::vector<Gaussian<Real>>& packed, const Eigen::Vector3d& engineOrigin,
                          const Beam& beam, const TransferFunction& transfer)
{
  GaussianField field;
  field.beam = beam;
  field.transfer = transfer;
  field.Resize(packed.size());
  for (std::size_t i = 0; i < packed.size(); ++i)
  {
    field.means[i] = FromVector3(packed[i].mean) + engineOrigin;
    field.scales[i] = FromVector3(packed[i].logScale).array().exp();
    field.rotations[i] =
        Eigen::Vector4d(packed[i].rotation[0], packed[i].rotation[1], packed[i].rotation[2], packed[i].rotation[3]);
    field.reflectivities[i] = packed[i].reflectivity;
  }
  return field;
}

template <class Real>
FieldGradient UnpackGradient(const std::vector<GaussianGradient<Real>>& packed)
{
  FieldGradient gradient;
  for (const GaussianGradient<Real>& g : packed)
  {
    gradient.means.push_back(FromVector3(g.mean));
    gradient.logScales.push_back(FromVector3(g.logScale));
    gradient.rotations.push_back(FromVector3(g.rotation));
    gradient.reflectivities.push_back(g.reflectivity);
  }
  return gradient;
}

/// The sum of two gradients of one Gaussian.
template <class Real>
void AddTo(GaussianGradient<Real>& sum, const GaussianGradient<Real>& g)
{
  sum.mean = MultiplyAdd(Real(1), g.mean, sum.mean);
  sum.logScale = MultiplyAdd(Real(1), g.logScale, sum.logScale);
  sum.rotation = MultiplyAdd(Real(1), g.rotation, sum.rotation);
  sum.reflectivity += g.reflectivity;
}

/// The middle of the field's bounding box: float positions relative to it keep micrometres.
inline Eigen::Vector3d MiddleOf(const GaussianField& field)
{
  if (field.means.empty())
  {
    return Eigen::Vector3d::Zero();
  }
  Eigen::Vector3d low = field.means[0], high = field.means[0];
  for (const Eigen::Vector3d& mean : field.means)
  {
    low = low.cwiseMin(mean);
    high = high.cwiseMax(mean);
  }
  return 0.5 * (low + high);
}

/// Optimizer state of a restructured field: state[i] of Gaussian i comes from its parent, or is fresh.
template <class State>
std::vector<State> InheritState(const std::vector<State>& old, std::size_t size, const std::vector<int>* parents)
{
  std::vector<State> state(size);
  if (parents)
  {
    Require(parents->size() == size, "Engine: ", parents->size(), " parents for ", size, " Gaussians.");
    for (std::size_t i = 0; i < size; ++i)
    {
      const int parent = (*parents)[i];
      if (parent >= 0 && static_cast<std::size_t>(parent) < old.size())
      {
        state[i] = old[parent];
      }
    }
  }
  return state;
}

}  // namespace bigus
