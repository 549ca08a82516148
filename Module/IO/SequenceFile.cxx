// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/SequenceFile.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "IO/FileError.h"
#include "IO/Formats/PngFile.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::uint64_t longestHeader = 256u << 20;
constexpr std::size_t mostCsvColumns = 1000;

[[noreturn]] void Refuse(const SequenceFile& file, const std::string& message)
{
  throw FormatError(file.fileName + ": " + message);
}

const std::string* Find(const Fields& fields, const std::string& name)
{
  const auto found = fields.find(name);
  return found == fields.end() ? nullptr : &found->second;
}

const std::string& Require(const SequenceFile& file, const Fields& fields, const std::string& name)
{
  const std::string* value = Find(fields, name);
  if (!value)
  {
    Refuse(file, "the header has no field " + name + "; it is incomplete or not a tracked sequence");
  }
  return *value;
}

std::vector<std::int64_t> RequireSizes(const SequenceFile& file, const std::string& name, const std::string& text)
{
  std::vector<std::int64_t> sizes;
  for (const auto word : Words(text))
  {
    std::int64_t size = 0;
    if (!ParseNumber(word, size) || size < 1 || sizes.size() >= 16)
    {
      Refuse(file, name + " = " + Quoted(text) + "; at most 16 whole numbers from 1 on are expected");
    }
    sizes.push_back(size);
  }
  return sizes;
}

void SetSizes(SequenceFile& file, std::int64_t width, std::int64_t height, std::int64_t frames)
{
  if (width > largestSide || height > largestSide || frames > mostFrames)
  {
    Refuse(file, "claims " + std::to_string(frames) + " frames of " + std::to_string(width) + " x " +
                     std::to_string(height) + " pixels; at most " + std::to_string(mostFrames) + " frames of " +
                     std::to_string(largestSide) + " x " + std::to_string(largestSide) + " are read");
  }
  file.width = static_cast<int>(width);
  file.height = static_cast<int>(height);
  file.numberOfFrames = static_cast<int>(frames);
}

// In marked-far order i grows towards the marked side of the probe and j away from it. Plus brings images to
// that order when it loads them, and transforms refer to it. The flag's third letter, where there is one, is
// the direction of the slices of a 3-D frame; our frames have one slice, so it changes nothing.
void SetOrientation(SequenceFile& file, const std::string* flag)
{
  file.orientation = flag ? std::string(Trimmed(*flag)) : "MF";
  const std::string& o = file.orientation;
  const bool known = (o.size() == 2 || (o.size() == 3 && (o[2] == 'A' || o[2] == 'D'))) &&
                     (o[0] == 'M' || o[0] == 'U') && (o[1] == 'F' || o[1] == 'N');
  if (!known)
  {
    Refuse(file, "UltrasoundImageOrientation = " + Quoted(o) +
                     "; MF, MN, UF and UN, with A or D after them, are read. Scan-line orders such as FM are not: "
                     "convert to a B-mode image first");
  }
  file.flipColumns = o[0] == 'U';
  file.flipRows = o[1] == 'N';
}

void CheckImageType(const SequenceFile& file)
{
  const std::string* type = Find(file.fields, "UltrasoundImageType");
  if (type && *type != "BRIGHTNESS")
  {
    Refuse(file, "UltrasoundImageType = " + Quoted(*type) + "; only BRIGHTNESS (B-mode) is read");
  }
}

// A field of one frame (Seq_Frame0012_Name) goes to that frame, any other to the file.
class FieldCollector
{
public:
  void Add(const SequenceFile& file, std::string_view key, std::string_view value)
  {
    constexpr std::string_view prefix = "Seq_Frame";
    if (key.substr(0, prefix.size()) != prefix)
    {
      fields[std::string(key)] = value;
      return;
    }
    const auto rest = key.substr(prefix.size());
    const auto underscore = rest.find('_');
    std::int64_t frame = -1;
    if (underscore == std::string_view::npos || !ParseNumber(rest.substr(0, underscore), frame) || frame < 0)
    {
      Refuse(file, "field " + Quoted(key) + "; a per-frame field is named Seq_Frame0000_Name");
    }
    perFrame[frame][std::string(rest.substr(underscore + 1))] = value;
  }

