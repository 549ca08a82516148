// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Inspection/Page.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "Core/Inspection/Rules.h"
#include "Core/Numerics/Drawing.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/OpenCv.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

using namespace drawing;

constexpr int kStripHeight = 120, kPlotHeight = 120, kPictureSide = 420;
constexpr std::size_t kThumbnails = 12;
const cv::Scalar kKept(70, 130, 90);

cv::Scalar ColourOf(FindingKind kind)
{
  switch (kind)
  {
    case FindingKind::Order:
      return {150, 90, 190};
    case FindingKind::Contact:
      return {205, 60, 50};
    case FindingKind::Repeat:
      return {60, 110, 210};
    case FindingKind::Rest:
      return {225, 145, 30};
    case FindingKind::Overlay:
    case FindingKind::Fan:
      return {200, 30, 130};
    case FindingKind::Tracking:
      return {20, 150, 160};
    default:
      return {110, 110, 110};
  }
}

/// A frame of the sweep, grey, in colours' form.
cv::Mat FrameOf(const Sweep& sweep, int frame)
{
  cv::Mat colours;
  cv::cvtColor(LevelsOf(sweep, frame), colours, cv::COLOR_GRAY2RGB);
  return colours;
}

/// Of every recorded frame the colour of what it is left out for.
std::vector<cv::Scalar> ColoursOf(const InspectedSweep& inspected)
{
  std::vector<cv::Scalar> colours(inspected.recorded->NumberOfFrames(), kKept);
  for (const Finding& finding : inspected.findings)
  {
    for (const int frame : finding.LeftOut())
    {
      colours[frame] = ColourOf(finding.kind);
    }
  }
  return colours;
}

void DrawStrip(cv::Mat& page, int top, const InspectedSweep& inspected, const std::vector<int>& numbers,
               const std::vector<cv::Scalar>& colours)
{
  const Sweep& sweep = *inspected.recorded;
  const int cell = (kWidth - 2 * kMargin) / static_cast<int>(kThumbnails);
  int x = kMargin;
  for (const int frame : EvenlySpread(AllFrames(sweep), kThumbnails))
  {
    const double scale = std::min((cell - 8.0) / sweep.width, (kStripHeight - kLine - 8.0) / sweep.height);
    const cv::Size size(std::max(1, static_cast<int>(scale * sweep.width)),
                        std::max(1, static_cast<int>(scale * sweep.height)));
    cv::Mat small;
    cv::resize(FrameOf(sweep, frame), small, size, 0, 0, cv::INTER_AREA);
    small.copyTo(page(cv::Rect({x + 2, top + 2}, size)));
    cv::rectangle(page, cv::Rect(x, top, size.width + 4, size.height + 4), colours[frame], 2);
    Write(page, std::to_string(numbers[frame]), x, top + size.height + kLine, 0.4);
    x += cell;
  }
}

/// A bar a frame, as high as the way from the frame before it; ways longer than nearly all are cut.
void DrawWay(cv::Mat& page, int top, const Sweep& sweep, const std::vector<cv::Scalar>& colours)
{
  std::vector<double> ways = StepsOf(sweep, AllFrames(sweep));
  ways.insert(ways.begin(), 0);
  std::vector<double> sorted = ways;
  std::sort(sorted.begin(), sorted.end());
  const double longest = std::max(1e-9, 1.2 * Quantile(sorted, 0.97));
  Write(page, "Way from frame to frame, up to " + Format("%.3g", longest) + " mm", kMargin, top + 14);
  const double width = (kWidth - 2.0 * kMargin) / static_cast<double>(ways.size());
  const int bottom = top + kPlotHeight;
  for (std::size_t k = 0; k < ways.size(); ++k)
  {
    const int height = std::max(2, static_cast<int>((kPlotHeight - kLine) * std::min(1.0, ways[k] / longest)));
    const cv::Point from(kMargin + static_cast<int>(width * static_cast<double>(k)), bottom - height);
    const cv::Point to(std::max(from.x, kMargin + static_cast<int>(width * static_cast<double>(k + 1)) - 1), bottom);
    cv::rectangle(page, from, to, colours[k], cv::FILLED);
  }
}

/// A frame in the middle of what is left, with filled and blackened pixels tinted.
cv::Mat FilledFrame(const InspectedSweep& inspected)
{
  const int middle = inspected.sweep->NumberOfFrames() / 2;
  cv::Mat image = FrameOf(*inspected.recorded, inspected.frames[middle]);
  cv::Mat difference;
  cv::absdiff(image, FrameOf(*inspected.sweep, middle), difference);
  cv::cvtColor(difference, difference, cv::COLOR_RGB2GRAY);
  image.setTo(ColourOf(FindingKind::Overlay), difference > 0);
  const double scale =
      std::min(static_cast<double>(kPictureSide) / image.cols, static_cast<double>(kPictureSide) / image.rows);
  cv::resize(image, image, {}, scale, scale, cv::INTER_NEAREST);
  return image;
}

}  // namespace

Page DrawPage(const InspectedSweep& inspected, const std::vector<int>& numbers, const std::string& title)
try
{
  const bool isFilled = std::any_of(inspected.findings.begin(), inspected.findings.end(),
                                    [](const Finding& finding) { return finding.pixels > 0 && finding.isApplied; });
  const cv::Mat picture = isFilled ? FilledFrame(inspected) : cv::Mat();
  std::vector<std::pair<std::string, cv::Scalar>> lines;
  for (const Finding& finding : inspected.findings)
  {
    for (const std::string& line : Lines(Describe(finding, numbers), kLetters))
    {
      lines.emplace_back(line, ColourOf(finding.kind));
    }
  }
  const int strip = 2 * kMargin + kLine, way = strip + kStripHeight + kMargin, words = way + kPlotHeight + kMargin;
  const int below = words + kLine * static_cast<int>(lines.size() + 1);
  cv::Mat page(below + (isFilled ? picture.rows + kMargin : 0), kWidth, CV_8UC3, kPaper);
  const std::vector<cv::Scalar> colours = ColoursOf(inspected);
  Write(page, title, kMargin, kMargin + kLine, 0.6);
  DrawStrip(page, strip, inspected, numbers, colours);
  DrawWay(page, way, *inspected.recorded, colours);
  for (std::size_t k = 0; k < lines.size(); ++k)
  {
    Write(page, lines[k].first, kMargin, words + kLine * static_cast<int>(k + 1), 0.45, lines[k].second);
  }
  if (isFilled)
  {
    picture.copyTo(page(cv::Rect(kMargin, below, picture.cols, picture.rows)));
  }
  return PageOf(page);
}
catch (const cv::Exception& exception)
{
  ThrowAsCores(exception);
}

}  // namespace bigus
