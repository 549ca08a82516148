// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Deciding/PosePage.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "Core/Numerics/Drawing.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/OpenCv.h"

namespace bigus
{
namespace
{

using namespace drawing;

constexpr int kPlotHeight = 340, kTitleHeight = 70, kScale = 56;  // pixels; kScale: left of a plot, for its numbers
constexpr int kTicks = 4;
const cv::Scalar kGrid(225, 225, 225), kBefore(170, 170, 170), kAfter(30, 100, 200);
const cv::Scalar kTaken(40, 140, 70), kRefused(205, 60, 50);
const std::array<cv::Scalar, 3> kAxes = {cv::Scalar(205, 60, 50), cv::Scalar(40, 140, 70), cv::Scalar(30, 100, 200)};

/// A rectangle of the page and the numbers that it stands for; y points up.
struct Plot
{
  cv::Rect area;
  double left, right, low, high;

  cv::Point At(double x, double y) const
  {
    const double u = (x - left) / (right - left), v = (y - low) / (high - low);
    return {area.x + static_cast<int>(std::lround(u * area.width)),
            area.y + static_cast<int>(std::lround((1 - v) * area.height))};
  }
};

/// Title, frame, and lines with their numbers.
void DrawFrame(cv::Mat& page, const Plot& plot, const std::string& title)
{
  Write(page, title, plot.area.x, plot.area.y - 10);
  for (int k = 0; k <= kTicks; ++k)
  {
    const double y = plot.low + k * (plot.high - plot.low) / kTicks;
    cv::line(page, plot.At(plot.left, y), plot.At(plot.right, y), kGrid);
    Write(page, Format("%.3g", y), plot.area.x - kScale + 6, plot.At(plot.left, y).y + 4, 0.38);
  }
  cv::rectangle(page, plot.area, kInk);
}

void DrawLine(cv::Mat& page, const Plot& plot, const std::vector<double>& x, const std::vector<double>& y,
              const cv::Scalar& colour, int width)
{
  for (std::size_t k = 0; k + 1 < x.size(); ++k)
  {
    cv::line(page, plot.At(x[k], y[k]), plot.At(x[k + 1], y[k + 1]), colour, width, cv::LINE_AA);
  }
}

/// The path seen along its least extent: of every pose the centre's two coordinates.
void DrawPath(cv::Mat& page, const cv::Rect& area, const std::vector<Eigen::Vector3d>& before,
              const std::vector<Eigen::Vector3d>& after)
{
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& centre : after)
  {
    mean += centre / static_cast<double>(after.size());
  }
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& centre : after)
  {
    spread += (centre - mean) * (centre - mean).transpose();
  }
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors();
  double reach = 1e-6;  // mm, that both coordinates stay within
  const auto along = [&](const std::vector<Eigen::Vector3d>& centres, int axis)
  {
    std::vector<double> values;
    for (const Eigen::Vector3d& centre : centres)
    {
      values.push_back((centre - mean).dot(axes.col(axis)));
      reach = std::max(reach, std::abs(values.back()));
    }
    return values;
  };
  const auto x = along(before, 2), y = along(before, 1), u = along(after, 2), v = along(after, 1);
  const double high = reach * area.height / area.width;
  const double tall = std::max(*std::max_element(y.begin(), y.end()), -*std::min_element(y.begin(), y.end()));
  const double zoom = std::max(1.0, 1.1 * tall / high);  // so that the path is inside whichever way it is long
  const Plot plot{area, -1.05 * zoom * reach, 1.05 * zoom * reach, -1.05 * zoom * high, 1.05 * zoom * high};
  DrawFrame(page, plot, "The path of the images' centres, mm: grey as recorded, blue corrected");
  DrawLine(page, plot, x, y, kBefore, 1);
  DrawLine(page, plot, u, v, kAfter, 2);
}

