// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus label: labels drawn on frames, carried by a field to any plane.
#include <algorithm>
#include <cmath>
#include <memory>

#include "Command.h"
#include "Core/Labels/LabelVolumes.h"
#include "Core/Labels/Labels.h"
#include "Core/StandardError/StandardError.h"
#include "Data/Arrays.h"
#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "Data/SweepData.h"
#include "Files.h"
#include "Inputs.h"
#include "Pipeline.h"
#include "vtkBigusLabelReader.h"
#include "vtkDataArray.h"
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
  int holdOut = 0, iterations = 4;
  bool keepEmpty = false;
};

/// "1=vessel" names the label of value 1.
std::vector<Label> Named(std::vector<Label> labels, const std::vector<std::string>& names)
{
  for (const std::string& text : names)
  {
    const std::size_t sign = text.find('=');
    Label named;
    Require(sign != std::string::npos && CLI::detail::lexical_cast(text.substr(0, sign), named.value), "--names: '",
            text, "' is not VALUE=NAME, such as 1=vessel.");
    const auto known =
        std::find_if(labels.begin(), labels.end(), [&named](const Label& label) { return label.value == named.value; });
    named.name = text.substr(sign + 1);
    named.color = known == labels.end() ? UsualColor(named.value) : known->color;
    (known == labels.end() ? *labels.insert(labels.end(), named) : *known) = named;
  }
  std::sort(labels.begin(), labels.end(), [](const Label& a, const Label& b) { return a.value < b.value; });
  ValidateLabels(labels);
  return labels;
}

/// Says which frames of the file the pictures are of, unless their extent does.
void Number(vtkImageData* pictures, bool isNumbered, const LabelOptions& options, int framesInFile)
{
  const int count = pictures->GetDimensions()[2];
  if (!options.frames.empty())
  {
    const std::vector<int> given = ParseFrames(options.frames, framesInFile);
    Require(static_cast<int>(given.size()) == count, "--frames: names ", given.size(), " frames, and ", options.labels,
            " has ", count, " pictures; name one frame for each.");
    const auto numbers = NewArray<vtkIntArray>("SourceFrame", 1, count);
    std::copy(given.begin(), given.end(), numbers->GetPointer(0));
    pictures->GetFieldData()->AddArray(numbers);
  }
  else if (!isNumbered && count != framesInFile)
  {
    throw Error(options.labels + ": has " + std::to_string(count) + " pictures for " + std::to_string(framesInFile) +
                " frames; --frames says which frames they are of.");
  }
}

/// The label pictures, with names and numbers of frames.
vtkSmartPointer<vtkImageData> ReadLabels(const LabelOptions& options, vtkImageData* frames, Console& console)
{
  vtkDataArray* const source = frames->GetFieldData()->GetArray("SourceFrame");
  const int framesInFile =
      std::max(frames->GetDimensions()[2], source ? static_cast<int>(source->GetRange()[1]) + 1 : 0);
  vtkNew<vtkBigusLabelReader> reader;
  reader->SetFileName(options.labels.c_str());
  reader->SetMaximumPictures(framesInFile);
  Update(reader, console, "Reading labels");
  const vtkSmartPointer<vtkImageData> pictures = reader->GetOutput();
  const int *size = pictures->GetDimensions(), *extent = pictures->GetExtent();
  const bool isPart = IsPartOfPictures(pictures, frames);
  Require(!isPart || options.frames.empty(), "--frames: ", options.labels,
          " is cropped, which says where its pictures lie in those of all frames; "
          "save it without 'Crop to minimum extent'.");
  if (isPart)
  {
    console.Note("bigus: " + options.labels + " is cropped: taken for frames " + std::to_string(extent[4]) + " to " +
                 std::to_string(extent[5]) + ", and others show none.");
  }
  else if (size[0] == frames->GetDimensions()[0] && size[1] == frames->GetDimensions()[1])  // others are refused later
  {
    Number(pictures, reader->GetNumbered(), options, framesInFile);
  }
  ReplaceLabelNames(pictures, Named(LabelNamesOf(pictures), options.names));
  return pictures;
}

