// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "FieldRenderer.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "Core/Slicing/Pixels.h"
#include "Data/FieldData.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkUnsignedCharArray.h"

namespace bigus
{
namespace
{

/// Gaussians from `first` on.
GaussianField Slice(const GaussianField& field, std::size_t first, std::size_t count)
{
  const auto part = [first, count](const auto& values)
  {
    const auto begin = values.begin() + static_cast<std::ptrdiff_t>(first);
    return std::decay_t<decltype(values)>(begin, begin + static_cast<std::ptrdiff_t>(count));
  };
  return {part(field.means),          part(field.scales), part(field.rotations),
          part(field.reflectivities), field.beam,         field.transfer};
}

}  // namespace

void AllocatePixels(vtkImageData* image, const int extent[6], int scalarType, const char* name)
{
  image->SetExtent(const_cast<int*>(extent));
  image->AllocateScalars(scalarType, 1);
  image->GetPointData()->GetScalars()->SetName(name);
}

void StorePixels(const float* values, vtkIdType first, vtkIdType count, vtkImageData* image)
{
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  if (auto* bytes = vtkUnsignedCharArray::SafeDownCast(scalars))
  {
    ToBytes(values, count, bytes->GetPointer(first));
  }
  else
  {
    std::copy_n(values, count, vtkFloatArray::SafeDownCast(scalars)->GetPointer(first));
  }
}

const GaussianField& FieldRenderer::Load(vtkPolyData* input)
{
  if (!input_ || input_ != input || inputTime_ != input->GetMTime())
  {
    input_ = nullptr;  // should the next line throw, nothing valid is held
    field_ = FieldFromPolyData(input);
    uploadedSigma_.reset();
    bands_ = Bands(!parts_);  // processes take the same bands
    input_ = input;
    inputTime_ = input->GetMTime();
  }
  return field_;
}

void FieldRenderer::SetParts(std::unique_ptr<FieldParts> parts)
{
  parts_ = std::move(parts);
  chunks_ = {};
  engines_.clear();
  uploadedSigma_.reset();
  bands_ = Bands(!parts_);
}

void FieldRenderer::Upload(vtkPolyData* input, const ViewSettings& settings)
{
  if (!parts_)
  {
    UploadHere(input, settings);
    return;
  }
  parts_->Agree([&] { Load(input); });
  chunks_ = parts_->ChunksOf(input, field_.Size());
  parts_->RequireOneField(field_, transfer_);
  parts_->Agree([&] { UploadHere(input, settings); });
}

void FieldRenderer::UploadHere(vtkPolyData* input, const ViewSettings& settings)
{
  settings.Validate();
  Load(input);
  const std::size_t engines = parts_ ? chunks_.sizes.size() : 1;
  if (engines_.size() != engines || engineName_ != settings.engine)
  {
    engines_.clear();
    for (std::size_t k = 0; k < engines; ++k)
    {
      engines_.push_back(Engine::Create(settings.engine));
    }
    engineName_ = settings.engine;
    device_ = engines_.empty() ? "" : engines_[0]->Device();
    uploadedSigma_.reset();
  }
  const double sigma = std::max(settings.elevationSigma, -1.0);  // every negative number is the field's beam
  if (uploadedSigma_ != sigma)
  {
    const Beam own = field_.beam;
    if (sigma >= 0)
    {
      field_.beam = Beam{sigma};
    }
    if (!parts_)
    {
      engines_[0]->SetField(field_);
    }
    std::size_t first = 0;
    for (std::size_t k = 0; parts_ && k < engines; ++k)
    {
      engines_[k]->SetField(Slice(field_, first, chunks_.sizes[k]));
      first += chunks_.sizes[k];
    }
    field_.beam = own;
    uploadedSigma_ = sigma;
  }
  for (const auto& engine : engines_)
  {
    engine->SetAccuracy({settings.tolerance / chunks_.total});  // what chunks leave out adds up
  }
}

void FieldRenderer::RenderParts(const SlicePlane& plane, const Engine::Window& window, ViewOutput output, float* image,
                                float* coverage)
{
  // Scattering and coverage are linear in the Gaussians, and intensity follows from the sum.
  const std::size_t pixels = static_cast<std::size_t>(window.rows) * window.columns;
  std::vector<float> sum((coverage ? 2 : 1) * pixels);
  parts_->Sum(
      chunks_, sum.size(),
      [&](int k, float* picture)
      { engines_[k]->Render(plane, window, ViewOutput::Scattering, picture, coverage ? picture + pixels : nullptr); },
      sum.data());
  for (std::size_t p = 0; p < pixels; ++p)
  {
    image[p] = output == ViewOutput::Intensity ? transfer_.Intensity(sum[p]) : sum[p];
  }
  if (coverage)
  {
    std::copy(sum.begin() + static_cast<std::ptrdiff_t>(pixels), sum.end(), coverage);
  }
}

bool FieldRenderer::Render(const GridPart& grid, ViewOutput output, bool coverage, const Slab& slab,
                           const std::function<bool(const PixelBand&)>& receive)
{
  if (!parts_)
  {
    return bands_.Run(grid, coverage, slab, PlanesOn(*engines_[0], output), receive);
  }
  const auto render =
      [&](const std::vector<SlicePlane>& planes, const Engine::Window& window, float* image, float* covered)
  {
    const std::size_t size = static_cast<std::size_t>(window.rows) * window.columns;
    for (std::size_t i = 0; i < planes.size(); ++i)
    {
      RenderParts(planes[i], window, output, image + i * size, covered ? covered + i * size : nullptr);
    }
  };
  const auto receiveTogether = [&](const PixelBand& band)
  {
    bool goesOn = true;
    parts_->Agree([&] { goesOn = receive(band); });
    return parts_->All(goesOn);
  };
  return bands_.Run(grid, coverage, slab, render, receiveTogether);
}

}  // namespace bigus
