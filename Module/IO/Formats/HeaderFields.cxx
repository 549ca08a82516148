// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/HeaderFields.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "IO/FileError.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

/// Frames that a file of any size may hold.
constexpr std::uint64_t kFramesOfAnyFile = 10000;

// A field of the whole file by its name in MetaImage sequences, or else by the one that IGSIO gives it in NRRD.
const std::string* FindEither(const SequenceFile& file, const char* name, const char* nrrdName)
{
  const std::string* value = Find(file.fields, name);
  const std::string* other = Find(file.fields, nrrdName);
  if (value && other && Trimmed(*value) != Trimmed(*other))
  {
    Refuse(file, std::string(name) + " = " + Quoted(*value) + ", but " + nrrdName + " = " + Quoted(*other) +
                     "; remove the one that is wrong");
  }
  return value ? value : other;
}

// In marked-far order i grows towards the marked side of the probe and j away from it. Plus brings images to
// that order when it loads them, and transforms refer to it. The flag's third letter, where there is one, is
// the direction of the slices of a 3-D frame; our frames have one slice, so it changes nothing.
void SetOrientation(SequenceFile& file)
{
  const std::string* flag = FindEither(file, "UltrasoundImageOrientation", "ultrasound image orientation");
  file.orientation = flag ? std::string(Trimmed(*flag)) : "MF";
  const std::string& o = file.orientation;
  const bool known = (o.size() == 2 || (o.size() == 3 && (o[2] == 'A' || o[2] == 'D'))) &&
                     (o[0] == 'M' || o[0] == 'U') && (o[1] == 'F' || o[1] == 'N');
  RequireHeader(file, known, "UltrasoundImageOrientation = ", Quoted(o),
                "; MF, MN, UF and UN, with A or D after them, are read. Scan-line orders such as FM are not: "
                "convert to a B-mode image first");
  file.flipColumns = o[0] == 'U';
  file.flipRows = o[1] == 'N';
}

void CheckImageType(const SequenceFile& file)
{
  const std::string* type = FindEither(file, "UltrasoundImageType", "ultrasound image type");
  if (type && *type != "BRIGHTNESS" && !(*type == "RGB_COLOR" && file.channels > 1))
  {
    Refuse(file, "UltrasoundImageType = " + Quoted(*type) + "; only BRIGHTNESS (B-mode) is read");
  }
}

// Fills dataBytes, and refuses headers that claim more pixels than the data can hold.
void CheckDataSize(SequenceFile& file)
{
  const std::uint64_t size = InputFile(file.dataFile).Size();
  const std::uint64_t available = size > file.dataOffset ? size - file.dataOffset : 0;
  Require(FileFault::Truncated, file.dataBytes <= available, file.fileName,
          ": states CompressedDataSize = ", file.dataBytes, ", but only ", available,
          " bytes of pixels follow; the file is truncated or that number is wrong");
  file.dataBytes = file.dataBytes == 0 ? available : file.dataBytes;

  const std::uint64_t needed = file.PixelBytesInFile();
  const bool compressed = file.encoding != Encoding::Raw;
  // What is kept of a frame takes some hundred bytes, so a few bytes must not stand for a million frames of a pixel.
  const auto frames = static_cast<std::uint64_t>(file.numberOfFrames);
  RequireHeader(file, frames <= std::max<std::uint64_t>(kFramesOfAnyFile, file.dataBytes), "claims ", frames,
                " frames in ", file.dataBytes, " bytes of pixels; where there are more than ", kFramesOfAnyFile,
                " frames, each takes a byte at least");
  Require(FileFault::Truncated, !(compressed ? needed / deflateLimit > file.dataBytes : needed > file.dataBytes),
          file.fileName, ": claims ", file.numberOfFrames, " frames of ", file.width, " x ", file.height, " ",
          file.PixelType(), " (", needed, " bytes), but only ", file.dataBytes, compressed ? " compressed" : "",
          " bytes of pixels follow; the file is truncated or its sizes are wrong");
  RequireHeader(file, compressed || needed >= file.dataBytes, "the header accounts for ", needed,
                " bytes of pixels, but there are ", file.dataBytes, "; its sizes or element type are wrong");
}

}  // namespace

