// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusSweepInspection.h"

#include <vector>

#include "Core/Inspection/Inspection.h"
#include "Data/SweepData.h"
#include "PipelineSupport.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkStringArray.h"
#include "vtkTable.h"

vtkStandardNewMacro(vtkBigusSweepInspection);

namespace
{

void FillFindings(const bigus::InspectedSweep& inspected, const std::vector<int>& numbers, vtkTable* table)
{
  using bigus::Finding;
  const std::vector<Finding>& found = inspected.findings;
  bigus::AddColumn<vtkStringArray>(table, "Kind", found, [](const Finding& one) { return bigus::NameOf(one.kind); });
  bigus::AddColumn<vtkIntArray>(table, "Frames", found, [](const Finding& one) { return one.frames.size(); });
  bigus::AddColumn<vtkIntArray>(table, "Pixels", found, &Finding::pixels);
  bigus::AddColumn<vtkIntArray>(table, "Applied", found, &Finding::isApplied);
  bigus::AddColumn<vtkStringArray>(table, "Text", found,
                                   [&numbers](const Finding& one) { return bigus::Describe(one, numbers); });
}

/// Why each frame of the image is left out.
void AddReasons(const bigus::InspectedSweep& inspected, const std::vector<int>& numbers, vtkImageData* image)
{
  vtkNew<vtkIntArray> reasons;
  reasons->SetName("Finding");
  reasons->SetNumberOfValues(image->GetDimensions()[2]);
  reasons->FillValue(0);
  for (const bigus::Finding& finding : inspected.findings)
  {
    for (const int frame : finding.LeftOut())
    {
      reasons->SetValue(numbers[frame], 1 + static_cast<int>(finding.kind));
    }
  }
  image->GetFieldData()->AddArray(reasons);
}

}  // namespace

vtkBigusSweepInspection::vtkBigusSweepInspection()
{
  this->SetNumberOfOutputPorts(2);
}

void vtkBigusSweepInspection::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Keep: " << this->Keep << "\n";
  os << indent << "Findings: " << this->GetFindings()->GetNumberOfRows() << "\n";
}

vtkTable* vtkBigusSweepInspection::GetFindings()
{
  return vtkTable::SafeDownCast(this->GetOutputDataObject(1));
}

int vtkBigusSweepInspection::FillOutputPortInformation(int port, vtkInformation* info)
{
  info->Set(vtkDataObject::DATA_TYPE_NAME(), port == 0 ? "vtkImageData" : "vtkTable");
  return 1;
}

int vtkBigusSweepInspection::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  return 1;
}

int vtkBigusSweepInspection::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkImageData* output = vtkImageData::GetData(outputs, 0);
  vtkTable* table = vtkTable::GetData(outputs, 1);
  const auto work = [&]
  {
    vtkImageData* image = vtkImageData::GetData(inputs[0]);
    const bigus::KeptKinds kept = bigus::KeptKinds::Parse(this->Keep);
    const bigus::ImportedSweep imported = bigus::SweepFromImage(image);
    const bigus::InspectedSweep inspected = bigus::Inspect(imported.sweep, kept);
    output->ShallowCopy(image);
    AddReasons(inspected, imported.frames, output);
    FillFindings(inspected, imported.frames, table);
  };
  return bigus::Execute(this, outputs, work);
}
