// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field on an engine, ready for many slices, and the grids that filters of VTK's pipelines render.
#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>

#include "Arrays.h"
#include "Core/Engine/Engine.h"
#include "Core/Engine/ViewEngine.h"
#include "Core/Labels/Labels.h"
#include "Core/Model/Error.h"
#include "Core/Model/Sweep.h"
#include "Core/Slicing/Pixels.h"
#include "Core/StandardError/StandardError.h"
#include "Progress.h"

namespace bigus
{
namespace
{

constexpr double kMostPixels = 4294967296.0;  // 2^32 of one call: 16 GiB of floats

ViewOutput OutputOf(bool isScattering)
{
  return isScattering ? ViewOutput::Scattering : ViewOutput::Intensity;
}

/// What a field keeps of its standard error. The last one stays, because opening it takes longer than a slice.
std::shared_ptr<const StandardError> LastStandardError(const nb::bytes& kept)
{
  static std::mutex mutex;
  static std::string last;
  static std::shared_ptr<const StandardError> opened;
  const std::lock_guard<std::mutex> alone(mutex);
  const std::string_view bytes(kept.c_str(), kept.size());
  if (!opened || bytes != last)
  {
    opened = std::make_shared<const StandardError>(bytes);
    last = bytes;
  }
  return opened;
}

/// An engine is used by one thread at a time.
class Slicer
{
public:
  /// `seesDirections`: whether each plane shows the field as it looks from there. `label`: by its value, to show its share.
  Slicer(const Field& field, const std::string& engine, double elevationSigma, double tolerance, bool seesDirections,
         std::optional<int> label)
      : isShare_(label.has_value())
  {
    const nb::gil_scoped_release others;
    ViewSettings{engine, elevationSigma, tolerance}.Validate();
    engine_ = Engine::Create(engine);
    Require(!label || field.labels, "LabelValue: the field has no labels; bigus.label gives it some.");
    GaussianField shown = label ? field.labels->CarriersOf(field.field, *label) : field.field;
    if (elevationSigma >= 0)
    {
      shown.beam = Beam{elevationSigma};
    }
    Accuracy accuracy;
    accuracy.tolerance = tolerance;
    engine_->SetAccuracy(accuracy);
    isAlike_ = !field.view || !seesDirections || isShare_;
    seen_.emplace(*engine_, shown, isAlike_ ? nullptr : &*field.view);
    meanCoverage_ = SpreadOf(field.field).MeanCoverage();
  }

  std::string Device() const { return engine_->Device(); }
  double MeanCoverage() const { return meanCoverage_; }

  nb::object Render(const InputDoubles& poses, int width, int height, bool isScattering, bool isCovered)
  {
    RequireShape(poses, {-1, 4, 4}, "planes");
    const std::size_t n = poses.shape(0);
    if (width < 1 || height < 1 || static_cast<double>(width) * height * static_cast<double>(n) > kMostPixels)
    {
      throw nb::value_error("the size must be positive, and the pixels of one call at most 2^32");
    }
    std::vector<SlicePlane> planes;
    for (std::size_t k = 0; k < n; ++k)
    {
      planes.push_back(SlicePlane::FromImageToReference(MatrixAt(poses.data() + 16 * k), width, height));
      planes.back().Validate("plane " + std::to_string(k));
    }
    const std::size_t pixels = n * static_cast<std::size_t>(width) * height;
    std::vector<float> images(pixels), coverage(isCovered ? pixels : 0);
    if (n > 0)
    {
      const nb::gil_scoped_release others;
      const std::lock_guard<std::mutex> alone(mutex_);
      PlanesSeen(OutputOf(isScattering))(planes, {0, 0, width, height}, images.data(),
                                         isCovered ? coverage.data() : nullptr);
    }
    const auto h = static_cast<std::size_t>(height), w = static_cast<std::size_t>(width);
    const nb::object image = Owned(std::move(images), {n, h, w});
    return nb::make_tuple(image, isCovered ? std::optional(Owned(std::move(coverage), {n, h, w})) : std::nullopt);
  }

