// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Small files with known content, for tests of readers.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "vtk_zlib.h"

namespace bigus::test
{

inline void WriteBytes(const std::string& fileName, const std::string& bytes)
{
  std::filesystem::remove(fileName);  // some file systems flush a file that is truncated and written anew
  std::ofstream(fileName, std::ios::binary) << bytes;
}

inline std::string ReadBytes(const std::string& fileName)
{
  std::ifstream stream(fileName, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// zlib (gzip = false) or gzip bytes.
inline std::string Compressed(const std::string& bytes, bool gzip = false)
{
  z_stream zlib = {};
  deflateInit2(&zlib, 6, Z_DEFLATED, gzip ? 15 + 16 : 15, 8, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&zlib, bytes.size()) + 64, '\0');
  zlib.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  zlib.avail_in = static_cast<uInt>(bytes.size());
  zlib.next_out = reinterpret_cast<Bytef*>(out.data());
  zlib.avail_out = static_cast<uInt>(out.size());
  deflate(&zlib, Z_FINISH);
  out.resize(zlib.total_out);
  deflateEnd(&zlib);
  return out;
}

/// A MetaImage sequence under construction: fields in order, then pixels.
struct Sequence
{
  std::vector<std::pair<std::string, std::string>> fields;
  std::string pixels;

  void Set(const std::string& name, const std::string& value)
  {
    for (auto& field : fields)
    {
      if (field.first == name)
      {
        field.second = value;
        return;
      }
    }
    fields.insert(fields.end() - 1, {name, value});  // ElementDataFile stays last
  }
  void Remove(const std::string& name)
  {
    for (auto field = fields.begin(); field != fields.end(); ++field)
    {
      if (field->first == name)
      {
        fields.erase(field);
        return;
      }
    }
  }
  std::string Header() const
  {
    std::string header;
    for (const auto& field : fields)
    {
      header += field.first + " = " + field.second + "\n";
    }
    return header;
  }
  std::string Bytes() const { return Header() + pixels; }

  /// The same with IGSIO's NRRD header.
  std::string NrrdBytes(const std::string& sizes, const std::string& kinds, const std::string& encoding,
                        const std::string& data) const
  {
    std::string header = "NRRD0004\n# a comment\ntype: unsigned char\ndimension: 3\nsizes: " + sizes +
                         "\nkinds: " + kinds + "\nencoding: " + encoding + "\n";
    for (const auto& field : fields)
    {
      if (field.first.rfind("Seq_", 0) == 0 || field.first.find("ltrasound") == 1)
      {
        header += field.first + ":=" + field.second + "\n";
      }
    }
    return header + "\n" + data;
  }
};

constexpr int smallWidth = 4;
constexpr int smallHeight = 3;
constexpr int smallFrames = 3;

/// The pixel that SmallSequence has at column i, row j of a frame; never 0.
inline std::uint8_t SmallPixel(int i, int j, int frame)
{
  return static_cast<std::uint8_t>(1 + i + 10 * j + 50 * frame);
}

/// The element at row r, column c of the pose that SmallSequence gives a frame: 0.2 and 0.3 mm a pixel, 10 mm
/// apart.
inline double SmallPose(int r, int c, int frame)
{
  const double pose[16] = {0.2, 0, 0, 10.0 * frame, 0, 0.3, 0, 5, 0, 0, 1, -7.125, 0, 0, 0, 1};
  return pose[4 * r + c];
}

inline std::string SmallPoseText(int frame)
{
  return "0.2 0 0 " + std::to_string(10 * frame) + " 0 0.3 0 5 0 0 1 -7.125 0 0 0 1";
}

inline std::string SmallField(int frame, const std::string& name)
{
  return "Seq_Frame000" + std::to_string(frame) + "_" + name;
}

/// 4 x 3 pixels, 3 frames, raw unsigned char, marked-far, ImageToReference at every frame.
inline Sequence SmallSequence()
{
  Sequence sequence;
  sequence.fields = {{"ObjectType", "Image"},
                     {"NDims", "3"},
                     {"BinaryData", "True"},
                     {"BinaryDataByteOrderMSB", "False"},
                     {"CompressedData", "False"},
                     {"DimSize", "4 3 3"},
                     {"Kinds", "domain domain list"},
                     {"ElementSpacing", "1 1 1"},
                     {"ElementType", "MET_UCHAR"},
                     {"UltrasoundImageOrientation", "MF"},
                     {"UltrasoundImageType", "BRIGHTNESS"},
                     {"ElementDataFile", "LOCAL"}};
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    sequence.Set(SmallField(frame, "ImageToReferenceTransform"), SmallPoseText(frame));
    sequence.Set(SmallField(frame, "ImageToReferenceTransformStatus"), "OK");
    sequence.Set(SmallField(frame, "Timestamp"), std::to_string(frame) + ".25");
    sequence.Set(SmallField(frame, "ImageStatus"), "OK");
    for (int j = 0; j < smallHeight; ++j)
    {
      for (int i = 0; i < smallWidth; ++i)
      {
        sequence.pixels += static_cast<char>(SmallPixel(i, j, frame));
      }
    }
  }
  return sequence;
}

/// The pixels of SmallSequence as a volume: no poses.
inline Sequence SmallVolume()
{
  Sequence volume = SmallSequence();
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    for (const char* name :
         {"ImageToReferenceTransform", "ImageToReferenceTransformStatus", "Timestamp", "ImageStatus"})
    {
      volume.Remove(SmallField(frame, name));
    }
  }
  for (const char* name : {"Kinds", "UltrasoundImageOrientation", "UltrasoundImageType"})
  {
    volume.Remove(name);
  }
  return volume;
}

/// SmallSequence without pixels as a CSV of poses; `image` names come from the pattern frame_N.png.
inline std::string SmallCsv(bool images)
{
  std::string csv = images ? "image,timestamp" : "timestamp";
  for (int c = 0; c < 16; ++c)
  {
    csv += ",m" + std::to_string(c / 4) + std::to_string(c % 4);
  }
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    csv += "\n" + (images ? "frame_" + std::to_string(frame) + ".png," : std::string()) + std::to_string(frame) + ".25";
    std::string pose = SmallPoseText(frame);
    for (char& c : pose)
    {
      c = c == ' ' ? ',' : c;
    }
    csv += "," + pose;
  }
  return csv + "\n";
}

/// A 3D Slicer plane: 8 x 4 mm about (1, 2, 3) LPS, its axes along x and z.
inline std::string SmallMarkup()
{
  return R"({"@schema": "markups", "markups": [{"type": "Fiducial"}, {"type": "Plane", "coordinateSystem": "LPS",
  "coordinateUnits": "mm", "center": [1.0, 2.0, 3.0], "normal": [0, -1, 0],
  "orientation": [1, 0, 0, 0, 0, -1, 0, 1, 0], "size": [8.0, 4.0, 0.0]}]})";
}

/// A Plus configuration with an ImageToProbe and a singular transform.
inline std::string SmallConfig()
{
  return R"(<PlusConfiguration version="2.1"><CoordinateDefinitions>
    <Transform From="Image" To="Probe" Matrix="0 2 0 1
       -2 0 0 2   0 0 2 3   0 0 0 1" Error="0" Date="x"/>
    <Transform From="Flat" To="Reference" Matrix="1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1"/>
  </CoordinateDefinitions></PlusConfiguration>)";
}

}  // namespace bigus::test
