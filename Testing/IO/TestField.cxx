// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields: exact in .vtp, documented precision in .ply, and one error for every way to be bad.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <random>

#include "Core/Model/FieldRounding.h"
#include "Data/FieldData.h"
#include "IO/Formats/Vtp.h"
#include "SmallFiles.h"
#include "Support/ErrorObserver.h"
#include "Support/Fields.h"
#include "Support/TestSupport.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusFieldWriter.h"
#include "vtkCellArray.h"
#include "vtkDataArray.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkIntArray.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkStringArray.h"
#include "vtkXMLPolyDataReader.h"
#include "vtkXMLPolyDataWriter.h"

namespace bigus::test
{
namespace
{

void AddDoubles(vtkFieldData* data, const char* name, int components, const std::vector<double>& values)
{
  vtkNew<vtkDoubleArray> array;
  array->SetName(name);
  array->SetNumberOfComponents(components);
  array->SetNumberOfTuples(static_cast<vtkIdType>(values.size()) / components);
  std::copy(values.begin(), values.end(), array->GetPointer(0));
  data->AddArray(array);
}

// Without cells: a field is its points and arrays.
vtkSmartPointer<vtkPolyData> RandomField(int count)
{
  std::mt19937_64 random(11);
  const auto uniform = [&random] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  std::vector<double> scales, rotations, reflectivities;
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (int i = 0; i < count; ++i)
  {
    points->InsertNextPoint(200 * uniform() - 100, 100 * uniform(), -300 * uniform());
    for (int k = 0; k < 3; ++k)
    {
      scales.push_back(std::exp(8 * uniform() - 6));
    }
    for (int k = 0; k < 4; ++k)
    {
      rotations.push_back(2 * uniform() - 1);
    }
    reflectivities.push_back(4 * uniform() - 2);
  }
  auto field = vtkSmartPointer<vtkPolyData>::New();
  field->SetPoints(points);
  AddDoubles(field->GetPointData(), "Scale", 3, scales);
  AddDoubles(field->GetPointData(), "Rotation", 4, rotations);
  AddDoubles(field->GetPointData(), "Reflectivity", 1, reflectivities);
  AddDoubles(field->GetFieldData(), "Gamma", 1, {0.123456789012345678});
  AddDoubles(field->GetFieldData(), "ElevationSigma", 1, {1.0 / 3});
  vtkNew<vtkStringArray> provenance;
  provenance->SetName("Provenance");
  provenance->InsertNextValue("sweep=brain.igs.mha");
  provenance->InsertNextValue("seed=7");
  field->GetFieldData()->AddArray(provenance);
  return field;
}

void Write(vtkPolyData* field, const std::string& fileName)
{
  vtkNew<vtkBigusFieldWriter> writer;
  ErrorObserver errors(writer);
  writer->SetFileName(fileName.c_str());
  writer->SetInputData(field);
  EXPECT_EQ(writer->Write(), 1) << errors.Text();
}

vtkPolyData* Read(vtkBigusFieldReader* reader, const std::string& fileName)
{
  ErrorObserver errors(reader);
  reader->SetFileName(fileName.c_str());
  EXPECT_EQ(reader->CanReadFile(fileName.c_str()), 1);
  reader->Modified();
  reader->Update();
  EXPECT_TRUE(errors.Errors().empty()) << errors.Text();
  return reader->GetOutput();
}

// Pipelines that open whatever comes, as ParaView, ask each reader for files that are its own.
TEST(Field, OtherFilesOfPointsAreLeftToTheirReaders)
{
  TemporaryFolder folder;
  vtkNew<vtkPoints> points;
  points->InsertNextPoint(1, 2, 3);
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  vtkNew<vtkXMLPolyDataWriter> vtp;
  vtp->SetInputData(data);
  vtp->SetFileName((folder / "points.vtp").c_str());
  vtp->Write();
  WriteBytes(folder / "points.ply",
             "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
             "property float z\nend_header\n1 2 3\n rot_0");

  vtkNew<vtkBigusFieldReader> reader;
  EXPECT_EQ(reader->CanReadFile((folder / "points.vtp").c_str()), 0);
  EXPECT_EQ(reader->CanReadFile((folder / "points.ply").c_str()), 0);

  // A field that VTK's own writer wrote as text is one all the same.
  vtp->SetInputData(RandomField(3));
  vtp->SetDataModeToAscii();
  vtp->SetFileName((folder / "field.vtp").c_str());
  vtp->Write();
  EXPECT_EQ(reader->CanReadFile((folder / "field.vtp").c_str()), 1);
}

TEST(Field, TheProbesBeamIsKeptExactlyByEveryFormat)
{
  TemporaryFolder folder;
  const auto field = RandomField(3);
  AddDoubles(field->GetFieldData(), "ProbeElevationSigma", 1, {1.0 / 7});
  AddDoubles(field->GetFieldData(), "TrainedNormals", 3, {0, 0, 1, 0.6, -0.8, 0});
  for (const char* name : {"field.vtp", "field.ply"})
  {
    Write(field, folder / name);
    vtkNew<vtkBigusFieldReader> reader;
    vtkFieldData* const back = Read(reader, folder / name)->GetFieldData();
    ASSERT_TRUE(back->GetArray("ProbeElevationSigma") && back->GetArray("TrainedNormals")) << name;
    EXPECT_EQ(back->GetArray("ProbeElevationSigma")->GetComponent(0, 0), 1.0 / 7) << name;
    ASSERT_EQ(back->GetArray("TrainedNormals")->GetNumberOfTuples(), 2) << name;
    EXPECT_EQ(back->GetArray("TrainedNormals")->GetComponent(1, 0), 0.6) << name;
    EXPECT_EQ(back->GetArray("TrainedNormals")->GetComponent(1, 1), -0.8) << name;
  }
}

/// A field that knows of directions, by three recorded frames.
vtkSmartPointer<vtkPolyData> DirectedField(int count)
{
  auto field = vtkSmartPointer<vtkPolyData>::New();
  ShareField(RandomField(count), field);
  ViewDependence view;
  view.views.unit = 1.0 / 7;
  view.views.angleStep = 0.3;
  view.views.elevationStep = 1.0 / 3;
  for (int k = 0; k < 3; ++k)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose.topLeftCorner<3, 3>() = RotationMatrix({1, 0.1 * k, -0.3, 0.2});
    pose.topRightCorner<3, 1>() << 0.1 * k, 1.0 / 3, -k;
    view.views.poses.push_back(pose);
  }
  view.views.mean = view.views.poses[1].topLeftCorner<3, 3>();
  for (int i = 0; i < count; ++i)
  {
    view.terms.emplace_back(0.1 * i, -1.0 / (i + 3), 0);
  }
  ViewToPolyData(view, field);
  return field;
}

void ExpectSameViews(vtkPolyData* a, vtkPolyData* b)
{
  const auto first = ViewFromPolyData(a), second = ViewFromPolyData(b);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->terms, second->terms);
  EXPECT_EQ(first->views.mean, second->views.mean);
  EXPECT_EQ(first->views.unit, second->views.unit);
  EXPECT_EQ(first->views.angleStep, second->views.angleStep);
  EXPECT_EQ(first->views.elevationStep, second->views.elevationStep);
  EXPECT_EQ(first->views.poses, second->views.poses);
}

