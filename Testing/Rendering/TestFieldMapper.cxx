// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusFieldMapper: silhouettes are the ellipses that the Gaussians' covariances project to, colours tell the sign,
// and fewer ellipsoids are drawn only while the window is in a hurry.

#include <cmath>

#include "Rendering/RenderingTestSupport.h"
#include "vtkActor.h"
#include "vtkBigusFieldMapper.h"
#include "vtkCamera.h"
#include "vtkProperty.h"

namespace bigus::test
{
namespace
{

constexpr int kSize = 200;         // pixels
constexpr double kHalfHeight = 5;  // mm

/// A scene that looks along -z, 0.05 mm a pixel, at a field drawn without shading.
struct FieldScene : Scene
{
  explicit FieldScene(const GaussianField& field) : Scene(kSize, kSize)
  {
    this->mapper->SetInputData(ToPolyData(field));
    this->actor->SetMapper(this->mapper);
    this->actor->GetProperty()->LightingOff();
    this->renderer->AddActor(this->actor);
    vtkCamera* camera = this->renderer->GetActiveCamera();
    camera->ParallelProjectionOn();
    camera->SetParallelScale(kHalfHeight);
    camera->SetPosition(0, 0, 50);
    camera->SetFocalPoint(0, 0, 0);
    this->renderer->ResetCameraClippingRange();
  }
  vtkNew<vtkBigusFieldMapper> mapper;
  vtkNew<vtkActor> actor;
};

GaussianField OneGaussian(double reflectivity)
{
  GaussianField field;
  field.Resize(1);
  field.means[0] = {0.7, -0.4, 1};
  field.scales[0] = {2.4, 0.8, 1.3};
  field.rotations[0] = Eigen::Vector4d(0.8, 0.3, -0.4, 0.5);  // not of length 1
  field.reflectivities[0] = reflectivity;
  return field;
}

TEST(FieldMapper, ASilhouetteIsTheProjectedCovariance)
{
  BIGUS_NEEDS_DISPLAY();
  for (const double sigmas : {1.0, 1.5})
  {
    const GaussianField field = OneGaussian(1);
    FieldScene scene(field);
    scene.mapper->SetScaleFactor(sigmas);
    const auto pixels = scene.Pixels();
    const Eigen::Matrix3d axes = RotationMatrix(field.rotations[0]) * field.scales[0].asDiagonal();
    const Eigen::Matrix2d projected = (axes * axes.transpose()).topLeftCorner<2, 2>();
    int inside = 0, wrong = 0;
    for (int row = 0; row < kSize; ++row)
    {
      for (int column = 0; column < kSize; ++column)
      {
        const double pixel = 2 * kHalfHeight / kSize;
        const Eigen::Vector2d x((column + 0.5) * pixel - kHalfHeight, (row + 0.5) * pixel - kHalfHeight);
        const Eigen::Vector2d d = x - field.means[0].head<2>();
        const double distance = std::sqrt(d.dot(projected.inverse() * d)) / sigmas;
        const bool drawn = pixels->GetComponent(row * kSize + column, 0) > 0;
        inside += distance < 1;
        wrong += drawn ? distance > 1.02 : distance < 0.95;  // the polyhedron lies up to 2.5 % inside its sphere
      }
    }
    EXPECT_GT(inside, 1000);
    EXPECT_EQ(wrong, 0) << "at " << sigmas << " standard deviations";
  }
}

TEST(FieldMapper, SignsHaveTheirColourAndFaintGaussiansAreTransparent)
{
  BIGUS_NEEDS_DISPLAY();
  const auto middle = [](double reflectivity)
  {
    FieldScene scene(OneGaussian(reflectivity));
    scene.mapper->SetReflectivityRange(1);
    const auto pixels = scene.Pixels();
    const int column = static_cast<int>((0.7 + kHalfHeight) / (2 * kHalfHeight) * kSize);
    const int row = static_cast<int>((-0.4 + kHalfHeight) / (2 * kHalfHeight) * kSize);
    double rgb[3];
    pixels->GetTuple(row * kSize + column, rgb);
    return Eigen::Vector3d(rgb);
  };
  const Eigen::Vector3d positive = middle(1), negative = middle(-1), faint = middle(0.1), zero = middle(0);
  EXPECT_GT(positive[0], positive[2] + 100);  // orange
  EXPECT_GT(negative[2], negative[0] + 100);  // blue
  EXPECT_GT(faint.maxCoeff(), 3);
  EXPECT_LT(faint.maxCoeff(), 0.35 * positive.maxCoeff());
  EXPECT_EQ(zero.maxCoeff(), 0);
}

TEST(FieldMapper, TheRangeIsAQuantileOfTheField)
{
  GaussianField field = RandomField(101, 1);
  for (int i = 0; i < 101; ++i)
  {
    field.reflectivities[i] = (i % 2 ? 1 : -1) * i;
  }
  vtkNew<vtkBigusFieldMapper> mapper;
  mapper->SetInputData(ToPolyData(field));
  EXPECT_EQ(mapper->GetReflectivityRangeInUse(), 95);
  mapper->SetReflectivityRange(7);
  EXPECT_EQ(mapper->GetReflectivityRangeInUse(), 7);
}

TEST(FieldMapper, BoundsHoldEveryEllipsoid)
{
  const GaussianField field = OneGaussian(1);
  vtkNew<vtkBigusFieldMapper> mapper;
  mapper->SetInputData(ToPolyData(field));
  mapper->SetScaleFactor(2);
  const double* bounds = mapper->GetBounds();
  const Eigen::Matrix3d axes = RotationMatrix(field.rotations[0]) * field.scales[0].asDiagonal();
  const Eigen::Matrix3d covariance = axes * axes.transpose();
  for (int axis = 0; axis < 3; ++axis)
  {
    EXPECT_NEAR(bounds[2 * axis], field.means[0][axis] - 2 * std::sqrt(covariance(axis, axis)), 1e-5);
    EXPECT_NEAR(bounds[2 * axis + 1], field.means[0][axis] + 2 * std::sqrt(covariance(axis, axis)), 1e-5);
  }
}

TEST(FieldMapper, AHurriedWindowGetsTheStrongestAndAStillOneAll)
{
  BIGUS_NEEDS_DISPLAY();
  const GaussianField field = RandomField(5000, 2);
  FieldScene scene(field);
  scene.window->SetDesiredUpdateRate(0.001);
  const auto still = scene.Pixels();
  EXPECT_EQ(scene.mapper->GetNumberOfEllipsoidsDrawn(), 5000);
  EXPECT_EQ(scene.mapper->GetNumberOfPointsDrawn(), 0);
  scene.window->SetDesiredUpdateRate(1e4);  // a tenth of a millisecond
  scene.Pixels();
  EXPECT_LT(scene.mapper->GetNumberOfEllipsoidsDrawn(), 2500);
  EXPECT_GT(scene.mapper->GetNumberOfEllipsoidsDrawn(), 100);
  EXPECT_GT(scene.mapper->GetNumberOfPointsDrawn(), 100);
  EXPECT_LT(scene.mapper->GetNumberOfPointsDrawn(), 2500);
  scene.mapper->LevelOfDetailOff();
  scene.Pixels();
  EXPECT_EQ(scene.mapper->GetNumberOfEllipsoidsDrawn(), 5000);
  scene.mapper->LevelOfDetailOn();
  scene.window->SetDesiredUpdateRate(0.001);
  const auto again = scene.Pixels();
  for (vtkIdType value = 0; value < still->GetNumberOfValues(); ++value)
  {
    ASSERT_EQ(again->GetValue(value), still->GetValue(value));
  }
}

TEST(FieldMapper, TheMostEllipsoidsAreTheStrongest)
{
  BIGUS_NEEDS_DISPLAY();
  GaussianField both = OneGaussian(1);
  both.Resize(2);
  both.means[1] = {-3, 3, 0};
  both.scales[1] = {0.5, 0.5, 0.5};
  both.rotations[1] = {1, 0, 0, 0};
  both.reflectivities[1] = 0.9;  // weaker, and smaller
  FieldScene scene(both);
  scene.mapper->SetMaximumNumberOfEllipsoids(1);
  scene.Pixels();
  EXPECT_EQ(scene.mapper->GetNumberOfEllipsoidsDrawn(), 1);
  const auto at = [](vtkUnsignedCharArray* pixels, double x, double y)
  {
    const int column = static_cast<int>((x + kHalfHeight) / (2 * kHalfHeight) * kSize);
    const int row = static_cast<int>((y + kHalfHeight) / (2 * kHalfHeight) * kSize);
    return pixels->GetComponent(row * kSize + column, 0);
  };
  const auto one = scene.Pixels();
  EXPECT_GT(at(one, 0.7, -0.4), 100);
  EXPECT_EQ(at(one, -3, 3), 0);
  scene.mapper->SetMaximumNumberOfEllipsoids(2);
  EXPECT_GT(at(scene.Pixels(), -3, 3), 100);
}

TEST(FieldMapper, FarAwayGaussiansArePoints)
{
  BIGUS_NEEDS_DISPLAY();
  FieldScene scene(RandomField(300, 3));
  scene.renderer->GetActiveCamera()->SetParallelScale(1000);
  scene.Pixels();
  EXPECT_EQ(scene.mapper->GetNumberOfEllipsoidsDrawn(), 0);
  EXPECT_EQ(scene.mapper->GetNumberOfPointsDrawn(), 300);
  scene.mapper->LevelOfDetailOff();
  scene.window->SetDesiredUpdateRate(1e6);
  scene.Pixels();
  EXPECT_EQ(scene.mapper->GetNumberOfPointsDrawn(), 300);
  scene.mapper->SetPointsBelow(0);
  scene.Pixels();
  EXPECT_EQ(scene.mapper->GetNumberOfEllipsoidsDrawn(), 300);
}

TEST(FieldMapper, AnEmptyFieldDrawsNothingAndABrokenOneIsOneError)
{
  BIGUS_NEEDS_DISPLAY();
  FieldScene empty{GaussianField()};
  EXPECT_EQ(empty.Pixels()->GetRange(0)[1], 0);

  const auto broken = ToPolyData(OneGaussian(1));
  broken->GetPointData()->RemoveArray("Scale");
  FieldScene scene(OneGaussian(1));
  scene.mapper->SetInputData(broken);
  const ErrorObserver observer(scene.mapper);
  EXPECT_EQ(scene.Pixels()->GetRange(0)[1], 0);
  ASSERT_EQ(observer.Errors().size(), 1u);
  EXPECT_NE(observer.Errors()[0].find("Scale"), std::string::npos);
}

}  // namespace
}  // namespace bigus::test
