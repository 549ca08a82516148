// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusReslice: where its pixels lie, what they hold, and how it behaves in a pipeline.

#include "Filters/FilterTestSupport.h"
#include "Support/Sweeps.h"
#include "vtkBigusReslice.h"
#include "vtkCallbackCommand.h"
#include "vtkFloatArray.h"
#include "vtkImageAppendComponents.h"
#include "vtkImageReslice.h"
#include "vtkImageStencilData.h"
#include "vtkInformation.h"
#include "vtkPerspectiveTransform.h"
#include "vtkSphereSource.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkThinPlateSplineTransform.h"
#include "vtkTransform.h"
#include "vtkUnsignedCharArray.h"

namespace bigus::test
{
namespace
{

/// A filter over 200 random Gaussians and a tilted 3-D grid through them.
struct Tilted
{
  GaussianField field = RandomField(200, 5);
  vtkSmartPointer<vtkPolyData> input = ToPolyData(field);
  vtkNew<vtkBigusReslice> reslice;
  Tilted()
  {
    Random random(8);
    reslice->SetInputData(input);
    reslice->SetResliceAxes(ToVtk(RigidMatrix(RandomRotation(random), {1, -2, 0.5})));
    reslice->SetOutputSpacing(0.31, 0.43, 1.7);
    reslice->SetOutputOrigin(-9, -8, -4);
    reslice->SetOutputExtent(-3, 52, 2, 43, -1, 4);
  }
};

TEST(Reslice, PixelsLieWhereTheChainPutsThem)
{
  for (int trial = 0; trial < 6; ++trial)
  {
    Random random(100 + trial);
    const GaussianField field = RandomField(40, trial);
    const Eigen::Vector3d origin = random.Vector(-6, 2), spacing = random.Vector(0.2, 0.9);
    const auto axes = ToVtk(RigidMatrix(RandomRotation(random), random.Vector(-3, 3)));
    vtkNew<vtkTransform> transform;
    transform->RotateWXYZ(random.Uniform(-90, 90), random.Vector(-1, 1).data());
    transform->Translate(random.Vector(-2, 2).data());
    transform->Scale(1.2, 0.8, 1.1);

    vtkNew<vtkBigusReslice> reslice;
    const auto input = ToPolyData(field);
    reslice->SetInputData(input);
    reslice->SetResliceAxes(axes);
    reslice->SetResliceTransform(trial % 2 ? transform.Get() : nullptr);
    reslice->SetOutputSpacing(spacing.data());
    reslice->SetOutputOrigin(origin.data());
    reslice->SetOutputExtent(-4, 15, 3, 20, 2, 5);
    reslice->SetOutputModeToScatteringField();
    reslice->SetElevationSigma(0);
    reslice->SetTolerance(0);
    reslice->Update();

    vtkImageData* image = reslice->GetOutput();
    ASSERT_EQ(image->GetNumberOfPoints(), 20 * 18 * 4);
    double worst = 0;
    for (int k = 2; k <= 5; ++k)
    {
      for (int j = 3; j <= 20; ++j)
      {
        for (int i = -4; i <= 15; ++i)
        {
          double x[4] = {origin[0] + i * spacing[0], origin[1] + j * spacing[1], origin[2] + k * spacing[2], 1};
          axes->MultiplyPoint(x, x);
          if (trial % 2)
          {
            transform->TransformPoint(x, x);
          }
          worst = std::max(worst, std::abs(FloatAt(image, i, j, k) - ThinScattering(field, Eigen::Vector3d(x))));
        }
      }
    }
    EXPECT_LT(worst, 2e-4) << "trial " << trial;
    EXPECT_GT(LargestValue(image), 0.1) << "trial " << trial;
  }
}

TEST(Reslice, AFramesPixelsLieWhereItsPosePutsThem)
{
  const GaussianField field = RandomField(60, 9);
  const auto input = ToPolyData(field);
  Eigen::Matrix4d pose = RigidMatrix(RandomRotation(3), {-4, -3, 1});
  pose.col(0) *= 0.5;  // mm a column
  pose.col(1) *= 0.4;  // mm a row
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputData(input);
  reslice->SetOutputToFrame(ToVtk(pose), 18, 15);
  reslice->SetOutputModeToScatteringField();
  reslice->SetElevationSigma(0);
  reslice->SetTolerance(0);
  reslice->Update();
  const int* extent = reslice->GetOutput()->GetExtent();
  EXPECT_EQ(std::vector<int>(extent, extent + 6), std::vector<int>({0, 17, 0, 14, 0, 0}));
  double worst = 0;
  for (int j = 0; j < 15; ++j)
  {
    for (int i = 0; i < 18; ++i)
    {
      const Eigen::Vector4d x = pose * Eigen::Vector4d(i, j, 0, 1);
      worst = std::max(worst, std::abs(FloatAt(reslice->GetOutput(), i, j, 0) - ThinScattering(field, x.head<3>())));
    }
  }
  EXPECT_LT(worst, 2e-4);
  EXPECT_GT(LargestValue(reslice->GetOutput()), 0.1);
}

TEST(Reslice, DirectionCosinesAndOriginAreTheMatrix)
{
  vtkNew<vtkBigusReslice> ours;
  vtkNew<vtkImageReslice> theirs;
  for (auto set : {0, 1})
  {
    const double x[3] = {0, 1, 0}, y[3] = {0, 0, 1}, z[3] = {1, 0, 0};
    const double nine[9] = {0.6, 0.8, 0, -0.8, 0.6, 0, 0, 0, 1};
    if (set == 0)
    {
      ours->SetResliceAxesDirectionCosines(x, y, z);
      theirs->SetResliceAxesDirectionCosines(x, y, z);
    }
    else
    {
      ours->SetResliceAxesDirectionCosines(nine);
      theirs->SetResliceAxesDirectionCosines(nine);
    }
    ours->SetResliceAxesOrigin(4, 5, 6);
    theirs->SetResliceAxesOrigin(4, 5, 6);
    for (int i = 0; i < 16; ++i)
    {
      EXPECT_EQ(ours->GetResliceAxes()->GetData()[i], theirs->GetResliceAxes()->GetData()[i]);
    }
    double a[9], b[9], origin[3];
    ours->GetResliceAxesDirectionCosines(a);
    theirs->GetResliceAxesDirectionCosines(b);
    EXPECT_TRUE(std::equal(a, a + 9, b));
    ours->GetResliceAxesOrigin(origin);
    EXPECT_EQ(origin[2], 6);
  }
}

TEST(Reslice, DefaultGeometryIsThatOfVtkImageReslice)
{
  for (int trial = 0; trial < 24; ++trial)
  {
    Random random(trial);
    vtkNew<vtkImageData> image;
    image->SetExtent(2, 31, -5, 14, 0, 9);
    image->SetSpacing(0.5, 0.7, 1.9);
    image->SetOrigin(3, -4, 5);
    image->AllocateScalars(VTK_FLOAT, 1);
    vtkNew<vtkBigusReslice> ours;
    vtkNew<vtkImageReslice> theirs;
    const auto input = ToPolyData(RandomField(3, 1));
    ours->SetInputData(input);
    ours->SetInformationInput(image);
    theirs->SetInputData(image);
    const auto axes = ToVtk(RigidMatrix(RandomRotation(random), random.Vector(-5, 5)));
    ours->SetResliceAxes(trial % 3 ? axes : nullptr);
    theirs->SetResliceAxes(trial % 3 ? axes : nullptr);
    const int dimensionality = trial % 4;
    ours->SetOutputDimensionality(dimensionality);
    theirs->SetOutputDimensionality(dimensionality);
    if (trial & 1)
    {
      ours->SetOutputSpacing(0.4, 0.3, 0.8);
      theirs->SetOutputSpacing(0.4, 0.3, 0.8);
    }
    if (trial & 2)
    {
      ours->SetOutputOrigin(1, 2, 3);
      theirs->SetOutputOrigin(1, 2, 3);
    }
    if (trial & 4)
    {
      ours->SetOutputExtent(-1, 8, 0, 9, 2, 3);
      theirs->SetOutputExtent(-1, 8, 0, 9, 2, 3);
    }
    ours->UpdateInformation();
    theirs->UpdateInformation();
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
      EXPECT_NEAR(a->Get(vtkDataObject::SPACING())[i], b->Get(vtkDataObject::SPACING())[i], 1e-12);
      EXPECT_NEAR(a->Get(vtkDataObject::ORIGIN())[i], b->Get(vtkDataObject::ORIGIN())[i], 1e-9);
    }
  }
}

TEST(Reslice, WithoutAnyGeometryTheWholeFieldIsSeen)
{
  const GaussianField field = RandomField(30, 2);
  const auto input = ToPolyData(field);
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputData(input);
  reslice->UpdateInformation();
  vtkInformation* info = reslice->GetOutputInformation(0);
  const int* extent = info->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT());
  const double* spacing = info->Get(vtkDataObject::SPACING());
  const double* origin = info->Get(vtkDataObject::ORIGIN());
  int longest = 0;
  for (int axis = 0; axis < 3; ++axis)
  {
    EXPECT_DOUBLE_EQ(spacing[axis], spacing[0]);
    longest = std::max(longest, extent[2 * axis + 1] - extent[2 * axis] + 1);
    for (const Eigen::Vector3d& mean : field.means)
    {
      EXPECT_LE(origin[axis], mean[axis]);
      EXPECT_GE(origin[axis] + spacing[axis] * extent[2 * axis + 1], mean[axis]);
    }
  }
  EXPECT_EQ(longest, 256);

