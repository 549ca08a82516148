// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include "IO/FileError.h"
#include "IO/Formats/HeaderFields.h"
#include "IO/Formats/SequenceHeaders.h"
#include "IO/SequenceTimes.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

/// 3D Slicer writes a number a frame into one line.
constexpr std::size_t kLongestLine = 32u << 20;

/// Reads lines up to a blank one and returns the format's own fields, by lowercase name. Without a blank line the header
/// is not complete.
Fields ReadFields(SequenceFile& file, InputFile& input, FieldCollector& collected, bool& isComplete)
{
  Fields nrrd;
  std::string line;
  input.ReadLine(line);  // the magic
  while (!isComplete && input.ReadLine(line, kLongestLine))
  {
    RequireHeader(file, input.Position() <= longestHeader, "the header is longer than 256 MiB");
    if (line.empty())
    {
      isComplete = true;
      continue;
    }
    if (line[0] == '#')
    {
      file.comments.emplace_back(Trimmed(std::string_view(line).substr(1)));
      continue;
    }
    const auto colon = line.find(':');
    if (colon == std::string::npos)
    {
      Refuse(file, "header line " + Quoted(line) + " is neither \"field: value\" nor \"key:=value\"");
    }
    const auto key = Trimmed(std::string_view(line).substr(0, colon));
    if (colon + 1 < line.size() && line[colon + 1] == '=')
    {
      collected.Add(file, key, Trimmed(std::string_view(line).substr(colon + 2)));
    }
    else
    {
      const auto value = Trimmed(std::string_view(line).substr(colon + 1));
      nrrd[Lowercase(key)] = value;
      collected.Add(file, key, value);  // IGSIO writes its own file-wide fields in this form too
    }
  }
  return nrrd;
}

std::vector<std::int64_t> SizesOf(const SequenceFile& file, const Fields& nrrd)
{
  auto sizes = RequireSizes(file, "sizes", Require(file, nrrd, "sizes"));
  if (const std::string* dimension = Find(nrrd, "dimension"))
  {
    std::int64_t count = 0;
    RequireHeader(file, ParseNumber(*dimension, count) && count == static_cast<std::int64_t>(sizes.size()),
                  "dimension: ", Quoted(*dimension), ", but sizes has ", sizes.size(), " numbers");
  }
  return sizes;
}

/// What each of the axes is. Where the header does not say, they are columns, rows and a list of frames. Of four the third or
/// the fourth has one sample, or the first holds colours.
std::vector<std::string> KindsOf(const SequenceFile& file, const Fields& nrrd, const std::vector<std::int64_t>& sizes)
{
  const std::size_t axes = sizes.size();
  std::vector<std::string> kinds;
  if (const std::string* text = Find(nrrd, "kinds"))
  {
    for (const auto word : Words(*text))
    {
      kinds.push_back(Lowercase(word));
    }
  }
  else if (axes == 3)
  {
    kinds = {"domain", "domain", "list"};
  }
  else if (axes == 4 && sizes[2] == 1)
  {
    kinds = {"domain", "domain", "domain", "list"};
  }
  else if (axes == 4 && sizes[3] == 1)
  {
    kinds = {"domain", "domain", "list", "none"};
  }
  else if (axes == 4 && (sizes[0] == 1 || sizes[0] == 3 || sizes[0] == 4))
  {
    kinds = {"vector", "domain", "domain", "list"};
  }
  else if (axes == 2)
  {
    kinds = {"domain", "domain"};
  }
  RequireHeader(file, kinds.size() == axes, "kinds must name each of the ", axes,
                " axes, such as \"domain domain list\"");
  return kinds;
}

/// Per axis how far its samples lie apart, by "spacings" or by the lengths of "space directions"; NaN where it has none.
std::vector<double> SpacingsOf(const Fields& nrrd, std::string& field)
{
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> spacings;
  field = "spacings";
  if (const std::string* text = Find(nrrd, field))
  {
    for (const auto word : Words(*text))
    {
      spacings.push_back(nan);
      ParseNumber(word, spacings.back());
    }
    return spacings;
  }
  field = "space directions";
  const std::string* text = Find(nrrd, field);
  for (std::size_t at = 0; text && (at = text->find_first_of("n(", at)) != std::string::npos;)
  {
    const std::size_t end = std::min(text->find((*text)[at] == '(' ? ')' : ' ', at), text->size());
    std::string vector = text->substr(at + 1, end - at - 1);
    std::replace(vector.begin(), vector.end(), ',', ' ');
    double v[3];
    spacings.push_back(ParseNumbers(vector, 3, v) ? std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) : nan);
    at = end;
  }
  return spacings;
}

