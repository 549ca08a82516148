// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldReader.h"

#include <algorithm>
#include <string>

#include "FieldData.h"
#include "FileError.h"
#include "Text.h"
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

bool LooksLikePly(const std::string& beginning)
{
  return beginning.rfind("ply\n", 0) == 0 || beginning.rfind("ply\r", 0) == 0;
}

bool LooksLikeVtp(const std::string& beginning)
{
  return beginning.find("<VTKFile") != std::string::npos && beginning.find("PolyData") != std::string::npos;
}

// VTK's reader allocates what a piece says it has before it looks for it, so that is checked here: no piece
// can have more points than its file, unpacked, has bytes.
void CheckVtp(const std::string& fileName)
{
  bigus::InputFile file(fileName);
  char tail[64] = {};
  file.Seek(file.Size() - std::min<std::uint64_t>(file.Size(), sizeof(tail)));
  const std::string ending(tail, file.Read(tail, sizeof(tail)));
  if (ending.find("</VTKFile>") == std::string::npos)
  {
    throw bigus::TruncationError(fileName + ": does not end with </VTKFile>; the file is truncated");
  }
  const std::uint64_t most = file.Size() * bigus::deflateLimit;
  const std::string beginning = bigus::FileBeginning(fileName, 64 * 1024);
  for (const char* name : {"NumberOfPoints=\"", "NumberOfVerts=\"", "NumberOfLines=\"", "NumberOfStrips=\"",
                           "NumberOfPolys=\"", "NumberOfTuples=\"", "NumberOfComponents=\""})
  {
    const std::string attribute = name;
    for (std::size_t at = beginning.find(attribute); at != std::string::npos;
         at = beginning.find(attribute, at + 1))
    {
      const std::size_t begin = at + attribute.size();
      const std::string text = beginning.substr(begin, beginning.find('"', begin) - begin);
      std::int64_t claimed = -1;
      if (!bigus::ParseNumber(text, claimed) || claimed < 0 || static_cast<std::uint64_t>(claimed) > most)
      {
        throw bigus::FormatError(fileName + ": " + attribute.substr(0, attribute.size() - 2) + " is " +
                                 bigus::Quoted(text) + ", which a file of this size cannot hold");
      }
    }
  }
}

bigus::StoredField ReadVtp(const std::string& fileName)
{
  CheckVtp(fileName);
  std::string problem;
  vtkNew<vtkCallbackCommand> keepProblem;
  keepProblem->SetClientData(&problem);
  keepProblem->SetCallback(
      [](vtkObject*, unsigned long, void* target, void* text)
      {
        auto& kept = *static_cast<std::string*>(target);
        if (text && kept.empty())
        {
          kept = static_cast<const char*>(text);
        }
      });
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->AddObserver(vtkCommand::ErrorEvent, keepProblem);
  reader->AddObserver(vtkCommand::WarningEvent, keepProblem);
  reader->GetExecutive()->AddObserver(vtkCommand::ErrorEvent, keepProblem);
  reader->SetParserErrorObserver(keepProblem);
  reader->SetFileName(fileName.c_str());
  reader->Update();
  if (!problem.empty() || reader->GetErrorCode() != vtkErrorCode::NoError)
  {
    throw bigus::FormatError(fileName + ": VTK cannot read it; it is damaged or truncated: " +
                             std::string(bigus::Trimmed(problem)));
  }
  return bigus::FieldFromPolyData(reader->GetOutput(), fileName);
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

int vtkBigusFieldReader::RequestData(vtkInformation*, vtkInformationVector**,
                                     vtkInformationVector* outputVector)
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
    bigus::FieldToPolyData(LooksLikePly(beginning) ? bigus::ReadPly(fileName) : ReadVtp(fileName), output);
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
