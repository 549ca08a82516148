// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/FrameDistance.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "Core/Model/Error.h"

namespace bigus
{

void DistanceToFrames(const Sweep& sweep, const std::vector<int>& frames, const SlicePlane& plane, float* distances)
{
  Require(!frames.empty(), "Distances to recorded frames need at least one frame.");
  // A frame's coordinates (i, j, z) are affine along a row of the slice: start + u step.
  struct Frame
  {
    SlicePlane plane;
    Eigen::Matrix3d toFrame;
    Eigen::Vector3d step;
    double columnSquare, rowSquare, product;  // |columnStep|^2, |rowStep|^2, columnStep . rowStep, mm^2
  };
  std::vector<Frame> all;
  for (const int frame : frames)
  {
    const SlicePlane at = sweep.Plane(frame);
    const Eigen::Matrix3d toFrame = at.WorldToSlice();
    all.push_back({at, toFrame, toFrame * plane.columnStep, at.columnStep.squaredNorm(), at.rowStep.squaredNorm(),
                   at.columnStep.dot(at.rowStep)});
  }
  tbb::parallel_for(0, plane.height,
                    [&](int row)
                    {
                      std::vector<double> squares(plane.width, std::numeric_limits<double>::infinity());
                      for (const Frame& frame : all)
                      {
                        const Eigen::Vector3d start = frame.toFrame * (plane.Point(0, row) - frame.plane.origin);
                        const double right = frame.plane.width - 0.5, bottom = frame.plane.height - 0.5;
                        for (int u = 0; u < plane.width; ++u)
                        {
                          const double i = start[0] + u * frame.step[0], j = start[1] + u * frame.step[1],
                                       z = start[2] + u * frame.step[2];
                          const double di = i - std::min(std::max(i, -0.5), right),
                                       dj = j - std::min(std::max(j, -0.5), bottom);
                          const double square = di * di * frame.columnSquare + dj * dj * frame.rowSquare +
                                                2 * di * dj * frame.product + z * z;
                          squares[u] = std::min(squares[u], square);
                        }
                      }
                      float* out = distances + static_cast<std::size_t>(row) * plane.width;
                      std::transform(squares.begin(), squares.end(), out,
                                     [](double square) { return static_cast<float>(std::sqrt(square)); });
                    });
}

}  // namespace bigus
