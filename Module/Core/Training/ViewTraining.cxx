// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/ViewTraining.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
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
#include "Core/Training/Schedule.h"
#include "Core/Training/TrainingLoop.h"

namespace bigus
{
namespace
{

// ---- whether: a refit of r, and of r with q, to a coarse field

constexpr std::size_t kFewestFrames = 12;
constexpr std::size_t kManyFrames = 60;
constexpr std::size_t kJudged = 3;    // every so many frames
constexpr std::size_t kTogether = 8;  // frames walked over at once
constexpr int kConjugateGradients = 8;
/// In units of what the mean Gaussian's own pixels weigh, so that nothing is refitted by what few pixels say.
constexpr double kRidge = 1;
/// Radian: below it directions are the tracker's last digits.
constexpr double kLeastUnit = 1e-3;
/// Pixels of weights kept, of all frames; larger sweeps are judged at half the size.
constexpr std::size_t kMostPixels = std::size_t(1) << 26;

/// The coarse field has this share of the plan's Gaussians. So each is seen by several frames, and none is fitted to one
/// frame alone, of which a refit could tell nothing.
constexpr double kCoarse = 0.25;
/// Its training: a full one takes 60 to 80 passes.
constexpr double kCoarsePasses = 10;
constexpr int kFewestCoarseSteps = 40;

using Numbers = std::vector<double>;

double Dot(const Numbers& a, const Numbers& b)
{
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    sum += a[i] * b[i];
  }
  return sum;
}

/// The linear problem J x = T - I(r) of a field's shapes, where x changes r_i by x_i, and q_i by the three numbers after
/// those of all r. J = dI/dS w with dI/dS = gamma (1 - I).
class Refit
{
public:
  Refit(Engine& engine, std::shared_ptr<const Sweep> sweep, const GaussianField& field, const RecordedViews& views)
      : walker_(*ViewEngine::Of(engine)),
        sweep_(std::move(sweep)),
        gamma_(field.transfer.gamma),
        own_(field.reflectivities),
        usual_(views.UsualAt(field.means).directions)
  {
    for (int frame = 0; frame < sweep_->NumberOfFrames(); ++frame)
    {
      directions_.push_back(views.Direction(sweep_->Plane(frame)));
    }
    engine.SetFrames(sweep_);
    engine.SetField(field);
  }

  /// J^T (T - I), and notes dI/dS of these frames. `x` gets as many numbers.
  Numbers Residual(const std::vector<int>& frames)
  {
    weights_.assign(frames.size() * sweep_->PixelsPerFrame(), 0.0f);
    return Sum(
        frames, own_, [this](const Numbers& own, std::size_t, std::size_t i) { return own[i]; }, true,
        [&](std::size_t k, std::size_t pixel, float s)
        {
          const double intensity = 1 - std::exp(-gamma_ * std::max(s, 0.0f));
          const float weight = s > 0 && sweep_->IsLit(pixel) ? static_cast<float>(gamma_ * (1 - intensity)) : 0.0f;
          weights_[k * sweep_->PixelsPerFrame() + pixel] = weight;
          return weight * static_cast<float>(Truth(frames[k], pixel) - intensity);
        });
  }

  /// J^T J x of the frames that Residual saw.
  Numbers Normal(const std::vector<int>& frames, const Numbers& x) const
  {
    return Sum(
        frames, x, [this](const Numbers& v, std::size_t frame, std::size_t i) { return Change(v, frame, i); },
        x.size() > own_.size(),
        [this](std::size_t k, std::size_t pixel, float s)
        {
          const float weight = weights_[k * sweep_->PixelsPerFrame() + pixel];
          return weight * weight * s;
        });
  }

