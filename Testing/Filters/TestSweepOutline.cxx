// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusSweepOutline: lines and pixels lie where the poses put them.

#include <algorithm>
#include <array>

#include "Filters/FilterTestSupport.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusSweepOutline.h"
#include "vtkCell.h"
#include "vtkCellData.h"
#include "vtkFieldData.h"
#include "vtkPointData.h"
#include "vtkStructuredGrid.h"
#include "vtkUnsignedCharArray.h"

namespace bigus::test
{
namespace
{

vtkSmartPointer<vtkImageData> SmallSweep()
{
  vtkNew<vtkBigusPhantomSource> source;
  source->SetFrameSize(24, 16);
  source->SetNumberOfFrames(9);
  source->Update();
  auto sweep = vtkSmartPointer<vtkImageData>::New();
  sweep->ShallowCopy(source->GetOutput());
  return sweep;
}

/// Pixel (i, j) of frame k, straight from the array of poses.
Eigen::Vector3d Pixel(vtkImageData* sweep, int k, double i, double j)
{
  double m[16];
  sweep->GetFieldData()->GetArray("ImageToReference")->GetTuple(k, m);
  return {m[0] * i + m[1] * j + m[3], m[4] * i + m[5] * j + m[7], m[8] * i + m[9] * j + m[11]};
}

TEST(SweepOutline, LinesPassThroughTheCornersOfUsableFrames)
{
  const auto sweep = SmallSweep();
  vtkNew<vtkUnsignedCharArray> status;
  status->SetName("Status");
  status->SetNumberOfValues(9);
  status->FillValue(1);
  status->SetValue(2, 0);  // rejected
  sweep->GetFieldData()->AddArray(status);

  vtkNew<vtkBigusSweepOutline> outline;
  outline->SetInputData(sweep);
  outline->Update();
  vtkPolyData* lines = outline->GetOutput();
  const std::vector<int> usable = {0, 1, 3, 4, 5, 6, 7, 8};
  ASSERT_EQ(lines->GetNumberOfLines(), 8);
  for (int n = 0; n < 8; ++n)
  {
    EXPECT_EQ(lines->GetCellData()->GetArray("Frame")->GetTuple1(n), usable[n]);
    vtkCell* line = lines->GetCell(n);
    ASSERT_EQ(line->GetNumberOfPoints(), 5);
    const double corners[5][2] = {{0, 0}, {23, 0}, {23, 15}, {0, 15}, {0, 0}};
    for (int c = 0; c < 5; ++c)
    {
      const Eigen::Vector3d x(lines->GetPoint(line->GetPointId(c)));
      EXPECT_LT((x - Pixel(sweep, usable[n], corners[c][0], corners[c][1])).norm(), 1e-9);
    }
  }
  vtkPolyData* path = outline->GetPathOutput();
  ASSERT_EQ(path->GetNumberOfLines(), 1);
  ASSERT_EQ(path->GetNumberOfPoints(), 8);
  for (int n = 0; n < 8; ++n)
  {
    EXPECT_LT((Eigen::Vector3d(path->GetPoint(n)) - Pixel(sweep, usable[n], 11.5, 0)).norm(), 1e-9);
  }
}

TEST(SweepOutline, AStrideKeepsTheFirstAndTheLastFrame)
{
  const auto sweep = SmallSweep();
  vtkNew<vtkBigusSweepOutline> outline;
  outline->SetInputData(sweep);
  outline->SetFrameStride(3);
  outline->Update();
  vtkDataArray* frames = outline->GetOutput()->GetCellData()->GetArray("Frame");
  ASSERT_EQ(frames->GetNumberOfTuples(), 4);
  const int expected[] = {0, 3, 6, 8};
  for (int n = 0; n < 4; ++n)
  {
    EXPECT_EQ(frames->GetTuple1(n), expected[n]);
  }
  EXPECT_EQ(outline->GetPathOutput()->GetNumberOfPoints(), 9);
}

TEST(SweepOutline, PixelsLieWhereThePosesPutThem)
{
  const auto sweep = SmallSweep();
  vtkNew<vtkBigusSweepOutline> outline;
  outline->SetInputData(sweep);
  outline->SetFrameStride(3);
  outline->Update();
  EXPECT_EQ(outline->GetPixelsOutput()->GetNumberOfPoints(), 0);
  outline->GeneratePixelsOn();
  outline->Update();
  vtkStructuredGrid* grid = outline->GetPixelsOutput();
  const std::array<int, 6> extent = {0, 23, 0, 15, 0, 3};
  EXPECT_TRUE(std::equal(extent.begin(), extent.end(), grid->GetExtent()));
  vtkDataArray* pixels = grid->GetPointData()->GetArray("Recorded");
  ASSERT_NE(pixels, nullptr);
  const int frames[] = {0, 3, 6, 8};
  for (vtkIdType point = 0; point < grid->GetNumberOfPoints(); ++point)
  {
    const int i = static_cast<int>(point % 24), j = static_cast<int>(point / 24 % 16), k = frames[point / (24 * 16)];
    EXPECT_LT((Eigen::Vector3d(grid->GetPoint(point)) - Pixel(sweep, k, i, j)).norm(), 1e-5);  // mm, of float
    EXPECT_EQ(pixels->GetTuple1(point), sweep->GetScalarComponentAsDouble(i, j, k, 0));
  }
}

TEST(SweepOutline, WithoutPosesThereIsOneError)
{
  const auto sweep = SmallSweep();
  sweep->GetFieldData()->RemoveArray("ImageToReference");
  vtkNew<vtkBigusSweepOutline> outline;
  outline->SetInputData(sweep);
  ExpectOneError(outline, {"ImageToReference"});
}

}  // namespace
}  // namespace bigus::test
