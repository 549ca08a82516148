// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field as a cloud, by VTK's volume rendering. The field's own quantiles say what is opaque.
//   field_volume FIELD [PICTURE.png]
#include "ExampleWindow.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusFieldVolume.h"

int main(int argc, char* argv[])
{
  if (argc < 2)
  {
    return 1;
  }
  ExampleWindow window(argc > 2 ? argv[2] : nullptr, 520, 390);
  vtkNew<vtkBigusFieldReader> field;
  field->SetFileName(argv[1]);
  vtkNew<vtkBigusFieldVolume> volume;
  volume->SetInputConnection(field->GetOutputPort());
  vtkNew<vtkRenderer> renderer;
  renderer->AddVolume(volume);
  window.Add(renderer, -0.7, -0.5, -1.3, 1.5);
  window.Show();
  return 0;
}
