// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusSliceProp: what a window shows is what vtkBigusReslice gives, at the plane's place.
#include "RenderingTestSupport.h"
#include "vtkBigusReslice.h"
#include "vtkBigusSliceProp.h"
#include "vtkCallbackCommand.h"
#include "vtkCamera.h"
#include "vtkImageProperty.h"
#include "vtkProperty.h"

namespace bigus::test
{
namespace
{

constexpr int kWidth = 96, kHeight = 72;
constexpr double kStep = 0.2;  // mm between pixels

vtkSmartPointer<vtkMatrix4x4> ObliquePlane()
{
  return ToVtk(RigidMatrix(RandomRotation(7), {-4, -3, 1}));
}

/// A reslice made by hand, exact.
vtkSmartPointer<vtkBigusReslice> ResliceByHand(vtkPolyData* field, vtkMatrix4x4* plane)
{
  auto reslice = vtkSmartPointer<vtkBigusReslice>::New();
  reslice->SetInputData(field);
  reslice->SetResliceAxes(plane);
  reslice->SetOutputDimensionality(2);
  reslice->SetOutputSpacing(kStep, kStep, 1);
  reslice->SetOutputOrigin(0, 0, 0);
  reslice->SetOutputExtent(0, kWidth - 1, 0, kHeight - 1, 0, 0);
  reslice->Update();
  return reslice;
}

struct SliceScene : Scene
{
  SliceScene() : Scene(kWidth, kHeight)
  {
    this->prop->SetInputData(this->field);
    this->prop->SetPlane(this->plane);
    this->prop->SetSliceSize(kWidth, kHeight);
    this->prop->SetSliceSpacing(kStep, kStep);
    this->prop->GetProperty()->SetInterpolationTypeToNearest();
    this->prop->OutlineVisibilityOff();
    this->prop->CoverageVisibilityOff();
    this->renderer->AddViewProp(this->prop);
    this->LookAtPlane();
  }

  /// One pixel of the window for one of the slice, from wherever the plane lies.
  void LookAtPlane()
  {
    const double middle[4] = {0.5 * (kWidth - 1) * kStep, 0.5 * (kHeight - 1) * kStep, 0, 1};
    const double above[4] = {middle[0], middle[1], 50, 1};
    double focus[4], position[4];
    this->plane->MultiplyPoint(middle, focus);
    this->plane->MultiplyPoint(above, position);
    vtkCamera* camera = this->renderer->GetActiveCamera();
    camera->ParallelProjectionOn();
    camera->SetParallelScale(0.5 * kHeight * kStep);
    camera->SetFocalPoint(focus);
    camera->SetPosition(position);
    camera->SetViewUp(this->plane->GetElement(0, 1), this->plane->GetElement(1, 1), this->plane->GetElement(2, 1));
    this->renderer->ResetCameraClippingRange();
  }

