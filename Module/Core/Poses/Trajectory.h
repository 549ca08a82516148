// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The path of the probe: a smooth motion without the tracker's noise, from the recorded poses alone. No pixel is read.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <memory>
#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// What orders frames along the path.
enum class FrameClock
{
  Times,   ///< Sweep::timestamps: dropped frames leave wide steps, stalls short ones
  Numbers  ///< the frames' numbers: images came evenly, whatever the recorded times say
};

/// Whether the sweep's times can order its frames: there is one for every frame, each later than the one before, and no
/// step is longer than 1000 median steps.
bool HasUsableTimes(const Sweep& sweep);

struct TrajectoryOptions
{
  /// How strongly noise is taken out, 0 to 1000, in units of what the sweep itself tells: 1 assumes the estimated noise,
  /// 2 twice that. 0 keeps every pose.
  double strength = 1;
  FrameClock clock = FrameClock::Times;  ///< without usable times the frames' numbers count

  /// Throws Error naming the option, its value and its range.
  void Validate() const;
};

/// Poses without noise and what was found about the tracker. Vectors have one element for every frame of the sweep.
struct Trajectory
{
  std::vector<Eigen::Matrix4d> imageToReference;  ///< as Sweep's; scale and shear are those of the recorded pose
  std::vector<double> displacement;  ///< mm that the image's corners moved from where they were recorded, mean of four
  std::vector<double> rotation;      ///< degrees between the recorded and the new orientation
  std::vector<std::uint8_t> isOutlier;  ///< 1: recorded so far off that the pose follows from its neighbours
  std::vector<int> stroke;              ///< number, from 0, of the continuous motion that the frame belongs to
  /// The tracker's noise. Not a number where it is unknown: fewer than 8 poses lie in strokes of 5 and more.
  double translationNoise = 0;  ///< mm, standard deviation on each axis of the recorded place of `pivot`, but outliers'
  double translationLeft = 0;   ///< mm: the standard deviation left in imageToReference
  double rotationNoise = 0;     ///< degrees, the same of the recorded orientation
  double cornerNoise = 0;       ///< mm: what both make at the image's corners, root mean square of the distance
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();  ///< mm, in the image's axes (along its rows, across them in the
                                                    ///< plane, along its normal) from its centre: where noise of place
                                                    ///< and of orientation do not depend on each other; near what is
                                                    ///< tracked
  FrameClock clock = FrameClock::Numbers;           ///< what was used
  bool isStepped = false;                           ///< motion in equal steps, as of a motor: every pose is kept

  bool IsNoiseKnown() const { return translationNoise == translationNoise; }
  bool IsChanged() const;  ///< whether any pose is not the recorded one
};

/// A smooth path through the recorded poses of all frames (its model is in Trajectory.md). A stroke ends where the path
/// jumps, breaks or turns back; each is smoothed on its own, and one shorter than 5 frames is kept. Poses are also kept,
/// bit for bit, where motion is stepped or noise is below what matters. The same for every number of threads. O(n).
/// Throws Error for options out of range and poses that SlicePlane::Validate refuses.
Trajectory SmoothTrajectory(const Sweep& sweep, const TrajectoryOptions& options = {});

/// The same at several strengths: noise and smoothness are estimated once, when this is made.
class TrajectorySmoother
{
public:
  /// The sweep must outlive this. Throws Error as SmoothTrajectory.
  TrajectorySmoother(const Sweep& sweep, FrameClock clock);
  ~TrajectorySmoother();
  TrajectorySmoother(const TrajectorySmoother&) = delete;
  TrajectorySmoother& operator=(const TrajectorySmoother&) = delete;

  Trajectory At(double strength);

private:
  struct State;
  std::unique_ptr<State> state_;
};

/// mm between the corners of images at two poses, mean of the four.
double CornerDistance(const Eigen::Matrix4d& a, const Eigen::Matrix4d& b, int width, int height);

}  // namespace bigus
