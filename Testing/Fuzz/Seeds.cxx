// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// fuzz-seeds FOLDER: writes FOLDER/TARGET/NAME, small files from which fuzzing starts: sound ones of every kind, and
// headers of the kinds that other readers of these formats are known to have crashed on.
#include "Fuzz/Seeds.h"

#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "Data/FieldData.h"
#include "Fuzz/Png.h"
#include "IO/SmallFiles.h"
#include "Support/SourceFolder.h"
#include "vtkBigusFieldWriter.h"
#include "vtkNew.h"
#include "vtkPolyData.h"

namespace bigus::fuzz
{
namespace
{

using test::Compressed;
using test::Sequence;
using test::SmallSequence;

std::filesystem::path root;

std::vector<void (*)()>& Writers()
{
  static std::vector<void (*)()> writers;
  return writers;
}

}  // namespace

void Seed(const std::string& target, const std::string& name, const std::string& bytes)
{
  std::filesystem::create_directories(root / target);
  test::WriteBytes((root / target / name).string(), bytes);
}

std::size_t AddSeeds(void (*write)())
{
  Writers().push_back(write);
  return Writers().size();
}

namespace
{

void MetaImages()
{
  const auto seed = [](const std::string& name, const std::string& bytes) { Seed("MetaImage", name, bytes); };
  const auto changed = [](const std::string& name, const std::string& value)
  {
    Sequence sequence = SmallSequence();
    sequence.Set(name, value);
    return sequence.Bytes();
  };
  seed("sequence", SmallSequence().Bytes());
  seed("volume", test::SmallVolume().Bytes());
  Sequence compressed = SmallSequence();
  compressed.Set("CompressedData", "True");
  compressed.pixels = Compressed(compressed.pixels);
  seed("zlib", compressed.Bytes());
  compressed.Set("CompressedDataSize", std::to_string(compressed.pixels.size()));
  seed("zlib-sized", compressed.Bytes());
  for (const auto& [type, bytes] : {std::pair("MET_USHORT", 2), {"MET_SHORT", 2}, {"MET_FLOAT", 4}})
  {
    Sequence sequence = SmallSequence();
    sequence.Set("ElementType", type);
    sequence.pixels.assign(std::size_t(36) * bytes, '\1');
    seed(type, sequence.Bytes());
    sequence.Set("BinaryDataByteOrderMSB", "True");
    seed(std::string(type) + "-msb", sequence.Bytes());
  }
  Sequence colour = SmallSequence();
  colour.Set("ElementNumberOfChannels", "3");
  colour.pixels.assign(108, '\7');
  seed("colour", colour.Bytes());
  seed("mirrored", changed("UltrasoundImageOrientation", "UN"));
  seed("inverse", changed("ReferenceToTrackerTransform", "0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1"));

  // Headers of the kinds that MetaIO is known to fail on (Kitware/MetaIO, issue 150 and change 141): counts beyond its
  // arrays of ten, fewer words than it takes, lists of slices, sizes that overflow or ask for gigabytes, an element type
  // that its buffer does not have, compressed data of no stated size.
  const std::pair<const char*, const char*> defects[] = {
      {"NDims", "11"},
      {"NDims", "-1"},
      {"NDims", "2147483647"},
      {"NDims", ""},
      {"DimSize", ""},
      {"DimSize", "4"},
      {"DimSize", "4 3 3 1 1 1 1 1 1 1 1 1"},
      {"DimSize", "-4 -3 3"},
      {"DimSize", "0 0 3"},
      {"DimSize", "65536 65536 65536"},
      {"DimSize", "30000 30000 20"},
      {"ElementNumberOfChannels", "-1"},
      {"ElementNumberOfChannels", "2000000000"},
      {"ElementType", "MET_DOUBLE"},
      {"ElementType", "MET_STRING"},
      {"ElementType", ""},
      {"ElementSpacing", "1"},
      {"TransformMatrix", "1 0"},
      {"Offset", ""},
      {"CompressedData", "True"},
      {"CompressedDataSize", "-1"},
      {"HeaderSize", "-2"},
      {"HeaderSize", "9223372036854775807"},
      {"BinaryData", "False"},
      {"ObjectType", "Tube"},
      {"Comment", "%s%s%s%n"},
  };
  int number = 0;
  for (const auto& [name, value] : defects)
  {
    seed("defect-" + std::to_string(number++) + "-" + name, changed(name, value));
  }
  for (const std::string file : {"LIST", "LIST -1", "LIST 3", "LIST 11\nslice0.raw\n", "slice%03d.raw 1 3 1",
                                 "slice%n%s.raw 1 3 1", "slice.raw 1 3", "", "../../etc/passwd", "Local"})
  {
    Sequence sequence = SmallSequence();
    sequence.fields.back().second = file;
    seed("defect-file-" + std::to_string(number++), sequence.Bytes());
  }
}

void Nrrds()
{
  const auto seed = [](const std::string& name, const std::string& bytes) { Seed("Nrrd", name, bytes); };
  const Sequence sequence = SmallSequence();
  seed("raw", sequence.NrrdBytes("4 3 3", "domain domain list", "raw", sequence.pixels));
  seed("gzip", sequence.NrrdBytes("4 3 3", "domain domain list", "gzip", Compressed(sequence.pixels, true)));
  seed("first", sequence.NrrdBytes("3 4 3", "list domain domain", "raw", sequence.pixels));
  seed("colour", sequence.NrrdBytes("3 4 3 1", "vector domain domain list", "raw", sequence.pixels));
  seed("volume", test::SmallVolume().NrrdBytes("4 3 3", "domain domain domain", "raw", sequence.pixels));
  seed("segments",
       "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 4 3 3\nkinds: list domain domain domain\nencoding: raw\n"
       "Segment0_LabelValue:=1\nSegment0_Layer:=1\nSegment0_Name:=vein\nSegment0_Color:=1 0 0\n\n" +
           std::string(66, '\0') + std::string("\0\1\0\0\0\1", 6));
  // NrrdIO parses one number more than its arrays of 16 hold.
  const std::string ones = " 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1";
  seed("defect-17-sizes", "NRRD0004\ntype: uchar\ndimension: 16\nsizes: 1" + ones + "\nencoding: raw\n\n1");
  seed("defect-data-list",
       "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 1 1 1\nencoding: raw\ndata file: LIST\nx.raw\n");
  seed("igsio",
       "NRRD0004\ntype: short\ndimension: 3\nsizes: 1 1 1\nkinds: domain domain list\nendian: big\nencoding: raw\n"
       "ultrasound image orientation:=UFA\nultrasound image type:=BRIGHTNESS\nSeq_Frame0000_Status:=OK\n"
       "Seq_Frame0000_ImageToReferenceTransform:=1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"
       "Seq_Frame0000_ImageToReferenceTransformStatus:=OK\n\nab");
}

vtkSmartPointer<vtkPolyData> Field()
{
  GaussianField field;
  field.Resize(3);
  for (std::size_t i = 0; i < 3; ++i)
  {
    field.means[i] = Eigen::Vector3d(1, 2, 3) * double(i);
    field.scales[i] = {0.5, 1, 2};
    field.rotations[i] = {1, 0, 0, 0.5};
    field.reflectivities[i] = 0.25 - double(i);
  }
  field.beam.trainedNormals = {{0, 0, 1}};
  auto data = vtkSmartPointer<vtkPolyData>::New();
  FieldToPolyData(field, data);
  return data;
}

void Fields()
{
  for (const std::string target : {"Vtp", "Ply"})
  {
    const std::string name = (root / ("field." + std::string(target == "Vtp" ? "vtp" : "ply"))).string();
    vtkNew<vtkBigusFieldWriter> writer;
    writer->SetInputData(Field());
    writer->SetFileName(name.c_str());
    writer->Write();
    const std::string bytes = test::ReadBytes(name);
    std::filesystem::remove(name);
    Seed(target, "field", bytes);
    if (target == "Vtp")
    {
      const std::string index = (root / "field.pvtp").string();
      writer->SetFileName(index.c_str());
      writer->SetNumberOfPieces(2);
      writer->Write();
      Seed("Pvtp", "index", test::ReadBytes(index));
      for (const char* file : {"field.pvtp", "field_0.vtp", "field_1.vtp"})
      {
        std::filesystem::remove(root / file);
      }
    }
    if (target == "Ply")
    {
      std::string ascii = bytes.substr(0, bytes.find("end_header\n") + 11);
      ascii.replace(ascii.find("binary_little_endian"), 20, "ascii");
      for (int i = 0; i < 3; ++i)
      {
        ascii += "1 2 3 0 0 0 0 0 0 0 -1 -1 -1 1 0 0 0 0.25\n";
      }
      Seed(target, "ascii", ascii);
      Seed(target, "empty",
           "ply\nformat binary_big_endian 1.0\nelement vertex 0\nproperty list uchar int x\nend_header\n");
    }
  }
}

}  // namespace
}  // namespace bigus::fuzz