TEST(Field, WhatIsKnownOfDirectionsIsKeptExactly)
{
  TemporaryFolder folder;
  const auto field = DirectedField(50);
  Write(field, folder / "field.vtp");
  vtkNew<vtkXMLPolyDataWriter> foreign;
  foreign->SetInputData(field);
  foreign->SetFileName((folder / "foreign.vtp").c_str());
  foreign->SetDataModeToAscii();
  foreign->Write();
  Write(field, folder / "field.pvtp");  // of fewer Gaussians than a block, so that they are in one piece
  Write(field, folder / "field.ply");
  for (const char* name : {"field.vtp", "foreign.vtp", "field.pvtp", "field.ply"})
  {
    vtkNew<vtkBigusFieldReader> reader;
    ExpectSameViews(field, Read(reader, folder / name));
  }
}

TEST(Field, RefusesUnsoundDirectionsOfPly)
{
  TemporaryFolder folder;
  const std::string path = folder / "field.ply";
  Write(DirectedField(50), path);
  const std::string sound = ReadBytes(path);
  const auto replaced = [&](const std::string& what, const std::string& by)
  {
    std::string bytes = sound;
    const std::size_t at = bytes.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    return at == std::string::npos ? "" : bytes.replace(at, what.size(), by);
  };
  const std::pair<std::string, const char*> faults[] = {
      {replaced("view_version 1", "view_version 2"), "newer BIGUS"},
      {replaced("element view_pose", "element other_one"), "element view_pose"},
      {replaced("property double m23\n", ""), "element view_pose"},
      {replaced("element view_pose", "element other 0\nelement view_pose"), "does not follow vertex"},
      {replaced("property double view_1", "property double view_9"), "view_1"},
      {replaced("view_steps ", "view_steps 1 "), "3 numbers"},
      {sound.substr(0, sound.size() - 8), "recorded poses"},
  };
  for (const auto& [bytes, expected] : faults)
  {
    WriteBytes(path, bytes);
    vtkNew<vtkBigusFieldReader> reader;
    ErrorObserver observer(reader);
    reader->SetFileName(path.c_str());
    reader->Update();
    EXPECT_NE(observer.Text().find(expected), std::string::npos) << expected << ": " << observer.Text();
    EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 0);
  }
}

