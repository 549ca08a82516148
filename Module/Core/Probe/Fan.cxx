// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Probe/Fan.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <utility>

#include "Core/Numerics/Constants.h"

namespace bigus
{
namespace
{

constexpr double kOnLine = 1;       // pixels: an edge is rounded to pixels, and ...
constexpr double kJagged = 0.005;   // of the picture's longer side: its last echoes are not there in every row
constexpr double kOnCircle = 1.5;   // pixels: the middle radius may lie between two
constexpr double kBeside = 3;       // pixels from a side, within which its corner may be rounded
constexpr int kFewestInRow = 3;     // pixels beside each other: fewer are text beside the picture
constexpr int kFewestOnSide = 12;   // pixels of an edge: fewer tell no direction
constexpr double kLeastSide = 0.1;  // of what is lit from above to below, and ...
constexpr double kLongSide = 0.6;   // ... so much where sides alone must tell, which then lean alike but for ...
constexpr double kAlike = 3 * kRadiansPerDegree;
constexpr double kLeastCircle = 0.6;  // of an end: there are shadows
constexpr double kLeastRise = 4;      // pixels of a circle over its chord: up to 2 kOnCircle a line passes for one
constexpr int kTried = 48;            // points of an edge, between which lines are drawn
const double kLeastSlant = std::tan(5 * kRadiansPerDegree), kMostSlant = std::tan(85 * kRadiansPerDegree);

using Points = std::vector<Eigen::Vector2d>;  // mm

/// x = at + slope y.
struct Side
{
  double at = 0, slope = 0;
  double X(double y) const { return at + slope * y; }
};

/// The outline, left and right between two pixels, without what lies on the picture's rim: a rim says nothing of the probe.
struct Outline
{
  Points left, right, top, bottom;
};

Outline OutlineOf(const std::vector<std::uint8_t>& lit, int width, int height, double pixelWidth, double pixelHeight)
{
  Outline outline;
  const auto isLit = [&](int i, int j) { return lit[static_cast<std::size_t>(j) * width + i] != 0; };
  const auto add = [&](Points& points, double i, double j) { points.emplace_back(i * pixelWidth, j * pixelHeight); };
  std::vector<int> first(width, height), last(width, -1);
  for (int j = 0; j < height; ++j)
  {
    int left = width, right = -1, begin = 0;
    for (int i = 0; i < width; ++i)
    {
      if (!isLit(i, j))
      {
        begin = i + 1;
        continue;
      }
      if (i - begin + 1 >= kFewestInRow)
      {
        left = std::min(left, begin);
        right = i;
      }
      first[i] = std::min(first[i], j);
      last[i] = j;
    }
    if (right >= 0 && left > 0)
    {
      add(outline.left, left - 0.5, j);
    }
    if (right >= 0 && right < width - 1)
    {
      add(outline.right, right + 0.5, j);
    }
  }
  for (int i = 0; i < width; ++i)
  {
    if (last[i] >= 0 && first[i] > 0)
    {
      add(outline.top, i, first[i]);
    }
    if (last[i] >= 0 && last[i] < height - 1)
    {
      add(outline.bottom, i, last[i]);
    }
  }
  return outline;
}

/// Least squares.
Side Through(const Points& points)
{
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : points)
  {
    mean += p / static_cast<double>(points.size());
  }
  double both = 0, squares = 0;
  for (const Eigen::Vector2d& p : points)
  {
    both += (p - mean).prod();
    squares += (p[1] - mean[1]) * (p[1] - mean[1]);
  }
  const double slope = both / squares;
  return {mean[0] - slope * mean[1], slope};
}

/// The line on which most of the points lie, of those that lead outwards (`sign` -1: to the left) by 5 to 85 degrees, and
/// how many these are.
std::pair<Side, std::size_t> SideOf(const Points& points, double sign, double onLine)
{
  Side best;
  std::size_t most = 0;
  // A slanted edge is rounded along its rows by its step.
  const auto isOn = [onLine](const Side& side, const Eigen::Vector2d& p)
  { return std::abs(p[0] - side.X(p[1])) <= onLine * std::max(1.0, std::abs(side.slope)); };
  const std::size_t step = std::max<std::size_t>(1, points.size() / kTried);
  for (std::size_t a = 0; a < points.size(); a += step)
  {
    for (std::size_t b = a + std::max<std::size_t>(step, kFewestOnSide / 2); b < points.size(); b += step)
    {
      const double slope = (points[b][0] - points[a][0]) / (points[b][1] - points[a][1]);
      if (sign * slope >= kLeastSlant && sign * slope <= kMostSlant)
      {
        const Side side{points[a][0] - slope * points[a][1], slope};
        const std::size_t count =
            std::count_if(points.begin(), points.end(), [&](const Eigen::Vector2d& p) { return isOn(side, p); });
        best = count > most ? side : best;
        most = std::max(most, count);
      }
    }
  }
  Points on;
  std::copy_if(points.begin(), points.end(), std::back_inserter(on),
               [&](const Eigen::Vector2d& p) { return isOn(best, p); });
  return {most < 2 ? Side() : Through(on), most};
}

/// Whether an end of the fan lies on a circle about the apex, and not as well on a line.
bool IsCircle(const Points& end, const Eigen::Vector2d& apex, const Side& left, const Side& right, double pixel)
{
  std::vector<std::pair<double, double>> polar;  // mm, radian from downwards
  for (const Eigen::Vector2d& p : end)
  {
    if (p[0] > left.X(p[1]) + kBeside * pixel && p[0] < right.X(p[1]) - kBeside * pixel)
    {
      polar.emplace_back((p - apex).norm(), std::atan2(p[0] - apex[0], p[1] - apex[1]));
    }
  }
  std::sort(polar.begin(), polar.end());
  std::size_t most = 0, first = 0;  // of those that lie as far off, and where they begin
  for (std::size_t begin = 0, end = 0; begin < polar.size(); ++begin)
  {
    for (; end < polar.size() && polar[end].first <= polar[begin].first + 2 * kOnCircle * pixel; ++end)
    {
    }
    first = end - begin > most ? begin : first;
    most = std::max(most, end - begin);
  }
  if (most < static_cast<std::size_t>(kFewestOnSide))
  {
    return false;
  }
  const auto from = polar.begin() + static_cast<std::ptrdiff_t>(first);
  const auto to = from + static_cast<std::ptrdiff_t>(most);
  const auto byAngle = [](const auto& a, const auto& b) { return a.second < b.second; };
  const auto [low, high] = std::minmax_element(from, to, byAngle);
  const auto within = std::count_if(polar.begin(), polar.end(),
                                    [low = low->second, high = high->second](const auto& p)
                                    { return p.second >= low && p.second <= high; });
  const double rise = from->first * (1 - std::cos(0.5 * (high->second - low->second)));
  return static_cast<double>(most) >= kLeastCircle * static_cast<double>(within) && rise >= kLeastRise * pixel;
}

}  // namespace

