// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/LabelFile.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <numeric>
#include <string_view>

#include "IO/FileError.h"
#include "IO/Formats/PngFile.h"
#include "IO/SequenceFrames.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

/// The last number in a name; negative without one.
int NumberIn(const std::string& name)
{
  const auto isDigit = [](unsigned char c) { return std::isdigit(c) != 0; };
  const auto last = std::find_if(name.rbegin(), name.rend(), isDigit);
  const auto first = std::find_if_not(last, name.rend(), isDigit);
  std::int64_t number = -1;
  return ParseNumber(std::string(first.base(), last.base()), number) && number <= mostFrames ? static_cast<int>(number)
                                                                                             : -1;
}

/// A folder's PNG images as one sequence.
SequenceFile FolderOfPictures(const std::string& path, std::vector<int>& numbers)
{
  SequenceFile file;
  file.fileName = path;
  file.encoding = Encoding::Png;
  for (const auto& entry : std::filesystem::directory_iterator(path))
  {
    if (Lowercase(entry.path().extension().string()) == ".png")
    {
      file.images.push_back(entry.path().string());
    }
  }
  Require(FileFault::NotFound, !file.images.empty(), path,
          ": has no PNG image; give a folder with one for each labelled frame");
  std::sort(file.images.begin(), file.images.end(), InNaturalOrder);
  const PngHeader first = ReadPngHeader(file.images[0]);
  file.width = first.width;
  file.height = first.height;
  file.elementType = first.elementType;
  file.numberOfFrames = static_cast<int>(file.images.size());
  for (const std::string& image : file.images)
  {
    RequirePng(image, first);
    numbers.push_back(NumberIn(std::filesystem::path(image).stem().string()));
  }
  return file;
}

std::string Field(const SequenceFile& file, const std::string& name)
{
  const auto found = file.fields.find(name);
  return found == file.fields.end() ? std::string() : found->second;
}

/// What Slicer calls a segment.
struct Segment
{
  Label label;
  std::int64_t value = 0, layer = 0;  // in the file
};

/// Segment0_LabelValue, _Name, _Color and _Layer. Values of several layers may be the same, so segments are counted there.
std::vector<Segment> SegmentsOf(const SequenceFile& file)
{
  std::vector<Segment> segments;
  for (int k = 0; k < kLargestLabel; ++k)
  {
    const std::string name = "Segment" + std::to_string(k) + "_";
    Segment segment;
    if (!ParseNumber(Field(file, name + "LabelValue"), segment.value))
    {
      continue;
    }
    ParseNumber(Field(file, name + "Layer"), segment.layer);
    Label& label = segment.label;
    label.name = Printable(Field(file, name + "Name"));
    label.name = label.name.empty() ? "Label " + std::to_string(segment.value) : label.name;
    if (segment.layer < 0 || segment.layer >= file.layers)
    {
      throw FormatError(file.fileName + ": the segment " + Quoted(label.name) + " is in layer " +
                        std::to_string(segment.layer) + ", and there are " + std::to_string(file.layers));
    }
    label.value = file.layers > 1 ? static_cast<int>(segments.size()) + 1
                                  : static_cast<int>(std::clamp<std::int64_t>(segment.value, 0, kLargestLabel + 1));
    if (!ParseNumbers(Field(file, name + "Color"), 3, label.color.data()))
    {
      label.color = UsualColor(label.value);
    }
    segments.push_back(segment);
  }
  return segments;
}

std::vector<Label> LabelsOf(const SequenceFile& file, const std::vector<Segment>& segments)
{
  std::vector<Label> labels;
  std::transform(segments.begin(), segments.end(), std::back_inserter(labels),
                 [](const Segment& segment) { return segment.label; });
  std::sort(labels.begin(), labels.end(), [](const Label& a, const Label& b) { return a.value < b.value; });
  try
  {
    ValidateLabels(labels);
  }
  catch (const Error& error)
  {
    throw FormatError(file.fileName + ": " + error.what());
  }
  return labels;
}