TEST(Field, RefusesUnsoundDirections)
{
  TemporaryFolder folder;
  const std::string path = folder / "field.vtp";
  using Spoil = std::function<void(vtkPolyData*)>;
  const std::vector<std::pair<Spoil, std::string>> cases = {
      {[](vtkPolyData* f) { f->GetFieldData()->RemoveArray("ViewPoses"); }, "ViewPoses"},
      {[](vtkPolyData* f) { f->GetFieldData()->RemoveArray("ViewVersion"); }, "ViewVersion"},
      {[](vtkPolyData* f) { f->GetFieldData()->GetArray("ViewVersion")->SetComponent(0, 0, 2); }, "newer BIGUS"},
      {[](vtkPolyData* f) {
         AddDoubles(f->GetFieldData(), "ViewMean", 3, {1, 0, 0, 0, 1, 0, 0, 0, 1});
       },
       "ViewMean"},
      {[](vtkPolyData* f) { f->GetFieldData()->GetArray("ViewMean")->SetComponent(0, 4, 3); }, "mean orientation"},
      {[](vtkPolyData* f) { f->GetFieldData()->GetArray("ViewSteps")->SetComponent(0, 0, 0); }, "unit"},
      {[](vtkPolyData* f) { f->GetFieldData()->GetArray("ViewPoses")->SetComponent(2, 15, 2); }, "recorded pose 2"},
      {[](vtkPolyData* f) { f->GetPointData()->GetArray("ViewTerm")->SetComponent(7, 1, 1e100); }, "Gaussian 7"},
  };
  for (const auto& [spoil, word] : cases)
  {
    const auto field = DirectedField(20);
    spoil(field);
    vtkNew<vtkXMLPolyDataWriter> writer;
    writer->SetInputData(field);
    writer->SetFileName(path.c_str());
    writer->SetHeaderTypeToUInt64();
    writer->SetEncodeAppendedData(0);
    for (const bool isOurs : {true, false})
    {
      isOurs ? writer->SetDataModeToAppended() : writer->SetDataModeToAscii();
      writer->Write();
      vtkNew<vtkBigusFieldReader> reader;
      ErrorObserver errors(reader);
      reader->SetFileName(path.c_str());
      reader->Update();
      EXPECT_NE(errors.Text().find(word), std::string::npos) << word << ": " << errors.Text();
      EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 0);
    }
  }
}

TEST(Field, VtpRoundTripIsExact)
{
  TemporaryFolder folder;
  const auto field = RandomField(1000);
  Write(field, folder / "field.vtp");
  vtkNew<vtkBigusFieldReader> reader;
  vtkPolyData* const back = Read(reader, folder / "field.vtp");
  ASSERT_EQ(back->GetNumberOfPoints(), 1000);
  EXPECT_EQ(back->GetNumberOfVerts(), 1000);
  EXPECT_EQ(back->GetPoints()->GetDataType(), VTK_DOUBLE);
  EXPECT_STREQ(back->GetPointData()->GetScalars()->GetName(), "Reflectivity");
  for (vtkIdType i = 0; i < 1000; ++i)
  {
    for (int axis = 0; axis < 3; ++axis)
    {
      EXPECT_EQ(back->GetPoint(i)[axis], field->GetPoint(i)[axis]);
    }
  }
  for (const char* name : {"Scale", "Rotation", "Reflectivity"})
  {
    vtkDataArray* const a = field->GetPointData()->GetArray(name);
    vtkDataArray* const b = back->GetPointData()->GetArray(name);
    ASSERT_EQ(a->GetNumberOfValues(), b->GetNumberOfValues());
    EXPECT_EQ(
        std::memcmp(a->GetVoidPointer(0), b->GetVoidPointer(0), 8u * static_cast<std::size_t>(a->GetNumberOfValues())),
        0);
  }
  EXPECT_EQ(back->GetFieldData()->GetArray("Gamma")->GetComponent(0, 0), 0.123456789012345678);
  EXPECT_EQ(back->GetFieldData()->GetArray("ElevationSigma")->GetComponent(0, 0), 1.0 / 3);
  EXPECT_EQ(back->GetFieldData()->GetArray("FormatVersion")->GetComponent(0, 0), 1);
  auto* const provenance = vtkStringArray::SafeDownCast(back->GetFieldData()->GetAbstractArray("Provenance"));
  ASSERT_TRUE(provenance);
  EXPECT_EQ(provenance->GetValue(0), "sweep=brain.igs.mha");
  EXPECT_EQ(provenance->GetValue(1), "seed=7");
}

