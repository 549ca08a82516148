// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/PoseDoubts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "Core/Model/SlicePlane.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Format.h"

namespace bigus
{
namespace
{

// mm. Probes of 1 to 60 MHz show 5 to 300 mm of depth on 200 to 2000 rows: 0.0025 to 1.5 mm. Matrices in metres give a
// thousandth of that, those in micrometres a thousand times as much.
constexpr double kSmallestPixel = 0.002, kLargestPixel = 5;
constexpr double kCoarsePixel = 1.5, kLargestImage = 450;  // mm, of pixel and diagonal, that no probe has both
// Of the image's diagonal. A sweep that moves less shows one slice; one that moves further left the patient.
constexpr double kShortestPath = 0.003, kLongestPath = 100;
constexpr double kCoplanar = 0.005;  // pixels: as near do no two frames of a hand come
constexpr double kSheared = 0.5;     // degrees that rows and columns may be off a right angle
constexpr double kScaled = 0.01;     // share by which the sides of pixels may differ between frames
constexpr double kInMetres = 1e-3;   // what is left of a path in millimetres
// Cosines: columns of a matrix that are not perpendicular, by half a degree, and those of its inverse that are.
constexpr double kSkew = 0.0087, kPerpendicular = 0.0009;

std::string FramesOf(int some, int all)
{
  return some == all ? "all " + std::to_string(all) + " frames"
                     : std::to_string(some) + " of " + std::to_string(all) + " frames";
}

double LargestHeight(const SlicePlane& plane, const SlicePlane& above)
{
  double height = 0;
  for (const double i : {0.0, plane.width - 1.0})
  {
    for (const double j : {0.0, plane.height - 1.0})
    {
      height = std::max(height, std::abs(above.Normal().dot(plane.Point(i, j) - above.origin)));
    }
  }
  return height;
}

/// What all poses together say.
struct Survey
{
  int sheared = 0, coplanar = 0;         // frames
  double angle = 90;                     // degrees between rows and columns, the worst
  double smallest = 1e300, largest = 0;  // pixel, mm
  int inverted = 0;                      // frames whose matrix is rather an inverse
  std::array<double, 4> corners = {};    // paths, mm, the first of pixel (0, 0), which translations alone move
};

/// The largest cosine of the angle between two columns.
double Skew(const Eigen::Matrix3d& matrix)
{
  const Eigen::Matrix3d unit = matrix.colwise().normalized();
  return std::max({std::abs(unit.col(0).dot(unit.col(1))), std::abs(unit.col(0).dot(unit.col(2))),
                   std::abs(unit.col(1).dot(unit.col(2)))});
}

/// An image's matrix has perpendicular columns. One of another scale along each, stored the wrong way round, has perpendicular
/// rows instead; one of a single scale has pixels that are cubes, too large here and usual the other way round.
bool IsInverted(const Eigen::Matrix4d& pose)
{
  const Eigen::Matrix3d matrix = pose.topLeftCorner<3, 3>();
  const Eigen::RowVector3d sides = matrix.colwise().norm(), inverse = matrix.rowwise().norm().cwiseInverse();
  const double pixel = std::sqrt(inverse[0] * inverse[1]);
  if (!(sides.minCoeff() > 0) || Skew(matrix.transpose()) > kPerpendicular || !(pixel > kSmallestPixel) ||
      pixel > kCoarsePixel)
  {
    return false;
  }
  return Skew(matrix) > kSkew ||
         (sides.minCoeff() > kCoarsePixel && sides.maxCoeff() < (1 + kScaled) * sides.minCoeff());
}

Survey Look(const Sweep& sweep, const std::vector<int>& frames)
{
  Survey seen;
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    const SlicePlane plane = sweep.Plane(frames[k]);
    const double between =
        std::acos(std::clamp(plane.columnStep.normalized().dot(plane.rowStep.normalized()), -1.0, 1.0)) /
        kRadiansPerDegree;
    seen.sheared += std::abs(between - 90) > kSheared ? 1 : 0;
    seen.angle = std::abs(between - 90) > std::abs(seen.angle - 90) ? between : seen.angle;
    seen.inverted += IsInverted(sweep.imageToReference[frames[k]]) ? 1 : 0;
    seen.smallest = std::min(seen.smallest, plane.PixelSize());
    seen.largest = std::max(seen.largest, plane.PixelSize());
    if (k > 0)
    {
      const SlicePlane before = sweep.Plane(frames[k - 1]);
      for (int corner = 0; corner < 4; ++corner)
      {
        const double i = corner % 2 * (sweep.width - 1.0), j = corner / 2 * (sweep.height - 1.0);
        seen.corners[corner] += (plane.Point(i, j) - before.Point(i, j)).norm();
      }
      seen.coplanar += LargestHeight(plane, before) < kCoplanar * plane.PixelSize() ? 1 : 0;
    }
  }
  return seen;
}

/// What units, or the path, are wrong by; empty: by nothing.
std::string DoubtAboutPath(const Sweep& sweep, const std::vector<int>& looked, const Survey& seen)
{
  const int frames = static_cast<int>(looked.size());
  const SlicePlane first = sweep.Plane(looked[0]);
  const double diagonal = (sweep.width * first.columnStep + sweep.height * first.rowStep).norm();
  const double path = PathLength(sweep, looked), farthest = *std::max_element(seen.corners.begin(), seen.corners.end());
  const std::string beside = " beside an image of " + Format("%.3g mm", diagonal);
  if (2 * seen.inverted > frames)
  {
    return "The matrices of " + FramesOf(seen.inverted, frames) +
           " are perhaps stored the wrong way round: their inverses are those of an image, with pixels of " +
           Format("%.3g mm.", SlicePlane::FromImageToReference(sweep.imageToReference[looked[0]].inverse(), sweep.width,
                                                               sweep.height)
                                  .PixelSize());
  }
  if (seen.smallest < kSmallestPixel)
  {
    return "Pixels of " + Format("%.3g mm", seen.smallest) +
           " are too small for ultrasound: matrices must be in millimetres, not in metres.";
  }
  if (seen.largest > kLargestPixel || (seen.largest > kCoarsePixel && diagonal > kLargestImage))
  {
    return "Pixels of " + Format("%.3g mm", seen.largest) +
           " are too large for ultrasound: matrices must be in millimetres, and contain the image's scale.";
  }
  if (frames < 2 || seen.coplanar == frames - 1)
  {
    return "";
  }
  const double least = kShortestPath * diagonal;
  if (farthest < least)
  {
    return "A path of " + Format("%.3g mm", path) + " is short" + beside +
           ": the probe hardly moved, or translations are in metres.";
  }
  // A hand that turns the probe moves corners, whatever translations are. One that stays exactly is an axis.
  if (seen.corners[0] < least && seen.corners[0] > kInMetres * least)
  {
    return "A path of " + Format("%.3g mm", seen.corners[0]) +
           " of pixel (0, 0), which translations alone move, is short" + beside +
           ": translations are in metres, or the probe turns about that pixel.";
  }
  return path > kLongestPath * diagonal
             ? "A path of " + Format("%.3g mm", path) + " is long" + beside + ": translations must be in millimetres."
             : "";
}

}  // namespace

