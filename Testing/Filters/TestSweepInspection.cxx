// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <utility>

#include "FilterTestSupport.h"
#include "Support/OutputWindow.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusPoseCorrection.h"
#include "vtkBigusSweepInspection.h"
#include "vtkBigusTrainer.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkTable.h"
#include "vtkUnsignedShortArray.h"
#include "vtkVariant.h"

namespace
{

using bigus::test::ExpectOneError;

/// A phantom's sweep whose frames 4 and 5 are black, and frame 1 has no pose.
vtkSmartPointer<vtkImageData> Damaged()
{
  vtkNew<vtkBigusPhantomSource> phantom;
  phantom->SetNumberOfFrames(16);
  phantom->SetFrameSize(48, 40);
  phantom->SetPixelSize(0.6);
  phantom->SetScattererDensity(8);  // quick
  phantom->Update();
  vtkSmartPointer<vtkImageData> sweep = phantom->GetOutput();
  auto* pixels = static_cast<unsigned char*>(sweep->GetScalarPointer());
  std::fill_n(pixels + 4 * 48 * 40, 2 * 48 * 40, static_cast<unsigned char>(0));
  vtkNew<vtkIntArray> status;
  status->SetName("Status");
  status->SetNumberOfValues(16);
  status->FillValue(1);
  status->SetValue(1, 0);
  sweep->GetFieldData()->AddArray(status);
  return sweep;
}

TEST(SweepInspection, TellsWhatTheTrainerLeavesOutByTheImagesNumbers)
{
  const vtkSmartPointer<vtkImageData> sweep = Damaged();
  vtkNew<vtkBigusSweepInspection> inspection;
  inspection->SetInputData(sweep);
  inspection->Update();
  vtkTable* findings = inspection->GetFindings();
  ASSERT_EQ(findings->GetNumberOfRows(), 1);
  EXPECT_EQ(findings->GetValueByName(0, "Kind").ToString(), "contact");
  EXPECT_EQ(findings->GetValueByName(0, "Frames").ToInt(), 2);
  EXPECT_EQ(findings->GetValueByName(0, "Applied").ToInt(), 1);
  EXPECT_NE(findings->GetValueByName(0, "Text").ToString().find("2 frames (4-5)"), std::string::npos);
  vtkDataArray* reasons = inspection->GetOutput()->GetFieldData()->GetArray("Finding");
  for (int frame = 0; frame < 16; ++frame)
  {
    EXPECT_EQ(reasons->GetTuple1(frame), frame == 4 || frame == 5 ? 2 : 0) << frame;
  }
  EXPECT_EQ(inspection->GetOutput()->GetScalarPointer(), sweep->GetScalarPointer());

  vtkNew<vtkBigusTrainer> trainer;
  trainer->SetInputConnection(inspection->GetOutputPort());
  trainer->SetAutomatic(0);
  trainer->SetGaussians(50);
  trainer->SetIterations(1);
  trainer->Update();
  const std::vector<int> expected = {0, 2, 3, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  vtkIntArray* frames = trainer->GetTrainingFrames();
  EXPECT_EQ(std::vector<int>(frames->GetPointer(0), frames->GetPointer(0) + frames->GetNumberOfValues()), expected);
}

/// The same without damage, whose poses are changed: [frame](matrix, row by row).
vtkSmartPointer<vtkImageData> WithPoses(const std::function<void(int, double*)>& change)
{
  const vtkSmartPointer<vtkImageData> sweep = Damaged();
  sweep->GetFieldData()->RemoveArray("Status");
  vtkDataArray* poses = sweep->GetFieldData()->GetArray("ImageToReference");
  for (int frame = 0; frame < 16; ++frame)
  {
    double pose[16];
    poses->GetTuple(frame, pose);
    change(frame, pose);
    poses->SetTuple(frame, pose);
  }
  return sweep;
}

/// The same without damage, 12 of 16 bits used, as a frame grabber hands them on.
vtkSmartPointer<vtkImageData> OfTwelveBits()
{
  const vtkSmartPointer<vtkImageData> sweep = WithPoses([](int, double*) {});
  vtkDataArray* bytes = sweep->GetPointData()->GetScalars();
  vtkNew<vtkUnsignedShortArray> pixels;
  for (vtkIdType pixel = 0; pixel < bytes->GetNumberOfTuples(); ++pixel)
  {
    pixels->InsertNextValue(static_cast<unsigned short>(16 * bytes->GetTuple1(pixel)));
  }
  sweep->GetPointData()->SetScalars(pixels);
  return sweep;
}

TEST(SweepInspection, FindingsComeToTheOutputWindow)
{
  const vtkSmartPointer<vtkImageData> metres = WithPoses(
      [](int, double* pose) { std::transform(pose, pose + 12, pose, [](double value) { return value / 1000; }); });
  const vtkSmartPointer<vtkImageData> coplanar = WithPoses(
      [](int frame, double* pose)  // the probe is pushed along its rows
      {
        const double axes[] = {0.6, 0, 0, 0.5 * frame, 0, 0.6, 0, 0, 0, 0, 1, 0};
        std::copy_n(axes, 12, pose);
      });
  for (const auto& [sweep, said] : {std::pair(Damaged(), "off the skin: 2 frames (4-5)"),
                                    {metres, "matrices must be in millimetres, not in metres"},
                                    {coplanar, "All frames lie in one plane"},
                                    {OfTwelveBits(), "pixels may have fewer bits than their type"}})
  {
    bigus::test::OutputWindow window;
    vtkNew<vtkBigusTrainer> trainer;
    trainer->SetInputData(sweep);
    trainer->SetAutomatic(0);
    trainer->SetGaussians(50);
    trainer->SetIterations(1);
    trainer->Update();
    EXPECT_NE(window.Take().find(said), std::string::npos) << said;
    vtkNew<vtkBigusPoseCorrection> poses;
    poses->SetInputData(sweep);
    poses->SetStrength(0);
    poses->Update();
    const std::string text = window.Take();
    EXPECT_NE(text.find(said), std::string::npos) << said;
    EXPECT_NE(text.find("Nothing was done"), std::string::npos) << text;
  }
}

TEST(SweepInspection, KeptKindsAreToldAndLeft)
{
  vtkNew<vtkBigusSweepInspection> inspection;
  inspection->SetInputData(Damaged());
  inspection->SetKeep("contact");
  inspection->Update();
  ASSERT_EQ(inspection->GetFindings()->GetNumberOfRows(), 1);
  EXPECT_EQ(inspection->GetFindings()->GetValueByName(0, "Applied").ToInt(), 0);
  EXPECT_EQ(inspection->GetOutput()->GetFieldData()->GetArray("Finding")->GetRange()[1], 0);
}

TEST(SweepInspection, MistakesAreNamed)
{
  vtkNew<vtkBigusSweepInspection> inspection;
  inspection->SetInputData(Damaged());
  inspection->SetKeep("dust");
  ExpectOneError(inspection, {"'dust'", "contact"});
  const vtkSmartPointer<vtkImageData> bare = Damaged();
  bare->GetFieldData()->RemoveArray("ImageToReference");
  inspection->SetKeep("none");
  inspection->SetInputData(bare);
  ExpectOneError(inspection, {"ImageToReference", "missing"});
}

}  // namespace
