// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sweeps whose truth is known at every plane.
#include <memory>

#include "Arrays.h"
#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
#include "Progress.h"

namespace bigus
{
namespace
{

struct Number
{
  const char* name;
  double PhantomOptions::*member;
};
constexpr Number kNumbers[] = {
    {"pixel_size", &PhantomOptions::pixelSize},
    {"probe_radius", &PhantomOptions::probeRadius},
    {"half_angle", &PhantomOptions::halfAngle},
    {"frequency", &PhantomOptions::frequency},
    {"axial_sigma", &PhantomOptions::axialSigma},
    {"lateral_sigma", &PhantomOptions::lateralSigma},
    {"elevation_sigma", &PhantomOptions::elevationSigma},
    {"scatterer_density", &PhantomOptions::scattererDensity},
    {"attenuation", &PhantomOptions::attenuation},
    {"dynamic_range", &PhantomOptions::dynamicRange},
    {"white_level", &PhantomOptions::whiteLevel},
    {"frame_spacing", &PhantomOptions::frameSpacing},
    {"speed_variation", &PhantomOptions::speedVariation},
    {"tilt", &PhantomOptions::tilt},
    {"wander", &PhantomOptions::wander},
    {"sweep_angle", &PhantomOptions::sweepAngle},
    {"frame_rate", &PhantomOptions::frameRate},
    {"dropped_share", &PhantomOptions::droppedShare},
    {"shake", &PhantomOptions::shake},
    {"shake_rotation", &PhantomOptions::shakeRotation},
    {"shake_correlation", &PhantomOptions::shakeCorrelation},
    {"tracking_noise", &PhantomOptions::trackingNoise},
    {"tracking_rotation_noise", &PhantomOptions::trackingRotationNoise},
    {"noise_correlation", &PhantomOptions::noiseCorrelation},
    {"tracking_drift", &PhantomOptions::trackingDrift},
    {"tracking_rotation_drift", &PhantomOptions::trackingRotationDrift},
    {"outlier_share", &PhantomOptions::outlierShare},
    {"outlier_size", &PhantomOptions::outlierSize},
    {"tracking_delay", &PhantomOptions::trackingDelay},
    {"tracking_quantum", &PhantomOptions::trackingQuantum},
    {"tracking_rotation_quantum", &PhantomOptions::trackingRotationQuantum},
};

struct Count
{
  const char* name;
  int PhantomOptions::*member;
};
constexpr Count kCounts[] = {{"frames", &PhantomOptions::frames},
                             {"width", &PhantomOptions::width},
                             {"height", &PhantomOptions::height},
                             {"passes", &PhantomOptions::passes}};

const std::vector<std::string> kScenes = {"organ", "speckle", "points"};
const std::vector<std::string> kProbes = {"linear", "convex", "sector"};

/// Every option and its default.
nb::dict Defaults()
{
  const PhantomOptions options;
  nb::dict defaults;
  defaults["probe"] = kProbes[static_cast<std::size_t>(options.probe)];
  defaults["scene"] = kScenes[static_cast<std::size_t>(options.scene)];
  defaults["seed"] = options.seed;
  for (const Count& count : kCounts)
  {
    defaults[count.name] = options.*count.member;
  }
  for (const Number& number : kNumbers)
  {
    defaults[number.name] = options.*number.member;
  }
  defaults["calibration_shift"] = nb::tuple(nb::cast(options.calibrationShift));
  defaults["calibration_rotation"] = nb::tuple(nb::cast(options.calibrationRotation));
  return defaults;
}

template <class Choice>
Choice Chosen(const std::string& name, nb::handle value, const std::vector<std::string>& names)
{
  const std::string text = nb::cast<std::string>(value);
  std::string known;
  for (std::size_t i = 0; i < names.size(); ++i)
  {
    if (names[i] == text)
    {
      return static_cast<Choice>(i);
    }
    known += (i ? ", " : "") + names[i];
  }
  throw nb::value_error((name + " is one of " + known + ", not " + text).c_str());
}

void Set(PhantomOptions& options, const std::string& name, nb::handle value)
{
  for (const Number& number : kNumbers)
  {
    if (name == number.name)
    {
      options.*number.member = nb::cast<double>(value);
      return;
    }
  }
  for (const Count& count : kCounts)
  {
    if (name == count.name)
    {
      options.*count.member = nb::cast<int>(value);
      return;
    }
  }
  if (name == "seed")
  {
    options.seed = nb::cast<std::int64_t>(value);
  }
  else if (name == "scene")
  {
    options.scene = Chosen<PhantomScene>(name, value, kScenes);
  }
  else if (name == "probe")
  {
    options.probe = Chosen<ProbeKind>(name, value, kProbes);
  }
  else if (name == "calibration_shift" || name == "calibration_rotation")
  {
    const auto numbers = nb::cast<std::vector<double>>(value);
    if (numbers.size() != 3)
    {
      throw nb::value_error((name + " has 3 numbers, not " + std::to_string(numbers.size())).c_str());
    }
    auto& to = name == "calibration_shift" ? options.calibrationShift : options.calibrationRotation;
    std::copy(numbers.begin(), numbers.end(), to.begin());
  }
  else
  {
    throw nb::type_error(("a phantom has no option " + name).c_str());
  }
}

/// Of no frames where `progress` stopped it.
std::shared_ptr<Sweep> SweepOf(const Phantom& phantom, const nb::object& progress)
{
  PythonProgress calls(progress);
  auto sweep = std::make_shared<Sweep>();
  {
    const nb::gil_scoped_release others;
    *sweep = phantom.MakeSweep([&](double fraction) { return calls(fraction); });
  }
  calls.Rethrow();
  return sweep;
}

std::shared_ptr<Sweep> TruthOf(const Phantom& phantom, const InputDoubles& pose, int width, int height)
{
  RequireShape(pose, {4, 4}, "the plane");
  const SlicePlane plane = SlicePlane::FromImageToReference(MatrixAt(pose.data()), width, height);
  const nb::gil_scoped_release others;
  return std::make_shared<Sweep>(phantom.MakeTruth(plane));
}

Array FrameOf(const Phantom& phantom, const InputDoubles& pose, int width, int height)
{
  RequireShape(pose, {4, 4}, "the plane");
  const SlicePlane plane = SlicePlane::FromImageToReference(MatrixAt(pose.data()), width, height);
  plane.Validate("plane");
  std::vector<std::uint8_t> image(plane.NumberOfPixels());
  {
    const nb::gil_scoped_release others;
    phantom.Frame(plane, image.data());
  }
  return Owned(std::move(image), {static_cast<std::size_t>(height), static_cast<std::size_t>(width)});
}

}  // namespace

void BindPhantom(nb::module_& m)
{
  m.def("phantom_options", &Defaults, "Every option of a phantom, and its default.");
  nb::class_<Phantom>(m, "Phantom", "What bigus.Phantom is made of; its options are keywords of phantom_options().")
      .def("__init__",
           [](Phantom* self, nb::kwargs kwargs)
           {
             PhantomOptions options;
             for (const auto& [name, value] : kwargs)
             {
               Set(options, nb::cast<std::string>(name), value);
             }
             new (self) Phantom(options);
           })
      .def(
          "sweep", &SweepOf, nb::arg("progress") = nb::none(),
          "The whole sweep, uint8, with the poses that the tracker recorded. progress(fraction) is called now and then; "
          "when it returns False the sweep has no frames.")
      .def("truth", &TruthOf, nb::arg("plane"), nb::arg("width"), nb::arg("height"),
           "The truth at a plane as a sweep of one frame, with its pose and mask.")
      .def("frame", &FrameOf, nb::arg("plane"), nb::arg("width"), nb::arg("height"),
           "The truth at a plane (4 x 4, pixel (i, j, 0, 1) to mm): uint8 [height, width].")
      .def_prop_ro(
          "size",
          [](const Phantom& phantom)
          { return nb::make_tuple(phantom.Options().width, phantom.Options().height, phantom.Options().frames); },
          "(width, height, frames).")
      .def_prop_ro("scatterers_per_resolution_cell", &Phantom::ScatterersPerResolutionCell,
                   "Mean number in parenchyma; fully developed speckle needs 10 or more.")
      .def_prop_ro(
          "true_poses",
          [](const Phantom& phantom)
          {
            std::vector<Eigen::Matrix4d> poses;
            for (int k = 0; k < phantom.Options().frames; ++k)
            {
              poses.push_back(phantom.TruePlane(k).ImageToReference());
            }
            return PosesToArray(poses);
          },
          "Where the frames were taken: float64 [frames, 4, 4].");
}

}  // namespace bigus
