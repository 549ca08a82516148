// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields in several files: VTK's index of pieces, each a .vtp in the index's folder.
// https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "IO/FieldFile.h"

namespace bigus
{

class Exchange;

/// Whether a file that begins with these bytes is such an index.
bool LooksLikePvtp(const std::string& beginning);

/// The files that an index names, at most FieldChunks::kMost, all of them there and in its folder. Throws FileError.
std::vector<std::string> PieceFilesOf(const std::string& fileName);

/// The field of all files, or of those of one piece, one after the other. `foreign` reads those of another encoding than
/// ours; without it there is nothing where any is. Throws FileError.
std::optional<StoredField> ReadPvtp(const std::string& fileName, const FieldPiece& piece,
                                    const std::function<StoredField(const std::string&)>& foreign);

/// The name of a piece's file: that of the index with "_3" in place of its ending and then ".vtp".
std::string PieceFileOf(const std::string& fileName, int piece);

/// Where a program was killed while it put the files of a field in their places, gives the earlier ones their names back.
/// Without effect where there is an index.
void PutEarlierPvtpBack(const std::string& fileName);

/// Writes a valid field as `pieces` files, each a chunk, and their index; what was under these names stays until all are
/// complete. While they are put there, there is no index, so none ever names pieces of two fields. Of several
/// writers each waits for the one before. Throws FileError.
void WritePvtp(const StoredField& stored, const std::string& fileName, int pieces);

/// The same for a field of which every process has a part, which becomes a piece. All call it, inside Together. Throws
/// FileError and Error.
void WritePvtpTogether(const StoredField& part, const std::string& fileName, Exchange& processes);

}  // namespace bigus