  void MoveInto(SequenceFile& file)
  {
    if (!perFrame.empty() && perFrame.rbegin()->first >= file.numberOfFrames)
    {
      Refuse(file, "has fields for frame " + std::to_string(perFrame.rbegin()->first) + ", but only " +
                       std::to_string(file.numberOfFrames) + " frames; the sizes or the fields are wrong");
    }
    file.frames.resize(static_cast<std::size_t>(file.numberOfFrames));
    for (auto& [frame, frameFields] : perFrame)
    {
      file.frames[static_cast<std::size_t>(frame)] = std::move(frameFields);
    }
  }

  Fields fields;
  std::map<std::int64_t, Fields> perFrame;
};

bool ParseBool(const SequenceFile& file, const std::string& name, const std::string& text)
{
  const std::string lower = Lowercase(Trimmed(text));
  if (lower == "true" || lower == "1")
  {
    return true;
  }
  if (lower == "false" || lower == "0")
  {
    return false;
  }
  Refuse(file, name + " = " + Quoted(text) + "; True or False is expected");
}

// Fills dataBytes, and refuses headers that claim more pixels than the data can hold.
void CheckDataSize(SequenceFile& file)
{
  const std::uint64_t size = InputFile(file.dataFile).Size();
  const std::uint64_t available = size > file.dataOffset ? size - file.dataOffset : 0;
  if (file.dataBytes > available)
  {
    throw TruncationError(file.fileName + ": states CompressedDataSize = " + std::to_string(file.dataBytes) +
                          ", but only " + std::to_string(available) +
                          " bytes of pixels follow; the file is truncated or that number is wrong");
  }
  file.dataBytes = file.dataBytes == 0 ? available : file.dataBytes;

  const std::uint64_t needed = file.FrameBytes() * static_cast<std::uint64_t>(file.numberOfFrames);
  const bool compressed = file.encoding != Encoding::Raw;
  if (compressed ? needed / deflateLimit > file.dataBytes : needed > file.dataBytes)
  {
    throw TruncationError(file.fileName + ": claims " + std::to_string(file.numberOfFrames) + " frames of " +
                          std::to_string(file.width) + " x " + std::to_string(file.height) + " " +
                          NameOf(file.elementType) + " (" + std::to_string(needed) + " bytes), but only " +
                          std::to_string(file.dataBytes) + (compressed ? " compressed" : "") +
                          " bytes of pixels follow; the file is truncated or its sizes are wrong");
  }
  if (!compressed && needed < file.dataBytes)
  {
    Refuse(file, "the header accounts for " + std::to_string(needed) + " bytes of pixels, but there are " +
                     std::to_string(file.dataBytes) + "; its sizes or element type are wrong");
  }
}

// --- MetaImage
// ------------------------------------------------------------------------------------------------

