// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The standard errors of slices and voxels: Core's at the same plane, whole or in parts, and an error where a field has none.
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/StandardError/StandardError.h"
#include "Data/FieldData.h"
#include "Filters/FilterTestSupport.h"
#include "vtkBigusReslice.h"
#include "vtkBigusVoxelizer.h"
#include "vtkUnsignedCharArray.h"

namespace bigus::test
{
namespace
{

/// Frames of noise, 1 mm apart, across the box of RandomField.
Sweep FramesOfNoise()
{
  Random random(3);
  Sweep sweep;
  sweep.width = sweep.height = 50;
  sweep.pixelType = Sweep::PixelType::Float32;
  auto pixels = std::make_shared<std::vector<float>>();
  for (int k = -2; k <= 2; ++k)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 0) = pose(1, 1) = 0.5;
    pose.col(3) = Eigen::Vector4d(-12, -12, k, 1);
    sweep.imageToReference.push_back(pose);
    for (int p = 0; p < 50 * 50; ++p)
    {
      pixels->push_back(static_cast<float>(random.Uniform(0, 1)));
    }
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

const StandardError& StandardErrorOfNoise()
{
  static const Sweep sweep = FramesOfNoise();
  static const StandardError kept(RandomField(200, 5), sweep, AllFrames(sweep), 0.1);
  return kept;
}

/// Two oblique slices of 40 x 30 pixels that leave the frames.
vtkSmartPointer<vtkBigusReslice> SlicesThatLeaveTheFrames()
{
  const auto field = ToPolyData(RandomField(200, 5));
  ReplaceStandardError(field, StandardErrorOfNoise().ToBytes());
  const auto reslice = vtkSmartPointer<vtkBigusReslice>::New();
  reslice->SetInputDataObject(0, field);
  Random random(8);
  reslice->SetResliceAxes(ToVtk(RigidMatrix(RandomRotation(random), {1, -2, 0.5})));
  reslice->SetOutputSpacing(0.4, 0.4, 1.5);
  reslice->SetOutputOrigin(-8, -7, -1);
  reslice->SetOutputExtent(0, 39, 0, 29, 0, 1);
  reslice->SetOutputScalarTypeToUnsignedChar();  // the standard error is of the intensity before rounding
  reslice->GenerateStandardErrorOutputOn();
  return reslice;
}

bool IsSameSigma(float a, float b)
{
  return a == b || (std::isnan(a) && std::isnan(b));
}

/// That `sigma` is what Core says of each slice, [height][width] of the field seen so, whose index (i, j, k) lies at `at`.
void ExpectThatOfCore(vtkImageData* sigma, const GaussianField& field,
                      const std::function<Eigen::Vector3d(int, int, int)>& at)
{
  int size[3];
  sigma->GetDimensions(size);
  const std::unique_ptr<Engine> engine = Engine::Create("auto");
  engine->SetField(field);
  int known = 0, unknown = 0;
  for (int k = 0; k < size[2]; ++k)
  {
    SlicePlane plane;
    plane.width = size[0];
    plane.height = size[1];
    plane.origin = at(0, 0, k);
    plane.columnStep = at(1, 0, k) - plane.origin;
    plane.rowStep = at(0, 1, k) - plane.origin;
    std::vector<float> image(plane.NumberOfPixels()), expected(image.size());
    engine->Render(plane, ViewOutput::Intensity, image.data());
    StandardErrorOfNoise().Evaluate(plane, image.data(), expected.data());
    for (int p = 0; p < size[0] * size[1]; ++p)
    {
      const float found = static_cast<float*>(sigma->GetScalarPointer(p % size[0], p / size[0], k))[0];
      ASSERT_EQ(std::isnan(found), std::isnan(expected[p]));
      (std::isnan(found) ? unknown : known) += 1;
      // The image is right to the filter's tolerance, 1e-4, and its slopes to twice of it a pixel of 0.4 mm.
      ASSERT_TRUE(std::isnan(found) || std::abs(found - expected[p]) < 1e-3) << p;
    }
  }
  EXPECT_GT(known, 100);
  EXPECT_GT(unknown, 100);
}

TEST(StandardErrorOutput, IsThatOfCore)
{
  const auto reslice = SlicesThatLeaveTheFrames();
  reslice->Update();
  vtkImageData* sigma = reslice->GetStandardErrorOutput();
  ASSERT_EQ(sigma->GetNumberOfPoints(), 40 * 30 * 2);
  ExpectThatOfCore(sigma, RandomField(200, 5),
                   [&](int i, int j, int k)
                   {
                     const double place[4] = {-8 + 0.4 * i, -7 + 0.4 * j, -1 + 1.5 * k, 1};
                     double world[4];
                     reslice->GetResliceAxes()->MultiplyPoint(place, world);
                     return Eigen::Vector3d(world[0], world[1], world[2]);
                   });
}

TEST(StandardErrorOutput, OfVoxelsIsThatOfCoreInTheVolumesThinSlices)
{
  const auto field = ToPolyData(RandomField(200, 5));
  ReplaceStandardError(field, StandardErrorOfNoise().ToBytes());
  vtkNew<vtkBigusVoxelizer> voxelizer;
  voxelizer->SetInputDataObject(0, field);
  const double direction[9] = {1, 0, 0, 0, 0.8, -0.6, 0, 0.6, 0.8};
  voxelizer->SetOutputDirection(direction);
  voxelizer->SetOutputDimensions(30, 25, 4);
  voxelizer->SetOutputOrigin(-6, -5, -3);
  voxelizer->SetOutputSpacing(0.4, 0.4, 0.9);
  voxelizer->GenerateStandardErrorOutputOn();
  voxelizer->Update();
  vtkImageData* sigma = voxelizer->GetStandardErrorOutput();
  ASSERT_EQ(sigma->GetNumberOfPoints(), 30 * 25 * 4);
  const auto at = [&](int i, int j, int k)
  { return Eigen::Vector3d(-6 + 0.4 * i, -5 + 0.32 * j - 0.54 * k, -3 + 0.24 * j + 0.72 * k); };
  GaussianField thin = RandomField(200, 5);
  thin.beam = Beam{0};
  ExpectThatOfCore(sigma, thin, at);
  const int last[3] = {29, 24, 3};
  double place[3];
  sigma->TransformIndexToPhysicalPoint(last, place);
  EXPECT_LT((Eigen::Map<Eigen::Vector3d>(place) - at(29, 24, 3)).norm(), 1e-9);
}

TEST(StandardErrorOutput, TellsThatOfTheMeanOfSlices)
{
  const auto reslice = SlicesThatLeaveTheFrames();
  const ErrorObserver observer(reslice);
  EXPECT_TRUE(std::isnan(reslice->GetStandardErrorOfMean()));  // nothing yet
  reslice->Update();
  const double two = reslice->GetStandardErrorOfMean();
  EXPECT_GT(two, 0);
  reslice->SetOutputExtent(0, 39, 0, 29, 0, 0);
  reslice->Update();
  vtkImageData* sigma = reslice->GetStandardErrorOutput();
  vtkNew<vtkImageData> where;
  where->SetDimensions(40, 30, 1);
  where->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  SlicePlane plane;
  plane.width = 40;
  plane.height = 30;
  plane.columnStep = 0.4 * Eigen::Vector3d::UnitX();
  plane.rowStep = 0.4 * Eigen::Vector3d::UnitY();
  auto* chosen = static_cast<unsigned char*>(where->GetScalarPointer());
  for (int p = 0; p < 40 * 30; ++p)
  {
    chosen[p] = p % 40 < 25 ? 3 : 0;
  }
  const auto* values = static_cast<const float*>(sigma->GetScalarPointer());
  EXPECT_NEAR(reslice->GetStandardErrorOfMean(), StandardErrorOfNoise().OfMean(plane, values), 1e-9);
  EXPECT_NEAR(reslice->GetStandardErrorOfMean(where), StandardErrorOfNoise().OfMean(plane, values, chosen), 1e-9);
  where->SetDimensions(30, 40, 1);
  EXPECT_TRUE(std::isnan(reslice->GetStandardErrorOfMean(where)));
  EXPECT_EQ(observer.Errors().size(), 2u);
}

/// Pixels that are floats are not rendered a second time; those that are rounded, filled or joined of several planes are.
TEST(StandardErrorOutput, IsTheSameHoweverTheSliceIsShown)
{
  const auto asBytes = SlicesThatLeaveTheFrames();
  asBytes->Update();
  const auto same = [&](const std::function<void(vtkBigusReslice*)>& change)
  {
    const auto reslice = SlicesThatLeaveTheFrames();
    reslice->SetOutputScalarTypeToFloat();
    change(reslice);
    reslice->Update();
    for (int p = 0; p < 40 * 30 * 2; ++p)
    {
      const auto* a = static_cast<float*>(asBytes->GetStandardErrorOutput()->GetScalarPointer()) + p;
      const auto* b = static_cast<float*>(reslice->GetStandardErrorOutput()->GetScalarPointer()) + p;
      ASSERT_TRUE(IsSameSigma(*a, *b)) << p << ' ' << *a << ' ' << *b;
    }
  };
  same([](vtkBigusReslice*) {});
  same([](vtkBigusReslice* reslice) { reslice->SetBackgroundLevel(0.7); });
  same([](vtkBigusReslice* reslice) { reslice->SetSlabNumberOfSlices(3); });
  same([](vtkBigusReslice* reslice) { reslice->SetOutputModeToScatteringField(); });
}

TEST(StandardErrorOutput, InPartsIsThatOfTheWhole)
{
  const auto whole = SlicesThatLeaveTheFrames();
  whole->Update();
  const int parts[][6] = {{0, 13, 0, 29, 0, 0}, {14, 39, 7, 9, 0, 1}, {5, 5, 5, 5, 1, 1}};
  for (const auto& part : parts)
  {
    const auto reslice = SlicesThatLeaveTheFrames();
    reslice->UpdateExtent(part);
    for (int k = part[4]; k <= part[5]; ++k)
    {
      for (int j = part[2]; j <= part[3]; ++j)
      {
        for (int i = part[0]; i <= part[1]; ++i)
        {
          const auto* a = static_cast<float*>(whole->GetStandardErrorOutput()->GetScalarPointer(i, j, k));
          const auto* b = static_cast<float*>(reslice->GetStandardErrorOutput()->GetScalarPointer(i, j, k));
          ASSERT_TRUE(IsSameSigma(*a, *b)) << i << ' ' << j << ' ' << k;
        }
      }
    }
  }
}

TEST(StandardErrorOutput, IsEmptyUnlessAskedForAndAnErrorWhereThereIsNone)
{
  const auto reslice = SlicesThatLeaveTheFrames();
  reslice->GenerateStandardErrorOutputOff();
  reslice->Update();
  EXPECT_EQ(reslice->GetStandardErrorOutput()->GetNumberOfPoints(), 0);

  vtkNew<vtkUnsignedCharArray> damaged;
  damaged->SetName("StandardError");
  damaged->InsertNextValue(7);
  for (vtkDataArray* array : {static_cast<vtkDataArray*>(nullptr), static_cast<vtkDataArray*>(damaged)})
  {
    const auto field = ToPolyData(RandomField(20, 5));
    if (array)
    {
      field->GetFieldData()->AddArray(array);
    }
    const auto wrong = SlicesThatLeaveTheFrames();
    wrong->SetInputDataObject(0, field);
    ErrorObserver errors(wrong);
    wrong->Update();
    ASSERT_FALSE(errors.Errors().empty());
    EXPECT_NE(errors.Errors().front().find("StandardError"), std::string::npos) << errors.Errors().front();
    EXPECT_EQ(wrong->GetOutput()->GetNumberOfPoints(), 0);
  }
}

}  // namespace
}  // namespace bigus::test
