// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field on an engine, ready for many slices.
#include <cmath>
#include <memory>
#include <mutex>

#include "Arrays.h"
#include "Core/Engine/Engine.h"
#include "Core/Model/Error.h"
#include "Core/Model/Sweep.h"

namespace bigus
{
namespace
{

constexpr double kMostPixels = 4294967296.0;  // 2^32 of one call: 16 GiB of floats

/// An engine is used by one thread at a time.
class Slicer
{
public:
  Slicer(const Field& field, const std::string& engine, double elevationSigma, double tolerance)
  {
    const nb::gil_scoped_release others;
    if (!(tolerance >= 0 && tolerance <= 1))
    {
      throw Error("The tolerance is " + std::to_string(tolerance) + "; it must lie between 0 and 1.");
    }
    if (!std::isfinite(elevationSigma))
    {
      throw Error(
          "The elevation sigma is not finite; give mm, 0 for a thin plane, or a negative number for the field's.");
    }
    engine_ = Engine::Create(engine);
    GaussianField shown = field;
    if (elevationSigma >= 0)
    {
      shown.beam = Beam{elevationSigma};
    }
    Accuracy accuracy;
    accuracy.tolerance = tolerance;
    engine_->SetAccuracy(accuracy);
    engine_->SetField(shown);
  }

  std::string Device() const { return engine_->Device(); }

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
      engine_->RenderStack(planes, isScattering ? ViewOutput::Scattering : ViewOutput::Intensity, images.data(),
                           isCovered ? coverage.data() : nullptr);
    }
    const auto h = static_cast<std::size_t>(height), w = static_cast<std::size_t>(width);
    const nb::object image = Owned(std::move(images), {n, h, w});
    return nb::make_tuple(image, isCovered ? nb::object(Owned(std::move(coverage), {n, h, w})) : nb::none());
  }

private:
  std::unique_ptr<Engine> engine_;
  std::mutex mutex_;
};

}  // namespace

void BindSlices(nb::module_& m)
{
  nb::class_<Slicer>(m, "Renderer")
      .def(nb::init<const Field&, const std::string&, double, double>(), nb::arg("field"), nb::arg("engine"),
           nb::arg("elevation_sigma"), nb::arg("tolerance"))
      .def_prop_ro("device", &Slicer::Device)
      .def("render", &Slicer::Render, nb::arg("planes"), nb::arg("width"), nb::arg("height"), nb::arg("scattering"),
           nb::arg("coverage"));
}

}  // namespace bigus