// https://itk.org/Wiki/ITK/MetaIO/Documentation, with the per-frame fields of Plus and IGSIO.
void ReadMetaImageHeader(SequenceFile& file, InputFile& input)
{
  file.format = "MetaImage sequence";
  FieldCollector collected;
  std::string line;
  bool complete = false;
  while (!complete && input.ReadLine(line))
  {
    if (input.Position() > longestHeader)
    {
      Refuse(file, "the header is longer than 256 MiB");
    }
    const auto equals = line.find('=');
    if (equals == std::string::npos)
    {
      if (Trimmed(line).empty())
      {
        continue;
      }
      Refuse(file, "header line " + Quoted(line) + " is not \"Name = value\"");
    }
    const auto key = Trimmed(std::string_view(line).substr(0, equals));
    collected.Add(file, key, Trimmed(std::string_view(line).substr(equals + 1)));
    complete = key == "ElementDataFile";
  }
  if (!complete)
  {
    throw TruncationError(file.fileName + ": the header ends before ElementDataFile; the file is truncated");
  }
  file.fields = std::move(collected.fields);

  if (const std::string* type = Find(file.fields, "ObjectType"); type && *type != "Image")
  {
    Refuse(file, "ObjectType = " + Quoted(*type) + "; only Image is read");
  }
  auto sizes = RequireSizes(file, "DimSize", Require(file, file.fields, "DimSize"));
  std::int64_t dimensions = 0;
  const std::string& nDims = Require(file, file.fields, "NDims");
  if (!ParseNumber(nDims, dimensions) || dimensions != static_cast<std::int64_t>(sizes.size()))
  {
    Refuse(file, "NDims = " + Quoted(nDims) + ", but DimSize has " + std::to_string(sizes.size()) + " numbers");
  }
  if (sizes.size() == 4 && sizes[2] == 1)
  {
    sizes.erase(sizes.begin() + 2);
  }
  if (sizes.size() == 2)
  {
    sizes.push_back(1);
  }
  if (sizes.size() != 3)
  {
    Refuse(file, "DimSize = " + Quoted(file.fields["DimSize"]) +
                     "; a sequence of single-slice frames (width height frames) is expected");
  }
  SetSizes(file, sizes[0], sizes[1], sizes[2]);

  if (const std::string* channels = Find(file.fields, "ElementNumberOfChannels"); channels && *channels != "1")
  {
    Refuse(file, "ElementNumberOfChannels = " + Quoted(*channels) + "; only grey images (1) are read");
  }
  const std::string& type = Require(file, file.fields, "ElementType");
  if (type == "MET_UCHAR")
  {
    file.elementType = ElementType::UInt8;
  }
  else if (type == "MET_USHORT")
  {
    file.elementType = ElementType::UInt16;
  }
  else if (type == "MET_FLOAT")
  {
    file.elementType = ElementType::Float32;
  }
  else
  {
    Refuse(file, "ElementType = " + Quoted(type) + "; MET_UCHAR, MET_USHORT and MET_FLOAT are read");
  }

  if (const std::string* binary = Find(file.fields, "BinaryData"); binary && !ParseBool(file, "BinaryData", *binary))
  {
    Refuse(file, "BinaryData = False; pixels as text are not read");
  }
  for (const char* name : {"BinaryDataByteOrderMSB", "ElementByteOrderMSB"})
  {
    if (const std::string* order = Find(file.fields, name))
    {
      file.bigEndian = ParseBool(file, name, *order);
    }
  }
  if (const std::string* compressed = Find(file.fields, "CompressedData");
      compressed && ParseBool(file, "CompressedData", *compressed))
  {
    file.encoding = Encoding::Zlib;
  }

  const std::string& dataFile = Require(file, file.fields, "ElementDataFile");
  if (dataFile == "LOCAL")
  {
    file.dataFile = file.fileName;
    file.dataOffset = input.Position();
  }
  else if (Lowercase(dataFile).rfind("list", 0) == 0 || dataFile.find('%') != std::string::npos)
  {
    Refuse(file, "ElementDataFile = " + Quoted(dataFile) + "; one data file or LOCAL is read, lists and patterns not");
  }
  else
  {
    file.dataFile = CompanionFile(file.fileName, FolderOf(file.fileName), dataFile);
  }
  if (const std::string* text = Find(file.fields, "CompressedDataSize"); text && file.encoding == Encoding::Zlib)
  {
    std::int64_t bytes = 0;
    if (!ParseNumber(*text, bytes) || bytes < 1)
    {
      Refuse(file, "CompressedDataSize = " + Quoted(*text) + "; a positive whole number is expected");
    }
    file.dataBytes = static_cast<std::uint64_t>(bytes);
  }
  if (const std::string* text = Find(file.fields, "HeaderSize"); text && dataFile != "LOCAL")
  {
    std::int64_t bytes = 0;
    if (!ParseNumber(*text, bytes) || bytes < -1 || (bytes == -1 && file.encoding != Encoding::Raw))
    {
      Refuse(file, "HeaderSize = " + Quoted(*text) + "; bytes to skip in the data file, or -1 (raw data only)");
    }
    if (bytes == -1)
    {
      const std::uint64_t size = InputFile(file.dataFile).Size();
      const std::uint64_t needed = file.FrameBytes() * static_cast<std::uint64_t>(file.numberOfFrames);
      file.dataOffset = size > needed ? size - needed : 0;
    }
    else
    {
      file.dataOffset = static_cast<std::uint64_t>(bytes);
    }
  }
  CheckDataSize(file);
  CheckImageType(file);
  SetOrientation(file, Find(file.fields, "UltrasoundImageOrientation"));
  collected.MoveInto(file);
}

