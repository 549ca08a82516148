// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Deciding/Trials.h"

#include <algorithm>
#include <cmath>

#include "Core/Deciding/DecisionRules.h"
#include "Core/Evaluation/Baselines.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/Judging.h"
#include "Core/Training/OptionList.h"
#include "Core/Training/TrainingLoop.h"
#include "Core/Training/VirtualPlanes.h"

namespace bigus
{
namespace
{

/// Progress shows this share of what is left with every trial, since how many trials it will take is not known.
constexpr double kProgressOfATrial = 0.07;

/// Planes across the frames, half of them along columns and half along rows.
constexpr int kAcrossEach = 2;

/// Mean PSNR where a cross-plane lies between frames; both pictures equal elsewhere.
double PsnrWithin(const CrossPlane& cross, const std::vector<float>& image, const std::vector<float>& truth)
{
  double squares = 0;
  std::size_t counted = 0;
  for (std::size_t p = 0; p < image.size(); ++p)
  {
    if (cross.enclosed[p])
    {
      const double difference = static_cast<double>(image[p]) - truth[p];
      squares += difference * difference;
      ++counted;
    }
  }
  return squares > 0 ? std::min(kMostPsnr, -10 * std::log10(squares / static_cast<double>(counted))) : kMostPsnr;
}

Gain GainOf(const std::vector<double>& psnr, const std::vector<double>& over)
{
  Gain gain;
  const double n = static_cast<double>(psnr.size());
  gain.mean = Mean(psnr) - Mean(over);
  double squares = 0;
  std::size_t gained = 0;
  for (std::size_t k = 0; k < psnr.size(); ++k)
  {
    const double difference = psnr[k] - over[k] - gain.mean;
    squares += difference * difference;
    gained += psnr[k] > over[k];
  }
  gain.mostGain = 2 * gained >= psnr.size();
  gain.error = n > 1 ? std::sqrt(squares / (n * (n - 1))) : 0.0;
  return gain;
}

/// The whole number by which a frame's sides are divided, so that it has at most kTrialPixels.
int Reduction(const Sweep& sweep)
{
  return static_cast<int>(std::ceil(std::sqrt(static_cast<double>(sweep.PixelsPerFrame()) / kTrialPixels) - 1e-9));
}

}  // namespace

std::string Gain::ToString() const
{
  return Format("%+.2f", mean) + Format(" +- %.2f dB", error) + ", across" + Format(" %+.2f dB", across) +
         ", anywhere" + Format(" %+.2f dB", anywhere);
}

Trials::Trials(const Sweep& sweep, const std::vector<int>& frames, std::size_t trained, const TrainerOptions& asked,
               const ProgressCallback& progress, TrialKeeper& keeper, Exchange& exchange, std::string poses)
    : asked_(asked), progress_(progress), keeper_(keeper), exchange_(exchange), poses_(std::move(poses))
{
  const std::size_t tried = std::min(kTrialFrames, frames.size());
  const auto begin = frames.begin() + static_cast<std::ptrdiff_t>((frames.size() - tried) / 2);
  share_ = static_cast<double>(tried) / static_cast<double>(trained);
  const Sweep part = sweep.Subset({begin, begin + static_cast<std::ptrdiff_t>(tried)});
  sweep_ = std::make_shared<const Sweep>(part.Reduced(Reduction(part)));
  std::tie(training_, validation_) = SplitHoldOut(static_cast<int>(tried), kValidationEvery);
  pixelSize_ = MeasureGeometry(*sweep_, training_).pixelSize;
  MakeAcross();
  MeasureShares();
}

void Trials::MeasureShares()
{
  const std::vector<double> gaps = GapsBetween(*sweep_, AllFrames(*sweep_));
  double sum = 0, squares = 0;
  for (const double g : gaps)
  {
    sum += g;
    squares += g * g;
  }
  const double expected = sum > 0 ? squares / (6 * sum) : 0;
  for (const int frame : validation_)
  {
    const bool isInside = frame > 0 && frame + 1 < sweep_->NumberOfFrames();
    const double before = isInside ? gaps[frame - 1] : 0, after = isInside ? gaps[frame] : 0;
    const double here = before + after > 0 ? before * after / (before + after) : 0;
    shares_.push_back(here > 0 ? std::min(1.0, expected / here) : 1.0);
  }
}

/// PSNR of the expected squared error at a plane at random, dB: the mean over the validation frames and what surrounds
/// them.
double Trials::Anywhere(const TrialScores& scores) const
{
  const auto squared = [](double psnr) { return std::pow(10.0, -0.1 * psnr); };
  double seen = 0, sum = 0;
  for (const double psnr : scores.seen)
  {
    seen += squared(psnr) / static_cast<double>(scores.seen.size());
  }
  for (std::size_t k = 0; k < scores.frames.size(); ++k)
  {
    sum += seen + shares_[k] * (squared(scores.frames[k]) - seen);
  }
  return -10 * std::log10(sum / static_cast<double>(scores.frames.size()));
}

/// Interpolation between all frames has gaps half as wide as those between the frames trained on, and no beam.
void Trials::MakeAcross()
{
  const std::vector<int> all = AllFrames(*sweep_);
  for (CrossPlane& cross : MakeCrossPlanes(*sweep_, all, kAcrossEach, pixelSize_))
  {
    if (std::none_of(cross.enclosed.begin(), cross.enclosed.end(), [](std::uint8_t inside) { return inside != 0; }))
    {
      continue;
    }
    std::vector<float> image(cross.enclosed.size());
    PredictPoseInterpolation(*sweep_, all, cross.plane, image.data());
    across_.push_back({std::move(cross), std::move(image)});
  }
}

std::optional<Gain> Trials::Compare(const TrainingPlan& candidate, const TrainingPlan& best, double passes)
{
  if (!Proceed())
  {
    return std::nullopt;
  }
  const TrialScores over = Score(best, passes), psnr = Score(candidate, passes);
  // A trial cut short says nothing.
  if (stopped_)
  {
    return std::nullopt;
  }
  Gain gain = GainOf(psnr.frames, over.frames);
  gain.anywhere = Anywhere(psnr) - Anywhere(over);
  gain.across = across_.empty() ? 0.0 : Mean(psnr.across) - Mean(over.across);
  return gain;
}

std::optional<Gain> Trials::ComparePoses(Trials& others, const TrainingPlan& plan, double passes)
{
  if (!Proceed())
  {
    return std::nullopt;
  }
  const TrialScores over = others.Score(plan, passes), psnr = others.stopped_ ? TrialScores{} : Score(plan, passes);
  return stopped_ || others.stopped_ ? std::nullopt : std::optional(GainOf(psnr.frames, over.frames));
}

std::optional<double> Trials::Predict(const FrameInterpolation& interpolation)
{
  const std::string name = "prediction by " + interpolation.ToString();
  if (const TrialScores* known = keeper_.FindTrial(name); known && !known->frames.empty())
  {
    return known->frames[0];
  }
  const std::optional<double> psnr =
      ScoreInterpolation(*sweep_, training_, interpolation, [this] { return Proceed(); });
  if (psnr)
  {
    keeper_.NoteTrial(name, {{*psnr}, {}, {}});
  }
  return psnr;
}

bool Trials::Proceed()
{
  if (progress_ && !stopped_)
  {
    TrainingProgress now;
    now.phase = TrainingProgress::Phase::Deciding;
    now.fraction = 1 - std::pow(1 - kProgressOfATrial, trained_);
    stopped_ = !progress_(now);
  }
  return !stopped_;
}

/// Trains unless that was done before. All that trials differ in names one.
TrialScores Trials::Score(const TrainingPlan& plan, double passes)
{
  const std::string name = poses_ + std::to_string(plan.gaussians) + " Gaussians, beam " +
                           NumberText(plan.elevationSigma) + ", " + std::to_string(plan.virtualPlanes) + " planes, " +
                           plan.interpolation.ToString() + ", " + NumberText(passes) + " passes";
  if (const TrialScores* known = keeper_.FindTrial(name))
  {
    return *known;
  }
  return Train(plan, passes, name);
}

TrialScores Trials::Train(TrainingPlan plan, double passes, const std::string& name)
{
  plan.gaussians =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(static_cast<double>(plan.gaussians) * share_)));
  const int steps =
      std::max(kFewestTrialSteps, StepsForPasses(passes, training_.size(), plan.virtualPlanes, plan.batch));
  plan.iterations = std::min(steps, asked_.iterations.value_or(steps));
  plan.timeLimit = 0;
  plan.densification.interval = 0;
  ScaleToPixels(pixelSize_, plan);
  const std::shared_ptr<const Sweep> withVirtualPlanes = WithVirtualPlanes(plan);
  if (stopped_)
  {
    return {};
  }
  TrainingLoop loop(
      sweep_, training_, plan, [this](const TrainingProgress&) { return Proceed(); }, withVirtualPlanes, exchange_);
  loop.SetKeeping(keeper_.KeepingOfTrial(name));
  const std::string state = keeper_.TakeTrial(name);
  if (state.empty())
  {
    loop.Begin(loop.SeedStart());
  }
  else
  {
    loop.Resume(state);
  }
  const Fitted fitted = loop.Run({});
  ++trained_;
  Engine& engine = loop.engine();
  engine.SetAccuracy({});
  engine.SetField(fitted.field);
  TrialScores psnrs;
  for (const double psnr : FramePsnrs(engine, *sweep_, validation_))
  {
    psnrs.frames.push_back(std::min(kMostPsnr, psnr));
  }
  for (const double psnr : FramePsnrs(engine, *sweep_, training_))
  {
    psnrs.seen.push_back(std::min(kMostPsnr, psnr));
  }
  for (const auto& [cross, seen] : across_)
  {
    std::vector<float> image(seen.size());
    engine.Render(cross.plane, ViewOutput::Intensity, image.data());
    psnrs.across.push_back(PsnrWithin(cross, image, seen));
  }
  if (fitted.finished)
  {
    keeper_.NoteTrial(name, psnrs);
  }
  return psnrs;
}

std::shared_ptr<const Sweep> Trials::WithVirtualPlanes(const TrainingPlan& plan)
{
  if (plan.virtualPlanes == 0)
  {
    return nullptr;
  }
  std::shared_ptr<const Sweep>& made = withVirtualPlanes_[{plan.virtualPlanes, plan.interpolation.ToString()}];
  if (!made)
  {
    made = AddVirtualPlanes(*sweep_, training_, plan.virtualPlanes, plan.interpolation,
                            [this](double) { return Proceed(); });
  }
  return made;
}

}  // namespace bigus
