// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldWriter.h"

#include <algorithm>
#include <string>

#include "AtomicFile.h"
#include "FieldData.h"
#include "FileError.h"
#include "Text.h"
#include "vtkInformation.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkXMLPolyDataWriter.h"

vtkStandardNewMacro(vtkBigusFieldWriter);

vtkBigusFieldWriter::vtkBigusFieldWriter() : FileName(nullptr) {}

vtkBigusFieldWriter::~vtkBigusFieldWriter()
{
  this->SetFileName(nullptr);
}

int vtkBigusFieldWriter::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData");
  return 1;
}

vtkPolyData* vtkBigusFieldWriter::GetInput()
{
  return vtkPolyData::SafeDownCast(this->GetInputDataObject(0, 0));
}

void vtkBigusFieldWriter::WriteData()
{
  try
  {
    if (!this->FileName || !*this->FileName)
    {
      throw bigus::FileError(vtkErrorCode::NoFileNameError, "FileName is not set");
    }
    const std::string fileName = this->FileName;
    const std::string ending =
        bigus::Lowercase(fileName.substr(fileName.size() - std::min<std::size_t>(4, fileName.size())));
    if (ending != ".vtp" && ending != ".ply")
    {
      throw bigus::FileError(vtkErrorCode::UnrecognizedFileTypeError,
                             fileName + ": fields are written as .vtp or .ply; name the file so");
    }
    const bigus::StoredField stored = bigus::FieldFromPolyData(this->GetInput(), "the field");
    bigus::AtomicFile file(fileName);
    if (ending == ".ply")
    {
      bigus::WritePly(stored, file);
    }
    else
    {
      vtkNew<vtkPolyData> clean;
      bigus::FieldToPolyData(stored, clean);
      vtkNew<vtkXMLPolyDataWriter> writer;
      writer->SetFileName(file.TemporaryName().c_str());
      writer->SetInputData(clean);
      writer->SetDataModeToAppended();
      writer->EncodeAppendedDataOff();
      writer->SetCompressorTypeToZLib();
      writer->SetHeaderTypeToUInt64();
      if (!writer->Write() || writer->GetErrorCode() != vtkErrorCode::NoError)
      {
        throw bigus::FileError(vtkErrorCode::OutOfDiskSpaceError,
                               fileName + ": writing failed, perhaps for want of space; nothing was written");
      }
    }
    file.Commit();
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< bigus::MessageOf(error));
    this->SetErrorCode(bigus::ErrorCodeOf(error));
  }
}

void vtkBigusFieldWriter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "FileName: " << (this->FileName ? this->FileName : "(none)") << "\n";
}
