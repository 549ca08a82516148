// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "FieldRenderer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "Core/Model/Error.h"
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

constexpr double kFirstBandPixels = 65536;  // and of every band where several processes render
constexpr double kBandSeconds = 0.03;
constexpr double kMinimumSpacing = 1e-6, kMaximumSpacing = 1e6;  // mm

// How much plane i of a slab counts.
float PlaneWeight(const Slab& slab, int i)
{
  if (slab.planes == 1 || slab.mode == Slab::Min || slab.mode == Slab::Max)
  {
    return 1;
  }
  const float share = slab.mode == Slab::Sum ? 1.0f : 1.0f / static_cast<float>(slab.planes - slab.trapezoid);
  return slab.trapezoid && (i == 0 || i == slab.planes - 1) ? 0.5f * share : share;
}

// Adds plane i, count pixels, to what the slab's earlier planes gave.
void JoinPlane(const Slab& slab, int i, const float* plane, float* joined, std::size_t count)
{
  const float weight = PlaneWeight(slab, i);
  for (std::size_t pixel = 0; pixel < count; ++pixel)
  {
    const float value = weight * plane[pixel];
    joined[pixel] = i == 0                   ? value
                    : slab.mode == Slab::Min ? std::min(joined[pixel], value)
                    : slab.mode == Slab::Max ? std::max(joined[pixel], value)
                                             : joined[pixel] + value;
  }
}

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

FieldGrid GridOver(const GaussianField& field, const Eigen::Matrix3d& axes, int maximumDimension,
                   const FieldParts* parts)
{
  FieldGrid grid;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  const Eigen::Matrix3d toGrid = axes.inverse();
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    const Eigen::Vector3d centre = toGrid * field.means[i];
    // Row norms of R diag(s) are the standard deviations along the axes.
    const Eigen::Matrix3d spread = toGrid * RotationMatrix(field.rotations[i]) * field.scales[i].asDiagonal();
    const Eigen::Vector3d reach = 3 * spread.rowwise().norm();
    low = low.cwiseMin(centre - reach);
    high = high.cwiseMax(centre + reach);
  }
  if (parts)
  {
    Eigen::Matrix<double, 6, 1> bounds;
    bounds << low, -high;
    parts->Least(bounds.data(), 6);
    low = bounds.head<3>();
    high = -bounds.tail<3>();
  }
  if (!(low[0] <= high[0]))
  {
    return grid;
  }
  const Eigen::Vector3d size = high - low;
  // The limits keep numbers of any field inside an int; an absurd grid is refused later, with its size.
  grid.spacing = std::clamp(size.maxCoeff() / (maximumDimension - 1), kMinimumSpacing, kMaximumSpacing);
  const Eigen::Vector3d steps = (size / grid.spacing).array().round().min(1e9);
  grid.dimensions = steps.cast<int>() + Eigen::Vector3i::Ones();
  grid.origin = 0.5 * (low + high) - 0.5 * grid.spacing * steps;
  return grid;
}

void CheckGrid(const double spacing[3], const double origin[3])
{
  for (int axis = 0; axis < 3; ++axis)
  {
    const double size = std::abs(spacing[axis]);
    if (!(size >= kMinimumSpacing && size <= kMaximumSpacing))
    {
      throw Error("OutputSpacing along axis " + std::to_string(axis) + " is " + std::to_string(spacing[axis]) +
                  " mm; it must lie between 1e-6 and 1e6 mm.");
    }
    if (!std::isfinite(origin[axis]))
    {
      throw Error("OutputOrigin along axis " + std::to_string(axis) + " is not finite.");
    }
  }
}

double ExtentSize(const int extent[6])
{
  double size = 1;
  for (int axis = 0; axis < 3; ++axis)
  {
    size *= std::max(0.0, static_cast<double>(extent[2 * axis + 1]) - extent[2 * axis] + 1);
  }
  return size;
}

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
    std::transform(values, values + count, bytes->GetPointer(first),
                   [](float value) -> unsigned char
                   { return value > 0 ? static_cast<unsigned char>(std::min(255 * value + 0.5f, 255.0f)) : 0; });
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
    pixelsPerBand_ = kFirstBandPixels;
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
}

void FieldRenderer::Upload(vtkPolyData* input, const Settings& settings)
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

