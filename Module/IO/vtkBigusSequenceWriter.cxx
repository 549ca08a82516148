// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusSequenceWriter.h"

#include <string>

#include "Data/Arrays.h"
#include "Data/Progress.h"
#include "IO/ErrorCode.h"
#include "IO/SequenceOutput.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"

vtkStandardNewMacro(vtkBigusSequenceWriter);

namespace
{

bigus::FileError InputError(const std::string& message)
{
  return bigus::FileError(bigus::FileFault::User, message);
}

bigus::ElementType ElementTypeOf(int vtkType)
{
  switch (vtkType)
  {
    case VTK_UNSIGNED_CHAR:
      return bigus::ElementType::UInt8;
    case VTK_UNSIGNED_SHORT:
      return bigus::ElementType::UInt16;
    case VTK_FLOAT:
      return bigus::ElementType::Float32;
    default:
      throw InputError("pixels of type " + std::string(vtkImageScalarTypeNameMacro(vtkType)) +
                       "; unsigned char, unsigned short and float are written");
  }
}

}  // namespace

vtkBigusSequenceWriter::vtkBigusSequenceWriter()
    : FileName(nullptr), FromFrame(nullptr), ToFrame(nullptr), Compression(1)
{
  this->SetFromFrame("Image");
  this->SetToFrame("Reference");
}

vtkBigusSequenceWriter::~vtkBigusSequenceWriter()
{
  this->SetFileName(nullptr);
  this->SetFromFrame(nullptr);
  this->SetToFrame(nullptr);
}

int vtkBigusSequenceWriter::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkImageData");
  return 1;
}

vtkImageData* vtkBigusSequenceWriter::GetInput()
{
  return vtkImageData::SafeDownCast(this->GetInputDataObject(0, 0));
}

#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 7, 0)
bool vtkBigusSequenceWriter::WriteDataAndReturn()
{
  this->WriteFile();
  return this->GetErrorCode() == vtkErrorCode::NoError;
}
#else
void vtkBigusSequenceWriter::WriteData()
{
  this->WriteFile();
}
#endif

void vtkBigusSequenceWriter::WriteFile()
{
  try
  {
    bigus::Require(bigus::FileFault::NoName, this->FileName && *this->FileName, "FileName is not set");
    const std::string fileName = this->FileName;
    bigus::SequenceToWrite sequence;
    sequence.fromFrame = this->FromFrame ? this->FromFrame : "";
    sequence.toFrame = this->ToFrame ? this->ToFrame : "";
    sequence.compression = this->Compression != 0;
    bigus::RequireSequenceNames(fileName, sequence.fromFrame, sequence.toFrame);
    vtkImageData* const image = this->GetInput();
    vtkDataArray* const scalars = image->GetPointData()->GetScalars();
    int size[3];
    image->GetDimensions(size);
    if (!scalars || scalars->GetNumberOfTuples() < 1)
    {
      throw InputError("the sweep has no pixels");
    }
    if (scalars->GetNumberOfComponents() != 1)
    {
      throw InputError("the sweep's pixels have " + std::to_string(scalars->GetNumberOfComponents()) +
                       " components; one is expected");
    }
    vtkFieldData* const fields = image->GetFieldData();
    vtkDataArray* const poses = bigus::FindArray(fields, "Sweep", "ImageToReference", 16, size[2], true);
    vtkDataArray* const timestamps = bigus::FindArray(fields, "Sweep", "Timestamp", 1, size[2], false);
    vtkDataArray* const status = bigus::FindArray(fields, "Sweep", "Status", 1, size[2], false);

    sequence.width = size[0];
    sequence.height = size[1];
    sequence.elementType = ElementTypeOf(scalars->GetDataType());
    sequence.pixels = scalars->GetVoidPointer(0);
    sequence.imageToReference.resize(16 * static_cast<std::size_t>(size[2]));
    for (int frame = 0; frame < size[2]; ++frame)
    {
      poses->GetTuple(frame, &sequence.imageToReference[16 * static_cast<std::size_t>(frame)]);
      if (timestamps)
      {
        sequence.timestamps.push_back(timestamps->GetComponent(frame, 0));
      }
      if (status)
      {
        sequence.isUsable.push_back(status->GetComponent(frame, 0) != 0);
      }
    }
    if (!bigus::WriteSequence(sequence, fileName, [this](double share) { return bigus::ReportProgress(this, share); }))
    {
      this->SetErrorCode(vtkErrorCode::UserError);  // so that Write() does not say it has written
    }
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< bigus::MessageOf(error));
    this->SetErrorCode(bigus::ErrorCodeOf(error));
  }
}

void vtkBigusSequenceWriter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  const auto name = [](const char* text) { return text ? text : "(none)"; };
  os << indent << "FileName: " << name(this->FileName) << "\n";
  os << indent << "FromFrame: " << name(this->FromFrame) << "\n";
  os << indent << "ToFrame: " << name(this->ToFrame) << "\n";
  os << indent << "Compression: " << this->Compression << "\n";
}
