// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Readers given thousands of small damaged files, the same ones in every run: they may refuse, with one
// error, or read something sound, but neither crash nor allocate what the file cannot hold. What was read is used: sweeps
// are inspected, planes rendered, a field is moved. Run it under the sanitizers too.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <functional>
#include <random>

#include "Core/Inspection/Inspection.h"
#include "Data/SweepData.h"
#include "Fuzz/Structured.h"
#include "IO/Formats/LinearTransform.h"
#include "IO/SmallFiles.h"
#include "Support/ErrorObserver.h"
#include "Support/TestSupport.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusFieldWriter.h"
#include "vtkBigusPoseReader.h"
#include "vtkBigusSequenceReader.h"
#include "vtkDataArray.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkTable.h"

namespace bigus::test
{
namespace
{

constexpr int mutationsPerKind = 2000;

// One to four random changes of a kind that files suffer.
std::string Mutated(std::string bytes, std::mt19937_64& random)
{
  static const std::vector<std::string> words = {"0",
                                                 "-1",
                                                 "1",
                                                 "nan",
                                                 "inf",
                                                 "-inf",
                                                 "1e308",
                                                 "2147483647",
                                                 "2147483648",
                                                 "4294967296",
                                                 "9223372036854775807",
                                                 "18446744073709551616",
                                                 "0x10",
                                                 "1,5",
                                                 "",
                                                 " ",
                                                 "\n",
                                                 "\n\n",
                                                 "=",
                                                 ":=",
                                                 "LOCAL",
                                                 "LIST",
                                                 "../x",
                                                 "%d",
                                                 "\xff",
                                                 "\"",
                                                 "]",
                                                 "{"};
  const auto below = [&random](std::size_t n) { return n == 0 ? 0 : static_cast<std::size_t>(random() % n); };
  for (std::size_t change = 1 + below(4); change > 0; --change)
  {
    const std::size_t at = below(bytes.size() + 1);
    switch (below(7))
    {
      case 0:  // a bit
        if (at < bytes.size())
        {
          bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        }
        break;
      case 1:  // a byte
        bytes.insert(at, 1, static_cast<char>(random()));
        break;
      case 2:  // a piece lost
        bytes.erase(at, below(20));
        break;
      case 3:  // a piece twice
        bytes.insert(at, bytes.substr(below(bytes.size()), below(40)));
        break;
      case 4:  // a telling word
        bytes.insert(at, words[below(words.size())]);
        break;
      case 5:  // a number replaced
      {
        const std::size_t begin = bytes.find_first_of("0123456789", at);
        if (begin != std::string::npos)
        {
          const std::size_t end = bytes.find_first_not_of("0123456789.e-", begin);
          bytes.replace(begin, (end == std::string::npos ? bytes.size() : end) - begin, words[below(words.size())]);
        }
        break;
      }
      default:  // the end lost
        if (below(4) == 0)
        {
          bytes.resize(at);
        }
    }
  }
  return bytes;
}

double PeakMegabytes()
{
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

// Reads mutations of `bytes` under `name`; `sound` looks at what a reader that did not complain has made.
void Torture(const TemporaryFolder& folder, vtkAlgorithm* reader, const std::string& name, const std::string& bytes,
             std::uint64_t seed, const std::function<void(const std::string&)>& setFileName,
             const std::function<void()>& sound)
{
  std::mt19937_64 random(seed);
  int refused = 0;
  const double before = PeakMegabytes();
  for (int i = 0; i < mutationsPerKind; ++i)
  {
    SCOPED_TRACE(name + " mutation " + std::to_string(i));
    WriteBytes(folder / name, Mutated(bytes, random));
    ErrorObserver errors(reader);
    setFileName(folder / name);
    reader->Modified();
    reader->Update();
    const auto isError = [](const std::string& text) { return text.rfind("ERROR", 0) == 0; };  // else a warning
    const auto found = std::count_if(errors.Errors().begin(), errors.Errors().end(), isError);
    ASSERT_LE(found, 1) << errors.Text();
    refused += static_cast<int>(found);
    if (found == 0)
    {
      sound();
    }
  }
  // AddressSanitizer also keeps what was freed, up to its quarantine (64 MB in the test preset, 256 MB without it).
  EXPECT_LT(PeakMegabytes() - before, 300.0);
  EXPECT_GT(refused, mutationsPerKind / 10);  // the damage is real...
  EXPECT_LT(refused, mutationsPerKind);       // ...but not total
}

/// A sweep may be refused, as one of a single black frame is.
void InspectSweep(vtkImageData* image)
{
  fuzz::IsAccepted([image] { Inspect(SweepFromImage(image).sweep); });
}

void TortureSequence(const std::string& name, const std::string& bytes, std::uint64_t seed)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetImagePattern("no_%d.png");
  Torture(
      folder, reader, name, bytes, seed, [&](const std::string& file) { reader->SetFileName(file.c_str()); },
      [&]
      {
        vtkImageData* const image = reader->GetOutput();
        ASSERT_GT(image->GetNumberOfPoints(), 0);
        ASSERT_EQ(image->GetPointData()->GetScalars()->GetNumberOfTuples(), image->GetNumberOfPoints());
        ASSERT_EQ(image->GetFieldData()->GetArray("ImageToReference")->GetNumberOfTuples(), image->GetDimensions()[2]);
        InspectSweep(image);
      });
}

TEST(Mutations, RawMetaImage)
{
  TortureSequence("raw.mha", SmallSequence().Bytes(), 1);
}

TEST(Mutations, CompressedMetaImage)
{
  Sequence sequence = SmallSequence();
  sequence.Set("CompressedData", "True");
  sequence.pixels = Compressed(sequence.pixels);
  TortureSequence("zlib.mha", sequence.Bytes(), 2);
}

TEST(Mutations, Nrrd)
{
  const Sequence sequence = SmallSequence();
  TortureSequence("raw.nrrd", sequence.NrrdBytes("4 3 3", "domain domain list", "raw", sequence.pixels), 3);
  TortureSequence("first.nrrd",
                  sequence.NrrdBytes("3 4 3", "list domain domain", "gzip", Compressed(sequence.pixels, true)), 4);
}

TEST(Mutations, PlainVolume)
{
  TemporaryFolder folder;
  const Sequence volume = SmallVolume();
  vtkNew<vtkBigusSequenceReader> reader;
  reader->RequirePosesOff();
  const auto torture = [&](const std::string& name, const std::string& bytes, std::uint64_t seed)
  {
    Torture(
        folder, reader, name, bytes, seed, [&](const std::string& file) { reader->SetFileName(file.c_str()); },
        [&]
        {
          vtkImageData* const image = reader->GetOutput();
          ASSERT_GT(image->GetNumberOfPoints(), 0);
          ASSERT_EQ(image->GetPointData()->GetScalars()->GetNumberOfTuples(), image->GetNumberOfPoints());
        });
  };
  torture("plain.mha", volume.Bytes(), 13);
  torture("plain.nrrd", volume.NrrdBytes("4 3 3", "domain domain domain", "raw", volume.pixels), 14);
}

void TorturePoses(const std::string& name, const std::string& bytes, std::uint64_t seed)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusPoseReader> reader;
  Torture(
      folder, reader, name, bytes, seed, [&](const std::string& file) { reader->SetFileName(file.c_str()); },
      [&]
      {
        vtkTable* const table = reader->GetOutput();
        ASSERT_GT(table->GetNumberOfRows(), 0);
        auto* const poses = vtkDataArray::SafeDownCast(table->GetColumnByName("ImageToReference"));
        std::vector<SlicePlane> planes;
        for (vtkIdType row = 0; row < table->GetNumberOfRows(); ++row)
        {
          Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose;
          poses->GetTuple(row, pose.data());
          planes.push_back(SlicePlane::FromImageToReference(pose, 4, 3));
        }
        std::string wrong;
        fuzz::IsAccepted([&] { wrong = fuzz::WrongSlices(planes); });
        ASSERT_EQ(wrong, "");
      });
}

TEST(Mutations, CsvPoses)
{
  TorturePoses("poses.csv", SmallCsv(false), 5);
}

TEST(Mutations, Markups)
{
  TorturePoses("plane.mrk.json", SmallMarkup(), 6);
}

TEST(Mutations, Configuration)
{
  TemporaryFolder folder;
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName((folder / "small.mha").c_str());
  Torture(
      folder, reader, "plus.xml", SmallConfig(), 7,
      [&](const std::string& file) { reader->SetConfigFileName(file.c_str()); },
      [&]
      {
        ASSERT_EQ(reader->GetOutput()->GetNumberOfPoints(), 36);
        InspectSweep(reader->GetOutput());
      });
}

TEST(Mutations, Transforms)
{
  const TemporaryFolder folder;
  const std::string path = folder / "t.tfm",
                    sound =
                        "#Insight Transform File V1.0\n#Transform 0\nTransform: Similarity3DTransform_double_3_3\n"
                        "Parameters: 0.1 0.2 0.3 4 5 6 2\nFixedParameters: 0 0 0\n";
  std::mt19937_64 random(15);
  int moved = 0;
  for (int i = 0; i < mutationsPerKind; ++i)
  {
    WriteBytes(path, Mutated(sound, random));
    moved += fuzz::IsAccepted([&] { Transformed(fuzz::UsualField(), ReadObjectMatrix(path, i % 2 == 0)).Validate(); });
  }
  EXPECT_GT(moved, 50);  // most damage bends a line, a name or space itself, and is refused
  EXPECT_LT(moved, mutationsPerKind * 9 / 10);
}

// A PNG's checksums stop nearly every mutation, so these are made of its chunks with the checksums set right.
TEST(Mutations, Png)
{
  const auto chunk = [](const std::string& type, const std::string& data)
  {
    const auto number = [](unsigned long n)
    {
      return std::string{static_cast<char>(n >> 24), static_cast<char>(n >> 16), static_cast<char>(n >> 8),
                         static_cast<char>(n)};
    };
    const std::string body = type + data;
    return number(data.size()) + body +
           number(crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size())));
  };
  TemporaryFolder folder;
  WriteBytes(folder / "poses.csv", SmallCsv(true));
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName((folder / "poses.csv").c_str());
  std::mt19937_64 random(8);
  int refused = 0;
  for (int i = 0; i < mutationsPerKind; ++i)
  {
    std::string rows;
    for (int row = 0; row < 3; ++row)
    {
      rows += static_cast<char>(random() % (i % 8 == 0 ? 6 : 5));  // the filter; 5 is none
      rows += std::string(4, static_cast<char>(random()));
    }
    std::string header("\0\0\0\4\0\0\0\3\x08\0\0\0\0", 13);
    std::string data = Compressed(rows);
    if (i % 4 == 1)
    {
      header = Mutated(header, random);
    }
    if (i % 4 == 2)
    {
      data = Mutated(data, random);
    }
    std::string png = "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + chunk("IDAT", data.substr(0, 5)) +
                      chunk("IDAT", data.substr(std::min<std::size_t>(5, data.size()))) + chunk("IEND", "");
    if (i % 4 == 3)
    {
      png = Mutated(png, random);
    }
    for (int frame = 0; frame < smallFrames; ++frame)
    {
      WriteBytes(folder / ("frame_" + std::to_string(frame) + ".png"), png);
    }
    ErrorObserver errors(reader);
    reader->Modified();
    reader->Update();
    ASSERT_LE(errors.Errors().size(), 1u) << errors.Text();
    refused += errors.Errors().empty() ? 0 : 1;
  }
  EXPECT_GT(refused, mutationsPerKind / 10);
  EXPECT_LT(refused, mutationsPerKind * 9 / 10);
}

