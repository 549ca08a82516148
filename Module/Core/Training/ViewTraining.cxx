// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/ViewTraining.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <utility>

#include "Core/Engine/ViewEngine.h"
#include "Core/Formula/Adam.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Random.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Training/Batches.h"
#include "Core/Training/FieldAverage.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/Judging.h"
#include "Core/Training/Schedule.h"
#include "Core/Training/Targets.h"
#include "Core/Training/TrainingLoop.h"

namespace bigus
{
namespace
{

// ---- training with q

/// Steps: a quarter of the ordinary training's, between these; and never more than those.
constexpr int kFewestSteps = 500, kMostSteps = 1000;
constexpr double kStepsShare = 0.25;
/// Times as many where terms are there already, because what is shown without them has not been trained then.
constexpr int kStepsWithTerms = 2;
constexpr double kFirstRate = 0.5;  // of the ordinary training's first rates
constexpr double kTermRate = 0.5;   // of r's, for a direction as far from the usual one as is usual
constexpr double kLeastSpread = 0.05;
constexpr double kDropout = 0.3;  // share of planes on which q is off
constexpr int kLooks = 10;        // how often what is usual at the Gaussians' places is found again

/// Adam on q, as Formula/Adam.h has it.
class TermSteps
{
public:
  explicit TermSteps(std::vector<Eigen::Vector3d> first) : terms_(std::move(first)), states_(terms_.size()) {}

  const std::vector<Eigen::Vector3d>& Terms() const { return terms_; }

  void Step(std::size_t i, const Eigen::Vector3d& gradient, const Eigen::Vector3d& rates)
  {
    if (!gradient.allFinite())
    {
      return;
    }
    State& state = states_[i];
    state.updates += 1;
    const double share = std::clamp(kYoungUpdates / state.updates, kFirstShare, kYoungShare);
    state.first += share * (gradient - state.first);
    state.second += kSecondShare * (gradient.cwiseAbs2() - state.second);
    const double correction =
        std::sqrt(1 - std::exp(kLogSecondDecay * state.updates)) / (1 - std::exp(kLogYoungDecay * state.updates));
    terms_[i] -=
        correction * rates.cwiseProduct(Eigen::Vector3d(state.first.array() / (state.second.array().sqrt() + 1e-18)));
  }

private:
  struct State
  {
    Eigen::Vector3d first = Eigen::Vector3d::Zero(), second = Eigen::Vector3d::Zero();
    double updates = 0;
  };
  std::vector<Eigen::Vector3d> terms_;
  std::vector<State> states_;
};

/// One training with q, which is off on this share of planes.
class ViewLoop
{
public:
  ViewLoop(Engine& engine, const ViewTargets& targets, const TrainingPlan& plan, const GaussianField& field,
           const ViewDependence& first, int steps, double dropout)
      : engine_(engine),
        walker_(*ViewEngine::Of(engine)),
        targets_(targets),
        plan_(plan),
        views_(first.views),
        steps_(steps),
        dropout_(dropout),
        batches_(targets.frames, plan.batch, plan.seed),
        random_(Mix(plan.seed)),
        terms_(first.terms.empty() ? std::vector<Eigen::Vector3d>(field.Size(), Eigen::Vector3d::Zero()) : first.terms)
  {
    engine.SetFrames(targets.images);
    engine.SetField(field);
    engine.SetAccuracy({plan.tolerance, true});
    rates_ = Scaled(FirstRates(plan, field), kFirstRate);
    usual_ = views_.UsualAt(field.means);
  }

  /// Null when `goOn` says stop.
  std::optional<ViewedField> Run(const std::function<bool()>& goOn)
  {
    while (step_ < steps_)
    {
      if (!goOn())
      {
        return std::nullopt;
      }
      Step();
    }
    if (average_.count == 0)
    {
      Average();
    }
    return ViewedField{std::move(average_.mean), {views_, std::move(meanTerms_)}};
  }

private:
  void Step()
  {
    const double fraction = static_cast<double>(step_) / steps_;
    if (step_ > 0 && step_ % std::max(1, steps_ / kLooks) == 0)
    {
      usual_ = views_.UsualAt(engine_.GetField().means);  // which have moved
    }
    const std::vector<int> batch = batches_.Next();
    passes_ += static_cast<double>(batch.size()) / static_cast<double>(targets_.frames.size());
    const LearningRates rates =
        Scaled(rates_, RateLeft(plan_, targets_.frames.size(), {step_, fraction, passes_, false}));
    const std::vector<Eigen::Vector3d> directions = Directions(batch);
    const std::vector<float> values = Reflectivities(directions);
    std::vector<float> derivatives;
    walker_.Backpropagate(batch, plan_.loss, values, derivatives);
    engine_.Step(rates, targets_.limits);
    StepTerms(directions, derivatives, rates.reflectivity);
    ++step_;
    if (IsLastPart(fraction) && IsAveraged(step_, steps_))
    {
      Average();
    }
  }

