// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The tracker that watches the hand, and its errors.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "Core/Phantom/PhantomOptions.h"

namespace bigus
{

struct TrackedPoses
{
  std::vector<Eigen::Matrix4d> truth;     ///< [frames] ImageToReference: where the probe was
  std::vector<Eigen::Matrix4d> recorded;  ///< [frames] ImageToReference: where the tracker says it was
  std::vector<double> timestamps;         ///< [frames] seconds, of the pictures
};

/// `options` are valid and have their width and height.
TrackedPoses TrackHand(const PhantomOptions& options);

}  // namespace bigus
