// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the header of a tracked sequence says, whichever format it is in, and its pixels as a stream.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace bigus
{

enum class ElementType
{
  UInt8,
  UInt16,
  Float32
};

enum class Encoding
{
  Raw,
  Zlib,
  Gzip,
  Png  ///< one PNG file a frame
};

std::size_t BytesPerElement(ElementType type);
const char* NameOf(ElementType type);
const char* NameOf(Encoding encoding);

using Fields = std::map<std::string, std::string>;

/// The most pixels a side that are read. With mostFrames it keeps products of sizes far below 2^63.
constexpr std::int64_t largestSide = 32768;
constexpr std::int64_t mostFrames = 1000000;

/// Everything but the pixels.
struct SequenceFile
{
  std::string fileName;
  std::string format;
  int width = 0;
  int height = 0;
  int numberOfFrames = 0;
  ElementType elementType = ElementType::UInt8;  ///< of a pixel as it is read
  int channels = 1;       ///< elements of a pixel in the file; 3 or 4 are red, green, blue, and what is ignored
  bool isSigned = false;  ///< UInt16 is short in the file, and no pixel may be negative
  bool bigEndian = false;
  int layers = 1;              ///< of each pixel, which lie side by side: `width` counts them all
  bool framesFastest = false;  ///< the list axis comes first: a pixel's values in all frames lie side by side

  std::string orientation;   ///< the flag as in the file
  bool flipColumns = false;  ///< to reach marked-far order
  bool flipRows = false;
  std::array<double, 2> spacing = {0, 0};  ///< mm of a pixel along i and j as the header states it; 0: it does not
  std::string spacingField;                ///< which states it
  double timeUnit = 0;                     ///< seconds of the unit of Timestamps, by the file; 0: it does not say
  std::vector<std::string> notes;          ///< sentences on what was decided or left out

  Encoding encoding = Encoding::Raw;
  std::string dataFile;                   ///< raw, zlib, gzip
  std::uint64_t dataOffset = 0;           ///< bytes into dataFile
  std::uint64_t dataBytes = 0;            ///< encoded bytes there are
  std::vector<std::string> images;        ///< png: [frames]
  std::vector<std::array<int, 2>> sizes;  ///< CSV only: [frames] width and height where stated, else 0, 0

  Fields fields;                      ///< of the whole file, by name
  std::vector<Fields> frames;         ///< [frames] of each frame, by name without the Seq_FrameNNNN_ prefix
  std::vector<std::string> comments;  ///< lines of NRRD and CSV that begin with #, without it
  std::vector<std::pair<std::string, std::string>> otherColumns;  ///< CSV: name and first value of what is not read

  /// Of a frame as it is read.
  std::uint64_t FrameBytes() const
  {
    return static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) * BytesPerElement(elementType);
  }
  /// Of all frames as they are in the file, decoded.
  std::uint64_t PixelBytesInFile() const
  {
    return FrameBytes() * static_cast<std::uint64_t>(channels) * static_cast<std::uint64_t>(numberOfFrames);
  }
  /// Such as "unsigned char, 3 channels".
  std::string PixelType() const;
};

/// Where a CSV of poses finds its images.
struct ImageOptions
{
  bool wanted = true;    ///< false: poses only, images are looked at for their size at most
  bool plain = false;    ///< true: a PNG image, and an NRRD volume as a stack of its slices, will do too
  bool layered = false;  ///< true: so will such a volume of several layers (SequenceFile::layers)
  std::string folder;    ///< empty: the CSV's folder
  std::string pattern;   ///< with one %d; empty: the `image` column, or all PNG files of `folder`
};

/// Whether a file says that it is a sequence: it looks like one and, unless it may be plain, its header has a transform of a
/// frame. Volumes and pictures without poses are left to other readers.
bool IsSequence(const std::string& fileName, bool plain);

/// Throws FileError naming the file, the field, what was found and what to do. Checks that the file can hold
/// the pixels that its header claims before anything of that size is allocated.
SequenceFile ReadSequenceFile(const std::string& fileName, const ImageOptions& images);

/// The lightness of a colour as video weighs it (ITU-R BT.601), rounded; of equal channels it is their value.
constexpr std::uint8_t Grey(int red, int green, int blue)
{
  return static_cast<std::uint8_t>((299 * red + 587 * green + 114 * blue + 500) / 1000);
}

/// The decoded pixel bytes of a raw, zlib or gzip sequence, in file order and this machine's byte order, colours as grey.
class PixelStream
{
public:
  explicit PixelStream(const SequenceFile& file);
  ~PixelStream();

  /// Exactly `count` bytes (whole elements), or FileError.
  void Read(void* bytes, std::size_t count);

  /// Throws FileError unless all pixels have been read, the stream ends there and its checksum is right.
  void Finish();

private:
  void ReadElements(unsigned char* bytes, std::size_t count);
  void ReadColours(unsigned char* greys, std::size_t count);

  class Decoder;
  std::unique_ptr<Decoder> decoder_;
  const SequenceFile& file_;
};

}  // namespace bigus
