// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/FieldRounding.h"

#include <algorithm>
#include <cmath>

namespace bigus
{
namespace
{

/// Of a Gaussian's smallest scale: the step of its mean. A mean that is off by d changes a footprint by at most
/// 0.6 |r| d / s, here by 0.0012 |r|.
constexpr double kMeanStep = 1.0 / 256;
constexpr int kScaleBits = 11;  // a scale is off by 1/4096 of itself at most
constexpr double kRotationStep = 1.0 / 4096;
constexpr double kUnitSquare =
    2 * kRotationStep;                 // by so much rounding changes the square of a unit quaternion at most
constexpr int kReflectivityBits = 12;  // off by 1/8192 of itself at most
constexpr int kTermBits = 8;           // off by 1/512 of itself at most

double RoundToMultiple(double value, double step)
{
  return std::nearbyint(value / step) * step;
}

/// To so many significant bits.
double RoundToBits(double value, int bits)
{
  int exponent = 0;
  const double mantissa = std::frexp(value, &exponent);  // in [0.5, 1)
  return std::ldexp(std::nearbyint(std::ldexp(mantissa, bits)), exponent - bits);
}

}  // namespace

void RoundField(GaussianField& field)
{
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    Eigen::Vector3d& scale = field.scales[i];
    for (double& s : scale)
    {
      s = std::clamp(RoundToBits(s, kScaleBits), GaussianField::kSmallestScale, GaussianField::kLargestScale);
    }
    const double step = std::exp2(std::floor(std::log2(kMeanStep * scale.minCoeff())));
    for (double& x : field.means[i])
    {
      x = std::clamp(RoundToMultiple(x, step), -GaussianField::kLargestCoordinate, GaussianField::kLargestCoordinate);
    }
    Eigen::Vector4d& rotation = field.rotations[i];
    if (!(std::abs(rotation.squaredNorm() - 1) <= kUnitSquare))
    {
      rotation.stableNormalize();
    }
    for (double& q : rotation)
    {
      q = RoundToMultiple(q, kRotationStep);
    }
    double& r = field.reflectivities[i];
    r = std::clamp(RoundToBits(r, kReflectivityBits), -GaussianField::kLargestReflectivity,
                   GaussianField::kLargestReflectivity);
  }
}

void RoundView(ViewDependence& view)
{
  for (Eigen::Vector3d& term : view.terms)
  {
    for (double& q : term)
    {
      q = std::clamp(RoundToBits(q, kTermBits), -GaussianField::kLargestReflectivity,
                     GaussianField::kLargestReflectivity);
    }
  }
}

}  // namespace bigus
