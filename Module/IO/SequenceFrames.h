// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The frames of a tracked sequence, without VTK: in marked-far order, clipped, and scaled to what their type holds.
#pragma once

#include <functional>
#include <vector>

#include "IO/Poses.h"
#include "IO/SequenceFile.h"

namespace bigus
{

/// What blackens pixels. Angles are in degrees from +j towards +i, lengths in pixels.
struct Clip
{
  enum class Shape
  {
    None,
    Rectangle,
    Fan
  };
  Shape shape = Shape::None;
  int rectangle[4] = {0, 0, 0, 0};  ///< first column and row, width, height
  double apex[2] = {0, 0};
  double radii[2] = {0, 0};
  double angles[2] = {0, 0};
};

/// [height][width] 1 where the clip leaves pixels as they are; empty without one. Throws FileError where it is no shape, or
/// leaves no pixel.
std::vector<unsigned char> ClipMask(const SequenceFile& file, const Clip& clip);

/// What is known of frames when they have been read.
struct ReadPixels
{
  std::vector<unsigned char> lit;  ///< [height][width] 1 where a frame that is accepted has a pixel above 0
  double usedRange = 0;            ///< the pixel that became white; 0: white is what the type says
  int usedBits = 0;                ///< of 16, where fewer were found in use; else 0
};

/// The sentence that tells that fewer than 16 bits were found in use.
std::string UsedBitsWarning(const SequenceFile& file, const ReadPixels& read);

/// Reads the frames whose indices are given, in rising order, into `pixels`, which has room for them, and passes over the
/// others. `clip` is ClipMask's. `range`: the pixel to become white; 0: chosen where data of 8 to 14 bits are kept in 16.
/// `goOn` gets the share done and returns whether to go on; false: the frames are not all read. Throws FileError.
bool ReadFrames(const SequenceFile& file, const PoseTable& poses, const std::vector<int>& frames,
                const std::vector<unsigned char>& clip, double range, const std::function<bool(double)>& goOn,
                unsigned char* pixels, ReadPixels& read);

}  // namespace bigus
