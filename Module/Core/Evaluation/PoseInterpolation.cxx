// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Linear and cubic interpolation between tracked frames.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "Core/Evaluation/Baselines.h"
#include "Core/Evaluation/FrameInSpace.h"
#include "Core/Model/Sequences.h"

namespace bigus
{
namespace
{

constexpr int kSearches = 3;  // for where on the first frame what comes through a point is from

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
    double Share() const { return Gap() > 0 ? std::abs(toA) / Gap() : 0.5; }
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
    const double share = feet.Share();
    return (1 - share) * a_.Sample(feet.a) + share * b_.Sample(feet.b);
  }

  /// The way from one frame to the other of what comes through the point; both must be met.
  Eigen::Vector3d Way(const Feet& feet, const PixelMoves& moves) const
  {
    if (moves.moves.empty())
    {
      return direction_;
    }
    const double share = feet.Share();
    Eigen::Vector3d move = Eigen::Vector3d::Zero();
    for (int k = 0; k < kSearches; ++k)
    {
      const Eigen::Vector3d from = feet.a - share * move;
      move << moves.At(static_cast<int>(std::lround(from[0])), static_cast<int>(std::lround(from[1]))), 0;
    }
    const Eigen::Vector3d from = feet.a - share * move, to = from + move;
    const Eigen::Vector3d end = Find(a_.Plane().Point(to[0], to[1])).b;
    return b_.Plane().Point(end[0], end[1]) - a_.Plane().Point(from[0], from[1]);
  }

private:
  FrameInSpace a_, b_;
  Eigen::Vector3d direction_;
  Eigen::Vector3d alongA_, alongB_;  // 1 mm along the line, in each frame's (i, j, z)
};

/// Cubic in all directions, between two frames with one more on either side where there is one.
class CubicPair
{
public:
  /// The frames at places k and k + 1 of `frames`, which are in the order of the sweep; which of the two outer ones there
  /// are.
  CubicPair(const std::vector<FrameInSpace>& frames, std::size_t k, bool hasBefore, bool hasAfter)
      : pair_(frames[k], frames[k + 1]),
        a_(frames[k]),
        b_(frames[k + 1]),
        outerA_(hasBefore ? std::optional(frames[k - 1]) : std::nullopt),
        outerB_(hasAfter ? std::optional(frames[k + 2]) : std::nullopt)
  {
  }

  double At(const Eigen::Vector3d& x, const PixelMoves& moves = {}) const
  {
    const FramePair::Feet feet = pair_.Find(x);
    const bool isMet = feet.inA && feet.inB;
    const Eigen::Vector3d way = isMet ? pair_.Way(feet, moves) : pair_.Direction();
    const Knot a = Meet(a_, x, way), b = Meet(b_, x, way);
    const double gap = b.t - a.t;
    const double share = -a.t / gap;  // of the way from a to b
    if (!isMet || !(share >= 0 && share <= 1))
    {
      return pair_.Mix(feet);
    }
    const double chord = (b.value - a.value) / gap;
    double slopeA = chord, slopeB = chord;
    if (outerA_)
    {
      const Knot outer = Meet(*outerA_, x, way);
      slopeA = outer.seen && (a.t - outer.t) * gap > 0 ? Slope(outer, a, b) : chord;
    }
    if (outerB_)
    {
      const Knot outer = Meet(*outerB_, x, way);
      slopeB = outer.seen && (outer.t - b.t) * gap > 0 ? Slope(a, b, outer) : chord;
    }
    // Cubic Hermite.
    const double s = share, r = 1 - share;
    const double value =
        r * r * (1 + 2 * s) * a.value + s * s * (1 + 2 * r) * b.value + gap * s * r * (r * slopeA - s * slopeB);
    return std::clamp(value, 0.0, 1.0);
  }

private:
  /// Where a line through a point meets a frame.
  struct Knot
  {
    double t, value;  // lengths of `way` along the line; intensity there, or at the edge
    bool seen;
  };

