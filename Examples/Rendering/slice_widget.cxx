// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A slice that mouse and keys move, in the box that it covered at first.
//   slice_widget FIELD [PICTURE.png]
#include "ExampleWindow.h"
#include "vtkActor.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusSliceProp.h"
#include "vtkBigusSliceRepresentation.h"
#include "vtkBigusSliceWidget.h"
#include "vtkOutlineFilter.h"
#include "vtkPolyDataMapper.h"

int main(int argc, char* argv[])
{
  if (argc < 2)
  {
    return 1;
  }
  ExampleWindow window(argc > 2 ? argv[2] : nullptr, 640, 480);
  vtkNew<vtkBigusFieldReader> field;
  field->SetFileName(argv[1]);
  vtkNew<vtkOutlineFilter> outline;
  outline->SetInputConnection(field->GetOutputPort());
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(outline->GetOutputPort());
  vtkNew<vtkActor> box;
  box->SetMapper(mapper);
  vtkNew<vtkRenderer> renderer;
  renderer->AddActor(box);
  window.Add(renderer, -1.2, -0.6, 1, 1.1);
  vtkNew<vtkBigusSliceWidget> widget;
  widget->SetInteractor(window.interactor);
  vtkBigusSliceRepresentation* moved = widget->GetSliceRepresentation();
  moved->GetSliceProp()->SetInputConnection(field->GetOutputPort());
  moved->GetSliceProp()->PlaceInField(2, 512);
  const double y[3] = {0, 1, 0};
  moved->Rotate(y, 12);  // degrees about the field's y
  widget->On();
  window.Show();
  return 0;
}
