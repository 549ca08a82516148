// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Images compared with baselines that a person has looked at, strictly: no pixel may differ by a single grey
// level.
//
// They are rendered by the reference engine, in double and with nothing left out, so they do not depend on
// the instruction set; that the fast engine equals it is tested with numbers elsewhere. The phantom's field
// is stored (Testing/Data), so that training has no part in it.

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iostream>
#include <string>

#include "Core/Model/Sweep.h"
#include "Data/SweepData.h"
#include "Support/TestSupport.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusReslice.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusTrainer.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkImageAppendComponents.h"
#include "vtkImageData.h"
#include "vtkImageDifference.h"
#include "vtkImageFlip.h"
#include "vtkImageShiftScale.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkPNGReader.h"
#include "vtkPNGWriter.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"

namespace bigus::test
{
namespace
{

/// vtkImageDifference wants colours.
vtkSmartPointer<vtkImageData> ToColour(vtkImageData* grey)
{
  vtkNew<vtkImageAppendComponents> colour;
  for (int component = 0; component < 3; ++component)
  {
    colour->AddInputData(grey);
  }
  colour->Update();
  return colour->GetOutput();
}

/// 0 only for images equal in every pixel.
double StrictDifference(vtkImageData* image, vtkImageData* baseline)
{
  vtkNew<vtkImageDifference> difference;
  difference->SetInputData(ToColour(image));
  difference->SetImageData(ToColour(baseline));
  difference->AllowShiftOff();
  difference->AveragingOff();
  difference->SetThreshold(0);
  difference->Update();
  return difference->GetThresholdedError();
}

void ExpectBaseline(vtkImageData* slice, const std::string& name)
{
  vtkNew<vtkImageFlip> flip;  // row 0 is the skin: in a PNG it belongs on top
  flip->SetInputData(slice);
  flip->SetFilteredAxis(1);
  flip->Update();
  vtkImageData* image = flip->GetOutput();
  const auto file = TestDataFolder() / "Baseline" / (name + ".png");
  const auto written = std::filesystem::temp_directory_path() /
                       ("bigus-" + name + "-" + std::to_string(::getpid()) + ".png");  // kept, to be looked at
  ASSERT_EQ(image->GetScalarType(), VTK_UNSIGNED_CHAR);
  double difference = -1;
  if (std::filesystem::exists(file))
  {
    vtkNew<vtkPNGReader> reader;
    reader->SetFileName(file.c_str());
    reader->Update();
    const int* size = reader->GetOutput()->GetDimensions();
    const int* got = image->GetDimensions();
    if (size[0] == got[0] && size[1] == got[1])
    {
      difference = StrictDifference(image, reader->GetOutput());
    }
  }
  if (difference != 0)
  {
    vtkNew<vtkPNGWriter> writer;
    writer->SetFileName(written.c_str());
    writer->SetInputData(image);
    writer->Write();
    FAIL() << "the image differs from " << file << " (error " << difference << ", -1 = no baseline of this size); see "
           << written;
  }
}

/// The stored phantom field, seen on 160 x 128 pixels of 0.4 mm.
vtkSmartPointer<vtkBigusReslice> PhantomSlice()
{
  vtkNew<vtkBigusFieldReader> reader;
  reader->SetFileName((TestDataFolder() / "phantom-field.vtp").c_str());
  reader->Update();
  EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 5000);
  auto reslice = vtkSmartPointer<vtkBigusReslice>::New();
  reslice->SetInputData(reader->GetOutput());
  reslice->SetEngine("reference");
  reslice->SetOutputScalarTypeToUnsignedChar();
  reslice->SetOutputDimensionality(2);
  reslice->SetOutputSpacing(0.4, 0.4, 1);
  reslice->SetOutputExtent(0, 159, 0, 127, 0, 0);
  reslice->SetOutputOrigin(-31.8, 0, 0);
  return reslice;
}

TEST(Baseline, PhantomAcrossTheSweep)
{
  const auto reslice = PhantomSlice();
  reslice->SetResliceAxesDirectionCosines(1, 0, 0, 0, 1, 0, 0, 0, 1);
  reslice->SetResliceAxesOrigin(0, 0, 0.5);
  reslice->Update();
  ExpectBaseline(reslice->GetOutput(), "phantom-across");

  vtkNew<vtkImageShiftScale> grey;  // coverage 0 to 6 as black to white
  grey->SetInputConnection(reslice->GetCoverageOutputPort());
  grey->SetScale(255 / 6.0);
  grey->SetOutputScalarTypeToUnsignedChar();
  grey->ClampOverflowOn();
  grey->Update();
  ExpectBaseline(grey->GetOutput(), "phantom-coverage");
}

TEST(Baseline, PhantomAlongTheSweep)
{
  const auto reslice = PhantomSlice();
  // x along the sweep, y into the body: a plane that no frame lies in.
  reslice->SetResliceAxesDirectionCosines(0, 0, 1, 0, 1, 0, -1, 0, 0);
  reslice->SetResliceAxesOrigin(2, 0, 0);
  reslice->SetOutputSpacing(0.2, 0.4, 1);
  reslice->SetOutputOrigin(-15.9, 0, 0);
  reslice->Update();
  ExpectBaseline(reslice->GetOutput(), "phantom-along");
}

TEST(Baseline, PhantomOblique)
{
  const auto reslice = PhantomSlice();
  reslice->SetResliceAxesDirectionCosines(0.8, 0, 0.6, 0, 1, 0, -0.6, 0, 0.8);
  reslice->SetResliceAxesOrigin(0, 0, 0);
  reslice->SetCoverageThreshold(0.05);
  reslice->SetBackgroundLevel(60);
  reslice->SetOutputSpacing(0.3, 0.4, 1);
  reslice->SetOutputOrigin(-23.85, 0, 0);
  reslice->Update();
  ExpectBaseline(reslice->GetOutput(), "phantom-oblique");
}

TEST(Baseline, Brain)
{
  BIGUS_REQUIRE_DATA(file, "brain-sweep/us_brain_sweep.igs.mha");
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName(file.c_str());
  reader->Update();
  ASSERT_GT(reader->GetOutput()->GetNumberOfPoints(), 0);

  // Nine frames at a quarter of the resolution, and seeds without training: what the reference engine does in
  // seconds.
  const Sweep sweep =
      SweepFromImage(reader->GetOutput()).sweep->Subset({16, 17, 18, 19, 20, 21, 22, 23, 24}).Reduced(4);
  vtkNew<vtkImageData> small;
  SweepToImage(sweep, small);
  vtkNew<vtkBigusTrainer> trainer;
  trainer->SetInputData(small);
  trainer->SetEngine("reference");
  trainer->SetAutomatic(false);  // what trials decide is not what this picture is about
  trainer->SetGaussians(5000);
  trainer->SetIterations(0);
  trainer->SetVirtualPlanes(0);
  trainer->Update();
  ASSERT_EQ(trainer->GetOutput()->GetNumberOfPoints(), 5000);

  vtkNew<vtkMatrix4x4> axes;
  axes->DeepCopy(vtkDoubleArray::SafeDownCast(small->GetFieldData()->GetArray("ImageToReference"))->GetPointer(16 * 4));
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputConnection(trainer->GetOutputPort());
  reslice->SetEngine("reference");
  reslice->SetOutputToFrame(axes, 160, 120);
  reslice->SetOutputScalarTypeToUnsignedChar();
  reslice->Update();
  ExpectBaseline(reslice->GetOutput(), "brain");

  // It is the frame it should be.
  std::vector<float> frame(sweep.PixelsPerFrame());
  sweep.CopyFrame(4, frame.data());
  double sum = 0, frameSum = 0, square = 0, frameSquare = 0, product = 0;
  for (std::size_t i = 0; i < frame.size(); ++i)
  {
    const double value = static_cast<unsigned char*>(reslice->GetOutput()->GetScalarPointer())[i];
    sum += value;
    frameSum += frame[i];
    square += value * value;
    frameSquare += frame[i] * frame[i];
    product += value * frame[i];
  }
  const double n = static_cast<double>(frame.size());
  EXPECT_GT(
      (product - sum * frameSum / n) / std::sqrt((square - sum * sum / n) * (frameSquare - frameSum * frameSum / n)),
      0.9);
}

/// What vtkRegressionTestImage looks at; it passes below 0.15.
double UsualDifference(vtkImageData* image, vtkImageData* baseline)
{
  vtkNew<vtkImageDifference> difference;
  difference->SetInputData(ToColour(image));
  difference->SetImageData(ToColour(baseline));
  difference->Update();
  return difference->GetThresholdedError();
}

// Why a slice is not compared as scenes are: Testing/Regression/README.md.
TEST(Baseline, TheUsualComparisonPassesWrongSlices)
{
  const auto picture = [](const std::function<void(vtkBigusReslice*)>& change)
  {
    const auto reslice = PhantomSlice();
    reslice->SetEngine("cpu");  // fast; these pictures differ by far more than engines do
    reslice->SetResliceAxesDirectionCosines(1, 0, 0, 0, 1, 0, 0, 0, 1);
    reslice->SetResliceAxesOrigin(0, 0, 0.5);
    change(reslice);
    reslice->Update();
    return vtkSmartPointer<vtkImageData>(reslice->GetOutput());
  };
  const auto right = picture([](vtkBigusReslice*) {});
  const auto moved = picture([](vtkBigusReslice* reslice) { reslice->SetResliceAxesOrigin(0.4, 0, 0.5); });
  const auto beside = picture([](vtkBigusReslice* reslice) { reslice->SetResliceAxesOrigin(0, 0, 0.6); });
  const auto thick = picture([](vtkBigusReslice* reslice) { reslice->SetElevationSigma(0.5); });
  for (const auto& [name, wrong] : {std::pair{"a pixel to the side", moved}, std::pair{"0.1 mm beside", beside},
                                    std::pair{"a beam of 0.5 mm for 0.6 mm", thick}})
  {
    std::cout << name << ": " << UsualDifference(wrong, right) << ", strictly " << StrictDifference(wrong, right)
              << "\n";
    EXPECT_LT(UsualDifference(wrong, right), 0.15) << name;
    EXPECT_GT(StrictDifference(wrong, right), 10) << name;
  }
}

TEST(Baseline, TheComparisonIsStrict)
{
  vtkNew<vtkImageData> image;
  image->SetDimensions(40, 30, 1);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  auto* pixels = static_cast<unsigned char*>(image->GetScalarPointer());
  for (int i = 0; i < 1200; ++i)
  {
    pixels[i] = static_cast<unsigned char>(i * 7);
  }
  vtkNew<vtkImageData> other;
  other->DeepCopy(image);
  EXPECT_EQ(StrictDifference(image, other), 0);
  ++pixels[617];
  EXPECT_GT(StrictDifference(image, other), 0) << "one grey level in one pixel";
  --pixels[617];
  std::rotate(pixels, pixels + 1, pixels + 1200);
  EXPECT_GT(StrictDifference(image, other), 0) << "a shift by one pixel";
}

}  // namespace
}  // namespace bigus::test
