// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A rectangular grid of pixels in space: where a frame was taken, or where a slice is wanted.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstddef>
#include <string>

namespace bigus
{

/// Pixel (i, j) lies at  x(i, j) = origin + i * columnStep + j * rowStep  (mm, world frame).
/// Distances out of the plane are measured in mm along Normal().
struct SlicePlane
{
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();       ///< centre of pixel (0, 0), mm
  Eigen::Vector3d columnStep = Eigen::Vector3d::UnitX();  ///< mm per +1 in i (along a row); not zero
  Eigen::Vector3d rowStep = Eigen::Vector3d::UnitY();     ///< mm per +1 in j; not parallel to columnStep
  int width = 1;                                          ///< pixels in i, at least 1
  int height = 1;                                         ///< pixels in j, at least 1

  /// The plane whose pixel (i, j) is at M (i, j, 0, 1)^T, as in a tracked sequence's ImageToReference matrix.
  static SlicePlane FromImageToReference(const Eigen::Matrix4d& imageToReference, int width, int height);

  /// The inverse of FromImageToReference; the third column is Normal() (1 mm per unit).
  Eigen::Matrix4d ImageToReference() const;

  Eigen::Vector3d Point(double i, double j, double z = 0.0) const
  {
    return origin + i * columnStep + j * rowStep + z * Normal();
  }

  /// Unit vector columnStep x rowStep / |...|. The beam is symmetric, so its sign changes no image.
  Eigen::Vector3d Normal() const { return columnStep.cross(rowStep).normalized(); }

  /// The matrix T for which T (x - origin) = (i, j, z): the pixel (i, j) on which the point x (mm) stands, and its signed
  /// distance z (mm) along Normal(). Steps need not be orthogonal.
  Eigen::Matrix3d WorldToSlice() const;

  /// Geometric mean of the pixel sides, mm.
  double PixelSize() const { return std::sqrt(columnStep.cross(rowStep).norm()); }

  std::size_t NumberOfPixels() const { return static_cast<std::size_t>(width) * height; }

  /// How far along each axis pixels of a recorded frame may lie from the world's origin, mm: 1,000 km. Rounding moves them by
  /// up to 1e-7 mm there, and Gaussians trained on them stay within GaussianField::kLargestCoordinate.
  static constexpr double kFarthestFrame = 1e9;

  /// Whether all its pixels lie as near as recorded frames must.
  bool IsWithinReach() const;

  /// Throws Error, starting with `what` (for example "frame 12"), unless every number is finite, the steps span a plane
  /// (angle between them above 0.06 degrees) with sides from 1e-6 to 1e6 mm, and the size is positive.
  void Validate(const std::string& what) const;
};

/// An orthonormal frame of the plane: along its rows, in the plane across them, along its normal.
Eigen::Matrix3d AxesOf(const SlicePlane& plane);

/// `pose` moved as a plane that was `from` and is `to`. A motion, because a pose has a third column of its own.
Eigen::Matrix4d Followed(const Eigen::Matrix4d& pose, const SlicePlane& from, const SlicePlane& to);

/// The middle of the plane's pixels.
Eigen::Vector3d CentreOf(const SlicePlane& plane);

/// Sine of the angle below which two axes count as lying in a line, and three in a plane.
constexpr double kFlattestAxes = 1e-9;

/// The determinant of a matrix's three axes as if each had length 1: 0 where they lie in a plane or one is zero, below 0
/// where they are left-handed.
double Handedness(const Eigen::Matrix4d& matrix);

/// A picture has two axes, and the third of its pose may be none. Makes that where it is zero, lies in their plane or, unless
/// `keepsLeftHanded`, points the other way: of length 1, along the normal. Returns whether it was made.
bool MakeThirdAxis(Eigen::Matrix4d& imageToReference, bool keepsLeftHanded);

}  // namespace bigus
