// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Valid sequences in every format and orientation: pixels, poses and report against what was put into the
// file.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "SmallFiles.h"
#include "Support/ErrorObserver.h"
#include "Support/OutputWindow.h"
#include "Support/TestSupport.h"
#include "vtkBigusSequenceReader.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkPNGWriter.h"
#include "vtkPointData.h"

namespace bigus::test
{
namespace
{

// Every pixel and pose of the output is that of SmallSequence; `frames` says which of its frames are there.
void ExpectSmall(vtkImageData* image, const std::vector<int>& frames = {0, 1, 2})
{
  int size[3];
  image->GetDimensions(size);
  ASSERT_EQ(size[0], smallWidth);
  ASSERT_EQ(size[1], smallHeight);
  ASSERT_EQ(size[2], static_cast<int>(frames.size()));
  ASSERT_EQ(image->GetScalarType(), VTK_UNSIGNED_CHAR);
  vtkDataArray* const poses = image->GetFieldData()->GetArray("ImageToReference");
  vtkDataArray* const source = image->GetFieldData()->GetArray("SourceFrame");
  vtkDataArray* const times = image->GetFieldData()->GetArray("Timestamp");
  ASSERT_TRUE(poses && source && times);
  for (int k = 0; k < size[2]; ++k)
  {
    const int frame = frames[static_cast<std::size_t>(k)];
    EXPECT_EQ(source->GetComponent(k, 0), frame);
    EXPECT_EQ(times->GetComponent(k, 0), frame + 0.25);
    for (int c = 0; c < 16; ++c)
    {
      EXPECT_EQ(poses->GetComponent(k, c), SmallPose(c / 4, c % 4, frame)) << "frame " << frame << " element " << c;
    }
    for (int j = 0; j < size[1]; ++j)
    {
      for (int i = 0; i < size[0]; ++i)
      {
        EXPECT_EQ(image->GetScalarComponentAsDouble(i, j, k, 0), SmallPixel(i, j, frame)) << i << " " << j << " " << k;
      }
    }
  }
}

// Reads what must be readable.
vtkImageData* Read(vtkBigusSequenceReader* reader, const std::string& fileName)
{
  ErrorObserver errors(reader);
  reader->SetFileName(fileName.c_str());
  EXPECT_EQ(reader->CanReadFile(fileName.c_str()), 1);
  reader->Update();
  EXPECT_TRUE(errors.Errors().empty()) << errors.Text();
  EXPECT_EQ(reader->GetErrorCode(), 0u);
  return reader->GetOutput();
}

// Pixels of a sequence as the file would hold them under another orientation flag.
std::string Reordered(bool flipColumns, bool flipRows)
{
  std::string pixels;
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    for (int j = 0; j < smallHeight; ++j)
    {
      for (int i = 0; i < smallWidth; ++i)
      {
        pixels += static_cast<char>(
            SmallPixel(flipColumns ? smallWidth - 1 - i : i, flipRows ? smallHeight - 1 - j : j, frame));
      }
    }
  }
  return pixels;
}

TEST(SequenceReader, ReadsRawMetaImage)
{
  TemporaryFolder folder;
  WriteBytes(folder / "small.igs.mha", SmallSequence().Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  vtkImageData* const image = Read(reader, folder / "small.igs.mha");
  ExpectSmall(image);
  EXPECT_EQ(image->GetFieldData()->GetArray("Status")->GetComponent(2, 0), 1);
  for (int p = 0; p < smallWidth * smallHeight; ++p)
  {
    EXPECT_EQ(image->GetFieldData()->GetArray("Mask")->GetComponent(p, 0), 1);
  }
}

TEST(SequenceReader, ReportsWhatTheFileHolds)
{
  TemporaryFolder folder;
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName((folder / "small.mha").c_str());
  reader->UpdateInformation();
  EXPECT_EQ(reader->GetNumberOfFramesInFile(), 3);
  EXPECT_EQ(reader->GetNumberOfAcceptedFrames(), 3);
  EXPECT_EQ(reader->GetNumberOfRejectedFrames(), 0);
  EXPECT_STREQ(reader->GetRejectionSummary(), "");
  EXPECT_STREQ(reader->GetFormat(), "MetaImage sequence");
  EXPECT_STREQ(reader->GetEncoding(), "raw");
  EXPECT_STREQ(reader->GetElementType(), "unsigned char");
  EXPECT_STREQ(reader->GetOrientation(), "MF");
  EXPECT_STREQ(reader->GetTransformChain(), "Image -> Reference");
  ASSERT_EQ(reader->GetNumberOfTransforms(), 1);
  EXPECT_STREQ(reader->GetTransformName(0), "ImageToReference");
  EXPECT_STREQ(reader->GetTransformSource(0), "frames");
  EXPECT_EQ(reader->GetTransformName(1), nullptr);
  int size[2];
  reader->GetFrameSize(size);
  EXPECT_EQ(size[0], 4);
  EXPECT_EQ(size[1], 3);
  double pixel[2], spacing[3], bounds[6];
  reader->GetPixelSize(pixel);
  reader->GetPlaneSpacing(spacing);
  reader->GetBounds(bounds);
  EXPECT_NEAR(pixel[0], 0.2, 1e-15);
  EXPECT_NEAR(pixel[1], 0.3, 1e-15);
  EXPECT_NEAR(spacing[0], 0, 1e-12);  // the frames move within their plane
  EXPECT_NEAR(spacing[1], 0, 1e-12);
  EXPECT_NEAR(spacing[2], 0, 1e-12);
  EXPECT_NEAR(reader->GetPathLength(), 20, 1e-12);
  const double expected[6] = {0, 20.6, 5, 5.6, -7.125, -7.125};
  for (int i = 0; i < 6; ++i)
  {
    EXPECT_NEAR(bounds[i], expected[i], 1e-12) << i;
  }
  EXPECT_TRUE(reader->GetHasTimestamps());
  EXPECT_EQ(reader->GetDuration(), 2.0);
}

TEST(SequenceReader, ReadsCompressedAndSeparateData)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  const std::string raw = sequence.pixels;
  vtkNew<vtkBigusSequenceReader> reader;

  sequence.Set("CompressedData", "True");
  sequence.pixels = Compressed(raw);
  sequence.Set("CompressedDataSize", std::to_string(sequence.pixels.size()) + "      ");
  WriteBytes(folder / "zlib.mha", sequence.Bytes() + "trailing bytes that CompressedDataSize leaves out");
  ExpectSmall(Read(reader, folder / "zlib.mha"));
  EXPECT_STREQ(reader->GetEncoding(), "zlib");

  sequence.Remove("CompressedDataSize");
  WriteBytes(folder / "zlib-without-size.mha", sequence.Bytes());
  ExpectSmall(Read(reader, folder / "zlib-without-size.mha"));

  sequence.Set("ElementDataFile", "data.zraw");
  WriteBytes(folder / "separate.mhd", sequence.Header());
  WriteBytes(folder / "data.zraw", sequence.pixels);
  ExpectSmall(Read(reader, folder / "separate.mhd"));

  sequence.Set("CompressedData", "False");
  sequence.Set("HeaderSize", "5");
  sequence.Set("ElementDataFile", "data.raw");
  WriteBytes(folder / "skip.mhd", sequence.Header());
  WriteBytes(folder / "data.raw", "12345" + raw);
  ExpectSmall(Read(reader, folder / "skip.mhd"));
  sequence.Set("HeaderSize", "-1");
  WriteBytes(folder / "skip.mhd", sequence.Header());
  ExpectSmall(Read(reader, folder / "skip.mhd"));
}

TEST(SequenceReader, ReadsWiderElementsInEitherByteOrder)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  for (const bool big : {false, true})
  {
    for (const bool wide : {false, true})
    {
      Sequence sequence = SmallSequence();
      sequence.Set("ElementType", wide ? "MET_FLOAT" : "MET_USHORT");
      sequence.Set("BinaryDataByteOrderMSB", big ? "True" : "False");
      sequence.pixels.clear();
      for (int p = 0; p < smallWidth * smallHeight * smallFrames; ++p)
      {
        char bytes[4];
        const auto number = static_cast<std::uint16_t>(30000 + p);
        const float real = 0.25f + static_cast<float>(p);
        const std::size_t count = wide ? 4 : 2;
        std::memcpy(bytes, wide ? static_cast<const void*>(&real) : &number, count);
        std::string element(bytes, count);
        sequence.pixels += big ? std::string(element.rbegin(), element.rend()) : element;
      }
      WriteBytes(folder / "wide.mha", sequence.Bytes());
      reader->Modified();
      vtkImageData* const image = Read(reader, folder / "wide.mha");
      ASSERT_EQ(image->GetScalarType(), wide ? VTK_FLOAT : VTK_UNSIGNED_SHORT);
      for (int p = 0; p < smallWidth * smallHeight * smallFrames; ++p)
      {
        EXPECT_EQ(image->GetPointData()->GetScalars()->GetComponent(p, 0), wide ? 0.25 + p : 30000.0 + p);
      }
    }
  }
}

// A sequence of 36 pixels of 16 bits, `add` and more: SmallSequence otherwise.
Sequence ShortSequence(int add, const std::string& type)
{
  Sequence sequence = SmallSequence();
  sequence.Set("ElementType", type);
  sequence.pixels.clear();
  for (int p = 0; p < smallWidth * smallHeight * smallFrames; ++p)
  {
    const auto number = static_cast<std::int16_t>(add + p);
    sequence.pixels += {static_cast<char>(number & 255), static_cast<char>(number >> 8 & 255)};
  }
  return sequence;
}

