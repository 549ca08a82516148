// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus train: a tracked sequence to a Gaussian field, with an honest score on frames it never saw.
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <type_traits>

#include "Command.h"
#include "Core/Deciding/Trainer.h"
#include "Core/Engine/Engine.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Model/Error.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "Files.h"
#include "IO/Text.h"
#include "Inputs.h"
#include "Scores.h"
#include "vtkNew.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

struct Options
{
  SequenceOptions sequence;
  std::string output, log, continueFrom, preset = "fidelity", loss, finalLoss;
  TrainerOptions trainer;
  bool withoutBaselines = false, align = false;
};

std::uint64_t PeakMemory()
{
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;  // Linux counts in kilobytes
}

void WriteLog(const std::string& path, const std::vector<TrainingRecord>& log)
{
  WriteAtomically(path,
                  [&log](std::ostream& file)
                  {
                    file.precision(9);
                    file << "iteration,seconds,loss,validation_psnr,gaussians,rate\n";
                    for (const TrainingRecord& line : log)
                    {
                      file << line.iteration << ',' << line.seconds << ',' << line.loss << ',';
                      if (line.validationPsnr)
                      {
                        file << *line.validationPsnr;
                      }
                      file << ',' << line.gaussians << ',' << line.rate << '\n';
                    }
                  });
}

/// What was chosen, why, and what finding out cost.
void PrintDecisions(const std::vector<Decision>& decisions, Console& console)
{
  for (const Decision& decision : decisions)
  {
    const auto padded = [](const std::string& text, std::size_t width)
    { return text + std::string(text.size() < width ? width - text.size() : 1, ' '); };
    console.Print("  " + padded(decision.what, 18) + padded(decision.choice, 12) +
                  padded(FormatNumber(decision.seconds, 1) + " s", 9) + decision.evidence);
  }
}

Json ToJson(const std::vector<Decision>& decisions)
{
  Json list = Json::array();
  for (const Decision& decision : decisions)
  {
    list.push_back({{"decision", decision.what},
                    {"choice", decision.choice},
                    {"evidence", decision.evidence},
                    {"seconds", decision.seconds}});
  }
  return list;
}

/// The options with every choice made, whoever made it.
Json SettledJson(const TrainerOptions& settled)
{
  return {{"gaussians", *settled.gaussians},
          {"elevation_sigma", *settled.elevationSigma},
          {"signed", settled.signedReflectivity},
          {"virtual_planes", *settled.virtualPlanes},
          {"interpolation", settled.interpolation->ToString()},
          {"frame_gains", settled.frameGains},
          {"refine_poses", settled.poseRefinement},
          {"iterations", *settled.iterations},
          {"loss", settled.loss.ToString()},
          {"final_loss", settled.finalLoss ? Json(settled.finalLoss->ToString()) : Json(nullptr)}};
}

Json ToJson(const BackscatterFidelity& bfs)
{
  return {{"mean_contrast", bfs.meanContrast},
          {"contrast_distribution", bfs.contrastDistribution},
          {"rayleigh", bfs.rayleigh}};
}

Json ToJson(const FrameScores& scores)
{
  return {{"psnr", scores.psnr}, {"ssim", scores.ssim}};
}

Json ToFullJson(const FrameScores& scores)
{
  return {{"frames", scores.frames.size()},  {"psnr", scores.psnr},
          {"psnr_std", scores.psnrStd},      {"ssim", scores.ssim},
          {"bfs", scores.bfs.score},         {"ssim_std", scores.ssimStd},
          {"bfs_terms", ToJson(scores.bfs)}, {"texture", TextureJson(scores.texture)}};
}

std::string Row(const std::string& name, const FrameScores& scores)
{
  return "  " + name + std::string(24 - name.size(), ' ') + FormatNumber(scores.psnr, 2) + " dB +- " +
         FormatNumber(scores.psnrStd, 2) + "   SSIM " + FormatNumber(scores.ssim, 4);
}

