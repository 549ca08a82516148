// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A bad file for every way to be bad: one clear error that names the file, and no output.
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

#include "SmallFiles.h"
#include "Support/ErrorObserver.h"
#include "Support/TestSupport.h"
#include "vtkBigusPoseReader.h"
#include "vtkBigusSequenceReader.h"
#include "vtkDemandDrivenPipeline.h"
#include "vtkErrorCode.h"
#include "vtkExecutive.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkPNGWriter.h"
#include "vtkTable.h"

namespace bigus::test
{
namespace
{

// Reads a file that must be refused with one error that has all of `parts` in it.
void ExpectRefused(vtkBigusSequenceReader* reader, const std::string& fileName, const std::vector<std::string>& parts)
{
  ErrorObserver errors(reader);
  reader->SetFileName(fileName.c_str());
  reader->Modified();
  reader->Update();
  ASSERT_EQ(errors.Errors().size(), 1u) << errors.Text();
  for (const std::string& part : parts)
  {
    EXPECT_NE(errors.Text().find(part), std::string::npos) << "no \"" << part << "\" in: " << errors.Text();
  }
  EXPECT_NE(reader->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
  EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 0);
}

void ExpectRefused(const std::string& fileName, const std::vector<std::string>& parts)
{
  vtkNew<vtkBigusSequenceReader> reader;
  ExpectRefused(reader, fileName, parts);
}

TEST(BadSequence, MetaImageFields)
{
  const std::vector<std::tuple<std::string, std::string, std::string>> cases = {
      {"ObjectType", "Tube", "ObjectType"},
      {"NDims", "4", "NDims"},
      {"NDims", "three", "NDims"},
      {"DimSize", "4 3", "NDims"},
      {"DimSize", "4 3 0", "no images"},
      {"DimSize", "0 0 3", "no images"},
      {"DimSize", "4 3 -3", "DimSize"},
      {"DimSize", "4 3 3.5", "DimSize"},
      {"DimSize", "4 three 3", "DimSize"},
      {"DimSize", "", "DimSize"},
      {"DimSize", "99999999999999999999 3 3", "DimSize"},
      {"DimSize", "2147483648 2147483648 2147483648", "claims"},
      {"DimSize", "4294967297 3 3", "claims"},
      {"DimSize", "4 3 4", "claims"},
      {"DimSize", "4 3 2", "accounts for 24"},
      {"DimSize", "3 3 3", "accounts for 27"},
      {"ElementType", "MET_DOUBLE", "MET_DOUBLE"},
      {"ElementType", "MET_USHORT", "claims"},
      {"ElementType", "", "ElementType"},
      {"ElementNumberOfChannels", "3", "claims"},
      {"ElementNumberOfChannels", "2", "2 channels"},
      {"ElementNumberOfChannels", "-3", "-3 channels"},
      {"ElementNumberOfChannels", "1.5", "ElementNumberOfChannels"},
      {"BinaryData", "False", "BinaryData"},
      {"BinaryData", "maybe", "BinaryData"},
      {"CompressedData", "2", "CompressedData"},
      {"UltrasoundImageOrientation", "FM", "UltrasoundImageOrientation"},
      {"UltrasoundImageOrientation", "XX", "UltrasoundImageOrientation"},
      {"UltrasoundImageOrientation", "MFX", "UltrasoundImageOrientation"},
      {"UltrasoundImageType", "RF_REAL", "UltrasoundImageType"},
      {"Seq_Frame0003_Timestamp", "1", "frame 3"},
      {"Seq_Frame99999999999999999999_Timestamp", "1", "Seq_Frame"},
      {"Seq_Frame-001_Timestamp", "1", "Seq_Frame"},
      {"Seq_Frame0000", "1", "Seq_Frame"},
      {"ElementDataFile", "LIST", "LIST"},
      {"ElementDataFile", "slice%03d.raw 1 3 1", "slice%03d.raw"},
      {"ElementDataFile", "missing.raw", "missing.raw"},
      {"ElementDataFile", "../outside.raw", "../outside.raw"},
      {"ElementDataFile", "sub/../../outside.raw", "sub/../../outside.raw"},
      {"ElementDataFile", "/etc/passwd", "/etc/passwd"},
      {"ElementDataFile", "link.raw", "link.raw"},
      {"ElementDataFile", "", "not a relative name"},
      {"ElementDataFile", ".", "there is none"},
  };
  TemporaryFolder folder;
  std::filesystem::create_directory(folder / "inside");
  WriteBytes(folder / "outside.raw", SmallSequence().pixels);
  std::filesystem::create_symlink(folder / "outside.raw", folder / "inside/link.raw");
  for (const auto& [field, value, part] : cases)
  {
    SCOPED_TRACE(field + " = " + value);
    Sequence sequence = SmallSequence();
    sequence.Set(field, value);
    WriteBytes(folder / "inside/bad.mha", sequence.Bytes());
    ExpectRefused(folder / "inside/bad.mha", {"inside", part});
  }
  for (const char* field : {"NDims", "DimSize", "ElementType", "ElementDataFile"})
  {
    SCOPED_TRACE(field);
    Sequence sequence = SmallSequence();
    sequence.Remove(field);
    sequence.pixels.clear();
    WriteBytes(folder / "bad.mha", sequence.Bytes());
    ExpectRefused(folder / "bad.mha", {"bad.mha", field});
  }
}

TEST(BadSequence, EveryTruncationOfAFile)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set("CompressedData", "True");
  sequence.pixels = Compressed(sequence.pixels);
  const std::string whole = sequence.Bytes();
  for (std::size_t length = 0; length < whole.size(); ++length)
  {
    SCOPED_TRACE(length);
    WriteBytes(folder / "cut.mha", whole.substr(0, length));
    ExpectRefused(folder / "cut.mha", {"cut.mha"});
  }
  const std::string nrrd = sequence.NrrdBytes("4 3 3", "domain domain list", "gzip", sequence.pixels);
  for (std::size_t length = 0; length < nrrd.size(); ++length)
  {
    SCOPED_TRACE(length);
    WriteBytes(folder / "cut.nrrd", nrrd.substr(0, length));
    ExpectRefused(folder / "cut.nrrd", {"cut.nrrd"});
  }
}

TEST(BadSequence, EmptyMissingAndForeignFiles)
{
  TemporaryFolder folder;
  WriteBytes(folder / "empty.mha", "");
  ExpectRefused(folder / "empty.mha", {"empty.mha", "empty"});
  ExpectRefused(folder / "missing.mha", {"missing.mha", "no such file"});
  ExpectRefused(folder.Path().string(), {"not a regular file"});
  WriteBytes(folder / "text.mha", "Dear reader,\nthis is not a sequence.\n");
  ExpectRefused(folder / "text.mha", {"neither"});
  WriteBytes(folder / "binary.mha", std::string(100000, '\xff'));
  ExpectRefused(folder / "binary.mha", {"neither"});
  WriteBytes(folder / "endless.mha", "ObjectType = " + std::string(200000, 'x'));
  ExpectRefused(folder / "endless.mha", {"64 KiB"});

  vtkNew<vtkBigusSequenceReader> reader;
  EXPECT_EQ(reader->CanReadFile((folder / "text.mha").c_str()), 0);
  EXPECT_EQ(reader->CanReadFile((folder / "missing.mha").c_str()), 0);
  EXPECT_EQ(reader->CanReadFile(nullptr), 0);
  WriteBytes(folder / "volume.mha",
             "ObjectType = Image\nNDims = 3\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nDimSize = 1 1 1\n"
             "ElementType = MET_UCHAR\nElementDataFile = LOCAL\nTransform = no header");
  WriteBytes(folder / "volume.nrrd", "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 1 1\nencoding: raw\n\nTransform:=");
  for (const char* const volume : {"volume.mha", "volume.nrrd"})
  {
    EXPECT_EQ(reader->CanReadFile((folder / volume).c_str()), 0) << volume;
    reader->RequirePosesOff();
    EXPECT_EQ(reader->CanReadFile((folder / volume).c_str()), 1) << volume;
    reader->RequirePosesOn();
  }
  ErrorObserver errors(reader);
  reader->Update();
  EXPECT_NE(errors.Text().find("FileName"), std::string::npos);
}

// ParaView asks for data of a file that did not open. What is wrong with it is said once.
TEST(BadSequence, AFileThatDidNotOpenIsToldOnce)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  reader->SetFileName((folder / "small.mha").c_str());
  reader->SetFromFrame("Stylus");
  ErrorObserver errors(reader);
  reader->UpdateInformation();
  vtkNew<vtkInformation> request;
  request->Set(vtkDemandDrivenPipeline::REQUEST_DATA());
  EXPECT_EQ(reader->ProcessRequest(request, reader->GetExecutive()->GetInputInformation(),
                                   reader->GetExecutive()->GetOutputInformation()),
            0);
  EXPECT_EQ(errors.Errors().size(), 1) << errors.Text();
}