TEST(SequenceReader, ShortIsReadUnlessNegative)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  WriteBytes(folder / "short.mha", ShortSequence(20000, "MET_SHORT").Bytes());
  vtkImageData* const image = Read(reader, folder / "short.mha");
  ASSERT_EQ(image->GetScalarType(), VTK_UNSIGNED_SHORT);
  EXPECT_EQ(image->GetPointData()->GetScalars()->GetComponent(35, 0), 20035);
  EXPECT_STREQ(reader->GetElementType(), "short");

  WriteBytes(folder / "negative.mha", ShortSequence(-30, "MET_SHORT").Bytes());
  ErrorObserver errors(reader);
  reader->SetFileName((folder / "negative.mha").c_str());
  reader->Update();
  EXPECT_NE(errors.Text().find("has the pixel -30"), std::string::npos) << errors.Text();
}

TEST(SequenceReader, PixelsOfFewBitsAreScaledAndSaid)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  const auto read = [&](int add, double range)
  {
    WriteBytes(folder / "few.mha", ShortSequence(add, "MET_USHORT").Bytes());
    reader->SetPixelRange(range);
    reader->SetFileName((folder / "few.mha").c_str());
    reader->Modified();
    ErrorObserver errors(reader);
    reader->Update();
    return errors.Text();
  };
  const auto pixel = [&](int p) { return reader->GetOutput()->GetPointData()->GetScalars()->GetComponent(p, 0); };
  for (const auto& [add, bits] :
       {std::pair(60, 8), {220, 8}, {221, 10}, {988, 10}, {3000, 12}, {4060, 12}, {16348, 14}})
  {
    SCOPED_TRACE(add);
    const double white = std::pow(2, bits) - 1;
    EXPECT_NE(read(add, 0).find("use " + std::to_string(bits) + " of 16 bits"), std::string::npos);
    EXPECT_EQ(reader->GetUsedPixelRange(), white);
    EXPECT_EQ(pixel(35), std::round((add + 35) * 65535 / white));
  }
  {
    bigus::test::OutputWindow window;
    reader->Modified();
    reader->Update();  // nobody observes it
    EXPECT_NE(window.Take().find("use 14 of 16 bits"), std::string::npos);
  }
  // All 16 bits; too dark to tell; the user's word.
  EXPECT_EQ(read(16349, 0), "");
  EXPECT_EQ(pixel(0), 16349);
  EXPECT_EQ(read(20, 0), "");
  EXPECT_EQ(pixel(35), 55);
  EXPECT_EQ(read(3000, 65535), "");
  EXPECT_EQ(pixel(35), 3035);
  EXPECT_EQ(read(3000, 6000), "");
  EXPECT_EQ(pixel(35), std::round(3035 * 65535 / 6000.0));
  EXPECT_NE(read(3000, 3020).find("has the pixel 3021"), std::string::npos);

  Sequence real = SmallSequence();  // float of another program
  real.Set("ElementType", "MET_FLOAT");
  real.pixels.clear();
  for (int p = 0; p < 36; ++p)
  {
    const auto number = static_cast<float>(7 * p);
    real.pixels += std::string(reinterpret_cast<const char*>(&number), 4);
  }
  WriteBytes(folder / "float.mha", real.Bytes());
  reader->SetPixelRange(255);
  EXPECT_FLOAT_EQ(Read(reader, folder / "float.mha")->GetPointData()->GetScalars()->GetComponent(35, 0), 245.0 / 255);
}

TEST(SequenceReader, ColoursBecomeGrey)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  for (const int channels : {3, 4})
  {
    // Grey drawn in colour is what it was.
    Sequence sequence = SmallSequence();
    sequence.Set("ElementNumberOfChannels", std::to_string(channels));
    std::string pixels;
    for (const char grey : sequence.pixels)
    {
      pixels += std::string(3, grey) + std::string(std::size_t(channels - 3), '\x11');
    }
    sequence.pixels = pixels;
    WriteBytes(folder / "colour.mha", sequence.Bytes());
    reader->Modified();
    ExpectSmall(Read(reader, folder / "colour.mha"));
    EXPECT_EQ(reader->GetElementType(), "unsigned char, " + std::to_string(channels) + " channels");

    const std::string kind = channels == 3 ? "RGB-color" : "vector";
    std::string nrrd = sequence.NrrdBytes(std::to_string(channels) + " 4 3 3", kind + " domain domain list", "gzip",
                                          Compressed(pixels, true));
    nrrd.replace(nrrd.find("dimension: 3"), 12, "dimension: 4");
    WriteBytes(folder / "colour.nrrd", nrrd);
    reader->Modified();
    ExpectSmall(Read(reader, folder / "colour.nrrd"));
  }
  // Pure red, green, blue and white by the weights 0.299, 0.587, 0.114.
  Sequence sequence = SmallSequence();
  sequence.Set("ElementNumberOfChannels", "3");
  sequence.pixels = std::string("\xff\0\0\0\xff\0\0\0\xff\xff\xff\xff", 12) + std::string(96, '\1');
  WriteBytes(folder / "pure.mha", sequence.Bytes());
  reader->Modified();
  vtkDataArray* const greys = Read(reader, folder / "pure.mha")->GetPointData()->GetScalars();
  EXPECT_EQ(greys->GetComponent(0, 0), 76);
  EXPECT_EQ(greys->GetComponent(1, 0), 150);
  EXPECT_EQ(greys->GetComponent(2, 0), 29);
  EXPECT_EQ(greys->GetComponent(3, 0), 255);
}

// Every colour type of PNG, written by VTK.
TEST(SequenceReader, ColourPngsBecomeGrey)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  reader->RequirePosesOff();
  for (const int type : {VTK_UNSIGNED_CHAR, VTK_UNSIGNED_SHORT})
  {
    for (const int channels : {2, 3, 4})
    {
      SCOPED_TRACE(channels);
      vtkNew<vtkImageData> image;
      image->SetDimensions(5, 4, 1);
      image->AllocateScalars(type, channels);
      for (vtkIdType p = 0; p < 20; ++p)
      {
        for (int c = 0; c < channels; ++c)
        {
          const double alpha = channels % 2 == 0 && c + 1 == channels;
          image->GetPointData()->GetScalars()->SetComponent(
              p, c, (alpha ? 200 : double(3 * p)) * (type == VTK_UNSIGNED_CHAR ? 1 : 257));
        }
      }
      vtkNew<vtkPNGWriter> writer;
      writer->SetFileName((folder / "colour.png").c_str());
      writer->SetInputData(image);
      writer->Write();
      reader->Modified();
      vtkImageData* const read = Read(reader, folder / "colour.png");
      ASSERT_EQ(read->GetScalarType(), VTK_UNSIGNED_CHAR);
      for (int j = 0; j < 4; ++j)
      {
        for (int i = 0; i < 5; ++i)
        {
          EXPECT_EQ(read->GetScalarComponentAsDouble(i, j, 0, 0), 3 * (5 * (3 - j) + i));  // VTK's rows go up
        }
      }
    }
  }
}

TEST(SequenceReader, SaysThatImagesMayBeCropped)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  Sequence sequence = SmallSequence();
  sequence.Set("CroppedImageToImageTransform", "1 0 0 2 0 1 0 3 0 0 1 0 0 0 0 1");
  WriteBytes(folder / "cropped.mha", sequence.Bytes());
  reader->SetFileName((folder / "cropped.mha").c_str());
  {
    ErrorObserver warnings(reader);
    reader->Update();
    EXPECT_NE(warnings.Text().find("CroppedImage"), std::string::npos) << warnings.Text();
  }
  EXPECT_STREQ(reader->GetCroppedFrame(), "CroppedImage");
  reader->SetFromFrame("CroppedImage");
  EXPECT_EQ(Read(reader, folder / "cropped.mha")->GetFieldData()->GetArray("ImageToReference")->GetComponent(0, 3),
            0.4);
  EXPECT_STREQ(reader->GetCroppedFrame(), "");
}