// --- NRRD
// -----------------------------------------------------------------------------------------------------

// https://teem.sourceforge.net/nrrd/format.html, with the per-frame fields of IGSIO as key/value pairs.
void ReadNrrdHeader(SequenceFile& file, InputFile& input, bool plain)
{
  file.format = "NRRD sequence";
  FieldCollector collected;
  Fields nrrd;  // the format's own fields, by lowercase name
  std::string line;
  bool blankLine = false;
  input.ReadLine(line);  // the magic
  while (!blankLine && input.ReadLine(line))
  {
    if (input.Position() > longestHeader)
    {
      Refuse(file, "the header is longer than 256 MiB");
    }
    if (line.empty())
    {
      blankLine = true;
      continue;
    }
    if (line[0] == '#')
    {
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
  file.fields = std::move(collected.fields);

  const auto sizes = RequireSizes(file, "sizes", Require(file, nrrd, "sizes"));
  if (const std::string* dimension = Find(nrrd, "dimension"))
  {
    std::int64_t count = 0;
    if (!ParseNumber(*dimension, count) || count != static_cast<std::int64_t>(sizes.size()))
    {
      Refuse(file, "dimension: " + Quoted(*dimension) + ", but sizes has " + std::to_string(sizes.size()) + " numbers");
    }
  }
  std::vector<std::string> kinds;
  if (const std::string* text = Find(nrrd, "kinds"))
  {
    for (const auto word : Words(*text))
    {
      kinds.push_back(Lowercase(word));
    }
  }
  else if (sizes.size() == 3)
  {
    kinds = {"domain", "domain", "list"};
  }
  else if (sizes.size() == 2)
  {
    kinds = {"domain", "domain"};
  }
  if (kinds.size() != sizes.size())
  {
    Refuse(file,
           "kinds must name each of the " + std::to_string(sizes.size()) + " axes, such as \"domain domain list\"");
  }
  std::vector<std::int64_t> plane;
  std::int64_t frames = 1;
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
      else if (plain && lists == 0)
      {
        frames = sizes[axis];
        ++lists;
      }
      else if (sizes[axis] != 1)
      {
        Refuse(file, "sizes: " + Quoted(nrrd["sizes"]) + "; frames of more than one slice are not read");
      }
    }
    else if (sizes[axis] != 1)
    {
      Refuse(file, "kinds: " + Quoted(kinds[axis]) + " of size " + std::to_string(sizes[axis]) +
                       "; only grey images (domain and list axes) are read");
    }
  }
  if (plane.size() != 2)
  {
    Refuse(file, "kinds: " + Quoted(nrrd["kinds"]) + "; two domain axes (width and height) are needed");
  }
  SetSizes(file, plane[0], plane[1], frames);

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
  else if (type == "float")
  {
    file.elementType = ElementType::Float32;
  }
  else
  {
    Refuse(file, "type: " + Quoted(type) + "; unsigned char, unsigned short and float are read");
  }
  if (const std::string* endian = Find(nrrd, "endian"))
  {
    if (Lowercase(*endian) != "little" && Lowercase(*endian) != "big")
    {
      Refuse(file, "endian: " + Quoted(*endian) + "; little or big is expected");
    }
    file.bigEndian = Lowercase(*endian) == "big";
  }
  else if (BytesPerElement(file.elementType) > 1)
  {
    Refuse(file, "the header has no field endian, which elements of more than one byte need");
  }

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
    if (Lowercase(*dataFile).rfind("list", 0) == 0 || dataFile->find('%') != std::string::npos)
    {
      Refuse(file, "data file: " + Quoted(*dataFile) + "; one file is read, lists and patterns not");
    }
    file.dataFile = CompanionFile(file.fileName, FolderOf(file.fileName), *dataFile);
  }
  else if (blankLine)
  {
    file.dataFile = file.fileName;
    file.dataOffset = input.Position();
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
  CheckDataSize(file);
  CheckImageType(file);
  SetOrientation(file, Find(file.fields, "UltrasoundImageOrientation"));
  collected.MoveInto(file);
}

