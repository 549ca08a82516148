// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields in files, without VTK.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "Core/Model/GaussianField.h"

namespace bigus
{

/// A field, and what its file says of where it comes from.
struct StoredField
{
  GaussianField field;
  std::vector<std::string> provenance;  ///< key=value
};

/// Whether a file that begins with these bytes is worth handing to ReadField.
bool LooksLikeField(const std::string& beginning);

/// A valid field of a .vtp or .ply file. Nothing where a .vtp has another encoding than the one that we write. Throws
/// FileError.
std::optional<StoredField> ReadField(const std::string& fileName);

/// Throws FileError, Unrecognized, unless the name ends in .vtp or .ply.
void RequireFieldName(const std::string& fileName);

/// Writes a valid field, as .vtp or .ply by the name. Throws FileError; then nothing is written.
void WriteField(const StoredField& stored, const std::string& fileName);

}  // namespace bigus
