// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Voxel compounding: the volume that users make of a sweep today, as a baseline.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// Voxel compounding: trilinear paste of every lit training pixel into an axis-aligned grid, weighted mean, holes filled
/// along sticks, trilinear reslice. A stick is a line of voxels through a hole in one of the 13 directions to its
/// neighbours, from the nearest pasted voxel on one side to that on the other, at most 9 voxels or 1.13 times the widest
/// gap between neighbouring planes (a break is none) long, and never above 64. The hole gets what lies linearly between
/// the ends of the shortest. Where some of the eight voxels around a point are empty the others share their weight;
/// where all are, the answer is 0.
class Compounding
{
public:
  /// voxelSize in mm; 0 chooses one (ChooseVoxelSize). Throws Error when a given size makes the grid exceed
  /// maximumVoxels (2 bytes each).
  Compounding(const Sweep& sweep, const std::vector<int>& training, double voxelSize = 0,
              std::size_t maximumVoxels = std::size_t(1) << 29);

  void Predict(const SlicePlane& plane, float* image) const;

  double VoxelSize() const { return voxelSize_; }                                ///< mm
  std::size_t MemoryUse() const { return voxels_.size() * sizeof(voxels_[0]); }  ///< bytes of the grid

  /// The smallest voxel size, mm, to a thousandth, whose grid takes at most so many bytes. Throws Error when they hold
  /// not even the 8 voxels of the coarsest grid.
  static double VoxelSizeForMemory(const Sweep& sweep, const std::vector<int>& training, std::size_t bytes);

  /// 4, 2 sqrt 2, 2, sqrt 2 or once the pixel size, mm, in this order as long as the next predicts training frames better:
  /// a sixteenth of five of them, evenly spread, each from the four before and after it. At least so large that the grid of all frames has
  /// at most maximumVoxels, and 6 for each that the frames sweep (a gap of more than 16 pixels counts as 16): a pose that
  /// strays makes the box around all, not the work. With fewer than three frames the smallest.
  static double ChooseVoxelSize(const Sweep& sweep, const std::vector<int>& training, std::size_t maximumVoxels);

private:
  /// 0: empty; else 1 + 65534 times the intensity.
  using Voxel = std::uint16_t;

  std::size_t Index(int x, int y, int z) const { return (static_cast<std::size_t>(z) * size_[1] + y) * size_[0] + x; }
  void Paste(const Sweep& sweep, const std::vector<int>& training);
  void FillHoles(int longest);
  double Value(const Eigen::Vector3d& point) const;

  Eigen::Vector3d origin_;  // centre of voxel (0, 0, 0), mm
  Eigen::Vector3i size_;
  double voxelSize_;
  std::vector<Voxel> voxels_;
};

}  // namespace bigus
