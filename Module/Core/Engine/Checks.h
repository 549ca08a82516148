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
  if (!sweep)
  {
    throw Error("Engine: no frames were uploaded; call SetFrames first.");
  }
  if (frames.empty())
  {
    throw Error("Engine: the batch holds no frame.");
  }
  for (int frame : frames)
  {
    if (frame < 0 || frame >= sweep->NumberOfFrames())
    {
      throw Error("Engine: frame " + std::to_string(frame) + " is not one of the " +
                  std::to_string(sweep->NumberOfFrames()) + " frames of the sweep.");
    }
  }
}

inline void CheckWindow(const SlicePlane& plane, int firstColumn, int firstRow, int columns, int rows)
{
  if (firstColumn < 0 || firstRow < 0 || columns < 0 || rows < 0 || columns > plane.width - firstColumn ||
      rows > plane.height - firstRow)
  {
    throw Error("Engine: the window of " + std::to_string(columns) + " x " + std::to_string(rows) + " pixels at (" +
                std::to_string(firstColumn) + ", " + std::to_string(firstRow) + ") does not lie inside the plane of " +
                std::to_string(plane.width) + " x " + std::to_string(plane.height) + ".");
  }
}

inline void CheckStack(const std::vector<SlicePlane>& planes)
{
  for (const SlicePlane& plane : planes)
  {
    if (plane.width != planes[0].width || plane.height != planes[0].height)
    {
      throw Error("Engine: a stack of planes of " + std::to_string(planes[0].width) + " x " +
                  std::to_string(planes[0].height) + " and of " + std::to_string(plane.width) + " x " +
                  std::to_string(plane.height) + " pixels; render planes of one size together.");
    }
  }
}

}  // namespace bigus
