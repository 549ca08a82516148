// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus metrics: how alike two images, sequences or volumes are.
#include <algorithm>
#include <memory>

#include "Command.h"
#include "Inputs.h"
#include "Pipeline.h"
#include "Scores.h"
#include "vtkBigusImageMetrics.h"
#include "vtkBigusSequenceReader.h"
#include "vtkDoubleArray.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkTable.h"

namespace bigus::command
{

namespace
{

struct MetricsOptions
{
  std::string image, truth, frames;
  int reduce = 1;
};

/// 16-bit pixels become float in [0, 1], which the metrics take.
void UnpackShorts(vtkImageData* image)
{
  if (image->GetScalarType() != VTK_UNSIGNED_SHORT)
  {
    return;
  }
  vtkDataArray* shorts = image->GetPointData()->GetScalars();
  vtkNew<vtkFloatArray> floats;
  floats->SetName("Intensity");
  floats->SetNumberOfComponents(shorts->GetNumberOfComponents());
  floats->SetNumberOfTuples(shorts->GetNumberOfTuples());
  const auto* values = static_cast<const unsigned short*>(shorts->GetVoidPointer(0));
  for (vtkIdType i = 0; i < floats->GetNumberOfValues(); ++i)
  {
    floats->SetValue(i, values[i] / 65535.0f);
  }
  image->GetPointData()->SetScalars(floats);
}

/// Tracked or plain, by the same bounded reader: frames that a tracked sequence rejects are left out.
/// `range` is the 16-bit pixel that is shown as white, 0 asks the pixels; it becomes the one taken, 0 for other types.
vtkSmartPointer<vtkImageData> ReadImage(const std::string& path, double& range, Console& console)
{
  SequenceOptions options;
  options.path = path;
  options.pixelRange = range;
  options.chain.assumeStatus = true;
  const auto reader = NewSequenceReader(options);
  reader->RequirePosesOff();
  Update(reader, console, "Reading");
  vtkImageData* image = reader->GetOutput();
  const double used = reader->GetUsedPixelRange();
  range = image->GetScalarType() != VTK_UNSIGNED_SHORT ? 0 : used > 0 ? used : 65535;
  UnpackShorts(image);
  return image;
}

/// Means of n x n pixels, in [0, 1], as `train --reduce` makes them.
vtkSmartPointer<vtkImageData> Reduced(vtkImageData* images, int n)
{
  int size[3];
  images->GetDimensions(size);
  const int width = size[0] / n, height = size[1] / n;
  Require(width >= 1 && height >= 1, "--reduce ", n, " leaves no pixel of images of ", size[0], " x ", size[1], ".");
  vtkDataArray* all = images->GetPointData()->GetScalars();
  const double one = images->GetScalarType() == VTK_UNSIGNED_CHAR ? 255 : 1;
  auto reduced = vtkSmartPointer<vtkImageData>::New();
  reduced->SetDimensions(width, height, size[2]);
  reduced->AllocateScalars(VTK_FLOAT, 1);
  auto* out = static_cast<float*>(reduced->GetScalarPointer());
  for (int k = 0; k < size[2]; ++k)
  {
    for (int j = 0; j < height; ++j)
    {
      for (int i = 0; i < width; ++i)
      {
        double sum = 0;
        for (int row = j * n; row < (j + 1) * n; ++row)
        {
          for (int column = i * n; column < (i + 1) * n; ++column)
          {
            sum += all->GetComponent((vtkIdType(k) * size[1] + row) * size[0] + column, 0);
          }
        }
        *out++ = static_cast<float>(sum / (one * n * n));
      }
    }
  }
  return reduced;
}

/// Means over the table's rows.
TextureComparison ReadTexture(vtkTable* table)
{
  const auto mean = [table](const std::string& name, int component)
  {
    const auto* column = vtkDoubleArray::SafeDownCast(table->GetColumnByName(name.c_str()));
    double sum = 0;
    for (vtkIdType row = 0; row < table->GetNumberOfRows(); ++row)
    {
      sum += column->GetTypedComponent(row, component);
    }
    return sum / static_cast<double>(table->GetNumberOfRows());
  };
  TextureComparison texture;
  ForEachNumber(texture, [&mean](const std::string& name, double& number) { number = mean(name, 0); });
  for (int bin = 0; bin < kSpectrumBins; ++bin)
  {
    texture.image.power[bin] = mean("ImageSpectrum", bin);
    texture.truth.power[bin] = mean("TruthSpectrum", bin);
  }
  return texture;
}

void RequireEqualSizes(vtkImageData* image, vtkImageData* truth, const MetricsOptions& options)
{
  int size[3], truthSize[3];
  image->GetDimensions(size);
  truth->GetDimensions(truthSize);
  if (!std::equal(size, size + 3, truthSize))
  {
    const auto text = [](const int* s)
    { return std::to_string(s[0]) + " x " + std::to_string(s[1]) + " x " + std::to_string(s[2]); };
    throw Error(
        "'" + options.image + "' has " + text(size) + " pixels and '" + options.truth + "' " + text(truthSize) +
        ": only images of equal size compare. --reduce averages the pixels of the second, --frames chooses images.");
  }
}

ExitCode Measure(Console& console, const MetricsOptions& options)
{
  double imageRange = 0, truthRange = 0;
  vtkSmartPointer<vtkImageData> image = ReadImage(options.image, imageRange, console);
  vtkSmartPointer<vtkImageData> truth = ReadImage(options.truth, truthRange, console);
  if (imageRange > 0 && truthRange > 0 && imageRange != truthRange)
  {
    // Pixels compare on one scale.
    double both = std::max(imageRange, truthRange);
    console.Note("bigus: both are read with " + FormatNumber(both, 0) + " as white.");
    const bool again = imageRange < truthRange;  // the image, else the truth
    (again ? image : truth) = ReadImage(again ? options.image : options.truth, both, console);
  }
  if (!options.frames.empty())
  {
    const std::vector<int> numbers = ParseFrames(options.frames, truth->GetDimensions()[2]);
    if (image->GetDimensions()[2] == truth->GetDimensions()[2])
    {
      image = ChosenFrames(image, numbers);
    }
    truth = ChosenFrames(truth, numbers);
  }
  if (options.reduce > 1)
  {
    truth = Reduced(truth, options.reduce);
  }
  RequireEqualSizes(image, truth, options);

  vtkNew<vtkBigusImageMetrics> metrics;
  metrics->SetInputData(image);
  metrics->SetTruthData(truth);
  Update(metrics, console, "Comparing");

  const int* size = image->GetDimensions();
  const int slices = size[2];
  console.Print(std::to_string(slices) + (slices == 1 ? " image" : " images") + " of " + std::to_string(size[0]) +
                " x " + std::to_string(size[1]) + " pixels (mean, standard deviation)");
  const Json answer = {{"images", slices},
                       {"psnr", metrics->GetPSNR()},
                       {"psnr_std", metrics->GetPSNRStandardDeviation()},
                       {"ssim", metrics->GetSSIM()},
                       {"ssim_std", metrics->GetSSIMStandardDeviation()},
                       {"bfs", metrics->GetBFS()},
                       {"mean_contrast", metrics->GetMeanContrast()},
                       {"contrast_distribution", metrics->GetContrastDistribution()},
                       {"rayleigh", metrics->GetRayleigh()},
                       {"texture", TextureJson(ReadTexture(metrics->GetOutput()))}};
  console.Print("  PSNR  {psnr:3} dB, {psnr_std:3}", answer);
  console.Print("  SSIM  {ssim:5}, {ssim_std:5}", answer);
  console.Print(
      "  BFS   {bfs:4}  (mean contrast {mean_contrast:4}, contrast distribution {contrast_distribution:4}, Rayleigh "
      "{rayleigh:4})",
      answer);
  PrintTexture(answer["texture"], console);
  console.Report(answer);
  return Success;
}

}  // namespace

void AddMetrics(Program& program)
{
  auto options = std::make_shared<MetricsOptions>();
  CLI::App* app = program.app.add_subcommand(
      "metrics",
      "Compare images, sequences or volumes, frame by frame\n"
      "  bigus metrics again.igs.mha sweep.igs.mha\n"
      "Intensities count as [0, 1]. PSNR in dB (none for equal images), SSIM (11 x 11 windows), BFS, the speckle\n"
      "score, and texture: speckle contrast, histogram and power spectrum. These look at B for what is\n"
      "right: give the truth second.");
  app->add_option("A", options->image, "Image to judge: .png (grey) .mha .mhd .nrrd or a CSV of poses")
      ->required()
      ->type_name("");
  app->add_option("B", options->truth, "The truth, of the same size")->required()->type_name("");
  app->add_option(
         "--frames", options->frames,
         "Compare only these images of B, such as 0,4,10-20, with the same of A or, where A has fewer, with all of A")
      ->type_name("LIST");
  app->add_option("--reduce", options->reduce, "Average N x N pixels of B first, for slices of 'train --reduce N'")
      ->check(NumberIn(1, 1000))
      ->type_name("N");

  RunWhenChosen(app, program, [options](Console& console) { return Measure(console, *options); });
}

}  // namespace bigus::command
