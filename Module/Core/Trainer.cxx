#include "Trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <random>
#include <sstream>
#include <tuple>

#include "Error.h"
#include "VirtualPlanes.h"

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
  double Seconds() const
  {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

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
        for (std::size_t i = frames_.size(); i > 1;
             --i)  // Fisher-Yates; std::shuffle differs between libraries
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
    sum += Psnr(image.data(), truth.data(), image.size());
  }
  return sum / static_cast<double>(frames.size());
}

/// Scales all reflectivities by the one factor that brings rendered scattering closest to the frames' (least
/// squares): neighbouring seeds overlap, so inverting the transfer function at each overshoots.
void ScaleReflectivities(Engine& engine, const Sweep& sweep, const std::vector<int>& frames,
                         GaussianField& field)
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

}  // namespace

void TrainerOptions::Validate() const
{
  Require(gaussians >= 1 && gaussians <= (std::size_t(1) << 26), "gaussians", static_cast<double>(gaussians),
          "1 to 67108864");
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
  Require(!virtualPlanes || (*virtualPlanes >= 0 && *virtualPlanes <= 8), "virtual planes",
          virtualPlanes.value_or(0), "0 to 8");
  Require(!minimumScale || Between(*minimumScale, 1e-6, 1e6), "minimum scale", minimumScale.value_or(0),
          "1e-6 to 1e6 mm");
  Require(!maximumScale || Between(*maximumScale, minimumScale.value_or(1e-6), 1e6), "maximum scale",
          maximumScale.value_or(0), "at least the minimum scale, at most 1e6 mm");
  Require(densification.interval >= 0, "densification interval", densification.interval, "0 (never) or more");
  Require(Between(densification.percentile, 0, 100), "densification percentile", densification.percentile,
          "0 to 100");
  Require(Between(densification.start, 0, 1) && Between(densification.stop, 0, 1),
          "densification start or stop", densification.start, "a fraction, 0 to 1");
  Require(Between(densification.splitScale, 0, 1e6), "split scale", densification.splitScale,
          "0 to 1e6 pixels");
  Require(Between(densification.pruneReflectivity, 0, 1), "prune reflectivity",
          densification.pruneReflectivity, "0 to 1");
  Require(Between(densification.cloneReflectivity, 1e-6, 1), "clone reflectivity",
          densification.cloneReflectivity, "above 0, at most 1");
}

TrainingResult Train(std::shared_ptr<const Sweep> sweep, const TrainerOptions& options,
                     const GaussianField* start, const std::function<bool(const TrainingProgress&)>& progress)
{
  const Clock clock;
  options.Validate();
  sweep->Validate();

  TrainingResult result;
  std::tie(result.trainingFrames, result.heldOutFrames) =
      SplitHoldOut(sweep->NumberOfFrames(), options.holdOut);
  if (options.validation > 0)
  {
    const auto [train, validate] =
        SplitHoldOut(static_cast<int>(result.trainingFrames.size()), options.validation);
    std::vector<int> kept;
    for (int k : train)
    {
      kept.push_back(result.trainingFrames[k]);
    }
    for (int k : validate)
    {
      result.validationFrames.push_back(result.trainingFrames[k]);
    }
    result.trainingFrames = kept;
  }
  if (result.trainingFrames.empty())
  {
    throw Error("Trainer: with a hold-out of " + std::to_string(options.holdOut) + " and validation of " +
                std::to_string(options.validation) + ", none of the " +
                std::to_string(sweep->NumberOfFrames()) + " frames is left to train on.");
  }
  const std::vector<int>& frames = result.trainingFrames;
  if (!start)
  {
    RequireSomethingToLearn(*sweep, frames);
  }
  const SweepGeometry geometry = MeasureGeometry(*sweep, frames);

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

  // The field to begin with.
  const std::unique_ptr<Engine> engine = Engine::Create(options.engine);
  result.device = engine->Device();
  engine->SetAccuracy({options.tolerance, true});
  proceed(TrainingProgress::Phase::Seeding, 0.0);

  // What the engine trains on: the frames themselves, or a sweep of training frames and virtual planes.
  std::vector<int> targets = frames;
  const int virtualPlanes = options.virtualPlanes.value_or(geometry.IsSparse() ? 1 : 0);
  std::shared_ptr<const Sweep> targetSweep = sweep;
  if (virtualPlanes > 0 && frames.size() > 1)
  {
    targetSweep = AddVirtualPlanes(*sweep, frames, virtualPlanes);
    targets.resize(targetSweep->NumberOfFrames());
    std::iota(targets.begin(), targets.end(), 0);
  }
  engine->SetFrames(targetSweep, options.ignoreMasked);
  GaussianField field;
  if (start)
  {
    field = *start;
    if (options.elevationSigma)
    {
      field.beam.elevationSigma = *options.elevationSigma;
    }
    if (field.Size() == 0)
    {
      throw Error("Trainer: the field to continue from holds no Gaussian.");
    }
    engine->SetField(field);
  }
  else
  {
    const Beam beam{options.elevationSigma.value_or(geometry.IsSparse() ? 0.8 : 0.3)};
    field = Seed(*sweep, frames, beam, {options.seeding, options.gaussians, options.seed});
    engine->SetField(field);
    ScaleReflectivities(*engine, *sweep, frames, field);
    const int solve = options.solveIterations.value_or(geometry.IsSparse() ? 0 : 8);
    if (solve > 0 && !result.aborted)
    {
      engine->SolveReflectivities(targets, solve,
                                  [&](double fraction)
                                  { return proceed(TrainingProgress::Phase::Solving, 0.1 * fraction); });
    }
    field = engine->GetField();
    if (!options.signedReflectivity)
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
  limits.positiveReflectivity = !options.signedReflectivity;

  DensificationOptions densification = options.densification;
  if (densification.cap == 0)
  {
    densification.cap = 2 * field.Size();
  }

  Batches batches(targets, options.batch, options.seed);
  // Sparse sweeps gain nothing from more: what they lack is frames.
  const std::size_t passes = geometry.IsSparse() ? 60 : 120;
  const int steps =
      static_cast<int>(passes * targets.size() / std::min<std::size_t>(options.batch, targets.size()));
  const int iterations = options.iterations.value_or(std::max(steps, 200));
  const int logInterval = std::max(1, iterations / 100);
  const double trainingStart = clock.Seconds();
  double lossSum = 0;
  int lossCount = 0;
  std::optional<GaussianField> best;
  double bestPsnr = 0;
  int sinceBest = 0;
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
      fraction = std::max(
          fraction, (clock.Seconds() - trainingStart) / std::max(options.timeLimit - trainingStart, 1e-3));
    }
    if (fraction >= 1.0)
    {
      break;
    }
    const double decay = std::pow(options.finalRate, fraction);
    lossSum += engine->TrainStep(
        batches.Next(), options.loss,
        {rates.mean * decay, rates.logScale * decay, rates.rotation * decay, rates.reflectivity * decay},
        limits);
    ++lossCount;
    result.iterations = iteration;

    if (densification.interval > 0 && iteration % densification.interval == 0 &&
        fraction >= densification.start && fraction <= densification.stop)
    {
      const Restructured next =
          Densify(engine->GetField(), engine->GetScores(), geometry.pixelSize, densification);
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
      if (!result.validationFrames.empty())
      {
        const double psnr = FieldPsnr(*engine, *sweep, result.validationFrames);
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
  result.seconds = clock.Seconds();
  return result;
}

}  // namespace bigus
