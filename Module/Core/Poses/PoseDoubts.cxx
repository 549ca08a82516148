// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/PoseDoubts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "Core/Model/SlicePlane.h"
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
  double path = 0;                       // of the image's centre, mm
  double corner = 0;                     // of pixel (0, 0)
};

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
    seen.smallest = std::min(seen.smallest, plane.PixelSize());
    seen.largest = std::max(seen.largest, plane.PixelSize());
    if (k > 0)
    {
      const SlicePlane before = sweep.Plane(frames[k - 1]);
      seen.path += (CentreOf(plane) - CentreOf(before)).norm();
      seen.corner += (plane.origin - before.origin).norm();
      seen.coplanar += LargestHeight(plane, before) < kCoplanar * plane.PixelSize() ? 1 : 0;
    }
  }
  return seen;
}

}  // namespace

std::vector<std::string> DoubtsAboutPoses(const Sweep& sweep, const std::vector<int>& looked)
{
  std::vector<std::string> doubts;
  const int frames = static_cast<int>(looked.size());
  if (frames == 0)
  {
    return doubts;
  }
  const auto [sheared, coplanar, angle, smallest, largest, path, corner] = Look(sweep, looked);
  const SlicePlane first = sweep.Plane(looked[0]);
  const double diagonal = (sweep.width * first.columnStep + sweep.height * first.rowStep).norm();
  if (smallest < kSmallestPixel)
  {
    doubts.push_back("Pixels of " + Format("%.3g mm", smallest) +
                     " are too small for ultrasound: matrices must be in millimetres, not in metres.");
  }
  else if (largest > kLargestPixel || (largest > kCoarsePixel && diagonal > kLargestImage))
  {
    doubts.push_back("Pixels of " + Format("%.3g mm", largest) +
                     " are too large for ultrasound: matrices must be in millimetres, and contain the image's scale.");
  }
  else if (const double least = std::min(path, corner);  // a probe that turns moves the one by the other
           frames > 1 && coplanar < frames - 1 && least < kShortestPath * diagonal)
  {
    doubts.push_back("A path of " + Format("%.3g mm", least) + " is short beside an image of " +
                     Format("%.3g mm", diagonal) + ": the probe hardly moved, or translations are in metres.");
  }
  else if (frames > 1 && path > kLongestPath * diagonal)
  {
    doubts.push_back("A path of " + Format("%.3g mm", path) + " is long beside an image of " +
                     Format("%.3g mm", diagonal) + ": translations must be in millimetres.");
  }
  if (largest > (1 + kScaled) * smallest)
  {
    doubts.push_back("Pixels measure from " + Format("%.4g", smallest) + Format(" to %.4g mm", largest) +
                     ": the matrices of a sweep should have one scale.");
  }
  if (sheared > 0)
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
