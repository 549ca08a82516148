// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One field on several processes: the same bits for any number of them, and errors that all hear of.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "Data/FieldData.h"
#include "Groups.h"
#include "Support/BrokenRename.h"
#include "Support/ErrorObserver.h"
#include "Support/Fields.h"
#include "Support/Random.h"
#include "Support/Sweeps.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusFieldWriter.h"
#include "vtkBigusPartitionField.h"
#include "vtkBigusReslice.h"
#include "vtkBigusVoxelizer.h"
#include "vtkCallbackCommand.h"
#include "vtkDummyController.h"
#include "vtkErrorCode.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"

namespace
{

using bigus::test::WithGroups;
using bigus::test::World;

vtkSmartPointer<vtkPolyData> Field(std::size_t count = 9000, double gamma = 0.5)
{
  bigus::test::Random random(11);
  bigus::GaussianField field = bigus::test::RandomField(random, count, 10.0, 0.1, 1.0, 0.4);
  field.transfer.gamma = gamma;
  const auto data = vtkSmartPointer<vtkPolyData>::New();
  bigus::FieldToPolyData(field, data);
  return data;
}

/// The same, and what it knows of directions: recorded planes like that of Slice, one of them the same.
vtkSmartPointer<vtkPolyData> ViewedField()
{
  const auto data = Field();
  const auto sweep = bigus::test::BlackSweep(3, 90, 70, 0.25, 0.25);
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topLeftCorner<3, 2>() << 0.6, 0, 0.8, 0, 0, 1;
  pose.col(2).head<3>() = pose.col(0).head<3>().cross(pose.col(1).head<3>());
  const Eigen::Vector3d corner = Eigen::Vector3d(1, -2, 0.5) + pose.topLeftCorner<3, 2>() * Eigen::Vector2d(-11, -9);
  for (int k = 0; k < 3; ++k)
  {
    Eigen::Matrix4d turned = pose;
    turned.topLeftCorner<3, 3>() = Eigen::AngleAxisd(0.1 * k, Eigen::Vector3d::UnitZ()) * pose.topLeftCorner<3, 3>();
    turned.col(3).head<3>() = corner;
    turned.topLeftCorner<3, 2>() *= 0.25;
    sweep->imageToReference[k] = turned;
  }
  bigus::test::Random random(12);
  bigus::ViewDependence view{bigus::RecordedViews::Of(*sweep, {0, 1, 2}), {}};
  for (vtkIdType i = 0; i < data->GetNumberOfPoints(); ++i)
  {
    view.terms.push_back(random.Vector(0.3));
  }
  bigus::ViewToPolyData(view, data);
  return data;
}

vtkSmartPointer<vtkBigusPartitionField> Part(vtkPolyData* field, vtkMultiProcessController* controller, int chunks = 16)
{
  const auto part = vtkSmartPointer<vtkBigusPartitionField>::New();
  part->SetInputData(field);
  part->SetNumberOfChunks(chunks);
  part->SetNumberOfPieces(controller->GetNumberOfProcesses());
  part->SetPiece(controller->GetLocalProcessId());
  return part;
}

/// A slice of 90 x 70 pixels with coverage.
vtkSmartPointer<vtkBigusReslice> Slice(vtkAlgorithm* producer, vtkMultiProcessController* controller)
{
  const auto slice = vtkSmartPointer<vtkBigusReslice>::New();
  slice->SetController(controller);
  slice->SetInputConnection(producer->GetOutputPort());
  slice->SetResliceAxesDirectionCosines(0.6, 0.8, 0, 0, 0, 1, 0.8, -0.6, 0);
  slice->SetResliceAxesOrigin(1, -2, 0.5);
  slice->SetOutputSpacing(0.25, 0.25, 1);
  slice->SetOutputOrigin(-11, -9, 0);
  slice->SetOutputExtent(0, 89, 0, 69, 0, 0);
  return slice;
}

std::vector<float> Pixels(vtkImageData* image)
{
  vtkDataArray* const scalars = image->GetPointData()->GetScalars();
  std::vector<float> pixels;
  for (vtkIdType k = 0; scalars && k < scalars->GetNumberOfTuples(); ++k)
  {
    pixels.push_back(static_cast<float>(scalars->GetTuple1(k)));
  }
  return pixels;
}

std::vector<float> Answer(vtkImageAlgorithm* filter)
{
  filter->Update();
  EXPECT_EQ(filter->GetErrorCode(), vtkErrorCode::NoError);
  return Pixels(filter->GetOutput());
}

/// A folder that all processes which mpirun has started know, and no other run. The first makes and removes it.
class SharedFolder
{
public:
  explicit SharedFolder(const std::string& name)
      : path_(std::filesystem::temp_directory_path() / ("bigus-" + name + "-" + std::to_string(getppid())))
  {
    if (World()->GetLocalProcessId() == 0)
    {
      std::filesystem::create_directories(path_);
    }
    World()->Barrier();
  }
  ~SharedFolder()
  {
    World()->Barrier();
    if (World()->GetLocalProcessId() == 0)
    {
      std::filesystem::remove_all(path_);
    }
  }
  SharedFolder(const SharedFolder&) = delete;
  SharedFolder& operator=(const SharedFolder&) = delete;

