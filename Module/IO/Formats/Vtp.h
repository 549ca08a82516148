// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields in VTK's XML format for PolyData,
// https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html
#pragma once

#include <optional>
#include <string>

#include "IO/AtomicFile.h"
#include "IO/FieldFile.h"

namespace bigus
{

/// The field that the file holds, not yet checked by GaussianField::Validate. Nothing where the file has another encoding
/// than the one that WriteVtp writes (raw appended data, zlib, sizes in 64 bits, floats and doubles in this machine's
/// order). Withstands any damage. Throws FileError for a damaged file, and Error for arrays that are no field.
std::optional<StoredField> ReadVtp(const std::string& fileName);

/// Writes a valid field. An array whose values are all floats is written in 32 bits. Throws FileError.
void WriteVtp(const StoredField& stored, AtomicFile& file);

}  // namespace bigus