// A header of 100 bytes must not make us allocate 17 GB.
TEST(BadSequence, ClaimsAreCheckedBeforeAllocation)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set("DimSize", "4096 4096 1024");
  WriteBytes(folder / "raw.mha", sequence.Bytes());
  ExpectRefused(folder / "raw.mha", {"17179869184 bytes"});
  sequence.Set("CompressedData", "True");
  sequence.pixels = Compressed(sequence.pixels);
  WriteBytes(folder / "zlib.mha", sequence.Bytes());
  ExpectRefused(folder / "zlib.mha", {"17179869184 bytes"});
  WriteBytes(folder / "gzip.nrrd", sequence.NrrdBytes("4096 4096 1024", "domain domain list", "gzip", "x"));
  ExpectRefused(folder / "gzip.nrrd", {"17179869184 bytes"});
}

TEST(BadSequence, CompressedDataThatDoNotFit)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  const std::string raw = sequence.pixels;
  sequence.Set("CompressedData", "True");

  sequence.pixels = Compressed(std::string(10 << 20, '\0'));  // a bomb: 10 MiB where 36 bytes are due
  WriteBytes(folder / "bomb.mha", sequence.Bytes());
  ExpectRefused(folder / "bomb.mha", {"bomb.mha", "do not end"});

  sequence.pixels = Compressed(raw.substr(1));
  WriteBytes(folder / "short.mha", sequence.Bytes());
  ExpectRefused(folder / "short.mha", {"short.mha", "end early"});

  sequence.pixels = Compressed(raw);
  sequence.pixels.back() = static_cast<char>(sequence.pixels.back() ^ 1);  // the checksum
  WriteBytes(folder / "checksum.mha", sequence.Bytes());
  ExpectRefused(folder / "checksum.mha", {"checksum.mha", "damaged"});

  sequence.pixels = raw;
  WriteBytes(folder / "not-compressed.mha", sequence.Bytes());
  ExpectRefused(folder / "not-compressed.mha", {"not-compressed.mha", "damaged"});

  sequence.pixels = Compressed(raw);
  for (const char* size : {"0", "-5", "many", "3"})
  {
    sequence.Set("CompressedDataSize", size);
    WriteBytes(folder / "size.mha", sequence.Bytes());
    ExpectRefused(folder / "size.mha", {"size.mha"});
  }
}

