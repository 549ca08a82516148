// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/TrainingLoop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <random>

#include "Core/Formula/SsimWindow.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Training/FrameCorrections.h"
#include "Core/Training/VirtualPlanes.h"

namespace bigus
{
namespace
{

/// Training frames in a new order every epoch, dealt in batches.
class Batches
{
public:
  Batches(std::vector<int> frames, int size, std::uint64_t seed)
      : frames_(std::move(frames)), size_(std::min<std::size_t>(size, frames_.size())), random_(seed)
  {
  }

  std::vector<int> Next()
  {
    std::vector<int> batch;
    while (batch.size() < size_)
    {
      if (at_ == 0)
      {
        for (std::size_t i = frames_.size(); i > 1; --i)  // Fisher-Yates; std::shuffle differs between libraries
        {
          std::swap(frames_[i - 1], frames_[random_() % i]);
        }
      }
      batch.push_back(frames_[at_]);
      at_ = (at_ + 1) % frames_.size();
    }
    return batch;
  }

private:
  std::vector<int> frames_;
  std::size_t size_;
  std::size_t at_ = 0;
  std::mt19937_64 random_;
};

double MeanMagnitude(const std::vector<double>& values)
{
  double sum = 0;
  for (double value : values)
  {
    sum += std::abs(value);
  }
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

/// Mean PSNR of the engine's field over some frames.
double FieldPsnr(Engine& engine, const Sweep& sweep, const std::vector<int>& frames)
{
  std::vector<float> image(sweep.PixelsPerFrame()), truth(sweep.PixelsPerFrame());
  double sum = 0;
  for (int frame : frames)
  {
    sweep.CopyFrame(frame, truth.data());
    engine.Render(sweep.Plane(frame), ViewOutput::Intensity, image.data());
    sweep.BlackenUnlit(image.data());
    sum += Psnr(image.data(), truth.data(), image.size());
  }
  return sum / static_cast<double>(frames.size());
}

/// The sweep with a mask of the pixels that count in the loss. Beside the lit area frames contradict each other:
/// tissue outside one's fan lies inside its neighbour's. So what is dark within an SSIM window of lit pixels does not
/// count. Further out it is black, lest Gaussians reach where no frame looks; nor does it count if `ignoreMasked`.
std::shared_ptr<const Sweep> WithCountedPixels(const Sweep& sweep, bool ignoreMasked)
{
  auto out = std::make_shared<Sweep>(sweep);
  if (sweep.mask && !ignoreMasked)
  {
    cv::Mat beside;
    cv::dilate(cv::Mat(*sweep.mask).reshape(1, sweep.height), beside, cv::Mat::ones(kSsimTaps, kSsimTaps, CV_8U));
    auto counted = std::make_shared<std::vector<std::uint8_t>>(sweep.PixelsPerFrame());
    for (std::size_t pixel = 0; pixel < counted->size(); ++pixel)
    {
      (*counted)[pixel] = sweep.IsLit(pixel) || beside.data[pixel] == 0;
    }
    out->mask = counted;
  }
  return out;
}

/// Scales all reflectivities by the one factor that brings rendered scattering closest to the frames' (least
/// squares): neighbouring seeds overlap, so inverting the transfer function at each overshoots.
void ScaleReflectivities(Engine& engine, const Sweep& sweep, const std::vector<int>& frames, GaussianField& field)
{
  constexpr std::size_t kSamples = 4;  // frames: one factor needs few
  std::vector<float> scattering(sweep.PixelsPerFrame()), truth(sweep.PixelsPerFrame());
  double product = 0, square = 0;
  for (std::size_t k = 0; k < std::min(kSamples, frames.size()); ++k)
  {
    const int frame = frames[(2 * k + 1) * frames.size() / (2 * std::min(kSamples, frames.size()))];
    sweep.CopyFrame(frame, truth.data());
    engine.Render(sweep.Plane(frame), ViewOutput::Scattering, scattering.data());
    for (std::size_t p = 0; p < truth.size(); ++p)
    {
      product += field.transfer.Scattering<double>(truth[p]) * scattering[p];
      square += static_cast<double>(scattering[p]) * scattering[p];
    }
  }
  if (product > 0 && square > 0)
  {
    for (double& r : field.reflectivities)
    {
      r *= product / square;
    }
    engine.SetField(field);
  }
}

/// Passes over the frames beyond which the rates fall with the root of their number: see Decay. On a volume of 64
/// slices no such fall gives 0.8 dB less after 2500 passes, and 100 instead of 300 gives 0.25 dB less after 125.
constexpr double kSettledPasses = 300;

/// When frames' gains and poses are found, as fractions of training: once the field says more than one frame does, and
/// again when it is better.
constexpr std::array<double, 2> kCorrections = {0.3, 0.6};

/// First and last densification, as fractions of training: not before error scores mean something, and not so late that
/// what is new cannot settle.
constexpr double kFirstDensification = 0.1, kLastDensification = 0.6;

/// Lines of the log that a training of many iterations writes; each costs a pass over the validation frames.
constexpr int kLogLines = 100;

/// Share of the progress bar that seeding and solving take.
constexpr double kSolvingShare = 0.1;

/// Seconds that a time limit leaves to training at the least, so that nothing is divided by 0.
constexpr double kLeastTime = 1e-3;

/// The loss a fraction of the way through training.
Loss Blend(const TrainingPlan& options, double fraction)
{
  if (!options.finalLoss)
  {
    return options.loss;
  }
  const auto mix = [fraction](double a, double b) { return (1 - fraction) * a + fraction * b; };
  const Loss &a = options.loss, &b = *options.finalLoss;
  Loss loss;
  loss.l1 = mix(a.l1, b.l1);
  loss.l2 = mix(a.l2, b.l2);
  loss.dssim = mix(a.dssim, b.dssim);
  loss.ffl = mix(a.ffl, b.ffl);
  loss.contrast = mix(a.contrast, b.contrast);
  return loss;
}

/// Removes Gaussians that no plane shows: a footprint's peak is at most |r|, which changes I by at most
/// gamma |r|, and below the tolerance training does not render it either. One stays, whatever it is: a field
/// is never empty.
void RemoveInvisible(GaussianField& field, double tolerance)
{
  std::size_t kept = 0;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    if (std::abs(field.reflectivities[i]) * field.transfer.gamma >= tolerance || (i + 1 == field.Size() && kept == 0))
    {
      field.means[kept] = field.means[i];
      field.scales[kept] = field.scales[i];
      field.rotations[kept] = field.rotations[i];
      field.reflectivities[kept] = field.reflectivities[i];
      ++kept;
    }
  }
  field.Resize(kept);
}

/// The share of the first rates that a fraction of the way through training is left. What a step of Adam jitters by is
/// in proportion to its rate, so long training at full rate wears a field out.
double Decay(double finalRate, double fraction, double passes)
{
  return std::pow(finalRate, fraction) / std::sqrt(1 + passes / kSettledPasses);
}

LearningRates Scaled(const LearningRates& rates, double factor)
{
  return {rates.mean * factor, rates.logScale * factor, rates.rotation * factor, rates.reflectivity * factor};
}

/// The best field on the validation frames so far.
class EarlyStop
{
public:
  explicit EarlyStop(int patience) : patience_(patience) {}

