// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewPlanes.h"

#include <algorithm>
#include <cmath>

#include "Console.h"
#include "vtkPolyData.h"
#include "vtkPolyDataMapper2D.h"

namespace bigus::command
{

namespace
{

constexpr int kPixels = 512;  // along a plane's longer side
constexpr Color kColors[] = {{1, 0.55, 0.5}, {0.55, 0.9, 0.5}, {0.55, 0.7, 1}};

}  // namespace

void PlaneView::Move(double distance)
{
  this->measure.Clear();
  this->offset = std::clamp(this->offset + distance, -0.5 * this->depth, 0.5 * this->depth);
  this->Fit();
}

void PlaneView::Fit()
{
  const Eigen::Vector3d at = this->centre + this->offset * this->normal;
  for (int row = 0; row < 3; ++row)
  {
    this->plane->SetElement(row, 0, this->across[row]);
    this->plane->SetElement(row, 1, this->down[row]);
    this->plane->SetElement(row, 2, this->normal[row]);
    this->plane->SetElement(row, 3, at[row]);
  }
  this->SetCaption(this->name + "   " + this->axis + " " + FormatNumber(this->along.dot(at - this->origin), 1) + " mm");
  this->LookAt(at, this->normal, this->down, this->width, this->height);
}

ViewPlanes::ViewPlanes(vtkPolyData* field, const ViewBox& box, bool isSweep)
{
  // Axes of the box that run across and down in each view. The third looks away from the viewer.
  const int across[] = {0, 2, 0}, down[] = {1, 1, 2};
  const std::array<const char*, 3> sweptNames = {"as the middle frame", "along the sweep", "at equal depth"};
  const std::array<const char*, 3> sweptAxes = {"across", "depth", "sweep"};
  const std::array<const char*, 3> plainNames = {"x y", "z y", "x z"}, plainAxes = {"x", "y", "z"};
  for (int k = 0; k < 3; ++k)
  {
    PlaneView& view = this->views[k];
    const int through = 3 - across[k] - down[k];
    view.name = (isSweep ? sweptNames : plainNames)[k];
    view.axis = (isSweep ? sweptAxes : plainAxes)[through];
    view.across = box.axes.col(across[k]);
    view.down = box.axes.col(down[k]);
    view.normal = view.across.cross(view.down);
    const auto& axes = isSweep ? sweptAxes : plainAxes;
    view.mark->SetInput(("right: " + std::string(axes[across[k]]) + ", down: " + axes[down[k]]).c_str());
    view.color = kColors[k];
    view.crossings[0].other = &this->views[(k + 1) % 3];
    view.crossings[1].other = &this->views[(k + 2) % 3];
    view.along = box.axes.col(through);
    view.origin = box.origin;
    view.centre = box.centre;
    view.width = box.size[across[k]];
    view.height = box.size[down[k]];
    view.depth = box.size[through];
    const double spacing = std::max(view.width, view.height) / kPixels;
    const int columns = std::max(1, static_cast<int>(std::lround(view.width / spacing)));
    const int rows = std::max(1, static_cast<int>(std::lround(view.height / spacing)));
    for (vtkBigusSliceProp* slice : {view.slice.Get(), view.inScene.Get()})
    {
      slice->SetInputData(field);
      slice->SetPlane(view.plane);
      slice->SetSliceSize(columns, rows);
      slice->SetSliceSpacing(spacing, spacing);
      slice->SetSliceOrigin(-0.5 * (columns - 1) * spacing, -0.5 * (rows - 1) * spacing);
    }
    view.slice->OutlineVisibilityOff();
    view.inScene->CoverageVisibilityOff();
    view.renderer->AddViewProp(view.slice);
    // The first plane begins as the middle frame itself.
    for (PlaneView::Crossing& crossing : view.crossings)
    {
      DrawInWorld(crossing.actor, kColors[crossing.other - this->views.data()], 1)
          ->SetInputConnection(crossing.line->GetOutputPort());
      view.renderer->AddViewProp(crossing.actor);
    }
    view.Move(isSweep && k == 0 ? view.normal.dot(box.origin - box.centre) : 0.0);
  }
}

void ViewPlanes::Cross()
{
  for (PlaneView& view : this->views)
  {
    for (PlaneView::Crossing& crossing : view.crossings)
    {
      // The planes are at right angles, so what is on both is one offset along each normal.
      const PlaneView& other = *crossing.other;
      const Eigen::Vector3d at = view.centre + view.offset * view.normal + other.offset * other.normal;
      const Eigen::Vector3d along = view.normal.cross(other.normal);
      const double half =
          0.5 * (std::abs(along.dot(view.across)) * view.width + std::abs(along.dot(view.down)) * view.height);
      const Eigen::Vector3d from = at - half * along, to = at + half * along;
      crossing.line->SetPoint1(from.data());
      crossing.line->SetPoint2(to.data());
    }
  }
}

void ViewPlanes::ShowCrossings(bool isShown)
{
  for (PlaneView& view : this->views)
  {
    for (PlaneView::Crossing& crossing : view.crossings)
    {
      crossing.actor->SetVisibility(isShown);
    }
  }
}

PlaneView* ViewPlanes::In(vtkRenderer* renderer)
{
  const auto found =
      std::find_if(views.begin(), views.end(), [&](const PlaneView& view) { return view.renderer == renderer; });
  return found == views.end() ? nullptr : &*found;
}

}  // namespace bigus::command
