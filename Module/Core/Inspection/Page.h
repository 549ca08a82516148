// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What an inspection found, on one page to look at.
#pragma once

#include <string>
#include <vector>

#include "Core/Inspection/Inspection.h"
#include "Core/Numerics/Page.h"

namespace bigus
{

/// Draws frames along time, the way from frame to frame, pixels that were filled, and every finding in words, each kind in
/// its colour. `numbers` says how frames are called.
Page DrawPage(const InspectedSweep& inspected, const std::vector<int>& numbers, const std::string& title);

}  // namespace bigus