TEST(Field, WhatItsStandardErrorRestsOnIsKeptByVtpAlone)
{
  TemporaryFolder folder;
  const auto field = RandomField(3);
  std::string bytes;
  for (std::uint32_t k = 0; k < 100000; ++k)  // more than one compressed block
  {
    bytes.push_back(static_cast<char>(k * k / 7));
  }
  ReplaceStandardError(field, bytes);
  Write(field, folder / "field.vtp");
  Write(field, folder / "field.ply");
  vtkNew<vtkXMLPolyDataWriter> writer;  // which our reader reads by VTK's
  writer->SetFileName((folder / "other.vtp").c_str());
  writer->SetDataModeToAscii();
  writer->SetInputData(field);
  ASSERT_EQ(writer->Write(), 1);
  for (const auto& [name, expected] :
       {std::pair<const char*, std::string>("field.vtp", bytes), {"field.ply", ""}, {"other.vtp", bytes}})
  {
    vtkNew<vtkBigusFieldReader> reader;
    vtkPolyData* const back = Read(reader, folder / name);
    EXPECT_EQ(back->GetNumberOfPoints(), 3) << name;
    EXPECT_TRUE(StandardErrorOf(back) == expected) << name;
  }
  vtkNew<vtkXMLPolyDataReader> older;  // one that does not know it passes over it
  older->SetFileName((folder / "field.vtp").c_str());
  older->Update();
  EXPECT_EQ(older->GetOutput()->GetNumberOfPoints(), 3);

  field->GetFieldData()->RemoveArray("StandardError");
  AddDoubles(field->GetFieldData(), "StandardError", 1, {1, 2});
  vtkNew<vtkBigusFieldWriter> refusing;
  ErrorObserver errors(refusing);
  refusing->SetFileName((folder / "bad.vtp").c_str());
  refusing->SetInputData(field);
  EXPECT_EQ(refusing->Write(), 0);
  EXPECT_NE(errors.Text().find("StandardError"), std::string::npos) << errors.Text();
}

TEST(Field, PlyRoundTripHasThePrecisionPromised)
{
  TemporaryFolder folder;
  const auto field = RandomField(500);
  Write(field, folder / "field.ply");
  vtkNew<vtkBigusFieldReader> reader;
  vtkPolyData* const back = Read(reader, folder / "field.ply");
  ASSERT_EQ(back->GetNumberOfPoints(), 500);
  EXPECT_EQ(back->GetFieldData()->GetArray("Gamma")->GetComponent(0, 0), 0.123456789012345678);
  EXPECT_EQ(back->GetFieldData()->GetArray("ElevationSigma")->GetComponent(0, 0), 1.0 / 3);
  EXPECT_EQ(vtkStringArray::SafeDownCast(back->GetFieldData()->GetAbstractArray("Provenance"))->GetValue(1), "seed=7");
  for (vtkIdType i = 0; i < 500; ++i)
  {
    EXPECT_EQ(back->GetPointData()->GetArray("Reflectivity")->GetComponent(i, 0),
              field->GetPointData()->GetArray("Reflectivity")->GetComponent(i, 0));
    for (int axis = 0; axis < 3; ++axis)
    {
      EXPECT_EQ(back->GetPoint(i)[axis], static_cast<float>(field->GetPoint(i)[axis]));
      const double scale = field->GetPointData()->GetArray("Scale")->GetComponent(i, axis);
      EXPECT_NEAR(back->GetPointData()->GetArray("Scale")->GetComponent(i, axis), scale, 5e-7 * scale);
    }
    const double* q = field->GetPointData()->GetArray("Rotation")->GetTuple4(i);
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const std::array<double, 4> unit = {q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm};
    for (int c = 0; c < 4; ++c)
    {
      EXPECT_NEAR(back->GetPointData()->GetArray("Rotation")->GetComponent(i, c), unit[static_cast<std::size_t>(c)],
                  1e-7);
    }
  }
}

// What viewers of Gaussian splats look for, read byte by byte.
TEST(Field, PlyHasWhatViewersExpect)
{
  TemporaryFolder folder;
  const auto field = RandomField(2);
  field->GetPointData()->GetArray("Reflectivity")->SetComponent(0, 0, -2.0);
  field->GetPointData()->GetArray("Reflectivity")->SetComponent(1, 0, 0.5);
  Write(field, folder / "field.ply");
  const std::string bytes = ReadBytes(folder / "field.ply");
  const std::string end = "end_header\n";
  const std::size_t data = bytes.find(end) + end.size();
  const std::string header = bytes.substr(0, data);
  std::size_t at = header.find("element vertex 2\n");
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
  {
    const std::size_t next = header.find(std::string("property float ") + name + "\n", at);
    ASSERT_NE(next, std::string::npos) << name;
    ASSERT_GT(next, at);
    at = next;
  }
  ASSERT_EQ(bytes.size(), data + 2 * (17 * 4 + 8));
  std::array<float, 17> first, second;
  std::memcpy(first.data(), &bytes[data], 68);
  std::memcpy(second.data(), &bytes[data + 76], 68);
  const double c0 = 0.28209479177387814;
  EXPECT_NEAR(0.5 + c0 * first[6], 1.0, 1e-6);    // the strongest |r| is white
  EXPECT_NEAR(0.5 + c0 * second[8], 0.25, 1e-6);  // a quarter of it is a quarter grey
  EXPECT_NEAR(1 / (1 + std::exp(-first[9])), 0.99, 1e-6);
  EXPECT_NEAR(1 / (1 + std::exp(-second[9])), 0.25, 1e-6);
  EXPECT_NEAR(first[10], std::log(field->GetPointData()->GetArray("Scale")->GetComponent(0, 0)), 1e-6);
}

