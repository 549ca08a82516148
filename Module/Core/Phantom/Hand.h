// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The hand that moves the probe. Private to this room.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

#include "Core/Phantom/PhantomOptions.h"

namespace bigus
{

/// Where a probe is: the middle of the image's first row, mm, and the directions of rows, beams and normal as columns.
struct ProbePose
{
  Eigen::Vector3d face;
  Eigen::Matrix3d axes;
};

/// The rotation by |vector| radians about `vector`.
Eigen::Matrix3d RotationBy(const Eigen::Vector3d& vector);

/// What follows from a seed, a stream and a whole number.
std::uint64_t RandomBits(std::uint64_t seed, std::uint64_t stream, std::uint64_t index);

/// Normal with standard deviation 1 on each axis; of three streams, from `stream` on.
Eigen::Vector3d NormalVector(std::uint64_t seed, std::uint64_t stream, int index);

/// [last + 1 - first], first <= 0 <= last: e_0 = w_0 and, away from 0 to both sides, e_k = r e_(k-+1) + sqrt(1 - r^2) w_k
/// with w a NormalVector and r = exp(-1 / correlation), or 0 where that is 0. So it is as strong everywhere, and what lies
/// between does not depend on first and last.
std::vector<Eigen::Vector3d> NoiseOf(std::uint64_t seed, std::uint64_t stream, int first, int last, double correlation);

/// A smooth random motion in [-1, 1] that follows from seed and stream: three slow sines of random phase, of 0.21, 0.53
/// and 0.92 periods in a unit of time.
double Sway(std::uint64_t seed, std::uint64_t stream, double time);

/// The motion of a sweep. Pictures are taken at a constant rate; picture p at p / frameRate seconds.
class Hand
{
public:
  /// `options` are valid; the sweep's last picture is `lastPicture`. `margin` pictures before the first and after the
  /// last can be asked for, too.
  Hand(const PhantomOptions& options, int lastPicture, int margin);

  /// Between two pictures the hand travels, and shakes, at constant speed.
  ProbePose At(double picture) const;

private:
  PhantomOptions options_;
  int margin_;
  double length_;               // of the path, mm
  std::vector<double> travel_;  // [margin + pictures + margin] along the path, in steps of average length
  std::vector<Eigen::Vector3d> shakes_,
      turns_;  // the same: mm and radians about the path; empty where it does not shake
};

}  // namespace bigus
