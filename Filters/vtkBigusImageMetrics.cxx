// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusImageMetrics.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "Core/Metrics/BackscatterFidelity.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Metrics/Texture.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Statistics.h"
#include "Data/Progress.h"
#include "PipelineSupport.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkTable.h"
#include "vtkUnsignedCharArray.h"

vtkStandardNewMacro(vtkBigusImageMetrics);

namespace
{

vtkDataArray* Pixels(vtkImageData* image, const std::string& name)
{
  vtkDataArray* scalars = image ? image->GetPointData()->GetScalars() : nullptr;
  bigus::Require(
      scalars && image->GetNumberOfPoints() != 0 && scalars->GetNumberOfTuples() == image->GetNumberOfPoints(), name,
      " has no pixels.");
  bigus::Require(scalars->GetNumberOfComponents() == 1, name, " has ", scalars->GetNumberOfComponents(),
                 " components; grey images with one are compared. Convert colour to grey first.");
  bigus::Require(vtkUnsignedCharArray::SafeDownCast(scalars) || vtkFloatArray::SafeDownCast(scalars), name, " holds ",
                 scalars->GetDataTypeAsString(), "; unsigned char, or float in [0, 1], is expected.");
  return scalars;
}

// Intensities in [0, 1] of one slice.
std::vector<float> SliceIntensities(vtkDataArray* scalars, vtkIdType first, vtkIdType count, const std::string& name)
{
  std::vector<float> values(count);
  if (auto* bytes = vtkUnsignedCharArray::SafeDownCast(scalars))
  {
    const unsigned char* pixels = bytes->GetPointer(first);
    std::transform(pixels, pixels + count, values.begin(),
                   [](unsigned char value) { return static_cast<float>(value / 255.0); });
    return values;
  }
  std::copy_n(vtkFloatArray::SafeDownCast(scalars)->GetPointer(first), count, values.begin());
  const auto bad = std::find_if(values.begin(), values.end(), [](float v) { return !(v >= 0 && v <= 1); });
  if (bad != values.end())
  {
    throw bigus::Error(name + " holds the value " + std::to_string(*bad) + "; float intensities must lie in [0, 1]. " +
                       (std::isfinite(*bad) ? "Shift and scale them so that black is 0 and white is 1."
                                            : "Give pixels without a value the value 0."));
  }
  return values;
}

// Of the population: one slice has 0. Equal slices of infinite PSNR do not spread either.
double StandardDeviation(const std::vector<double>& values)
{
  if (std::all_of(values.begin(), values.end(), [&](double value) { return value == values[0]; }))
  {
    return 0;
  }
  return std::sqrt(bigus::MeanSquare(values, bigus::Mean(values)));
}

void AddColumn(vtkTable* table, const char* name, const std::vector<double>& values)
{
  vtkNew<vtkDoubleArray> column;
  column->SetName(name);
  for (double value : values)
  {
    column->InsertNextValue(value);
  }
  table->AddColumn(column);
}

void AddTextureColumns(vtkTable* table, const std::vector<bigus::TextureComparison>& textures)
{
  std::vector<std::pair<std::string, std::vector<double>>> columns;
  vtkNew<vtkDoubleArray> imageSpectrum, truthSpectrum;
  imageSpectrum->SetName("ImageSpectrum");
  imageSpectrum->SetNumberOfComponents(bigus::kSpectrumBins);
  truthSpectrum->SetName("TruthSpectrum");
  truthSpectrum->SetNumberOfComponents(bigus::kSpectrumBins);
  for (const bigus::TextureComparison& texture : textures)
  {
    std::size_t k = 0;
    bigus::ForEachNumber(texture,
                         [&](const std::string& name, double value)
                         {
                           if (k == columns.size())
                           {
                             columns.emplace_back(name, std::vector<double>());
                           }
                           columns[k++].second.push_back(value);
                         });
    imageSpectrum->InsertNextTuple(texture.image.power.data());
    truthSpectrum->InsertNextTuple(texture.truth.power.data());
  }
  for (const auto& [name, values] : columns)
  {
    AddColumn(table, name.c_str(), values);
  }
  table->AddColumn(imageSpectrum);
  table->AddColumn(truthSpectrum);
}

void RequireOneSize(vtkImageData* image, vtkImageData* truth)
{
  int size[3], truthSize[3];
  image->GetDimensions(size);
  truth->GetDimensions(truthSize);
  bigus::Require(std::equal(size, size + 3, truthSize), "The image is ", size[0], " x ", size[1], " x ", size[2],
                 " pixels, the truth ", truthSize[0], " x ", truthSize[1], " x ", truthSize[2],
                 "; they must be equal.");
}

}  // namespace

vtkBigusImageMetrics::vtkBigusImageMetrics()
{
  this->SetNumberOfInputPorts(2);
}