  /// PSNR over lit pixels of each of the frames at r and q changed by x.
  Numbers Judge(const std::vector<int>& frames, const Numbers& x) const
  {
    Numbers psnrs;
    std::vector<float> values;
    for (const int frame : frames)
    {
      values.resize(own_.size());
      for (std::size_t i = 0; i < own_.size(); ++i)
      {
        values[i] = static_cast<float>(own_[i] + Change(x, frame, i));
      }
      Numbers squares(sweep_->height, 0.0), lit(sweep_->height, 0.0);
      walker_.Walk(
          {frame}, values,
          [&](std::size_t, int row, float* line)
          {
            for (int column = 0; column < sweep_->width; ++column)
            {
              const std::size_t pixel = static_cast<std::size_t>(row) * sweep_->width + column;
              const double intensity = 1 - std::exp(-gamma_ * std::max(line[column], 0.0f));
              const double off = sweep_->IsLit(pixel) ? Truth(frame, pixel) - intensity : 0;
              squares[row] += off * off;
              lit[row] += sweep_->IsLit(pixel);
            }
          },
          nullptr);
      psnrs.push_back(-10 * std::log10(std::max(SumInOrder(squares) / SumInOrder(lit), 1e-12)));
    }
    return psnrs;
  }

private:
  double Truth(int frame, std::size_t pixel) const
  {
    const std::size_t at = frame * sweep_->PixelsPerFrame() + pixel;
    return sweep_->pixelType == Sweep::PixelType::UInt8
               ? static_cast<const std::uint8_t*>(sweep_->pixels.get())[at] / 255.0
               : static_cast<const float*>(sweep_->pixels.get())[at];
  }

  /// By how much x changes r_i(P) of a frame.
  double Change(const Numbers& x, std::size_t frame, std::size_t i) const
  {
    const std::size_t n = own_.size();
    const Eigen::Vector3d away = directions_[frame] - usual_[i];
    return x[i] + (x.size() > n ? Eigen::Map<const Eigen::Vector3d>(&x[n + 3 * i]).dot(away) : 0.0);
  }

  /// Over the frames, with S of valueOf(x, frame, i): the sums of changed(frame's place, pixel, S) over footprints, by r,
  /// and `withTerms` by q.
  template <class ValueOf, class Changed>
  Numbers Sum(const std::vector<int>& frames, const Numbers& x, ValueOf&& valueOf, bool withTerms,
              Changed&& changed) const
  {
    const std::size_t n = own_.size();
    Numbers out(withTerms ? 4 * n : n, 0.0);
    std::vector<float> values, sums;
    for (std::size_t first = 0; first < frames.size(); first += kTogether)
    {
      const std::vector<int> some(
          frames.begin() + static_cast<std::ptrdiff_t>(first),
          frames.begin() + static_cast<std::ptrdiff_t>(std::min(first + kTogether, frames.size())));
      values.resize(some.size() * n);
      tbb::parallel_for(std::size_t(0), n,
                        [&](std::size_t i)
                        {
                          for (std::size_t f = 0; f < some.size(); ++f)
                          {
                            values[f * n + i] = static_cast<float>(valueOf(x, some[f], i));
                          }
                        });
      walker_.Walk(
          some, values,
          [&](std::size_t f, int row, float* line)
          {
            for (int column = 0; column < sweep_->width; ++column)
            {
              line[column] = changed(first + f, static_cast<std::size_t>(row) * sweep_->width + column, line[column]);
            }
          },
          &sums);
      tbb::parallel_for(std::size_t(0), n,
                        [&](std::size_t i)
                        {
                          for (std::size_t f = 0; f < some.size(); ++f)
                          {
                            out[i] += sums[f * n + i];
                            if (withTerms)
                            {
                              Eigen::Map<Eigen::Vector3d>(&out[n + 3 * i]) +=
                                  sums[f * n + i] * (directions_[some[f]] - usual_[i]);
                            }
                          }
                        });
    }
    return out;
  }

