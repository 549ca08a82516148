// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What every engine refuses. Private to Core and Cuda.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

inline void CheckFrames(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& frames)
{
  Require(sweep != nullptr, "Engine: no frames were uploaded; call SetFrames first.");
  Require(!frames.empty(), "Engine: the batch holds no frame.");
  for (int frame : frames)
  {
    Require(frame >= 0 && frame < sweep->NumberOfFrames(), "Engine: frame ", frame, " is not one of the ",
            sweep->NumberOfFrames(), " frames of the sweep.");
  }
}

inline void CheckWindow(const SlicePlane& plane, int firstColumn, int firstRow, int columns, int rows)
{
  Require(firstColumn >= 0 && firstRow >= 0 && columns >= 0 && rows >= 0 && columns <= plane.width - firstColumn &&
              rows <= plane.height - firstRow,
          "Engine: the window of ", columns, " x ", rows, " pixels at (", firstColumn, ", ", firstRow,
          ") does not lie inside the plane of ", plane.width, " x ", plane.height, ".");
}

inline void CheckStack(const std::vector<SlicePlane>& planes)
{
  for (const SlicePlane& plane : planes)
  {
    Require(plane.width == planes[0].width && plane.height == planes[0].height, "Engine: a stack of planes of ",
            planes[0].width, " x ", planes[0].height, " and of ", plane.width, " x ", plane.height,
            " pixels; render planes of one size together.");
  }
}

}  // namespace bigus
