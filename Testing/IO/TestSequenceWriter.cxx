// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What is written reads back to the last bit, and a write that fails leaves nothing behind.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <clocale>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <limits>
#include <locale>
#include <random>

#include "SmallFiles.h"
#include "Support/ErrorObserver.h"
#include "Support/TestSupport.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusSequenceWriter.h"
#include "vtkDataArray.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkPointData.h"
#include "vtkUnsignedCharArray.h"

namespace bigus::test
{
namespace
{

// A sweep of random pixels and of poses whose numbers need all their digits.
vtkSmartPointer<vtkImageData> RandomSweep(int type, int width, int height, int frames)
{
  std::mt19937_64 random(7);
  const auto uniform = [&random] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(width, height, frames);
  image->AllocateScalars(type, 1);
  auto* const bytes = static_cast<unsigned char*>(image->GetScalarPointer());
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    if (type == VTK_FLOAT)
    {
      const auto value = static_cast<float>(uniform());
      std::memcpy(bytes + 4 * i, &value, 4);
    }
    else
    {
      bytes[i * image->GetScalarSize()] = static_cast<unsigned char>(random());
    }
  }
  vtkNew<vtkDoubleArray> poses;
  poses->SetName("ImageToReference");
  poses->SetNumberOfComponents(16);
  vtkNew<vtkDoubleArray> times;
  times->SetName("Timestamp");
  for (int frame = 0; frame < frames; ++frame)
  {
    double pose[16] = {0.1 + uniform(),
                       1e-3 * uniform(),
                       -uniform() / 3,
                       1e5 * uniform(),
                       1e-17 * uniform(),
                       0.1 + uniform(),
                       1e-300,
                       -1.0 / 3,
                       0,
                       -0.0,
                       0.5 + uniform(),
                       std::numeric_limits<double>::denorm_min(),
                       0,
                       0,
                       0,
                       1};
    poses->InsertNextTuple(pose);
    times->InsertNextValue(1.6e9 + uniform());
  }
  image->GetFieldData()->AddArray(poses);
  image->GetFieldData()->AddArray(times);
  return image;
}

void ExpectSameBits(vtkDataArray* a, vtkDataArray* b)
{
  ASSERT_TRUE(a && b);
  ASSERT_EQ(a->GetDataType(), b->GetDataType());
  ASSERT_EQ(a->GetNumberOfValues(), b->GetNumberOfValues());
  EXPECT_EQ(std::memcmp(a->GetVoidPointer(0), b->GetVoidPointer(0),
                        static_cast<std::size_t>(a->GetNumberOfValues() * a->GetDataTypeSize())),
            0);
}

void ExpectRoundTrip(vtkImageData* sweep, const std::string& fileName, bool compression)
{
  vtkNew<vtkBigusSequenceWriter> writer;
  ErrorObserver writeErrors(writer);
  writer->SetFileName(fileName.c_str());
  writer->SetInputData(sweep);
  writer->SetCompression(compression);
  EXPECT_EQ(writer->Write(), 1) << writeErrors.Text();

  vtkNew<vtkBigusSequenceReader> reader;
  ErrorObserver readErrors(reader);
  reader->SetFileName(fileName.c_str());
  reader->Update();
  ASSERT_TRUE(readErrors.Errors().empty()) << readErrors.Text();
  vtkImageData* const back = reader->GetOutput();
  for (int axis = 0; axis < 3; ++axis)
  {
    EXPECT_EQ(back->GetDimensions()[axis], sweep->GetDimensions()[axis]);
  }
  EXPECT_STREQ(reader->GetEncoding(), compression ? "zlib" : "raw");
  ExpectSameBits(back->GetPointData()->GetScalars(), sweep->GetPointData()->GetScalars());
  for (const char* name : {"ImageToReference", "Timestamp"})
  {
    ExpectSameBits(back->GetFieldData()->GetArray(name), sweep->GetFieldData()->GetArray(name));
  }
}

TEST(SequenceWriter, RoundTripIsExact)
{
  TemporaryFolder folder;
  for (const int type : {VTK_UNSIGNED_CHAR, VTK_UNSIGNED_SHORT, VTK_FLOAT})
  {
    for (const bool compression : {false, true})
    {
      SCOPED_TRACE(std::to_string(type) + (compression ? " zlib" : " raw"));
      ExpectRoundTrip(RandomSweep(type, 37, 23, 12), folder / "sweep.igs.mha", compression);
    }
  }
  ExpectRoundTrip(RandomSweep(VTK_UNSIGNED_CHAR, 1, 1, 1), folder / "one.mha", true);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.Path()), {}), 2);  // no temporary files
}

