// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sweeps and fields, from VTK to Core and back.

#include "Core/Model/Error.h"
#include "Filters/FilterTestSupport.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkStringArray.h"
#include "vtkUnsignedCharArray.h"

namespace bigus::test
{
namespace
{

void AddArray(vtkFieldData* data, const char* name, int components, int tuples, double value)
{
  vtkNew<vtkDoubleArray> array;
  array->SetName(name);
  array->SetNumberOfComponents(components);
  array->SetNumberOfTuples(tuples);
  array->Fill(value);
  data->AddArray(array);
}

/// Four frames of 6 x 5 pixels, 2 mm apart.
vtkSmartPointer<vtkImageData> Stack(int type = VTK_UNSIGNED_CHAR)
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(6, 5, 4);
  image->AllocateScalars(type, 1);
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  const double top = type == VTK_UNSIGNED_CHAR ? 255 : type == VTK_UNSIGNED_SHORT ? 65535 : 1;
  for (vtkIdType i = 0; i < scalars->GetNumberOfTuples(); ++i)
  {
    scalars->SetTuple1(i, top * (i % 17) / 16);
  }
  AddArray(image->GetFieldData(), "ImageToReference", 16, 4, 0);
  for (int k = 0; k < 4; ++k)
  {
    const double pose[16] = {0.5, 0, 0, 10, 0, 0.25, 0, -3, 0, 0, 1, 2.0 * k, 0, 0, 0, 1};
    image->GetFieldData()->GetArray("ImageToReference")->SetTuple(k, pose);
  }
  return image;
}

std::string ErrorOf(vtkImageData* image)
{
  try
  {
    SweepFromImage(image);
  }
  catch (const Error& error)
  {
    return error.what();
  }
  return "";
}

TEST(Convert, AnEightBitSweepSharesItsPixels)
{
  std::shared_ptr<const Sweep> sweep;
  {
    const auto image = Stack();
    const ImportedSweep imported = SweepFromImage(image);
    EXPECT_EQ(imported.sweep->pixels.get(), image->GetScalarPointer());
    EXPECT_EQ(imported.frames, (std::vector<int>{0, 1, 2, 3}));
    sweep = imported.sweep;
  }
  // The image is gone; its pixels live as long as the sweep.
  std::vector<float> frame(30);
  sweep->CopyFrame(1, frame.data());
  EXPECT_FLOAT_EQ(frame[3], static_cast<float>(std::floor(255.0 * (33 % 17) / 16) / 255));
  EXPECT_EQ(sweep->Plane(2).Point(2, 4), Eigen::Vector3d(11, -2, 4));
}

TEST(Convert, OtherPixelTypesGiveTheSameIntensities)
{
  for (int type : {VTK_UNSIGNED_SHORT, VTK_FLOAT})
  {
    const ImportedSweep imported = SweepFromImage(Stack(type));
    std::vector<float> frame(30);
    imported.sweep->CopyFrame(3, frame.data());
    for (int i = 0; i < 30; ++i)
    {
      EXPECT_NEAR(frame[i], ((90 + i) % 17) / 16.0, 1e-4);
    }
  }
}

TEST(Convert, RejectedFramesAreLeftOut)
{
  const auto image = Stack();
  AddArray(image->GetFieldData(), "Status", 1, 4, 1);
  image->GetFieldData()->GetArray("Status")->SetTuple1(1, 0);
  const ImportedSweep imported = SweepFromImage(image);
  EXPECT_EQ(imported.frames, (std::vector<int>{0, 2, 3}));
  EXPECT_EQ(imported.sweep->NumberOfFrames(), 3);
  EXPECT_EQ(imported.sweep->Plane(1).origin[2], 4);
  std::vector<float> frame(30);
  imported.sweep->CopyFrame(1, frame.data());
  EXPECT_FLOAT_EQ(frame[0], static_cast<float>(std::floor(255.0 * (60 % 17) / 16) / 255));
}

TEST(Convert, ACroppedStackKeepsItsPlace)
{
  const auto image = Stack();
  image->SetExtent(2, 7, -1, 3, 0, 3);  // as a crop of a larger stack would have it
  const ImportedSweep imported = SweepFromImage(image);
  EXPECT_EQ(imported.sweep->Plane(0).Point(0, 0), Eigen::Vector3d(11, -3.25, 0));
}

TEST(Convert, MaskAndTimesComeAlong)
{
  const auto image = Stack();
  AddArray(image->GetFieldData(), "Mask", 1, 30, 1);
  image->GetFieldData()->GetArray("Mask")->SetTuple1(4, 0);
  AddArray(image->GetFieldData(), "Timestamp", 1, 4, 1.5);
  const ImportedSweep imported = SweepFromImage(image);
  EXPECT_FALSE(imported.sweep->IsLit(4));
  EXPECT_TRUE(imported.sweep->IsLit(5));
  EXPECT_EQ(imported.sweep->timestamps, std::vector<double>(4, 1.5));
}

TEST(Convert, ASweepComesBackAsItWent)
{
  for (int type : {VTK_UNSIGNED_CHAR, VTK_FLOAT})
  {
    const auto image = Stack(type);
    AddArray(image->GetFieldData(), "Mask", 1, 30, 1);
    AddArray(image->GetFieldData(), "Timestamp", 1, 4, 1.5);
    vtkNew<vtkImageData> back;
    SweepToImage(*SweepFromImage(image).sweep, back);
    EXPECT_TRUE(SameBits(back, image));
    for (const char* name : {"ImageToReference", "Mask", "Timestamp"})
    {
      vtkDataArray* a = image->GetFieldData()->GetArray(name);
      vtkDataArray* b = back->GetFieldData()->GetArray(name);
      ASSERT_NE(b, nullptr) << name;
      ASSERT_EQ(a->GetNumberOfValues(), b->GetNumberOfValues());
      for (vtkIdType i = 0; i < a->GetNumberOfValues(); ++i)
      {
        EXPECT_EQ(a->GetComponent(i / a->GetNumberOfComponents(), i % a->GetNumberOfComponents()),
                  b->GetComponent(i / a->GetNumberOfComponents(), i % a->GetNumberOfComponents()));
      }
    }
  }
}

TEST(ConvertBadInput, SweepsThatAreNone)
{
  const auto expect = [](vtkImageData* image, const char* part)
  { EXPECT_NE(ErrorOf(image).find(part), std::string::npos) << "'" << ErrorOf(image) << "' lacks " << part; };
  expect(nullptr, "no pixels");
  vtkNew<vtkImageData> nothing;
  expect(nothing, "no pixels");
  nothing->SetDimensions(2, 2, 2);
  expect(nothing, "scalars");
  nothing->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  expect(nothing, "3 components");

  auto image = Stack();
  image->GetFieldData()->RemoveArray("ImageToReference");
  expect(image, "ImageToReference is missing");
  AddArray(image->GetFieldData(), "ImageToReference", 12, 4, 0);
  expect(image, "4 tuples of 12");
  AddArray(image->GetFieldData(), "ImageToReference", 16, 3, 0);
  expect(image, "3 tuples of 16");
  AddArray(image->GetFieldData(), "ImageToReference", 16, 4, 0);
  expect(image, "frame 0");
  vtkNew<vtkStringArray> words;
  words->SetName("ImageToReference");
  words->InsertNextValue("identity");
  image->GetFieldData()->AddArray(words);
  expect(image, "numeric");

  image = Stack();
  image->GetFieldData()->GetArray("ImageToReference")->SetComponent(2, 7, std::nan(""));
  expect(image, "frame 2");
  image = Stack(VTK_SHORT);
  expect(image, "short");
  image = Stack(VTK_FLOAT);
  image->GetPointData()->GetScalars()->SetTuple1(7, 200);
  expect(image, "[0, 1]");
  image = Stack();
  AddArray(image->GetFieldData(), "Status", 1, 4, 0);
  expect(image, "all 4 frames");
  AddArray(image->GetFieldData(), "Status", 1, 5, 1);
  expect(image, "Status");
  image = Stack();
  AddArray(image->GetFieldData(), "Mask", 1, 31, 1);
  expect(image, "Mask");
  image = Stack();
  AddArray(image->GetFieldData(), "Timestamp", 2, 4, 1);
  expect(image, "Timestamp");
}

TEST(Convert, AFieldComesBackAsItWent)
{
  const GaussianField field = RandomField(50, 3);
  const auto polyData = ToPolyData(field);
  EXPECT_EQ(polyData->GetNumberOfVerts(), 50);
  EXPECT_EQ(polyData->GetPointData()->GetScalars(), polyData->GetPointData()->GetArray("Reflectivity"));
  polyData->SetVerts(nullptr);  // cells are optional
  const GaussianField back = FieldFromPolyData(polyData);
  EXPECT_EQ(back.means, field.means);
  EXPECT_EQ(back.scales, field.scales);
  EXPECT_EQ(back.rotations, field.rotations);
  EXPECT_EQ(back.reflectivities, field.reflectivities);
  EXPECT_EQ(back.beam.elevationSigma, field.beam.elevationSigma);
  EXPECT_EQ(back.transfer.gamma, field.transfer.gamma);

  vtkNew<vtkPolyData> nothing;
  EXPECT_EQ(FieldFromPolyData(nothing).Size(), 0u);
}

TEST(Convert, AFieldIsSharedWithoutWhatIsNotItsOwn)
{
  const auto from = ToPolyData(RandomField(20, 3));
  AddArray(from->GetPointData(), "Colour", 3, 20, 0.5);
  AddArray(from->GetFieldData(), "Note", 1, 1, 7);
  SetProvenance(from, "seed", "1");
  vtkNew<vtkFloatArray> single;
  single->DeepCopy(from->GetPointData()->GetArray("Scale"));
  from->GetPointData()->AddArray(single);
  from->SetVerts(nullptr);

  vtkNew<vtkPolyData> to;
  ShareField(from, to);
  EXPECT_EQ(to->GetPoints()->GetData(), from->GetPoints()->GetData());
  EXPECT_EQ(to->GetPointData()->GetArray("Rotation"), from->GetPointData()->GetArray("Rotation"));
  EXPECT_EQ(to->GetPointData()->GetArray("Scale")->GetDataType(), VTK_DOUBLE);
  EXPECT_EQ(to->GetPointData()->GetArray("Scale")->GetComponent(7, 2), single->GetComponent(7, 2));
  EXPECT_STREQ(to->GetPointData()->GetScalars()->GetName(), "Reflectivity");
  EXPECT_EQ(to->GetPointData()->GetNumberOfArrays(), 3);
  EXPECT_EQ(to->GetFieldData()->GetAbstractArray("Note"), nullptr);
  EXPECT_EQ(to->GetNumberOfVerts(), 20);
  EXPECT_EQ(GetProvenance(to, "seed"), "1");

  from->GetPointData()->GetArray("Rotation")->SetTuple4(9, 0, 0, 0, 0);
  EXPECT_THROW(ShareField(from, to), Error);
}

TEST(Convert, ProvenanceKeepsOneLineAKey)
{
  vtkNew<vtkPolyData> data;
  EXPECT_EQ(GetProvenance(data, "seed"), "");
  SetProvenance(data, "seed", "1");
  SetProvenance(data, "source", "a=b.mha");
  vtkNew<vtkPolyData> copy;
  copy->ShallowCopy(data);
  SetProvenance(data, "seed", "2");
  EXPECT_EQ(GetProvenance(data, "seed"), "2");
  EXPECT_EQ(GetProvenance(data, "source"), "a=b.mha");
  EXPECT_EQ(GetProvenance(copy, "seed"), "1");
}

}  // namespace
}  // namespace bigus::test
