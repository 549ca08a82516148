// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/Hand.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Random.h"

namespace bigus
{
namespace
{

enum HandStream : std::uint64_t
{
  kSpeedStream = 101,
  kSwayStream = 111,       // and the four after it
  kShakeStream = 191,      // and the two after it
  kShakeTurnStream = 201,  // and the two after it
};

}  // namespace

Eigen::Matrix3d RotationBy(const Eigen::Vector3d& vector)
{
  const double angle = vector.norm();
  return angle > 0 ? Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix() : Eigen::Matrix3d::Identity();
}

std::uint64_t RandomBits(std::uint64_t seed, std::uint64_t stream, std::uint64_t index)
{
  return Mix(Mix(Mix(seed) + stream) + index);
}

Eigen::Vector3d NormalVector(std::uint64_t seed, std::uint64_t stream, int index)
{
  Eigen::Vector3d vector;
  for (int axis = 0; axis < 3; ++axis)
  {
    vector[axis] = Normal(RandomBits(seed, stream + axis, index));
  }
  return vector;
}

std::vector<Eigen::Vector3d> NoiseOf(std::uint64_t seed, std::uint64_t stream, int first, int last, double correlation)
{
  const double r = correlation > 0 ? std::exp(-1 / correlation) : 0;
  std::vector<Eigen::Vector3d> noise(last + 1 - first);
  noise[-first] = NormalVector(seed, stream, 0);
  for (const int side : {1, -1})
  {
    for (int k = side; k >= first && k <= last; k += side)
    {
      noise[k - first] = r * noise[k - side - first] + std::sqrt(1 - r * r) * NormalVector(seed, stream, k);
    }
  }
  return noise;
}

double Sway(std::uint64_t seed, std::uint64_t stream, double time)
{
  constexpr double kShare[3] = {0.5, 0.3, 0.2};
  constexpr double kFrequency[3] = {0.21, 0.53, 0.92};
  double sum = 0;
  for (int m = 0; m < 3; ++m)
  {
    const double phase = OpenUniform(static_cast<std::uint32_t>(Mix(Mix(Mix(seed) + stream) + m)));
    sum += kShare[m] * std::sin(2 * kPi * (kFrequency[m] * time + phase));
  }
  return sum;
}

Hand::Hand(const PhantomOptions& options, int lastPicture, int margin)
    : options_(options),
      margin_(margin),
      length_(lastPicture * options.frameSpacing),
      travel_(static_cast<std::size_t>(margin) + lastPicture + 1 + margin, 0.0)
{
  const auto unevenness = [&](int from)
  { return options_.speedVariation * Sway(options_.seed, kSpeedStream, (from + 0.5) / options_.frameRate); };
  for (int p = 1; p <= lastPicture + margin; ++p)
  {
    travel_[margin + p] = travel_[margin + p - 1] + 1 + unevenness(p - 1);
  }
  for (int p = -1; p >= -margin; --p)
  {
    travel_[margin + p] = travel_[margin + p + 1] - 1 - unevenness(p);
  }
  if (options.shake > 0 || options.shakeRotation > 0)
  {
    const auto shaking = [&](std::uint64_t stream, double deviation)
    {
      std::vector<Eigen::Vector3d> noise =
          NoiseOf(options.seed, stream, -margin, lastPicture + margin, options.shakeCorrelation);
      for (Eigen::Vector3d& vector : noise)
      {
        vector *= deviation;
      }
      return noise;
    };
    shakes_ = shaking(kShakeStream, options.shake);
    turns_ = shaking(kShakeTurnStream, options.shakeRotation * kRadiansPerDegree);
  }
}

ProbePose Hand::At(double picture) const
{
  const PhantomOptions& o = options_;
  const int last = static_cast<int>(travel_.size()) - 1;
  const int before = std::clamp(static_cast<int>(std::floor(picture)) + margin_, 0, last);
  const int after = std::min(before + 1, last);
  const double share = picture + margin_ - before;
  const double travel = travel_[before] + share * (travel_[after] - travel_[before]);
  const double whole = travel_[last - margin_];
  const double scale = whole > 0 ? length_ / whole : 0;
  const double z = o.passes == 1 || !(whole > 0)
                       ? scale * travel - 0.5 * length_
                       : -0.5 * length_ / o.passes * std::cos(kPi * o.passes * travel / whole);

  const double seconds = picture / o.frameRate;
  Eigen::Vector3d angles;
  for (int axis = 0; axis < 3; ++axis)
  {
    angles[axis] = o.tilt * kRadiansPerDegree * Sway(o.seed, kSwayStream + axis, seconds);
  }
  const Eigen::Vector3d place(o.wander * Sway(o.seed, kSwayStream + 3, seconds),
                              o.wander * Sway(o.seed, kSwayStream + 4, seconds), z);
  const Eigen::Matrix3d turn = RotationBy(Eigen::Vector3d(0, o.sweepAngle * kRadiansPerDegree, 0));
  ProbePose pose;
  pose.axes = turn * RotationBy(angles[0] * Eigen::Vector3d::UnitX()) *
              RotationBy(angles[1] * Eigen::Vector3d::UnitY()) * RotationBy(angles[2] * Eigen::Vector3d::UnitZ());
  pose.face = turn * place;
  if (!shakes_.empty())
  {
    pose.face += shakes_[before] + share * (shakes_[after] - shakes_[before]);
    pose.axes = RotationBy(turns_[before] + share * (turns_[after] - turns_[before])) * pose.axes;
  }
  return pose;
}

}  // namespace bigus