int main(int count, char** arguments)
{
  using namespace bigus;
  using namespace bigus::fuzz;
  if (count != 2)
  {
    std::cerr << "fuzz-seeds FOLDER\n";
    return 1;
  }
  root = arguments[1];
  std::filesystem::create_directories(root);
  MetaImages();
  Nrrds();
  Seed("Csv", "plain", test::SmallCsv(false));
  Seed("Csv", "images", test::SmallCsv(true));
  Seed("Csv", "quoted", "\xef\xbb\xbf" + test::SmallCsv(true) + "# a comment\n\"frame_0.png\",\"1\"\"2\"\n");
  std::string numbered = "A title\n" + test::SmallCsv(true);
  for (std::size_t at; (at = numbered.find("frame_")) != std::string::npos;)
  {
    numbered.erase(at, 6);
    numbered.erase(numbered.find(".png", at), 4);
  }
  Seed("Csv", "numbered", numbered);
  Seed("PlusXml", "config", test::SmallConfig());
  Seed("PlusXml", "chain",
       R"(<?xml version="1.0"?><PlusConfiguration><CoordinateDefinitions><Transform From="Image" To="Probe"
  Matrix="0.1 0 0 0 0 0.1 0 0 0 0 0.1 0 0 0 0 1"/></CoordinateDefinitions></PlusConfiguration>)");
  Seed("Markups", "plane", test::SmallMarkup());
  Seed("Markups", "line",
       R"({"markups": [{"type": "Line", "controlPoints": [{"position": [1, 2, 3]}, {"position": [4, 5, 6]}]}]})");
  Seed(
      "Markups", "box",
      R"({"markups": [{"type": "ROI", "center": [1, 2, 3], "orientation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "size": [1, 2, 3]}]})");
  Seed(
      "Nrrd", "volume",
      "NRRD0005\ntype: uint8\ndimension: 3\nsizes: 1 1 2\nspace: left-posterior-superior\nencoding: raw\nkinds: domain "
      "domain domain\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n\nab");
  Seed("Markups", "deep", std::string(500, '[') + std::string(500, ']'));
  Fields();
  Seed("Png", "grey8", fuzz::Png(4, 3));
  Seed("Png", "grey16", fuzz::Png(4, 3, 0, 16));
  Seed("Png", "colour", fuzz::Png(4, 3, 2, 8, 3));
  Seed("Png", "alpha", fuzz::Png(4, 3, 6, 16, 4));
  Seed("Png", "large", fuzz::Png(30000, 30));
  for (const char* text : {"l1", "0.8*l1+0.2*dssim", "l1 + 0.5 * L2 + 1e-3*ffl+contrast", "0*l1", "nan*l1"})
  {
    Seed("Loss", std::to_string(std::string(text).size()), text);
  }
  for (const char* target : {"Sweep", "Field", "Checkpoint"})
  {
    Seed(target, "usual", std::string(3000, '\x60'));  // as usual as numbers get, see Structured.h
  }
  Seed("Transform", "hdf5", test::ReadBytes((test::SourceFolder() / "Testing/Data/transform.h5").string()));
  const std::string magic = "#Insight Transform File V1.0\n#Transform 0\n";
  Seed("Transform", "affine",
       magic + "Transform: AffineTransform_double_3_3\nParameters: 1 0 0 0 1 0 0 0 1 5 6 7\nFixedParameters: 0 0 0\n");
  Seed("Transform", "composite",
       magic +
           "Transform: CompositeTransform_double_3_3\nTransform: Euler3DTransform_double_3_3\n"
           "Parameters: 0.1 0.2 0.3 4 5 6\nFixedParameters: 1 2 3 1\n"
           "Transform: Similarity3DTransform_float_3_3\nParameters: 0.1 0.2 0.3 4 5 6 2\nFixedParameters: 0 0 0\n"
           "Transform: TranslationTransform_double_3_3\nParameters: 1 2 3\nFixedParameters: \n");
  Seed("Transform", "matrix", "1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n");
  for (void (*const write)() : Writers())
  {
    write();
  }
  return 0;
}
