// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What `bigus view` can show and hide in its scene.
#pragma once

#include <string>
#include <vector>

namespace bigus::command
{

/// Names of --show; keys 1, 2, ... in the window.
inline const std::vector<std::string> kViewParts = {"ellipsoids", "volume", "slice", "frames", "planes", "beam"};

}  // namespace bigus::command