// One splat as splatting programs write it: opacity and colour give the reflectivity.
std::string ForeignHeader(const std::string& format, int count)
{
  std::string header =
      "ply\nformat " + format + " 1.0\ncomment by another program\nelement vertex " + std::to_string(count) + "\n";
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "f_rest_0", "opacity", "scale_0", "scale_1",
                           "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
  {
    header += std::string("property float ") + name + "\n";
  }
  return header + "end_header\n";
}

TEST(Field, ReadsForeignPly)
{
  TemporaryFolder folder;
  const float numbers[15] = {1, 2, -3, 0.5f, -0.25f, 1.0f, 9, 0.75f, -1, 0, 1, 2, 0, 0, 0};
  const double luminance = 0.5 + 0.28209479177387814 * (0.2126 * 0.5 - 0.7152 * 0.25 + 0.0722);
  const double expected = luminance / (1 + std::exp(-0.75));

  std::string ascii = ForeignHeader("ascii", 1);
  std::string little = ForeignHeader("binary_little_endian", 1);
  std::string big = ForeignHeader("binary_big_endian", 1);
  for (const float number : numbers)
  {
    ascii += std::to_string(number) + " ";
    std::string bytes(reinterpret_cast<const char*>(&number), 4);
    little += bytes;
    big += std::string(bytes.rbegin(), bytes.rend());
  }
  for (const std::string& file : {ascii + "\n", little, big})
  {
    WriteBytes(folder / "foreign.ply", file);
    vtkNew<vtkBigusFieldReader> reader;
    vtkPolyData* const back = Read(reader, folder / "foreign.ply");
    ASSERT_EQ(back->GetNumberOfPoints(), 1);
    EXPECT_EQ(back->GetPoint(0)[2], -3);
    EXPECT_NEAR(back->GetPointData()->GetArray("Scale")->GetComponent(0, 2), std::exp(1.0), 1e-12);
    EXPECT_NEAR(back->GetPointData()->GetArray("Reflectivity")->GetComponent(0, 0), expected, 1e-12);
    EXPECT_EQ(back->GetFieldData()->GetArray("Gamma")->GetComponent(0, 0), 1);
    EXPECT_EQ(back->GetFieldData()->GetArray("ElevationSigma")->GetComponent(0, 0), 0);
  }
}

TEST(Field, EmptyFieldIsValid)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusFieldReader> reader;
  for (const char* name : {"empty.vtp", "empty.ply"})
  {
    Write(vtkNew<vtkPolyData>(), folder / name);
    EXPECT_EQ(Read(reader, folder / name)->GetNumberOfPoints(), 0);
    Write(RandomField(0), folder / name);
    EXPECT_EQ(Read(reader, folder / name)->GetFieldData()->GetArray("ElevationSigma")->GetComponent(0, 0), 1.0 / 3);
  }
}

// Rounded numbers are floats, stored as such, and come back as they were written.
TEST(Field, ARoundedFieldIsLessThanHalfAsLargeAndComesBack)
{
  TemporaryFolder folder;
  const auto field = RandomField(3000);
  Write(field, folder / "field.vtp");
  vtkNew<vtkBigusFieldWriter> writer;
  writer->SetInputData(field);
  writer->SetFileName((folder / "rounded.vtp").c_str());
  writer->RoundingOn();
  ASSERT_EQ(writer->Write(), 1);
  EXPECT_LT(2 * std::filesystem::file_size(folder / "rounded.vtp"), std::filesystem::file_size(folder / "field.vtp"));
  bigus::GaussianField rounded = bigus::FieldFromPolyData(field);
  bigus::RoundField(rounded);
  vtkNew<vtkBigusFieldReader> reader;
  vtkPolyData* const back = Read(reader, folder / "rounded.vtp");
  EXPECT_EQ(back->GetPoints()->GetDataType(), VTK_DOUBLE);
  EXPECT_EQ(back->GetNumberOfVerts(), 3000);
  EXPECT_TRUE(bigus::test::SameField(bigus::FieldFromPolyData(back), rounded));
  EXPECT_TRUE(bigus::ReadVtp(folder / "rounded.vtp").has_value());
  vtkNew<vtkXMLPolyDataReader> stock;
  stock->SetFileName((folder / "rounded.vtp").c_str());
  stock->Update();
  EXPECT_TRUE(bigus::test::SameField(bigus::FieldFromPolyData(stock->GetOutput()), rounded));
  auto* const provenance = vtkStringArray::SafeDownCast(back->GetFieldData()->GetAbstractArray("Provenance"));
  ASSERT_TRUE(provenance);
  EXPECT_EQ(provenance->GetValue(1), "seed=7");
}

