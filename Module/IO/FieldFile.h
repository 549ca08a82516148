// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields in files, without VTK.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "Core/Labels/FieldLabels.h"
#include "Core/Model/FieldChunks.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/ViewDependence.h"

namespace bigus
{

class Exchange;

/// A field, and what its file says of where it comes from.
struct StoredField
{
  GaussianField field;
  std::vector<std::string> provenance;  ///< key=value
  std::optional<FieldChunks> chunks;    ///< that it has, where it is a part of a field
  /// What its standard error rests on (Core/StandardError), as bytes; only .vtp files have it.
  std::string standardError = {};
  /// What it knows of directions; of a whole file. Parts have none.
  std::optional<ViewDependence> view = std::nullopt;
  std::optional<FieldLabels> labels = std::nullopt;  ///< of a whole .vtp alone
};

/// One of several parts of a field. A .pvtp is dealt file by file, each a chunk; other files are split into `chunks`.
struct FieldPiece
{
  int piece = 0, pieces = 1;
  int chunks = FieldChunks::kUsual;
};

/// Whether a file begins as those that ReadField reads: VTK XML PolyData or PLY, be it a field or not.
bool IsPolyData(const std::string& fileName);

/// Whether a file says that it holds a field: a .vtp or .pvtp with an array Reflectivity, or a .ply with rotations. Other
/// files of points are left to other readers.
bool IsField(const std::string& fileName);

/// A valid field of a .vtp, .pvtp or .ply file, or a part of it. Nothing where a .vtp has another encoding than the one
/// that we write; of the pieces of a .pvtp `foreign` reads such ones. Throws FileError.
std::optional<StoredField> ReadField(const std::string& fileName, const FieldPiece& piece = {},
                                     const std::function<StoredField(const std::string&)>& foreign = {});

/// How many chunks the pieces of a file are dealt in: those of a .pvtp where they are a power of two, else 0; `chunks` of
/// any other file. Throws FileError.
int ChunksOfFile(const std::string& fileName, int chunks);

/// Throws FileError, Unrecognized, unless the name ends in .vtp, .pvtp or .ply.
void RequireFieldName(const std::string& fileName);

/// Writes a valid field, as .vtp, .ply or .pvtp of so many pieces by the name. Throws FileError; then nothing is written.
void WriteField(const StoredField& stored, const std::string& fileName, int pieces = FieldChunks::kUsual);

/// Writes a valid field of which every process has a part, as a .pvtp with a piece of each. All call it with the same name,
/// inside Exchange::Together, so what fails in one fails in all; then files of before are as they were. Throws FileError,
/// and Error for parts that are not of one field.
void WriteFieldTogether(const StoredField& part, const std::string& fileName, Exchange& processes);

/// Whether a file of this name keeps a field's labels.
bool KeepsLabels(const std::string& fileName);

/// All files that WriteField writes under this name.
std::vector<std::string> FilesOfField(const std::string& fileName, int pieces);

}  // namespace bigus