/// One picture of several layers, pixels [pictures][height][width][layers]: what lies in two is the later segment's, as Slicer
/// draws it over the other.
std::vector<std::uint8_t> Flattened(const SequenceFile& file, const std::vector<Segment>& segments,
                                    const std::vector<std::uint8_t>& pixels)
{
  RequireFormat(!file.flipColumns, file.fileName,
                ": has layers of pictures that are not in marked-far order; save them as volumes");
  const auto layers = static_cast<std::size_t>(file.layers);
  std::vector<std::uint8_t> valueOf(layers * (kLargestLabel + 1), 0), flat(pixels.size() / layers, 0);
  for (const Segment& segment : segments)
  {
    valueOf.at(static_cast<std::size_t>(segment.layer * (kLargestLabel + 1) +
                                        std::clamp<std::int64_t>(segment.value, 0, kLargestLabel))) =
        static_cast<std::uint8_t>(segment.label.value);
  }
  for (std::size_t at = 0; at < pixels.size(); ++at)
  {
    const std::uint8_t value = pixels[at] ? valueOf[at % layers * (kLargestLabel + 1) + pixels[at]] : 0;
    if (pixels[at] && !value)
    {
      throw FormatError(file.fileName + ": layer " + std::to_string(at % layers) + " has the label " +
                        std::to_string(pixels[at]) + ", which no segment names");
    }
    flat[at / layers] = std::max(flat[at / layers], value);
  }
  return flat;
}

/// A segmentation may be stored without its empty border; then it says where its first voxel lies in the reference volume.
std::optional<std::array<int, 3>> PlaceOf(const SequenceFile& file, std::size_t mostPictures)
{
  const std::string name = "Segmentation_ReferenceImageExtentOffset";
  if (file.fields.count(name) == 0)
  {
    return std::nullopt;
  }
  const std::string text = Field(file, name);
  const std::vector<std::string_view> words = Words(text);
  const std::int64_t sizes[3] = {file.width / file.layers, file.height, file.numberOfFrames};
  const std::int64_t most[3] = {largestSide, largestSide, static_cast<std::int64_t>(mostPictures)};
  std::array<int, 3> place{};
  for (std::size_t k = 0; k < 3; ++k)
  {
    std::int64_t first = 0;
    RequireFormat(words.size() == 3 && ParseNumber(words[k], first), file.fileName, ": ", name, ": ", Quoted(text),
                  " is not three whole numbers");
    RequireFormat(first >= 0 && first <= most[k] - sizes[k], file.fileName, ": ", name, ": ", Quoted(text), " puts ",
                  sizes[0], " x ", sizes[1], " x ", sizes[2], " voxels outside of ", most[2],
                  " pictures; save labels that were drawn on this sweep");
    place[k] = static_cast<int>(first);
  }
  RequireFormat(!file.flipColumns && !file.flipRows, file.fileName, ": ", name,
                " is not read of pictures in the orientation ", Quoted(file.orientation),
                "; save them in marked-far order (MF)");
  return place;
}

}  // namespace

LabelPictures ReadLabelPictures(const std::string& path, std::size_t mostPictures)
{
  LabelPictures pictures;
  std::vector<int> numbers;
  const SequenceFile file = std::filesystem::is_directory(path) ? FolderOfPictures(path, numbers)
                                                                : ReadSequenceFile(path, {true, true, true, {}, {}});
  const auto count = static_cast<std::size_t>(file.numberOfFrames);
  RequireFormat(count <= mostPictures, path, ": has ", count, " pictures, and the sweep has ", mostPictures,
                " frames; there is at most one for each");
  RequireFormat(file.elementType != ElementType::Float32, path,
                ": pixels are of type float; labels are whole numbers from 0 (none) to 255");
  pictures.place = PlaceOf(file, mostPictures);
  PoseTable poses;
  poses.frames.resize(count);
  std::vector<int> all(count);
  std::iota(all.begin(), all.end(), 0);
  const std::size_t pixels = count * file.width * file.height;
  std::vector<unsigned char> bytes(pixels * BytesPerElement(file.elementType));
  ReadPixels read;
  // 65535: pixels stay as they are.
  ReadFrames(
      file, poses, all, {}, file.elementType == ElementType::UInt16 ? 65535 : 0, [](double) { return true; },
      bytes.data(), read);
  const std::vector<Segment> segments = SegmentsOf(file);
  pictures.width = file.width / file.layers;
  pictures.height = file.height;
  pictures.labels = LabelsOf(file, segments);
  pictures.isNumbered = !numbers.empty() && *std::min_element(numbers.begin(), numbers.end()) >= 0;
  pictures.numbers = pictures.isNumbered ? numbers : all;
  pictures.pixels.resize(pixels);
  for (std::size_t p = 0; p < pixels; ++p)
  {
    std::uint16_t value = bytes[p];
    if (file.elementType == ElementType::UInt16)
    {
      std::memcpy(&value, &bytes[2 * p], 2);
    }
    if (value > kLargestLabel)
    {
      throw FormatError(path + ": has the label " + std::to_string(value) + "; labels from 1 to 255 are read");
    }
    pictures.pixels[p] = static_cast<std::uint8_t>(value);
  }
  if (file.layers > 1)
  {
    pictures.pixels = Flattened(file, segments, pictures.pixels);
  }
  return pictures;
}

}  // namespace bigus