  static Knot Meet(const FrameInSpace& plane, const Eigen::Vector3d& x, const Eigen::Vector3d& way)
  {
    const Eigen::Vector3d along = plane.Direction(way);
    const Eigen::Vector3d p = plane.Project(x);
    const double t = -p[2] / along[2];
    const Eigen::Vector3d foot = p + t * along;
    return {t, plane.Sample(foot), plane.Contains(foot)};
  }

  /// The derivative at `at` of the parabola through three knots; the middle one's neighbours lie on its two sides.
  static double Slope(const Knot& from, const Knot& at, const Knot& to)
  {
    const double h = at.t - from.t, k = to.t - at.t;
    return ((at.value - from.value) * k / h + (to.value - at.value) * h / k) / (h + k);
  }

  FramePair pair_;
  FrameInSpace a_, b_;
  std::optional<FrameInSpace> outerA_, outerB_;
};

/// The training frames in space, in order, and which two consecutive ones enclose a point.
class FrameStack
{
public:
  FrameStack(const Sweep& sweep, const std::vector<int>& training, PixelInterpolation sampling)
  {
    CheckTraining(sweep, training);
    for (int frame : training)
    {
      around_.push_back(NeighboursOf(sweep, training, frame));
      frames_.emplace_back(sweep, frame, sampling);
      Eigen::Vector3d normal = frames_.back().Plane().Normal();
      if (!normals_.empty())
      {
        pairs_.emplace_back(frames_[frames_.size() - 2], frames_.back());
        normal *= normal.dot(normals_.back()) < 0 ? -1.0 : 1.0;
      }
      normals_.push_back(normal);
    }
  }

  const std::vector<FrameInSpace>& Frames() const { return frames_; }
  /// Of the pairs that have the point between them and for which `accept(feet)` holds, the one with the smallest sum of
  /// distances; kNoFrame when there is none.
  template <class Accept>
  int Enclosing(const Eigen::Vector3d& x, const Accept& accept) const
  {
    int found = kNoFrame;
    double smallest = std::numeric_limits<double>::infinity();
    double before = 0;  // signed distance from the frame before
    for (std::size_t k = 0; k < frames_.size(); ++k)
    {
      const double distance = normals_[k].dot(x - frames_[k].Plane().origin);
      const double gap = std::abs(before) + std::abs(distance);
      if (around_[k].before && before * distance <= 0 && gap < smallest && accept(pairs_[k - 1].Find(x)))
      {
        smallest = gap;
        found = static_cast<int>(k) - 1;
      }
      before = distance;
    }
    return found;
  }

  /// `between(k)` where frames k and k + 1 enclose the point; else the sample of the nearest frame that it projects onto
  /// at right angles, if any.
  template <class Between>
  double At(const Eigen::Vector3d& x, const Between& between) const
  {
    const int k = Enclosing(x, [](const FramePair::Feet& feet) { return feet.inA || feet.inB; });
    if (k != kNoFrame)
    {
      return between(k);
    }
    double smallest = std::numeric_limits<double>::infinity();
    double intensity = 0;
    for (const FrameInSpace& frame : frames_)
    {
      const Eigen::Vector3d p = frame.Project(x);
      if (std::abs(p[2]) < smallest && frame.Contains(p))
      {
        smallest = std::abs(p[2]);
        intensity = frame.Sample(p);
      }
    }
    return intensity;
  }

  /// The mix of the two frames around a point.
  double Linear(const Eigen::Vector3d& x) const
  {
    return At(x, [&](int k) { return pairs_[k].Mix(pairs_[k].Find(x)); });
  }

  /// Consecutive frames with those around them.
  std::vector<CubicPair> Cubics() const
  {
    std::vector<CubicPair> cubics;
    for (std::size_t k = 0; k + 1 < frames_.size(); ++k)
    {
      cubics.emplace_back(frames_, k, around_[k].before.has_value(), around_[k + 1].after.has_value());
    }
    return cubics;
  }

private:
  std::vector<FrameInSpace> frames_;
  std::vector<Neighbours> around_;  // of the frames
  std::vector<FramePair> pairs_;
  std::vector<Eigen::Vector3d> normals_;  // all to the same side
};

}  // namespace