vtkSmartPointer<vtkPolyData> SmallField()
{
  auto field = vtkSmartPointer<vtkPolyData>::New();
  vtkNew<vtkPoints> points;
  const auto add = [](vtkFieldData* data, const char* name, int components, int tuples)
  {
    vtkNew<vtkDoubleArray> array;
    array->SetName(name);
    array->SetNumberOfComponents(components);
    array->SetNumberOfTuples(tuples);
    array->Fill(0.5);
    data->AddArray(array);
  };
  for (int i = 0; i < 3; ++i)
  {
    points->InsertNextPoint(i, 2 * i, 3 * i);
  }
  field->SetPoints(points);
  add(field->GetPointData(), "Scale", 3, 3);
  add(field->GetPointData(), "Rotation", 4, 3);
  add(field->GetPointData(), "Reflectivity", 1, 3);
  add(field->GetFieldData(), "Gamma", 1, 1);
  add(field->GetFieldData(), "ElevationSigma", 1, 1);
  return field;
}

void TortureField(const TemporaryFolder& folder, const std::string& name, const std::string& bytes, std::uint64_t seed)
{
  vtkNew<vtkBigusFieldReader> reader;
  Torture(
      folder, reader, name, bytes, seed, [&](const std::string& file) { reader->SetFileName(file.c_str()); },
      [&]
      {
        vtkPolyData* const field = reader->GetOutput();
        for (vtkIdType i = 0; i < field->GetNumberOfPoints(); ++i)
        {
          ASSERT_GT(field->GetPointData()->GetArray("Scale")->GetComponent(i, 2), 0);
        }
      });
}