// A rate that no tracker has would be read as that of another unit.
TEST(SequenceWriter, TimesOfAnyRateStaySeconds)
{
  TemporaryFolder folder;
  for (const double step : {60.0, 1e-5, 1.0, 0.0})
  {
    SCOPED_TRACE(step);
    auto sweep = RandomSweep(VTK_UNSIGNED_CHAR, 5, 4, 3);
    vtkDataArray* const times = sweep->GetFieldData()->GetArray("Timestamp");
    for (int frame = 0; frame < 3; ++frame)
    {
      times->SetComponent(frame, 0, 7 + step * frame);
    }
    ExpectRoundTrip(sweep, folder / "sweep.igs.mha", false);
    const std::string bytes = ReadBytes(folder / "sweep.igs.mha");
    EXPECT_EQ(bytes.find("TimestampUnit = s\n") != std::string::npos, step == 60);
  }
}

TEST(SequenceWriter, WritesFrameNamesAndStatus)
{
  TemporaryFolder folder;
  auto sweep = RandomSweep(VTK_UNSIGNED_CHAR, 5, 4, 3);
  vtkNew<vtkUnsignedCharArray> status;
  status->SetName("Status");
  for (const int usable : {1, 0, 1})
  {
    status->InsertNextValue(static_cast<unsigned char>(usable));
  }
  sweep->GetFieldData()->AddArray(status);
  vtkNew<vtkBigusSequenceWriter> writer;
  writer->SetFileName((folder / "names.mha").c_str());
  writer->SetToFrame("Tracker");
  writer->SetInputData(sweep);
  ASSERT_EQ(writer->Write(), 1);
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName((folder / "names.mha").c_str());
  reader->SetToFrame("Tracker");
  reader->Update();
  EXPECT_EQ(reader->GetNumberOfAcceptedFrames(), 2);
  EXPECT_EQ(reader->GetOutput()->GetFieldData()->GetArray("SourceFrame")->GetComponent(1, 0), 2);
}

// Text is written and read the same where the decimal point is a comma.
TEST(SequenceWriter, IgnoresTheLocale)
{
  struct Comma : std::numpunct<char>
  {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  TemporaryFolder folder;
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new Comma));
  const bool german = std::setlocale(LC_ALL, "de_DE.UTF-8") || std::setlocale(LC_ALL, "de_DE");
  ExpectRoundTrip(RandomSweep(VTK_UNSIGNED_CHAR, 9, 8, 7), folder / "comma.mha", true);
  std::setlocale(LC_ALL, "C");
  std::locale::global(before);
  if (!german)
  {
    GTEST_LOG_(INFO) << "no German locale here: only C++ streams had the comma";
  }
}

TEST(SequenceWriter, RoundTripOfARealSweep)
{
  BIGUS_REQUIRE_DATA(path, "brain-sweep/us_brain_sweep.igs.mha");
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName(path.c_str());
  reader->Update();
  ExpectRoundTrip(reader->GetOutput(), folder / "brain.igs.mha", true);
}