void FieldRenderer::UploadHere(vtkPolyData* input, const Settings& settings)
{
  if (!(settings.tolerance >= 0 && settings.tolerance <= 1))
  {
    throw Error("The tolerance is " + std::to_string(settings.tolerance) + "; it must lie between 0 and 1.");
  }
  if (!std::isfinite(settings.elevationSigma))
  {
    throw Error(
        "The elevation sigma is not finite; give mm, 0 for a thin plane, or a negative number for the "
        "field's.");
  }
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

void FieldRenderer::RenderWindow(const SlicePlane& plane, const Engine::Window& window, ViewOutput output, float* image,
                                 float* coverage)
{
  if (!parts_)
  {
    engines_[0]->Render(plane, window, output, image, coverage);
    return;
  }
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

bool FieldRenderer::Render(const Eigen::Matrix4d& indexToWorld, const int whole[6], const int extent[6],
                           ViewOutput output, bool coverage, const Slab& slab,
                           const std::function<bool(const PixelBand&)>& receive)
{
  const int columns = extent[1] - extent[0] + 1, rows = extent[3] - extent[2] + 1;
  const int width = whole[1] - whole[0] + 1, height = whole[3] - whole[2] + 1;
  const double total = ExtentSize(extent);
  vtkIdType first = 0;

  // Renders so many pixels into image_ and coverage_, and passes them on. `render` gets the place of a plane of the slab,
  // in steps from its middle.
  const auto deliver = [&](std::size_t count, auto&& render)
  {
    image_.resize(count);
    coverage_.resize(coverage ? count : 0);
    float* covered = coverage ? coverage_.data() : nullptr;
    const auto before = std::chrono::steady_clock::now();
    if (slab.planes == 1)
    {
      render(0.0, image_.data(), covered);
    }
    else
    {
      planeImage_.resize(count);
      planeCoverage_.resize(coverage_.size());
      for (int i = 0; i < slab.planes; ++i)
      {
        render((i - 0.5 * (slab.planes - 1)) * slab.spacing, planeImage_.data(),
               coverage ? planeCoverage_.data() : nullptr);
        JoinPlane(slab, i, planeImage_.data(), image_.data(), count);
        for (std::size_t pixel = 0; pixel < coverage_.size(); ++pixel)
        {
          covered[pixel] = i == 0 ? planeCoverage_[pixel] : std::max(covered[pixel], planeCoverage_[pixel]);
        }
      }
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count();
    // Aim at kBandSeconds from what this band took; a plane that is nearly free says little about the next.
    if (!parts_)  // processes take the same bands
    {
      pixelsPerBand_ = std::clamp(count * std::clamp(kBandSeconds / std::max(seconds, 1e-6), 0.1, 8.0), 1.0, 4.0e6);
    }
    const vtkIdType pixels = static_cast<vtkIdType>(count);
    const double fraction = (static_cast<double>(first) + pixels) / total;
    const PixelBand band{first, pixels, image_.data(), covered, fraction};
    first += pixels;
    if (!parts_)
    {
      return receive(band);
    }
    bool goesOn = true;
    parts_->Agree([&] { goesOn = receive(band); });
    return parts_->All(goesOn);
  };
  const auto planeAt = [&](double k)
  {
    const Eigen::Vector4d start = indexToWorld * Eigen::Vector4d(whole[0], whole[2], k, 1);
    SlicePlane plane;
    plane.origin = start.head<3>();
    plane.columnStep = indexToWorld.block<3, 1>(0, 0);
    plane.rowStep = indexToWorld.block<3, 1>(0, 1);
    plane.width = width;
    plane.height = height;
    plane.Validate("Output slice " + std::to_string(std::lround(k)));
    return plane;
  };

  for (int k = extent[4]; k <= extent[5];)
  {
    // Whole planes together, if there is time for several; else a plane in bands of rows.
    const double planePixels = static_cast<double>(width) * height;
    const int planes = columns == width && rows == height
                           ? std::min(static_cast<int>(pixelsPerBand_ / planePixels), extent[5] - k + 1)
                           : 1;
    if (planes > 1)
    {
      const auto renderStack = [&](double offset, float* pixels, float* cover)
      {
        std::vector<SlicePlane> stack;
        for (int i = 0; i < planes; ++i)
        {
          stack.push_back(planeAt(k + i + offset));
        }
        if (!parts_)
        {
          engines_[0]->RenderStack(stack, output, pixels, cover);
          return;
        }
        const std::size_t size = static_cast<std::size_t>(width) * height;
        for (std::size_t i = 0; i < stack.size(); ++i)
        {
          RenderWindow(stack[i], {0, 0, width, height}, output, pixels + i * size, cover ? cover + i * size : nullptr);
        }
      };
      if (!deliver(static_cast<std::size_t>(planes) * width * height, renderStack))
      {
        return false;
      }
      k += planes;
      continue;
    }
    for (int row = extent[2]; row <= extent[3];)
    {
      const int wanted = static_cast<int>(std::min(1e9, pixelsPerBand_ / columns));
      const int band = std::clamp(wanted, 1, extent[3] - row + 1);
      const Engine::Window window{extent[0] - whole[0], row - whole[2], columns, band};
      if (!deliver(static_cast<std::size_t>(band) * columns, [&](double offset, float* pixels, float* cover)
                   { RenderWindow(planeAt(k + offset), window, output, pixels, cover); }))
      {
        return false;
      }
      row += band;
    }
    ++k;
  }
  return true;
}

}  // namespace bigus
