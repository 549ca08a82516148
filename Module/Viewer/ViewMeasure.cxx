// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewMeasure.h"

#include <cstdlib>

#include "Console.h"
#include "ViewCell.h"
#include "vtkCamera.h"
#include "vtkCellArray.h"
#include "vtkPolyDataMapper2D.h"
#include "vtkRenderer.h"
#include "vtkTextProperty.h"

namespace bigus::command
{

namespace
{

constexpr int kDrag = 4;           // pixels that a click may move
constexpr float kLineWidth = 1.5;  // pixels

/// The place under a pixel, at the depth that the camera looks at.
Eigen::Vector3d Under(vtkRenderer* renderer, int x, int y)
{
  const double* const focus = renderer->GetActiveCamera()->GetFocalPoint();
  renderer->SetWorldPoint(focus[0], focus[1], focus[2], 1);
  renderer->WorldToDisplay();
  renderer->SetDisplayPoint(x, y, renderer->GetDisplayPoint()[2]);
  renderer->DisplayToWorld();
  const double* const world = renderer->GetWorldPoint();
  return Eigen::Map<const Eigen::Vector3d>(world) / world[3];
}

}  // namespace

void ViewMeasure::Place(vtkRenderer* renderer, int fontSize)
{
  renderer_ = renderer;
  DrawInWorld(line_, kAccent, kLineWidth)->SetInputData(path_);
  StyleText(label_->GetTextProperty(), fontSize);
  label_->GetTextProperty()->SetColor(kAccent.data());
  label_->GetTextProperty()->SetShadow(1);
  label_->GetPositionCoordinate()->SetCoordinateSystemToWorld();
  renderer->AddViewProp(line_);
  renderer->AddViewProp(label_);
}

std::string ViewMeasure::Add(int x, int y, const About& about)
{
  pressedX_ = x;
  pressedY_ = y;
  points_.push_back(Under(renderer_, x, y));
  about_ = points_.size() == 2 ? "" : about(points_);
  // Words to the side that has room.
  x < renderer_->GetOrigin()[0] + renderer_->GetSize()[0] / 2 ? label_->GetTextProperty()->SetJustificationToLeft()
                                                              : label_->GetTextProperty()->SetJustificationToRight();
  Draw();
  return Words();
}

std::string ViewMeasure::AddIfDragged(int x, int y, const About& about)
{
  const bool isDrag = std::abs(x - pressedX_) > kDrag || std::abs(y - pressedY_) > kDrag;
  return points_.empty() || !isDrag ? "" : Add(x, y, about);
}

void ViewMeasure::Clear()
{
  points_.clear();
  Draw();
}

void ViewMeasure::Draw()
{
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> lines;
  const auto count = static_cast<vtkIdType>(points_.size());
  const bool isClosed = count > 2;
  lines->InsertNextCell(static_cast<int>(count + isClosed));
  for (vtkIdType k = 0; k < count + isClosed; ++k)
  {
    lines->InsertCellPoint(k % count);
  }
  for (const Eigen::Vector3d& point : points_)
  {
    points->InsertNextPoint(point.data());
  }
  path_->SetPoints(points);
  path_->SetLines(lines);
  label_->SetInput(Words().c_str());
  if (count > 0)
  {
    label_->GetPositionCoordinate()->SetValue(points_.back().data());
  }
}

std::string ViewMeasure::Words() const
{
  if (points_.size() < 2)
  {
    return points_.empty() ? "" : about_;
  }
  double length = 0;
  Eigen::Vector3d twice = Eigen::Vector3d::Zero();  // the area, as a normal: sum (p_k - p_0) x (p_k+1 - p_0)
  for (std::size_t k = 1; k < points_.size(); ++k)
  {
    length += (points_[k] - points_[k - 1]).norm();
    twice += (points_[k - 1] - points_[0]).cross(points_[k] - points_[0]);
  }
  return FormatNumber(length, 1) + " mm" +
         (points_.size() < 3 ? "" : ", inside " + FormatNumber(0.5 * twice.norm(), 1) + " mm^2") +
         (about_.empty() ? "" : ", " + about_);
}

}  // namespace bigus::command
