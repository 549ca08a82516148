// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Every setting of vtkImageReslice has a meaning in vtkBigusReslice, compared with VTK's own filter on a volume of the
// same field, or is refused with what to use instead.

#include <functional>

#include "Filters/FilterTestSupport.h"
#include "vtkBigusReslice.h"
#include "vtkBigusVoxelizer.h"
#include "vtkImageInterpolator.h"
#include "vtkImageReslice.h"
#include "vtkImageSlabReslice.h"
#include "vtkImageStencilData.h"
#include "vtkInformation.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkTransform.h"
#include "vtkVersionMacros.h"

namespace bigus::test
{
namespace
{

/// Gaussians that fine voxels resolve, and a volume of them. Planes are thin, as voxels are.
struct FieldAndVolume
{
  GaussianField field = RandomField(150, 21);
  vtkSmartPointer<vtkPolyData> input;
  vtkNew<vtkBigusVoxelizer> volume;
  FieldAndVolume()
  {
    for (Eigen::Vector3d& scale : field.scales)
    {
      scale = scale.cwiseMax(1.0);
    }
    input = ToPolyData(field);
    volume->SetInputData(input);
    volume->SetOutputModeToScatteringField();
    volume->SetOutputSpacing(0.25, 0.25, 0.25);
    volume->SetOutputOrigin(-16, -16, -16);
    volume->SetOutputDimensions(129, 129, 129);
    volume->SetTolerance(0);
    volume->Update();
  }
};

template <class Filter>
void PlaceObliquely(Filter* filter)
{
  Random random(4);
  filter->SetResliceAxes(ToVtk(RigidMatrix(RandomRotation(random), {0.5, -0.3, 0.2})));
  filter->SetOutputSpacing(0.5, 0.5, 0.8);
  filter->SetOutputOrigin(-8, -8, -1);
  filter->SetOutputExtent(0, 32, 0, 32, 0, 2);
}

double LargestDifference(vtkImageData* a, vtkImageData* b)
{
  EXPECT_EQ(a->GetNumberOfPoints(), b->GetNumberOfPoints());
  double worst = 0;
  for (vtkIdType pixel = 0; pixel < a->GetNumberOfPoints(); ++pixel)
  {
    worst = std::max(worst, std::abs(a->GetPointData()->GetScalars()->GetTuple1(pixel) -
                                     b->GetPointData()->GetScalars()->GetTuple1(pixel)));
  }
  return worst;
}

TEST(ResliceSettings, ASlabIsThatOfVtkImageReslice)
{
  const FieldAndVolume data;
  for (const int mode : {VTK_IMAGE_SLAB_MIN, VTK_IMAGE_SLAB_MAX, VTK_IMAGE_SLAB_MEAN, VTK_IMAGE_SLAB_SUM})
  {
    for (const int planes : {1, 2, 5})
    {
      for (const bool trapezoid : {false, true})
      {
        vtkNew<vtkBigusReslice> ours;
        ours->SetInputData(data.input);
        ours->SetOutputModeToScatteringField();
        ours->SetElevationSigma(0);
        ours->SetTolerance(0);
        vtkNew<vtkImageReslice> theirs;
        theirs->SetInputConnection(data.volume->GetOutputPort());
        const auto configure = [&](auto* filter)
        {
          PlaceObliquely(filter);
          filter->SetInterpolationModeToCubic();
          filter->SetSlabMode(mode);
          filter->SetSlabNumberOfSlices(planes);
          filter->SetSlabSliceSpacingFraction(0.75);
          filter->SetSlabTrapezoidIntegration(trapezoid);
          filter->Update();
        };
        configure(ours.Get());
        configure(theirs.Get());
        EXPECT_STREQ(ours->GetSlabModeAsString(), theirs->GetSlabModeAsString());
        const double scale = mode == VTK_IMAGE_SLAB_SUM ? planes : 1;
        EXPECT_LT(LargestDifference(ours->GetOutput(), theirs->GetOutput()), 2e-3 * scale)
            << ours->GetSlabModeAsString() << " of " << planes << (trapezoid ? ", trapezoid" : "");
      }
    }
  }
}

TEST(ResliceSettings, WhatChangesNothingDoesNotRunTheFilterAgain)
{
  const FieldAndVolume data;
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputData(data.input);
  PlaceObliquely(reslice.Get());
  reslice->Update();
  const vtkMTimeType settings = reslice->GetMTime(), made = reslice->GetOutput()->GetMTime();

  reslice->SetInterpolationModeToCubic();
  reslice->InterpolateOff();
  reslice->SetInterpolationMode(1000);
  reslice->BorderOff();
  reslice->SetBorderThickness(7);
  reslice->OptimizationOff();
  reslice->Update();
  EXPECT_EQ(reslice->GetMTime(), settings);
  EXPECT_EQ(reslice->GetOutput()->GetMTime(), made);

  EXPECT_EQ(reslice->GetInterpolationMode(), VTK_CUBIC_INTERPOLATION);
  EXPECT_EQ(reslice->GetBorder(), 0);
  EXPECT_EQ(reslice->GetBorderThickness(), 7);
  EXPECT_EQ(reslice->GetOptimization(), 0);
  std::ostringstream printed;
  reslice->Print(printed);
  for (const char* line : {"InterpolationMode: Cubic", "Border: Off", "BorderThickness: 7", "Optimization: Off"})
  {
    EXPECT_NE(printed.str().find(line), std::string::npos) << line;
  }
  reslice->SetBackgroundLevel(3);
  reslice->Update();
  EXPECT_GT(reslice->GetOutput()->GetMTime(), made);
}

TEST(ResliceSettings, ASlabShowsWhatVtkImageSlabResliceShows)
{
  const FieldAndVolume data;
  vtkNew<vtkImageSlabReslice> theirs;
  theirs->SetInputConnection(data.volume->GetOutputPort());
  theirs->SetBlendModeToMean();
  theirs->SetSlabThickness(4);
  theirs->SetSlabResolution(0.5);
  theirs->SetOutputDimensionality(2);
  PlaceObliquely(theirs.Get());
  theirs->SetInterpolationModeToCubic();
  theirs->Update();

  vtkNew<vtkBigusReslice> ours;
  ours->SetInputData(data.input);
  ours->SetOutputModeToScatteringField();
  ours->SetElevationSigma(0);
  ours->SetTolerance(0);
  ours->SetOutputDimensionality(2);
  PlaceObliquely(ours.Get());
  ours->SetSlabModeToMean();
  ours->SetSlabNumberOfSlices(theirs->GetNumBlendSamplePoints());
  ours->SetSlabSliceSpacingFraction(0.5 / 0.8);  // a plane every 0.5 mm, as SlabResolution
  ours->Update();
  EXPECT_GT(theirs->GetNumBlendSamplePoints(), 5);
  EXPECT_LT(LargestDifference(ours->GetOutput(), theirs->GetOutput()), 2e-3);
}

TEST(ResliceSettings, PartsOfASlabHoldTheBitsOfTheWhole)
{
  const auto input = ToPolyData(RandomField(200, 5));
  const auto make = [&](const int* part)
  {
    auto reslice = vtkSmartPointer<vtkBigusReslice>::New();
    reslice->SetInputData(input);
    PlaceObliquely(reslice.Get());
    reslice->SetSlabNumberOfSlices(4);
    reslice->SetSlabModeToMax();
    if (part)
    {
      reslice->UpdateExtent(part);
    }
    else
    {
      reslice->Update();
    }
    return reslice;
  };
  const auto whole = make(nullptr);
  const int part[6] = {3, 17, 8, 9, 1, 2};
  const auto piece = make(part);
  EXPECT_EQ(piece->GetOutput()->GetNumberOfPoints(), 15 * 2 * 2);
  EXPECT_TRUE(SameBits(piece->GetOutput(), whole->GetOutput()));
  EXPECT_TRUE(SameBits(piece->GetCoverageOutput(), whole->GetCoverageOutput()));
}

TEST(ResliceSettings, ASlabIsSeenWhereAnyOfItsPlanesIs)
{
  GaussianField field;
  field.Resize(1);
  field.means[0] = {0, 0, 3};
  field.scales[0].setConstant(0.5);
  field.reflectivities[0] = 1;
  field.beam.elevationSigma = 0;
  const auto input = ToPolyData(field);
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputData(input);
  reslice->SetOutputDimensionality(2);
  reslice->SetOutputSpacing(1, 1, 1);
  reslice->SetOutputOrigin(-2, -2, 0);
  reslice->SetOutputExtent(0, 4, 0, 4, 0, 0);
  reslice->SetCoverageThreshold(0.5);
  reslice->SetBackgroundLevel(-1);
  reslice->SetOutputModeToScatteringField();
  reslice->Update();
  EXPECT_EQ(FloatAt(reslice->GetOutput(), 2, 2, 0), -1) << "6 standard deviations away";
  reslice->SetSlabNumberOfSlices(7);  // z = -3 to 3
  reslice->SetSlabModeToMax();
  reslice->Update();
  EXPECT_NEAR(FloatAt(reslice->GetOutput(), 2, 2, 0), 1, 1e-4);
  EXPECT_NEAR(FloatAt(reslice->GetCoverageOutput(), 2, 2, 0), 1, 1e-4);
  EXPECT_EQ(FloatAt(reslice->GetOutput(), 0, 0, 0), -1);
  reslice->SetSlabSliceSpacingFraction(std::nan(""));
  ExpectOneError(reslice, {"SlabSliceSpacingFraction"});
}

TEST(ResliceSettings, DefaultGeometryFollowsAutoCropAndInputSampling)
{
  for (int trial = 0; trial < 32; ++trial)
  {
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 7, 0)
    if ((trial & 26) == 10)
    {
      continue;  // its vtkImageReslice then keeps the number of pixels; earlier ones and ours keep the size in mm
    }
#endif
    Random random(trial);
    vtkNew<vtkImageData> image;
    image->SetExtent(2, 31, -5, 14, 0, 9);
    image->SetSpacing(0.5, 0.7, 1.9);
    image->SetOrigin(3, -4, 5);
    image->AllocateScalars(VTK_FLOAT, 1);
    const auto axes = ToVtk(RigidMatrix(RandomRotation(random), random.Vector(-5, 5)));
    vtkNew<vtkTransform> transform;
    transform->RotateX(random.Uniform(-90, 90));
    transform->Translate(random.Vector(-2, 2).data());
    vtkNew<vtkBigusReslice> ours;
    vtkNew<vtkImageReslice> theirs;
    const auto input = ToPolyData(RandomField(3, 1));
    ours->SetInputData(input);
    ours->SetInformationInput(image);
    theirs->SetInputData(image);
    const auto configure = [&](auto* filter)
    {
      filter->SetResliceAxes(axes);
      filter->SetAutoCropOutput(trial & 1);
      filter->SetTransformInputSampling((trial & 2) == 0);
      filter->SetResliceTransform(trial & 4 ? transform.Get() : nullptr);
      if (trial & 8)
      {
        filter->SetOutputSpacing(0.4, 0.3, 0.8);
      }
      if (trial & 16)
      {
        filter->SetOutputExtent(-1, 8, 0, 9, 2, 3);
      }
      filter->UpdateInformation();
    };
    configure(ours.Get());
    configure(theirs.Get());
    vtkInformation* a = ours->GetOutputInformation(0);
    vtkInformation* b = theirs->GetOutputInformation(0);
    for (int i = 0; i < 6; ++i)
    {
      EXPECT_EQ(a->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT())[i],
                b->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT())[i])
          << "trial " << trial;
    }
    for (int i = 0; i < 3; ++i)
    {
      EXPECT_NEAR(a->Get(vtkDataObject::SPACING())[i], b->Get(vtkDataObject::SPACING())[i], 1e-9) << "trial " << trial;
      EXPECT_NEAR(a->Get(vtkDataObject::ORIGIN())[i], b->Get(vtkDataObject::ORIGIN())[i], 1e-9) << "trial " << trial;
    }
  }
}

