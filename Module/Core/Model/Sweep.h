// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A tracked sweep: frames of equal size, each with a pose in one world frame.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Core/Model/SlicePlane.h"

namespace bigus
{

/// Frames are stored once, in the type they came in. Intensities are read as float in [0, 1]: 8-bit pixels divided by
/// 255, float pixels as they are.
struct Sweep
{
  enum class PixelType
  {
    UInt8,
    Float32
  };

  int width = 0;   ///< pixels in i
  int height = 0;  ///< pixels in j
  PixelType pixelType = PixelType::UInt8;
  std::shared_ptr<const void> pixels;                     ///< [frames][height][width], may alias memory owned elsewhere
  std::vector<Eigen::Matrix4d> imageToReference;          ///< [frames] pixel (i, j, 0, 1) to mm
  std::vector<double> timestamps;                         ///< [frames] seconds, or empty
  std::shared_ptr<const std::vector<std::uint8_t>> mask;  ///< [height][width], 0 = never lit or clipped; null = all lit

  int NumberOfFrames() const { return static_cast<int>(imageToReference.size()); }
  std::size_t PixelsPerFrame() const { return static_cast<std::size_t>(width) * height; }
  SlicePlane Plane(int frame) const { return SlicePlane::FromImageToReference(imageToReference[frame], width, height); }
  bool IsLit(std::size_t pixel) const { return !mask || (*mask)[pixel] != 0; }

  /// The frame's intensities in [0, 1]; `image` has PixelsPerFrame() elements.
  void CopyFrame(int frame, float* image) const;

  /// Begins to fetch frames that will be read soon, where they lie in a file (PixelMemory.h).
  void Prefetch(const std::vector<int>& frames) const;

  /// Box-averages n x n pixels (a partial block at the right or lower edge is dropped); poses follow, so that the new
  /// pixel (0, 0) lies at the centre of the first block. Pixels become float: no second rounding. n >= 1.
  /// A reduced pixel counts as lit when any of its pixels was. n = 1 gives the sweep as it is, pixels shared.
  /// Throws Error when the block does not fit the frame.
  Sweep Reduced(int n) const;

  /// The frames named, in that order. Pixels are copied. Throws Error for a frame that is not there.
  Sweep Subset(const std::vector<int>& frames) const;

  /// The same sweep, pixels shared, whose mask leaves out also what none of `frames` lights: the corners outside a
  /// fan. Lit are what some frame shows brighter than 0 and, within the convex hull of that, all below it: shadows
  /// and dark tissue. Throws Error for a frame that is not there.
  Sweep LitBy(const std::vector<int>& frames) const;

  /// Sets what is not lit to 0 in `image`, of PixelsPerFrame() elements: all that a probe shows there.
  void BlackenUnlit(float* image) const;

  /// Throws Error unless there is at least one frame and every size, pose and float pixel is sound (float pixels must
  /// lie in [0, 1]; poses must be affine and pass SlicePlane::Validate).
  void Validate() const;

  /// The same without a look at the pixels' values, which takes no time.
  void ValidateLayout() const;
};

/// Frames that a hold-out of K keeps from training: index % K == K / 2 (integer division). K = 0 holds out none;
/// K = 1 is refused with Error. `first` gets the frames to train on, `second` the held-out ones.
std::pair<std::vector<int>, std::vector<int>> SplitHoldOut(int numberOfFrames, int k);

}  // namespace bigus
