// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The C++ snippets of the rooms' pages as they stand there (extract_snippets.py), after what the text around them tells.
#include <filesystem>
#include <iostream>

#include "Rendering/RenderingTestSupport.h"
#include "Support/TestSupport.h"
#include "vtkBigusImageMetrics.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusPoseCorrection.h"
#include "vtkBigusReslice.h"
#include "vtkBigusResliceCursorRepresentation.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusSequenceWriter.h"
#include "vtkBigusSliceProp.h"
#include "vtkBigusSliceRepresentation.h"
#include "vtkBigusSliceWidget.h"
#include "vtkBigusTrainer.h"
#include "vtkGenericRenderWindowInteractor.h"
#include "vtkPolyData.h"
#include "vtkResliceCursor.h"
#include "vtkResliceCursorWidget.h"
#include "vtkTable.h"
#include "vtkTrivialProducer.h"

namespace bigus::test
{
namespace
{

class Snippets : public ::testing::Test
{
protected:
  ~Snippets() override { std::filesystem::current_path(folder_.Path().parent_path()); }

  /// Goes to a folder that has a small sweep.igs.mha.
  void GoToSweep()
  {
    std::filesystem::current_path(folder_.Path());
    vtkNew<vtkBigusPhantomSource> source;
    source->SetNumberOfFrames(24);
    source->SetFrameSize(48, 40);
    source->SetPixelSize(0.6);
    vtkNew<vtkBigusSequenceWriter> writer;
    writer->SetInputConnection(source->GetOutputPort());
    writer->SetFileName("sweep.igs.mha");
    writer->Write();
    reader->SetFileName("sweep.igs.mha");
    reader->Update();
  }

  vtkNew<vtkBigusSequenceReader> reader;
  vtkSmartPointer<vtkPolyData> field = ToPolyData(RandomField(80, 11));

private:
  TemporaryFolder folder_;
};

TEST_F(Snippets, PoseCorrection)
{
  GoToSweep();
#include "Filters/README-1.h"
  EXPECT_EQ(vtkImageData::SafeDownCast(correction->GetOutputDataObject(0))->GetDimensions()[2], 24);
}

TEST_F(Snippets, TrainResliceAndScore)
{
  GoToSweep();
  vtkImageData* const sweep = this->reader->GetOutput();
#include "Filters/README-2.h"
  EXPECT_GT(field->GetNumberOfPoints(), 100);
  EXPECT_GT(log->GetNumberOfRows(), 0);
#include "Filters/README-3.h"
  EXPECT_EQ(image->GetDimensions()[0], 400);
  EXPECT_EQ(distance->GetDimensions()[1], 300);
  vtkNew<vtkImageData> truth;
  truth->DeepCopy(image);
#include "Filters/README-4.h"
  EXPECT_GT(metrics->GetPSNR(), 90);  // of an image and itself
}

TEST_F(Snippets, SliceProp)
{
  BIGUS_NEEDS_DISPLAY();
  vtkNew<vtkTrivialProducer> reader;
  reader->SetOutput(field);
  Scene scene;
  vtkRenderer* const renderer = scene.renderer;
#include "Rendering/README-1.h"
  scene.window->Render();
  EXPECT_EQ(renderer->GetViewProps()->GetNumberOfItems(), 1);
}

TEST_F(Snippets, SliceWidget)
{
  BIGUS_NEEDS_DISPLAY();
  Scene scene;
  vtkNew<vtkGenericRenderWindowInteractor> interactor;
  interactor->SetRenderWindow(scene.window);
  interactor->Initialize();
#include "Rendering/README-2.h"
  scene.window->Render();
  EXPECT_TRUE(widget->GetEnabled());
}

TEST_F(Snippets, ResliceCursor)
{
  BIGUS_NEEDS_DISPLAY();
  Scene scene;
  vtkNew<vtkGenericRenderWindowInteractor> interactor;
  interactor->SetRenderWindow(scene.window);
  interactor->Initialize();
  vtkNew<vtkResliceCursor> cursor;
  vtkNew<vtkResliceCursorWidget> widget;
  widget->SetInteractor(interactor);
  widget->SetDefaultRenderer(scene.renderer);
#include "Rendering/README-3.h"
  widget->On();
  scene.window->Render();
  EXPECT_EQ(view->GetFieldReslice()->GetOutput()->GetDimensions()[2], 1);
}

}  // namespace
}  // namespace bigus::test
