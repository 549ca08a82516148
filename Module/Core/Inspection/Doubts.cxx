// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What cannot be mended by leaving frames out, or is not sure enough: it is only said.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/imgproc.hpp>

#include "Core/Inspection/Rules.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Poses/PoseDoubts.h"

namespace bigus
{
namespace
{

// Gain.
constexpr float kLit = 8;               // grey levels, of blocks that are compared
constexpr double kStep = 6;             // grey levels, and ...
constexpr double kOverUsual = 5;        // ... so many times what nine steps of ten have
constexpr std::size_t kBefore = 4;      // frames, whose means before and after a step differ by ...
constexpr double kLasting = 0.6;        // ... that share of it
constexpr std::size_t kFewest = 12;     // frames
constexpr std::size_t kFewestLit = 20;  // blocks

// Depth. Small pictures without their broad brightness are compared, one of them larger or smaller.
constexpr int kBroad = 15;          // blocks
constexpr double kUnlike = 0.75;    // of the usual correlation of neighbours, and ...
constexpr double kBetter = 0.25;    // ... by so much of it they are alike again
constexpr double kUsable = 0.3;     // correlation; else neighbours have too little in common
constexpr double kLikeAgain = 0.6;  // of the usual correlation, at the best scale
constexpr double kChance = 5;  // standard deviations of unrelated pictures' correlation, of which the best is asked for
constexpr double kGrain = 12.6;   // blocks with one value of their own: 2 pi s^2, s^2 = 1 of Detail and 1 of speckle
constexpr int kSides[] = {1, 0};  // of OpenCV's flip
constexpr double kLeastScale = 1.06, kMostScale = 2, kScaleStep = 1.03;

/// Median difference of what both frames show, grey levels; 0 where that is too little.
double Brighter(const Pictures& pictures, std::size_t from, std::size_t to)
{
  std::vector<double> differences;
  for (std::size_t p = 0; p < pictures.small[from].size(); ++p)
  {
    const float one = pictures.small[from][p], other = pictures.small[to][p];
    if (one > kLit && other > kLit)
    {
      differences.push_back(other - one);
    }
  }
  return differences.size() < kFewestLit ? 0 : ShareBelow(differences, 0.5);
}

std::optional<Finding> DoubtGain(const Pictures& pictures, const std::vector<int>& frames)
{
  std::vector<double> steps, sizes;
  for (std::size_t k = 0; k + 1 < frames.size(); ++k)
  {
    steps.push_back(Brighter(pictures, k, k + 1));
    sizes.push_back(std::abs(steps.back()));
  }
  const double least = std::max(kStep, kOverUsual * ShareBelow(sizes, 0.9));
  std::vector<int> from;
  std::string evidence;
  for (std::size_t k = kBefore - 1; k + kBefore < frames.size(); ++k)
  {
    double lasting = 0;
    for (std::size_t j = 0; j < kBefore && sizes[k] > least; ++j)
    {
      lasting += Brighter(pictures, k - j, k + 1 + j) / kBefore;
    }
    if (lasting / steps[k] >= kLasting)
    {
      from.push_back(frames[k + 1]);
      evidence +=
          (evidence.empty() ? "from one frame to the next pictures change by " : ", ") + Format("%+.0f", steps[k]);
    }
  }
  return Found(FindingKind::Gain, from, evidence + " grey levels, and stay so");
}

/// Small pictures without their broad brightness.
cv::Mat Detail(const cv::Mat& image)
{
  cv::Mat smooth, broad;
  constexpr int kBorder = cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED;
  cv::GaussianBlur(image, smooth, {}, 1, 1, kBorder);
  cv::blur(image, broad, {kBroad, kBroad}, {-1, -1}, kBorder);
  return smooth - broad;
}

/// The same; 0 where the best of many unrelated pictures may reach it.
double SureCorrelation(const cv::Mat& a, const cv::Mat& b)
{
  const double correlation = Correlation(a, b);
  return correlation * correlation * a.total() > kChance * kChance * kGrain ? correlation : 0;
}

/// How alike `to` is to `from` made larger about a row of its middle column, where both show something.
double AlikeAt(const cv::Mat& from, const cv::Mat& to, double scale, double row)
{
  const double x = 0.5 * (from.cols - 1);
  const cv::Matx23d larger(scale, 0, x - scale * x, 0, scale, row - scale * row);
  cv::Mat scaled;
  cv::warpAffine(from, scaled, larger, from.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT_101);
  const double left = std::max(0.0, x - scale * x), top = std::max(0.0, row - scale * row);
  const double bottom = std::min(from.rows - 1.0, row + scale * (from.rows - 1 - row));
  const cv::Rect both(cv::Point(static_cast<int>(std::ceil(left)), static_cast<int>(std::ceil(top))),
                      cv::Point(from.cols - static_cast<int>(std::ceil(left)), static_cast<int>(bottom) + 1));
  return SureCorrelation(Detail(scaled(both)), Detail(to(both)));
}

/// The factor by which `to` is larger than `from` about the middle of the probe or of the picture, if that makes them alike.
double LargerBy(const cv::Mat& from, const cv::Mat& to, double enough)
{
  double best = enough, factor = 1;
  for (double scale = 1 / kMostScale; scale <= kMostScale; scale *= kScaleStep)
  {
    for (const double row : {0.0, 0.5 * (from.rows - 1)})
    {
      const double alike = std::max(scale, 1 / scale) < kLeastScale ? 0 : AlikeAt(from, to, scale, row);
      if (alike > best)
      {
        best = alike;
        factor = scale;
      }
    }
  }
  return factor;
}

/// Whether one picture is the other mirrored from left to right, or from top to bottom.
bool IsMirrored(const cv::Mat& from, const cv::Mat& to, double enough)
{
  return std::any_of(std::begin(kSides), std::end(kSides),
                     [&](int side)
                     {
                       cv::Mat mirrored;
                       cv::flip(from, mirrored, side);
                       return SureCorrelation(mirrored, to) > enough;
                     });
}

std::optional<Finding> DoubtDepth(const Pictures& pictures, const std::vector<int>& frames)
{
  if (std::min(pictures.width, pictures.height) < kBroad)  // there is no detail to compare
  {
    return std::nullopt;
  }
  std::vector<cv::Mat> details;
  std::vector<double> alike;
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    details.push_back(Detail(ImageOf(pictures, k)));
    if (k > 0)
    {
      alike.push_back(Correlation(details[k - 1], details[k]));
    }
  }
  const double usual = ShareBelow(alike, 0.5);
  std::vector<int> from;
  std::string factors, evidence;
  bool isMirrored = false;
  for (std::size_t k = 1; k < frames.size() && usual >= kUsable; ++k)
  {
    if (alike[k - 1] >= kUnlike * usual)
    {
      continue;
    }
    const double enough = std::max(kLikeAgain * usual, alike[k - 1] + kBetter * usual);
    const double factor = LargerBy(ImageOf(pictures, k - 1), ImageOf(pictures, k), enough);
    const bool turns = factor == 1 && IsMirrored(details[k - 1], details[k], enough);
    isMirrored = isMirrored || turns;
    if (factor != 1 || turns)
    {
      from.push_back(frames[k]);
    }
    if (factor != 1)
    {
      factors += (factors.empty() ? "" : ", ") + Format("%.2f", factor);
    }
  }
  if (!factors.empty())
  {
    evidence = "pictures are larger by factors of " + factors +
               " from there on, so one size of pixels is not right for all frames";
  }
  if (isMirrored)
  {
    evidence +=
        std::string(evidence.empty() ? "" : "; ") + "pictures are mirrored from there on, so poses are not right";
  }
  return Found(FindingKind::Depth, from, evidence + "; train on each part by itself");
}

std::optional<Finding> DoubtLevels(const GreyLevels& levels, bool isFlat)
{
  std::string evidence;
  if (isFlat)
  {
    evidence = (levels.brightest == 0
                    ? std::string("all pixels are black")
                    : "all pixels have one grey level, " + Format("%.2g", levels.brightest / 2.55) + " % of white") +
               ", so that there is nothing to learn and a training refuses them";
  }
  else if (levels.IsSaturated())
  {
    evidence = Format("%.0f", 100 * levels.white) +
               " % of what is not black is white: the gain was too high, or the largest value of the pixels is given "
               "too low";
  }
  else if (levels.IsDim())
  {
    evidence =
        "no pixel is brighter than " + Format("%.2g", levels.brightest / 2.55) +
        " % of white: pixels may have fewer bits than their type; give the value that is white (--pixel-range 255 "
        "for 8 bits that were stored in 16, PixelRange in Python), or use them as bytes";
  }
  if (evidence.empty())
  {
    return std::nullopt;
  }
  return Finding{FindingKind::Levels, {}, 0, false, evidence};
}

}  // namespace

