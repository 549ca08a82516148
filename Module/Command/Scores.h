// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Scores as `metrics` and `train` report them: JSON first, and lines for people that are made of its numbers.
#pragma once

#include <string>
#include <vector>

#include "Console.h"
#include "Core/Metrics/Texture.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Model/ViewDependence.h"
#include "Core/StandardError/StandardError.h"

namespace bigus::command
{

/// Every number under the name of its table column in snake case ("image_contrast_mean"), and the spectra:
/// `spectrum_frequency` in cycles a pixel, `image_spectrum`, `truth_spectrum`.
Json TextureJson(const TextureComparison& texture);

/// TextureJson for people, on stdout.
void PrintTexture(const Json& texture, Console& console);

/// A trained field and the frames that it is scored on, by their number in the sweeps.
struct TrainedField
{
  const GaussianField& field;
  const ViewDependence* view;  ///< null: the field has none
  const Sweep& tracked;        ///< at the poses that were read
  const Sweep& corrected;      ///< at those that the field was trained at
  const std::vector<int>& training;
  const std::vector<int>& trained;  ///< training without the frames that decided when to stop
  const std::vector<int>& heldOut;
  std::string engine;
  bool withBaselines = true, isAligned = false;
};

/// Scores on held-out frames (some are needed): into `answer` "held_out", "held_out_tracked", "trained", "baselines",
/// "held_out_aligned" and the same of each of its "sequences"; and onto the console.
void ScoreHeldOut(const TrainedField& trained, Json& answer, Console& console);

/// What the standard error says of held-out frames beside their errors: into `answer` "standard_error", and onto the console.
void ScoreStandardError(const StandardError& standardError, const TrainedField& trained, Json& answer,
                        Console& console);

/// What the field shows along the sweep, where there is no truth: beside linear interpolation between the frames. Into
/// `answer` "cross_planes", and onto the console.
void ScoreCrossPlanes(const TrainedField& trained, Json& answer, Console& console);

}  // namespace bigus::command
