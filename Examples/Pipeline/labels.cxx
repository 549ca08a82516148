// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Labels drawn on the frames of a sweep as a surface: reader, labeler, voxelizer, flying edges, STL.
//
//   labels SWEEP.igs.mha LABELS FIELD.vtp VALUE SURFACE.stl
//
// LABELS is a .seg.nrrd of 3D Slicer, another .nrrd or .mha with one slice a frame, or a folder of PNG images.
#include <cstdlib>
#include <iostream>

#include "vtkBigusFieldLabeler.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusLabelReader.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusVoxelizer.h"
#include "vtkFlyingEdges3D.h"
#include "vtkNew.h"
#include "vtkPolyData.h"
#include "vtkSTLWriter.h"
#include "vtkWindowedSincPolyDataFilter.h"

int main(int argumentCount, char** arguments)
{
  if (argumentCount != 6)
  {
    std::cerr << "usage: labels SWEEP.igs.mha LABELS FIELD.vtp VALUE SURFACE.stl\n";
    return EXIT_FAILURE;
  }
  vtkNew<vtkBigusSequenceReader> sweep;
  sweep->SetFileName(arguments[1]);
  vtkNew<vtkBigusLabelReader> labels;
  labels->SetFileName(arguments[2]);
  vtkNew<vtkBigusFieldReader> field;
  field->SetFileName(arguments[3]);

  vtkNew<vtkBigusFieldLabeler> labeler;
  labeler->SetInputConnection(field->GetOutputPort());
  labeler->SetInputConnection(1, sweep->GetOutputPort());
  labeler->SetInputConnection(2, labels->GetOutputPort());

  vtkNew<vtkBigusVoxelizer> share;  // how much of each voxel has the label
  share->SetInputConnection(labeler->GetOutputPort());
  share->SetOutputModeToLabelShare();
  share->SetLabelValue(std::atoi(arguments[4]));

  vtkNew<vtkFlyingEdges3D> border;
  border->SetInputConnection(share->GetOutputPort());
  border->SetValue(0, 0.5);
  vtkNew<vtkWindowedSincPolyDataFilter> smooth;  // which does not shrink
  smooth->SetInputConnection(border->GetOutputPort());
  vtkNew<vtkSTLWriter> writer;
  writer->SetInputConnection(smooth->GetOutputPort());
  writer->SetFileName(arguments[5]);
  writer->SetFileTypeToBinary();
  writer->Write();
  std::cout << smooth->GetOutput()->GetNumberOfCells() << " triangles in " << arguments[5] << '\n';
  return smooth->GetOutput()->GetNumberOfCells() > 0 && writer->GetErrorCode() == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