// Plus reorders pixels to marked-far and leaves transforms as they are.
// 0.2 x 0.3 mm by the transforms. Whatever a header says is a doubt; the size that is given is taken.
TEST(SequenceReader, SaysThatAHeaderStatesAnotherSizeOfAPixel)
{
  TemporaryFolder folder;
  const auto doubt = [&](const std::string& bytes)
  {
    WriteBytes(folder / "file", bytes);
    vtkNew<vtkBigusSequenceReader> reader;
    ErrorObserver warnings(reader);
    reader->SetFileName((folder / "file").c_str());
    reader->UpdateInformation();
    const std::string text = reader->GetSpacingDoubt();
    EXPECT_EQ(warnings.Text().find(text.empty() ? "by the header" : text) != std::string::npos, !text.empty());
    return text;
  };
  Sequence sequence = SmallSequence();
  const std::string said = "0.2 x 0.3 mm by the transforms, but 0.35 x 0.4 mm by the header (";
  const std::string nrrdPixels = "4 3 3\nspace dimension: 3";
  for (const char* good : {"1 1 1", "0.2 0.3 1", "0.2004 0.2996 4", "0 0 0", "nan 1 1", "much", ""})
  {
    SCOPED_TRACE(good);
    sequence.Set("ElementSpacing", good);
    EXPECT_EQ(doubt(sequence.Bytes()), "");
  }
  sequence.Set("ElementSpacing", "0.35 0.4 1");
  const std::string text = doubt(sequence.Bytes());
  EXPECT_NE(text.find(said + "ElementSpacing)"), std::string::npos) << text;
  EXPECT_NE(text.find("set the image spacing to 0.35 0.4"), std::string::npos) << text;
  sequence.Set("ElementSpacing", "1 1 1");
  sequence.Set(SmallField(0, "ElementSpacing"), "0.35 0.4 1");
  EXPECT_NE(doubt(sequence.Bytes()).find(said + "ElementSpacing)"), std::string::npos);
  sequence.Remove(SmallField(0, "ElementSpacing"));
  EXPECT_NE(doubt(sequence.NrrdBytes(nrrdPixels + "\nspace directions: (0.35,0,0) (0, -0.4, 0) none",
                                     "domain domain list", "raw", sequence.pixels))
                .find(said + "space directions)"),
            std::string::npos);
  EXPECT_NE(doubt(sequence.NrrdBytes("3 4 3\nspacings: 1 0.35 0.4", "list domain domain", "raw", sequence.pixels))
                .find(said + "spacings)"),
            std::string::npos);
  EXPECT_EQ(doubt(sequence.NrrdBytes(nrrdPixels + "\nspace directions: (0.35,0 (0,0.4,0)", "domain domain list", "raw",
                                     sequence.pixels)),
            "");

  vtkNew<vtkBigusSequenceReader> reader;
  sequence.Set("ElementSpacing", "0.35 0.4 1");
  WriteBytes(folder / "file", sequence.Bytes());
  reader->SetImageSpacing(0.35, 0.4);
  vtkImageData* const image = Read(reader, folder / "file");
  EXPECT_STREQ(reader->GetSpacingDoubt(), "");
  for (int c = 0; c < 16; ++c)
  {
    const double expected = c == 0 ? 0.35 : c == 5 ? 0.4 : SmallPose(c / 4, c % 4, 2);
    EXPECT_NEAR(image->GetFieldData()->GetArray("ImageToReference")->GetComponent(2, c), expected, 1e-15);
  }
  for (const double bad : {0.0, -0.4, std::nan("")})
  {
    reader->SetImageSpacing(0.35, bad);
    ErrorObserver errors(reader);
    reader->UpdateInformation();
    EXPECT_NE(errors.Text().find("the image spacing is 0.35 x"), std::string::npos) << errors.Text();
  }
}

TEST(SequenceReader, BringsEveryOrientationToMarkedFar)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  for (const char* side : {"M", "U"})
  {
    for (const char* depth : {"F", "N"})
    {
      for (const char* slices : {"", "A", "D"})
      {
        const std::string flag = std::string(side) + depth + slices;
        SCOPED_TRACE(flag);
        Sequence sequence = SmallSequence();
        sequence.Set("UltrasoundImageOrientation", flag);
        sequence.pixels = Reordered(flag[0] == 'U', flag[1] == 'N');
        WriteBytes(folder / (flag + ".mha"), sequence.Bytes());
        ExpectSmall(Read(reader, folder / (flag + ".mha")));
        EXPECT_EQ(reader->GetOrientation(), flag);
      }
    }
  }
  Sequence unflagged = SmallSequence();
  unflagged.Remove("UltrasoundImageOrientation");
  WriteBytes(folder / "unflagged.mha", unflagged.Bytes());
  ExpectSmall(Read(reader, folder / "unflagged.mha"));
}

TEST(SequenceReader, NrrdByIgsioIsReadByItsOwnNames)
{
  // IGSIO writes other names in NRRD than in MetaImage.
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  Sequence sequence = SmallSequence();
  const auto read = [&](const Sequence& file) -> vtkImageData*
  {
    WriteBytes(folder / "igsio.nrrd", file.NrrdBytes("4 3 3", "domain domain list", "raw", file.pixels));
    reader->SetFileName((folder / "igsio.nrrd").c_str());
    reader->Modified();
    reader->Update();
    return reader->GetOutput();
  };
  vtkNew<vtkImageData> plain;
  plain->DeepCopy(read(sequence));
  ASSERT_EQ(plain->GetNumberOfPoints(), 4 * 3 * 3);

  sequence.Remove("UltrasoundImageOrientation");
  sequence.Set("ultrasound image orientation", "UF");
  vtkImageData* mirrored = read(sequence);
  EXPECT_STREQ(reader->GetOrientation(), "UF");
  for (int i = 0; i < 4; ++i)
  {
    EXPECT_EQ(mirrored->GetScalarComponentAsDouble(i, 1, 2, 0), plain->GetScalarComponentAsDouble(3 - i, 1, 2, 0));
  }

  Sequence rejected = sequence;
  rejected.Set(SmallField(1, "Status"), "INVALID");
  EXPECT_EQ(read(rejected)->GetDimensions()[2], 2);
  EXPECT_NE(std::string(reader->GetRejectionSummary()).find("INVALID"), std::string::npos);

  const auto expectRefused = [&](const Sequence& file, const std::string& words)
  {
    const ErrorObserver errors(reader);
    EXPECT_EQ(read(file)->GetNumberOfPoints(), 0);
    EXPECT_NE(errors.Text().find(words), std::string::npos) << errors.Text();
  };
  Sequence contradicting = sequence;
  contradicting.Set("UltrasoundImageOrientation", "MF");
  expectRefused(contradicting, "remove the one that is wrong");
  Sequence raw = sequence;
  raw.Remove("UltrasoundImageType");
  raw.Set("ultrasound image type", "RF_REAL");
  expectRefused(raw, "BRIGHTNESS");
}

TEST(SequenceReader, ReadsNrrd)
{
  TemporaryFolder folder;
  const Sequence sequence = SmallSequence();
  vtkNew<vtkBigusSequenceReader> reader;

  WriteBytes(folder / "raw.nrrd", sequence.NrrdBytes("4 3 3", "domain domain list", "raw", sequence.pixels));
  ExpectSmall(Read(reader, folder / "raw.nrrd"));
  EXPECT_STREQ(reader->GetFormat(), "NRRD sequence");

  WriteBytes(folder / "gzip.seq.nrrd",
             sequence.NrrdBytes("4 3 3", "domain domain time", "gzip", Compressed(sequence.pixels, true)));
  ExpectSmall(Read(reader, folder / "gzip.seq.nrrd"));
  EXPECT_STREQ(reader->GetEncoding(), "gzip");

  // 3D Slicer puts the list axis first.
  std::string interleaved;
  for (int j = 0; j < smallHeight; ++j)
  {
    for (int i = 0; i < smallWidth; ++i)
    {
      for (int frame = 0; frame < smallFrames; ++frame)
      {
        interleaved += static_cast<char>(SmallPixel(i, j, frame));
      }
    }
  }
  WriteBytes(folder / "first.nrrd", sequence.NrrdBytes("3 4 3", "list domain domain", "raw", interleaved));
  ExpectSmall(Read(reader, folder / "first.nrrd"));

  std::string header = sequence.NrrdBytes("4 3 3", "domain domain list", "raw", "");
  header.replace(header.find("encoding"), 0, "data file: pixels.raw\n");
  WriteBytes(folder / "detached.nhdr", header.substr(0, header.size() - 1));
  WriteBytes(folder / "pixels.raw", sequence.pixels);
  ExpectSmall(Read(reader, folder / "detached.nhdr"));

  std::string fourAxes = sequence.NrrdBytes("4 3 1 3", "domain domain domain list", "raw", sequence.pixels);
  fourAxes.replace(fourAxes.find("dimension: 3"), 12, "dimension: 4");
  WriteBytes(folder / "four.nrrd", fourAxes);
  ExpectSmall(Read(reader, folder / "four.nrrd"));
}

// What axes are that nothing names follows where one of them has a single sample, or as many as colours.
TEST(SequenceReader, ReadsNrrdOfFourAxesWithoutKinds)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  const Sequence sequence = SmallSequence();
  std::string colours;
  for (const char grey : sequence.pixels)
  {
    colours += std::string(3, grey);
  }
  const auto write = [&](const std::string& sizes, const std::string& pixels)
  {
    std::string bytes = sequence.NrrdBytes(sizes, "domain domain list", "raw", pixels);
    bytes.replace(bytes.find("dimension: 3"), 12, "dimension: 4");
    bytes.erase(bytes.find("kinds:"), bytes.find('\n', bytes.find("kinds:")) + 1 - bytes.find("kinds:"));
    WriteBytes(folder / "four.nrrd", bytes);
    reader->Modified();
  };
  for (const char* sizes : {"4 3 1 3", "4 3 3 1", "1 4 3 3", "3 4 3 3"})
  {
    SCOPED_TRACE(sizes);
    write(sizes, sizes[0] == '3' ? colours : sequence.pixels);
    ExpectSmall(Read(reader, folder / "four.nrrd"));
  }
  write("2 4 3 3", sequence.pixels + sequence.pixels);
  ErrorObserver errors(reader);
  reader->SetFileName((folder / "four.nrrd").c_str());
  reader->Update();
  EXPECT_NE(errors.Text().find("kinds must name each of the 4 axes"), std::string::npos) << errors.Text();
}

// SmallSequence's frames as PNG files, the top row first as in any picture.
void WritePngs(const TemporaryFolder& folder, const std::string& prefix)
{
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    vtkNew<vtkImageData> picture;
    picture->SetDimensions(smallWidth, smallHeight, 1);
    picture->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
    for (int j = 0; j < smallHeight; ++j)
    {
      for (int i = 0; i < smallWidth; ++i)
      {
        // VTK's writer takes the last row for the top one.
        picture->SetScalarComponentFromDouble(i, smallHeight - 1 - j, 0, 0, SmallPixel(i, j, frame));
      }
    }
    vtkNew<vtkPNGWriter> writer;
    writer->SetFileName((folder / (prefix + std::to_string(frame) + ".png")).c_str());
    writer->SetInputData(picture);
    writer->Write();
  }
}