  reslice->SetOutputSpacing(1, 1, 1);
  reslice->SetOutputSpacingToDefault();
  reslice->SetOutputOrigin(1, 1, 1);
  reslice->SetOutputOriginToDefault();
  reslice->SetOutputExtent(0, 1, 0, 1, 0, 1);
  reslice->SetOutputExtentToDefault();
  const std::vector<int> before(extent, extent + 6);
  reslice->UpdateInformation();
  EXPECT_TRUE(std::equal(before.begin(), before.end(),
                         reslice->GetOutputInformation(0)->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT())));
}

TEST(Reslice, EverySubExtentHoldsTheBitsOfTheWhole)
{
  for (const char* engine : {"cpu", "reference"})
  {
    Tilted whole;
    whole.reslice->SetEngine(engine);
    whole.reslice->Update();
    ASSERT_GT(LargestValue(whole.reslice->GetOutput()), 0.2);
    const int parts[][6] = {{-3, 52, 2, 43, 2, 2}, {0, 0, 20, 20, 0, 0},   {13, 40, 7, 29, -1, 4},
                            {-3, 9, 2, 43, 1, 3},  {51, 52, 42, 43, 4, 4}, {5, 36, 3, 3, -1, -1}};
    for (const int* extent : parts)
    {
      Tilted part;
      part.reslice->SetEngine(engine);
      part.reslice->UpdateExtent(extent);
      int got[6];
      part.reslice->GetOutput()->GetExtent(got);
      EXPECT_TRUE(std::equal(got, got + 6, extent));
      EXPECT_TRUE(SameBits(part.reslice->GetOutput(), whole.reslice->GetOutput())) << engine;
      EXPECT_TRUE(SameBits(part.reslice->GetCoverageOutput(), whole.reslice->GetCoverageOutput())) << engine;
    }
  }
}

