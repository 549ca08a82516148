// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>

#include "Core/Inspection/Rules.h"
#include "Core/Model/PixelMemory.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr float kLevels = 255;
constexpr std::size_t kLookedAt = 48;  // frames, evenly spread
constexpr std::size_t kFewestFrames = 8;
constexpr float kSame = 2.5f;        // grey levels that compression and rounding leave between equal pixels
constexpr double kSameShare = 0.95;  // of the frames
constexpr float kDarkest = 12;       // grey levels: darker pixels that never change are the ground that text stands on
constexpr float kWhite = 253;        // grey levels: of saturated tissue
constexpr int kSmallest = 4;         // pixels that touch each other
constexpr int kRing = 2, kRim = 2;   // pixels: what a group is compared with, and what is filled around it
/// Grey levels, and changes from frame to frame, by which a pixel of the ring differs from the group; and the share of the
/// ring that does. Saturated tissue does not change either, but fades into what is around it.
constexpr float kContrast = 12, kContrastChanges = 1.0f;
constexpr double kRingShare = 0.7;
constexpr double kReached = 0.05;     // share of a window that is not covered, from which its mean is taken
constexpr double kMostPixels = 0.25;  // of a frame: more is a scene that does not change

/// How every pixel behaves over the frames, [height][width] grey levels.
struct Behaviour
{
  cv::Mat value;   ///< of the middle frame
  cv::Mat change;  ///< mean magnitude of the difference to it
  cv::Mat same;    ///< CV_8U, 255 where kSameShare of the frames show what the first or the middle one shows
};

Behaviour Behave(const Sweep& sweep, const std::vector<int>& frames)
{
  const cv::Mat first = LevelsOf(sweep, frames.front()), middle = LevelsOf(sweep, frames[frames.size() / 2]);
  cv::Mat change = cv::Mat::zeros(first.size(), CV_32F), difference;
  cv::Mat asFirst = cv::Mat::zeros(first.size(), CV_8U), asMiddle = asFirst.clone();  // counts, at most kLookedAt
  for (const int frame : frames)
  {
    const cv::Mat image = LevelsOf(sweep, frame);
    cv::absdiff(image, first, difference);
    asFirst += (difference <= kSame) & 1;
    cv::absdiff(image, middle, difference);
    asMiddle += (difference <= kSame) & 1;
    cv::accumulate(difference, change);
  }
  Behaviour behaviour;
  middle.convertTo(behaviour.value, CV_32F);
  behaviour.change = change / static_cast<double>(frames.size());
  behaviour.same = cv::max(asFirst, asMiddle) >= kSameShare * static_cast<double>(frames.size());
  return behaviour;
}

/// Whether the group `label`, which lies within `box`, stands out from what is around it.
bool StandsOut(const Behaviour& behaviour, const cv::Mat& labels, int label, const cv::Rect& box)
{
  const cv::Rect around = cv::Rect(box.x - kRing, box.y - kRing, box.width + 2 * kRing, box.height + 2 * kRing) &
                          cv::Rect({0, 0}, labels.size());
  const cv::Mat group = labels(around) == label, isStill = labels(around) != 0;
  cv::Mat ring;
  cv::dilate(group, ring, cv::Mat::ones(2 * kRing + 1, 2 * kRing + 1, CV_8U));
  ring &= ~isStill;
  const auto value = static_cast<float>(cv::mean(behaviour.value(around), group)[0]);
  const cv::Mat differs =
      cv::abs(behaviour.value(around) - value) - kContrastChanges * behaviour.change(around) >= kContrast;
  const int all = cv::countNonZero(ring);
  return all > 0 && cv::countNonZero(differs & ring) >= kRingShare * all;
}

/// Replaces filled pixels by means of Gaussian windows over those that are not covered, of 1 pixel where that reaches some,
/// else of twice as many, and so on. Blackened pixels become black.
void Fill(cv::Mat& image, const cv::Mat& covered)
{
  cv::Mat open = covered == 0, weights;
  open.convertTo(weights, CV_32F, 1.0 / 255);
  const cv::Mat weighted = image.mul(weights);
  cv::Mat left = covered == kFilled;
  for (double sigma = 1; cv::countNonZero(left) > 0 && sigma < std::max(image.cols, image.rows); sigma *= 2)
  {
    cv::Mat sums, shares;
    cv::GaussianBlur(weighted, sums, {}, sigma);
    cv::GaussianBlur(weights, shares, {}, sigma);
    const cv::Mat reached = left & (shares > kReached);
    cv::Mat(sums / shares).copyTo(image, reached);
    left &= ~reached;
  }
  image.setTo(0, covered == kBlackened);
}

}  // namespace