TEST(SequenceReader, ReadsCsvWithPngs)
{
  TemporaryFolder folder;
  WritePngs(folder, "frame_");
  vtkNew<vtkBigusSequenceReader> reader;
  WriteBytes(folder / "poses.csv", SmallCsv(true));
  ExpectSmall(Read(reader, folder / "poses.csv"));
  EXPECT_STREQ(reader->GetFormat(), "CSV of poses");
  EXPECT_STREQ(reader->GetEncoding(), "png");

  WriteBytes(folder / "bare.csv", SmallCsv(false));
  reader->SetImagePattern("frame_%d.png");
  ExpectSmall(Read(reader, folder / "bare.csv"));

  reader->SetImagePattern(nullptr);
  reader->SetImageFolder(folder.Path().c_str());
  ExpectSmall(Read(reader, folder / "bare.csv"));

  // Spreadsheets write semicolons or tabs where a comma is the sign of decimals.
  for (const char separator : {';', '\t'})
  {
    std::string csv = SmallCsv(false);
    std::replace(csv.begin(), csv.end(), ',', separator);
    std::replace(csv.begin(), csv.end(), '.', ',');
    for (const char* before : {"", "sep=;\r\n", "\xef\xbb\xbf# by hand\n\n# twice\n", "# "})
    {
      WriteBytes(folder / "commas.csv", before + csv);
      ExpectSmall(Read(reader, folder / "commas.csv"));
    }
  }

  // Numbers count as numbers, whichever way they are written, also after other numbers.
  for (const auto& names : std::vector<std::vector<std::string>>{
           {"f2.png", "f10.png", "f100.png"},
           {"s1_f9.png", "s01_f10.png", "s2_f1.png"},
           {"f09.PNG", "f10.png", "g1.png"},
           {"f18446744073709551615.png", "f18446744073709551616.png", "f018446744073709551617.png"}})
  {
    const std::string images = folder / names[0].substr(0, 2);
    std::filesystem::create_directory(images);
    for (int frame = 0; frame < smallFrames; ++frame)
    {
      std::filesystem::copy_file(folder / ("frame_" + std::to_string(frame) + ".png"),
                                 images + "/" + names[static_cast<std::size_t>(frame)]);
    }
    reader->SetImageFolder(images.c_str());
    ExpectSmall(Read(reader, folder / "bare.csv"));
  }
  reader->SetImageFolder(folder.Path().c_str());

  WritePngs(folder, "padded_00");
  reader->SetImagePattern("padded_%03d.png");
  ExpectSmall(Read(reader, folder / "bare.csv"));
}

// A CSV whose rows are poses of SmallSequence's frames in some order, after what each says of its picture.
std::string NamedCsv(const std::string& title, const std::vector<std::pair<std::string, int>>& rows)
{
  std::string csv = title;
  for (int c = 0; c < 12; ++c)
  {
    csv += ",m" + std::to_string(c / 4) + std::to_string(c % 4);
  }
  for (const auto& [cell, frame] : rows)
  {
    csv += "\n" + cell;
    for (int c = 0; c < 12; ++c)
    {
      csv += "," + std::to_string(SmallPose(c / 4, c % 4, frame));
    }
  }
  return csv + "\n";
}

// Every picture has the pose of its own frame.
void ExpectPairs(vtkImageData* image, const std::vector<int>& frames)
{
  ASSERT_EQ(image->GetDimensions()[2], static_cast<int>(frames.size()));
  for (int k = 0; k < image->GetDimensions()[2]; ++k)
  {
    const int frame = frames[static_cast<std::size_t>(k)];
    EXPECT_EQ(image->GetScalarComponentAsDouble(2, 1, k, 0), SmallPixel(2, 1, frame));
    EXPECT_EQ(image->GetFieldData()->GetArray("ImageToReference")->GetComponent(k, 3), SmallPose(0, 3, frame));
  }
}

// The same rule as in Python's test_sources.py.
TEST(SequenceReader, CsvRowsNameTheirPictures)
{
  TemporaryFolder folder;
  std::filesystem::create_directory(folder / "images");
  const auto read = [&](const std::string& title, const std::vector<std::string>& cells)
  {
    vtkNew<vtkBigusSequenceReader> reader;
    reader->SetImageFolder((folder / "images").c_str());
    WriteBytes(folder / "named.csv", NamedCsv(title, {{cells[2], 2}, {cells[0], 0}, {cells[1], 1}}));
    ExpectPairs(Read(reader, folder / "named.csv"), {0, 1, 2});
    WriteBytes(folder / "fewer.csv", NamedCsv(title, {{cells[2], 2}, {cells[0], 0}}));
    ExpectPairs(Read(reader, folder / "fewer.csv"), {0, 2});
  };
  WritePngs(folder, "images/frame_");
  for (const char* title : {"image", "File", "file name", "FileName", "picture"})
  {
    SCOPED_TRACE(title);
    read(title, {"frame_0.png", "frame_1.png", "frame_2.png"});
    read(title, {"frame_0", "frame_1", "frame_2"});
    read(title, {"images/frame_0.png", "images/frame_1.png", "images/frame_2.png"});
    read(title, {"/far/frame_0.png", "/far/frame_1.png", "/far/frame_2.png"});
    read(title, {"C:\\scan\\frame_0.png", "C:\\scan\\frame_1.png", "C:\\scan\\frame_2.png"});
    read(title, {"0", "1.0", "2"});
  }
  for (const char* title : {"frame", "Frame_ID", "Frame Number", "frame-index", "Index", "ID"})
  {
    SCOPED_TRACE(title);
    read(title, {"0", "1.0", "2e0"});
  }

  // A pattern takes the rows' numbers.
  WriteBytes(folder / "named.csv", NamedCsv("frame", {{"2", 2}, {"0", 0}, {"1", 1}}));
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetImageFolder((folder / "images").c_str());
  reader->SetImagePattern("frame_%d.png");
  ExpectPairs(Read(reader, folder / "named.csv"), {0, 1, 2});

  // Rows with times stay in their order.
  WriteBytes(folder / "timed.csv", NamedCsv("time_s,frame", {{"1,2", 2}, {"2,0", 0}, {"3,1", 1}}));
  ExpectPairs(Read(reader, folder / "timed.csv"), {2, 0, 1});
}

TEST(SequenceReader, CsvSaysHowItTookNumbersOfPictures)
{
  TemporaryFolder folder;
  std::filesystem::create_directory(folder / "images");
  for (const char* name : {"a_9.png", "b_10.png", "b_11.png"})
  {
    WritePngs(folder, "frame_");
    const int frame = name[0] == 'a' ? 0 : name[3] == '0' ? 1 : 2;
    std::filesystem::rename(folder / ("frame_" + std::to_string(frame) + ".png"),
                            folder / ("images/" + std::string(name)));
  }
  using Rows = std::vector<std::pair<std::string, int>>;
  for (const auto& [rows, said] : std::vector<std::pair<Rows, std::string>>{
           {{{"11", 2}, {"9", 0}, {"10", 1}}, "are those of the pictures' names: 11 is b_11.png"},
           {{{"3", 2}, {"1", 0}, {"2", 1}},
            "begin with 1 and reach 3, the number of pictures, so they were counted from 1"},
           {{{"2", 2}, {"1", 1}},
            "begin with 1 and do not reach 3, the number of pictures, so they were counted from 0"},
           {{{"2", 2}, {"0", 0}}, ""}})
  {
    SCOPED_TRACE(said);
    WriteBytes(folder / "named.csv", NamedCsv("frame", rows));
    vtkNew<vtkBigusSequenceReader> reader;
    ErrorObserver warnings(reader);
    reader->SetImageFolder((folder / "images").c_str());
    reader->SetFileName((folder / "named.csv").c_str());
    reader->Update();
    EXPECT_NE(warnings.Text().find(said), std::string::npos) << warnings.Text();
    EXPECT_EQ(warnings.Text().empty(), said.empty()) << warnings.Text();
    std::vector<int> frames;
    for (const auto& row : rows)
    {
      frames.push_back(row.second);
    }
    std::sort(frames.begin(), frames.end());
    ExpectPairs(reader->GetOutput(), frames);
  }
}

