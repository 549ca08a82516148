// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Deciding/Decisions.h"

#include <array>
#include <limits>
#include <optional>

#include "Core/Deciding/DecisionRules.h"
#include "Core/Deciding/Trials.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Format.h"
#include "Core/Probe/ElevationEstimate.h"
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

/// Whether something costly or unusual is taken: a gain beyond chance, on most frames, and nothing lost across them.
bool Passes(const Gain& gain)
{
  return gain.mean > kLeastGain && gain.across > -kAcrossMayLose && gain.mean > kLeastStandardErrors * gain.error &&
         gain.mostGain;
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

/// How fast frames change and whether flow helps, for each path. Which path is left to DecidePath, because one that
/// follows the probe is scored here where its own path leads, while slices are asked for at tracked poses. Flow takes
/// longest, so it comes last; where there is no time, what was found before counts.
Prediction PredictFrames(Trials& trials, bool keepContrast)
{
  using Decay = FrameInterpolation::Decay;
  using Path = FrameInterpolation::Path;
  const Stopwatch watch;
  Prediction prediction;
  struct Best
  {
    FrameInterpolation* how;
    Path path;
    double psnr;
  };
  std::array<Best, 2> bests{Best{&prediction.alongNormals, Path::Normals, 0},
                            Best{&prediction.alongProbe, Path::Probe, 0}};
  const auto take = [&](Best& best, const FrameInterpolation& candidate, double least)
  {
    const std::optional<double> psnr = trials.Predict(candidate);
    if (!psnr)
    {
      return false;
    }
    prediction.evidence += (prediction.evidence.empty() ? "" : ", ") + candidate.ToString() + Format(" %.2f dB", *psnr);
    if (*psnr > best.psnr + least)
    {
      *best.how = candidate;
      best.psnr = *psnr;
    }
    return true;
  };
  bool goesOn = true;
  for (Best& best : bests)
  {
    best.how->path = best.path;
    for (const Decay decay : {FrameInterpolation{}.decay, Decay::Rough, Decay::Smooth})
    {
      goesOn = goesOn && take(best, {best.path, false, decay}, 0);
    }
  }
  // A path that was not looked at is not known to be better.
  prediction.pathGain = bests[1].psnr > 0 ? bests[1].psnr - bests[0].psnr : 0;
  for (Best& best : bests)
  {
    goesOn = goesOn && take(best, {best.path, true, best.how->decay}, kLeastGain);
  }
  if (goesOn)
  {
    prediction.pathGain = bests[1].psnr - bests[0].psnr;
  }
  prediction.alongNormals.keepContrast = prediction.alongProbe.keepContrast = keepContrast;
  prediction.seconds = watch.Seconds();
  return prediction;
}

/// A path that predicts frames worse is not tried. Planes across have no say: what is held against them there is
/// interpolation along the normals, which is the other path.
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
        [](const Gain& gain) { return gain.mean + gain.error > -kPathMayLose; });
  }
  return Made(state, "interpolation", state.plan.interpolation.ToString(), evidence,
              state.prediction.seconds + watch.Seconds());
}

/// The probe's beam is physics. It is given, measured by how fast speckle changes, or not known.
Decision DecideProbeBeam(State& state, const Sweep& sweep, const std::vector<int>& frames)
{
  const auto choice = [&state]
  { return state.plan.probeElevationSigma > 0 ? Format("%.3g mm", state.plan.probeElevationSigma) : "not known"; };
  if (state.asked.probeElevationSigma)
  {
    return Given("probe's beam", choice());
  }
  const Stopwatch watch;
  std::string evidence;
  if (IsVolume(sweep, frames))
  {
    evidence = "frames lie exactly above one another, as the slices of a volume, which no probe made";
  }
  else
  {
    const ElevationEstimate estimate = EstimateElevationSigma(sweep, frames);
    evidence = estimate.reliable ? "speckle changes as for" + Format(" %.2f", estimate.sigma) +
                                       Format(" +- %.2f mm", estimate.standardError)
                                 : estimate.reason;
    if (estimate.reliable)
    {
      state.plan.probeElevationSigma = estimate.sigma;
    }
  }
  return Made(state, "probe's beam", choice(), evidence, watch.Seconds());
}

/// The beam that the field is trained under. Frames that lie side by side cannot tell it, because what is blurred across
/// them fits them as well, so there it is thin. Where sweeps cross, each shows what the other's beam has blurred. There
/// it is the probe's or, if that is not known, the one that predicts frames best.
Decision DecideBeam(State& state, const Sweep& sweep, const std::vector<int>& frames, const std::vector<int>& tried)
{
  const auto choice = [&state] { return Format("%.3g mm", state.plan.elevationSigma); };
  if (state.asked.elevationSigma)
  {
    return Given("elevation sigma", choice());
  }
  if (!FramesCross(sweep, frames))
  {
    return Made(state, "elevation sigma", choice(), "frames do not cross", 0);
  }
  const Stopwatch watch;
  std::string evidence = "frames cross";
  if (state.plan.probeElevationSigma > 0)
  {
    state.plan.elevationSigma = state.plan.probeElevationSigma;
    evidence += ", so it is the probe's";
    return Made(state, "elevation sigma", choice(), evidence, watch.Seconds());
  }
  if (tried.size() < frames.size() && !FramesCross(sweep, tried))
  {
    evidence += ", but not those of one sequence, on which a trial is";
    return Made(state, "elevation sigma", choice(), evidence, watch.Seconds());
  }
  for (const double sigma : kCrossingBeams)
  {
    TrainingPlan candidate = state.plan;
    candidate.elevationSigma = sigma;
    const std::string label = Format("%.2f mm", sigma) + Format(" instead of %.2f", state.plan.elevationSigma);
    if (!Try(state, candidate, label, evidence, [](const Gain& gain) { return Passes(gain); }))
    {
      break;
    }
  }
  return Made(state, "elevation sigma", choice(), evidence, watch.Seconds());
}