/// Sets width, height and frames, and returns how many channels a pixel has.
std::int64_t SetAxes(SequenceFile& file, Fields& nrrd, const ImageOptions& options)
{
  const std::vector<std::int64_t> sizes = SizesOf(file, nrrd);
  const std::vector<std::string> kinds = KindsOf(file, nrrd, sizes);
  const auto isColour = [](const std::string& kind)
  { return kind == "rgb-color" || kind == "rgba-color" || kind == "3-color" || kind == "vector"; };
  std::int64_t channels = 1;
  std::vector<std::int64_t> plane;
  std::int64_t frames = 1, layers = 1;
  int lists = 0;
  for (std::size_t axis = 0; axis < sizes.size(); ++axis)
  {
    if (kinds[axis] == "list" || kinds[axis] == "time")
    {
      frames = sizes[axis];
      file.framesFastest = plane.empty();
      if (++lists > 1 || plane.size() == 1)
      {
        Refuse(file, "kinds: " + Quoted(nrrd["kinds"]) + "; one list axis, before or after all domain axes, is read");
      }
    }
    else if (kinds[axis] == "domain" || kinds[axis] == "space")
    {
      if (plane.size() < 2)
      {
        plane.push_back(sizes[axis]);
      }
      else if (options.plain && lists == 0 && sizes[axis] != 1)
      {
        frames = sizes[axis];
        ++lists;
      }
      else if (options.layered && file.framesFastest && plane.size() == 2 && frames <= largestSide)
      {
        layers = frames;
        frames = sizes[axis];
        file.framesFastest = false;
      }
      else if (sizes[axis] != 1)
      {
        Refuse(file, "sizes: " + Quoted(nrrd["sizes"]) + "; frames of more than one slice are not read");
      }
    }
    else if (axis == 0 && isColour(kinds[axis]))
    {
      channels = sizes[axis];
    }
    else if (sizes[axis] != 1)
    {
      Refuse(file, "kinds: " + Quoted(kinds[axis]) + " of size " + std::to_string(sizes[axis]) +
                       "; domain and list axes are read, and colours that come first (RGB-color or vector)");
    }
  }
  if (plane.size() != 2)
  {
    Refuse(file, "kinds: " + Quoted(nrrd["kinds"]) + "; two domain axes (width and height) are needed");
  }
  SetSizes(file, std::min(plane[0], largestSide + 1) * layers, plane[1], frames);
  file.layers = static_cast<int>(layers);
  return channels;
}

/// Seconds of the unit of an axis; 0 where the header names none, or not one of time.
double UnitOfAxis(const Fields& nrrd, std::size_t axis)
{
  std::vector<std::string> units;
  const std::string* text = Find(nrrd, "units");
  for (std::size_t at = text ? text->find('"') : std::string::npos; at != std::string::npos;)
  {
    const std::size_t end = std::min(text->find('"', at + 1), text->size());
    units.emplace_back(Trimmed(std::string_view(*text).substr(at + 1, end - at - 1)));
    at = text->find('"', end + 1);
  }
  return axis < units.size() ? UnitOfTime(Lowercase(units[axis])).value_or(0) : 0;
}

/// Times of frames that have none, by what 3D Slicer writes of the list axis.
void TakeTimes(SequenceFile& file, const Fields& nrrd)
{
  const std::vector<std::string> kinds = KindsOf(file, nrrd, SizesOf(file, nrrd));
  const auto list =
      std::find_if(kinds.begin(), kinds.end(), [](const std::string& k) { return k == "list" || k == "time"; });
  const std::string axis = "axis " + std::to_string(list - kinds.begin());
  const double unit = UnitOfAxis(nrrd, static_cast<std::size_t>(list - kinds.begin()));
  const std::string* values = Find(file.fields, axis + " index values");
  const std::vector<std::string_view> words = values ? Words(*values) : std::vector<std::string_view>();
  if (unit == 0 || words.size() != file.frames.size())
  {
    return;
  }
  const bool haveNone = std::none_of(file.frames.begin(), file.frames.end(),
                                     [](const Fields& fields) { return fields.count("Timestamp") > 0; });
  file.timeUnit = haveNone ? 1 : 0;
  for (std::size_t frame = 0; frame < words.size(); ++frame)
  {
    double time = 0;
    const bool isConverted = unit != 1 && ParseNumber(words[frame], time);
    file.frames[frame].emplace("Timestamp", isConverted ? ExactNumber(unit * time) : std::string(words[frame]));
  }
}