TEST(SequenceReader, CsvHasTitlesUnitsAndWhatSpreadsheetsWriteForNoNumber)
{
  TemporaryFolder folder;
  WritePngs(folder, "frame_");
  const std::string good = SmallCsv(true);
  const std::size_t below = good.find('\n') + 1;
  const auto read = [&](const std::string& csv, const std::vector<int>& frames, const std::string& said)
  {
    SCOPED_TRACE(said);
    WriteBytes(folder / "poses.csv", csv);
    vtkNew<vtkBigusSequenceReader> reader;
    ErrorObserver warnings(reader);
    reader->SetFileName((folder / "poses.csv").c_str());
    EXPECT_EQ(reader->CanReadFile((folder / "poses.csv").c_str()), 1);
    reader->Update();
    EXPECT_NE(warnings.Text().find(said), std::string::npos) << warnings.Text();
    ExpectSmall(reader->GetOutput(), frames);
    return reader->GetRejectionSummary() ? std::string(reader->GetRejectionSummary()) : std::string();
  };
  for (const char* title : {"Recorded with NDI on 2024\n", "\xef\xbb\xbfRecorded, by hand\n\n# a comment\n"})
  {
    read(title + good, {0, 1, 2}, "line 1 stands before the names of the columns and was skipped: \"Recorded");
  }
  std::string units = "-,[s]";
  for (int c = 0; c < 16; ++c)
  {
    units += c % 4 == 3 ? ",mm" : ",-";
  }
  read(good.substr(0, below) + units + "\n" + good.substr(below), {0, 1, 2}, "holds units and no pose");
  const std::size_t second = good.find('\n', below) + 1;
  read(good.substr(0, second) + "#" + good.substr(below), {0, 1, 2},
       "1 lines that have as many cells as rows begin with #");

  // Poses first, so that the row begins with what there is not.
  std::string lost = NamedCsv("m30", {{"0", 0}, {"0", 1}, {"0", 2}});
  for (std::size_t at = 0, row = 0; (at = lost.find('\n', at + 1)) != std::string::npos && at + 1 < lost.size(); ++row)
  {
    if (row == 1)
    {
      std::string nothing = "#N/A";
      for (int c = 0; c < 12; ++c)
      {
        nothing += ",#N/A";
      }
      lost.replace(at + 1, lost.find('\n', at + 1) - at - 1, nothing);
    }
  }
  lost.replace(0, 3, "other");
  WriteBytes(folder / "lost.csv", lost);
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetImageFolder(folder.Path().c_str());
  ExpectPairs(Read(reader, folder / "lost.csv"), {0, 2});
  EXPECT_NE(std::string(reader->GetRejectionSummary()).find("#N/A"), std::string::npos)
      << reader->GetRejectionSummary();
}

TEST(SequenceReader, CsvTakesTwelveColumnsQuotesStatusAndWindowsLineEnds)
{
  TemporaryFolder folder;
  WritePngs(folder, "frame_");
  std::string csv = "\xef\xbb\xbfimage,status,timestamp";
  for (int c = 0; c < 12; ++c)
  {
    csv += ",M" + std::to_string(c / 4) + std::to_string(c % 4);
  }
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    csv += "\r\n\"frame_" + std::to_string(frame) + ".png\"," + (frame == 1 ? "INVALID" : "OK") + "," +
           std::to_string(frame) + ".25,.2,0,0," + std::to_string(10 * frame) + ", 0 ,3e-1,0,+5,0,0,1,-7.125";
  }
  WriteBytes(folder / "poses.csv", csv + "\r\n");
  vtkNew<vtkBigusSequenceReader> reader;
  ExpectSmall(Read(reader, folder / "poses.csv"), {0, 2});
  EXPECT_EQ(reader->GetNumberOfRejectedFrames(), 1);
}

// As the table of a tracker is read by Python's sources.py.
TEST(SequenceReader, CsvSaysByColumnsWhichPosesThereAre)
{
  TemporaryFolder folder;
  WritePngs(folder, "frame_");
  const auto write = [&](const std::string& name, const std::vector<std::string>& cells)
  {
    std::string csv = SmallCsv(true);
    csv.insert(0, name + ",");
    std::size_t at = 0;
    for (const std::string& cell : cells)
    {
      at = csv.find('\n', at) + 1;
      csv.insert(at, cell + ",");
    }
    WriteBytes(folder / "poses.csv", csv);
  };
  using Case = std::array<std::string, 3>;  // name, sound, lost
  for (const auto& [name, sound, lost] : {Case{"status", "ok", "MISSING"},
                                          {"Status", "Tracked", "INVALID"},
                                          {"valid", "1", "0"},
                                          {"is_valid", "True", "False"},
                                          {"Tracked", "yes", "no"},
                                          {"visible", "1", ""}})
  {
    SCOPED_TRACE(name + " " + lost);
    write(name, {sound, lost, sound});
    vtkNew<vtkBigusSequenceReader> reader;
    ExpectSmall(Read(reader, folder / "poses.csv"), {0, 2});
    EXPECT_EQ(reader->GetNumberOfRejectedFrames(), 1);
  }
  for (const auto& [name, cell, part] : {Case{"status", "0", "OK where there is a pose"},
                                         {"status", "1", "valid where 1 means so"},
                                         {"tracked", "0.7", "0 or 1 is expected"}})
  {
    SCOPED_TRACE(name + " " + cell);
    write(name, {cell, cell, cell});
    vtkNew<vtkBigusSequenceReader> reader;
    ErrorObserver errors(reader);
    reader->SetFileName((folder / "poses.csv").c_str());
    reader->Update();
    EXPECT_NE(errors.Text().find("row 0, column " + name + ": \"" + cell + "\""), std::string::npos) << errors.Text();
    EXPECT_NE(errors.Text().find(part), std::string::npos) << errors.Text();
  }
}

TEST(SequenceReader, CsvHasTimesOfOtherUnits)
{
  TemporaryFolder folder;
  WritePngs(folder, "frame_");
  using Case = std::tuple<std::string, std::vector<std::string>, double, std::string>;  // name, times, s between, said
  const std::vector<Case> cases = {
      {"timestamp", {"1700000000000000000", "1700000000050000000", "1700000000100000000"}, 0.05, "nanoseconds"},
      {"timestamp", {"1700000000000000", "1700000000050000", "1700000000100000"}, 0.05, "microseconds"},
      {"Time", {"100", "150", "200"}, 0.05, "milliseconds"},
      {"timestamp", {"100", "100.05", "100.1"}, 0.05, ""},
      {"timestamp", {"100", "100", "100"}, 0, ""},
      {"time_ms", {"1", "2", "3"}, 0.001, ""},
      {"t (us)", {"1000", "51000", "101000"}, 0.05, ""},
      {"timestamp_ns", {"7", "100000007", "200000007"}, 0.1, ""},
      {"timestamps_sec", {"1", "2", "3"}, 1, ""}};
  for (const auto& [name, times, step, said] : cases)
  {
    SCOPED_TRACE(name + " " + times[1]);
    std::string csv = SmallCsv(true);
    csv.replace(csv.find("timestamp"), 9, name);
    std::size_t at = 0;
    for (const std::string& time : times)
    {
      at = csv.find(".png,", at) + 5;
      csv.replace(at, csv.find(',', at) - at, time);
    }
    WriteBytes(folder / "poses.csv", csv);
    vtkNew<vtkBigusSequenceReader> reader;
    ErrorObserver warnings(reader);
    reader->SetFileName((folder / "poses.csv").c_str());
    reader->Update();
    vtkDataArray* const read = reader->GetOutput()->GetFieldData()->GetArray("Timestamp");
    ASSERT_NE(read, nullptr);
    for (int k = 1; k < smallFrames; ++k)
    {
      // A double has 2.4e-7 s at the time of day in seconds since 1970.
      EXPECT_NEAR(read->GetComponent(k, 0) - read->GetComponent(k - 1, 0), step, 1e-6);
    }
    EXPECT_EQ(warnings.Text().find("the times are taken for " + said) != std::string::npos, !said.empty())
        << warnings.Text();
  }
}

// Seconds, whatever unit a sequence has; the rule is that of a CSV.
TEST(SequenceReader, SequencesHaveTimesOfOtherUnits)
{
  TemporaryFolder folder;
  for (const auto& [factor, said] : std::vector<std::pair<double, std::string>>{
           {0.05, ""}, {50, "milliseconds"}, {5e4, "microseconds"}, {5e7, "nanoseconds"}})
  {
    Sequence sequence = SmallSequence();
    for (int frame = 0; frame < smallFrames; ++frame)
    {
      sequence.Set(SmallField(frame, "Timestamp"), std::to_string(factor * (frame + 1)));
    }
    WriteBytes(folder / "times.mha", sequence.Bytes());
    WriteBytes(folder / "times.nrrd", sequence.NrrdBytes("4 3 3", "domain domain list", "raw", sequence.pixels));
    for (const char* name : {"times.mha", "times.nrrd"})
    {
      SCOPED_TRACE(name + said);
      vtkNew<vtkBigusSequenceReader> reader;
      ErrorObserver warnings(reader);
      reader->SetFileName((folder / name).c_str());
      reader->Update();
      vtkDataArray* const times = reader->GetOutput()->GetFieldData()->GetArray("Timestamp");
      ASSERT_NE(times, nullptr);
      EXPECT_NEAR(times->GetComponent(2, 0), 0.15, 1e-12);
      EXPECT_NEAR(reader->GetDuration(), 0.1, 1e-12);
      EXPECT_EQ(warnings.Text().find("the times are taken for " + said + ", because they are") != std::string::npos,
                !said.empty())
          << warnings.Text();
    }
  }
}

TEST(SequenceReader, TheTimeAxisOfANrrdSaysItsUnit)
{
  TemporaryFolder folder;
  const Sequence volume = SmallVolume();
  for (const auto& [unit, values, step] : std::vector<std::tuple<std::string, std::string, double>>{
           {"s", "0 50 100", 50}, {"ms", "0 50 100", 0.05}, {"us", "0 50 100", 5e-5}, {"MS", "0 2 4", 0.002}})
  {
    SCOPED_TRACE(unit);
    WriteBytes(folder / "axis.nrrd",
               volume.NrrdBytes("4 3 3",
                                "domain domain list\nunits: \"mm\" \"mm\" \"" + unit +
                                    "\"\naxis 2 index type:=numeric\naxis 2 index values:=" + values,
                                "raw", volume.pixels));
    vtkNew<vtkBigusSequenceReader> reader;
    reader->RequirePosesOff();
    vtkDataArray* const times = Read(reader, folder / "axis.nrrd")->GetFieldData()->GetArray("Timestamp");
    ASSERT_NE(times, nullptr);
    EXPECT_NEAR(times->GetComponent(2, 0), 2 * step, 1e-12);
  }
}

