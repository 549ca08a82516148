// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/FieldFile.h"

#include "Core/Engine/Exchange.h"
#include "IO/AtomicFile.h"
#include "IO/FileError.h"
#include "IO/Formats/Ply.h"
#include "IO/Formats/Pvtp.h"
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

bool EndsIn(const std::string& fileName, const std::string& ending)
{
  return fileName.size() > ending.size() && Lowercase(fileName.substr(fileName.size() - ending.size())) == ending;
}

}  // namespace

bool IsPolyData(const std::string& fileName)
{
  const std::string beginning = FileBeginning(fileName, 4096);
  return LooksLikePly(beginning) || LooksLikeVtp(beginning);
}

bool IsField(const std::string& fileName)
{
  const std::string beginning = FileBeginning(fileName, 4096);
  return LooksLikePly(beginning) ? HasBefore(fileName, " rot_0", "end_header")
                                 : LooksLikeVtp(beginning) && HasBefore(fileName, "\"Reflectivity\"", "<AppendedData");
}

std::optional<StoredField> ReadField(const std::string& fileName, const FieldPiece& piece,
                                     const std::function<StoredField(const std::string&)>& foreign)
{
  RequireChunks(piece.chunks, piece.piece, piece.pieces);
  PutEarlierPvtpBack(fileName);
  Require(FileFault::Truncated, InputFile(fileName).Size() != 0, fileName, ": the file is empty");
  const std::string beginning = FileBeginning(fileName, 4096);
  Require(FileFault::Unrecognized, LooksLikePly(beginning) || LooksLikeVtp(beginning), fileName,
          ": neither a VTK XML PolyData file (.vtp, .pvtp) nor a PLY file (.ply)");
  try
  {
    if (LooksLikePvtp(beginning))
    {
      return ReadPvtp(fileName, piece, foreign);
    }
    FieldChunks chunks = ChunksOfPiece(piece.chunks, piece.piece, piece.pieces);
    FieldChunks* const wanted = piece.pieces > 1 ? &chunks : nullptr;
    const bool isPly = LooksLikePly(beginning);
    std::optional<StoredField> stored = isPly ? ReadPly(fileName) : ReadVtp(fileName, wanted);
    if (stored)
    {
      stored->field.Validate();
      if (stored->view)
      {
        stored->view->Validate(stored->field.Size());
      }
      if (stored->labels)
      {
        stored->labels->Validate(stored->field.Size());
      }
      if (isPly && wanted)
      {
        stored->field = PartOf(stored->field, chunks);
        if (stored->view)
        {
          stored->view = PartOf(*stored->view, chunks);
        }
      }
      if (wanted)
      {
        stored->chunks = chunks;
      }
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

int ChunksOfFile(const std::string& fileName, int chunks)
{
  if (!LooksLikePvtp(FileBeginning(fileName, 4096)))
  {
    return chunks;
  }
  const auto pieces = static_cast<int>(PieceFilesOf(fileName).size());
  return (pieces & (pieces - 1)) == 0 ? pieces : 0;
}

void RequireFieldName(const std::string& fileName)
{
  Require(FileFault::Unrecognized, EndsIn(fileName, ".vtp") || EndsIn(fileName, ".pvtp") || EndsIn(fileName, ".ply"),
          fileName, ": fields are written as .vtp, .pvtp or .ply; name the file so");
}

void WriteField(const StoredField& stored, const std::string& fileName, int pieces)
{
  RequireFieldName(fileName);
  if (stored.labels)
  {
    stored.labels->Validate(stored.field.Size());
  }
  if (EndsIn(fileName, ".pvtp"))
  {
    RequireChunks(pieces, 0, 1);
    WritePvtp(stored, fileName, pieces);
    return;
  }
  AtomicFile file(fileName);
  EndsIn(fileName, ".ply") ? WritePly(stored, file) : WriteVtp(stored, file, SinglesOf(stored));
  file.Commit();
}

void WriteFieldTogether(const StoredField& part, const std::string& fileName, Exchange& processes)
{
  Require(FileFault::Unrecognized, EndsIn(fileName, ".pvtp"), fileName,
          ": several processes write a field in pieces, as .pvtp; name the file so");
  RequireChunks(processes.Size(), processes.Rank(), processes.Size());
  WritePvtpTogether(part, fileName, processes);
}

bool KeepsLabels(const std::string& fileName)
{
  return EndsIn(fileName, ".vtp");
}

std::vector<std::string> FilesOfField(const std::string& fileName, int pieces)
{
  std::vector<std::string> files = {fileName};
  for (int piece = 0; EndsIn(fileName, ".pvtp") && piece < pieces; ++piece)
  {
    files.push_back(PieceFileOf(fileName, piece));
  }
  return files;
}

}  // namespace bigus