std::optional<Finding> FindOverlay(const Sweep& sweep, const GreyLevels& levels, const std::vector<int>& frames,
                                   std::vector<std::uint8_t>& covered)
{
  // Averaged tissue hardly changes, and averaged text mixes with it: whoever averages looks before.
  if (frames.size() < kFewestFrames || sweep.averaged > 1)
  {
    return std::nullopt;
  }
  const Behaviour behaviour = Behave(sweep, EvenlySpread(frames, kLookedAt));
  covered.resize(sweep.PixelsPerFrame(), 0);
  cv::Mat still = behaviour.same & (behaviour.value >= kDarkest) & (cv::Mat(covered).reshape(1, sweep.height) == 0);
  if (levels.IsSaturated())
  {
    still &= behaviour.value < kWhite;
  }
  cv::Mat labels, boxes, middles;
  const int groups = cv::connectedComponentsWithStats(still, labels, boxes, middles, 8);
  cv::Mat overlay = cv::Mat::zeros(still.size(), CV_8U);
  for (int label = 1; label < groups; ++label)
  {
    const int* stats = boxes.ptr<int>(label);
    const cv::Rect box(stats[cv::CC_STAT_LEFT], stats[cv::CC_STAT_TOP], stats[cv::CC_STAT_WIDTH],
                       stats[cv::CC_STAT_HEIGHT]);
    if (stats[cv::CC_STAT_AREA] >= kSmallest && StandsOut(behaviour, labels, label, box))
    {
      overlay(box).setTo(255, labels(box) == label);  // a hostile picture has very many groups
    }
  }
  const int pixels = cv::countNonZero(overlay);
  if (pixels == 0 || pixels > kMostPixels * static_cast<double>(sweep.PixelsPerFrame()))
  {
    return std::nullopt;
  }
  cv::dilate(overlay, overlay, cv::Mat::ones(2 * kRim + 1, 2 * kRim + 1, CV_8U));
  std::transform(covered.begin(), covered.end(), overlay.begin<std::uint8_t>(), covered.begin(),
                 [](std::uint8_t now, std::uint8_t isOverlay) { return now == 0 && isOverlay ? kFilled : now; });
  Finding found{FindingKind::Overlay, frames, static_cast<std::size_t>(cv::countNonZero(overlay)), true, {}};
  found.evidence = std::to_string(pixels) + " bright pixels are the same in all frames and unlike those around them";
  return found;
}

Sweep WithoutOverlay(const Sweep& sweep, const std::vector<std::shared_ptr<const std::vector<std::uint8_t>>>& covered)
{
  const std::size_t pixels = sweep.PixelsPerFrame(), all = pixels * covered.size();
  const bool isBytes = sweep.pixelType == Sweep::PixelType::UInt8;
  const std::shared_ptr<std::uint8_t> bytes = AllocatePixels<std::uint8_t>(isBytes ? all : 0);
  const std::shared_ptr<float> floats = AllocatePixels<float>(isBytes ? 0 : all);
  cv::Mat image(sweep.height, sweep.width, CV_32F);
  for (std::size_t k = 0; k < covered.size(); ++k)
  {
    sweep.CopyFrame(static_cast<int>(k), image.ptr<float>());
    if (covered[k])
    {
      Fill(image, cv::Mat(*covered[k]).reshape(1, sweep.height));
    }
    const float* from = image.ptr<float>();
    if (isBytes)
    {
      std::transform(from, from + pixels, bytes.get() + k * pixels,
                     [](float value) { return static_cast<std::uint8_t>(std::lround(kLevels * value)); });
    }
    else
    {
      std::copy_n(from, pixels, floats.get() + k * pixels);
    }
  }
  Sweep filled = sweep;
  filled.pixels = isBytes ? std::shared_ptr<const void>(bytes) : floats;
  return filled;
}

}  // namespace bigus
