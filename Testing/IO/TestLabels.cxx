// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Label pictures as people save them, and labels in the files of fields.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Data/LabelData.h"
#include "IO/FieldFile.h"
#include "SmallFiles.h"
#include "Support/ErrorObserver.h"
#include "Support/TestSupport.h"
#include "vtkBigusLabelReader.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkPNGWriter.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkXMLPolyDataReader.h"

namespace bigus::test
{
namespace
{

/// As 3D Slicer 5 writes the segmentation of a stack of two pictures of 3 x 2 pixels.
std::string Segmentation(const std::string& offset = "0 0 0", const std::string& layer = "0")
{
  return "NRRD0004\n# Complete NRRD file format specification at:\ntype: unsigned char\ndimension: 3\n"
         "space: left-posterior-superior\nsizes: 3 2 2\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
         "kinds: domain domain domain\nencoding: raw\nspace origin: (0,0,0)\n"
         "Segment0_Color:=0.5 0.68 0.5\nSegment0_Extent:=0 2 0 1 0 1\nSegment0_ID:=Segment_1\nSegment0_LabelValue:=2\n"
         "Segment0_Layer:=0\nSegment0_Name:=portal vein\nSegment1_Color:=1 0 0\nSegment1_LabelValue:=1\n"
         "Segment1_Layer:=" +
         layer + "\nSegment1_Name:=cyst\nSegmentation_ReferenceImageExtentOffset:=" + offset + "\n\n" +
         std::string("\0\1\2\0\0\2\0\0\0\1\1\0", 12);
}

/// What the reader gives, and what it says; none where it has an error.
struct Pictures
{
  explicit Pictures(const std::string& path)
  {
    vtkNew<vtkBigusLabelReader> reader;
    ErrorObserver errors(reader);
    reader->SetFileName(path.c_str());
    reader->Update();
    error = errors.Errors().empty() ? "no error" : errors.Errors().front();
    image->ShallowCopy(reader->GetOutput());
    if (error == "no error")
    {
      const auto* first = static_cast<const std::uint8_t*>(image->GetScalarPointer());
      pixels.assign(first, first + image->GetNumberOfPoints());
      labels = LabelNamesOf(image);
    }
  }
  vtkDataArray* SourceFrame() const { return image->GetFieldData()->GetArray("SourceFrame"); }

