// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/Tracker.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "Core/Model/SlicePlane.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Random.h"
#include "Core/Phantom/Hand.h"
#include "Core/Poses/Alignment.h"

namespace bigus
{
namespace
{

// Of Sway's fastest sine a sweep sees 1.5 periods then, of its slowest a third.
constexpr double kDriftTimePerSweep = 1.6;

enum TrackerStream : std::uint64_t
{
  kPositionNoiseStream = 121,  // and the two after it
  kRotationNoiseStream = 131,  // and the two after it
  kPositionDriftStream = 141,  // and the two after it
  kRotationDriftStream = 151,  // and the two after it
  kOutlierStream = 161,
  kOutlierDirectionStream = 171,  // and the two after it
  kDropStream = 181
};

/// Which picture each frame is: k itself when none is dropped.
std::vector<int> KeptPictures(const PhantomOptions& o)
{
  std::vector<int> pictures;
  for (int picture = 0; static_cast<int>(pictures.size()) < o.frames; ++picture)
  {
    const auto bits = static_cast<std::uint32_t>(RandomBits(o.seed, kDropStream, picture));
    if (picture == 0 || OpenUniform(bits) >= o.droppedShare)
    {
      pictures.push_back(picture);
    }
  }
  return pictures;
}

/// [frames] whether the tracker is far off there; the stated share, to the nearest frame.
std::vector<bool> ChooseOutliers(const PhantomOptions& o)
{
  std::vector<std::pair<std::uint64_t, int>> order;
  for (int k = 0; k < o.frames; ++k)
  {
    order.emplace_back(RandomBits(o.seed, kOutlierStream, k), k);
  }
  std::sort(order.begin(), order.end());
  std::vector<bool> isOutlier(o.frames, false);
  for (int n = 0; n < std::lround(o.outlierShare * o.frames); ++n)
  {
    isOutlier[order[n].second] = true;
  }
  return isOutlier;
}

/// Multiples of `quantum`, component by component.
Eigen::Vector3d Rounded(const Eigen::Vector3d& vector, double quantum)
{
  return (vector / quantum).array().round() * quantum;
}

ProbePose Quantised(ProbePose pose, const PhantomOptions& o)
{
  if (o.trackingQuantum > 0)
  {
    pose.face = Rounded(pose.face, o.trackingQuantum);
  }
  if (o.trackingRotationQuantum > 0)
  {
    const Eigen::AngleAxisd turn(pose.axes);
    pose.axes = RotationBy(Rounded(turn.angle() * turn.axis(), o.trackingRotationQuantum * kRadiansPerDegree));
  }
  return pose;
}

SlicePlane PlaneOf(const ProbePose& pose, const PhantomOptions& o)
{
  SlicePlane plane;
  plane.width = o.width;
  plane.height = o.height;
  plane.columnStep = o.pixelSize * pose.axes.col(0);
  plane.rowStep = o.pixelSize * pose.axes.col(1);
  plane.origin = pose.face - 0.5 * (o.width - 1) * plane.columnStep;
  return plane;
}

}  // namespace

TrackedPoses TrackHand(const PhantomOptions& o)
{
  const std::vector<int> pictures = KeptPictures(o);
  const std::vector<bool> isOutlier = ChooseOutliers(o);
  const double delay = o.trackingDelay * o.frameRate;  // pictures
  const Hand hand(o, pictures.back(), static_cast<int>(std::ceil(std::abs(delay))) + 1);
  const Eigen::Vector3d calibrationShift(o.calibrationShift.data()), calibrationTurn(o.calibrationRotation.data());
  const bool isCalibrated = calibrationShift.isZero(0) && calibrationTurn.isZero(0);

  const std::vector<Eigen::Vector3d> shifts =
      NoiseOf(o.seed, kPositionNoiseStream, 0, o.frames - 1, o.noiseCorrelation);
  const std::vector<Eigen::Vector3d> turns = NoiseOf(o.seed, kRotationNoiseStream, 0, o.frames - 1, o.noiseCorrelation);

  TrackedPoses poses;
  for (int k = 0; k < o.frames; ++k)
  {
    poses.timestamps.push_back(pictures[k] / o.frameRate);
    poses.truth.push_back(PlaneOf(hand.At(pictures[k]), o).ImageToReference());

    Eigen::Vector3d shift = o.trackingNoise * shifts[k];
    Eigen::Vector3d twist = o.trackingRotationNoise * kRadiansPerDegree * turns[k];
    const double time = kDriftTimePerSweep * pictures[k] / std::max(1, pictures.back());
    for (int axis = 0; axis < 3; ++axis)
    {
      shift[axis] += o.trackingDrift * Sway(o.seed, kPositionDriftStream + axis, time);
      twist[axis] += o.trackingRotationDrift * kRadiansPerDegree * Sway(o.seed, kRotationDriftStream + axis, time);
    }
    if (isOutlier[k])
    {
      shift += o.outlierSize * NormalVector(o.seed, kOutlierDirectionStream, k).normalized();
    }
    ProbePose seen = hand.At(pictures[k] - delay);
    seen.face += shift;
    seen.axes = RotationBy(twist) * seen.axes;
    const SlicePlane plane = PlaneOf(Quantised(seen, o), o);
    poses.recorded.push_back(
        (isCalibrated ? plane : Moved(plane, calibrationShift, calibrationTurn)).ImageToReference());
  }
  return poses;
}

}  // namespace bigus