TEST(SequenceReader, SaysThatSomeFramesHaveNoTime)
{
  TemporaryFolder folder;
  for (const char* time : {"", "unknown", "nan"})
  {
    SCOPED_TRACE(time);
    Sequence sequence = SmallSequence();
    sequence.Set(SmallField(1, "Timestamp"), time);
    WriteBytes(folder / "times.mha", sequence.Bytes());
    vtkNew<vtkBigusSequenceReader> reader;
    ErrorObserver warnings(reader);
    reader->SetFileName((folder / "times.mha").c_str());
    reader->Update();
    EXPECT_EQ(reader->GetOutput()->GetFieldData()->GetArray("Timestamp"), nullptr);
    EXPECT_NE(warnings.Text().find("1 of 3 frames have no time, so times are not used"), std::string::npos)
        << warnings.Text();
  }
}

TEST(SequenceReader, HeadersMayBeginWithAByteOrderMark)
{
  TemporaryFolder folder;
  const Sequence sequence = SmallSequence();
  const std::string mark = "\xef\xbb\xbf";
  WriteBytes(folder / "marked.mha", mark + sequence.Bytes());
  WriteBytes(folder / "marked.nrrd", mark + sequence.NrrdBytes("4 3 3", "domain domain list", "raw", sequence.pixels));
  for (const char* name : {"marked.mha", "marked.nrrd"})
  {
    vtkNew<vtkBigusSequenceReader> reader;
    ExpectSmall(Read(reader, folder / name));
  }
}

// Image -> Probe from the configuration, ProbeToTracker forward, ReferenceToTracker backward.
TEST(SequenceReader, ChainsTransformsByName)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    sequence.Remove(SmallField(frame, "ImageToReferenceTransform"));
    sequence.Remove(SmallField(frame, "ImageToReferenceTransformStatus"));
    sequence.Set(SmallField(frame, "ProbeToTrackerTransform"),
                 "1 0 0 " + std::to_string(frame) + " 0 1 0 0 0 0 1 0 0 0 0 1");
    sequence.Set(SmallField(frame, "ProbeToTrackerTransformStatus"), "OK");
    sequence.Set(SmallField(frame, "ReferenceToTrackerTransform"), "0 0 1 4 1 0 0 5 0 1 0 6 0 0 0 1");
    sequence.Set(SmallField(frame, "ReferenceToTrackerTransformStatus"), "OK");
    sequence.Set(SmallField(frame, "ToolToTrackerTransform"), "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
  }
  WriteBytes(folder / "plus.mha", sequence.Bytes());
  WriteBytes(folder / "plus.xml", SmallConfig());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetConfigFileName((folder / "plus.xml").c_str());
  vtkImageData* const image = Read(reader, folder / "plus.mha");
  EXPECT_STREQ(reader->GetTransformChain(), "Image -> Probe -> Tracker -> Reference");
  EXPECT_EQ(reader->GetNumberOfTransforms(), 5);

  // By hand, pixel (1, 1) of frame 2: probe (3, 0, 3), tracker (5, 0, 3), reference: x from tracker y, y from
  // z, z from x, less the offsets.
  const double* pose = static_cast<double*>(image->GetFieldData()->GetArray("ImageToReference")->GetVoidPointer(32));
  const double expected[3] = {0 - 5, 3 - 6, 5 - 4};
  for (int r = 0; r < 3; ++r)
  {
    EXPECT_NEAR(pose[4 * r] + pose[4 * r + 1] + pose[4 * r + 3], expected[r], 1e-12) << r;
  }

  reader->SetToFrame("Tool");
  reader->AssumeMissingStatusOKOn();
  Read(reader, folder / "plus.mha");
  EXPECT_STREQ(reader->GetTransformChain(), "Image -> Probe -> Tracker -> Tool");
  reader->SetFromFrame("Reference");
  reader->SetToFrame("Tracker");
  reader->SetAllowReflectedPoses(1);
  Read(reader, folder / "plus.mha");
  EXPECT_STREQ(reader->GetTransformChain(), "Reference -> Tracker");
}

// As where a scene or a project holds the configuration, and as some editors save text.
TEST(SequenceReader, FindsDefinitionsWhereverTheyLie)
{
  TemporaryFolder folder;
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  const std::string nested = "<Scene><Transform/><Data>" + SmallConfig() + "</Data><Transform/></Scene>";
  std::string wide = "\xFF\xFE";
  for (const char c : nested)
  {
    wide += {c, '\0'};
  }
  for (const std::string& config : {nested, wide})
  {
    WriteBytes(folder / "plus.xml", config);
    vtkNew<vtkBigusSequenceReader> reader;
    reader->SetConfigFileName((folder / "plus.xml").c_str());
    reader->SetToFrame("Probe");
    Read(reader, folder / "small.mha");
    EXPECT_STREQ(reader->GetTransformChain(), "Image -> Probe");
    EXPECT_EQ(reader->GetNumberOfTransforms(), 3);
  }
}

TEST(SequenceReader, FilesOwnTransformGoesBeforeTheConfiguration)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set("ImageToProbeTransform", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
  WriteBytes(folder / "own.mha", sequence.Bytes());
  WriteBytes(folder / "plus.xml", SmallConfig());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetConfigFileName((folder / "plus.xml").c_str());
  reader->SetToFrame("Probe");
  vtkImageData* const image = Read(reader, folder / "own.mha");
  EXPECT_EQ(image->GetFieldData()->GetArray("ImageToReference")->GetComponent(0, 0), 1);
  EXPECT_STREQ(reader->GetTransformSource(1), "header");
}

TEST(SequenceReader, RejectsFramesOneByOneAndSaysWhy)
{
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"nan 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "not finite"},
      {"1 0 0 inf 0 1 0 0 0 0 1 0 0 0 0 1", "not finite"},
      {"1 0 0 0 2 0 0 0 0 0 1 0 0 0 0 1", "singular"},
      {"1 2 0 0 0 0 0 0 0 0 1 0 0 0 0 1", "singular"},
      {"1 0.9 0 0 0 0.1 0 0 0 0 0 0 0 0 0 1", "off a right angle"},
      {"1 0.9 0 0 0 0.1 0 0 0 0 -1 0 0 0 0 1", "off a right angle"},
      {"1 1 0 0 0 1e-4 0 0 0 0 0 0 0 0 0 1", "span no plane"},
      {"0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1", "holds no pose but zeros"},
      {"0.0 0.0 0 0 0 0 0 0 0 0 0 0 0 0 0 0", "holds no pose but zeros"},
      {"MISSING", "holds no pose but \"MISSING\""},
      {"nan nan nan nan nan nan nan nan nan nan nan nan 0 0 0 1", "holds no pose but \"nan\""},
      {"1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2", "not affine"},
      {"1 0 0 0 0 1 0 0 0 0 1 0 0 0 0", "not 16 numbers"},
      {"1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1,5", "not 16 numbers"},
      {"1e999 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "not 16 numbers"},
      {"1e-9 0 0 0 0 1e-9 0 0 0 0 1e-9 0 0 0 0 1", "1e-6"},
      {"1e90 0 0 0 0 1e90 0 0 0 0 1e90 0 0 0 0 1", "1e6"},
      {"1 0 0 0 0 1 0 0 0 0 1 -2e9 0 0 0 1", "farther than 1e9 mm"},
  };
  TemporaryFolder folder;
  for (const auto& [pose, reason] : cases)
  {
    SCOPED_TRACE(pose);
    Sequence sequence = SmallSequence();
    sequence.Set(SmallField(1, "ImageToReferenceTransform"), pose);
    WriteBytes(folder / "one.mha", sequence.Bytes());
    vtkNew<vtkBigusSequenceReader> reader;
    ExpectSmall(Read(reader, folder / "one.mha"), {0, 2});
    ASSERT_EQ(reader->GetNumberOfRejectionReasons(), 1);
    EXPECT_NE(std::string(reader->GetRejectionReason(0)).find(reason), std::string::npos)
        << reader->GetRejectionReason(0);
    EXPECT_EQ(reader->GetRejectionCount(0), 1);
    EXPECT_NE(std::string(reader->GetRejectionSummary()).find("1 of 3 frames rejected"), std::string::npos);
    EXPECT_NE(std::string(reader->GetRejectionSummary()).find("(frame 1)"), std::string::npos);
  }
}