  /// Pixels of part of a grid (uint8 or float32), their coverage, and the runs of seen ones, [n, 4] of first, last, y and
  /// z; None when `progress` said stop.
  nb::object RenderPart(const Eigen::Matrix4d& indexToWorld, const Extent& whole, const Extent& extent,
                        bool isScattering, bool isBytes, const std::tuple<int, double, int, bool>& slab,
                        const std::pair<double, double>& seenAbove, bool isCovered, bool isStencil,
                        const nb::object& progress)
  {
    const auto [planes, spacing, mode, trapezoid] = slab;
    const Slab joined{planes, spacing, static_cast<Slab::Mode>(mode), trapezoid};
    const Seen seen{seenAbove.first, seenAbove.second};
    joined.Validate();
    seen.Validate();
    const auto count = static_cast<std::size_t>(ExtentSize(extent));
    const bool needsCoverage = isCovered || isStencil || seen.FillsBackground();
    std::vector<float> pixels(isBytes ? 0 : count), coverage(isCovered ? count : 0);
    std::vector<unsigned char> bytes(isBytes ? count : 0);
    std::vector<int> runs;
    const auto keep = [&](const PixelBand& band)
    {
      if (seen.FillsBackground())
      {
        seen.FillBackground(band, isBytes);
      }
      if (isBytes)
      {
        ToBytes(band.image, band.count, bytes.data() + band.first);
      }
      else
      {
        std::copy_n(band.image, band.count, pixels.begin() + band.first);
      }
      if (isCovered)
      {
        std::copy_n(band.coverage, band.count, coverage.begin() + band.first);
      }
      if (isStencil)
      {
        seen.ForEachRun(band, extent, [&](int a, int b, int y, int z) { runs.insert(runs.end(), {a, b, y, z}); });
      }
    };
    const auto draw = [&](PythonProgress& tell)
    {
      const std::lock_guard<std::mutex> alone(mutex_);
      return bands_.Run({indexToWorld, whole, extent}, needsCoverage, joined, PlanesSeen(OutputOf(isScattering)),
                        [&](const PixelBand& band) { return keep(band), tell(band.fraction); });
    };
    if (!WorkAlone(progress, draw))
    {
      return nb::none();
    }
    const std::size_t n = runs.size() / 4;
    return nb::make_tuple(isBytes ? Owned(std::move(bytes)) : Owned(std::move(pixels)), Owned(std::move(coverage)),
                          Owned(std::move(runs), {n, 4}));
  }

  /// Standard errors of part of a grid; None when `progress` said stop. `image`: its intensities, where they are known.
  std::optional<Array> StandardErrorPart(const nb::bytes& kept, const Eigen::Matrix4d& indexToWorld,
                                         const Extent& whole, const Extent& extent,
                                         const std::optional<InputFloats>& image, const nb::object& progress)
  {
    const std::shared_ptr<const StandardError> error = LastStandardError(kept);
    std::vector<float> sigma(static_cast<std::size_t>(ExtentSize(extent)));
    if (image)
    {
      RequireShape(*image, {static_cast<std::int64_t>(sigma.size())}, "the intensities");
    }
    const auto evaluate = [&](PythonProgress& tell)
    {
      const std::lock_guard<std::mutex> alone(mutex_);
      const auto render = [&](const Extent& part, float* to)
      {
        const int slice = part[4] - extent[4];
        if (image && std::equal(part.begin(), part.begin() + 4, extent.begin()))
        {
          const auto count = static_cast<std::ptrdiff_t>(ExtentSize(part));
          std::copy_n(image->data() + slice * count, count, to);
        }
        else
        {
          const auto keep = [to](const PixelBand& band)
          { return std::copy_n(band.image, band.count, to + band.first), true; };
          bands_.Run({indexToWorld, whole, part}, false, {}, PlanesSeen(ViewOutput::Intensity), keep);
        }
        return tell((slice + 1.0) / (extent[5] - extent[4] + 1));
      };
      return error->Evaluate({indexToWorld, whole, extent}, render, sigma.data(), isAlike_);
    };
    return WorkAlone(progress, evaluate) ? std::optional(Owned(std::move(sigma))) : std::nullopt;
  }

private:
  /// Each plane as it looks from there.
  RenderPlanes PlanesSeen(ViewOutput output)
  {
    const RenderPlanes render = PlanesOn(*engine_, isShare_ ? ViewOutput::Scattering : output);
    if (isAlike_)
    {
      return isShare_ ? ShareOf(render) : render;
    }
    return [this, render](const std::vector<SlicePlane>& planes, const Engine::Window& window, float* image,
                          float* coverage)
    {
      const std::size_t pixels = static_cast<std::size_t>(window.columns) * window.rows;
      for (std::size_t k = 0; k < planes.size(); ++k)
      {
        seen_->LookFrom(planes[k]);
        render({planes[k]}, window, image + k * pixels, coverage ? coverage + k * pixels : nullptr);
      }
    };
  }