  std::string operator/(const std::string& name) const { return path_ / name; }

  /// Names and bytes.
  std::map<std::string, std::string> Files() const
  {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(path_))
    {
      std::ifstream file(entry.path(), std::ios::binary);
      files[entry.path().filename()] = std::string(std::istreambuf_iterator<char>(file), {});
    }
    return files;
  }

  void Clear() const
  {
    for (const auto& entry : std::filesystem::directory_iterator(path_))
    {
      std::filesystem::remove(entry.path());
    }
  }

private:
  std::filesystem::path path_;
};

/// While this lives, writing files beyond a few KB fails, as on a full disk.
class FullDisk
{
public:
  explicit FullDisk(bool isFull) : handler_(std::signal(SIGXFSZ, SIG_IGN))
  {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit small = before_;
    small.rlim_cur = isFull ? 4096 : before_.rlim_cur;
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FullDisk()
  {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

private:
  rlimit before_;
  void (*handler_)(int);
};

TEST(Parts, SameBitsForAnyNumberOfProcesses)
{
  for (const auto& [field, chunks] :
       {std::pair(Field(), 1), std::pair(Field(), 2), std::pair(Field(), 16), std::pair(ViewedField(), 16)})
  {
    vtkNew<vtkDummyController> alone;
    const std::vector<float> truth = Answer(Slice(Part(field, alone, chunks), alone));
    ASSERT_EQ(truth.size(), 90u * 70u);
    WithGroups(
        [&](vtkMultiProcessController* controller)
        {
          EXPECT_EQ(Answer(Slice(Part(field, controller, chunks), controller)), truth);  // empty ones with few chunks
        });
  }
}

TEST(Parts, EveryProcessReadsItsPartAlone)
{
  const auto field = ViewedField();
  const SharedFolder folder("parts");
  if (World()->GetLocalProcessId() == 0)
  {
    for (const char* name : {"field.vtp", "field.pvtp"})
    {
      vtkNew<vtkBigusFieldWriter> writer;
      writer->SetInputData(field);
      writer->SetFileName((folder / name).c_str());
      EXPECT_EQ(writer->Write(), 1);
    }
  }
  World()->Barrier();
  vtkNew<vtkDummyController> alone;
  const std::vector<float> truth = Answer(Slice(Part(field, alone), alone));
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        const int processes = controller->GetNumberOfProcesses();
        for (const char* name : {"field.vtp", "field.pvtp"})
        {
          vtkNew<vtkBigusFieldReader> reader;
          reader->SetFileName((folder / name).c_str());
          const auto part = Part(field, controller);
          part->SetInputConnection(reader->GetOutputPort());
          EXPECT_EQ(Answer(Slice(part, controller)), truth) << name;
          const vtkIdType most = (16 / processes + 1) * 768;  // 9000 Gaussians in 36 blocks: two or three a chunk
          EXPECT_LE(reader->GetOutput()->GetNumberOfPoints(), processes == 1 ? 9000 : most) << name;
        }
      });
}

