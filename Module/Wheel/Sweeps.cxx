// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sweeps, and what their poses and pixels tell.
#include <memory>

#include "Arrays.h"
#include "Core/Deciding/PoseCorrectionNumbers.h"
#include "Core/Inspection/Inspection.h"
#include "Core/Metrics/BackscatterFidelity.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Metrics/Texture.h"
#include "Core/Model/Error.h"
#include "Core/Model/FrameDistance.h"
#include "Core/Model/Sweep.h"
#include "Progress.h"

namespace bigus
{
namespace
{

/// A numpy array kept as long as the sweep that shares its memory. Python's lock is held where it is let go.
template <class Array>
std::shared_ptr<const void> Kept(const Array& array)
{
  return std::shared_ptr<const void>(array.data(),
                                     [kept = new Array(array)](const void*)
                                     {
                                       nb::gil_scoped_acquire lock;
                                       delete kept;
                                     });
}

template <class Frames, Sweep::PixelType Type>
std::shared_ptr<Sweep> MakeSweep(const Frames& frames, const InputDoubles& poses,
                                 const std::optional<InputDoubles>& timestamps, const std::optional<InputBytes>& mask)
{
  RequireShape(frames, {-1, -1, -1}, "frames");
  const auto count = static_cast<std::int64_t>(frames.shape(0));
  const auto height = static_cast<std::int64_t>(frames.shape(1)), width = static_cast<std::int64_t>(frames.shape(2));
  RequireShape(poses, {count, 4, 4}, "poses");
  auto sweep = std::make_shared<Sweep>();
  sweep->width = static_cast<int>(width);
  sweep->height = static_cast<int>(height);
  sweep->pixelType = Type;
  sweep->pixels = Kept(frames);
  for (std::int64_t k = 0; k < count; ++k)
  {
    sweep->imageToReference.push_back(MatrixAt(poses.data() + 16 * k));
  }
  if (timestamps)
  {
    RequireShape(*timestamps, {count}, "timestamps");
    sweep->timestamps.assign(timestamps->data(), timestamps->data() + count);
  }
  if (mask)
  {
    RequireShape(*mask, {height, width}, "mask");
    sweep->mask = std::make_shared<const std::vector<std::uint8_t>>(mask->data(), mask->data() + height * width);
  }
  const nb::gil_scoped_release others;
  sweep->Validate();
  return sweep;
}

template <class Pixel>
Array FramesAs(const Sweep& sweep, nb::handle self)
{
  return View(static_cast<const Pixel*>(sweep.pixels.get()),
              {static_cast<std::size_t>(sweep.NumberOfFrames()), static_cast<std::size_t>(sweep.height),
               static_cast<std::size_t>(sweep.width)},
              self);
}

Array FramesOf(nb::handle self)
{
  const auto& sweep = nb::cast<const Sweep&>(self);
  return sweep.pixelType == Sweep::PixelType::UInt8 ? FramesAs<std::uint8_t>(sweep, self)
                                                    : FramesAs<float>(sweep, self);
}

/// Eigen's matrices lie column by column.
Array PosesOf(nb::handle self)
{
  const auto& poses = nb::cast<const Sweep&>(self).imageToReference;
  return View(poses[0].data(), {poses.size(), 4, 4}, self, {16, 1, 4});
}

std::optional<Array> TimestampsOf(nb::handle self)
{
  const auto& times = nb::cast<const Sweep&>(self).timestamps;
  return times.empty() ? std::nullopt : std::optional(View(times.data(), {times.size()}, self));
}

std::optional<Array> MaskOf(nb::handle self)
{
  const auto& sweep = nb::cast<const Sweep&>(self);
  const std::size_t h = static_cast<std::size_t>(sweep.height), w = static_cast<std::size_t>(sweep.width);
  return sweep.mask ? std::optional(View(sweep.mask->data(), {h, w}, self)) : std::nullopt;
}

nb::object Correct(const std::shared_ptr<Sweep>& sweep, std::optional<double> strength, int holdOut,
                   const nb::object& progress)
{
  const auto correct = [&](PythonProgress& goOn)
  {
    const auto [frames, heldOut] = SplitHoldOut(sweep->NumberOfFrames(), holdOut);
    return CorrectPoses(*sweep, frames, {strength}, std::ref(goOn));
  };
  const PoseCorrection found = WorkAlone(progress, correct);
  if (found.aborted)
  {
    return nb::none();
  }
  nb::list steps;
  for (const PoseStep& step : found.steps)
  {
    steps.append(Dict("from", step.from, "to", step.to, "share", step.share, "share_error", step.shareError, "gain",
                      step.gain, "gain_error", step.gainError, "revisit_share", step.revisitShare, "revisit_error",
                      step.revisitError, "taken", step.isTaken));
  }
  nb::list numbers;  // (name, names of components, [tuples, components])
  for (NamedNumbers& one : NumbersOf(found))
  {
    const std::size_t count = one.components.size(), tuples = one.values.size() / count;
    numbers.append(nb::make_tuple(one.name, one.components, Owned(std::move(one.values), {tuples, count})));
  }
  const Trajectory& path = found.trajectory;
  return Dict("sweep", std::make_shared<Sweep>(AtCorrectedPoses(*sweep, found)), "displacement",
              Owned(path.displacement), "rotation", Owned(path.rotation), "outlier", Owned(path.isOutlier), "stroke",
              Owned(path.stroke), "numbers", numbers, "constant_errors_applied", found.constant.IsSignificant(),
              "strength", found.strength, "steps", steps, "decision",
              Dict("choice", found.decision.choice, "evidence", found.decision.evidence));
}

/// The scores of an image, by their names in Python. With `texture` also every number of the comparison of textures, by the
/// name it has in tables, and both spectra.
nb::dict Compare(const InputFloats& image, const InputFloats& truth, bool texture)
{
  RequireShape(image, {-1, -1}, "the image");
  const int height = static_cast<int>(image.shape(0)), width = static_cast<int>(image.shape(1));
  RequireShape(truth, {height, width}, "the truth");
  double psnr, ssim;
  BackscatterFidelity bfs;
  TextureComparison compared;
  {
    const nb::gil_scoped_release others;
    psnr = Psnr(image.data(), truth.data(), image.size());
    ssim = Ssim(image.data(), truth.data(), width, height);
    bfs = Bfs(image.data(), truth.data(), width, height);
    if (texture)
    {
      compared = CompareTexture(image.data(), truth.data(), width, height);
    }
  }
  nb::dict scores = Dict("psnr", psnr, "ssim", ssim, "bfs", bfs.score, "mean_contrast", bfs.meanContrast,
                         "contrast_distribution", bfs.contrastDistribution, "rayleigh", bfs.rayleigh);
  if (texture)
  {
    ForEachNumber(compared, [&](const std::string& name, double value) { scores[name.c_str()] = value; });
    const auto& seen = compared.image.power;
    const auto& due = compared.truth.power;
    Put(scores, "ImageSpectrum", Owned(std::vector<double>(seen.begin(), seen.end())), "TruthSpectrum",
        Owned(std::vector<double>(due.begin(), due.end())));
  }
  return scores;
}

Array Distances(const Sweep& sweep, const std::vector<int>& frames, const Eigen::Matrix4d& plane, int width, int height)
{
  for (const int frame : frames)
  {
    Require(frame >= 0 && frame < sweep.NumberOfFrames(), "there is no frame ", frame, " among ",
            sweep.NumberOfFrames());
  }
  return PictureAt<float>(plane, width, height,
                          [&](const SlicePlane& at, float* pixels) { DistanceToFrames(sweep, frames, at, pixels); });
}

/// A row a finding, and for every frame 1 + the kind for which it is left out, or 0. `numbers` says how frames are called.
nb::tuple Inspected(const std::shared_ptr<Sweep>& sweep, const std::string& keep, const std::vector<int>& numbers)
{
  InspectedSweep found;
  {
    const nb::gil_scoped_release others;
    Require(numbers.size() == sweep->imageToReference.size(), "inspect: ", numbers.size(), " numbers for ",
            sweep->NumberOfFrames(), " frames; give one a frame.");
    found = Inspect(sweep, KeptKinds::Parse(keep));
  }
  std::vector<int> reasons(numbers.size(), 0);
  nb::list rows;
  for (const Finding& finding : found.findings)
  {
    rows.append(Dict("kind", NameOf(finding.kind), "frames", finding.frames.size(), "pixels", finding.pixels, "applied",
                     finding.isApplied, "text", Describe(finding, numbers)));
    for (const int frame : finding.LeftOut())
    {
      reasons[frame] = 1 + static_cast<int>(finding.kind);
    }
  }
  return nb::make_tuple(rows, reasons);
}

std::shared_ptr<Sweep> Joined(const std::vector<std::shared_ptr<Sweep>>& sweeps)
{
  return sweeps.size() == 1 ? sweeps[0] : std::make_shared<Sweep>(*Join({sweeps.begin(), sweeps.end()}));
}

std::string TextOf(const Sweep& sweep)
{
  return "<bigus.Sweep of " + std::to_string(sweep.NumberOfFrames()) + " frames, " + std::to_string(sweep.width) +
         " x " + std::to_string(sweep.height) + " pixels>";
}

}  // namespace

Array PosesToArray(const std::vector<Eigen::Matrix4d>& poses)
{
  return Owned(RowByRow(poses), {poses.size(), 4, 4});
}

void BindSweep(nb::module_& m)
{
  nb::class_<Sweep>(
      m, "Sweep",
      "Frames of equal size, each with a pose in one world frame. It does not change; bigus.sweep() makes "
      "one of arrays, whose memory it shares.")
      .def_prop_ro("frames", &FramesOf,
                   "The pixels: uint8 or float32 in [0, 1], [frames, height, width], a view that cannot be written to.")
      .def_prop_ro("poses", &PosesOf,
                   "ImageToReference: float64 [frames, 4, 4], a view. poses[k] @ (i, j, 0, 1) is where pixel column i, "
                   "row j of frame k lies, mm.")
      .def_prop_ro("timestamps", &TimestampsOf, "float64 [frames], seconds, a view; or None.")
      .def_prop_ro("mask", &MaskOf, "uint8 [height, width], 0 where the probe lights nothing; or None.")
      .def_ro("width", &Sweep::width, "Pixels of a row.")
      .def_ro("height", &Sweep::height, "Rows.")
      .def("__len__", &Sweep::NumberOfFrames)
      .def("__repr__", &TextOf);
  const auto times = "timestamps"_a.none(), mask = "mask"_a.none();
  m.def("sweep_of_bytes", &MakeSweep<InputBytes, Sweep::PixelType::UInt8>, "frames"_a, "poses"_a, times, mask);
  m.def("sweep_of_floats", &MakeSweep<InputFloats, Sweep::PixelType::Float32>, "frames"_a, "poses"_a, times, mask);
  m.def("join", &Joined, "sweeps"_a);
  m.def("correct_poses", &Correct, "sweep"_a, "strength"_a.none(), "hold_out"_a, "progress"_a = nb::none());
  m.def("inspect", &Inspected, "sweep"_a, "keep"_a, "numbers"_a);
  m.def("compare", &Compare, "image"_a, "truth"_a, "texture"_a = false);
  m.def("distances", &Distances, "sweep"_a, "frames"_a, "plane"_a, "width"_a, "height"_a);
}

}  // namespace bigus