// Writes what must be refused, with one error that has `part` in it, and leaves the folder as it was.
void ExpectRefused(vtkImageData* sweep, const std::string& fileName, const std::string& part,
                   const std::function<void(vtkBigusSequenceWriter*)>& prepare = {})
{
  const auto listing = [&]
  {
    std::string names;
    const auto folder = std::filesystem::path(fileName).parent_path();
    for (const auto& entry :
         std::filesystem::directory_iterator(std::filesystem::exists(folder) ? folder : "/dev/null/.."))
    {
      names += entry.path().string() + "\n";
    }
    return names;
  };
  const bool haveFolder = std::filesystem::exists(std::filesystem::path(fileName).parent_path());
  const std::string before = haveFolder ? listing() : "";
  vtkNew<vtkBigusSequenceWriter> writer;
  ErrorObserver errors(writer);
  writer->SetFileName(fileName.c_str());
  writer->SetInputData(sweep);
  if (prepare)
  {
    prepare(writer);
  }
  EXPECT_EQ(writer->Write(), 0);
  ASSERT_EQ(errors.Errors().size(), 1u) << errors.Text();
  EXPECT_NE(errors.Text().find(part), std::string::npos) << errors.Text();
  EXPECT_NE(writer->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
  EXPECT_EQ(haveFolder ? listing() : "", before);
}

TEST(SequenceWriter, RefusesWhatItCannotWrite)
{
  TemporaryFolder folder;
  const auto sweep = RandomSweep(VTK_UNSIGNED_CHAR, 5, 4, 3);
  ExpectRefused(sweep, folder / "sweep.png", ".mha");
  ExpectRefused(sweep, folder / "missing/sweep.mha", "cannot be written");
  std::filesystem::create_directory(folder / "folder.mha");
  ExpectRefused(sweep, folder / "folder.mha", "cannot be written");
  for (const char* name : {"", "lower", "Has Blank", "A=B", "A\nB"})
  {
    ExpectRefused(sweep, folder / "sweep.mha", "coordinate frame name",
                  [name](vtkBigusSequenceWriter* writer) { writer->SetToFrame(name); });
  }
  ExpectRefused(RandomSweep(VTK_DOUBLE, 5, 4, 3), folder / "sweep.mha", "double");
  ExpectRefused(vtkNew<vtkImageData>(), folder / "sweep.mha", "no pixels");
  auto bare = RandomSweep(VTK_UNSIGNED_CHAR, 5, 4, 3);
  bare->GetFieldData()->RemoveArray("ImageToReference");
  ExpectRefused(bare, folder / "sweep.mha", "ImageToReference");
  auto fewer = RandomSweep(VTK_UNSIGNED_CHAR, 5, 4, 3);
  fewer->GetFieldData()->GetArray("ImageToReference")->SetNumberOfTuples(2);
  ExpectRefused(fewer, folder / "sweep.mha", "ImageToReference has 2 tuples");
  auto untimed = RandomSweep(VTK_UNSIGNED_CHAR, 5, 4, 3);
  untimed->GetFieldData()->GetArray("Timestamp")->SetNumberOfTuples(1);
  ExpectRefused(untimed, folder / "sweep.mha", "Timestamp");
}

TEST(SequenceWriter, AbortedWriteLeavesNothing)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusSequenceWriter> writer;
  vtkNew<vtkCallbackCommand> abort;
  abort->SetCallback([](vtkObject* caller, unsigned long, void*, void*)
                     { static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1); });
  writer->AddObserver(vtkCommand::ProgressEvent, abort);
  writer->SetFileName((folder / "sweep.mha").c_str());
  writer->SetInputData(RandomSweep(VTK_UNSIGNED_CHAR, 5, 4, 3));
  EXPECT_EQ(writer->Write(), 0);
  EXPECT_TRUE(std::filesystem::is_empty(folder.Path()));
}

// A full disk, played by a limit on the size of files.
TEST(SequenceWriter, InterruptedWriteLeavesTheEarlierFile)
{
  TemporaryFolder folder;
  WriteBytes(folder / "sweep.mha", "what was here before");
  const auto sweep = RandomSweep(VTK_UNSIGNED_CHAR, 200, 200, 50);
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit small = before;
  small.rlim_cur = 300 * 1024;
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  ExpectRefused(sweep, folder / "sweep.mha", "nothing was written");
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(ReadBytes(folder / "sweep.mha"), "what was here before");
}

}  // namespace
}  // namespace bigus::test
