// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/PoseAxes.h"

#include "Core/Model/SlicePlane.h"

namespace bigus
{

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
