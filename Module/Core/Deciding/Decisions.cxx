// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Deciding/Decisions.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>

#include "Core/Deciding/ElevationEstimate.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/TrainingLoop.h"
#include "Core/Training/VirtualPlanes.h"

namespace bigus
{
namespace
{

constexpr std::size_t kFewest = 8;    // frames, below which there is nothing to compare on
constexpr std::size_t kTried = 32;    // frames a trial looks at
constexpr double kTrialPixels = 8e4;  // of a frame; larger ones are averaged down
constexpr double kTrialPasses = 10;   // over frames and virtual planes
// What many Gaussians can do shows late; taken for their number where the whole sweep takes much longer
// anyway.
constexpr double kLongTrialPasses = 40;
constexpr double kLongTrialShare = 0.5;  // the most of a dense sweep that such a trial may look at
constexpr int kFewestSteps = 40;
constexpr double kPays = 0.03;  // dB
// dB; a trial is too short to show all that a Gaussian is worth, so fewer must lose next to nothing.
constexpr double kAsGood = 0.02;
constexpr double kUnsure = 1.0;  // dB that the probe's path predicts frames better than poses that are off
// dB that may be lost in a trial by what the frames themselves ask for: the beam that speckle measures, the path
// that predicts them better.
constexpr double kAgrees = 0.05;
constexpr std::size_t kFewestGaussians = 1000;

std::string Format(const char* pattern, double value)
{
  char text[64];
  std::snprintf(text, sizeof text, pattern, value);
  // snprintf follows the C locale's decimal separator; a log does not.
  std::replace(text, text + sizeof text, ',', '.');
  return text;
}

/// PSNR of each validation frame after a short training.
struct Trial
{
  std::vector<double> psnr;
  double Mean() const
  {
    double sum = 0;
    for (double value : psnr)
    {
      sum += value;
    }
    return sum / static_cast<double>(psnr.size());
  }
};

/// Mean gain of one trial over another and the standard error of that mean, paired frame by frame.
struct Gain
{
  double mean = 0, error = 0;
  bool mostGain = false;  // so that one frame does not decide
};
Gain GainOf(const Trial& trial, const Trial& over)
{
  Gain gain;
  const double n = static_cast<double>(trial.psnr.size());
  gain.mean = trial.Mean() - over.Mean();
  double squares = 0;
  std::size_t gained = 0;
  for (std::size_t k = 0; k < trial.psnr.size(); ++k)
  {
    const double difference = trial.psnr[k] - over.psnr[k] - gain.mean;
    squares += difference * difference;
    gained += trial.psnr[k] > over.psnr[k];
  }
  gain.mostGain = 2 * gained >= trial.psnr.size();
  gain.error = n > 1 ? std::sqrt(squares / (n * (n - 1))) : 0.0;
  return gain;
}

class Decider
{
public:
  Decider(const Sweep& sweep, const std::vector<int>& frames, TrainerOptions& options, const ProgressCallback& progress)
      : options_(options), progress_(progress)
  {
    // The middle of the sweep: its ends show least.
    const std::size_t tried = std::min(kTried, frames.size());
    const auto begin = frames.begin() + static_cast<std::ptrdiff_t>((frames.size() - tried) / 2);
    share_ = static_cast<double>(tried) / static_cast<double>(frames.size());
    const std::vector<int> chosen(begin, begin + static_cast<std::ptrdiff_t>(tried));
    Sweep part = sweep.Subset(chosen);
    const int reduce =
        static_cast<int>(std::ceil(std::sqrt(static_cast<double>(part.PixelsPerFrame()) / kTrialPixels) - 1e-9));
    sweep_ = std::make_shared<const Sweep>(reduce > 1 ? part.Reduced(reduce) : part);
    std::tie(training_, validation_) = SplitHoldOut(static_cast<int>(tried), 4);
    geometry_ = MeasureGeometry(*sweep_, training_);
  }

  std::vector<Decision> Run(const Sweep& sweep, const std::vector<int>& frames)
  {
    base_ = PlanByGeometry(options_, sweep, frames);
    if (base_.virtualPlanes > 0 || !options_.virtualPlanes)
    {
      DecideFlow();
    }
    if (options_.keepContrast)
    {
      Record("the rest", "by geometry", "the least error is smooth: it cannot judge texture", Clock::now());
      return decisions_;
    }
    DecideVirtualPlanes();
    DecidePath();
    DecideElevation(sweep, frames);
    DecideGaussians();  // last, since more of them make every further trial longer
    return decisions_;
  }

private:
  using Clock = std::chrono::steady_clock;

