// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusPoseReader.h"

#include <cmath>
#include <string>
#include <vector>

#include "Data/Arrays.h"
#include "IO/ErrorCode.h"
#include "IO/PlaneFile.h"
#include "IO/Poses.h"
#include "vtkDataObject.h"
#include "vtkDoubleArray.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkObjectFactory.h"
#include "vtkTable.h"

vtkStandardNewMacro(vtkBigusPoseReader);

vtkBigusPoseReader::vtkBigusPoseReader() = default;

vtkBigusPoseReader::~vtkBigusPoseReader() = default;

vtkTable* vtkBigusPoseReader::GetOutput()
{
  return vtkTable::SafeDownCast(this->GetOutputDataObject(0));
}

int vtkBigusPoseReader::FillOutputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkDataObject::DATA_TYPE_NAME(), "vtkTable");
  return 1;
}

int vtkBigusPoseReader::RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputVector)
{
  vtkTable* const output = vtkTable::GetData(outputVector, 0);
  output->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  bigus::PlaneFile file;
  int succeeded = 1;
  try
  {
    const std::string fileName = this->RequireFileName();
    bigus::ReadPlanes(fileName, this->GetPoseOptions(), this->PixelSpacing, this->WorldCoordinateSystem == LPS, file);
    const std::vector<bigus::FilePlane>& planes = file.planes;
    const auto count = static_cast<vtkIdType>(planes.size());
    const auto imageToReference = bigus::NewArray<vtkDoubleArray>("ImageToReference", 16, count);
    const auto size = bigus::NewArray<vtkIntArray>("Size", 2, count);
    const auto sourceFrame = bigus::NewArray<vtkIntArray>("SourceFrame", 1, count);
    const auto timestamp = bigus::NewArray<vtkDoubleArray>("Timestamp", 1, count);
    bool allTimed = true;
    for (vtkIdType i = 0; i < count; ++i)
    {
      const bigus::FilePlane& plane = planes[static_cast<std::size_t>(i)];
      for (int c = 0; c < 16; ++c)
      {
        imageToReference->SetComponent(i, c, plane.imageToReference(c / 4, c % 4));
      }
      size->SetComponent(i, 0, plane.width);
      size->SetComponent(i, 1, plane.height);
      sourceFrame->SetValue(i, plane.sourceFrame);
      timestamp->SetValue(i, plane.timestamp);
      allTimed = allTimed && std::isfinite(plane.timestamp);
    }
    output->AddColumn(imageToReference);
    output->AddColumn(size);
    output->AddColumn(sourceFrame);
    if (allTimed)
    {
      output->AddColumn(timestamp);
    }
  }
  catch (const std::exception& error)
  {
    output->Initialize();
    succeeded = this->Fail(error);
  }
  this->NumberOfRejectedPoses = file.rejected;
  this->RejectionSummary = file.rejections;
  return succeeded;
}

void vtkBigusPoseReader::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "PixelSpacing: " << this->PixelSpacing << "\n";
  os << indent << "WorldCoordinateSystem: " << (this->WorldCoordinateSystem == LPS ? "LPS" : "RAS") << "\n";
  os << indent << "NumberOfRejectedPoses: " << this->NumberOfRejectedPoses << "\n";
  os << indent << "RejectionSummary: " << this->RejectionSummary << "\n";
}