TEST(Parts, ShowWhatTheWholeFieldShows)
{
  const auto field = ViewedField();
  vtkNew<vtkBigusPartitionField> whole;
  whole->SetInputData(field);
  const std::vector<float> truth = Answer(Slice(whole, nullptr));
  vtkNew<vtkBigusPartitionField> usual;
  usual->SetInputData(Field());
  EXPECT_NE(truth, Answer(Slice(usual, nullptr))) << "directions count";
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        const std::vector<float> sum = Answer(Slice(Part(field, controller), controller));
        ASSERT_EQ(sum.size(), truth.size());
        for (std::size_t p = 0; p < sum.size(); ++p)
        {
          ASSERT_NEAR(sum[p], truth[p], 2e-4 + 1e-5);  // both may be off by Tolerance
        }
      });
}

TEST(Parts, CoverageSlabsBytesAndPiecesOfTheOutput)
{
  const auto field = Field();
  vtkNew<vtkDummyController> alone;
  const auto make = [&](vtkMultiProcessController* controller)
  {
    const auto slice = Slice(Part(field, controller), controller);
    slice->SetSlabNumberOfSlices(3);
    slice->SetSlabModeToMax();
    slice->SetOutputScalarTypeToUnsignedChar();
    slice->GenerateCoverageOutputOn();
    return slice;
  };
  const auto single = make(alone);
  const std::vector<float> truth = Answer(single);
  const std::vector<float> coverage = Pixels(vtkImageData::SafeDownCast(single->GetOutputDataObject(1)));
  ASSERT_FALSE(coverage.empty());
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        const auto slice = make(controller);
        EXPECT_EQ(Answer(slice), truth);
        EXPECT_EQ(Pixels(vtkImageData::SafeDownCast(slice->GetOutputDataObject(1))), coverage);
        const auto streamed = Slice(Part(field, controller), controller);
        const int extent[6] = {10, 59, 20, 24, 0, 0};
        streamed->UpdateExtent(extent);
        const std::vector<float> some = Pixels(streamed->GetOutput());
        const std::vector<float> all = Answer(Slice(Part(field, controller), controller));
        ASSERT_EQ(some.size(), 50u * 5u);
        for (int row = 0; row < 5; ++row)
        {
          EXPECT_EQ(std::memcmp(&some[50u * row], &all[90u * (20 + row) + 10], 50 * sizeof(float)), 0);
        }
      });
}

TEST(Parts, TheGridOfAVolumeIsThatOfTheWholeField)
{
  const auto field = Field(3000);
  const auto volume = [](vtkAlgorithm* producer, vtkMultiProcessController* controller)
  {
    const auto voxelizer = vtkSmartPointer<vtkBigusVoxelizer>::New();
    voxelizer->SetController(controller);
    voxelizer->SetInputConnection(producer->GetOutputPort());
    voxelizer->SetMaximumDimension(24);
    return voxelizer;
  };
  vtkNew<vtkDummyController> alone;
  const auto single = volume(Part(field, alone), alone);
  const std::vector<float> truth = Answer(single);
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        const auto voxelizer = volume(Part(field, controller), controller);
        EXPECT_EQ(Answer(voxelizer), truth);
        for (int axis = 0; axis < 3; ++axis)
        {
          EXPECT_EQ(voxelizer->GetOutput()->GetOrigin()[axis], single->GetOutput()->GetOrigin()[axis]);
          EXPECT_EQ(voxelizer->GetOutput()->GetSpacing()[axis], single->GetOutput()->GetSpacing()[axis]);
        }
      });
}

/// All processes refuse, and say what the one says.
void ExpectRefused(vtkBigusFieldToImage* filter, const std::string& words)
{
  const bigus::test::ErrorObserver errors(filter);
  filter->Update();
  EXPECT_NE(filter->GetErrorCode(), vtkErrorCode::NoError);
  EXPECT_NE(errors.Text().find(words), std::string::npos) << errors.Text();
  EXPECT_EQ(filter->GetOutput()->GetNumberOfPoints(), 0);
}