bool IsPathDoubtful(const Sweep& sweep, const std::vector<int>& looked)
{
  const Survey seen = looked.empty() ? Survey() : Look(sweep, looked);
  return !looked.empty() &&
         (!DoubtAboutPath(sweep, looked, seen).empty() || seen.coplanar == static_cast<int>(looked.size()) - 1);
}

std::optional<std::string> DoubtAboutTimes(const std::vector<double>& times)
{
  if (times.size() < 2 || times.back() > times.front())
  {
    return std::nullopt;
  }
  if (times.back() < times.front())
  {
    return "The last frame has an earlier time than the first: frames are listed in another order than that in which they "
           "were recorded, or times are not theirs.";
  }
  const bool isOne = std::all_of(times.begin(), times.end(), [&times](double time) { return time == times[0]; });
  return isOne ? std::optional<std::string>("All frames have the same time, so that times tell nothing of their order.")
               : std::nullopt;
}

std::vector<std::string> DoubtsAboutPoses(const Sweep& sweep, const std::vector<int>& looked)
{
  std::vector<std::string> doubts;
  const int frames = static_cast<int>(looked.size());
  if (frames == 0)
  {
    return doubts;
  }
  const Survey seen = Look(sweep, looked);
  const auto& [sheared, coplanar, angle, smallest, largest, inverted, corners] = seen;
  if (const std::string doubt = DoubtAboutPath(sweep, looked, seen); !doubt.empty())
  {
    doubts.push_back(doubt);
  }
  const bool isInverse = 2 * inverted > frames;  // of which no more need be said
  if (largest > (1 + kScaled) * smallest && !isInverse)
  {
    doubts.push_back("Pixels measure from " + Format("%.4g", smallest) + Format(" to %.4g mm", largest) +
                     ": the matrices of a sweep should have one scale.");
  }
  if (sheared > 0 && !isInverse)
  {
    doubts.push_back("The matrices of " + FramesOf(sheared, frames) + " shear the image: rows and columns meet at" +
                     Format(" %.1f degrees.", angle));
  }
  if (coplanar > 0)
  {
    doubts.push_back(coplanar == frames - 1 ? "All frames lie in one plane, so there is no volume to learn."
                                            : FramesOf(coplanar, frames) +
                                                  " lie in the plane of the frame before them, within 0.005 pixels.");
  }
  return doubts;
}

std::optional<std::string> DoubtAboutSequences(const Sweep& sweep)
{
  constexpr double kFarApart = 3;  // times the largest sequence's diagonal: further than organs of one patient lie
  const std::vector<std::vector<int>> sequences = BySequence(sweep, AllFrames(sweep));
  const auto& poses = sweep.imageToReference;
  std::vector<Eigen::AlignedBox3d> boxes(sequences.size());
  double largest = 0;
  for (std::size_t s = 0; s < sequences.size(); ++s)
  {
    for (const int frame : sequences[s])
    {
      const SlicePlane plane = sweep.Plane(frame);
      for (const double i : {0.0, plane.width - 1.0})
      {
        boxes[s].extend(plane.Point(i, 0)).extend(plane.Point(i, plane.height - 1));
      }
    }
    largest = std::max(largest, boxes[s].diagonal().norm());
  }
  for (std::size_t s = 0; s < sequences.size() && sequences.size() > 1; ++s)
  {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t other = 0; other < sequences.size(); ++other)
    {
      const auto first = poses.begin() + sequences[s].front(), second = poses.begin() + sequences[other].front();
      if (other < s && std::equal(first, first + sequences[s].size(), second, second + sequences[other].size()))
      {
        return "sequences " + std::to_string(other + 1) + " and " + std::to_string(s + 1) +
               " have the same poses: is one given twice?";
      }
      nearest = other == s ? nearest : std::min(nearest, boxes[s].exteriorDistance(boxes[other]));
    }
    if (nearest > kFarApart * largest)
    {
      return "sequence " + std::to_string(s + 1) + " lies " + Format("%.0f mm", nearest) +
             " from the nearest other: are all in one coordinate frame?";
    }
  }
  return std::nullopt;
}

}  // namespace bigus