#ifdef BIGUS_WITH_STREAMER
TEST(Reslice, StreamedInPiecesItIsTheSameImage)
{
  Tilted whole;
  whole.reslice->Update();
  for (int port : {0, 1})
  {
    for (int divisions : {2, 7, 40})
    {
      Tilted streamed;
      vtkNew<vtkImageDataStreamer> streamer;
      streamer->SetInputConnection(streamed.reslice->GetOutputPort(port));
      streamer->SetNumberOfStreamDivisions(divisions);
      streamer->Update();
      int extent[6];
      streamer->GetOutput()->GetExtent(extent);
      const int expected[6] = {-3, 52, 2, 43, -1, 4};
      EXPECT_TRUE(std::equal(extent, extent + 6, expected));
      EXPECT_TRUE(
          SameBits(streamer->GetOutput(), vtkImageData::SafeDownCast(whole.reslice->GetOutputDataObject(port))));
      int last[6];
      streamed.reslice->GetOutput()->GetExtent(last);
      EXPECT_LT((last[1] - last[0] + 1) * (last[3] - last[2] + 1) * (last[5] - last[4] + 1), 56 * 42 * 6)
          << "the filter made the whole image for a piece";
    }
  }
}
#endif

TEST(Reslice, AFilterConnectedToBothOutputsFindsBoth)
{
  Tilted tilted;
  vtkNew<vtkImageAppendComponents> both;
  both->AddInputConnection(tilted.reslice->GetOutputPort());
  both->AddInputConnection(tilted.reslice->GetCoverageOutputPort());
  both->Update();
  Tilted alone;
  alone.reslice->Update();
  for (int i = -3; i <= 52; i += 5)
  {
    const auto* pixel = static_cast<const float*>(both->GetOutput()->GetScalarPointer(i, 20, 1));
    EXPECT_EQ(pixel[0], FloatAt(alone.reslice->GetOutput(), i, 20, 1));
    EXPECT_EQ(pixel[1], FloatAt(alone.reslice->GetCoverageOutput(), i, 20, 1));
  }
}

TEST(Reslice, FollowsItsAxesTransformAndInput)
{
  Tilted tilted;
  tilted.reslice->Update();
  const auto first = vtkSmartPointer<vtkImageData>::New();
  first->DeepCopy(tilted.reslice->GetOutput());

  const vtkMTimeType made = tilted.reslice->GetOutput()->GetMTime();
  tilted.reslice->Update();
  EXPECT_EQ(tilted.reslice->GetOutput()->GetMTime(), made) << "nothing changed, yet it was made again";

  const vtkMTimeType before = tilted.reslice->GetMTime();
  tilted.reslice->GetResliceAxes()->SetElement(0, 3, 3.0);
  EXPECT_GT(tilted.reslice->GetMTime(), before);
  tilted.reslice->Update();
  EXPECT_FALSE(SameBits(tilted.reslice->GetOutput(), first));
  tilted.reslice->GetResliceAxes()->SetElement(0, 3, 1.0);
  tilted.reslice->Update();
  EXPECT_TRUE(SameBits(tilted.reslice->GetOutput(), first));

  vtkNew<vtkTransform> transform;
  tilted.reslice->SetResliceTransform(transform);
  tilted.reslice->Update();
  EXPECT_TRUE(SameBits(tilted.reslice->GetOutput(), first));
  transform->Translate(1, 0, 0);
  tilted.reslice->Update();
  EXPECT_FALSE(SameBits(tilted.reslice->GetOutput(), first));
  tilted.reslice->SetResliceTransform(nullptr);

  // The engine's copy of the field is renewed when the input changes.
  vtkDataArray* reflectivity = tilted.input->GetPointData()->GetArray("Reflectivity");
  const double old = reflectivity->GetTuple1(7);
  for (int i = 0; i < 200; ++i)
  {
    reflectivity->SetTuple1(i, 2 * reflectivity->GetTuple1(i));
  }
  reflectivity->Modified();
  tilted.reslice->Update();
  EXPECT_FALSE(SameBits(tilted.reslice->GetOutput(), first));
  EXPECT_EQ(reflectivity->GetTuple1(7), 2 * old);
}

