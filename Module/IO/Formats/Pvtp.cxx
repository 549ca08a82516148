// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/Pvtp.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "Core/Engine/Exchange.h"
#include "Core/Engine/FieldState.h"
#include "Core/Numerics/Checksum.h"
#include "IO/AtomicFile.h"
#include "IO/Bytes.h"
#include "IO/FileError.h"
#include "IO/Formats/Vtp.h"
#include "IO/Formats/Xml.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::uint64_t kLargestIndex = 4 << 20;

/// What all pieces of a field have in common.
bool IsOneField(const StoredField& one, const StoredField& other)
{
  const GaussianField &a = one.field, &b = other.field;
  return a.transfer.gamma == b.transfer.gamma && a.beam.elevationSigma == b.beam.elevationSigma &&
         a.beam.probeElevationSigma == b.beam.probeElevationSigma && a.beam.trainedNormals == b.beam.trainedNormals &&
         one.view.has_value() == other.view.has_value() && (!one.view || one.view->views == other.view->views);
}

/// What the field knows of directions, without that of any Gaussian.
std::optional<ViewDependence> ViewsOf(const StoredField& part)
{
  return part.view ? std::optional(ViewDependence{part.view->views, {}}) : std::nullopt;
}

std::string Declared(const char* name, int components, bool isSingle)
{
  return std::string("<PDataArray type=\"") + (isSingle ? "Float32" : "Float64") + "\" Name=\"" + name +
         "\" NumberOfComponents=\"" + std::to_string(components) + "\"/>\n";
}

/// The index, without what the names of its pieces may hold that XML does not.
std::string IndexText(const std::string& fileName, int pieces, const VtpSingles& singles, bool hasViews)
{
  std::string text = std::string("<?xml version=\"1.0\"?>\n<VTKFile type=\"PPolyData\" version=\"1.0\" byte_order=\"") +
                     (kThisMachineIsBigEndian ? "BigEndian" : "LittleEndian") +
                     "\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n<PPolyData GhostLevel=\"0\">\n";
  text += "<PPointData Scalars=\"Reflectivity\">\n" + Declared("Scale", 3, singles.scales) +
          Declared("Rotation", 4, singles.rotations) + Declared("Reflectivity", 1, singles.reflectivities) +
          (hasViews ? Declared("ViewTerm", 3, singles.viewTerms) : "") + "</PPointData>\n<PPoints>\n" +
          Declared("Points", 3, singles.means) + "</PPoints>\n";
  for (int piece = 0; piece < pieces; ++piece)
  {
    std::string name;
    for (const char c : std::filesystem::path(PieceFileOf(fileName, piece)).filename().string())
    {
      name += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '"' ? "&quot;" : std::string(1, c);
    }
    text += "<Piece Source=\"" + name + "\"/>\n";
  }
  return text + "</PPolyData>\n</VTKFile>\n";
}

void RequireNoFolders(const std::vector<std::string>& files)
{
  for (const std::string& file : files)
  {
    std::error_code ignored;
    Require(FileFault::CannotOpen, !std::filesystem::is_directory(file, ignored), file,
            ": is a folder, so no file can be written there");
  }
}

/// Throws unless all processes were told the same name.
void RequireOneName(const std::string& fileName, Exchange& processes)
{
  const std::vector<std::string> names = processes.Gather(fileName);
  for (std::size_t rank = 1; rank < names.size(); ++rank)
  {
    Require(FileFault::NoName, names[rank] == names[0], names[0], ": process ", rank,
            " was told to write its piece of ", names[rank], "; all need one file name");
  }
}

/// Throws unless the parts, of which some may be empty, can be pieces of one field.
void RequirePartsOfOneField(const StoredField& stored, Exchange& processes)
{
  const GaussianField& part = stored.field;
  StateWriter shared;
  shared.Number(part.transfer.gamma);
  SaveBeam(part.beam, shared);
  Checksum views, own;
  if (stored.view)
  {
    views.Add(stored.view->views.poses.data(), stored.view->views.poses.size() * sizeof(Eigen::Matrix4d));
  }
  shared.Number(stored.view.has_value());
  shared.Number(views.Value());
  const auto add = [&own](const auto& values) { own.Add(values.data(), values.size() * sizeof(values[0])); };
  add(part.means);
  add(part.scales);
  add(part.rotations);
  add(part.reflectivities);
  const bool isEmpty = part.Size() == 0;
  const std::vector<std::string> kinds = processes.Gather(isEmpty ? "" : shared.Take());
  const std::vector<std::string> sums = processes.Gather(isEmpty ? "" : std::to_string(own.Value()));
  std::map<std::string, std::size_t> known;  // checksums, and whose they are
  std::size_t first = kinds.size();
  for (std::size_t rank = 0; rank < kinds.size(); ++rank)
  {
    if (kinds[rank].empty())
    {
      continue;
    }
    first = std::min(first, rank);
    Require(
        kinds[rank] == kinds[first], "The processes ", first, " and ", rank,
        " have parts with another Gamma, elevation sigma, trained normals or recorded views, so they are not of one "
        "field.");
    if (const auto [other, isNew] = known.emplace(sums[rank], rank); !isNew)
    {
      throw Error("The processes " + std::to_string(other->second) + " and " + std::to_string(rank) +
                  " have the same Gaussians, which would count twice. Where every process has the whole field, "
                  "vtkBigusPartitionField leaves each its part, or one process writes the field alone.");
    }
  }
}