TEST(Parts, WhatFailsInOneProcessFailsInAll)
{
  const auto field = Field(), other = Field(9000, 0.25);
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        const int last = controller->GetNumberOfProcesses() - 1;
        const bool isLast = controller->GetLocalProcessId() == last;
        {
          const auto slice = Slice(Part(field, controller), controller);
          slice->SetTolerance(isLast ? 7 : 1e-4);
          ExpectRefused(slice, isLast ? "tolerance" : "Process " + std::to_string(last));
          slice->SetTolerance(1e-4);
          EXPECT_EQ(Answer(slice).size(), 90u * 70u);  // and goes on afterwards
        }
        if (last > 0)
        {
          const auto slice = Slice(Part(isLast ? other : field, controller), controller);
          ExpectRefused(slice, "different fields");
          const auto twice = Part(field, controller);
          twice->SetPiece(0);
          ExpectRefused(Slice(twice, controller), "follow each other");
        }
        {
          vtkNew<vtkBigusFieldReader> reader;
          reader->SetFileName("/there/is/no/such/field.vtp");
          const bigus::test::ErrorObserver ignored(reader);
          const auto part = Part(field, controller);
          const auto slice = Slice(isLast ? static_cast<vtkAlgorithm*>(reader) : part, controller);
          ExpectRefused(slice, "");
        }
      });
}

TEST(Parts, AreWrittenByAllProcessesOrByNone)
{
  const SharedFolder folder("written");
  const auto old = Field(7000), field = Field(9000), other = Field(9000, 0.25);
  const std::string name = folder / "field.pvtp";
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        const int processes = controller->GetNumberOfProcesses(), last = processes - 1;
        const bool isLast = controller->GetLocalProcessId() == last;
        const auto write = [&](vtkAlgorithm* producer, const std::string& fileName, std::string words)
        {
          vtkNew<vtkBigusFieldWriter> writer;
          const bigus::test::ErrorObserver errors(writer);
          writer->SetController(controller);
          writer->SetInputConnection(producer->GetOutputPort());
          writer->SetFileName(fileName.c_str());
          EXPECT_EQ(writer->Write(), words.empty() ? 1 : 0);
          EXPECT_EQ(errors.Errors().size(), words.empty() ? 0u : 1u) << errors.Text();
          EXPECT_NE(errors.Text().find(words), std::string::npos) << errors.Text();
          controller->Barrier();
        };
        write(Part(old, controller), name, "");
        const auto before = folder.Files();
        EXPECT_EQ(before.count("field.pvtp"), 1u);
        controller->Barrier();  // all have looked
        const std::string process = "Process " + std::to_string(last) + " of";
        {
          const FullDisk full(isLast);
          write(Part(field, controller), name, isLast ? "writing failed" : process);
        }
        EXPECT_EQ(folder.Files(), before);
        controller->Barrier();  // all have looked
        if (processes > 1)
        {
          const std::string piece = folder / ("field_" + std::to_string(last) + ".vtp");
          if (isLast)
          {
            std::filesystem::rename(piece, piece + ".away");
            std::filesystem::create_directories(piece + "/in the way");
          }
          controller->Barrier();
          write(Part(field, controller), name, isLast ? "is a folder" : process);
          if (isLast)
          {
            std::filesystem::remove_all(piece);
            std::filesystem::rename(piece + ".away", piece);
          }
          write(Part(field, controller), isLast ? folder / "nowhere/field.pvtp" : name, "all need one file name");
          write(Part(field, controller), folder / "nowhere/field.pvtp", "cannot be written");
          write(Part(field, controller), folder / "field.vtp", "as .pvtp");
          write(Part(isLast ? other : field, controller), name, "not of one field");
          const auto whole = Part(field, controller);
          whole->SetNumberOfPieces(1);
          whole->SetPiece(0);
          write(whole, name, "same Gaussians");
          vtkNew<vtkBigusFieldReader> reader;
          reader->SetFileName("/there/is/no/such/field.vtp");
          const bigus::test::ErrorObserver ignored(reader);
          const auto part = Part(field, controller);
          write(isLast ? static_cast<vtkAlgorithm*>(reader) : part, name, "could not be made");
          EXPECT_EQ(folder.Files(), before);
        }
        controller->Barrier();
        write(Part(field, controller), name, "");
        vtkNew<vtkBigusFieldReader> reader;
        reader->SetFileName(name.c_str());
        vtkNew<vtkDummyController> alone;
        const auto slice = Slice(reader, nullptr);
        const std::vector<float> written = Answer(slice), truth = Answer(Slice(Part(field, alone), alone));
        ASSERT_EQ(written.size(), truth.size());
        for (std::size_t p = 0; p < truth.size(); ++p)
        {
          ASSERT_NEAR(written[p], truth[p], 2e-4 + 1e-5);  // both may be off by Tolerance
        }
        controller->Barrier();
      });
}

