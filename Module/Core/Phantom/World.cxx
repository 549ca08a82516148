// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/World.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace bigus
{
namespace
{

constexpr TissueProperties kProperties[] = {
    {1.0, 1.0, 1.0},    // Parenchyma
    {1.0, 0.06, 0.3},   // Vessel: -24 dB
    {0.0, 0.0, 0.0},    // Cyst
    {1.0, 10.0, 20.0},  // Boundary: +20 dB
    {0.3, 0.3, 30.0},   // Bone
    {0.6, 2.8, 0.9},    // Tumour: coarser and brighter, +6.7 dB
};

/// A tube of constant radius, mm.
struct Tube
{
  double from[3], to[3];
  double radius;
};

constexpr Tube kVessels[] = {
    {{8, 15, -40}, {5, 17, -10}, 3.0},   // trunk,
    {{5, 17, -10}, {2, 19, 6}, 2.8},     // to where it forks
    {{2, 19, 6}, {-3, 23, 40}, 2.2},     // first branch
    {{2, 19, 6}, {13, 16, 17}, 1.9},     // second branch,
    {{13, 16, 17}, {26, 14, 40}, 1.6},   // its end
    {{-40, 44, 8}, {-9, 43, -3}, 1.7},   // a vessel that crosses below,
    {{-9, 43, -3}, {9, 45, -8}, 1.5},    // its middle
    {{9, 45, -8}, {40, 42, 2}, 1.3},     // and end,
    {{-9, 43, -3}, {-4, 48, -30}, 1.2},  // and a twig of it
};
constexpr Tube kRib = {{-19, 15, -60}, {-15, 13, 60}, 4.0};
constexpr double kBoundaryThickness = 0.5;  // mm
constexpr double kCystCentre[3] = {-4, 33, 3};
constexpr double kCystRadii[3] = {6.5, 5.5, 7};
constexpr double kTumourCentre[3] = {14, 31, -2};
constexpr double kTumourRadii[3] = {7, 6, 8};

/// Infinity beyond the box around a tube, where most points lie and no more is asked of them.
double SquaredDistanceToAxis(const Tube& tube, const Eigen::Vector3d& p)
{
  const double* at = p.data();
  for (int k = 0; k < 3; ++k)
  {
    const auto [low, high] = std::minmax(tube.from[k], tube.to[k]);
    if (at[k] < low - tube.radius || at[k] > high + tube.radius)
    {
      return std::numeric_limits<double>::infinity();
    }
  }
  const Eigen::Vector3d from(tube.from), axis = Eigen::Vector3d(tube.to) - from;
  const double along = std::clamp((p - from).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (p - from - along * axis).squaredNorm();
}

/// Squared distance from an ellipsoid's centre, its surface being at 1.
double EllipsoidLevel(const double centre[3], const double radii[3], const Eigen::Vector3d& p)
{
  return ((p - Eigen::Vector3d(centre)).array() / Eigen::Array3d(radii)).square().sum();
}

}  // namespace

const TissueProperties& PropertiesOf(Tissue tissue)
{
  return kProperties[static_cast<int>(tissue)];
}

Tissue OrganAt(const Eigen::Vector3d& p)
{
  const double rib = SquaredDistanceToAxis(kRib, p);
  if (rib < kRib.radius * kRib.radius)
  {
    const double inner = kRib.radius - kBoundaryThickness;
    return rib < inner * inner ? Tissue::Bone : Tissue::Boundary;
  }
  if (EllipsoidLevel(kCystCentre, kCystRadii, p) < 1)
  {
    return Tissue::Cyst;
  }
  const double tumour = EllipsoidLevel(kTumourCentre, kTumourRadii, p);
  if (tumour < 1.5)
  {
    // Lobes: the surface waves by a tenth of the radius.
    const double lobes = 1 + 0.2 * std::sin(0.9 * p[0]) * std::sin(0.8 * p[1] + 1) * std::sin(0.7 * p[2] + 2);
    if (tumour < lobes)
    {
      return Tissue::Tumour;
    }
  }
  for (const Tube& vessel : kVessels)
  {
    if (SquaredDistanceToAxis(vessel, p) < vessel.radius * vessel.radius)
    {
      return Tissue::Vessel;
    }
  }
  return Tissue::Parenchyma;
}

double ParenchymaTexture(const Eigen::Vector3d& p)
{
  return 1 + 0.23 * std::sin(0.33 * p[0] + 0.5) * std::sin(0.29 * p[1]) * std::sin(0.24 * p[2] + 1.1);
}

}  // namespace bigus
