// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What was done to the poses of a sweep, on one page to look at.
#pragma once

#include <string>
#include <vector>

#include "Core/Deciding/PoseCorrection.h"
#include "Core/Model/Sweep.h"
#include "Core/Numerics/Page.h"

namespace bigus
{

/// Draws the path of the images' centres before and after, by how much each pose was moved along the image's axes, and what
/// pictures say of every step. `poses` are those after, one a frame of the recorded sweep, which has at least one; its
/// pixels are not looked at.
Page DrawPoses(const Sweep& recorded, const std::vector<Eigen::Matrix4d>& poses, const std::vector<PoseStep>& steps,
               const std::string& title);

}  // namespace bigus