  ViewEngine& walker_;
  std::shared_ptr<const Sweep> sweep_;
  double gamma_;
  Numbers own_;
  std::vector<Eigen::Vector3d> usual_, directions_;
  std::vector<float> weights_;  // dI/dS, [frames of Residual][pixels]
};

/// (J^T J + ridge) x = b by conjugate gradients. Null when `goOn` says stop.
std::optional<Numbers> Solve(const Refit& refit, const std::vector<int>& frames, const Numbers& b, double ridge,
                             const std::function<bool()>& goOn)
{
  Numbers x(b.size(), 0.0), residual = b, direction = b;
  double square = Dot(residual, residual);
  for (int k = 0; k < kConjugateGradients && square > 0; ++k)
  {
    if (!goOn())
    {
      return std::nullopt;
    }
    Numbers image = refit.Normal(frames, direction);
    for (std::size_t i = 0; i < image.size(); ++i)
    {
      image[i] += ridge * direction[i];
    }
    const double step = square / Dot(direction, image);
    for (std::size_t i = 0; i < x.size(); ++i)
    {
      x[i] += step * direction[i];
      residual[i] -= step * image[i];
    }
    const double next = Dot(residual, residual);
    for (std::size_t i = 0; i < x.size(); ++i)
    {
      direction[i] = residual[i] + next / square * direction[i];
    }
    square = next;
  }
  return x;
}

/// What a short training makes of these frames alone. Null when `goOn` says stop.
std::optional<GaussianField> CoarseField(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& frames,
                                         TrainingPlan plan, const std::function<bool()>& goOn)
{
  plan.gaussians = std::max<std::size_t>(1, static_cast<std::size_t>(kCoarse * static_cast<double>(plan.gaussians)));
  plan.virtualPlanes = 0;
  plan.iterations = std::min(plan.iterations,
                             std::max(kFewestCoarseSteps, StepsForPasses(kCoarsePasses, frames.size(), 0, plan.batch)));
  plan.timeLimit = 0;
  plan.densification.interval = 0;
  ScaleToPixels(MeasureGeometry(*sweep, frames).pixelSize, plan);
  TrainingLoop loop(sweep, frames, plan, [&goOn](const TrainingProgress&) { return goOn(); });
  loop.Begin(loop.SeedStart());
  const Fitted fitted = loop.Run({});
  return fitted.aborted || fitted.field.Size() == 0 ? std::nullopt : std::optional<GaussianField>(fitted.field);
}

/// dB that r and q, refitted to frames, gain over r alone on each of other frames. Null when `goOn` says stop.
std::optional<Numbers> Gains(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& fitted,
                             const std::vector<int>& judged, const GaussianField& field, const TrainingPlan& plan,
                             const std::function<bool()>& goOn)
{
  const std::unique_ptr<Engine> engine = Engine::Create("cpu");
  engine->SetAccuracy({plan.tolerance, true});
  Refit refit(*engine, sweep, field, RecordedViews::Of(*sweep, fitted));
  const Numbers both = refit.Residual(fitted);
  const Numbers alone(both.begin(), both.begin() + static_cast<std::ptrdiff_t>(field.Size()));
  // The mean of the diagonal: z^T A z over the numbers of z, where each is 1 or -1 by chance.
  RandomNumbers random(Mix(plan.seed));
  Numbers signs(field.Size());
  for (double& sign : signs)
  {
    sign = random.Bits() >> 63 ? 1 : -1;
  }
  const double ridge = kRidge * Dot(signs, refit.Normal(fitted, signs)) / static_cast<double>(field.Size());
  const std::optional<Numbers> without = Solve(refit, fitted, alone, ridge, goOn);
  const std::optional<Numbers> with = without ? Solve(refit, fitted, both, ridge, goOn) : std::nullopt;
  if (!with)
  {
    return std::nullopt;
  }
  Numbers gains = refit.Judge(judged, *with);
  const Numbers before = refit.Judge(judged, *without);
  for (std::size_t k = 0; k < gains.size(); ++k)
  {
    gains[k] -= before[k];
  }
  return gains;
}

// ---- how: training with q

/// Steps: a quarter of the ordinary training's, between these; and never more than those.
constexpr int kFewestSteps = 500, kMostSteps = 1000;
constexpr double kStepsShare = 0.25;
constexpr double kFirstRate = 0.5;  // of the ordinary training's first rates
constexpr double kTermRate = 0.5;   // of r's, for a direction as far from the usual one as is usual
constexpr double kLeastSpread = 0.05;
constexpr double kDropout = 0.3;  // share of planes on which q is off
constexpr int kLooks = 10;        // how often what is usual at the Gaussians' places is found again

/// Adam on q, as Formula/Adam.h has it.
class TermSteps
{
public:
  explicit TermSteps(std::size_t gaussians) : terms_(gaussians, Eigen::Vector3d::Zero()), states_(gaussians) {}

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

/// One training with q.
class ViewLoop
{
public:
  ViewLoop(Engine& engine, const ViewTargets& targets, const TrainingPlan& plan, const GaussianField& field,
           const RecordedViews& views)
      : engine_(engine),
        walker_(*ViewEngine::Of(engine)),
        targets_(targets),
        plan_(plan),
        views_(views),
        steps_(std::min(plan.iterations,
                        std::clamp(static_cast<int>(kStepsShare * plan.iterations), kFewestSteps, kMostSteps))),
        batches_(targets.frames, plan.batch, plan.seed),
        random_(Mix(plan.seed)),
        terms_(field.Size())
  {
    engine.SetFrames(targets.images);
    engine.SetField(field);
    engine.SetAccuracy({plan.tolerance, true});
    rates_ = Scaled(FirstRates(plan, field), kFirstRate);
    usual_ = views.UsualAt(field.means);
  }