TEST(Reslice, ModesAndTypesTellTheSameStory)
{
  Tilted tilted;
  tilted.reslice->SetTolerance(0);
  tilted.reslice->Update();
  const auto intensity = vtkSmartPointer<vtkImageData>::New();
  intensity->DeepCopy(tilted.reslice->GetOutput());
  EXPECT_EQ(intensity->GetScalarType(), VTK_FLOAT);

  tilted.reslice->SetOutputModeToScatteringField();
  tilted.reslice->Update();
  const auto scattering = vtkSmartPointer<vtkImageData>::New();
  scattering->DeepCopy(tilted.reslice->GetOutput());
  EXPECT_LT(scattering->GetScalarRange()[0], 0);

  tilted.reslice->SetOutputModeToIntensity();
  tilted.reslice->SetOutputScalarTypeToUnsignedChar();
  tilted.reslice->Update();
  vtkImageData* bytes = tilted.reslice->GetOutput();
  EXPECT_EQ(bytes->GetScalarType(), VTK_UNSIGNED_CHAR);
  EXPECT_EQ(tilted.reslice->GetCoverageOutput()->GetScalarType(), VTK_FLOAT);
  for (vtkIdType pixel = 0; pixel < intensity->GetNumberOfPoints(); ++pixel)
  {
    const double i = intensity->GetPointData()->GetScalars()->GetTuple1(pixel);
    const double s = scattering->GetPointData()->GetScalars()->GetTuple1(pixel);
    EXPECT_NEAR(i, s > 0 ? 1 - std::exp(-0.7 * s) : 0, 1e-6);
    EXPECT_NEAR(bytes->GetPointData()->GetScalars()->GetTuple1(pixel), 255 * i, 0.5001);
  }
}

TEST(Reslice, ElevationProfileAveragesAcrossThePlane)
{
  const GaussianField field = RandomField(25, 11);
  const auto input = ToPolyData(field);
  Random random(3);
  const Eigen::Matrix4d axes = RigidMatrix(RandomRotation(random), {0, 1, 0});
  const Eigen::Vector3d normal = axes.block<3, 1>(0, 2);
  for (double sigma : {-1.0, 0.0, 2.5})
  {
    vtkNew<vtkBigusReslice> reslice;
    reslice->SetInputData(input);
    reslice->SetResliceAxes(ToVtk(axes));
    reslice->SetOutputDimensionality(2);
    reslice->SetOutputSpacing(0.9, 0.9, 1);
    reslice->SetOutputOrigin(-5, -5, 0);
    reslice->SetOutputExtent(0, 9, 0, 9, 0, 0);
    reslice->SetOutputModeToScatteringField();
    reslice->SetElevationSigma(sigma);
    reslice->SetTolerance(0);
    reslice->Update();

    const double thickness = sigma < 0 ? field.beam.elevationSigma : sigma;
    for (int j = 0; j < 10; j += 3)
    {
      for (int i = 0; i < 10; i += 3)
      {
        const Eigen::Vector4d x = axes * Eigen::Vector4d(-5 + 0.9 * i, -5 + 0.9 * j, 0, 1);
        double sum = 0, weights = 0;  // of thin planes, by the profile
        for (int z = -80; z <= 80; ++z)
        {
          const double weight = std::exp(-0.5 * z * z / 256.0);  // 16 steps a standard deviation
          sum += weight * ThinScattering(field, x.head<3>() + normal * thickness * z / 16);
          weights += weight;
        }
        EXPECT_NEAR(FloatAt(reslice->GetOutput(), i, j, 0), sum / weights, 2e-4);
      }
    }
  }
}

