// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where a block of Gaussians is, whether a plane can see it, and the plane in the block's own coordinates: in double,
// for host and device. Private to Core and Cuda.
#pragma once

#include <cmath>
#include <cstdint>

#include "Core/Formula/GaussianBlock.h"
#include "Core/Formula/Scalars.h"
#include "Core/Formula/Splat.h"

namespace bigus
{

/// A plane and beam, before they are reduced to a block's own coordinates.
struct Camera
{
  Vector3<double> origin, a, b, n, dualA, dualB;  ///< see View; origin in the world, mm
  double area;                                    ///< mm^2
  double variance;                                ///< sigma_E^2, mm^2
};

/// Where a block is and how far it reaches, for the tests that spare looking into it.
struct BlockPlace
{
  Vector3<double> centre;        ///< origin of the block's coordinates, mm
  Vector3<double> middle, half;  ///< box of its means, mm
  double variance;               ///< largest s^2, mm^2
  double logMagnitude;           ///< ln of the largest |r|
  int count;
};

/// Half-open ranges of pixels.
struct PixelBox
{
  std::int64_t columnBegin, columnEnd, rowBegin, rowEnd;
};

BIGUS_FORMULA bool Overlap(const PixelBox& p, const PixelBox& q)
{
  return p.columnEnd > q.columnBegin && p.columnBegin < q.columnEnd && p.rowEnd > q.rowBegin && p.rowBegin < q.rowEnd;
}

BIGUS_FORMULA double DotOfSizes(const Vector3<double>& p, const Vector3<double>& q)
{
  return std::abs(p.x) * q.x + std::abs(p.y) * q.y + std::abs(p.z) * q.z;
}

/// The pixels that a block can reach, and how far (squared, mm^2) a Gaussian of it may be from the plane.
struct Reach
{
  PixelBox box;
  double slab;
};

/// Whether a block can reach `tolerance` (given as its logarithm) on the plane, and where. The region where magnitude *
/// w >= tolerance is the slice of an ellipsoid k times the Gaussian's, thickened by the beam along the normal: it stays
/// within k s of the mean in the plane and within k sqrt(s^2 + sigma_E^2) across. T is the type in which footprints are
/// evaluated.
template <class T>
BIGUS_FORMULA bool Reaches(const BlockPlace& place, const Camera& camera, double logMagnitude, double logTolerance,
                           Reach& reach)
{
  const double cut = min(2 * (logMagnitude - logTolerance), static_cast<double>(kWholeCut<T>)) * 1.002;
  if (!(cut > 0))
  {
    return false;
  }
  reach.slab = cut * (place.variance + camera.variance);
  const Vector3<double> offset = MultiplyAdd(-1.0, camera.origin, place.middle);
  const double across = DotOfSizes(camera.n, place.half) + std::sqrt(reach.slab);
  if (!(std::abs(Dot(camera.n, offset)) <= across))
  {
    return false;
  }
  const double along = std::sqrt(cut * place.variance);
  const Vector3<double>* duals[2] = {&camera.dualA, &camera.dualB};
  std::int64_t limits[4];
  for (int k = 0; k < 2; ++k)
  {
    const double middle = Dot(*duals[k], offset);
    const double half = DotOfSizes(*duals[k], place.half) + along * std::sqrt(Dot(*duals[k], *duals[k]));
    const double low = min(max(middle - half, -1e15), 1e15), high = min(max(middle + half, -1e15), 1e15);
    limits[2 * k] = static_cast<std::int64_t>(std::ceil(low));
    limits[2 * k + 1] = static_cast<std::int64_t>(std::floor(high)) + 1;
  }
  reach.box = {limits[0], limits[1], limits[2], limits[3]};
  return true;
}

template <class U>
BIGUS_FORMULA Vector3<U> Narrowed(const Vector3<double>& v)
{
  return {static_cast<U>(v.x), static_cast<U>(v.y), static_cast<U>(v.z)};
}

/// The view in the block's coordinates, relative to the pixel (column, row) nearest to the block's centre, which lies
/// within kLargestImage / 4 of pixel (0, 0), so that sums of whole numbers stay exact in float.
template <class U>
BIGUS_FORMULA View<U> LocalView(const Camera& camera, const BlockPlace& place, std::int32_t& column, std::int32_t& row)
{
  const Vector3<double> centre = MultiplyAdd(-1.0, camera.origin, place.centre);
  const double far = kLargestImage / 4;
  const double u = std::round(min(max(Dot(camera.dualA, centre), -far), far));
  const double v = std::round(min(max(Dot(camera.dualB, centre), -far), far));
  column = static_cast<std::int32_t>(u);
  row = static_cast<std::int32_t>(v);
  const Vector3<double> pixel = MultiplyAdd(u, camera.a, Scaled(v, camera.b));
  return {Narrowed<U>(MultiplyAdd(-1.0, centre, pixel)),
          Narrowed<U>(camera.a),
          Narrowed<U>(camera.b),
          Narrowed<U>(camera.n),
          Narrowed<U>(camera.dualA),
          Narrowed<U>(camera.dualB),
          static_cast<U>(camera.area),
          static_cast<U>(camera.variance)};
}

}  // namespace bigus
