// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldWriter.h"

#include <algorithm>
#include <string>

#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "IO/AtomicFile.h"
#include "IO/FileError.h"
#include "IO/Formats/Ply.h"
#include "IO/Formats/Vtp.h"
#include "IO/Text.h"
#include "vtkInformation.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"

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

#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 7, 0)
bool vtkBigusFieldWriter::WriteDataAndReturn()
{
  this->WriteFile();
  return this->GetErrorCode() == vtkErrorCode::NoError;
}
#else
void vtkBigusFieldWriter::WriteData()
{
  this->WriteFile();
}
#endif

void vtkBigusFieldWriter::WriteFile()
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
    vtkNew<vtkPolyData> field;
    bigus::ShareField(this->GetInput(), field);
    if (this->Rounding)
    {
      bigus::RoundFieldData(field);
    }
    if (ending == ".ply")
    {
      const bigus::PlyField ply = {bigus::FieldFromPolyData(field), bigus::ProvenanceOf(field)};
      bigus::AtomicFile file(fileName);
      bigus::WritePly(ply, file);
      file.Commit();
      return;
    }
    bigus::AtomicFile file(fileName);
    if (!bigus::WriteVtp(field, file.TemporaryName()))
    {
      throw bigus::FileError(vtkErrorCode::OutOfDiskSpaceError,
                             fileName + ": writing failed, perhaps for want of space; nothing was written");
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
  os << indent << "Rounding: " << this->Rounding << "\n";
}
