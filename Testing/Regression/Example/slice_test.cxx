// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// sliceTest FIELD BASELINE.png: fails unless a slice equals its baseline in every pixel.
#include <vtkBigusFieldReader.h>
#include <vtkBigusReslice.h>
#include <vtkImageAppendComponents.h>
#include <vtkImageData.h>
#include <vtkImageDifference.h>
#include <vtkImageFlip.h>
#include <vtkNew.h>
#include <vtkPNGReader.h>
#include <vtkPNGWriter.h>

#include <algorithm>
#include <iostream>

int main(int, char* argv[])
{
  vtkNew<vtkBigusFieldReader> field;
  field->SetFileName(argv[1]);
  vtkNew<vtkBigusReslice> slice;
  slice->SetInputConnection(field->GetOutputPort());
  slice->SetEngine("reference");  // double precision, no vector instructions
  slice->SetTolerance(0);         // nothing is left out
  slice->SetResliceAxesDirectionCosines(0, 0, 1, 0, 1, 0, -1, 0, 0);
  slice->SetResliceAxesOrigin(2, 0, 0);
  slice->SetOutputDimensionality(2);
  slice->SetOutputSpacing(0.2, 0.4, 1);
  slice->SetOutputOrigin(-15.9, 0, 0);
  slice->SetOutputExtent(0, 159, 0, 127, 0, 0);
  slice->SetOutputScalarTypeToUnsignedChar();
  vtkNew<vtkImageFlip> image;  // row 0 is the skin, which belongs on top of a picture
  image->SetInputConnection(slice->GetOutputPort());
  image->SetFilteredAxis(1);
  vtkNew<vtkPNGReader> baseline;
  baseline->SetFileName(argv[2]);
  vtkNew<vtkImageAppendComponents> colours[2];  // vtkImageDifference wants three components
  for (int i = 0; i < 3; ++i)
  {
    colours[0]->AddInputConnection(image->GetOutputPort());
    colours[1]->AddInputConnection(baseline->GetOutputPort());
  }
  vtkNew<vtkImageDifference> difference;
  difference->SetInputConnection(colours[0]->GetOutputPort());
  difference->SetImageConnection(colours[1]->GetOutputPort());
  difference->AllowShiftOff();
  difference->AveragingOff();
  difference->SetThreshold(0);
  difference->Update();
  const int *size = image->GetOutput()->GetDimensions(), *expected = baseline->GetOutput()->GetDimensions();
  const bool equal = std::equal(size, size + 3, expected) && difference->GetThresholdedError() == 0;

  vtkNew<vtkPNGWriter> writer;
  writer->SetInputConnection(image->GetOutputPort());
  writer->SetFileName("slice_test.png");
  writer->Write();
  std::cout << (equal ? "As the baseline.\n" : "Not as the baseline; look at slice_test.png.\n");
  return equal ? 0 : 1;
}
