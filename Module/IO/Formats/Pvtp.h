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

/// Writes a valid field as `pieces` files, each a chunk, and their index; what was under these names stays until all are
/// complete. Throws FileError.
void WritePvtp(const StoredField& stored, const std::string& fileName, int pieces);

/// Writes a valid field as the file of one piece, and with piece 0 the index of all. Throws FileError.
void WritePvtpPiece(const StoredField& stored, const std::string& fileName, int piece, int pieces);

}  // namespace bigus
