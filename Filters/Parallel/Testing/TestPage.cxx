// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The page's C++ snippets as they stand there (extract_snippets.py), on one process.
#include <filesystem>

#include "Data/FieldData.h"
#include "Support/Fields.h"
#include "Support/Random.h"
#include "Support/TestSupport.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusFieldWriter.h"
#include "vtkBigusPartitionField.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusReslice.h"
#include "vtkBigusTrainer.h"
#include "vtkDummyController.h"
#include "vtkImageData.h"
#include "vtkPolyData.h"
#include "vtkTrivialProducer.h"

namespace bigus::test
{
namespace
{

TEST(PartsPage, SlicesAndWrites)
{
  const TemporaryFolder folder;
  std::filesystem::current_path(folder.Path());
  vtkNew<vtkTrivialProducer> reader;
  vtkNew<vtkPolyData> field;
  Random random(11);
  FieldToPolyData(RandomField(random, 80, 10.0, 0.1, 1.0, 0.4), field);
  reader->SetOutput(field);
  vtkNew<vtkDummyController> controller;
#include "Filters/Parallel/README-1.h"
  EXPECT_EQ(vtkPolyData::SafeDownCast(part->GetOutputDataObject(0))->GetNumberOfPoints(), 80);
  EXPECT_GT(reslice->GetOutput()->GetNumberOfPoints(), 0);
#include "Filters/Parallel/README-3.h"
  vtkNew<vtkBigusFieldReader> again;
  again->SetFileName("field.pvtp");
  again->Update();
  EXPECT_EQ(again->GetOutput()->GetNumberOfPoints(), 80);
  std::filesystem::current_path(folder.Path().parent_path());
}

TEST(PartsPage, Trains)
{
  vtkNew<vtkBigusPhantomSource> reader;
  reader->SetNumberOfFrames(16);
  reader->SetFrameSize(48, 40);
  reader->SetPixelSize(0.6);
  vtkNew<vtkDummyController> controller;
#include "Filters/Parallel/README-2.h"
  EXPECT_GT(vtkPolyData::SafeDownCast(trainer->GetOutputDataObject(0))->GetNumberOfPoints(), 100);
  EXPECT_EQ(trainer->GetSentBytes(), 0);
}

}  // namespace
}  // namespace bigus::test
