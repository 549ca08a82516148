// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusFieldLabeler, and the labels that vtkBigusReslice and vtkBigusVoxelizer show of its field.
#include <algorithm>
#include <string>
#include <vector>

#include "Core/Labels/Labels.h"
#include "Data/LabelData.h"
#include "Filters/FilterTestSupport.h"
#include "vtkBigusFieldLabeler.h"
#include "vtkBigusReslice.h"
#include "vtkBigusTransformField.h"
#include "vtkBigusVoxelizer.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkIntArray.h"
#include "vtkTransform.h"

namespace bigus::test
{
namespace
{

constexpr int kSize = 41, kFrames = 9;

/// Dark frames of half a millimetre a pixel, 2.5 mm apart across the box of RandomField; SourceFrame begins at 3.
vtkSmartPointer<vtkImageData> DarkSweep()
{
  const auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(kSize, kSize, kFrames);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  image->GetPointData()->GetScalars()->Fill(0);
  vtkNew<vtkDoubleArray> poses;
  poses->SetName("ImageToReference");
  poses->SetNumberOfComponents(16);
  vtkNew<vtkIntArray> source;
  source->SetName("SourceFrame");
  for (int k = 0; k < kFrames; ++k)
  {
    const double pose[16] = {0.5, 0, 0, -10, 0, 0.5, 0, -10, 0, 0, 1, 2.5 * k - 10, 0, 0, 0, 1};
    poses->InsertNextTuple(pose);
    source->InsertNextValue(k + 3);
  }
  image->GetFieldData()->AddArray(poses);
  image->GetFieldData()->AddArray(source);
  return image;
}

/// 5 left of x = 0 and 9 right of it, of so many frames from SourceFrame 3 on.
vtkSmartPointer<vtkImageData> Halves(int frames = kFrames)
{
  const auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(kSize, kSize, frames);
  image->AllocateScalars(VTK_SHORT, 1);
  for (vtkIdType p = 0; p < image->GetNumberOfPoints(); ++p)
  {
    image->GetPointData()->GetScalars()->SetTuple1(p, p % kSize < kSize / 2 ? 5 : 9);
  }
  ReplaceLabelNames(image, {{5, "left", {0, 0, 1}}});
  vtkNew<vtkIntArray> source;
  source->SetName("SourceFrame");
  for (int k = 0; k < frames; ++k)
  {
    source->InsertNextValue(k + 3);
  }
  image->GetFieldData()->AddArray(source);
  return image;
}

vtkSmartPointer<vtkBigusFieldLabeler> Labeler(vtkImageData* labels)
{
  const auto labeler = vtkSmartPointer<vtkBigusFieldLabeler>::New();
  labeler->SetInputDataObject(0, ToPolyData(RandomField(300, 5)));
  labeler->SetInputDataObject(1, DarkSweep());
  labeler->SetInputDataObject(2, labels);
  return labeler;
}

vtkSmartPointer<vtkBigusReslice> Across(vtkPolyData* field)
{
  const auto reslice = vtkSmartPointer<vtkBigusReslice>::New();
  reslice->SetInputData(field);
  reslice->SetResliceAxes(ToVtk(RigidMatrix(RandomRotation(8), {0.5, -1, 0.5})));
  reslice->SetOutputSpacing(0.4, 0.4, 1.5);
  reslice->SetOutputOrigin(-7, -6, -1);
  reslice->SetOutputExtent(0, 34, 0, 29, 0, 1);
  reslice->GenerateLabelOutputOn();
  return reslice;
}

TEST(FieldLabeler, GivesLabelsThatEveryPlaneShows)
{
  const auto labeler = Labeler(Halves());
  labeler->Update();
  const auto labels = LabelsFromPolyData(labeler->GetOutput());
  ASSERT_TRUE(labels);
  ASSERT_EQ(labels->labels.size(), 2u);
  EXPECT_EQ(labels->labels[0].name, "left");
  EXPECT_EQ(labels->labels[1].name, "Label 9");

  const auto reslice = Across(labeler->GetOutput());
  reslice->Update();
  vtkImageData* map = reslice->GetLabelOutput();
  ASSERT_EQ(map->GetNumberOfPoints(), 35 * 30 * 2);
  EXPECT_EQ(LabelNamesOf(map)[0].color[2], 1);
  int wrong = 0;
  for (vtkIdType p = 0; p < map->GetNumberOfPoints(); ++p)
  {
    double place[4] = {0, 0, 0, 1}, world[4];
    map->GetPoint(p, place);
    reslice->GetResliceAxes()->MultiplyPoint(place, world);
    const double value = map->GetPointData()->GetScalars()->GetTuple1(p);
    // Gaussians of up to 2.5 mm have a border that soft.
    wrong += std::abs(world[0]) > 2.5 && value != (world[0] < 0 ? 5 : 9);
  }
  EXPECT_LT(wrong, 0.01 * map->GetNumberOfPoints());
}

TEST(FieldLabeler, LabelsOfPartsAreThoseOfTheWhole)
{
  const auto labeler = Labeler(Halves());
  labeler->Update();
  const auto whole = Across(labeler->GetOutput()), parts = Across(labeler->GetOutput());
  whole->Update();
  const int part[6] = {3, 20, 7, 19, 1, 1};
  parts->UpdateInformation();
  parts->UpdateExtent(part);
  for (int j = part[2]; j <= part[3]; ++j)
  {
    for (int i = part[0]; i <= part[1]; ++i)
    {
      ASSERT_EQ(*static_cast<unsigned char*>(parts->GetLabelOutput()->GetScalarPointer(i, j, 1)),
                *static_cast<unsigned char*>(whole->GetLabelOutput()->GetScalarPointer(i, j, 1)));
    }
  }
}

TEST(FieldLabeler, LeavesSlicesAndWhatElseTheFieldKnowsAsTheyAre)
{
  const auto labeler = Labeler(Halves());
  labeler->Update();
  const auto plain = Across(ToPolyData(RandomField(300, 5))), labelled = Across(labeler->GetOutput());
  plain->GenerateLabelOutputOff();
  plain->Update();
  labelled->Update();
  ASSERT_EQ(plain->GetOutput()->GetNumberOfPoints(), labelled->GetOutput()->GetNumberOfPoints());
  for (vtkIdType p = 0; p < plain->GetOutput()->GetNumberOfPoints(); ++p)
  {
    ASSERT_EQ(plain->GetOutput()->GetPointData()->GetScalars()->GetTuple1(p),
              labelled->GetOutput()->GetPointData()->GetScalars()->GetTuple1(p));
  }
  EXPECT_EQ(plain->GetLabelOutput()->GetNumberOfPoints(), 0);
}

TEST(FieldLabeler, VolumesShowSharesAndMovedFieldsKeepLabels)
{
  const auto labeler = Labeler(Halves());
  vtkNew<vtkTransform> turn;
  turn->RotateZ(180);
  vtkNew<vtkBigusTransformField> moved;
  moved->SetInputConnection(labeler->GetOutputPort());
  moved->SetTransform(turn);
  vtkNew<vtkBigusVoxelizer> voxelizer;
  voxelizer->SetInputConnection(moved->GetOutputPort());
  voxelizer->SetOutputOrigin(-8, 0, 0);
  voxelizer->SetOutputSpacing(16, 1, 1);
  voxelizer->SetOutputDimensions(2, 1, 1);
  voxelizer->SetOutputModeToLabelShare();
  voxelizer->SetLabelValue(5);
  voxelizer->Update();
  const auto share = [&](int p) { return voxelizer->GetOutput()->GetPointData()->GetScalars()->GetTuple1(p); };
  EXPECT_LT(share(0), 0.1);  // what lay left lies right
  EXPECT_GT(share(1), 0.9);
}

TEST(FieldLabeler, SharesKeepTheirBitsAndTheFieldComesBackAfterThem)
{
  const auto labeler = Labeler(Halves());
  labeler->Update();
  const auto reslice = Across(labeler->GetOutput());
  const auto pixels = [&]
  {
    reslice->Update();
    auto* values = static_cast<float*>(reslice->GetOutput()->GetScalarPointer());
    return std::vector<float>(values, values + reslice->GetOutput()->GetNumberOfPoints());
  };
  const std::vector<float> intensity = pixels();
  reslice->SetTolerance(0.01);  // what a share may be off by, too
  reslice->SetOutputModeToLabelShare();
  reslice->SetLabelValue(5);
  const std::vector<float> share = pixels();
  reslice->Modified();
  EXPECT_EQ(pixels(), share);
  reslice->SetLabelValue(6);
  ErrorObserver errors(reslice);
  reslice->Update();
  EXPECT_FALSE(errors.Errors().empty());
  reslice->SetTolerance(1e-4);
  reslice->SetOutputModeToIntensity();
  EXPECT_EQ(pixels(), intensity);
}

TEST(FieldLabeler, SaysWhatDoesNotFit)
{
  const auto says = [](vtkAlgorithm* algorithm, const std::string& words)
  {
    ErrorObserver errors(algorithm);
    algorithm->Update();
    ASSERT_FALSE(errors.Errors().empty()) << words;
    EXPECT_NE(errors.Errors().front().find(words), std::string::npos) << errors.Errors().front();
  };
  const auto small = Halves();
  small->SetDimensions(kSize, kSize - 1, kFrames);
  small->AllocateScalars(VTK_SHORT, 1);
  says(Labeler(small), "41 x 40");
  const auto large = Halves();
  large->GetPointData()->GetScalars()->SetTuple1(0, 300);
  says(Labeler(large), "300");
  const auto elsewhere = Halves();
  elsewhere->GetFieldData()->GetArray("SourceFrame")->Fill(77);
  elsewhere->GetFieldData()->GetArray("SourceFrame")->SetTuple1(0, 3);
  const auto one = Labeler(elsewhere);
  one->Update();
  const auto first = Labeler(Halves(1));
  first->Update();
  EXPECT_EQ(LabelsFromPolyData(one->GetOutput())->weights, LabelsFromPolyData(first->GetOutput())->weights);
  says(Across(ToPolyData(RandomField(20, 5))), "no labels");
  const auto voxelizer = vtkSmartPointer<vtkBigusVoxelizer>::New();
  voxelizer->SetInputDataObject(0, ToPolyData(RandomField(20, 5)));
  voxelizer->SetOutputModeToLabelShare();
  says(voxelizer, "LabelValue");
}

}  // namespace
}  // namespace bigus::test
