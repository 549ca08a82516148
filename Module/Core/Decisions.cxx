#include "Decisions.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>

#include "ElevationEstimate.h"
#include "Fit.h"
#include "Metrics.h"
#include "VirtualPlanes.h"

namespace bigus
{
namespace
{

constexpr std::size_t kFewest = 8;    // frames, below which there is nothing to compare on
constexpr std::size_t kTried = 32;    // frames a trial looks at
constexpr double kTrialPixels = 8e4;  // of a frame; larger ones are averaged down
constexpr int kTrialShare = 8;        // a trial's steps: an eighth of a full training's on the same frames
constexpr int kFewestSteps = 40;
constexpr double kPays = 0.03;  // dB
constexpr double kSparsePasses = 60, kDensePasses = 120;
constexpr int kFewestIterations = 200;

/// Optimizer steps for so many passes over frames and virtual planes.
int Steps(double passes, std::size_t frames, int perGap, int batch)
{
  const std::size_t planes = frames + (frames > 1 ? (frames - 1) * static_cast<std::size_t>(perGap) : 0);
  return static_cast<int>(passes * static_cast<double>(planes) /
                          static_cast<double>(std::min<std::size_t>(batch, planes)));
}

double Passes(const SweepGeometry& geometry)
{
  // Sparse sweeps gain nothing from more: what they lack is frames.
  return geometry.IsSparse() ? kSparsePasses : kDensePasses;
}

/// A Gaussian for every 50 lit pixels recorded: where the search for the right number starts.
std::size_t UsualGaussians(const Sweep& sweep, const std::vector<int>& frames)
{
  std::vector<float> image(sweep.PixelsPerFrame());
  std::size_t lit = 0;
  for (int frame : frames)
  {
    sweep.CopyFrame(frame, image.data());
    for (std::size_t p = 0; p < image.size(); ++p)
    {
      lit += image[p] > 0 && sweep.IsLit(p);
    }
  }
  return std::clamp<std::size_t>(lit / 50, 1000, 300000);
}

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
  bool Pays() const { return mean > kPays && mean > error; }
};
Gain GainOf(const Trial& trial, const Trial& over)
{
  Gain gain;
  const double n = static_cast<double>(trial.psnr.size());
  gain.mean = trial.Mean() - over.Mean();
  double squares = 0;
  for (std::size_t k = 0; k < trial.psnr.size(); ++k)
  {
    const double difference = trial.psnr[k] - over.psnr[k] - gain.mean;
    squares += difference * difference;
  }
  gain.error = n > 1 ? std::sqrt(squares / (n * (n - 1))) : 0.0;
  return gain;
}

class Decider
{
public:
  Decider(const Sweep& sweep, const std::vector<int>& frames, TrainerOptions& options,
          const std::function<bool(const TrainingProgress&)>& progress)
      : options_(options), progress_(progress)
  {
    // The middle of the sweep: its ends show least.
    const std::size_t tried = std::min(kTried, frames.size());
    const auto begin = frames.begin() + static_cast<std::ptrdiff_t>((frames.size() - tried) / 2);
    share_ = static_cast<double>(tried) / static_cast<double>(frames.size());
    const std::vector<int> chosen(begin, begin + static_cast<std::ptrdiff_t>(tried));
    Sweep part = sweep.Subset(chosen);
    const int reduce = static_cast<int>(
        std::ceil(std::sqrt(static_cast<double>(part.PixelsPerFrame()) / kTrialPixels) - 1e-9));
    sweep_ = std::make_shared<const Sweep>(reduce > 1 ? part.Reduced(reduce) : part);
    std::tie(training_, validation_) = SplitHoldOut(static_cast<int>(tried), 4);
    geometry_ = MeasureGeometry(*sweep_, training_);
    allFrames_ = frames.size();
  }

  std::vector<Decision> Run(const Sweep& sweep, const std::vector<int>& frames)
  {
    TrainerOptions trial = options_;
    SettleByGeometry(sweep, frames, trial);
    if (!options_.virtualPlanes || *options_.virtualPlanes > 0)
    {
      DecideInterpolation(trial);
    }
    base_ = trial;
    best_ = Try(base_);
    DecideVirtualPlanes();
    DecidePath();
    DecideElevation(sweep, frames);
    DecideGaussians();
    DecideSign();
    DecideSwitch("frame gains", options_.frameGains, &TrainerOptions::frameGains);
    DecideSwitch("pose refinement", options_.poseRefinement, &TrainerOptions::poseRefinement);
    DecideIterations();
    return decisions_;
  }

private:
  using Clock = std::chrono::steady_clock;