// Another program's .vtp: any number type, encoding and header, no cells.
TEST(Field, ReadsEveryEncodingThatVtkWrites)
{
  TemporaryFolder folder;
  const auto field = RandomField(3000);  // more than one compressed block an array
  vtkNew<vtkFloatArray> single;
  single->DeepCopy(field->GetPointData()->GetArray("Reflectivity"));
  field->GetPointData()->AddArray(single);
  for (const std::string encoding : {"ascii", "binary", "appended", "base64"})
  {
    for (int variant = 0; variant < 8; ++variant)
    {
      const bool compressed = variant & 1;
      const bool wide = variant & 2;
      const bool big = variant & 4;
      SCOPED_TRACE(encoding + (compressed ? " zlib" : "") + (wide ? " UInt64" : "") + (big ? " big" : ""));
      vtkNew<vtkXMLPolyDataWriter> writer;
      writer->SetFileName((folder / "other.vtp").c_str());
      writer->SetDataMode(encoding == "ascii"    ? vtkXMLWriter::Ascii
                          : encoding == "binary" ? vtkXMLWriter::Binary
                                                 : vtkXMLWriter::Appended);
      writer->SetEncodeAppendedData(encoding == "base64");
      writer->SetCompressorType(compressed ? vtkXMLWriter::ZLIB : vtkXMLWriter::NONE);
      writer->SetHeaderType(wide ? vtkXMLWriter::UInt64 : vtkXMLWriter::UInt32);
      writer->SetByteOrder(big ? vtkXMLWriter::BigEndian : vtkXMLWriter::LittleEndian);
      writer->SetInputData(field);
      ASSERT_EQ(writer->Write(), 1);
      vtkNew<vtkBigusFieldReader> reader;
      vtkPolyData* const back = Read(reader, folder / "other.vtp");
      ASSERT_EQ(back->GetNumberOfPoints(), 3000);
      EXPECT_EQ(back->GetNumberOfVerts(), 3000);
      for (vtkIdType i = 0; i < 3000; i += 13)
      {
        EXPECT_NEAR(back->GetPoint(i)[1], field->GetPoint(i)[1], encoding == "ascii" ? 1e-8 : 0);
        const double scale = field->GetPointData()->GetArray("Scale")->GetComponent(i, 2);
        EXPECT_NEAR(back->GetPointData()->GetArray("Scale")->GetComponent(i, 2), scale,
                    encoding == "ascii" ? 1e-9 * scale : 0);
        EXPECT_NEAR(back->GetPointData()->GetArray("Reflectivity")->GetComponent(i, 0), single->GetValue(i), 1e-6);
      }
      auto* const provenance = vtkStringArray::SafeDownCast(back->GetFieldData()->GetAbstractArray("Provenance"));
      ASSERT_TRUE(provenance);
      EXPECT_EQ(provenance->GetValue(1), "seed=7");
    }
  }
}

// And VTK's own reader reads ours.
TEST(Field, VtkReadsTheVtp)
{
  TemporaryFolder folder;
  const auto field = RandomField(100);
  Write(field, folder / "field.vtp");
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName((folder / "field.vtp").c_str());
  reader->Update();
  ASSERT_EQ(reader->GetOutput()->GetNumberOfPoints(), 100);
  EXPECT_EQ(reader->GetOutput()->GetNumberOfVerts(), 100);
  EXPECT_EQ(reader->GetOutput()->GetPointData()->GetArray("Rotation")->GetComponent(99, 3),
            field->GetPointData()->GetArray("Rotation")->GetComponent(99, 3));
}

