// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field cut into blocks of neighbours, as the fast engines hold it: the host's part. Private to Core and Cuda.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Formula/BlockReach.h"
#include "Core/Model/Error.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"

namespace bigus
{

inline Vector3<double> ToVector(const Eigen::Vector3d& v)
{
  return {v[0], v[1], v[2]};
}

inline Camera CameraOf(const SlicePlane& plane, const Beam& beam)
{
  const Eigen::Matrix3d t = plane.WorldToSlice();
  return {ToVector(plane.origin),
          ToVector(plane.columnStep),
          ToVector(plane.rowStep),
          ToVector(plane.Normal()),
          ToVector(t.row(0)),
          ToVector(t.row(1)),
          plane.columnStep.cross(plane.rowStep).norm(),
          beam.Variance(plane.Normal())};
}

inline std::size_t NumberOfBlocks(std::size_t gaussians)
{
  return (gaussians + kBlock - 1) / kBlock;
}

/// Where block b of a field in `order` is, all but what its Gaussians' sizes and reflectivities say.
inline BlockPlace PlaceOf(const GaussianField& field, const std::vector<std::uint32_t>& order, std::size_t b)
{
  const std::size_t first = b * kBlock;
  BlockPlace place{};
  place.count = static_cast<int>(std::min<std::size_t>(kBlock, order.size() - first));
  Eigen::Vector3d low = field.means[order[first]], high = low;
  for (int k = 1; k < place.count; ++k)
  {
    low = low.cwiseMin(field.means[order[first + k]]);
    high = high.cwiseMax(field.means[order[first + k]]);
  }
  place.centre = ToVector(low + 0.5 * (high - low));
  return place;
}

template <class U>
void PackBlock(const GaussianField& field, const std::vector<std::uint32_t>& order, std::size_t b,
               const BlockPlace& place, GaussianBlock<U>& block)
{
  const Eigen::Vector3d centre(place.centre.x, place.centre.y, place.centre.z);
  for (int k = 0; k < place.count; ++k)
  {
    const std::size_t i = order[b * kBlock + k];
    const Eigen::Vector4d q = field.rotations[i].stableNormalized();
    for (int axis = 0; axis < 3; ++axis)
    {
      block.mean[axis][k] = static_cast<U>(field.means[i][axis] - centre[axis]);
      block.logScale[axis][k] =
          static_cast<U>(std::log(std::clamp(field.scales[i][axis], kSmallestScale, kLargestScale)));
    }
    for (int part = 0; part < 4; ++part)
    {
      block.rotation[part][k] = static_cast<U>(q[part]);
    }
    block.reflectivity[k] = static_cast<U>(field.reflectivities[i]);
  }
  for (int k = place.count; k < kBlock; ++k)
  {
    block.rotation[0][k] = U(1);  // a sound Gaussian of no reflectivity
  }
}

/// Gaussian k of a block into the field's Gaussian i.
template <class U>
void UnpackGaussian(const GaussianBlock<U>& block, int k, const BlockPlace& place, std::size_t i, GaussianField& field)
{
  const Eigen::Vector3d centre(place.centre.x, place.centre.y, place.centre.z);
  field.means[i] = centre + Eigen::Vector3d(block.mean[0][k], block.mean[1][k], block.mean[2][k]);
  for (int axis = 0; axis < 3; ++axis)
  {
    field.scales[i][axis] = std::exp(static_cast<double>(block.logScale[axis][k]));
  }
  for (int part = 0; part < 4; ++part)
  {
    field.rotations[i][part] = block.rotation[part][k];
  }
  field.reflectivities[i] = block.reflectivity[k];
}

/// Gradients by block into the field's order; none of no blocks.
template <class T>
FieldGradient GradientOf(const std::vector<GradientBlock<T>>& blocks, const std::vector<std::uint32_t>& order)
{
  FieldGradient out;
  const std::size_t n = blocks.empty() ? 0 : order.size();
  out.means.resize(n);
  out.logScales.resize(n);
  out.rotations.resize(n);
  out.reflectivities.resize(n);
  for (std::size_t slot = 0; slot < n; ++slot)
  {
    double values[kParametersPerGaussian];
    for (int k = 0; k < kParametersPerGaussian; ++k)
    {
      values[k] = blocks[slot / kBlock].values[k][slot % kBlock];
    }
    const GaussianGradient<double> g = FromArray(values);
    const std::size_t i = order[slot];
    out.means[i] = {g.mean.x, g.mean.y, g.mean.z};
    out.logScales[i] = {g.logScale.x, g.logScale.y, g.logScale.z};
    out.rotations[i] = {g.rotation.x, g.rotation.y, g.rotation.z};
    out.reflectivities[i] = g.reflectivity;
  }
  return out;
}

/// Scores by block into the field's order; zeros of no blocks.
template <class T>
Engine::Scores ScoresOf(const std::vector<ScoreBlock<T>>& blocks, const std::vector<std::uint32_t>& order)
{
  Engine::Scores out;
  out.error.resize(order.size(), 0.0);
  out.descent.resize(order.size(), Eigen::Vector3d::Zero());
  out.visits.resize(order.size(), 0.0);
  for (std::size_t slot = 0; slot < (blocks.empty() ? 0 : order.size()); ++slot)
  {
    const ScoreBlock<T>& scores = blocks[slot / kBlock];
    const std::size_t k = slot % kBlock, i = order[slot];
    out.error[i] = scores.error[k];
    out.descent[i] = {scores.descent[0][k], scores.descent[1][k], scores.descent[2][k]};
    out.visits[i] = scores.visits[k];
  }
  return out;
}

/// For every slot of a restructured field in `order`: the slot whose optimizer state it inherits, in the field that
/// `oldOrder` is of, or -1 for a fresh one. See Engine::SetField.
inline std::vector<std::int64_t> InheritedSlots(const std::vector<std::uint32_t>& oldOrder,
                                                const std::vector<std::uint32_t>& order,
                                                const std::vector<int>& parents)
{
  Require(parents.size() == order.size(), "Engine: ", parents.size(), " parents for ", order.size(), " Gaussians.");
  std::vector<std::uint32_t> slotOf(oldOrder.size());
  for (std::size_t slot = 0; slot < oldOrder.size(); ++slot)
  {
    slotOf[oldOrder[slot]] = static_cast<std::uint32_t>(slot);
  }
  std::vector<std::int64_t> inherited(order.size(), -1);
  for (std::size_t slot = 0; slot < order.size(); ++slot)
  {
    const int parent = parents[order[slot]];
    if (parent >= 0 && static_cast<std::size_t>(parent) < slotOf.size())
    {
      inherited[slot] = slotOf[parent];
    }
  }
  return inherited;
}

}  // namespace bigus
