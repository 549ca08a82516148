// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/SweepGeometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "Core/Model/Sequences.h"

namespace bigus
{
namespace
{

/// Cosines of the angles between normals: below which one normal stands for another's plane too, and from which planes
/// cross. 5 degrees of a beam of 1 mm are 0.09 mm, less than a pixel.
constexpr double kSameDirection = 0.99619470, kCrossing = 0.86602540;

/// Share of a length that counts as no difference: more than text files with five digits leave, and a hundredth of the
/// noise of a good tracker (0.01 mm and 0.01 degrees for frames 0.5 mm apart).
constexpr double kExact = 1e-4;

constexpr std::size_t kLookedAt = 24;  // frames: 276 pairs

/// Times the median gap, from which the median along the path is usual. Noise of the tracker alone makes 1.5 to 2.
constexpr double kTwoSpeeds = 3;
constexpr double kLocalBreak = 4;  // usual gaps around it: longer ones are not part of the path
constexpr std::ptrdiff_t kAround = 5;

/// Times the way of the image's centre that its places go in the mean, from which the probe turns about the centre. What goes
/// kBreak times the usual way is a break; sweeps that advance have 1.0 to 1.1 (liver, brain), those that turn about an edge of
/// the image 1.0, and about a place between edge and centre 1.3.
constexpr double kTurns = kBreak;
constexpr int kPlaces = 4;  // in rows and columns, each amid its share of the image; none is the centre

double MedianGap(std::vector<double> values)
{
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[values.size() / 2];
}

double MedianOfSome(std::vector<double> values)
{
  constexpr std::size_t kFewest = 3;
  return values.size() < kFewest ? 0 : MedianGap(std::move(values));
}

/// The gap below which half of the path lies, without gaps that are breaks.
double MedianAlongPath(const std::vector<double>& gaps)
{
  std::vector<double> along;
  for (auto gap = gaps.begin(); gap != gaps.end(); ++gap)
  {
    const double before = MedianGap({gap - std::min(kAround, gap - gaps.begin()), gap});
    const double after = MedianGap({gap + 1, gap + 1 + std::min(kAround, gaps.end() - gap - 1)});
    if (*gap <= kLocalBreak * std::max(before, after))
    {
      along.push_back(*gap);
    }
  }
  std::sort(along.begin(), along.end());
  const double half = 0.5 * std::accumulate(along.begin(), along.end(), 0.0);
  double sum = 0;
  for (const double gap : along)
  {
    sum += gap;
    if (sum >= half)
    {
      return gap;
    }
  }
  return 0;
}

/// Whether the line in which two planes meet runs through both images, seen at the middle of what lies in the second.
bool Meet(const SlicePlane& a, const SlicePlane& b)
{
  const double right = b.width - 1, bottom = b.height - 1;
  const std::array<Eigen::Vector3d, 4> corners = {b.Point(0, 0), b.Point(right, 0), b.Point(right, bottom),
                                                  b.Point(0, bottom)};
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int cuts = 0;
  for (int k = 0; k < 4; ++k)
  {
    const Eigen::Vector3d &p = corners[k], &q = corners[(k + 1) % 4];
    const double from = (p - a.origin).dot(a.Normal()), to = (q - a.origin).dot(a.Normal());
    if ((from < 0) != (to < 0))
    {
      sum += p + from / (from - to) * (q - p);
      ++cuts;
    }
  }
  if (cuts != 2)
  {
    return false;
  }
  const Eigen::Vector3d ijz = a.WorldToSlice() * (0.5 * sum - a.origin);
  return ijz[0] >= 0 && ijz[0] <= a.width - 1 && ijz[1] >= 0 && ijz[1] <= a.height - 1;
}

}  // namespace

double UsualStep(const std::vector<double>& steps)
{
  const double median = MedianGap(steps), along = MedianAlongPath(steps);
  return along > kTwoSpeeds * median ? along : median;
}

double UsualAround(const std::vector<double>& steps, std::size_t k)
{
  const auto step = steps.begin() + static_cast<std::ptrdiff_t>(k);
  return std::max(MedianOfSome({step - std::min(kAround, step - steps.begin()), step}),
                  MedianOfSome({step + 1, step + 1 + std::min(kAround, steps.end() - step - 1)}));
}

namespace
{

/// Mean over the image of what `way` tells of each place.
template <class Way>
double MeanOverImage(const Sweep& sweep, const Way& way)
{
  double sum = 0;
  for (int place = 0; place < kPlaces * kPlaces; ++place)
  {
    sum += way((place % kPlaces + 0.5) / kPlaces * (sweep.width - 1),
               (place / kPlaces + 0.5) / kPlaces * (sweep.height - 1));
  }
  return sum / (kPlaces * kPlaces);
}

/// Ways from each frame to the next, `between(from, to, i, j)` those of places of the image.
template <class Between>
std::vector<double> WaysBetween(const Sweep& sweep, const std::vector<int>& frames, const Between& between)
{
  std::vector<double> centre, mean;
  for (std::size_t k = 0; k + 1 < frames.size(); ++k)
  {
    const auto at = [&](double i, double j) { return between(frames[k], frames[k + 1], i, j); };
    centre.push_back(at(0.5 * (sweep.width - 1), 0.5 * (sweep.height - 1)));
    mean.push_back(MeanOverImage(sweep, at));
  }
  std::size_t k = 0;
  for (const std::vector<int>& own : BySequence(sweep, frames))
  {
    const auto first = static_cast<std::ptrdiff_t>(k), last = first + static_cast<std::ptrdiff_t>(own.size()) - 1;
    const auto sum = [&](const std::vector<double>& ways)
    { return std::accumulate(ways.begin() + first, ways.begin() + last, 0.0); };
    const double rounding = kExact * sweep.Plane(own[0]).PixelSize() * static_cast<double>(own.size());
    if (sum(mean) > kTurns * sum(centre) + rounding)
    {
      std::copy(mean.begin() + first, mean.begin() + last, centre.begin() + first);
    }
    k += own.size();
  }
  return centre;
}

}  // namespace

std::vector<double> GapsBetween(const Sweep& sweep, const std::vector<int>& frames)
{
  return WaysBetween(sweep, frames,
                     [&](int from, int to, double i, double j) { return GapBetween(sweep, from, to, i, j); });
}

double PathLength(const Sweep& sweep, const std::vector<int>& frames)
{
  const std::vector<double> ways =
      WaysBetween(sweep, frames,
                  [&](int from, int to, double i, double j)
                  { return (sweep.Plane(to).Point(i, j) - sweep.Plane(from).Point(i, j)).norm(); });
  return std::accumulate(ways.begin(), ways.end(), 0.0);
}

std::vector<double> LongestGaps(const Sweep& sweep, const std::vector<int>& frames)
{
  const double usual = MeasureGeometry(sweep, frames).usualSpacing;
  const std::vector<double> gaps = GapsBetween(sweep, frames);
  std::vector<double> longest;
  for (std::size_t k = 0; k < gaps.size(); ++k)
  {
    const bool goesOn = NeighboursOf(sweep, frames, frames[k]).after.has_value();
    longest.push_back(goesOn ? kBreak * std::max(usual, UsualAround(gaps, k)) : -1);
  }
  return longest;
}

double GapBetween(const Sweep& sweep, int from, int to, double i, double j)
{
  const SlicePlane plane = sweep.Plane(from);
  return std::abs((sweep.Plane(to).Point(i, j) - plane.Point(i, j)).dot(plane.Normal()));
}

SweepGeometry MeasureGeometry(const Sweep& sweep, const std::vector<int>& frames)
{
  SweepGeometry geometry;
  std::vector<double> spacings;
  const std::vector<double> gaps = GapsBetween(sweep, frames);
  for (std::size_t k = 0; k < gaps.size(); ++k)
  {
    if (NeighboursOf(sweep, frames, frames[k]).after)
    {
      spacings.push_back(gaps[k]);
    }
  }
  for (const std::vector<int>& own : BySequence(sweep, frames))
  {
    const double size = sweep.Plane(own[0]).PixelSize();
    geometry.pixelSize = geometry.pixelSize > 0 ? std::min(geometry.pixelSize, size) : size;
  }
  if (!spacings.empty())
  {
    geometry.usualSpacing = UsualStep(spacings);
    const auto [smallest, largest] = std::minmax_element(spacings.begin(), spacings.end());
    geometry.smallestSpacing = *smallest;
    geometry.largestSpacing = *largest;
  }
  return geometry;
}

std::vector<Eigen::Vector3d> DistinctNormals(const Sweep& sweep, const std::vector<int>& frames)
{
  std::vector<Eigen::Vector3d> distinct;
  for (const int frame : frames)
  {
    const Eigen::Vector3d normal = sweep.Plane(frame).Normal();
    if (std::none_of(distinct.begin(), distinct.end(),
                     [&normal](const Eigen::Vector3d& known) { return std::abs(known.dot(normal)) >= kSameDirection; }))
    {
      distinct.push_back(normal);
    }
  }
  return distinct;
}

bool IsVolume(const Sweep& sweep, const std::vector<int>& frames)
{
  if (frames.size() < 3)
  {
    return false;
  }
  const Eigen::Matrix4d& first = sweep.imageToReference[frames[0]];
  const Eigen::Vector3d normal = sweep.Plane(frames[0]).Normal();
  const double spacing = MeasureGeometry(sweep, frames).usualSpacing;
  return spacing > 0 &&
         std::all_of(frames.begin(), frames.end(),
                     [&](int frame)
                     {
                       const Eigen::Matrix4d difference = sweep.imageToReference[frame] - first;
                       const Eigen::Vector3d step = difference.block<3, 1>(0, 3);
                       return difference.leftCols<2>().norm() <= kExact * first.leftCols<2>().norm() &&
                              (step - step.dot(normal) * normal).norm() <= kExact * std::max(spacing, step.norm());
                     });
}

bool FramesCross(const Sweep& sweep, const std::vector<int>& frames)
{
  const std::size_t count = std::min(kLookedAt, frames.size());
  std::vector<SlicePlane> planes;
  for (std::size_t k = 0; k < count; ++k)
  {
    planes.push_back(sweep.Plane(frames[(2 * k + 1) * frames.size() / (2 * count)]));
  }
  std::size_t crossing = 0;
  for (const SlicePlane& a : planes)
  {
    crossing += std::any_of(planes.begin(), planes.end(),
                            [&a](const SlicePlane& b) {
                              return std::abs(a.Normal().dot(b.Normal())) <= kCrossing && (Meet(a, b) || Meet(b, a));
                            });
  }
  return count > 0 && 2 * crossing >= count;
}

}  // namespace bigus
