// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/TrainingLoop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <random>

#include "Core/Engine/FieldState.h"
#include "Core/Engine/PartEngine.h"
#include "Core/Formula/SsimWindow.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/PixelMemory.h"
#include "Core/Training/FieldAverage.h"
#include "Core/Training/FrameCorrections.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/VirtualPlanes.h"

namespace bigus
{
namespace
{

/// Training frames in a new order every epoch, dealt in batches. The frames of a batch lie a stride apart along the
/// sweep, so that few Gaussians are seen by two of them: a step moves more Gaussians, and each is seen at more steps.
class Batches
{
public:
  /// `frames` are in their order along the sweep.
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
        Deal();
      }
      batch.push_back(dealt_[at_]);
      at_ = (at_ + 1) % dealt_.size();
    }
    return batch;
  }

private:
  void Deal()
  {
    const std::size_t stride = (frames_.size() + size_ - 1) / size_, phase = random_() % frames_.size();
    std::vector<std::size_t> firsts(stride);
    std::iota(firsts.begin(), firsts.end(), std::size_t(0));
    for (std::size_t i = stride; i > 1; --i)  // Fisher-Yates; std::shuffle differs between libraries
    {
      std::swap(firsts[i - 1], firsts[random_() % i]);
    }
    dealt_.clear();
    for (const std::size_t first : firsts)
    {
      for (std::size_t k = first; k < frames_.size(); k += stride)
      {
        dealt_.push_back(frames_[(k + phase) % frames_.size()]);
      }
    }
  }

  std::vector<int> frames_, dealt_;
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

/// `count` frames evenly spread over `frames`, or all.
std::vector<int> Sample(const std::vector<int>& frames, std::size_t count)
{
  std::vector<int> some;
  count = std::min(count, frames.size());
  for (std::size_t k = 0; k < count; ++k)
  {
    some.push_back(frames[(2 * k + 1) * frames.size() / (2 * count)]);
  }
  return some;
}

