// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The Gaussians of a field as ellipsoids, beside the sweep's frames and the probe's path.
//   field_mapper FIELD SWEEP [PICTURE.png]
#include "ExampleWindow.h"
#include "vtkActor.h"
#include "vtkBigusFieldMapper.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusSweepOutline.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"

int main(int argc, char* argv[])
{
  if (argc < 3)
  {
    return 1;
  }
  ExampleWindow window(argc > 3 ? argv[3] : nullptr, 440, 330);
  vtkNew<vtkBigusFieldReader> field;
  field->SetFileName(argv[1]);
  vtkNew<vtkBigusFieldMapper> mapper;
  mapper->SetInputConnection(field->GetOutputPort());
  mapper->SetScaleFactor(0.6);  // standard deviations
  vtkNew<vtkActor> ellipsoids;
  ellipsoids->SetMapper(mapper);
  vtkNew<vtkBigusSequenceReader> sweep;
  sweep->SetFileName(argv[2]);
  vtkNew<vtkBigusSweepOutline> outline;
  outline->SetInputConnection(sweep->GetOutputPort());
  outline->SetFrameStride(8);
  vtkNew<vtkPolyDataMapper> lines[2];  // frames, path
  vtkNew<vtkActor> actors[2];
  vtkNew<vtkRenderer> renderer;
  renderer->AddActor(ellipsoids);
  for (int port = 0; port < 2; ++port)
  {
    lines[port]->SetInputConnection(outline->GetOutputPort(port));
    actors[port]->SetMapper(lines[port]);
    actors[port]->GetProperty()->SetLineWidth(port == 0 ? 1 : 4);
    renderer->AddActor(actors[port]);
  }
  actors[0]->GetProperty()->SetColor(0.6, 0.75, 0.9);
  actors[1]->GetProperty()->SetColor(1, 0.85, 0.2);
  window.Add(renderer, -0.8, -0.9, -1.1, 1.4);
  window.Show();
  return 0;
}
