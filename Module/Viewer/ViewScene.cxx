// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewScene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "Core/Numerics/Constants.h"
#include "Data/SweepData.h"
#include "vtkBigusSliceRepresentation.h"
#include "vtkBigusSweepOutline.h"
#include "vtkCallbackCommand.h"
#include "vtkCamera.h"
#include "vtkCommand.h"
#include "vtkImageData.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkRenderWindowInteractor.h"
#include "vtkSmartVolumeMapper.h"
#include "vtkTextProperty.h"

namespace bigus::command
{

namespace
{

constexpr int kMostOutlines = 14;  // of frames; more hide what lies between
constexpr Color kFrameColor = {0.42, 0.52, 0.62};
constexpr double kPointSize = 2;   // pixels, of Gaussians that are too small for ellipsoids
constexpr double kAmbient = 0.25;  // light from everywhere, so that no ellipsoid is black
constexpr double kCloser = 0.92;   // than the distance from which the whole box is seen

void SetLines(vtkActor* actor, vtkAlgorithmOutput* lines, const Color& color, double width)
{
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(lines);
  mapper->ScalarVisibilityOff();
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(color[0], color[1], color[2]);
  actor->GetProperty()->SetLineWidth(width);
  actor->GetProperty()->LightingOff();
}

}  // namespace

ViewScene::ViewScene(vtkPolyData* field, const Sweep* sweep, const ViewBox& box, int fontSize) : box_(box)
{
  ellipsoidMapper_->SetInputData(field);
  ellipsoids_->SetMapper(ellipsoidMapper_);
  ellipsoids_->GetProperty()->SetPointSize(kPointSize);
  ellipsoids_->GetProperty()->SetAmbient(kAmbient);
  volume_->SetInputData(field);
  slice_ = sliceWidget_->GetSliceRepresentation()->GetSliceProp();
  slice_->SetInputData(field);
  slice_->CoverageVisibilityOff();
  cell.renderer->AddActor(ellipsoids_);
  cell.renderer->AddVolume(volume_);
  if (sweep)
  {
    AddSweep(*sweep);
  }
  AddLegend(fontSize);
  for (const std::string& part : kViewParts)
  {
    shown_[part] = true;
  }
}

void ViewScene::AddSweep(const Sweep& sweep)
{
  vtkNew<vtkImageData> stack;
  SweepToImage(sweep, stack);
  vtkNew<vtkBigusSweepOutline> outline;
  outline->SetInputData(stack);
  outline->SetFrameStride((sweep.NumberOfFrames() + kMostOutlines - 1) / kMostOutlines);
  SetLines(outlines_, outline->GetOutputPort(), kFrameColor, 1);
  SetLines(path_, outline->GetPathOutputPort(), kAccent, 3);
  cell.renderer->AddActor(outlines_);
  cell.renderer->AddActor(path_);
}

void ViewScene::AddLegend(int fontSize)
{
  legend_->SetLookupTable(ellipsoidMapper_->GetLookupTable());
  legend_->SetTitle("reflectivity");
  legend_->SetNumberOfLabels(3);
  legend_->SetLabelFormat("%.2g");
  legend_->UnconstrainedFontSizeOn();
  legend_->SetBarRatio(0.3);
  StyleText(legend_->GetTitleTextProperty(), fontSize - 2);
  StyleText(legend_->GetLabelTextProperty(), fontSize - 2);
  legend_->SetVerticalTitleSeparation(fontSize / 2);
  legend_->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  legend_->SetPosition(0.88, 0.70);
  legend_->SetWidth(0.11);
  legend_->SetHeight(0.28);
  cell.renderer->AddViewProp(legend_);
}

void ViewScene::SetPlane(const Eigen::Matrix4d& plane)
{
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = plane;
  slice_->GetPlane()->DeepCopy(rows.data());
  UpdateCut();
}

void ViewScene::SetInteractor(vtkRenderWindowInteractor* interactor, std::function<void()> moved)
{
  moved_ = std::move(moved);
  sliceWidget_->SetInteractor(interactor);
  sliceWidget_->SetDefaultRenderer(cell.renderer);
  sliceWidget_->SetCurrentRenderer(cell.renderer);
  const auto onMotion = [](vtkObject*, unsigned long, void* self, void*)
  {
    auto* const scene = static_cast<ViewScene*>(self);
    scene->UpdateCut();
    scene->moved_();
  };
  vtkNew<vtkCallbackCommand> motion;
  motion->SetClientData(this);
  motion->SetCallback(onMotion);
  sliceWidget_->AddObserver(vtkCommand::InteractionEvent, motion);
}

void ViewScene::AddPlane(vtkBigusSliceProp* plane)
{
  planes_.emplace_back(plane);
  cell.renderer->AddViewProp(plane);
}

void ViewScene::Show(const std::string& part, bool isShown)
{
  shown_[part] = isShown;
  if (part == "ellipsoids")
  {
    ellipsoids_->SetVisibility(isShown);
    legend_->SetVisibility(isShown);
  }
  else if (part == "volume")
  {
    volume_->SetVisibility(isShown);
  }
  else if (part == "slice")
  {
    sliceWidget_->SetEnabled(isShown);
  }
  else if (part == "frames")
  {
    outlines_->SetVisibility(isShown);
    path_->SetVisibility(isShown);
  }
  else if (part == "planes")
  {
    for (vtkBigusSliceProp* plane : planes_)
    {
      plane->SetVisibility(isShown);
    }
  }
  else if (part == "beam")
  {
    slice_->SetBeamVisibility(isShown);
  }
}

void ViewScene::SetCut(bool isCut)
{
  isCut_ = isCut;
  ellipsoidMapper_->RemoveAllClippingPlanes();
  volume_->GetMapper()->RemoveAllClippingPlanes();
  if (isCut)
  {
    ellipsoidMapper_->AddClippingPlane(cut_);
    volume_->GetMapper()->AddClippingPlane(cut_);
  }
  UpdateCut();
}

void ViewScene::UpdateCut()
{
  const vtkMatrix4x4* plane = slice_->GetPlane();
  Eigen::Vector3d columns, rows, origin;
  for (int row = 0; row < 3; ++row)
  {
    columns[row] = plane->GetElement(row, 0);
    rows[row] = plane->GetElement(row, 1);
    origin[row] = plane->GetElement(row, 3);
  }
  Eigen::Vector3d normal = columns.cross(rows).normalized();
  cut_->SetOrigin(origin.data());
  cut_->SetNormal(normal.data());
}

void ViewScene::LookFromTheStart()
{
  const int* pixels = cell.renderer->GetSize();
  const double aspect = pixels[1] > 0 ? std::min(1.0, static_cast<double>(pixels[0]) / pixels[1]) : 1;
  vtkCamera* camera = cell.renderer->GetActiveCamera();
  const double halfAngle = 0.5 * camera->GetViewAngle() * kRadiansPerDegree;
  const double distance = kCloser * 0.5 * box_.size.norm() / (std::sin(halfAngle) * std::max(aspect, 1e-3));
  const Eigen::Vector3d from = box_.axes * Eigen::Vector3d(-1.2, -0.6, -1).normalized();
  const Eigen::Vector3d position = box_.centre + distance * from, up = -box_.axes.col(1);
  camera->SetFocalPoint(box_.centre.data());
  camera->SetPosition(position.data());
  camera->SetViewUp(up.data());
  cell.renderer->ResetCameraClippingRange();
}

}  // namespace bigus::command