/// Of the pictures those that count; says what is left out.
LabelFrames DrawnFrames(vtkImageData* pictures, vtkImageData* frames, const ImportedSweep& imported, bool keepEmpty,
                        Console& console)
{
  LabelFrames given = LabelFramesFromImage(pictures, frames, imported.frames);
  const std::vector<int> drawn = given.Drawn();
  if (!keepEmpty && drawn.size() < given.frames.size())
  {
    console.Note("bigus: " + std::to_string(given.frames.size() - drawn.size()) + " of " +
                 std::to_string(given.frames.size()) +
                 " pictures hold no label, most of those between others: taken for frames that nobody drew on "
                 "(--keep-empty: they show none).");
    given = given.Subset(drawn);
  }
  given.Validate(*imported.sweep);
  return given;
}

/// Of the labels in the pictures, what three ways reach on pictures that had no part.
Json ToldOfScores(const std::vector<LabelScore>& scores, Console& console)
{
  Json rows = Json::array();
  for (const LabelScore& score : scores)
  {
    rows.push_back({{"value", score.label.value},
                    {"name", score.label.name},
                    {"field", score.field},
                    {"nearest", score.nearest},
                    {"compounding", score.compounding},
                    {"length_error", score.length},
                    {"area_error", score.area}});
    console.Print(std::string("  {name}, Dice on frames held out: field {field:3}, nearest labelled frame {nearest:3}, "
                              "compounded volume {compounding:3}") +
                      (std::isfinite(score.length)
                           ? "; lengths are off by {length_error:2} mm, areas by {area_error:2} mm x outline"
                           : ""),
                  rows.back());
  }
  return rows;
}

Json ToldOfVolumes(const std::vector<LabelVolume>& volumes, Console& console)
{
  Json rows = Json::array();
  for (const LabelVolume& found : volumes)
  {
    rows.push_back({{"value", found.label.value},
                    {"name", found.label.name},
                    {"volume", found.volume},
                    {"standard_error", found.standardError}});
    const bool isKnown = std::isfinite(found.standardError);
    console.Print(std::string("  {name} ({value}): {volume:0} mm^3") + (isKnown ? " +- {standard_error:0}" : ""),
                  rows.back());
  }
  return rows;
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
  const LabelFrames given =
      DrawnFrames(ReadLabels(options, frames, console), frames, imported, options.keepEmpty, console);
  const auto [fitted, others] = SplitHoldOut(static_cast<int>(given.frames.size()), options.holdOut);
  const LabelFrames training = given.Subset(fitted), heldOut = given.Subset(others);
  const GaussianField plain = FieldFromPolyData(field);

  const auto start = std::chrono::steady_clock::now();
  const auto progress = [&console](double share)
  {
    console.Progress("Labelling", share);
    return !IsInterrupted();
  };
  const FieldLabels found = FitLabels(plain, *imported.sweep, training, {options.iterations, options.engine, progress});
  if (found.labels.empty())
  {
    throw Interrupted();
  }
  Json answer = {{"output", options.output},         {"labels", {}}, {"fitted_frames", fitted.size()},
                 {"held_out_frames", others.size()}, {"dice", {}},   {"seconds", SecondsSince(start)}};
  LabelsToPolyData(found, field);
  WriteFieldData(field, options.output, false, console);

  const double noise = TrackerNoise(*imported.sweep, 0);
  const auto volumes = MeasureLabels(plain, found, *imported.sweep, training, noise, options.engine);
  std::vector<LabelScore> scores;
  if (!others.empty())
  {
    heldOut.Validate(*imported.sweep);
    std::vector<SlicePlane> planes;
    std::transform(heldOut.frames.begin(), heldOut.frames.end(), std::back_inserter(planes),
                   [&](int frame) { return imported.sweep->Plane(frame); });
    scores = ScoreLabels(plain, found, *imported.sweep, training, planes, heldOut.pixels, options.engine);
  }
  console.Print("{output}: labels of {fitted_frames} frames in {seconds:1} s", answer);
  answer["labels"] = ToldOfVolumes(volumes, console);
  if (!others.empty())
  {
    answer["dice"] = ToldOfScores(scores, console);
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
  app->add_option("--iterations", options->iterations, "Passes of the fit; 0: what lies between labelled frames")
      ->check(WholeNumberIn(0, 1000))
      ->type_name("N")
      ->capture_default_str();
  app->add_option("--engine", options->engine, "What computes: auto, or a name from 'bigus info --devices'")
      ->type_name("NAME")
      ->capture_default_str();
  RunWhenChosen(app, program, [options](Console& console) { return LabelField(console, *options); });
}

}  // namespace bigus::command