TEST(Reslice, CoverageTellsSeenFromUnseen)
{
  // One Gaussian in the middle of a large plane, and one with nearly no reflectivity.
  GaussianField field;
  field.Resize(2);
  field.means[1] = {0, 6, 0};
  field.reflectivities = {1.0, 1e-3};
  field.beam.elevationSigma = 0;
  const auto input = ToPolyData(field);
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputData(input);
  reslice->SetOutputDimensionality(2);
  reslice->SetOutputSpacing(0.5, 0.5, 1);
  reslice->SetOutputOrigin(-20, -20, 0);
  reslice->SetOutputExtent(0, 80, 0, 80, 0, 0);
  reslice->SetCoverageThreshold(0.05);
  reslice->SetBackgroundLevel(-1);
  reslice->GenerateStencilOutputOn();
  reslice->SetTolerance(0);
  reslice->Update();
  vtkImageData* image = reslice->GetOutput();
  vtkImageData* coverage = reslice->GetCoverageOutput();
  int seen = 0;
  for (int j = 0; j <= 80; ++j)
  {
    for (int i = 0; i <= 80; ++i)
    {
      const Eigen::Vector3d x(-20 + 0.5 * i, -20 + 0.5 * j, 0);
      const double expected = std::exp(-0.5 * x.squaredNorm()) + std::exp(-0.5 * (x - field.means[1]).squaredNorm());
      EXPECT_NEAR(FloatAt(coverage, i, j, 0), expected, 1e-5) << "reflectivity has no part in the coverage";
      const bool inside = FloatAt(coverage, i, j, 0) > 0.05f;
      EXPECT_EQ(FloatAt(image, i, j, 0) == -1.0f, !inside);
      EXPECT_EQ(reslice->GetStencilOutput()->IsInside(i, j, 0) != 0, inside);
      seen += inside;
    }
  }
  EXPECT_GT(seen, 100);
  EXPECT_LT(seen, 300);

  reslice->SetOutputScalarTypeToUnsignedChar();
  reslice->SetBackgroundLevel(100);
  reslice->Update();
  EXPECT_EQ(reslice->GetOutput()->GetScalarComponentAsDouble(0, 0, 0, 0), 100);
  EXPECT_GT(reslice->GetOutput()->GetScalarComponentAsDouble(40, 40, 0, 0), 100);

  // Into an object of the caller's.
  vtkNew<vtkImageStencilData> own;
  reslice->SetStencilOutput(own);
  reslice->Update();
  EXPECT_EQ(reslice->GetStencilOutput(), own.Get());
  int extent[6];
  own->GetExtent(extent);
  EXPECT_EQ(extent[1], reslice->GetOutput()->GetExtent()[1]);
  reslice->SetStencilOutput(nullptr);
  reslice->Update();
  EXPECT_NE(reslice->GetStencilOutput(), own.Get());

  reslice->GenerateCoverageOutputOff();
  reslice->GenerateStencilOutputOff();
  reslice->Update();
  EXPECT_EQ(reslice->GetCoverageOutput()->GetNumberOfPoints(), 0);
  EXPECT_EQ(reslice->GetOutput()->GetScalarComponentAsDouble(0, 0, 0, 0), 100);
}

TEST(Reslice, DistanceTellsGapsBetweenRecordedFrames)
{
  // Frames at z = -2.5 to 2.5 mm, 1 mm apart, but for those at -0.5 and 0.5, which are rejected: a gap of 3 mm.
  const auto sweep = BlackSweep(6, 60, 60, 1.0, 1.0);
  vtkNew<vtkImageData> recorded;
  SweepToImage(*sweep, recorded);
  vtkNew<vtkUnsignedCharArray> status;
  status->SetName("Status");
  for (const int accepted : {1, 1, 0, 0, 1, 1})
  {
    status->InsertNextValue(accepted);
  }
  recorded->GetFieldData()->AddArray(status);

  Tilted tilted;
  tilted.reslice->Update();
  EXPECT_EQ(tilted.reslice->GetDistanceOutput()->GetNumberOfPoints(), 0) << "not asked for";
  tilted.reslice->SetRecordedFrames(recorded);
  tilted.reslice->Update();
  vtkImageData* distance = tilted.reslice->GetDistanceOutput();
  EXPECT_EQ(distance->GetNumberOfPoints(), tilted.reslice->GetOutput()->GetNumberOfPoints());
  vtkMatrix4x4* axes = tilted.reslice->GetResliceAxes();
  for (int k = -1; k <= 4; ++k)
  {
    for (int j = 2; j <= 43; ++j)
    {
      for (int i = -3; i <= 52; ++i)
      {
        const double place[4] = {-9 + 0.31 * i, -8 + 0.43 * j, -4 + 1.7 * k, 1};
        double world[4], nearest = VTK_DOUBLE_MAX;
        axes->MultiplyPoint(place, world);
        for (const double z : {-2.5, -1.5, 1.5, 2.5})
        {
          nearest = std::min(nearest, std::abs(world[2] - z));
        }
        EXPECT_NEAR(FloatAt(distance, i, j, k), nearest, 1e-5);
      }
    }
  }

  vtkNew<vtkImageData> noSweep;
  Tilted wrong;
  wrong.reslice->SetRecordedFrames(noSweep);
  ErrorObserver errors(wrong.reslice);
  wrong.reslice->Update();
  EXPECT_FALSE(errors.Errors().empty());
  EXPECT_EQ(wrong.reslice->GetDistanceOutput()->GetNumberOfPoints(), 0);
}

