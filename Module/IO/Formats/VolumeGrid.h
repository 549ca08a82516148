// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where the voxels of a volume lie, by its header alone.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <string>

namespace bigus
{

/// A grid of voxels: voxel (i, j, k) lies at origin + steps * (i, j, k), mm.
struct VolumeGrid
{
  std::array<int, 3> size = {1, 1, 1};
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Matrix3d steps = Eigen::Matrix3d::Identity();  ///< columns: from a voxel to the next along i, j, k
};

/// The grid of a NRRD (.nrrd, .nhdr) or MetaImage (.mha, .mhd) volume, of any type of voxels, which are not read.
/// `worldIsLps` says which patient coordinate system the result shall be in: LPS, else RAS. MetaImage volumes are in LPS by
/// convention, NRRD volumes name theirs. Throws FileError naming the file, the field and what was found.
VolumeGrid ReadVolumeGrid(const std::string& fileName, bool worldIsLps);

}  // namespace bigus
