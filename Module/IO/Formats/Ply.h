// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields as 3-D Gaussian splats, https://github.com/graphdeco-inria/gaussian-splatting, with the additions
// that README.md lists.
#pragma once

#include <string>

#include "IO/AtomicFile.h"
#include "IO/FieldFile.h"

namespace bigus
{

/// What the file holds, not yet checked by GaussianField::Validate. Throws FileError.
StoredField ReadPly(const std::string& fileName);

/// Writes a valid field. Throws FileError.
void WritePly(const StoredField& ply, AtomicFile& file);

}  // namespace bigus
