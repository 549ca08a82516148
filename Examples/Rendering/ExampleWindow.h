// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the examples share: a window that is shown, or drawn off screen and written to a file.
#pragma once

#include "vtkCamera.h"
#include "vtkInteractorStyleTrackballCamera.h"
#include "vtkNew.h"
#include "vtkPNGWriter.h"
#include "vtkRenderWindow.h"
#include "vtkRenderWindowInteractor.h"
#include "vtkRenderer.h"
#include "vtkWindowToImageFilter.h"

struct ExampleWindow
{
  /// `picture` names the PNG file; a null pointer shows the window instead.
  ExampleWindow(const char* picture, int width, int height) : file(picture)
  {
    this->window->SetOffScreenRendering(picture != nullptr);
    this->window->SetSize(width, height);
    this->interactor->SetRenderWindow(this->window);
    this->interactor->SetInteractorStyle(vtkNew<vtkInteractorStyleTrackballCamera>());
  }

  /// Adds a renderer that sees all it has from a direction, with depth, the field's y, pointing down.
  void Add(vtkRenderer* renderer, double x, double y, double z, double zoom)
  {
    renderer->SetBackground(0.1, 0.12, 0.15);
    renderer->GetActiveCamera()->SetViewUp(0, -1, 0);
    renderer->GetActiveCamera()->SetPosition(x, y, z);
    renderer->ResetCamera();
    renderer->GetActiveCamera()->Zoom(zoom);
    this->window->AddRenderer(renderer);
  }

  /// Returns when the user closes the window, or when the file is written.
  void Show()
  {
    this->window->Render();
    if (!this->file)
    {
      this->interactor->Start();
      return;
    }
    vtkNew<vtkWindowToImageFilter> grab;
    grab->SetInput(this->window);
    grab->ReadFrontBufferOff();
    vtkNew<vtkPNGWriter> writer;
    writer->SetInputConnection(grab->GetOutputPort());
    writer->SetFileName(this->file);
    writer->Write();
  }

  vtkNew<vtkRenderWindow> window;
  vtkNew<vtkRenderWindowInteractor> interactor;
  const char* file;
};
