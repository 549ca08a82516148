// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where fields are rendered and trained. One interface; the reference engine says what is right, the others
// are fast.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Core/Engine/Loss.h"
#include "Core/Formula/LearningRates.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

class Exchange;
class StateReader;
class StateWriter;

/// Derivatives of the loss, in world frame and natural units.
struct FieldGradient
{
  std::vector<Eigen::Vector3d> means;      ///< [N] dL/dmu, per mm
  std::vector<Eigen::Vector3d> logScales;  ///< [N] dL/d ln s
  std::vector<Eigen::Vector3d> rotations;  ///< [N] dL/d omega, R <- R exp([omega]x): turn about local axes, radian
  std::vector<double> reflectivities;      ///< [N] dL/dr
};

/// How exactly footprints are evaluated: the knob of speed against error. The reference engine always
/// evaluates everything.
struct Accuracy
{
  /// On I, >= 0; 0 leaves nothing out. Since dI = gamma (1 - I) dS, footprints end where what they drop could
  /// change S by more than their share of tolerance / gamma.
  double tolerance = 1e-4;
  /// false: all that is dropped at any one pixel changes I by at most `tolerance`, guaranteed (rounding
  /// apart, see README.md). true: each splat alone changes it by at most that; the sum is not bounded, and
  /// training is faster for it.
  bool perSplat = false;
  /// Compute an exponential for every pixel instead of recurrences along the rows: slower; to measure what
  /// recurrences cost in exactness.
  bool direct = false;
};

/// The Gaussians of a field that one process has, and where in the field they are.
struct FieldPart
{
  GaussianField field;
  std::vector<std::uint32_t> places;  ///< [field.Size()]; empty: it is the whole field
};

/// Numbers a view can hold.
enum class ViewOutput
{
  Intensity,  ///< I in [0, 1)
  Scattering  ///< S, signed
};

/// Everything lives where the engine computes: frames, field, gradients and optimizer state. Only scalars
/// come back from a training step; arrays come back when asked for. Results do not depend on the number of
/// threads. Errors are thrown as bigus::Error. An engine is used by one thread at a time.
class Engine
{
public:
  virtual ~Engine() = default;

  /// "auto" (the fastest present), "cuda" (float, where there is a CUDA device), "cpu" (float), "cpu-double"
  /// (the same in double, for tolerances below 1e-5), "reference", or a name registered. Throws Error that lists
  /// the names, or says why the engine cannot be used here.
  static std::unique_ptr<Engine> Create(const std::string& name = "auto");
  /// Makes an engine available by name; `preferred` puts it first for "auto".
  using Factory = std::function<std::unique_ptr<Engine>()>;
  static void Register(const std::string& name, Factory factory, bool preferred);
  /// The engines that can be used here, the preferred first.
  static std::vector<std::string> Names();
  /// Engines known by name that cannot be used here, and why: "no CUDA driver is installed".
  static std::vector<std::pair<std::string, std::string>> Missing();

  /// Name of what computes, for reports: "CPU (AVX2, 2 threads)".
  virtual std::string Device() const = 0;

  /// Uploads a field. `parents[i]` is the index in the present field whose optimizer state Gaussian i
  /// inherits, or -1 for a fresh one; null resets all state.
  virtual void SetField(const GaussianField& field, const std::vector<int>* parents = nullptr) = 0;
  virtual GaussianField GetField() const = 0;
  virtual std::size_t FieldSize() const = 0;

  /// The Gaussians that this process trains: all of them, unless the engine is a PartEngine.
  virtual FieldPart GetPart() const { return {GetField(), {}}; }
  /// Replaces those by as many others, and resets all state.
  virtual void SetPart(const GaussianField& part) { SetField(part); }
  /// The whole field, of which every process gives the part that its GetPart gave at some time.
  virtual GaussianField Gather(FieldPart part) const { return std::move(part.field); }

  /// From now on the engine's field is a part of one, and what it trains on is the sum of S of the parts of all
  /// processes, each of which calls Backpropagate and TrainStep as this one does. Null: it has the
  /// whole field. The exchange must outlive the engine. By default throws Error, since not every engine can.
  virtual void SetExchange(Exchange* exchange);