  /// False when `patience` evaluations in a row were no better than the best.
  bool Note(double psnr, const Engine& engine)
  {
    if (!best_ || psnr > bestPsnr_)
    {
      best_ = engine.GetField();
      bestPsnr_ = psnr;
      sinceBest_ = 0;
      return true;
    }
    return ++sinceBest_ < patience_;
  }

  GaussianField BestOr(const Engine& engine) { return best_ ? std::move(*best_) : engine.GetField(); }

private:
  int patience_;
  std::optional<GaussianField> best_;
  double bestPsnr_ = 0;
  int sinceBest_ = 0;
};

}  // namespace

TrainingLoop::TrainingLoop(std::shared_ptr<const Sweep> sweep, std::vector<int> frames, TrainingPlan plan,
                           ProgressCallback progress, std::shared_ptr<const Sweep> withVirtualPlanes)
    : sweep_(std::move(sweep)),
      frames_(std::move(frames)),
      plan_(std::move(plan)),
      progress_(std::move(progress)),
      engine_(Engine::Create(plan_.engine)),
      targetSweep_(sweep_),
      targets_(frames_)
{
  engine_->SetAccuracy({plan_.tolerance, true});
  Proceed(TrainingProgress::Phase::Seeding, 0.0);
  const bool virtualPlanes = plan_.virtualPlanes > 0 && frames_.size() > 1;
  if (virtualPlanes || plan_.frameGains || plan_.poseRefinement)
  {
    targetSweep_ = !virtualPlanes      ? std::make_shared<const Sweep>(sweep_->Subset(frames_))
                   : withVirtualPlanes ? std::move(withVirtualPlanes)
                                       : AddVirtualPlanes(*sweep_, frames_, plan_.virtualPlanes, plan_.interpolation);
    targets_.resize(targetSweep_->NumberOfFrames());
    std::iota(targets_.begin(), targets_.end(), 0);
  }
  if (plan_.frameGains)
  {
    targetSweep_ = Levelled(*sweep_, frames_, *targetSweep_);
  }
  UploadTargets();
}

void TrainingLoop::UploadTargets()
{
  engine_->SetFrames(WithCountedPixels(*targetSweep_, plan_.ignoreMasked));
}

Start TrainingLoop::SeedAndSolve()
{
  Start start;
  start.field =
      Seed(*sweep_, frames_, Beam{plan_.elevationSigma}, {plan_.seeding, plan_.gaussians, plan_.seed, plan_.sparse});
  engine_->SetField(start.field);
  ScaleReflectivities(*engine_, *sweep_, frames_, start.field);
  if (plan_.solveIterations > 0 && !aborted_)
  {
    engine_->SolveReflectivities(targets_, plan_.solveIterations,
                                 [this](double fraction)
                                 { return Proceed(TrainingProgress::Phase::Solving, kSolvingShare * fraction); });
  }
  // Only the reflectivities are the engine's: it rounds places.
  start.field.reflectivities = engine_->GetField().reflectivities;
  return start;
}

/// Gives the field to the engine, and returns it as the engine rounds it.
GaussianField TrainingLoop::Load(Start start)
{
  engine_->SetField(start.field);
  if (!start.seeded)
  {
    return std::move(start.field);
  }
  GaussianField field = engine_->GetField();
  if (!plan_.signedReflectivity)
  {
    for (double& r : field.reflectivities)
    {
      r = std::max(r, 0.0);
    }
    engine_->SetField(field);
  }
  return field;
}

LearningRates TrainingLoop::FirstRates(const GaussianField& field) const
{
  const double meanMagnitude = MeanMagnitude(field.reflectivities);
  LearningRates rates;
  rates.mean = plan_.meanRate * plan_.pixelSize;
  rates.logScale = plan_.shapeRate;
  rates.rotation = plan_.shapeRate;
  // An all-dark start has no magnitude to go by; 1 is the mean scattering that gamma aims at.
  rates.reflectivity = plan_.reflectivityRate * (meanMagnitude > 0 ? meanMagnitude : 1.0);
  return rates;
}

ParameterLimits TrainingLoop::Limits() const
{
  ParameterLimits limits;
  limits.minimumScale = plan_.minimumScale;
  limits.maximumScale = plan_.maximumScale;
  limits.positiveReflectivity = !plan_.signedReflectivity;
  return limits;
}

/// How far training is, by iterations or by the clock, whichever is ahead, so that the rates are spent when it ends.
double TrainingLoop::Fraction(int iteration, double trainingStart) const
{
  const double fraction = static_cast<double>(iteration - 1) / plan_.iterations;
  if (plan_.timeLimit > 0)
  {
    return std::max(fraction,
                    (watch_.Seconds() - trainingStart) / std::max(plan_.timeLimit - trainingStart, kLeastTime));
  }
  return fraction;
}

void TrainingLoop::Correct()
{
  targetSweep_ = Corrected(*engine_, *sweep_, frames_, *targetSweep_, plan_);
  UploadTargets();
}

void TrainingLoop::Restructure(const DensificationOptions& densification)
{
  const Restructured next = Densify(engine_->GetField(), engine_->GetScores(), plan_.pixelSize, densification);
  if (next.field.Size() > 0)
  {
    engine_->SetField(next.field, &next.parents);
  }
  engine_->ResetScores();
}

Fitted TrainingLoop::Run(Start start, const std::vector<int>& validationFrames)
{
  Fitted fitted;
  LearningRates rates;
  DensificationOptions densification = plan_.densification;
  {
    const GaussianField field = Load(std::move(start));
    rates = FirstRates(field);
    densification.cap = densification.cap > 0 ? densification.cap : 2 * field.Size();
  }
  const ParameterLimits limits = Limits();
  Batches batches(targets_, plan_.batch, plan_.seed);
  EarlyStop earlyStop(plan_.patience);
  const int logInterval = std::max(1, plan_.iterations / kLogLines);
  const double trainingStart = watch_.Seconds();
  double lossSum = 0;
  int lossCount = 0;
  std::size_t corrections = 0;
  if (densification.interval > 0)
  {
    engine_->ResetScores();
  }
  for (int iteration = 1; iteration <= plan_.iterations && !aborted_; ++iteration)
  {
    const double fraction = Fraction(iteration, trainingStart);
    if (fraction >= 1.0)
    {
      break;
    }
    if ((plan_.frameGains || plan_.poseRefinement) && corrections < kCorrections.size() &&
        fraction >= kCorrections[corrections])
    {
      ++corrections;
      Correct();
    }
    const double passes = static_cast<double>(iteration) * plan_.batch / static_cast<double>(targets_.size());
    const double decay = Decay(plan_.finalRate, fraction, passes);
    lossSum += engine_->TrainStep(batches.Next(), Blend(plan_, fraction), Scaled(rates, decay), limits);
    ++lossCount;
    fitted.iterations = iteration;
    if (densification.interval > 0 && iteration % densification.interval == 0 && fraction >= kFirstDensification &&
        fraction <= kLastDensification)
    {
      Restructure(densification);
    }

    TrainingRecord& line = report_.record;
    line.iteration = iteration;
    line.loss = lossSum / lossCount;
    line.gaussians = engine_->FieldSize();
    line.rate = decay;
    if (iteration % logInterval == 0 || iteration == plan_.iterations)
    {
      line.seconds = watch_.Seconds();
      line.validationPsnr.reset();
      if (!validationFrames.empty())
      {
        line.validationPsnr = FieldPsnr(*engine_, *sweep_, validationFrames);
      }
      fitted.log.push_back(line);
      if (line.validationPsnr && !earlyStop.Note(*line.validationPsnr, *engine_))
      {
        break;
      }
      lossSum = 0;
      lossCount = 0;
    }
    Proceed(TrainingProgress::Phase::Training, kSolvingShare + (1 - kSolvingShare) * fraction);
  }

  fitted.field = earlyStop.BestOr(*engine_);
  if (plan_.iterations > 0)
  {
    RemoveInvisible(fitted.field, plan_.tolerance);
  }
  fitted.aborted = aborted_;
  return fitted;
}

bool TrainingLoop::Proceed(TrainingProgress::Phase phase, double fraction)
{
  report_.phase = phase;
  report_.fraction = fraction;
  report_.record.seconds = watch_.Seconds();
  report_.secondsLeft = fraction > 0.01 ? report_.record.seconds * (1 - fraction) / fraction : 0.0;
  aborted_ = aborted_ || (progress_ && !progress_(report_));
  return !aborted_;
}

}  // namespace bigus
