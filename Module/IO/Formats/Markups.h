// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The planes of a 3D Slicer markup file.
#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

namespace bigus
{

struct MarkupPlane
{
  Eigen::Matrix4d imageToReference;
  int width;
  int height;
};

/// The planes of a .mrk.json file, as grids of pixels `spacing` mm apart. `worldIsLps` says which patient
/// coordinate system the result shall be in: LPS, else RAS. Throws FileError.
std::vector<MarkupPlane> ReadMarkupPlanes(const std::string& fileName, double spacing, bool worldIsLps);

}  // namespace bigus
