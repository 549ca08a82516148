// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where a probe can light pixels follows from those that are not black (Sweep::LitBy). A screen's grey, or a video's
// noise, hides that.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "Core/Inspection/Rules.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr std::size_t kLookedAt = 48;  // frames, evenly spread
constexpr std::size_t kFewestFrames = 8;
constexpr int kCorners = 16;         // a corner is such a part of the width and of the height
constexpr int kFewestPixels = 16;    // of a corner: fewer tell no level
constexpr int kBrightest = 64;       // grey levels of the ground: beyond is tissue, or a scene
constexpr int kAlike = 3;            // grey levels between both corners
constexpr int kEven = 5;             // grey levels: noise of a video about the ground, in ...
constexpr double kEvenShare = 0.75;  // ... so many of a corner's pixels: there may be text
constexpr double kOther = 3;         // grey levels by which the mean of a lit pixel differs, or which it changes by ...
constexpr double kOverNoise = 2;     // ... where that is twice as much as the ground does
constexpr double kLargePart = 0.01;  // of all that differ: smaller groups are text, and so are ...
constexpr double kChangingPart = 0.25;  // ... those of which less than this share changes
constexpr double kFull = 0.5;           // of what a probe lights: echoes of less are a few in the dark, not a picture
constexpr double kLeastShare = 0.05;    // of a frame: less that counts as lit and is not, is not worth a word
constexpr double kMostChanging = 0.04;  // of what lies beside the picture: there may be a clock

/// How every pixel behaves over the frames, [height][width] grey levels, and how many of the upper corners' pixels in all
/// frames have each level.
struct Behaviour
{
  cv::Mat mean, deviation;
  std::array<std::vector<int>, 2> levels = {std::vector<int>(256, 0), std::vector<int>(256, 0)};
};

/// The upper corners of the rectangle that a mask leaves.
std::array<cv::Rect, 2> CornersOf(const Sweep& sweep)
{
  const cv::Rect whole(0, 0, sweep.width, sweep.height);
  const cv::Rect open = sweep.mask ? cv::boundingRect(cv::Mat(*sweep.mask).reshape(1, sweep.height)) : whole;
  const cv::Size size(std::max(1, open.width / kCorners), std::max(1, open.height / kCorners));
  return {cv::Rect(open.tl(), size) & whole, cv::Rect({open.br().x - size.width, open.y}, size) & whole};
}

Behaviour Behave(const Sweep& sweep, const std::vector<int>& frames, const std::array<cv::Rect, 2>& corners)
{
  const cv::Mat hidden = sweep.mask ? cv::Mat(cv::Mat(*sweep.mask).reshape(1, sweep.height) == 0) : cv::Mat();
  Behaviour behaviour;
  cv::Mat sum = cv::Mat::zeros(sweep.height, sweep.width, CV_32F), squares = sum.clone();
  for (const int frame : frames)
  {
    cv::Mat image = LevelsOf(sweep, frame);
    if (sweep.mask)
    {
      image.setTo(0, hidden);
    }
    cv::accumulate(image, sum);
    cv::accumulateSquare(image, squares);
    for (std::size_t side = 0; side < corners.size(); ++side)
    {
      const cv::Mat corner = image(corners[side]);
      std::for_each(corner.begin<std::uint8_t>(), corner.end<std::uint8_t>(),
                    [&counts = behaviour.levels[side]](std::uint8_t level) { ++counts[level]; });
    }
  }
  behaviour.mean = sum / static_cast<double>(frames.size());
  const cv::Mat variance = squares / static_cast<double>(frames.size()) - behaviour.mean.mul(behaviour.mean);
  cv::sqrt(cv::max(variance, 0.0), behaviour.deviation);
  return behaviour;
}

/// The grey level of what lies beside the picture, where both corners show it; nothing where they are black, or show more.
std::optional<double> GroundOf(const Behaviour& behaviour)
{
  std::array<int, 2> grounds{};
  bool isBlack = true;
  for (std::size_t side = 0; side < grounds.size(); ++side)
  {
    const std::vector<int>& counts = behaviour.levels[side];
    const auto between = [&counts](int first, int last) {
      return std::accumulate(counts.begin() + std::clamp(first, 0, 256), counts.begin() + std::clamp(last, 0, 256), 0);
    };
    int& ground = grounds[side];
    const int all = between(0, 256);
    while (2 * between(0, ground + 1) < all)
    {
      ++ground;
    }
    if (ground > kBrightest || between(ground - kEven, ground + kEven + 1) < kEvenShare * all)
    {
      return std::nullopt;
    }
    isBlack = isBlack && counts[0] == all;
  }
  return isBlack || std::abs(grounds[0] - grounds[1]) > kAlike ? std::nullopt
                                                               : std::optional(0.5 * (grounds[0] + grounds[1]));
}

