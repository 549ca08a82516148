// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewCell.h"

#include <algorithm>

#include "vtkCamera.h"
#include "vtkRenderWindow.h"
#include "vtkTextProperty.h"

namespace bigus::command
{

namespace
{

constexpr double kGap = 0.0015;         // of the window, around each cell
constexpr double kViewMargin = 1.14;    // of what a flat view shows
constexpr double kCameraAway = 1000.0;  // mm; without perspective it only has to be outside

}  // namespace

void StyleText(vtkTextProperty* text, int fontSize)
{
  text->SetFontSize(fontSize);
  text->SetColor(kText.data());
  text->BoldOff();
  text->ItalicOff();
  text->ShadowOff();
}

void ViewCell::Place(vtkRenderWindow* window, const Viewport& viewport, int fontSize)
{
  this->renderer->SetViewport(viewport.left + kGap, viewport.bottom + kGap, viewport.right - kGap, viewport.top - kGap);
  this->renderer->SetBackground(kDark.data());
  StyleText(this->caption->GetTextProperty(), fontSize);
  this->caption->GetTextProperty()->SetVerticalJustificationToTop();
  this->caption->GetTextProperty()->SetShadow(1);
  this->caption->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  this->caption->SetPosition(0.02, 0.98);
  this->renderer->AddViewProp(this->caption);
  window->AddRenderer(this->renderer);
}

void ViewCell::LookAt(const Eigen::Vector3d& centre, const Eigen::Vector3d& normal, const Eigen::Vector3d& down,
                      double width, double height)
{
  const Eigen::Vector3d position = centre - kCameraAway * normal, up = -down;
  const int* pixels = this->renderer->GetSize();
  const double aspect = pixels[1] > 0 ? static_cast<double>(pixels[0]) / pixels[1] : 1;
  vtkCamera* camera = this->renderer->GetActiveCamera();
  camera->ParallelProjectionOn();
  camera->SetFocalPoint(centre.data());
  camera->SetPosition(position.data());
  camera->SetViewUp(up.data());
  camera->SetParallelScale(0.5 * kViewMargin * std::max(height, width / std::max(aspect, 1e-3)));
  this->renderer->ResetCameraClippingRange();
}

}  // namespace bigus::command