// The header alone shows it: whoever asks only for poses or a report must hear of it too.
TEST(BadSequence, TruncatedCompressedPixelsWithoutReadingThem)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set("CompressedData", "True");
  sequence.pixels = Compressed(sequence.pixels);
  sequence.Set("CompressedDataSize", std::to_string(sequence.pixels.size()));
  WriteBytes(folder / "whole.mha", sequence.Bytes());
  const std::string whole = ReadBytes(folder / "whole.mha");
  WriteBytes(folder / "cut.mha", whole.substr(0, whole.size() - 1));

  vtkNew<vtkBigusSequenceReader> frames;
  vtkNew<vtkBigusPoseReader> poses;
  const auto look = [&](const std::string& name)
  {
    frames->SetFileName((folder / name).c_str());
    frames->UpdateInformation();
    poses->SetFileName((folder / name).c_str());
    poses->Update();
  };
  ErrorObserver frameErrors(frames);
  ErrorObserver poseErrors(poses);
  look("whole.mha");
  ASSERT_EQ(frameErrors.Text() + poseErrors.Text(), "");
  look("cut.mha");
  for (const std::string& text : {frameErrors.Text(), poseErrors.Text()})
  {
    EXPECT_NE(text.find("cut.mha: states CompressedDataSize"), std::string::npos) << text;
    EXPECT_NE(text.find("truncated"), std::string::npos) << text;
  }
  EXPECT_EQ(frames->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::PrematureEndOfFileError));
}

