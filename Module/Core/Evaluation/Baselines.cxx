// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Evaluation/Baselines.h"

#include <algorithm>
#include <limits>
#include <string>

#include "Core/Evaluation/FrameInSpace.h"
#include "Core/Model/Error.h"
#include "Core/Model/Sequences.h"

namespace bigus
{

void PredictNearest(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane, float* image)
{
  CheckTraining(sweep, training);
  Require(plane.width == sweep.width && plane.height == sweep.height, "Nearest frame: the plane has ", plane.width,
          " x ", plane.height, " pixels, but the frames have ", sweep.width, " x ", sweep.height,
          "; a frame can only be copied pixel for pixel.");
  int nearest = kNoFrame;
  double smallest = std::numeric_limits<double>::infinity();
  for (int frame : training)
  {
    const SlicePlane other = sweep.Plane(frame);
    double squares = 0;
    for (int corner = 0; corner < 4; ++corner)
    {
      const double i = corner % 2 * (plane.width - 1.0), j = corner / 2 * (plane.height - 1.0);
      squares += (other.Point(i, j) - plane.Point(i, j)).squaredNorm();
    }
    if (nearest == kNoFrame || squares < smallest)
    {
      smallest = squares;
      nearest = frame;
    }
  }
  sweep.CopyFrame(nearest, image);
}

void PredictNeighbourAverage(const Sweep& sweep, const std::vector<int>& training, int frame, float* image)
{
  CheckTraining(sweep, training);
  const auto [before, after] = NeighboursOf(sweep, training, frame);
  sweep.CopyFrame(before ? *before : after.value_or(kNoFrame), image);
  if (before && after)
  {
    std::vector<float> other(sweep.PixelsPerFrame());
    sweep.CopyFrame(*after, other.data());
    std::transform(other.begin(), other.end(), image, image, [](float a, float b) { return 0.5f * (a + b); });
  }
}

}  // namespace bigus
