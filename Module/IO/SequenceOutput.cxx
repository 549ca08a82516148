// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/SequenceOutput.h"

#include <zlib.h>

#include <algorithm>
#include <memory>

#include "IO/AtomicFile.h"
#include "IO/Bytes.h"
#include "IO/FileError.h"
#include "IO/SequenceTimes.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

std::string MetaTypeOf(ElementType type)
{
  return type == ElementType::UInt8 ? "MET_UCHAR" : type == ElementType::UInt16 ? "MET_USHORT" : "MET_FLOAT";
}

void CheckFrameName(const std::string& text)
{
  const bool plain =
      !text.empty() &&
      std::all_of(text.begin(), text.end(),
                  [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); });
  Require(FileFault::User, plain && text[0] >= 'A' && text[0] <= 'Z', "coordinate frame name ", Quoted(text),
          "; letters and digits, with a capital first, are expected");
}

// Compresses what it is given into a file.
class Deflater
{
public:
  explicit Deflater(AtomicFile& file) : file_(file)
  {
    Require(FileFault::Unknown, deflateInit(&zlib_, Z_DEFAULT_COMPRESSION) == Z_OK, "zlib cannot be started");
  }
  ~Deflater() { deflateEnd(&zlib_); }
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;

  void Write(const unsigned char* bytes, std::size_t count)
  {
    while (count > 0)
    {
      const std::size_t part = std::min<std::size_t>(count, 1u << 30);
      zlib_.next_in = const_cast<unsigned char*>(bytes);
      zlib_.avail_in = static_cast<uInt>(part);
      Run(Z_NO_FLUSH);
      bytes += part;
      count -= part;
    }
  }

  void Finish() { Run(Z_FINISH); }

private:
  void Run(int flush)
  {
    do
    {
      zlib_.next_out = buffer_.data();
      zlib_.avail_out = static_cast<uInt>(buffer_.size());
      deflate(&zlib_, flush);
      file_.Write(buffer_.data(), buffer_.size() - zlib_.avail_out);
    } while (zlib_.avail_out == 0);
  }

  AtomicFile& file_;
  z_stream zlib_ = {};
  std::vector<unsigned char> buffer_ = std::vector<unsigned char>(256 * 1024);
};

/// The text before the pixels. `sizeField` becomes where the size of compressed pixels is to be filled in.
std::string HeaderOf(const SequenceToWrite& sequence, int frames, std::size_t& sizeField)
{
  std::string header = "ObjectType = Image\nNDims = 3\nAnatomicalOrientation = RAI\nBinaryData = True\n";
  header += std::string("BinaryDataByteOrderMSB = ") + (kThisMachineIsBigEndian ? "True\n" : "False\n");
  header += "CenterOfRotation = 0 0 0\n";
  header += std::string("CompressedData = ") + (sequence.compression ? "True\n" : "False\n");
  sizeField = header.size() + std::string("CompressedDataSize = ").size();
  if (sequence.compression)
  {
    constexpr std::size_t kMostDigits = 20;
    header += "CompressedDataSize = " + std::string(kMostDigits, ' ') + "\n";
  }
  header += "DimSize = " + std::to_string(sequence.width) + " " + std::to_string(sequence.height) + " " +
            std::to_string(frames);
  header += "\nKinds = domain domain list\nElementNumberOfChannels = 1\nElementSpacing = 1 1 1\nElementType = ";
  header += MetaTypeOf(sequence.elementType);
  header += "\nOffset = 0 0 0\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n";
  header += "UltrasoundImageOrientation = MF\nUltrasoundImageType = BRIGHTNESS\n";

  if (const std::string unit = StatedUnitOf(sequence.timestamps); !unit.empty())
  {
    header += "TimestampUnit = " + unit + "\n";
  }
  const std::string transform = sequence.fromFrame + "To" + sequence.toFrame + "Transform";
  for (int frame = 0; frame < frames; ++frame)
  {
    const auto at = static_cast<std::size_t>(frame);
    std::string number = std::to_string(frame);
    number.insert(0, number.size() < 4 ? 4 - number.size() : 0, '0');
    const std::string prefix = "Seq_Frame" + number + "_";
    const bool usable = sequence.isUsable.empty() || sequence.isUsable[at] != 0;
    header += prefix + transform + " =";
    for (std::size_t c = 0; c < 16; ++c)
    {
      header += " " + ExactNumber(sequence.imageToReference[16 * at + c]);
    }
    header += "\n" + prefix + transform + "Status = " + (usable ? "OK\n" : "INVALID\n");
    if (!sequence.timestamps.empty())
    {
      header += prefix + "Timestamp = " + ExactNumber(sequence.timestamps[at]) + "\n";
    }
    header += prefix + "ImageStatus = OK\n";
  }
  return header + "ElementDataFile = LOCAL\n";
}

}  // namespace

void RequireSequenceNames(const std::string& fileName, const std::string& fromFrame, const std::string& toFrame)
{
  Require(FileFault::Unrecognized, fileName.size() >= 4 && Lowercase(fileName.substr(fileName.size() - 4)) == ".mha",
          fileName, ": sequences are written as .mha (or .igs.mha) only");
  CheckFrameName(fromFrame);
  CheckFrameName(toFrame);
}

bool WriteSequence(const SequenceToWrite& sequence, const std::string& fileName,
                   const std::function<bool(double)>& goOn)
{
  RequireSequenceNames(fileName, sequence.fromFrame, sequence.toFrame);
  const auto frames = static_cast<int>(sequence.imageToReference.size() / 16);
  AtomicFile file(fileName);
  std::size_t sizeField = 0;
  const std::string header = HeaderOf(sequence, frames, sizeField);
  file.Write(header);

  const std::size_t frameBytes = static_cast<std::size_t>(sequence.width) * static_cast<std::size_t>(sequence.height) *
                                 BytesPerElement(sequence.elementType);
  const auto* const pixels = static_cast<const unsigned char*>(sequence.pixels);
  std::unique_ptr<Deflater> deflater(sequence.compression ? new Deflater(file) : nullptr);
  for (int frame = 0; frame < frames; ++frame)
  {
    const unsigned char* const bytes = pixels + static_cast<std::size_t>(frame) * frameBytes;
    deflater ? deflater->Write(bytes, frameBytes) : file.Write(bytes, frameBytes);
    if (!goOn((frame + 1.0) / frames))
    {
      return false;
    }
  }
  if (deflater)
  {
    deflater->Finish();
    const std::uint64_t bytes = file.Position() - header.size();
    file.Seek(sizeField);
    file.Write(std::to_string(bytes));
  }
  file.Commit();
  return true;
}

}  // namespace bigus
