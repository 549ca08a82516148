// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The phantom as a VTK source: a sweep in the agreed form, the truth at any plane, and errors that name the option.
#include <gtest/gtest.h>

#include <cstring>
#include <sstream>
#include <string>

#include "Core/Phantom/Phantom.h"
#include "Data/SweepData.h"
#include "Filters/FilterTestSupport.h"
#include "vtkBigusPhantomSource.h"
#include "vtkCallbackCommand.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"

namespace
{

/// A sweep small enough to make in a moment.
vtkSmartPointer<vtkBigusPhantomSource> SmallSource()
{
  auto source = vtkSmartPointer<vtkBigusPhantomSource>::New();
  source->SetNumberOfFrames(5);
  source->SetFrameSize(48, 40);
  source->SetPixelSize(0.8);
  source->SetScattererDensity(8);
  return source;
}

TEST(PhantomSource, DefaultsAreCores)
{
  vtkNew<vtkBigusPhantomSource> source;
  const bigus::PhantomOptions core;
  EXPECT_EQ(source->GetNumberOfFrames(), core.frames);
  EXPECT_EQ(source->GetElevationSigma(), core.elevationSigma);
  EXPECT_EQ(source->GetDynamicRange(), core.dynamicRange);
  EXPECT_STREQ(source->GetProbeAsString(), "Linear");
  EXPECT_STREQ(source->GetSceneAsString(), "Organ");
  std::ostringstream text;
  source->Print(text);
  for (const char* name : {"Probe",
                           "Scene",
                           "Seed",
                           "NumberOfFrames",
                           "FrameSize",
                           "PixelSize",
                           "ProbeRadius",
                           "HalfAngle",
                           "Frequency",
                           "AxialSigma",
                           "LateralSigma",
                           "ElevationSigma",
                           "ScattererDensity",
                           "Attenuation",
                           "DynamicRange",
                           "WhiteLevel",
                           "FrameSpacing",
                           "SpeedVariation",
                           "Tilt",
                           "Wander",
                           "SweepAngle",
                           "Shake",
                           "ShakeRotation",
                           "ShakeCorrelation",
                           "FrameRate",
                           "TrackingNoise",
                           "TrackingRotationNoise",
                           "Passes",
                           "DroppedShare",
                           "NoiseCorrelation",
                           "TrackingDrift",
                           "TrackingRotationDrift",
                           "OutlierShare",
                           "OutlierSize",
                           "TrackingDelay",
                           "TrackingQuantum",
                           "TrackingRotationQuantum",
                           "CalibrationShift",
                           "CalibrationRotation"})
  {
    EXPECT_NE(text.str().find(std::string(name) + ": "), std::string::npos) << name;
  }
}

TEST(PhantomSource, EveryOptionReachesTheImages)
{
  const auto make = [](auto&& change)
  {
    auto source = SmallSource();
    source->SetProbeToConvex();
    source->SetNumberOfFrames(3);
    source->SetFrameSize(30, 20);
    source->SetPixelSize(1.5);
    source->SetScattererDensity(2);  // quick
    change(source.Get());
    source->Update();
    return source;
  };
  const auto plain = make([](vtkBigusPhantomSource*) {});
  const auto differs = [&](auto&& change)
  {
    const auto changed = make(change);
    vtkImageData* a = plain->GetOutput();
    vtkImageData* b = changed->GetOutput();
    for (const char* name : {"ImageToReference", "Timestamp"})
    {
      vtkDataArray* p = a->GetFieldData()->GetArray(name);
      vtkDataArray* q = b->GetFieldData()->GetArray(name);
      if (p->GetNumberOfTuples() != q->GetNumberOfTuples() ||
          std::memcmp(p->GetVoidPointer(0), q->GetVoidPointer(0),
                      p->GetNumberOfValues() * static_cast<std::size_t>(p->GetDataTypeSize())) != 0)
      {
        return true;
      }
    }
    return a->GetNumberOfPoints() != b->GetNumberOfPoints() ||
           std::memcmp(a->GetScalarPointer(), b->GetScalarPointer(), a->GetNumberOfPoints()) != 0;
  };
  using Source = vtkBigusPhantomSource;
  EXPECT_FALSE(differs([](Source*) {}));
  EXPECT_TRUE(differs([](Source* s) { s->SetProbeToSector(); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetSceneToSpeckle(); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetSeed(2); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetSeed(9007199254740992); }));  // 2^53, the largest
  EXPECT_TRUE(differs([](Source* s) { s->SetNumberOfFrames(4); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetFrameSize(31, 20); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetPixelSize(0.7); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetProbeRadius(30); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetHalfAngle(20); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetFrequency(4); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetAxialSigma(0.3); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetLateralSigma(0.5); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetElevationSigma(1.2); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetScattererDensity(30); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetAttenuation(0.2); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetDynamicRange(70); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetWhiteLevel(10); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetFrameSpacing(0.9); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetSpeedVariation(0.1); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetTilt(1); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetWander(2); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetSweepAngle(90); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetShake(1); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetShakeRotation(1); }));
  EXPECT_FALSE(differs([](Source* s) { s->SetShakeCorrelation(5); })) << "it does not shake";
  EXPECT_TRUE(differs([](Source* s) { s->SetFrameRate(10); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetTrackingNoise(1); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetTrackingRotationNoise(1); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetPasses(2); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetDroppedShare(0.5); }));
  EXPECT_FALSE(differs([](Source* s) { s->SetNoiseCorrelation(5); })) << "there is no noise";
  const auto noisy = make([](Source* s) { s->SetTrackingNoise(1); });
  const auto slow = make(
      [](Source* s)
      {
        s->SetTrackingNoise(1);
        s->SetNoiseCorrelation(5);
      });
  const auto place = [](Source* s)
  { return s->GetOutput()->GetFieldData()->GetArray("ImageToReference")->GetComponent(1, 3); };
  EXPECT_NE(place(noisy), place(slow));
  EXPECT_TRUE(differs([](Source* s) { s->SetTrackingDrift(1); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetTrackingRotationDrift(1); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetOutlierShare(0.4); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetTrackingDelay(0.1); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetTrackingQuantum(0.5); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetTrackingRotationQuantum(0.5); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetCalibrationShift(0, 0, 1); }));
  EXPECT_TRUE(differs([](Source* s) { s->SetCalibrationRotation(0, 1, 0); }));
}

TEST(PhantomSource, OutputIsASweep)
{
  auto source = SmallSource();
  source->SetProbeToConvex();
  source->SetTrackingNoise(0.5);
  source->UpdateInformation();
  source->Update();
  vtkImageData* output = source->GetOutput();
  int dimensions[3];
  output->GetDimensions(dimensions);
  EXPECT_EQ(dimensions[0], 48);
  EXPECT_EQ(dimensions[1], 40);
  EXPECT_EQ(dimensions[2], 5);
  EXPECT_EQ(output->GetScalarType(), VTK_UNSIGNED_CHAR);
  EXPECT_EQ(output->GetSpacing()[0], 1.0);
  EXPECT_EQ(output->GetOrigin()[2], 0.0);

  const bigus::ImportedSweep imported = bigus::SweepFromImage(output);
  EXPECT_EQ(imported.sweep->NumberOfFrames(), 5);
  EXPECT_TRUE(imported.sweep->mask);
  EXPECT_EQ(imported.sweep->timestamps.size(), 5u);

  // The true poses are the ones whose truth the frames are; the recorded ones are not.
  vtkDataArray* actual = output->GetFieldData()->GetArray("TrueImageToReference");
  vtkDataArray* recorded = output->GetFieldData()->GetArray("ImageToReference");
  ASSERT_TRUE(actual);
  ASSERT_EQ(actual->GetNumberOfComponents(), 16);
  vtkNew<vtkImageData> truth;
  for (int k = 0; k < 5; ++k)
  {
    vtkNew<vtkMatrix4x4> pose;
    pose->DeepCopy(actual->GetTuple(k));
    ASSERT_TRUE(source->ComputeTruth(pose, 48, 40, truth));
    EXPECT_EQ(std::memcmp(truth->GetScalarPointer(), output->GetScalarPointer(0, 0, k), 48 * 40), 0);
    EXPECT_EQ(bigus::SweepFromImage(truth).sweep->NumberOfFrames(), 1);
    pose->DeepCopy(recorded->GetTuple(k));
    ASSERT_TRUE(source->ComputeTruth(pose, 48, 40, truth));
    EXPECT_NE(std::memcmp(truth->GetScalarPointer(), output->GetScalarPointer(0, 0, k), 48 * 40), 0);
  }
}

TEST(PhantomSource, OptionOutOfRangeIsOneErrorThatNamesIt)
{
  auto source = SmallSource();
  source->Update();  // an earlier output must not survive the error
  source->SetElevationSigma(-1);
  bigus::test::ExpectOneError(source, {"elevationSigma", "-1", "0.05"});
  source->SetElevationSigma(1);
  source->Update();
  EXPECT_EQ(source->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
  EXPECT_EQ(source->GetOutput()->GetNumberOfPoints(), 48 * 40 * 5);
}

TEST(PhantomSource, TruthAtAPlaneNoProbeCouldSeeIsAnError)
{
  auto source = SmallSource();
  const bigus::test::ErrorObserver errors(source);
  vtkNew<vtkMatrix4x4> pose;
  vtkNew<vtkImageData> truth;
  pose->Zero();
  EXPECT_FALSE(source->ComputeTruth(pose, 10, 10, truth));
  EXPECT_EQ(errors.Errors().size(), 1u);
  EXPECT_FALSE(source->ComputeTruth(nullptr, 10, 10, truth));
  EXPECT_EQ(errors.Errors().size(), 2u);
  pose->Identity();
  EXPECT_FALSE(source->ComputeTruth(pose, 1000000, 1000000, truth));
  EXPECT_EQ(errors.Errors().size(), 3u);
  EXPECT_EQ(truth->GetNumberOfPoints(), 0);
  EXPECT_TRUE(source->ComputeTruth(pose, 10, 10, truth));
  EXPECT_EQ(source->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
}

TEST(PhantomSource, AbortLeavesAnEmptyOutput)
{
  auto source = SmallSource();
  vtkNew<vtkCallbackCommand> abort;
  abort->SetCallback([](vtkObject* caller, unsigned long, void*, void*)
                     { static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1); });
  source->AddObserver(vtkCommand::ProgressEvent, abort);
  source->Update();
  EXPECT_EQ(source->GetOutput()->GetNumberOfPoints(), 0);
}

}  // namespace
