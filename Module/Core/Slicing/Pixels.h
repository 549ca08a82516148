// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What becomes of rendered pixels: background where nothing was seen, grey levels, runs of seen pixels.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <string>

#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Slicing/Bands.h"

namespace bigus
{

/// Throws Error unless pixels of this type can hold what is wanted. `type`: its name in VTK, such as "unsigned char".
void CheckPixelType(const std::string& type, ViewOutput output);

/// Where a slice shows something.
struct Seen
{
  double threshold = 0;  ///< pixels with at most so much coverage are background
  double level = 0;      ///< of the background, in the output's units: 0 to 255 where pixels are bytes

  /// Throws Error unless the threshold is 0 or more.
  void Validate() const;

  /// False where a rendered image has its background already.
  bool FillsBackground() const { return level != 0 || threshold > 0; }

  /// Puts the background's level where a band shows nothing.
  void FillBackground(const PixelBand& band, bool isBytes) const;

  /// Calls `run(first, last, y, z)`, indices of the grid, for every run of seen pixels in a band's rows, in order.
  void ForEachRun(const PixelBand& band, const Extent& extent,
                  const std::function<void(int, int, int, int)>& run) const;
};

/// Where a field's Gaussians lie and how large they are. Of the parts of a field, numbers add up and boxes unite.
struct FieldSpread
{
  Eigen::AlignedBox3d centres;  ///< mm; empty without Gaussians
  double volume = 0;            ///< sum of the products of their scales, mm^3
  double count = 0;
  Eigen::Vector3d scales = Eigen::Vector3d::Zero();  ///< sum, mm

  /// The box of the centres, padded by the mean scale.
  Eigen::AlignedBox3d Box() const;

  /// Coverage of thin slices averaged over the box: (2 pi)^(3/2) volume / |box|. What a sweep saw has about that much, so a
  /// pixel with less than a tenth of it counts as unseen wherever slices are shown. 0 without Gaussians.
  double MeanCoverage() const;
};
FieldSpread SpreadOf(const GaussianField& field);

/// round(255 v), clamped.
void ToBytes(const float* values, std::int64_t count, unsigned char* bytes);

/// The distance from every pixel of a grid to the nearest of the sweep's frames, mm: `distances` gets
/// [depth][height][width] floats.
void GridDistances(const Sweep& sweep, const Eigen::Matrix4d& indexToWorld, const Extent& extent, float* distances);

}  // namespace bigus
