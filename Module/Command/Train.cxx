// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus train: a tracked sequence to a Gaussian field, with an honest score on frames it never saw.
#include <sys/resource.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>

#include "Command.h"
#include "Core/Engine/Engine.h"
#include "Core/Evaluation/CrossPlanes.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Model/Error.h"
#include "Core/Model/FieldRounding.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/OptionList.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "Data/SweepData.h"
#include "Files.h"
#include "IO/CheckpointFile.h"
#include "IO/Text.h"
#include "Inputs.h"
#include "Outputs.h"
#include "Pipeline.h"
#include "Scores.h"
#include "vtkBigusTrainer.h"
#include "vtkDataArray.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkPolyData.h"
#include "vtkTable.h"
#include "vtkVariant.h"

namespace bigus::command
{

namespace
{

struct Options
{
  SequenceOptions sequence;       ///< the first, and how all are read
  std::vector<std::string> more;  ///< further sequences
  std::string output, log, continueFrom, poses;
  std::map<std::string, std::string> trainer;  ///< values of the trainer's options that were given, by name
  double checkpointInterval = 60;              ///< s; 0 writes none
  bool withoutBaselines = false, align = false, resume = false, exact = false;
};

std::uint64_t PeakMemory()
{
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;  // Linux counts in kilobytes
}

/// The training curve, one line a row of the trainer's log. What was not measured stays empty.
void WriteLog(const std::string& path, vtkTable* log)
{
  WriteAtomically(path,
                  [log](std::ostream& file)
                  {
                    file.precision(9);
                    file << "iteration,seconds,loss,validation_psnr,gaussians,rate\n";
                    for (vtkIdType row = 0; row < log->GetNumberOfRows(); ++row)
                    {
                      const char* comma = "";
                      for (const char* name : {"Iteration", "Seconds", "Loss", "ValidationPSNR", "Gaussians", "Rate"})
                      {
                        const double value = log->GetValueByName(row, name).ToDouble();
                        file << comma;
                        comma = ",";
                        if (!std::isnan(value))
                        {
                          file << value;
                        }
                      }
                      file << '\n';
                    }
                  });
}

/// What was chosen, why, and what finding out cost.
Json ToJson(vtkTable* decisions)
{
  Json list = Json::array();
  for (vtkIdType row = 0; row < decisions->GetNumberOfRows(); ++row)
  {
    list.push_back({{"decision", decisions->GetValueByName(row, "Decision").ToString()},
                    {"choice", decisions->GetValueByName(row, "Choice").ToString()},
                    {"evidence", decisions->GetValueByName(row, "Evidence").ToString()},
                    {"seconds", decisions->GetValueByName(row, "Seconds").ToDouble()}});
  }
  return list;
}

void PrintDecisions(const Json& decisions, Console& console)
{
  const auto padded = [](const std::string& text, std::size_t width)
  { return text + std::string(text.size() < width ? width - text.size() : 1, ' '); };
  for (const Json& decision : decisions)
  {
    console.Print("  " + padded(decision["decision"], 18) + padded(decision["choice"], 12) +
                  padded(FormatNumber(decision["seconds"], 1) + " s", 9) + decision["evidence"].get<std::string>());
  }
}

/// The options with every choice made, whoever made it.
Json SettledJson(vtkBigusTrainer* trainer)
{
  Json settled;
  for (OptionText option : ListOptions())
  {
    option.value = trainer->GetSettledOption(option.info.name);
    settled[SpellOption(option.info.name, '_')] = bigus::ToJson<Json>(option);
  }
  return settled;
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

/// The score of each of several sequences, at the poses that were trained at and as tracked.
void ScoreSequences(const GaussianField& field, const Sweep& lit, const Sweep& tracked, const std::vector<int>& heldOut,
                    const std::string& engine, Json& answer, Console& console)
{
  for (const std::vector<int>& frames : BySequence(lit, heldOut))
  {
    const int k = lit.SequenceOf(frames.front());
    const FrameScores scores = ScoreField(field, lit, frames, engine);
    answer["sequences"][k]["held_out"] = ToFullJson(scores);
    const bool isCorrected = std::any_of(frames.begin(), frames.end(),
                                         [&](int f) { return lit.imageToReference[f] != tracked.imageToReference[f]; });
    answer["sequences"][k]["held_out_tracked"] =
        isCorrected ? ToFullJson(ScoreField(field, tracked, frames, engine)) : answer["sequences"][k]["held_out"];
    console.Print(Row("  sequence " + std::to_string(k + 1), scores) + "   " + std::to_string(frames.size()) +
                  " frames, poses " + answer["sequences"][k]["poses"].get<std::string>());
  }
}

/// What the field shows along the sweep, where there is no truth: beside linear interpolation between the frames.
void ScoreCrossPlanes(const GaussianField& field, const Sweep& sweep, const std::vector<int>& training,
                      const std::string& engineName, Json& answer, Console& console)
{
  const std::unique_ptr<Engine> engine = Engine::Create(engineName);
  engine->SetField(field);
  const auto render = [&engine](const SlicePlane& plane, float* image)
  { engine->Render(plane, ViewOutput::Intensity, image); };
  if (const std::optional<CrossScores> scores = CrossPlaneScorer(sweep, training).Score(render))
  {
    answer["cross_planes"] = {{"detail", scores->detail}, {"scratches", scores->scratches}};
    console.Print("Planes along the sweep (linear interpolation between frames: 1 and 1)");
    console.Print("  detail " + FormatNumber(scores->detail, 2) + ", scratches " + FormatNumber(scores->scratches, 2));
  }
}

/// What to read, one for each sequence.
std::vector<SequenceOptions> Sequences(const Options& options)
{
  std::vector<SequenceOptions> all = {options.sequence};
  for (const std::string& path : options.more)
  {
    all.push_back(options.sequence);
    all.back().path = path;
  }
  return all;
}

/// "poses.csv" to "poses-2.csv" for the second of several sequences; as it is for one alone.
std::string NameOfSequence(const std::string& path, std::size_t k, std::size_t count)
{
  if (count == 1)
  {
    return path;
  }
  const std::filesystem::path name = std::filesystem::path(path).filename();
  std::string stem = name.stem().string(), ending = name.extension().string();
  if (HasSuffix(stem, ".igs") || HasSuffix(stem, ".seq"))
  {
    ending = stem.substr(stem.size() - 4) + ending;
    stem.resize(stem.size() - 4);
  }
  return (std::filesystem::path(path).parent_path() / (stem + "-" + std::to_string(k + 1) + ending)).string();
}

/// The sequence as it is trained on, --reduce applied.
vtkSmartPointer<vtkImageData> ReadTrainingImage(const SequenceOptions& options, Console& console)
{
  const vtkSmartPointer<vtkImageData> whole = ReadSequence(options, console);
  if (options.reduce <= 1)
  {
    return whole;
  }
  auto reduced = vtkSmartPointer<vtkImageData>::New();
  SweepToImage(SweepFromImage(whole).sweep->Reduced(options.reduce), reduced);
  return reduced;
}

/// Throws Error, which names both files, where frames of two sequences differ in size.
void RequireOneSizeOf(const std::vector<SequenceOptions>& sequences, const std::vector<vtkImageData*>& images)
{
  for (std::size_t k = 1; k < images.size(); ++k)
  {
    const int *first = images[0]->GetDimensions(), *other = images[k]->GetDimensions();
    RequireOneSize(first[0], first[1], sequences[0].path, other[0], other[1], sequences[k].path);
  }
}

/// The trainer's frames by their number in the sweep, which leaves rejected ones out. `usable` are the sweep's frames by
/// their number in the image, increasing.
std::vector<int> SweepFrames(vtkIntArray* imageFrames, const std::vector<int>& usable)
{
  std::vector<int> frames;
  for (vtkIdType i = 0; i < imageFrames->GetNumberOfValues(); ++i)
  {
    const auto found = std::lower_bound(usable.begin(), usable.end(), imageFrames->GetValue(i));
    frames.push_back(static_cast<int>(found - usable.begin()));
  }
  return frames;
}

/// The poses that the trainer trained at, of the image's usable frames.
std::vector<Eigen::Matrix4d> CorrectedPoses(vtkBigusTrainer* trainer, const std::vector<int>& usable)
{
  std::vector<Eigen::Matrix4d> poses;
  for (const int frame : usable)
  {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose;
    trainer->GetCorrectedPoses()->GetTypedTuple(frame, pose.data());
    poses.push_back(pose);
  }
  return poses;
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

/// How a training keeps its state in `file`. After an interruption the state waits in `waiting`, because the field is
/// written first.
Checkpoints KeepIn(CheckpointFile& file, std::string& waiting, const Options& options, Console& console)
{
  Checkpoints checkpoints;
  checkpoints.interval = options.checkpointInterval;
  if (options.resume && file.Exists())
  {
    checkpoints.resume = file.Read();
    console.Note("Going on from " + file.Path() + ".");
  }
  else if (options.resume)
  {
    console.Note("There is no " + file.Path() + " to go on from, so training begins.");
  }
  else if (file.Exists())
  {
    console.Note(file.Path() +
                 " holds a training that was not finished. --resume would go on with it; this training replaces it.");
  }
  if (checkpoints.interval > 0)
  {
    checkpoints.save = [&file, &waiting](const std::string& state)
    {
      if (IsInterrupted())
      {
        waiting = state;
      }
      else
      {
        file.Write(state);
      }
    };
  }
  return checkpoints;
}

ExitCode Train(Console& console, const Options& options)
{
  CheckpointFile checkpoint(options.output + ".checkpoint",
                            [&console](const std::string& what) { console.Note("bigus: warning: " + what); });
  const std::vector<SequenceOptions> sequences = Sequences(options);
  std::vector<std::string> inputs = {options.sequence.chain.config, options.continueFrom}, posesFiles;
  for (std::size_t k = 0; k < sequences.size(); ++k)
  {
    inputs.push_back(sequences[k].path);
    if (!options.poses.empty())
    {
      posesFiles.push_back(NameOfSequence(options.poses, k, sequences.size()));
    }
  }
  std::vector<std::string> outputs = posesFiles;
  outputs.insert(outputs.end(), {options.output, options.log, checkpoint.Path()});
  RequireDistinct(inputs, outputs);
  RequireWritable(options.output);
  RequireFieldName(options.output);
  for (const std::string& file : posesFiles)
  {
    RequirePosesName(file);
    RequireWritable(file);
  }
  if (!options.log.empty())
  {
    RequireWritable(options.log);
  }

  vtkNew<vtkBigusTrainer> trainer;
  TrainerOptions settings;
  for (const auto& [name, value] : options.trainer)
  {
    trainer->SetOption(name.c_str(), value.c_str());
    SetOption(settings, name, value);
  }
  Engine::Create(settings.engine);  // an unknown name is said before the sweep is read
  std::vector<vtkSmartPointer<vtkImageData>> kept;
  std::vector<vtkImageData*> images;
  for (const SequenceOptions& one : sequences)
  {
    kept.push_back(ReadTrainingImage(one, console));
    images.push_back(kept.back());
  }
  RequireOneSizeOf(sequences, images);
  const auto [sweep, usableFrames] = SweepFromImages(images);
  const std::vector<std::vector<int>> framesOf = BySequence(*sweep, AllFrames(*sweep));
  const auto [trainingFrames, heldOutFrames] = SplitHoldOut(*sweep, AllFrames(*sweep), settings.holdOut);
  if (settings.holdOut > 0 && heldOutFrames.empty())
  {
    throw Error("--hold-out " + std::to_string(settings.holdOut) + " keeps none of the " +
                std::to_string(sweep->NumberOfFrames()) + " usable frames; use a smaller number.");
  }
  if (settings.holdOut > 0 && std::min(sweep->width, sweep->height) < 11)
  {
    throw Error("Frames of " + std::to_string(sweep->width) + " x " + std::to_string(sweep->height) +
                " pixels cannot be scored (11 x 11 are needed); use a smaller --reduce.");
  }
  for (vtkImageData* image : images)
  {
    trainer->AddInputData(image);
  }
  if (!options.continueFrom.empty())
  {
    trainer->SetInitialFieldData(ReadFieldData(options.continueFrom, console));
  }
  console.Note("Training on " + std::to_string(trainingFrames.size()) + " frames of " + std::to_string(sweep->width) +
               " x " + std::to_string(sweep->height) + " pixels" +
               (sequences.size() > 1 ? ", from " + std::to_string(sequences.size()) + " sequences" : "") + "; " +
               std::to_string(heldOutFrames.size()) + " held out.");
  std::string waiting;
  trainer->SetCheckpoints(KeepIn(checkpoint, waiting, options, console));
  UpdateUntilInterrupted(trainer, console, "Training");

  const bool interrupted = trainer->GetAborted() || IsInterrupted();
  vtkPolyData* output = trainer->GetOutput();
  SetProvenance(output, "program", std::string("bigus ") + BIGUS_VERSION);
  std::string recorded;
  for (const SequenceOptions& one : sequences)
  {
    recorded += (recorded.empty() ? "" : " ") + ChecksumOfPoses(one.path, one.chain);
  }
  SetProvenance(output, "recordedPoses", recorded);
  SetProvenance(output, "world", options.sequence.chain.to);
  SetProvenance(output, "reduce", std::to_string(options.sequence.reduce));
  WriteFieldData(output, options.output, !options.exact, console);
  if (!waiting.empty())
  {
    checkpoint.Write(waiting);
    waiting.clear();
  }
  if (trainer->GetFinished())
  {
    checkpoint.Remove();
  }
  if (!options.log.empty())
  {
    WriteLog(options.log, trainer->GetLog());
  }
  vtkIdType earlier = 0;  // frames of the images before
  for (std::size_t k = 0; k < posesFiles.size(); ++k)
  {
    const vtkIdType frames = images[k]->GetDimensions()[2];
    vtkNew<vtkDoubleArray> poses;
    poses->SetName("ImageToReference");
    poses->SetNumberOfComponents(16);
    poses->InsertTuples(0, frames, earlier, trainer->GetCorrectedPoses());
    vtkNew<vtkImageData> trained;
    trained->ShallowCopy(images[k]);
    trained->GetFieldData()->AddArray(poses);
    WritePoses(trained, posesFiles[k], {}, console);
    earlier += frames;
  }

  GaussianField field = FieldFromPolyData(output);
  if (!options.exact)
  {
    RoundField(field);  // what is scored is what was written
  }
  const Json decisions = ToJson(trainer->GetDecisions());
  const auto bytes = std::filesystem::file_size(options.output);
  Json answer = {{"gaussians", field.Size()},
                 {"bytes", bytes},
                 {"seconds", trainer->GetSeconds()},
                 {"iterations", trainer->GetIterationsDone()},
                 {"device", trainer->GetDevice()},
                 {"seed", settings.seed},
                 {"peak_memory_bytes", PeakMemory()},  // of training; the baselines may need more
                 {"held_out", nullptr},
                 {"held_out_tracked", nullptr},
                 {"held_out_aligned", nullptr},
                 {"trained", nullptr},
                 {"baselines", nullptr},
                 {"cross_planes", nullptr},
                 {"sequences", Json::array()},
                 {"interrupted", interrupted},
                 {"finished", trainer->GetFinished()},
                 {"decisions", decisions},
                 {"settled", SettledJson(trainer)},
                 {"elevation_sigma", field.beam.elevationSigma},
                 {"training_frames", trainer->GetTrainingFrames()->GetNumberOfValues()},
                 {"validation_frames", trainer->GetValidationFrames()->GetNumberOfValues()},
                 {"width", sweep->width},
                 {"height", sweep->height}};
  console.Print(options.output + ": " + std::to_string(field.Size()) + " Gaussians, " +
                FormatNumber(static_cast<double>(bytes) / 1e6, 1) + " MB, " +
                std::to_string(trainer->GetIterationsDone()) + " iterations in " +
                FormatNumber(trainer->GetSeconds(), 1) + " s on " + trainer->GetDevice() + ", beam sigma " +
                FormatNumber(field.beam.elevationSigma, 2) + " mm");
  if (!decisions.empty())
  {
    console.Print("Decisions, in dB on validation frames (standard error of the mean)");
    PrintDecisions(decisions, console);
  }

  // Held-out frames have no say in what the probe lights, either.
  const Sweep tracked = sweep->LitBy(trainingFrames);
  Sweep lit = tracked;
  lit.imageToReference = CorrectedPoses(trainer, usableFrames);
  const bool corrected = lit.imageToReference != tracked.imageToReference;
  for (std::size_t k = 0; k < framesOf.size(); ++k)
  {
    const std::string poses = framesOf.size() == 1 ? "poses" : "poses.sequence" + std::to_string(k + 1);
    answer["sequences"].push_back({{"frames", framesOf[k].size()},
                                   {"poses", GetProvenance(output, poses.c_str())},
                                   {"held_out", nullptr},
                                   {"held_out_tracked", nullptr}});
  }
  if (!heldOutFrames.empty() && !interrupted)
  {
    console.Note("Scoring " + std::to_string(heldOutFrames.size()) + " held-out frames.");
    const FrameScores scores = ScoreField(field, lit, heldOutFrames, settings.engine);
    const FrameScores scoresTracked = corrected ? ScoreField(field, tracked, heldOutFrames, settings.engine) : scores;
    answer["held_out"] = ToFullJson(scores);
    answer["held_out_tracked"] = ToFullJson(scoresTracked);
    const std::vector<int> trainedFrames = SweepFrames(trainer->GetTrainingFrames(), usableFrames);
    const FrameScores trained = ScoreField(field, lit, Spread(trainedFrames, heldOutFrames.size()), settings.engine);
    answer["trained"] = {{"frames", trained.frames.size()},
                         {"psnr", trained.psnr},
                         {"ssim", trained.ssim},
                         {"bfs", trained.bfs.score},
                         {"texture", TextureJson(trained.texture)}};
    console.Print("Frames it was trained on (" + std::to_string(trained.frames.size()) + " of them)");
    console.Print(Row("this field", trained) + "   BFS " + FormatNumber(trained.bfs.score, 3));
    console.Print(TextureLine(trained.texture));
    console.Print("Held-out frames (" + std::to_string(scores.frames.size()) + "), " +
                  (corrected ? "corrected poses (their own pixels had no part in them)" : "tracked poses"));
    console.Print(Row("this field", scores) + "   BFS " + FormatNumber(scores.bfs.score, 3));
    console.Print(TextureLine(scores.texture));
    if (corrected)
    {
      console.Print(Row("  at tracked poses", scoresTracked) + "   BFS " + FormatNumber(scoresTracked.bfs.score, 3));
    }
    if (framesOf.size() > 1)
    {
      ScoreSequences(field, lit, tracked, heldOutFrames, settings.engine, answer, console);
    }
    else
    {
      answer["sequences"][0].update(
          {{"held_out", answer["held_out"]}, {"held_out_tracked", answer["held_out_tracked"]}});
    }
    if (!options.withoutBaselines)
    {
      ScoreBaselines(lit, trainingFrames, heldOutFrames, answer, console);
    }
    if (options.align)
    {
      ScoreAligned(field, lit, heldOutFrames, settings.engine, answer, console);
    }
  }
  if (!interrupted)
  {
    ScoreCrossPlanes(field, lit, trainingFrames, settings.engine, answer, console);
  }
  if (interrupted)
  {
    console.Note("Interrupted: the best field so far was saved.");
  }
  if (!trainer->GetFinished() && checkpoint.Exists())
  {
    console.Note("Not all steps were taken. The same command with --resume " +
                 std::string(interrupted ? "" : "and a longer --time-limit ") + "goes on from " + checkpoint.Path() +
                 ".");
  }
  console.Report(answer);
  return interrupted ? InterruptedCode() : Success;
}

/// The trainer's options by the list that Core keeps of them: their names, ranges, defaults and help.
void AddTrainerOptions(CLI::App& app, std::map<std::string, std::string>& given)
{
  // Other names that are shorter.
  static const std::map<std::string, std::string> kShort = {{"MaximumGaussians", ",--max-gaussians"},
                                                            {"PoseRefinement", ",--refine-poses"},
                                                            {"DensificationInterval", ",--densify"}};
  std::map<std::string, CLI::Option*> added;
  for (const OptionText& option : ListOptions())
  {
    const std::string name = option.info.name;
    const bool isNumber = option.kind == OptionText::Kind::Number;
    std::string help = option.info.help;
    help += isNumber ? "; " + option.values : "";
    help += *option.info.open ? "; auto: " + std::string(option.info.open) : "";
    const std::string type = isNumber ? "N" : option.values.empty() ? "TEXT" : option.values;
    const auto fault = [name](const std::string& value) -> std::string
    {
      try
      {
        TrainerOptions any;
        SetOption(any, name, value);
        return "";
      }
      catch (const Error& error)
      {
        return error.what();
      }
    };
    const std::string flags = "--" + SpellOption(name, '-') + (kShort.count(name) ? kShort.at(name) : "");
    added[name] = app.add_option_function<std::string>(
                         flags, [&given, name](const std::string& value) { given[name] = value; }, help)
                      ->check(CLI::Validator(fault, "", isNumber ? option.isWhole ? kWhole : kReal : ""))
                      ->type_name(type + (option.mayBeOpen ? "|auto" : ""))
                      ->default_str(option.value)
                      ->group(option.info.group);
  }

  // Switches that need no value.
  app.add_flag_function(
         "--auto,!--no-auto", [&given](std::int64_t count) { given["Automatic"] = count > 0 ? "on" : "off"; },
         "Short for --automatic on, and off")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast)
      ->group(added["Automatic"]->get_group())
      ->excludes(added["Automatic"]);
  app.add_flag_callback(
         "--preview", [&given] { given["TimeLimit"] = "10"; },
         "Short for --time-limit 10: a usable field in ten seconds, without trials")
      ->group(added["TimeLimit"]->get_group())
      ->excludes(added["TimeLimit"]);
  CLI::Option* isSigned =
      app.add_flag_callback(
             "--signed", [&given] { given["SignedReflectivity"] = "on"; }, "Short for --signed-reflectivity on")
          ->group(added["SignedReflectivity"]->get_group())
          ->excludes(added["SignedReflectivity"]);
  app.add_flag_callback(
         "--positive,--positive-only", [&given] { given["SignedReflectivity"] = "off"; },
         "Short for --signed-reflectivity off")
      ->group(added["SignedReflectivity"]->get_group())
      ->excludes(added["SignedReflectivity"])
      ->excludes(isSigned);
}

}  // namespace

void AddTrain(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app =
      program.app.add_subcommand("train",
                                 "Turn a tracked sequence into a Gaussian field\n"
                                 "  bigus train sweep.igs.mha -o field.vtp --preview\n"
                                 "  bigus train sweep.igs.mha -o field.vtp --hold-out 8\n"
                                 "  bigus train axial.igs.mha sagittal.igs.mha -o field.vtp --hold-out 8\n"
                                 "  bigus train plus.mha --config Plus.xml -o field.vtp "
                                 "--gaussians 300000 --time-limit 600 --log curve.csv\n"
                                 "Ctrl-C stops early and keeps the best field so far; --resume goes on from there.");

  AddSequenceOptions(*app, options->sequence, "SEQUENCE", "Tracked frames: .igs.mha .mha .mhd .nrrd .seq.nrrd .csv");
  app->add_option(
         "MORE", options->more,
         "Further sequences of the same patient in the same world, for the same field. Poses are corrected and "
         "frames held out in each by itself; the options below that say how a sequence is read are for all")
      ->check(FileToRead(kSequenceEndings))
      ->type_name("");
  AddReduceOption(*app, options->sequence.reduce);
  app->add_option("-o,--output", options->output, "Field to write: .vtp or .ply")
      ->check(FileToWrite(kFieldEndings))
      ->required()
      ->type_name("FIELD");
  app->add_option("--log", options->log, "Write the training curve: loss and validation PSNR over time")
      ->check(FileToWrite(".csv"))
      ->type_name("CSV");
  app->add_option(
         "--write-poses", options->poses,
         "Write the poses that the field is trained at: the sequence, after --reduce, at these poses (.igs.mha, "
         ".nrrd), or a CSV; 'slice --poses' takes either. Of several sequences OUT-1, OUT-2 and so on, before the ending")
      ->check(FileToWrite(".mha,.nrrd,.csv"))
      ->type_name("OUT");
  app->add_option("--continue", options->continueFrom, "Start from this field instead of seeding")
      ->check(FileToRead(kFieldEndingsToRead))
      ->type_name("FIELD");
  app->add_flag("--exact", options->exact,
                "Write every digit of the field. Without it those are dropped that no picture shows (by less than 0.01 "
                "dB), and the file is less than half as large");
  app->add_flag("--resume", options->resume,
                "Go on where a training of this output was interrupted or killed, from FIELD.checkpoint; begin where "
                "there is none. The field is the same, bit for bit, as without a stop");
  app->add_option("--checkpoint-interval", options->checkpointInterval,
                  "Write FIELD.checkpoint so often, and when interrupted; 0 never; 0 to 1e6 s")
      ->check(NumberIn(0, 1e6))
      ->type_name("N")
      ->capture_default_str();
  AddTrainerOptions(*app, options->trainer);
  const char* judged = "How it is judged";
  app->add_flag("--align", options->align,
                "Score held-out frames a second time, each moved rigidly to where the field explains it best "
                "(within 2 mm and 3 degrees): a diagnostic that tells tracking error from modelling error")
      ->group(judged);
  app->add_flag("--no-baselines", options->withoutBaselines, "Do not score the plain methods beside the field")
      ->group(judged);

  RunWhenChosen(app, program, [options](Console& console) { return Train(console, *options); });
}

}  // namespace bigus::command
