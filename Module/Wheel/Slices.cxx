// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field on an engine, ready for many slices, and the grids that filters of VTK's pipelines render.
#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
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

Eigen::Matrix4d ToMatrix(const InputDoubles& matrix)
{
  RequireShape(matrix, {4, 4}, "a matrix");
  return MatrixAt(matrix.data());
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
    GaussianField shown = label ? field.labels->CarriersOf(field, *label) : GaussianField(field);
    if (elevationSigma >= 0)
    {
      shown.beam = Beam{elevationSigma};
    }
    Accuracy accuracy;
    accuracy.tolerance = tolerance;
    engine_->SetAccuracy(accuracy);
    isAlike_ = !field.view || !seesDirections || isShare_;
    seen_.emplace(*engine_, shown, isAlike_ ? nullptr : &*field.view);
    meanCoverage_ = SpreadOf(field).MeanCoverage();
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
    return nb::make_tuple(image, isCovered ? nb::object(Owned(std::move(coverage), {n, h, w})) : nb::none());
  }

  /// Pixels of part of a grid (uint8 or float32), their coverage, and the runs of seen ones, [n, 4] of first, last, y and
  /// z; None when `progress` said stop.
  nb::object RenderPart(const InputDoubles& indexToWorld, const Extent& whole, const Extent& extent, ViewOutput output,
                        bool isBytes, const std::tuple<int, double, int, bool>& slab, const Seen& seen, bool isCovered,
                        bool isStencil, nb::object progress)
  {
    const auto [planes, spacing, mode, trapezoid] = slab;
    const Slab joined{planes, spacing, static_cast<Slab::Mode>(mode), trapezoid};
    joined.Validate();
    seen.Validate();
    const GridPart grid{ToMatrix(indexToWorld), whole, extent};
    const auto count = static_cast<std::size_t>(ExtentSize(extent));
    const bool needsCoverage = isCovered || isStencil || seen.FillsBackground();
    std::vector<float> pixels(isBytes ? 0 : count), coverage(isCovered ? count : 0);
    std::vector<unsigned char> bytes(isBytes ? count : 0);
    std::vector<int> runs;
    PythonProgress tell(std::move(progress));
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
      return tell(band.fraction);
    };
    bool isFinished = false;
    {
      const nb::gil_scoped_release others;
      const std::lock_guard<std::mutex> alone(mutex_);
      isFinished = bands_.Run(grid, needsCoverage, joined, PlanesSeen(output), keep);
    }
    tell.Rethrow();
    if (!isFinished)
    {
      return nb::none();
    }
    const nb::object image = isBytes ? nb::object(Owned(std::move(bytes), {count})) : Owned(std::move(pixels), {count});
    const std::size_t n = runs.size() / 4;
    return nb::make_tuple(image, Owned(std::move(coverage), {isCovered ? count : 0}), Owned(std::move(runs), {n, 4}));
  }

  /// Standard errors of part of a grid; None when `progress` said stop.
  nb::object StandardErrorPart(const nb::bytes& kept, const InputDoubles& indexToWorld, const Extent& whole,
                               const Extent& extent, nb::object progress)
  {
    const GridPart grid{ToMatrix(indexToWorld), whole, extent};
    const std::string bytes(kept.c_str(), kept.size());
    std::vector<float> sigma(static_cast<std::size_t>(ExtentSize(extent)));
    PythonProgress tell(std::move(progress));
    const auto render = [&](const Extent& part, float* image)
    {
      const auto keep = [image](const PixelBand& band)
      {
        std::copy_n(band.image, band.count, image + band.first);
        return true;
      };
      bands_.Run({grid.indexToWorld, whole, part}, false, {}, PlanesSeen(ViewOutput::Intensity), keep);
      return tell((part[4] - extent[4] + 1.0) / (extent[5] - extent[4] + 1));
    };
    bool isFinished = false;
    {
      const nb::gil_scoped_release others;
      const std::lock_guard<std::mutex> alone(mutex_);
      isFinished = StandardError(bytes).Evaluate(grid, render, sigma.data());
    }
    tell.Rethrow();
    const std::size_t count = sigma.size();
    return isFinished ? nb::object(Owned(std::move(sigma), {count})) : nb::none();
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

/// `input()` gives the field, or spacing, origin and extent of an image.
nb::tuple GridOfSlice(const Numbers& spacing, const Numbers& origin, const std::optional<Extent>& extent,
                      const InputDoubles& axes, const std::optional<InputDoubles>& transform, bool turnsInput,
                      bool crops, int dimensionality, const nb::callable& input)
{
  ResliceSettings settings{ToMatrix(axes), std::nullopt, turnsInput, crops, dimensionality};
  if (transform)
  {
    settings.transform = ToMatrix(*transform);
  }
  const auto derive = [&]
  {
    const nb::object found = input();
    if (nb::isinstance<Field>(found))
    {
      return GridOver(BoundsAlong(nb::cast<const Field&>(found), Eigen::Matrix3d::Identity()), kDefaultDimension);
    }
    const auto [step, start, indices] =
        nb::cast<std::tuple<std::array<double, 3>, std::array<double, 3>, Extent>>(found);
    return OutputGrid{Eigen::Vector3d(step.data()), Eigen::Vector3d(start.data()), indices};
  };
  return ToPython(ResliceGrid(Given(spacing, origin, extent), settings, derive));
}

/// `field()` gives the field.
nb::tuple GridOfVoxels(const Numbers& spacing, const Numbers& origin, const std::optional<std::array<int, 3>>& size,
                       const std::array<double, 9>& direction, int maximumDimension, const nb::callable& field)
{
  std::optional<Extent> extent;
  if (size)
  {
    extent = {0, (*size)[0] - 1, 0, (*size)[1] - 1, 0, (*size)[2] - 1};
  }
  const Eigen::Matrix3d axes = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(direction.data());
  const auto derive = [&]
  {
    const nb::object found = field();
    return GridOver(BoundsAlong(nb::cast<const Field&>(found), axes), maximumDimension);
  };
  return ToPython(VoxelGrid(Given(spacing, origin, extent), axes, derive));
}

Array PlaceOfIndices(const InputDoubles& axes, const std::optional<InputDoubles>& transform,
                     const std::array<double, 3>& spacing, const std::array<double, 3>& origin)
{
  const std::optional<Eigen::Matrix4d> after =
      transform ? std::optional<Eigen::Matrix4d>(ToMatrix(*transform)) : std::nullopt;
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = IndexToWorld(
      OutputToWorld(ToMatrix(axes), after), Eigen::Vector3d(spacing.data()), Eigen::Vector3d(origin.data()));
  return Owned(std::vector<double>(matrix.data(), matrix.data() + 16), {4, 4});
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
  field.labels = FitLabels(field, sweep, keepEmpty ? given : given.Subset(given.Drawn()), {engine});
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
    GaussianField shown = field;
    shown.beam = elevationSigma >= 0 ? Beam{elevationSigma} : field.beam;
    labelled_.emplace(shown, *field.labels, engine);
  }

  /// [height, width]
  Array Render(const InputDoubles& plane, int width, int height)
  {
    const SlicePlane at = SlicePlane::FromImageToReference(ToMatrix(plane), width, height);
    at.Validate("the plane");
    std::vector<std::uint8_t> map(at.NumberOfPixels());
    {
      const nb::gil_scoped_release others;
      const std::lock_guard<std::mutex> alone(mutex_);
      labelled_->Render(at, map.data());
    }
    return Owned(std::move(map), {static_cast<std::size_t>(height), static_cast<std::size_t>(width)});
  }

  /// [pixels] of part of a grid
  Array RenderPart(const InputDoubles& indexToWorld, const Extent& whole, const Extent& extent)
  {
    const GridPart grid{ToMatrix(indexToWorld), whole, extent};
    const auto count = static_cast<std::size_t>(ExtentSize(extent));
    std::vector<std::uint8_t> map(count);
    if (count > 0)
    {
      const nb::gil_scoped_release others;
      const std::lock_guard<std::mutex> alone(mutex_);
      labelled_->Render(grid, map.data());
    }
    return Owned(std::move(map), {count});
  }

private:
  std::optional<LabelledField> labelled_;
  std::mutex mutex_;
};

