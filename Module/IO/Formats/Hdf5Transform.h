// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Transforms that ITK and 3D Slicer write as HDF5 (.h5).
#pragma once

#include <string>
#include <vector>

namespace bigus
{

/// One transform of a file, as it stands there.
struct TransformEntry
{
  std::string type;  ///< such as AffineTransform_double_3_3
  std::vector<double> parameters, fixedParameters;
};

/// Whether a file that begins with these bytes is HDF5.
bool LooksLikeHdf5(const std::string& beginning);

/// The groups TransformGroup/0, 1, ... of a file. Reads what ITK 5 writes (superblock 2 or 3, links kept in the group's
/// header, contiguous data without filters), not HDF5 at large. Throws FileError that says to save the transform as .tfm.
std::vector<TransformEntry> ReadHdf5Transforms(const std::string& fileName);

}  // namespace bigus
