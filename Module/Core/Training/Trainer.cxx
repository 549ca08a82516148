// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/Trainer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <random>
#include <sstream>
#include <tuple>

#include "Core/Deciding/Decisions.h"
#include "Core/Formula/SsimWindow.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"
#include "Core/Training/Fit.h"
#include "Core/Training/FrameCorrections.h"
#include "Core/Training/VirtualPlanes.h"

namespace bigus
{
namespace
{

[[noreturn]] void Refuse(const char* option, double value, const char* range)
{
  std::ostringstream text;
  text << "Trainer: " << option << " is " << value << "; it must be " << range << ".";
  throw Error(text.str());
}

void Require(bool condition, const char* option, double value, const char* range)
{
  if (!condition)
  {
    Refuse(option, value, range);
  }
}

bool Between(double value, double low, double high)
{
  return value >= low && value <= high;
}  // false for NaN

class Clock
{
public:
  double Seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

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
    cv::dilate(cv::Mat(*sweep.mask).reshape(1, sweep.height), beside, cv::Mat::ones(ssimTaps, ssimTaps, CV_8U));
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
  constexpr std::size_t kSamples = 4;
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

/// Refuses what no field can be seeded from: a single plane says nothing about space, equal pixels nothing at
/// all.
void RequireSomethingToLearn(const Sweep& sweep, const std::vector<int>& frames)
{
  if (frames.size() < 2)
  {
    throw Error(
        "Trainer: there is one frame to train on; a field needs at least two, at different places. (A field "
        "that "
        "exists already can be continued with one.)");
  }
  std::vector<float> image(sweep.PixelsPerFrame());
  sweep.CopyFrame(frames[0], image.data());
  const float level = image[0];
  for (int frame : frames)
  {
    sweep.CopyFrame(frame, image.data());
    if (std::any_of(image.begin(), image.end(), [level](float value) { return value != level; }))
    {
      return;
    }
  }
  throw Error("Trainer: " +
              (level == 0 ? std::string("all frames are black")
                          : "every pixel of all frames is " + std::to_string(level) + " (of 1)") +
              ", so there is nothing to learn. Check the file, the clip region and the pixel type.");
}

/// Passes over the frames from which training counts as long: see Fit. On a volume of 64 slices, none gives .8 dB
/// less after 2500 passes, and 100 .25 dB less after 125.
constexpr double kSettled = 300;

/// Where in training frames' gains and poses are found: once the field says more than one frame does, and
/// again.
constexpr std::array<double, 2> kCorrections = {0.3, 0.6};

/// The loss a fraction of the way through training.
Loss Blend(const TrainerOptions& options, double fraction)
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

}  // namespace

void TrainerOptions::Validate() const
{
  const auto count = [](const char* option, std::size_t value)
  { Require(value >= 1 && value <= (std::size_t(1) << 26), option, static_cast<double>(value), "1 to 67108864"); };
  count("gaussians", gaussians.value_or(1));
  count("maximum of gaussians", maximumGaussians);
  Require(Between(price, 0, 100), "price", price, "0 to 100 dB");
  Require(trackerTranslation > 0 && trackerTranslation <= 1000, "tracker translation", trackerTranslation,
          "above 0, at most 1000 mm");
  Require(trackerRotation > 0 && trackerRotation <= 45, "tracker rotation", trackerRotation,
          "above 0, at most 45 degrees");
  loss.Validate();
  if (finalLoss)
  {
    finalLoss->Validate();
  }
  Require(!elevationSigma || Between(*elevationSigma, 0, 1e3), "elevation sigma", elevationSigma.value_or(0),
          "0 to 1000 mm");
  Require(holdOut == 0 || holdOut >= 2, "hold-out", holdOut, "0 (none), or at least 2");
  Require(validation == 0 || validation >= 2, "validation", validation, "0 (none), or at least 2");
  Require(patience >= 1, "patience", patience, "at least 1");
  Require(!iterations || (*iterations >= 0 && *iterations <= 10000000), "iterations", iterations.value_or(0),
          "0 to 10000000");
  Require(Between(timeLimit, 0, 1e9), "time limit", timeLimit, "0 (none) to 1e9 seconds");
  Require(batch >= 1 && batch <= 4096, "batch", batch, "1 to 4096 frames");
  loss.Validate();
  Require(Between(tolerance, 0, 1), "tolerance", tolerance, "0 to 1");
  Require(Between(meanRate, 0, 100), "mean rate", meanRate, "0 to 100 pixels");
  Require(Between(shapeRate, 0, 1), "shape rate", shapeRate, "0 to 1");
  Require(Between(reflectivityRate, 0, 10), "reflectivity rate", reflectivityRate, "0 to 10");
  Require(Between(finalRate, 1e-6, 1), "final rate", finalRate, "1e-6 to 1");
  Require(!solveIterations || (*solveIterations >= 0 && *solveIterations <= 1000), "solve iterations",
          solveIterations.value_or(0), "0 to 1000");
  Require(!virtualPlanes || (*virtualPlanes >= 0 && *virtualPlanes <= 8), "virtual planes", virtualPlanes.value_or(0),
          "0 to 8");
  Require(!minimumScale || Between(*minimumScale, 1e-6, 1e6), "minimum scale", minimumScale.value_or(0),
          "1e-6 to 1e6 mm");
  Require(!maximumScale || Between(*maximumScale, minimumScale.value_or(1e-6), 1e6), "maximum scale",
          maximumScale.value_or(0), "at least the minimum scale, at most 1e6 mm");
  Require(densification.interval >= 0, "densification interval", densification.interval, "0 (never) or more");
  Require(Between(densification.percentile, 0, 100), "densification percentile", densification.percentile, "0 to 100");
  Require(Between(densification.start, 0, 1) && Between(densification.stop, 0, 1), "densification start or stop",
          densification.start, "a fraction, 0 to 1");
  Require(Between(densification.splitScale, 0, 1e6), "split scale", densification.splitScale, "0 to 1e6 pixels");
  Require(Between(densification.pruneReflectivity, 0, 1), "prune reflectivity", densification.pruneReflectivity,
          "0 to 1");
  Require(Between(densification.cloneReflectivity, 1e-6, 1), "clone reflectivity", densification.cloneReflectivity,
          "above 0, at most 1");
}

void ApplyPreset(const std::string& name, TrainerOptions& options)
{
  if (name != "fidelity" && name != "texture")
  {
    throw Error("Trainer: there is no preset \"" + name.substr(0, 60) + "\"; it is fidelity or texture.");
  }
  // Where the place of speckle cannot be known, the least error is a smooth picture; contrast asks for grains
  // of the right strength wherever they lie.
  options.keepContrast = name == "texture";
  options.loss = options.keepContrast ? Loss::Parse("l1+30*contrast") : Loss{};
  options.finalLoss.reset();
}

TrainingResult Fit(std::shared_ptr<const Sweep> sweep, const std::vector<int>& frames,
                   const std::vector<int>& validationFrames, const TrainerOptions& options, const GaussianField* start,
                   const std::function<bool(const TrainingProgress&)>& progress,
                   std::shared_ptr<const Sweep> withVirtualPlanes, GaussianField* solved)
{
  const Clock clock;
  const SweepGeometry geometry = MeasureGeometry(*sweep, frames);
  TrainingResult result;
  result.settled = options;
  TrainingProgress report;
  const auto proceed = [&](TrainingProgress::Phase phase, double fraction)
  {
    report.phase = phase;
    report.fraction = fraction;
    report.record.seconds = clock.Seconds();
    report.secondsLeft = fraction > 0.01 ? report.record.seconds * (1 - fraction) / fraction : 0.0;
    result.aborted = result.aborted || (progress && !progress(report));
    return !result.aborted;
  };

  const std::unique_ptr<Engine> engine = Engine::Create(options.engine);
  result.device = engine->Device();
  engine->SetAccuracy({options.tolerance, true});
  proceed(TrainingProgress::Phase::Seeding, 0.0);

  // What the engine trains on: the frames themselves, or a sweep of training frames and virtual planes.
  std::vector<int> targets = frames;
  std::shared_ptr<const Sweep> targetSweep = sweep;
  const bool virtualPlanes = *options.virtualPlanes > 0 && frames.size() > 1;
  if (virtualPlanes || *options.frameGains || *options.poseRefinement)
  {
    targetSweep = !virtualPlanes ? std::make_shared<const Sweep>(sweep->Subset(frames))
                  : withVirtualPlanes
                      ? withVirtualPlanes
                      : AddVirtualPlanes(*sweep, frames, *options.virtualPlanes, *options.interpolation);
    targets.resize(targetSweep->NumberOfFrames());
    std::iota(targets.begin(), targets.end(), 0);
  }
  if (*options.frameGains)
  {
    targetSweep = Levelled(*sweep, frames, *targetSweep);
  }
  engine->SetFrames(WithCountedPixels(*targetSweep, options.ignoreMasked), true);
  GaussianField field;
  if (start)
  {
    field = *start;
    field.beam.elevationSigma = *options.elevationSigma;
    engine->SetField(field);
  }
  else
  {
    if (solved && solved->Size() > 0)
    {
      engine->SetField(*solved);
    }
    else
    {
      field = Seed(*sweep, frames, Beam{*options.elevationSigma}, {options.seeding, *options.gaussians, options.seed});
      engine->SetField(field);
      ScaleReflectivities(*engine, *sweep, frames, field);
      if (*options.solveIterations > 0 && !result.aborted)
      {
        engine->SolveReflectivities(targets, *options.solveIterations,
                                    [&](double fraction)
                                    { return proceed(TrainingProgress::Phase::Solving, 0.1 * fraction); });
      }
      if (solved)
      {
        *solved = field;  // not the engine's, whose places are rounded
        solved->reflectivities = engine->GetField().reflectivities;
      }
    }
    field = engine->GetField();
    if (!*options.signedReflectivity)
    {
      for (double& r : field.reflectivities)
      {
        r = std::max(r, 0.0);
      }
      engine->SetField(field);
    }
  }

  LearningRates rates;
  const double meanMagnitude = MeanMagnitude(field.reflectivities);
  rates.mean = options.meanRate * geometry.pixelSize;
  rates.logScale = options.shapeRate;
  rates.rotation = options.shapeRate;
  // An all-dark start has no magnitude to go by; 1 is the mean scattering that gamma aims at.
  rates.reflectivity = options.reflectivityRate * (meanMagnitude > 0 ? meanMagnitude : 1.0);
  ParameterLimits limits;
  limits.minimumScale = options.minimumScale.value_or(0.25 * geometry.pixelSize);
  limits.maximumScale = std::max(options.maximumScale.value_or(48 * geometry.pixelSize), limits.minimumScale);
  limits.positiveReflectivity = !*options.signedReflectivity;

  DensificationOptions densification = options.densification;
  if (densification.cap == 0)
  {
    densification.cap = 2 * field.Size();
  }

  Batches batches(targets, options.batch, options.seed);
  const int iterations = *options.iterations;
  const int logInterval = std::max(1, iterations / 100);
  const double trainingStart = clock.Seconds();
  double lossSum = 0;
  int lossCount = 0;
  std::optional<GaussianField> best;
  double bestPsnr = 0;
  int sinceBest = 0;
  std::size_t corrections = 0;
  if (densification.interval > 0)
  {
    engine->ResetScores();
  }
  for (int iteration = 1; iteration <= iterations && !result.aborted; ++iteration)
  {
    // Progress is by iterations or by the clock, whichever is ahead, so that the rates are spent when
    // training ends.
    double fraction = static_cast<double>(iteration - 1) / iterations;
    if (options.timeLimit > 0)
    {
      fraction =
          std::max(fraction, (clock.Seconds() - trainingStart) / std::max(options.timeLimit - trainingStart, 1e-3));
    }
    if (fraction >= 1.0)
    {
      break;
    }
    if ((*options.frameGains || *options.poseRefinement) && corrections < kCorrections.size() &&
        fraction >= kCorrections[corrections])
    {
      ++corrections;
      targetSweep = Corrected(*engine, *sweep, frames, *targetSweep, options);
      engine->SetFrames(WithCountedPixels(*targetSweep, options.ignoreMasked), true);
    }
    // What a step of Adam jitters by is in proportion to its rate, so that long training at full rate wears a field
    // out. Beyond kSettled passes over the frames rates fall with the root of their number.
    const double passes = static_cast<double>(iteration) * options.batch / static_cast<double>(targets.size());
    const double decay = std::pow(options.finalRate, fraction) / std::sqrt(1 + passes / kSettled);
    lossSum += engine->TrainStep(
        batches.Next(), Blend(options, fraction),
        {rates.mean * decay, rates.logScale * decay, rates.rotation * decay, rates.reflectivity * decay}, limits);
    ++lossCount;
    result.iterations = iteration;

    if (densification.interval > 0 && iteration % densification.interval == 0 && fraction >= densification.start &&
        fraction <= densification.stop)
    {
      const Restructured next = Densify(engine->GetField(), engine->GetScores(), geometry.pixelSize, densification);
      if (next.field.Size() > 0)
      {
        engine->SetField(next.field, &next.parents);
      }
      engine->ResetScores();
    }

    report.record.iteration = iteration;
    report.record.loss = lossSum / lossCount;
    report.record.gaussians = engine->FieldSize();
    report.record.rate = decay;
    if (iteration % logInterval == 0 || iteration == iterations)
    {
      report.record.seconds = clock.Seconds();
      report.record.validationPsnr.reset();
      if (!validationFrames.empty())
      {
        const double psnr = FieldPsnr(*engine, *sweep, validationFrames);
        report.record.validationPsnr = psnr;
        if (!best || psnr > bestPsnr)
        {
          best = engine->GetField();
          bestPsnr = psnr;
          sinceBest = 0;
        }
        else if (++sinceBest >= options.patience)
        {
          result.log.push_back(report.record);
          break;
        }
      }
      result.log.push_back(report.record);
      lossSum = 0;
      lossCount = 0;
    }
    proceed(TrainingProgress::Phase::Training, 0.1 + 0.9 * fraction);
  }

  result.field = best ? *best : engine->GetField();
  if (iterations > 0)
  {
    RemoveInvisible(result.field, options.tolerance);
  }
  result.seconds = clock.Seconds();
  return result;
}

TrainingResult Train(std::shared_ptr<const Sweep> sweep, const TrainerOptions& options, const GaussianField* start,
                     const std::function<bool(const TrainingProgress&)>& progress)
{
  const Clock clock;
  options.Validate();
  sweep->Validate();

  auto [frames, heldOut] = SplitHoldOut(sweep->NumberOfFrames(), options.holdOut);
  std::vector<int> validation;
  if (options.validation > 0)
  {
    const auto [train, validate] = SplitHoldOut(static_cast<int>(frames.size()), options.validation);
    validation = Pick(frames, validate);
    frames = Pick(frames, train);
  }
  if (frames.empty())
  {
    throw Error("Trainer: with a hold-out of " + std::to_string(options.holdOut) + " and validation of " +
                std::to_string(options.validation) + ", none of the " + std::to_string(sweep->NumberOfFrames()) +
                " frames is left to train on.");
  }
  if (!start)
  {
    RequireSomethingToLearn(*sweep, frames);
  }
  else if (start->Size() == 0)
  {
    throw Error("Trainer: the field to continue from holds no Gaussian.");
  }
  sweep = std::make_shared<const Sweep>(sweep->LitBy(frames));

  TrainerOptions settled = options;
  if (start && !settled.elevationSigma)
  {
    settled.elevationSigma = start->beam.elevationSigma;
  }
  constexpr double kDeciding = 0.3;  // of the progress bar
  double from = 0, share = 1;        // of the bar, for what runs now
  bool aborted = false;
  const auto passOn = [&](TrainingProgress now)
  {
    now.fraction = from + share * now.fraction;
    now.record.seconds = clock.Seconds();
    now.secondsLeft = now.fraction > 0.01 ? now.record.seconds * (1 - now.fraction) / now.fraction : 0.0;
    aborted = aborted || (progress && !progress(now));
    return !aborted;
  };
  std::vector<Decision> decisions;
  // A field to continue from was decided on before.
  if (options.automatic && !start && options.iterations.value_or(1) > 0)
  {
    share = kDeciding;
    // Of a limited time training gets the larger part.
    constexpr double kTimeForDeciding = 1.0 / 3;
    decisions = Decide(
        sweep, frames, settled,
        [&](const TrainingProgress& now)
        { return passOn(now) && (options.timeLimit == 0 || clock.Seconds() < kTimeForDeciding * options.timeLimit); });
    from = kDeciding;
    share = 1 - kDeciding;
  }
  SettleByGeometry(*sweep, frames, settled);
  TrainerOptions fitted = settled;
  if (options.timeLimit > 0)
  {
    fitted.timeLimit = std::max(options.timeLimit - clock.Seconds(), 1e-3);
  }
  TrainingResult result = Fit(sweep, frames, validation, fitted, start, passOn);
  result.settled = settled;
  result.decisions = std::move(decisions);
  result.trainingFrames = std::move(frames);
  result.validationFrames = std::move(validation);
  result.heldOutFrames = std::move(heldOut);
  result.aborted = aborted;
  result.seconds = clock.Seconds();
  return result;
}

}  // namespace bigus
