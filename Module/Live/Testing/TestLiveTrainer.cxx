// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusLiveTrainer: frames in, slices and a field out; how it learns is tested with Core.

#include <chrono>
#include <limits>
#include <sstream>
#include <thread>

#include "Core/Evaluation/Evaluation.h"
#include "Core/Metrics/Metrics.h"
#include "Filters/FilterTestSupport.h"
#include "vtkBigusLiveTrainer.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusReslice.h"
#include "vtkCallbackCommand.h"
#include "vtkExtractVOI.h"
#include "vtkFieldData.h"
#include "vtkImageShiftScale.h"
#include "vtkInformation.h"
#include "vtkStreamingDemandDrivenPipeline.h"

namespace bigus::test
{
namespace
{

vtkSmartPointer<vtkImageData> PhantomSweep(int frames = 24)
{
  vtkNew<vtkBigusPhantomSource> source;
  source->SetNumberOfFrames(frames);
  source->SetFrameSize(96, 80);
  source->SetPixelSize(0.3);
  source->SetScattererDensity(8);  // quick
  source->Update();
  return source->GetOutput();
}

vtkNew<vtkMatrix4x4> PoseOf(vtkImageData* sweep, int frame)
{
  vtkNew<vtkMatrix4x4> pose;
  sweep->GetFieldData()->GetArray("ImageToReference")->GetTuple(frame, pose->GetData());
  return pose;
}

/// Frame `frame` as an image of its own.
vtkSmartPointer<vtkImageData> FrameOf(vtkImageData* sweep, int frame)
{
  vtkNew<vtkExtractVOI> one;
  one->SetInputData(sweep);
  one->SetVOI(0, 95, 0, 79, frame, frame);
  one->Update();
  return one->GetOutput();
}

TEST(LiveTrainer, FollowsFramesServesSlicesAndFinishes)
{
  const auto sweep = PhantomSweep();
  vtkNew<vtkBigusLiveTrainer> live;
  live->SetEngine("cpu");
  live->Update();
  EXPECT_EQ(live->GetOutput()->GetNumberOfPoints(), 0);  // no frame yet, and no error
  for (int frame = 0; frame < 24; ++frame)
  {
    ASSERT_TRUE(live->AddFrame(FrameOf(sweep, frame), PoseOf(sweep, frame), 0.05 * frame));
    vtkNew<vtkImageData> slice;
    ASSERT_TRUE(live->RenderSlice(PoseOf(sweep, frame), 96, 80, slice));
    EXPECT_EQ(slice->GetNumberOfPoints(), 96 * 80);
  }
  while (live->GetNumberOfWaitingFrames() > 0 || live->GetNumberOfSteps() < 200)
  {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(live->GetNumberOfFrames(), 24);
  EXPECT_EQ(live->GetNumberOfDroppedFrames() + live->GetNumberOfRefusedFrames() + live->GetNumberOfPassedOverFrames(),
            0);
  live->Modified();
  live->Update();
  const GaussianField soFar = FieldFromPolyData(live->GetOutput());
  EXPECT_GT(soFar.Size(), 1000u);
  const std::shared_ptr<const Sweep> truth = SweepFromImage(sweep).sweep;
  const std::vector<int> some = {3, 12, 20};
  const double before = ScoreField(soFar, *truth, some, "reference").psnr;
  EXPECT_GT(before, 15);

  live->SetFinishTime(60);  // ends when all its steps are taken, which is sooner unless the machine is very busy
  live->Update();
  const GaussianField finished = FieldFromPolyData(live->GetOutput());
  EXPECT_GT(ScoreField(finished, *truth, some, "reference").psnr, before);
  const std::vector<std::string> provenance = ProvenanceOf(live->GetOutput());
  EXPECT_NE(std::find(provenance.begin(), provenance.end(), "filter=vtkBigusLiveTrainer"), provenance.end());

  // A slice that is served is the one that the reslice filter makes of the field.
  vtkNew<vtkImageData> served;
  ASSERT_TRUE(live->RenderSlice(PoseOf(sweep, 12), 96, 80, served));
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputData(live->GetOutput());
  reslice->SetOutputToFrame(PoseOf(sweep, 12), 96, 80);
  reslice->Update();
  vtkImageData* resliced = reslice->GetOutput();
  EXPECT_GT(
      Psnr(static_cast<float*>(served->GetScalarPointer()), static_cast<float*>(resliced->GetScalarPointer()), 96 * 80),
      50);
  for (const int pixel : {0, 95, 96 * 80 - 1})
  {
    double a[3], b[3];
    served->GetPoint(pixel, a);
    const int i = pixel % 96, j = pixel / 96;
    const vtkNew<vtkMatrix4x4> pose = PoseOf(sweep, 12);
    for (int axis = 0; axis < 3; ++axis)
    {
      b[axis] = pose->GetElement(axis, 0) * i + pose->GetElement(axis, 1) * j + pose->GetElement(axis, 3);
      EXPECT_NEAR(a[axis], b[axis], 1e-9);
    }
  }
}

TEST(LiveTrainer, ASweepAtOnceLosesNoFrame)
{
  const auto sweep = PhantomSweep(90);
  vtkNew<vtkBigusLiveTrainer> live;
  live->SetEngine("cpu");
  ASSERT_TRUE(live->AddSweep(sweep));
  EXPECT_EQ(live->GetNumberOfFrames(), 90);
  EXPECT_EQ(live->GetNumberOfDroppedFrames(), 0);
  ASSERT_TRUE(live->AddSweep(sweep));  // its times are over
  EXPECT_EQ(live->GetNumberOfPassedOverFrames(), 90);
  live->Reset();
  EXPECT_EQ(live->GetNumberOfFrames(), 0);
  live->Update();
  EXPECT_EQ(live->GetOutput()->GetNumberOfPoints(), 0);
}

TEST(LiveTrainer, ACroppedFrameKeepsItsPlace)
{
  const auto sweep = PhantomSweep();
  vtkNew<vtkBigusLiveTrainer> whole, cropped;
  for (int frame = 0; frame < 24; ++frame)
  {
    vtkNew<vtkExtractVOI> part;
    part->SetInputData(sweep);
    part->SetVOI(20, 90, 10, 70, frame, frame);
    part->Update();
    whole->AddFrame(FrameOf(sweep, frame), PoseOf(sweep, frame), frame);
    cropped->AddFrame(part->GetOutput(), PoseOf(sweep, frame), frame);
  }
  vtkNew<vtkImageData> a, b;
  for (auto& live : {&whole, &cropped})
  {
    (*live)->SetFinishTime(60);  // ends when all its steps are taken
    (*live)->Update();
  }
  // The middle of frame 12 looks alike in both; shifted by 20 pixels it would not.
  ASSERT_TRUE(whole->RenderSlice(PoseOf(sweep, 12), 96, 80, a));
  ASSERT_TRUE(cropped->RenderSlice(PoseOf(sweep, 12), 96, 80, b));
  double same = 0, shifted = 0;
  for (int j = 20; j < 60; ++j)
  {
    for (int i = 30; i < 60; ++i)
    {
      const double here = a->GetScalarComponentAsDouble(i, j, 0, 0);
      same += std::abs(here - b->GetScalarComponentAsDouble(i, j, 0, 0));
      shifted += std::abs(here - b->GetScalarComponentAsDouble(i + 20, j + 10, 0, 0));
    }
  }
  EXPECT_LT(same, 0.5 * shifted);
}

TEST(LiveTrainer, WhatIsNoFrameIsOneError)
{
  const auto sweep = PhantomSweep();
  vtkNew<vtkBigusLiveTrainer> live;
  ErrorObserver errors(live);
  EXPECT_FALSE(live->AddFrame(nullptr, PoseOf(sweep, 0), 0));
  EXPECT_FALSE(live->AddFrame(FrameOf(sweep, 0), nullptr, 0));
  EXPECT_FALSE(live->AddFrame(sweep, PoseOf(sweep, 0), 0));  // 24 slices
  vtkNew<vtkImageShiftScale> floats;
  floats->SetInputData(FrameOf(sweep, 0));
  floats->SetOutputScalarTypeToFloat();
  floats->Update();
  EXPECT_FALSE(live->AddFrame(floats->GetOutput(), PoseOf(sweep, 0), 0));
  vtkNew<vtkImageData> slice;
  EXPECT_FALSE(live->RenderSlice(PoseOf(sweep, 0), 0, 80, slice));
  EXPECT_FALSE(live->RenderSlice(PoseOf(sweep, 0), 96, 80, nullptr));
  EXPECT_FALSE(live->RenderSlice(nullptr, 96, 80, slice));
  EXPECT_EQ(errors.Errors().size(), 7u);

  // What only the session's thread sees is counted.
  vtkNew<vtkMatrix4x4> nowhere;
  nowhere->SetElement(0, 3, std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(live->AddFrame(FrameOf(sweep, 0), nowhere, 0));
  while (live->GetNumberOfRefusedFrames() == 0)
  {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_NE(std::string(live->GetLastRefusal()).find("live frame"), std::string::npos);

  live->SetFinishTime(1);
  live->Update();
  EXPECT_EQ(errors.Errors().size(), 8u);  // there is no field to finish
  vtkNew<vtkBigusLiveTrainer> unknown;
  ErrorObserver unknownErrors(unknown);
  unknown->SetEngine("abacus");
  EXPECT_FALSE(unknown->AddFrame(FrameOf(sweep, 0), PoseOf(sweep, 0), 0));
  EXPECT_EQ(unknownErrors.Errors().size(), 1u);
  std::ostringstream text;
  live->Print(text);
  EXPECT_NE(text.str().find("MaximumGaussians: 1000000"), std::string::npos);

  // A window of frames of 96 x 80 pixels takes 96 * 80 * (4 * 128 + 64) bytes, 4.4 MB.
  vtkNew<vtkBigusLiveTrainer> small;
  small->SetMemoryLimit(0.001);
  EXPECT_TRUE(small->AddFrame(FrameOf(sweep, 0), PoseOf(sweep, 0), 0));
  while (small->GetNumberOfRefusedFrames() == 0)
  {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_NE(std::string(small->GetLastRefusal()).find("MB that pictures may take"), std::string::npos)
      << small->GetLastRefusal();
}

TEST(LiveTrainer, AConnectedSweepIsHandedOverUpToTheTimeAskedFor)
{
  const auto sweep = PhantomSweep();
  const auto time = [&](int frame) { return sweep->GetFieldData()->GetArray("Timestamp")->GetTuple1(frame); };
  const auto isFinished = [](vtkBigusLiveTrainer* live)
  {
    const std::vector<std::string> provenance = ProvenanceOf(live->GetOutput());
    return std::find(provenance.begin(), provenance.end(), "filter=vtkBigusLiveTrainer") != provenance.end();
  };
  vtkNew<vtkBigusLiveTrainer> live;
  ErrorObserver errors(live);
  live->SetEngine("cpu");
  live->SetFinishTime(60);  // ends when all its steps are taken
  live->SetInputData(sweep);
  live->UpdateInformation();
  vtkInformation* info = live->GetOutputInformation(0);
  ASSERT_EQ(info->Length(vtkStreamingDemandDrivenPipeline::TIME_STEPS()), 24);
  EXPECT_EQ(info->Get(vtkStreamingDemandDrivenPipeline::TIME_STEPS())[23], time(23));

  live->UpdateTimeStep(time(11));
  EXPECT_EQ(live->GetNumberOfFrames(), 12);
  EXPECT_FALSE(isFinished(live));
  EXPECT_GT(live->GetOutput()->GetNumberOfPoints(), 0);
  live->UpdateTimeStep(time(23));  // goes on
  EXPECT_EQ(live->GetNumberOfFrames(), 24);
  EXPECT_EQ(live->GetNumberOfPassedOverFrames(), 0);
  EXPECT_TRUE(isFinished(live));
  live->UpdateTimeStep(time(9));  // begins anew
  EXPECT_EQ(live->GetNumberOfFrames(), 10);
  EXPECT_FALSE(isFinished(live));
  EXPECT_TRUE(errors.Errors().empty());

  live->SetEngine("abacus");  // a changed option begins anew, too
  live->UpdateTimeStep(time(9));
  EXPECT_EQ(errors.Errors().size(), 1u);
  live->SetEngine("cpu");
  live->UpdateTimeStep(time(9));
  EXPECT_EQ(live->GetNumberOfFrames(), 10);
  EXPECT_EQ(errors.Errors().size(), 1u);

  vtkNew<vtkBigusLiveTrainer> whole;
  whole->SetEngine("cpu");
  whole->SetInputData(sweep);
  whole->Update();  // no time is asked for
  EXPECT_EQ(whole->GetNumberOfFrames(), 24);

  vtkNew<vtkImageData> none;
  none->SetDimensions(4, 4, 2);
  none->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  vtkNew<vtkBigusLiveTrainer> broken;
  ErrorObserver brokenErrors(broken);
  broken->SetInputData(none);
  broken->Update();
  ASSERT_EQ(brokenErrors.Errors().size(), 1u);
  EXPECT_NE(brokenErrors.Errors()[0].find("ImageToReference"), std::string::npos);
}

TEST(LiveTrainer, AnAbortEndsTheFinish)
{
  const auto sweep = PhantomSweep();
  vtkNew<vtkBigusLiveTrainer> live;
  ASSERT_TRUE(live->AddSweep(sweep));
  vtkNew<vtkCallbackCommand> stop;
  stop->SetCallback([](vtkObject* caller, unsigned long, void*, void*)
                    { static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1); });
  live->AddObserver(vtkCommand::ProgressEvent, stop);
  live->SetFinishTime(600);
  const auto start = std::chrono::steady_clock::now();
  live->Update();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
  EXPECT_GT(live->GetOutput()->GetNumberOfPoints(), 0);
}

}  // namespace
}  // namespace bigus::test
