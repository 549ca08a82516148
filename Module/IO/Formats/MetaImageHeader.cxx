// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <string_view>

#include "IO/FileError.h"
#include "IO/Formats/HeaderFields.h"
#include "IO/Formats/SequenceHeaders.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

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

void ReadFields(SequenceFile& file, InputFile& input, FieldCollector& collected)
{
  std::string line;
  bool complete = false;
  while (!complete && input.ReadLine(line))
  {
    RequireHeader(file, input.Position() <= longestHeader, "the header is longer than 256 MiB");
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
  Require(FileFault::Truncated, complete, file.fileName,
          ": the header ends before ElementDataFile; the file is truncated");
  file.fields = std::move(collected.fields);
}

/// Width, height and frames.
void SetAxes(SequenceFile& file)
{
  auto sizes = RequireSizes(file, "DimSize", Require(file, file.fields, "DimSize"));
  std::int64_t dimensions = 0;
  const std::string& nDims = Require(file, file.fields, "NDims");
  RequireHeader(file, ParseNumber(nDims, dimensions) && dimensions == static_cast<std::int64_t>(sizes.size()),
                "NDims = ", Quoted(nDims), ", but DimSize has ", sizes.size(), " numbers");
  if (sizes.size() == 4 && sizes[2] == 1)
  {
    sizes.erase(sizes.begin() + 2);
  }
  if (sizes.size() == 2)
  {
    sizes.push_back(1);
  }
  RequireHeader(file, sizes.size() == 3, "DimSize = ", Quoted(file.fields["DimSize"]),
                "; a sequence of single-slice frames (width height frames) is expected");
  SetSizes(file, sizes[0], sizes[1], sizes[2]);
}

/// The type of an element and how many of them a pixel has.
void SetType(SequenceFile& file)
{
  const std::string& type = Require(file, file.fields, "ElementType");
  if (type == "MET_UCHAR")
  {
    file.elementType = ElementType::UInt8;
  }
  else if (type == "MET_USHORT" || type == "MET_SHORT")
  {
    file.elementType = ElementType::UInt16;
    file.isSigned = type == "MET_SHORT";
  }
  else if (type == "MET_FLOAT")
  {
    file.elementType = ElementType::Float32;
  }
  else
  {
    Refuse(file, "ElementType = " + Quoted(type) + "; MET_UCHAR, MET_USHORT, MET_SHORT and MET_FLOAT are read");
  }
  if (const std::string* text = Find(file.fields, "ElementNumberOfChannels"))
  {
    std::int64_t channels = 0;
    RequireHeader(file, ParseNumber(*text, channels), "ElementNumberOfChannels = ", Quoted(*text),
                  "; a whole number is expected");
    SetChannels(file, channels);
  }
}

void SetCoding(SequenceFile& file)
{
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
}

/// Where the pixels lie. The header ends at byte `end` of its file.
void SetData(SequenceFile& file, std::uint64_t end)
{
  const std::string& dataFile = Require(file, file.fields, "ElementDataFile");
  if (dataFile == "LOCAL")
  {
    file.dataFile = file.fileName;
    file.dataOffset = end;
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
    RequireHeader(file, ParseNumber(*text, bytes) && bytes >= 1, "CompressedDataSize = ", Quoted(*text),
                  "; a positive whole number is expected");
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
      const std::uint64_t needed = file.PixelBytesInFile();
      file.dataOffset = size > needed ? size - needed : 0;
    }
    else
    {
      file.dataOffset = static_cast<std::uint64_t>(bytes);
    }
  }
}

/// Of the file, or of the first frame that has a size of its own where the file has none but 1.
void TakeSpacing(SequenceFile& file)
{
  const auto take = [&file](const Fields& fields, const std::string& name)
  {
    const std::string* text = Find(fields, name);
    const std::vector<std::string_view> words = text ? Words(*text) : std::vector<std::string_view>();
    double sides[2] = {0, 0};
    if (words.size() >= 2 && ParseNumber(words[0], sides[0]) && ParseNumber(words[1], sides[1]))
    {
      SetSpacing(file, name, sides[0], sides[1]);
    }
  };
  take(file.fields, "ElementSize");
  take(file.fields, "ElementSpacing");
  for (std::size_t frame = 0; frame < file.frames.size() && (file.spacing[0] == 0 || file.spacing[0] == 1); ++frame)
  {
    take(file.frames[frame], "ElementSpacing");
  }
}

}  // namespace

bool LooksLikeMetaImage(const std::string& beginning)
{
  const std::string key(Trimmed(std::string_view(beginning).substr(0, beginning.find('='))));
  return beginning.find('=') != std::string::npos &&
         (key == "ObjectType" || key == "NDims" || key == "Comment" || key == "ObjectSubType");
}

void ReadMetaImageHeader(SequenceFile& file, InputFile& input)
{
  file.format = "MetaImage sequence";
  FieldCollector collected;
  ReadFields(file, input, collected);
  if (const std::string* type = Find(file.fields, "ObjectType"); type && *type != "Image")
  {
    Refuse(file, "ObjectType = " + Quoted(*type) + "; only Image is read");
  }
  SetAxes(file);
  SetType(file);
  SetCoding(file);
  SetData(file, input.Position());
  FinishHeader(file, collected);
  TakeSpacing(file);
}

}  // namespace bigus
