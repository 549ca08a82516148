// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Training with every option of Core's list, while other Python threads run.
#include <limits>
#include <memory>

#include "Arrays.h"
#include "Core/Model/Error.h"
#include "Core/Trainer/Provenance.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/OptionList.h"
#include "IO/CheckpointFile.h"
#include "Progress.h"

namespace bigus
{
namespace
{

nb::dict ToPython(const std::vector<TrainingRecord>& log)
{
  using Record = TrainingRecord;
  nb::dict columns;
  const auto add = [&](const char* name, const auto& number)
  {
    std::vector<double> numbers;
    for (const Record& record : log)
    {
      numbers.push_back(static_cast<double>(number(record)));
    }
    columns[name] = Owned(std::move(numbers));
  };
  add("iteration", [](const Record& r) { return r.iteration; });
  add("seconds", [](const Record& r) { return r.seconds; });
  add("loss", [](const Record& r) { return r.loss; });
  add("validation_psnr",
      [](const Record& r) { return r.validationPsnr.value_or(std::numeric_limits<double>::quiet_NaN()); });
  add("gaussians", [](const Record& r) { return r.gaussians; });
  add("rate", [](const Record& r) { return r.rate; });
  return columns;
}

/// What a training hands back, in Python's types.
nb::dict ToPython(TrainingResult& result, std::vector<std::string> provenance, std::string keptError)
{
  nb::list decisions;
  for (const Decision& decision : result.decisions)
  {
    decisions.append(Dict("decision", decision.what, "choice", decision.choice, "evidence", decision.evidence,
                          "seconds", decision.seconds));
  }
  nb::dict settled;
  for (const OptionText& option : ListOptions(result.settled))
  {
    settled[option.info.name] = option.value;
  }
  Field field{std::move(result.field), std::move(provenance), {}, std::move(keptError)};
  field.view = std::move(result.view);
  return Dict("field", std::move(field), "log", ToPython(result.log), "decisions", decisions, "poses",
              PosesToArray(result.imageToReference), "options", settled, "iterations", result.iterations, "seconds",
              result.seconds, "device", result.device, "aborted", result.aborted, "finished", result.finished,
              "training_frames", result.trainingFrames, "validation_frames", result.validationFrames, "held_out_frames",
              result.heldOutFrames);
}

/// Where a training's state is kept, and where it goes on from.
Checkpoints Keep(CheckpointFile& file, double interval, bool resume)
{
  Checkpoints checkpoints;
  file.Lock();
  checkpoints.interval = interval;
  checkpoints.save = [&file](const std::string& state) { file.Write(state); };
  if (resume && file.Exists())
  {
    checkpoints.resume = file.Read();
  }
  return checkpoints;
}

/// The triple of what came of it, a function that raises what ended it, if Ctrl-C or `progress` did, and warnings. The state
/// is kept in the file `checkpoint`, unless that is empty, every `interval` seconds.
nb::object TrainOn(std::shared_ptr<Sweep> sweep, const std::map<std::string, std::string>& values, const Field* start,
                   nb::object progress, const std::string& checkpoint, double interval, bool resume, bool keepsError)
{
  TrainerOptions options;
  for (const auto& [name, value] : values)
  {
    SetOption(options, name, value);
  }
  std::optional<GaussianField> from;  // its own, because other threads may write to the arrays meanwhile
  if (start)
  {
    from = start->field;
  }
  const auto calls = std::make_shared<PythonProgress>(std::move(progress));
  const auto tell = [&calls](const TrainingProgress& now) { return (*calls)(now.fraction, ProgressText(now)); };
  TrainingResult result;
  std::vector<std::string> provenance, warnings;
  std::string keptError;
  {
    const nb::gil_scoped_release others;
    CheckpointFile file(checkpoint, [&warnings](const std::string& what) { warnings.push_back(what); });
    result = Train(sweep, options, from ? &*from : nullptr, tell,
                   checkpoint.empty() ? Checkpoints() : Keep(file, interval, resume));
    for (const Finding& finding : result.findings)
    {
      warnings.push_back(Describe(finding, AllFrames(*sweep)));
    }
    if (result.finished && !checkpoint.empty())
    {
      file.Remove();
    }
    AddTrainingProvenance(provenance, result, *sweep, start != nullptr);
    SetProvenanceLine(provenance, "trainingFrames", FrameListText(result.trainingFrames));
    SetProvenanceLine(provenance, "validationFrames", FrameListText(result.validationFrames));
    SetProvenanceLine(provenance, "heldOutFrames", FrameListText(result.heldOutFrames));
    try
    {
      keptError = keepsError ? MeasureStandardError(result, *sweep, options.timeLimit) : "";
    }
    catch (const Error& error)  // the field comes first
    {
      warnings.push_back(std::string("The field keeps no standard error: ") + error.what());
    }
  }
  return nb::make_tuple(ToPython(result, std::move(provenance), std::move(keptError)),
                        nb::cpp_function([calls] { calls->Rethrow(); }), warnings);
}

nb::list Options()
{
  nb::list rows;
  for (const OptionText& option : ListOptions())
  {
    const OptionInfo& info = option.info;
    const char* type = option.kind == OptionText::Kind::Switch   ? "bool"
                       : option.kind != OptionText::Kind::Number ? "str"
                       : option.isWhole                          ? "int"
                                                                 : "float";
    rows.append(Dict("name", info.name, "keyword", SpellOption(info.name, '_'), "group", info.group, "help", info.help,
                     "unit", info.unit, "values", option.values, "type", type, "default", option.value, "open",
                     info.open));
  }
  return rows;
}

}  // namespace

void BindTraining(nb::module_& m)
{
  m.def("train", &TrainOn, "sweep"_a, "options"_a, "start"_a.none(), "progress"_a.none(), "checkpoint"_a, "interval"_a,
        "resume"_a, "keeps_error"_a);
  m.def("options", &Options,
        "Every option of training: name, keyword, group, help, unit, values, type, default, open.");
  m.def(
      "check_option",
      [](const std::string& name, const std::string& value)
      {
        TrainerOptions options;
        SetOption(options, name, value);
      },
      "name"_a, "value"_a, "Raises Error for a value that the option cannot have.");
  m.def("number_text", &NumberText, "value"_a);
}

}  // namespace bigus
