// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/SequenceFrames.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>

#include "Core/Numerics/Constants.h"
#include "IO/FileError.h"
#include "IO/Formats/PngFile.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

// [rows][columns] 1 where `inside(i, j)`.
template <class Inside>
std::vector<unsigned char> MaskOf(int width, int height, const Inside& inside)
{
  std::vector<unsigned char> mask(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  auto pixel = mask.begin();
  for (std::int64_t j = 0; j < height; ++j)
  {
    for (std::int64_t i = 0; i < width; ++i)
    {
      *pixel++ = inside(i, j);
    }
  }
  return mask;
}

std::vector<unsigned char> FanMask(int width, int height, const Clip& clip)
{
  return MaskOf(width, height,
                [&clip](double i, double j)
                {
                  const double x = i - clip.apex[0];
                  const double y = j - clip.apex[1];
                  const double radius = std::sqrt(x * x + y * y);
                  const double angle = std::atan2(x, y) * (180.0 / kPi);
                  return radius >= clip.radii[0] && radius <= clip.radii[1] && angle >= clip.angles[0] &&
                         angle <= clip.angles[1];
                });
}

std::vector<unsigned char> RectangleMask(int width, int height, const int rectangle[4])
{
  return MaskOf(width, height,
                [=](std::int64_t i, std::int64_t j)
                {
                  return i >= rectangle[0] && i - rectangle[0] < rectangle[2] && j >= rectangle[1] &&
                         j - rectangle[1] < rectangle[3];
                });
}

// One frame from the file's pixel order to marked-far order.
void Reorder(const SequenceFile& file, const unsigned char* from, unsigned char* to)
{
  const std::size_t bytes = BytesPerElement(file.elementType);
  const auto width = static_cast<std::size_t>(file.width);
  const auto height = static_cast<std::size_t>(file.height);
  for (std::size_t j = 0; j < height; ++j)
  {
    const unsigned char* row = from + (file.flipRows ? height - 1 - j : j) * width * bytes;
    unsigned char* out = to + j * width * bytes;
    if (!file.flipColumns)
    {
      std::memcpy(out, row, width * bytes);
      continue;
    }
    for (std::size_t i = 0; i < width; ++i)
    {
      std::memcpy(out + i * bytes, row + (width - 1 - i) * bytes, bytes);
    }
  }
}

// Reads a sequence whose list axis comes first. `place` says where each frame goes in `pixels`, or -1. False
// when the user wants to stop.
bool ReadInterleaved(const SequenceFile& file, const std::vector<int>& place, const std::function<bool(double)>& goOn,
                     unsigned char* pixels)
{
  const std::size_t bytes = BytesPerElement(file.elementType);
  const std::size_t frames = place.size();
  const auto width = static_cast<std::size_t>(file.width);
  const auto height = static_cast<std::size_t>(file.height);
  PixelStream stream(file);
  std::vector<unsigned char> row(frames * width * bytes);
  for (std::size_t j = 0; j < height; ++j)
  {
    stream.Read(row.data(), row.size());
    for (std::size_t frame = 0; frame < frames; ++frame)
    {
      for (std::size_t i = 0; place[frame] >= 0 && i < width; ++i)
      {
        std::memcpy(pixels + ((static_cast<std::size_t>(place[frame]) * height + j) * width + i) * bytes,
                    &row[(i * frames + frame) * bytes], bytes);
      }
    }
    // The other half is for sorting the pixels out.
    if (!goOn(0.5 * static_cast<double>(j + 1) / static_cast<double>(height)))
    {
      return false;
    }
  }
  stream.Finish();
  return true;
}

// Blackens what the mask leaves out and notes what is lit. A float pixel of any sign of zero is black. One loop a pixel
// type: where one loop took all types, GCC read 4 bytes for pixels of 1 byte, past the end of the last frame.
template <class Pixel>
void ClipAndNotePixels(const std::vector<unsigned char>& clip, Pixel* frame, std::size_t pixels, unsigned char* lit)
{
  for (std::size_t p = 0; p < pixels; ++p)
  {
    if (!clip.empty() && !clip[p])
    {
      frame[p] = 0;
    }
    lit[p] |= frame[p] != 0;
  }
}

void ClipAndNote(const SequenceFile& file, const std::vector<unsigned char>& clip, unsigned char* frame,
                 unsigned char* lit)
{
  const std::size_t pixels = static_cast<std::size_t>(file.width) * static_cast<std::size_t>(file.height);
  switch (file.elementType)
  {
    case ElementType::Float32:
      return ClipAndNotePixels(clip, reinterpret_cast<float*>(frame), pixels, lit);
    case ElementType::UInt16:
      return ClipAndNotePixels(clip, reinterpret_cast<std::uint16_t*>(frame), pixels, lit);
    default:
      return ClipAndNotePixels(clip, frame, pixels, lit);
  }
}

// How many of an unsigned short's highest bits no pixel has, of data that have 8, 10, 12 or 14 bits; else 0. Pixels below
// kDimmest would make the number of bits a guess.
int UnusedBits(const std::uint16_t* pixels, std::size_t count)
{
  constexpr int kDimmest = 64;
  const int largest = count > 0 ? *std::max_element(pixels, pixels + count) : 0;
  int bits = 8;
  while (largest >= 1 << bits)
  {
    bits += 2;
  }
  return largest < kDimmest ? 0 : 16 - bits;
}

// Makes `range` the largest pixel of the type. Throws FileError where a pixel is larger.
template <class Pixel>
void ScalePixels(const SequenceFile& file, Pixel* pixels, std::size_t count, double range, double white)
{
  for (std::size_t p = 0; p < count; ++p)
  {
    const double pixel = pixels[p];
    if (pixel > range)
    {
      throw FormatError(file.fileName + ": has the pixel " + ExactNumber(pixel) + ", above the pixel range of " +
                        ExactNumber(range));
    }
    const double scaled = pixel * (white / range);
    pixels[p] = static_cast<Pixel>(white > 1 ? std::round(scaled) : scaled);
  }
}

void Scale(const SequenceFile& file, unsigned char* pixels, std::size_t count, double range)
{
  switch (file.elementType)
  {
    case ElementType::Float32:
      return ScalePixels(file, reinterpret_cast<float*>(pixels), count, range, 1);
    case ElementType::UInt16:
      return ScalePixels(file, reinterpret_cast<std::uint16_t*>(pixels), count, range, 65535);
    default:
      return ScalePixels(file, pixels, count, range, 255);
  }
}

/// Where a frame of the file goes in the output, or -1.
std::vector<int> PlacesOf(const std::vector<int>& frames, std::size_t framesOfFile)
{
  std::vector<int> place(framesOfFile, -1);
  for (std::size_t i = 0; i < frames.size(); ++i)
  {
    place[static_cast<std::size_t>(frames[i])] = static_cast<int>(i);
  }
  return place;
}

/// Scales `count` pixels to what is shown as white: `range`, or where that is not given, what the bits in use hold.
void SetRange(const SequenceFile& file, double range, unsigned char* pixels, std::size_t count, ReadPixels& read)
{
  read.usedRange = range;
  if (file.elementType == ElementType::UInt16 && !(range > 0))
  {
    const int bits = UnusedBits(reinterpret_cast<const std::uint16_t*>(pixels), count);
    read.usedBits = bits > 0 ? 16 - bits : 0;
    read.usedRange = bits > 0 ? (1 << read.usedBits) - 1 : range;
  }
  if (read.usedRange > 0)
  {
    Scale(file, pixels, count, read.usedRange);
  }
}

}  // namespace

