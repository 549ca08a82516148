// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field in several files, and read piece by piece: what vtkBigusPartitionField would choose, and one error for every way
// to be bad.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Model/FieldChunks.h"
#include "Core/Model/FieldRounding.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "IO/FieldFile.h"
#include "SmallFiles.h"
#include "Support/ErrorObserver.h"
#include "Support/Fields.h"
#include "Support/Random.h"
#include "Support/TestSupport.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusFieldWriter.h"
#include "vtkDataArray.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkXMLPPolyDataReader.h"
#include "vtkXMLPolyDataReader.h"
#include "vtkXMLPolyDataWriter.h"

namespace bigus::test
{
namespace
{

GaussianField Field(std::size_t count)
{
  Random random(5);
  GaussianField field = RandomField(random, count, 10.0, 0.1, 1.0, 0.4);
  field.transfer.gamma = 0.7;
  field.beam = {0.25, 0.5, {{0, 0, 1}}};
  return field;
}

bool Same(const GaussianField& a, const GaussianField& b)
{
  return a.means == b.means && a.scales == b.scales && a.rotations == b.rotations &&
         a.reflectivities == b.reflectivities && a.transfer.gamma == b.transfer.gamma &&
         a.beam.elevationSigma == b.beam.elevationSigma && a.beam.probeElevationSigma == b.beam.probeElevationSigma &&
         a.beam.trainedNormals == b.beam.trainedNormals;
}

/// What the Gaussians of a chunk are, told one by one.
GaussianField ChunkByHand(const GaussianField& field, int chunk, int total)
{
  GaussianField part;
  part.transfer = field.transfer;
  part.beam = field.beam;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    if (static_cast<int>(i / 256 % static_cast<std::size_t>(total)) == chunk)
    {
      part.means.push_back(field.means[i]);
      part.scales.push_back(field.scales[i]);
      part.rotations.push_back(field.rotations[i]);
      part.reflectivities.push_back(field.reflectivities[i]);
    }
  }
  return part;
}

GaussianField Joined(GaussianField a, const GaussianField& b)
{
  a.means.insert(a.means.end(), b.means.begin(), b.means.end());
  a.scales.insert(a.scales.end(), b.scales.begin(), b.scales.end());
  a.rotations.insert(a.rotations.end(), b.rotations.begin(), b.rotations.end());
  a.reflectivities.insert(a.reflectivities.end(), b.reflectivities.begin(), b.reflectivities.end());
  return a;
}

/// One error, of that file, with these words; nothing else is left.
void Refused(const std::string& file, const std::string& words, int piece = 0, int pieces = 1)
{
  vtkNew<vtkBigusFieldReader> reader;
  ErrorObserver errors(reader);
  reader->SetFileName(file.c_str());
  reader->UpdatePiece(piece, pieces, 0);
  ASSERT_EQ(errors.Errors().size(), 1u) << errors.Text();
  EXPECT_NE(errors.Text().find(words), std::string::npos) << errors.Text();
  EXPECT_NE(reader->GetErrorCode(), vtkErrorCode::NoError);
  EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 0);
}

