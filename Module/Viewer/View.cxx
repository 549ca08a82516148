// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus view: a field and its sweep in a window.
#include <algorithm>
#include <memory>
#include <numeric>

#include "Command.h"
#include "Display.h"
#include "Exit.h"
#include "Files.h"
#include "Inputs.h"
#include "ViewBox.h"
#include "ViewParts.h"
#include "ViewWindow.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

struct Options
{
  std::string field, screenshot;
  SequenceOptions sequence;
  std::vector<int> size = {1440, 900};
  int frame = -1;  ///< negative: the middle one
  std::vector<std::string> show = {"ellipsoids", "slice", "frames"};
};

constexpr double kFewInside = 0.5;  // of the lit pixels in the field's box; a sweep's own are nearly all there

/// The sweep with the pixels known that any frame lights; null without a sequence.
std::shared_ptr<const Sweep> ReadLitSweep(const SequenceOptions& options, Console& console)
{
  if (options.path.empty())
  {
    return nullptr;
  }
  const std::shared_ptr<const Sweep> sweep = ReadSweep(options, console);
  std::vector<int> frames(sweep->NumberOfFrames());
  std::iota(frames.begin(), frames.end(), 0);
  return std::make_shared<const Sweep>(sweep->LitBy(frames));
}

/// The frame to show first.
int FirstFrame(const Options& options, const Sweep* sweep)
{
  Require(options.frame < 0 || sweep, "--frame ", options.frame,
          ": there are no frames; name a sequence after the field.");
  const int count = sweep ? sweep->NumberOfFrames() : 0;
  Require(options.frame < count || !sweep, "--frame ", options.frame, ": '", options.sequence.path, "' has ", count,
          " usable frames, counted from 0.");
  return options.frame >= 0 ? options.frame : count / 2;
}

void NoteForeignSweep(vtkPolyData* field, const Sweep& sweep, const Options& options, Console& console)
{
  const double inside = ShareInside(BoxOfField(field, &sweep), sweep);
  if (inside < kFewInside)
  {
    console.Note("Only " + FormatNumber(100 * inside, 0) + " % of the frames of '" + options.sequence.path +
                 "' lies where the field has Gaussians. Was '" + options.field +
                 "' trained on another sweep, or with other --image-from, --image-to or --config?");
  }
}

ExitCode View(Console& console, const Options& options)
{
  if (!options.screenshot.empty())
  {
    RequireOutput(HasSuffix(options.screenshot, ".png"), "'", options.screenshot,
                  "': a screenshot's name must end in .png.");
    RequireDistinct({options.field, options.sequence.path, options.sequence.chain.config}, {options.screenshot});
    RequireWritable(options.screenshot);
  }
  RequireFile(options.field);
  RequireDisplay();
  const vtkSmartPointer<vtkPolyData> field = ReadFieldData(options.field, console);
  const std::shared_ptr<const Sweep> sweep = ReadLitSweep(options.sequence, console);
  const int frame = FirstFrame(options, sweep.get());
  if (sweep)
  {
    NoteTrackedPlanes(field, options.sequence.path, options.sequence.chain, console);
    NoteForeignSweep(field, *sweep, options, console);
  }

  ViewSettings settings;
  settings.name = FileName(options.field);
  settings.width = options.size[0];
  settings.height = options.size[1];
  settings.offScreen = !options.screenshot.empty();
  ViewWindow window(field, sweep, settings, console);
  for (const std::string& part : kViewParts)
  {
    window.Scene().Show(part, std::count(options.show.begin(), options.show.end(), part) > 0);
  }
  if (sweep)
  {
    window.ShowFrame(frame);
  }
  if (options.screenshot.empty())
  {
    window.Run();
    return IsInterrupted() ? InterruptedCode() : Success;
  }
  window.WriteScreenshot(options.screenshot);
  console.Print(
      options.screenshot + ": " + std::to_string(settings.width) + " x " + std::to_string(settings.height) + " pixels" +
      (sweep ? ", frame " + std::to_string(frame) + " at " + FormatNumber(window.FramePsnr(), 2) + " dB" : ""));
  for (const std::string& name : window.Guessed())
  {
    console.Print("  mostly guessed: " + name);
  }
  console.Report({{"screenshot", options.screenshot},
                  {"size", options.size},
                  {"frame", sweep ? Json(frame) : Json()},
                  {"psnr", window.FramePsnr()},
                  {"mostly_guessed", window.Guessed()}});
  return Success;
}

void AddView(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app = program.app.add_subcommand(
      "view",
      "See a field in a window, with its sweep beside it\n"
      "  bigus view field.vtp sweep.igs.mha\n"
      "  bigus view field.vtp sweep.igs.mha --frame 20 --screenshot view.png\n"
      "A 3-D scene (Gaussians as ellipsoids at one standard deviation, blue where reflectivity is negative; the slice at a\n"
      "frame; frames and the probe's path), three planes at right angles, and the recorded frame beside the rendered one\n"
      "with their difference. ? lists the keys. It needs an X server, for --screenshot a virtual one is enough.");
  app->add_option("FIELD", options->field, "Field: .vtp, .pvtp or .ply")->required()->type_name("");
  AddSequenceOptions(*app, options->sequence, "SEQUENCE",
                     "The sweep that it was trained on. Its poses are taken as they are: give what 'train "
                     "--write-poses' wrote, where poses were corrected");
  app->get_option("SEQUENCE")->required(false);
  AddReduceOption(*app, options->sequence.reduce);
  app->add_option("--frame", options->frame,
                  "Frame shown first, counted from 0 among the usable ones; default: the middle one")
      ->check(NumberIn(0, 1e9))
      ->type_name("N");
  app->add_option("--show", options->show,
                  "Parts of the scene: ellipsoids, volume, slice, frames, planes, beam; default: "
                  "ellipsoids,slice,frames")
      ->delimiter(',')
      ->check(CLI::IsMember(kViewParts).description(""))
      ->type_name("LIST");
  app->add_option("--size", options->size, "Pixels of the window across and down; default: 1440 900")
      ->expected(2)
      ->delimiter('x')
      ->check(NumberIn(200, 4096))
      ->type_name("W H");
  app->add_option("--screenshot", options->screenshot, "Draw off screen, write the picture and end: .png")
      ->type_name("OUT");
  RunWhenChosen(app, program, [options](Console& console) { return View(console, *options); });
}

[[maybe_unused]] const std::size_t row =
    AddVerb({80, "bigus view field.vtp sweep.igs.mha", "both in a window", AddView});

}  // namespace

}  // namespace bigus::command
