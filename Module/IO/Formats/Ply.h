// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields as 3-D Gaussian splats, https://github.com/graphdeco-inria/gaussian-splatting, with the additions
// that README.md lists.
#pragma once

#include <string>
#include <vector>

#include "Core/Model/GaussianField.h"
#include "IO/AtomicFile.h"

namespace bigus
{

struct PlyField
{
  GaussianField field;
  std::vector<std::string> provenance;  ///< key=value
};

/// What the file holds, not yet checked by GaussianField::Validate. Throws FileError.
PlyField ReadPly(const std::string& fileName);

/// Writes a valid field. Throws FileError.
void WritePly(const PlyField& ply, AtomicFile& file);

}  // namespace bigus