TEST(Reslice, APlaneThatMissesAndAnEmptyFieldAreBackground)
{
  for (const char* engine : {"cpu", "reference"})
  {
    Tilted missing;
    ErrorObserver errors(missing.reslice);
    missing.reslice->SetEngine(engine);
    missing.reslice->SetResliceAxesOrigin(1e4, -3e5, 1e4);
    missing.reslice->SetBackgroundLevel(0.25);
    missing.reslice->Update();
    EXPECT_EQ(missing.reslice->GetOutput()->GetScalarRange()[0], 0.25);
    EXPECT_EQ(missing.reslice->GetOutput()->GetScalarRange()[1], 0.25);
    EXPECT_EQ(LargestValue(missing.reslice->GetCoverageOutput()), 0);

    vtkNew<vtkPolyData> nothing;
    missing.reslice->SetInputData(nothing);
    missing.reslice->Update();
    EXPECT_EQ(missing.reslice->GetOutput()->GetScalarRange()[1], 0.25);
    missing.reslice->SetOutputSpacingToDefault();
    missing.reslice->SetOutputOriginToDefault();
    missing.reslice->SetOutputExtentToDefault();
    missing.reslice->Update();
    EXPECT_EQ(missing.reslice->GetOutput()->GetNumberOfPoints(), 1);
    EXPECT_TRUE(errors.Errors().empty()) << errors.Errors()[0];
  }
}

TEST(Reslice, AnAbortIsHeardAndTheNextUpdateCompletes)
{
  Tilted tilted;
  tilted.reslice->SetOutputExtent(0, 599, 0, 599, 0, 30);
  tilted.reslice->SetOutputSpacing(0.03, 0.03, 0.3);
  vtkNew<vtkCallbackCommand> stop;
  stop->SetCallback(
      [](vtkObject* caller, unsigned long, void*, void*)
      {
        auto* filter = vtkAlgorithm::SafeDownCast(caller);
        if (filter->GetProgress() > 0.02)
        {
          filter->SetAbortExecute(1);
        }
      });
  tilted.reslice->AddObserver(vtkCommand::ProgressEvent, stop);
  ErrorObserver errors(tilted.reslice);
  tilted.reslice->Update();
  EXPECT_GT(tilted.reslice->GetProgress(), 0.02);
  EXPECT_LT(tilted.reslice->GetProgress(), 0.5);  // where it was, but for what was under way
  EXPECT_EQ(tilted.reslice->GetOutput()->GetNumberOfPoints(), 0);
  EXPECT_TRUE(errors.Errors().empty());

  tilted.reslice->RemoveObservers(vtkCommand::ProgressEvent);
  tilted.reslice->SetAbortExecute(0);  // from VTK 9.3 on an algorithm stays stopped until then
  tilted.reslice->Update();
  EXPECT_EQ(tilted.reslice->GetOutput()->GetNumberOfPoints(), 600 * 600 * 31);
}

TEST(Reslice, ASlowEngineStillReportsProgressOften)
{
  Tilted tilted;
  tilted.reslice->SetEngine("reference");
  tilted.reslice->SetOutputExtent(0, 299, 0, 299, 0, 0);
  int reports = 0;
  vtkNew<vtkCallbackCommand> count;
  count->SetClientData(&reports);
  count->SetCallback([](vtkObject*, unsigned long, void* data, void*) { ++*static_cast<int*>(data); });
  tilted.reslice->AddObserver(vtkCommand::ProgressEvent, count);
  tilted.reslice->Update();
  EXPECT_GT(reports, 3);
}

TEST(Reslice, FieldsOfExtremeSizeHaveADefaultGeometryOrAnError)
{
  for (double size : {1e-300, 1e-9, 1e9, 1e300})
  {
    GaussianField field = RandomField(2, 1);
    field.means[1] = field.means[0];
    field.scales[0].setConstant(size);
    field.scales[1].setConstant(size);
    const auto input = ToPolyData(field);
    vtkNew<vtkBigusReslice> reslice;
    reslice->SetInputData(input);
    reslice->SetOutputDimensionality(2);
    ErrorObserver errors(reslice);
    reslice->Update();
    EXPECT_EQ(reslice->GetOutput()->GetNumberOfPoints() > 0, errors.Errors().empty()) << size;
  }
}

// Bad input: one clear error each.

