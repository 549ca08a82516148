// From a tracked sweep to a Gaussian field.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Densification.h"
#include "Engine.h"
#include "GaussianField.h"
#include "Loss.h"
#include "Metrics.h"
#include "Seeding.h"
#include "Sweep.h"

namespace bigus
{

/// Everything a caller can set. An empty optional means: derived from the sweep (see README.md of this
/// folder).
struct TrainerOptions
{
  std::string engine = "auto";
  SeedPlacement seeding = SeedPlacement::Intensity;
  std::size_t gaussians = 100000;  ///< seeds, 1 to 2^26
  std::optional<double>
      elevationSigma;  ///< mm, >= 0; default 0.3, or 0.8 when planes are more than 1 mm apart
  int holdOut = 0;     ///< frames with index % K == K / 2 are kept for the final score; 0 or >= 2
  int validation = 0;  ///< of the remaining frames, the same rule with this K serves early stop; 0 or >= 2
  int patience = 10;   ///< evaluations without a better validation PSNR before stopping, >= 1
  /// Optimizer steps, 0 (seeding only) to 10^7; default: 120 passes over the frames trained on, 60 when
  /// sparse, at least 200.
  std::optional<int> iterations;
  double timeLimit = 0;  ///< seconds, seeding and solve included, 0 = none; the rate schedule is fitted to it
  int batch = 8;         ///< frames a step, 1 to 4096
  std::uint64_t seed = 1;
  Loss loss;
  bool signedReflectivity = true;  ///< false: r >= 0
  bool ignoreMasked = false;       ///< true: pixels never lit do not count in the loss
  double tolerance = 1e-4;         ///< on I, of each splat: Accuracy::perSplat
  double meanRate = 0.6;           ///< Adam step for means, pixels
  double shapeRate = 0.08;         ///< Adam step for log-scales and rotation (radian)
  double reflectivityRate = 0.15;  ///< Adam step for r, in units of mean |r|
  double finalRate = 0.05;         ///< rates decay to this share
  std::optional<int>
      solveIterations;  ///< conjugate-gradient steps on r at the start; default 8, or 0 when sparse
  std::optional<int> virtualPlanes;    ///< planes added in every gap, 0 to 8; default 1 when sparse, else 0
  std::optional<double> minimumScale;  ///< mm; default 0.25 pixel
  std::optional<double> maximumScale;  ///< mm; default 48 pixels
  DensificationOptions densification;

  /// Throws Error naming the option, its value and its range.
  void Validate() const;
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
    Seeding,
    Solving,
    Training
  };
  Phase phase = Phase::Seeding;
  double fraction = 0;     ///< of the whole job, 0 to 1
  double secondsLeft = 0;  ///< estimate; 0 while unknown
  TrainingRecord record;
};

struct TrainingResult
{
  GaussianField field;
  std::vector<TrainingRecord> log;
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
