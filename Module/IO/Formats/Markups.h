// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Planes, lines and regions of interest of a 3D Slicer markup file.
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

/// A region of interest.
struct MarkupBox
{
  Eigen::Vector3d centre;  ///< mm
  Eigen::Matrix3d axes;    ///< columns, unit vectors at right angles; may be left-handed
  Eigen::Vector3d size;    ///< mm along each of them
};

/// The planes of a .mrk.json file, as grids of pixels `spacing` mm apart; of a line a square that holds it: columns along
/// the line, rows as nearly down to the feet as a right angle allows, or to the back where the line runs along the body. `worldIsLps` says which patient
/// coordinate system the result shall be in: LPS, else RAS. Throws FileError.
std::vector<MarkupPlane> ReadMarkupPlanes(const std::string& fileName, double spacing, bool worldIsLps);

/// The one region of interest of a .mrk.json file. Throws FileError.
MarkupBox ReadMarkupBox(const std::string& fileName, bool worldIsLps);

}  // namespace bigus
