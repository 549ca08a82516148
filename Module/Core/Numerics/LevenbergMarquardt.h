// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The Levenberg-Marquardt method for a sum of squares or what behaves like one.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <utility>

namespace bigus
{

struct LevenbergMarquardtOptions
{
  int iterations = 60;  ///< linearisations at most
  int attempts = 5;     ///< steps tried from one linearisation, each shorter than the one before
  double ridge = 0;     ///< share of the mean diagonal added to D, so that a direction nothing depends on stays
};

/// Lowers the cost of `q`, whose evaluation is `state`, by steps that solve (H + lambda D) step = -gradient, with
/// D = diag H + ridge mean(diag H). lambda starts at 1e-3, falls tenfold (to 1e-6 at least) when a step lowers the cost
/// and grows tenfold when it does not. Returns the number of linearisations. `problem` offers, q being an Eigen vector:
///   State Evaluate(q)                      with a member `cost`
///   std::pair<Matrix, Vector> Linearise(q, state)   half the Hessian and half the gradient of the cost
///   Vector Bounded(q)                      the nearest point that is allowed
///   bool IsConverged(from, to, costFrom, costTo)    whether a step is as good as none
template <class Problem, class Vector, class State>
int MinimiseByLevenbergMarquardt(const Problem& problem, const LevenbergMarquardtOptions& options, Vector& q,
                                 State& state)
{
  double damping = 1e-3;
  int iterations = 0;
  bool moving = true;
  while (moving && iterations < options.iterations)
  {
    ++iterations;
    const auto [hessian, gradient] = problem.Linearise(q, state);
    const double mean = hessian.diagonal().mean();
    moving = false;
    for (int attempt = 0; attempt < options.attempts && mean > 0; ++attempt)
    {
      auto damped = hessian;
      damped.diagonal() += damping * (hessian.diagonal() + Vector::Constant(options.ridge * mean));
      const Vector trial = problem.Bounded(q - damped.ldlt().solve(gradient));
      if (!((trial - q).norm() > 0))
      {
        break;
      }
      State there = problem.Evaluate(trial);
      const bool converged = problem.IsConverged(q, trial, state.cost, there.cost);
      if (there.cost < state.cost)
      {
        q = trial;
        state = std::move(there);
        damping = std::max(damping / 10, 1e-6);
        moving = !converged;
        break;
      }
      if (converged)
      {
        break;  // no better place within reach
      }
      damping *= 10;
    }
  }
  return iterations;
}

}  // namespace bigus