  /// delta of each of the batch's planes; not finite where q is off.
  std::vector<Eigen::Vector3d> Directions(const std::vector<int>& batch)
  {
    std::vector<Eigen::Vector3d> directions;
    for (const int frame : batch)
    {
      const bool isOff = random_.Uniform() < dropout_;
      directions.push_back(isOff ? Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity())
                                 : views_.Direction(targets_.images->Plane(frame)));
    }
    return directions;
  }

  std::vector<float> Reflectivities(const std::vector<Eigen::Vector3d>& directions) const
  {
    const std::vector<double> own = walker_.Reflectivities();
    std::vector<float> values(directions.size() * own.size());
    tbb::parallel_for(std::size_t(0), own.size(),
                      [&](std::size_t i)
                      {
                        for (std::size_t f = 0; f < directions.size(); ++f)
                        {
                          const bool isOn = std::isfinite(directions[f][0]);
                          values[f * own.size() + i] = static_cast<float>(
                              own[i] + (isOn ? terms_.Terms()[i].dot(directions[f] - usual_.directions[i]) : 0.0));
                        }
                      });
    return values;
  }

  /// dL/dq_i = sum over planes with q of m0 (delta - c_i).
  void StepTerms(const std::vector<Eigen::Vector3d>& directions, const std::vector<float>& derivatives, double rate)
  {
    const Eigen::Vector3d rates = kTermRate * rate * usual_.spread.cwiseMax(kLeastSpread).cwiseInverse();
    const std::size_t n = usual_.directions.size();
    tbb::parallel_for(std::size_t(0), n,
                      [&](std::size_t i)
                      {
                        Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
                        bool isSeen = false;
                        for (std::size_t f = 0; f < directions.size(); ++f)
                        {
                          const float derivative = derivatives[f * n + i];
                          if (derivative != 0 && std::isfinite(directions[f][0]))
                          {
                            gradient += derivative * (directions[f] - usual_.directions[i]);
                            isSeen = true;
                          }
                        }
                        if (isSeen)
                        {
                          terms_.Step(i, gradient, rates);
                        }
                      });
  }

  void Average()
  {
    average_.Add(engine_.GetField());
    const std::vector<Eigen::Vector3d>& terms = terms_.Terms();
    meanTerms_.resize(terms.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < terms.size(); ++i)
    {
      meanTerms_[i] += (terms[i] - meanTerms_[i]) / average_.count;
    }
  }