std::vector<unsigned char> ClipMask(const SequenceFile& file, const Clip& clip)
{
  std::vector<unsigned char> mask;
  if (clip.shape == Clip::Shape::Rectangle)
  {
    mask = RectangleMask(file.width, file.height, clip.rectangle);
  }
  else if (clip.shape == Clip::Shape::Fan)
  {
    Require(FileFault::User,
            clip.radii[0] >= 0 && clip.radii[0] < clip.radii[1] && clip.angles[0] >= -180 &&
                clip.angles[0] < clip.angles[1] && clip.angles[1] <= 180,
            "the clip fan needs 0 <= inner < outer radius and -180 <= first < last <= 180 degrees");
    mask = FanMask(file.width, file.height, clip);
  }
  Require(FileFault::User, mask.empty() || std::find(mask.begin(), mask.end(), 1) != mask.end(),
          "the clip shape leaves no pixel of the ", file.width, " x ", file.height, " image");
  return mask;
}

std::string UsedBitsWarning(const SequenceFile& file, const ReadPixels& read)
{
  return file.fileName + ": the pixels use " + std::to_string(read.usedBits) + " of 16 bits, so " +
         ExactNumber(read.usedRange) +
         " is shown as white. Where that is wrong, set the pixel range; 65535 keeps pixels as they are";
}

bool ReadFrames(const SequenceFile& file, const PoseTable& poses, const std::vector<int>& frames,
                const std::vector<unsigned char>& clip, double range, const std::function<bool(double)>& goOn,
                unsigned char* pixels, ReadPixels& read)
{
  const auto pixelsPerFrame = static_cast<std::size_t>(file.width) * static_cast<std::size_t>(file.height);
  const auto frameBytes = static_cast<std::size_t>(file.FrameBytes());
  read = ReadPixels();
  read.lit.assign(pixelsPerFrame, 0);

  const std::vector<int> place = PlacesOf(frames, poses.frames.size());
  if (file.framesFastest && !ReadInterleaved(file, place, goOn, pixels))
  {
    return false;
  }

  // Frames are read where they belong, unless they have to be turned or are not wanted.
  const bool turned = file.flipColumns || file.flipRows;
  std::vector<unsigned char> buffer(frameBytes);
  const bool streamed = file.encoding != Encoding::Png && !file.framesFastest;
  std::unique_ptr<PixelStream> stream(streamed ? new PixelStream(file) : nullptr);
  for (std::size_t i = 0; i < place.size(); ++i)
  {
    unsigned char* const target = place[i] < 0 ? nullptr : pixels + static_cast<std::size_t>(place[i]) * frameBytes;
    unsigned char* const here = target && !turned ? target : buffer.data();
    if (streamed)
    {
      stream->Read(here, frameBytes);
    }
    if (target)
    {
      if (!streamed && !file.framesFastest)
      {
        const PngHeader expected = {file.width, file.height, file.elementType};
        ReadPng(file.images[i], expected, here);
      }
      if (turned)
      {
        if (file.framesFastest)
        {
          std::memcpy(here, target, frameBytes);
        }
        Reorder(file, here, target);
      }
      // Rejected frames are clipped too, but do not light the mask.
      std::vector<unsigned char> ignored(poses.frames[i].accepted ? 0 : pixelsPerFrame);
      ClipAndNote(file, clip, target, ignored.empty() ? read.lit.data() : ignored.data());
    }
    const double share = static_cast<double>(i + 1) / static_cast<double>(place.size());
    if (!goOn(file.framesFastest ? 0.5 + 0.5 * share : share))
    {
      return false;
    }
  }
  if (stream)
  {
    stream->Finish();
  }
  SetRange(file, range, pixels, pixelsPerFrame * frames.size(), read);
  return true;
}

}  // namespace bigus
