// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Random fields, planes and sweeps for tests; everything follows from a seed.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"

namespace bigus::test
{

class Random
{
public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double Uniform(double low = 0, double high = 1)
  {
    return low + (high - low) * std::uniform_real_distribution<double>()(engine_);
  }
  double LogUniform(double low, double high) { return std::exp(Uniform(std::log(low), std::log(high))); }
  Eigen::Vector4d UnitQuaternion()
  {
    std::normal_distribution<double> normal;
    return Eigen::Vector4d(normal(engine_), normal(engine_), normal(engine_), normal(engine_)).normalized();
  }
  Eigen::Vector3d Vector(double half) { return {Uniform(-half, half), Uniform(-half, half), Uniform(-half, half)}; }

private:
  std::mt19937_64 engine_;
};

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

/// Frames of random float intensities in [low, high] at the given planes, all of one size.
inline std::shared_ptr<Sweep> RandomSweep(Random& random, const std::vector<SlicePlane>& planes, double low,
                                          double high)
{
  auto sweep = std::make_shared<Sweep>();
  sweep->width = planes[0].width;
  sweep->height = planes[0].height;
  sweep->pixelType = Sweep::PixelType::Float32;
  auto pixels = std::make_shared<std::vector<float>>();
  for (const SlicePlane& plane : planes)
  {
    sweep->imageToReference.push_back(plane.ImageToReference());
    for (std::size_t i = 0; i < plane.NumberOfPixels(); ++i)
    {
      pixels->push_back(static_cast<float>(random.Uniform(low, high)));
    }
  }
  sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
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
