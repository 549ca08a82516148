// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A VTK pipeline from a tracked sweep to a slice: reader, trainer, reslice, PNG.
//
//   pipeline SWEEP.igs.mha SLICE.png
//
// The slice is taken where the middle frame of the sweep was, which training never sees.
#include <cstdlib>
#include <iostream>

#include "vtkBigusReslice.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusTrainer.h"
#include "vtkCallbackCommand.h"
#include "vtkCommand.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkImageFlip.h"
#include "vtkIntArray.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkPNGWriter.h"
#include "vtkPolyData.h"

int main(int argumentCount, char** arguments)
{
  if (argumentCount != 3)
  {
    std::cerr << "usage: pipeline SWEEP.igs.mha SLICE.png\n";
    return EXIT_FAILURE;
  }

  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName(arguments[1]);

  vtkNew<vtkBigusTrainer> trainer;
  trainer->SetInputConnection(reader->GetOutputPort());
  trainer->AutomaticOff();  // by default the trainer tries out what this sweep needs, which takes longer
  trainer->SetGaussians(5000);
  trainer->SetIterations(60);
  trainer->SetHoldOut(4);

  vtkNew<vtkCallbackCommand> report;
  report->SetCallback(
      [](vtkObject* caller, unsigned long, void*, void*)
      {
        auto* algorithm = vtkAlgorithm::SafeDownCast(caller);
        std::cerr << "\rtraining " << static_cast<int>(100 * algorithm->GetProgress()) << " %" << std::flush;
      });
  trainer->AddObserver(vtkCommand::ProgressEvent, report);
  trainer->Update();
  std::cerr << '\n';
  if (trainer->GetErrorCode() || trainer->GetOutput()->GetNumberOfPoints() == 0)
  {
    return EXIT_FAILURE;  // VTK has said why
  }

  // The held-out frame nearest the middle: its pose says where to look, and its size how much.
  vtkImageData* sweep = reader->GetOutput();
  vtkIntArray* heldOut = trainer->GetHeldOutFrames();
  const int frame = heldOut->GetValue(heldOut->GetNumberOfValues() / 2);
  vtkNew<vtkMatrix4x4> pose;  // pixel (i, j, 0, 1) to mm
  pose->DeepCopy(sweep->GetFieldData()->GetArray("ImageToReference")->GetTuple(frame));

  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputConnection(trainer->GetOutputPort());
  reslice->SetOutputToFrame(pose, sweep->GetDimensions()[0], sweep->GetDimensions()[1]);
  reslice->SetOutputScalarTypeToUnsignedChar();

  vtkNew<vtkImageFlip> flip;  // VTK's PNG writer puts the last row on top; an ultrasound image starts there
  flip->SetInputConnection(reslice->GetOutputPort());
  flip->SetFilteredAxis(1);

  vtkNew<vtkPNGWriter> writer;
  writer->SetInputConnection(flip->GetOutputPort());
  writer->SetFileName(arguments[2]);
  writer->Write();
  if (writer->GetErrorCode())
  {
    return EXIT_FAILURE;
  }

  std::cout << trainer->GetOutput()->GetNumberOfPoints() << " Gaussians after " << trainer->GetIterationsDone()
            << " steps on " << trainer->GetDevice() << "; frame " << frame << " predicted in " << arguments[2] << '\n';
  return EXIT_SUCCESS;
}
