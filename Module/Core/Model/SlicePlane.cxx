// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/SlicePlane.h"

#include "Core/Model/Error.h"

namespace bigus
{

SlicePlane SlicePlane::FromImageToReference(const Eigen::Matrix4d& m, int width, int height)
{
  SlicePlane plane;
  plane.columnStep = m.block<3, 1>(0, 0);
  plane.rowStep = m.block<3, 1>(0, 1);
  plane.origin = m.block<3, 1>(0, 3);
  plane.width = width;
  plane.height = height;
  return plane;
}

Eigen::Matrix4d SlicePlane::ImageToReference() const
{
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.block<3, 1>(0, 0) = columnStep;
  m.block<3, 1>(0, 1) = rowStep;
  m.block<3, 1>(0, 2) = Normal();
  m.block<3, 1>(0, 3) = origin;
  return m;
}

Eigen::Matrix3d SlicePlane::WorldToSlice() const
{
  Eigen::Matrix3d basis;
  basis << columnStep, rowStep, Normal();
  return basis.inverse();
}

bool SlicePlane::IsWithinReach() const
{
  for (const double i : {0.0, width - 1.0})
  {
    for (const double j : {0.0, height - 1.0})
    {
      const Eigen::Vector3d corner = origin + i * columnStep + j * rowStep;
      if (!(corner.cwiseAbs().maxCoeff() <= kFarthestFrame))
      {
        return false;
      }
    }
  }
  return true;
}

void SlicePlane::Validate(const std::string& what) const
{
  Require(width >= 1 && height >= 1, what, ": the image is ", width, " x ", height,
          " pixels; both sides must be at least 1.");
  Require(origin.allFinite() && columnStep.allFinite() && rowStep.allFinite(), what,
          ": the pose holds a value that is not finite; check the tracker's transforms.");
  const double a = columnStep.norm();
  const double b = rowStep.norm();
  Require(a >= 1e-6 && a <= 1e6 && b >= 1e-6 && b <= 1e6, what, ": a pixel measures ", a, " x ", b,
          " mm; each side must lie between 1e-6 and 1e6 mm. Is the pose singular or in other units?");
  Require(columnStep.cross(rowStep).norm() >= 1e-3 * a * b, what,
          ": the image's rows and columns are parallel, so the pose is singular.");
}

Eigen::Matrix3d AxesOf(const SlicePlane& plane)
{
  Eigen::Matrix3d axes;
  axes.col(0) = plane.columnStep.normalized();
  axes.col(2) = plane.Normal();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

Eigen::Matrix4d Followed(const Eigen::Matrix4d& pose, const SlicePlane& from, const SlicePlane& to)
{
  Eigen::Affine3d motion = Eigen::Affine3d::Identity();
  motion.linear() = AxesOf(to) * AxesOf(from).transpose();
  motion.translation() = to.origin - motion.linear() * from.origin;
  return motion.matrix() * pose;
}

Eigen::Vector3d CentreOf(const SlicePlane& plane)
{
  return plane.Point(0.5 * (plane.width - 1), 0.5 * (plane.height - 1));
}

double Handedness(const Eigen::Matrix4d& matrix)
{
  const Eigen::Matrix3d axes = matrix.topLeftCorner<3, 3>();
  const double volume = axes.col(0).norm() * axes.col(1).norm() * axes.col(2).norm();
  return volume > 0 ? axes.determinant() / volume : 0;
}

bool MakeThirdAxis(Eigen::Matrix4d& imageToReference, bool keepsLeftHanded)
{
  const double handedness = Handedness(imageToReference);
  if (handedness > kFlattestAxes || (keepsLeftHanded && handedness < -kFlattestAxes))
  {
    return false;
  }
  imageToReference.block<3, 1>(0, 2) = SlicePlane::FromImageToReference(imageToReference, 1, 1).Normal();
  return true;
}

}  // namespace bigus