void Refuse(const SequenceFile& file, const std::string& message)
{
  throw FormatError(file.fileName + ": " + message);
}

bool IsSound(const std::string& status)
{
  static const std::set<std::string> words = {"ok", "valid", "good", "tracked", "visible", "true", "yes", "1"};
  return words.count(Lowercase(status)) > 0;
}

const std::string* Find(const Fields& fields, const std::string& name)
{
  const auto found = fields.find(name);
  return found == fields.end() ? nullptr : &found->second;
}

const std::string& Require(const SequenceFile& file, const Fields& fields, const std::string& name)
{
  const std::string* value = Find(fields, name);
  RequireHeader(file, value, "the header has no field ", name, "; it is incomplete or not a tracked sequence");
  return *value;
}

std::vector<std::int64_t> RequireSizes(const SequenceFile& file, const std::string& name, const std::string& text)
{
  std::vector<std::int64_t> sizes;
  for (const auto word : Words(text))
  {
    std::int64_t size = -1;
    if (!ParseNumber(word, size) || size < 1 || sizes.size() >= 16)
    {
      Refuse(file, name + " = " + Quoted(text) +
                       (size != 0 ? "; at most 16 whole numbers from 1 on are expected"
                                  : ", so it holds no images. What a tracker records without a video "
                                    "is not read"));
    }
    sizes.push_back(size);
  }
  return sizes;
}

void SetChannels(SequenceFile& file, std::int64_t channels)
{
  RequireHeader(file, channels == 1 || channels == 3 || channels == 4, "has ", channels,
                " channels a pixel; grey images (1) and colours (3, 4) are read");
  RequireHeader(file, channels <= 1 || file.elementType == ElementType::UInt8, "has colours of type ", file.PixelType(),
                "; those of unsigned char are read");
  file.channels = static_cast<int>(channels);
}

void SetSizes(SequenceFile& file, std::int64_t width, std::int64_t height, std::int64_t frames)
{
  RequireHeader(file, width <= largestSide && height <= largestSide && frames <= mostFrames, "claims ", frames,
                " frames of ", width, " x ", height, " pixels; at most ", mostFrames, " frames of ", largestSide, " x ",
                largestSide, " are read");
  file.width = static_cast<int>(width);
  file.height = static_cast<int>(height);
  file.numberOfFrames = static_cast<int>(frames);
}

void SetSpacing(SequenceFile& file, const std::string& field, double i, double j)
{
  if (i > 0 && j > 0 && std::isfinite(i) && std::isfinite(j))
  {
    file.spacing = {i, j};
    file.spacingField = field;
  }
}

void FieldCollector::Add(const SequenceFile& file, std::string_view key, std::string_view value)
{
  constexpr std::string_view kPrefix = "Seq_Frame";
  if (key.substr(0, kPrefix.size()) != kPrefix)
  {
    fields[std::string(key)] = value;
    return;
  }
  const auto rest = key.substr(kPrefix.size());
  const auto underscore = rest.find('_');
  std::int64_t frame = -1;
  if (underscore == std::string_view::npos || !ParseNumber(rest.substr(0, underscore), frame) || frame < 0)
  {
    Refuse(file, "field " + Quoted(key) + "; a per-frame field is named Seq_Frame0000_Name");
  }
  perFrame_[frame][std::string(rest.substr(underscore + 1))] = value;
}

void FieldCollector::MoveInto(SequenceFile& file)
{
  if (!perFrame_.empty() && perFrame_.rbegin()->first >= file.numberOfFrames)
  {
    Refuse(file, "has fields for frame " + std::to_string(perFrame_.rbegin()->first) + ", but only " +
                     std::to_string(file.numberOfFrames) + " frames; the sizes or the fields are wrong");
  }
  file.frames.resize(static_cast<std::size_t>(file.numberOfFrames));
  for (auto& [frame, frameFields] : perFrame_)
  {
    file.frames[static_cast<std::size_t>(frame)] = std::move(frameFields);
  }
}

void FinishHeader(SequenceFile& file, FieldCollector& collected)
{
  CheckDataSize(file);
  CheckImageType(file);
  SetOrientation(file);
  collected.MoveInto(file);
}

}  // namespace bigus