  /// Trains shortly with these choices; `longer` times as many steps.
  Trial Try(TrainerOptions choices, double longer = 1)
  {
    choices.gaussians = std::max<std::size_t>(
        1, static_cast<std::size_t>(std::lround(static_cast<double>(*choices.gaussians) * share_)));
    const int steps = std::max(kFewestSteps, Steps(Passes(geometry_) / kTrialShare, training_.size(),
                                                   *choices.virtualPlanes, choices.batch));
    choices.iterations = static_cast<int>(longer * std::min(steps, options_.iterations.value_or(steps)));
    choices.timeLimit = 0;
    choices.densification.interval = 0;
    const TrainingResult result = Fit(
        sweep_, training_, {}, choices, nullptr, [this](const TrainingProgress&) { return Proceed(); },
        WithVirtualPlanes(choices));
    ++trials_;
    Trial trial;
    const std::unique_ptr<Engine> engine = Engine::Create(choices.engine);
    engine->SetField(result.field);
    std::vector<float> image(sweep_->PixelsPerFrame()), truth(image.size());
    for (int frame : validation_)
    {
      engine->Render(sweep_->Plane(frame), ViewOutput::Intensity, image.data());
      sweep_->CopyFrame(frame, truth.data());
      // A frame met exactly must not make a mean infinite: 8-bit truth has no more than 100 dB to say.
      trial.psnr.push_back(std::min(100.0, Psnr(image.data(), truth.data(), image.size())));
    }
    return trial;
  }