  vtkSmartPointer<vtkPolyData> field = ToPolyData(RandomField(60, 3));
  vtkSmartPointer<vtkMatrix4x4> plane = ObliquePlane();
  vtkNew<vtkBigusSliceProp> prop;
};

/// The most by which the window differs from the image, in grey levels.
double LargestDifference(vtkUnsignedCharArray* pixels, vtkImageData* image)
{
  double largest = 0;
  for (int j = 0; j < kHeight; ++j)
  {
    for (int i = 0; i < kWidth; ++i)
    {
      const double expected = 255 * FloatAt(image, i, j, 0);
      for (int colour = 0; colour < 3; ++colour)
      {
        largest = std::max(largest, std::abs(pixels->GetComponent(j * kWidth + i, colour) - expected));
      }
    }
  }
  return largest;
}

TEST(SliceProp, WindowShowsTheSlicePixelForPixel)
{
  BIGUS_NEEDS_DISPLAY();
  SliceScene scene;
  const auto pixels = scene.Pixels();
  const auto byHand = ResliceByHand(scene.field, scene.plane);
  EXPECT_TRUE(SameBits(scene.prop->GetReslice()->GetOutput(), byHand->GetOutput()));
  EXPECT_GT(LargestValue(byHand->GetOutput()), 0.3);
  EXPECT_LE(LargestDifference(pixels, byHand->GetOutput()), 1);  // VTK's window and level round down
}

TEST(SliceProp, MovingTheMatrixMovesPlaneAndPicture)
{
  BIGUS_NEEDS_DISPLAY();
  SliceScene scene;
  scene.Pixels();
  for (int row = 0; row < 3; ++row)
  {
    scene.plane->SetElement(row, 3, scene.plane->GetElement(row, 3) + 1.5 * scene.plane->GetElement(row, 2));
  }
  scene.LookAtPlane();
  const auto pixels = scene.Pixels();
  const auto byHand = ResliceByHand(scene.field, scene.plane);
  EXPECT_TRUE(SameBits(scene.prop->GetReslice()->GetOutput(), byHand->GetOutput()));
  EXPECT_LE(LargestDifference(pixels, byHand->GetOutput()), 1);
}

TEST(SliceProp, OverlayGreysWhatHasNoCoverageAndNothingElse)
{
  BIGUS_NEEDS_DISPLAY();
  SliceScene scene;
  scene.prop->CoverageVisibilityOn();
  scene.prop->SetCoverageColor(1, 0, 0);
  scene.plane->SetElement(0, 3, scene.plane->GetElement(0, 3) + 10);  // partly beside the field
  scene.LookAtPlane();
  const auto pixels = scene.Pixels();
  vtkImageData* image = scene.prop->GetReslice()->GetOutput();
  vtkImageData* coverage = scene.prop->GetReslice()->GetCoverageOutput();
  double box[6];
  ASSERT_TRUE(scene.prop->GetFieldBox(box));
  int greyed = 0, clear = 0;
  for (int j = 1; j < kHeight - 1; ++j)
  {
    for (int i = 1; i < kWidth - 1; ++i)
    {
      const double red = pixels->GetComponent(j * kWidth + i, 0), green = pixels->GetComponent(j * kWidth + i, 1);
      const float covered = FloatAt(coverage, i, j, 0);
      if (covered == 0)
      {
        EXPECT_GT(red, 255 * 0.55) << i << " " << j;
        ++greyed;
      }
      else if (red == green)
      {
        EXPECT_LE(std::abs(red - 255 * FloatAt(image, i, j, 0)), 1) << i << " " << j;
        ++clear;
      }
    }
  }
  EXPECT_GT(greyed, 200);
  EXPECT_GT(clear, 200);
}

TEST(SliceProp, WhereTwoSlicesCrossTheNearerOneIsSeen)
{
  BIGUS_NEEDS_DISPLAY();
  SliceScene scene;
  scene.prop->CoverageVisibilityOn();
  vtkNew<vtkBigusSliceProp> crossing;
  crossing->SetInputData(scene.field);
  crossing->PlaceInField(0, 80);
  crossing->OutlineVisibilityOff();
  scene.renderer->AddViewProp(crossing);
  scene.renderer->GetActiveCamera()->Azimuth(35);
  scene.renderer->ResetCameraClippingRange();
  const auto both = scene.Pixels();
  crossing->VisibilityOff();
  const auto first = scene.Pixels();
  crossing->VisibilityOn();
  scene.prop->VisibilityOff();
  const auto second = scene.Pixels();

  // Depth along the camera's direction of projection at which the line of sight through a pixel meets a slice.
  vtkCamera* camera = scene.renderer->GetActiveCamera();
  const auto depthAt = [&](vtkBigusSliceProp* prop, int i, int j)
  {
    Eigen::Vector4d near, far;
    for (auto& [place, z] : {std::pair{&near, 0.0}, std::pair{&far, 1.0}})
    {
      scene.renderer->SetDisplayPoint(i + 0.5, j + 0.5, z);
      scene.renderer->DisplayToWorld();
      scene.renderer->GetWorldPoint(place->data());
      *place /= (*place)[3];
    }
    const Eigen::Matrix4d plane =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(prop->GetPlane()->GetData());
    const Eigen::Vector3d normal = plane.col(0).head<3>().cross(plane.col(1).head<3>());
    const Eigen::Vector3d line = (far - near).head<3>();
    const double t = normal.dot((plane.col(3) - near).head<3>()) / normal.dot(line);
    const Eigen::Vector3d at = near.head<3>() + t * line - plane.col(3).head<3>();
    for (int axis = 0; axis < 2; ++axis)
    {
      const double place =
          (at.dot(plane.col(axis).head<3>()) - prop->GetSliceOrigin()[axis]) / prop->GetSliceSpacing()[axis];
      if (place < -0.5 || place > prop->GetSliceSize()[axis] - 0.5)
      {
        return std::numeric_limits<double>::infinity();
      }
    }
    return t * (camera->GetClippingRange()[1] - camera->GetClippingRange()[0]);  // mm
  };
  int nearer[2] = {0, 0};
  for (int j = 0; j < kHeight; ++j)
  {
    for (int i = 0; i < kWidth; ++i)
    {
      const double depths[2] = {depthAt(scene.prop, i, j), depthAt(crossing, i, j)};
      if (std::abs(depths[0] - depths[1]) < 0.5 || (std::isinf(depths[0]) && std::isinf(depths[1])))
      {
        continue;  // too near the line where they cross, or neither is here
      }
      const bool isFirst = depths[0] < depths[1];
      const auto& alone = isFirst ? first : second;
      ++nearer[isFirst ? 0 : 1];
      for (int colour = 0; colour < 3; ++colour)
      {
        ASSERT_EQ(both->GetComponent(j * kWidth + i, colour), alone->GetComponent(j * kWidth + i, colour))
            << i << " " << j;
      }
    }
  }
  EXPECT_GT(nearer[0], 500);
  EXPECT_GT(nearer[1], 200);
}

TEST(SliceProp, BeamIsASlabOfTheProfilesWidthAtHalfMaximum)
{
  SliceScene scene;
  scene.plane->Identity();
  double* bounds = scene.prop->GetBounds();
  EXPECT_NEAR(bounds[0], -0.5 * kStep, 1e-9);
  EXPECT_NEAR(bounds[1], (kWidth - 0.5) * kStep, 1e-9);
  EXPECT_EQ(bounds[4], bounds[5]);
  scene.prop->BeamVisibilityOn();
  EXPECT_DOUBLE_EQ(scene.prop->GetBeamSigma(), 0.6);  // RandomField's
  bounds = scene.prop->GetBounds();
  EXPECT_NEAR(bounds[5] - bounds[4], 2.3548 * 0.6, 1e-4);
  scene.prop->GetReslice()->SetElevationSigma(2);
  bounds = scene.prop->GetBounds();
  EXPECT_NEAR(bounds[5] - bounds[4], 2.3548 * 2, 1e-4);
}

TEST(SliceProp, TheSlabIsOneTintOverTheSliceHoweverTheRendererBlends)
{
  BIGUS_NEEDS_DISPLAY();
  for (const bool peeling : {false, true})
  {
    SliceScene scene;
    scene.renderer->SetUseDepthPeeling(peeling);
    scene.prop->GetProperty()->SetColorLevel(1e6);  // black
    scene.prop->BeamVisibilityOn();
    scene.prop->GetReslice()->SetElevationSigma(2);
    scene.prop->GetBeamProperty()->SetColor(1, 0.6, 0.2);
    scene.prop->GetBeamProperty()->SetOpacity(0.5);
    const double colour[3] = {1, 0.6, 0.2};
    for (int again = 0; again < 2; ++again)
    {
      const auto pixels = scene.Pixels();
      for (int j = 2; j < kHeight - 2; ++j)
      {
        for (int i = 2; i < kWidth - 2; ++i)
        {
          for (int k = 0; k < 3; ++k)
          {
            ASSERT_NEAR(pixels->GetComponent(j * kWidth + i, k), 0.5 * 255 * colour[k], 2) << peeling << i << " " << j;
          }
        }
      }
    }
    scene.prop->GetReslice()->SetElevationSigma(0);  // a plane has no slab, and nothing flickers in its place
    EXPECT_EQ(scene.Pixels()->GetComponent(kHeight / 2 * kWidth + kWidth / 2, 0), 0) << peeling;
  }
}

TEST(SliceProp, ABudgetMakesItCoarseAndWithoutItIsExactAgain)
{
  SliceScene scene;
  scene.prop->UpdateSlice();
  scene.prop->SetTimeBudget(1e-9);
  for (int k = 0; k < 3; ++k)
  {
    scene.plane->SetElement(0, 3, scene.plane->GetElement(0, 3) + 0.1);
    scene.prop->UpdateSlice();
  }
  EXPECT_EQ(scene.prop->GetReduction(), 8);
  EXPECT_EQ(scene.prop->GetReslice()->GetOutput()->GetDimensions()[0], kWidth / 8);
  EXPECT_NEAR(scene.prop->GetReslice()->GetTolerance(), 1.0 / 255, 1e-12);
  scene.prop->SetTimeBudget(0);
  scene.prop->UpdateSlice();
  EXPECT_EQ(scene.prop->GetReduction(), 1);
  EXPECT_TRUE(SameBits(scene.prop->GetReslice()->GetOutput(), ResliceByHand(scene.field, scene.plane)->GetOutput()));
}

TEST(SliceProp, PlaceInFieldCoversTheCentresOfAllGaussians)
{
  vtkNew<vtkBigusSliceProp> prop;
  const GaussianField field = RandomField(60, 3);
  prop->SetInputData(ToPolyData(field));
  for (int axis = 0; axis < 3; ++axis)
  {
    prop->PlaceInField(axis, 128);
    EXPECT_EQ(std::max(prop->GetSliceSize()[0], prop->GetSliceSize()[1]), 128);
    double bounds[6];
    std::copy_n(prop->GetBounds(), 6, bounds);
    EXPECT_EQ(bounds[2 * axis], bounds[2 * axis + 1]);
    for (const Eigen::Vector3d& mean : field.means)
    {
      for (int other = 0; other < 3; ++other)
      {
        EXPECT_TRUE(other == axis || (mean[other] >= bounds[2 * other] && mean[other] <= bounds[2 * other + 1]));
      }
    }
  }
}

TEST(SliceProp, WrongGeometryIsAnErrorAndChangesNothing)
{
  vtkNew<vtkBigusSliceProp> prop;
  int errors = 0;
  vtkNew<vtkCallbackCommand> count;
  count->SetClientData(&errors);
  count->SetCallback([](vtkObject*, unsigned long, void* errors, void*) { ++*static_cast<int*>(errors); });
  prop->AddObserver(vtkCommand::ErrorEvent, count);
  prop->SetSliceSize(0, 5);
  prop->SetSliceSpacing(0, 1);
  EXPECT_EQ(errors, 2);
  EXPECT_EQ(prop->GetSliceSize()[0], 512);
  EXPECT_EQ(prop->GetSliceSpacing()[0], 1);
}

}  // namespace
}  // namespace bigus::test