std::string Replaced(std::string text, const std::string& from, const std::string& to)
{
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(Pieces, AVtpIsReadByChunks)
{
  TemporaryFolder folder;
  for (const std::size_t count : {std::size_t(0), std::size_t(1), std::size_t(255), std::size_t(9000)})
  {
    GaussianField field = Field(count);
    for (const bool isRounded : {false, true})  // numbers of 64 bits, and of 32
    {
      if (isRounded)
      {
        RoundField(field);
      }
      for (const char* name : {"field.vtp", "field.ply"})
      {
        WriteField({field, {"seed=1"}, {}}, folder / name);
        const GaussianField stored = ReadField(folder / name)->field;
        for (const int pieces : {2, 3, 20})
        {
          std::size_t sum = 0;
          for (int piece = 0; piece < pieces; ++piece)
          {
            const StoredField part = *ReadField(folder / name, {piece, pieces, 16});
            GaussianField truth;
            truth.transfer = stored.transfer;
            truth.beam = stored.beam;
            for (int chunk = 16 * piece / pieces; chunk < 16 * (piece + 1) / pieces; ++chunk)
            {
              truth = Joined(truth, ChunkByHand(stored, chunk, 16));
            }
            EXPECT_TRUE(Same(part.field, truth)) << name << " of " << count << ", " << piece << " of " << pieces;
            EXPECT_EQ(part.provenance, (std::vector<std::string>{"seed=1"}));
            ASSERT_TRUE(part.chunks);
            EXPECT_EQ(part.chunks->first, 16 * piece / pieces);
            sum += part.field.Size();
          }
          EXPECT_EQ(sum, count);
        }
      }
    }
  }
}

TEST(Pieces, APvtpHoldsTheFieldChunkByChunk)
{
  TemporaryFolder folder;
  const GaussianField field = Field(5000);
  for (const int pieces : {1, 4, 5})
  {
    WriteField({field, {"seed=1"}, {}}, folder / "field.pvtp", pieces);
    GaussianField truth = ChunkByHand(field, 0, pieces);
    for (int chunk = 1; chunk < pieces; ++chunk)
    {
      truth = Joined(truth, ChunkByHand(field, chunk, pieces));
    }
    const StoredField whole = *ReadField(folder / "field.pvtp");
    EXPECT_TRUE(Same(whole.field, truth));
    EXPECT_EQ(whole.provenance, (std::vector<std::string>{"seed=1"}));
    EXPECT_EQ(ChunksOfFile(folder / "field.pvtp", 16), pieces == 5 ? 0 : pieces);
    // A piece of it reads its files alone.
    const std::string other = folder / ("field_" + std::to_string(pieces - 1) + ".vtp");
    std::filesystem::rename(other, other + ".away");
    std::ofstream(other) << "damaged";
    if (pieces > 1)
    {
      const StoredField first = *ReadField(folder / "field.pvtp", {0, 2, 16});
      GaussianField own = ChunkByHand(field, 0, pieces);
      for (int chunk = 1; chunk < pieces / 2; ++chunk)
      {
        own = Joined(own, ChunkByHand(field, chunk, pieces));
      }
      EXPECT_TRUE(Same(first.field, own));
      EXPECT_EQ(first.chunks.has_value(), pieces == 4) << "a tree needs a power of two";
    }
    Refused(folder / "field.pvtp", "field_" + std::to_string(pieces - 1) + ".vtp");
  }
}

TEST(Pieces, VtkReadsOursAndWeReadVtks)
{
  TemporaryFolder folder;
  GaussianField field = Field(3000);
  for (const bool isRounded : {false, true})
  {
    if (isRounded)
    {
      RoundField(field);
    }
    WriteField({field, {}, {}}, folder / "field.pvtp", 4);
    const GaussianField ours = ReadField(folder / "field.pvtp")->field;
    vtkNew<vtkXMLPPolyDataReader> vtk;
    vtk->SetFileName((folder / "field.pvtp").c_str());
    vtk->Update();
    vtkPolyData* const read = vtk->GetOutput();
    ASSERT_EQ(read->GetNumberOfPoints(), 3000);
    for (vtkIdType i = 0; i < 3000; i += 7)
    {
      for (int k = 0; k < 3; ++k)
      {
        ASSERT_EQ(read->GetPoint(i)[k], ours.means[i][k]);
        ASSERT_EQ(read->GetPointData()->GetArray("Scale")->GetComponent(i, k), ours.scales[i][k]);
      }
      ASSERT_EQ(read->GetPointData()->GetArray("Reflectivity")->GetComponent(i, 0), ours.reflectivities[i]);
    }
    // The same pieces as VTK writes them, in text.
    for (int piece = 0; piece < 4; ++piece)
    {
      vtkNew<vtkPolyData> part;
      FieldToPolyData(ChunkByHand(field, piece, 4), part);
      vtkNew<vtkXMLPolyDataWriter> writer;
      writer->SetInputData(part);
      writer->SetDataModeToAscii();
      writer->SetFileName((folder / ("field_" + std::to_string(piece) + ".vtp")).c_str());
      writer->Write();
    }
    EXPECT_FALSE(ReadField(folder / "field.pvtp")) << "another encoding is VTK's to read";
    vtkNew<vtkBigusFieldReader> reader;
    reader->SetFileName((folder / "field.pvtp").c_str());
    reader->UpdatePiece(1, 2, 0);
    const GaussianField half = FieldFromPolyData(reader->GetOutput());
    ASSERT_EQ(half.Size(), ChunkByHand(field, 2, 4).Size() + ChunkByHand(field, 3, 4).Size());
    EXPECT_NEAR(half.means[5][1], ChunkByHand(field, 2, 4).means[5][1], 1e-9);  // VTK writes 11 digits
    EXPECT_TRUE(reader->GetOutput()->GetFieldData()->GetArray("Chunks"));
  }
}

/// Two recorded frames, and of each Gaussian a q that tells which one it is.
ViewDependence ViewOf(const GaussianField& field, double angleStep)
{
  ViewDependence view;
  view.views.unit = 0.5;
  view.views.angleStep = angleStep;
  view.views.elevationStep = 2;
  view.views.poses.assign(2, Eigen::Matrix4d::Identity());
  view.views.poses[1](2, 3) = 3;
  for (const Eigen::Vector3d& mean : field.means)
  {
    view.terms.emplace_back(mean[2], 2 * mean[0], -mean[1]);
  }
  return view;
}

TEST(Pieces, APvtpKeepsWhatEachGaussianKnowsOfDirections)
{
  TemporaryFolder folder;
  const std::string path = folder / "field.pvtp";
  StoredField stored = {Field(3000), {}, {}};
  stored.view = ViewOf(stored.field, 1);
  WriteField(stored, path, 4);
  const StoredField whole = *ReadField(path);
  ASSERT_TRUE(whole.view);
  EXPECT_EQ(whole.view->terms, ViewOf(whole.field, 1).terms);
  EXPECT_TRUE(whole.view->views == stored.view->views);
  for (const char* name : {"field.pvtp", "field.vtp", "field.ply"})
  {
    WriteField(stored, folder / name, 4);
    const StoredField part = *ReadField(folder / name, {1, 2, 16});
    ASSERT_TRUE(part.view && part.field.Size() > 0) << name;
    const std::vector<Eigen::Vector3d> terms = ViewOf(part.field, 1).terms;
    ASSERT_EQ(part.view->terms.size(), terms.size()) << name;
    for (std::size_t i = 0; i < terms.size(); ++i)
    {
      EXPECT_LT((part.view->terms[i] - terms[i]).norm(), 1e-5) << name;  // .ply has places in float
    }
    EXPECT_TRUE(part.view->views == stored.view->views) << name;
  }
  vtkNew<vtkXMLPPolyDataReader> vtk;
  vtk->SetFileName(path.c_str());
  vtk->Update();
  vtkDataArray* const terms = vtk->GetOutput()->GetPointData()->GetArray("ViewTerm");
  ASSERT_TRUE(terms && terms->GetNumberOfTuples() == 3000);
  EXPECT_EQ(terms->GetComponent(2999, 1), whole.view->terms[2999][1]);

  StoredField other = {ChunkByHand(stored.field, 1, 4), {}, {}};
  for (const double angleStep : {0.0, 2.0})  // 0: none
  {
    other.view = angleStep > 0 ? std::optional(ViewOf(other.field, angleStep)) : std::nullopt;
    WriteField(other, folder / "field_1.vtp");
    Refused(path, "recorded views");
  }
  other.view = ViewOf(other.field, 1);
  other.view->terms[3][1] = 1e30;
  WriteField(other, folder / "field_1.vtp");
  Refused(path, "Gaussian 3");
}

TEST(Pieces, WhatIsWrongIsOneErrorThatNamesIt)
{
  TemporaryFolder folder;
  const std::string index = folder / "field.pvtp";
  const GaussianField field = Field(2000);
  WriteField({field, {}, {}}, index, 4);
  const std::string good = ReadBytes(index);
  const auto with = [&](const std::string& from, const std::string& to)
  { WriteBytes(index, Replaced(good, from, to)); };

  std::filesystem::rename(folder / "field_2.vtp", folder / "away");
  Refused(index, "field_2.vtp");
  std::filesystem::rename(folder / "away", folder / "field_2.vtp");
  with("\"field_1.vtp\"", "\"../field_1.vtp\"");
  Refused(index, "leads out of its folder");
  with("\"field_1.vtp\"", "\"/etc/passwd\"");
  Refused(index, "not a relative name");
  with("\"field_1.vtp\"", "\"field_0.vtp\"");
  Refused(index, "twice");
  with("\"field_1.vtp\"", "\"./field_0.vtp\"");
  Refused(index, "twice");
  with("Source=\"field_1.vtp\"", "");
  Refused(index, "not a relative name");
  std::filesystem::create_symlink("/etc/passwd", folder / "link.vtp");
  with("\"field_1.vtp\"", "\"link.vtp\"");
  Refused(index, "leads out of its folder");
  with("\"field_1.vtp\"", "\"field.pvtp\"");
  Refused(index, "field.pvtp");
  with("GhostLevel=\"0\"", "GhostLevel=\"1\"");
  Refused(index, "GhostLevel");
  with("PPolyData\" version", "PImageData\" version");
  Refused(index, "not a VTK XML");
  WriteBytes(index, good.substr(0, good.size() / 2));
  Refused(index, "truncated");
  std::string many = good.substr(0, good.find("<Piece"));
  for (int k = 0; k <= FieldChunks::kMost; ++k)
  {
    std::filesystem::create_hard_link(folder / "field_0.vtp", folder / ("p" + std::to_string(k)));
    many += "<Piece Source=\"p" + std::to_string(k) + "\"/>";
  }
  WriteBytes(index, many + "</PPolyData></VTKFile>");
  Refused(index, "more than 4096 pieces");
  WriteBytes(index, good.substr(0, good.find("<Piece")) + "</PPolyData></VTKFile>");
  Refused(index, "names no piece");

  WriteBytes(index, good);
  GaussianField other = ChunkByHand(field, 1, 4);
  other.transfer.gamma = 0.8;
  WriteField({other, {}, {}}, folder / "field_1.vtp");
  Refused(index, "another Gamma");
  const std::string piece = ReadBytes(folder / "field_0.vtp");
  WriteBytes(folder / "field_1.vtp", Replaced(piece, "Name=\"Scale\"", "Name=\"Scalf\""));
  Refused(index, "Scale");
  WriteBytes(folder / "field_1.vtp", Replaced(piece, "NumberOfPoints=\"512\"", "NumberOfPoints=\"999999999999\""));
  Refused(index, "NumberOfPoints");
  Refused(index, "NumberOfPoints", 0, 2);
  WriteBytes(folder / "field_1.vtp", Replaced(piece, "NumberOfPoints=\"512\"", "NumberOfPoints=\"513\""));
  Refused(index, "Points");
}

TEST(Pieces, AFailedWriteLeavesWhatWas)
{
  TemporaryFolder folder;
  WriteField({Field(600), {}, {}}, folder / "field.pvtp", 2);
  const std::string before = ReadBytes(folder / "field_0.vtp");
  std::filesystem::create_directory(folder / "field_3.vtp");  // cannot be replaced
  std::filesystem::create_directory(folder / "field_3.vtp/full");
  const StoredField other = {Field(700), {}, {}};
  EXPECT_THROW(WriteField(other, folder / "field.pvtp", 4), bigus::Error);
  EXPECT_THROW(WriteField(other, folder / "field.pvtp", 0), bigus::Error);
  EXPECT_THROW(WriteField(other, folder / "field.pvtp", 4097), bigus::Error);
  EXPECT_TRUE(ReadBytes(folder / "field_0.vtp") == before);
  EXPECT_EQ(ReadField(folder / "field.pvtp")->field.Size(), 600u);
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(folder / "field.pvtp").parent_path()))
  {
    EXPECT_EQ(entry.path().string().find("bigus-part"), std::string::npos) << entry.path();
  }
}

