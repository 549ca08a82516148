// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Runs one experiment, described in JSON, and prints what came of it, in JSON: a sweep, which of its frames
// may be seen, a method that predicts the others, and its scores. README.md of this folder lists what can be
// asked for.
#include <tbb/info.h>
#include <vtkNew.h>
#include <vtkPolyData.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "Core/Deciding/PoseCorrection.h"
#include "Core/Engine/Engine.h"
#include "Core/Engine/ViewEngine.h"
#include "Core/Evaluation/Baselines.h"
#include "Core/Evaluation/Compounding.h"
#include "Core/Evaluation/CrossPlanes.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Model/Error.h"
#include "Core/Poses/PoseError.h"
#include "Core/Probe/ElevationEstimate.h"
#include "Core/StandardError/StandardError.h"
#include "Core/Trainer/Provenance.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/FrameInterpolation.h"
#include "Core/Training/OptionList.h"
#include "Core/Training/Seeding.h"
#include "Data/FieldData.h"
#include "JobFields.h"
#include "KnownPlanes.h"
#include "OtherPlanes.h"
#include "Outside.h"
#include "Scene.h"
#include "UltraGaussEngine.h"
#include "vtkBigusFieldReader.h"

using namespace bigus;
using Json = nlohmann::json;

namespace
{

constexpr int LeastSquares = 50;  // over which means are taken; fewer tell of these squares only
constexpr std::size_t GaussianBytes = 11 * sizeof(float);  // mean, scales, rotation, reflectivity

double SecondsSince(std::chrono::steady_clock::time_point start)
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// ---- which frames may be seen ----

struct Split
{
  std::vector<int> training, heldOut;
};

Split ReadSplit(const Json& description, int count)
{
  JobFields fields(description, "frames");
  Split split;
  const auto add = [&split](bool train, int frame) { (train ? split.training : split.heldOut).push_back(frame); };
  if (fields.Has("hold_out"))
  {
    std::tie(split.training, split.heldOut) = SplitHoldOut(count, fields.Required<int>("hold_out"));
  }
  else if (fields.Has("every"))
  {
    const int step = fields.Required<int>("every");
    if (step < 1)
    {
      throw Error("frames: 'every' must be at least 1.");
    }
    // What lies behind the last of them is in neither set: nothing encloses it.
    for (int frame = 0; frame <= (count - 1) / step * step; ++frame)
    {
      add(frame % step == 0, frame);
    }
  }
  else if (fields.Has("first"))
  {
    const int wanted = fields.Required<int>("first");
    if (wanted < 2 || wanted >= count)
    {
      throw Error("frames: 'first' must be 2 to " + std::to_string(count - 1) + ".");
    }
    for (int frame = 0; frame < count; ++frame)
    {
      add(frame < wanted, frame);
    }
  }
  else if (fields.Has("spread"))
  {
    // So many, evenly spread from the first to the last.
    const int wanted = fields.Required<int>("spread");
    if (wanted < 2 || wanted > count)
    {
      throw Error("frames: 'spread' must be 2 to " + std::to_string(count) + ".");
    }
    std::set<int> chosen;
    for (int k = 0; k < wanted; ++k)
    {
      chosen.insert(static_cast<int>(std::lround(k * (count - 1.0) / (wanted - 1))));
    }
    for (int frame = 0; frame < count; ++frame)
    {
      add(chosen.count(frame) > 0, frame);
    }
  }
  else
  {
    // Held out, for any gap: the middle of every whole period. Trained on: frames `gap` away from those, and
    // on in steps of twice the gap.
    const int gap = fields.Required<int>("gap"), period = fields.Required<int>("period");
    if (gap < 1 || period % (2 * gap) != 0)
    {
      throw Error("frames: 'period' must be a multiple of twice the 'gap'.");
    }
    for (int frame = 0; frame < count; ++frame)
    {
      const int fromHeldOut = (frame + period / 2) % period;
      if (fromHeldOut % (2 * gap) == gap)
      {
        split.training.push_back(frame);
      }
      else if (fromHeldOut == 0 && frame + period / 2 < count)
      {
        split.heldOut.push_back(frame);
      }
    }
  }
  fields.Done();
  if (split.training.empty())
  {
    throw Error("frames: none of the " + std::to_string(count) + " frames is left to train on.");
  }
  return split;
}

// ---- methods ----

/// What predicts frames, and what it cost.
struct Method
{
  std::function<void(int, float*)> predict;
  std::function<void(const SlicePlane&, float*)> predictPlane;  ///< any plane; empty: frames of the sweep only
  std::string engine;                                           ///< that renders it
  std::optional<GaussianField> field;                           ///< of trained methods, which alone can be aligned to
  std::shared_ptr<const TrainingResult> training;               ///< of those that this job trains
  bool seesItsOwnFrame = true;  ///< false: knows frames by their neighbours only, so training frames have no score
  double seconds = 0;           ///< to prepare
  double bytes = 0;             ///< of what must be kept to render
  Json facts = Json::object();
};

/// The trainer's options by their names in snake_case. Seed and held-out frames are the job's own.
TrainerOptions ReadTrainerOptions(JobFields& fields, TrainerOptions options)
{
  for (const OptionText& option : ListOptions())
  {
    const std::string name = option.info.name;
    Json value;
    if (name != "Seed" && name != "HoldOut")
    {
      fields.Read(SpellOption(name, '_'), value);
    }
    if (!value.is_null())
    {
      SetOption(options, name,
                value.is_boolean()  ? (value.get<bool>() ? "on" : "off")
                : value.is_string() ? value.get<std::string>()
                                    : value.dump());
    }
  }
  return options;
}

const char* const UltraGaussName = "ultragauss";  // of the engine

/// The method that the paper compares itself with, as far as this engine can be it: Gaussians cut by a thin
/// plane, weights normalised, positive, started uniformly at random, nothing added to the frames, nothing
/// decided from evidence.
TrainerOptions UltraGauss()
{
  TrainerOptions options;
  options.engine = UltraGaussName;
  options.automatic = false;
  options.gaussians = 100000;
  options.elevationSigma = 0;
  options.signedReflectivity = false;
  options.seeding = SeedPlacement::Random;
  options.virtualPlanes = 0;
  // Of 0.3 to 0.01 pixels and 0.15 to 0.005 the best on the liver's volume and sweep and on the brain sweep.
  options.meanRate = 0.1;
  options.reflectivityRate = 0.02;
  return options;
}

/// Its first Gaussians: a normalised sum of intensities is an intensity, so r is the picture's at the seed.
GaussianField UltraGaussSeeds(const TrainerOptions& options, const Sweep& seen)
{
  std::vector<int> all(seen.NumberOfFrames());
  std::iota(all.begin(), all.end(), 0);
  GaussianField field = Seed(seen, all, {0.0}, {options.seeding, *options.gaussians, options.seed});
  for (double& r : field.reflectivities)
  {
    r = field.transfer.Intensity(r);
  }
  return field;
}

/// What an engine shows of a field at any plane, from its direction where that counts.
std::function<void(const SlicePlane&, float*)> SeenBy(const std::string& engineName, const GaussianField& field,
                                                      const std::optional<ViewDependence>& view)
{
  const std::shared_ptr<Engine> engine = Engine::Create(engineName);
  const auto seen = std::make_shared<SeenField>(*engine, field, view ? &*view : nullptr);
  return [engine, seen](const SlicePlane& plane, float* image)
  {
    seen->LookFrom(plane);
    engine->Render(plane, ViewOutput::Intensity, image);
  };
}

/// `renderedSigma`, mm, takes the place of the trained beam in pictures.
Method Trained(const TrainerOptions& options, std::optional<double> renderedSigma, const Sweep& sweep,
               const Split& split)
{
  // The trainer gets the frames it may see and nothing else: its own validation comes out of these.
  const auto seen = std::make_shared<const Sweep>(sweep.Subset(split.training));
  const auto begin = std::chrono::steady_clock::now();
  std::optional<GaussianField> start;
  if (options.engine == UltraGaussName)
  {
    start = UltraGaussSeeds(options, *seen);
  }
  Method method;
  method.training = std::make_shared<const TrainingResult>(Train(seen, options, start ? &*start : nullptr));
  const TrainingResult& result = *method.training;
  method.seconds = SecondsSince(begin);
  GaussianField rendered = result.field;
  rendered.beam.elevationSigma = renderedSigma.value_or(rendered.beam.elevationSigma);
  method.predictPlane = SeenBy(options.engine, rendered, result.view);
  method.engine = options.engine;
  method.field = rendered;
  method.bytes = static_cast<double>(result.field.Size() * GaussianBytes);
  method.facts = {{"gaussians", result.field.Size()},
                  {"iterations", result.iterations},
                  {"validation_frames", result.validationFrames.size()},
                  {"elevation_sigma", result.field.beam.elevationSigma},
                  {"rendered_elevation_sigma", rendered.beam.elevationSigma}};
  for (const OptionText& option : ListOptions(result.settled))
  {
    method.facts["settled"][SpellOption(option.info.name, '_')] = ToJson<Json>(option);
  }
  for (const Decision& decision : result.decisions)
  {
    method.facts["decisions"].push_back({{"what", decision.what},
                                         {"choice", decision.choice},
                                         {"evidence", decision.evidence},
                                         {"seconds", decision.seconds}});
    method.facts["deciding_seconds"] = method.facts.value("deciding_seconds", 0.0) + decision.seconds;
  }
  for (const TrainingRecord& line : result.log)
  {
    method.facts["curve"].push_back(
        {line.seconds, line.loss, line.validationPsnr ? Json(*line.validationPsnr) : Json()});
  }
  return method;
}

/// A field from a file, trained elsewhere.
Method FromFile(JobFields& fields)
{
  const auto file = fields.Required<std::string>("file");
  vtkNew<vtkBigusFieldReader> reader;
  reader->SetFileName(file.c_str());
  reader->Update();
  if (reader->GetErrorCode() != 0)
  {
    throw Error("The field '" + file + "' could not be read.");
  }
  Method method;
  method.field = FieldFromPolyData(reader->GetOutput());
  fields.Read("rendered_elevation_sigma", method.field->beam.elevationSigma);
  method.engine = "auto";
  method.predictPlane = SeenBy(method.engine, *method.field, ViewFromPolyData(reader->GetOutput()));
  method.bytes = static_cast<double>(method.field->Size() * GaussianBytes);
  method.facts = {{"gaussians", method.field->Size()}, {"elevation_sigma", method.field->beam.elevationSigma}};
  return method;
}

Method Compounded(JobFields& fields, const Sweep& sweep, const Split& split)
{
  double voxelSize = 0;
  fields.Read("voxel_size", voxelSize);
  std::size_t gaussians = 0;
  fields.Read("equal_gaussians", gaussians);
  const auto start = std::chrono::steady_clock::now();
  if (gaussians > 0)
  {
    voxelSize = Compounding::VoxelSizeForMemory(sweep, split.training, gaussians * GaussianBytes);
  }
  const auto volume = std::make_shared<const Compounding>(sweep, split.training, voxelSize);
  Method method;
  method.predictPlane = [volume](const SlicePlane& plane, float* image) { volume->Predict(plane, image); };
  method.seconds = SecondsSince(start);
  method.bytes = static_cast<double>(volume->MemoryUse());
  method.facts = {{"voxel_size", volume->VoxelSize()}};
  return method;
}

/// What virtual planes are made of, as a method of its own: guessed from the frames before and after.
void PredictFrameInterpolation(const Sweep& sweep, const std::vector<int>& training, int frame,
                               const FrameInterpolation& interpolation, float* image)
{
  const auto after = std::upper_bound(training.begin(), training.end(), frame);
  const auto before = std::lower_bound(training.begin(), training.end(), frame);
  if (before == training.begin() || after == training.end())
  {
    sweep.CopyFrame(after == training.end() ? training.back() : training.front(), image);
    return;
  }
  // How far between the two the plane lies, by the distances of its centre.
  const FramesAround around =
      FramesAround::Gap(sweep, training, static_cast<std::size_t>(before - 1 - training.begin()));
  const int a = around.first, b = around.second;
  const auto centre = [&sweep](int k)
  { return sweep.Plane(k).Point(0.5 * (sweep.width - 1), 0.5 * (sweep.height - 1)); };
  const double toA = (centre(frame) - centre(a)).norm(), toB = (centre(frame) - centre(b)).norm();
  InterpolateFrames(sweep, around, {{sweep.Plane(frame), toA + toB > 0 ? toA / (toA + toB) : 0.5}}, interpolation,
                    {image});
}

/// Interpolation. A frame of the sweep is predicted from its neighbours in the sequence, another plane from the frames
/// that enclose each of its points; `pose_any_plane` and `cubic_any_plane` do the latter for frames, too.
Method FromNeighbours(const std::string& name, const Sweep& sweep, const Split& split)
{
  const std::vector<int>& training = split.training;
  const auto linearAt = [&sweep, &training](PixelInterpolation sampling)
  {
    return [&sweep, &training, sampling](const SlicePlane& plane, float* image)
    { PredictPoseInterpolation(sweep, training, plane, image, sampling); };
  };
  const auto cubicAt = [&sweep, &training](const SlicePlane& plane, float* image)
  { PredictCubicInterpolation(sweep, training, plane, image); };
  const auto linear = [&sweep, &training](PixelInterpolation sampling)
  {
    return [&sweep, &training, sampling](int frame, float* image)
    { PredictPoseInterpolation(sweep, training, frame, image, sampling); };
  };
  Method method;
  method.seesItsOwnFrame = false;
  if (name == "neighbour_average")
  {
    method.predict = [&sweep, &training](int frame, float* image)
    { PredictNeighbourAverage(sweep, training, frame, image); };
  }
  else if (name == "pose_linear")
  {
    method.predict = linear(PixelInterpolation::Linear);
    method.predictPlane = linearAt(PixelInterpolation::Linear);
  }
  else if (name == "pose_cubic")
  {
    method.predict = linear(PixelInterpolation::Cubic);
    method.predictPlane = linearAt(PixelInterpolation::Cubic);
  }
  else if (name == "cubic")
  {
    method.predict = [&sweep, &training](int frame, float* image)
    { PredictCubicInterpolation(sweep, training, frame, image); };
    method.predictPlane = cubicAt;
  }
  else if (name == "pose_any_plane")
  {
    method.predictPlane = linearAt(PixelInterpolation::Linear);
  }
  else if (name == "cubic_any_plane")
  {
    method.predictPlane = cubicAt;
  }
  else
  {
    throw Error("method: there is none called '" + name + "'.");
  }
  return method;
}

/// No prediction: how thick the beam is, from the training frames.
Method EstimatedElevation(const Sweep& sweep, const Split& split)
{
  const auto start = std::chrono::steady_clock::now();
  const ElevationEstimate estimate = EstimateElevationSigma(sweep, split.training);
  Method method;
  method.seconds = SecondsSince(start);
  method.facts = {{"sigma", estimate.sigma},
                  {"standard_error", estimate.standardError},
                  {"reliable", estimate.reliable ? 1 : 0},
                  {"reason", estimate.reason},
                  {"distance", estimate.distance},
                  {"correlation", estimate.correlation},
                  {"fitted", estimate.fitted}};
  return method;
}

Method VirtualPlane(JobFields& fields, const Sweep& sweep, const Split& split)
{
  FrameInterpolation interpolation = FrameInterpolation::Parse(fields.Required<std::string>("interpolation"));
  fields.Read("keep_contrast", interpolation.keepContrast);
  Method method;
  method.predict = [&sweep, &split, interpolation](int frame, float* image)
  { PredictFrameInterpolation(sweep, split.training, frame, interpolation, image); };
  method.seesItsOwnFrame = false;
  return method;
}

/// What another program predicts; see Outside.
Method FromOutside(JobFields& fields, const Sweep& sweep, const Split& split)
{
  const auto outside = std::make_shared<Outside>(fields.Required<std::string>("folder"), sweep, split.training);
  Method method;
  method.predictPlane = [outside](const SlicePlane& plane, float* image) { outside->Predict(plane, image); };
  method.facts = {{"predicted", outside->IsPredicted()}};
  return method;
}

/// A method that serves any plane serves those of the sweep's frames.
Method ServingFrames(Method method, const Sweep& sweep)
{
  if (!method.predict && method.predictPlane)
  {
    method.predict = [&sweep, atPlane = method.predictPlane](int frame, float* image)
    { atPlane(sweep.Plane(frame), image); };
  }
  return method;
}

Method MakeMethod(const Json& description, std::uint64_t seed, const Sweep& sweep, const Split& split)
{
  JobFields fields(description, "method");
  const auto name = fields.Required<std::string>("name");
  Method method;
  if (name == "bigus" || name == "ultragauss")
  {
    TrainerOptions options = ReadTrainerOptions(fields, name == "bigus" ? TrainerOptions() : UltraGauss());
    options.seed = seed;
    options.poseSmoothing = options.poseSmoothing.value_or(0);  // the job's poses are those to train at
    std::optional<double> renderedSigma;
    fields.Read("rendered_elevation_sigma", renderedSigma);
    fields.Done();
    return ServingFrames(Trained(options, renderedSigma, sweep, split), sweep);
  }
  if (name == "field")
  {
    method = FromFile(fields);
  }
  else if (name == "elevation")
  {
    method = EstimatedElevation(sweep, split);
  }
  else if (name == "compounding")
  {
    method = Compounded(fields, sweep, split);
  }
  else if (name == "virtual")
  {
    method = VirtualPlane(fields, sweep, split);
  }
  else if (name == "outside")
  {
    method = FromOutside(fields, sweep, split);
  }
  else if (name == "nearest")
  {
    method.predict = [&sweep, &split](int frame, float* image)
    { PredictNearest(sweep, split.training, sweep.Plane(frame), image); };
  }
  else
  {
    method = FromNeighbours(name, sweep, split);
  }
  fields.Done();
  method = ServingFrames(std::move(method), sweep);
  if (method.predict && method.bytes == 0)
  {
    method.bytes = static_cast<double>(split.training.size() * sweep.PixelsPerFrame());  // a byte each
  }
  return method;
}

// ---- scores ----

/// JSON knows no infinity: a perfect picture's PSNR is null.
Json Number(double value)
{
  return std::isfinite(value) ? Json(value) : Json();
}

/// "ContrastRatio" to contrast_ratio.
std::string SnakeCase(const std::string& name)
{
  std::string snake;
  for (const char letter : name)
  {
    const bool upper = letter >= 'A' && letter <= 'Z';
    snake += upper && !snake.empty() ? "_" : "";
    snake += upper ? static_cast<char>(letter - 'A' + 'a') : letter;
  }
  return snake;
}

Json ToJson(const TextureComparison& comparison)
{
  Json texture = {{"image_power", comparison.image.power}, {"truth_power", comparison.truth.power}};
  ForEachNumber(comparison,
                [&texture](const std::string& name, double value) { texture[SnakeCase(name)] = Number(value); });
  return texture;
}

Json ToJson(const FrameScores& scores)
{
  return {{"frames", scores.frames.size()},
          {"psnr", Number(scores.psnr)},
          {"psnr_std", Number(scores.psnrStd)},
          {"ssim", scores.ssim},
          {"ssim_std", scores.ssimStd},
          {"bfs", scores.bfs.score},
          {"bfs_mean_contrast", scores.bfs.meanContrast},
          {"bfs_contrast_distribution", scores.bfs.contrastDistribution},
          {"bfs_rayleigh", scores.bfs.rayleigh},
          {"texture", ToJson(scores.texture)}};
}

Json ToJson(const PlaneScores& scores)
{
  return {{"planes", scores.planes},
          {"scored_share", scores.scoredShare},
          {"psnr", Number(scores.psnr)},
          {"psnr_std", Number(scores.psnrStd)},
          {"structure", Number(scores.structure)},
          {"structure_std", Number(scores.structureStd)}};
}

Json ToJson(const StandardErrorScores& scores)
{
  return {{"variance_ratio", scores.varianceRatio},
          {"within_1", scores.within1},
          {"within_2", scores.within2},
          {"correlation", scores.correlation},
          {"sparsification", scores.sparsification}};
}

/// `side`: of a pixel, mm.
Json ToJson(const StandardErrorReport& report, double side)
{
  Json json = ToJson(report.model);
  json.update({{"rmse", report.rmse},
               {"known", report.known},
               {"constant", ToJson(report.constant)},
               {"distance", ToJson(report.distance)},
               {"local_variance", ToJson(report.texture)}});
  for (const MeanErrorScore& mean : report.means)
  {
    if (mean.count < LeastSquares)
    {
      continue;
    }
    json["means"][std::to_string(std::lround(mean.side / side))] = {{"variance_ratio", mean.varianceRatio},
                                                                    {"squares", mean.count}};
  }
  for (const StandardErrorBin& bin : report.reliability)
  {
    json["reliability"].push_back({bin.sigma, bin.error, bin.count});
  }
  return json;
}

/// What the standard error says of the held-out frames (0 degrees), or of frames of the same world swept in a direction
/// turned by so much. `recorded`: the sweep before its poses were corrected, by `strength`.
Json StandardErrorJson(double degrees, const Json& scene, const SceneFolders& folders, const Method& method,
                       const Sweep& recorded, const Sweep& sweep, const Split& split, double strength)
{
  // As 'bigus train' keeps it, which corrects poses itself and numbers frames as recorded.
  TrainingResult result = *method.training;
  for (std::vector<int>* frames : {&result.trainingFrames, &result.validationFrames})
  {
    std::transform(frames->begin(), frames->end(), frames->begin(), [&](int k) { return split.training[k]; });
  }
  result.imageToReference = sweep.imageToReference;
  result.settled.poseSmoothing = strength;
  const StandardError error(MeasureStandardError(result, recorded, 0));
  const std::shared_ptr<const Sweep> turned = degrees != 0 ? MakeTurnedScene(degrees, scene, folders) : nullptr;
  std::vector<int> all(turned ? turned->NumberOfFrames() : 0);
  std::iota(all.begin(), all.end(), 0);
  const SlicePlane plane = sweep.Plane(0);
  return ToJson(ScoreStandardError(error, *method.field, turned ? *turned : sweep, turned ? all : split.heldOut,
                                   method.engine, method.training->view ? &*method.training->view : nullptr),
                std::sqrt(plane.columnStep.cross(plane.rowStep).norm()));
}

/// The field at poses that the held-out frames chose for themselves: a diagnostic of the tracking.
Json AlignedScores(const Method& method, const Sweep& sweep, const std::vector<int>& frames)
{
  const bigus::AlignedScores aligned = ScoreFieldAligned(*method.field, sweep, frames, method.engine);
  Json scores = ToJson(aligned.scores);
  scores["mean_translation"] = aligned.meanTranslation;
  scores["largest_translation"] = aligned.largestTranslation;
  scores["mean_rotation"] = aligned.meanRotation;
  return scores;
}

/// At most `count` of the frames, evenly spread; 0: all.
std::vector<int> Spread(const std::vector<int>& frames, std::size_t count)
{
  if (count == 0 || frames.size() <= count)
  {
    return frames;
  }
  std::vector<int> some;
  for (std::size_t k = 0; k < count; ++k)
  {
    some.push_back(frames[k * frames.size() / count]);
  }
  return some;
}

/// What `--pictures` asks for: every picture of cross-planes as an 8-bit PGM file.
void WritePictures(const std::filesystem::path& folder, const std::string& set, const std::vector<CrossPlane>& planes,
                   const Method& method)
{
  std::filesystem::create_directories(folder);
  for (std::size_t k = 0; k < planes.size(); ++k)
  {
    const SlicePlane& plane = planes[k].plane;
    std::vector<float> image(plane.NumberOfPixels());
    method.predictPlane(plane, image.data());
    std::string bytes;
    for (std::size_t p = 0; p < image.size(); ++p)
    {
      bytes += static_cast<char>(planes[k].enclosed[p] ? std::lround(255 * std::clamp(image[p], 0.0f, 1.0f)) : 0);
    }
    std::ofstream out(folder / (set + "-" + std::to_string(k) + ".pgm"), std::ios::binary);
    out << "P5\n" << plane.width << ' ' << plane.height << "\n255\n" << bytes;
  }
}

/// How strongly poses are smoothed; empty where pictures decide.
std::optional<double> Strength(const std::string& poses)
{
  if (poses == "corrected")
  {
    return std::nullopt;
  }
  if (poses == "tracked")
  {
    return 0.0;
  }
  throw Error("job: 'poses' is corrected or tracked, not '" + poses + "'.");
}

/// How far poses are from the true ones, mm and degrees; null where these are not known.
Json PoseErrorOf(const std::vector<Eigen::Matrix4d>& poses, const std::vector<Eigen::Matrix4d>& truth,
                 const Sweep& sweep)
{
  if (truth.empty())
  {
    return nullptr;
  }
  const bigus::PoseError error = bigus::MeasurePoseError(poses, truth, sweep.width, sweep.height);
  return {{"distance", error.distance}, {"bending", error.bending}, {"angle", error.angle}};
}

/// What was done to poses and, where the truth is known, how far they were and are from it, and would be at best: smoothed
/// by the strength that brings them closest, and by nothing else.
Json PosesJson(const Sweep& recorded, const PoseCorrection& correction, const std::vector<Eigen::Matrix4d>& truth)
{
  Json smoothed, best;
  if (!truth.empty())
  {
    bigus::TrajectorySmoother path(recorded, correction.trajectory.clock);
    const auto at = [&](double strength)
    {
      Json error = PoseErrorOf(path.At(strength).imageToReference, truth, recorded);
      error["strength"] = strength;
      return error;
    };
    smoothed = at(correction.strength);
    best = at(0);
    for (double strength = 0.5; strength <= 128; strength *= 2)
    {
      const Json error = at(strength);
      best = error["distance"] < best["distance"] ? error : best;
    }
  }
  return {{"choice", correction.decision.choice},
          {"evidence", correction.decision.evidence},
          {"strength", correction.strength},
          {"aligned", correction.alignment.isTaken ? 1 : 0},
          {"seconds", correction.decision.seconds},
          {"error_tracked", PoseErrorOf(recorded.imageToReference, truth, recorded)},
          {"error_smoothed", smoothed},
          {"error_best", best},
          {"error", PoseErrorOf(correction.trajectory.imageToReference, truth, recorded)}};
}

Json Run(const Json& job, const SceneFolders& folders, const std::string& pictures)
{
  JobFields fields(job, "job");
  std::uint64_t seed = 1;
  fields.Read("seed", seed);
  std::vector<std::string> scored = {"held_out"};
  fields.Read("score", scored);
  std::size_t scoredFrames = 0;
  fields.Read("scored_frames", scoredFrames);
  std::string poses = "corrected";
  fields.Read("poses", poses);
  const Json& scene = fields.Object("sweep");
  const Json& frames = fields.Object("frames");
  const Json& description = fields.Object("method");
  fields.Done();

  const std::shared_ptr<const Sweep> made = MakeScene(scene, folders);
  const Split split = ReadSplit(frames, made->NumberOfFrames());
  // No method need predict what a probe shows where it shows nothing.
  const Sweep recorded = made->LitBy(split.training);
  // Every method works and is scored at the same poses: as tracked, or corrected by pixels of training frames alone.
  const PoseCorrection correction = CorrectPoses(recorded, split.training, {Strength(poses)});
  const auto sweep = std::make_shared<const Sweep>(AtCorrectedPoses(recorded, correction));
  const std::vector<Eigen::Matrix4d> truth = TruePoses(scene);
  const Method method = MakeMethod(description, seed, *sweep, split);

  Json scores = Json::object();
  const auto start = std::chrono::steady_clock::now();
  std::vector<int> all(sweep->NumberOfFrames());
  std::iota(all.begin(), all.end(), 0);
  const std::map<std::string, const std::vector<int>*> sets = {
      {"held_out", &split.heldOut}, {"aligned", &split.heldOut}, {"training", &split.training}, {"all", &all}};
  for (const std::string& set : scored)
  {
    if (set == "cross")
    {
      if (method.predictPlane)
      {
        if (!pictures.empty())
        {
          WritePictures(pictures, set, MakeCrossPlanes(*sweep, split.training, 3, sweep->Plane(0).PixelSize()), method);
        }
        if (const auto cross = CrossPlaneScorer(*sweep, split.training).Score(method.predictPlane))
        {
          scores[set] = {{"detail", cross->detail},
                         {"scratches", cross->scratches},
                         {"within", cross->power.within},
                         {"beyond", cross->power.beyond}};
        }
      }
      continue;
    }
    if (set == "held_out_tracked")
    {
      if (method.predictPlane && !split.heldOut.empty())
      {
        scores[set] =
            ToJson(ScoreFrames(recorded, Spread(split.heldOut, scoredFrames),
                               [&](int frame, float* image) { method.predictPlane(recorded.Plane(frame), image); }));
      }
      continue;
    }
    if (const std::optional<double> degrees = NumberAfter(set, "standard_error_"))
    {
      if (method.training)
      {
        scores[set] = StandardErrorJson(*degrees, scene, folders, method, recorded, *sweep, split, correction.strength);
      }
      continue;
    }
    if (IsSetOfOtherPlanes(set))
    {
      if (method.predictPlane)
      {
        const std::vector<KnownPlane> planes =
            MakeOtherPlanes(set, scene, folders, *sweep, split.training, static_cast<int>(scoredFrames));
        scores[set] = ToJson(ScorePlanes(planes, method.predictPlane));
      }
      continue;
    }
    if (sets.count(set) == 0)
    {
      throw Error(
          "job: 'score' knows held_out, held_out_tracked, training, all, aligned, cross, planes_*, turned_* and "
          "standard_error_*, not '" +
          set + "'.");
    }
    const std::vector<int> chosen = Spread(*sets.at(set), scoredFrames);
    if (!method.predict)
    {
      continue;
    }
    if (set == "aligned" && method.field && !chosen.empty())
    {
      scores[set] = AlignedScores(method, *sweep, chosen);
    }
    else if (set != "aligned" && !chosen.empty() && (set == "held_out" || method.seesItsOwnFrame))
    {
      scores[set] = ToJson(ScoreFrames(*sweep, chosen, method.predict));
    }
  }
  return {{"job", job},
          {"scores", scores},
          {"seconds", method.seconds},
          {"scoring_seconds", SecondsSince(start)},
          {"bytes", method.bytes},
          {"poses", PosesJson(recorded, correction, truth)},
          {"facts", method.facts},
          {"width", sweep->width},
          {"height", sweep->height},
          {"frames", sweep->NumberOfFrames()},
          {"training_frames", split.training.size()},
          {"device", Engine::Create()->Device()},
          {"threads", tbb::info::default_concurrency()},
          {"version", BIGUS_VERSION}};
}

}  // namespace

