// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Scores.h"

#include <algorithm>
#include <initializer_list>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <tuple>

#include "Core/Engine/Engine.h"
#include "Core/Evaluation/CrossPlanes.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Model/Error.h"
#include "Core/Training/OptionList.h"

namespace bigus::command
{

namespace
{

Json ToJson(const FrameScores& scores)
{
  return {{"frames", scores.frames.size()},
          {"psnr", scores.psnr},
          {"psnr_std", scores.psnrStd},
          {"ssim", scores.ssim},
          {"bfs", scores.bfs.score},
          {"ssim_std", scores.ssimStd},
          {"bfs_terms",
           {{"mean_contrast", scores.bfs.meanContrast},
            {"contrast_distribution", scores.bfs.contrastDistribution},
            {"rayleigh", scores.bfs.rayleigh}}},
          {"texture", TextureJson(scores.texture)}};
}

/// Only what is named.
Json Pick(const Json& scores, std::initializer_list<const char*> names)
{
  Json part;
  for (const char* name : names)
  {
    part[name] = scores.at(name);
  }
  return part;
}

std::string Row(const std::string& name, const Json& scores)
{
  return "  " + name + std::string(24 - name.size(), ' ') +
         Words("{psnr:2} dB +- {psnr_std:2}   SSIM {ssim:4}", scores);
}

/// Row, with the speckle score.
std::string FieldRow(const std::string& name, const Json& scores)
{
  return Row(name, scores) + Words("   BFS {bfs:3}", scores);
}

void PrintField(const Json& scores, Console& console)
{
  console.Print(FieldRow("this field", scores));
  console.Print(
      "    texture beside the truth's: speckle contrast x {contrast_ratio:3}, power above half Nyquist x "
      "{high_frequency_power:3}, spectrum off by {spectrum_difference:2} dB",
      scores.at("texture"));
}

/// At most `count` of the frames, evenly spread.
std::vector<int> Spread(const std::vector<int>& frames, std::size_t count)
{
  count = std::min(count, frames.size());
  std::vector<int> some;
  for (std::size_t k = 0; k < count; ++k)
  {
    some.push_back(frames[k * frames.size() / count]);
  }
  return some;
}

bool IsCorrected(const TrainedField& trained, const std::vector<int>& frames)
{
  return std::any_of(frames.begin(), frames.end(),
                     [&trained](int f)
                     { return trained.corrected.imageToReference[f] != trained.tracked.imageToReference[f]; });
}

Json ScoreAt(const TrainedField& trained, const Sweep& poses, const std::vector<int>& frames)
{
  return ToJson(ScoreField(trained.field, poses, frames, trained.engine, trained.view));
}

/// The score of each of several sequences, at the poses that were trained at and as tracked.
void ScoreSequences(const TrainedField& trained, Json& answer, Console& console)
{
  for (const std::vector<int>& frames : BySequence(trained.corrected, trained.heldOut))
  {
    const int k = trained.corrected.SequenceOf(frames.front());
    Json& sequence = answer["sequences"][k];
    const Json scores = ScoreAt(trained, trained.corrected, frames);
    sequence["held_out"] = scores;
    sequence["held_out_tracked"] = IsCorrected(trained, frames) ? ScoreAt(trained, trained.tracked, frames) : scores;
    console.Print(Row("  sequence " + std::to_string(k + 1), scores) + Words("   {frames} frames, poses ", scores) +
                  sequence["poses"].get<std::string>());
  }
}

/// The plain methods on the same frames. One that cannot be had (a volume too large to compound) takes none
/// of the field's own score with it.
void ScoreBaselines(const TrainedField& trained, Json& answer, Console& console)
{
  try
  {
    const BaselineScores scores = bigus::ScoreBaselines(trained.corrected, trained.training, trained.heldOut);
    using Method = std::tuple<const char*, const char*, const FrameScores&>;
    for (const auto& [name, words, one] : {Method("nearest", "nearest frame", scores.nearest),
                                           Method("neighbour_average", "neighbour average", scores.neighbourAverage),
                                           Method("pose_interpolation", "pose interpolation", scores.poseInterpolation),
                                           Method("compounding", "voxel compounding", scores.compounding)})
    {
      const Json all = ToJson(one);
      answer["baselines"][name] = Pick(all, {"psnr", "ssim"});
      console.Print(Row(words, all));
    }
    answer["baselines"]["compounding"]["voxel_size"] = scores.compoundingVoxelSize;
  }
  catch (const Error& error)
  {
    console.Note(std::string("bigus: the baselines were not scored: ") + error.what());
  }
}

/// What the tracker's error costs: the same frames once more, each at the pose where the field explains it
/// best.
void ScoreAligned(const TrainedField& trained, Json& answer, Console& console)
{
  const std::string count = std::to_string(trained.heldOut.size());
  console.Note("Aligning " + count + " held-out frames.");
  const AlignedScores aligned =
      ScoreFieldAligned(trained.field, trained.corrected, trained.heldOut, trained.engine, trained.view);
  Json scores = ToJson(aligned.scores);
  scores.update({{"mean_translation", aligned.meanTranslation},
                 {"largest_translation", aligned.largestTranslation},
                 {"mean_rotation", aligned.meanRotation},
                 {"largest_rotation", aligned.largestRotation}});
  console.Print("Held-out frames (" + count + "), aligned poses (diagnostic: the frame itself chose its pose)");
  console.Print(FieldRow("this field", scores));
  console.Print(
      "  moved by {mean_translation:3} mm and {mean_rotation:2} degrees on average, {largest_translation:3} mm and "
      "{largest_rotation:2} degrees at most",
      scores);
  answer["held_out_aligned"] = scores;
}

void PrintContrast(const std::string& whose, const Json& texture, Console& console)
{
  const std::string of = "{" + whose + "_contrast_";
  console.Print("    " + whose + " " + of + "mean:4} +- " + of + "std:4}, 5 25 50 75 95 % below " + of + "q05:3} " +
                    of + "q25:3} " + of + "q50:3} " + of + "q75:3} " + of + "q95:3}",
                texture);
}

void PrintIntensity(const std::string& whose, const Json& texture, Console& console)
{
  const std::string of = "{" + whose + "_";
  console.Print("    " + whose + " " + of + "mean:4} +- " + of + "std:4}, SNR " + of + "snr:3}, local SNR " + of +
                    "local_snr:3}, skewness " + of + "skewness:3}, excess kurtosis " + of + "kurtosis:3}",
                texture);
}

}  // namespace

Json TextureJson(const TextureComparison& texture)
{
  Json json = Json::object();
  ForEachNumber(texture, [&json](const std::string& name, double value) { json[SpellOption(name, '_')] = value; });
  json["spectrum_frequency"] = Json::array();
  for (int bin = 0; bin < kSpectrumBins; ++bin)
  {
    json["spectrum_frequency"].push_back(SpectrumFrequency(bin));
  }
  json["image_spectrum"] = texture.image.power;
  json["truth_spectrum"] = texture.truth.power;
  return json;
}

void PrintTexture(const Json& texture, Console& console)
{
  console.Print(
      "  Speckle contrast: ratio to the truth's {contrast_ratio:3}, distance of distributions {contrast_distance:4}",
      texture);
  PrintContrast("image", texture, console);
  PrintContrast("truth", texture, console);
  console.Print("  Intensity where lit: distance of histograms {intensity_distance:4}", texture);
  PrintIntensity("image", texture, console);
  PrintIntensity("truth", texture, console);
  console.Print(
      "  Power spectrum: {spectrum_difference:2} dB from the truth's, {high_frequency_power:3} of its power above half of "
      "Nyquist's frequency",
      texture);
}

void ScoreHeldOut(const TrainedField& trained, Json& answer, Console& console)
{
  const std::vector<int>& heldOut = trained.heldOut;
  console.Note("Scoring " + std::to_string(heldOut.size()) + " held-out frames.");
  const bool isCorrected = trained.corrected.imageToReference != trained.tracked.imageToReference;
  const Json scores = ScoreAt(trained, trained.corrected, heldOut);
  const Json atTracked = isCorrected ? ScoreAt(trained, trained.tracked, heldOut) : scores;
  const Json seen = ScoreAt(trained, trained.corrected, Spread(trained.trained, heldOut.size()));
  answer["held_out"] = scores;
  answer["held_out_tracked"] = atTracked;
  answer["trained"] = Pick(seen, {"frames", "psnr", "ssim", "bfs", "texture"});

  console.Print("Frames it was trained on ({frames} of them)", seen);
  PrintField(seen, console);
  console.Print(Words("Held-out frames ({frames}), ", scores) +
                (isCorrected ? "corrected poses (their own pixels had no part in them)" : "tracked poses"));
  PrintField(scores, console);
  if (isCorrected)
  {
    console.Print(FieldRow("  at tracked poses", atTracked));
  }
  if (answer["sequences"].size() > 1)
  {
    ScoreSequences(trained, answer, console);
  }
  else
  {
    answer["sequences"][0].update({{"held_out", scores}, {"held_out_tracked", atTracked}});
  }
  if (trained.withBaselines)
  {
    ScoreBaselines(trained, answer, console);
  }
  if (trained.isAligned)
  {
    ScoreAligned(trained, answer, console);
  }
}

namespace
{

Json ToJson(const StandardErrorScores& scores)
{
  return {{"variance_ratio", scores.varianceRatio},
          {"within_1", scores.within1},
          {"within_2", scores.within2},
          {"correlation", scores.correlation},
          {"sparsification", scores.sparsification}};
}

}  // namespace

void ScoreStandardError(const StandardError& standardError, const TrainedField& trained, Json& answer, Console& console)
{
  const StandardErrorReport report = bigus::ScoreStandardError(standardError, trained.field, trained.corrected,
                                                               trained.heldOut, trained.engine, trained.view);
  Json& json = answer["standard_error"];
  json.update(ToJson(report.model));
  json["rmse"] = report.rmse;
  json["known"] = report.known;
  json["peers"] = {{"constant", ToJson(report.constant)},
                   {"distance", ToJson(report.distance)},
                   {"local_variance", ToJson(report.texture)}};
  console.Print("Standard error on held-out frames, known at {known:3} of the lit pixels; error {rmse:4}", json);
  console.Print("                      variance ratio  within 1, 2   correlation  sparsification (0 best, 1 chance)");
  const auto print = [&console](const std::string& name, const Json& scores)
  {
    console.Print(
        "  " + name + std::string(24 - name.size(), ' ') +
            "{variance_ratio:2}          {within_1:3}, {within_2:3}  {correlation:2}         {sparsification:2}",
        scores);
  };
  print("this", json);
  print("a constant*", json["peers"]["constant"]);
  print("distance alone*", json["peers"]["distance"]);
  print("local variance alone*", json["peers"]["local_variance"]);
  console.Print("  * scaled to these very frames");
  json["reliability"] = Json::array();
  for (const StandardErrorBin& bin : report.reliability)
  {
    json["reliability"].push_back({{"sigma", bin.sigma}, {"error", bin.error}, {"pixels", bin.count}});
  }
  json["means"] = Json::array();
  for (const MeanErrorScore& score : report.means)
  {
    json["means"].push_back({{"side", score.side}, {"variance_ratio", score.varianceRatio}, {"squares", score.count}});
    console.Print("  means over squares of {side:1} mm ({squares}): variance ratio {variance_ratio:2}",
                  json["means"].back());
  }
}

/// Without the probe's beam, which is no blur of the field's and which interpolation does not have: whether the beam is known
/// must not change what is said of the same Gaussians.
void ScoreCrossPlanes(const TrainedField& trained, Json& answer, Console& console)
{
  const std::unique_ptr<Engine> engine = Engine::Create(trained.engine);
  GaussianField field = trained.field;
  field.beam = Beam{field.beam.elevationSigma};
  engine->SetField(field);
  const auto render = [&engine](const SlicePlane& plane, float* image)
  { engine->Render(plane, ViewOutput::Intensity, image); };
  if (const std::optional<CrossScores> scores = CrossPlaneScorer(trained.corrected, trained.training).Score(render))
  {
    answer["cross_planes"] = {{"detail", scores->detail}, {"scratches", scores->scratches}};
    console.Print("Planes along the sweep (linear interpolation between frames: 1 and 1)");
    console.Print("  detail {detail:2}, scratches {scratches:2}", answer["cross_planes"]);
  }
}

}  // namespace bigus::command