/// The arrays whose values are floats in all processes, because VTK wants them alike in all pieces.
VtpSingles SinglesOfAll(const StoredField& part, Exchange& processes)
{
  VtpSingles singles = SinglesOf(part);
  for (bool* const isSingle :
       {&singles.means, &singles.scales, &singles.rotations, &singles.reflectivities, &singles.viewTerms})
  {
    *isSingle = !processes.Any(!*isSingle);
  }
  return singles;
}

/// Throws FileError unless this process finds the files of all.
void RequireOneFolder(const std::vector<std::string>& files)
{
  for (std::size_t rank = 0; rank < files.size(); ++rank)
  {
    std::error_code ignored;
    Require(FileFault::CannotOpen, std::filesystem::exists(files[rank], ignored), files[rank], ": process ", rank,
            " has written its piece where process 0 does not find it; all need "
            "a folder that they share. Nothing was written");
  }
}

}  // namespace

bool LooksLikePvtp(const std::string& beginning)
{
  return beginning.find("<VTKFile") != std::string::npos && beginning.find("PPolyData") != std::string::npos;
}

std::vector<std::string> PieceFilesOf(const std::string& fileName)
{
  const std::string text = ReadTextFile(fileName, kLargestIndex);
  Require(FileFault::Truncated, text.find("</VTKFile>") != std::string::npos, fileName,
          ": does not end with </VTKFile>; the file is truncated");
  const pugi::xml_document document = ParseXml(text, fileName + ": not valid XML");
  const pugi::xml_node root = document.document_element(), index = root.child("PPolyData");
  RequireFormat(root.name() == std::string_view("VTKFile") &&
                    root.attribute("type").value() == std::string_view("PPolyData") && index,
                fileName, ": not a VTK XML index of PolyData pieces");
  if (const std::string ghosts = index.attribute("GhostLevel").value(); !ghosts.empty() && ghosts != "0")
  {
    throw FormatError(fileName + ": GhostLevel is " + Quoted(ghosts) +
                      "; pieces that hold others' Gaussians again would count them twice. Write it without ghosts");
  }
  std::vector<std::string> files;
  std::set<std::string> known;
  for (const pugi::xml_node& piece : index.children("Piece"))
  {
    const std::string source = piece.attribute("Source").value();
    RequireFormat(files.size() != FieldChunks::kMost, fileName, ": names more than ", FieldChunks::kMost, " pieces");
    files.push_back(CompanionFile(fileName, FolderOf(fileName), source));
    std::error_code ignored;
    RequireFormat(known.insert(std::filesystem::weakly_canonical(files.back(), ignored).string()).second, fileName,
                  ": names the piece ", Quoted(source), " twice, so its Gaussians would count twice");
  }
  RequireFormat(!files.empty(), fileName, ": names no piece");
  return files;
}

