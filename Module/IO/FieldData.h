// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A Gaussian field as files hold it.
#pragma once

#include <string>
#include <vector>

#include "AtomicFile.h"
#include "Core/Model/GaussianField.h"

class vtkPolyData;

namespace bigus
{

struct StoredField
{
  GaussianField field;
  std::vector<std::string> provenance;  ///< key=value
};

/// From and to points with the arrays that README.md lists. `what` begins every message. Throw FileError
/// naming the array, the index and the value; the result is valid in the sense of GaussianField::Validate.
StoredField FieldFromPolyData(vtkPolyData* polyData, const std::string& what);
void FieldToPolyData(const StoredField& stored, vtkPolyData* polyData);

/// VTK XML PolyData, in any encoding but with the zlib compressor or none. Throws FileError.
StoredField ReadVtp(const std::string& fileName);

/// 3-D Gaussian splat PLY, https://github.com/graphdeco-inria/gaussian-splatting, with the additions that
/// README.md lists. Throw FileError.
StoredField ReadPly(const std::string& fileName);
void WritePly(const StoredField& stored, AtomicFile& file);

}  // namespace bigus