/// The plain methods on the same frames. One that cannot be had (a volume too large to compound) takes none
/// of the field's own score with it.
void ScoreBaselines(const Sweep& sweep, const std::vector<int>& training, const std::vector<int>& heldOut, Json& answer,
                    Console& console)
{
  try
  {
    const BaselineScores scores = bigus::ScoreBaselines(sweep, training, heldOut);
    answer["baselines"] = {{"nearest", ToJson(scores.nearest)},
                           {"neighbour_average", ToJson(scores.neighbourAverage)},
                           {"pose_interpolation", ToJson(scores.poseInterpolation)},
                           {"compounding", ToJson(scores.compounding)}};
    answer["baselines"]["compounding"]["voxel_size"] = scores.compoundingVoxelSize;
    console.Print(Row("nearest frame", scores.nearest));
    console.Print(Row("neighbour average", scores.neighbourAverage));
    console.Print(Row("pose interpolation", scores.poseInterpolation));
    console.Print(Row("voxel compounding", scores.compounding));
  }
  catch (const Error& error)
  {
    console.Note(std::string("bigus: the baselines were not scored: ") + error.what());
  }
}

/// What the tracker's error costs: the same frames once more, each at the pose where the field explains it
/// best.
void ScoreAligned(const GaussianField& field, const Sweep& sweep, const std::vector<int>& heldOut,
                  const std::string& engine, Json& answer, Console& console)
{
  console.Note("Aligning " + std::to_string(heldOut.size()) + " held-out frames.");
  const AlignedScores aligned = ScoreFieldAligned(field, sweep, heldOut, {}, engine);
  answer["held_out_aligned"] = ToFullJson(aligned.scores);
  answer["held_out_aligned"].update({{"mean_translation", aligned.meanTranslation},
                                     {"largest_translation", aligned.largestTranslation},
                                     {"mean_rotation", aligned.meanRotation},
                                     {"largest_rotation", aligned.largestRotation}});
  console.Print("Held-out frames (" + std::to_string(heldOut.size()) +
                "), aligned poses (diagnostic: the frame itself chose its pose)");
  console.Print(Row("this field", aligned.scores) + "   BFS " + FormatNumber(aligned.scores.bfs.score, 3));
  console.Print("  moved by " + FormatNumber(aligned.meanTranslation, 3) + " mm and " +
                FormatNumber(aligned.meanRotation, 2) + " degrees on average, " +
                FormatNumber(aligned.largestTranslation, 3) + " mm and " + FormatNumber(aligned.largestRotation, 2) +
                " degrees at most");
}