// --- CSV of poses
// ---------------------------------------------------------------------------------------------

// One line's cells. Cells may be quoted with ", "" inside standing for one; they cannot contain line ends.
std::vector<std::string> CsvCells(const SequenceFile& file, const std::string& line)
{
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i)
  {
    const char c = line[i];
    if (quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"')
    {
      cells.back() += '"';
      ++i;
    }
    else if (c == '"')
    {
      quoted = !quoted;
    }
    else if (c == ',' && !quoted)
    {
      if (cells.size() >= mostCsvColumns)
      {
        Refuse(file, "has more than " + std::to_string(mostCsvColumns) + " columns");
      }
      cells.emplace_back();
    }
    else
    {
      cells.back() += c;
    }
  }
  if (quoted)
  {
    Refuse(file, "line " + Quoted(line) + " has a quote that does not end");
  }
  for (std::string& cell : cells)
  {
    cell = std::string(Trimmed(cell));
  }
  return cells;
}

// The pattern with its one %d or %0Nd replaced.
std::string ImageName(const SequenceFile& file, const std::string& pattern, std::int64_t number)
{
  const auto percent = pattern.find('%');
  auto end = percent;
  while (end != std::string::npos && ++end < pattern.size() && pattern[end] >= '0' && pattern[end] <= '9')
  {
  }
  std::int64_t digits = 0;
  const std::string width = end == std::string::npos ? "" : pattern.substr(percent + 1, end - percent - 1);
  if (end == std::string::npos || end >= pattern.size() || pattern[end] != 'd' ||
      pattern.find('%', end) != std::string::npos ||
      (!width.empty() && (width[0] != '0' || !ParseNumber(width, digits) || digits > 20)))
  {
    Refuse(file, "image pattern " + Quoted(pattern) + "; one %d or %04d, where the number goes, is expected");
  }
  std::string text = std::to_string(number);
  text.insert(0, text.size() < static_cast<std::size_t>(digits) ? static_cast<std::size_t>(digits) - text.size() : 0,
              '0');
  return pattern.substr(0, percent) + text + pattern.substr(end + 1);
}

std::vector<std::string> PngFilesOf(const std::string& folder)
{
  std::vector<std::string> files;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
  {
    if (Lowercase(entry->path().extension().string()) == ".png")
    {
      files.push_back(entry->path().string());
    }
  }
  if (error)
  {
    throw FileError(vtkErrorCode::CannotOpenFileError, folder + ": the folder cannot be read: " + error.message());
  }
  std::sort(files.begin(), files.end());
  return files;
}

