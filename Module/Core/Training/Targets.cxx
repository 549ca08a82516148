// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/Targets.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "Core/Formula/SsimWindow.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/VirtualPlanes.h"

namespace bigus
{
namespace
{

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

/// Pixels of the reduced frames: the smallest scale while training on them. A reduced pixel is a mean over its area,
/// while training takes it for a sample, so what is narrower would be wrong between the samples.
constexpr double kCoarseScale = 0.5;

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

Targets::Targets(std::shared_ptr<const Sweep> sweep, std::vector<int> frames, const TrainingPlan& plan, Engine& engine,
                 Report& report, std::shared_ptr<const Sweep> withVirtualPlanes)
    : sweep_(std::move(sweep)),
      recorded_(std::move(frames)),
      plan_(plan),
      engine_(engine),
      report_(report),
      withVirtualPlanes_(std::move(withVirtualPlanes))
{
}

void Targets::SetFrames(int coarseness)
{
  if (areFramesAlone_ && coarseness_ == coarseness)
  {
    return;  // seeds come from them
  }
  areFramesAlone_ = true;
  coarseness_ = coarseness;
  images_ = sweep_;
  frames_ = recorded_;
  if (coarseness > 1)
  {
    images_ = std::make_shared<const Sweep>(sweep_->Reduced(coarseness));  // of all, without a copy of frames_ first
  }
  Upload();
}

bool Targets::SetPlanes(const SecondStage& stage, double most, double after)
{
  std::shared_ptr<const Sweep> images = sweep_;
  std::vector<int> frames = recorded_;
  if (stage.coarseness > 1 || plan_.frameGains)
  {
    images = std::make_shared<const Sweep>(sweep_->ReducedOf(recorded_, stage.coarseness));
    std::iota(frames.begin(), frames.end(), 0);
  }
  if (stage.planes > 0 && frames.size() > 1)
  {
    if (!AddPlanes(stage, most, after, images, frames))
    {
      return false;
    }
  }
  if (stage.pixelStep > 1)
  {
    images_ = sweep_;  // reduced frames take no room beside the copy
    Upload();
    images = std::make_shared<const Sweep>(images->Interleaved(frames, stage.pixelStep));
    frames = AllFrames(*images);
  }
  areFramesAlone_ = false;
  coarseness_ = stage.coarseness;
  images_ = plan_.frameGains ? Levelled(*sweep_, recorded_, *images) : std::move(images);
  frames_ = std::move(frames);
  Upload();
  return true;
}

/// Puts virtual planes between the `frames` of `images`. False where SetPlanes is.
bool Targets::AddPlanes(const SecondStage& stage, double most, double after, std::shared_ptr<const Sweep>& images,
                        std::vector<int>& frames) const
{
  const double begun = report_.Seconds();
  const auto goOn = [&](double done)
  {
    const double spent = report_.Seconds() - begun;
    const bool isTooSlow = most > 0 && spent > most * std::max(done, kLeastProjected);
    if (done > 0)
    {
      report_.Now().secondsLeft = spent * (1 / done - 1) + after;
    }
    return report_.Proceed() && !isTooSlow;
  };
  FrameInterpolation interpolation = plan_.interpolation;
  interpolation.flow = interpolation.flow && stage.flow;
  const bool isGiven = withVirtualPlanes_ && stage.planes == plan_.virtualPlanes && stage.coarseness == 1 &&
                       interpolation.flow == plan_.interpolation.flow;
  images = isGiven ? withVirtualPlanes_ : AddVirtualPlanes(*images, frames, stage.planes, interpolation, goOn);
  if (!images)
  {
    return false;
  }
  std::vector<int> recorded(frames.size());  // they come first in `images`
  std::iota(recorded.begin(), recorded.end(), 0);
  frames = AllFrames(*images);
  // A pass has frames twice where they are sparse: what lies far between them is a guess, and frames are not. Where they are
  // dense a plane between them is a mean, which has less of the noise of poses and speckle.
  if (plan_.sparse)
  {
    frames.insert(frames.end(), recorded.begin(), recorded.end());
  }
  const std::vector<double>& along = images->timestamps;
  std::sort(frames.begin(), frames.end(), [&along](int a, int b) { return along[a] < along[b]; });
  return true;
}

std::optional<SecondStage> Targets::SetPlanesInTime(double secondsOfPass, double after)
{
  const TimeForPlanes& needed = plan_.sparse ? kSparseTime : kDenseTime;
  const double secondsAtFullSize = coarseness_ * secondsOfPass;
  SecondStage stage{plan_.virtualPlanes};
  while (stage.planes > 0 && !report_.IsAborted())
  {
    double most = 0;
    bool isTime = true;
    if (plan_.timeLimit > 0)
    {
      const double left = plan_.timeLimit - report_.Seconds();
      isTime = (1 - needed.share) * left > needed.passes * (1 + stage.planes) * secondsAtFullSize / stage.coarseness;
      most = needed.share * left;
    }
    const bool isSet = isTime && SetPlanes(stage, most, after);
    if (isSet)
    {
      return stage;
    }
    if (stage.flow && plan_.interpolation.flow)
    {
      stage.flow = false;
    }
    else if (plan_.sparse && stage.coarseness == 1 && CanReduce(*sweep_))
    {
      stage.coarseness = kReduction;
    }
    else
    {
      stage.planes /= kFewerPlanes;
    }
  }
  if (report_.IsAborted())
  {
    return std::nullopt;
  }
  // No virtual planes, or no time for them. A step sees as many pixels of a frame as in the first stage, because few
  // passes are worth more in more steps.
  stage = {0, 1, coarseness_, true};
  SetPlanes(stage);
  return stage;
}

void Targets::Correct(const Corrections& found)
{
  images_ = Corrected(found, *sweep_, recorded_, *images_);
  Upload();
}

ParameterLimits Targets::Limits() const
{
  ParameterLimits limits;
  limits.minimumScale =
      coarseness_ > 1 ? std::max(plan_.minimumScale, kCoarseScale * coarseness_ * plan_.pixelSize) : plan_.minimumScale;
  limits.maximumScale = plan_.maximumScale;
  limits.positiveReflectivity = !plan_.signedReflectivity;
  return limits;
}

void Targets::Upload()
{
  engine_.SetFrames(WithCountedPixels(*images_, plan_.ignoreMasked));
}

}  // namespace bigus
