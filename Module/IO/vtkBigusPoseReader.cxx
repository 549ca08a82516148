// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusPoseReader.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "Data/Arrays.h"
#include "IO/FileError.h"
#include "IO/Formats/LinearTransform.h"
#include "IO/Formats/Markups.h"
#include "IO/Poses.h"
#include "IO/SequenceFile.h"
#include "IO/Text.h"
#include "vtkDataObject.h"
#include "vtkDoubleArray.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkObjectFactory.h"
#include "vtkTable.h"

vtkStandardNewMacro(vtkBigusPoseReader);

namespace
{

struct Plane
{
  Eigen::Matrix4d imageToReference;
  int width;
  int height;
  int sourceFrame;
  double timestamp;
};

/// `rejections` gets the sentence on those left out.
std::vector<Plane> PlanesOfSequence(const std::string& fileName, const bigus::PoseOptions& options, int& rejected,
                                    std::string& rejections)
{
  bigus::ImageOptions images;
  images.wanted = false;
  const bigus::SequenceFile file = bigus::ReadSequenceFile(fileName, images);
  bigus::PoseTable table;
  bigus::ResolvePoses(file, options, table);
  rejections = table.RejectionSummary();
  std::vector<Plane> planes;
  for (std::size_t i = 0; i < table.frames.size(); ++i)
  {
    rejected += table.frames[i].accepted ? 0 : 1;
    if (table.frames[i].accepted)
    {
      const int width = file.sizes.empty() ? file.width : file.sizes[i][0];
      const int height = file.sizes.empty() ? file.height : file.sizes[i][1];
      planes.push_back({table.frames[i].imageToReference, width, height, static_cast<int>(i), table.timestamps[i]});
    }
  }
  if (planes.empty())
  {
    throw bigus::FormatError(fileName + ": no pose is left: " + rejections);
  }
  return planes;
}

std::vector<Plane> PlanesOfMarkups(const std::string& fileName, double spacing, bool worldIsLps)
{
  if (!(spacing > 0 && std::isfinite(spacing)))
  {
    throw bigus::FileError(vtkErrorCode::UserError,
                           "PixelSpacing is " + bigus::ExactNumber(spacing) + " mm; it must be positive");
  }
  std::vector<Plane> planes;
  for (const auto& plane : bigus::ReadMarkupPlanes(fileName, spacing, worldIsLps))
  {
    planes.push_back({plane.imageToReference, plane.width, plane.height, static_cast<int>(planes.size()),
                      std::numeric_limits<double>::quiet_NaN()});
  }
  return planes;
}

/// The transform's matrix is the pose.
std::vector<Plane> PlaneOfTransform(const std::string& fileName, bool worldIsLps)
{
  return {{bigus::ReadObjectMatrix(fileName, worldIsLps), 0, 0, 0, std::numeric_limits<double>::quiet_NaN()}};
}

}  // namespace

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
  this->NumberOfRejectedPoses = 0;
  this->RejectionSummary.clear();
  try
  {
    const std::string fileName = this->RequireFileName();
    const std::string beginning = bigus::FileBeginning(fileName, 4096);
    const bool json = !bigus::Trimmed(beginning).empty() && bigus::Trimmed(beginning).front() == '{';
    const bool worldIsLps = this->WorldCoordinateSystem == LPS;
    const std::vector<Plane> planes =
        json ? PlanesOfMarkups(fileName, this->PixelSpacing, worldIsLps)
        : bigus::LooksLikeTransform(beginning)
            ? PlaneOfTransform(fileName, worldIsLps)
            : PlanesOfSequence(fileName, this->GetPoseOptions(), this->NumberOfRejectedPoses, this->RejectionSummary);

    const auto count = static_cast<vtkIdType>(planes.size());
    const auto imageToReference = bigus::NewArray<vtkDoubleArray>("ImageToReference", 16, count);
    const auto size = bigus::NewArray<vtkIntArray>("Size", 2, count);
    const auto sourceFrame = bigus::NewArray<vtkIntArray>("SourceFrame", 1, count);
    const auto timestamp = bigus::NewArray<vtkDoubleArray>("Timestamp", 1, count);
    bool allTimed = true;
    for (vtkIdType i = 0; i < count; ++i)
    {
      const Plane& plane = planes[static_cast<std::size_t>(i)];
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
    return this->Fail(error);
  }
  return 1;
}

void vtkBigusPoseReader::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "PixelSpacing: " << this->PixelSpacing << "\n";
  os << indent << "WorldCoordinateSystem: " << (this->WorldCoordinateSystem == LPS ? "LPS" : "RAS") << "\n";
  os << indent << "NumberOfRejectedPoses: " << this->NumberOfRejectedPoses << "\n";
  os << indent << "RejectionSummary: " << this->RejectionSummary << "\n";
}