/// Scales all reflectivities by the one factor that brings rendered scattering closest to the frames' (least
/// squares): neighbouring seeds overlap, so inverting the transfer function at each overshoots.
void ScaleReflectivities(Engine& engine, const Sweep& sweep, const std::vector<int>& frames, GaussianField& field)
{
  constexpr std::size_t kSamples = 4;  // frames: one factor needs few
  std::vector<float> scattering(sweep.PixelsPerFrame()), truth(sweep.PixelsPerFrame());
  double product = 0, square = 0;
  for (const int frame : Sample(frames, kSamples))
  {
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

/// Steps after which the rates of the first stage are halved where frames are dense and no time limit tells its end,
/// because the field is to be good whenever somebody stops. The second stage begins at full rates again, so this costs
/// 0.04 dB of 43.1 (ShortTraining.md has what it gains). Sparse frames gain nothing by it: brain sweep -0.1 to -0.2 dB, spine 0.
constexpr double kOpenEndedSteps = 64;

/// The share of the first rates that a field to continue from begins with, for a training of one pass over frames and
/// virtual planes; it grows with the root of passes, up to 1. Whole steps throw a good field back, and few passes do not
/// make up for that (ShortTraining.md).
constexpr double kContinuedRate = 0.2, kLeastContinuedRate = 0.1;

/// Share of training that sees the recorded frames alone, perhaps reduced. Virtual planes join then.
constexpr double kFirstStage = 0.25;

/// What a time limit must leave for virtual planes to be made, else there are fewer or none: passes over them and the
/// frames, and the most of the time left that making them may take.
struct TimeForPlanes
{
  double passes, share;
};
/// On the liver sweep 10 passes over frames alone give the same score as equally many steps over frames and planes.
constexpr TimeForPlanes kDenseTime = {10, 0.25};
/// Frames that share little are learned by heart without planes between them: in 10 s the brain sweep (full size) reaches
/// 25.3 dB without.
constexpr TimeForPlanes kSparseTime = {3, 0.5};

/// Where there is no time for virtual planes, a third of them is tried.
constexpr int kFewerPlanes = 3;
/// The share of them that tells how long all will take.
constexpr double kLeastProjected = 0.1;

/// Steps on one frame that take as long as a virtual plane to be made, for what is told of the time left. Liver sweep at half
/// and at full size, brain and spine sweep, whose planes are made by flow: 1.4, 2.4, 6.7 and 6.
constexpr double kStepsToMakeDensePlane = 2, kStepsToMakeSparsePlane = 6;

/// Pixels of the reduced frames: the smallest scale while training on them. A reduced pixel is a mean over its area,
/// while training takes it for a sample, so what is narrower would be wrong between the samples.
constexpr double kCoarseScale = 0.5;

/// Steps in all, below which every step is taken as two or four on parts of its batch. Few steps are better taken
/// small; in long training they jitter. Held-out PSNR of the liver sweep (half, 100,000 Gaussians), whole steps, halves
/// and quarters: 38.01, 38.32 and 38.53 dB with 153 steps, 42.45, 42.59 and 42.56 with 1376, 43.31 and 43.22 with 3670.
constexpr double kQuarteredSteps = 500, kHalvedSteps = 2000;

/// The end of training that the field is averaged over, and how many fields of it are. A step of Adam jitters by its
/// rate, which the mean does not, so rates need not fall as far (README.md has what this gains).
constexpr double kAveragedFrom = 0.9;
constexpr double kAveragedFields = 20;

/// What a field that is stopped amid training still gets: so many steps or seconds, whichever are over first, because who
/// stops a program waits for it; the share of the rates of then that is left at their end; and the part of them from
/// which on fields are averaged.
constexpr int kSettlingSteps = 40;
constexpr double kSettlingSeconds = 0.6, kSettlingRate = 0.1, kSettledFrom = 2.0 / 3;

/// Training frames that tell which of two fields a caller gets.
constexpr std::size_t kJudges = 8;

/// When frames' gains are found, as fractions of training: once the field says more than one frame does, and
/// again when it is better.
constexpr std::array<double, 2> kCorrections = {0.3, 0.6};

/// First and last densification, as fractions of training: not before error scores mean something, and not so late that
/// what is new cannot settle.
constexpr double kFirstDensification = 0.1, kLastDensification = 0.6;

/// Lines of the log that a training of many iterations writes; each costs a pass over the validation frames.
constexpr int kLogLines = 100;

/// Share of the progress bar that seeding takes.
constexpr double kSeedingShare = 0.1;

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

LearningRates Scaled(const LearningRates& rates, double factor)
{
  return {rates.mean * factor, rates.logScale * factor, rates.rotation * factor, rates.reflectivity * factor};
}

/// PSNR of equal images is infinite; a state holds finite numbers only.
constexpr double kEqualImages = std::numeric_limits<double>::max();

void SavePsnr(double psnr, StateWriter& to)
{
  to.Number(std::min(psnr, kEqualImages));
}

double LoadPsnr(StateReader& from)
{
  const double psnr = from.Number<double>();
  return psnr == kEqualImages ? std::numeric_limits<double>::infinity() : psnr;
}

void SaveKept(const std::optional<FieldPart>& kept, StateWriter& to)
{
  to.Flag(kept.has_value());
  if (kept)
  {
    SaveField(kept->field, to);
    to.Array(kept->places);
  }
}

/// Of several processes one may have no Gaussian.
std::optional<FieldPart> LoadKept(StateReader& from, bool isOfSeveral)
{
  std::optional<FieldPart> kept;
  if (from.Flag())
  {
    kept = FieldPart{LoadField(from), from.Array<std::uint32_t>()};
    StateReader::Require(kept->places.size() == (isOfSeveral ? kept->field.Size() : 0), "places of other Gaussians");
    StateReader::Require(isOfSeveral || kept->field.Size() > 0, "a field of no Gaussian");
  }
  return kept;
}

void SaveLog(const std::vector<TrainingRecord>& log, StateWriter& to)
{
  to.Number<std::uint64_t>(log.size());
  for (const TrainingRecord& line : log)
  {
    to.Number(line.iteration);
    to.Number(line.seconds);
    to.Number(line.loss);
    to.Flag(line.validationPsnr.has_value());
    SavePsnr(line.validationPsnr.value_or(0), to);
    to.Number<std::uint64_t>(line.gaussians);
    to.Number(line.rate);
  }
}

std::vector<TrainingRecord> LoadLog(StateReader& from)
{
  constexpr std::size_t kLineBytes = sizeof(int) + 4 * sizeof(double) + sizeof(std::uint64_t) + 1;
  std::vector<TrainingRecord> log(from.Count(kLineBytes));
  for (TrainingRecord& line : log)
  {
    line.iteration = from.Number<int>();
    line.seconds = from.Number<double>();
    line.loss = from.Number<double>();
    const bool isValidated = from.Flag();
    const double psnr = LoadPsnr(from);
    if (isValidated)
    {
      line.validationPsnr = psnr;
    }
    line.gaussians = from.Number<std::uint64_t>();
    line.rate = from.Number<double>();
  }
  return log;
}

}  // namespace

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

LearningRates FirstRates(const TrainingPlan& plan, const GaussianField& field)
{
  const double meanMagnitude = MeanMagnitude(field.reflectivities);
  LearningRates rates;
  rates.mean = plan.meanRate * plan.pixelSize;
  rates.logScale = plan.shapeRate;
  rates.rotation = plan.shapeRate;
  // An all-dark start has no magnitude to go by; 1 is the mean scattering that gamma aims at.
  rates.reflectivity = plan.reflectivityRate * (meanMagnitude > 0 ? meanMagnitude : 1.0);
  return rates;
}

/// What training keeps from one step to the next, the engine's state apart. The order of the batches follows from the
/// seed and the number of steps.
struct TrainingLoop::Course
{
  int iteration = 0;   ///< steps taken
  int firstStage = 0;  ///< of them in the first stage
  int coarseness = 1;  ///< of the first stage's frames
  Targets second;      ///< of the second stage
  double passes = 0;   ///< over what is trained on
  LearningRates rates;
  std::size_t cap = 0;      ///< DensificationOptions::cap
  double trainingTime = 0;  ///< s, of steps before the last resumption
  double lossSum = 0;       ///< since the last line of the log
  int lossCount = 0;
  std::size_t corrections = 0;  ///< how often frames were corrected
  Corrections corrected;        ///< what was found the last time
  std::vector<TrainingRecord> log;
  std::optional<FieldPart> best;  ///< on the validation frames
  double bestPsnr = 0;
  int sinceBest = 0;               ///< evaluations
  FieldAverage average;            ///< of the last part
  std::optional<FieldPart> first;  ///< at the end of the first stage
  int endsAt = 0;                  ///< the last step, where validation frames brought it forward; 0: as planned

  /// Notes what the validation frames say of the engine's field. False when `patience` evaluations in a row were no
  /// better than the best.
  bool Note(double psnr, const Engine& engine, int patience)
  {
    if (!best || psnr > bestPsnr)
    {
      best = engine.GetPart();
      bestPsnr = psnr;
      sinceBest = 0;
      return true;
    }
    sinceBest = std::min(sinceBest + 1, patience);  // the last part goes on when they are used up
    return sinceBest < patience;
  }
};

TrainingLoop::TrainingLoop(std::shared_ptr<const Sweep> sweep, std::vector<int> frames, TrainingPlan plan,
                           ProgressCallback progress, std::shared_ptr<const Sweep> withVirtualPlanes,
                           Exchange* exchange)
    : exchange_(exchange),
      sweep_(std::move(sweep)),
      frames_(std::move(frames)),
      plan_(std::move(plan)),
      progress_(std::move(progress)),
      engine_(CreatePartEngine(plan_.engine, exchange)),
      withVirtualPlanes_(std::move(withVirtualPlanes))
{
  engine_->SetAccuracy({plan_.tolerance, true});
  Proceed(TrainingProgress::Phase::Seeding, 0.0);
}

TrainingLoop::~TrainingLoop() = default;

/// By what the sides of frames are divided in the first stage of a training of so many Gaussians. Reduced frames would
/// take the detail from a field to continue from, which has it.
int TrainingLoop::FirstCoarsenessFor(std::size_t gaussians) const
{
  return plan_.continued || !HasFirstStage(plan_) ? 1 : FirstCoarseness(*sweep_, frames_.size(), gaussians);
}

/// What the first stage trains on: the recorded frames, reduced where Gaussians are large.
void TrainingLoop::TargetFrames(int coarseness)
{
  isFirstStage_ = true;
  coarseness_ = coarseness;
  targetSweep_ = sweep_;
  targets_ = frames_;
  if (coarseness_ > 1)
  {
    targetSweep_ =
        std::make_shared<const Sweep>(sweep_->Reduced(coarseness_));  // of all, without a copy of frames_ first
  }
  UploadTargets();
}

/// Trains on the frames and virtual planes between them. False, and nothing changes, when making those would take longer
/// than `most` seconds (0: no limit) or the caller said stop.
bool TrainingLoop::TargetPlanes(const Targets& targets, double most)
{
  const double begun = Seconds();
  const auto goOn = [&](double done)
  {
    const double spent = Seconds() - begun;
    const bool isTooSlow = most > 0 && spent > most * std::max(done, kLeastProjected);
    if (done > 0)
    {
      report_.secondsLeft = spent * (1 / done - 1) + secondsOfSecondStage_;
    }
    return Proceed(report_.phase, report_.fraction) && !isTooSlow;
  };
  std::shared_ptr<const Sweep> sweep = sweep_;
  std::vector<int> frames = frames_;
  if (targets.coarseness > 1 || plan_.frameGains)
  {
    sweep = std::make_shared<const Sweep>(sweep_->ReducedOf(frames_, targets.coarseness));
    std::iota(frames.begin(), frames.end(), 0);
  }
  if (targets.planes > 0 && frames.size() > 1)
  {
    FrameInterpolation interpolation = plan_.interpolation;
    interpolation.flow = interpolation.flow && targets.flow;
    const bool isGiven = withVirtualPlanes_ && targets.planes == plan_.virtualPlanes && targets.coarseness == 1 &&
                         interpolation.flow == plan_.interpolation.flow;
    sweep = isGiven ? withVirtualPlanes_ : AddVirtualPlanes(*sweep, frames, targets.planes, interpolation, goOn);
    if (!sweep)
    {
      return false;
    }
    frames.resize(sweep->NumberOfFrames());
    std::iota(frames.begin(), frames.end(), 0);
    const std::vector<double>& along = sweep->timestamps;
    std::sort(frames.begin(), frames.end(), [&along](int a, int b) { return along[a] < along[b]; });
  }
  if (targets.pixelStep > 1)
  {
    targetSweep_ = sweep_;  // reduced frames take no room beside the copy
    UploadTargets();
    sweep = std::make_shared<const Sweep>(sweep->Interleaved(frames, targets.pixelStep));
    frames = AllFrames(*sweep);
  }
  isFirstStage_ = false;
  coarseness_ = targets.coarseness;
  targetSweep_ = plan_.frameGains ? Levelled(*sweep_, frames_, *sweep) : std::move(sweep);
  targets_ = std::move(frames);
  UploadTargets();
  return true;
}

/// The second stage's targets that a time limit leaves time for; they are set. Where planes are dense there may be fewer
/// virtual planes, or none. Where they are sparse frames are reduced instead, because detail is learned last. Before
/// either, planes are made without flow, which takes most of the time.
/// `secondsOfPass` is the first stage's pace; frames of half the sides take half as long. Null, and the first stage's
/// targets stay, when the caller said stop.
std::optional<TrainingLoop::Targets> TrainingLoop::TargetPlanesInTime(double secondsOfPass)
{
  const TimeForPlanes& needed = plan_.sparse ? kSparseTime : kDenseTime;
  const double secondsAtFullSize = coarseness_ * secondsOfPass;
  Targets targets{plan_.virtualPlanes};
  while (targets.planes > 0 && !aborted_)
  {
    const double left = plan_.timeLimit - Seconds();
    const double training = needed.passes * (1 + targets.planes) * secondsAtFullSize / targets.coarseness;
    if (plan_.timeLimit <= 0 ? TargetPlanes(targets)
                             : (1 - needed.share) * left > training && TargetPlanes(targets, needed.share * left))
    {
      return targets;
    }
    if (targets.flow && plan_.interpolation.flow)
    {
      targets.flow = false;
    }
    else if (plan_.sparse && targets.coarseness == 1 && CanReduce(*sweep_))
    {
      targets.coarseness = kReduction;
    }
    else
    {
      targets.planes /= kFewerPlanes;
    }
  }
  if (aborted_)
  {
    return std::nullopt;
  }
  // No virtual planes, or no time for them. A step sees as many pixels of a frame as in the first stage, because few
  // passes are worth more in more steps.
  targets = {0, 1, coarseness_, true};
  TargetPlanes(targets);
  return targets;
}

void TrainingLoop::UploadTargets()
{
  engine_->SetFrames(WithCountedPixels(*targetSweep_, plan_.ignoreMasked));
}

Start TrainingLoop::SeedStart()
{
  TargetFrames(FirstCoarsenessFor(plan_.gaussians));
  Start start;
  start.field = Seed(*targetSweep_, frames_, Beam{plan_.elevationSigma},
                     {plan_.seeding, plan_.gaussians, plan_.seed, plan_.sparse});
  engine_->SetField(start.field);
  ScaleReflectivities(*engine_, *targetSweep_, frames_, start.field);
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

ParameterLimits TrainingLoop::Limits() const
{
  ParameterLimits limits;
  limits.minimumScale =
      coarseness_ > 1 ? std::max(plan_.minimumScale, kCoarseScale * coarseness_ * plan_.pixelSize) : plan_.minimumScale;
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
    return std::max(fraction, (Seconds() - trainingStart) / std::max(plan_.timeLimit - trainingStart, kLeastTime));
  }
  return fraction;
}

/// The share of the first rates that a fraction of the way through training is left. What a step of Adam jitters by is
/// in proportion to its rate, so long training at full rate wears a field out.
double TrainingLoop::RateLeft(double fraction) const
{
  const double left = std::pow(plan_.finalRate, fraction) / std::sqrt(1 + course_->passes / kSettledPasses);
  const bool isOpenEnded = isFirstStage_ && !plan_.sparse && plan_.timeLimit == 0;
  return ContinuedRate(fraction) * (isOpenEnded ? left / (1 + course_->iteration / kOpenEndedSteps) : left);
}

/// Steps in all. With a time limit they follow from those so far, of which there may be none.
double TrainingLoop::StepsInAll(double fraction) const
{
  return plan_.timeLimit > 0 && fraction > 0 ? std::min<double>(plan_.iterations, course_->iteration / fraction)
                                             : plan_.iterations;
}

/// By what the rates of a field to continue from are less than those of seeds.
double TrainingLoop::ContinuedRate(double fraction) const
{
  if (!plan_.continued)
  {
    return 1;
  }
  const double views = static_cast<double>(frames_.size()) * (1 + plan_.virtualPlanes);
  const double passes = StepsInAll(fraction) * plan_.batch / views;
  return std::clamp(kContinuedRate * std::sqrt(passes), kLeastContinuedRate, 1.0);
}

/// By how much a step of the second stage takes longer than one on the first's frames, for what is told of the time left:
/// 1.5 on the liver sweep and 1.3 on the brain's, whose sides are halved first; 1.03 where frames are interleaved then.
double TrainingLoop::Growth() const
{
  return plan_.virtualPlanes > 0 ? std::sqrt(static_cast<double>(coarseness_)) : 1;
}

/// Seconds that the steps left will take, and the virtual planes to be made, at a pace of so many seconds a step.
double TrainingLoop::SecondsLeft(int iteration, double pace) const
{
  if (!isFirstStage_)
  {
    return pace * (plan_.iterations - iteration);
  }
  const double first = kFirstStage * plan_.iterations;
  const double planes = (plan_.sparse ? kStepsToMakeSparsePlane : kStepsToMakeDensePlane) * plan_.virtualPlanes *
                        static_cast<double>(frames_.size()) / plan_.batch;
  return pace * (std::max(0.0, first - iteration) + Growth() * (plan_.iterations - first + planes));
}

/// The loss of a step of the batch, or of several on parts of it where there are few `steps` in all.
double TrainingLoop::Step(const std::vector<int>& batch, double steps, const Loss& loss, const LearningRates& rates)
{
  const std::size_t wanted = steps < kQuarteredSteps ? 4 : steps < kHalvedSteps ? 2 : 1;
  const std::size_t parts = std::min(batch.size(), wanted);
  double sum = 0;
  for (std::size_t part = 0; part < parts; ++part)
  {
    const auto at = [&](std::size_t k)
    { return batch.begin() + static_cast<std::ptrdiff_t>(k * batch.size() / parts); };
    sum += engine_->TrainStep({at(part), at(part + 1)}, loss, rates, Limits());
  }
  return sum / static_cast<double>(parts);
}

void TrainingLoop::Correct(const Corrections& found)
{
  targetSweep_ = Corrected(found, *sweep_, frames_, *targetSweep_);
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

bool TrainingLoop::HasFirstStage(const TrainingPlan& plan)
{
  // Gains are found on the way, which needs all frames as they are from the first step on.
  return plan.iterations > 0 && !plan.frameGains;
}

void TrainingLoop::Replan(TrainingPlan plan)
{
  plan_ = std::move(plan);
  if (plan_.timeLimit > 0)
  {
    plan_.timeLimit += Seconds();
  }
}

void TrainingLoop::Begin(Start start)
{
  course_ = std::make_unique<Course>();
  Course& course = *course_;
  {
    const GaussianField field = Load(std::move(start));
    course.rates = FirstRates(plan_, field);
    course.cap = plan_.densification.cap > 0 ? plan_.densification.cap : 2 * field.Size();
    course.coarseness = FirstCoarsenessFor(field.Size());
  }
  if (!HasFirstStage(plan_))
  {
    course.second.planes = plan_.iterations > 0 ? plan_.virtualPlanes : 0;
    TargetPlanes(course.second);
  }
  else if (!isFirstStage_ || coarseness_ != course.coarseness)  // else seeds come from them
  {
    TargetFrames(course.coarseness);
  }
  if (plan_.densification.interval > 0)
  {
    engine_->ResetScores();
  }
}

void TrainingLoop::Resume(std::string_view state)
{
  StateReader all(state);
  const auto processes = static_cast<std::uint64_t>(exchange_ ? exchange_->Size() : 1);
  const auto here = static_cast<std::uint64_t>(exchange_ ? exchange_->Rank() : 0);
  StateReader::Require(all.Number<std::uint64_t>() == processes, "the parts of another number of processes");
  std::string_view own;
  for (std::uint64_t rank = 0; rank < processes; ++rank)
  {
    const std::string_view part = all.Text();
    own = rank == here ? part : own;
  }
  all.End();
  StateReader from(own);
  course_ = std::make_unique<Course>();
  Course& course = *course_;
  course.iteration = from.NumberIn(1, std::max(plan_.iterations, 1));
  course.firstStage = from.NumberIn(0, course.iteration);
  course.coarseness = from.NumberIn(1, std::min(sweep_->width, sweep_->height));
  course.second.planes = from.NumberIn(0, plan_.virtualPlanes);
  course.second.coarseness = from.NumberIn(1, std::min(sweep_->width, sweep_->height));
  course.second.pixelStep = from.NumberIn(1, course.second.planes > 0 ? 1 : std::min(sweep_->width, sweep_->height));
  course.second.flow = from.Flag();
  course.passes = from.NumberIn(0.0, 1e9);
  const bool isFirstStage = from.Flag();
  course.rates.mean = from.NumberIn(0.0, GaussianField::kLargestCoordinate);
  course.rates.logScale = from.NumberIn(0.0, 1.0);  // OptionList.h
  course.rates.rotation = from.NumberIn(0.0, 1.0);
  course.rates.reflectivity = from.NumberIn(0.0, 10 * GaussianField::kLargestReflectivity);
  course.cap = from.Number<std::uint64_t>();
  course.trainingTime = from.Number<double>();
  course.lossSum = from.Number<double>();
  course.lossCount = from.NumberIn(0, course.iteration);
  course.corrections = from.NumberIn<std::uint64_t>(0, kCorrections.size());
  course.corrected.gains = from.Array<double>();
  course.corrected.offsets = from.Array<double>();
  const std::size_t corrected = plan_.frameGains && course.corrections > 0 ? frames_.size() : 0;
  StateReader::Require(course.corrected.gains.size() == corrected && course.corrected.offsets.size() == corrected,
                       "corrections of other frames");
  course.log = LoadLog(from);
  course.best = LoadKept(from, exchange_ != nullptr);
  course.bestPsnr = LoadPsnr(from);
  course.sinceBest = from.NumberIn(0, plan_.patience);
  course.endsAt = from.NumberIn(0, plan_.iterations);
  course.average.count = from.NumberIn(0, course.iteration);
  if (course.average.count > 0)
  {
    course.average.mean = LoadField(from);
  }
  course.first = LoadKept(from, exchange_ != nullptr);
  engine_->LoadState(from);
  from.End();
  StateReader::Require(engine_->FieldSize() > 0, "a field of no Gaussian");
  StateReader::Require(course.average.count == 0 || course.average.mean.Size() == engine_->GetPart().field.Size(),
                       "the average of another field");
  if (isFirstStage)
  {
    TargetFrames(course.coarseness);
  }
  else
  {
    TargetPlanes(course.second);
  }
  if (course.corrections > 0)
  {
    Correct(course.corrected);
    targetSweep_->Validate();
  }
}

/// Of every process its part, in one state: the first keeps it for all.
void TrainingLoop::Save(StateWriter& to) const
{
  StateWriter own;
  SavePart(own);
  const std::vector<std::string> all = exchange_ ? exchange_->Gather(own.Take()) : std::vector<std::string>{own.Take()};
  to.Number<std::uint64_t>(all.size());
  for (const std::string& part : all)
  {
    to.Text(part);
  }
}

void TrainingLoop::SavePart(StateWriter& to) const
{
  const Course& course = *course_;
  to.Number(course.iteration);
  to.Number(course.firstStage);
  to.Number(course.coarseness);
  to.Number(course.second.planes);
  to.Number(course.second.coarseness);
  to.Number(course.second.pixelStep);
  to.Flag(course.second.flow);
  to.Number(course.passes);
  to.Flag(isFirstStage_);
  for (const double rate : {course.rates.mean, course.rates.logScale, course.rates.rotation, course.rates.reflectivity})
  {
    to.Number(rate);
  }
  to.Number<std::uint64_t>(course.cap);
  to.Number(course.trainingTime);
  to.Number(course.lossSum);
  to.Number(course.lossCount);
  to.Number<std::uint64_t>(course.corrections);
  to.Array(course.corrected.gains);
  to.Array(course.corrected.offsets);
  SaveLog(course.log, to);
  SaveKept(course.best, to);
  SavePsnr(course.bestPsnr, to);
  to.Number(course.sinceBest);
  to.Number(course.endsAt);
  to.Number(course.average.count);
  if (course.average.count > 0)
  {
    SaveField(course.average.mean, to);
  }
  SaveKept(course.first, to);
  engine_->SaveState(to);
}

Fitted TrainingLoop::Run(const std::vector<int>& validationFrames, Until until)
{
  Course& course = *course_;
  DensificationOptions densification = plan_.densification;
  densification.cap = course.cap;
  Batches batches(targets_, plan_.batch, plan_.seed);
  for (int taken = isFirstStage_ ? 0 : course.firstStage; taken < course.iteration; ++taken)
  {
    batches.Next();
  }
  const int logInterval = std::max(1, plan_.iterations / kLogLines);
  const double trainingStart = Seconds() - course.trainingTime;
  double stageStart = Seconds();
  int stageFirst = course.iteration;
  const auto save = [this](StateWriter& to) { Save(to); };
  bool isFinished = course.iteration >= plan_.iterations && !aborted_;
  while (!isFinished && !aborted_)
  {
    const int iteration = course.iteration + 1;
    const double fraction = Fraction(iteration, trainingStart);
    if (fraction >= 1.0)
    {
      break;
    }
    if (isFirstStage_ && fraction >= kFirstStage)
    {
      if (until == Until::FirstStage)
      {
        break;
      }
      course.first = engine_->GetPart();
      const auto second = TargetPlanesInTime((Seconds() - trainingStart) / course.passes);
      if (!second)
      {
        break;
      }
      course.firstStage = course.iteration;
      course.second = *second;
      batches = Batches(targets_, plan_.batch, plan_.seed);
      stageStart = Seconds();
      stageFirst = course.iteration;
    }
    if (plan_.frameGains && course.corrections < kCorrections.size() && fraction >= kCorrections[course.corrections])
    {
      ++course.corrections;
      course.corrected = FindCorrections(*engine_, *sweep_, frames_);
      Correct(course.corrected);
    }
    const std::vector<int> batch = batches.Next();
    if (PixelBytesInFiles() > 0)
    {
      targetSweep_->Prefetch(Batches(batches).Next());  // the batch after this one
    }
    course.passes += static_cast<double>(batch.size()) / static_cast<double>(targets_.size());
    const double rateLeft = RateLeft(fraction), steps = StepsInAll(fraction);
    course.lossSum += Step(batch, steps, Blend(plan_, fraction), Scaled(course.rates, rateLeft));
    ++course.lossCount;
    course.iteration = iteration;
    if (densification.interval > 0 && iteration % densification.interval == 0 && fraction >= kFirstDensification &&
        fraction <= kLastDensification)
    {
      Restructure(densification);
    }
    const bool isLastPart = fraction >= kAveragedFrom || course.endsAt > 0;
    const auto interval = std::max(1L, std::lround((1 - kAveragedFrom) * steps / kAveragedFields));
    if (isLastPart && iteration % interval == 0)
    {
      course.average.Add(engine_->GetPart().field);
    }

    TrainingRecord& line = report_.record;
    line.iteration = iteration;
    line.loss = course.lossSum / course.lossCount;
    line.gaussians = engine_->FieldSize();
    line.rate = rateLeft;
    isFinished = iteration == plan_.iterations || iteration == course.endsAt;
    if (iteration % logInterval == 0 || isFinished)
    {
      line.seconds = Seconds();
      line.validationPsnr.reset();
      if (!validationFrames.empty())
      {
        line.validationPsnr = FieldPsnr(*engine_, *sweep_, validationFrames);
      }
      course.log.push_back(line);
      if (line.validationPsnr && !course.Note(*line.validationPsnr, *engine_, plan_.patience) && !isLastPart)
      {
        // The mean at the end is worth more than what single fields no longer gain, so the end comes, but not at once.
        const double end = iteration + std::ceil((1 - kAveragedFrom) * steps);
        course.endsAt = static_cast<int>(std::min<double>(end, plan_.iterations));
      }
      course.lossSum = 0;
      course.lossCount = 0;
    }
    const double pace = (Seconds() - stageStart) / (iteration - stageFirst);
    report_.secondsLeft = SecondsLeft(iteration, pace);
    secondsOfSecondStage_ = (1 - kFirstStage) * Growth() * pace * plan_.iterations;
    Proceed(TrainingProgress::Phase::Training, kSeedingShare + (1 - kSeedingShare) * fraction);
    course.trainingTime = Seconds() - trainingStart;
    if (keeping_.due && !isFinished && !aborted_ && keeping_.due())
    {
      keeping_.keep(save);
    }
  }
  if (keeping_.keep && !isFinished && course.iteration > 0)
  {
    keeping_.keep(save);
  }
  if (course.average.count > 0)
  {
    engine_->SetPart(course.average.mean);
    if (course.best)
    {
      course.Note(FieldPsnr(*engine_, *sweep_, validationFrames), *engine_, plan_.patience);
    }
  }

  Fitted fitted;
  fitted.log = course.log;
  fitted.iterations = course.iteration;
  fitted.finished = isFinished;
  fitted.field = course.best ? engine_->Gather(*course.best) : engine_->GetField();
  if (plan_.iterations > 0)
  {
    RemoveInvisible(fitted.field, plan_.tolerance);
  }
  fitted.aborted = aborted_;
  return fitted;
}

GaussianField TrainingLoop::Settle(const std::vector<int>& validationFrames)
{
  Course& course = *course_;
  const Stopwatch watch;
  const double fraction = Fraction(course.iteration, Seconds() - course.trainingTime);
  const double rateLeft = RateLeft(fraction);
  Batches batches(targets_, plan_.batch, plan_.seed);
  FieldAverage average;
  double done = 0;
  for (int k = 1; done < 1; ++k)
  {
    const double seconds = exchange_ ? exchange_->OfFirst(watch.Seconds()) : watch.Seconds();
    done = std::max(static_cast<double>(k) / kSettlingSteps, seconds / kSettlingSeconds);
    Step(batches.Next(), plan_.iterations, Blend(plan_, fraction),
         Scaled(course.rates, rateLeft * std::pow(kSettlingRate, std::min(done, 1.0))));
    if (done > kSettledFrom)
    {
      average.Add(engine_->GetPart().field);
    }
  }
  engine_->SetPart(average.mean);
  // The second stage begins with larger steps, which take a field back at first.
  const std::optional<FieldPart>& before = course.best ? course.best : course.first;
  const std::vector<int> judges = course.best ? validationFrames : Sample(frames_, kJudges);
  GaussianField field = engine_->GetField();
  if (before)
  {
    const double psnr = FieldPsnr(*engine_, *sweep_, judges);
    engine_->SetPart(before->field);
    if (FieldPsnr(*engine_, *sweep_, judges) >= psnr)
    {
      field = engine_->Gather(*before);
    }
  }
  RemoveInvisible(field, plan_.tolerance);
  return field;
}

GaussianField TrainingLoop::Nearer(GaussianField a, const GaussianField& b)
{
  const std::vector<int> judges = Sample(frames_, kJudges);
  engine_->SetField(a);
  const double psnr = FieldPsnr(*engine_, *sweep_, judges);
  engine_->SetField(b);
  return FieldPsnr(*engine_, *sweep_, judges) > psnr ? b : std::move(a);
}

/// Since the loop was made. With a time limit what is done depends on them, so processes go by the clock of the first.
double TrainingLoop::Seconds() const
{
  const double seconds = watch_.Seconds();
  return exchange_ && plan_.timeLimit > 0 ? exchange_->OfFirst(seconds) : seconds;
}

bool TrainingLoop::Proceed(TrainingProgress::Phase phase, double fraction)
{
  report_.phase = phase;
  report_.fraction = fraction;
  report_.record.seconds = Seconds();
  aborted_ = aborted_ || (progress_ && !progress_(report_));
  return !aborted_;
}

}  // namespace bigus
