// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusTrainer on several processes of MPI: as good a field as one process trains, the same in all of them, and errors
// that all hear of. What is trained is tested with Core.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Trainer/Trainer.h"
#include "Data/FieldData.h"
#include "Data/SweepData.h"
#include "Groups.h"
#include "Support/ErrorObserver.h"
#include "Support/Psnr.h"
#include "Support/Sweeps.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusTrainer.h"
#include "vtkCallbackCommand.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkIntArray.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkStringArray.h"

namespace bigus::test
{
namespace
{

vtkSmartPointer<vtkImageData> ImageOf(const Sweep& sweep)
{
  const auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(sweep.width, sweep.height, sweep.NumberOfFrames());
  image->AllocateScalars(VTK_FLOAT, 1);
  std::memcpy(image->GetScalarPointer(), sweep.pixels.get(),
              sizeof(float) * sweep.PixelsPerFrame() * sweep.imageToReference.size());
  vtkNew<vtkDoubleArray> poses;
  poses->SetName("ImageToReference");
  poses->SetNumberOfComponents(16);
  for (const Eigen::Matrix4d& pose : sweep.imageToReference)
  {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = pose;
    poses->InsertNextTypedTuple(rows.data());
  }
  image->GetFieldData()->AddArray(poses);
  return image;
}

/// Takes a moment; l2 in double for what TestPartEngine says.
struct Quick
{
  std::shared_ptr<Sweep> sweep = RenderedSweep();
  vtkSmartPointer<vtkImageData> image = ImageOf(*sweep);
  vtkNew<vtkBigusTrainer> trainer;

  explicit Quick(vtkMultiProcessController* controller)
  {
    trainer->SetController(controller);
    trainer->SetInputData(image);
    trainer->AutomaticOff();
    trainer->SetEngine("cpu-double");
    trainer->SetLoss("l2");
    trainer->SetGaussians(1500);
    trainer->SetIterations(30);
    trainer->SetHoldOut(6);
  }

  GaussianField Train()
  {
    trainer->Update();
    EXPECT_EQ(trainer->GetErrorCode(), vtkErrorCode::NoError);
    return FieldFromPolyData(trainer->GetOutput());
  }

  double HeldOutPsnr(const GaussianField& field)
  {
    std::vector<int> frames;
    for (vtkIdType k = 0; k < trainer->GetHeldOutFrames()->GetNumberOfValues(); ++k)
    {
      frames.push_back(trainer->GetHeldOutFrames()->GetValue(k));
    }
    return PsnrOn(field, *sweep, frames, "cpu");
  }
};

/// The sum of all numbers of a field: equal in all processes where their fields are.
double SumOf(const GaussianField& field)
{
  double sum = 0;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    sum += field.means[i].sum() + field.scales[i].sum() + field.rotations[i].sum() + field.reflectivities[i];
  }
  return sum;
}

TEST(Training, GivesAFieldAsGoodInEveryProcess)
{
  Quick alone(nullptr);
  const GaussianField single = alone.Train();
  const double truth = alone.HeldOutPsnr(single);
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        Quick together(controller);
        const GaussianField field = together.Train();
        EXPECT_NEAR(together.HeldOutPsnr(field), truth, 0.01);
        EXPECT_TRUE(SameField(Quick(controller).Train(), field));  // the same bits again
        const int processes = controller->GetNumberOfProcesses();
        if (processes == 1)
        {
          EXPECT_TRUE(SameField(field, single));
          EXPECT_EQ(together.trainer->GetSentBytes(), 0);
          return;
        }
        const double mine = SumOf(field);
        double least = 0, most = 0;
        controller->AllReduce(&mine, &least, 1, vtkCommunicator::MIN_OP);
        controller->AllReduce(&mine, &most, 1, vtkCommunicator::MAX_OP);
        EXPECT_EQ(least, most);
        // Pictures of the 20 frames' batches of 8, 2 (1 - 1 / n) times each, in double; the rest are a few fields.
        const double pictures = 30.0 * 8 * 48 * 40 * 8 * 2 * (processes - 1) / processes;
        EXPECT_GT(together.trainer->GetSentBytes(), pictures);
        EXPECT_LT(together.trainer->GetSentBytes(), 1.5 * pictures);
        EXPECT_NE(std::string(together.trainer->GetDevice()).find(std::to_string(processes) + " processes"),
                  std::string::npos);
      });
}

TEST(Training, MoreProcessesThanGaussians)
{
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        Quick together(controller);
        together.trainer->SetGaussians(2);
        EXPECT_LE(together.Train().Size(), 2u);
      });
}

/// All processes refuse: the last with its own words, the others with its name.
void ExpectRefused(vtkMultiProcessController* controller, vtkBigusTrainer* trainer, const std::string& words)
{
  const int last = controller->GetNumberOfProcesses() - 1;
  const ErrorObserver errors(trainer);
  trainer->Update();
  EXPECT_NE(trainer->GetErrorCode(), vtkErrorCode::NoError);
  EXPECT_NE(errors.Text().find(words), std::string::npos) << errors.Text();
  if (controller->GetLocalProcessId() < last)
  {
    EXPECT_NE(errors.Text().find("Process " + std::to_string(last) + " of"), std::string::npos) << errors.Text();
  }
  EXPECT_EQ(trainer->GetOutput()->GetNumberOfPoints(), 0);
}