TEST(Parts, WhatFailsAmidTheRenamesLeavesWhatWas)
{
  const SharedFolder folder("renamed");
  const auto old = Field(7000), field = Field(9000);
  const std::string name = folder / "field.pvtp";
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        const int processes = controller->GetNumberOfProcesses(), pieces = processes == 1 ? 4 : processes;
        const auto write = [&](vtkPolyData* data, const std::vector<std::string>& words)
        {
          const auto part = Part(data, controller);
          vtkNew<vtkBigusFieldWriter> writer;
          const bigus::test::ErrorObserver errors(writer);
          writer->SetController(controller);
          writer->SetNumberOfPieces(pieces);
          writer->SetInputConnection(part->GetOutputPort());
          writer->SetFileName(name.c_str());
          EXPECT_EQ(writer->Write(), words.empty() ? 1 : 0);
          EXPECT_EQ(errors.Errors().size(), words.empty() ? 0u : 1u) << errors.Text();
          for (const std::string& one : words)
          {
            EXPECT_NE(errors.Text().find(one), std::string::npos) << errors.Text();
          }
          controller->Barrier();
        };
        /// The index's rename, or that of a piece, fails in the process that does it.
        const auto fail = [&](int piece, int times, const std::string& words)
        {
          const std::string victim = piece < pieces ? "field_" + std::to_string(piece) + ".vtp" : "field.pvtp";
          SCOPED_TRACE(victim);
          const int process = processes == 1 || piece == pieces ? 0 : piece;
          const bool isHere = controller->GetLocalProcessId() == process;
          const bigus::test::BrokenRename broken(victim, isHere ? times : 0);
          write(field, {isHere ? "" : "Process " + std::to_string(process) + " of ",
                        victim + ": cannot be written: Input/output error; " + words});
          return victim;
        };
        for (const bool isNew : {true, false})
        {
          const auto before = folder.Files();
          EXPECT_EQ(before.empty(), isNew);
          controller->Barrier();  // all have looked
          for (int piece = 0; piece <= pieces; ++piece)
          {
            fail(piece, 1, "nothing was written");
            EXPECT_TRUE(folder.Files() == before);
            controller->Barrier();
          }
          write(old, {});
        }
        // Where a name cannot be given back either, all are told where the earlier file is.
        for (const int piece : {pieces - 1, pieces})
        {
          const auto before = folder.Files();
          controller->Barrier();
          const std::string victim = fail(piece, 3, "the earlier file could not be put back either, and is ");
          const std::string aside = victim + ".bigus-part-earlier";
          auto after = folder.Files();
          EXPECT_EQ(after.count(victim), 0u);
          after[victim] = after[aside];
          after.erase(aside);
          EXPECT_TRUE(after == before);
          controller->Barrier();
          if (controller->GetLocalProcessId() == 0)
          {
            std::filesystem::rename(folder / aside, folder / victim);
          }
          controller->Barrier();
        }
        write(field, {});
        EXPECT_EQ(folder.Files().size(), static_cast<std::size_t>(pieces) + 1);
        controller->Barrier();
        if (controller->GetLocalProcessId() == 0)
        {
          folder.Clear();
        }
        controller->Barrier();
      });
}

TEST(Parts, AnAbortInOneProcessEndsAll)
{
  const auto field = Field(600);
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        const auto slice = Slice(Part(field, controller), controller);
        slice->SetOutputExtent(0, 399, 0, 399, 0, 3);
        vtkNew<vtkCallbackCommand> stop;
        stop->SetCallback([](vtkObject* caller, unsigned long, void*, void*)
                          { static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1); });
        if (controller->GetLocalProcessId() == 0)
        {
          slice->AddObserver(vtkCommand::ProgressEvent, stop);
        }
        slice->Update();
        EXPECT_EQ(slice->GetOutput()->GetNumberOfPoints(), 0);
      });
}

}  // namespace