std::vector<Finding> DoubtsAbout(const Sweep& sweep, const Pictures& pictures, const GreyLevels& levels,
                                 const std::vector<int>& frames)
{
  std::vector<Finding> doubts;
  const auto add = [&doubts](std::optional<Finding> doubt)
  {
    if (doubt)
    {
      doubt->isApplied = false;
      doubts.push_back(*std::move(doubt));
    }
  };
  if (frames.size() >= kFewest)
  {
    add(DoubtGain(pictures, frames));
    add(DoubtDepth(pictures, frames));
    // Where poses alone say what is wrong, pictures would only give another name to it.
    add(IsPathDoubtful(sweep, frames) ? std::nullopt : DoubtMotion(sweep, pictures, frames));
  }
  add(DoubtLevels(levels, LevelOf(sweep, frames).has_value()));
  std::vector<std::string> said = DoubtsAboutPoses(sweep, frames);
  // Of times that fall the finding 'order' tells more.
  if (const std::optional<std::string> times = DoubtAboutTimes(sweep.timestamps);
      times && sweep.timestamps.back() == sweep.timestamps.front())
  {
    said.push_back(*times);
  }
  for (std::string& doubt : said)
  {
    doubt.pop_back();  // its full stop
    add(Finding{FindingKind::Poses, {}, 0, false, std::move(doubt)});
  }
  return doubts;
}

}  // namespace bigus
