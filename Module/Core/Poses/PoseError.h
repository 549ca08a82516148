// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How far poses are from known true ones.
#pragma once

#include <Eigen/Dense>
#include <vector>

namespace bigus
{

struct PoseError
{
  double distance = 0;  ///< mm, mean over frames and the four corners of the image
  double angle = 0;     ///< degrees, mean over frames: of the rotation from the true image axes to the given ones
  /// mm, the distance once the whole sweep has been moved rigidly to where it lies nearest to the truth. What is left
  /// bends the sweep in itself; what is gone only places it elsewhere in its reference frame, which blurs nothing.
  double bending = 0;
};

/// Compares ImageToReference matrices, frame by frame, of images of width x height pixels. Both sequences are of the
/// same, positive length, or Error is thrown.
PoseError MeasurePoseError(const std::vector<Eigen::Matrix4d>& poses, const std::vector<Eigen::Matrix4d>& truth,
                           int width, int height);

}  // namespace bigus
