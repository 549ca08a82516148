// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Multi-planar reformatting: three views through a cursor that the mouse moves and turns.
//   reslice_cursor FIELD [PICTURE.png]
#include "ExampleWindow.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusResliceCursorRepresentation.h"
#include "vtkCommand.h"
#include "vtkPlane.h"
#include "vtkResliceCursor.h"
#include "vtkResliceCursorWidget.h"

int main(int argc, char* argv[])
{
  if (argc < 2)
  {
    return 1;
  }
  ExampleWindow window(argc > 2 ? argv[2] : nullptr, 960, 320);
  window.window->SetMultiSamples(0);  // smooth edges take long where software draws
  vtkNew<vtkBigusFieldReader> field;
  field->SetFileName(argv[1]);
  vtkNew<vtkResliceCursor> cursor;
  cursor->SetXViewUp(0, -1, 0);  // depth points down, as it does in z from the start
  vtkNew<vtkRenderer> renderers[3];
  vtkNew<vtkBigusResliceCursorRepresentation> views[3];
  vtkNew<vtkResliceCursorWidget> widgets[3];
  for (int axis = 0; axis < 3; ++axis)
  {
    renderers[axis]->SetViewport(axis / 3.0, 0, (axis + 1) / 3.0, 1);
    window.window->AddRenderer(renderers[axis]);
    views[axis]->SetInputConnection(field->GetOutputPort());
    views[axis]->PlaceCursor(cursor, axis, 320);
    widgets[axis]->SetInteractor(window.interactor);
    widgets[axis]->SetRepresentation(views[axis]);
    widgets[axis]->SetDefaultRenderer(renderers[axis]);
    widgets[axis]->AddObserver(vtkCommand::InteractionEvent, window.window.Get(), &vtkRenderWindow::Render);
    widgets[axis]->On();
    renderers[axis]->ResetCamera();
    renderers[axis]->GetActiveCamera()->ParallelProjectionOn();
    renderers[axis]->GetActiveCamera()->Zoom(1.45);
  }
  cursor->GetPlane(0)->SetNormal(0.9, 0, 0.4);  // oblique
  cursor->GetPlane(2)->SetNormal(0, 0, -1);     // seen as frames are, not from behind
  window.Show();
  return 0;
}
