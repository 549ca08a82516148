// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewControls.h"

#include <algorithm>
#include <string>

#include "ViewCell.h"
#include "vtkCoordinate.h"
#include "vtkProperty2D.h"
#include "vtkRenderWindowInteractor.h"
#include "vtkRenderer.h"
#include "vtkTextProperty.h"

namespace bigus::command
{

namespace
{

constexpr double kThickest = 5;  // mm, one standard deviation of the beam

const char* const kHelp =
    "Left Right    previous, next frame\n"
    "Home End      first, last frame\n"
    "f             slice back to the frame\n"
    "Up Down       push the slice by 0.5 mm\n"
    "              arrows tilt it with Shift,\n"
    "              move it with Ctrl\n"
    "1 2 3         ellipsoids, volume, slice\n"
    "4 5 6         frames and path, planes, beam\n"
    "c             cut at the slice on, off\n"
    "g             grey over what was never seen\n"
    "r             look from the start again\n"
    "s             save a screenshot, .png\n"
    "w             save the slice under the\n"
    "              mouse, .igs.mha with its pose\n"
    "k n           keep the slice's plane;\n"
    "              to the next kept one\n"
    "BackSpace     forget the kept one shown\n"
    "l             lines where planes cross\n"
    "e             tint what may be off by over\n"
    "              10 % of white, or is not known\n"
    "o             outlines of labels\n"
    "?             this help\n"
    "q             quit\n"
    "\n"
    "Mouse on the slice: push; at a margin\n"
    "tilt; at a corner spin; its ball moves,\n"
    "its arrow turns it; right: window, level.\n"
    "Beside it: turn; middle: pan; right,\n"
    "wheel: zoom. On a plane: wheel moves it,\n"
    "clicks and drags measure, right ends.";

/// Sizes are shares of the cell.
void StyleSlider(vtkSliderRepresentation2D* looks, int fontSize)
{
  looks->SetSliderLength(0.02);
  looks->SetSliderWidth(0.025);
  looks->SetTubeWidth(0.005);
  looks->SetEndCapLength(0.004);
  looks->SetEndCapWidth(0.012);
  looks->SetLabelHeight(0.02);
  looks->GetTubeProperty()->SetColor(kBackdrop[0], kBackdrop[1], kBackdrop[2]);
  looks->GetCapProperty()->SetColor(kBackdrop[0], kBackdrop[1], kBackdrop[2]);
  looks->GetSliderProperty()->SetColor(kAccent[0], kAccent[1], kAccent[2]);
  looks->GetSelectedProperty()->SetColor(1, 1, 1);
  StyleText(looks->GetLabelProperty(), fontSize);
}

}  // namespace

void ViewControls::AddTexts(vtkRenderer* renderer, int fontSize)
{
  help_->SetInput(kHelp);
  vtkTextProperty* text = help_->GetTextProperty();
  StyleText(text, fontSize);
  text->SetFontFamilyToCourier();  // columns
  text->SetBackgroundColor(kDark.data());
  text->SetBackgroundOpacity(0.9);
  text->SetLineSpacing(1.3);
  text->SetVerticalJustificationToCentered();
  help_->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  help_->SetPosition(0.03, 0.5);
  help_->VisibilityOff();
  renderer->AddViewProp(help_);
  StyleText(keptNames_->GetTextProperty(), fontSize);
  keptNames_->GetTextProperty()->SetVerticalJustificationToTop();
  keptNames_->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  keptNames_->SetPosition(0.02, 0.9);
  renderer->AddViewProp(keptNames_);
}

void ViewControls::Add(vtkRenderer* renderer, vtkRenderWindowInteractor* interactor, int fontSize, int frames,
                       double sigma)
{
  AddTexts(renderer, fontSize);
  const auto add = [&](vtkSliderWidget* widget, vtkSliderRepresentation2D* looks, double most, const char* label,
                       double from, double to)
  {
    looks->SetMinimumValue(0);
    looks->SetMaximumValue(most);
    looks->SetLabelFormat(label);
    looks->GetPoint1Coordinate()->SetCoordinateSystemToNormalizedViewport();
    looks->GetPoint1Coordinate()->SetValue(from, 0.055);
    looks->GetPoint2Coordinate()->SetCoordinateSystemToNormalizedViewport();
    looks->GetPoint2Coordinate()->SetValue(to, 0.055);
    StyleSlider(looks, fontSize);
    widget->SetInteractor(interactor);
    widget->SetRepresentation(looks);
    widget->SetDefaultRenderer(renderer);
    widget->SetCurrentRenderer(renderer);
    widget->SetAnimationModeToJump();
    widget->EnabledOn();
  };
  if (frames > 0)
  {
    add(slider, sliderLooks, std::max(1, frames - 1), "frame %.0f", 0.06, 0.64);
  }
  add(thickness, thicknessLooks, std::max(kThickest, 2 * sigma), "beam %.1f mm", 0.72, 0.94);
  thicknessLooks->SetValue(sigma);
}

void ViewControls::ListKept(std::size_t count, std::size_t shown)
{
  std::string names = count == 0 ? "" : "kept   n: next";
  for (std::size_t k = 1; k <= count; ++k)
  {
    names += "\n" + std::string(k == shown ? "> " : "   ") + "plane " + std::to_string(k);
  }
  keptNames_->SetInput(names.c_str());
}

}  // namespace bigus::command