std::optional<Eigen::Vector2d> FindApex(const std::vector<std::uint8_t>& lit, int width, int height, double pixelWidth,
                                        double pixelHeight)
{
  const Outline outline = OutlineOf(lit, width, height, pixelWidth, pixelHeight);
  const double onLine = pixelWidth * std::max(kOnLine, kJagged * std::max(width, height));
  const auto [left, onLeft] = SideOf(outline.left, -1, onLine);
  const auto [right, onRight] = SideOf(outline.right, 1, onLine);
  const auto fewest = static_cast<double>(std::min(onLeft, onRight));
  const auto rows = static_cast<double>(std::max(outline.left.size(), outline.right.size()));
  if (fewest < std::max<double>(kFewestOnSide, kLeastSide * rows))
  {
    return std::nullopt;
  }
  const double y = (left.at - right.at) / (right.slope - left.slope);
  const Eigen::Vector2d apex(left.X(y), y);
  const double pixel = std::max(pixelWidth, pixelHeight);
  const bool isAbove = y <= std::min(outline.left.front()[1], outline.right.front()[1]) + pixel;
  const bool isLong = fewest >= kLongSide * rows && std::abs(std::atan(right.slope) + std::atan(left.slope)) <= kAlike;
  if (!isAbove || !(isLong || IsCircle(outline.bottom, apex, left, right, pixel) ||
                    IsCircle(outline.top, apex, left, right, pixel)))
  {
    return std::nullopt;
  }
  return Eigen::Vector2d(apex[0] / pixelWidth, apex[1] / pixelHeight);
}

}  // namespace bigus
