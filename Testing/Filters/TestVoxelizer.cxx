// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusVoxelizer: the field at voxel centres, on the grid asked for.

#include "Filters/FilterTestSupport.h"
#include "vtkBigusReslice.h"
#include "vtkBigusVoxelizer.h"
#include "vtkMatrix3x3.h"

namespace bigus::test
{
namespace
{

TEST(Voxelizer, VoxelsHoldTheFieldAtTheirCentres)
{
  for (int trial = 0; trial < 4; ++trial)
  {
    Random random(trial);
    const GaussianField field = RandomField(40, 50 + trial);
    const auto input = ToPolyData(field);
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> direction = RandomRotation(random);
    vtkNew<vtkBigusVoxelizer> voxelizer;
    voxelizer->SetInputData(input);
    voxelizer->SetOutputDirection(direction.data());
    voxelizer->SetOutputSpacing(random.Vector(0.4, 1).data());
    voxelizer->SetOutputOrigin(random.Vector(-8, 0).data());
    voxelizer->SetOutputDimensions(11, 12, 9);
    voxelizer->SetOutputModeToScatteringField();
    voxelizer->SetTolerance(0);
    voxelizer->Update();

    vtkImageData* image = voxelizer->GetOutput();
    ASSERT_EQ(image->GetNumberOfPoints(), 11 * 12 * 9);
    EXPECT_EQ(image->GetDirectionMatrix()->GetElement(1, 0), direction(1, 0));
    double worst = 0;
    for (vtkIdType voxel = 0; voxel < image->GetNumberOfPoints(); ++voxel)
    {
      double x[3];
      image->GetPoint(voxel, x);  // VTK's own idea of where the voxel lies
      const double value = image->GetPointData()->GetScalars()->GetTuple1(voxel);
      worst = std::max(worst, std::abs(value - ThinScattering(field, Eigen::Vector3d(x))));
    }
    EXPECT_LT(worst, 2e-4);
    EXPECT_GT(LargestValue(image), 0.05);
  }
}

TEST(Voxelizer, WithoutAGridTheWholeFieldFits)
{
  const GaussianField field = RandomField(30, 2);
  const auto input = ToPolyData(field);
  vtkNew<vtkBigusVoxelizer> voxelizer;
  voxelizer->SetInputData(input);
  voxelizer->SetMaximumDimension(40);
  voxelizer->Update();
  vtkImageData* image = voxelizer->GetOutput();
  const int* size = image->GetDimensions();
  EXPECT_EQ(*std::max_element(size, size + 3), 40);
  for (int axis = 0; axis < 3; ++axis)
  {
    EXPECT_DOUBLE_EQ(image->GetSpacing()[axis], image->GetSpacing()[0]);
  }
  // Three standard deviations of every Gaussian, seen along each axis.
  const double* bounds = image->GetBounds();
  const double half = 0.5 * image->GetSpacing()[0];
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    const Eigen::Matrix3d rotation = RotationMatrix(field.rotations[i]);
    for (int axis = 0; axis < 3; ++axis)
    {
      const double reach = 3 * rotation.row(axis).transpose().cwiseProduct(field.scales[i]).norm();
      EXPECT_GE(field.means[i][axis] - reach, bounds[2 * axis] - half - 1e-9);
      EXPECT_LE(field.means[i][axis] + reach, bounds[2 * axis + 1] + half + 1e-9);
    }
  }
}

TEST(Voxelizer, WhatIsSetReplacesItsPartOfTheAutomaticGrid)
{
  const auto input = ToPolyData(RandomField(30, 2));
  vtkNew<vtkBigusVoxelizer> automatic;
  automatic->SetInputData(input);
  automatic->SetMaximumDimension(30);
  automatic->Update();
  const double* bounds = automatic->GetOutput()->GetBounds();

  vtkNew<vtkBigusVoxelizer> voxelizer;
  voxelizer->SetInputData(input);
  voxelizer->SetOutputSpacing(1.5, 2, 3);
  voxelizer->Update();
  const double* spacing = voxelizer->GetOutput()->GetSpacing();
  EXPECT_EQ(spacing[1], 2);
  const double* covered = voxelizer->GetOutput()->GetBounds();
  for (int axis = 0; axis < 3; ++axis)
  {
    EXPECT_NEAR(covered[2 * axis] + covered[2 * axis + 1], bounds[2 * axis] + bounds[2 * axis + 1], 1e-9);
    EXPECT_NEAR(covered[2 * axis + 1] - covered[2 * axis], bounds[2 * axis + 1] - bounds[2 * axis],
                spacing[axis] / 2 + automatic->GetOutput()->GetSpacing()[0]);
  }

  voxelizer->SetOutputSpacingToDefault();
  voxelizer->SetOutputDimensions(10, 20, 1);
  voxelizer->Update();
  EXPECT_EQ(voxelizer->GetOutput()->GetDimensions()[1], 20);
  covered = voxelizer->GetOutput()->GetBounds();
  EXPECT_NEAR(covered[0] + covered[1], bounds[0] + bounds[1], 0.2);
  EXPECT_NEAR(covered[3] - covered[2], bounds[3] - bounds[2], 1);

  voxelizer->SetOutputDimensionsToDefault();
  voxelizer->SetOutputSpacing(1, 1, 1);
  voxelizer->SetOutputOrigin(0, 0, 0);
  voxelizer->Update();
  EXPECT_EQ(voxelizer->GetOutput()->GetOrigin()[2], 0);
  EXPECT_NEAR(voxelizer->GetOutput()->GetBounds()[1], bounds[1], 1);
}

#ifdef BIGUS_WITH_STREAMER
TEST(Voxelizer, IsAStackOfReslicedPlanes)
{
  const auto input = ToPolyData(RandomField(80, 4));
  for (double sigma : {0.0, -1.0})
  {
    vtkNew<vtkBigusVoxelizer> voxelizer;
    voxelizer->SetInputData(input);
    voxelizer->SetElevationSigma(sigma);
    voxelizer->SetOutputOrigin(-5, -6, -7);
    voxelizer->SetOutputSpacing(0.5, 0.6, 0.7);
    voxelizer->SetOutputDimensions(20, 19, 18);
    voxelizer->Update();
    vtkNew<vtkBigusReslice> reslice;
    reslice->SetInputData(input);
    reslice->SetElevationSigma(sigma);
    reslice->SetOutputOrigin(-5, -6, -7);
    reslice->SetOutputSpacing(0.5, 0.6, 0.7);
    reslice->SetOutputExtent(0, 19, 0, 18, 0, 17);
    reslice->Update();
    EXPECT_TRUE(SameBits(voxelizer->GetOutput(), reslice->GetOutput()));

    vtkNew<vtkImageDataStreamer> streamer;
    streamer->SetInputConnection(voxelizer->GetOutputPort());
    streamer->SetNumberOfStreamDivisions(5);
    streamer->Update();
    EXPECT_TRUE(SameBits(streamer->GetOutput(), reslice->GetOutput()));
  }
}
#endif

TEST(Voxelizer, SettingTheSameGridAgainDoesNotExecuteAgain)
{
  const auto input = ToPolyData(RandomField(10, 4));
  vtkNew<vtkBigusVoxelizer> voxelizer;
  voxelizer->SetInputData(input);
  voxelizer->SetOutputSpacing(1, 2, 3);
  voxelizer->SetOutputOrigin(-1, -2, -3);
  voxelizer->SetOutputDimensions(4, 5, 6);
  voxelizer->Update();
  const vtkMTimeType set = voxelizer->GetMTime(), made = voxelizer->GetOutput()->GetMTime();
  voxelizer->SetOutputSpacing(1, 2, 3);
  voxelizer->SetOutputOrigin(-1, -2, -3);
  voxelizer->SetOutputDimensions(4, 5, 6);
  EXPECT_EQ(voxelizer->GetMTime(), set);
  voxelizer->Update();
  EXPECT_EQ(voxelizer->GetOutput()->GetMTime(), made);

  const auto expectChange = [&](auto&& change)
  {
    const vtkMTimeType before = voxelizer->GetMTime();
    change();
    EXPECT_GT(voxelizer->GetMTime(), before);
    const vtkMTimeType after = voxelizer->GetMTime();
    change();
    EXPECT_EQ(voxelizer->GetMTime(), after);
  };
  expectChange([&] { voxelizer->SetOutputSpacingToDefault(); });
  expectChange([&] { voxelizer->SetOutputOriginToDefault(); });
  expectChange([&] { voxelizer->SetOutputDimensionsToDefault(); });
  // The values shown while a default is in force are not those given.
  expectChange([&] { voxelizer->SetOutputSpacing(1, 1, 1); });
  expectChange([&] { voxelizer->SetOutputOrigin(0, 0, 0); });
  expectChange([&] { voxelizer->SetOutputDimensions(1, 1, 1); });
}

TEST(VoxelizerBadInput, OneErrorEach)
{
  const auto input = ToPolyData(RandomField(10, 4));
  const auto expect = [&](void (*change)(vtkBigusVoxelizer*), std::vector<std::string> parts)
  {
    vtkNew<vtkBigusVoxelizer> voxelizer;
    voxelizer->SetInputData(input);
    voxelizer->SetOutputDimensions(4, 4, 4);
    change(voxelizer);
    ExpectOneError(voxelizer, parts);
  };
  expect([](vtkBigusVoxelizer* f) { f->SetOutputDimensions(0, 4, 4); }, {"OutputDimensions", "0 x 4 x 4"});
  expect([](vtkBigusVoxelizer* f) { f->SetOutputDimensions(100000, 100000, 4); }, {"MaximumOutputPixels"});
  expect(
      [](vtkBigusVoxelizer* f)
      {
        f->SetOutputDimensionsToDefault();
        f->SetOutputSpacing(1e-5, 1e-5, 1e-5);
      },
      {"MaximumOutputPixels"});
  expect([](vtkBigusVoxelizer* f) { f->SetOutputSpacing(0, 1, 1); }, {"OutputSpacing", "mm"});
  expect([](vtkBigusVoxelizer* f) { f->SetOutputSpacing(std::nan(""), 1, 1); }, {"OutputSpacing"});
  expect(
      [](vtkBigusVoxelizer* f)
      {
        const double flat[9] = {1, 1, 0, 0, 0, 0, 0, 0, 1};
        f->SetOutputDirection(flat);
      },
      {"OutputDirection"});
  expect(
      [](vtkBigusVoxelizer* f)
      {
        const double unknown[9] = {1, 0, 0, 0, std::nan(""), 0, 0, 0, 1};
        f->SetOutputDirection(unknown);
      },
      {"OutputDirection"});
  expect([](vtkBigusVoxelizer* f) { f->SetOutputScalarType(VTK_SHORT); }, {"OutputScalarType"});
  expect([](vtkBigusVoxelizer* f) { f->SetEngine("none such"); }, {"none such"});

  vtkNew<vtkPolyData> points;
  points->DeepCopy(input);
  points->GetPointData()->RemoveArray("Scale");
  vtkNew<vtkBigusVoxelizer> voxelizer;
  voxelizer->SetInputData(points);
  ExpectOneError(voxelizer, {"Scale", "missing"});
}

TEST(Voxelizer, AnEmptyFieldIsOneDarkVoxel)
{
  vtkNew<vtkPolyData> nothing;
  vtkNew<vtkBigusVoxelizer> voxelizer;
  voxelizer->SetInputData(nothing);
  voxelizer->Update();
  EXPECT_EQ(voxelizer->GetOutput()->GetNumberOfPoints(), 1);
  EXPECT_EQ(LargestValue(voxelizer->GetOutput()), 0);
}

}  // namespace
}  // namespace bigus::test