  /// Trains shortly with these choices, from `start` where it has Gaussians; else it gets them.
  Trial Try(TrainingPlan choices, double passes, Start& start)
  {
    choices.gaussians = std::max<std::size_t>(
        1, static_cast<std::size_t>(std::lround(static_cast<double>(choices.gaussians) * share_)));
    const int steps =
        std::max(kFewestSteps, StepsForPasses(passes, training_.size(), choices.virtualPlanes, choices.batch));
    choices.iterations = std::min(steps, options_.iterations.value_or(steps));
    choices.timeLimit = 0;
    choices.densification.interval = 0;
    ScaleToPixels(options_, geometry_.pixelSize, choices);
    TrainingLoop loop(
        sweep_, training_, choices, [this](const TrainingProgress&) { return Proceed(); }, WithVirtualPlanes(choices));
    if (start.field.Size() == 0)
    {
      start = loop.SeedAndSolve();
    }
    const Fitted fitted = loop.Run(start, {});
    ++trials_;
    Trial trial;
    Engine* engine = &loop.engine();
    engine->SetAccuracy({});
    engine->SetField(fitted.field);
    std::vector<float> image(sweep_->PixelsPerFrame()), truth(image.size());
    for (int frame : validation_)
    {
      engine->Render(sweep_->Plane(frame), ViewOutput::Intensity, image.data());
      sweep_->BlackenUnlit(image.data());
      sweep_->CopyFrame(frame, truth.data());
      // A frame met exactly must not make a mean infinite: 8-bit truth has no more than 100 dB to say.
      trial.psnr.push_back(std::min(100.0, Psnr(image.data(), truth.data(), image.size())));
    }
    return trial;
  }

  /// Whether trials of both are seeded and solved alike, and differ only in what follows.
  static bool StartAlike(const TrainingPlan& a, const TrainingPlan& b)
  {
    return a.gaussians == b.gaussians && a.virtualPlanes == b.virtualPlanes &&
           a.interpolation.ToString() == b.interpolation.ToString() && a.elevationSigma == b.elevationSigma;
  }

  /// Made once for every number of them, since the interpolation is settled first.
  std::shared_ptr<const Sweep> WithVirtualPlanes(const TrainingPlan& choices)
  {
    const int perGap = choices.virtualPlanes;
    if (perGap == 0)
    {
      return nullptr;
    }
    std::shared_ptr<const Sweep>& made = withVirtualPlanes_[perGap];
    if (!made)
    {
      made = AddVirtualPlanes(*sweep_, training_, perGap, choices.interpolation);
    }
    return made;
  }

  bool Proceed()
  {
    if (progress_ && !stopped_)
    {
      TrainingProgress now;
      now.phase = TrainingProgress::Phase::Deciding;
      now.fraction = 1 - std::pow(0.93, trials_);  // how many trials it will take is not known
      stopped_ = !progress_(now);
    }
    return !stopped_;
  }

  void Record(const char* what, const std::string& choice, std::string evidence, Clock::time_point since)
  {
    if (stopped_ && evidence != "given")
    {
      evidence += evidence.empty() ? "stopped before it was compared" : "; stopped there";
    }
    decisions_.push_back({what, choice, evidence, std::chrono::duration<double>(Clock::now() - since).count()});
  }

  static std::string Describe(const Gain& gain)
  {
    return Format("%+.2f", gain.mean) + Format(" +- %.2f dB", gain.error);
  }

  /// What the best choices so far reach; a caller who made all of them spares the trial.
  const Trial& Best()
  {
    if (!best_)
    {
      best_ = Try(base_, passes_, start_);
    }
    return *best_;
  }

  /// Tries other choices and takes them when they gain more than `least` dB. What is to gain something must
  /// gain more than half the standard error, too: between choices so close that chance decides, either will
  /// do. `orDoesNotLose`: or when they lose less than kAgrees even if they gain a standard error less.
  bool Consider(const TrainingPlan& candidate, const std::string& label, double least, std::string& evidence,
                bool orDoesNotLose = false)
  {
    if (!Proceed())
    {
      return false;
    }
    const Trial best = Best();
    Start start = StartAlike(candidate, base_) ? start_ : Start();
    const Trial trial = Try(candidate, passes_, start);
    if (stopped_)
    {
      return false;  // a trial cut short says nothing
    }
    const Gain gain = GainOf(trial, best);
    evidence += (evidence.empty() ? "" : "; ") + label + ": " + Describe(gain);
    const bool pays = gain.mean > least && (least <= 0 || (gain.mean > 0.5 * gain.error && gain.mostGain));
    if (!pays && !(orDoesNotLose && gain.mean - gain.error > -kAgrees))
    {
      return false;
    }
    base_ = candidate;
    best_ = trial;
    start_ = std::move(start);
    return true;
  }

