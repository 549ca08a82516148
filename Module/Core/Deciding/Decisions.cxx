// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Deciding/Decisions.h"

#include <algorithm>
#include <optional>

#include "Core/Deciding/DecisionRules.h"
#include "Core/Deciding/Format.h"
#include "Core/Deciding/Trials.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/Stopwatch.h"

namespace bigus
{
namespace
{

/// How well frames are predicted from their neighbours, for each path, with flow where it gains.
struct Prediction
{
  FrameInterpolation alongNormals, alongProbe;
  double pathGain = 0;   // dB by which the probe's path predicts better than the poses do
  std::string evidence;  // empty where nothing was predicted
  double seconds = 0;
};

/// What one decision hands to the next.
struct State
{
  const TrainerOptions& asked;
  Trials& trials;
  TrainingPlan& plan;  // with the best choices so far
  Prediction prediction;
};

Decision Made(const State& state, const char* what, const std::string& choice, std::string evidence, double seconds)
{
  if (state.trials.Stopped())
  {
    evidence += evidence.empty() ? "stopped before it was compared" : "; stopped there";
  }
  return {what, choice, evidence, seconds};
}

Decision Given(const char* what, const std::string& choice)
{
  return {what, choice, "given", 0};
}

/// What must be true of a gain for the candidate to be taken.
struct Rule
{
  double least = kLeastGain;  // dB
  bool clear = true;          // beyond chance, and on most frames; false where either choice will do
};

bool Passes(const Gain& gain, const Rule& rule)
{
  return gain.mean > rule.least && (!rule.clear || (gain.mean > kLeastStandardErrors * gain.error && gain.mostGain));
}

/// Tries a candidate against the plan, which becomes it when the gain passes. Adds what was found to `evidence`.
template <class Accept>
bool Try(State& state, const TrainingPlan& candidate, const std::string& label, std::string& evidence,
         const Accept& accept, double passes = kTrialPasses)
{
  const std::optional<Gain> gain = state.trials.Compare(candidate, state.plan, passes);
  if (!gain)
  {
    return false;
  }
  evidence += (evidence.empty() ? "" : "; ") + label + ": " + gain->ToString();
  if (!accept(*gain))
  {
    return false;
  }
  state.plan = candidate;
  return true;
}

/// With flow or without, for each path. Which path is left to DecidePath: one that follows the probe is scored here
/// where its own path leads, while slices are asked for at tracked poses.
Prediction PredictFrames(Trials& trials, bool keepContrast)
{
  const Stopwatch watch;
  Prediction prediction;
  const auto bestOf = [&](FrameInterpolation::Path path, FrameInterpolation& best)
  {
    best = {path, false, false};
    const FrameInterpolation moved{path, true, false};
    const double without = trials.Predict(best), with = trials.Predict(moved);
    prediction.evidence += (prediction.evidence.empty() ? "" : "; ") + best.ToString() + Format(" %.2f dB", without) +
                           ", with flow" + Format(" %.2f dB", with);
    best.flow = with > without + kLeastGain;
    best.keepContrast = keepContrast;
    return best.flow ? with : without;
  };
  const double normals = bestOf(FrameInterpolation::Path::Normals, prediction.alongNormals);
  const double probe = bestOf(FrameInterpolation::Path::Probe, prediction.alongProbe);
  prediction.pathGain = probe - normals;
  prediction.seconds = watch.Seconds();
  return prediction;
}

/// From what geometry suggests down to none where it suggests any, else up while it gains.
Decision DecideVirtualPlanes(State& state)
{
  if (state.asked.virtualPlanes)
  {
    return Given("virtual planes", std::to_string(*state.asked.virtualPlanes));
  }
  const Stopwatch watch;
  std::string evidence;
  const auto take = [&](int perGap, const Rule& rule)
  {
    TrainingPlan candidate = state.plan;
    candidate.virtualPlanes = perGap;
    return Try(state, candidate, std::to_string(perGap) + " instead of " + std::to_string(state.plan.virtualPlanes),
               evidence, [&rule](const Gain& gain) { return Passes(gain, rule); });
  };
  const int start = state.plan.virtualPlanes;
  // Without them training is faster, so none is taken where that is as good.
  if (start == 0 || !take(0, {-kLeastGain, false}))
  {
    for (int perGap = start + 1; perGap <= kMostVirtualPlanes && take(perGap, {}); ++perGap)
    {
    }
  }
  return Made(state, "virtual planes", std::to_string(state.plan.virtualPlanes), evidence, watch.Seconds());
}

/// A path that predicts frames worse is not tried.
Decision DecidePath(State& state)
{
  if (state.asked.interpolation)
  {
    return Given("interpolation", state.plan.interpolation.ToString());
  }
  const Stopwatch watch;
  std::string evidence = state.prediction.evidence;
  if (state.plan.virtualPlanes > 0 && state.prediction.pathGain > 0 && state.asked.preset != Preset::Texture)
  {
    TrainingPlan candidate = state.plan;
    candidate.interpolation = state.prediction.alongProbe;
    Try(state, candidate, "along the probe's path in a trial", evidence,
        [](const Gain& gain) { return Passes(gain, {}) || gain.mean - gain.error > -kPathMayLose; });
  }
  return Made(state, "interpolation", state.plan.interpolation.ToString(), evidence,
              state.prediction.seconds + watch.Seconds());
}

/// A beam twice as thick as geometry suggests helps where sweeps cross: planes seen from two sides tell how thick it
/// is. There is one such step, because validation frames widen the gaps of trials, and wider gaps ask for ever thicker
/// beams. Where tracked poses are off, frames contradict each other and only a blurred picture can be known. A beam
/// much thicker than the probe's gives such a picture, so there 4 and 8 times need only not lose.
Decision DecideBeam(State& state)
{
  const auto choice = [&state] { return Format("%.3g mm", state.plan.elevationSigma); };
  if (state.asked.elevationSigma)
  {
    return Given("elevation sigma", choice());
  }
  const Stopwatch watch;
  const double gain = state.prediction.pathGain;
  std::string evidence = state.prediction.evidence.empty() ? ""
                                                           : "the probe's path predicts frames" +
                                                                 Format(" %+.2f dB", gain) + " better than their poses";
  const double start = state.plan.elevationSigma;
  const auto take = [&](double sigma, const Rule& rule)
  {
    TrainingPlan candidate = state.plan;
    candidate.elevationSigma = sigma;
    return Try(state, candidate, Format("%.2f mm", sigma) + Format(" instead of %.2f", state.plan.elevationSigma),
               evidence, [&rule](const Gain& g) { return Passes(g, rule); });
  };
  const Rule notWorse{0, false};
  if (gain >= kPosesOff && take(4 * start, notWorse))
  {
    take(8 * start, notWorse);
  }
  else
  {
    take(2 * start, {});
  }
  return Made(state, "elevation sigma", choice(), evidence, watch.Seconds());
}

/// Doubles while it gains its price, else halves while that costs next to nothing.
Decision DecideGaussians(State& state)
{
  if (state.asked.gaussians)
  {
    return Given("Gaussians", std::to_string(*state.asked.gaussians));
  }
  const Stopwatch watch;
  std::string evidence;
  const double passes = !state.plan.sparse && state.trials.Share() <= kLongTrialShare ? kLongTrialPasses : kTrialPasses;
  const auto take = [&](std::size_t count, const Rule& rule)
  {
    TrainingPlan candidate = state.plan;
    candidate.gaussians = count;
    return Try(
        state, candidate, std::to_string(count) + " instead of " + std::to_string(state.plan.gaussians), evidence,
        [&rule](const Gain& gain) { return Passes(gain, rule); }, passes);
  };
  bool grew = false;
  while (2 * state.plan.gaussians <= state.asked.maximumGaussians &&
         take(2 * state.plan.gaussians, {state.asked.price, state.asked.price > 0}))
  {
    grew = true;
  }
  while (!grew && state.plan.gaussians >= kFewestToHalve && take(state.plan.gaussians / 2, {-kFewerMayLose, false}))
  {
  }
  return Made(state, "Gaussians", std::to_string(state.plan.gaussians),
              evidence + (evidence.empty() ? "" : "; ") + Format("price %.2f dB a doubling", state.asked.price),
              watch.Seconds());
}

}  // namespace

std::vector<Decision> Decide(const Sweep& sweep, const std::vector<int>& frames, const TrainerOptions& asked,
                             TrainingPlan& plan, const ProgressCallback& progress)
{
  if (frames.size() < kFewestFrames)
  {
    return {{"everything", "by geometry", std::to_string(frames.size()) + " frames are too few to compare on", 0}};
  }
  Trials trials(sweep, frames, asked, progress);
  State state{asked, trials, plan, {}};
  const bool interpolates = plan.virtualPlanes > 0 || !asked.virtualPlanes;
  const bool interpolationOpen = interpolates && !asked.interpolation;
  const bool beamOpen = !asked.elevationSigma && asked.preset != Preset::Texture;
  if ((interpolationOpen || beamOpen) && trials.Proceed())
  {
    state.prediction = PredictFrames(trials, asked.preset == Preset::Texture);
    if (interpolationOpen)
    {
      plan.interpolation = state.prediction.alongNormals;
    }
  }
  std::vector<Decision> decisions;
  if (asked.preset != Preset::Texture)
  {
    decisions.push_back(DecideVirtualPlanes(state));
    plan.iterations = IterationsByGeometry(asked, frames.size(), plan);
  }
  if (interpolates)
  {
    decisions.push_back(DecidePath(state));
  }
  if (asked.preset == Preset::Texture)
  {
    decisions.push_back({"the rest", "by geometry", "PSNR is best for smooth pictures, so it cannot judge texture", 0});
    return decisions;
  }
  decisions.push_back(DecideBeam(state));
  decisions.push_back(DecideGaussians(state));
  return decisions;
}

}  // namespace bigus
