// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/Hand.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>

#include "Core/Model/SlicePlane.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Random.h"

namespace bigus
{
namespace
{

/// Standard normal number `index` of a stream.
double TrackerNoise(std::uint64_t seed, std::uint64_t stream, std::uint64_t index)
{
  return Normal(Mix(Mix(Mix(seed) + stream) + index));
}

/// A smooth random motion in [-1, 1]: three slow sines (hertz) of random phase.
double Sway(std::uint64_t seed, std::uint64_t stream, double seconds)
{
  constexpr double kShare[3] = {0.5, 0.3, 0.2};
  constexpr double kHertz[3] = {0.21, 0.53, 0.92};
  double sum = 0;
  for (int m = 0; m < 3; ++m)
  {
    const double phase = OpenUniform(static_cast<std::uint32_t>(Mix(Mix(Mix(seed) + stream) + m)));
    sum += kShare[m] * std::sin(2 * kPi * (kHertz[m] * seconds + phase));
  }
  return sum;
}

enum Stream : std::uint64_t
{
  kSpeedStream = 101,
  kSwayStream = 111,           // and the four after it
  kPositionNoiseStream = 121,  // and the two after it
  kRotationNoiseStream = 131   // and the two after it
};

/// The pose of an image whose first row's middle is at `face` and whose axes are the columns of `axes`.
Eigen::Matrix4d PoseAt(const Eigen::Vector3d& face, const Eigen::Matrix3d& axes, const PhantomOptions& options)
{
  SlicePlane plane;
  plane.columnStep = options.pixelSize * axes.col(0);
  plane.rowStep = options.pixelSize * axes.col(1);
  plane.origin = face - 0.5 * (options.width - 1) * plane.columnStep;
  return plane.ImageToReference();
}

}  // namespace

HandPoses MoveHand(const PhantomOptions& o)
{
  HandPoses poses;
  std::vector<double> travel(o.frames, 0.0);
  for (int k = 1; k < o.frames; ++k)
  {
    travel[k] = travel[k - 1] + 1 + o.speedVariation * Sway(o.seed, kSpeedStream, (k - 0.5) / o.frameRate);
  }
  const double length = (o.frames - 1) * o.frameSpacing;
  const double scale = o.frames > 1 ? length / travel.back() : 0;

  const auto rotation = [](const Eigen::Vector3d& vector) -> Eigen::Matrix3d
  {
    const double angle = vector.norm();
    return angle > 0 ? Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix() : Eigen::Matrix3d::Identity();
  };
  const Eigen::Matrix3d turn = rotation(Eigen::Vector3d(0, o.sweepAngle * kRadiansPerDegree, 0));
  for (int k = 0; k < o.frames; ++k)
  {
    const double seconds = k / o.frameRate;
    Eigen::Vector3d angles, place;
    for (int axis = 0; axis < 3; ++axis)
    {
      angles[axis] = o.tilt * kRadiansPerDegree * Sway(o.seed, kSwayStream + axis, seconds);
    }
    place = {o.wander * Sway(o.seed, kSwayStream + 3, seconds), o.wander * Sway(o.seed, kSwayStream + 4, seconds),
             scale * travel[k] - 0.5 * length};
    const Eigen::Matrix3d axes = turn * rotation(angles[0] * Eigen::Vector3d::UnitX()) *
                                 rotation(angles[1] * Eigen::Vector3d::UnitY()) *
                                 rotation(angles[2] * Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d face = turn * place;
    poses.truth.push_back(PoseAt(face, axes, o));

    Eigen::Vector3d shift, twist;
    for (int axis = 0; axis < 3; ++axis)
    {
      shift[axis] = o.trackingNoise * TrackerNoise(o.seed, kPositionNoiseStream + axis, k);
      twist[axis] = o.trackingRotationNoise * kRadiansPerDegree * TrackerNoise(o.seed, kRotationNoiseStream + axis, k);
    }
    poses.recorded.push_back(PoseAt(face + shift, rotation(twist) * axes, o));
  }
  return poses;
}

}  // namespace bigus