/// Keeps the bar going; false, once interrupted, stops training.
bool OnProgress(Console& console, const TrainingProgress& progress)
{
  static const std::map<TrainingProgress::Phase, const char*> names = {{TrainingProgress::Phase::Deciding, "Deciding"},
                                                                       {TrainingProgress::Phase::Seeding, "Seeding "},
                                                                       {TrainingProgress::Phase::Solving, "Solving "},
                                                                       {TrainingProgress::Phase::Training, "Training"}};
  std::string rate;
  const TrainingRecord& record = progress.record;
  if (progress.phase == TrainingProgress::Phase::Training && record.iteration > 0 && record.seconds > 0)
  {
    rate = FormatNumber(record.iteration / record.seconds, 1) + " iterations/s, loss " + FormatNumber(record.loss, 4);
  }
  console.Progress(names.at(progress.phase), progress.fraction, rate,
                   progress.secondsLeft > 0 ? progress.secondsLeft : -1);
  return !IsInterrupted();
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

ExitCode Train(Console& console, Options& options)
{
  RequireDistinct({options.sequence.path, options.sequence.chain.config, options.continueFrom},
                  {options.output, options.log});
  RequireWritable(options.output);
  RequireFieldName(options.output);
  if (!options.log.empty())
  {
    RequireWritable(options.log);
  }

  TrainerOptions& trainer = options.trainer;
  Engine::Create(trainer.engine);  // an unknown name is said before the sweep is read
  ApplyPreset(options.preset, trainer);
  if (!options.loss.empty())
  {
    trainer.loss = Loss::Parse(options.loss);
    trainer.finalLoss.reset();  // the preset's would lead away from what was asked for
  }
  if (!options.finalLoss.empty())
  {
    trainer.finalLoss = Loss::Parse(options.finalLoss);
  }
  if (trainer.interpolation)
  {
    trainer.interpolation->keepContrast = trainer.keepContrast;
  }
  const std::shared_ptr<const Sweep> sweep = ReadSweep(options.sequence, console);
  const auto [trainingFrames, heldOutFrames] = SplitHoldOut(sweep->NumberOfFrames(), trainer.holdOut);
  if (trainer.holdOut > 0 && heldOutFrames.empty())
  {
    throw Error("--hold-out " + std::to_string(trainer.holdOut) + " keeps none of the " +
                std::to_string(sweep->NumberOfFrames()) + " usable frames; use a smaller number.");
  }
  if (trainer.holdOut > 0 && std::min(sweep->width, sweep->height) < 11)
  {
    throw Error("Frames of " + std::to_string(sweep->width) + " x " + std::to_string(sweep->height) +
                " pixels cannot be scored (11 x 11 are needed); use a smaller --reduce.");
  }
  std::optional<GaussianField> start;
  if (!options.continueFrom.empty())
  {
    start = ReadField(options.continueFrom, console);
  }
  console.Note("Training on " + std::to_string(trainingFrames.size()) + " frames of " + std::to_string(sweep->width) +
               " x " + std::to_string(sweep->height) + " pixels; " + std::to_string(heldOutFrames.size()) +
               " held out.");

  const TrainingResult result =
      bigus::Train(sweep, trainer, start ? &*start : nullptr,
                   [&console](const TrainingProgress& progress) { return OnProgress(console, progress); });
  console.EndProgress();

  const bool interrupted = result.aborted || IsInterrupted();
  vtkNew<vtkPolyData> field;
  FieldToPolyData(result.field, field);
  SetProvenance(field, "program", std::string("bigus ") + BIGUS_VERSION);
  SetProvenance(field, "sequence", FileName(options.sequence.path));
  SetProvenance(field, "world", options.sequence.chain.to);
  SetProvenance(field, "reduce", std::to_string(options.sequence.reduce));
  SetProvenance(field, "hold_out", std::to_string(trainer.holdOut));
  SetTrainingProvenance(field, result);
  WriteFieldData(field, options.output, console);
  if (!options.log.empty())
  {
    WriteLog(options.log, result.log);
  }

  Json answer = {{"gaussians", result.field.Size()},
                 {"seconds", result.seconds},
                 {"iterations", result.iterations},
                 {"device", result.device},
                 {"seed", trainer.seed},
                 {"peak_memory_bytes", PeakMemory()},  // of training; the baselines may need more
                 {"held_out", nullptr},
                 {"held_out_aligned", nullptr},
                 {"trained", nullptr},
                 {"baselines", nullptr},
                 {"interrupted", interrupted},
                 {"decisions", ToJson(result.decisions)},
                 {"settled", SettledJson(result.settled)},
                 {"elevation_sigma", result.field.beam.elevationSigma},
                 {"training_frames", result.trainingFrames.size()},
                 {"validation_frames", result.validationFrames.size()},
                 {"width", sweep->width},
                 {"height", sweep->height}};
  console.Print(options.output + ": " + std::to_string(result.field.Size()) + " Gaussians, " +
                std::to_string(result.iterations) + " iterations in " + FormatNumber(result.seconds, 1) + " s on " +
                result.device + ", beam sigma " + FormatNumber(result.field.beam.elevationSigma, 2) + " mm");
  if (!result.decisions.empty())
  {
    console.Print("Decisions, in dB on validation frames (standard error of the mean)");
    PrintDecisions(result.decisions, console);
  }

  if (!heldOutFrames.empty() && !interrupted)
  {
    console.Note("Scoring " + std::to_string(heldOutFrames.size()) + " held-out frames.");
    // Held-out frames have no say in what the probe lights, either.
    const Sweep lit = sweep->LitBy(trainingFrames);
    const FrameScores scores = ScoreField(result.field, lit, heldOutFrames, trainer.engine);
    answer["held_out"] = ToFullJson(scores);
    const FrameScores trained =
        ScoreField(result.field, lit, Spread(result.trainingFrames, heldOutFrames.size()), trainer.engine);
    answer["trained"] = {{"frames", trained.frames.size()},
                         {"psnr", trained.psnr},
                         {"ssim", trained.ssim},
                         {"bfs", trained.bfs.score},
                         {"texture", TextureJson(trained.texture)}};
    console.Print("Frames it was trained on (" + std::to_string(trained.frames.size()) + " of them)");
    console.Print(Row("this field", trained) + "   BFS " + FormatNumber(trained.bfs.score, 3));
    console.Print(TextureLine(trained.texture));
    console.Print("Held-out frames (" + std::to_string(scores.frames.size()) + "), tracked poses");
    console.Print(Row("this field", scores) + "   BFS " + FormatNumber(scores.bfs.score, 3));
    console.Print(TextureLine(scores.texture));
    if (!options.withoutBaselines)
    {
      ScoreBaselines(lit, trainingFrames, heldOutFrames, answer, console);
    }
    if (options.align)
    {
      ScoreAligned(result.field, lit, heldOutFrames, trainer.engine, answer, console);
    }
  }
  if (interrupted)
  {
    console.Note("Interrupted: the best field so far was saved.");
  }
  console.Report(answer);
  return interrupted ? Stopped : Success;
}

/// "" when `parse` takes the text, else what it says.
template <class Parse>
std::string Complaint(const Parse& parse)
{
  try
  {
    parse();
    return "";
  }
  catch (const Error& error)
  {
    return error.what();
  }
}

/// A choice: a number, or auto (default), which leaves it open.
template <class Number>
CLI::Option* AddChoice(CLI::App& app, const std::string& name, std::optional<Number>& choice, double low, double high,
                       const std::string& help)
{
  const auto whole = [](const std::string& text) -> std::string
  {
    double value = 0;
    return text == "auto" || (ParseNumber(text, value) && value == std::floor(value))
               ? ""
               : "'" + text + "' is not a whole number";
  };
  CLI::Option* option = app.add_option_function<std::string>(
                               name,
                               [&choice](const std::string& text)
                               {
                                 double value = 0;
                                 choice.reset();
                                 if (text != "auto" && ParseNumber(text, value))
                                 {
                                   choice = static_cast<Number>(value);
                                 }
                               },
                               help)
                            ->check(CLI::IsMember({"auto"}).description("") | NumberIn(low, high))
                            ->default_str("auto");
  return std::is_integral_v<Number> ? option->check(CLI::Validator(whole, ""))->type_name("N|auto")
                                    : option->type_name("MM|auto");
}

/// A choice between on and off, or auto (default), which leaves it open.
CLI::Option* AddSwitch(CLI::App& app, const std::string& name, bool& choice, const std::string& help)
{
  return app
      .add_option_function<std::string>(
          name, [&choice](const std::string& text) { choice = text == "on"; }, help)
      ->check(CLI::IsMember({"on", "off"}).description(""))
      ->type_name("on|off")
      ->default_str("off");
}

}  // namespace

