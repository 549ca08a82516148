// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/FieldFile.h"

#include <algorithm>

#include "IO/AtomicFile.h"
#include "IO/FileError.h"
#include "IO/Formats/Ply.h"
#include "IO/Formats/Vtp.h"
#include "IO/Text.h"

namespace bigus
{
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

/// The last four characters, such as ".vtp", in lower case.
std::string Ending(const std::string& fileName)
{
  return Lowercase(fileName.substr(fileName.size() - std::min<std::size_t>(4, fileName.size())));
}

}  // namespace

bool LooksLikeField(const std::string& beginning)
{
  return LooksLikePly(beginning) || LooksLikeVtp(beginning);
}

std::optional<StoredField> ReadField(const std::string& fileName)
{
  if (InputFile(fileName).Size() == 0)
  {
    throw TruncationError(fileName + ": the file is empty");
  }
  const std::string beginning = FileBeginning(fileName, 4096);
  if (!LooksLikeField(beginning))
  {
    throw FileError(FileFault::Unrecognized,
                    fileName + ": neither a VTK XML PolyData file (.vtp) nor a PLY file (.ply)");
  }
  try
  {
    std::optional<StoredField> stored = LooksLikePly(beginning) ? ReadPly(fileName) : ReadVtp(fileName);
    if (stored)
    {
      stored->field.Validate();
    }
    return stored;
  }
  catch (const FileError&)
  {
    throw;
  }
  catch (const Error& error)  // what is wrong with the field
  {
    throw FormatError(fileName + ": " + error.what());
  }
}

void RequireFieldName(const std::string& fileName)
{
  const std::string ending = Ending(fileName);
  if (ending != ".vtp" && ending != ".ply")
  {
    throw FileError(FileFault::Unrecognized, fileName + ": fields are written as .vtp or .ply; name the file so");
  }
}

void WriteField(const StoredField& stored, const std::string& fileName)
{
  RequireFieldName(fileName);
  AtomicFile file(fileName);
  Ending(fileName) == ".ply" ? WritePly(stored, file) : WriteVtp(stored, file);
  file.Commit();
}

}  // namespace bigus
