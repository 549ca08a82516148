// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusLabelReader.h"

#include <algorithm>

#include "Data/Arrays.h"
#include "Data/LabelData.h"
#include "IO/LabelFile.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkObjectFactory.h"
#include "vtkStreamingDemandDrivenPipeline.h"

vtkStandardNewMacro(vtkBigusLabelReader);

vtkBigusLabelReader::vtkBigusLabelReader()
{
  this->SetNumberOfInputPorts(0);
  this->SetNumberOfOutputPorts(1);
}

vtkImageData* vtkBigusLabelReader::GetOutput()
{
  return vtkImageData::SafeDownCast(this->GetOutputDataObject(0));
}

int vtkBigusLabelReader::FillOutputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkDataObject::DATA_TYPE_NAME(), "vtkImageData");
  return 1;
}

int vtkBigusLabelReader::RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputVector)
{
  vtkImageData* const output = vtkImageData::GetData(outputVector, 0);
  output->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    const bigus::LabelPictures pictures =
        bigus::ReadLabelPictures(this->RequireFileName(), static_cast<std::size_t>(this->MaximumPictures));
    const auto count = static_cast<int>(pictures.numbers.size());
    const std::array<int, 3> first = pictures.place.value_or(std::array<int, 3>{});
    output->SetExtent(first[0], first[0] + pictures.width - 1, first[1], first[1] + pictures.height - 1, first[2],
                      first[2] + count - 1);
    output->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
    std::copy(pictures.pixels.begin(), pictures.pixels.end(), static_cast<unsigned char*>(output->GetScalarPointer()));
    if (!pictures.place)
    {
      const auto source = bigus::NewArray<vtkIntArray>("SourceFrame", 1, count);
      std::copy(pictures.numbers.begin(), pictures.numbers.end(), source->GetPointer(0));
      output->GetFieldData()->AddArray(source);
    }
    if (!pictures.labels.empty())
    {
      bigus::ReplaceLabelNames(output, pictures.labels);
    }
    this->Numbered = pictures.isNumbered;
    return 1;
  }
  catch (const std::exception& error)
  {
    output->Initialize();
    return this->Fail(error);
  }
}

void vtkBigusLabelReader::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "MaximumPictures: " << this->MaximumPictures << "\n";
  os << indent << "Numbered: " << this->Numbered << "\n";
}