// Without poses the same bounds hold.
TEST(BadSequence, PlainImages)
{
  TemporaryFolder folder;
  Sequence volume = SmallVolume();
  std::vector<std::pair<std::string, std::string>> files;
  files.emplace_back("empty.png", "");
  files.emplace_back("signature.png", "\x89PNG\r\n\x1a\n");
  files.emplace_back("cut.mha", volume.Bytes().substr(0, volume.Bytes().size() - 1));
  const std::string nrrd = volume.NrrdBytes("4 3 3", "domain domain domain", "raw", volume.pixels);
  files.emplace_back("cut.nrrd", nrrd.substr(0, nrrd.size() - 1));
  files.emplace_back("two.nrrd", volume.NrrdBytes("2 2 3 3", "domain domain domain list", "raw", volume.pixels));
  volume.Set("DimSize", "60000 60000 60000");
  files.emplace_back("huge.mha", volume.Bytes());
  volume.Set("DimSize", "4 3 3");
  volume.Set("ElementDataFile", "../../etc/passwd");
  files.emplace_back("escape.mha", volume.Bytes());
  files.emplace_back("foreign.vti", "<?xml version=\"1.0\"?><VTKFile type=\"ImageData\"/>");
  for (const auto& [name, bytes] : files)
  {
    SCOPED_TRACE(name);
    WriteBytes(folder / name, bytes);
    vtkNew<vtkBigusSequenceReader> reader;
    reader->RequirePosesOff();
    ExpectRefused(reader, folder / name, {name});
  }
}

TEST(BadSequence, NrrdFields)
{
  const Sequence sequence = SmallSequence();
  const std::string good = sequence.NrrdBytes("4 3 3", "domain domain list", "raw", sequence.pixels);
  const std::vector<std::tuple<std::string, std::string, std::string>> cases = {
      {"sizes: 4 3 3", "sizes: 4 3", "sizes"},
      {"sizes: 4 3 3", "sizes: 4 -3 3", "sizes"},
      {"sizes: 4 3 3", "sizes: 4 3 9999999", "claims"},
      {"sizes: 4 3 3", "", "sizes"},
      {"dimension: 3", "dimension: 4", "dimension"},
      {"domain domain list", "domain domain domain", "slice"},
      {"domain domain list", "domain list domain", "list axis"},
      {"domain domain list", "domain list list", "list axis"},
      {"domain domain list", "domain domain vector", "vector"},
      {"domain domain list", "domain list", "kinds"},
      {"type: unsigned char", "type: double", "double"},
      {"type: unsigned char", "type: float", "endian"},
      {"type: unsigned char", "", "type"},
      {"encoding: raw", "encoding: bzip2", "bzip2"},
      {"encoding: raw", "encoding: gzip", "damaged"},
      {"encoding: raw", "", "encoding"},
      {"encoding: raw", "encoding: raw\ndata file: ../x.raw", "../x.raw"},
      {"encoding: raw", "encoding: raw\ndata file: LIST", "LIST"},
      {"encoding: raw", "encoding: raw\nbyte skip: 4", "skip"},
      {"encoding: raw", "encoding: raw\nendian: middle", "endian"},
      {"encoding: raw", "encoding: raw\nno colon here", "no colon"},
  };
  TemporaryFolder folder;
  for (const auto& [from, to, part] : cases)
  {
    SCOPED_TRACE(from + " -> " + to);
    std::string bad = good;
    const std::string line = to.empty() ? from + "\n" : from;
    bad.replace(bad.find(line), line.size(), to);
    WriteBytes(folder / "bad.nrrd", bad);
    ExpectRefused(folder / "bad.nrrd", {"bad.nrrd", part});
  }
}

void WritePng(const std::string& fileName, int width, int height, int type, int components)
{
  vtkNew<vtkImageData> picture;
  picture->SetDimensions(width, height, 1);
  picture->AllocateScalars(type, components);
  for (vtkIdType i = 0; i < width * height; ++i)
  {
    picture->SetScalarComponentFromDouble(static_cast<int>(i % width), static_cast<int>(i / width), 0, 0, double(i));
  }
  vtkNew<vtkPNGWriter> writer;
  writer->SetFileName(fileName.c_str());
  writer->SetInputData(picture);
  writer->Write();
}