TEST(ResliceSettings, HowVoxelsAreReadDoesNotMatter)
{
  const auto input = ToPolyData(RandomField(100, 3));
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputData(input);
  PlaceObliquely(reslice.Get());
  reslice->Update();
  vtkNew<vtkImageData> before;
  before->DeepCopy(reslice->GetOutput());
  reslice->SetInterpolationModeToLinear();
  EXPECT_STREQ(reslice->GetInterpolationModeAsString(), "Linear");
  reslice->BorderOff();
  reslice->SetBorderThickness(2);
  reslice->OptimizationOff();
  reslice->Update();
  EXPECT_TRUE(SameBits(reslice->GetOutput(), before));

  reslice->SetBackgroundColor(0.5, 0.1, 0.2, 1);
  EXPECT_EQ(reslice->GetBackgroundLevel(), 0.5);
}

TEST(ResliceSettings, WhatAFieldCannotDoIsRefusedWithWhatToUse)
{
  vtkNew<vtkBigusReslice> reslice;
  vtkNew<vtkImageInterpolator> interpolator;
  vtkNew<vtkImageStencilData> stencil;
  const auto expect = [&](const std::function<void()>& set, const std::vector<std::string>& parts)
  {
    const ErrorObserver errors(reslice);
    const vtkMTimeType before = reslice->GetMTime();
    set();
    ASSERT_EQ(errors.Errors().size(), 1u) << parts[0];
    for (const std::string& part : parts)
    {
      EXPECT_NE(errors.Errors()[0].find(part), std::string::npos) << errors.Errors()[0];
    }
    EXPECT_EQ(reslice->GetMTime(), before);
  };
  expect([&] { reslice->WrapOn(); }, {"Wrap", "vtkImageWrapPad", "vtkBigusVoxelizer"});
  expect([&] { reslice->MirrorOn(); }, {"Mirror", "vtkImageMirrorPad"});
  expect([&] { reslice->SetInterpolator(interpolator); }, {"Interpolator", "ElevationSigma"});
  expect([&] { reslice->SetScalarShift(3); }, {"ScalarShift", "vtkImageShiftScale"});
  expect([&] { reslice->SetScalarScale(3); }, {"ScalarScale", "vtkImageShiftScale"});
  expect([&] { reslice->SetStencilData(stencil); }, {"stencil", "vtkImageStencil"});

  // What is the case anyway is no error.
  const ErrorObserver errors(reslice);
  reslice->WrapOff();
  reslice->MirrorOff();
  reslice->SetInterpolator(nullptr);
  reslice->SetScalarShift(0);
  reslice->SetScalarScale(1);
  reslice->SetStencilData(nullptr);
  EXPECT_TRUE(errors.Errors().empty());
}

}  // namespace
}  // namespace bigus::test