  /// With flow or without, for each path, by predicting frames from their neighbours. The path itself is left
  /// to DecidePath: one that follows the probe is scored here where its own path leads, while slices are
  /// asked for at tracked poses.
  void DecideFlow()
  {
    const auto since = Clock::now();
    if (options_.interpolation)
    {
      Record("interpolation", options_.interpolation->ToString(), "given", since);
      return;
    }
    if (training_.size() < 3 || !Proceed())
    {
      return;
    }
    double normals = 0, probe = 0;
    const auto bestOf = [&](FrameInterpolation::Path path, double& score)
    {
      FrameInterpolation best{path, false, false}, flow{path, true, false};
      const double without = ScoreInterpolation(*sweep_, training_, best);
      const double with = ScoreInterpolation(*sweep_, training_, flow);
      interpolationEvidence_ += (interpolationEvidence_.empty() ? "" : "; ") + best.ToString() +
                                Format(" %.2f dB", without) + ", with flow" + Format(" %.2f dB", with);
      best.flow = with > without + kPays;  // it must pay for its time
      score = best.flow ? with : without;
      best.keepContrast = options_.keepContrast;
      return best;
    };
    base_.interpolation = bestOf(FrameInterpolation::Path::Normals, normals);
    alongProbe_ = bestOf(FrameInterpolation::Path::Probe, probe);
    pathGain_ = probe - normals;
    options_.interpolation = base_.interpolation;
    interpolationSeconds_ = std::chrono::duration<double>(Clock::now() - since).count();
    if (options_.keepContrast)
    {
      Record("interpolation", options_.interpolation->ToString(), interpolationEvidence_, since);
    }
  }

  /// A path that predicts frames worse is not tried.
  void DecidePath()
  {
    const auto since = Clock::now();
    if (!alongProbe_)
    {
      return;
    }
    if (base_.virtualPlanes > 0 && pathGain_ > 0)
    {
      TrainingPlan candidate = base_;
      candidate.interpolation = *alongProbe_;
      const auto alongNormals = std::move(withVirtualPlanes_);
      withVirtualPlanes_.clear();
      if (!Consider(candidate, "along the probe's path in a trial", kPays, interpolationEvidence_, true))
      {
        withVirtualPlanes_ = alongNormals;
      }
    }
    options_.interpolation = base_.interpolation;
    Record("interpolation", base_.interpolation.ToString(), interpolationEvidence_, since);
    decisions_.back().seconds += interpolationSeconds_;
  }

  /// From what geometry suggests down to none where it suggests any, else up while it pays.
  void DecideVirtualPlanes()
  {
    const auto since = Clock::now();
    if (options_.virtualPlanes)
    {
      Record("virtual planes", std::to_string(*options_.virtualPlanes), "given", since);
      return;
    }
    std::string evidence;
    const auto consider = [&](int perGap, double least)
    {
      TrainingPlan candidate = base_;
      candidate.virtualPlanes = perGap;
      return Consider(candidate, std::to_string(perGap) + " instead of " + std::to_string(base_.virtualPlanes), least,
                      evidence);
    };
    const int start = base_.virtualPlanes;
    if (start == 0 || !consider(0, -kPays))  // as good without them: without them
    {
      for (int perGap = start + 1; perGap <= 2 && consider(perGap, kPays); ++perGap)
      {
      }
    }
    options_.virtualPlanes = base_.virtualPlanes;
    Record("virtual planes", std::to_string(base_.virtualPlanes), evidence, since);
  }