int main(int argc, char* argv[])
{
  SceneFolders folders;
  std::string jobFile = "-", pictures;
  for (int i = 1; i < argc; ++i)
  {
    const std::string argument = argv[i];
    if ((argument == "--data" || argument == "--cache") && i + 1 < argc)
    {
      (argument == "--data" ? folders.data : folders.cache) = argv[++i];
    }
    else if (argument == "--pictures" && i + 1 < argc)
    {
      pictures = argv[++i];
    }
    else if (argument.rfind("--", 0) == 0)
    {
      std::cerr << "bigusExperiment [--data FOLDER] [--cache FOLDER] [--pictures FOLDER] [JOB.json]\n"
                   "Runs the job (default: from standard input) and prints its result.\n";
      return 2;
    }
    else
    {
      jobFile = argument;
    }
  }
  Engine::Register(UltraGaussName, CreateUltraGaussEngine, false);
  try
  {
    std::ifstream file;
    if (jobFile != "-")
    {
      file.open(jobFile);
      if (!file)
      {
        throw Error("There is no job file '" + jobFile + "'.");
      }
    }
    std::istream& in = jobFile == "-" ? std::cin : file;
    const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    std::cout << Run(Json::parse(text), folders, pictures).dump(1) << '\n';
    return 0;
  }
  catch (const std::exception& error)
  {
    std::cerr << "bigusExperiment: " << error.what() << '\n';
    return 1;
  }
}
