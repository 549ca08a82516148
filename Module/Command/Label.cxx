// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus label: labels drawn on frames, carried by a field to any plane.
#include <algorithm>
#include <cmath>
#include <memory>

#include "Command.h"
#include "Core/Labels/Labels.h"
#include "Core/StandardError/StandardError.h"
#include "Data/Arrays.h"
#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "Data/SweepData.h"
#include "Files.h"
#include "IO/SequenceFile.h"
#include "Inputs.h"
#include "Pipeline.h"
#include "vtkBigusLabelReader.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

struct LabelOptions
{
  SequenceOptions sequence;
  std::string labels, field, output, frames, engine = "auto";
  std::vector<std::string> names;
  int holdOut = 0;
  bool keepEmpty = false;
};

/// "1=vessel" names the label of value 1, if there is one.
void Rename(const std::string& text, std::vector<Label>& labels)
{
  const std::size_t sign = text.find('=');
  int value = 0;
  Require(sign != std::string::npos && sign + 1 < text.size() && CLI::detail::lexical_cast(text.substr(0, sign), value),
          "--names: '", text, "' is not VALUE=NAME, such as 1=vessel.");
  const auto isMeant = [value](const Label& label) { return label.value == value; };
  if (const auto found = std::find_if(labels.begin(), labels.end(), isMeant); found != labels.end())
  {
    found->name = text.substr(sign + 1);
  }
}

/// Label pictures of frames that count. Says what is left out.
LabelFrames ReadLabels(const LabelOptions& options, vtkImageData* frames, const ImportedSweep& imported,
                       Console& console)
{
  vtkNew<vtkBigusLabelReader> reader;
  reader->SetFileName(options.labels.c_str());
  Update(reader, console, "Reading labels");
  vtkImageData* const pictures = reader->GetOutput();
  if (!options.frames.empty())
  {
    const std::vector<int> given = ParseFrames(options.frames, static_cast<int>(mostFrames));
    const int count = pictures->GetDimensions()[2];
    Require(static_cast<int>(given.size()) == count, "--frames: names ", given.size(), " frames, and ", options.labels,
            " has ", count, " pictures; name one frame for each.");
    const auto numbers = NewArray<vtkIntArray>("SourceFrame", 1, count);
    std::copy(given.begin(), given.end(), numbers->GetPointer(0));
    pictures->GetFieldData()->AddArray(numbers);
  }
  LabelFrames given = LabelFramesFromImage(pictures, frames, imported.frames);
  for (const std::string& text : options.names)
  {
    Rename(text, given.labels);
  }
  const std::vector<int> drawn = given.Drawn();
  if (options.keepEmpty || drawn.size() == given.frames.size())
  {
    return given;
  }
  console.Note("bigus: " + std::to_string(given.frames.size() - drawn.size()) + " of " +
               std::to_string(given.frames.size()) +
               " pictures hold no label, most of those between others: taken for frames that nobody drew on "
               "(--keep-empty: they show none).");
  return given.Subset(drawn);
}

/// Rows of the answer, each also in words.
template <class Rows, class Told>
Json ToldOf(const Rows& rows, const Told& told, Console& console)
{
  Json answer = Json::array();
  for (const auto& row : rows)
  {
    answer.push_back({{"value", row.label.value}, {"name", row.label.name}});
    const auto [values, words] = told(row);
    answer.back().update(values);
    console.Print("  {name} ({value}): " + std::string(words), answer.back());
  }
  return answer;
}

std::pair<Json, std::string> ToldOfVolume(const LabelVolume& found)
{
  return {{{"volume", found.volume}, {"standard_error", found.standardError}},
          std::string("{volume:0} mm^3") + (std::isfinite(found.standardError) ? " +- {standard_error:0}" : "")};
}

std::pair<Json, std::string> ToldOfScore(const LabelScore& score)
{
  return {{{"field", score.dice}, {"length_error", score.length}, {"area_error", score.area}},
          std::string("Dice on frames held out {field:3}") +
              (std::isfinite(score.length)
                   ? "; lengths are off by {length_error:2} mm, areas by {area_error:2} mm x outline"
                   : "")};
}

