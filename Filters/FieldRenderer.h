// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field rendered on a grid of planes: what vtkBigusFieldToImage and its subclasses compute with.
#ifndef BigusFieldRenderer_h
#define BigusFieldRenderer_h

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Engine/ViewEngine.h"
#include "Core/Labels/Labels.h"
#include "Core/Slicing/Bands.h"
#include "Core/Slicing/Pixels.h"
#include "FieldParts.h"
#include "vtkBigusFiltersModule.h"  // for the ABI namespace
#include "vtkType.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkImageData;
class vtkPolyData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

/// Gives the image its extent and pixels, whose values are not set yet.
void AllocatePixels(vtkImageData* image, const int extent[6], int scalarType, const char* name);

/// Writes values into pixels from `first` on: as they are in float, round(255 v) clamped in unsigned char.
void StorePixels(const float* values, vtkIdType first, vtkIdType count, vtkImageData* image);

/// A field on an engine, rendered on a grid of planes band by band.
class FieldRenderer
{
public:
  /// The fields given are whole, or parts of one, which several processes render together. Then every process calls all
  /// other members in the same order, with the same settings and planes.
  void SetParts(std::unique_ptr<FieldParts> parts);
  const FieldParts& Parts() const { return *parts_; }

  /// The field of this input, read again only when it changed. Throws Error.
  const GaussianField& Load(vtkPolyData* input);

  /// FieldSpread::MeanCoverage of the whole field that was loaded last.
  double MeanCoverage() const;

  /// Makes the engine hold the field of this input. Uploads only what changed since the last call. Throws Error.
  void Upload(vtkPolyData* input, const ViewSettings& settings);

  /// Whether planes see the reflectivities of their directions; else each Gaussian is as it usually looks at its place. Off
  /// at first.
  void SetSeesDirections(bool isOn) { seesDirections_ = isOn; }
  /// The label whose share planes show, by its value; null: they show the field itself. Null at first.
  void SetLabel(std::optional<int> value) { label_ = value; }
  /// The labels of the whole field that was uploaded last, as it is seen. Throws Error where it has none.
  LabelledField& Labelled();

  /// The most that a plane of the last Render saw of what the field knows of directions, 0 to 1; negative where it knows
  /// nothing, or is not asked.
  double ViewNearness() const { return nearness_; }
  bool SeesDirections() const { return view_ && seesDirections_; }

  /// Renders a part of a grid, as Bands::Run does.
  bool Render(const GridPart& grid, ViewOutput output, bool coverage, const Slab& slab,
              const std::function<bool(const PixelBand&)>& receive);

  const std::string& Device() const { return device_; }

private:
  void UploadHere(const ViewSettings& settings);
  void UploadField(double sigma);
  void UploadLabel(double sigma);
  RenderPlanes Seen(const RenderPlanes& render);

  std::unique_ptr<FieldParts> parts_ = FieldParts::Of(nullptr);
  PartEngines whole_;
  GaussianField field_;
  FieldSpread spread_;
  std::optional<ViewDependence> view_;
  std::optional<FieldLabels> labels_;
  std::unique_ptr<LabelledField> labelled_;  // made when asked for
  std::optional<int> label_, uploadedLabel_;
  bool seesDirections_ = false;
  double nearness_ = -1;
  vtkPolyData* input_ = nullptr;  // compared, never followed
  vtkMTimeType inputTime_ = 0;
  std::string engineName_, device_;
  std::optional<double> uploadedSigma_;  // mm, of the field on the engine; none when it holds another
  Bands bands_;
};

}  // namespace bigus

#endif
