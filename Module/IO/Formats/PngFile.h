// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// PNG images as grey ones, read by libspng because VTK 9.1's reader crashes on a truncated one.
#pragma once

#include <string>
#include <vector>

#include "IO/SequenceFile.h"

namespace bigus
{

struct PngHeader
{
  int width = 0;
  int height = 0;
  ElementType elementType = ElementType::UInt8;
  int channels = 1;  ///< in the file; colours, indexed ones too, and grey with alpha are read as 8-bit grey
};

/// The PNG images in a folder, in natural order. Throws FileError where it cannot be read.
std::vector<std::string> PngFilesOf(const std::string& folder);

/// Throws FileError unless the file begins as a PNG of 8 or 16 bits a channel, not interlaced, that can hold the pixels it
/// claims.
PngHeader ReadPngHeader(const std::string& fileName);

/// Throws FileError unless the header says that the image is as `expected`.
void RequirePng(const std::string& fileName, const PngHeader& expected);

/// Reads the pixels, top row first, in this machine's byte order. Throws FileError when the image is damaged
/// or is not as `expected`, for which `pixels` has room.
void ReadPng(const std::string& fileName, const PngHeader& expected, void* pixels);

}  // namespace bigus
