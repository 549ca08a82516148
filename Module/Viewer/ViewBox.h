// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where a field lies, along directions that suit its sweep.
#pragma once

#include <Eigen/Dense>

#include "Core/Model/Sweep.h"

class vtkPolyData;

namespace bigus::command
{

struct ViewBox
{
  /// Unit vectors: across the middle frame, down it, and along the sweep; without a sweep x, y and z.
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm
  Eigen::Vector3d size = Eigen::Vector3d::Ones();    ///< along these axes, mm, at least 1
  /// From where places are told: the middle of the middle frame's first row, at the probe; without a sweep the world's origin.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();

  bool Holds(const Eigen::Vector3d& point) const
  {
    return ((axes.transpose() * (point - centre)).cwiseAbs() - 0.5 * size).maxCoeff() <= 0;
  }
};

/// The box that holds the Gaussians' centres but for a few strays, with a margin. `sweep` may be null.
ViewBox BoxOfField(vtkPolyData* field, const Sweep* sweep);

/// The share of the sweep's lit pixels that lie in the box, by samples.
double ShareInside(const ViewBox& box, const Sweep& sweep);

}  // namespace bigus::command
