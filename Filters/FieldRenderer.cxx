// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "FieldRenderer.h"

#include <algorithm>
#include <utility>

#include "Core/Model/Error.h"
#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkUnsignedCharArray.h"

namespace bigus
{
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
    spread_ = SpreadOf(field_);
    view_ = ViewFromPolyData(input);
    labels_ = LabelsFromPolyData(input);
    labelled_.reset();
    uploadedSigma_.reset();
    bands_ = Bands(parts_->FollowsClock());
    input_ = input;
    inputTime_ = input->GetMTime();
  }
  return field_;
}

double FieldRenderer::MeanCoverage() const
{
  FieldSpread whole = spread_;
  Eigen::Matrix<double, 6, 1> ends;
  ends << whole.centres.min(), -whole.centres.max();
  parts_->Least(ends.data(), 6);
  whole.centres = Eigen::AlignedBox3d(ends.head<3>(), -ends.tail<3>());
  parts_->Sum(&whole.volume, 1);
  parts_->Sum(&whole.count, 1);
  parts_->Sum(whole.scales.data(), 3);
  return whole.MeanCoverage();
}

void FieldRenderer::SetParts(std::unique_ptr<FieldParts> parts)
{
  parts_ = std::move(parts);
  whole_ = {};
  uploadedSigma_.reset();
  bands_ = Bands(parts_->FollowsClock());
}

void FieldRenderer::Upload(vtkPolyData* input, const ViewSettings& settings)
{
  parts_->Agree(
      [&]
      {
        settings.Validate();
        Load(input);
      });
  parts_->Join(input, field_, whole_);
  parts_->Agree([&] { UploadHere(settings); });
}

void FieldRenderer::UploadHere(const ViewSettings& settings)
{
  const std::size_t engines = whole_.chunks.sizes.size();
  if (whole_.engines.size() != engines || engineName_ != settings.engine)
  {
    whole_.seen.clear();
    whole_.engines.clear();
    for (std::size_t k = 0; k < engines; ++k)
    {
      whole_.engines.push_back(Engine::Create(settings.engine));
    }
    engineName_ = settings.engine;
    device_ = engines == 0 ? "" : whole_.engines[0]->Device();
    uploadedSigma_.reset();
  }
  const double sigma = std::max(settings.elevationSigma, -1.0);  // every negative number is the field's beam
  if (uploadedSigma_ != sigma || uploadedLabel_ != label_)
  {
    label_ ? UploadLabel(sigma) : UploadField(sigma);
    labelled_.reset();
    uploadedSigma_ = sigma;
    uploadedLabel_ = label_;
  }
  for (const auto& engine : whole_.engines)
  {
    engine->SetAccuracy({settings.tolerance / whole_.chunks.total});  // what chunks leave out adds up
  }
}

void FieldRenderer::UploadField(double sigma)
{
  // The field's own beam comes back, also when the engine throws.
  const struct Kept
  {
    Beam& beam;
    Beam own;
    ~Kept() { beam = std::move(own); }
  } kept{field_.beam, field_.beam};
  if (sigma >= 0)
  {
    field_.beam = Beam{sigma};
  }
  parts_->SetField(field_, SeesDirections() ? &*view_ : nullptr, whole_);
}

void FieldRenderer::UploadLabel(double sigma)
{
  Require(labels_.has_value(), "LabelValue: the field has no labels; vtkBigusFieldLabeler gives it some.");
  Require(parts_->FollowsClock() && whole_.engines.size() == 1,
          "LabelValue: labels are of whole fields, and several processes have parts of one.");
  GaussianField carriers = labels_->CarriersOf(field_, *label_);
  if (sigma >= 0)
  {
    carriers.beam = Beam{sigma};
  }
  whole_.seen.clear();
  whole_.engines[0]->SetField(carriers);
}

LabelledField& FieldRenderer::Labelled()
{
  Require(labels_.has_value(),
          "GenerateLabelOutput: the field has no labels; vtkBigusFieldLabeler or bigus label gives it some.");
  if (!labelled_)
  {
    GaussianField field = field_;
    field.beam = *uploadedSigma_ >= 0 ? Beam{*uploadedSigma_} : field.beam;
    labelled_ = std::make_unique<LabelledField>(field, *labels_, engineName_);
  }
  return *labelled_;
}

/// The same, plane by plane where directions are seen.
RenderPlanes FieldRenderer::Seen(const RenderPlanes& render)
{
  if (!SeesDirections())
  {
    return render;
  }
  return
      [this, render](const std::vector<SlicePlane>& planes, const Engine::Window& window, float* image, float* coverage)
  {
    const std::size_t pixels = static_cast<std::size_t>(window.columns) * window.rows;
    for (std::size_t k = 0; k < planes.size(); ++k)
    {
      for (SeenField& seen : whole_.seen)
      {
        nearness_ = std::max(nearness_, seen.LookFrom(planes[k]));
      }
      render({planes[k]}, window, image + k * pixels, coverage ? coverage + k * pixels : nullptr);
    }
  };
}

bool FieldRenderer::Render(const GridPart& grid, ViewOutput output, bool coverage, const Slab& slab,
                           const std::function<bool(const PixelBand&)>& receive)
{
  nearness_ = SeesDirections() && !label_ ? 0 : -1;
  const RenderPlanes render =
      label_ ? ShareOf(PlanesOn(*whole_.engines[0], ViewOutput::Scattering)) : Seen(parts_->PlanesOf(whole_, output));
  return bands_.Run(grid, coverage, slab, render,
                    [&](const PixelBand& band)
                    {
                      bool goesOn = true;
                      parts_->Agree([&] { goesOn = receive(band); });
                      return parts_->All(goesOn);
                    });
}

}  // namespace bigus
