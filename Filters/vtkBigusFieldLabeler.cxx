// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldLabeler.h"

#include "Core/Labels/Labels.h"
#include "Core/Model/Error.h"
#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "Data/Progress.h"
#include "Data/SweepData.h"
#include "PipelineSupport.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"

vtkStandardNewMacro(vtkBigusFieldLabeler);

vtkBigusFieldLabeler::vtkBigusFieldLabeler()
{
  this->SetNumberOfInputPorts(3);
  this->SetEngine("auto");
}

vtkBigusFieldLabeler::~vtkBigusFieldLabeler()
{
  this->SetEngine(nullptr);
}

void vtkBigusFieldLabeler::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "KeepEmptyPictures: " << (this->KeepEmptyPictures ? "On\n" : "Off\n");
  os << indent << "Engine: " << (this->Engine ? this->Engine : "(none)") << "\n";
}

int vtkBigusFieldLabeler::FillInputPortInformation(int port, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), port == 0 ? "vtkPolyData" : "vtkImageData");
  return 1;
}

int vtkBigusFieldLabeler::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  for (int port = 0; port < 3; ++port)
  {
    bigus::RequestWholeInput(inputs[port]);
  }
  return 1;
}

int vtkBigusFieldLabeler::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkPolyData* const output = vtkPolyData::GetData(outputs);
  const auto work = [&]
  {
    bigus::Require(this->Engine, "No Engine is set; \"auto\" takes the fastest.");
    vtkPolyData* const input = vtkPolyData::GetData(inputs[0]);
    vtkImageData* const frames = vtkImageData::GetData(inputs[1]);
    const bigus::ImportedSweep imported = bigus::SweepFromImage(frames);
    bigus::LabelFrames given = bigus::LabelFramesFromImage(vtkImageData::GetData(inputs[2]), frames, imported.frames);
    if (!this->KeepEmptyPictures)
    {
      given = given.Subset(given.Drawn());
    }
    const bigus::FieldLabels labels =
        bigus::FitLabels(bigus::FieldFromPolyData(input), *imported.sweep, given,
                         {this->Engine, [this](double share) { return bigus::ReportProgress(this, share); }});
    if (labels.labels.empty())
    {
      return;  // aborted
    }
    bigus::ShareField(input, output);
    bigus::ReplaceStandardError(output, bigus::StandardErrorOf(input));
    bigus::LabelsToPolyData(labels, output);
  };
  return bigus::Execute(this, outputs, work);
}