  int Steps() const { return steps_; }

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
    walker_.Backpropagate(batch, LossAt(plan_, 1), values, derivatives);
    engine_.Step(rates, targets_.limits);
    StepTerms(directions, derivatives, rates.reflectivity);
    ++step_;
    if (IsLastPart(fraction) && IsAveraged(step_, steps_))
    {
      Average();
    }
  }

  ViewedField Result()
  {
    if (average_.count == 0)
    {
      Average();
    }
    return {std::move(average_.mean), {views_, std::move(meanTerms_)}};
  }

private:
  /// delta of each of the batch's planes; not finite where q is off.
  std::vector<Eigen::Vector3d> Directions(const std::vector<int>& batch)
  {
    std::vector<Eigen::Vector3d> directions;
    for (const int frame : batch)
    {
      const bool isOff = random_.Uniform() < kDropout;
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
  double passes_ = 0;
  LearningRates rates_;
  Batches batches_;
  RandomNumbers random_;
  RecordedViews::Usual usual_;
  TermSteps terms_;
  FieldAverage average_;
  std::vector<Eigen::Vector3d> meanTerms_;
};

}  // namespace

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
  Numbers gains;
  // A third of few frames is too few to judge by, so there each third is judged by the others.
  for (std::size_t fold = 0; fold < (frames.size() < kManyFrames ? kJudged : 1); ++fold)
  {
    std::vector<int> fitted, judged;
    for (std::size_t k = 0; k < frames.size(); ++k)
    {
      (k % kJudged == (kJudged / 2 + fold) % kJudged ? judged : fitted).push_back(frames[k]);
    }
    const std::optional<GaussianField> coarse = CoarseField(asked, fitted, plan, goOn);
    const std::optional<Numbers> some = coarse ? Gains(asked, fitted, judged, *coarse, plan, goOn) : std::nullopt;
    if (!some)
    {
      return std::nullopt;
    }
    gains.insert(gains.end(), some->begin(), some->end());
  }
  const double mean = Mean(gains);
  return ViewEvidence{mean, std::sqrt(MeanSquare(gains, mean) / static_cast<double>(gains.size() - 1))};
}

std::optional<ViewedField> TrainViews(Engine& engine, const ViewTargets& targets, const TrainingPlan& plan,
                                      const GaussianField& field, const RecordedViews& views,
                                      const std::function<bool()>& goOn)
{
  ViewLoop loop(engine, targets, plan, field, views);
  for (int k = 0; k < loop.Steps(); ++k)
  {
    if (!goOn())
    {
      return std::nullopt;
    }
    loop.Step();
  }
  return loop.Result();
}

}  // namespace bigus
