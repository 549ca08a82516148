// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewOverlay.h"

#include "vtkImageData.h"
#include "vtkImageProperty.h"
#include "vtkRenderer.h"
#include "vtkScalarsToColors.h"

namespace bigus::command
{

namespace
{

constexpr double kAbove = 0.05;  // mm, towards the viewer, so that it is drawn over the slice

}  // namespace

void ViewOverlay::AddTo(vtkRenderer* renderer, vtkScalarsToColors* colors)
{
  picture_->SetMapper(mapper_);
  picture_->SetUserMatrix(place_);
  picture_->GetProperty()->SetLookupTable(colors);
  picture_->GetProperty()->UseLookupTableScalarRangeOn();
  picture_->GetProperty()->SetInterpolationTypeToNearest();
  picture_->VisibilityOff();
  renderer->AddViewProp(picture_);
}

void ViewOverlay::Show(vtkImageData* image, const Eigen::Matrix4d& place)
{
  mapper_->SetInputData(image);
  // A flat view looks along the normal, so towards the viewer is against it.
  const Eigen::Vector3d across = place.block<3, 1>(0, 0), down = place.block<3, 1>(0, 1);
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> lifted = place;
  lifted.block<3, 1>(0, 3) -= kAbove * across.cross(down).normalized();
  place_->DeepCopy(lifted.data());
  picture_->VisibilityOn();
}

}  // namespace bigus::command
