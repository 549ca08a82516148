// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus train: a tracked sequence to a Gaussian field, with an honest score on frames it never saw.
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <optional>

#include "Command.h"
#include "Core/Engine/Engine.h"
#include "Core/Model/Error.h"
#include "Core/Model/FieldRounding.h"
#include "Core/StandardError/StandardError.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/OptionList.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "Data/SweepData.h"
#include "Files.h"
#include "IO/CheckpointFile.h"
#include "IO/FieldFile.h"
#include "IO/FileError.h"
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

struct TrainOptions
{
  SequenceOptions sequence;       ///< the first, and how all are read
  std::vector<std::string> more;  ///< further sequences
  std::string output, log, continueFrom, poses;
  TrainerOptions trainer;
  double checkpointInterval = 60;  ///< s; 0 writes none
  bool withoutBaselines = false, withoutStandardError = false, align = false, resume = false, exact = false;
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

bool WasInterrupted(vtkBigusTrainer* trainer)
{
  return trainer->GetAborted() || IsInterrupted();
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

/// What to read, one for each sequence.
std::vector<SequenceOptions> Sequences(const TrainOptions& options)
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

/// The sequence as it is trained on, --reduce applied. Text of a screen is looked for before pixels are averaged, because
/// it mixes with tissue then; what is found is told and added to `findings`.
vtkSmartPointer<vtkImageData> ReadTrainingImage(const SequenceOptions& options, const TrainerOptions& trainer,
                                                Json& findings, Console& console)
{
  const vtkSmartPointer<vtkImageData> whole = ReadSequence(options, console);
  if (options.reduce <= 1)
  {
    return whole;
  }
  const ImportedSweep imported = SweepFromImage(whole);
  const char* const kept = trainer.keep.Keeps(FindingKind::Overlay) ? "all" : "order+contact+repeat+rest+tracking+fan";
  InspectedSweep inspected = bigus::Inspect(imported.sweep, KeptKinds::Parse(kept), trainer.holdOut);
  const auto isOther = [](const Finding& finding) { return finding.kind != FindingKind::Overlay; };
  inspected.findings.erase(std::remove_if(inspected.findings.begin(), inspected.findings.end(), isOther),
                           inspected.findings.end());
  for (const Json& finding : FindingsJson(inspected.findings, imported.frames))
  {
    console.Note("bigus: warning: " + finding["text"].get<std::string>());
    findings.push_back(finding);
  }
  auto reduced = vtkSmartPointer<vtkImageData>::New();
  SweepToImage(inspected.sweep->Reduced(options.reduce), reduced);
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
/// their number in the image.
std::vector<int> SweepFrames(vtkIntArray* imageFrames, const std::vector<int>& usable)
{
  std::map<int, int> frameOf;
  for (const int imageFrame : usable)
  {
    frameOf.emplace(imageFrame, static_cast<int>(frameOf.size()));
  }
  std::vector<int> frames;
  for (vtkIdType i = 0; i < imageFrames->GetNumberOfValues(); ++i)
  {
    frames.push_back(frameOf.at(imageFrames->GetValue(i)));
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

/// How a training keeps its state in `file`. After an interruption the state waits in `waiting`, because the field is
/// written first.
Checkpoints KeepIn(CheckpointFile& file, std::string& waiting, const TrainOptions& options, Console& console)
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

/// The files that poses are written to, one for each sequence; none where they are not asked for.
std::vector<std::string> PosesFiles(const TrainOptions& options, std::size_t count)
{
  std::vector<std::string> files;
  for (std::size_t k = 0; k < count && !options.poses.empty(); ++k)
  {
    files.push_back(NameOfSequence(options.poses, k, count));
  }
  return files;
}

/// Throws OutputError, before hours of work, where something could not be written at their end.
void RequireOutputs(const TrainOptions& options, const std::vector<SequenceOptions>& sequences,
                    const std::vector<std::string>& posesFiles, const std::string& checkpoint)
{
  std::vector<std::string> inputs = {options.sequence.chain.config, options.continueFrom};
  for (const SequenceOptions& one : sequences)
  {
    inputs.push_back(one.path);
  }
  std::vector<std::string> outputs = posesFiles;
  outputs.insert(outputs.end(), {options.output, options.log, checkpoint});
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
}

/// Throws OutputError where another program trains the same output.
void Lock(CheckpointFile& checkpoint)
{
  try
  {
    checkpoint.Lock();
  }
  catch (const FileError& error)
  {
    throw OutputError(error.what());
  }
}

/// What is trained on: one image a sequence, what an inspection left of all frames as one sweep, and which of them are held
/// out.
struct Frames
{
  std::vector<vtkSmartPointer<vtkImageData>> images;
  ImportedSweep imported;
  Json findings = Json::array();
  std::vector<int> training, heldOut;
};

/// Fills what an inspection of recorded frames leaves to train on and to score. A held-out frame has no part in the former,
/// and is not scored where it shows what is left out elsewhere.
void Inspect(const ImportedSweep& recorded, const TrainerOptions& options, Frames& frames)
{
  const InspectedSweep inspected = bigus::Inspect(recorded.sweep, options.keep, options.holdOut);
  std::vector<int> shown = options.holdOut > 0 ? bigus::Inspect(recorded.sweep, options.keep).frames : inspected.frames;
  std::sort(shown.begin(), shown.end());
  frames.imported.sweep = inspected.sweep;
  for (int k = 0; k < inspected.sweep->NumberOfFrames(); ++k)
  {
    const int frame = inspected.frames[k];
    frames.imported.frames.push_back(recorded.frames[frame]);
    if (!std::binary_search(inspected.heldOut.begin(), inspected.heldOut.end(), k))
    {
      frames.training.push_back(k);
    }
    else if (std::binary_search(shown.begin(), shown.end(), frame))
    {
      frames.heldOut.push_back(k);
    }
  }
  for (Json& finding : FindingsJson(inspected.findings, recorded.frames))
  {
    frames.findings.push_back(std::move(finding));
  }
}

Frames ReadFrames(const std::vector<SequenceOptions>& sequences, const TrainerOptions& options, Console& console)
{
  const int holdOut = options.holdOut;
  Frames frames;
  std::vector<vtkImageData*> images;
  for (const SequenceOptions& one : sequences)
  {
    frames.images.push_back(ReadTrainingImage(one, options, frames.findings, console));
    images.push_back(frames.images.back());
  }
  RequireOneSizeOf(sequences, images);
  const ImportedSweep recorded = SweepFromImages(images);
  Inspect(recorded, options, frames);
  const Sweep& sweep = *frames.imported.sweep;
  Require(holdOut <= 0 || !frames.heldOut.empty(), "--hold-out ", holdOut, " keeps none of the ",
          sweep.NumberOfFrames(), " usable frames; ",
          sweep.NumberOfFrames() > 1 ? "use a smaller number." : "a field needs two frames besides those held out.");
  Require(holdOut <= 0 || std::min(sweep.width, sweep.height) >= 11, "Frames of ", sweep.width, " x ", sweep.height,
          " pixels cannot be scored (11 x 11 are needed); use a smaller --reduce.");
  return frames;
}

void Prepare(vtkBigusTrainer* trainer, const TrainOptions& options, const Frames& frames, Console& console)
{
  for (const OptionText& option : ListOptions(options.trainer))
  {
    trainer->SetOption(option.info.name, option.value.c_str());
  }
  // Where no file can keep it and no frame can prove it, it is not measured.
  trainer->SetKeepStandardError(!options.withoutStandardError &&
                                (HasSuffix(options.output, ".vtp") || !frames.heldOut.empty()));
  for (vtkImageData* image : frames.images)
  {
    trainer->AddInputData(image);
  }
  if (!options.continueFrom.empty())
  {
    trainer->SetInitialFieldData(ReadFieldData(options.continueFrom, console));
  }
  const Sweep& sweep = *frames.imported.sweep;
  const std::size_t sequences = frames.images.size();
  console.Note("Training on " + std::to_string(frames.training.size()) + " frames of " + std::to_string(sweep.width) +
               " x " + std::to_string(sweep.height) + " pixels" +
               (sequences > 1 ? ", from " + std::to_string(sequences) + " sequences" : "") + "; " +
               std::to_string(frames.heldOut.size()) + " held out.");
}

/// Writes the field, with what the command knows of its making.
void WriteField(vtkPolyData* field, const TrainOptions& options, const std::vector<SequenceOptions>& sequences,
                Console& console)
{
  std::string recorded;
  for (const SequenceOptions& one : sequences)
  {
    recorded += (recorded.empty() ? "" : " ") + ChecksumOfPoses(one.path, one.chain);
  }
  SetProvenance(field, "program", std::string("bigus ") + BIGUS_VERSION);
  SetProvenance(field, "recordedPoses", recorded);
  SetProvenance(field, "world", options.sequence.chain.to);
  SetProvenance(field, "reduce", std::to_string(options.sequence.reduce));
  WriteFieldData(field, options.output, !options.exact, console);
}

/// Writes the field; where that fails, at least the state of a training that was interrupted.
void Save(vtkPolyData* field, const TrainOptions& options, const std::vector<SequenceOptions>& sequences,
          CheckpointFile& checkpoint, const std::string& waiting, Console& console)
{
  const std::filesystem::path folder = std::filesystem::path(options.output).parent_path();
  std::error_code fault;
  if (!folder.empty() && std::filesystem::create_directories(folder, fault))
  {
    console.Note("bigus: warning: the folder " + folder.string() + " was taken away meanwhile, and is made anew.");
  }
  const auto keep = [&]
  {
    if (!waiting.empty())
    {
      checkpoint.Write(waiting);
    }
  };
  try
  {
    WriteField(field, options, sequences, console);
  }
  catch (...)
  {
    keep();
    throw;
  }
  keep();
}

/// Writes each sequence at the poses that were trained at.
void WriteTrainedPoses(vtkBigusTrainer* trainer, const std::vector<vtkSmartPointer<vtkImageData>>& images,
                       const std::vector<std::string>& files, Console& console)
{
  vtkIdType earlier = 0;  // frames of the images before
  for (std::size_t k = 0; k < files.size(); ++k)
  {
    const vtkIdType frames = images[k]->GetDimensions()[2];
    vtkNew<vtkDoubleArray> poses;
    poses->SetName("ImageToReference");
    poses->SetNumberOfComponents(16);
    poses->InsertTuples(0, frames, earlier, trainer->GetCorrectedPoses());
    vtkNew<vtkImageData> trained;
    trained->ShallowCopy(images[k]);
    trained->GetFieldData()->AddArray(poses);
    WritePoses(trained, files[k], {}, console);
    earlier += frames;
  }
}

/// What is known before anything is scored. Scores are null; their names keep the place where they will stand.
Json Summary(vtkBigusTrainer* trainer, const TrainOptions& options, const GaussianField& field, const Frames& frames)
{
  const Sweep& sweep = *frames.imported.sweep;
  Json sequences = Json::array();
  const std::vector<std::vector<int>> framesOf = BySequence(sweep, AllFrames(sweep));
  for (std::size_t k = 0; k < framesOf.size(); ++k)
  {
    const std::string poses = framesOf.size() == 1 ? "poses" : "poses.sequence" + std::to_string(k + 1);
    sequences.push_back({{"frames", framesOf[k].size()},
                         {"poses", GetProvenance(trainer->GetOutput(), poses.c_str())},
                         {"held_out", nullptr},
                         {"held_out_tracked", nullptr}});
  }
  const bool isKept = !StandardErrorOf(trainer->GetOutput()).empty();
  return {{"gaussians", field.Size()},
          {"bytes", std::filesystem::file_size(options.output)},
          {"seconds", trainer->GetSeconds()},
          {"iterations", trainer->GetIterationsDone()},
          {"device", trainer->GetDevice()},
          {"seed", options.trainer.seed},
          {"peak_memory_bytes", PeakMemory()},  // of training; the baselines may need more
          {"held_out", nullptr},
          {"held_out_tracked", nullptr},
          {"held_out_aligned", nullptr},
          {"trained", nullptr},
          {"baselines", nullptr},
          {"cross_planes", nullptr},
          {"standard_error",
           {{"seconds", isKept ? Json(trainer->GetStandardErrorSeconds()) : Json()},
            {"variance_ratio", nullptr},
            {"within_1", nullptr},
            {"within_2", nullptr},
            {"correlation", nullptr},
            {"sparsification", nullptr},
            {"rmse", nullptr},
            {"known", nullptr},
            {"peers", nullptr},
            {"reliability", nullptr},
            {"means", nullptr}}},
          {"sequences", sequences},
          {"findings", frames.findings},
          {"interrupted", WasInterrupted(trainer)},
          {"finished", trainer->GetFinished()},
          {"decisions", ToJson(trainer->GetDecisions())},
          {"settled", SettledJson(trainer)},
          {"elevation_sigma", field.beam.elevationSigma},
          {"training_frames", trainer->GetTrainingFrames()->GetNumberOfValues()},
          {"validation_frames", trainer->GetValidationFrames()->GetNumberOfValues()},
          {"width", sweep.width},
          {"height", sweep.height}};
}

void PrintSummary(const Json& answer, const std::string& output, Console& console)
{
  console.Print(
      output + ": " +
      Words("{gaussians} Gaussians, {bytes:1M} MB, {iterations} iterations in {seconds:1} s on {device}, beam "
            "sigma {elevation_sigma:2} mm",
            answer));
  if (!answer["decisions"].empty())
  {
    console.Print("Decisions, in dB on validation frames (standard error of the mean)");
    PrintDecisions(answer["decisions"], console);
  }
}

/// A score that cannot be had stays null, with a line that says why: the field is written by now, and stands.
template <class Function>
void ScoreIfPossible(const std::string& what, Console& console, const Function& score)
{
  try
  {
    score();
  }
  catch (const std::exception& error)
  {
    console.Note("bigus: warning: the field was written, but " + what + " could not be scored: " + MessageOf(error));
  }
}

/// Scores what was trained, unless it was interrupted: then nobody waits for scores.
void Score(vtkBigusTrainer* trainer, const TrainOptions& options, const GaussianField& field,
           const std::optional<ViewDependence>& view, const Frames& frames, Json& answer, Console& console)
{
  // Held-out frames have no say in what the probe lights, either.
  const Sweep tracked = frames.imported.sweep->LitBy(frames.training);
  Sweep corrected = tracked;
  corrected.imageToReference = CorrectedPoses(trainer, frames.imported.frames);
  const std::vector<int> trained = SweepFrames(trainer->GetTrainingFrames(), frames.imported.frames);
  const TrainedField scored{field,          view ? &*view : nullptr, tracked,
                            corrected,      frames.training,         trained,
                            frames.heldOut, options.trainer.engine,  !options.withoutBaselines,
                            options.align};
  if (!frames.heldOut.empty())
  {
    ScoreIfPossible("held-out frames", console, [&] { ScoreHeldOut(scored, answer, console); });
  }
  if (!frames.heldOut.empty() && trainer->GetKeepStandardError() && answer["standard_error"]["seconds"].is_null())
  {
    console.Note("The standard error was not measured: it would have taken more than a tenth of the time limit.");
  }
  else if (!frames.heldOut.empty() && trainer->GetKeepStandardError())
  {
    ScoreIfPossible(
        "the standard error", console,
        [&] { ScoreStandardError(StandardError(StandardErrorOf(trainer->GetOutput())), scored, answer, console); });
  }
  ScoreIfPossible("planes along the sweep", console, [&] { ScoreCrossPlanes(scored, answer, console); });
}

/// Scores apart from what hears signals. Interrupted, it ends the process, because the field is written and scores cannot
/// be stopped.
void ScoreUntilInterrupted(const std::function<void(Json&)>& score, Json& answer, Console& console)
{
  Json scored = answer;
  std::future<void> scores = std::async(std::launch::async, [&] { score(scored); });
  while (scores.wait_for(std::chrono::milliseconds(100)) != std::future_status::ready)
  {
    if (IsInterrupted())
    {
      console.Note("Interrupted: the field was written, but not scored.");
      console.Report(answer);
      std::_Exit(InterruptedCode());
    }
  }
  scores.get();
  answer = std::move(scored);
}

ExitCode Train(Console& console, const TrainOptions& options)
{
  CheckpointFile checkpoint(options.output + ".checkpoint",
                            [&console](const std::string& what) { console.Note("bigus: warning: " + what); });
  const std::vector<SequenceOptions> sequences = Sequences(options);
  const std::vector<std::string> posesFiles = PosesFiles(options, sequences.size());
  RequireOutputs(options, sequences, posesFiles, checkpoint.Path());
  Lock(checkpoint);
  Engine::Create(options.trainer.engine);  // an unknown name is said before the sweep is read
  const Frames frames = ReadFrames(sequences, options.trainer, console);

  vtkNew<vtkBigusTrainer> trainer;
  Prepare(trainer, options, frames, console);
  std::string waiting;
  trainer->SetCheckpoints(KeepIn(checkpoint, waiting, options, console));
  UpdateUntilInterrupted(trainer, console, "Training");

  vtkPolyData* output = trainer->GetOutput();
  Save(output, options, sequences, checkpoint, waiting, console);
  if (trainer->GetFinished())
  {
    checkpoint.Remove();
  }
  checkpoint.Unlock();
  if (!options.log.empty())
  {
    WriteLog(options.log, trainer->GetLog());
  }
  WriteTrainedPoses(trainer, frames.images, posesFiles, console);

  GaussianField field = FieldFromPolyData(output);
  std::optional<ViewDependence> view = ViewFromPolyData(output);
  if (!options.exact)  // what is scored is what was written
  {
    RoundField(field);
    if (view)
    {
      RoundView(*view);
    }
  }
  Json answer = Summary(trainer, options, field, frames);
  PrintSummary(answer, options.output, console);
  const bool isInterrupted = answer["interrupted"];
  if (!isInterrupted)
  {
    ScoreUntilInterrupted([&](Json& scored) { Score(trainer, options, field, view, frames, scored, console); }, answer,
                          console);
  }
  else
  {
    console.Note("Interrupted: the best field so far was saved.");
  }
  if (!trainer->GetFinished() && checkpoint.Exists())
  {
    console.Note("Not all steps were taken. The same command with --resume " +
                 std::string(isInterrupted ? "" : "and a longer --time-limit ") + "goes on from " + checkpoint.Path() +
                 ".");
  }
  console.Report(answer);
  return isInterrupted ? InterruptedCode() : Success;
}

/// The trainer's options by the list that Core keeps of them: their names, ranges, defaults and help.
void AddTrainerOptions(CLI::App& app, TrainerOptions& options)
{
  // Other names that are shorter.
  static const std::map<std::string, std::string> kShort = {{"MaximumGaussians", ",--max-gaussians"},
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
    const auto parse = [&options, name](const std::string& value)
    {
      try
      {
        SetOption(options, name, value);
      }
      catch (const Error& error)
      {
        throw CLI::ValidationError("--" + SpellOption(name, '-'), error.what());
      }
    };
    const std::string flags = "--" + SpellOption(name, '-') + (kShort.count(name) ? kShort.at(name) : "");
    added[name] = app.add_option_function<std::string>(flags, parse, help)
                      ->check(Named(isNumber ? option.isWhole ? kWhole : kReal : ""))
                      ->type_name(type + (option.mayBeOpen ? "|auto" : ""))
                      ->default_str(option.value)
                      ->group(option.info.group);
  }

  // Switches that need no value.
  app.add_flag_function(
         "--auto,!--no-auto", [&options](std::int64_t count) { options.automatic = count > 0; },
         "Short for --automatic on, and off")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast)
      ->group(added["Automatic"]->get_group())
      ->excludes(added["Automatic"]);
  app.add_flag_callback(
         "--preview", [&options] { options.timeLimit = 10; },
         "Short for --time-limit 10: a usable field in ten seconds, without trials")
      ->group(added["TimeLimit"]->get_group())
      ->excludes(added["TimeLimit"]);
  CLI::Option* isSigned =
      app.add_flag_callback(
             "--signed", [&options] { options.signedReflectivity = true; }, "Short for --signed-reflectivity on")
          ->group(added["SignedReflectivity"]->get_group())
          ->excludes(added["SignedReflectivity"]);
  app.add_flag_callback(
         "--positive,--positive-only", [&options] { options.signedReflectivity = false; },
         "Short for --signed-reflectivity off")
      ->group(added["SignedReflectivity"]->get_group())
      ->excludes(added["SignedReflectivity"])
      ->excludes(isSigned);
}

}  // namespace

void AddTrain(Program& program)
{
  auto options = std::make_shared<TrainOptions>();
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
  app->add_flag(
      "--no-standard-error", options->withoutStandardError,
      "Leave out of the field what 'slice --standard-error' rests on: 0.1 to 4 MB of a .vtp, measured at the end");
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