  vtkNew<vtkImageData> image;
  std::vector<std::uint8_t> pixels;
  std::vector<Label> labels;
  std::string error;
};

std::string ErrorOf(const std::string& path)
{
  return Pictures(path).error;
}

void WritePng(const std::string& path, int width, unsigned char value)
{
  vtkNew<vtkImageData> image;
  image->SetDimensions(width, 2, 1);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  image->GetPointData()->GetScalars()->Fill(value);
  vtkNew<vtkPNGWriter> writer;
  writer->SetFileName(path.c_str());
  writer->SetInputData(image);
  writer->Write();
}

TEST(LabelFile, ASegmentationOfSlicerNamesItsSegments)
{
  TemporaryFolder folder;
  WriteBytes(folder / "s.seg.nrrd", Segmentation());
  const Pictures read(folder / "s.seg.nrrd");
  EXPECT_EQ(read.image->GetDimensions()[0], 3);
  EXPECT_EQ(read.pixels, (std::vector<std::uint8_t>{0, 1, 2, 0, 0, 2, 0, 0, 0, 1, 1, 0}));
  ASSERT_EQ(read.labels.size(), 2u);
  EXPECT_EQ(read.labels[0].name, "cyst");
  EXPECT_EQ(read.labels[1].name, "portal vein");
  EXPECT_EQ(read.labels[1].color[1], 0.68);
  EXPECT_EQ(read.SourceFrame(), nullptr);
}

TEST(LabelFile, WhatWasCroppedSaysFromWhere)
{
  TemporaryFolder folder;
  WriteBytes(folder / "cut.seg.nrrd", Segmentation("10 4 8"));
  const Pictures read(folder / "cut.seg.nrrd");
  const int* const extent = read.image->GetExtent();
  EXPECT_EQ(std::vector<int>(extent, extent + 6), (std::vector<int>{10, 12, 4, 5, 8, 9}));
  EXPECT_EQ(read.image->GetScalarComponentAsDouble(12, 5, 8, 0), 2);
  EXPECT_EQ(read.SourceFrame(), nullptr);
  for (const std::string wrong : {"0 0 -1", "0 0 9223372036854775807", "1 2", "0 0 0 0", "0 0 1.5", "a b c", ""})
  {
    WriteBytes(folder / "wrong.seg.nrrd", Segmentation(wrong));
    EXPECT_NE(ErrorOf(folder / "wrong.seg.nrrd").find("ReferenceImageExtentOffset: \"" + wrong + "\""),
              std::string::npos)
        << wrong << ": " << ErrorOf(folder / "wrong.seg.nrrd");
  }
}

TEST(LabelFile, WhatOverlapsIsToldHowToBeSaved)
{
  TemporaryFolder folder;
  WriteBytes(folder / "layers.seg.nrrd", Segmentation("0 0 0", "1"));
  EXPECT_NE(ErrorOf(folder / "layers.seg.nrrd").find("layer 1"), std::string::npos);
  EXPECT_NE(ErrorOf(folder / "layers.seg.nrrd").find("there are 1"), std::string::npos);
  EXPECT_NE(ErrorOf(folder / "none").find("none"), std::string::npos);
}

TEST(LabelFile, OfLayersALaterSegmentCoversAnEarlierOne)
{
  TemporaryFolder folder;
  // Two layers of 3 x 2 pixels in two pictures; both segments have the value 1.
  const std::string header =
      "NRRD0004\ntype: unsigned char\ndimension: 4\nspace: left-posterior-superior\nsizes: 2 3 2 2\n"
      "space directions: none (1,0,0) (0,1,0) (0,0,1)\nkinds: list domain domain domain\nencoding: raw\n"
      "Segment0_LabelValue:=1\nSegment0_Layer:=0\nSegment0_Name:=liver\n"
      "Segment1_LabelValue:=1\nSegment1_Layer:=1\nSegment1_Name:=vein\n\n";
  const std::string pixels("\1\0\1\1\0\1\0\0\1\0\1\0\0\0\0\0\0\1\0\1\1\1\1\1", 24);
  WriteBytes(folder / "l.seg.nrrd", header + pixels);
  const Pictures read(folder / "l.seg.nrrd");
  EXPECT_EQ(read.image->GetDimensions()[0], 3);
  EXPECT_EQ(read.pixels, (std::vector<std::uint8_t>{1, 2, 2, 0, 1, 1, 0, 0, 2, 2, 2, 2}));
  ASSERT_EQ(read.labels.size(), 2u);
  EXPECT_EQ(read.labels[1].name, "vein");
  std::string other = pixels;
  other[3] = 5;
  WriteBytes(folder / "other.seg.nrrd", header + other);
  EXPECT_NE(ErrorOf(folder / "other.seg.nrrd").find("layer 1 has the label 5"), std::string::npos);
  WriteBytes(folder / "short.seg.nrrd", header + pixels.substr(1));
  EXPECT_NE(ErrorOf(folder / "short.seg.nrrd").find("short.seg.nrrd"), std::string::npos);
  std::string wide = header;
  wide.replace(wide.find("2 3 2 2"), 7, "30000 30000 2 2");
  WriteBytes(folder / "wide.seg.nrrd", wide + pixels);
  EXPECT_NE(ErrorOf(folder / "wide.seg.nrrd").find("at most"), std::string::npos);
}

TEST(LabelFile, PicturesOfAFolderAreNumberedByTheirNames)
{
  TemporaryFolder folder;
  EXPECT_NE(ErrorOf(folder / "").find("no PNG"), std::string::npos);
  WritePng(folder / "frame_10.png", 3, 4);
  WritePng(folder / "frame_2.png", 3, 1);
  const Pictures read(folder / "");
  ASSERT_NE(read.SourceFrame(), nullptr);
  EXPECT_EQ(read.SourceFrame()->GetTuple1(0), 2);
  EXPECT_EQ(read.SourceFrame()->GetTuple1(1), 10);
  EXPECT_EQ(read.pixels.front(), 1);
  EXPECT_EQ(read.pixels.back(), 4);
  WritePng(folder / "frame_3.png", 4, 1);
  EXPECT_NE(ErrorOf(folder / "").find("frame_3.png"), std::string::npos);
}

StoredField Labelled()
{
  StoredField stored;
  stored.field.Resize(3);
  for (int i = 0; i < 3; ++i)
  {
    stored.field.means[i] = {1.0 * i, 2, 3};
    stored.field.scales[i] = {1, 1, 1};
    stored.field.rotations[i] = {1, 0, 0, 0};
    stored.field.reflectivities[i] = 0.5;
  }
  stored.labels = FieldLabels{
      {{1, "cyst", {1, 0, 0}}, {7, "vein", {0, 0, 0.1}}}, {0, 1, 0.3f, 0.7f, 1, 0, 0.2f, 0.4f}, {{0.1, 5, 6, 0.5}}};
  return stored;
}

TEST(LabelsOfFields, AreKeptToTheBitAndSeenByVtksReader)
{
  TemporaryFolder folder;
  WriteField(Labelled(), folder / "f.vtp");
  const auto read = ReadField(folder / "f.vtp");
  ASSERT_TRUE(read && read->labels);
  EXPECT_EQ(read->labels->weights, Labelled().labels->weights);
  EXPECT_EQ(read->labels->labels[1].name, "vein");
  EXPECT_EQ(read->labels->labels[1].value, 7);
  EXPECT_EQ(read->labels->labels[1].color[2], 0.1);
  EXPECT_EQ(read->labels->points, Labelled().labels->points);

  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName((folder / "f.vtp").c_str());
  reader->Update();
  vtkDataArray* weights = reader->GetOutput()->GetPointData()->GetArray("LabelWeight");
  ASSERT_NE(weights, nullptr);
  EXPECT_EQ(weights->GetNumberOfComponents(), 2);
  EXPECT_EQ(static_cast<float>(weights->GetComponent(1, 1)), 0.7f);
  EXPECT_NE(reader->GetOutput()->GetFieldData()->GetAbstractArray("LabelNames"), nullptr);
}

TEST(LabelsOfFields, DamageIsAnErrorThatNamesTheFile)
{
  TemporaryFolder folder;
  StoredField stored = Labelled();
  WriteField(stored, folder / "f.vtp");
  const std::string good = ReadBytes(folder / "f.vtp");
  const auto refused = [&](const std::string& from, const std::string& to)
  {
    std::string text = good;
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    WriteBytes(folder / "bad.vtp", text);
    try
    {
      ReadField(folder / "bad.vtp");
      ADD_FAILURE() << "read: " << to;
    }
    catch (const Error&)
    {
    }
  };
  refused("Name=\"LabelValues\" NumberOfComponents=\"1\" NumberOfTuples=\"2\"",
          "Name=\"LabelValues\" NumberOfComponents=\"1\" NumberOfTuples=\"3\"");
  refused("Name=\"LabelValues\"", "Name=\"LabelWalues\"");
  refused("Name=\"LabelWeight\" NumberOfComponents=\"2\"", "Name=\"LabelWeight\" NumberOfComponents=\"3\"");
  stored.labels->weights[2] = 1.5f;
  EXPECT_THROW(WriteField(stored, folder / "g.vtp"), Error);
}

}  // namespace
}  // namespace bigus::test
