// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Grey PNG images, read by libspng because VTK 9.1's reader crashes on a truncated one.
#pragma once

#include <string>

#include "IO/SequenceFile.h"

namespace bigus
{

struct PngHeader
{
  int width = 0;
  int height = 0;
  ElementType elementType = ElementType::UInt8;
};

/// Throws FileError unless the file begins as a grey 8- or 16-bit PNG, not interlaced, that can hold the
/// pixels it claims.
PngHeader ReadPngHeader(const std::string& fileName);

/// Reads the pixels, top row first, in this machine's byte order. Throws FileError when the image is damaged
/// or is not as `expected`, for which `pixels` has room.
void ReadPng(const std::string& fileName, const PngHeader& expected, void* pixels);

}  // namespace bigus
