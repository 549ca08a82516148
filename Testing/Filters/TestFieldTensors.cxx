// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusFieldTensors: eigenvalues and eigenvectors are the Gaussians' scales and axes, and VTK's own glyph filter
// draws their ellipsoids.

#include "Filters/FilterTestSupport.h"
#include "vtkBigusFieldTensors.h"
#include "vtkSphereSource.h"
#include "vtkTensorGlyph.h"

namespace bigus::test
{
namespace
{

TEST(FieldTensors, TheirEigenvectorsAreTheGaussiansAxes)
{
  const GaussianField field = RandomField(50, 3);
  for (const bool covariance : {false, true})
  {
    vtkNew<vtkBigusFieldTensors> filter;
    filter->SetInputData(ToPolyData(field));
    filter->SetTensor(covariance ? vtkBigusFieldTensors::Covariance : vtkBigusFieldTensors::StandardDeviation);
    filter->Update();
    vtkDataArray* tensors = filter->GetOutput()->GetPointData()->GetTensors();
    ASSERT_TRUE(tensors);
    EXPECT_STREQ(tensors->GetName(), covariance ? "Covariance" : "StandardDeviation");
    ASSERT_EQ(tensors->GetNumberOfTuples(), 50);
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      double t[9];
      tensors->GetTuple(static_cast<vtkIdType>(i), t);
      const Eigen::Matrix3d tensor = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(t);
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(tensor);
      Eigen::Vector3d expected = field.scales[i];
      std::sort(expected.data(), expected.data() + 3);
      const Eigen::Vector3d values = solver.eigenvalues();
      const Eigen::Matrix3d axes = RotationMatrix(field.rotations[i]);
      for (int k = 0; k < 3; ++k)
      {
        EXPECT_NEAR(covariance ? std::sqrt(values[k]) : values[k], expected[k], 1e-9);
        // The Gaussian's k-th axis is an eigenvector with its own scale.
        const double s = field.scales[i][k];
        EXPECT_LT((tensor * axes.col(k) - (covariance ? s * s : s) * axes.col(k)).norm(), 1e-9);
      }
    }
  }
}

TEST(FieldTensors, TensorGlyphsAreTheOneSigmaSurface)
{
  const GaussianField field = RandomField(20, 4);
  vtkNew<vtkBigusFieldTensors> filter;
  filter->SetInputData(ToPolyData(field));
  vtkNew<vtkSphereSource> sphere;
  sphere->SetRadius(1);
  sphere->SetThetaResolution(8);
  sphere->SetPhiResolution(8);
  sphere->Update();
  vtkNew<vtkTensorGlyph> glyphs;
  glyphs->SetInputConnection(filter->GetOutputPort());
  glyphs->SetSourceConnection(sphere->GetOutputPort());
  glyphs->ThreeGlyphsOff();
  glyphs->ExtractEigenvaluesOn();
  glyphs->ColorGlyphsOff();
  glyphs->Update();
  const vtkIdType each = sphere->GetOutput()->GetNumberOfPoints();
  ASSERT_EQ(glyphs->GetOutput()->GetNumberOfPoints(), 20 * each);
  for (vtkIdType point = 0; point < 20 * each; ++point)
  {
    const std::size_t i = static_cast<std::size_t>(point / each);
    const Eigen::Vector3d x(glyphs->GetOutput()->GetPoint(point));
    const Eigen::Vector3d local = RotationMatrix(field.rotations[i]).transpose() * (x - field.means[i]);
    EXPECT_NEAR(local.cwiseQuotient(field.scales[i]).norm(), 1, 1e-4) << "Gaussian " << i;
  }
}

TEST(FieldTensors, EverythingElseOfTheFieldIsKept)
{
  const GaussianField field = RandomField(5, 5);
  vtkNew<vtkBigusFieldTensors> filter;
  filter->SetInputData(ToPolyData(field));
  filter->Update();
  const GaussianField again = FieldFromPolyData(filter->GetOutput());
  EXPECT_EQ(again.means, field.means);
  EXPECT_EQ(again.reflectivities, field.reflectivities);
  EXPECT_EQ(again.beam.elevationSigma, field.beam.elevationSigma);
}

TEST(FieldTensors, WhatIsNoFieldIsOneError)
{
  const auto input = ToPolyData(RandomField(5, 6));
  input->GetPointData()->RemoveArray("Rotation");
  vtkNew<vtkBigusFieldTensors> filter;
  filter->SetInputData(input);
  ExpectOneError(filter, {"Rotation"});
}

}  // namespace
}  // namespace bigus::test
