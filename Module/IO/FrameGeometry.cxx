// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/FrameGeometry.h"

#include <Eigen/Geometry>

namespace bigus
{

FrameGeometry MeasureFrames(const SequenceFile& file, const std::vector<FramePose>& frames)
{
  FrameGeometry geometry;
  Sweep sweep;  // without pixels
  sweep.width = file.width;
  sweep.height = file.height;
  for (const FramePose& frame : frames)
  {
    if (frame.accepted)
    {
      sweep.imageToReference.push_back(frame.imageToReference);
    }
  }
  const int accepted = sweep.NumberOfFrames();
  if (accepted == 0)
  {
    return geometry;
  }
  const double i = file.width - 1;
  const double j = file.height - 1;
  Eigen::AlignedBox3d box;
  for (int k = 0; k < accepted; ++k)
  {
    const SlicePlane plane = sweep.Plane(k);
    geometry.pixelSize[0] += plane.columnStep.norm() / accepted;
    geometry.pixelSize[1] += plane.rowStep.norm() / accepted;
    box.extend(plane.Point(0, 0)).extend(plane.Point(i, 0)).extend(plane.Point(0, j)).extend(plane.Point(i, j));
  }
  for (int axis = 0; axis < 3; ++axis)
  {
    geometry.bounds[2 * axis] = box.min()[axis];
    geometry.bounds[2 * axis + 1] = box.max()[axis];
  }
  geometry.pathLength = PathLength(sweep, AllFrames(sweep));
  geometry.planes = MeasureGeometry(sweep, AllFrames(sweep));
  return geometry;
}

}  // namespace bigus
