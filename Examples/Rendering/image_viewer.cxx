// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// VTK's own viewer of images, which asks for one slice of a field; the wheel goes to others, the mouse sets the contrast.
//   image_viewer FIELD [PICTURE.png]
#include "ExampleWindow.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusReslice.h"
#include "vtkCallbackCommand.h"
#include "vtkImageViewer2.h"

int main(int argc, char* argv[])
{
  if (argc < 2)
  {
    return 1;
  }
  ExampleWindow window(argc > 2 ? argv[2] : nullptr, 480, 400);
  vtkNew<vtkBigusFieldReader> field;
  field->SetFileName(argv[1]);
  vtkNew<vtkBigusReslice> reslice;  // unless told otherwise a grid of voxels over the whole field
  reslice->SetInputConnection(field->GetOutputPort());
  vtkNew<vtkImageViewer2> viewer;
  viewer->SetInputConnection(reslice->GetOutputPort());
  viewer->SetRenderWindow(window.window);
  viewer->SetupInteractor(window.interactor);
  viewer->SetColorWindow(1);  // intensities lie in [0, 1]
  viewer->SetColorLevel(0.5);
  viewer->SetSlice((viewer->GetSliceMin() + viewer->GetSliceMax()) / 2);
  viewer->Render();
  vtkCamera* camera = viewer->GetRenderer()->GetActiveCamera();
  camera->Azimuth(180);  // depth, the field's y, points down
  camera->Roll(180);
  camera->Zoom(2.4);
  viewer->GetRenderer()->ResetCameraClippingRange();

  vtkNew<vtkCallbackCommand> turn;
  turn->SetClientData(viewer);
  turn->SetCallback(
      [](vtkObject*, unsigned long event, void* data, void*)
      {
        auto* viewer = static_cast<vtkImageViewer2*>(data);
        viewer->SetSlice(viewer->GetSlice() + (event == vtkCommand::MouseWheelForwardEvent ? 1 : -1));
      });
  window.interactor->AddObserver(vtkCommand::MouseWheelForwardEvent, turn);
  window.interactor->AddObserver(vtkCommand::MouseWheelBackwardEvent, turn);
  window.Show();
  return 0;
}