std::optional<StoredField> ReadPvtp(const std::string& fileName, const FieldPiece& piece,
                                    const std::function<StoredField(const std::string&)>& foreign)
{
  const std::vector<std::string> files = PieceFilesOf(fileName);
  const auto total = static_cast<int>(files.size());
  FieldChunks chunks = ChunksOfPiece(total, piece.piece, piece.pieces);
  StoredField all;
  std::string first;  // file that had Gaussians
  for (std::size_t k = 0; k < chunks.sizes.size(); ++k)
  {
    const std::string& file = files[static_cast<std::size_t>(chunks.first) + k];
    std::optional<StoredField> part = ReadVtp(file);
    if (!part && !foreign)
    {
      return std::nullopt;
    }
    part = part ? std::move(part) : foreign(file);
    try
    {
      part->field.Validate();
      if (part->view)
      {
        part->view->Validate(part->field.Size());
      }
    }
    catch (const Error& error)
    {
      throw FormatError(file + ": " + error.what());
    }
    chunks.sizes[k] = part->field.Size();
    if (k == 0)
    {
      all.provenance = part->provenance;
    }
    if (part->field.Size() == 0)
    {
      all.view = all.view ? all.view : ViewsOf(*part);  // should all be empty
      continue;                                         // of a foreign program it has no field data either
    }
    if (first.empty())
    {
      first = file;
      all.field.transfer = part->field.transfer;
      all.field.beam = part->field.beam;
      all.view = ViewsOf(*part);
    }
    else if (!IsOneField(all, *part))
    {
      throw FormatError(file + ": has another Gamma, elevation sigma, trained normals or recorded views than " + first +
                        ", so they are not of one field. Write all pieces anew");
    }
    if (part->view)
    {
      all.view->terms.insert(all.view->terms.end(), part->view->terms.begin(), part->view->terms.end());
    }
    all.field.Append(part->field);
  }
  // Pictures of chunks are added up along a binary tree over a power of two of them.
  if ((total & (total - 1)) == 0)
  {
    all.chunks = chunks;
  }
  return all;
}

std::string PieceFileOf(const std::string& fileName, int piece)
{
  return fileName.substr(0, fileName.size() - 5) + "_" + std::to_string(piece) + ".vtp";
}

void PutEarlierPvtpBack(const std::string& fileName)
{
  if (AtomicFile::IsAside(fileName))
  {
    const FileLock lock(fileName, FileLock::Mode::Wait);  // a writer may be about to put the index there
    AtomicFile::PutEarlierBack(FilesOfField(fileName, FieldChunks::kMost));
  }
}

void WritePvtp(const StoredField& stored, const std::string& fileName, int pieces)
{
  RequireNoFolders(FilesOfField(fileName, pieces));
  const FileLock lock(fileName, FileLock::Mode::Wait);
  AtomicFile::PutEarlierBack(FilesOfField(fileName, FieldChunks::kMost));
  const VtpSingles singles = SinglesOf(stored);  // VTK wants them alike in all pieces
  AtomicFile index(fileName);  // before the pieces, so that where one fails it is the last that comes back
  std::vector<std::unique_ptr<AtomicFile>> files;
  for (int piece = 0; piece < pieces; ++piece)
  {
    FieldChunks chunk{pieces, piece, {0}};
    files.push_back(std::make_unique<AtomicFile>(PieceFileOf(fileName, piece)));
    StoredField part = {PartOf(stored.field, chunk), stored.provenance, {}};
    if (stored.view)
    {
      part.view = PartOf(*stored.view, chunk);
    }
    WriteVtp(part, *files.back(), singles);
    files.back()->Finish();
  }
  index.Write(IndexText(fileName, pieces, singles, stored.view.has_value()));
  index.Finish();
  index.SetEarlierAside();
  for (const auto& file : files)
  {
    file->SetEarlierAside();
    file->Commit();
  }
  index.Commit();
  index.Keep();
  for (const auto& file : files)
  {
    file->Keep();
  }
}

void WritePvtpTogether(const StoredField& part, const std::string& fileName, Exchange& processes)
{
  RequireOneName(fileName, processes);
  RequirePartsOfOneField(part, processes);
  const VtpSingles singles = SinglesOfAll(part, processes);
  const bool isFirst = processes.Rank() == 0, hasViews = processes.Any(part.view.has_value());
  const std::string pieceName = PieceFileOf(fileName, processes.Rank());
  RequireNoFolders(isFirst ? std::vector<std::string>{pieceName, fileName} : std::vector<std::string>{pieceName});
  std::optional<FileLock> lock;
  std::optional<AtomicFile> index;
  if (isFirst)
  {
    lock.emplace(fileName, FileLock::Mode::Wait);
    AtomicFile::PutEarlierBack(FilesOfField(fileName, FieldChunks::kMost));
    index.emplace(fileName);
    index->Write(IndexText(fileName, processes.Size(), singles, hasViews));
    index->Finish();
  }
  AtomicFile file(pieceName);
  WriteVtp(part, file, singles);
  file.Finish();
  // Nothing is in its place yet, and of what failed anywhere until here all hear now.
  const std::vector<std::string> names = processes.Gather(file.TemporaryName());
  if (index)
  {
    RequireOneFolder(names);
    index->SetEarlierAside();
  }
  processes.Any(false);  // all have come so far
  file.SetEarlierAside();
  file.Commit();
  processes.Any(false);
  if (index)
  {
    index->Commit();
  }
  processes.Any(false);  // until here each undoes what it did when one fails
  file.Keep();
  if (index)
  {
    index->Keep();
  }
}

}  // namespace bigus
