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
/// With `chunks` it has only their Gaussians, one chunk after the other, and fills in their sizes. What has none of them
/// is not inflated, and memory holds no more than the XML, a block and the field that is returned.
std::optional<StoredField> ReadVtp(const std::string& fileName, FieldChunks* chunks = nullptr);

/// The arrays that are written in 32 bits.
struct VtpSingles
{
  bool means = false, scales = false, rotations = false, reflectivities = false, viewTerms = false;
};
/// Those whose values are all floats.
VtpSingles SinglesOf(const StoredField& stored);

/// Writes a valid field. Throws FileError.
void WriteVtp(const StoredField& stored, AtomicFile& file, const VtpSingles& singles);

}  // namespace bigus
