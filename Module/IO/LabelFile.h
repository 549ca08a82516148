// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Label pictures of frames in files, without VTK.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "Core/Labels/FieldLabels.h"

namespace bigus
{

/// One picture after another, in marked-far order as sweeps are (README.md, Orientation).
struct LabelPictures
{
  int width = 0, height = 0;
  std::vector<int> numbers;          ///< [pictures] in the file names, or counted from 0
  bool isNumbered = false;           ///< whether file names have numbers
  std::vector<std::uint8_t> pixels;  ///< [pictures][height][width]
  std::vector<Label> labels;         ///< those that the file names
  /// Column, row and number of the first pixel in pictures that may be larger, where the file says so; all else there is 0.
  std::optional<std::array<int, 3>> place;
};

/// Label pictures of a folder of PNG images, in natural order, or of a MetaImage or NRRD sequence or volume, a slice a picture:
/// a segmentation of 3D Slicer (.seg.nrrd) names its segments. Where it has layers, a pixel is the later segment's, and segments
/// are numbered from 1 in the file's order. Colours that are grey will do. Throws FileError for what is none, for a value above
/// 255, for more pictures than `mostPictures`, and for a place that is none or leaves fewer than there are.
LabelPictures ReadLabelPictures(const std::string& path, std::size_t mostPictures);

}  // namespace bigus
