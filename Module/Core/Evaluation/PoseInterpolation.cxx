// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Linear and cubic interpolation between tracked frames.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "Core/Evaluation/Baselines.h"
#include "Core/Evaluation/FrameInSpace.h"

namespace bigus
{
namespace
{

/// Linear interpolation between two frames, along the mean of their normals: exact where intensity is linear in space,
/// however the frames are tilted.
class FramePair
{
public:
  FramePair(const FrameInSpace& a, const FrameInSpace& b) : a_(a), b_(b)
  {
    const Eigen::Vector3d na = a.Plane().Normal(), nb = b.Plane().Normal();
    direction_ = (na.dot(nb) < 0 ? Eigen::Vector3d(na - nb) : Eigen::Vector3d(na + nb)).normalized();
    alongA_ = a.Direction(direction_);
    alongB_ = b.Direction(direction_);
  }

  /// The mean of the normals, of length 1.
  const Eigen::Vector3d& Direction() const { return direction_; }

  /// Where the line through a point meets the two planes.
  struct Feet
  {
    Eigen::Vector3d a, b;  // (i, j, 0) on each
    double toA, toB;       // mm along the line, signed
    bool inA, inB;         // whether that is inside the image
    double Gap() const { return std::abs(toA) + std::abs(toB); }
  };

  Feet Find(const Eigen::Vector3d& point) const
  {
    Feet feet;
    const Eigen::Vector3d p = a_.Project(point), q = b_.Project(point);
    feet.toA = -p[2] / alongA_[2];
    feet.toB = -q[2] / alongB_[2];
    feet.a = p + feet.toA * alongA_;
    feet.b = q + feet.toB * alongB_;
    feet.inA = a_.Contains(feet.a);
    feet.inB = b_.Contains(feet.b);
    return feet;
  }

