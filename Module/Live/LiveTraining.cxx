// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Live/LiveTraining.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <string>

#include "Core/Evaluation/Baselines.h"
#include "Core/Model/Error.h"
#include "Core/Model/FieldTransform.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Training/FrameInterpolation.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/Seeding.h"
#include "Core/Training/TrainingLoop.h"
#include "Core/Training/TrainingPlan.h"

namespace bigus
{
namespace
{

/// Frames from which geometry and brightness of the sweep are measured before the field begins.
constexpr std::size_t kFirstFrames = 8;

/// Frames that are seeded together, 0.4 s at 20 frames a second. Measured on the liver sweep (half size, six steps a frame)
/// when the last frame had come: 36.5 dB with 8 frames, 36.0 dB with 4, which also take twice as long to be seeded.
constexpr std::size_t kChunk = 8;

/// Steps learn from the recorded frames and from planes midway between them. Without those frames are learned by heart
/// where they lie far apart: held-out frames of the brain sweep (half size) have 1.0 dB less, of the liver 0.1 dB more.
constexpr std::size_t kPlanesOfFrame = 2;

/// Planes: what a step learns from lies so far behind the newest on average. With half of it the newest frames are better
/// and all others worse, with twice it is the other way round.
constexpr double kRecent = 16 * kPlanesOfFrame;

/// Its own updates, after which a Gaussian's steps are short. Without it new frames
/// disturb what the Gaussians that they share with older ones have learned: the oldest frames of the liver sweep fall
/// from 36 to 28 dB.
constexpr double kUpdatesToSettle = 120;
/// What steps are left then. There is no mean of fields here that takes their jitter out.
constexpr double kSettledStep = 0.05;
/// No step of a Gaussian is shorter than by this.
constexpr double kLeastStep = 0.02;

/// A seed stays where more coverage is missing than this share of what fresh seeds bring to its frame. Not a share of full
/// coverage, because Gaussians reach 1.6 gaps beyond the frames that they were seeded for, and the first frames after
/// those would get too few. Liver sweep, when the last frame had come: 39.3 and 39.6 dB with 1/2 and 1/4.
constexpr double kMissing = 0.25;

/// Frames of a chunk that tell how bright its seeds must be.
constexpr std::size_t kScaledFrames = 2;

void RequireIn(const char* name, double value, double least, double most)
{
  Require(value >= least && value <= most, "Live training: ", name, " is ", value, "; it must be from ", least, " to ",
          most, ".");
}

/// The furthest that a corner of the image moved, mm.
double CornerMotion(const LiveFrame& from, const LiveFrame& to)
{
  double motion = 0;
  for (const double i : {0.0, from.width - 1.0})
  {
    for (const double j : {0.0, from.height - 1.0})
    {
      const Eigen::Vector4d corner(i, j, 0, 1);
      motion = std::max(motion, ((to.imageToReference - from.imageToReference) * corner).norm());
    }
  }
  return motion;
}

/// The frames from `first` on as a sweep.
Sweep ToSweep(const std::deque<LiveFrame>& frames, std::size_t first)
{
  Sweep sweep;
  sweep.width = frames[first].width;
  sweep.height = frames[first].height;
  const std::size_t size = sweep.PixelsPerFrame();
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(size * (frames.size() - first));
  for (std::size_t k = first; k < frames.size(); ++k)
  {
    std::memcpy(pixels->data() + (k - first) * size, frames[k].pixels.data(), size);
    sweep.imageToReference.push_back(frames[k].imageToReference);
    sweep.timestamps.push_back(frames[k].timestamp);
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

/// The plane midway between a frame and the next, with what pose interpolation shows there.
LiveFrame Between(const Sweep& sweep, int frame)
{
  const SlicePlane plane = PlaneBetween(sweep.Plane(frame), sweep.Plane(frame + 1), 0.5);
  std::vector<float> image(sweep.PixelsPerFrame());
  PredictPoseInterpolation(sweep, {frame, frame + 1}, plane, image.data());
  LiveFrame between;
  between.width = sweep.width;
  between.height = sweep.height;
  between.imageToReference = plane.ImageToReference();
  between.pixels.resize(image.size());
  std::transform(image.begin(), image.end(), between.pixels.begin(),
                 [](float intensity) { return static_cast<std::uint8_t>(std::lround(255 * intensity)); });
  return between;
}

double MeanOfLit(const Sweep& sweep, const std::vector<float>& image)
{
  double sum = 0, lit = 0;
  for (std::size_t p = 0; p < image.size(); ++p)
  {
    if (sweep.IsLit(p))
    {
      sum += image[p];
      ++lit;
    }
  }
  return lit > 0 ? sum / lit : 0;
}

/// Means over the lit pixels of a square as large as one of `seeds` has of the frame. Between Gaussians there is less
/// coverage than on them, and a probe that stands still would get seeds there again and again.
void AverageOverSeed(const Sweep& sweep, std::size_t seeds, std::vector<float>& coverage)
{
  std::vector<float> lit(coverage.size());
  double area = 0;
  for (std::size_t p = 0; p < lit.size(); ++p)
  {
    lit[p] = sweep.IsLit(p) ? 1.0f : 0.0f;
    coverage[p] *= lit[p];
    area += lit[p];
  }
  const int side = 1 + 2 * static_cast<int>(std::sqrt(area / static_cast<double>(std::max<std::size_t>(seeds, 1))) / 2);
  cv::Mat sum, count;
  cv::boxFilter(cv::Mat(coverage).reshape(1, sweep.height), sum, CV_32F, {side, side});
  cv::boxFilter(cv::Mat(lit).reshape(1, sweep.height), count, CV_32F, {side, side});
  for (std::size_t p = 0; p < lit.size(); ++p)
  {
    coverage[p] = lit[p] > 0 ? sum.ptr<float>()[p] / count.ptr<float>()[p] : 0.0f;
  }
}

bool IsBlack(const LiveFrame& frame)
{
  return std::all_of(frame.pixels.begin(), frame.pixels.end(), [](std::uint8_t pixel) { return pixel == 0; });
}

}  // namespace

struct LiveTraining::Shape
{
  TrainingPlan plan;
  TransferFunction transfer;
  LearningRates rates;
  double coverage = 0;                                    // mean over lit pixels of a frame amid the first
  std::shared_ptr<const std::vector<std::uint8_t>> mask;  // lit by any frame so far
};

void LiveOptions::Validate() const
{
  training.Validate();
  RequireIn("window", window, kFirstFrames, 1024);
  RequireIn("batch", batch, 1, window);
  RequireIn("maximumFrames", static_cast<double>(maximumFrames), window, 1e6);
  RequireIn("maximumGaussians", static_cast<double>(maximumGaussians), 1000, std::size_t(1) << 26);
  Require(memory > 0, "Live training: memory is ", memory, " bytes; it must be above 0.");
  Require(training.holdOut <= 0 && training.validation <= 0,
          "Live training: no frames are held out or kept for validation while a probe moves; set both to 0.");
}

std::size_t LiveOptions::KeptFrames(int width, int height) const
{
  constexpr double kMegabyte = 1e6;
  const double bytes = static_cast<double>(width) * height;
  // Twice the kept ones; and the window's planes by themselves, as a sweep, and both anew while frames come in.
  const double others = 4.0 * static_cast<double>(kPlanesOfFrame) * window + static_cast<double>(kMostWaitingFrames);
  const double room = 0.5 * (memory / bytes - others);
  Require(room >= window, "Live frame: it has ", width, " x ", height, " pixels. The ", window,
          " newest frames, which are learned from, would take ",
          std::llround((others + 2 * window) * bytes / kMegabyte), " MB, more than the ",
          std::llround(memory / kMegabyte),
          " MB that pictures may take. Have the sender make them smaller, or allow more (MemoryLimit, --memory GB).");
  return static_cast<std::size_t>(std::min(room, static_cast<double>(maximumFrames)));
}

LiveTraining::LiveTraining(LiveOptions options) : options_(std::move(options)), random_(options_.training.seed)
{
  options_.Validate();
  engine_ = Engine::Create(options_.training.engine);
  seedEngine_ = Engine::Create(options_.training.engine);
  engine_->SetAccuracy({options_.training.tolerance, true});
  seedEngine_->SetAccuracy({options_.training.tolerance, true});
}

LiveTraining::~LiveTraining() = default;

bool LiveTraining::Add(LiveFrame frame)
{
  Require(frame.width >= 1 && frame.height >= 1 &&
              frame.pixels.size() == static_cast<std::size_t>(frame.width) * frame.height,
          "Live frame: ", frame.pixels.size(), " pixels were given for an image of ", frame.width, " x ", frame.height,
          ".");
  if (!frames_.empty() && (frame.width != frames_.front().width || frame.height != frames_.front().height))
  {
    throw Error("Live frame: it has " + std::to_string(frame.width) + " x " + std::to_string(frame.height) +
                " pixels, but the frames before have " + std::to_string(frames_.front().width) + " x " +
                std::to_string(frames_.front().height) + ". Begin a new field where the scanner's image changes.");
  }
  const std::size_t kept = frames_.empty() ? options_.KeptFrames(frame.width, frame.height) : kept_;
  Require(std::isfinite(frame.timestamp), "Live frame: its time is not a finite number of seconds.");
  const SlicePlane plane = SlicePlane::FromImageToReference(frame.imageToReference, frame.width, frame.height);
  plane.Validate("live frame");
  Require(plane.IsWithinReach(), "live frame: it lies farther than 1e9 mm from the origin; is the pose in mm?");
  if ((!frames_.empty() && frame.timestamp <= lastTime_) || IsBlack(frame))
  {
    return false;
  }
  kept_ = kept;
  lastTime_ = frame.timestamp;
  moved_.push_back(frames_.empty() ? std::numeric_limits<double>::max() : CornerMotion(frames_.back(), frame));
  frames_.push_back(std::move(frame));
  ++waiting_;
  if (waiting_ >= (shape_ ? kChunk : kFirstFrames))
  {
    Absorb();
  }
  return true;
}

void LiveTraining::SeedWaiting()
{
  if (shape_ && waiting_ > 0)
  {
    Absorb();
  }
}

/// Gives seeds to the frames that have none, and makes them part of what steps learn from.
void LiveTraining::Absorb()
{
  // With the frame before, so that the gap to it is known. Seeds at that frame fall away, because it is covered.
  const std::size_t first = frames_.size() - waiting_ - (shape_ ? 1 : 0);
  Sweep chunk = ToSweep(frames_, first);
  std::vector<int> frames = AllFrames(chunk);
  waiting_ = 0;
  if (!shape_)
  {
    chunk = chunk.LitBy(frames);
    shape_ = std::make_unique<Shape>();
    shape_->plan = PlanByGeometry(options_.training, chunk, frames);
  }
  UploadWindow(chunk);
  Pause();
  chunk.mask = shape_->mask;
  if (engine_->FieldSize() >= options_.maximumGaussians)
  {
    return;
  }
  const GaussianField seeds = SeedsFor(chunk, frames);
  GaussianField field = HasField() ? engine_->GetField() : seeds;
  if (HasField() && seeds.Size() > 0)
  {
    Pause();
    std::vector<int> parents(field.Size() + seeds.Size(), -1);
    std::iota(parents.begin(), parents.begin() + static_cast<std::ptrdiff_t>(field.Size()), 0);
    field.Append(seeds);
    engine_->SetField(field, &parents);
  }
  else if (!HasField())
  {
    engine_->SetField(field);
  }
  if (shape_->rates.mean == 0)
  {
    shape_->rates = FirstRates(shape_->plan, field);
    shape_->rates.settling = -std::log(kSettledStep) / kUpdatesToSettle;
    shape_->rates.settled = kLeastStep;
  }
}

/// Seeds where the frames are not covered by the field yet, so bright that field and seeds together come near the
/// frames.
GaussianField LiveTraining::SeedsFor(const Sweep& chunk, const std::vector<int>& frames)
{
  GaussianField seeds = FreshSeeds(chunk, frames);
  std::vector<std::vector<float>> scattering(frames.size());  // the field's
  KeepWhatIsMissing(chunk, frames, seeds, scattering);
  if (seeds.Size() > 0)
  {
    ScaleToWhatIsMissing(chunk, frames, scattering, seeds);
  }
  return seeds;
}

/// As many seeds as the frames get, whatever the field has there, under the field's gamma.
GaussianField LiveTraining::FreshSeeds(const Sweep& chunk, const std::vector<int>& frames)
{
  const std::size_t most = options_.maximumGaussians - std::min(options_.maximumGaussians, NumberOfGaussians());
  const std::size_t usual = options_.training.gaussians ? *options_.training.gaussians * frames.size() / 100
                                                        : GaussiansOfSweepsSize(chunk, frames.size());
  SeedingOptions seeding{shape_->plan.seeding, std::max<std::size_t>(1, std::min(usual, most)), random_(),
                         shape_->plan.sparse};
  GaussianField seeds = Seed(chunk, frames, Beam{shape_->plan.elevationSigma}, seeding);
  if (!HasField())
  {
    shape_->transfer = seeds.transfer;
  }
  Pause();
  // S = -ln(1 - I) / gamma: the same picture under the field's gamma.
  for (double& r : seeds.reflectivities)
  {
    r *= seeds.transfer.gamma / shape_->transfer.gamma;
  }
  seeds.transfer = shape_->transfer;
  return seeds;
}

/// Keeps of the seeds those in places that the field covers too little. `scattering` becomes what the field shows of the
/// frames; without a field it stays empty, and all seeds stay.
void LiveTraining::KeepWhatIsMissing(const Sweep& chunk, const std::vector<int>& frames, GaussianField& seeds,
                                     std::vector<std::vector<float>>& scattering)
{
  const std::size_t pixels = chunk.PixelsPerFrame();
  seedEngine_->SetField(seeds);
  std::vector<double> brought(frames.size());
  std::vector<std::vector<float>> covered(frames.size());
  std::vector<float> seeded(pixels), coverage(pixels);
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    seedEngine_->Render(chunk.Plane(frames[k]), ViewOutput::Scattering, seeded.data(), coverage.data());
    brought[k] = MeanOfLit(chunk, coverage);
    if (HasField())
    {
      covered[k].resize(pixels);
      scattering[k].resize(pixels);
      engine_->Render(chunk.Plane(frames[k]), ViewOutput::Scattering, scattering[k].data(), covered[k].data());
      AverageOverSeed(chunk, seeds.Size() / frames.size(), covered[k]);
    }
    Pause();
  }
  if (!HasField())
  {
    shape_->coverage = *std::max_element(brought.begin(), brought.end());
    return;
  }

  // What counts is a seed's pixel of the nearest frame.
  std::vector<SlicePlane> planes;
  std::vector<Eigen::Matrix3d> toSlice;
  for (const int frame : frames)
  {
    planes.push_back(chunk.Plane(frame));
    toSlice.push_back(planes.back().WorldToSlice());
  }
  const auto isMissing = [&](std::size_t s)
  {
    std::size_t nearest = 0;
    Eigen::Vector3d at = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
    for (std::size_t k = 0; k < planes.size(); ++k)
    {
      const Eigen::Vector3d here = toSlice[k] * (seeds.means[s] - planes[k].origin);
      if (std::abs(here.z()) < std::abs(at.z()))
      {
        nearest = k;
        at = here;
      }
    }
    const int i = std::clamp(static_cast<int>(std::lround(at.x())), 0, chunk.width - 1);
    const int j = std::clamp(static_cast<int>(std::lround(at.y())), 0, chunk.height - 1);
    const double missing = shape_->coverage - covered[nearest][static_cast<std::size_t>(j) * chunk.width + i];
    return missing > kMissing * std::min(brought[nearest], shape_->coverage);
  };
  Keep(seeds, isMissing);
}

/// Multiplies the seeds' reflectivities by the one factor f for which field + f seeds is nearest to the frames, by least
/// squares over a few of them.
void LiveTraining::ScaleToWhatIsMissing(const Sweep& chunk, const std::vector<int>& frames,
                                        const std::vector<std::vector<float>>& scattering, GaussianField& seeds)
{
  const std::size_t pixels = chunk.PixelsPerFrame();
  seedEngine_->SetField(seeds);
  std::vector<float> truth(pixels), seeded(pixels);
  double product = 0, square = 0;
  const std::size_t samples = std::min(kScaledFrames, frames.size() - 1);
  for (std::size_t n = 1; n <= samples; ++n)
  {
    const std::size_t k = n * (frames.size() - 1) / samples;
    chunk.CopyFrame(frames[k], truth.data());
    seedEngine_->Render(chunk.Plane(frames[k]), ViewOutput::Scattering, seeded.data());
    for (std::size_t p = 0; p < pixels; ++p)
    {
      if (!chunk.IsLit(p))
      {
        continue;
      }
      const double missing = shape_->transfer.Scattering<double>(truth[p]) - (HasField() ? scattering[k][p] : 0.0f);
      product += missing * seeded[p];
      square += static_cast<double>(seeded[p]) * seeded[p];
    }
  }
  const double factor = square > 0 ? std::max(0.0, product / square) : 0.0;
  for (double& r : seeds.reflectivities)
  {
    r *= factor;
  }
}

/// Makes the newest frames what steps learn from. `chunk` are those that are new.
void LiveTraining::UploadWindow(const Sweep& chunk)
{
  std::shared_ptr<const std::vector<std::uint8_t>> mask = chunk.LitBy(AllFrames(chunk)).mask;
  if (shape_->mask && mask)
  {
    auto both = std::make_shared<std::vector<std::uint8_t>>(*mask);
    std::transform(both->begin(), both->end(), shape_->mask->begin(), both->begin(),
                   [](std::uint8_t a, std::uint8_t b) { return a | b; });
    mask = both;
  }
  shape_->mask = HasField() && !shape_->mask ? nullptr : mask;  // null: all is lit
  const std::vector<double> gaps = GapsBetween(chunk, AllFrames(chunk));
  const double longest = kBreak * MeasureGeometry(chunk, AllFrames(chunk)).usualSpacing;
  for (int frame = 0; frame < chunk.NumberOfFrames(); ++frame)
  {
    if (frame > 0 && gaps[frame - 1] <= longest)  // else nothing is known of what lies between
    {
      targets_.push_back(Between(chunk, frame - 1));
      Pause();
    }
    if (frame > 0 || targets_.empty())
    {
      targets_.push_back(frames_[frames_.size() - chunk.NumberOfFrames() + frame]);
    }
  }
  const std::size_t most = kPlanesOfFrame * static_cast<std::size_t>(options_.window);
  targets_.erase(targets_.begin(), targets_.end() - static_cast<std::ptrdiff_t>(std::min(most, targets_.size())));
  Sweep recent = ToSweep(targets_, 0);
  recent.mask = shape_->mask;
  recent_ = WithCountedPixels(recent, shape_->plan.ignoreMasked);
  engine_->SetFrames(recent_);
  ThinOut();
}

/// Keeps at most as many frames as it may. The window's are not touched.
void LiveTraining::ThinOut()
{
  while (frames_.size() > kept_)
  {
    const auto end =
        moved_.end() - std::min<std::ptrdiff_t>(options_.window, static_cast<std::ptrdiff_t>(moved_.size()));
    const auto least = end - moved_.begin() > 1 ? std::min_element(moved_.begin() + 1, end) : moved_.begin();
    const std::ptrdiff_t at = least - moved_.begin();
    frames_.erase(frames_.begin() + at);
    moved_.erase(least);
    if (at > 0)
    {
      moved_[at] = CornerMotion(frames_[at - 1], frames_[at]);
    }
  }
}

bool LiveTraining::Step()
{
  if (!HasField())
  {
    return false;
  }
  // Exponentially more often the newer they are; and one from each of equally probable stretches of the window, because a
  // step moves more Gaussians by frames that lie apart, and each Gaussian is seen at more steps.
  const int count = recent_->NumberOfFrames(), batch = std::min(options_.batch, count);
  const double u = static_cast<double>(random_() >> 11) * 0x1p-53;
  std::vector<int> frames;
  for (int k = 0; k < batch; ++k)
  {
    const double back = -kRecent * std::log1p((u + k) / batch * std::expm1(-count / kRecent));
    const int frame = count - 1 - std::min(count - 1, static_cast<int>(back));
    if (frames.empty() || frames.back() != frame)  // the newest stretches may be shorter than a frame
    {
      frames.push_back(frame);
    }
  }
  ParameterLimits limits;
  limits.minimumScale = shape_->plan.minimumScale;
  limits.maximumScale = shape_->plan.maximumScale;
  limits.positiveReflectivity = !shape_->plan.signedReflectivity;
  engine_->TrainStep(frames, shape_->plan.loss, shape_->rates, limits);
  ++steps_;
  return true;
}

GaussianField LiveTraining::Field() const
{
  return HasField() ? engine_->GetField() : GaussianField{};
}

void LiveTraining::Render(const SlicePlane& plane, ViewOutput output, float* image, float* coverage)
{
  if (HasField())
  {
    engine_->Render(plane, output, image, coverage);
    return;
  }
  plane.Validate("slice plane");
  std::fill_n(image, plane.NumberOfPixels(), 0.0f);
  if (coverage)
  {
    std::fill_n(coverage, plane.NumberOfPixels(), 0.0f);
  }
}

Sweep LiveTraining::Frames() const
{
  return frames_.empty() ? Sweep{} : ToSweep(frames_, 0);
}

LiveResult LiveTraining::Finish(double seconds, const ProgressCallback& progress)
{
  Require(HasField(),
          "Live training: there is no field yet. It begins with the eighth frame that shows anything; there are ",
          frames_.size(), ".");
  Require(seconds > 0, "Live training: finishing takes a time above 0 s.");
  SeedWaiting();
  TrainerOptions options = options_.training;
  options.timeLimit = seconds;
  const GaussianField start = engine_->GetField();
  LiveResult result;
  result.sweep = std::make_shared<const Sweep>(Frames());
  result.training = Train(result.sweep, options, &start, progress);
  const GaussianField& field = result.training.field;
  // Gaussians go on as settled ones where frames come in again: each inherits the count of one that took part.
  std::vector<int> parents(field.Size());
  for (std::size_t i = 0; i < parents.size(); ++i)
  {
    parents[i] = static_cast<int>(std::min(i, start.Size() - 1));
  }
  engine_->SetField(field, &parents);
  return result;
}

}  // namespace bigus