  Bands bands_;
  std::unique_ptr<Engine> engine_;
  std::optional<SeenField> seen_;
  bool isShare_, isAlike_ = true;  // from everywhere
  std::mutex mutex_;
  double meanCoverage_ = 0;
};

using Numbers = std::optional<std::array<double, 3>>;

GivenGrid Given(const Numbers& spacing, const Numbers& origin, const std::optional<Extent>& extent)
{
  const auto vector = [](const Numbers& values)
  { return values ? std::optional<Eigen::Vector3d>(Eigen::Vector3d(values->data())) : std::nullopt; };
  const GivenGrid given{vector(spacing), vector(origin), extent};
  CheckGiven(given);
  return given;
}

nb::tuple ToPython(const OutputGrid& grid)
{
  const auto numbers = [](const Eigen::Vector3d& v) { return std::array<double, 3>{v[0], v[1], v[2]}; };
  return nb::make_tuple(numbers(grid.spacing), numbers(grid.origin), grid.extent);
}

/// What `input()` says that is to be covered: a field, along the axes, or spacing, origin and extent of an image.
InputGrid InputOf(const nb::callable& input, const Eigen::Matrix3d& axes, int maximumDimension)
{
  return [&input, axes, maximumDimension]
  {
    const nb::object found = input();
    if (nb::isinstance<Field>(found))
    {
      return GridOver(BoundsAlong(nb::cast<const Field&>(found).field, axes), maximumDimension);
    }
    const auto [step, start, indices] =
        nb::cast<std::tuple<std::array<double, 3>, std::array<double, 3>, Extent>>(found);
    return OutputGrid{Eigen::Vector3d(step.data()), Eigen::Vector3d(start.data()), indices};
  };
}

nb::tuple GridOfSlice(const Numbers& spacing, const Numbers& origin, const std::optional<Extent>& extent,
                      const Eigen::Matrix4d& axes, const std::optional<Eigen::Matrix4d>& transform, bool turnsInput,
                      bool crops, int dimensionality, const nb::callable& input)
{
  return ToPython(ResliceGrid(Given(spacing, origin, extent), {axes, transform, turnsInput, crops, dimensionality},
                              InputOf(input, Eigen::Matrix3d::Identity(), kDefaultDimension)));
}

nb::tuple GridOfVoxels(const Numbers& spacing, const Numbers& origin, const std::optional<std::array<int, 3>>& size,
                       const std::array<double, 9>& direction, int maximumDimension, const nb::callable& field)
{
  std::optional<Extent> extent;
  if (size)
  {
    extent = {0, (*size)[0] - 1, 0, (*size)[1] - 1, 0, (*size)[2] - 1};
  }
  const Eigen::Matrix3d axes = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(direction.data());
  return ToPython(VoxelGrid(Given(spacing, origin, extent), axes, InputOf(field, axes, maximumDimension)));
}

Array PlaceOfIndices(const Eigen::Matrix4d& axes, const std::optional<Eigen::Matrix4d>& transform,
                     const std::array<double, 3>& spacing, const std::array<double, 3>& origin)
{
  return Owned(RowByRow({IndexToWorld(OutputToWorld(axes, transform), Eigen::Vector3d(spacing.data()),
                                      Eigen::Vector3d(origin.data()))}),
               {4, 4});
}

/// The field with labels, of pictures [n, height, width] of these frames.
Field Labelled(Field field, const Sweep& sweep, const InputBytes& pictures, std::vector<int> frames,
               const std::map<int, std::string>& names, bool keepEmpty, const std::string& engine)
{
  RequireShape(pictures, {static_cast<std::int64_t>(frames.size()), sweep.height, sweep.width}, "label pictures");
  const nb::gil_scoped_release others;
  LabelFrames given{{}, std::move(frames), {pictures.data(), pictures.data() + pictures.size()}};
  for (const auto& [value, name] : names)
  {
    given.labels.push_back({value, name, UsualColor(value)});
  }
  given.labels = WithNames(std::move(given.labels), given.pixels);
  field.labels = FitLabels(field.field, sweep, keepEmpty ? given : given.Subset(given.Drawn()), {engine});
  return field;
}

/// A field's labels on an engine, used by one thread at a time.
class LabelSlicer
{
public:
  LabelSlicer(const Field& field, const std::string& engine, double elevationSigma)
  {
    Require(field.labels.has_value(), "Labels: the field has no labels; bigus.label gives it some.");
    const nb::gil_scoped_release others;
    GaussianField shown = field.field;
    shown.beam = elevationSigma >= 0 ? Beam{elevationSigma} : shown.beam;
    labelled_.emplace(shown, *field.labels, engine);
  }

  /// [height, width]
  Array Render(const Eigen::Matrix4d& plane, int width, int height)
  {
    return PictureAt<std::uint8_t>(plane, width, height,
                                   [&](const SlicePlane& at, std::uint8_t* map)
                                   {
                                     const std::lock_guard<std::mutex> alone(mutex_);
                                     labelled_->Render(at, map);
                                   });
  }

