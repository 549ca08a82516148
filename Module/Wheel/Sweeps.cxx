// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sweeps, and what their poses and pixels tell.
#include <memory>

#include "Arrays.h"
#include "Core/Deciding/PoseCorrection.h"
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

template <class Array>
std::shared_ptr<Sweep> MakeSweep(const Array& frames, Sweep::PixelType type, const InputDoubles& poses,
                                 const std::optional<InputDoubles>& timestamps, const std::optional<InputBytes>& mask)
{
  RequireShape(frames, {-1, -1, -1}, "frames");
  const auto count = static_cast<std::int64_t>(frames.shape(0));
  const auto height = static_cast<std::int64_t>(frames.shape(1)), width = static_cast<std::int64_t>(frames.shape(2));
  RequireShape(poses, {count, 4, 4}, "poses");
  auto sweep = std::make_shared<Sweep>();
  sweep->width = static_cast<int>(width);
  sweep->height = static_cast<int>(height);
  sweep->pixelType = type;
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

Array FramesOf(nb::handle self)
{
  const auto& sweep = nb::cast<const Sweep&>(self);
  const auto n = static_cast<std::size_t>(sweep.NumberOfFrames()), h = static_cast<std::size_t>(sweep.height),
             w = static_cast<std::size_t>(sweep.width);
  return sweep.pixelType == Sweep::PixelType::UInt8
             ? View(static_cast<const std::uint8_t*>(sweep.pixels.get()), {n, h, w}, self)
             : View(static_cast<const float*>(sweep.pixels.get()), {n, h, w}, self);
}

/// Eigen's matrices lie column by column.
Array PosesOf(nb::handle self)
{
  const auto& sweep = nb::cast<const Sweep&>(self);
  return View(static_cast<const double*>(sweep.imageToReference[0].data()), {sweep.imageToReference.size(), 4, 4}, self,
              {16, 1, 4});
}

std::optional<Array> TimestampsOf(nb::handle self)
{
  const auto& sweep = nb::cast<const Sweep&>(self);
  if (sweep.timestamps.empty())
  {
    return std::nullopt;
  }
  return View(static_cast<const double*>(sweep.timestamps.data()), {sweep.timestamps.size()}, self);
}

std::optional<Array> MaskOf(nb::handle self)
{
  const auto& sweep = nb::cast<const Sweep&>(self);
  if (!sweep.mask)
  {
    return std::nullopt;
  }
  return View(static_cast<const std::uint8_t*>(sweep.mask->data()),
              {static_cast<std::size_t>(sweep.height), static_cast<std::size_t>(sweep.width)}, self);
}

/// Delay, three shifts, three rotations: [estimate, standard error, whether pictures tell it; 7].
Array ConstantErrorsToArray(const ConstantErrors& errors)
{
  std::vector<double> numbers(3 * 7);
  const ConstantError* all[] = {&errors.delay,       &errors.shift[0],    &errors.shift[1],   &errors.shift[2],
                                &errors.rotation[0], &errors.rotation[1], &errors.rotation[2]};
  for (int k = 0; k < 7; ++k)
  {
    numbers[k] = all[k]->value;
    numbers[7 + k] = all[k]->standardError;
    numbers[14 + k] = all[k]->isObservable ? 1 : 0;
  }
  return Owned(std::move(numbers), {3, 7});
}

/// Of the delay, the calibration and the alignment: [share, standard error, dB, whether it is taken; 3 x 4]; not numbers where
/// not asked.
Array ConfirmedStepsToArray(const PoseCorrection& found)
{
  std::vector<double> numbers;
  for (const ConfirmedStep* step : {&found.constant.delayStep, &found.constant.calibrationStep, &found.alignment})
  {
    numbers.insert(numbers.end(), {step->share, step->shareError, step->gain, step->isTaken ? 1.0 : 0.0});
  }
  return Owned(std::move(numbers), {3, 4});
}

nb::object Correct(const std::shared_ptr<Sweep>& sweep, std::optional<double> strength, int holdOut,
                   const nb::object& progress)
{
  PoseCorrection found;
  std::shared_ptr<Sweep> corrected;
  PythonProgress calls(progress);
  {
    const nb::gil_scoped_release others;
    const auto [frames, heldOut] = SplitHoldOut(sweep->NumberOfFrames(), holdOut);
    found = CorrectPoses(*sweep, frames, {strength}, [&](double fraction) { return calls(fraction); });
    if (!found.aborted)
    {
      corrected = std::make_shared<Sweep>(AtCorrectedPoses(*sweep, found));
    }
  }
  calls.Rethrow();
  if (found.aborted)
  {
    return nb::none();
  }
  const Trajectory& path = found.trajectory;
  const std::size_t n = path.displacement.size();
  nb::dict noise, decision, result;
  noise["translation"] = path.translationNoise;
  noise["rotation"] = path.rotationNoise;
  noise["corner"] = path.cornerNoise;
  decision["choice"] = found.decision.choice;
  decision["evidence"] = found.decision.evidence;
  result["sweep"] = corrected;
  result["displacement"] = Owned(path.displacement, {n});
  result["rotation"] = Owned(path.rotation, {n});
  result["outlier"] = Owned(path.isOutlier, {n});
  result["stroke"] = Owned(path.stroke, {n});
  result["noise"] = noise;
  result["constant_errors"] = ConstantErrorsToArray(found.constant);
  result["constant_errors_applied"] = found.constant.IsSignificant();
  result["confirmed_steps"] = ConfirmedStepsToArray(found);
  result["strength"] = found.strength;
  nb::list steps;
  for (const PoseStep& step : found.steps)
  {
    nb::dict row;
    row["from"] = step.from;
    row["to"] = step.to;
    row["share"] = step.share;
    row["share_error"] = step.shareError;
    row["gain"] = step.gain;
    row["gain_error"] = step.gainError;
    row["revisit_share"] = step.revisitShare;
    row["revisit_error"] = step.revisitError;
    row["taken"] = step.isTaken;
    steps.append(row);
  }
  result["steps"] = steps;
  result["decision"] = decision;
  return result;
}

nb::dict Compare(const InputFloats& image, const InputFloats& truth)
{
  RequireShape(image, {-1, -1}, "the image");
  RequireShape(truth, {static_cast<std::int64_t>(image.shape(0)), static_cast<std::int64_t>(image.shape(1))},
               "the truth");
  const int height = static_cast<int>(image.shape(0)), width = static_cast<int>(image.shape(1));
  double psnr, ssim;
  BackscatterFidelity bfs;
  {
    const nb::gil_scoped_release others;
    psnr = Psnr(image.data(), truth.data(), image.size());
    ssim = Ssim(image.data(), truth.data(), width, height);
    bfs = Bfs(image.data(), truth.data(), width, height);
  }
  nb::dict scores;
  scores["psnr"] = psnr;
  scores["ssim"] = ssim;
  scores["bfs"] = bfs.score;
  scores["mean_contrast"] = bfs.meanContrast;
  scores["contrast_distribution"] = bfs.contrastDistribution;
  scores["rayleigh"] = bfs.rayleigh;
  return scores;
}

/// Every number of a comparison by the name it has in tables, and both spectra.
nb::dict CompareTextures(const InputFloats& image, const InputFloats& truth)
{
  RequireShape(image, {-1, -1}, "the image");
  RequireShape(truth, {static_cast<std::int64_t>(image.shape(0)), static_cast<std::int64_t>(image.shape(1))},
               "the truth");
  TextureComparison texture;
  {
    const nb::gil_scoped_release others;
    texture =
        CompareTexture(image.data(), truth.data(), static_cast<int>(image.shape(1)), static_cast<int>(image.shape(0)));
  }
  nb::dict numbers;
  ForEachNumber(texture, [&](const std::string& name, double value) { numbers[name.c_str()] = value; });
  for (const auto& [name, power] :
       {std::pair("ImageSpectrum", &texture.image.power), std::pair("TruthSpectrum", &texture.truth.power)})
  {
    numbers[name] = Owned(std::vector<double>(power->begin(), power->end()), {power->size()});
  }
  return numbers;
}

Array Distances(const Sweep& sweep, const std::vector<int>& frames, const InputDoubles& pose, int width, int height)
{
  RequireShape(pose, {4, 4}, "the plane");
  const SlicePlane plane = SlicePlane::FromImageToReference(MatrixAt(pose.data()), width, height);
  plane.Validate("slice plane");
  std::vector<float> distances(plane.NumberOfPixels());
  {
    const nb::gil_scoped_release others;
    for (const int frame : frames)
    {
      Require(frame >= 0 && frame < sweep.NumberOfFrames(), "there is no frame ", frame, " among ",
              sweep.NumberOfFrames());
    }
    DistanceToFrames(sweep, frames, plane, distances.data());
  }
  return Owned(std::move(distances), {static_cast<std::size_t>(height), static_cast<std::size_t>(width)});
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
    nb::dict row;
    row["kind"] = NameOf(finding.kind);
    row["frames"] = finding.frames.size();
    row["pixels"] = finding.pixels;
    row["applied"] = finding.isApplied;
    row["text"] = Describe(finding, numbers);
    rows.append(row);
    for (const int frame : finding.LeftOut())
    {
      reasons[frame] = 1 + static_cast<int>(finding.kind);
    }
  }
  return nb::make_tuple(rows, reasons);
}

}  // namespace

