// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus poses: a sequence without the tracker's noise.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "Command.h"
#include "Core/Deciding/PosePage.h"
#include "Core/Inspection/Inspection.h"
#include "Core/Numerics/Statistics.h"
#include "Data/SweepData.h"
#include "Files.h"
#include "IO/Text.h"
#include "Inputs.h"
#include "Outputs.h"
#include "Pipeline.h"
#include "vtkBigusPoseCorrection.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkStringArray.h"
#include "vtkTable.h"

namespace bigus::command
{

namespace
{

constexpr double kMostStrength = 1000;   // as TrajectoryOptions::strength
constexpr std::size_t kMostListed = 12;  // outliers named to people; --json has all

struct PosesOptions
{
  SequenceOptions sequence;
  std::string output;
  std::string strength = "auto";
  int holdOut = 0;
};

/// Negative for auto, as the filter has it.
double StrengthOf(const std::string& text)
{
  double strength = text == "off" ? 0 : -1;
  ParseNumber(text, strength);
  return strength;
}

CLI::Validator Strength()
{
  const auto check = [](const std::string& text) -> std::string
  {
    double value = 0;
    const bool isNumber = ParseNumber(text, value) && value >= 0 && value <= kMostStrength;
    return isNumber || text == "auto" || text == "off" ? ""
                                                       : "'" + text + "' is not auto, off or a number from 0 to 1000";
  };
  return CLI::Validator(check, "");
}

/// One component of a field data array, all tuples.
std::vector<double> Values(vtkImageData* sweep, const char* name, int component = 0)
{
  vtkDataArray* array = sweep->GetFieldData()->GetArray(name);
  std::vector<double> values;
  for (vtkIdType k = 0; array && k < array->GetNumberOfTuples(); ++k)
  {
    values.push_back(array->GetComponent(k, component));
  }
  return values;
}

/// The same of an array of whole numbers.
std::vector<int> Numbers(vtkImageData* sweep, const char* name)
{
  const std::vector<double> values = Values(sweep, name);
  return {values.begin(), values.end()};
}

/// Where the image's centre lies in every frame, mm: x, y and z apart.
std::array<std::vector<double>, 3> Centres(vtkImageData* sweep, const char* poses)
{
  std::array<std::vector<double>, 3> centres;
  const int* size = sweep->GetDimensions();
  vtkDataArray* array = sweep->GetFieldData()->GetArray(poses);
  for (vtkIdType k = 0; k < array->GetNumberOfTuples(); ++k)
  {
    for (int axis = 0; axis < 3; ++axis)
    {
      centres[axis].push_back(0.5 * (size[0] - 1) * array->GetComponent(k, 4 * axis) +
                              0.5 * (size[1] - 1) * array->GetComponent(k, 4 * axis + 1) +
                              array->GetComponent(k, 4 * axis + 3));
    }
  }
  return centres;
}

Json Points(const std::array<std::vector<double>, 3>& axes)
{
  Json points = Json::array();
  for (std::size_t k = 0; k < axes[0].size(); ++k)
  {
    points.push_back({axes[0][k], axes[1][k], axes[2][k]});
  }
  return points;
}

/// Components first to last - 1 of what is the same in every frame; standard errors are null where unknown.
Json ConstantErrorJson(vtkImageData* sweep, int first, int last)
{
  vtkDataArray* array = sweep->GetFieldData()->GetArray("ConstantErrors");
  Json values = Json::array(), errors = Json::array(), observable = Json::array();
  for (int k = first; k < last; ++k)
  {
    values.push_back(array->GetComponent(0, k));
    errors.push_back(array->GetComponent(1, k));
    observable.push_back(array->GetComponent(2, k) != 0);
  }
  return {{"value", values}, {"standard_error", errors}, {"observable", observable}};
}

/// What frames without part say of the delay (0), the calibration (1) or the alignment (2); null where nothing was asked.
Json ConfirmedStepJson(vtkImageData* sweep, int kind)
{
  vtkDataArray* array = sweep->GetFieldData()->GetArray("ConfirmedSteps");
  return {{"share", array->GetComponent(kind, 0)},
          {"share_error", array->GetComponent(kind, 1)},
          {"gain", array->GetComponent(kind, 2)},
          {"taken", array->GetComponent(kind, 3) != 0}};
}

Json Summary(std::vector<double> values)
{
  std::sort(values.begin(), values.end());
  return {{"mean", Mean(values)},
          {"median", Quantile(values, 0.5)},
          {"q95", Quantile(values, 0.95)},
          {"largest", values.back()}};
}

std::string SummaryText(const Json& summary, int decimals, const std::string& unit)
{
  std::string text;
  for (const auto& [name, value] : summary.items())
  {
    text += (text.empty() ? "" : ", ") + (name == "q95" ? "95 % below" : name) + " " +
            FormatNumber(value.get<double>(), decimals);
  }
  return text + " " + unit;
}

std::string OutlierText(const std::vector<int>& outliers)
{
  std::string text = std::to_string(outliers.size());
  for (std::size_t k = 0; k < std::min(outliers.size(), kMostListed); ++k)
  {
    text += (k ? ", " : ": frame ") + std::to_string(outliers[k]);
  }
  return text + (outliers.size() > kMostListed ? ", ..." : "");
}

std::vector<PoseStep> StepsOf(vtkTable* table)
{
  std::vector<PoseStep> steps;
  for (vtkIdType row = 0; row < table->GetNumberOfRows(); ++row)
  {
    const auto value = [&](const char* name) { return table->GetValueByName(row, name).ToDouble(); };
    steps.push_back({value("From"), value("To"), value("Share"), value("ShareError"), value("Gain"), value("GainError"),
                     value("Taken") != 0, value("RevisitShare"), value("RevisitError")});
  }
  return steps;
}

/// Writes the sequence, its poses with what was done to each, or a page to look at.
void WriteCorrected(vtkBigusPoseCorrection* correction, const PosesOptions& options, Console& console)
{
  vtkImageData* sweep = correction->GetOutput();
  const std::string& path = options.output;
  if (HasSuffix(path, ".png"))
  {
    const ImportedSweep recorded = SweepFromImage(vtkImageData::SafeDownCast(correction->GetInput()));
    const ImportedSweep corrected = SweepFromImage(sweep);
    auto* decision = vtkStringArray::SafeDownCast(sweep->GetFieldData()->GetAbstractArray("PoseDecision"));
    WritePage(DrawPoses(*recorded.sweep, corrected.sweep->imageToReference, StepsOf(correction->GetSteps()),
                        FileName(options.sequence.path) + ": poses " + decision->GetValue(0) + ". " +
                            decision->GetValue(1) + "."),
              path);
    return;
  }
  const auto recorded = Centres(sweep, "RecordedImageToReference");
  WritePoses(sweep, path,
             {{"displacement", Values(sweep, "PoseDisplacement")},
              {"rotation", Values(sweep, "PoseRotation")},
              {"outlier", Values(sweep, "PoseOutlier")},
              {"stroke", Values(sweep, "PoseStroke")},
              {"recorded_x", recorded[0]},
              {"recorded_y", recorded[1]},
              {"recorded_z", recorded[2]}},
             console);
}

std::vector<int> Outliers(vtkImageData* sweep)
{
  std::vector<int> outliers;
  const std::vector<int> isOutlier = Numbers(sweep, "PoseOutlier");
  for (std::size_t k = 0; k < isOutlier.size(); ++k)
  {
    if (isOutlier[k] != 0)
    {
      outliers.push_back(static_cast<int>(k));
    }
  }
  return outliers;
}

Json StepsJson(const std::vector<PoseStep>& steps)
{
  Json rows = Json::array();
  for (const PoseStep& step : steps)
  {
    rows.push_back({{"from", step.from},
                    {"to", step.to},
                    {"share", step.share},
                    {"share_error", step.shareError},
                    {"gain", step.gain},
                    {"gain_error", step.gainError},
                    {"revisit_share", step.revisitShare},
                    {"revisit_error", step.revisitError},
                    {"taken", step.isTaken}});
  }
  return rows;
}

Json EachFrame(vtkImageData* sweep)
{
  const std::vector<double> times = Values(sweep, "Timestamp");
  return {{"source_frame", Numbers(sweep, "SourceFrame")},
          {"timestamp", times.empty() ? Json() : Json(times)},
          {"displacement", Values(sweep, "PoseDisplacement")},
          {"rotation", Values(sweep, "PoseRotation")},
          {"stroke", Numbers(sweep, "PoseStroke")},
          {"recorded_centre", Points(Centres(sweep, "RecordedImageToReference"))},
          {"corrected_centre", Points(Centres(sweep, "ImageToReference"))}};
}

Json CorrectionJson(vtkBigusPoseCorrection* correction, const std::string& output)
{
  vtkImageData* sweep = correction->GetOutput();
  const std::vector<double> displacement = Values(sweep, "PoseDisplacement"), stroke = Values(sweep, "PoseStroke");
  const std::vector<double> noise = {Values(sweep, "TrackerNoise", 0)[0], Values(sweep, "TrackerNoise", 1)[0],
                                     Values(sweep, "TrackerNoise", 2)[0]};
  auto* decision = vtkStringArray::SafeDownCast(sweep->GetFieldData()->GetAbstractArray("PoseDecision"));
  return {{"output", output},
          {"frames", displacement.size()},
          {"changed", std::any_of(displacement.begin(), displacement.end(), [](double mm) { return mm > 0; })},
          {"strength", correction->GetChosenStrength()},
          {"decision", {{"choice", decision->GetValue(0)}, {"evidence", decision->GetValue(1)}}},
          {"steps", StepsJson(StepsOf(correction->GetSteps()))},
          {"noise", {{"translation", noise[0]}, {"rotation", noise[1]}, {"corner", noise[2]}}},
          {"constant_errors",
           {{"applied", Values(sweep, "ConstantErrorsApplied")[0] != 0},
            {"delay", ConstantErrorJson(sweep, 0, 1)},
            {"shift", ConstantErrorJson(sweep, 1, 4)},
            {"rotation", ConstantErrorJson(sweep, 4, 7)},
            {"steps", {{"delay", ConfirmedStepJson(sweep, 0)}, {"calibration", ConfirmedStepJson(sweep, 1)}}}}},
          {"alignment", ConfirmedStepJson(sweep, 2)},
          {"outliers", Outliers(sweep)},
          {"strokes", 1 + static_cast<int>(*std::max_element(stroke.begin(), stroke.end()))},
          {"displacement", Summary(displacement)},
          {"rotation", Summary(Values(sweep, "PoseRotation"))},
          {"each_frame", EachFrame(sweep)}};
}

/// A line for everything that pictures were asked about.
void PrintSteps(const Json& answer, Console& console)
{
  const auto print = [&console](std::string what, const Json& step)
  {
    if (std::isnan(step["share"].get<double>()))
    {
      return;
    }
    what.resize(22, ' ');  // "smooth 64.0 to 128.0"
    console.Print("  " + what + "pictures confirm " + FormatNumber(step["share"].get<double>(), 2) + " +- " +
                  FormatNumber(step["share_error"].get<double>(), 2) + ", gain " +
                  FormatNumber(step["gain"].get<double>(), 2) + " dB, " + (step["taken"] ? "taken" : "not taken"));
  };
  for (const Json& step : answer["steps"])
  {
    print("smooth " + FormatNumber(step["from"].get<double>(), 1) + " to " + FormatNumber(step["to"].get<double>(), 1),
          step);
  }
  print("delay", answer["constant_errors"]["steps"]["delay"]);
  print("calibration", answer["constant_errors"]["steps"]["calibration"]);
  print("alignment", answer["alignment"]);
}

void PrintCorrection(const Json& answer, Console& console)
{
  const Json& noise = answer["noise"];
  console.Print(
      std::string("{output}: {frames}") + (answer["frames"] == 1 ? " frame" : " frames") + ", poses {decision/choice}",
      answer);
  console.Print("  evidence         {decision/evidence}", answer);
  PrintSteps(answer, console);
  console.Print("  tracker's noise  " + NoiseText(noise["translation"], noise["rotation"], noise["corner"]));
  console.Print("  outliers         " + OutlierText(answer["outliers"]));
  console.Print(std::string("  path             {strokes}") +
                    (answer["strokes"] == 1 ? " continuous motion" : " continuous motions"),
                answer);
  if (answer["changed"])
  {
    console.Print("  moved            " + SummaryText(answer["displacement"], 3, "mm (the image's corners)"));
    console.Print("  turned           " + SummaryText(answer["rotation"], 3, "degrees"));
  }
}

ExitCode CorrectPoses(Console& console, const PosesOptions& options)
{
  RequireDistinct({options.sequence.path, options.sequence.chain.config}, {options.output});
  if (!HasSuffix(options.output, ".png"))
  {
    RequirePosesName(options.output);
  }
  RequireWritable(options.output);
  const vtkSmartPointer<vtkImageData> sequence = ReadSequence(options.sequence, console);
  vtkNew<vtkBigusPoseCorrection> correction;
  correction->SetInputData(sequence);
  correction->SetStrength(StrengthOf(options.strength));
  correction->SetHoldOut(options.holdOut);
  Update(correction, console, "Comparing");
  WriteCorrected(correction, options, console);
  Json answer = CorrectionJson(correction, options.output);
  const ImportedSweep imported = SweepFromImage(sequence);  // the filter says the same in warnings
  answer["findings"] = FindingsJson(Inspect(imported.sweep, KeptKinds::Parse("all")).findings, imported.frames);
  PrintCorrection(answer, console);
  console.Report(answer);
  return Success;
}

}  // namespace

void AddPoses(Program& program)
{
  auto options = std::make_shared<PosesOptions>();
  CLI::App* app = program.app.add_subcommand(
      "poses",
      "Take the tracker's noise out of a sequence's poses\n"
      "  bigus poses sweep.igs.mha -o corrected.igs.mha\n"
      "  bigus poses plus.mha --config Plus.xml -o poses.csv --json\n"
      "  bigus poses sweep.igs.mha -o poses.png\n"
      "The noise is estimated from the poses. It is taken out where frames then predict their neighbours better; exact "
      "poses are kept.");
  AddSequenceOptions(*app, options->sequence, "SEQUENCE", "Tracked frames: .igs.mha .mha .mhd .nrrd .seq.nrrd .csv");
  app->add_option(
         "-o,--output", options->output,
         "What to write: the sequence at corrected poses (.igs.mha, .mha, .nrrd), the poses (.csv), or a page to "
         "look at (.png): the path, what was moved, what pictures say of every step")
      ->check(FileToWrite(".mha,.nrrd,.csv,.png"))
      ->required()
      ->type_name("OUT");
  app->add_option("--strength", options->strength,
                  "How strongly, in units of the noise found: auto (as pictures confirm it), off, or 0 to 1000")
      ->check(Strength())
      ->type_name("STRENGTH")
      ->capture_default_str();
  app->add_option("--hold-out", options->holdOut,
                  "Do not look at the pixels of frames that 'train --hold-out K' keeps; 0 looks at all")
      ->check(WholeNumberIn(0, 1e6))
      ->check([](const std::string& text)
              { return text == "1" ? "'1' is not 0 or a number from 2 up" : std::string(); })
      ->type_name("K")
      ->capture_default_str();

  RunWhenChosen(app, program, [options](Console& console) { return CorrectPoses(console, *options); });
}

}  // namespace bigus::command
