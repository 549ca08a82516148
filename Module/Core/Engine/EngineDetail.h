// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What every engine needs between the public nouns and its kernels. Private to Core and Cuda.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Formula/Splat.h"
#include "Core/Model/Error.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

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
  view.elevationVariance = static_cast<Real>(beam.elevationSigma * beam.elevationSigma);
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
    if (parents->size() != size)
    {
      throw Error("Engine: " + std::to_string(parents->size()) + " parents for " + std::to_string(size) +
                  " Gaussians.");
    }
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

/// 1 where a pixel has a part in the loss, else 0; empty when all have.
inline std::vector<std::uint8_t> CountedPixels(const Sweep& sweep)
{
  std::vector<std::uint8_t> counted(sweep.mask ? sweep.PixelsPerFrame() : 0);
  for (std::size_t pixel = 0; pixel < counted.size(); ++pixel)
  {
    counted[pixel] = sweep.IsLit(pixel);
  }
  return counted;
}

inline void CheckFrames(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& frames)
{
  if (!sweep)
  {
    throw Error("Engine: no frames were uploaded; call SetFrames first.");
  }
  if (frames.empty())
  {
    throw Error("Engine: the batch holds no frame.");
  }
  for (int frame : frames)
  {
    if (frame < 0 || frame >= sweep->NumberOfFrames())
    {
      throw Error("Engine: frame " + std::to_string(frame) + " is not one of the " +
                  std::to_string(sweep->NumberOfFrames()) + " frames of the sweep.");
    }
  }
}

inline void CheckWindow(const SlicePlane& plane, int firstColumn, int firstRow, int columns, int rows)
{
  if (firstColumn < 0 || firstRow < 0 || columns < 0 || rows < 0 || columns > plane.width - firstColumn ||
      rows > plane.height - firstRow)
  {
    throw Error("Engine: the window of " + std::to_string(columns) + " x " + std::to_string(rows) + " pixels at (" +
                std::to_string(firstColumn) + ", " + std::to_string(firstRow) + ") does not lie inside the plane of " +
                std::to_string(plane.width) + " x " + std::to_string(plane.height) + ".");
  }
}

inline void CheckStack(const std::vector<SlicePlane>& planes)
{
  for (const SlicePlane& plane : planes)
  {
    if (plane.width != planes[0].width || plane.height != planes[0].height)
    {
      throw Error("Engine: a stack of planes of " + std::to_string(planes[0].width) + " x " +
                  std::to_string(planes[0].height) + " and of " + std::to_string(plane.width) + " x " +
                  std::to_string(plane.height) + " pixels; render planes of one size together.");
    }
  }
}

// What ConjugateGradients asks of vectors, here those of the host. Sums are serial: the same order for any number
// of threads.

template <class Real>
double Dot(const std::vector<Real>& p, const std::vector<Real>& q)
{
  double sum = 0;
  for (std::size_t i = 0; i < p.size(); ++i)
  {
    sum += static_cast<double>(p[i]) * q[i];
  }
  return sum;
}

/// y <- y + alpha x
template <class Real>
void AddScaled(std::vector<Real>& y, double alpha, const std::vector<Real>& x)
{
  for (std::size_t i = 0; i < y.size(); ++i)
  {
    y[i] += static_cast<Real>(alpha * x[i]);
  }
}

/// y <- x + beta y
template <class Real>
void ScaleAndAdd(std::vector<Real>& y, double beta, const std::vector<Real>& x)
{
  for (std::size_t i = 0; i < y.size(); ++i)
  {
    y[i] = x[i] + static_cast<Real>(beta * y[i]);
  }
}

/// Reduces the squared weighted residual sum_p (1 - I_gt)^2 (S - S_gt)^2 by conjugate gradients on its normal
/// equations. `product(x, target)` returns sum_p omega w_i (sum_j w_j x_j - [target] S_gt) for every i: a
/// forward and a zeroth-moment backward pass, as std::optional; nothing means: stop here. Returns |gradient| at
/// the end over |gradient| at the start.
template <class Vector, class Product>
double ConjugateGradients(Vector& x, int iterations, Product&& product)
{
  const std::optional<Vector> gradient = product(x, true);
  if (!gradient)
  {
    return 1.0;
  }
  // The gradient g falls by alpha A d where x falls by alpha d; d are the directions, made of gradients.
  Vector g = *gradient, direction = *gradient;
  const double start = Dot(g, g);
  double now = start;
  for (int iteration = 0; iteration < iterations && now > 0; ++iteration)
  {
    const std::optional<Vector> image = product(direction, false);
    const double curvature = image ? Dot(direction, *image) : 0.0;
    if (!(curvature > 0))
    {
      break;
    }
    const double alpha = now / curvature;
    AddScaled(x, -alpha, direction);
    AddScaled(g, -alpha, *image);
    const double next = Dot(g, g);
    ScaleAndAdd(direction, next / now, g);
    now = next;
  }
  return start > 0 ? std::sqrt(now / start) : 0.0;
}

}  // namespace bigus