  double Mix(const Feet& feet) const
  {
    if (!feet.inA || !feet.inB)
    {
      return feet.inA ? a_.Sample(feet.a) : feet.inB ? b_.Sample(feet.b) : 0.0;
    }
    const double share = feet.Gap() > 0 ? std::abs(feet.toA) / feet.Gap() : 0.5;
    return (1 - share) * a_.Sample(feet.a) + share * b_.Sample(feet.b);
  }

private:
  FrameInSpace a_, b_;
  Eigen::Vector3d direction_;
  Eigen::Vector3d alongA_, alongB_;  // 1 mm along the line, in each frame's (i, j, z)
};

}  // namespace

void PredictPoseInterpolation(const Sweep& sweep, const std::vector<int>& training, int frame, float* image,
                              PixelInterpolation sampling)
{
  CheckTraining(sweep, training);
  const auto [before, after] = Neighbours(training, frame);
  const FramePair pair(FrameInSpace(sweep, before == kNoFrame ? after : before, sampling),
                       FrameInSpace(sweep, after == kNoFrame ? before : after, sampling));
  ForEachPixel(sweep.Plane(frame), image, [&](const Eigen::Vector3d& x) { return pair.Mix(pair.Find(x)); });
}

void PredictPoseInterpolation(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane,
                              float* image, PixelInterpolation sampling)
{
  CheckTraining(sweep, training);
  std::vector<FrameInSpace> frames;
  std::vector<FramePair> pairs;          // pairs[k] are frames k and k + 1
  std::vector<Eigen::Vector3d> normals;  // all to the same side
  for (int frame : training)
  {
    frames.emplace_back(sweep, frame, sampling);
    Eigen::Vector3d normal = frames.back().Plane().Normal();
    if (!normals.empty())
    {
      pairs.emplace_back(frames[frames.size() - 2], frames.back());
      normal *= normal.dot(normals.back()) < 0 ? -1.0 : 1.0;
    }
    normals.push_back(normal);
  }
  ForEachPixel(plane, image,
               [&](const Eigen::Vector3d& x)
               {
                 double smallest = std::numeric_limits<double>::infinity();
                 double intensity = 0;
                 double before = 0;  // signed distance from the frame before
                 for (std::size_t k = 0; k < frames.size(); ++k)
                 {
                   const double distance = normals[k].dot(x - frames[k].Plane().origin);
                   const double gap = std::abs(before) + std::abs(distance);
                   if (k > 0 && before * distance <= 0 && gap < smallest)
                   {
                     const FramePair::Feet feet = pairs[k - 1].Find(x);
                     if (feet.inA || feet.inB)
                     {
                       smallest = gap;
                       intensity = pairs[k - 1].Mix(feet);
                     }
                   }
                   before = distance;
                 }
                 if (std::isfinite(smallest))
                 {
                   return intensity;
                 }
                 for (const FrameInSpace& frame : frames)
                 {
                   const Eigen::Vector3d p = frame.Project(x);
                   if (std::abs(p[2]) < smallest && frame.Contains(p))
                   {
                     smallest = std::abs(p[2]);
                     intensity = frame.Sample(p);
                   }
                 }
                 return intensity;
               });
}

void PredictCubicInterpolation(const Sweep& sweep, const std::vector<int>& training, int frame, float* image)
{
  CheckTraining(sweep, training);
  const auto [before, after] = Neighbours(training, frame);
  if (before == kNoFrame || after == kNoFrame)
  {
    PredictPoseInterpolation(sweep, training, frame, image, PixelInterpolation::Cubic);
    return;
  }
  const auto inSpace = [&](int index) { return FrameInSpace(sweep, index, PixelInterpolation::Cubic); };
  const FrameInSpace a = inSpace(before), b = inSpace(after);
  const FramePair pair(a, b);
  const int first = Neighbours(training, before).first, last = Neighbours(training, after).second;
  const std::optional<FrameInSpace> outerA = first == kNoFrame ? std::nullopt : std::optional(inSpace(first));
  const std::optional<FrameInSpace> outerB = last == kNoFrame ? std::nullopt : std::optional(inSpace(last));

  // Where the line through x along `direction` meets a frame.
  struct Knot
  {
    double t = 0, value = 0;  // mm along the line; intensity there
    bool seen = false;
  };
  const Eigen::Vector3d direction = pair.Direction();
  const auto meet = [&direction](const FrameInSpace& plane, const Eigen::Vector3d& x)
  {
    const Eigen::Vector3d along = plane.Direction(direction);
    const Eigen::Vector3d p = plane.Project(x);
    const double t = -p[2] / along[2];
    const Eigen::Vector3d foot = p + t * along;
    return plane.Contains(foot) ? Knot{t, plane.Sample(foot), true} : Knot{};
  };
  // The derivative at `at` of the parabola through three knots; the middle one's neighbours lie on its two sides.
  const auto slope = [](const Knot& from, const Knot& at, const Knot& to)
  {
    const double h = at.t - from.t, k = to.t - at.t;
    return ((at.value - from.value) * k / h + (to.value - at.value) * h / k) / (h + k);
  };
  ForEachPixel(sweep.Plane(frame), image,
               [&](const Eigen::Vector3d& x)
               {
                 const Knot knotA = meet(a, x), knotB = meet(b, x);
                 const double gap = knotB.t - knotA.t;
                 const double share = -knotA.t / gap;  // of the way from a to b
                 if (!knotA.seen || !knotB.seen || !(share >= 0 && share <= 1))
                 {
                   return pair.Mix(pair.Find(x));
                 }
                 const double chord = (knotB.value - knotA.value) / gap;
                 double slopeA = chord, slopeB = chord;
                 if (outerA)
                 {
                   const Knot outer = meet(*outerA, x);
                   slopeA = outer.seen && (knotA.t - outer.t) * gap > 0 ? slope(outer, knotA, knotB) : chord;
                 }
                 if (outerB)
                 {
                   const Knot outer = meet(*outerB, x);
                   slopeB = outer.seen && (outer.t - knotB.t) * gap > 0 ? slope(knotA, knotB, outer) : chord;
                 }
                 // Cubic Hermite.
                 const double s = share, r = 1 - share;
                 const double value = r * r * (1 + 2 * s) * knotA.value + s * s * (1 + 2 * r) * knotB.value +
                                      gap * s * r * (r * slopeA - s * slopeB);
                 return std::clamp(value, 0.0, 1.0);
               });
}

}  // namespace bigus
