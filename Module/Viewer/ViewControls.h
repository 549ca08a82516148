// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What lies over the scene: sliders, the list of keys, and the kept planes.
#pragma once

#include <cstddef>

#include "vtkNew.h"
#include "vtkSliderRepresentation2D.h"
#include "vtkSliderWidget.h"
#include "vtkTextActor.h"

class vtkRenderWindowInteractor;
class vtkRenderer;

namespace bigus::command
{

struct ViewControls
{
  vtkNew<vtkSliderWidget> slider, thickness;  ///< of frames; of the beam, mm, one standard deviation
  vtkNew<vtkSliderRepresentation2D> sliderLooks, thicknessLooks;

  /// `frames`: of the sweep; 0: there is none. `sigma`: the field's own beam, mm.
  void Add(vtkRenderer* renderer, vtkRenderWindowInteractor* interactor, int fontSize, int frames, double sigma);
  void ToggleHelp() { help_->SetVisibility(!help_->GetVisibility()); }
  /// Names so many kept planes, and marks the one shown, counted from 1.
  void ListKept(std::size_t count, std::size_t shown);

private:
  void AddTexts(vtkRenderer* renderer, int fontSize);

  vtkNew<vtkTextActor> help_, keptNames_;
};

}  // namespace bigus::command
