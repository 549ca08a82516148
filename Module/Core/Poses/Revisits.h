// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Frames that lie where the probe was at another time. Private to Core.
#pragma once

#include <vector>

#include "Core/Model/SlicePlane.h"

namespace bigus
{

/// A frame that lies between two others that follow each other, of another time: `before` and the next.
struct Revisit
{
  int frame, before;  ///< by their places in the list
};

struct Revisits
{
  std::vector<Revisit> found;  ///< at most two of a frame, the nearest first; those whose pictures can be compared
  bool comesBack = false;      ///< whether there is any, also where pictures are turned too far to be compared
};

/// Among planes of frames of a sweep, whose numbers ascend. `stroke` of every frame of the sweep is Trajectory's.
Revisits FindRevisits(const std::vector<SlicePlane>& planes, const std::vector<int>& frames,
                      const std::vector<int>& stroke);

}  // namespace bigus
