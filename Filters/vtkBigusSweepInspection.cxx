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
  const std::size_t rows = inspected.findings.size();
  auto* kinds = bigus::AddColumn<vtkStringArray>(table, "Kind", rows);
  auto* frames = bigus::AddColumn<vtkIntArray>(table, "Frames", rows);
  auto* pixels = bigus::AddColumn<vtkIntArray>(table, "Pixels", rows);
  auto* applied = bigus::AddColumn<vtkIntArray>(table, "Applied", rows);
  auto* texts = bigus::AddColumn<vtkStringArray>(table, "Text", rows);
  for (std::size_t i = 0; i < rows; ++i)
  {
    const bigus::Finding& finding = inspected.findings[i];
    const vtkIdType row = static_cast<vtkIdType>(i);
    kinds->SetValue(row, bigus::NameOf(finding.kind));
    frames->SetValue(row, static_cast<int>(finding.frames.size()));
    pixels->SetValue(row, static_cast<int>(finding.pixels));
    applied->SetValue(row, finding.isApplied ? 1 : 0);
    texts->SetValue(row, bigus::Describe(finding, numbers));
  }
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