void DrawSteps(cv::Mat& page, const cv::Rect& area, const std::vector<PoseStep>& steps)
{
  double low = 0, high = 1.5;
  for (const PoseStep& step : steps)
  {
    low = std::min(low, step.share - step.shareError);
    high = std::max(high, step.share + step.shareError);
  }
  const Plot plot{area, 0, std::max(1.0, static_cast<double>(steps.size())), low - 0.1, high + 0.1};
  DrawFrame(page, plot, "Share of each step that pictures confirm: green taken, red not");
  cv::line(page, plot.At(plot.left, 0.5), plot.At(plot.right, 0.5), kBefore, 1);
  for (std::size_t k = 0; k < steps.size(); ++k)
  {
    const PoseStep& step = steps[k];
    const double x = static_cast<double>(k) + 0.5;
    const cv::Scalar colour = step.isTaken ? kTaken : kRefused;
    cv::line(page, plot.At(x, step.share - step.shareError), plot.At(x, step.share + step.shareError), colour, 2);
    cv::circle(page, plot.At(x, step.share), 5, colour, cv::FILLED, cv::LINE_AA);
    Write(page, Format("%g", step.from) + Format(" - %g", step.to), plot.At(x, 0).x - 22, area.y + area.height + 18,
          0.38);
  }
  if (steps.empty())
  {
    Write(page, "No step was asked for.", area.x + 20, area.y + 40);
  }
}

/// In the image's axes: along its rows, down, along its normal.
void DrawMoves(cv::Mat& page, const cv::Rect& area, const Sweep& recorded, const std::vector<double>& times,
               const std::string& unit, const std::vector<Eigen::Vector3d>& before,
               const std::vector<Eigen::Vector3d>& after)
{
  std::array<std::vector<double>, 3> moves;
  double largest = 1e-6;
  for (std::size_t k = 0; k < before.size(); ++k)
  {
    const Eigen::Vector3d move = AxesOf(recorded.Plane(static_cast<int>(k))).transpose() * (after[k] - before[k]);
    for (int axis = 0; axis < 3; ++axis)
    {
      moves[axis].push_back(move[axis]);
      largest = std::max(largest, std::abs(move[axis]));
    }
  }
  const Plot plot{area, times.front(), std::max(times.back(), times.front() + 1e-9), -1.1 * largest, 1.1 * largest};
  DrawFrame(page, plot, "Moved, mm, over " + unit + ": red along the rows, green down, blue along the normal");
  for (int axis = 0; axis < 3; ++axis)
  {
    DrawLine(page, plot, times, moves[axis], kAxes[axis], 1);
  }
}

}  // namespace

Page DrawPoses(const Sweep& recorded, const std::vector<Eigen::Matrix4d>& poses, const std::vector<PoseStep>& steps,
               const std::string& title)
try
{
  std::vector<Eigen::Vector3d> before, after;
  std::vector<double> times = recorded.timestamps;
  const bool isTimed = !times.empty() && std::is_sorted(times.begin(), times.end());
  for (int k = 0; k < recorded.NumberOfFrames(); ++k)
  {
    before.push_back(CentreOf(recorded.Plane(k)));
    after.push_back(CentreOf(SlicePlane::FromImageToReference(poses[k], recorded.width, recorded.height)));
    if (!isTimed)
    {
      times.resize(poses.size());
      times[k] = k;
    }
  }
  const std::vector<std::string> lines = Lines(title, kLetters);
  const int top = kTitleHeight + kLine * static_cast<int>(lines.size()), half = (kWidth - kMargin) / 2;
  const int second = top + kPlotHeight + 3 * kMargin;
  cv::Mat page(second + kPlotHeight + kMargin, kWidth, CV_8UC3, kPaper);
  for (std::size_t k = 0; k < lines.size(); ++k)
  {
    Write(page, lines[k], kMargin, kMargin + kLine * static_cast<int>(k + 1));
  }
  DrawPath(page, {kScale, top, half - kScale - kMargin, kPlotHeight}, before, after);
  DrawSteps(page, {half + kScale, top, half - kScale, kPlotHeight}, steps);
  DrawMoves(page, {kScale, second, kWidth - kScale - kMargin, kPlotHeight}, recorded, times,
            isTimed ? "seconds" : "frames", before, after);
  return PageOf(page);
}
catch (const cv::Exception& exception)
{
  ThrowAsCores(exception);
}

}  // namespace bigus