// A field that must not be written, nor read where another program wrote it.
TEST(Field, RefusesUnsoundFields)
{
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto set = [](const char* array, int index, int component, double value) {
    return [=](vtkPolyData* field) { field->GetPointData()->GetArray(array)->SetComponent(index, component, value); };
  };
  const auto remove = [](const char* array)
  { return [=](vtkPolyData* field) { field->GetPointData()->RemoveArray(array); }; };
  const auto reshape = [](const char* array, int components, int tuples)
  {
    return [=](vtkPolyData* field)
    {
      AddDoubles(field->GetPointData(), array, components,
                 std::vector<double>(static_cast<std::size_t>(components * tuples), 1));
    };
  };
  struct Case
  {
    std::function<void(vtkPolyData*)> spoil;
    std::vector<std::string> parts;
    bool vtkWritesIt = true;
  };
  const std::vector<Case> cases = {
      {remove("Scale"), {"Scale", "missing"}},
      {remove("Rotation"), {"Rotation", "missing"}},
      {remove("Reflectivity"), {"Reflectivity", "missing"}},
      {reshape("Scale", 1, 20), {"Scale", "20 of 3"}},
      {reshape("Rotation", 3, 20), {"Rotation", "20 of 4"}},
      {reshape("Reflectivity", 2, 20), {"Reflectivity", "20 of 1"}},
      {reshape("Scale", 3, 19), {"Scale", "19"}, false},
      {set("Scale", 3, 1, 0), {"3"}},
      {set("Scale", 3, 1, -0.5), {"3", "-0.5"}},
      {set("Scale", 3, 1, nan), {"3"}},
      {set("Rotation", 17, 2, nan), {"17"}},
      {set("Reflectivity", 17, 0, HUGE_VAL), {"17"}},
      {[](vtkPolyData* field) { field->GetPointData()->GetArray("Rotation")->SetTuple4(5, 0, 0, 0, 0); }, {"5"}},
      {[=](vtkPolyData* field) { field->GetPoints()->SetPoint(9, nan, 0, 0); }, {"9"}},
      {[](vtkPolyData* field) { field->GetFieldData()->RemoveArray("Gamma"); }, {"Gamma", "missing"}},
      {[](vtkPolyData* field) { field->GetFieldData()->RemoveArray("ElevationSigma"); }, {"ElevationSigma", "missing"}},
      {[](vtkPolyData* field) { AddDoubles(field->GetFieldData(), "ProbeElevationSigma", 1, {-1}); }, {"probe"}},
      {[](vtkPolyData* field) {
         AddDoubles(field->GetFieldData(), "TrainedNormals", 3, {1, 1, 0});
       },
       {"normal"}},
      {[](vtkPolyData* field) {
         AddDoubles(field->GetFieldData(), "TrainedNormals", 2, {1, 0});
       },
       {"TrainedNormals"}},
      {[](vtkPolyData* field) { AddDoubles(field->GetFieldData(), "Gamma", 1, {0}); }, {"amma"}},
      {[](vtkPolyData* field) { AddDoubles(field->GetFieldData(), "ElevationSigma", 1, {-1}); }, {"levation"}},
      {[](vtkPolyData* field) { AddDoubles(field->GetFieldData(), "FormatVersion", 1, {2}); }, {"FormatVersion"}},
  };
  TemporaryFolder folder;
  for (std::size_t i = 0; i < cases.size(); ++i)
  {
    SCOPED_TRACE(i);
    const auto field = RandomField(20);
    cases[i].spoil(field);
    for (const char* name : {"bad.vtp", "bad.ply"})
    {
      vtkNew<vtkBigusFieldWriter> writer;
      ErrorObserver errors(writer);
      writer->SetFileName((folder / name).c_str());
      writer->SetInputData(field);
      EXPECT_EQ(writer->Write(), 0);
      EXPECT_EQ(errors.Errors().size(), 1u) << errors.Text();
      for (const std::string& part : cases[i].parts)
      {
        EXPECT_NE(errors.Text().find(part), std::string::npos) << errors.Text();
      }
      EXPECT_FALSE(std::filesystem::exists(folder / name));
    }
    if (!cases[i].vtkWritesIt)
    {
      continue;
    }
    vtkNew<vtkXMLPolyDataWriter> other;
    other->SetFileName((folder / "other.vtp").c_str());
    other->SetInputData(field);
    other->Write();
    vtkNew<vtkBigusFieldReader> reader;
    ErrorObserver errors(reader);
    reader->SetFileName((folder / "other.vtp").c_str());
    reader->Update();
    ASSERT_EQ(errors.Errors().size(), 1u) << errors.Text();
    EXPECT_NE(errors.Text().find("other.vtp"), std::string::npos);
    for (const std::string& part : cases[i].parts)
    {
      EXPECT_NE(errors.Text().find(part), std::string::npos) << errors.Text();
    }
    EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 0);
    EXPECT_NE(reader->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
  }
}

void ExpectRefused(const std::string& fileName, const std::string& part)
{
  vtkNew<vtkBigusFieldReader> reader;
  ErrorObserver errors(reader);
  reader->SetFileName(fileName.c_str());
  reader->Update();
  ASSERT_EQ(errors.Errors().size(), 1u) << errors.Text();
  EXPECT_NE(errors.Text().find(part), std::string::npos) << errors.Text();
  EXPECT_NE(errors.Text().find(fileName), std::string::npos) << errors.Text();
  EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 0);
  EXPECT_NE(reader->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
}