void vtkBigusImageMetrics::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "PSNR: " << this->PSNR << "\n";
  os << indent << "PSNRStandardDeviation: " << this->PSNRStandardDeviation << "\n";
  os << indent << "SSIM: " << this->SSIM << "\n";
  os << indent << "SSIMStandardDeviation: " << this->SSIMStandardDeviation << "\n";
  os << indent << "BFS: " << this->BFS << "\n";
  os << indent << "MeanContrast: " << this->MeanContrast << "\n";
  os << indent << "ContrastDistribution: " << this->ContrastDistribution << "\n";
  os << indent << "Rayleigh: " << this->Rayleigh << "\n";
  os << indent << "ContrastRatio: " << this->ContrastRatio << "\n";
  os << indent << "ContrastDistance: " << this->ContrastDistance << "\n";
  os << indent << "IntensityDistance: " << this->IntensityDistance << "\n";
  os << indent << "SpectrumDifference: " << this->SpectrumDifference << "\n";
  os << indent << "HighFrequencyPower: " << this->HighFrequencyPower << "\n";
}

int vtkBigusImageMetrics::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkImageData");
  return 1;
}

int vtkBigusImageMetrics::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  bigus::RequestWholeInput(inputs[1]);
  return 1;
}

int vtkBigusImageMetrics::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkTable* table = vtkTable::GetData(outputs);
  this->PSNR = this->PSNRStandardDeviation = this->SSIM = this->SSIMStandardDeviation = 0;
  this->BFS = this->MeanContrast = this->ContrastDistribution = this->Rayleigh = 0;
  this->ContrastRatio = this->ContrastDistance = this->IntensityDistance = 0;
  this->SpectrumDifference = this->HighFrequencyPower = 0;
  const auto work = [&]
  {
    vtkImageData* image = vtkImageData::GetData(inputs[0]);
    vtkImageData* truth = vtkImageData::GetData(inputs[1]);
    vtkDataArray* imageScalars = Pixels(image, "The image");
    vtkDataArray* truthScalars = Pixels(truth, "The truth");
    RequireOneSize(image, truth);
    int size[3];
    image->GetDimensions(size);
    int extent[6];
    image->GetExtent(extent);
    const vtkIdType count = static_cast<vtkIdType>(size[0]) * size[1];
    std::vector<double> psnr, ssim, bfs, meanContrast, contrastDistribution, rayleigh;
    std::vector<bigus::TextureComparison> textures;
    vtkNew<vtkIntArray> slices;
    slices->SetName("Slice");
    for (int k = 0; k < size[2]; ++k)
    {
      const std::vector<float> a = SliceIntensities(imageScalars, k * count, count, "The image");
      const std::vector<float> b = SliceIntensities(truthScalars, k * count, count, "The truth");
      const bigus::BackscatterFidelity fidelity = bigus::Bfs(a.data(), b.data(), size[0], size[1]);
      psnr.push_back(bigus::Psnr(a.data(), b.data(), a.size()));
      ssim.push_back(bigus::Ssim(a.data(), b.data(), size[0], size[1]));
      bfs.push_back(fidelity.score);
      meanContrast.push_back(fidelity.meanContrast);
      contrastDistribution.push_back(fidelity.contrastDistribution);
      rayleigh.push_back(fidelity.rayleigh);
      textures.push_back(bigus::CompareTexture(a.data(), b.data(), size[0], size[1]));
      slices->InsertNextValue(extent[4] + k);
      if (!bigus::ReportProgress(this, (k + 1.0) / size[2]))
      {
        break;  // what was measured so far is the result
      }
    }

    table->AddColumn(slices);
    AddColumn(table, "PSNR", psnr);
    AddColumn(table, "SSIM", ssim);
    AddColumn(table, "BFS", bfs);
    AddColumn(table, "MeanContrast", meanContrast);
    AddColumn(table, "ContrastDistribution", contrastDistribution);
    AddColumn(table, "Rayleigh", rayleigh);
    AddTextureColumns(table, textures);
    this->PSNR = bigus::Mean(psnr);
    this->PSNRStandardDeviation = StandardDeviation(psnr);
    this->SSIM = bigus::Mean(ssim);
    this->SSIMStandardDeviation = StandardDeviation(ssim);
    this->BFS = bigus::Mean(bfs);
    this->MeanContrast = bigus::Mean(meanContrast);
    this->ContrastDistribution = bigus::Mean(contrastDistribution);
    this->Rayleigh = bigus::Mean(rayleigh);
    const bigus::TextureComparison texture = bigus::MeanTexture(textures);
    this->ContrastRatio = texture.contrastRatio;
    this->ContrastDistance = texture.contrastDistance;
    this->IntensityDistance = texture.intensityDistance;
    this->SpectrumDifference = texture.spectrumDifference;
    this->HighFrequencyPower = texture.highFrequencyPower;
  };
  return bigus::Execute(this, outputs, work);
}