Array PosesToArray(const std::vector<Eigen::Matrix4d>& poses)
{
  std::vector<double> numbers;
  for (const Eigen::Matrix4d& pose : poses)
  {
    for (int k = 0; k < 16; ++k)
    {
      numbers.push_back(pose(k / 4, k % 4));
    }
  }
  return Owned(std::move(numbers), {poses.size(), 4, 4});
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
      .def_prop_ro(
          "width", [](const Sweep& s) { return s.width; }, "Pixels of a row.")
      .def_prop_ro(
          "height", [](const Sweep& s) { return s.height; }, "Rows.")
      .def("__len__", &Sweep::NumberOfFrames)
      .def("__repr__",
           [](const Sweep& s)
           {
             return "<bigus.Sweep of " + std::to_string(s.NumberOfFrames()) + " frames, " + std::to_string(s.width) +
                    " x " + std::to_string(s.height) + " pixels>";
           });
  m.def(
      "sweep_of_bytes",
      [](const InputBytes& f, const InputDoubles& p, std::optional<InputDoubles> t, std::optional<InputBytes> k)
      { return MakeSweep(f, Sweep::PixelType::UInt8, p, t, k); },
      nb::arg("frames"), nb::arg("poses"), nb::arg("timestamps").none(), nb::arg("mask").none());
  m.def(
      "sweep_of_floats",
      [](const InputFloats& f, const InputDoubles& p, std::optional<InputDoubles> t, std::optional<InputBytes> k)
      { return MakeSweep(f, Sweep::PixelType::Float32, p, t, k); },
      nb::arg("frames"), nb::arg("poses"), nb::arg("timestamps").none(), nb::arg("mask").none());
  m.def(
      "join",
      [](const std::vector<std::shared_ptr<Sweep>>& sweeps)
      {
        const std::vector<std::shared_ptr<const Sweep>> sequences(sweeps.begin(), sweeps.end());
        return sweeps.size() == 1 ? sweeps[0] : std::make_shared<Sweep>(*Join(sequences));
      },
      nb::arg("sweeps"));
  m.def("correct_poses", &Correct, nb::arg("sweep"), nb::arg("strength").none(), nb::arg("hold_out"),
        nb::arg("progress") = nb::none());
  m.def("inspect", &Inspected, nb::arg("sweep"), nb::arg("keep"), nb::arg("numbers"));
  m.def("compare", &Compare, nb::arg("image"), nb::arg("truth"));
  m.def("compare_textures", &CompareTextures, nb::arg("image"), nb::arg("truth"));
  m.def("distances", &Distances, nb::arg("sweep"), nb::arg("frames"), nb::arg("plane"), nb::arg("width"),
        nb::arg("height"));
}

}  // namespace bigus