/// [height, width], of an image [height, width] at a plane.
Array StandardErrorAt(const nb::bytes& kept, const InputDoubles& plane, const InputFloats& image)
{
  RequireShape(image, {-1, -1}, "the image");
  const std::size_t h = image.shape(0), w = image.shape(1);
  const SlicePlane at = SlicePlane::FromImageToReference(ToMatrix(plane), static_cast<int>(w), static_cast<int>(h));
  at.Validate("the plane");
  const std::string bytes(kept.c_str(), kept.size());
  std::vector<float> sigma(h * w);
  {
    const nb::gil_scoped_release others;
    StandardError(bytes).Evaluate(at, image.data(), sigma.data());
  }
  return Owned(std::move(sigma), {h, w});
}

/// Of pixels that are not 0 in `where`, [height, width].
double StandardErrorOfMean(const nb::bytes& kept, const InputDoubles& plane, const InputFloats& sigma,
                           const InputBytes& where)
{
  RequireShape(sigma, {-1, -1}, "the standard errors");
  const auto h = static_cast<std::int64_t>(sigma.shape(0)), w = static_cast<std::int64_t>(sigma.shape(1));
  RequireShape(where, {h, w}, "the pixels to take");
  const SlicePlane at = SlicePlane::FromImageToReference(ToMatrix(plane), static_cast<int>(w), static_cast<int>(h));
  at.Validate("the plane");
  return StandardError(std::string(kept.c_str(), kept.size())).OfMean(at, sigma.data(), where.data());
}