TEST(ResliceBadInput, AnAbsurdSizeIsRefusedBeforeAnythingIsAllocated)
{
  Tilted tilted;
  tilted.reslice->SetOutputExtent(0, 99999, 0, 99999, 0, 99);
  ExpectOneError(tilted.reslice, {"100000 x 100000 x 100", "MaximumOutputPixels"});

  tilted.reslice->SetOutputExtent(-2000000000, 2000000000, 0, 1, 0, 1);
  ExpectOneError(tilted.reslice, {"OutputExtent", "2^31"});

  // A piece of it is fine.
  tilted.reslice->SetOutputExtent(0, 99999, 0, 99999, 0, 99);
  const int piece[6] = {500, 600, 7, 8, 3, 3};
  tilted.reslice->UpdateExtent(piece);
  EXPECT_EQ(tilted.reslice->GetOutput()->GetNumberOfPoints(), 202);

  tilted.reslice->SetOutputExtent(0, 9, 0, 9, 0, 0);
  tilted.reslice->SetMaximumOutputPixels(99);
  ExpectOneError(tilted.reslice, {"10 x 10 x 1", "99"});
  tilted.reslice->SetMaximumOutputPixels(100);
  tilted.reslice->Update();
  EXPECT_EQ(tilted.reslice->GetOutput()->GetNumberOfPoints(), 100);
}

TEST(ResliceBadInput, TransformsThatBendPlanes)
{
  Tilted tilted;
  vtkNew<vtkThinPlateSplineTransform> bend;
  tilted.reslice->SetResliceTransform(bend);
  ExpectOneError(tilted.reslice, {"vtkThinPlateSplineTransform", "linear"});
  vtkNew<vtkPerspectiveTransform> perspective;
  perspective->Perspective(30, 1, 1, 100);
  tilted.reslice->SetResliceTransform(perspective);
  ExpectOneError(tilted.reslice, {"perspective"});
  perspective->Identity();
  tilted.reslice->Update();
  EXPECT_GT(tilted.reslice->GetOutput()->GetNumberOfPoints(), 0);
}

TEST(ResliceBadInput, AxesAndSpacingThatSpanNoPlane)
{
  const double nan = std::nan("");
  Tilted tilted;
  tilted.reslice->SetOutputSpacing(0, 1, 1);
  ExpectOneError(tilted.reslice, {"OutputSpacing", "axis 0", "mm"});
  tilted.reslice->SetOutputSpacing(1, nan, 1);
  ExpectOneError(tilted.reslice, {"OutputSpacing", "axis 1"});
  tilted.reslice->SetOutputExtentToDefault();
  ExpectOneError(tilted.reslice, {"OutputSpacing", "axis 1"});
  tilted.reslice->SetOutputExtent(0, 9, 0, 9, 0, 0);
  tilted.reslice->SetOutputSpacing(1, 1, 1);
  tilted.reslice->SetOutputOrigin(0, INFINITY, 0);
  ExpectOneError(tilted.reslice, {"OutputOrigin", "axis 1"});
  tilted.reslice->SetOutputOrigin(0, 0, 0);
  tilted.reslice->SetResliceAxesDirectionCosines(1, 0, 0, 1, 0, 0, 0, 0, 1);
  ExpectOneError(tilted.reslice, {"parallel"});
  tilted.reslice->SetOutputSpacingToDefault();
  ExpectOneError(tilted.reslice, {"inverted"});
  tilted.reslice->SetOutputSpacing(1, 1, 1);
  tilted.reslice->SetResliceAxesDirectionCosines(1, 0, 0, 0, nan, 0, 0, 0, 1);
  ExpectOneError(tilted.reslice, {"not finite"});
}

TEST(ResliceBadInput, OptionsOutOfRange)
{
  const auto expect = [](void (*change)(vtkBigusReslice*), std::vector<std::string> parts)
  {
    Tilted tilted;
    change(tilted.reslice);
    ExpectOneError(tilted.reslice, parts);
  };
  expect([](vtkBigusReslice* f) { f->SetOutputScalarType(VTK_DOUBLE); }, {"OutputScalarType", "double"});
  expect(
      [](vtkBigusReslice* f)
      {
        f->SetOutputScalarTypeToUnsignedChar();
        f->SetOutputModeToScatteringField();
      },
      {"signed", "float"});
  expect([](vtkBigusReslice* f) { f->SetElevationSigma(std::nan("")); }, {"elevation sigma"});
  expect([](vtkBigusReslice* f) { f->SetTolerance(-1); }, {"tolerance"});
  expect([](vtkBigusReslice* f) { f->SetTolerance(std::nan("")); }, {"tolerance"});
  expect([](vtkBigusReslice* f) { f->SetCoverageThreshold(-0.1); }, {"CoverageThreshold"});
  expect([](vtkBigusReslice* f) { f->SetEngine("warp drive"); }, {"warp drive", "cpu", "reference"});
  expect([](vtkBigusReslice* f) { f->SetEngine(nullptr); }, {"Engine"});
}

