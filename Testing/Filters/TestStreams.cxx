// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The filters inside VTK's pipelines: pieces, parts, repeated updates, writers and the filters that commonly follow.

#include "Filters/FilterTestSupport.h"
#include "Support/TestSupport.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusPoseCorrection.h"
#include "vtkBigusReslice.h"
#include "vtkBigusTrainer.h"
#include "vtkBigusVoxelizer.h"
#include "vtkCallbackCommand.h"
#include "vtkDoubleArray.h"
#include "vtkExtractVOI.h"
#include "vtkFieldData.h"
#include "vtkImageBlend.h"
#include "vtkImageCast.h"
#include "vtkImageStencil.h"
#include "vtkImageStencilData.h"
#include "vtkInformation.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkTransform.h"
#include "vtkTrivialProducer.h"
#include "vtkXMLImageDataReader.h"
#include "vtkXMLImageDataWriter.h"
#include "vtkXMLPolyDataReader.h"
#include "vtkXMLPolyDataWriter.h"

namespace bigus::test
{
namespace
{

using Streaming = vtkStreamingDemandDrivenPipeline;

/// How often a filter computed its data.
class Executions
{
public:
  explicit Executions(vtkAlgorithm* filter)
  {
    vtkNew<vtkCallbackCommand> count;
    count->SetClientData(&number_);
    count->SetCallback([](vtkObject*, unsigned long, void* number, void*) { ++*static_cast<int*>(number); });
    filter->AddObserver(vtkCommand::StartEvent, count);
  }
  int Take() { return std::exchange(number_, 0); }

private:
  int number_ = 0;
};

/// A reslice of a random field on a tilted grid of 40 x 30 x 4 pixels.
struct Oblique
{
  vtkNew<vtkBigusReslice> reslice;
  explicit Oblique(vtkAlgorithmOutput* field = nullptr)
  {
    if (field)
    {
      reslice->SetInputConnection(field);
    }
    else
    {
      reslice->SetInputDataObject(0, ToPolyData(RandomField(200, 5)));
    }
    Random random(8);
    reslice->SetResliceAxes(ToVtk(RigidMatrix(RandomRotation(random), {1, -2, 0.5})));
    reslice->SetOutputSpacing(0.4, 0.5, 1.5);
    reslice->SetOutputOrigin(-8, -7, -2);
    reslice->SetOutputExtent(0, 39, 0, 29, 0, 3);
  }
};

TEST(Streams, PiecesTogetherAreTheWhole)
{
  Oblique whole;
  whole.reslice->Update();
  const vtkIdType pixels = whole.reslice->GetOutput()->GetNumberOfPoints();
  ASSERT_EQ(pixels, 40 * 30 * 4);
  vtkNew<vtkBigusVoxelizer> voxels;
  voxels->SetInputData(vtkPolyData::SafeDownCast(whole.reslice->GetInputDataObject(0, 0)));
  voxels->SetMaximumDimension(24);
  voxels->Update();
  vtkNew<vtkImageData> volume;
  volume->DeepCopy(voxels->GetOutput());

  for (int piece = 0; piece < 5; ++piece)
  {
    Oblique part;
    part.reslice->UpdatePiece(piece, 5, 0);
    EXPECT_TRUE(SameBits(part.reslice->GetOutput(), whole.reslice->GetOutput()));
    EXPECT_LT(part.reslice->GetOutput()->GetNumberOfPoints(), pixels / 2);
    voxels->Modified();
    voxels->UpdatePiece(piece, 5, 0);
    EXPECT_LT(voxels->GetOutput()->GetNumberOfPoints(), volume->GetNumberOfPoints() / 2);
    EXPECT_TRUE(SameBits(voxels->GetOutput(), volume));
  }
}

TEST(Streams, EveryOutputGivesThePartAskedOfIt)
{
  Oblique whole;
  whole.reslice->GenerateStencilOutputOn();
  whole.reslice->Update();
  const int part[6] = {5, 20, 3, 17, 1, 2};
  for (const int port : {0, 1, 2})
  {
    Oblique one;
    one.reslice->GenerateStencilOutputOn();
    one.reslice->UpdateInformation();
    one.reslice->GetOutputInformation(port)->Set(Streaming::UPDATE_EXTENT(), part, 6);
    one.reslice->GetOutputInformation(port)->Set(Streaming::UPDATE_EXTENT_INITIALIZED(), 1);
    one.reslice->vtkAlgorithm::Update(port);
    int got[6];
    if (port == 2)
    {
      one.reslice->GetStencilOutput()->GetExtent(got);
      for (int i = part[0]; i <= part[1]; ++i)
      {
        EXPECT_EQ(one.reslice->GetStencilOutput()->IsInside(i, 10, 1),
                  whole.reslice->GetStencilOutput()->IsInside(i, 10, 1));
      }
    }
    else
    {
      auto* image = vtkImageData::SafeDownCast(one.reslice->GetOutputDataObject(port));
      image->GetExtent(got);
      EXPECT_TRUE(SameBits(image, vtkImageData::SafeDownCast(whole.reslice->GetOutputDataObject(port))));
    }
    EXPECT_TRUE(std::equal(got, got + 6, part)) << "port " << port;
  }
}

TEST(Streams, InformationComesBeforeData)
{
  // The geometry is set, so nothing upstream need run to tell it.
  vtkNew<vtkBigusPhantomSource> phantom;
  phantom->SetNumberOfFrames(4);
  phantom->SetFrameSize(16, 12);
  vtkNew<vtkBigusTrainer> trainer;
  trainer->SetInputConnection(phantom->GetOutputPort());
  Oblique oblique(trainer->GetOutputPort());
  Executions trainings(trainer), slices(oblique.reslice);
  oblique.reslice->UpdateInformation();
  vtkInformation* info = oblique.reslice->GetOutputInformation(0);
  EXPECT_EQ(info->Get(Streaming::WHOLE_EXTENT())[1], 39);
  EXPECT_EQ(info->Get(vtkDataObject::SPACING())[1], 0.5);
  EXPECT_EQ(vtkImageData::GetScalarType(info), VTK_FLOAT);
  for (const int port : {1, 3})
  {
    EXPECT_EQ(oblique.reslice->GetOutputInformation(port)->Get(Streaming::WHOLE_EXTENT())[3], 29);
  }
  EXPECT_EQ(trainings.Take(), 0);
  EXPECT_EQ(slices.Take(), 0);
}

TEST(Streams, OnlyWhatChangedRunsAgain)
{
  vtkNew<vtkTrivialProducer> producer;
  producer->SetOutput(ToPolyData(RandomField(100, 5)));
  vtkNew<vtkImageCast> cast;
  Oblique oblique(producer->GetOutputPort());
  vtkNew<vtkTransform> transform;
  oblique.reslice->SetResliceTransform(transform);
  cast->SetInputConnection(oblique.reslice->GetOutputPort());
  cast->SetOutputScalarTypeToDouble();
  Executions slices(oblique.reslice), casts(cast);
  const auto update = [&](const char* after, int expected)
  {
    cast->Update();
    EXPECT_EQ(slices.Take(), expected) << after;
    EXPECT_EQ(casts.Take(), expected) << after;
  };
  update("the first time", 1);
  update("nothing changed", 0);
  oblique.reslice->SetTolerance(oblique.reslice->GetTolerance());
  oblique.reslice->SetOutputSpacing(0.4, 0.5, 1.5);
  oblique.reslice->SetSlabNumberOfSlices(1);
  update("settings were set to what they are", 0);
  oblique.reslice->GetResliceAxes()->SetElement(0, 3, 2);
  update("the matrix was moved", 1);
  transform->Translate(1, 0, 0);
  update("the transform was changed", 1);
  oblique.reslice->SetSlabNumberOfSlices(2);
  update("a setting was changed", 1);
  oblique.reslice->SetResliceAxesOrigin(0, 0, 1);
  update("the origin was moved", 1);

  // A part of what is there is not made again; more than that is.
  const int part[6] = {0, 9, 0, 9, 0, 0}, rest[6] = {0, 39, 0, 29, 0, 3};
  oblique.reslice->UpdateExtent(part);
  EXPECT_EQ(slices.Take(), 0);
  oblique.reslice->Modified();
  oblique.reslice->UpdateExtent(part);
  oblique.reslice->UpdateExtent(rest);
  EXPECT_EQ(slices.Take(), 2);
}

TEST(Streams, AnAbortEmptiesEveryOutputAndIsForgotten)
{
  for (const int port : {0, 1})
  {
    Oblique oblique;
    oblique.reslice->SetOutputExtent(0, 399, 0, 299, 0, 9);
    oblique.reslice->SetOutputSpacing(0.04, 0.05, 0.6);
    vtkNew<vtkCallbackCommand> stop;
    stop->SetCallback([](vtkObject* caller, unsigned long, void*, void*)
                      { vtkAlgorithm::SafeDownCast(caller)->SetAbortExecute(1); });
    const unsigned long tag = oblique.reslice->AddObserver(vtkCommand::ProgressEvent, stop);
    vtkNew<vtkImageCast> consumer;
    consumer->SetInputConnection(oblique.reslice->GetOutputPort(port));
    ErrorObserver errors(oblique.reslice), quiet(consumer);  // the cast may complain that it got nothing
    oblique.reslice->vtkAlgorithm::Update(port);
    for (const int output : {0, 1})
    {
      EXPECT_EQ(vtkImageData::SafeDownCast(oblique.reslice->GetOutputDataObject(output))->GetNumberOfPoints(), 0);
    }
    EXPECT_TRUE(errors.Errors().empty());
    oblique.reslice->RemoveObserver(tag);
    oblique.reslice->SetAbortExecute(0);  // from VTK 9.3 on an algorithm stays stopped until then
    consumer->Update();
    EXPECT_EQ(consumer->GetOutput()->GetNumberOfPoints(), 400 * 300 * 10);
  }
}

TEST(Streams, VtkExtractVoiTakesAPart)
{
  Oblique whole, oblique;
  whole.reslice->Update();
  vtkNew<vtkExtractVOI> extract;
  extract->SetInputConnection(oblique.reslice->GetOutputPort());
  extract->SetVOI(4, 12, 7, 20, 2, 2);
  extract->Update();
  EXPECT_EQ(extract->GetOutput()->GetNumberOfPoints(), 9 * 14);
  EXPECT_TRUE(SameBits(extract->GetOutput(), whole.reslice->GetOutput()));
}

TEST(Streams, VtkImageBlendLaysOneSliceOverAnother)
{
  Oblique below, above;
  above.reslice->SetResliceAxesOrigin(2, 1, 0);
  vtkNew<vtkImageBlend> blend;
  blend->AddInputConnection(below.reslice->GetOutputPort());
  blend->AddInputConnection(above.reslice->GetOutputPort());
  blend->SetOpacity(1, 0.25);
  blend->Update();
  double worst = 0;
  for (int i = 0; i < 40; ++i)
  {
    const double expected =
        0.75 * FloatAt(below.reslice->GetOutput(), i, 12, 1) + 0.25 * FloatAt(above.reslice->GetOutput(), i, 12, 1);
    worst = std::max(worst, std::abs(FloatAt(blend->GetOutput(), i, 12, 1) - expected));
  }
  EXPECT_LT(worst, 1e-6);
}

#ifdef BIGUS_WITH_STREAMER
TEST(Streams, VtkImageStencilTakesTheSeenPixels)
{
  Oblique oblique;
  oblique.reslice->GenerateStencilOutputOn();
  oblique.reslice->SetCoverageThreshold(0.5);
  vtkNew<vtkImageStencil> cut;
  cut->SetInputConnection(oblique.reslice->GetOutputPort());
  cut->SetStencilConnection(oblique.reslice->GetStencilOutputPort());
  cut->SetBackgroundValue(7);
  vtkNew<vtkImageDataStreamer> streamer;
  streamer->SetInputConnection(cut->GetOutputPort());
  streamer->SetNumberOfStreamDivisions(3);
  streamer->Update();
  Oblique whole;
  whole.reslice->Update();
  int seen = 0;
  for (int j = 0; j < 30; ++j)
  {
    for (int i = 0; i < 40; ++i)
    {
      const bool inside = FloatAt(whole.reslice->GetCoverageOutput(), i, j, 2) > 0.5f;
      EXPECT_EQ(FloatAt(streamer->GetOutput(), i, j, 2), inside ? FloatAt(whole.reslice->GetOutput(), i, j, 2) : 7);
      seen += inside;
    }
  }
  EXPECT_GT(seen, 50);
}
#endif

TEST(Streams, XmlWritersKeepEveryBit)
{
  const TemporaryFolder folder;
  Oblique oblique;
  oblique.reslice->Update();
  for (const int pieces : {1, 3})
  {
    const std::string name = folder / ("slice" + std::to_string(pieces) + ".vti");
    vtkNew<vtkXMLImageDataWriter> writer;
    writer->SetInputConnection(oblique.reslice->GetOutputPort());
    writer->SetNumberOfPieces(pieces);  // written piece by piece, so the reslice streams
    writer->SetFileName(name.c_str());
    ASSERT_EQ(writer->Write(), 1);
    vtkNew<vtkXMLImageDataReader> reader;
    reader->SetFileName(name.c_str());
    reader->Update();
    oblique.reslice->UpdateWholeExtent();
    EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 40 * 30 * 4);
    EXPECT_TRUE(SameBits(reader->GetOutput(), oblique.reslice->GetOutput()));
    EXPECT_STREQ(reader->GetOutput()->GetPointData()->GetScalars()->GetName(), "Intensity");
  }

