// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where the frames of a sequence lie.
#pragma once

#include <vector>

#include "Core/Model/SweepGeometry.h"
#include "IO/Poses.h"
#include "IO/SequenceFile.h"

namespace bigus
{

/// Of the accepted frames, mm; zeros where there is none.
struct FrameGeometry
{
  double pixelSize[2] = {0, 0};           ///< along columns and rows, mean over frames
  SweepGeometry planes;                   ///< as the trainer measures it
  double pathLength = 0;                  ///< as PathLength measures it
  double bounds[6] = {0, 0, 0, 0, 0, 0};  ///< of their corners: x, x, y, y, z, z
};
FrameGeometry MeasureFrames(const SequenceFile& file, const std::vector<FramePose>& frames);

}  // namespace bigus
