// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewBox.h"

#include <algorithm>
#include <vector>

#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

constexpr double kStrays = 0.005;    // of the centres, at each end of an axis: a few would make the tissue small
constexpr double kBoxMargin = 1.06;  // of the size: Gaussians reach beyond their centres
constexpr int kSampledFrames = 20, kSampledPlaces = 16;  // along each side of a frame

}  // namespace

ViewBox BoxOfField(vtkPolyData* field, const Sweep* sweep)
{
  ViewBox box;
  if (sweep)
  {
    const SlicePlane middle = sweep->Plane(sweep->NumberOfFrames() / 2);
    box.axes = AxesOf(middle);
    box.origin = middle.Point(0.5 * (sweep->width - 1), 0);
  }
  const vtkIdType count = field->GetNumberOfPoints();
  if (count == 0)
  {
    return box;
  }
  Eigen::Vector3d middle;
  std::vector<double> places(count);
  for (int axis = 0; axis < 3; ++axis)
  {
    for (vtkIdType i = 0; i < count; ++i)
    {
      places[i] = box.axes.col(axis).dot(Eigen::Map<const Eigen::Vector3d>(field->GetPoint(i)));
    }
    const auto quantile = [&places](double share)
    {
      const auto place = places.begin() + static_cast<std::ptrdiff_t>(share * (places.size() - 1));
      std::nth_element(places.begin(), place, places.end());
      return *place;
    };
    const double low = quantile(kStrays), high = quantile(1 - kStrays);
    middle[axis] = 0.5 * (low + high);
    box.size[axis] = std::max(1.0, kBoxMargin * (high - low));
  }
  box.centre = box.axes * middle;
  return box;
}

double ShareInside(const ViewBox& box, const Sweep& sweep)
{
  const int stride = std::max(1, sweep.NumberOfFrames() / kSampledFrames);
  const int across = std::max(1, sweep.width / kSampledPlaces), down = std::max(1, sweep.height / kSampledPlaces);
  int lit = 0, inside = 0;
  for (int frame = 0; frame < sweep.NumberOfFrames(); frame += stride)
  {
    const SlicePlane plane = sweep.Plane(frame);
    for (int j = 0; j < sweep.height; j += down)
    {
      for (int i = 0; i < sweep.width; i += across)
      {
        if (sweep.IsLit(static_cast<std::size_t>(j) * sweep.width + i))
        {
          ++lit;
          inside += box.Holds(plane.Point(i, j));
        }
      }
    }
  }
  return lit > 0 ? static_cast<double>(inside) / lit : 0;
}

}  // namespace bigus::command