TEST(SequenceReader, HonoursStatuses)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set(SmallField(0, "ImageToReferenceTransformStatus"), "INVALID");
  sequence.Set(SmallField(1, "ImageStatus"), "INVALID");
  WriteBytes(folder / "status.mha", sequence.Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  ExpectSmall(Read(reader, folder / "status.mha"), {2});
  EXPECT_EQ(reader->GetNumberOfRejectionReasons(), 2);
  EXPECT_EQ(reader->GetDuration(), 0);
  EXPECT_EQ(reader->GetPathLength(), 0);

  sequence = SmallSequence();
  sequence.Remove(SmallField(1, "ImageToReferenceTransformStatus"));
  sequence.Remove(SmallField(2, "ImageToReferenceTransform"));
  WriteBytes(folder / "absent.mha", sequence.Bytes());
  ExpectSmall(Read(reader, folder / "absent.mha"), {0});
  reader->AssumeMissingStatusOKOn();
  ExpectSmall(Read(reader, folder / "absent.mha"), {0, 1});
  reader->AssumeMissingStatusOKOff();

  // As a CSV says it.
  sequence = SmallSequence();
  int frame = 0;
  for (const char* word : {"ok", "True", "1"})
  {
    sequence.Set(SmallField(frame, "ImageToReferenceTransformStatus"), word);
    sequence.Set(SmallField(frame++, "ImageStatus"), word);
  }
  WriteBytes(folder / "words.mha", sequence.Bytes());
  ExpectSmall(Read(reader, folder / "words.mha"));

  // The status of every link counts.
  sequence = SmallSequence();
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    sequence.Set(SmallField(frame, "ReferenceToRoomTransform"), "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
    sequence.Set(SmallField(frame, "ReferenceToRoomTransformStatus"), frame == 0 ? "OUT_OF_VIEW" : "OK");
  }
  WriteBytes(folder / "chain.mha", sequence.Bytes());
  reader->SetToFrame("Room");
  ExpectSmall(Read(reader, folder / "chain.mha"), {1, 2});
}

TEST(SequenceReader, KeepsRejectedFramesWhenAsked)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set(SmallField(1, "ImageToReferenceTransformStatus"), "INVALID");
  WriteBytes(folder / "one.mha", sequence.Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->KeepRejectedFramesOn();
  vtkImageData* const image = Read(reader, folder / "one.mha");
  EXPECT_EQ(image->GetDimensions()[2], 3);
  EXPECT_EQ(image->GetFieldData()->GetArray("Status")->GetComponent(1, 0), 0);
  EXPECT_TRUE(std::isnan(image->GetFieldData()->GetArray("ImageToReference")->GetComponent(1, 0)));
  EXPECT_EQ(image->GetScalarComponentAsDouble(2, 1, 1, 0), SmallPixel(2, 1, 1));
}

// Pixels lie where the first two columns say, whatever the third is, also after a calibration without one.
TEST(SequenceReader, MakesAThirdColumnThatIsNone)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence(), chain = SmallSequence();
  const auto pose = [](int frame, double third)
  {
    std::string text;
    for (int k = 0; k < 16; ++k)
    {
      text += (k ? " " : "") + std::to_string((k % 4 == 2 ? third : 1) * SmallPose(k / 4, k % 4, frame));
    }
    return text;
  };
  sequence.Set(SmallField(0, "ImageToReferenceTransform"), pose(0, 0));
  sequence.Set(SmallField(2, "ImageToReferenceTransform"), pose(2, -3));
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    chain.Set(SmallField(frame, "ReferenceToRoomTransform"), "1 0 0 0 0 1 0 0 0 0 1 7 0 0 0 1");
    chain.Set(SmallField(frame, "ReferenceToRoomTransformStatus"), "OK");
    chain.Set(SmallField(frame, "ImageToReferenceTransform"), pose(frame, 0));
  }
  WriteBytes(folder / "some.mha", sequence.Bytes());
  WriteBytes(folder / "chain.mha", chain.Bytes());
  for (const bool isChain : {false, true})
  {
    SCOPED_TRACE(isChain);
    vtkNew<vtkBigusSequenceReader> reader;
    reader->SetToFrame(isChain ? "Room" : "Reference");
    reader->SetFileName((folder / (isChain ? "chain.mha" : "some.mha")).c_str());
    ErrorObserver warnings(reader);
    reader->Update();
    vtkImageData* const image = reader->GetOutput();
    ASSERT_EQ(image->GetDimensions()[2], 3);
    EXPECT_EQ(reader->GetNumberOfMadeAxes(), isChain ? 3 : 2);
    EXPECT_NE(warnings.Text().find((isChain ? "third column of 3" : "third column of 2") + std::string(" of 3 poses")),
              std::string::npos)
        << warnings.Text();
    for (int frame = 0; frame < 3; ++frame)
    {
      const double* read = image->GetFieldData()->GetArray("ImageToReference")->GetTuple(frame);
      for (int k = 0; k < 16; ++k)  // the third column that it was, which is that of SmallPose
      {
        EXPECT_NEAR(read[k], SmallPose(k / 4, k % 4, frame) + (isChain && k == 11 ? 7 : 0), 1e-12) << k;
      }
    }
  }
}

TEST(SequenceReader, KeepsTheThirdColumnOfReflectedPosesWhenAsked)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set(SmallField(1, "ImageToReferenceTransform"), "0.2 0 0 0 0 -0.2 0 0 0 0 0.2 0 0 0 0 1");
  WriteBytes(folder / "reflected.mha", sequence.Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->AllowReflectedPosesOn();
  vtkImageData* const image = Read(reader, folder / "reflected.mha");
  EXPECT_EQ(image->GetFieldData()->GetArray("ImageToReference")->GetComponent(1, 10), 0.2);
  EXPECT_EQ(reader->GetNumberOfMadeAxes(), 0);
}

TEST(SequenceReader, ClipsToARectangle)
{
  TemporaryFolder folder;
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetClipModeToRectangle();
  reader->SetClipRectangle(1, 1, 2, 100);
  vtkImageData* const image = Read(reader, folder / "small.mha");
  for (int j = 0; j < smallHeight; ++j)
  {
    for (int i = 0; i < smallWidth; ++i)
    {
      const bool inside = i >= 1 && i < 3 && j >= 1;
      EXPECT_EQ(image->GetFieldData()->GetArray("Mask")->GetComponent(j * smallWidth + i, 0), inside);
      EXPECT_EQ(image->GetScalarComponentAsDouble(i, j, 2, 0), inside ? SmallPixel(i, j, 2) : 0);
    }
  }
}

TEST(SequenceReader, ClipsToAFan)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set("DimSize", "41 31 1");
  sequence.pixels = std::string(41 * 31, '\x7f');
  for (int frame = 1; frame < smallFrames; ++frame)
  {
    for (const char* name :
         {"ImageToReferenceTransform", "ImageToReferenceTransformStatus", "Timestamp", "ImageStatus"})
    {
      sequence.Remove(SmallField(frame, name));
    }
  }
  WriteBytes(folder / "fan.mha", sequence.Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetClipModeToFan();
  reader->SetFanApex(20, -5);
  reader->SetFanRadii(10, 30);
  reader->SetFanAngles(-45, 30);
  vtkImageData* const image = Read(reader, folder / "fan.mha");
  const auto lit = [image](int i, int j) { return image->GetScalarComponentAsDouble(i, j, 0, 0) != 0; };
  EXPECT_TRUE(lit(20, 5));    // on the axis, at the inner radius
  EXPECT_FALSE(lit(20, 4));   // nearer
  EXPECT_TRUE(lit(20, 25));   // at the outer radius
  EXPECT_FALSE(lit(20, 26));  // farther
  EXPECT_TRUE(lit(8, 7));     // 45 degrees towards -i
  EXPECT_FALSE(lit(32, 7));   // 45 degrees towards +i, beyond 30
  EXPECT_TRUE(lit(26, 8));    // 24.8 degrees
  EXPECT_FALSE(lit(0, 30));   // radius 40
}

TEST(SequenceReader, MasksPixelsThatAreNeverLit)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  for (int frame = 0; frame < smallFrames; ++frame)
  {
    sequence.pixels[static_cast<std::size_t>(12 * frame + 5)] = 0;
  }
  sequence.pixels[7] = 0;  // dark in one frame only
  WriteBytes(folder / "dark.mha", sequence.Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  vtkDataArray* const mask = Read(reader, folder / "dark.mha")->GetFieldData()->GetArray("Mask");
  for (int p = 0; p < 12; ++p)
  {
    EXPECT_EQ(mask->GetComponent(p, 0), p != 5) << p;
  }
  reader->AutoMaskOff();
  EXPECT_EQ(Read(reader, folder / "dark.mha")->GetFieldData()->GetArray("Mask"), nullptr);
}

TEST(SequenceReader, ReadsOneFrame)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  for (int frame = 1; frame < smallFrames; ++frame)
  {
    for (const char* name :
         {"ImageToReferenceTransform", "ImageToReferenceTransformStatus", "Timestamp", "ImageStatus"})
    {
      sequence.Remove(SmallField(frame, name));
    }
  }
  sequence.pixels.resize(12);
  for (const char* size : {"4 3 1", "4 3"})
  {
    sequence.Set("NDims", std::string(size).size() > 3 ? "3" : "2");
    sequence.Set("DimSize", size);
    WriteBytes(folder / "one.mha", sequence.Bytes());
    vtkNew<vtkBigusSequenceReader> reader;
    ExpectSmall(Read(reader, folder / "one.mha"), {0});
    EXPECT_EQ(reader->GetPathLength(), 0);
  }
}