TEST(Training, WhatFailsInOneProcessFailsInAll)
{
  WithGroups(
      [](vtkMultiProcessController* controller)
      {
        const bool isLast = controller->GetLocalProcessId() + 1 == controller->GetNumberOfProcesses();
        Quick together(controller);
        together.trainer->SetBatch(isLast ? 0 : 8);  // before anything is exchanged
        ExpectRefused(controller, together.trainer, "batch");
        together.trainer->SetBatch(8);
        together.trainer->SetIterations(5);
        EXPECT_GT(together.Train().Size(), 0u);  // and goes on afterwards
        if (controller->GetNumberOfProcesses() > 1)
        {
          Quick another(controller);
          another.trainer->SetBatch(isLast ? 7 : 8);
          const ErrorObserver errors(another.trainer);
          another.trainer->Update();
          EXPECT_NE(errors.Text().find("same sequence, options"), std::string::npos) << errors.Text();
          EXPECT_NE(errors.Text().find("'batch: 7'"), std::string::npos) << errors.Text();

          vtkNew<vtkBigusSequenceReader> reader;
          reader->SetFileName("/there/is/no/such/sweep.mha");
          const ErrorObserver ignored(reader);
          Quick unread(controller);
          if (isLast)
          {
            unread.trainer->SetInputConnection(reader->GetOutputPort());
          }
          ExpectRefused(controller, unread.trainer, "its sequence could not be read");
          EXPECT_GT(Quick(controller).Train().Size(), 0u);
        }
      });
}

/// Everything that a state holds: Gaussians are added, and validation frames keep the best field.
void AskForEverything(vtkBigusTrainer* trainer)
{
  trainer->SetValidation(5);
  trainer->SetDensificationInterval(4);
  trainer->SetDensificationPercentile(80);
}

TEST(Training, GoesOnFromACheckpointWithTheSameBits)
{
  std::string earlier;  // state of fewer processes
  WithGroups(
      [&](vtkMultiProcessController* controller)
      {
        const int processes = controller->GetNumberOfProcesses();
        const bool isFirst = controller->GetLocalProcessId() == 0;
        Quick whole(controller);
        AskForEverything(whole.trainer);
        const GaussianField truth = whole.Train();
        std::vector<std::string> states;  // after every step
        Quick kept(controller);
        AskForEverything(kept.trainer);
        Checkpoints checkpoints;
        checkpoints.interval = 0;
        checkpoints.save = [&states](const std::string& state) { states.push_back(state); };
        kept.trainer->SetCheckpoints(checkpoints);
        EXPECT_TRUE(SameField(kept.Train(), truth));
        EXPECT_EQ(states.empty(), !isFirst);  // the first process keeps the state of all
        std::string last;
        for (const std::size_t stop : {4, 25})
        {
          Quick resumed(controller);
          AskForEverything(resumed.trainer);
          Checkpoints from;
          from.resume = isFirst ? states.at(stop) : "";
          resumed.trainer->SetCheckpoints(from);
          EXPECT_TRUE(SameField(resumed.Train(), truth)) << stop;
          EXPECT_EQ(resumed.trainer->GetIterationsDone(), whole.trainer->GetIterationsDone());
          last = from.resume;
        }
        if (processes > 1)
        {
          Quick other(controller);
          AskForEverything(other.trainer);
          Checkpoints from;
          from.resume = earlier;
          other.trainer->SetCheckpoints(from);
          const ErrorObserver errors(other.trainer);
          other.trainer->Update();
          EXPECT_NE(errors.Text().find("processes was " + std::to_string(processes - 1) + " and is "),
                    std::string::npos)
              << errors.Text();
          from.resume = last.substr(0, last.size() / 2);
          other.trainer->SetCheckpoints(from);
          other.trainer->Update();
          EXPECT_NE(errors.Text().find("cut off"), std::string::npos) << errors.Text();
        }
        earlier = last;
      });
}

TEST(Training, AllHearOfACheckpointThatCannotBeKept)
{
  WithGroups(
      [](vtkMultiProcessController* controller)
      {
        Quick together(controller);
        Checkpoints checkpoints;
        checkpoints.interval = 0;
        checkpoints.save = [](const std::string&) { throw Error("the disk is full"); };
        together.trainer->SetCheckpoints(checkpoints);
        const ErrorObserver errors(together.trainer);
        together.trainer->Update();
        const bool isFirst = controller->GetLocalProcessId() == 0;
        EXPECT_NE(errors.Text().find(isFirst ? "the disk is full" : "Process 0 of"), std::string::npos)
            << errors.Text();
        together.trainer->SetCheckpoints({});
        EXPECT_GT(together.Train().Size(), 0u);  // and goes on afterwards
      });
}

TEST(Training, AnAbortInOneProcessStopsAll)
{
  WithGroups(
      [](vtkMultiProcessController* controller)
      {
        Quick together(controller);
        together.trainer->SetIterations(100000);
        vtkNew<vtkCallbackCommand> stop;
        stop->SetCallback([](vtkObject* caller, unsigned long, void*, void*)
                          { static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1); });
        if (controller->GetLocalProcessId() + 1 == controller->GetNumberOfProcesses())
        {
          together.trainer->AddObserver(vtkCommand::ProgressEvent, stop);
        }
        together.trainer->Update();
        EXPECT_TRUE(together.trainer->GetAborted());
        EXPECT_LT(together.trainer->GetIterationsDone(), 100000);
      });
}

}  // namespace
}  // namespace bigus::test
