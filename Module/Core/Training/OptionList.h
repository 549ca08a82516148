// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Every option of the trainer once: its name, range, unit, default and meaning. The VTK filter, the command, JSON jobs,
// provenance and the documentation walk this list, so that an option is added in one place.
#pragma once

#include <string>
#include <vector>

#include "Core/Training/TrainerOptions.h"

namespace bigus
{

/// What the list says of one option.
struct OptionInfo
{
  /// "VirtualPlanes", from which other spellings follow: --virtual-planes of the command, virtual_planes in JSON.
  const char* name;
  const char* group;  ///< heading in the command's help
  const char* help;   ///< one sentence without its full stop
  double least = 0;   ///< range of a number, both ends allowed
  double most = 0;
  const char* unit = "";
  const char* open = "";    ///< what holds when the option is left at "auto"
  bool zeroIsNone = false;  ///< 0 is allowed though it lies outside the range
};

/// Calls visit(info, member) for every option. `Options` is TrainerOptions, const or not. Members are bool, a number,
/// std::string, SeedPlacement, Preset, KeptKinds, Loss or FrameInterpolation, or a std::optional of these, which may stay open.
template <class Options, class Visit>
void ForEachOption(Options& options, const Visit& visit)
{
  constexpr double kMostGaussians = 67108864;  // 2^26
  constexpr double kMostIterations = 10000000;
  constexpr double kLargestSeed = 9007199254740992.0;  // 2^53: up to there every whole number is a double
  constexpr double kAboveZero = 1e-6;

  const char* field = "What is fitted";
  visit(
      OptionInfo{"Automatic", field,
                 "Decide what is left at auto by short trainings, scored on frames set aside among those to train on; "
                 "off: follow the sweep's geometry, at once"},
      options.automatic);
  visit(OptionInfo{"Gaussians", field, "Gaussians to start with", 1, kMostGaussians, "",
                   "begins at one for every 44 lit pixels to train on (preset texture: 8), 1000 to 300000"},
        options.gaussians);
  visit(OptionInfo{"MaximumGaussians", field, "The most Gaussians that are chosen while Gaussians is auto", 1,
                   kMostGaussians, "", "one for every 4 lit pixels to train on"},
        options.maximumGaussians);
  visit(
      OptionInfo{
          "Price", field,
          "What twice the Gaussians must gain at a plane at random to be chosen, PSNR; less: more Gaussians, time and bytes",
          0, 100, "dB"},
      options.price);
  visit(
      OptionInfo{"ElevationSigma", field,
                 "Thickness out of plane, standard deviation, of the planes trained on; 0 is a thin plane", 0, 1000,
                 "mm", "0, or the probe's where sweeps cross and are trained as one; the field's own when continuing"},
      options.elevationSigma);
  visit(
      OptionInfo{"ProbeElevationSigma", field,
                 "Thickness of the probe's beam out of plane, standard deviation, which planes across the sweep show; "
                 "0 where it is not known",
                 0, 1000, "mm",
                 "measured by how fast speckle changes, where it can be; the field's own when continuing"},
      options.probeElevationSigma);
  visit(OptionInfo{"SignedReflectivity", field, "Allow negative reflectivity, which darkens"},
        options.signedReflectivity);
  visit(
      OptionInfo{
          "ViewDependence", field,
          "Let reflectivities change with the direction they are seen from, near recorded frames", 0, 0, "",
          "where recorded frames that a short training has not seen gain by it; off without Automatic, with a time "
          "limit, or when continuing"},
      options.viewDependence);
  visit(
      OptionInfo{"VirtualPlanes", field, "Interpolated planes added in every gap between neighbouring training frames",
                 0, 8, "", "so many that planes lie about a pixel apart, 2 to 7"},
      options.virtualPlanes);
  visit(
      OptionInfo{
          "Interpolation", field,
          "What virtual planes show: points meet along the frames' normals (trusts poses) or at the same pixel "
          "(trusts the smoothness of the probe's path), with or without optical flow; frames change smoothly along the "
          "sweep, roughly, or in between",
          0, 0, "", "chosen by how well frames predict each other"},
      options.interpolation);
  visit(OptionInfo{"Keep", field, "Findings of the inspection that nothing is done about; several are joined by +"},
        options.keep);
  visit(
      OptionInfo{"FrameGains", field,
                 "Remove a gain and an offset from every training frame, for sweeps whose frames differ in brightness"},
      options.frameGains);
  visit(OptionInfo{"PoseSmoothing", field,
                   "How strongly the tracker's noise is taken out of all poses, in units of the noise found in them; 0 "
                   "keeps them as tracked",
                   0, 1000, "", "begins at 1, or 0 where pictures do not confirm it; 0 without Automatic"},
        options.poseSmoothing);
  visit(OptionInfo{"Seeding", field, "Where Gaussians start: spread by brightness, at corners, or anywhere"},
        options.seeding);

  const char* course = "How long and how";
  visit(OptionInfo{"Iterations", course, "Optimizer steps; 0 only seeds", 0, kMostIterations, "",
                   "begins at 80 passes over frames and virtual planes, 30 where planes are sparse, at least 200"},
        options.iterations);
  visit(OptionInfo{"TimeLimit", course, "Time for all of it, decisions included; 0 sets no limit", 0, 1e9, "s"},
        options.timeLimit);
  visit(OptionInfo{"Seed", course, "Seed of everything random: same seed, same field", 0, kLargestSeed}, options.seed);
  visit(OptionInfo{"Batch", course, "Frames in one step", 1, 4096}, options.batch);
  visit(OptionInfo{"Preset", course,
                   "What the field is for: least error (fidelity), or speckle as strong as in the frames, which costs "
                   "error (texture)"},
        options.preset);
  visit(OptionInfo{"Loss", course, "What is made small: l1, l2, dssim, ffl, contrast or a sum such as 0.8*l1+0.2*dssim",
                   0, 0, "", "the preset's: l1, or l1+30*contrast for texture"},
        options.loss);
  visit(OptionInfo{"Engine", course, "What computes: auto (the fastest present) or a name from 'bigus info --devices'"},
        options.engine);

  const char* judged = "How it is judged";
  visit(OptionInfo{"HoldOut", judged,
                   "Keep frames with index % K == K / 2 out of everything but the final score; 0 keeps none", 2, 1e6,
                   "", "", true},
        options.holdOut);
  visit(OptionInfo{"Validation", judged, "Of the other frames, keep every K-th to stop early by; 0 keeps none", 2, 1e6,
                   "", "", true},
        options.validation);
  visit(OptionInfo{"Patience", judged, "Evaluations on validation frames without a better PSNR before training stops",
                   1, 1e6},
        options.patience);

  const char* fine = "Finer points";
  visit(OptionInfo{"MeanRate", fine, "First step of the centres", 0, 100, "pixels"}, options.meanRate);
  visit(OptionInfo{"ShapeRate", fine, "First step of the logarithm of the scales and of the rotation (radian)", 0, 1},
        options.shapeRate);
  visit(
      OptionInfo{"ReflectivityRate", fine, "First step of the reflectivities, in units of their mean magnitude", 0, 10},
      options.reflectivityRate);
  visit(OptionInfo{"FinalRate", fine, "Share of the steps that is left at the end", kAboveZero, 1}, options.finalRate);
  visit(
      OptionInfo{"Tolerance", fine, "How much cutting off a Gaussian's footprint may change a pixel's intensity", 0, 1},
      options.tolerance);
  visit(
      OptionInfo{"IgnoreMasked", fine,
                 "Leave every pixel that no training frame lights out of the loss; off: only those within 5 pixels of "
                 "lit ones, the rest is learned as black"},
      options.ignoreMasked);
  visit(OptionInfo{"DensificationInterval", fine,
                   "Steps between restructurings that add Gaussians where error persists; 0 never", 0, kMostIterations},
        options.densification.interval);
  visit(OptionInfo{"DensificationPercentile", fine, "Gaussians with an error score above this percentile are densified",
                   0, 100},
        options.densification.percentile);
  visit(OptionInfo{"DensificationCap", fine, "No growth beyond so many Gaussians; 0 is twice the first number", 0,
                   kMostGaussians},
        options.densification.cap);
}

/// An option with its value as text, for whoever prints, parses or forwards it.
struct OptionText
{
  enum class Kind
  {
    Switch,  ///< on, off
    Number,
    Text
  };
  OptionInfo info;
  Kind kind = Kind::Text;
  bool mayBeOpen = false;  ///< "auto" is a value
  std::string values;      ///< other values: "0 to 8", "on|off", "intensity|harris|random", ...; empty: any text
  std::string value;       ///< as SetOption reads it
  bool isWhole = false;    ///< a number without a fraction
};

/// All options in the list's order; those of a default TrainerOptions are the defaults.
std::vector<OptionText> ListOptions(const TrainerOptions& options = {});

/// Reads a value: a number with a point as decimal mark, on or off, a name, or auto to leave the option open. Throws
/// Error naming the option, the value and what it may be; an unknown name is an Error, too.
void SetOption(TrainerOptions& options, const std::string& name, const std::string& value);

/// A number as SetOption reads it: the shortest text that reads back as the same, whole numbers without an exponent.
std::string NumberText(double value);

/// "VirtualPlanes" to "virtual planes", with another separator to "virtual-planes" or "virtual_planes".
std::string SpellOption(const std::string& name, char separator = ' ');

/// The value for a JSON object (nlohmann::json or the like): a number, true or false, text, or null where it is open.
template <class Json>
Json ToJson(const OptionText& option)
{
  if (option.mayBeOpen && option.value == "auto")
  {
    return Json();
  }
  return option.kind == OptionText::Kind::Number   ? Json::parse(option.value)
         : option.kind == OptionText::Kind::Switch ? Json(option.value == "on")
                                                   : Json(option.value);
}

}  // namespace bigus