/// The states that a program leaves that is killed between two renames of a write.
TEST(Pieces, AKilledWriteLeavesWhatWas)
{
  const std::string aside = ".bigus-part-earlier";
  for (int replaced = 0; replaced <= 3; ++replaced)
  {
    TemporaryFolder folder;
    WriteField({Field(700), {}, {}}, folder / "other.pvtp", 3);
    WriteField({Field(600), {}, {}}, folder / "field.pvtp", 3);
    std::filesystem::rename(folder / "field.pvtp", folder / "field.pvtp" + aside);
    for (int piece = 0; piece < replaced; ++piece)
    {
      const std::string name = "_" + std::to_string(piece) + ".vtp";
      std::filesystem::rename(folder / ("field" + name), folder / ("field" + name + aside));
      std::filesystem::rename(folder / ("other" + name), folder / ("field" + name));
    }
    EXPECT_TRUE(Same(
        ReadField(folder / "field.pvtp")->field,
        Joined(Joined(ChunkByHand(Field(600), 0, 3), ChunkByHand(Field(600), 1, 3)), ChunkByHand(Field(600), 2, 3))))
        << replaced;
    for (const auto& entry :
         std::filesystem::directory_iterator(std::filesystem::path(folder / "field.pvtp").parent_path()))
    {
      EXPECT_EQ(entry.path().string().find(".bigus"), std::string::npos) << entry.path();
    }
  }
}

TEST(Pieces, OfManyWritersOfOneNameAllSucceed)
{
  TemporaryFolder folder;
  std::vector<std::future<void>> writers;
  for (int count = 600; count < 606; ++count)
  {
    writers.push_back(std::async(std::launch::async,
                                 [&folder, count]
                                 {
                                   for (int time = 0; time < 10; ++time)
                                   {
                                     WriteField({Field(count), {}, {}}, folder / "field.pvtp", 3);
                                   }
                                 }));
  }
  for (std::future<void>& writer : writers)
  {
    EXPECT_NO_THROW(writer.get());
  }
  const std::size_t size = ReadField(folder / "field.pvtp")->field.Size();
  EXPECT_TRUE(size >= 600 && size < 606) << size;
}

}  // namespace
}  // namespace bigus::test
