// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusTransformField: the slice that moves with the field shows the same as before.

#include "Filters/FilterTestSupport.h"
#include "vtkBigusReslice.h"
#include "vtkBigusTransformField.h"
#include "vtkPoints.h"
#include "vtkThinPlateSplineTransform.h"
#include "vtkTransform.h"

namespace bigus::test
{
namespace
{

/// Picture and coverage of an oblique plane that moves with `transform`.
vtkSmartPointer<vtkBigusReslice> Slice(vtkPolyData* field, vtkTransform* transform, double sigma)
{
  auto reslice = vtkSmartPointer<vtkBigusReslice>::New();
  reslice->SetInputData(field);
  Random random(4);
  reslice->SetResliceAxes(ToVtk(RigidMatrix(RandomRotation(random), {1, -2, 0.5})));
  reslice->SetResliceTransform(transform);
  reslice->SetOutputSpacing(0.4, 0.5, 1.5);
  reslice->SetOutputOrigin(-8, -7, -2);
  reslice->SetOutputExtent(0, 39, 0, 29, 0, 3);
  reslice->SetElevationSigma(sigma);
  reslice->SetTolerance(0);
  reslice->SetEngine("reference");
  reslice->Update();
  return reslice;
}

double LargestChange(vtkImageData* a, vtkImageData* b)
{
  double worst = 0;
  for (vtkIdType pixel = 0; pixel < a->GetNumberOfPoints(); ++pixel)
  {
    worst = std::max(worst, std::abs(a->GetPointData()->GetScalars()->GetTuple1(pixel) -
                                     b->GetPointData()->GetScalars()->GetTuple1(pixel)));
  }
  return worst;
}

vtkSmartPointer<vtkPolyData> FieldWithBeam()
{
  GaussianField field = RandomField(120, 7);
  field.beam.probeElevationSigma = 1.1;  // so that planes that are turned look different
  field.beam.trainedNormals = {Eigen::Vector3d(1, 2, 2) / 3};
  auto input = ToPolyData(field);
  SetProvenance(input, "seed", "7");
  return input;
}

TEST(TransformField, ASliceThatMovesAlongShowsTheSame)
{
  const auto input = FieldWithBeam();
  for (int trial = 0; trial < 8; ++trial)
  {
    Random random(50 + trial);
    const double scale = trial % 2 ? random.Uniform(0.3, 3) : 1;
    const double mirror = trial & 4 ? -1 : 1;
    vtkNew<vtkTransform> transform;
    transform->Translate(random.Vector(-30, 30).data());
    transform->RotateWXYZ(random.Uniform(-180, 180), random.Vector(-1, 1).data());
    transform->Scale(mirror * scale, scale, scale);
    vtkNew<vtkBigusTransformField> filter;
    filter->SetInputData(input);
    filter->SetTransform(transform);
    filter->Update();
    const auto before = Slice(input, nullptr, -1), after = Slice(filter->GetOutput(), transform, -1);
    EXPECT_GT(LargestValue(before->GetOutput()), 0.2);
    EXPECT_LT(LargestChange(before->GetOutput(), after->GetOutput()), 1e-6) << "trial " << trial;
    EXPECT_LT(LargestChange(before->GetCoverageOutput(), after->GetCoverageOutput()), 1e-5) << "trial " << trial;
    EXPECT_EQ(GetProvenance(filter->GetOutput(), "seed"), "7");
    EXPECT_FALSE(GetProvenance(filter->GetOutput(), "transform").empty());
  }
}

TEST(TransformField, DirectionsTurnWithTheField)
{
  const auto input = FieldWithBeam();
  Random random(4);
  Eigen::Matrix4d plane = RigidMatrix(RandomRotation(random), {1, -2, 0.5});  // Slice's
  ViewDependence view;
  view.views.unit = 0.2;
  view.views.angleStep = 1;
  view.views.elevationStep = 2;
  view.views.mean = plane.topLeftCorner<3, 3>() * RotationMatrix({1, 0.1, -0.05, 0.02});
  view.views.poses = {plane, plane};
  view.views.poses[1].topLeftCorner<3, 3>() = view.views.mean;
  for (vtkIdType i = 0; i < input->GetNumberOfPoints(); ++i)
  {
    view.terms.push_back(random.Vector(-0.3, 0.3));
  }
  const auto plain = vtkSmartPointer<vtkPolyData>::New();
  plain->DeepCopy(input);
  ViewToPolyData(view, input);
  for (const double mirror : {1.0, -1.0})
  {
    vtkNew<vtkTransform> transform;
    transform->Translate(3, -20, 7);
    transform->RotateWXYZ(70, 1, -2, 0.4);
    transform->Scale(2 * mirror, 2, 2);
    vtkNew<vtkBigusTransformField> filter;
    filter->SetInputData(input);
    filter->SetTransform(transform);
    filter->Update();
    const auto before = Slice(input, nullptr, -1), after = Slice(filter->GetOutput(), transform, -1);
    EXPECT_EQ(before->GetViewNearness(), 1);
    EXPECT_LT(LargestDifference(before->GetOutput(), after->GetOutput()), 1e-6);
    EXPECT_GT(LargestDifference(before->GetOutput(), Slice(plain, nullptr, -1)->GetOutput()), 0.02);
    EXPECT_LT(Slice(plain, nullptr, -1)->GetViewNearness(), 0);
  }
}

TEST(TransformField, MovingPointsAloneDoesNot)
{
  const auto input = FieldWithBeam();
  vtkNew<vtkTransform> transform;
  transform->RotateZ(90);
  // What vtkTransformPolyDataFilter does.
  auto moved = vtkSmartPointer<vtkPolyData>::New();
  moved->DeepCopy(input);
  vtkNew<vtkPoints> points;
  transform->TransformPoints(input->GetPoints(), points);
  moved->SetPoints(points);
  EXPECT_GT(LargestChange(Slice(input, nullptr, 0)->GetOutput(), Slice(moved, transform, 0)->GetOutput()), 0.1);
}

TEST(TransformField, ThereAndBackIsWhereItWas)
{
  const auto input = FieldWithBeam();
  vtkNew<vtkTransform> transform;
  transform->RotateWXYZ(40, 1, 2, 3);
  transform->Translate(3, 2, 1);
  transform->Scale(2, 2, 2);
  vtkNew<vtkBigusTransformField> there, back;
  there->SetInputData(input);
  there->SetTransform(transform);
  back->SetInputConnection(there->GetOutputPort());
  back->SetTransform(transform->GetInverse());
  back->Update();
  const GaussianField first = FieldFromPolyData(input), last = FieldFromPolyData(back->GetOutput());
  for (std::size_t i = 0; i < first.Size(); ++i)
  {
    EXPECT_LT((first.means[i] - last.means[i]).norm(), 1e-12);
    EXPECT_LT((first.scales[i] - last.scales[i]).norm(), 1e-12);
    EXPECT_LT((RotationMatrix(first.rotations[i]) - RotationMatrix(last.rotations[i])).norm(), 1e-12);
    EXPECT_EQ(first.reflectivities[i], last.reflectivities[i]);
  }
  EXPECT_NEAR(last.beam.elevationSigma, first.beam.elevationSigma, 1e-12);
  EXPECT_NEAR(last.beam.probeElevationSigma, first.beam.probeElevationSigma, 1e-12);

  // A change to the transform is seen; no transform changes nothing.
  const vtkMTimeType made = there->GetOutput()->GetMTime();
  there->Update();
  EXPECT_EQ(there->GetOutput()->GetMTime(), made);
  transform->Translate(1, 0, 0);
  there->Update();
  EXPECT_GT(there->GetOutput()->GetMTime(), made);
  there->SetTransform(nullptr);
  there->Update();
  EXPECT_EQ(FieldFromPolyData(there->GetOutput()).means, first.means);
}

TEST(TransformFieldBadInput, TransformsThatNoFieldCanFollow)
{
  const auto expect = [](vtkAbstractTransform* transform, const std::vector<std::string>& parts)
  {
    vtkNew<vtkBigusTransformField> filter;
    filter->SetInputData(FieldWithBeam());
    filter->SetTransform(transform);
    ExpectOneError(filter, parts);
  };
  vtkNew<vtkTransform> uneven, flat, huge;
  uneven->Scale(1, 1, 1.5);
  expect(uneven, {"1.5", "1.0", "evenly"});
  flat->Scale(1, 1, 0);
  expect(flat, {"evenly"});
  huge->Scale(1e300, 1e300, 1e300);
  expect(huge, {"Gaussian field"});
  vtkNew<vtkThinPlateSplineTransform> bend;
  expect(bend, {"vtkThinPlateSplineTransform", "linear"});
}

}  // namespace
}  // namespace bigus::test
