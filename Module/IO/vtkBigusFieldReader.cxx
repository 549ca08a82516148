// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldReader.h"

#include <string>
#include <string_view>

#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "IO/ErrorCode.h"
#include "IO/FieldFile.h"
#include "IO/Text.h"
#include "vtkCallbackCommand.h"
#include "vtkExecutive.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkXMLPolyDataReader.h"

vtkStandardNewMacro(vtkBigusFieldReader);

namespace
{

// The first complaint, without the place in VTK's source and the object's address.
void KeepComplaint(vtkObject*, unsigned long, void* clientData, void* callData)
{
  std::string& kept = *static_cast<std::string*>(clientData);
  if (kept.empty())
  {
    const std::string text = callData ? static_cast<const char*>(callData) : "it gives no reason";
    const std::size_t begin = text.find("): ");
    kept = bigus::Trimmed(std::string_view(text).substr(begin == std::string::npos ? 0 : begin + 3));
  }
}

void ReadWithVtk(const std::string& fileName, vtkPolyData* polyData)
{
  std::string complaint;
  vtkNew<vtkCallbackCommand> observer;
  observer->SetCallback(KeepComplaint);
  observer->SetClientData(&complaint);
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->AddObserver(vtkCommand::ErrorEvent, observer);
  reader->GetExecutive()->AddObserver(vtkCommand::ErrorEvent, observer);
  reader->SetReaderErrorObserver(observer);
  reader->SetParserErrorObserver(observer);
  reader->SetFileName(fileName.c_str());
  reader->Update();
  if (!complaint.empty() || reader->GetErrorCode() != vtkErrorCode::NoError)
  {
    throw bigus::FormatError(fileName +
                             ": VTK's reader refuses it: " + (complaint.empty() ? "it gives no reason" : complaint));
  }
  polyData->ShallowCopy(reader->GetOutput());
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
  return bigus::LooksLikeField(beginning) ? 1 : 0;
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
      throw bigus::FileError(bigus::FileFault::NoName, "FileName is not set");
    }
    const std::string fileName = this->FileName;
    if (const auto stored = bigus::ReadField(fileName))
    {
      bigus::FieldToPolyData(stored->field, output);
      bigus::ReplaceProvenance(output, stored->provenance);
      return 1;
    }
    ReadWithVtk(fileName, output);
    try
    {
      bigus::ShareField(output, output);
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