  // A field goes through VTK's own files unharmed, and gives the same slice.
  const std::string name = folder / "field.vtp";
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputDataObject(oblique.reslice->GetInputDataObject(0, 0));
  writer->SetFileName(name.c_str());
  ASSERT_EQ(writer->Write(), 1);
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName(name.c_str());
  Oblique again(reader->GetOutputPort());
  again.reslice->Update();
  oblique.reslice->UpdateWholeExtent();
  EXPECT_TRUE(SameBits(again.reslice->GetOutput(), oblique.reslice->GetOutput()));
}

#ifdef BIGUS_WITH_STREAMER
TEST(Streams, ASweepPassesFiltersThatAskForParts)
{
  vtkNew<vtkBigusPhantomSource> phantom;
  phantom->SetNumberOfFrames(6);
  phantom->SetFrameSize(24, 20);
  phantom->Update();
  vtkNew<vtkImageData> whole;
  whole->DeepCopy(phantom->GetOutput());

  // Pose correction asks for the whole sweep, whatever part of its output is wanted.
  vtkNew<vtkBigusPoseCorrection> correction;
  correction->SetInputConnection(phantom->GetOutputPort());
  correction->SetStrength(0);
  vtkNew<vtkImageDataStreamer> streamer;
  streamer->SetInputConnection(correction->GetOutputPort());
  streamer->SetNumberOfStreamDivisions(3);
  streamer->Update();
  EXPECT_EQ(streamer->GetOutput()->GetNumberOfPoints(), 24 * 20 * 6);
  EXPECT_TRUE(SameBits(streamer->GetOutput(), whole));
  vtkDataArray* poses = correction->GetOutput()->GetFieldData()->GetArray("ImageToReference");
  ASSERT_TRUE(poses);
  EXPECT_EQ(poses->GetNumberOfTuples(), 6);
}
#endif

}  // namespace
}  // namespace bigus::test
