// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusFieldVolume: opacity follows the quantiles of the voxels, and the cloud lies where the field lies.

#include <algorithm>

#include "Rendering/RenderingTestSupport.h"
#include "vtkBigusFieldVolume.h"
#include "vtkBigusVoxelizer.h"
#include "vtkCamera.h"
#include "vtkColorTransferFunction.h"
#include "vtkPiecewiseFunction.h"

namespace bigus::test
{
namespace
{

TEST(FieldVolume, OpacityFollowsTheQuantilesOfVoxelsAboveZero)
{
  vtkNew<vtkImageData> volume;
  volume->SetDimensions(100, 20, 1);
  volume->SetSpacing(0.5, 0.5, 0.5);
  volume->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  for (int k = 0; k < 2000; ++k)  // half are 0, the others 1 to 200, five of each
  {
    static_cast<unsigned char*>(volume->GetScalarPointer())[k] = k < 1000 ? 0 : 1 + (k - 1000) / 5;
  }
  vtkNew<vtkPiecewiseFunction> opacity;
  vtkNew<vtkColorTransferFunction> color;
  const double length = vtkBigusFieldVolume::FillTransfer(volume, opacity, color);
  EXPECT_DOUBLE_EQ(length, 0.01 * std::hypot(49.5, 9.5));
  EXPECT_EQ(opacity->GetValue(50), 0);
  EXPECT_EQ(opacity->GetValue(100), 0);
  EXPECT_NEAR(opacity->GetValue(180), 0.08, 1e-6);
  EXPECT_NEAR(opacity->GetValue(199), 0.5, 1e-6);
  EXPECT_NEAR(opacity->GetValue(200), 0.8, 1e-6);
}

TEST(FieldVolume, ABlackVolumeIsTransparent)
{
  vtkNew<vtkImageData> volume;
  volume->SetDimensions(4, 4, 4);
  volume->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  volume->GetPointData()->GetScalars()->Fill(0);
  vtkNew<vtkPiecewiseFunction> opacity;
  vtkNew<vtkColorTransferFunction> color;
  vtkBigusFieldVolume::FillTransfer(volume, opacity, color);
  for (int level = 0; level < 256; ++level)
  {
    EXPECT_EQ(opacity->GetValue(level), 0);
  }
}

TEST(FieldVolume, TheCloudLiesWhereTheFieldLies)
{
  BIGUS_NEEDS_DISPLAY();
  GaussianField field;
  field.Resize(1);
  field.means[0] = {3, 2, 0};
  field.scales[0] = {1, 1, 1};
  field.rotations[0] = {1, 0, 0, 0};
  field.reflectivities[0] = 1;
  Scene scene(200, 200);
  vtkNew<vtkBigusFieldVolume> volume;
  volume->SetInputData(ToPolyData(field));
  volume->GetVoxelizer()->SetMaximumDimension(48);
  scene.renderer->AddVolume(volume);
  vtkCamera* camera = scene.renderer->GetActiveCamera();
  camera->ParallelProjectionOn();
  camera->SetParallelScale(10);  // 0.1 mm a pixel
  camera->SetPosition(0, 0, 50);
  camera->SetFocalPoint(0, 0, 0);
  scene.renderer->ResetCameraClippingRange();
  const auto pixels = scene.Pixels();
  double sum = 0, x = 0, y = 0;
  for (int row = 0; row < 200; ++row)
  {
    for (int column = 0; column < 200; ++column)
    {
      const double grey = pixels->GetComponent(row * 200 + column, 0);
      sum += grey;
      x += grey * ((column + 0.5) * 0.1 - 10);
      y += grey * ((row + 0.5) * 0.1 - 10);
    }
  }
  EXPECT_GT(sum, 1e4);
  EXPECT_NEAR(x / sum, 3, 0.1);
  EXPECT_NEAR(y / sum, 2, 0.1);
}

TEST(FieldVolume, OneLargeGaussianBesideTheTissueTakesNoVoxelsFromIt)
{
  GaussianField field = RandomField(201, 4);
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    field.scales[i].setConstant(0.5);
  }
  field.scales[0].setConstant(40);
  double low[3], high[3];
  for (int axis = 0; axis < 3; ++axis)
  {
    const auto less = [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; };
    low[axis] = (*std::min_element(field.means.begin(), field.means.end(), less))[axis] - 1.5;
    high[axis] = (*std::max_element(field.means.begin(), field.means.end(), less))[axis] + 1.5;
  }
  vtkNew<vtkBigusFieldVolume> volume;
  volume->SetInputData(ToPolyData(field));
  volume->GetVoxelizer()->SetMaximumDimension(50);
  const double* bounds = volume->GetBounds();
  const double* spacing = volume->GetVoxelizer()->GetOutput()->GetSpacing();
  for (int axis = 0; axis < 3; ++axis)
  {
    EXPECT_NEAR(bounds[2 * axis], low[axis], 1e-9);
    EXPECT_NEAR(bounds[2 * axis + 1], high[axis], 0.5 * spacing[axis] + 1e-9);
  }
  volume->CropToCentersOff();
  volume->GetVoxelizer()->SetOutputOriginToDefault();
  volume->GetVoxelizer()->SetOutputSpacingToDefault();
  volume->GetVoxelizer()->SetOutputDimensionsToDefault();
  bounds = volume->GetBounds();
  EXPECT_GT(bounds[1] - bounds[0], 200);  // the large one whole
}

TEST(FieldVolume, WithoutAFieldNothingIsDrawn)
{
  BIGUS_NEEDS_DISPLAY();
  Scene scene(50, 50);
  vtkNew<vtkBigusFieldVolume> volume;
  scene.renderer->AddVolume(volume);
  EXPECT_EQ(scene.Pixels()->GetRange(0)[1], 0);
}

}  // namespace
}  // namespace bigus::test
