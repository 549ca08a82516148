// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Echoes that change with the direction they are seen from: three more numbers a Gaussian. See ViewDependence.md.
#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// The planes that a field's reflectivities were learned from, as far as their directions and places count.
struct RecordedViews
{
  Eigen::Matrix3d mean =
      Eigen::Matrix3d::Identity();  ///< Rm: mean orientation; columns: row, column, normal of a plane
  double unit = 0;           ///< u, radian: root of the mean square of a component of log(Rm^T R) over the planes, > 0
  double angleStep = 0;      ///< degrees from a plane to the next, median, at least 0.25
  double elevationStep = 0;  ///< mm along the normal from a plane to the next, median, at least a pixel
  std::vector<Eigen::Matrix4d> poses;  ///< [K] rigid: a plane's axes, as in `mean`, and its image's centre, mm

  static constexpr std::size_t kMostPoses = 100000;

  /// Of these frames; `unit` is 0 where all have one orientation.
  static RecordedViews Of(const Sweep& sweep, const std::vector<int>& frames);

  /// delta = log(Rm^T R) / u, the plane's direction seen from the usual one.
  Eigen::Vector3d Direction(const SlicePlane& plane) const;
  /// Degrees that a plane is turned by from the recorded one that looks most alike.
  double Turn(const SlicePlane& plane) const;
  /// D, in steps: the least over recorded planes of the larger of angle and elevation, each in its step.
  double Distance(const SlicePlane& plane) const;
  /// a = clip(2 - D / 2, 0, 1): 1 near a recorded plane, 0 from four steps on, where what was learned of directions is no
  /// longer true.
  double Nearness(const SlicePlane& plane) const;
  /// What is usual at places: c, the mean of the recorded planes' directions weighted by
  /// exp(-z^2 / (2 (1.5 elevationStep)^2)) of the place's distance z from each; and over all places, with the same weights,
  /// the root of the mean square of each component of delta - c.
  struct Usual
  {
    std::vector<Eigen::Vector3d> directions;  ///< [places] c
    Eigen::Vector3d spread = Eigen::Vector3d::Zero();
  };
  Usual UsualAt(const std::vector<Eigen::Vector3d>& places) const;
  /// [K] of the recorded planes at a place, as for what is usual there; their sum is 1.
  std::vector<double> WeightsAt(const Eigen::Vector3d& place) const;
  /// [K] delta of the recorded planes.
  std::vector<Eigen::Vector3d> Directions() const;

  /// Throws Error naming the number unless all are finite, positive and rotations.
  void Validate() const;

  bool operator==(const RecordedViews& other) const
  {
    return mean == other.mean && unit == other.unit && angleStep == other.angleStep &&
           elevationStep == other.elevationStep && poses == other.poses;
  }
};

/// What a field knows of directions: r_i(P) = r_i + a(P) q_i . (delta(P) - c_i).
struct ViewDependence
{
  RecordedViews views;
  std::vector<Eigen::Vector3d> terms;  ///< [N] q, dimensionless

  /// Throws Error unless the views are valid and there is a finite q, of at most GaussianField::kLargestReflectivity, for
  /// each of so many Gaussians.
  void Validate(std::size_t gaussians) const;
};

/// A field's reflectivities at planes. Holds what does not depend on the plane.
class ViewedReflectivities
{
public:
  /// Throws Error unless `view` is of a field of as many Gaussians.
  ViewedReflectivities(const GaussianField& field, ViewDependence view);

  const ViewDependence& View() const { return view_; }
  /// a(P).
  double Nearness(const SlicePlane& plane) const { return view_.views.Nearness(plane); }
  /// [N] r_i(P) for this a, which may be 0.
  std::vector<double> At(const SlicePlane& plane, double nearness) const;

private:
  ViewDependence view_;
  std::vector<double> own_;             // r
  std::vector<Eigen::Vector3d> usual_;  // c
};

/// The view dependence of Transformed(field, transform): recorded planes and their mean turn with it; q stays.
/// A mirror turns every direction into its mirror image. The transform has passed Transformed.
ViewDependence Transformed(ViewDependence view, const Eigen::Matrix4d& transform);

}  // namespace bigus