/// Doubles while that gains its price at a plane at random, else halves while that loses next to nothing there. Amid gaps,
/// where a field that is too large errs, little may be lost either way, or less than is gained at random. A doubling gains
/// about half of what the one before gained, and its trial takes as long as all before, so one that would miss its price
/// by that is not tried.
Decision DecideGaussians(State& state)
{
  if (state.asked.gaussians)
  {
    return Given("Gaussians", std::to_string(*state.asked.gaussians));
  }
  const Stopwatch watch;
  std::string evidence;
  const double passes = state.plan.sparse ? kTrialPasses : kLongTrialPasses;
  double expected = std::numeric_limits<double>::infinity();  // dB that the next doubling gains
  const auto take = [&](std::size_t count, double least, double little)
  {
    TrainingPlan candidate = state.plan;
    candidate.gaussians = count;
    return Try(
        state, candidate, std::to_string(count) + " instead of " + std::to_string(state.plan.gaussians), evidence,
        [&](const Gain& gain)
        {
          expected = kOfGainBefore * gain.anywhere;
          return gain.anywhere > least && gain.mean > -std::max(little, gain.anywhere);
        },
        passes);
  };
  bool grew = false;
  while (2 * state.plan.gaussians <= state.plan.maximumGaussians && expected > state.asked.price &&
         take(2 * state.plan.gaussians, state.asked.price, kMoreMayLose))
  {
    grew = true;
  }
  while (!grew && state.plan.gaussians >= kFewestToHalve &&
         take(state.plan.gaussians / 2, -kFewerMayLose, kFewerMayLose))
  {
  }
  return Made(state, "Gaussians", std::to_string(state.plan.gaussians),
              evidence + (evidence.empty() ? "" : "; ") + Format("price %.2f dB a doubling", state.asked.price),
              watch.Seconds());
}

}  // namespace

std::vector<Decision> Decide(const Sweep& sweep, const std::vector<int>& frames, const TrainerOptions& asked,
                             TrainingPlan& plan, const ProgressCallback& progress, TrialKeeper& keeper,
                             Exchange& exchange)
{
  // Trials and speckle rest on the order of frames, so they look at one sequence.
  const std::vector<int> longest = LongestSequence(sweep, frames);
  if (longest.size() < kFewestFrames)
  {
    return {{"everything", "by geometry", std::to_string(longest.size()) + " frames are too few to compare on", 0}};
  }
  Trials trials(sweep, longest, frames.size(), asked, progress, keeper, exchange);
  State state{asked, trials, plan, {}};
  const bool isTexture = asked.preset == Preset::Texture;
  std::vector<Decision> decisions;
  if (plan.virtualPlanes > 0)
  {
    if (!asked.interpolation && trials.Proceed())
    {
      state.prediction = PredictFrames(trials, isTexture);
      plan.interpolation = state.prediction.alongNormals;
    }
    decisions.push_back(DecidePath(state));
  }
  if (trials.Proceed())
  {
    decisions.push_back(DecideProbeBeam(state, sweep, longest));
  }
  if (isTexture)
  {
    decisions.push_back({"the rest", "by geometry", "PSNR is best for smooth pictures, so it cannot judge texture", 0});
    return decisions;
  }
  decisions.push_back(DecideBeam(state, sweep, frames, longest));
  decisions.push_back(DecideGaussians(state));
  return decisions;
}

PoseCorrection DecidePoses(const Sequence& sequence, PoseCorrection undecided, const TrainerOptions& asked,
                           const ProgressCallback& progress, TrialKeeper& keeper, Exchange& exchange)
{
  const Stopwatch watch;
  const double strength = undecided.steps.at(0).to;
  PoseCorrection smoothed =
      CorrectPoses(sequence.sweep, sequence.frames, {strength}, [&](double) { return progress({}); });
  if (smoothed.aborted)
  {
    return undecided;
  }
  const auto trialsAt = [&](const PoseCorrection& poses)
  {
    return Trials(AtCorrectedPoses(sequence.sweep, poses), sequence.frames, sequence.frames.size(), asked, progress,
                  keeper, exchange,
                  std::to_string(sequence.first) + Format(", poses smoothed by %g, ", poses.strength));
  };
  Trials best = trialsAt(undecided), candidate = trialsAt(smoothed);
  const TrainingPlan plan = PlanByGeometry(asked, sequence.sweep, sequence.frames);
  if (const std::optional<Gain> gain = candidate.ComparePoses(best, plan, kTrialPasses))
  {
    undecided.decision.evidence += Format("; in a trial strength %g gains", strength) + Format(" %+.2f", gain->mean) +
                                   Format(" +- %.2f dB", gain->error);
    if (Passes(*gain))
    {
      smoothed.steps = undecided.steps;
      smoothed.decision.evidence = undecided.decision.evidence;
      undecided = std::move(smoothed);
    }
  }
  undecided.decision.seconds += watch.Seconds();
  return undecided;
}

}  // namespace bigus