Array DistancesOfGrid(const Sweep& sweep, const InputDoubles& indexToWorld, const Extent& extent)
{
  const Eigen::Matrix4d matrix = ToMatrix(indexToWorld);
  const auto count = static_cast<std::size_t>(ExtentSize(extent));
  std::vector<float> distances(count);
  {
    const nb::gil_scoped_release others;
    GridDistances(sweep, matrix, extent, distances.data());
  }
  return Owned(std::move(distances), {count});
}

}  // namespace

void BindSlices(nb::module_& m)
{
  nb::class_<Slicer>(m, "Renderer")
      .def(nb::init<const Field&, const std::string&, double, double, bool, std::optional<int>>(), nb::arg("field"),
           nb::arg("engine"), nb::arg("elevation_sigma"), nb::arg("tolerance"), nb::arg("sees_directions") = true,
           nb::arg("label").none() = nb::none())
      .def_prop_ro("device", &Slicer::Device)
      .def_prop_ro("mean_coverage", &Slicer::MeanCoverage)
      .def("render", &Slicer::Render, nb::arg("planes"), nb::arg("width"), nb::arg("height"), nb::arg("scattering"),
           nb::arg("coverage"))
      .def(
          "render_part",
          [](Slicer& slicer, const InputDoubles& indexToWorld, const Extent& whole, const Extent& extent,
             bool isScattering, bool isBytes, const std::tuple<int, double, int, bool>& slab,
             const std::pair<double, double>& seen, bool isCovered, bool isStencil, nb::object progress)
          {
            return slicer.RenderPart(indexToWorld, whole, extent, OutputOf(isScattering), isBytes, slab,
                                     {seen.first, seen.second}, isCovered, isStencil, std::move(progress));
          },
          nb::arg("index_to_world"), nb::arg("whole"), nb::arg("extent"), nb::arg("scattering"), nb::arg("bytes"),
          nb::arg("slab"), nb::arg("seen"), nb::arg("coverage"), nb::arg("stencil"), nb::arg("progress"))
      .def("standard_error_part", &Slicer::StandardErrorPart, nb::arg("kept"), nb::arg("index_to_world"),
           nb::arg("whole"), nb::arg("extent"), nb::arg("progress"));
  m.def("reslice_grid", &GridOfSlice, nb::arg("spacing").none(), nb::arg("origin").none(), nb::arg("extent").none(),
        nb::arg("axes"), nb::arg("transform").none(), nb::arg("turns_input"), nb::arg("crops"),
        nb::arg("dimensionality"), nb::arg("input"));
  m.def("voxel_grid", &GridOfVoxels, nb::arg("spacing").none(), nb::arg("origin").none(), nb::arg("dimensions").none(),
        nb::arg("direction"), nb::arg("maximum_dimension"), nb::arg("field"));
  m.def("index_to_world", &PlaceOfIndices, nb::arg("axes"), nb::arg("transform").none(), nb::arg("spacing"),
        nb::arg("origin"));
  m.def("grid_distances", &DistancesOfGrid, nb::arg("sweep"), nb::arg("index_to_world"), nb::arg("extent"));
  m.def("label", &Labelled, nb::arg("field"), nb::arg("sweep"), nb::arg("pictures"), nb::arg("frames"),
        nb::arg("names"), nb::arg("keep_empty"), nb::arg("engine"));
  nb::class_<LabelSlicer>(m, "LabelRenderer")
      .def(nb::init<const Field&, const std::string&, double>(), nb::arg("field"), nb::arg("engine"),
           nb::arg("elevation_sigma") = -1.0)
      .def("render", &LabelSlicer::Render, nb::arg("plane"), nb::arg("width"), nb::arg("height"))
      .def("render_part", &LabelSlicer::RenderPart, nb::arg("index_to_world"), nb::arg("whole"), nb::arg("extent"));
  m.def("standard_error", &StandardErrorAt, nb::arg("kept"), nb::arg("plane"), nb::arg("image"));
  m.def("standard_error_of_mean", &StandardErrorOfMean, nb::arg("kept"), nb::arg("plane"), nb::arg("sigma"),
        nb::arg("where"));
  m.def("check_output_size", &CheckOutputSize, nb::arg("extent"), nb::arg("maximum"));
  m.def(
      "check_pixel_type",
      [](const std::string& type, bool isScattering) { CheckPixelType(type, OutputOf(isScattering)); }, nb::arg("type"),
      nb::arg("scattering"));
}

}  // namespace bigus