void ReadCsv(SequenceFile& file, InputFile& input, const ImageOptions& options)
{
  file.format = "CSV of poses";
  file.orientation = "MF";
  file.encoding = Encoding::Png;

  std::string line;
  input.ReadLine(line);
  if (line.rfind("\xef\xbb\xbf", 0) == 0)
  {
    line.erase(0, 3);  // a byte order mark
  }
  std::map<std::string, std::size_t> columns;
  const auto names = CsvCells(file, line);
  for (std::size_t i = 0; i < names.size(); ++i)
  {
    columns.emplace(Lowercase(names[i]), i);
  }
  const bool lastRow = columns.count("m30") || columns.count("m31") || columns.count("m32") || columns.count("m33");
  std::vector<std::size_t> matrix;
  for (int i = 0; i < (lastRow ? 16 : 12); ++i)
  {
    const std::string name = "m" + std::to_string(i / 4) + std::to_string(i % 4);
    const auto found = columns.find(name);
    if (found == columns.end())
    {
      Refuse(file, "has no column " + name + "; a pose takes m00 to m33, or m00 to m23 without the last row");
    }
    matrix.push_back(found->second);
  }
  const auto cell = [&columns](const std::vector<std::string>& cells, const char* name) -> const std::string*
  {
    const auto found = columns.find(name);
    return found == columns.end() ? nullptr : &cells[found->second];
  };

  std::vector<std::string> named;
  while (input.ReadLine(line))
  {
    if (Trimmed(line).empty() || line[0] == '#')
    {
      continue;
    }
    const auto cells = CsvCells(file, line);
    const std::size_t row = file.frames.size();
    if (cells.size() != names.size())
    {
      Refuse(file, "row " + std::to_string(row) + " has " + std::to_string(cells.size()) + " cells, the header " +
                       std::to_string(names.size()));
    }
    if (static_cast<std::int64_t>(row) >= mostFrames || input.Position() > longestHeader)
    {
      Refuse(file, "has more than " + std::to_string(mostFrames) + " rows or 256 MiB");
    }
    Fields fields;
    std::string& pose = fields["ImageToReferenceTransform"];
    for (const std::size_t column : matrix)
    {
      pose += cells[column] + " ";
    }
    if (!lastRow)
    {
      pose += "0 0 0 1";
    }
    const std::string* status = cell(cells, "status");
    fields["ImageToReferenceTransformStatus"] = status ? *status : "OK";
    if (const std::string* timestamp = cell(cells, "timestamp"))
    {
      fields["Timestamp"] = *timestamp;
    }
    std::array<int, 2> size = {0, 0};
    for (int side = 0; side < 2; ++side)
    {
      const char* const name = side == 0 ? "width" : "height";
      const std::string* text = cell(cells, name);
      std::int64_t pixels = 0;
      if (text && (!ParseNumber(*text, pixels) || pixels < 1 || pixels > largestSide))
      {
        Refuse(file, "row " + std::to_string(row) + " has " + name + " " + Quoted(*text) + "; 1 to " +
                         std::to_string(largestSide) + " pixels are expected");
      }
      size[static_cast<std::size_t>(side)] = static_cast<int>(pixels);
    }
    file.sizes.push_back(size);
    const std::string* image = cell(cells, "image");
    named.push_back(image ? *image : "");
    file.frames.push_back(std::move(fields));
  }
  if (file.frames.empty())
  {
    throw TruncationError(file.fileName + ": has a header line but no poses");
  }
  file.numberOfFrames = static_cast<int>(file.frames.size());

  const std::string folder = options.folder.empty() ? FolderOf(file.fileName) : options.folder;
  if (!options.pattern.empty())
  {
    for (int frame = 0; frame < file.numberOfFrames; ++frame)
    {
      file.images.push_back((std::filesystem::path(folder) / ImageName(file, options.pattern, frame)).string());
    }
  }
  else if (columns.count("image"))
  {
    for (const std::string& name : named)
    {
      file.images.push_back(CompanionFile(file.fileName, folder, name));
    }
  }
  else if (options.wanted && !options.folder.empty())
  {
    file.images = PngFilesOf(folder);
    if (file.images.size() != file.frames.size())
    {
      Refuse(file, "has " + std::to_string(file.frames.size()) + " poses, but " + folder + " has " +
                       std::to_string(file.images.size()) + " PNG files");
    }
  }
  else if (options.wanted)
  {
    Refuse(file, "has no column image; add one, or give an image folder or pattern");
  }
  if (options.wanted)
  {
    const PngHeader first = ReadPngHeader(file.images[0]);
    file.width = first.width;
    file.height = first.height;
    file.elementType = first.elementType;
  }
  else if (!file.images.empty() && !columns.count("width") && !columns.count("height"))
  {
    for (std::size_t row = 0; row < file.images.size(); ++row)
    {
      const PngHeader header = ReadPngHeader(file.images[row]);
      file.sizes[row] = {header.width, header.height};
    }
  }
}