void PredictPoseInterpolation(const Sweep& sweep, const std::vector<int>& training, int frame, float* image,
                              PixelInterpolation sampling)
{
  CheckTraining(sweep, training);
  const auto [before, after] = NeighboursOf(sweep, training, frame);
  const FramePair pair(FrameInSpace(sweep, before ? *before : after.value_or(kNoFrame), sampling),
                       FrameInSpace(sweep, after ? *after : before.value_or(kNoFrame), sampling));
  ForEachPixel(sweep.Plane(frame), image, [&](const Eigen::Vector3d& x) { return pair.Mix(pair.Find(x)); });
}

void PredictPoseInterpolation(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane,
                              float* image, PixelInterpolation sampling)
{
  const FrameStack stack(sweep, training, sampling);
  ForEachPixel(plane, image, [&](const Eigen::Vector3d& x) { return stack.Linear(x); });
}

std::vector<float> PoseInterpolationAt(const Sweep& sweep, const std::vector<int>& training,
                                       const std::vector<Eigen::Vector3d>& points, const std::vector<PixelMoves>& moves)
{
  const FrameStack stack(sweep, training, PixelInterpolation::Linear);
  const std::vector<CubicPair> pairs = stack.Cubics();
  std::vector<float> values(points.size());
  tbb::parallel_for(
      std::size_t(0), points.size(),
      [&](std::size_t i) {
        values[i] = static_cast<float>(stack.At(points[i], [&](int k) { return pairs[k].At(points[i], moves[k]); }));
      });
  return values;
}

void PredictCubicInterpolation(const Sweep& sweep, const std::vector<int>& training, int frame, float* image)
{
  CheckTraining(sweep, training);
  const auto [before, after] = NeighboursOf(sweep, training, frame);
  if (!before || !after)
  {
    PredictPoseInterpolation(sweep, training, frame, image, PixelInterpolation::Cubic);
    return;
  }
  std::vector<FrameInSpace> frames;
  const auto first = NeighboursOf(sweep, training, *before).before, last = NeighboursOf(sweep, training, *after).after;
  for (const std::optional<int>& near : {first, before, after, last})
  {
    if (near)
    {
      frames.emplace_back(sweep, *near, PixelInterpolation::Cubic);
    }
  }
  const CubicPair cubic(frames, first ? 1 : 0, first.has_value(), last.has_value());
  ForEachPixel(sweep.Plane(frame), image, [&](const Eigen::Vector3d& x) { return cubic.At(x); });
}

void PredictCubicInterpolation(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane,
                               float* image)
{
  const FrameStack stack(sweep, training, PixelInterpolation::Cubic);
  const std::vector<CubicPair> pairs = stack.Cubics();
  ForEachPixel(plane, image,
               [&](const Eigen::Vector3d& x) { return stack.At(x, [&](int k) { return pairs[k].At(x); }); });
}

void FindEnclosed(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane, std::uint8_t* enclosed)
{
  const FrameStack stack(sweep, training, PixelInterpolation::Linear);
  // Within the outermost pixel centres; a plane along the images' border stays inside in spite of rounding.
  constexpr double kRounding = 1e-6;  // pixels
  const auto isInImage = [&sweep](const Eigen::Vector3d& foot)
  {
    const auto nearest = [](double at, int size)
    { return at >= -kRounding && at <= size - 1 + kRounding ? static_cast<int>(std::lround(at)) : kNoFrame; };
    const int i = nearest(foot[0], sweep.width), j = nearest(foot[1], sweep.height);
    return i >= 0 && j >= 0 && sweep.IsLit(static_cast<std::size_t>(j) * sweep.width + i);
  };
  const auto isInside = [&](const FramePair::Feet& feet) { return isInImage(feet.a) && isInImage(feet.b); };
  tbb::parallel_for(0, plane.height,
                    [&](int j)
                    {
                      for (int i = 0; i < plane.width; ++i)
                      {
                        enclosed[static_cast<std::size_t>(j) * plane.width + i] =
                            stack.Enclosing(plane.Point(i, j), isInside) != kNoFrame;
                      }
                    });
}

}  // namespace bigus