TEST(BadSequence, CsvAndItsImages)
{
  TemporaryFolder folder;
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    WritePng(folder / ("frame_" + std::to_string(frame) + ".png"), 40, 30, VTK_UNSIGNED_CHAR, 1);
  }
  const std::string good = SmallCsv(true);
  const auto refuse = [&](const std::string& from, const std::string& to, const std::string& part)
  {
    SCOPED_TRACE(from + " -> " + to);
    std::string bad = good;
    bad.replace(bad.find(from), from.size(), to);
    WriteBytes(folder / "bad.csv", bad);
    ExpectRefused(folder / "bad.csv", {part});
  };
  refuse("m12", "q12", "m12");
  refuse(",m33", "", "m33");
  refuse("m30", "other", "m30");
  refuse("m33\n", "m33,more\n", "row 0 has 18 cells");
  refuse("\nframe_1.png,", "\n", "row 1 has 17 cells");
  refuse("frame_1.png", "\"frame_1.png", "quote");
  refuse("frame_1.png", "../frame_1.png", "../frame_1.png");
  refuse("frame_1.png", "/frame_1.png", "/frame_1.png");
  refuse("frame_1.png", "", "relative name");
  refuse("frame_1.png", "frame_9.png", "frame_9.png");
  WriteBytes(folder / "bad.csv", good.substr(0, good.find('\n') + 1));
  ExpectRefused(folder / "bad.csv", {"no poses"});
  WriteBytes(folder / "bad.csv", SmallCsv(false));
  ExpectRefused(folder / "bad.csv", {"no column image"});
  WriteBytes(folder / "bad.csv", "image,tx,ty,tz,qx,qy,qz,qw\nframe_0.png,1,2,3,0,0,0,1\n");
  ExpectRefused(folder / "bad.csv", {"m00 to m33", "first line", "quaternions", "bigus.convert"});
  WriteBytes(folder / "bad.csv", SmallCsv(false));

  vtkNew<vtkBigusSequenceReader> reader;
  for (const char* pattern : {"frame.png", "frame_%s.png", "%d%d.png", "frame_%", "frame_%4d.png", "frame_%0999d.png"})
  {
    SCOPED_TRACE(pattern);
    reader->SetImagePattern(pattern);
    ExpectRefused(reader, folder / "bad.csv", {"image pattern"});
  }
  reader->SetImagePattern(nullptr);
  reader->SetImageFolder((folder / "nowhere").c_str());
  ExpectRefused(reader, folder / "bad.csv", {"nowhere"});
  WritePng(folder / "frame_3.png", 40, 30, VTK_UNSIGNED_CHAR, 1);
  reader->SetImageFolder(folder.Path().c_str());
  ExpectRefused(reader, folder / "bad.csv", {"4 PNG files"});

  // Columns that name pictures, and hold none of them.
  for (const auto& [title, cell, part] : std::vector<std::array<std::string, 3>>{
           {"image", "far.png", "names no PNG file in"},
           {"file", "far", "names no PNG file in"},
           {"frame", "frame_0.png", "a frame's number, counted from 0, is expected"},
           {"frame_id", "1.5", "a frame's number, counted from 0, is expected"},
           {"id", "77", "names none of the 4 PNG files"}})
  {
    SCOPED_TRACE(title);
    std::string bad = SmallCsv(true);
    bad.replace(0, 5, title);
    for (std::size_t at = 0; (at = bad.find("\nframe_", at)) != std::string::npos; at += 2)
    {
      bad.replace(at + 1, 11, cell);
    }
    WriteBytes(folder / "bad.csv", bad);
    ExpectRefused(reader, folder / "bad.csv",
                  {"bad.csv: row 0, column " + title + ": \"" + cell + "\"", part, "Rename the column"});
  }
  std::string twice = SmallCsv(true);
  twice.replace(twice.find("frame_1"), 7, "frame_0");
  WriteBytes(folder / "bad.csv", twice);
  ExpectRefused(reader, folder / "bad.csv", {"row 1, column image: \"frame_0.png\" names a picture twice"});
  reader->SetImagePattern("frame_%d.png");
  ExpectRefused(reader, folder / "bad.csv", {"row 1, column image", "leave the pattern out"});
  reader->SetImagePattern(nullptr);

  WriteBytes(folder / "good.csv", good);
  WritePng(folder / "frame_1.png", 41, 30, VTK_UNSIGNED_CHAR, 1);
  ExpectRefused(folder / "good.csv", {"frame_1.png", "41 x 30"});
  reader->SetImageFolder(nullptr);
  reader->SetFileName((folder / "good.csv").c_str());
  ErrorObserver sizes(reader);
  reader->UpdateInformation();  // what `bigus info` shows
  EXPECT_NE(sizes.Text().find("41 x 30"), std::string::npos) << sizes.Text();
  WritePng(folder / "frame_1.png", 40, 30, VTK_UNSIGNED_SHORT, 1);
  ExpectRefused(folder / "good.csv", {"frame_1.png", "unsigned short"});
  const std::string png = ReadBytes(folder / "frame_0.png");
  for (const std::size_t length : {std::size_t(0), std::size_t(20), std::size_t(60), png.size() / 2})
  {
    SCOPED_TRACE(length);
    WriteBytes(folder / "frame_1.png", png.substr(0, length));
    ExpectRefused(folder / "good.csv", {"frame_1.png"});
  }
  std::string huge = png;
  huge.replace(16, 8, std::string("\0\0\x7f\xff\0\0\x7f\xff", 8));
  WriteBytes(folder / "frame_0.png", huge);
  ExpectRefused(folder / "good.csv", {"frame_0.png", "32767 x 32767"});
}