void TakeSpacing(SequenceFile& file, const Fields& nrrd)
{
  std::string field;
  const std::vector<double> spacings = SpacingsOf(nrrd, field);
  if (spacings.size() != SizesOf(file, nrrd).size())
  {
    return;
  }
  const std::vector<std::string> kinds = KindsOf(file, nrrd, SizesOf(file, nrrd));
  std::vector<double> plane;
  for (std::size_t axis = 0; axis < spacings.size(); ++axis)
  {
    if (kinds[axis] == "domain" || kinds[axis] == "space")
    {
      plane.push_back(spacings[axis]);
    }
  }
  SetSpacing(file, field, plane[0], plane[1]);
}

void SetType(SequenceFile& file, const Fields& nrrd)
{
  const std::string type = Lowercase(Require(file, nrrd, "type"));
  if (type == "unsigned char" || type == "uchar" || type == "uint8" || type == "uint8_t")
  {
    file.elementType = ElementType::UInt8;
  }
  else if (type == "unsigned short" || type == "ushort" || type == "unsigned short int" || type == "uint16" ||
           type == "uint16_t")
  {
    file.elementType = ElementType::UInt16;
  }
  else if (type == "short" || type == "signed short" || type == "short int" || type == "signed short int" ||
           type == "int16" || type == "int16_t")
  {
    file.elementType = ElementType::UInt16;
    file.isSigned = true;
  }
  else if (type == "float")
  {
    file.elementType = ElementType::Float32;
  }
  else
  {
    Refuse(file, "type: " + Quoted(type) + "; unsigned char, unsigned short, short and float are read");
  }
}

void SetEndian(SequenceFile& file, const Fields& nrrd)
{
  if (const std::string* endian = Find(nrrd, "endian"))
  {
    RequireHeader(file, Lowercase(*endian) == "little" || Lowercase(*endian) == "big", "endian: ", Quoted(*endian),
                  "; little or big is expected");
    file.bigEndian = Lowercase(*endian) == "big";
  }
  else if (BytesPerElement(file.elementType) > 1)
  {
    Refuse(file, "the header has no field endian, which elements of more than one byte need");
  }
}

void SetData(SequenceFile& file, const Fields& nrrd, std::uint64_t end, bool isComplete)
{
  const std::string encoding = Lowercase(Require(file, nrrd, "encoding"));
  if (encoding == "gzip" || encoding == "gz")
  {
    file.encoding = Encoding::Gzip;
  }
  else if (encoding != "raw")
  {
    Refuse(file, "encoding: " + Quoted(encoding) + "; raw and gzip are read");
  }

  const std::string* dataFile = Find(nrrd, "data file");
  dataFile = dataFile ? dataFile : Find(nrrd, "datafile");
  if (dataFile)
  {
    RequireHeader(file, Lowercase(*dataFile).rfind("list", 0) != 0 && dataFile->find('%') == std::string::npos,
                  "data file: ", Quoted(*dataFile), "; one file is read, lists and patterns not");
    file.dataFile = CompanionFile(file.fileName, FolderOf(file.fileName), *dataFile);
  }
  else if (isComplete)
  {
    file.dataFile = file.fileName;
    file.dataOffset = end;
  }
  else
  {
    throw TruncationError(file.fileName + ": the header ends without a blank line or a data file; it is truncated");
  }
  for (const char* name : {"line skip", "lineskip", "byte skip", "byteskip"})
  {
    const std::string* skip = Find(nrrd, name);
    if (skip && *skip != "0")
    {
      Refuse(file, std::string(name) + ": " + Quoted(*skip) + "; skipping is not supported");
    }
  }
}

}  // namespace

bool LooksLikeNrrd(const std::string& beginning)
{
  return beginning.rfind("NRRD000", 0) == 0;
}

void ReadNrrdHeader(SequenceFile& file, InputFile& input, const ImageOptions& options)
{
  file.format = "NRRD sequence";
  FieldCollector collected;
  bool isComplete = false;
  Fields nrrd = ReadFields(file, input, collected, isComplete);
  file.fields = std::move(collected.fields);
  const std::int64_t channels = SetAxes(file, nrrd, options);
  TakeSpacing(file, nrrd);
  SetType(file, nrrd);
  SetChannels(file, channels);
  SetEndian(file, nrrd);
  SetData(file, nrrd, input.Position(), isComplete);
  FinishHeader(file, collected);
  TakeTimes(file, nrrd);
}

}  // namespace bigus
