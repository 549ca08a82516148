// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sweeps whose truth is known at every plane.
#include <algorithm>
#include <array>
#include <memory>
#include <type_traits>

#include "Arrays.h"
#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Phantom/PhantomOptionList.h"
#include "Core/Training/OptionList.h"
#include "Progress.h"

namespace bigus
{
namespace
{

const std::vector<std::string> kScenes = {"organ", "speckle", "points"};
const std::vector<std::string> kProbes = {"linear", "convex", "sector"};

/// Whether an option is one number.
template <class T>
constexpr bool IsOne = std::is_arithmetic_v<std::decay_t<T>>;

/// Every option and its default.
nb::dict Defaults()
{
  const PhantomOptions options;
  nb::dict defaults;
  defaults["probe"] = kProbes[static_cast<std::size_t>(options.probe)];
  defaults["scene"] = kScenes[static_cast<std::size_t>(options.scene)];
  defaults["seed"] = options.seed;
  ForEachPhantomOption(options,
                       [&defaults](const PhantomNumber& number, const auto& value)
                       {
                         nb::object object = nb::cast(value);
                         const std::string name = SpellOption(number.name, '_');
                         defaults[name.c_str()] = IsOne<decltype(value)> ? object : nb::object(nb::tuple(object));
                       });
  return defaults;
}

template <class Choice>
void Choose(Choice& choice, const std::string& name, nb::handle value, const std::vector<std::string>& names)
{
  const auto text = nb::cast<std::string>(value);
  const auto found = std::find(names.begin(), names.end(), text);
  if (found == names.end())
  {
    throw nb::value_error(
        (name + " is one of " + names[0] + ", " + names[1] + ", " + names[2] + ", not " + text).c_str());
  }
  choice = static_cast<Choice>(found - names.begin());
}

/// bigus.Phantom has seen to it that there is an option of this name, whose value is of the right kind.
void Set(PhantomOptions& options, const std::string& name, nb::handle value)
{
  if (name == "scene")
  {
    Choose(options.scene, name, value, kScenes);
  }
  else if (name == "probe")
  {
    Choose(options.probe, name, value, kProbes);
  }
  ForEachPhantomOption(options,
                       [&](const PhantomNumber& number, auto& member)
                       {
                         if (name == SpellOption(number.name, '_'))
                         {
                           member = nb::cast<std::decay_t<decltype(member)>>(value);
                         }
                       });
}

/// Of no frames where `progress` stopped it.
std::shared_ptr<Sweep> SweepOf(const Phantom& phantom, const nb::object& progress)
{
  return WorkAlone(progress,
                   [&](PythonProgress& goOn) { return std::make_shared<Sweep>(phantom.MakeSweep(std::ref(goOn))); });
}

std::shared_ptr<Sweep> TruthOf(const Phantom& phantom, const Eigen::Matrix4d& pose, int width, int height)
{
  const nb::gil_scoped_release others;
  return std::make_shared<Sweep>(phantom.MakeTruth(SlicePlane::FromImageToReference(pose, width, height)));
}

Array FrameOf(const Phantom& phantom, const Eigen::Matrix4d& pose, int width, int height)
{
  return PictureAt<std::uint8_t>(pose, width, height,
                                 [&](const SlicePlane& plane, std::uint8_t* pixels) { phantom.Frame(plane, pixels); });
}

Array TruePosesOf(const Phantom& phantom)
{
  std::vector<Eigen::Matrix4d> poses;
  for (int k = 0; k < phantom.Options().frames; ++k)
  {
    poses.push_back(phantom.TruePlane(k).ImageToReference());
  }
  return PosesToArray(poses);
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
          "sweep", &SweepOf, "progress"_a = nb::none(),
          "The whole sweep, uint8, with the poses that the tracker recorded. progress(fraction) is called now and then; "
          "when it returns False the sweep has no frames.")
      .def("truth", &TruthOf, "plane"_a, "width"_a, "height"_a,
           "The truth at a plane as a sweep of one frame, with its pose and mask.")
      .def("frame", &FrameOf, "plane"_a, "width"_a, "height"_a,
           "The truth at a plane (4 x 4, pixel (i, j, 0, 1) to mm): uint8 [height, width].")
      .def_prop_ro(
          "size",
          [](const Phantom& phantom)
          { return nb::make_tuple(phantom.Options().width, phantom.Options().height, phantom.Options().frames); },
          "(width, height, frames).")
      .def_prop_ro("scatterers_per_resolution_cell", &Phantom::ScatterersPerResolutionCell,
                   "Mean number in parenchyma; fully developed speckle needs 10 or more.")
      .def_prop_ro("true_poses", &TruePosesOf, "Where the frames were taken: float64 [frames, 4, 4].");
}

}  // namespace bigus