ExitCode LabelField(Console& console, const LabelOptions& options)
{
  RequireDistinct({options.sequence.path, options.labels, options.field}, {options.output});
  RequireWritable(options.output);
  RequireOutput(HasSuffix(options.output, ".vtp"), "Cannot write '", options.output, "': labels are kept in .vtp.");
  const vtkSmartPointer<vtkImageData> frames = ReadSequence(options.sequence, console);
  NoteDoubts(frames, options.sequence.path, console);
  const vtkSmartPointer<vtkPolyData> field = ReadFieldData(options.field, console);
  NoteTrackedPlanes(field, options.sequence.path, options.sequence.chain, console);

  const ImportedSweep imported = SweepFromImage(frames);
  const Sweep& sweep = *imported.sweep;
  const LabelFrames given = ReadLabels(options, frames, imported, console);
  given.Validate(sweep);
  const auto [fitted, others] = SplitHoldOut(static_cast<int>(given.frames.size()), options.holdOut);
  const LabelFrames training = given.Subset(fitted), heldOut = given.Subset(others);
  const GaussianField plain = FieldFromPolyData(field);

  const auto start = std::chrono::steady_clock::now();
  const auto progress = [&console](double share)
  {
    console.Progress("Labelling", share);
    return !IsInterrupted();
  };
  const FieldLabels found = FitLabels(plain, sweep, training, {options.engine, progress});
  if (found.labels.empty())
  {
    throw Interrupted();
  }
  Json answer = {{"output", options.output},         {"labels", {}}, {"fitted_frames", fitted.size()},
                 {"held_out_frames", others.size()}, {"dice", {}},   {"seconds", SecondsSince(start)}};
  LabelsToPolyData(found, field);
  WriteFieldData(field, options.output, false, console);
  console.Print("{output}: labels of {fitted_frames} frames in {seconds:1} s", answer);
  answer["labels"] = ToldOf(MeasureLabels(plain, found, sweep, training, TrackerNoise(sweep, 0), options.engine),
                            ToldOfVolume, console);
  if (!others.empty())
  {
    std::vector<SlicePlane> planes;
    std::transform(heldOut.frames.begin(), heldOut.frames.end(), std::back_inserter(planes),
                   [&sweep](int frame) { return sweep.Plane(frame); });
    answer["dice"] = ToldOf(ScoreLabels(plain, found, planes, heldOut.pixels, options.engine), ToldOfScore, console);
  }
  console.Report(answer);
  return Success;
}

}  // namespace

void AddLabel(Program& program)
{
  auto options = std::make_shared<LabelOptions>();
  CLI::App* app = program.app.add_subcommand(
      "label",
      "Carry labels drawn on frames to any plane\n"
      "  bigus label sweep.igs.mha labels.seg.nrrd field.vtp -o labelled.vtp --names 1=vessel\n"
      "  bigus slice labelled.vtp --poses planes.csv --labels maps.nrrd -o slices.nrrd\n"
      "  bigus voxelize labelled.vtp --label vessel --type float -o vessel.nrrd\n"
      "The sequence is the one that the field was trained on, at the poses that 'train --write-poses' wrote.");
  AddSequenceOptions(*app, options->sequence, "SEQUENCE", "Tracked sequence");
  app->add_option(
         "LABELS", options->labels,
         "Label pictures, 0 (none) to 255: .seg.nrrd, .nrrd or .mha with one slice a frame, or a folder of PNG "
         "images whose names have the frame's number, counted from 0")
      ->check(VolumeToRead(".nrrd,.mha,.mhd,.nhdr"))
      ->required()
      ->type_name("");
  app->add_option("FIELD", options->field, "Field: .vtp or .ply")
      ->check(FileToRead(kFieldEndingsToRead))
      ->required()
      ->type_name("");
  app->add_option("-o,--output", options->output, "The field with its labels: .vtp")
      ->check(FileToWrite(".vtp"))
      ->required()
      ->type_name("OUT");
  app->add_option("--names", options->names, "What labels are called, such as 1=vessel,2=cyst")
      ->delimiter(',')
      ->type_name("VALUE=NAME");
  app->add_option(
         "--frames", options->frames,
         "The frames of the file, counted from 0, that the pictures are of, such as 0,10,20-30; default: all, or "
         "the numbers in the names of PNG images")
      ->type_name("LIST");
  app->add_flag(
      "--keep-empty", options->keepEmpty,
      "Empty pictures show that nothing is there, also where most are empty between the first and the last label");
  app->add_option("--hold-out", options->holdOut,
                  "Keep every K-th picture from the fit and tell how well it is met (Dice); 0: none")
      ->check(WholeNumberIn(0, 1000000))
      ->type_name("K")
      ->capture_default_str();
  app->add_option("--engine", options->engine, "What computes: auto, or a name from 'bigus info --devices'")
      ->type_name("NAME")
      ->capture_default_str();
  RunWhenChosen(app, program, [options](Console& console) { return LabelField(console, *options); });
}

}  // namespace bigus::command