TEST(Field, RefusesBadFiles)
{
  TemporaryFolder folder;
  WriteBytes(folder / "empty.ply", "");
  ExpectRefused(folder / "empty.ply", "empty");
  ExpectRefused(folder / "missing.vtp", "no such file");
  WriteBytes(folder / "foreign.vtp", "<?xml version=\"1.0\"?><svg/>");
  ExpectRefused(folder / "foreign.vtp", "neither");

  const std::string row = "1 2 3 0 0 0 0 0 0 0 0 1 0 0 0\n";
  const std::string good = ForeignHeader("ascii", 2) + row + row;
  const std::vector<std::tuple<std::string, std::string, std::string>> cases = {
      {"format ascii 1.0\n", "", "no format"},
      {"format ascii 1.0", "format ascii 2.0", "not PLY 1.0"},
      {"element vertex 2", "element vertex -2", "element vertex -2"},
      {"element vertex 2", "element vertex 99999999999999999999", "one vertex element"},
      {"element vertex 2", "element vertex 1000000000", "claims 1000000000"},
      {"element vertex 2", "element vertex 3", "claims 3 vertices"},
      {"element vertex 2", "element face 2\nelement vertex 2", "vertex must be the first"},
      {"element vertex 2\n", "", "no vertex element"},
      {"property float x", "property list uchar int x", "no lists"},
      {"property float x", "property quad x", "number type"},
      {"property float scale_1\n", "property float scale_9\n", "scale_1"},
      {"property float opacity\n", "property float opaque\n", "opacity"},
      {"property float rot_3\n", "", "rot_3"},
      {"end_header\n", "", "not PLY 1.0"},
      {row + row, "1 2 3 0 0 0 0 0 1000 0 0 1 0 0 0\n" + row, "0"},
      {row + row, "1 2 3 0 0 0 0 0 0 0 0 0 0 0 0\n" + row, "0"},
      {row + row, "nan 2 3 0 0 0 0 0 0 0 0 1 0 0 0\n" + row, "0"},
      {row + row, row + "1 2 3 0 0 0 0 0 0 0 0 one 0 0 0\n", "vertex 1 is not"},
      {row + row, row, "truncated"},
      {"comment by another program", "comment bigus.gamma much", "bigus.gamma"},
      {"comment by another program", "comment bigus.gamma -1", "amma"},
      {"comment by another program", "comment bigus.format_version 2", "version"},
  };
  for (const auto& [from, to, part] : cases)
  {
    SCOPED_TRACE(from + " -> " + to);
    std::string bad = good;
    bad.replace(bad.find(from), from.size(), to);
    WriteBytes(folder / "bad.ply", bad);
    ExpectRefused(folder / "bad.ply", part);
  }
}

TEST(Field, RefusesEveryTruncation)
{
  TemporaryFolder folder;
  for (const char* name : {"field.ply", "field.vtp"})
  {
    Write(RandomField(3), folder / name);
    const std::string whole = ReadBytes(folder / name);
    const std::size_t last = whole.size() - 1;  // a last line end may be missing
    for (std::size_t length = 0; length < last; length += 1 + last / 400)
    {
      SCOPED_TRACE(std::string(name) + " " + std::to_string(length));
      WriteBytes(folder / (std::string("cut_") + name), whole.substr(0, length));
      ExpectRefused(folder / (std::string("cut_") + name), "cut_");
    }
  }
}

TEST(Field, RefusesUnwritableNamesAndSurvivesAFullDisk)
{
  TemporaryFolder folder;
  const auto field = RandomField(20000);
  const auto refused = [&](const std::string& name)
  {
    vtkNew<vtkBigusFieldWriter> writer;
    ErrorObserver errors(writer);
    writer->SetFileName(name.c_str());
    writer->SetInputData(field);
    EXPECT_EQ(writer->Write(), 0) << name;
    EXPECT_EQ(errors.Errors().size(), 1u) << errors.Text();
    EXPECT_NE(writer->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
  };
  refused(folder / "field.obj");
  refused(folder / "missing/field.vtp");
  refused("");
  for (const char* name : {"field.vtp", "field.ply"})
  {
    WriteBytes(folder / name, "what was here before");
    rlimit before;
    getrlimit(RLIMIT_FSIZE, &before);
    rlimit small = before;
    small.rlim_cur = 100 * 1024;
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &small);
    refused(folder / name);
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    EXPECT_EQ(ReadBytes(folder / name), "what was here before");
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.Path()), {}), 2);
}

}  // namespace
}  // namespace bigus::test