TEST(ResliceBadInput, AFieldThatIsNone)
{
  const auto expect = [](void (*change)(vtkPolyData*), std::vector<std::string> parts)
  {
    Tilted tilted;
    change(tilted.input);
    ExpectOneError(tilted.reslice, parts);
  };
  const auto replace = [](vtkFieldData* data, const char* name, int components, int tuples)
  {
    vtkNew<vtkFloatArray> array;
    array->SetName(name);
    array->SetNumberOfComponents(components);
    array->SetNumberOfTuples(tuples);
    array->Fill(1);
    data->AddArray(array);
  };
  static const auto put = replace;
  for (const char* name : {"Scale", "Rotation", "Reflectivity"})
  {
    Tilted tilted;
    tilted.input->GetPointData()->RemoveArray(name);
    ExpectOneError(tilted.reslice, {name, "missing"});
  }
  for (const char* name : {"Gamma", "ElevationSigma"})
  {
    Tilted tilted;
    tilted.input->GetFieldData()->RemoveArray(name);
    ExpectOneError(tilted.reslice, {name, "missing"});
  }
  expect([](vtkPolyData* p) { put(p->GetPointData(), "Scale", 1, 200); }, {"Scale", "200 tuples of 1", "of 3"});
  expect([](vtkPolyData* p) { put(p->GetPointData(), "Rotation", 3, 200); }, {"Rotation", "of 4"});
  expect([](vtkPolyData* p) { put(p->GetPointData(), "Reflectivity", 1, 199); }, {"Reflectivity", "199"});
  expect([](vtkPolyData* p) { put(p->GetFieldData(), "Gamma", 1, 0); }, {"Gamma", "0 tuples"});
  expect(
      [](vtkPolyData* p)
      { put(p->GetFieldData(), "FormatVersion", 1, 1), p->GetFieldData()->GetArray("FormatVersion")->SetTuple1(0, 2); },
      {"version", "2"});
  expect([](vtkPolyData* p) { p->GetPointData()->GetArray("Scale")->SetComponent(17, 1, -0.5); },
         {"Scale[17]", "standard deviations"});
  expect([](vtkPolyData* p) { p->GetPointData()->GetArray("Scale")->SetComponent(17, 1, 0); }, {"Scale[17]"});
  expect([](vtkPolyData* p) { p->GetPointData()->GetArray("Scale")->SetComponent(3, 2, std::nan("")); }, {"Scale[3]"});
  expect([](vtkPolyData* p) { p->GetPointData()->GetArray("Rotation")->SetTuple4(9, 0, 0, 0, 0); },
         {"Rotation[9]", "quaternion"});
  expect([](vtkPolyData* p) { p->GetPointData()->GetArray("Reflectivity")->SetTuple1(0, INFINITY); },
         {"Reflectivity[0]"});
  expect([](vtkPolyData* p) { p->GetPoints()->SetPoint(5, 0, std::nan(""), 0); }, {"Points[5]"});
  expect([](vtkPolyData* p) { p->GetFieldData()->GetArray("Gamma")->SetTuple1(0, -1); }, {"gamma"});
  expect([](vtkPolyData* p) { p->GetFieldData()->GetArray("ElevationSigma")->SetTuple1(0, -1); }, {"elevation sigma"});

  // The filter recovers when the field does.
  Tilted tilted;
  vtkDataArray* scale = tilted.input->GetPointData()->GetArray("Scale");
  const double good = scale->GetComponent(4, 0);
  scale->SetComponent(4, 0, -1);
  scale->Modified();
  ExpectOneError(tilted.reslice, {"Scale[4]"});
  scale->SetComponent(4, 0, good);
  scale->Modified();
  tilted.reslice->Update();
  EXPECT_GT(tilted.reslice->GetOutput()->GetNumberOfPoints(), 0);
  EXPECT_EQ(tilted.reslice->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
}

TEST(ResliceBadInput, OtherDataThanAField)
{
  vtkNew<vtkBigusReslice> reslice;
  vtkNew<vtkImageData> image;
  image->SetDimensions(3, 3, 3);
  image->AllocateScalars(VTK_FLOAT, 1);
  ErrorObserver errors(reslice);  // the executive complains for the filter
  reslice->SetInputData(image);
  reslice->Update();
  EXPECT_EQ(reslice->GetOutput()->GetNumberOfPoints(), 0);

  vtkNew<vtkSphereSource> sphere;
  vtkNew<vtkBigusReslice> other;
  other->SetInputConnection(sphere->GetOutputPort());
  ExpectOneError(other, {"missing"});

  vtkNew<vtkBigusReslice> unconnected;
  ErrorObserver quiet(unconnected);
  unconnected->Update();
  EXPECT_EQ(unconnected->GetOutput()->GetNumberOfPoints(), 0);
}

TEST(Reslice, PrintsWhatItIs)
{
  Tilted tilted;
  tilted.reslice->Update();
  std::ostringstream text;
  tilted.reslice->Print(text);
  for (const char* part : {"OutputSpacing: 0.31", "ElevationSigma: -1", "Engine: auto", "Device: "})
  {
    EXPECT_NE(text.str().find(part), std::string::npos) << part;
  }
}

}  // namespace
}  // namespace bigus::test
