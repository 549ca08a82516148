// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusPoseCorrection: a filter around the correction of poses; what is estimated is tested with Core.

#include <limits>
#include <sstream>

#include "Core/Poses/PoseError.h"
#include "Filters/FilterTestSupport.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusPoseCorrection.h"
#include "vtkBigusTrainer.h"
#include "vtkCallbackCommand.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkIntArray.h"
#include "vtkStringArray.h"
#include "vtkUnsignedCharArray.h"

namespace bigus::test
{
namespace
{

constexpr int kSide = 96;

/// A sweep of 48 frames; pixels do not depend on the tracker's noise, so without noise it holds the true poses.
vtkSmartPointer<vtkImageData> PhantomSweep(double noise, double rotationNoise)
{
  vtkNew<vtkBigusPhantomSource> source;
  source->SetNumberOfFrames(48);
  source->SetFrameSize(kSide, kSide);
  source->SetPixelSize(0.3);
  source->SetScattererDensity(8);  // quick
  source->SetTrackingNoise(noise);
  source->SetTrackingRotationNoise(rotationNoise);
  source->Update();
  return source->GetOutput();
}

vtkDataArray* Field(vtkImageData* image, const char* name)
{
  return image->GetFieldData()->GetArray(name);
}

std::vector<Eigen::Matrix4d> PosesOf(vtkImageData* image, const char* name = "ImageToReference")
{
  std::vector<Eigen::Matrix4d> poses;
  for (vtkIdType k = 0; k < Field(image, name)->GetNumberOfTuples(); ++k)
  {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose;
    Field(image, name)->GetTuple(k, pose.data());
    poses.push_back(pose);
  }
  return poses;
}

struct Correction
{
  vtkNew<vtkBigusPoseCorrection> filter;
  vtkImageData* operator()(vtkImageData* sweep)
  {
    filter->SetInputData(sweep);
    filter->Update();
    return filter->GetOutput();
  }
};

TEST(PoseCorrectionFilter, NoisyPosesComeNearerToTheTruthAndPixelsAreShared)
{
  const auto truth = PhantomSweep(0, 0), sweep = PhantomSweep(0.2, 0.3);
  Correction correct;
  vtkImageData* corrected = correct(sweep);
  const auto distance = [&](const std::vector<Eigen::Matrix4d>& poses)
  { return MeasurePoseError(poses, PosesOf(truth), kSide, kSide).distance; };
  EXPECT_LT(distance(PosesOf(corrected)), 0.5 * distance(PosesOf(sweep)));
  EXPECT_EQ(PosesOf(corrected, "RecordedImageToReference"), PosesOf(sweep));
  EXPECT_GE(correct.filter->GetChosenStrength(), 1);
  EXPECT_EQ(Field(corrected, "PoseStrength")->GetTuple1(0), correct.filter->GetChosenStrength());

  EXPECT_EQ(corrected->GetPointData()->GetScalars(), sweep->GetPointData()->GetScalars());
  EXPECT_EQ(Field(corrected, "Timestamp"), Field(sweep, "Timestamp"));
  EXPECT_EQ(Field(sweep, "PoseStrength"), nullptr) << "the input is not written to";

  // What moved, by the definition: the mean over the four corners of the image.
  for (int k = 0; k < 48; ++k)
  {
    const Eigen::Matrix4d change = PosesOf(corrected)[k] - PosesOf(sweep)[k];
    double moved = 0;
    for (const auto& [i, j] : {std::pair{0, 0}, {kSide - 1, 0}, {0, kSide - 1}, {kSide - 1, kSide - 1}})
    {
      moved += (change * Eigen::Vector4d(i, j, 0, 1)).norm() / 4;
    }
    EXPECT_NEAR(Field(corrected, "PoseDisplacement")->GetTuple1(k), moved, 1e-9);
    EXPECT_GT(Field(corrected, "PoseRotation")->GetTuple1(k), 0);
    EXPECT_EQ(Field(corrected, "PoseStroke")->GetTuple1(k), 0);
  }
  EXPECT_EQ(Field(corrected, "PoseOutlier")->GetNumberOfTuples(), 48);

  vtkDataArray* noise = Field(corrected, "TrackerNoise");
  EXPECT_STREQ(noise->GetComponentName(1), "Rotation");
  EXPECT_NEAR(noise->GetComponent(0, 0), 0.2, 0.06);
  EXPECT_NEAR(noise->GetComponent(0, 1), 0.3, 0.09);
  // One sweep, there and not back, tells nothing that is the same in every frame.
  vtkDataArray* constant = Field(corrected, "ConstantErrors");
  ASSERT_EQ(constant->GetNumberOfComponents(), 7);
  ASSERT_EQ(constant->GetNumberOfTuples(), 3);
  EXPECT_STREQ(constant->GetComponentName(6), "RotationZ");
  EXPECT_EQ(constant->GetComponent(0, 0), 0);
  EXPECT_TRUE(std::isinf(constant->GetComponent(1, 0)));
  EXPECT_EQ(constant->GetComponent(2, 0), 0);
  EXPECT_EQ(Field(corrected, "ConstantErrorsApplied")->GetTuple1(0), 0);

  auto* decision = vtkStringArray::SafeDownCast(corrected->GetFieldData()->GetAbstractArray("PoseDecision"));
  ASSERT_EQ(decision->GetNumberOfValues(), 2);
  EXPECT_NE(decision->GetValue(0).find("smoothed"), std::string::npos) << decision->GetValue(0);
  EXPECT_NE(decision->GetValue(1).find("pictures confirm"), std::string::npos) << decision->GetValue(1);
  EXPECT_EQ(GetProvenance(corrected, "sweep.poses"), decision->GetValue(0) + " (" + decision->GetValue(1) + ")");
}

// There and back over one path, which tells the delay.
TEST(PoseCorrectionFilter, ADelayIsFoundAndTakenOut)
{
  vtkNew<vtkBigusPhantomSource> source;
  source->SetNumberOfFrames(80);
  source->SetFrameSize(kSide, kSide);
  source->SetPixelSize(0.4);
  source->SetPasses(2);
  source->SetTrackingDelay(0.08);
  source->SetTrackingNoise(0.1);
  source->SetTrackingRotationNoise(0.1);
  source->Update();
  Correction correct;
  vtkImageData* corrected = correct(source->GetOutput());
  EXPECT_EQ(Field(corrected, "ConstantErrorsApplied")->GetTuple1(0), 1);
  EXPECT_NEAR(Field(corrected, "ConstantErrors")->GetComponent(0, 0), 0.08, 0.012);
  EXPECT_LT(Field(corrected, "ConstantErrors")->GetComponent(1, 0), 0.01);
  EXPECT_EQ(Field(corrected, "ConstantErrors")->GetComponent(2, 0), 1);
  const auto bending = [&](const std::vector<Eigen::Matrix4d>& poses)
  { return MeasurePoseError(poses, PosesOf(corrected, "TrueImageToReference"), kSide, kSide).bending; };
  EXPECT_LT(bending(PosesOf(corrected)), 0.5 * bending(PosesOf(source->GetOutput())));
}

TEST(PoseCorrectionFilter, ExactPosesPassBitForBit)
{
  const auto sweep = PhantomSweep(0, 0);
  Correction correct;
  vtkImageData* corrected = correct(sweep);
  EXPECT_EQ(PosesOf(corrected), PosesOf(sweep));
  EXPECT_EQ(correct.filter->GetChosenStrength(), 0);
  double moved[2];
  Field(corrected, "PoseDisplacement")->GetRange(moved);
  EXPECT_EQ(moved[1], 0);
}

TEST(PoseCorrectionFilter, AFieldKeepsWhatWasDoneToItsSweepAndToItsPoses)
{
  Correction correct;
  vtkNew<vtkBigusTrainer> trainer;
  trainer->SetInputData(correct(PhantomSweep(0.2, 0.3)));
  trainer->AutomaticOff();
  trainer->SetGaussians(100);
  trainer->SetIterations(1);
  trainer->Update();
  vtkPolyData* field = trainer->GetOutput();
  EXPECT_EQ(GetProvenance(field, "sweep.poses").find("smoothed by"), 0u);
  EXPECT_EQ(GetProvenance(field, "poses"), "as tracked");
  trainer->SetInputData(PhantomSweep(0.2, 0.3));
  trainer->SetPoseSmoothing(1);
  trainer->Update();
  EXPECT_EQ(GetProvenance(field, "sweep.poses"), "");
  EXPECT_EQ(GetProvenance(field, "poses").find("corrected by 0."), 0u) << GetProvenance(field, "poses");
}

TEST(PoseCorrectionFilter, StrengthIsObeyed)
{
  const auto sweep = PhantomSweep(0.2, 0.3);
  Correction correct;
  correct.filter->SetStrength(0);
  EXPECT_EQ(PosesOf(correct(sweep)), PosesOf(sweep));
  correct.filter->SetStrength(3);
  vtkImageData* corrected = correct(sweep);
  EXPECT_NE(PosesOf(corrected), PosesOf(sweep));
  EXPECT_EQ(Field(corrected, "PoseStrength")->GetTuple1(0), 3);
  auto* decision = vtkStringArray::SafeDownCast(corrected->GetFieldData()->GetAbstractArray("PoseDecision"));
  EXPECT_EQ(decision->GetValue(1).find("given"), 0u) << decision->GetValue(1);

  std::ostringstream text;
  correct.filter->Print(text);
  EXPECT_NE(text.str().find("Strength: 3\n"), std::string::npos);
  EXPECT_NE(text.str().find("HoldOut: 0\n"), std::string::npos);
}

// A cropped image keeps its place, and a rejected frame its pose and its number.
TEST(PoseCorrectionFilter, CroppedImagesAndRejectedFramesKeepTheirPlace)
{
  const auto sweep = PhantomSweep(0.2, 0.3);
  vtkNew<vtkUnsignedCharArray> status;
  status->SetName("Status");
  status->SetNumberOfValues(48);
  status->FillValue(1);
  status->SetValue(20, 0);
  sweep->GetFieldData()->AddArray(status);
  Correction correct;
  correct.filter->SetStrength(1);
  const std::vector<Eigen::Matrix4d> whole = PosesOf(correct(sweep));
  EXPECT_EQ(whole[20], PosesOf(sweep)[20]);
  EXPECT_NE(whole[21], PosesOf(sweep)[21]);
  EXPECT_EQ(Field(correct.filter->GetOutput(), "PoseStroke")->GetTuple1(20), -1);
  EXPECT_EQ(Field(correct.filter->GetOutput(), "PoseDisplacement")->GetTuple1(20), 0);

  // The same pixels by other indices: (i, j) is (i + 7, j + 5) now, so poses act on other indices, too.
  vtkNew<vtkImageData> moved;
  moved->ShallowCopy(sweep);
  moved->SetExtent(7, kSide + 6, 5, kSide + 4, 0, 47);
  vtkNew<vtkDoubleArray> poses;
  poses->DeepCopy(Field(sweep, "ImageToReference"));
  for (int k = 0; k < 48; ++k)
  {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = PosesOf(sweep)[k];
    pose.col(3) -= 7 * pose.col(0) + 5 * pose.col(1);
    poses->SetTypedTuple(k, pose.data());
  }
  moved->GetFieldData()->AddArray(poses);
  const std::vector<Eigen::Matrix4d> cropped = PosesOf(correct(moved));
  for (int k = 0; k < 48; ++k)
  {
    const Eigen::Vector4d there = cropped[k] * Eigen::Vector4d(7, 5, 0, 1),
                          here = whole[k] * Eigen::Vector4d(0, 0, 0, 1);
    EXPECT_LT((there - here).norm(), 1e-6) << k;
  }
}

TEST(PoseCorrectionFilter, HeldOutPixelsAreNotLookedAt)
{
  const auto sweep = PhantomSweep(0.2, 0.3);
  vtkNew<vtkImageData> inverted;
  inverted->DeepCopy(sweep);
  for (int k = 2; k < 48; k += 4)
  {
    auto* pixels = static_cast<unsigned char*>(inverted->GetScalarPointer(0, 0, k));
    std::transform(pixels, pixels + kSide * kSide, pixels, [](unsigned char value) { return 255 - value; });
  }
  Correction correct, again;
  correct.filter->SetHoldOut(4);
  again.filter->SetHoldOut(4);
  EXPECT_EQ(PosesOf(correct(sweep)), PosesOf(again(inverted)));
  EXPECT_GT(correct.filter->GetChosenStrength(), 0);
}

TEST(PoseCorrectionFilter, WrongInputIsOneErrorThatSaysWhatToDo)
{
  const auto expect = [](vtkImageData* image, const std::vector<std::string>& parts, double strength = -1, int hold = 0)
  {
    vtkNew<vtkBigusPoseCorrection> filter;
    filter->SetInputData(image);
    filter->SetStrength(strength);
    filter->SetHoldOut(hold);
    ExpectOneError(filter, parts);
  };
  vtkNew<vtkImageData> empty;
  expect(empty, {"no pixels", "connect a tracked sequence"});
  const auto sweep = PhantomSweep(0, 0);
  expect(sweep, {"strength", "2000", "1000"}, 2000);
  expect(sweep, {"strength"}, std::numeric_limits<double>::quiet_NaN());
  expect(sweep, {"1"}, -1, 1);
  vtkNew<vtkImageData> untracked;
  untracked->ShallowCopy(sweep);
  untracked->GetFieldData()->Initialize();
  expect(untracked, {"ImageToReference"});
  vtkNew<vtkImageData> broken;
  broken->DeepCopy(sweep);
  broken->GetFieldData()->GetArray("ImageToReference")->SetComponent(3, 0, std::nan(""));
  expect(broken, {"3"});

  // And it works again afterwards.
  vtkNew<vtkBigusPoseCorrection> filter;
  filter->SetInputData(untracked);
  {
    const ErrorObserver observer(filter);
    filter->Update();
  }
  filter->SetInputData(sweep);
  filter->Update();
  EXPECT_EQ(filter->GetOutput()->GetNumberOfPoints(), sweep->GetNumberOfPoints());
  EXPECT_EQ(filter->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
}

TEST(PoseCorrectionFilter, AnAbortIsHeardAndTheNextUpdateCompletes)
{
  Correction correct;
  const auto sweep = PhantomSweep(0.2, 0.3);
  vtkNew<vtkCallbackCommand> stop;
  stop->SetCallback([](vtkObject* caller, unsigned long, void*, void*)
                    { vtkAlgorithm::SafeDownCast(caller)->SetAbortExecute(1); });
  correct.filter->AddObserver(vtkCommand::ProgressEvent, stop);
  ErrorObserver errors(correct.filter);
  EXPECT_EQ(correct(sweep)->GetNumberOfPoints(), 0);
  EXPECT_TRUE(errors.Errors().empty());
  correct.filter->RemoveObservers(vtkCommand::ProgressEvent);
  correct.filter->SetAbortExecute(0);
  EXPECT_EQ(correct(sweep)->GetNumberOfPoints(), sweep->GetNumberOfPoints());
  EXPECT_GE(correct.filter->GetChosenStrength(), 1);
}

}  // namespace
}  // namespace bigus::test
