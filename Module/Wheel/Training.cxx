// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Training with every option of Core's list, while other Python threads run.
#include <limits>
#include <memory>

#include "Arrays.h"
#include "Core/Model/Error.h"
#include "Core/Trainer/KeptError.h"
#include "Core/Trainer/Provenance.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/OptionList.h"
#include "IO/CheckpointFile.h"

namespace bigus
{
namespace
{

const char* NameOf(TrainingProgress::Phase phase)
{
  const char* const names[] = {"deciding", "seeding", "training"};
  return names[static_cast<int>(phase)];
}

/// What a training hands back, in Python's types.
nb::dict ToPython(TrainingResult& result, std::vector<std::string> provenance, std::string keptError)
{
  const std::size_t n = result.log.size();
  std::vector<double> iterations, seconds, losses, psnrs, gaussians, rates;
  for (const TrainingRecord& record : result.log)
  {
    iterations.push_back(record.iteration);
    seconds.push_back(record.seconds);
    losses.push_back(record.loss);
    psnrs.push_back(record.validationPsnr.value_or(std::numeric_limits<double>::quiet_NaN()));
    gaussians.push_back(static_cast<double>(record.gaussians));
    rates.push_back(record.rate);
  }
  nb::dict log;
  log["iteration"] = Owned(std::move(iterations), {n});
  log["seconds"] = Owned(std::move(seconds), {n});
  log["loss"] = Owned(std::move(losses), {n});
  log["validation_psnr"] = Owned(std::move(psnrs), {n});
  log["gaussians"] = Owned(std::move(gaussians), {n});
  log["rate"] = Owned(std::move(rates), {n});
  nb::list decisions;
  for (const Decision& decision : result.decisions)
  {
    nb::dict row;
    row["decision"] = decision.what;
    row["choice"] = decision.choice;
    row["evidence"] = decision.evidence;
    row["seconds"] = decision.seconds;
    decisions.append(row);
  }
  nb::dict settled;
  for (const OptionText& option : ListOptions(result.settled))
  {
    settled[option.info.name] = option.value;
  }
  nb::dict answer;
  Field field(std::move(result.field), std::move(provenance), std::move(keptError));
  field.view = std::move(result.view);
  answer["field"] = nb::cast(std::move(field));
  answer["log"] = log;
  answer["decisions"] = decisions;
  answer["poses"] = PosesToArray(result.imageToReference);
  answer["options"] = settled;
  answer["iterations"] = result.iterations;
  answer["seconds"] = result.seconds;
  answer["device"] = result.device;
  answer["aborted"] = result.aborted;
  answer["finished"] = result.finished;
  answer["training_frames"] = result.trainingFrames;
  answer["validation_frames"] = result.validationFrames;
  answer["held_out_frames"] = result.heldOutFrames;
  return answer;
}

/// The exception as an object. Before Python 3.12 one that was raised without arguments may have none yet.
nb::object ValueOf(nb::python_error& error)
{
  PyObject *type, *value, *trace;
  error.restore();
  PyErr_Fetch(&type, &value, &trace);
  PyErr_NormalizeException(&type, &value, &trace);
  if (trace)
  {
    PyException_SetTraceback(value, trace);
  }
  Py_XDECREF(type);
  Py_XDECREF(trace);
  return nb::steal(value);
}

/// The triple of what came of it, what ended it (None, or the exception that Ctrl-C or `progress` raised) and warnings.
/// The state is kept in the file `checkpoint`, unless that is empty, every `interval` seconds.
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
    from = *start;
  }
  nb::object exception = nb::none();
  const auto tell = [&](const TrainingProgress& now)
  {
    const nb::gil_scoped_acquire lock;
    try
    {
      if (PyErr_CheckSignals() != 0)
      {
        throw nb::python_error();
      }
      if (progress.is_none())
      {
        return true;
      }
      const nb::object answer = progress(now.fraction, NameOf(now.phase), now.secondsLeft, now.record.iteration,
                                         now.record.gaussians, now.record.loss);
      return !answer.is(nb::bool_(false));
    }
    catch (nb::python_error& error)
    {
      exception = ValueOf(error);
      return false;
    }
  };
  TrainingResult result;
  std::vector<std::string> provenance, warnings;
  std::string keptError;
  {
    const nb::gil_scoped_release others;
    CheckpointFile file(checkpoint, [&warnings](const std::string& what) { warnings.push_back(what); });
    Checkpoints checkpoints;
    if (!checkpoint.empty())
    {
      file.Lock();
      checkpoints.interval = interval;
      checkpoints.save = [&file](const std::string& state) { file.Write(state); };
      if (resume && file.Exists())
      {
        checkpoints.resume = file.Read();
      }
    }
    result = Train(sweep, options, from ? &*from : nullptr, tell, checkpoints);
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
  return nb::make_tuple(ToPython(result, std::move(provenance), std::move(keptError)), exception, warnings);
}

nb::list Options()
{
  nb::list rows;
  for (const OptionText& option : ListOptions())
  {
    nb::dict row;
    row["name"] = option.info.name;
    row["keyword"] = SpellOption(option.info.name, '_');
    row["group"] = option.info.group;
    row["help"] = option.info.help;
    row["unit"] = option.info.unit;
    row["values"] = option.values;
    row["type"] = option.kind == OptionText::Kind::Switch   ? "bool"
                  : option.kind != OptionText::Kind::Number ? "str"
                  : option.isWhole                          ? "int"
                                                            : "float";
    row["default"] = option.value;
    row["open"] = option.info.open;
    rows.append(row);
  }
  return rows;
}

}  // namespace

void BindTraining(nb::module_& m)
{
  m.def("train", &TrainOn, nb::arg("sweep"), nb::arg("options"), nb::arg("start").none(), nb::arg("progress").none(),
        nb::arg("checkpoint"), nb::arg("interval"), nb::arg("resume"), nb::arg("keeps_error"));
  m.def("options", &Options,
        "Every option of training: name, keyword, group, help, unit, values, type, default, open.");
  m.def(
      "check_option",
      [](const std::string& name, const std::string& value)
      {
        TrainerOptions options;
        SetOption(options, name, value);
      },
      nb::arg("name"), nb::arg("value"), "Raises Error for a value that the option cannot have.");
  m.def("number_text", &NumberText, nb::arg("value"));
}

}  // namespace bigus