/// How much pixels of the corners change, on the median.
double NoiseOf(const cv::Mat& deviation, const std::array<cv::Rect, 2>& corners)
{
  std::vector<double> values;
  for (const cv::Rect& corner : corners)
  {
    const cv::Mat part = deviation(corner);
    values.insert(values.end(), part.begin<float>(), part.end<float>());
  }
  return ShareBelow(values, 0.5);
}

/// Of the pixels that are not the ground, large groups of which enough change; 255 there.
cv::Mat PictureOf(const cv::Mat& other, const cv::Mat& changes)
{
  cv::Mat labels, boxes, middles, picture;
  cv::erode(other, picture, cv::Mat::ones(3, 3, CV_8U));
  cv::dilate(picture, picture, cv::Mat::ones(5, 5, CV_8U));  // more than was taken: rims and tips come back
  picture &= other;
  const int all = cv::countNonZero(picture),
            groups = cv::connectedComponentsWithStats(picture, labels, boxes, middles, 8);
  std::vector<int> changing(groups, 0);
  for (int y = 0; y < labels.rows; ++y)
  {
    for (int x = 0; x < labels.cols; ++x)
    {
      changing[labels.at<int>(y, x)] += changes.at<std::uint8_t>(y, x) != 0;
    }
  }
  std::vector<std::uint8_t> isTissue(groups, 0);
  for (int label = 1; label < groups; ++label)
  {
    const int area = boxes.at<int>(label, cv::CC_STAT_AREA);
    isTissue[label] = area >= kLargePart * all && changing[label] >= kChangingPart * area ? 255 : 0;
  }
  std::transform(labels.begin<int>(), labels.end<int>(), picture.begin<std::uint8_t>(),
                 [&isTissue](int label) { return isTissue[label]; });
  return picture;
}

/// What a probe lights where `bright` is all that is not black; 255 there.
cv::Mat LitWhere(const cv::Mat& bright)
{
  Sweep one;
  one.width = bright.cols;
  one.height = bright.rows;
  one.imageToReference.resize(1, Eigen::Matrix4d::Identity());
  one.pixels = std::shared_ptr<const void>(std::shared_ptr<const void>(), bright.data);
  const Sweep lit = one.LitBy({0});
  return lit.mask ? cv::Mat(cv::Mat(*lit.mask).reshape(1, bright.rows) != 0) : cv::Mat(bright.size(), CV_8U, 255.0);
}

}  // namespace

std::optional<Finding> FindFan(const Sweep& sweep, const std::vector<int>& frames, std::vector<std::uint8_t>& covered)
{
  const std::array<cv::Rect, 2> corners = CornersOf(sweep);
  // Of most sweeps no more than a frame is looked at.
  if (frames.size() < kFewestFrames || corners[0].area() < kFewestPixels ||
      !GroundOf(Behave(sweep, {frames[frames.size() / 2]}, corners)))
  {
    return std::nullopt;
  }
  const Behaviour behaviour = Behave(sweep, EvenlySpread(frames, kLookedAt), corners);
  const std::optional<double> ground = GroundOf(behaviour);
  if (!ground)
  {
    return std::nullopt;
  }
  const cv::Mat changes = behaviour.deviation > std::max(kOther, kOverNoise * NoiseOf(behaviour.deviation, corners));
  const cv::Mat picture = PictureOf(changes | (cv::abs(behaviour.mean - *ground) > kOther), changes);
  const cv::Mat lit = LitWhere(picture), beside = ~lit, wrong = beside & LitWhere(behaviour.mean > 0);
  const int pixels = cv::countNonZero(wrong);
  if (pixels < kLeastShare * static_cast<double>(sweep.PixelsPerFrame()) ||
      cv::countNonZero(picture) < kFull * cv::countNonZero(lit) ||
      cv::countNonZero(changes & beside) > kMostChanging * cv::countNonZero(beside))
  {
    return std::nullopt;
  }
  covered.resize(sweep.PixelsPerFrame(), 0);
  std::transform(covered.begin(), covered.end(), beside.begin<std::uint8_t>(), covered.begin(),
                 [](std::uint8_t now, std::uint8_t isBeside) { return isBeside ? kBlackened : now; });
  Finding found{FindingKind::Fan, frames, static_cast<std::size_t>(pixels), true, {}};
  found.evidence = "they count as lit, but have grey level " + Format("%.0f", *ground) +
                   " in both upper corners, and change no more than noise does";
  return found;
}

}  // namespace bigus
