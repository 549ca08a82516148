// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One Gaussian written to a file, read back and resliced: as bright as it should be.
#include <Data/FieldData.h>
#include <vtkBigusFieldReader.h>
#include <vtkBigusFieldWriter.h>
#include <vtkBigusReslice.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>

#include <cmath>
#include <initializer_list>
#include <iostream>

namespace
{

void Add(vtkFieldData* attributes, const char* name, std::initializer_list<double> tuple)
{
  vtkNew<vtkDoubleArray> array;
  array->SetName(name);
  array->SetNumberOfComponents(static_cast<int>(tuple.size()));
  array->InsertNextTuple(tuple.begin());
  attributes->AddArray(array);
}

}  // namespace

int main()
{
  vtkNew<vtkPolyData> field;
  vtkNew<vtkPoints> points;
  points->InsertNextPoint(4, 3, 0);
  field->SetPoints(points);
  Add(field->GetPointData(), "Scale", {1, 1, 1});
  Add(field->GetPointData(), "Rotation", {1, 0, 0, 0});
  Add(field->GetPointData(), "Reflectivity", {2});
  Add(field->GetFieldData(), "Gamma", {0.5});
  Add(field->GetFieldData(), "ElevationSigma", {0});

  vtkNew<vtkBigusFieldWriter> writer;
  writer->SetFileName("consumer.vtp");
  writer->SetInputData(field);
  writer->Write();
  vtkNew<vtkBigusFieldReader> reader;
  reader->SetFileName("consumer.vtp");
  vtkNew<vtkBigusReslice> slicer;
  slicer->SetInputConnection(reader->GetOutputPort());
  slicer->SetOutputDimensionality(2);
  slicer->SetOutputSpacing(1, 1, 1);
  slicer->SetOutputOrigin(0, 0, 0);
  slicer->SetOutputExtent(0, 8, 0, 6, 0, 0);
  slicer->Update();
  if (bigus::FieldFromPolyData(reader->GetOutput()).Size() != 1)
  {
    return 1;
  }

  const double expected = 1 - std::exp(-1.0);
  const double found = slicer->GetOutput()->GetScalarComponentAsDouble(4, 3, 0, 0);
  std::cout << slicer->GetDevice() << ": " << found << ", expected " << expected << "\n";
  return std::abs(found - expected) < 1e-3 ? 0 : 1;
}
