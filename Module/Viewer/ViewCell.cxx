// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewCell.h"

#include <algorithm>
#include <cmath>

#include "Console.h"
#include "vtkCamera.h"
#include "vtkCoordinate.h"
#include "vtkPolyDataMapper2D.h"
#include "vtkProperty2D.h"
#include "vtkRenderWindow.h"
#include "vtkTextProperty.h"

namespace bigus::command
{

namespace
{

constexpr double kGap = 0.0015;         // of the window, around each cell
constexpr double kViewMargin = 1.14;    // of what a flat view shows
constexpr int kRulerGap = 10;           // pixels, from the cell's corner
constexpr float kRulerWidth = 2;        // pixels
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

vtkPolyDataMapper2D* DrawInWorld(vtkActor2D* lines, const Color& color, double width)
{
  vtkNew<vtkPolyDataMapper2D> mapper;
  vtkNew<vtkCoordinate> world;
  world->SetCoordinateSystemToWorld();
  mapper->SetTransformCoordinate(world);
  lines->SetMapper(mapper);
  lines->GetProperty()->SetColor(color.data());
  lines->GetProperty()->SetLineWidth(width);
  return mapper;
}

void ViewCell::Place(vtkRenderWindow* window, const Viewport& viewport, int fontSize)
{
  this->renderer->SetViewport(viewport.left + kGap, viewport.bottom + kGap, viewport.right - kGap, viewport.top - kGap);
  this->renderer->SetBackground(kDark.data());
  StyleText(this->caption->GetTextProperty(), fontSize);
  this->caption->GetTextProperty()->SetColor(this->color.data());
  this->caption->GetTextProperty()->SetVerticalJustificationToTop();
  this->caption->GetTextProperty()->SetShadow(1);
  this->caption->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  this->caption->SetPosition(0.02, 0.98);
  this->renderer->AddViewProp(this->caption);
  vtkNew<vtkPolyDataMapper2D> mapper;
  vtkNew<vtkCoordinate> pixels;
  pixels->SetCoordinateSystemToViewport();
  mapper->SetTransformCoordinate(pixels);
  mapper->SetInputConnection(this->ruler->GetOutputPort());
  this->rulerLine->SetMapper(mapper);
  this->rulerLine->GetProperty()->SetColor(kText.data());
  this->rulerLine->GetProperty()->SetLineWidth(kRulerWidth);
  StyleText(this->rulerLength->GetTextProperty(), fontSize - 2);
  this->rulerLength->GetTextProperty()->SetShadow(1);
  this->rulerLength->GetTextProperty()->SetVerticalJustificationToCentered();
  StyleText(this->mark->GetTextProperty(), fontSize - 2);
  this->mark->GetTextProperty()->SetShadow(1);
  this->mark->GetTextProperty()->SetJustificationToRight();
  this->mark->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  this->mark->SetPosition(0.98, 0.02);
  this->renderer->AddViewProp(this->mark);
  this->measure.Place(this->renderer, fontSize);
  window->AddRenderer(this->renderer);
}

void ViewCell::SetCaption(const std::string& words)
{
  this->text = words;
  this->SetDoubt("");
}

void ViewCell::SetDoubt(const std::string& words)
{
  this->caption->SetInput((this->text + (words.empty() ? "" : "   " + words)).c_str());
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
  this->Rule();
}

/// A line of 1, 2 or 5 times a power of ten mm, at most a third of the cell's width.
void ViewCell::Rule()
{
  const int* pixels = this->renderer->GetSize();
  if (pixels[0] < 1 || pixels[1] < 1)
  {
    return;
  }
  const double pixel = 2 * this->renderer->GetActiveCamera()->GetParallelScale() / pixels[1];  // mm
  const double most = pixels[0] * pixel / 3, power = std::pow(10, std::floor(std::log10(most)));
  const double length = power * (most >= 5 * power ? 5 : most >= 2 * power ? 2 : 1);
  this->ruler->SetPoint1(kRulerGap, kRulerGap, 0);
  this->ruler->SetPoint2(kRulerGap + length / pixel, kRulerGap, 0);
  this->rulerLength->SetInput((FormatNumber(length, length < 1 ? 2 : 0) + " mm").c_str());
  this->rulerLength->SetPosition(1.5 * kRulerGap + length / pixel, kRulerGap);
  this->renderer->AddViewProp(this->rulerLine);
  this->renderer->AddViewProp(this->rulerLength);
}

}  // namespace bigus::command
