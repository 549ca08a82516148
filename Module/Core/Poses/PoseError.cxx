// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/PoseError.h"

#include <Eigen/Geometry>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Numerics/Constants.h"

namespace bigus
{
namespace
{

/// [3][4 a frame] the corners' pixels' centres, mm.
Eigen::Matrix3Xd Corners(const std::vector<Eigen::Matrix4d>& poses, int width, int height)
{
  Eigen::Matrix3Xd corners(3, 4 * poses.size());
  Eigen::Index n = 0;
  for (const Eigen::Matrix4d& pose : poses)
  {
    for (const int j : {0, height - 1})
    {
      for (const int i : {0, width - 1})
      {
        corners.col(n++) = (pose * Eigen::Vector4d(i, j, 0, 1)).head<3>();
      }
    }
  }
  return corners;
}

Eigen::Matrix3d AxesOf(const Eigen::Matrix4d& pose)
{
  return bigus::AxesOf(SlicePlane::FromImageToReference(pose, 1, 1));
}

}  // namespace

PoseError MeasurePoseError(const std::vector<Eigen::Matrix4d>& poses, const std::vector<Eigen::Matrix4d>& truth,
                           int width, int height)
{
  Require(!poses.empty() && poses.size() == truth.size(), "pose error: there are ", poses.size(), " poses and ",
          truth.size(), " true ones; it takes as many of each, and at least one.");
  PoseError error;
  for (std::size_t k = 0; k < poses.size(); ++k)
  {
    const Eigen::AngleAxisd turn(AxesOf(poses[k]) * AxesOf(truth[k]).transpose());
    error.angle += turn.angle() / kRadiansPerDegree / static_cast<double>(poses.size());
  }
  const Eigen::Matrix3Xd given = Corners(poses, width, height), actual = Corners(truth, width, height);
  const Eigen::Isometry3d motion(Eigen::umeyama(given, actual, false));
  error.distance = (given - actual).colwise().norm().mean();
  error.bending = (motion * given - actual).colwise().norm().mean();
  return error;
}

}  // namespace bigus