  /// [pixels] of part of a grid
  Array RenderPart(const Eigen::Matrix4d& indexToWorld, const Extent& whole, const Extent& extent)
  {
    return Filled<std::uint8_t>({static_cast<std::size_t>(ExtentSize(extent))},
                                [&](std::uint8_t* map)
                                {
                                  const std::lock_guard<std::mutex> alone(mutex_);
                                  labelled_->Render({indexToWorld, whole, extent}, map);
                                });
  }

private:
  std::optional<LabelledField> labelled_;
  std::mutex mutex_;
};

/// [height, width], of an image [height, width] at a plane.
Array StandardErrorAt(const nb::bytes& kept, const Eigen::Matrix4d& plane, const InputFloats& image)
{
  RequireShape(image, {-1, -1}, "the image");
  const std::shared_ptr<const StandardError> error = LastStandardError(kept);
  return PictureAt<float>(plane, static_cast<int>(image.shape(1)), static_cast<int>(image.shape(0)),
                          [&](const SlicePlane& at, float* sigma) { error->Evaluate(at, image.data(), sigma); });
}

/// Of pixels that are not 0 in `where`, [depth, height, width].
double StandardErrorOfMean(const nb::bytes& kept, const Eigen::Matrix4d& indexToWorld, const InputFloats& sigma,
                           const InputBytes& where)
{
  RequireShape(sigma, {-1, -1, -1}, "the standard errors");
  const int d = static_cast<int>(sigma.shape(0)), h = static_cast<int>(sigma.shape(1));
  const int w = static_cast<int>(sigma.shape(2));
  RequireShape(where, {d, h, w}, "the pixels to take");
  const SlicePlane first = SlicePlane::FromImageToReference(indexToWorld, w, h);
  first.Validate("slice plane");
  return LastStandardError(kept)->OfMean(first, sigma.data(), where.data(), d, indexToWorld.col(2).norm());
}

Array DistancesOfGrid(const Sweep& sweep, const Eigen::Matrix4d& indexToWorld, const Extent& extent)
{
  return Filled<float>({static_cast<std::size_t>(ExtentSize(extent))},
                       [&](float* distances) { GridDistances(sweep, indexToWorld, extent, distances); });
}

}  // namespace

void BindSlices(nb::module_& m)
{
  const auto spacing = "spacing"_a.none(), origin = "origin"_a.none(), transform = "transform"_a.none();
  const auto place = "index_to_world"_a, whole = "whole"_a, extent = "extent"_a;
  nb::class_<Slicer>(m, "Renderer")
      .def(nb::init<const Field&, const std::string&, double, double, bool, std::optional<int>>(), "field"_a,
           "engine"_a, "elevation_sigma"_a, "tolerance"_a, "sees_directions"_a = true, "label"_a.none() = nb::none())
      .def_prop_ro("device", &Slicer::Device)
      .def_prop_ro("mean_coverage", &Slicer::MeanCoverage)
      .def("render", &Slicer::Render, "planes"_a, "width"_a, "height"_a, "scattering"_a, "coverage"_a)
      .def("render_part", &Slicer::RenderPart, place, whole, extent, "scattering"_a, "bytes"_a, "slab"_a, "seen"_a,
           "coverage"_a, "stencil"_a, "progress"_a)
      .def("standard_error_part", &Slicer::StandardErrorPart, "kept"_a, place, whole, extent, "image"_a.none(),
           "progress"_a);
  m.def("reslice_grid", &GridOfSlice, spacing, origin, "extent"_a.none(), "axes"_a, transform, "turns_input"_a,
        "crops"_a, "dimensionality"_a, "input"_a);
  m.def("voxel_grid", &GridOfVoxels, spacing, origin, "dimensions"_a.none(), "direction"_a, "maximum_dimension"_a,
        "field"_a);
  m.def("index_to_world", &PlaceOfIndices, "axes"_a, transform, "spacing"_a, "origin"_a);
  m.def("grid_distances", &DistancesOfGrid, "sweep"_a, place, extent);
  m.def("label", &Labelled, "field"_a, "sweep"_a, "pictures"_a, "frames"_a, "names"_a, "keep_empty"_a, "engine"_a);
  nb::class_<LabelSlicer>(m, "LabelRenderer")
      .def(nb::init<const Field&, const std::string&, double>(), "field"_a, "engine"_a, "elevation_sigma"_a = -1.0)
      .def("render", &LabelSlicer::Render, "plane"_a, "width"_a, "height"_a)
      .def("render_part", &LabelSlicer::RenderPart, place, whole, extent);
  m.def("standard_error", &StandardErrorAt, "kept"_a, "plane"_a, "image"_a);
  m.def("standard_error_of_mean", &StandardErrorOfMean, "kept"_a, "index_to_world"_a, "sigma"_a, "where"_a);
  m.def("check_output_size", &CheckOutputSize, "extent"_a, "maximum"_a);
  m.def(
      "check_pixel_type",
      [](const std::string& type, bool isScattering) { CheckPixelType(type, OutputOf(isScattering)); }, "type"_a,
      "scattering"_a);
}

}  // namespace bigus