TEST(SequenceReader, ReadsPlainImagesWhenPosesAreNotRequired)
{
  TemporaryFolder folder;
  const Sequence volume = SmallVolume();
  WriteBytes(folder / "plain.mha", volume.Bytes());
  WriteBytes(folder / "plain.nrrd",
             volume.NrrdBytes("4 3 3", "domain domain domain", "gzip", Compressed(volume.pixels, true)));
  vtkNew<vtkImageData> slice;  // the middle one; VTK writes its last row first
  slice->SetExtent(0, smallWidth - 1, 0, smallHeight - 1, 0, 0);
  slice->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  for (int j = 0; j < smallHeight; ++j)
  {
    for (int i = 0; i < smallWidth; ++i)
    {
      slice->SetScalarComponentFromDouble(i, smallHeight - 1 - j, 0, 0, SmallPixel(i, j, 1));
    }
  }
  vtkNew<vtkPNGWriter> png;
  png->SetFileName((folder / "plain.png").c_str());
  png->SetInputData(slice);
  png->Write();

  for (const char* name : {"plain.mha", "plain.nrrd", "plain.png"})
  {
    SCOPED_TRACE(name);
    vtkNew<vtkBigusSequenceReader> reader;
    reader->RequirePosesOff();
    vtkImageData* const image = Read(reader, folder / name);
    const bool one = std::string(name) == "plain.png";
    int size[3];
    image->GetDimensions(size);
    ASSERT_EQ(size[0], smallWidth);
    ASSERT_EQ(size[1], smallHeight);
    ASSERT_EQ(size[2], one ? 1 : smallFrames);
    for (int k = 0; k < size[2]; ++k)
    {
      for (int j = 0; j < smallHeight; ++j)
      {
        for (int i = 0; i < smallWidth; ++i)
        {
          EXPECT_EQ(image->GetScalarComponentAsDouble(i, j, k, 0), SmallPixel(i, j, one ? 1 : k));
        }
      }
    }
    EXPECT_EQ(image->GetFieldData()->GetArray("ImageToReference"), nullptr);
    EXPECT_EQ(reader->GetNumberOfAcceptedFrames(), size[2]);
    EXPECT_STREQ(reader->GetTransformChain(), "");
    double pixel[2];
    reader->GetPixelSize(pixel);
    EXPECT_EQ(pixel[0], 0);  // unknown

    reader->RequirePosesOn();
    ErrorObserver errors(reader);
    reader->Update();
    EXPECT_EQ(errors.Errors().size(), 1u) << errors.Text();
    EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 0);
  }
}

// A volume sequence of one slice a frame as 3D Slicer writes it, the list axis last, or first as it did before.
TEST(SequenceReader, ReadsSlicersVolumeSequences)
{
  TemporaryFolder folder;
  const Sequence volume = SmallVolume();
  std::string interleaved;
  for (std::size_t pixel = 0; pixel < 12; ++pixel)
  {
    for (std::size_t frame = 0; frame < smallFrames; ++frame)
    {
      interleaved += volume.pixels[12 * frame + pixel];
    }
  }
  const std::string directions = "(1,0,0) (0,1,0) (0,0,1)";
  for (const bool isLast : {true, false})
  {
    SCOPED_TRACE(isLast);
    std::string bytes =
        volume.NrrdBytes(isLast ? "4 3 1 3" : "3 4 3 1",
                         (isLast ? "domain domain domain list" : "list domain domain domain") +
                             std::string("\nspace: left-posterior-superior\nspace directions: ") +
                             (isLast ? directions + " none" : "none " + directions) +
                             "\nlabels: " + (isLast ? R"("" "" "" "time")" : R"("time" "" "" "")") +
                             "\nunits: " + (isLast ? R"("" "" "" "s")" : R"("s" "" "" "")") +
                             "\nspace origin: (0,0,0)\nmeasurement frame: (1,0,0) (0,1,0) (0,0,1)\nDataNodeClassName:="
                             "vtkMRMLScalarVolumeNode\naxis " +
                             (isLast ? "3" : "0") + " index type:=numeric\naxis " + (isLast ? "3" : "0") +
                             " index values:=0.25 1.25 2.25",
                         "raw", isLast ? volume.pixels : interleaved);
    bytes.replace(bytes.find("dimension: 3"), 12, "dimension: 4");
    WriteBytes(folder / "images.seq.nrrd", bytes);
    vtkNew<vtkBigusSequenceReader> reader;
    reader->RequirePosesOff();
    vtkImageData* const image = Read(reader, folder / "images.seq.nrrd");
    ASSERT_EQ(image->GetDimensions()[2], smallFrames);
    vtkDataArray* const times = image->GetFieldData()->GetArray("Timestamp");
    ASSERT_NE(times, nullptr);
    for (int frame = 0; frame < smallFrames; ++frame)
    {
      EXPECT_EQ(times->GetComponent(frame, 0), frame + 0.25);
      EXPECT_EQ(image->GetScalarComponentAsDouble(3, 1, frame, 0), SmallPixel(3, 1, frame));
    }
  }
}

TEST(SequenceReader, TransformsCountWhetherPosesAreRequiredOrNot)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set(SmallField(1, "ImageToReferenceTransformStatus"), "INVALID");
  WriteBytes(folder / "tracked.mha", sequence.Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->RequirePosesOff();
  ExpectSmall(Read(reader, folder / "tracked.mha"), {0, 2});
}

TEST(SequenceReader, StopsWhenAborted)
{
  TemporaryFolder folder;
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  ErrorObserver errors(reader);
  vtkNew<vtkCallbackCommand> abort;
  abort->SetCallback([](vtkObject* caller, unsigned long, void*, void*)
                     { static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1); });
  const unsigned long tag = reader->AddObserver(vtkCommand::ProgressEvent, abort);
  reader->SetFileName((folder / "small.mha").c_str());
  reader->Update();
  EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 0);
  EXPECT_TRUE(errors.Errors().empty()) << errors.Text();
  reader->RemoveObserver(tag);
  reader->SetAbortExecute(0);
  ExpectSmall(Read(reader, folder / "small.mha"));
}

TEST(SequenceReader, ReadsTheLiverSweep)
{
  BIGUS_REQUIRE_DATA(path, "liver-sweep/liver_sweep.igs.mha");
  vtkNew<vtkBigusSequenceReader> reader;
  vtkImageData* const image = Read(reader, path);
  EXPECT_EQ(image->GetDimensions()[0], 739);
  EXPECT_EQ(image->GetDimensions()[1], 593);
  EXPECT_EQ(image->GetDimensions()[2], 140);
  double pixel[2], spacing[3];
  reader->GetPixelSize(pixel);
  reader->GetPlaneSpacing(spacing);
  EXPECT_NEAR(pixel[0], 0.31482, 1e-5);
  EXPECT_NEAR(pixel[1], 0.31482, 1e-5);
  EXPECT_NEAR(reader->GetPathLength(), 81, 0.5);
  EXPECT_GT(spacing[1], 0.3);
  EXPECT_LT(spacing[1], 0.6);
  // What is lit is the fan that the data's description gives (video compression left
  // faint blocks along its rim).
  vtkDataArray* const mask = image->GetFieldData()->GetArray("Mask");
  double inside[2] = {0, 0};
  double outside[2] = {0, 0};
  for (int j = 0; j < 593; ++j)
  {
    for (int i = 0; i < 739; ++i)
    {
      const double radius = std::hypot(i - 369.0, j + 139.329);
      const double angle = std::atan2(i - 369.0, j + 139.329) * 180 / std::acos(-1.0);
      const bool fan = radius > 161.341 && radius < 724.352 && std::abs(angle) < 30.28;
      (fan ? inside : outside)[mask->GetComponent(j * 739 + i, 0) != 0] += 1;
    }
  }
  EXPECT_GT(inside[1] / (inside[0] + inside[1]), 0.99);
  EXPECT_LT(outside[1] / (outside[0] + outside[1]), 0.15);
}

TEST(SequenceReader, ReadsTheBrainSweep)
{
  BIGUS_REQUIRE_DATA(path, "brain-sweep/us_brain_sweep.igs.mha");
  vtkNew<vtkBigusSequenceReader> reader;
  vtkImageData* const image = Read(reader, path);
  EXPECT_EQ(image->GetDimensions()[0], 640);
  EXPECT_EQ(image->GetDimensions()[1], 480);
  EXPECT_EQ(image->GetDimensions()[2], 40);
  double pixel[2], spacing[3];
  reader->GetPixelSize(pixel);
  reader->GetPlaneSpacing(spacing);
  EXPECT_NEAR(pixel[0], 0.20610, 1e-5);
  EXPECT_NEAR(pixel[1], 0.20613, 1e-5);
  EXPECT_NEAR(spacing[0], 0.06, 0.05);
  EXPECT_NEAR(spacing[2], 3.6, 0.05);
  EXPECT_NEAR(reader->GetPathLength(), 65.5, 0.5);
}

// The Plus toolkit put the corner of its reconstruction where its own poses put the corner of the frames.
TEST(SequenceReader, PlacesTheSpinePhantomWherePlusDoes)
{
  BIGUS_REQUIRE_DATA(path, "spine-phantom/SpinePhantomFreehand.igs.mha");
  BIGUS_REQUIRE_DATA(config, "spine-phantom/PlusDeviceSet_SpinePhantomFreehandReconstructionOnly.xml");
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetConfigFileName(config.c_str());
  vtkImageData* const image = Read(reader, path);
  EXPECT_EQ(image->GetDimensions()[0], 820);
  EXPECT_EQ(image->GetDimensions()[1], 616);
  EXPECT_EQ(image->GetDimensions()[2], 21);
  EXPECT_STREQ(reader->GetOrientation(), "MFA");
  EXPECT_STREQ(reader->GetTransformChain(), "Image -> Probe -> Tracker -> Reference");
  double bounds[6];
  reader->GetBounds(bounds);
  EXPECT_NEAR(bounds[0], -74.5217, 1e-4);
  EXPECT_NEAR(bounds[2], 165.573, 1e-3);
  EXPECT_NEAR(bounds[4], 29.072, 1e-3);
}

}  // namespace
}  // namespace bigus::test
