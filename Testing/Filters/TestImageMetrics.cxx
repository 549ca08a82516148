// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusImageMetrics: the numbers, their statistics over slices, and what it refuses.

#include <limits>

#include "Core/Metrics/BackscatterFidelity.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Metrics/Texture.h"
#include "Filters/FilterTestSupport.h"
#include "vtkBigusImageMetrics.h"
#include "vtkDoubleArray.h"
#include "vtkTable.h"
#include "vtkVariant.h"

namespace bigus::test
{
namespace
{

constexpr int width = 40, height = 32, slices = 3;

/// Speckle-like floats in [0.1, 0.8].
vtkSmartPointer<vtkImageData> Noise(std::uint64_t seed, int type = VTK_FLOAT)
{
  Random random(seed);
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetExtent(3, 3 + width - 1, 0, height - 1, 7, 7 + slices - 1);
  image->AllocateScalars(type, 1);
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    const double value = random.Uniform(0.1, 0.8);
    image->GetPointData()->GetScalars()->SetTuple1(i, type == VTK_FLOAT ? value : std::floor(255 * value));
  }
  return image;
}

TEST(ImageMetrics, EqualImagesAreEqual)
{
  for (int type : {VTK_FLOAT, VTK_UNSIGNED_CHAR})
  {
    const auto image = Noise(1, type);
    vtkNew<vtkBigusImageMetrics> metrics;
    metrics->SetInputData(image);
    metrics->SetTruthData(image);
    metrics->Update();
    EXPECT_EQ(metrics->GetPSNR(), std::numeric_limits<double>::infinity());
    EXPECT_EQ(metrics->GetPSNRStandardDeviation(), 0);
    EXPECT_NEAR(metrics->GetSSIM(), 1, 1e-6);
    EXPECT_NEAR(metrics->GetBFS(), 1, 1e-6);
    EXPECT_EQ(metrics->GetOutput()->GetNumberOfRows(), slices);
    EXPECT_EQ(metrics->GetOutput()->GetValueByName(2, "Slice").ToInt(), 9);
  }
}

TEST(ImageMetrics, AKnownErrorHasItsKnownPsnr)
{
  const auto truth = Noise(1);
  const auto image = vtkSmartPointer<vtkImageData>::New();
  image->DeepCopy(truth);
  const double offsets[slices] = {0.1, 0.01, 0.1};  // 20, 40, 20 dB
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    vtkDataArray* scalars = image->GetPointData()->GetScalars();
    scalars->SetTuple1(i, scalars->GetTuple1(i) + offsets[i / (width * height)]);
  }
  vtkNew<vtkBigusImageMetrics> metrics;
  metrics->SetInputData(image);
  metrics->SetTruthData(truth);
  metrics->Update();
  EXPECT_NEAR(metrics->GetOutput()->GetValueByName(0, "PSNR").ToDouble(), 20, 1e-4);
  EXPECT_NEAR(metrics->GetOutput()->GetValueByName(1, "PSNR").ToDouble(), 40, 1e-3);
  EXPECT_NEAR(metrics->GetPSNR(), 80.0 / 3, 1e-3);
  EXPECT_NEAR(metrics->GetPSNRStandardDeviation(), 20 * std::sqrt(2.0) / 3, 1e-3);
}

