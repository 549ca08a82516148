// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From a tracked sweep to a Gaussian field.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Engine/Loss.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/Densification.h"
#include "Core/Training/FrameInterpolation.h"
#include "Core/Training/Seeding.h"

namespace bigus
{

/// Everything a caller can set. An empty optional is a choice left open: with `automatic` it is decided from
/// evidence (Decisions.h), else derived from the sweep's geometry (README.md of this folder).
struct TrainerOptions
{
  std::string engine = "auto";
  bool automatic = true;  ///< decide what is left open by short trainings scored on validation frames
  SeedPlacement seeding = SeedPlacement::Intensity;
  std::optional<std::size_t> gaussians;    ///< seeds, 1 to 2^26
  std::size_t maximumGaussians = 2000000;  ///< the most that `automatic` chooses, 1 to 2^26
  double price = 0.1;                      ///< dB on validation frames that twice the Gaussians must gain, 0 to 100
  std::optional<double> elevationSigma;    ///< mm, 0 to 1000
  std::optional<bool> signedReflectivity;  ///< false: r >= 0
  std::optional<int> virtualPlanes;        ///< planes added in every gap, 0 to 8
  std::optional<FrameInterpolation> interpolation;  ///< what virtual planes show
  bool keepContrast = false;  ///< interpolation that is decided on keeps the frames' speckle contrast
  /// A gain and an offset for every frame to train on, removed from it: images of one place that differ in
  /// brightness otherwise fight each other.
  std::optional<bool> frameGains;
  /// Every frame to train on is aligned rigidly to the field twice on the way, with the tracker's word as
  /// prior.
  std::optional<bool> poseRefinement;
  double trackerTranslation = 0.3;  ///< mm, above 0 to 1000: standard deviation of a tracked position
  double trackerRotation = 0.3;     ///< degrees, above 0 to 45: of a tracked orientation
  int holdOut = 0;                  ///< frames with index % K == K / 2 are kept for the final score; 0 or >= 2
  int validation = 0;               ///< of the remaining frames, the same rule with this K serves early stop; 0 or >= 2
  int patience = 10;                ///< evaluations without a better validation PSNR before stopping, >= 1
  std::optional<int> iterations;    ///< optimizer steps, 0 (seeding only) to 10^7
  double timeLimit = 0;             ///< seconds, all included, 0 = none; the rate schedule is fitted to it
  int batch = 8;                    ///< frames a step, 1 to 4096
  std::uint64_t seed = 1;
  Loss loss;
  std::optional<Loss> finalLoss;       ///< weights move linearly from `loss` to these as training goes on
  bool ignoreMasked = false;           ///< true: no pixel never lit counts in the loss; false: far ones are black
  double tolerance = 1e-4;             ///< on I, of each splat: Accuracy::perSplat
  double meanRate = 0.3;               ///< Adam step for means, pixels
  double shapeRate = 0.08;             ///< Adam step for log-scales and rotation (radian)
  double reflectivityRate = 0.15;      ///< Adam step for r, in units of mean |r|
  double finalRate = 0.05;             ///< rates decay to this share, and further in more than some 300 passes
  std::optional<int> solveIterations;  ///< conjugate-gradient steps on r at the start, 0 to 1000
  std::optional<double> minimumScale;  ///< mm; default 0.25 pixel
  std::optional<double> maximumScale;  ///< mm; default 48 pixels
  DensificationOptions densification;

  /// Throws Error naming the option, its value and its range.
  void Validate() const;
};

/// Sets what belongs to one aim, and leaves the rest as it is: "fidelity" (the least error, the default),
/// "texture" (speckle as strong as in the frames, at a price in error). Throws Error with the names for any
/// other.
void ApplyPreset(const std::string& name, TrainerOptions& options);

/// A choice that training rests on, why, and what finding out cost.
struct Decision
{
  std::string what;      ///< "Gaussians", "elevation sigma", ...
  std::string choice;    ///< with its unit
  std::string evidence;  ///< what was compared, in dB on validation frames; "given" when the caller chose
  double seconds = 0;
};

/// A line of the training log.
struct TrainingRecord
{
  int iteration = 0;
  double seconds = 0;
  double loss = 0;  ///< mean since the last line
  std::optional<double> validationPsnr;
  std::size_t gaussians = 0;
  double rate = 1;  ///< share of the first learning rate
};

struct TrainingProgress
{
  enum class Phase
  {
    Deciding,
    Seeding,
    Solving,
    Training
  };
  Phase phase = Phase::Deciding;
  double fraction = 0;     ///< of the whole job, 0 to 1
  double secondsLeft = 0;  ///< estimate; 0 while unknown
  TrainingRecord record;
};

struct TrainingResult
{
  GaussianField field;
  std::vector<TrainingRecord> log;
  std::vector<Decision> decisions;
  TrainerOptions settled;  ///< the options with every choice made
  int iterations = 0;
  double seconds = 0;
  std::string device;
  bool aborted = false;  ///< the callback said stop; the field is the best so far
  std::vector<int> trainingFrames, validationFrames, heldOutFrames;
};

/// `progress` (may be empty) is called at least every 100 ms or once an iteration; returning false stops
/// training and keeps the best field so far. `start` (may be null) is a field to continue from instead of
/// seeding; without one, fewer than two frames to train on or frames of equal pixels throughout are an Error.
TrainingResult Train(std::shared_ptr<const Sweep> sweep, const TrainerOptions& options,
                     const GaussianField* start = nullptr,
                     const std::function<bool(const TrainingProgress&)>& progress = {});

}  // namespace bigus
