// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Voxel compounding: the volume that users make of a sweep today, as a baseline.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// Voxel compounding: trilinear paste of every training pixel into an axis-aligned grid, weighted mean, hole filling,
/// trilinear reslice. Holes are filled layer by layer, each voxel with the mean of its filled neighbours (of 26), as
/// far as half the widest gap between neighbouring planes, 3 to 64 voxels. What is left empty is 0.
class Compounding
{
public:
  /// voxelSize in mm; 0 chooses the geometric mean of the pixel size and the median plane spacing, but not less than
  /// the pixel size, and not so small that the grid would exceed maximumVoxels (4 bytes each). Throws Error when a
  /// given size makes it exceed them.
  Compounding(const Sweep& sweep, const std::vector<int>& training, double voxelSize = 0,
              std::size_t maximumVoxels = std::size_t(1) << 28);

  void Predict(const SlicePlane& plane, float* image) const;

  double VoxelSize() const { return voxelSize_; }                           ///< mm
  std::size_t MemoryUse() const { return voxels_.size() * sizeof(float); }  ///< bytes of the grid

  /// The smallest voxel size, mm, to a thousandth, whose grid takes at most so many bytes. Throws Error when they hold
  /// not even the 8 voxels of the coarsest grid.
  static double VoxelSizeForMemory(const Sweep& sweep, const std::vector<int>& training, std::size_t bytes);

private:
  std::size_t Index(int x, int y, int z) const { return (static_cast<std::size_t>(z) * size_[1] + y) * size_[0] + x; }
  std::vector<unsigned char> Paste(const Sweep& sweep, const std::vector<int>& training);
  void FillHoles(std::vector<unsigned char> filled, int passes);
  bool FillVoxel(const std::vector<unsigned char>& filled, int x, int y, int z);

  Eigen::Vector3d origin_;  // centre of voxel (0, 0, 0), mm
  Eigen::Vector3i size_;
  double voxelSize_;
  std::vector<float> voxels_;
};

}  // namespace bigus
