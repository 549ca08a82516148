// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusLabelReader.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <numeric>
#include <regex>

#include "Data/Arrays.h"
#include "Data/LabelData.h"
#include "IO/FileError.h"
#include "IO/Formats/PngFile.h"
#include "IO/SequenceFrames.h"
#include "IO/Text.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkObjectFactory.h"

vtkStandardNewMacro(vtkBigusLabelReader);

namespace bigus
{
namespace
{

/// A folder's PNG images as one sequence.
SequenceFile FolderOfPictures(const std::string& path)
{
  const std::vector<std::string> images = PngFilesOf(path);
  Require(FileFault::NotFound, !images.empty(), path,
          ": has no PNG image; give a folder with one for each labelled frame");
  SequenceFile file = ReadSequenceFile(images[0], {true, true, false, {}, {}});
  for (const std::string& image : images)
  {
    RequirePng(image, {file.width, file.height, file.elementType, file.channels});
  }
  file.fileName = path;
  file.images = images;
  file.numberOfFrames = static_cast<int>(images.size());
  return file;
}

std::string Field(const SequenceFile& file, const std::string& name)
{
  const auto found = file.fields.find(name);
  return found == file.fields.end() ? std::string() : found->second;
}

/// The label of each value in a layer of the file; 0: none.
using LabelOfValue = std::array<std::uint8_t, kLargestLabel + 1>;

/// What Slicer calls segments: Segment0_LabelValue, _Name, _Color and _Layer. Where there are several layers, `of` [layers]
/// gets their labels, which count segments, since values of two layers may be the same. Else labels are the values.
std::vector<Label> SegmentsOf(const SequenceFile& file, std::vector<LabelOfValue>& of)
{
  of.assign(static_cast<std::size_t>(file.layers), {0});
  std::vector<Label> labels;
  for (int k = 0; k < kLargestLabel; ++k)
  {
    const std::string name = "Segment" + std::to_string(k) + "_";
    std::int64_t value = 0, layer = 0;
    if (!ParseNumber(Field(file, name + "LabelValue"), value))
    {
      continue;
    }
    ParseNumber(Field(file, name + "Layer"), layer);
    Label label;
    label.name = Printable(Field(file, name + "Name"));
    label.name = label.name.empty() ? "Label " + std::to_string(value) : label.name;
    RequireFormat(value > 0 && value <= kLargestLabel, file.fileName, ": the segment ", Quoted(label.name),
                  " has the value ", value, "; labels from 1 to 255 are read");
    RequireFormat(layer >= 0 && layer < file.layers, file.fileName, ": the segment ", Quoted(label.name),
                  " is in layer ", layer, ", and there are ", file.layers);
    RequireFormat(of[layer][value] == 0, file.fileName, ": two segments have the value ", value);
    label.value = static_cast<int>(file.layers > 1 ? labels.size() + 1 : value);
    const bool isColored = ParseNumbers(Field(file, name + "Color"), 3, label.color.data());
    const auto [least, most] = std::minmax_element(label.color.begin(), label.color.end());
    label.color = isColored && *least >= 0 && *most <= 1 ? label.color : UsualColor(label.value);
    of[layer][value] = static_cast<std::uint8_t>(label.value);
    labels.push_back(label);
  }
  if (file.layers == 1)
  {
    std::iota(of[0].begin(), of[0].end(), std::uint8_t(0));  // those without a name, too
  }
  std::sort(labels.begin(), labels.end(), [](const Label& a, const Label& b) { return a.value < b.value; });
  return labels;
}

/// One picture after another of what the file holds. What lies in two layers is the later segment's, as Slicer draws it
/// over the other.
void Flatten(const SequenceFile& file, const std::vector<LabelOfValue>& of, const std::vector<unsigned char>& bytes,
             unsigned char* pixels)
{
  const std::size_t size = BytesPerElement(file.elementType);
  for (std::size_t at = 0; at < bytes.size() / size; ++at)
  {
    std::uint16_t value = bytes[at];
    if (size == sizeof(value))
    {
      std::memcpy(&value, &bytes[at * size], size);
    }
    RequireFormat(value <= kLargestLabel, file.fileName, ": has the label ", value, "; labels from 1 to 255 are read");
    const std::size_t layer = at % of.size();
    const std::uint8_t label = of[layer][value];
    RequireFormat(label > 0 || value == 0, file.fileName, ": layer ", layer, " has the label ", value,
                  ", which no segment names");
    std::uint8_t& pixel = pixels[at / of.size()];
    pixel = layer == 0 ? label : std::max(pixel, label);
  }
}

/// The pixels of all pictures as the file holds them, which are whole numbers.
std::vector<unsigned char> ReadElements(const SequenceFile& file)
{
  RequireFormat(file.elementType != ElementType::Float32, file.fileName,
                ": pixels are of type float; labels are whole numbers from 0 (none) to 255");
  RequireFormat(file.layers == 1 || !file.flipColumns, file.fileName,
                ": has layers of pictures that are not in marked-far order; save them as volumes");
  const auto count = static_cast<std::size_t>(file.numberOfFrames);
  std::vector<unsigned char> bytes(count * file.FrameBytes());
  PoseTable poses;
  poses.frames.resize(count);
  std::vector<int> all(count);
  std::iota(all.begin(), all.end(), 0);
  const double range = file.elementType == ElementType::UInt16 ? 65535 : 0;  // pixels stay as they are
  ReadPixels read;
  ReadFrames(
      file, poses, all, {}, range, [](double) { return true; }, bytes.data(), read);
  return bytes;
}

/// A segmentation may be stored without its empty border; then it says where its first voxel lies in the whole one.
std::array<int, 3> FirstVoxelOf(const SequenceFile& file)
{
  const std::string name = "Segmentation_ReferenceImageExtentOffset", text = Field(file, name);
  std::array<int, 3> first{};
  const std::vector<std::string_view> words = Words(text);
  for (std::size_t k = 0; file.fields.count(name) > 0 && k < first.size(); ++k)
  {
    std::int64_t number = 0;
    RequireFormat(words.size() == 3 && ParseNumber(words[k], number) && number >= 0 && number <= mostFrames,
                  file.fileName, ": ", name, ": ", Quoted(text), " is not three whole numbers from 0 to ", mostFrames);
    first[k] = static_cast<int>(number);
  }
  RequireFormat(first == std::array<int, 3>{} || (!file.flipColumns && !file.flipRows), file.fileName, ": ", name,
                " is not read of pictures in the orientation ", Quoted(file.orientation),
                "; save them in marked-far order (MF)");
  return first;
}

/// The last number in the name of each image; empty where a name has none.
std::vector<int> NumbersIn(const std::vector<std::string>& images)
{
  const std::regex last("([0-9]+)[^0-9]*$");
  std::vector<int> numbers;
  for (const std::string& image : images)
  {
    const std::string name = std::filesystem::path(image).stem().string();
    std::smatch found;
    std::int64_t number = 0;
    if (!std::regex_search(name, found, last) || !ParseNumber(found.str(1), number) || number > mostFrames)
    {
      return {};
    }
    numbers.push_back(static_cast<int>(number));
  }
  return numbers;
}

void ReadLabels(const std::string& path, vtkImageData* output)
{
  const bool isFolder = std::filesystem::is_directory(path);
  const SequenceFile file = isFolder ? FolderOfPictures(path) : ReadSequenceFile(path, {true, true, true, {}, {}});
  const std::vector<unsigned char> bytes = ReadElements(file);
  std::vector<LabelOfValue> of;
  const std::vector<Label> labels = SegmentsOf(file, of);
  const auto [column, row, picture] = FirstVoxelOf(file);
  output->SetExtent(column, column + file.width / file.layers - 1, row, row + file.height - 1, picture,
                    picture + file.numberOfFrames - 1);
  output->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  Flatten(file, of, bytes, static_cast<unsigned char*>(output->GetScalarPointer()));
  if (const std::vector<int> numbers = NumbersIn(file.images); isFolder && !numbers.empty())
  {
    const auto source = NewArray<vtkIntArray>("SourceFrame", 1, file.numberOfFrames);
    std::copy(numbers.begin(), numbers.end(), source->GetPointer(0));
    output->GetFieldData()->AddArray(source);
  }
  if (!labels.empty())
  {
    ReplaceLabelNames(output, labels);
  }
}

}  // namespace
}  // namespace bigus

vtkImageData* vtkBigusLabelReader::GetOutput()
{
  return vtkImageData::SafeDownCast(this->GetOutputDataObject(0));
}

int vtkBigusLabelReader::FillOutputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkDataObject::DATA_TYPE_NAME(), "vtkImageData");
  return 1;
}

int vtkBigusLabelReader::RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputVector)
{
  vtkImageData* const output = vtkImageData::GetData(outputVector, 0);
  output->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    bigus::ReadLabels(this->RequireFileName(), output);
    return 1;
  }
  catch (const std::exception& error)
  {
    output->Initialize();
    return this->Fail(error);
  }
}
