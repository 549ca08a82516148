// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Training by all frames at once with steps that know curvature. Private to
// Core.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <deque>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Sweep.h"
#include "Core/Numerics/StateBytes.h"

namespace bigus
{

/// L-BFGS (Nocedal and Wright, Numerical Optimization, 2006, section 7.2) over
/// all Gaussians of an engine, whose first matrix is the Gauss-Newton matrix of
/// every Gaussian by itself, in closed form.
///
/// A Gaussian is mu, L with Sigma = L L^T, and r. A step moves it in its own
/// axes: r += dr, mu += L u, L <- L exp(E) with E symmetric, so nothing is
/// singular where it is round. The numbers of a step are c = (dr, r u, r E), E
/// as 11, 22, 33, 23, 13, 12; the footprint changes by dS/dc = w (1, y_k,
/// y_k^2, 2 y_j y_k), y = L^-1 (x - mu).
///
/// The loss falls with every step, so there are no rates and no decay, and any
/// step may be the last. The same input gives the same bits for any number of
/// threads.
class QuasiNewton
{
public:
  /// From the engine's field, which has no Gaussian of r = 0 that matters: such
  /// a one changes its r alone. `images` are the engine's frames, those of
  /// `frames` count. All must outlive this.
  QuasiNewton(Engine& engine, const Sweep& images, const std::vector<int>& frames, const ParameterLimits& limits);

  /// One step, which passes over the frames once, seldom more often. Returns
  /// the loss after it, which is the engine's field's; no less than before
  /// where no step lowers it.
  double Step(const Loss& loss);

  /// All that further steps depend on, for the same engine, frames and limits. Load goes on with the same bits; it throws
  /// Error for bytes that no Save wrote.
  void Save(StateWriter& to) const;
  void Load(StateReader& from);

  /// Passes over the frames up to now.
  int Passes() const { return passes_; }

private:
  /// Numbers of a step.
  static constexpr std::size_t kNumbers = 10;
  using Numbers = std::vector<float>;  // [Gaussians][kNumbers]

  struct State
  {
    std::vector<Eigen::Vector3d> means;
    std::vector<Eigen::Matrix3d> shapes;  // L
    std::vector<double> reflectivities;
  };

  /// What two steps tell of curvature.
  struct Pair
  {
    Numbers step, change;  // c, and the difference of gradients
    double product = 0;    // of both
  };

  double Evaluate(const Loss& loss);
  GaussianField FieldOf(const State& state) const;
  void SetEngine(const State& state);
  State Moved(const State& from, const Numbers& direction, double length) const;
  void TakeGradient(const FieldGradient& sum);
  void FindClamped();
  enum class Of
  {
    Step,
    Gradient
  };
  void ProjectClamped(Numbers& numbers, Of of) const;
  void MeasureMatrix(const Loss& loss);
  Numbers TimesInverse(const Numbers& gradient) const;
  Numbers Direction() const;
  void Limit(Numbers& direction) const;
  void Remember(const Numbers& step, const Numbers& before);

  Engine& engine_;
  const Sweep& images_;
  std::vector<int> frames_;
  ParameterLimits limits_;
  State state_;
  GaussianField field_;  // the same as the engine has it
  Numbers gradient_;
  double loss_ = 0;
  std::string lossName_;  // of the gradient
  double slope_ = 1;      // mean of (dI/dS)^2 over the frames' pixels
  std::vector<float> squares_,
      ridge_;                                 // [Gaussians] curvature of dr, and what is added to all
  std::vector<std::array<bool, 3>> clamped_;  // the field's axes that may not get shorter, or longer, and
                                              // would
  std::deque<Pair> pairs_;
  double scale_ = 0;  // of the first matrix; 0: not known
  int steps_ = 0, passes_ = 0;
};

}  // namespace bigus
