// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A frame's plane, as thick as the probe's beam, and a slice that crosses it.
//   slice_prop FIELD SWEEP [PICTURE.png]
#include "ExampleWindow.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusSliceProp.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkProperty.h"

int main(int argc, char* argv[])
{
  if (argc < 3)
  {
    return 1;
  }
  ExampleWindow window(argc > 3 ? argv[3] : nullptr, 640, 480);
  vtkNew<vtkBigusFieldReader> field;
  field->SetFileName(argv[1]);
  vtkNew<vtkBigusSequenceReader> sweep;
  sweep->SetFileName(argv[2]);
  sweep->Update();
  const int* size = sweep->GetOutput()->GetDimensions();
  vtkNew<vtkMatrix4x4> pose;
  pose->DeepCopy(sweep->GetOutput()->GetFieldData()->GetArray("ImageToReference")->GetTuple(size[2] / 2));
  vtkNew<vtkBigusSliceProp> frame;
  frame->SetInputConnection(field->GetOutputPort());
  frame->SetPlaneToFrame(pose, size[0], size[1]);
  frame->BeamVisibilityOn();
  vtkNew<vtkBigusSliceProp> across;
  across->SetInputConnection(field->GetOutputPort());
  across->PlaceInField(0, 512);
  across->GetOutlineProperty()->SetColor(1, 0.6, 0.2);
  vtkNew<vtkRenderer> renderer;
  renderer->AddViewProp(frame);
  renderer->AddViewProp(across);
  window.Add(renderer, -1.4, -0.6, -1.2, 1.35);
  window.Show();
  return 0;
}
