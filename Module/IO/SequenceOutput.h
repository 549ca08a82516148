// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Tracked sequences written as .igs.mha, without VTK.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "IO/SequenceFile.h"

namespace bigus
{

/// What is written; nothing is copied.
struct SequenceToWrite
{
  int width = 0;
  int height = 0;
  ElementType elementType = ElementType::UInt8;
  const void* pixels = nullptr;          ///< [frames][height][width]
  std::vector<double> imageToReference;  ///< [frames][16], row-major
  std::vector<double> timestamps;        ///< [frames] seconds; empty: none
  std::vector<std::uint8_t> isUsable;    ///< [frames]; empty: all are
  std::string fromFrame = "Image";       ///< coordinate frames that the poses lead from and to
  std::string toFrame = "Reference";
  bool compression = true;  ///< of the pixels, with zlib
};

/// Throws FileError where the name does not end in .mha, or those of coordinate frames cannot be written.
void RequireSequenceNames(const std::string& fileName, const std::string& fromFrame, const std::string& toFrame);

/// Numbers have enough digits to come back with the same bits. `goOn` gets the share done and returns whether to go on.
/// False: it did not, and nothing was written. Throws FileError; then nothing is written.
bool WriteSequence(const SequenceToWrite& sequence, const std::string& fileName,
                   const std::function<bool(double)>& goOn);

}  // namespace bigus
