// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldReader.h"

#include <string>

#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "IO/FileError.h"
#include "IO/Formats/Ply.h"
#include "IO/Formats/Vtp.h"
#include "IO/Text.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"

vtkStandardNewMacro(vtkBigusFieldReader);

namespace
{

bool LooksLikePly(const std::string& beginning)
{
  return beginning.rfind("ply\n", 0) == 0 || beginning.rfind("ply\r", 0) == 0;
}

bool LooksLikeVtp(const std::string& beginning)
{
  return beginning.find("<VTKFile") != std::string::npos && beginning.find("PolyData") != std::string::npos;
}

}  // namespace

vtkBigusFieldReader::vtkBigusFieldReader() : FileName(nullptr)
{
  this->SetNumberOfInputPorts(0);
}

vtkBigusFieldReader::~vtkBigusFieldReader()
{
  this->SetFileName(nullptr);
}

int vtkBigusFieldReader::CanReadFile(const char* fileName)
{
  const std::string beginning = fileName ? bigus::FileBeginning(fileName, 4096) : "";
  return LooksLikePly(beginning) || LooksLikeVtp(beginning) ? 1 : 0;
}

int vtkBigusFieldReader::RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputVector)
{
  vtkPolyData* const output = vtkPolyData::GetData(outputVector, 0);
  output->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    if (!this->FileName || !*this->FileName)
    {
      throw bigus::FileError(vtkErrorCode::NoFileNameError, "FileName is not set");
    }
    const std::string fileName = this->FileName;
    if (bigus::InputFile(fileName).Size() == 0)
    {
      throw bigus::TruncationError(fileName + ": the file is empty");
    }
    const std::string beginning = bigus::FileBeginning(fileName, 4096);
    if (!LooksLikePly(beginning) && !LooksLikeVtp(beginning))
    {
      throw bigus::FileError(vtkErrorCode::UnrecognizedFileTypeError,
                             fileName + ": neither a VTK XML PolyData file (.vtp) nor a PLY file (.ply)");
    }
    try
    {
      if (LooksLikePly(beginning))
      {
        const bigus::PlyField ply = bigus::ReadPly(fileName);
        ply.field.Validate();
        bigus::FieldToPolyData(ply.field, output);
        bigus::ReplaceProvenance(output, ply.provenance);
      }
      else
      {
        bigus::ReadVtp(fileName, output);
        bigus::ShareField(output, output);
      }
    }
    catch (const bigus::FileError&)
    {
      throw;
    }
    catch (const bigus::Error& error)  // what is wrong with the field
    {
      throw bigus::FormatError(fileName + ": " + error.what());
    }
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< bigus::MessageOf(error));
    this->SetErrorCode(bigus::ErrorCodeOf(error));
    output->Initialize();
    return 0;
  }
  return 1;
}

void vtkBigusFieldReader::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "FileName: " << (this->FileName ? this->FileName : "(none)") << "\n";
}