  /// Made once for every number of them, since the interpolation is settled first.
  std::shared_ptr<const Sweep> WithVirtualPlanes(const TrainerOptions& choices)
  {
    const int perGap = *choices.virtualPlanes;
    if (perGap == 0)
    {
      return nullptr;
    }
    std::shared_ptr<const Sweep>& made = withVirtualPlanes_[perGap];
    if (!made)
    {
      made = AddVirtualPlanes(*sweep_, training_, perGap, *choices.interpolation);
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

  void Record(const char* what, const std::string& choice, const std::string& evidence,
              Clock::time_point since)
  {
    decisions_.push_back(
        {what, choice, evidence, std::chrono::duration<double>(Clock::now() - since).count()});
  }

  static std::string Describe(const Gain& gain)
  {
    return Format("%+.2f", gain.mean) + Format(" +- %.2f dB", gain.error);
  }

  /// With flow or without, for each path, by predicting frames from their neighbours; the path itself later,
  /// by a trial: what follows the probe predicts a frame at the pose that its path suggests, while slices are
  /// asked for at tracked ones.
  void DecideInterpolation(TrainerOptions& trial)
  {
    const auto since = Clock::now();
    if (options_.interpolation)
    {
      Record("interpolation", options_.interpolation->ToString(), "given", since);
      return;
    }
    if (training_.size() < 3)
    {
      return;
    }
    const auto bestOf = [&](FrameInterpolation::Path path, std::string& evidence)
    {
      FrameInterpolation best{path, false, options_.keepContrast}, flow{path, true, options_.keepContrast};
      const double without = ScoreInterpolation(*sweep_, training_, {path, false, false});
      const double with = ScoreInterpolation(*sweep_, training_, {path, true, false});
      evidence += (evidence.empty() ? "" : "; ") + best.ToString() + Format(" %.2f dB", without) +
                  ", with flow" + Format(" %.2f dB", with);
      return with > without + kPays ? flow : best;  // flow must pay for its time
    };
    trial.interpolation = bestOf(FrameInterpolation::Path::Normals, interpolationEvidence_);
    alongProbe_ = bestOf(FrameInterpolation::Path::Probe, interpolationEvidence_);
    options_.interpolation = trial.interpolation;
    interpolationSeconds_ = std::chrono::duration<double>(Clock::now() - since).count();
  }

  void DecidePath()
  {
    const auto since = Clock::now();
    if (!alongProbe_)
    {
      return;
    }
    if (*base_.virtualPlanes > 0 && Proceed())
    {
      TrainerOptions candidate = base_;
      candidate.interpolation = alongProbe_;
      withVirtualPlanes_.clear();
      const Trial trial = Try(candidate);
      const Gain gain = GainOf(trial, best_);
      interpolationEvidence_ += "; along the probe's path in a trial: " + Describe(gain);
      if (gain.Pays())
      {
        options_.interpolation = alongProbe_;
        base_ = candidate;
        best_ = trial;
      }
      else
      {
        withVirtualPlanes_.clear();
      }
    }
    Record("interpolation", options_.interpolation->ToString(), interpolationEvidence_, since);
    decisions_.back().seconds += interpolationSeconds_;
  }

  void DecideVirtualPlanes()
  {
    const auto since = Clock::now();
    if (options_.virtualPlanes)
    {
      Record("virtual planes", std::to_string(*options_.virtualPlanes), "given", since);
      return;
    }
    // From what geometry suggests, down to none where it suggests any, then up while it pays.
    std::string evidence;
    const int start = *base_.virtualPlanes;
    for (int perGap = start > 0 ? 0 : 1; perGap <= 2 && Proceed(); ++perGap)
    {
      if (perGap == start)
      {
        continue;
      }
      TrainerOptions candidate = base_;
      candidate.virtualPlanes = perGap;
      const Trial trial = Try(candidate);
      const Gain gain = GainOf(trial, best_);
      evidence += (evidence.empty() ? "" : "; ") + std::to_string(perGap) + " instead of " +
                  std::to_string(*base_.virtualPlanes) + ": " + Describe(gain);
      const bool fewer = perGap < *base_.virtualPlanes;
      if (fewer ? gain.mean > -kPays : gain.Pays())
      {
        base_ = candidate;
        best_ = trial;
        if (fewer)
        {
          break;  // none is as good as some: more will not pay
        }
      }
      else if (!fewer)
      {
        break;
      }
    }
    options_.virtualPlanes = base_.virtualPlanes;
    Record("virtual planes", std::to_string(*base_.virtualPlanes), evidence, since);
  }

  void DecideElevation(const Sweep& sweep, const std::vector<int>& frames)
  {
    const auto since = Clock::now();
    if (options_.elevationSigma)
    {
      Record("elevation sigma", Format("%.3g mm", *options_.elevationSigma), "given", since);
      return;
    }
    // What speckle says about the probe; the field's best beam may be thinner, since Gaussians have a
    // thickness too.
    const ElevationEstimate estimate = EstimateElevationSigma(sweep, frames);
    std::string evidence = estimate.reliable ? Format("speckle decorrelates as for %.2f", estimate.sigma) +
                                                   Format(" +- %.2f mm", estimate.standardError)
                                             : "no estimate from speckle (" + estimate.reason + ")";
    std::vector<double> candidates{0.5 * *base_.elevationSigma, 2 * *base_.elevationSigma};
    if (estimate.reliable)
    {
      candidates = {estimate.sigma / 2, estimate.sigma};
    }
    for (double sigma : candidates)
    {
      if (!Proceed())
      {
        break;
      }
      TrainerOptions candidate = base_;
      candidate.elevationSigma = sigma;
      const Trial trial = Try(candidate);
      const Gain gain = GainOf(trial, best_);
      evidence +=
          Format("; %.2f mm", sigma) + Format(" instead of %.2f: ", *base_.elevationSigma) + Describe(gain);
      if (gain.Pays())
      {
        base_ = candidate;
        best_ = trial;
      }
    }
    options_.elevationSigma = base_.elevationSigma;
    Record("elevation sigma", Format("%.3g mm", *base_.elevationSigma), evidence, since);
  }

  /// Doubles while it pays, else halves while that costs less than the price.
  void DecideGaussians()
  {
    const auto since = Clock::now();
    if (options_.gaussians)
    {
      Record("Gaussians", std::to_string(*options_.gaussians), "given", since);
      return;
    }
    std::string evidence;
    bool grew = false;
    while (2 * *base_.gaussians <= options_.maximumGaussians && Proceed())
    {
      TrainerOptions candidate = base_;
      candidate.gaussians = 2 * *base_.gaussians;
      const Trial trial = Try(candidate);
      const Gain gain = GainOf(trial, best_);
      evidence += (evidence.empty() ? "" : "; ") + std::to_string(*candidate.gaussians) + " instead of " +
                  std::to_string(*base_.gaussians) + ": " + Describe(gain);
      if (!(gain.mean > options_.price && gain.mean > gain.error))
      {
        break;
      }
      grew = true;
      base_ = candidate;
      best_ = trial;
    }
    while (!grew && *base_.gaussians >= 1000 && Proceed())
    {
      TrainerOptions candidate = base_;
      candidate.gaussians = *base_.gaussians / 2;
      const Trial trial = Try(candidate);
      const Gain gain = GainOf(trial, best_);
      evidence += (evidence.empty() ? "" : "; ") + std::to_string(*candidate.gaussians) + " instead of " +
                  std::to_string(*base_.gaussians) + ": " + Describe(gain);
      if (gain.mean < -options_.price)
      {
        break;
      }
      base_ = candidate;
      best_ = trial;
    }
    options_.gaussians = base_.gaussians;
    Record("Gaussians", std::to_string(*base_.gaussians),
           evidence + Format("; price %.2f dB a doubling", options_.price), since);
  }

  void DecideSign()
  {
    const auto since = Clock::now();
    if (options_.signedReflectivity)
    {
      Record("reflectivity", *options_.signedReflectivity ? "signed" : "positive", "given", since);
      return;
    }
    TrainerOptions candidate = base_;
    candidate.signedReflectivity = false;
    std::string evidence;
    if (Proceed())
    {
      const Trial trial = Try(candidate);
      const Gain gain = GainOf(trial, best_);
      evidence = "positive instead of signed: " + Describe(gain);
      if (gain.Pays())
      {
        base_ = candidate;
        best_ = trial;
      }
    }
    options_.signedReflectivity = base_.signedReflectivity;
    Record("reflectivity", *base_.signedReflectivity ? "signed" : "positive", evidence, since);
  }

  void DecideSwitch(const char* what, std::optional<bool>& choice,
                    std::optional<bool> TrainerOptions::*option)
  {
    const auto since = Clock::now();
    if (choice)
    {
      Record(what, *choice ? "on" : "off", "given", since);
      return;
    }
    std::string evidence;
    choice = false;
    if (Proceed())
    {
      TrainerOptions candidate = base_;
      candidate.*option = true;
      const Trial trial = Try(candidate);
      const Gain gain = GainOf(trial, best_);
      evidence = "on: " + Describe(gain);
      if (gain.Pays())
      {
        choice = true;
        base_ = candidate;
        best_ = trial;
      }
    }
    Record(what, *choice ? "on" : "off", evidence, since);
  }

  /// Early stop: where twice the steps of a trial lose, half of a training's are enough.
  void DecideIterations()
  {
    const auto since = Clock::now();
    if (options_.iterations)
    {
      Record("iterations", std::to_string(*options_.iterations), "given", since);
      return;
    }
    int steps = std::max(kFewestIterations,
                         Steps(Passes(geometry_), allFrames_, *base_.virtualPlanes, options_.batch));
    std::string evidence;
    if (Proceed())
    {
      const Gain gain = GainOf(Try(base_, 2), best_);
      evidence = "twice a trial's steps: " + Describe(gain);
      if (gain.mean < -kPays && -gain.mean > gain.error)
      {
        steps = std::max(kFewestIterations, steps / 2);
      }
    }
    options_.iterations = steps;
    Record("iterations", std::to_string(steps), evidence, since);
  }

  TrainerOptions& options_;
  const std::function<bool(const TrainingProgress&)>& progress_;
  std::shared_ptr<const Sweep> sweep_;  // what is tried on
  std::vector<int> training_, validation_;
  SweepGeometry geometry_;
  double share_ = 1;           // of the sweep's frames
  std::size_t allFrames_ = 0;  // to train on in the end
  TrainerOptions base_;        // the best so far, and what it reached
  Trial best_;
  std::vector<Decision> decisions_;
  std::map<int, std::shared_ptr<const Sweep>> withVirtualPlanes_;
  std::optional<FrameInterpolation> alongProbe_;  // the candidate, while the path is open
  std::string interpolationEvidence_;
  double interpolationSeconds_ = 0;
  int trials_ = 0;
  bool stopped_ = false;
};

}  // namespace

std::vector<Decision> Decide(std::shared_ptr<const Sweep> sweep, const std::vector<int>& frames,
                             TrainerOptions& options,
                             const std::function<bool(const TrainingProgress&)>& progress)
{
  if (frames.size() < kFewest)
  {
    return {{"everything", "by geometry", std::to_string(frames.size()) + " frames are too few to compare on",
             0}};
  }
  return Decider(*sweep, frames, options, progress).Run(*sweep, frames);
}

void SettleByGeometry(const Sweep& sweep, const std::vector<int>& frames, TrainerOptions& options)
{
  const SweepGeometry geometry = MeasureGeometry(sweep, frames);
  const bool sparse = geometry.IsSparse();
  const auto settle = [](auto& choice, auto value)
  {
    if (!choice)
    {
      choice = value;
    }
  };
  if (!options.gaussians)
  {
    options.gaussians = std::min(UsualGaussians(sweep, frames), options.maximumGaussians);
  }
  settle(options.elevationSigma, sparse ? 0.8 : 0.3);
  settle(options.signedReflectivity, true);
  settle(options.virtualPlanes, sparse ? 1 : 0);
  settle(options.interpolation,
         FrameInterpolation{FrameInterpolation::Path::Normals, false, options.keepContrast});
  settle(options.frameGains, false);
  settle(options.poseRefinement, false);
  settle(options.solveIterations, sparse ? 0 : 8);
  if (!options.iterations)
  {
    options.iterations = std::max(
        kFewestIterations, Steps(Passes(geometry), frames.size(), *options.virtualPlanes, options.batch));
  }
}

}  // namespace bigus