TEST(ImageMetrics, BytesAreScoredAsTheirShareOf255AndMatchCore)
{
  const auto image = Noise(4, VTK_UNSIGNED_CHAR), truth = Noise(5, VTK_UNSIGNED_CHAR);
  vtkNew<vtkBigusImageMetrics> metrics;
  metrics->SetInputData(image);
  metrics->SetTruthData(truth);
  metrics->Update();
  const std::size_t count = width * height;
  std::vector<float> a(count), b(count);
  for (std::size_t i = 0; i < count; ++i)
  {
    a[i] = static_cast<float>(image->GetPointData()->GetScalars()->GetTuple1(count + i) / 255);
    b[i] = static_cast<float>(truth->GetPointData()->GetScalars()->GetTuple1(count + i) / 255);
  }
  vtkTable* table = metrics->GetOutput();
  const BackscatterFidelity fidelity = Bfs(a.data(), b.data(), width, height);
  EXPECT_DOUBLE_EQ(table->GetValueByName(1, "PSNR").ToDouble(), Psnr(a.data(), b.data(), count));
  EXPECT_DOUBLE_EQ(table->GetValueByName(1, "SSIM").ToDouble(), Ssim(a.data(), b.data(), width, height));
  EXPECT_DOUBLE_EQ(table->GetValueByName(1, "BFS").ToDouble(), fidelity.score);
  EXPECT_DOUBLE_EQ(table->GetValueByName(1, "MeanContrast").ToDouble(), fidelity.meanContrast);
  EXPECT_DOUBLE_EQ(table->GetValueByName(1, "ContrastDistribution").ToDouble(), fidelity.contrastDistribution);
  EXPECT_DOUBLE_EQ(table->GetValueByName(1, "Rayleigh").ToDouble(), fidelity.rayleigh);
  const TextureComparison texture = CompareTexture(a.data(), b.data(), width, height);
  ForEachNumber(texture, [table](const std::string& name, double value)
                { EXPECT_DOUBLE_EQ(table->GetValueByName(1, name.c_str()).ToDouble(), value) << name; });
  for (int bin = 0; bin < kSpectrumBins; ++bin)
  {
    EXPECT_DOUBLE_EQ(vtkDoubleArray::SafeDownCast(table->GetColumnByName("ImageSpectrum"))->GetComponent(1, bin),
                     texture.image.power[bin]);
    EXPECT_DOUBLE_EQ(vtkDoubleArray::SafeDownCast(table->GetColumnByName("TruthSpectrum"))->GetComponent(1, bin),
                     texture.truth.power[bin]);
  }
  const auto expectMean = [table](double found, const char* name)
  {
    double mean = 0;
    for (int k = 0; k < slices; ++k)
    {
      mean += table->GetValueByName(k, name).ToDouble() / slices;
    }
    EXPECT_NEAR(found, mean, 1e-12) << name;
  };
  expectMean(metrics->GetContrastRatio(), "ContrastRatio");
  expectMean(metrics->GetContrastDistance(), "ContrastDistance");
  expectMean(metrics->GetIntensityDistance(), "IntensityDistance");
  expectMean(metrics->GetSpectrumDifference(), "SpectrumDifference");
  expectMean(metrics->GetHighFrequencyPower(), "HighFrequencyPower");
  EXPECT_NEAR(
      metrics->GetBFS(),
      0.4 * metrics->GetMeanContrast() + 0.4 * metrics->GetContrastDistribution() + 0.2 * metrics->GetRayleigh(),
      1e-12);
}

TEST(ImageMetricsBadInput, OneErrorEach)
{
  const auto expect = [](vtkImageData* image, vtkImageData* truth, std::vector<std::string> parts)
  {
    vtkNew<vtkBigusImageMetrics> metrics;
    metrics->SetInputData(image);
    metrics->SetTruthData(truth);
    ExpectOneError(metrics, parts);
    EXPECT_EQ(metrics->GetOutput()->GetNumberOfRows(), 0);
    EXPECT_EQ(metrics->GetPSNR(), 0);
  };
  const auto good = Noise(1);
  vtkNew<vtkImageData> other;
  other->SetDimensions(width, height, 1);
  expect(other, good, {"image", "no pixels"});
  other->AllocateScalars(VTK_FLOAT, 1);
  other->GetPointData()->GetScalars()->Fill(0.5);
  expect(other, good, {"40 x 32 x 1", "40 x 32 x 3"});
  other->SetDimensions(width, height, slices);
  other->AllocateScalars(VTK_FLOAT, 3);
  expect(good, other, {"truth", "3 components"});
  other->AllocateScalars(VTK_SHORT, 1);
  expect(other, good, {"short"});
  const auto bad = Noise(2);
  bad->GetPointData()->GetScalars()->SetTuple1(77, std::nan(""));
  expect(bad, good, {"nan", "[0, 1]"});
  bad->GetPointData()->GetScalars()->SetTuple1(77, 200);
  expect(good, bad, {"200", "[0, 1]"});
  vtkNew<vtkImageData> small;
  small->SetDimensions(8, 8, 1);
  small->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  expect(small, small, {"11"});
}

}  // namespace
}  // namespace bigus::test