// --- A plain image
// ------------------------------------------------------------------------------------------------

void ReadPlainPng(SequenceFile& file)
{
  const PngHeader header = ReadPngHeader(file.fileName);
  file.format = "PNG image";
  file.orientation = "MF";
  file.encoding = Encoding::Png;
  file.width = header.width;
  file.height = header.height;
  file.elementType = header.elementType;
  file.numberOfFrames = 1;
  file.images = {file.fileName};
  file.frames.resize(1);
}

bool LooksLikePng(const std::string& beginning)
{
  return beginning.rfind("\x89PNG", 0) == 0;
}

bool LooksLikeMetaImage(const std::string& beginning)
{
  const std::string key(Trimmed(std::string_view(beginning).substr(0, beginning.find('='))));
  return beginning.find('=') != std::string::npos &&
         (key == "ObjectType" || key == "NDims" || key == "Comment" || key == "ObjectSubType");
}

bool LooksLikeCsv(const std::string& beginning)
{
  const std::string line = Lowercase(std::string_view(beginning).substr(0, beginning.find_first_of("\r\n")));
  return line.find("m00") != std::string::npos && line.find(',') != std::string::npos;
}

}  // namespace

std::size_t BytesPerElement(ElementType type)
{
  return type == ElementType::UInt8 ? 1 : type == ElementType::UInt16 ? 2 : 4;
}

const char* NameOf(ElementType type)
{
  return type == ElementType::UInt8 ? "unsigned char" : type == ElementType::UInt16 ? "unsigned short" : "float";
}

const char* NameOf(Encoding encoding)
{
  switch (encoding)
  {
    case Encoding::Raw:
      return "raw";
    case Encoding::Zlib:
      return "zlib";
    case Encoding::Gzip:
      return "gzip";
    default:
      return "png";
  }
}

bool LooksLikeSequence(const std::string& beginning, bool plain)
{
  return LooksLikeMetaImage(beginning) || beginning.rfind("NRRD000", 0) == 0 || LooksLikeCsv(beginning) ||
         (plain && LooksLikePng(beginning));
}

SequenceFile ReadSequenceFile(const std::string& fileName, const ImageOptions& images)
{
  InputFile input(fileName);
  if (input.Size() == 0)
  {
    throw TruncationError(fileName + ": the file is empty");
  }
  SequenceFile file;
  file.fileName = fileName;
  const std::string beginning = FileBeginning(fileName, 4096);
  if (beginning.rfind("NRRD000", 0) == 0)
  {
    ReadNrrdHeader(file, input, images.plain);
  }
  else if (LooksLikeMetaImage(beginning))
  {
    ReadMetaImageHeader(file, input);
  }
  else if (LooksLikeCsv(beginning))
  {
    ReadCsv(file, input, images);
  }
  else if (images.plain && LooksLikePng(beginning))
  {
    ReadPlainPng(file);
  }
  else
  {
    throw FileError(vtkErrorCode::UnrecognizedFileTypeError,
                    fileName +
                        (images.plain ? ": neither a MetaImage (.mha, .mhd), an NRRD, a PNG image, nor a CSV of "
                                      : ": neither a MetaImage sequence (.igs.mha, .mha, .mhd), an NRRD sequence, "
                                        "nor a CSV of ") +
                        "poses with columns m00 to m33");
  }
  return file;
}

}  // namespace bigus
