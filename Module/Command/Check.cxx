// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus check: what is wrong with a sequence, before it is trained on.
#include <algorithm>
#include <memory>

#include "Command.h"
#include "Core/Inspection/Inspection.h"
#include "Core/Inspection/Page.h"
#include "Core/Model/Error.h"
#include "Data/SweepData.h"
#include "Files.h"
#include "Inputs.h"
#include "Outputs.h"
#include "vtkImageData.h"
#include "vtkSmartPointer.h"

namespace bigus::command
{

namespace
{

struct CheckOptions
{
  SequenceOptions sequence;
  std::string output;
  std::string keep = "none";
};

/// Usable frames that no training would get, by their numbers in the sequence.
Json LeftOut(const InspectedSweep& inspected, const std::vector<int>& numbers)
{
  std::vector<int> left = inspected.frames;
  std::sort(left.begin(), left.end());
  Json gone = Json::array();
  for (const int frame : AllFrames(*inspected.recorded))
  {
    if (!std::binary_search(left.begin(), left.end(), frame))
    {
      gone.push_back(numbers[frame]);
    }
  }
  return gone;
}

/// The share of a frame that a probe lights, by what is left of the sweep: a training and its scores look at that.
double LitShare(const Sweep& sweep)
{
  const Sweep lit = sweep.LitBy(AllFrames(sweep));
  const auto unlit = lit.mask ? std::count(lit.mask->begin(), lit.mask->end(), 0) : 0;
  return 1 - static_cast<double>(unlit) / static_cast<double>(sweep.PixelsPerFrame());
}

ExitCode Check(Console& console, const CheckOptions& options)
{
  if (!options.output.empty())
  {
    RequireDistinct({options.sequence.path, options.sequence.chain.config}, {options.output});
    RequireWritable(options.output);
  }
  const vtkSmartPointer<vtkImageData> image = ReadSequence(options.sequence, console);
  const ImportedSweep imported = SweepFromImage(image);
  const InspectedSweep inspected = Inspect(imported.sweep, KeptKinds::Parse(options.keep));
  const Json answer = {{"sequence", options.sequence.path},
                       {"frames", imported.sweep->NumberOfFrames()},
                       {"lit", LitShare(*inspected.sweep)},
                       {"left_out", LeftOut(inspected, imported.frames)},
                       {"findings", FindingsJson(inspected.findings, imported.frames)}};
  const std::string outcome = answer["findings"].empty()
                                  ? "nothing is wrong with them that was looked for"
                                  : std::to_string(answer["left_out"].size()) + " would be left out of a training";
  if (!options.output.empty())
  {
    WritePage(DrawPage(inspected, imported.frames, FileName(options.sequence.path) + ": " + outcome), options.output);
  }
  console.Print(options.sequence.path + ": " + std::to_string(imported.sweep->NumberOfFrames()) + " usable frames, " +
                outcome);
  if (answer["lit"] < 1)
  {
    console.Print("  The probe lights " + FormatNumber(100 * answer["lit"].get<double>(), 0) +
                  " % of a frame; what lies beside has no part in a training");
  }
  for (const Json& finding : answer["findings"])
  {
    console.Print("  " + finding["kind"].get<std::string>() + ": " + finding["text"].get<std::string>());
  }
  console.Report(answer);
  return Success;
}

/// Nothing where the text names kinds, else what is wrong with it.
std::string WrongKinds(const std::string& text)
{
  try
  {
    KeptKinds::Parse(text);
    return "";
  }
  catch (const Error& error)
  {
    return error.what();
  }
}

}  // namespace

void AddCheck(Program& program)
{
  auto options = std::make_shared<CheckOptions>();
  CLI::App* app = program.app.add_subcommand(
      "check",
      "Say what is wrong with a sequence before it is trained on\n"
      "  bigus check sweep.igs.mha\n"
      "  bigus check sweep.igs.mha -o check.png\n"
      "Looked for are frames out of the order of their times, a probe off the skin or at rest, repeated pictures and "
      "text of the screen. 'train' looks by itself, and leaves out, orders or fills what it finds.");
  AddSequenceOptions(*app, options->sequence, "SEQUENCE", "Tracked frames: .igs.mha .mha .mhd .nrrd .seq.nrrd .csv");
  app->add_option("-o,--output", options->output,
                  "A page to look at: frames along time, the way from frame to frame, and every finding in its colour")
      ->check(FileToWrite(".png"))
      ->type_name("PNG");
  app->add_option("--keep", options->keep, "Kinds that nothing is done about; several are joined by +")
      ->check(WrongKinds)
      ->type_name(KeptKinds::kNames)
      ->capture_default_str();
  RunWhenChosen(app, program, [options](Console& console) { return Check(console, *options); });
}

}  // namespace bigus::command
