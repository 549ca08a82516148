// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/UnusedFields.h"

#include <map>
#include <set>
#include <string_view>

#include "IO/Text.h"

namespace bigus
{
namespace
{

/// Fields of MetaImage, NRRD and IGSIO that hold words of the format, or numbers that describe the grid of pixels. Those that
/// hold free text, such as Comment and content, are not among them.
const std::set<std::string_view>& FieldsOfFormats()
{
  static const std::set<std::string_view> names = {
      // MetaImage
      "ObjectType", "NDims", "DimSize", "ElementType", "ElementNumberOfChannels", "ElementSpacing", "ElementSize",
      "ElementDataFile", "HeaderSize", "BinaryData", "BinaryDataByteOrderMSB", "ElementByteOrderMSB", "CompressedData",
      "CompressedDataSize", "TransformMatrix", "Rotation", "Orientation", "Offset", "Position", "Origin",
      "CenterOfRotation", "AnatomicalOrientation", "Kinds", "UltrasoundImageOrientation", "UltrasoundImageType",
      // NRRD
      "type", "dimension", "sizes", "kinds", "encoding", "endian", "data file", "datafile", "line skip", "lineskip",
      "byte skip", "byteskip", "space", "space dimension", "space directions", "space origin", "space units", "units",
      "spacings", "thicknesses", "centers", "centerings", "axis mins", "axismins", "axis maxs", "axismaxs",
      "measurement frame", "ultrasound image orientation", "ultrasound image type", "axis 0 index type",
      "axis 0 index values", "axis 3 index type", "axis 3 index values",
      // of a frame
      "Timestamp", "TimestampUnit", "ImageStatus", "Status"};
  return names;
}

/// Labels are free text, but for those of the axes of a sequence of 3D Slicer.
bool IsSlicersLabels(std::string_view name, std::string_view value)
{
  return name == "labels" && (value == "\"\" \"\" \"\" \"time\"" || value == "\"time\" \"\" \"\" \"\"");
}

}  // namespace

std::vector<UnusedField> UnusedFieldsOf(const SequenceFile& file, const std::vector<TransformName>& transforms)
{
  std::vector<UnusedField> found;
  if (!file.comments.empty())
  {
    found.push_back({"comment", Shortened(file.comments.front()), static_cast<int>(file.comments.size())});
  }
  for (const auto& [name, value] : file.otherColumns)
  {
    found.push_back({Shortened(name), Shortened(value), file.numberOfFrames});
  }
  std::set<std::string> ofTransforms;
  for (const TransformName& transform : transforms)
  {
    ofTransforms.insert(transform.Name() + "Transform");
    ofTransforms.insert(transform.Name() + "TransformStatus");
  }
  std::map<std::string, UnusedField> byName;
  const auto add = [&](const Fields& fields)
  {
    for (const auto& [name, value] : fields)
    {
      if (FieldsOfFormats().count(name) != 0 || ofTransforms.count(name) != 0 || IsSlicersLabels(name, value))
      {
        continue;
      }
      if (const auto known = byName.find(name); known != byName.end())
      {
        ++known->second.count;
        continue;
      }
      byName.emplace(name, UnusedField{Shortened(name), Shortened(value), 1});
    }
  };
  add(file.fields);
  for (const Fields& frame : file.frames)
  {
    add(frame);
  }
  for (auto& [name, field] : byName)
  {
    found.push_back(std::move(field));
  }
  return found;
}

}  // namespace bigus