TEST(BadSequence, TransformsThatAreNotThere)
{
  TemporaryFolder folder;
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetToFrame("Tracker");
  ExpectRefused(reader, folder / "small.mha",
                {"Image to Tracker", "ImageToReference", "Reached from Image: Reference"});
  EXPECT_EQ(reader->GetNumberOfTransforms(), 1);
  for (const char* name : {"", "Image"})
  {
    reader->SetToFrame(name);
    ExpectRefused(reader, folder / "small.mha", {"two different coordinate frames"});
  }
}

TEST(BadSequence, AllFramesRejected)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    sequence.Set(SmallField(frame, "ImageToReferenceTransformStatus"), frame == 0 ? "MISSING" : "INVALID");
  }
  WriteBytes(folder / "none.mha", sequence.Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  ExpectRefused(reader, folder / "none.mha", {"no frame is left", "3 of 3", "MISSING", "INVALID", "frames 1, 2"});
  EXPECT_EQ(reader->GetNumberOfFramesInFile(), 3);
  EXPECT_EQ(reader->GetNumberOfRejectedFrames(), 3);
}

TEST(BadSequence, Configurations)
{
  TemporaryFolder folder;
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetConfigFileName((folder / "config.xml").c_str());
  ExpectRefused(reader, folder / "small.mha", {"config.xml", "no such file"});
  const std::string good = SmallConfig();
  for (const auto& [bytes, part] : std::vector<std::pair<std::string, std::string>>{
           {"", "not a Plus configuration"},
           {good.substr(0, good.size() / 2), "not a Plus configuration"},
           {"<PlusConfiguration/>", "CoordinateDefinitions"},
           {"<P><CoordinateDefinitions><Transform From=\"A\" To=\"B\"/></CoordinateDefinitions></P>", "Matrix"}})
  {
    WriteBytes(folder / "config.xml", bytes);
    ExpectRefused(reader, folder / "small.mha", {"config.xml", part});
  }
  // A bad matrix matters only where it is needed.
  WriteBytes(folder / "config.xml", good);
  reader->SetToFrame("Flat");
  ExpectRefused(reader, folder / "small.mha", {"FlatToReference", "singular"});
  std::filesystem::resize_file(folder / "config.xml", 17u << 20);
  ExpectRefused(reader, folder / "small.mha", {"config.xml"});
}

TEST(BadSequence, ClipsThatLeaveNothing)
{
  TemporaryFolder folder;
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetClipModeToRectangle();
  ExpectRefused(reader, folder / "small.mha", {"leaves no pixel"});
  reader->SetClipRectangle(2147483647, 0, 2147483647, 2147483647);
  ExpectRefused(reader, folder / "small.mha", {"leaves no pixel"});
  reader->SetClipModeToFan();
  ExpectRefused(reader, folder / "small.mha", {"outer radius"});
  reader->SetFanRadii(1000, 1001);
  ExpectRefused(reader, folder / "small.mha", {"leaves no pixel"});
}

// What an earlier, good file left in the output must not pass for the bad one.
TEST(BadSequence, ClearsAnEarlierOutput)
{
  TemporaryFolder folder;
  WriteBytes(folder / "good.mha", SmallSequence().Bytes());
  WriteBytes(folder / "bad.mha", SmallSequence().Header());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName((folder / "good.mha").c_str());
  reader->Update();
  ASSERT_EQ(reader->GetOutput()->GetNumberOfPoints(), 36);
  ExpectRefused(reader, folder / "bad.mha", {"bad.mha"});
  reader->SetFileName((folder / "good.mha").c_str());
  reader->Update();
  EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 36);
  EXPECT_EQ(reader->GetErrorCode(), 0u);
}

}  // namespace
}  // namespace bigus::test