  Engine& engine_;
  ViewEngine& walker_;
  const ViewTargets& targets_;
  const TrainingPlan& plan_;
  const RecordedViews& views_;
  int steps_, step_ = 0;
  double dropout_;
  double passes_ = 0;
  LearningRates rates_;
  Batches batches_;
  RandomNumbers random_;
  RecordedViews::Usual usual_;
  TermSteps terms_;
  FieldAverage average_;
  std::vector<Eigen::Vector3d> meanTerms_;
};

// ---- whether: short trainings with q and without

constexpr std::size_t kFewestFrames = 12;
constexpr std::size_t kManyFrames = 60;
constexpr std::size_t kJudged = 3;  // every so many frames
/// Radian: below it directions are the tracker's last digits.
constexpr double kLeastUnit = 1e-3;
/// Pixels of all frames; larger sweeps are judged at half the size.
constexpr std::size_t kMostPixels = std::size_t(1) << 23;

/// Short trainings have this share of the plan's Gaussians, take so many passes without q and as many again with it, and
/// twice as many where that is not clear. A full one takes 60 to 80.
constexpr double kShortShare = 0.5;
constexpr double kShortPasses = 5;
constexpr int kFewestShortSteps = 40;

/// The plan of a short training on these frames.
TrainingPlan ShortPlan(TrainingPlan plan, const Sweep& sweep, const std::vector<int>& frames, double passes)
{
  plan.gaussians =
      std::max<std::size_t>(1, static_cast<std::size_t>(kShortShare * static_cast<double>(plan.gaussians)));
  plan.virtualPlanes = 0;
  plan.iterations =
      std::min(plan.iterations, std::max(kFewestShortSteps, StepsForPasses(passes, frames.size(), 0, plan.batch)));
  plan.timeLimit = 0;
  plan.densification.interval = 0;
  ScaleToPixels(MeasureGeometry(sweep, frames).pixelSize, plan);
  return plan;
}

/// PSNR of each of the frames.
std::vector<double> Psnrs(Engine& engine, const Sweep& sweep, const std::vector<int>& frames, const ViewedField& viewed)
{
  SeenField seen(engine, viewed.field, &viewed.view);
  std::vector<double> psnrs;
  for (const int frame : frames)
  {
    seen.LookFrom(sweep.Plane(frame));
    psnrs.push_back(MeanPsnr(engine, sweep, {frame}));
  }
  return psnrs;
}

/// The field of a short training on two thirds of the frames is trained on, with q and without: dB that the former gains on
/// each of the others. Null when `goOn` says stop.
std::optional<std::vector<double>> Gains(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& frames,
                                         std::size_t third, double passes, const TrainingPlan& given,
                                         const std::function<bool()>& goOn)
{
  std::vector<int> trained, judged;
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    (k % kJudged == (kJudged / 2 + third) % kJudged ? judged : trained).push_back(frames[k]);
  }
  const TrainingPlan plan = ShortPlan(given, *sweep, trained, passes);
  TrainingLoop loop(sweep, trained, plan, [&goOn](const TrainingProgress&) { return goOn(); });
  loop.Begin(loop.SeedStart());
  const Fitted begun = loop.Run({});
  if (begun.aborted || begun.field.Size() == 0)
  {
    return std::nullopt;
  }
  const Targets& targets = loop.targets();
  const ViewTargets of = {WithCountedPixels(targets.Images(), plan.ignoreMasked), targets.Frames(), targets.Limits()};
  const ViewDependence first{RecordedViews::Of(*sweep, trained), {}};
  const std::unique_ptr<Engine> engine = Engine::Create("cpu");
  const auto trainOn = [&](double dropout)
  { return ViewLoop(*engine, of, plan, begun.field, first, plan.iterations, dropout).Run(goOn); };
  const std::optional<ViewedField> with = trainOn(kDropout);
  const std::optional<ViewedField> without = with ? trainOn(1) : std::nullopt;
  if (!without)
  {
    return std::nullopt;
  }
  std::vector<double> gains = Psnrs(*engine, *sweep, judged, *with);
  const std::vector<double> before = Psnrs(*engine, *sweep, judged, *without);
  std::transform(gains.begin(), gains.end(), before.begin(), gains.begin(), std::minus<>());
  return gains;
}

}  // namespace

ViewEvidence ViewEvidence::Of(std::vector<double> gains)
{
  const double gain = Mean(gains);
  const double error = std::sqrt(MeanSquare(gains, gain) / static_cast<double>(gains.size() - 1));
  return {std::move(gains), gain, error};
}

std::optional<ViewEvidence> AskForViews(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& frames,
                                        const TrainingPlan& plan, const std::function<bool()>& goOn)
{
  if (frames.size() < kFewestFrames || !(RecordedViews::Of(*sweep, frames).unit >= kLeastUnit))
  {
    return std::nullopt;
  }
  const bool isLarge =
      frames.size() * sweep->PixelsPerFrame() > kMostPixels && std::min(sweep->width, sweep->height) > 1;
  const std::shared_ptr<const Sweep> asked = isLarge ? std::make_shared<const Sweep>(sweep->Reduced(2)) : sweep;
  std::vector<double> gains;
  // A third of few frames is too few to judge by. So where it is not clear each third is judged by the others, and of many
  // frames the same again after a longer training.
  const bool areMany = frames.size() >= kManyFrames;
  ViewEvidence evidence;
  for (std::size_t k = 0; k < (areMany ? 2 : kJudged) && (k == 0 || !evidence.IsClear()); ++k)
  {
    const bool isShortest = areMany && k == 0;
    const std::optional<std::vector<double>> some =
        Gains(asked, frames, areMany ? 0 : k, isShortest ? kShortPasses : 2 * kShortPasses, plan, goOn);
    if (!some)
    {
      return std::nullopt;
    }
    gains.resize(areMany ? 0 : gains.size());
    gains.insert(gains.end(), some->begin(), some->end());
    evidence = ViewEvidence::Of(gains);
  }
  return evidence;
}

std::optional<ViewedField> TrainViews(Engine& engine, const ViewTargets& targets, const TrainingPlan& plan,
                                      const GaussianField& field, const ViewDependence& first,
                                      const std::function<bool()>& goOn)
{
  int steps = std::clamp(static_cast<int>(kStepsShare * plan.iterations), kFewestSteps, kMostSteps);
  steps *= first.terms.empty() ? 1 : kStepsWithTerms;
  return ViewLoop(engine, targets, plan, field, first, std::min(plan.iterations, steps), kDropout).Run(goOn);
}

}  // namespace bigus
