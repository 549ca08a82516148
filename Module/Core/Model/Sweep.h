// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Tracked frames of equal size, each with a pose in one world frame: one sweep, or several of one patient.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <memory>
#include <optional>
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
  std::shared_ptr<const void> pixels;             ///< [frames][height][width], may alias memory owned elsewhere
  std::vector<Eigen::Matrix4d> imageToReference;  ///< [frames] pixel (i, j, 0, 1) to mm
  std::vector<double> timestamps;                 ///< [frames] seconds, or empty
  /// [frames] number of the sequence that the frame was recorded in, never falling; empty: all in one. Neighbours, and
  /// whatever rests on the order of frames, are of one sequence only.
  std::vector<int> sequences;
  int averaged = 1;  ///< side of the blocks of recorded pixels that one of these is the mean of (Reduced)
  std::shared_ptr<const std::vector<std::uint8_t>> mask;  ///< [height][width], 0 = never lit or clipped; null = all lit

  int NumberOfFrames() const { return static_cast<int>(imageToReference.size()); }
  std::size_t PixelsPerFrame() const { return static_cast<std::size_t>(width) * height; }
  SlicePlane Plane(int frame) const { return SlicePlane::FromImageToReference(imageToReference[frame], width, height); }
  int SequenceOf(int frame) const { return sequences.empty() ? 0 : sequences[frame]; }
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

  /// The same of the frames named, in that order, as Subset gives them. Throws Error for a frame that is not there.
  Sweep ReducedOf(const std::vector<int>& frames, int n) const;

  /// Of each of the frames named n * n frames of every n-th pixel of every n-th row, which together have its pixels:
  /// first those that begin at pixels (0, 0), (1, 0) and so on of the next frame. Unlike reduced frames they are samples
  /// of the frame. Where n does not divide a side, what is left over at its end is in the second, fourth, ... frame, and
  /// what lies at its beginning is not. A pixel counts as lit when any is that it stands for. Pixels are copied in their
  /// type. Throws Error for a frame that is not there and for n that does not fit.
  Sweep Interleaved(const std::vector<int>& frames, int n) const;

  /// The frames named, in that order. Pixels are copied. Throws Error for a frame that is not there.
  Sweep Subset(const std::vector<int>& frames) const;

  /// `count` frames from `first` on, pixels shared. Throws Error for a frame that is not there.
  Sweep Range(int first, int count) const;

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
/// The same among `frames`, by their places within their own sequence: every sequence is split as if it were alone.
std::pair<std::vector<int>, std::vector<int>> SplitHoldOut(const Sweep& sweep, const std::vector<int>& frames, int k);

/// The intensity of all pixels of frames that show nothing, where masked pixels do not count; of others null.
std::optional<float> LevelOf(const Sweep& sweep, const std::vector<int>& frames);

/// All frames, 0 to NumberOfFrames() - 1.
std::vector<int> AllFrames(const Sweep& sweep);

/// `frames`, which are in the order of the sweep, one list for each sequence that has any.
std::vector<std::vector<int>> BySequence(const Sweep& sweep, const std::vector<int>& frames);

/// Of `frames` those of the sequence that has most of them; of equals the first.
std::vector<int> LongestSequence(const Sweep& sweep, const std::vector<int>& frames);

/// Throws Error, which names both, where frames of two sequences that shall be joined differ in size.
void RequireOneSize(int width, int height, const std::string& name, int otherWidth, int otherHeight,
                    const std::string& otherName);

/// Several sequences of one world frame as one sweep, in the order given. One alone is given back, pixels shared; else
/// pixels are copied, as bytes where all are bytes. A pixel is lit where any sequence says so, and those that a
/// sequence's own mask leaves out are black in its frames. Timestamps are kept where all sequences have them. Throws
/// Error where there is none, or sizes of frames differ.
std::shared_ptr<const Sweep> Join(const std::vector<std::shared_ptr<const Sweep>>& sequences);

}  // namespace bigus