  virtual void SetAccuracy(const Accuracy& accuracy) = 0;

  /// Renders plane pixels [firstRow, firstRow + rows) x [firstColumn, firstColumn + columns) of a view.
  struct Window
  {
    int firstColumn = 0, firstRow = 0, columns = 0, rows = 0;
  };
  /// `image` gets rows * columns floats. `coverage`, if not null, gets as many: the sum over Gaussians of
  /// w_i(p) (each footprint's weight, reflectivity left out), which falls to 0 where no Gaussian was ever
  /// seen.
  virtual void Render(const SlicePlane& plane, const Window& window, ViewOutput output, float* image,
                      float* coverage) = 0;
  void Render(const SlicePlane& plane, ViewOutput output, float* image, float* coverage = nullptr)
  {
    Render(plane, {0, 0, plane.width, plane.height}, output, image, coverage);
  }

  /// Whole planes of one size, which a device renders faster together than one by one: `images` gets
  /// [planes][height][width] floats, and `coverage`, if not null, as many. Throws Error when sizes differ.
  virtual void RenderStack(const std::vector<SlicePlane>& planes, ViewOutput output, float* images,
                           float* coverage = nullptr);

  /// Uploads the frames to train on. Pixels that the sweep's mask excludes have no part in any loss. The caller has
  /// called Sweep::Validate, which reads every pixel; this calls Sweep::ValidateLayout and throws its errors.
  virtual void SetFrames(std::shared_ptr<const Sweep> sweep) = 0;

  /// Renders the frames, and adds up the loss (mean over the batch's frames), its gradient
  /// with respect to every parameter, and the error scores of paper eq 14. Replaces the previous gradient; scores
  /// accumulate. Throws Error when a term of the loss finds no window in frames of this size and mask.
  virtual double Backpropagate(const std::vector<int>& frames, const Loss& loss) = 0;

  /// One Adam step (Formula/Adam.h) along the gradient of the last Backpropagate, for the Gaussians that its
  /// frames saw; all others rest, their averages with them.
  virtual void Step(const LearningRates& rates, const ParameterLimits& limits) = 0;

  /// Backpropagate and Step at once, which spares an engine from storing the gradient: what training calls.
  /// Afterwards there is no gradient to get or to step along. Returns the loss before the step.
  virtual double TrainStep(const std::vector<int>& frames, const Loss& loss, const LearningRates& rates,
                           const ParameterLimits& limits) = 0;

  /// How many updates of a Gaussian, since the field was set without parents, met a gradient that was not
  /// finite or beyond 1e15 and were guarded against it: 0 in any sound training.
  virtual std::uint64_t GuardedUpdates() const = 0;

  /// Bytes the engine holds: field, optimizer state, scores, what the last step needed. Frames are shared
  /// with their owner and not counted.
  virtual std::size_t MemoryUse() const = 0;

  /// All that further steps depend on, frames and accuracy apart: field, optimizer state, scores. LoadState of an engine
  /// of the same name, which computes with the same instructions, goes on with the same bits. LoadState throws Error for
  /// bytes that no SaveState wrote. By default both throw Error, since not every engine can.
  virtual void SaveState(StateWriter& to) const;
  virtual void LoadState(StateReader& from);

  /// For tests and densification; not part of a step.
  virtual FieldGradient GetGradient() const = 0;

  /// Per Gaussian, summed since the last ResetScores.
  struct Scores
  {
    std::vector<double> error;             ///< E_i of paper eq 14: sum_p |dL/dS| w_i
    std::vector<Eigen::Vector3d> descent;  ///< sum of -dL/dmu
    std::vector<double> visits;            ///< frames that saw the Gaussian
  };
  virtual Scores GetScores() const = 0;
  /// Starts to add up scores, which makes training a little slower: before, and after SetField, none are
  /// kept.
  virtual void ResetScores() = 0;
};

}  // namespace bigus
