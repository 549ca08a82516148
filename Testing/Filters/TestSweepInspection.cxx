// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>

#include "FilterTestSupport.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusSweepInspection.h"
#include "vtkBigusTrainer.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkTable.h"
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
