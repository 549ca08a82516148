// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Trainer/Provenance.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <locale>
#include <sstream>

#include "Core/Engine/InstructionSets.h"
#include "Core/Model/Sequences.h"
#include "Core/Poses/Trajectory.h"
#include "Core/StandardError/StandardError.h"
#include "Core/Training/OptionList.h"

namespace bigus
{
namespace
{

std::string PosesText(const Sweep& sweep, const std::vector<Eigen::Matrix4d>& poses)
{
  if (poses == sweep.imageToReference)
  {
    return kAsTracked;
  }
  double sum = 0;
  for (std::size_t k = 0; k < poses.size(); ++k)
  {
    sum += CornerDistance(sweep.imageToReference[k], poses[k], sweep.width, sweep.height);
  }
  return "corrected by " + NumberText(std::round(1000 * sum / poses.size()) / 1000) + " mm on average";
}

/// Whether measuring the standard error takes at most a tenth of the time limit, at 2 million pixels a second (one core of
/// an AMD EPYC). The same for equal runs, however busy the machine is.
bool IsInTime(const Sweep& sweep, double timeLimit)
{
  const double pixels = static_cast<double>(sweep.PixelsPerFrame()) * sweep.NumberOfFrames();
  return timeLimit == 0 || pixels / 2e6 <= 0.1 * timeLimit;
}

}  // namespace

void SetProvenanceLine(std::vector<std::string>& lines, const std::string& key, const std::string& value)
{
  const std::string beginning = key + "=";
  lines.erase(std::remove_if(lines.begin(), lines.end(),
                             [&beginning](const std::string& line) { return line.rfind(beginning, 0) == 0; }),
              lines.end());
  lines.push_back(beginning + value);
}

void AddTrainingProvenance(std::vector<std::string>& lines, const TrainingResult& result, const Sweep& sweep,
                           bool isContinued)
{
  for (const OptionText& option : ListOptions(result.settled))
  {
    if (!(option.mayBeOpen && option.value == "auto"))
    {
      std::string key = option.info.name;
      key[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(key[0])));
      SetProvenanceLine(lines, key, option.value);
    }
  }
  // The same field comes back only with these, whatever the number of threads.
  SetProvenanceLine(lines, "instructionSet", InstructionSets().front());
  if (result.processes > 1)
  {
    SetProvenanceLine(lines, "processes", std::to_string(result.processes));
  }
  // What came of it, rather than what was asked for.
  SetProvenanceLine(lines, "gaussians", std::to_string(result.field.Size()));
  SetProvenanceLine(lines, "iterations", std::to_string(result.iterations));
  SetProvenanceLine(lines, "aborted", result.aborted ? "yes" : "no");
  for (const Decision& decision : result.decisions)
  {
    SetProvenanceLine(lines, "decision." + decision.what, decision.choice + " (" + decision.evidence + ")");
  }
  SetProvenanceLine(lines, "poses", PosesText(sweep, result.imageToReference));
  const std::vector<Sequence> sequences = SequencesOf(sweep);
  for (std::size_t k = 0; k < sequences.size() && sequences.size() > 1; ++k)
  {
    const auto from = result.imageToReference.begin() + sequences[k].first;
    SetProvenanceLine(lines, "sequences", std::to_string(sequences.size()));
    SetProvenanceLine(lines, "poses.sequence" + std::to_string(k + 1),
                      PosesText(sequences[k].sweep, {from, from + sequences[k].sweep.NumberOfFrames()}));
  }
  if (isContinued)
  {
    SetProvenanceLine(lines, "seeding", "continued");
  }
}

std::string FrameListText(const std::vector<int>& frames)
{
  std::string text;
  for (const int frame : frames)
  {
    text += (text.empty() ? "" : " ") + std::to_string(frame);
  }
  return text;
}

std::string MeasureStandardError(const TrainingResult& result, const Sweep& recorded, double timeLimit)
{
  if (result.aborted || !IsInTime(recorded, timeLimit))
  {
    return {};
  }
  std::vector<int> shown = result.trainingFrames;
  shown.insert(shown.end(), result.validationFrames.begin(), result.validationFrames.end());
  std::sort(shown.begin(), shown.end());
  // Where each sequence was smoothed by a strength of its own it is the one that noise itself tells.
  const bool isCorrected = result.imageToReference != recorded.imageToReference;
  const double strength = isCorrected ? result.settled.poseSmoothing.value_or(1) : 0;
  Sweep trained = recorded.LitBy(shown);  // held-out frames have no say in what the probe lights, either
  trained.imageToReference = result.imageToReference;
  return StandardError(result.field, trained, shown, TrackerNoise(recorded, strength), result.settled.engine,
                       result.view ? &*result.view : nullptr)
      .ToBytes();
}

std::string ProgressText(const TrainingProgress& progress)
{
  using Phase = TrainingProgress::Phase;
  std::ostringstream line;
  line.imbue(std::locale::classic());
  switch (progress.phase)
  {
    case Phase::Deciding:
      line << "deciding what the sweep needs";
      break;
    case Phase::Seeding:
      line << "seeding";
      break;
    case Phase::Training:
      line << "iteration " << progress.record.iteration << ", loss " << progress.record.loss;
      break;
  }
  if (progress.record.validationPsnr)
  {
    line << ", validation " << *progress.record.validationPsnr << " dB";
  }
  if (progress.secondsLeft > 0)
  {
    line << ", " << std::lround(progress.secondsLeft) << " s left";
  }
  return line.str();
}

}  // namespace bigus