void AddTrain(Program& program)
{
  auto options = std::make_shared<Options>();
  TrainerOptions& trainer = options->trainer;
  CLI::App* app = program.app.add_subcommand("train",
                                             "Turn a tracked sequence into a Gaussian field\n"
                                             "  bigus train sweep.igs.mha -o field.vtp --hold-out 8\n"
                                             "  bigus train plus.mha --config Plus.xml -o field.vtp "
                                             "--gaussians 300000 --time-limit 600 --log curve.csv\n"
                                             "Ctrl-C stops early and keeps the best field so far.");

  AddSequenceOptions(*app, options->sequence, "SEQUENCE", "Tracked frames: .igs.mha .mha .mhd .nrrd .seq.nrrd .csv");
  AddReduceOption(*app, options->sequence.reduce);
  app->add_option("-o,--output", options->output, "Field to write: .vtp or .ply")->required()->type_name("FIELD");
  app->add_option("--log", options->log, "Write the training curve: loss and validation PSNR over time")
      ->type_name("CSV");

  const char* model = "What is fitted. auto is decided by short trainings, or from geometry with --no-auto";
  app->add_flag("--auto,!--no-auto", trainer.automatic,
                "Decide what is left at auto by short trainings, scored on frames set aside among those to train "
                "on, never on held-out ones (default); --no-auto follows the sweep's geometry, at once")
      ->group(model);
  AddChoice(*app, "--gaussians", trainer.gaussians, 1, 67108864, "Gaussians to start with, 1 to 67108864")
      ->group(model);
  app->add_option("--max-gaussians", trainer.maximumGaussians, "The most that --gaussians auto chooses, 1 to 67108864")
      ->check(NumberIn(1, 67108864))
      ->type_name("N")
      ->capture_default_str()
      ->group(model);
  app->add_option("--price", trainer.price,
                  "What twice the Gaussians must gain on validation frames to be chosen, 0 to 100 dB")
      ->check(NumberIn(0, 100))
      ->type_name("DB")
      ->capture_default_str()
      ->group(model);
  AddChoice(*app, "--elevation-sigma", trainer.elevationSigma, 0, 100,
            "Beam thickness out of plane, standard deviation in mm")
      ->group(model);
  CLI::Option* isSigned = app->add_flag_callback(
                                 "--signed", [&trainer] { trainer.signedReflectivity = true; },
                                 "Allow negative reflectivity, which darkens (the default)")
                              ->group(model);
  app->add_flag_callback(
         "--positive,--positive-only", [&trainer] { trainer.signedReflectivity = false; },
         "Allow no negative reflectivity")
      ->excludes(isSigned)
      ->group(model);
  AddChoice(*app, "--virtual-planes", trainer.virtualPlanes, 0, 8,
            "Interpolated planes added in every gap between training frames, 0 to 8")
      ->group(model);
  app->add_option_function<std::string>(
         "--interpolation",
         [&trainer](const std::string& text)
         { trainer.interpolation = text == "auto" ? std::nullopt : std::optional(FrameInterpolation::Parse(text)); },
         "What virtual planes show: points meet along the frames' normals (normals, normals+flow) or at the "
         "same pixel along the probe's path (probe, probe+flow), with or without optical flow")
      ->check(CLI::Validator([](const std::string& text)
                             { return text == "auto" ? "" : Complaint([&text] { FrameInterpolation::Parse(text); }); },
                             ""))
      ->type_name("HOW|auto")
      ->default_str("auto")
      ->group(model);
  AddSwitch(*app, "--frame-gains", trainer.frameGains,
            "Remove a gain and an offset from every training frame, where frames differ in brightness")
      ->group(model);
  AddSwitch(*app, "--refine-poses", trainer.poseRefinement,
            "Align training frames to the field, where tracking is worse than pixels")
      ->group(model);
  app->add_option("--tracker-translation", trainer.trackerTranslation,
                  "How far --refine-poses trusts a tracked position, standard deviation in mm")
      ->check(NumberIn(1e-6, 1000))
      ->type_name("MM")
      ->capture_default_str()
      ->group(model);
  app->add_option("--tracker-rotation", trainer.trackerRotation, "The same for orientation, degrees")
      ->check(NumberIn(1e-6, 45))
      ->type_name("DEGREES")
      ->capture_default_str()
      ->group(model);
  static const std::map<std::string, SeedPlacement> placements = {
      {"intensity", SeedPlacement::Intensity}, {"harris", SeedPlacement::Harris}, {"random", SeedPlacement::Random}};
  app->add_option("--seeding", trainer.seeding, "Where Gaussians start: intensity (default), harris or random")
      ->transform(CLI::Transformer(placements, CLI::ignore_case).description(""))
      ->type_name("PLACEMENT")
      ->group(model);
  app->add_option("--continue", options->continueFrom, "Start from this field instead of seeding")
      ->type_name("FIELD")
      ->group(model);

  const char* course = "How long and how";
  AddChoice(*app, "--iterations", trainer.iterations, 0, 1e7,
            "Optimizer steps; 0 only seeds; auto begins at 80 passes over the training frames (60 when they are "
            "more than 1 mm apart), at least 200")
      ->group(course);
  app->add_option("--time-limit", trainer.timeLimit, "Seconds, decisions included; 0 sets no limit")
      ->check(NumberIn(0, 1e7))
      ->type_name("S")
      ->capture_default_str()
      ->group(course);
  app->add_option("--seed", trainer.seed, "Seed of everything random: same seed, same field")
      ->check(NumberIn(0, 18446744073709549568.0))
      ->type_name("S")
      ->capture_default_str()
      ->group(course);
  app->add_option("--batch", trainer.batch, "Frames a step, 1 to 4096")
      ->check(NumberIn(1, 4096))
      ->type_name("N")
      ->capture_default_str()
      ->group(course);
  app->add_option("--preset", options->preset,
                  "What the field is for: fidelity (least error) or texture (speckle as strong as in the frames, at a "
                  "price in error)")
      ->check(CLI::Validator(
          [](const std::string& text)
          {
            return Complaint(
                [&text]
                {
                  TrainerOptions any;
                  ApplyPreset(text, any);
                });
          },
          ""))
      ->type_name("AIM")
      ->capture_default_str()
      ->group(course);
  const auto soundLoss = [](const std::string& text) { return Complaint([&text] { Loss::Parse(text); }); };
  app->add_option("--loss", options->loss,
                  "What is made small: l1, l2, dssim, ffl, contrast or a sum such as 0.8*l1+0.2*dssim; default: the "
                  "preset's, l1 for fidelity")
      ->check(CLI::Validator(soundLoss, ""))
      ->type_name("LOSS")
      ->group(course);
  app->add_option("--final-loss", options->finalLoss,
                  "The loss at the end, whose weights are reached linearly; default: --loss stays as it is")
      ->check(CLI::Validator(soundLoss, ""))
      ->type_name("LOSS")
      ->group(course);
  app->add_option("--densify", trainer.densification.interval,
                  "Steps between restructurings that add Gaussians where error persists; 0 never")
      ->check(NumberIn(0, 1e7))
      ->type_name("N")
      ->capture_default_str()
      ->group(course);
  app->add_option("--engine", trainer.engine, "What computes: auto, or a name from 'bigus info --devices'")
      ->type_name("NAME")
      ->capture_default_str()
      ->group(course);

  const char* honesty = "How it is judged";
  const auto holdOutRule = [](const std::string& text) -> std::string
  {
    double k = 0;
    return ParseNumber(text, k) && (k == 0 || (k >= 2 && k <= 1e6))
               ? ""
               : "'" + text + "' is neither 0 (hold out nothing) nor a number from 2 on";
  };
  app->add_option("--hold-out", trainer.holdOut,
                  "Keep frames with index % K == K / 2 out of everything but the final score; 0 keeps none")
      ->check(CLI::Validator(holdOutRule, ""))
      ->type_name("K")
      ->capture_default_str()
      ->group(honesty);
  app->add_option("--validation", trainer.validation,
                  "Of the other frames, keep every K-th to stop early by; 0 keeps none")
      ->check(CLI::Validator(holdOutRule, ""))
      ->type_name("K")
      ->capture_default_str()
      ->group(honesty);
  app->add_flag("--align", options->align,
                "Score held-out frames a second time, each moved rigidly to where the field explains it best "
                "(within 2 mm and 3 degrees): a diagnostic that tells tracking error from modelling error")
      ->group(honesty);
  app->add_flag("--no-baselines", options->withoutBaselines, "Do not score the plain methods beside the field")
      ->group(honesty);

  RunWhenChosen(app, program, [options](Console& console) { return Train(console, *options); });
}

}  // namespace bigus::command