  /// What speckle says about the probe is where to look: the field's best beam may be thinner, since
  /// Gaussians have a thickness too, or thicker, where poses are unsure.
  void DecideElevation(const Sweep& sweep, const std::vector<int>& frames)
  {
    const auto since = Clock::now();
    if (options_.elevationSigma)
    {
      Record("elevation sigma", Format("%.3g mm", *options_.elevationSigma), "given", since);
      return;
    }
    if (!Proceed())  // the estimate takes seconds
    {
      options_.elevationSigma = base_.elevationSigma;
      Record("elevation sigma", Format("%.3g mm", base_.elevationSigma), "", since);
      return;
    }
    const ElevationEstimate estimate = EstimateElevationSigma(sweep, frames);
    std::string evidence = estimate.reliable ? Format("speckle decorrelates as for %.2f", estimate.sigma) +
                                                   Format(" +- %.2f mm", estimate.standardError)
                                             : "no estimate from speckle (" + estimate.reason + ")";
    const auto consider = [&](double sigma, double least = kPays)
    {
      TrainingPlan candidate = base_;
      candidate.elevationSigma = sigma;
      return Consider(candidate, Format("%.2f mm", sigma) + Format(" instead of %.2f", base_.elevationSigma), least,
                      evidence);
    };
    const double start = base_.elevationSigma, half = estimate.reliable ? estimate.sigma / 2 : start;
    const auto thicken = [&]()
    {
      // One step: validation frames widen the gaps, and wider gaps ask for ever thicker beams.
      if (pathGain_ < kUnsure)
      {
        return consider(2 * start);
      }
      // Poses that are off blur what can be known as a thick beam would: where chance decides, it is thick.
      if (!consider(4 * start, 0))
      {
        return consider(2 * start);
      }
      consider(8 * start, 0);
      return true;
    };
    // A side where half the probe's own has lost is not tried again.
    const bool differs = std::abs(std::log2(half / start)) > 0.2;
    if (!differs || !consider(half, -kAgrees))
    {
      const bool tryThicker = !differs || half < start, tryThinner = !differs || half > start;
      if ((!tryThicker || !thicken()) && tryThinner)
      {
        consider(0.5 * start);
      }
    }
    options_.elevationSigma = base_.elevationSigma;
    Record("elevation sigma", Format("%.3g mm", base_.elevationSigma), evidence, since);
  }

  /// Doubles while it pays its price, else halves while that costs nothing.
  void DecideGaussians()
  {
    const auto since = Clock::now();
    if (options_.gaussians)
    {
      Record("Gaussians", std::to_string(*options_.gaussians), "given", since);
      return;
    }
    std::string evidence;
    const auto consider = [&](std::size_t count, double least)
    {
      TrainingPlan candidate = base_;
      candidate.gaussians = count;
      return Consider(candidate, std::to_string(count) + " instead of " + std::to_string(base_.gaussians), least,
                      evidence);
    };
    if (!geometry_.IsSparse() && share_ <= kLongTrialShare)
    {
      passes_ = kLongTrialPasses;
      best_.reset();
    }
    bool grew = false;
    while (2 * base_.gaussians <= options_.maximumGaussians && consider(2 * base_.gaussians, options_.price))
    {
      grew = true;
    }
    while (!grew && base_.gaussians >= kFewestGaussians && consider(base_.gaussians / 2, -kAsGood))
    {
    }
    options_.gaussians = base_.gaussians;
    Record("Gaussians", std::to_string(base_.gaussians),
           evidence + (evidence.empty() ? "" : "; ") + Format("price %.2f dB a doubling", options_.price), since);
  }

  TrainerOptions& options_;
  const ProgressCallback& progress_;
  std::shared_ptr<const Sweep> sweep_;  // what is tried on
  std::vector<int> training_, validation_;
  SweepGeometry geometry_;
  double share_ = 1;   // of the sweep's frames
  TrainingPlan base_;  // the best so far, and what it reached
  std::optional<Trial> best_;
  Start start_;                   // of trials of base_
  double passes_ = kTrialPasses;  // that trials take now
  std::vector<Decision> decisions_;
  std::map<int, std::shared_ptr<const Sweep>> withVirtualPlanes_;
  std::optional<FrameInterpolation> alongProbe_;  // the candidate, while the path is open
  std::string interpolationEvidence_;
  double interpolationSeconds_ = 0;
  double pathGain_ = 0;  // dB by which frames are predicted better along the probe's path than at their poses
  int trials_ = 0;
  bool stopped_ = false;
};

}  // namespace

std::vector<Decision> Decide(std::shared_ptr<const Sweep> sweep, const std::vector<int>& frames,
                             TrainerOptions& options, const ProgressCallback& progress)
{
  if (frames.size() < kFewest)
  {
    return {{"everything", "by geometry", std::to_string(frames.size()) + " frames are too few to compare on", 0}};
  }
  return Decider(*sweep, frames, options, progress).Run(*sweep, frames);
}

}  // namespace bigus
