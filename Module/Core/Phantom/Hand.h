// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The hand that moves the probe, and the tracker that watches it.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "Core/Phantom/PhantomOptions.h"

namespace bigus
{

struct HandPoses
{
  std::vector<Eigen::Matrix4d> truth;     ///< [frames] ImageToReference: where the probe was
  std::vector<Eigen::Matrix4d> recorded;  ///< [frames] ImageToReference: where the tracker says it was
};

/// `options` are valid and have their width and height.
HandPoses MoveHand(const PhantomOptions& options);

}  // namespace bigus