TEST(Mutations, Ply)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusFieldWriter> writer;
  writer->SetFileName((folder / "field.ply").c_str());
  writer->SetInputData(SmallField());
  writer->Write();
  const std::string binary = ReadBytes(folder / "field.ply");
  TortureField(folder, "binary.ply", binary, 9);

  std::string ascii = binary.substr(0, binary.find("end_header\n") + 11);
  ascii.replace(ascii.find("binary_little_endian"), 20, "ascii");
  for (int i = 0; i < 3; ++i)
  {
    ascii += "1 2 3 0 0 0 0 0 0 0 -1 -1 -1 1 0 0 0 0.25\n";
  }
  TortureField(folder, "ascii.ply", ascii, 10);
}

// Our own encoding; others are VTK's to read.
TEST(Mutations, Vtp)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusFieldWriter> writer;
  writer->SetFileName((folder / "field.vtp").c_str());
  writer->SetInputData(SmallField());
  writer->Write();
  TortureField(folder, "appended.vtp", ReadBytes(folder / "field.vtp"), 11);
}

// The index, its pieces sound.
TEST(Mutations, Pvtp)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusFieldWriter> writer;
  writer->SetFileName((folder / "field.pvtp").c_str());
  writer->SetInputData(SmallField());
  writer->SetNumberOfPieces(2);
  writer->Write();
  TortureField(folder, "index.pvtp", ReadBytes(folder / "field.pvtp"), 12);
}

}  // namespace
}  // namespace bigus::test
