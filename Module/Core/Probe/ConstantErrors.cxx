// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Probe/ConstantErrors.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <set>
#include <string>
#include <utility>

#include "Core/Model/Error.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/LevenbergMarquardt.h"
#include "Core/Numerics/Random.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Poses/Alignment.h"
#include "Core/Poses/PoseError.h"

namespace bigus
{
namespace
{

// What is sought, in this order: delay in seconds, shift in mm, rotation in degrees; of the correction.
constexpr int kParameters = 7;
using Vector = Eigen::Matrix<double, kParameters, 1>;
using Matrix = Eigen::Matrix<double, kParameters, kParameters>;

/// The same three numbers for the three kinds of parameter.
Vector PerKind(double delay, double shift, double rotation)
{
  Vector all;
  all << delay, shift, shift, shift, rotation, rotation, rotation;
  return all;
}

// Where no reason is given, a value was chosen, not measured.

// Errors of this size (standard deviation) are expected before a picture is seen.
const Vector kPrior = PerKind(0.1, 3, 3);
// A parameter whose standard error is larger is left at 0, ...
const Vector kObservable = PerKind(0.01, 0.3, 0.3);
// ... unless it differs from 0 by so many standard errors, and they are at most so many times larger. Fewer standard
// errors are no evidence of an error; much larger ones come with what single poses are off by.
constexpr double kIdentified = 2;  // standard errors: 95 of 100 estimates of nothing are nearer to 0
constexpr double kLeastKnown = 2;
// Estimates of phantoms without error scatter by twice their standard errors: beams of different directions do not show
// the same, and that is the same in all of the overlap.
constexpr double kSystematic = 2;
constexpr double kLeastBending = 0.1;         // mm: a correction that bends the sweep less is not worth the change
constexpr double kSure = 2;                   // standard errors by which frames must confirm more than half of a step
constexpr std::size_t kFewestOverlaps = 500;  // some seventy for each of seven parameters

Eigen::Vector3d RotationVector(const Eigen::Matrix3d& rotation)
{
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Eigen::Matrix3d RotationBy(const Eigen::Vector3d& vector)
{
  const double angle = vector.norm();
  return angle > 0 ? Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix() : Eigen::Matrix3d::Identity();
}

// ---- The path ----

constexpr double kPathBreak = 5;  // times the usual time or distance between frames: the path does not go on
constexpr int kPathReach = 5;     // frames to each side that say how the path bends; a quarter of a second at 20 Hz

/// The recorded poses and how they go on in time.
class Path
{
public:
  explicit Path(const Sweep& sweep)
  {
    const int frames = sweep.NumberOfFrames();
    std::vector<double> waits, steps;
    for (int k = 0; k < frames; ++k)
    {
      planes_.push_back(sweep.Plane(k));
      if (k > 0)
      {
        steps.push_back((CentreOf(planes_[k]) - CentreOf(planes_[k - 1])).norm());
        waits.push_back(sweep.timestamps.empty() ? 1 : sweep.timestamps[k] - sweep.timestamps[k - 1]);
      }
    }
    const double wait = Median(waits), step = Median(steps);
    const auto goesOn = [](const std::vector<double>& all, double usual, std::size_t k)
    { return all[k] <= kPathBreak * std::max(usual, UsualAround(all, k)); };
    segment_.assign(frames, 0);
    for (int k = 1; k < frames; ++k)
    {
      const bool breaks = !(waits[k - 1] > 0 && goesOn(waits, wait, k - 1)) || !goesOn(steps, step, k - 1);
      segment_[k] = segment_[k - 1] + (breaks ? 1 : 0);
    }
    bends_.assign(frames, Bend::Zero());
    for (int k = 0; k < frames && !sweep.timestamps.empty(); ++k)
    {
      bends_[k] = BendAt(sweep, k);
      speed_ += bends_[k].block<1, 3>(0, 0).norm() / frames;
    }
  }

  /// mm a second, on average; 0 when there are no times.
  double Speed() const { return speed_; }
  /// Frames of one segment follow each other without a break.
  int Segment(int frame) const { return segment_[frame]; }
  const SlicePlane& Recorded(int frame) const { return planes_[frame]; }

  /// Where the frame is once q is corrected. The motion of the smooth path within the delay is added to the recorded
  /// pose, so the tracker's noise stays as it is: to read the path between frames would average noise away, which
  /// makes any delay of half a frame look good.
  SlicePlane Corrected(int frame, const Vector& q) const
  {
    SlicePlane plane = planes_[frame];
    if (q[0] != 0)
    {
      const Eigen::Matrix<double, 1, 6> motion = q[0] * bends_[frame].row(0) + q[0] * q[0] * bends_[frame].row(1);
      const Eigen::Matrix3d turn = RotationBy(motion.tail<3>().transpose());
      const Eigen::Vector3d centre = CentreOf(plane);
      plane.columnStep = turn * plane.columnStep;
      plane.rowStep = turn * plane.rowStep;
      plane.origin = centre + motion.head<3>().transpose() + turn * (plane.origin - centre);
    }
    return Moved(plane, q.segment<3>(1), q.tail<3>());
  }

private:
  using Bend = Eigen::Matrix<double, 2, 6>;  // of tau and tau^2: position of the centre, mm; rotation vector, radians

  /// Least squares of a parabola in time through the poses around frame k.
  Bend BendAt(const Sweep& sweep, int k) const
  {
    std::vector<int> near;
    for (int n = std::max(0, k - kPathReach); n <= std::min(sweep.NumberOfFrames() - 1, k + kPathReach); ++n)
    {
      if (segment_[n] == segment_[k])
      {
        near.push_back(n);
      }
    }
    Bend bend = Bend::Zero();
    const int terms = near.size() >= 5 ? 3 : near.size() >= 2 ? 2 : 1;
    Eigen::MatrixXd powers(near.size(), terms), motions(near.size(), 6);
    const Eigen::Matrix3d axes = AxesOf(planes_[k]);
    for (std::size_t n = 0; n < near.size(); ++n)
    {
      const SlicePlane& there = planes_[near[n]];
      for (int term = 0; term < terms; ++term)
      {
        powers(n, term) = std::pow(sweep.timestamps[near[n]] - sweep.timestamps[k], term);
      }
      motions.row(n) << (CentreOf(there) - CentreOf(planes_[k])).transpose(),
          RotationVector(AxesOf(there) * axes.transpose()).transpose();
    }
    if (terms > 1)
    {
      bend.topRows(terms - 1) = powers.colPivHouseholderQr().solve(motions).bottomRows(terms - 1);
    }
    return bend;
  }

  std::vector<SlicePlane> planes_;
  std::vector<int> segment_;
  std::vector<Bend> bends_;
  double speed_ = 0;
};

// ---- Overlaps: places that are seen twice ----

constexpr int kTries = 40000;  // places looked at for a second view
// At most, each at one place from one frame: above 2000 frames fewer places are looked at.
constexpr double kLooks = 8e7;
constexpr std::size_t kMostOverlaps = 12000;
constexpr double kCrossing = 10;    // degrees between two planes from which on they cross
constexpr double kAway = 4;         // mm: a place that the probe left so far and came back to is seen anew
constexpr double kWidestGap = 0.8;  // mm between two frames that a place between them is predicted from

/// Where a frame is, for points to be projected onto it.
struct FramePose
{
  SlicePlane plane;
  Eigen::Matrix3d toSlice;
  Eigen::Vector3d normal;
  double offset;  // of the plane along its normal, mm

  double Height(const Eigen::Vector3d& point) const { return normal.dot(point) - offset; }
  Eigen::Vector3d Project(const Eigen::Vector3d& point) const { return toSlice * (point - plane.origin); }
};

constexpr double kCell = 8;  // mm: what places of different cells say is independent; 4 to 15 gave the same errors
using Cell = std::array<int, 3>;

Cell CellOf(const Eigen::Vector3d& point, double size)
{
  const Eigen::Vector3d cell = (point / size).array().floor();
  return {static_cast<int>(cell[0]), static_cast<int>(cell[1]), static_cast<int>(cell[2])};
}

/// A place that is seen twice: a pixel of one frame, and the first of two consecutive frames between which it lies. Frames are counted among those
/// whose pixels may be read.
struct Overlap
{
  int frame;
  double i, j;
  int before;
};

/// The frames whose pixels may be read, on the path.
class SeenFrames
{
public:
  SeenFrames(const Sweep& sweep, const std::vector<int>& frames) : path_(sweep), frames_(frames) {}

  const Path& ThePath() const { return path_; }
  int Count() const { return static_cast<int>(frames_.size()); }
  const SlicePlane& Recorded(int k) const { return path_.Recorded(frames_[k]); }
  bool Follow(int a, int b) const { return path_.Segment(frames_[a]) == path_.Segment(frames_[b]); }

  std::vector<FramePose> Poses(const Vector& q) const
  {
    std::vector<FramePose> poses;
    for (const int frame : frames_)
    {
      const SlicePlane plane = path_.Corrected(frame, q);
      const Eigen::Vector3d normal = plane.Normal();
      poses.push_back({plane, plane.WorldToSlice(), normal, normal.dot(plane.origin)});
    }
    return poses;
  }

  /// Pixels of frames that lie between two consecutive frames which cross this one, or which were taken after the probe
  /// had been away or had been lifted. Frames next to each other on the path tell nothing: an oblique vessel seems to
  /// move in the image just as if the image were turned on the probe.
  std::vector<Overlap> FindOverlaps(const Vector& q) const
  {
    const std::vector<FramePose> poses = Poses(q);
    Eigen::ArrayX4d normals(Count(), 4);
    for (int b = 0; b < Count(); ++b)
    {
      normals.row(b) << poses[b].normal.transpose().array(), poses[b].offset;
    }
    // No more places than pixels, which say nothing new.
    const double pixels = static_cast<double>(Count()) * Recorded(0).NumberOfPixels();
    const int tries = static_cast<int>(std::min({static_cast<double>(kTries), kLooks / Count(), pixels}));
    const int step = (Count() + tries - 1) / tries;
    std::vector<std::vector<Overlap>> found((Count() + step - 1) / step);
    tbb::parallel_for(0, static_cast<int>(found.size()),
                      [&](int k) { found[k] = OverlapsOf(k * step, poses, normals, std::max(1, tries / Count())); });
    std::vector<Overlap> all;
    for (const std::vector<Overlap>& overlaps : found)
    {
      all.insert(all.end(), overlaps.begin(), overlaps.end());
    }
    const std::size_t kept = std::min(all.size(), kMostOverlaps);
    for (std::size_t n = 0; n < kept; ++n)
    {
      all[n] = all[n * all.size() / kept];
    }
    all.resize(kept);
    return all;
  }

private:
  /// Columns of `normals`: x, y, z and offset of every frame, since each place is held against all frames.
  std::vector<Overlap> OverlapsOf(int a, const std::vector<FramePose>& poses, const Eigen::ArrayX4d& normals,
                                  int tries) const
  {
    std::vector<Overlap> overlaps;
    RandomNumbers random(static_cast<std::uint64_t>(a));
    const SlicePlane& plane = poses[a].plane;
    Eigen::ArrayXd height(poses.size());
    for (int n = 0; n < tries; ++n)
    {
      Overlap overlap{a, random.Uniform(0, plane.width - 1), random.Uniform(0, plane.height - 1), 0};
      const std::uint64_t choice = random.Bits();
      const Eigen::Vector3d point = plane.Point(overlap.i, overlap.j);
      height = normals.col(0) * point[0] + (normals.col(1) * point[1] + normals.col(2) * point[2]) - normals.col(3);
      std::vector<int> pairs;
      AddPairs(a, -1, point, poses, height, pairs);
      AddPairs(a, 1, point, poses, height, pairs);
      if (!pairs.empty())
      {
        overlap.before = pairs[choice % pairs.size()];
        overlaps.push_back(overlap);
      }
    }
    return overlaps;
  }

  void AddPairs(int a, int side, const Eigen::Vector3d& point, const std::vector<FramePose>& poses,
                const Eigen::ArrayXd& height, std::vector<int>& pairs) const
  {
    const double crossing = std::cos(kCrossing * kRadiansPerDegree);
    double away = 0;
    for (int b = a + side, c = b + side; b >= 0 && c >= 0 && b < Count() && c < Count(); b = c, c += side)
    {
      away = std::max(away, std::abs(height[b]));
      if ((height[b] > 0) != (height[c] > 0) && std::abs(height[b] - height[c]) <= kWidestGap && Follow(b, c))
      {
        const bool isAnew = std::abs(poses[b].normal.dot(poses[a].normal)) < crossing || away > kAway || !Follow(a, b);
        const Eigen::Vector3d at = poses[b].Project(point);
        const bool isInside =
            at[0] >= 0 && at[1] >= 0 && at[0] <= poses[b].plane.width - 1 && at[1] <= poses[b].plane.height - 1;
        if (isAnew && isInside)
        {
          pairs.push_back(std::min(b, c));
        }
      }
    }
  }

  Path path_;
  const std::vector<int> frames_;
};

// ---- Pictures ----

constexpr std::size_t kMostPixels = std::size_t(1) << 24;  // of all pictures of a level: 64 MB of floats
// Standard deviations: what is wider is taken out of the pictures, because gain and enhancement depend on the beam.
constexpr double kFlattening = 3;
// Of white: what is darker is left out. Shadows turn with the beam.
constexpr float kDark = 0.1f;
constexpr double kEnd = 2;        // sigma: 95 % of a Gaussian
constexpr double kSafety = 3;     // the angle between frames that flow together is so much smaller than kCrossing
constexpr double kShrink = 0.7;   // smoothings: pixels of a reduced picture; below 1 they sample what is left
constexpr int kFewestPixels = 8;  // a side of a reduced picture
constexpr double kLeastVariance = 0.01;  // pixels^2, of a blur: a narrower one leaves a picture as it is
constexpr float kLeastWeight = 1e-3f;    // of lit pixels under the kernel: keeps a division by 0 away
constexpr double kLeastSpacing = 1e-3;   // mm: frames at one place still count

/// The frames smoothed, in the frame and across frames.
class Pictures
{
public:
  /// `sigma` is in mm.
  Pictures(const Sweep& seen, const SeenFrames& seenFrames, double sigma)
  {
    const double pixel = seen.Plane(0).PixelSize();
    block_ = std::max(1, static_cast<int>(std::lround(kShrink * sigma / pixel)));
    const int coarsest = std::max(1, std::min(seen.width, seen.height) / kFewestPixels);
    while (seen.PixelsPerFrame() * seen.NumberOfFrames() / (block_ * block_) > kMostPixels)
    {
      ++block_;
    }
    block_ = std::min(block_, coarsest);
    // A box of n pixels has the variance n^2 / 12.
    const double blur = std::sqrt(std::max(kLeastVariance, std::pow(sigma / (pixel * block_), 2) - 1.0 / 12));
    SmoothInPlane(seen.Reduced(block_), blur);
    SmoothAcross(seenFrames, sigma);
    Flatten(kFlattening * sigma / (pixel * block_));
  }

  /// At pixel (i, j) of the full-size frame; false where nothing is to be read.
  bool Sample(int frame, double i, double j, double& value) const
  {
    const double u = (i - 0.5 * (block_ - 1)) / block_, v = (j - 0.5 * (block_ - 1)) / block_;
    const cv::Mat& image = images_[frame];
    if (!(u >= 0 && v >= 0 && u < image.cols - 1 && v < image.rows - 1))
    {
      return false;
    }
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    const auto* m0 = usable_[frame].ptr<std::uint8_t>(y) + x;
    const auto* m1 = usable_[frame].ptr<std::uint8_t>(y + 1) + x;
    if (!(m0[0] && m0[1] && m1[0] && m1[1]))
    {
      return false;
    }
    const double fx = u - x, fy = v - y;
    const float* p0 = image.ptr<float>(y) + x;
    const float* p1 = image.ptr<float>(y + 1) + x;
    value = (1 - fy) * ((1 - fx) * p0[0] + fx * p0[1]) + fy * ((1 - fx) * p1[0] + fx * p1[1]);
    return true;
  }

private:
  /// What is wider than the picture counts as wide as it: of tiny pixels a kernel would have any length.
  static cv::Mat Blurred(const cv::Mat& image, double sigma)
  {
    cv::Mat out;
    sigma = std::min<double>(sigma, std::max(image.rows, image.cols));
    cv::GaussianBlur(image, out, {}, sigma, sigma, cv::BORDER_CONSTANT);
    return out;
  }

  /// Weighted by what is lit.
  void SmoothInPlane(const Sweep& reduced, double blur)
  {
    cv::Mat lit(reduced.height, reduced.width, CV_32F), isLit(reduced.height, reduced.width, CV_8U);
    for (std::size_t p = 0; p < reduced.PixelsPerFrame(); ++p)
    {
      isLit.ptr()[p] = reduced.IsLit(p) ? 1 : 0;
      lit.ptr<float>()[p] = isLit.ptr()[p];
    }
    const cv::Mat weight = cv::max(Blurred(lit, blur), kLeastWeight);
    images_.resize(reduced.NumberOfFrames());
    usable_.assign(images_.size(), isLit);
    tbb::parallel_for(0, reduced.NumberOfFrames(),
                      [&](int k)
                      {
                        cv::Mat image(reduced.height, reduced.width, CV_32F);
                        reduced.CopyFrame(k, image.ptr<float>());
                        images_[k] = Blurred(image.mul(lit), blur) / weight;
                      });
  }

  /// Speckle of two directions is alike only when it is smoothed alike in all directions. Frames that cross, or were
  /// taken another time, must not flow together, or they would agree at the given poses whatever these are: the sum
  /// ends at kEnd sigma and at 1 / kSafety of the angle from which on planes cross.
  void SmoothAcross(const SeenFrames& seenFrames, double sigma)
  {
    const double parallel = std::cos(kCrossing / kSafety * kRadiansPerDegree);
    std::vector<cv::Mat> smoothed(images_.size());
    tbb::parallel_for(0, seenFrames.Count(),
                      [&](int k)
                      {
                        const SlicePlane& plane = seenFrames.Recorded(k);
                        cv::Mat sum = images_[k] * Spacing(seenFrames, k);
                        cv::Mat weights(sum.rows, sum.cols, CV_32F, cv::Scalar(Spacing(seenFrames, k)));
                        for (const int side : {-1, 1})
                        {
                          cv::Mat going(sum.rows, sum.cols, CV_8U, cv::Scalar(1));
                          bool any = true;
                          for (int b = k + side; any && b >= 0 && b < seenFrames.Count(); b += side)
                          {
                            const SlicePlane& there = seenFrames.Recorded(b);
                            any = seenFrames.Follow(k, b) && std::abs(there.Normal().dot(plane.Normal())) > parallel &&
                                  AddAcross(plane, there, b, Spacing(seenFrames, b), sigma, going, sum, weights);
                          }
                        }
                        smoothed[k] = sum / weights;
                      });
    images_ = std::move(smoothed);
  }

  /// Length of the path that frame k stands for, mm.
  static double Spacing(const SeenFrames& seenFrames, int k)
  {
    const int before = k > 0 && seenFrames.Follow(k - 1, k) ? k - 1 : k;
    const int after = k + 1 < seenFrames.Count() && seenFrames.Follow(k, k + 1) ? k + 1 : k;
    const double length = (CentreOf(seenFrames.Recorded(after)) - CentreOf(seenFrames.Recorded(before))).norm();
    return std::max(kLeastSpacing, length / std::max(1, after - before));
  }

  /// Adds frame `b`, which is `there`, to a weighted sum at `plane`, where it is near. False when it is near nowhere.
  bool AddAcross(const SlicePlane& plane, const SlicePlane& there, int b, double share, double sigma, cv::Mat& going,
                 cv::Mat& sum, cv::Mat& weights) const
  {
    const double first = 0.5 * (block_ - 1);
    const Eigen::Matrix3d toSlice = there.WorldToSlice();
    const Eigen::Vector3d origin = toSlice * (plane.Point(first, first) - there.origin);
    const Eigen::Vector3d right = block_ * toSlice * plane.columnStep, down = block_ * toSlice * plane.rowStep;
    bool any = false;
    for (int y = 0; y < sum.rows; ++y)
    {
      auto* s = sum.ptr<float>(y);
      auto* w = weights.ptr<float>(y);
      auto* go = going.ptr<std::uint8_t>(y);
      for (int x = 0; x < sum.cols; ++x)
      {
        const Eigen::Vector3d at = origin + x * right + y * down;
        const double distance = at[2] / sigma;
        go[x] = go[x] && distance * distance < kEnd * kEnd ? 1 : 0;
        double value = 0;
        if (go[x] && Sample(b, at[0], at[1], value))
        {
          const double weight = share * std::exp(-0.5 * distance * distance);
          s[x] += static_cast<float>(weight * value);
          w[x] += static_cast<float>(weight);
        }
        any = any || go[x];
      }
    }
    return any;
  }

  void Flatten(double blur)
  {
    tbb::parallel_for(std::size_t(0), images_.size(),
                      [&](std::size_t k)
                      {
                        cv::Mat bright = (images_[k] > kDark) & (usable_[k] > 0), weight;
                        bright.convertTo(weight, CV_32F, 1.0 / 255);
                        const cv::Mat mean = Blurred(images_[k].mul(weight), blur);
                        images_[k] = images_[k] - mean / cv::max(Blurred(weight, blur), kLeastWeight);
                        usable_[k] = bright;
                      });
  }

  int block_ = 1;  // pixels a side that became one
  std::vector<cv::Mat> images_, usable_;
};

// ---- What is minimised ----

// Root mean square distance of the pixels of an image from its centre, in diagonals: 1 / sqrt(12), rounded. It only
// scales the steps below.
constexpr double kLever = 0.29;
constexpr double kStep = 0.25;           // smoothings: the steps of central differences
constexpr double kConverged = 0.06;      // of these steps: a change of 1/64 of the smoothing ends the search
constexpr double kBounds = 3;            // prior deviations: as far as the coarsest smoothing can see
constexpr double kLeastScale = 1e-3;     // of white: pictures without any difference have a scale, too
constexpr double kIndependent = 3;       // smoothings between overlaps that are independent
constexpr double kBendingSteps = 2;      // steps to each side by which the cost's own bending is measured
constexpr double kLeastOfBending = 0.1;  // of the linearisation: a standard error is at most ten times as large for it
// The smallest width of a Cauchy cost at which estimates are 95 % efficient, and a standard deviation in median sizes.
constexpr double kCauchy = 2.385, kDeviationByMedian = 1.4826;

/// The disagreement of frames at places that are seen twice: the difference r between what one frame shows there and
/// what two consecutive others show in between, in sum of w log(1 + r^2 / s^2), and the prior.
class Disagreement
{
public:
  struct State
  {
    std::vector<float> differences;  // not a number where the place is not seen twice
    double cost = 0;
  };

  /// `sigma`, mm, is that of the pictures. `free` parameters may change.
  Disagreement(const SeenFrames& seenFrames, const Pictures& pictures, double sigma,
               const std::vector<Overlap>& overlaps, const std::vector<bool>& free, const Vector& q)
      : seenFrames_(seenFrames), pictures_(pictures), free_(free)
  {
    const SlicePlane& plane = seenFrames.Recorded(0);
    const Eigen::Vector2d size(plane.width * plane.columnStep.norm(), plane.height * plane.rowStep.norm());
    const double lever = kLever * size.norm();
    const double speed = seenFrames.ThePath().Speed();
    step_ = PerKind(speed > 0 ? 1 / speed : 0, 1, 1 / lever / kRadiansPerDegree) * kStep * sigma;
    Calibrate(sigma, q, KeepSeen(overlaps, q));
  }

  const std::vector<Overlap>& Overlaps() const { return overlaps_; }

  State Evaluate(const Vector& q) const
  {
    State state;
    state.differences = Differences(q);
    double sum = 0;
    for (std::size_t n = 0; n < overlaps_.size(); ++n)
    {
      // An overlap that is lost counts as it was: to lose sight of it is no gain.
      const double r = std::isnan(state.differences[n]) ? start_[n] : state.differences[n];
      sum += Cost(r);
    }
    state.cost = share_ * sum + q.cwiseQuotient(kPrior).squaredNorm();
    return state;
  }

  /// Of one difference.
  double Cost(double r) const { return std::log1p(r * r / (scale_ * scale_)); }

  /// Of two differences at one place: what the cost above counts their squares by, the same for both.
  double Weight(double r, double s) const { return 1 / (scale_ * scale_ + 0.5 * (r * r + s * s)); }

  std::pair<Matrix, Vector> Linearise(const Vector& q, const State& state) const
  {
    Matrix hessian = Matrix::Zero();
    Vector gradient = Vector::Zero();
    ForEachRow(q, state,
               [&](std::size_t, double weight, const Vector& row, double r)
               {
                 hessian.noalias() += weight * row * row.transpose();
                 gradient += weight * r * row;
               });
    hessian.diagonal() += kPrior.cwiseAbs2().cwiseInverse();
    for (int p = 0; p < kParameters; ++p)
    {
      gradient[p] += free_[p] ? q[p] / (kPrior[p] * kPrior[p]) : 0;
    }
    return {hessian, gradient};
  }

  Vector Bounded(const Vector& q) const { return q.cwiseMax(-kBounds * kPrior).cwiseMin(kBounds * kPrior); }

  bool IsConverged(const Vector& from, const Vector& to, double /*costFrom*/, double /*costTo*/) const
  {
    return ((to - from).cwiseAbs() - kConverged * step_).maxCoeff() <= 0;
  }

  /// Covariance of the free parameters at the minimum. Differences of overlaps close together are alike, and so are those
  /// of one frame, whose pose has an error of its own. So gradients are added up by cell of space and by frame before
  /// they are squared; what both count is taken away once (clustering in two ways: Cameron, Gelbach and Miller, 2011).
  Matrix Covariance(const Vector& q, const State& state) const
  {
    const std::vector<FramePose> poses = seenFrames_.Poses(q);
    std::map<Cell, Vector> cells;
    std::map<int, Vector> frames;
    std::map<std::pair<Cell, int>, Vector> both;
    Matrix hessian = Matrix::Zero();
    ForEachRow(q, state,
               [&](std::size_t n, double weight, const Vector& row, double r)
               {
                 const Overlap& overlap = overlaps_[n];
                 const Cell cell = CellOf(poses[overlap.frame].plane.Point(overlap.i, overlap.j), kCell);
                 const Vector gradient = weight * r * row;
                 cells.try_emplace(cell, Vector::Zero()).first->second += gradient;
                 frames.try_emplace(overlap.frame, Vector::Zero()).first->second += gradient;
                 both.try_emplace({cell, overlap.frame}, Vector::Zero()).first->second += gradient;
                 hessian.noalias() += weight * row * row.transpose();
               });
    const Matrix prior = kPrior.cwiseAbs2().cwiseInverse().asDiagonal();
    const Matrix inverse = (Bending(q, state, hessian) * hessian + prior).inverse();
    const Matrix byCell = Squares(cells);
    Matrix scatter = byCell + Squares(frames) - Squares(both);
    Matrix covariance = inverse * (scatter + prior) * inverse;
    // What is taken away may be more than was there by chance.
    const Matrix least = inverse * (byCell + prior) * inverse;
    covariance.diagonal() = covariance.diagonal().cwiseMax(least.diagonal());
    return covariance;
  }

  /// Differences where the search began, one for each overlap.
  const std::vector<float>& Start() const { return start_; }

private:
  template <class Key>
  static Matrix Squares(const std::map<Key, Vector>& sums)
  {
    Matrix squares = Matrix::Zero();
    for (const auto& [key, sum] : sums)
    {
      squares += sum * sum.transpose();
    }
    return squares;
  }

  /// Keeps the overlaps that both pictures show at q. Returns their differences.
  std::vector<float> KeepSeen(const std::vector<Overlap>& overlaps, const Vector& q)
  {
    overlaps_ = overlaps;
    std::vector<float> differences = Differences(q);
    overlaps_.clear();
    for (std::size_t n = 0; n < overlaps.size(); ++n)
    {
      if (!std::isnan(differences[n]))
      {
        overlaps_.push_back(overlaps[n]);
      }
    }
    differences.erase(
        std::remove_if(differences.begin(), differences.end(), [](float difference) { return std::isnan(difference); }),
        differences.end());
    return differences;
  }

  /// Regression of the one picture on the other, scale of the differences, and how many of them are independent.
  void Calibrate(double sigma, const Vector& q, const std::vector<float>& differences)
  {
    if (overlaps_.empty())
    {
      return;
    }
    // Two pictures of one speckle are alike only in part. Without the slope the cost would also fall where the prediction is
    // merely smoother, and bend more than what the two pictures share.
    const double n = static_cast<double>(overlaps_.size());
    Eigen::MatrixX2d pictures(overlaps_.size(), 2);
    for (std::size_t k = 0; k < overlaps_.size(); ++k)
    {
      double here = 0;
      pictures_.Sample(overlaps_[k].frame, overlaps_[k].i, overlaps_[k].j, here);
      pictures.row(k) << here + differences[k], here;
    }
    const Eigen::RowVector2d mean = pictures.colwise().sum() / n;
    const Eigen::MatrixX2d centred = pictures.rowwise() - mean;
    const double variance = centred.col(0).squaredNorm();
    slope_ = variance > 0 ? std::max(0.0, centred.col(0).dot(centred.col(1)) / variance) : 1;
    offset_ = mean[1] - slope_ * mean[0];

    start_ = Differences(q);
    std::vector<double> sizes;
    for (const float r : start_)
    {
      sizes.push_back(std::abs(r));
    }
    scale_ = std::max(kLeastScale, kCauchy * kDeviationByMedian * Median(sizes));

    // Overlaps closer than the smoothing say the same.
    std::set<Cell> cells;
    const std::vector<FramePose> frames = seenFrames_.Poses(q);
    for (const Overlap& overlap : overlaps_)
    {
      cells.insert(CellOf(frames[overlap.frame].plane.Point(overlap.i, overlap.j), kIndependent * sigma));
    }
    share_ = static_cast<double>(cells.size()) / n;
  }

  /// How much less the cost bends than its linearisation says, because outliers hardly count and two pictures share less
  /// fine structure than each has; the same in all directions, so taken from those that bend it well.
  double Bending(const Vector& q, const State& state, const Matrix& hessian) const
  {
    std::vector<double> ratios;
    for (int p = 0; p < kParameters; ++p)
    {
      const double step = kBendingSteps * step_[p], bend = hessian(p, p) * step * step;
      if (free_[p] && step > 0 && bend > 0)
      {
        const double up = Evaluate(q + step * Vector::Unit(p)).cost, down = Evaluate(q - step * Vector::Unit(p)).cost;
        ratios.push_back((up + down - 2 * state.cost) / (2 * bend));
      }
    }
    return std::clamp(Median(ratios), kLeastOfBending, 1.0);
  }

  std::vector<float> Differences(const Vector& q) const
  {
    const std::vector<FramePose> poses = seenFrames_.Poses(q);
    std::vector<float> differences(overlaps_.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, overlaps_.size(), 256),
                      [&](const tbb::blocked_range<std::size_t>& range)
                      {
                        for (std::size_t n = range.begin(); n < range.end(); ++n)
                        {
                          differences[n] = Difference(poses, overlaps_[n]);
                        }
                      });
    return differences;
  }

  float Difference(const std::vector<FramePose>& poses, const Overlap& overlap) const
  {
    constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
    const Eigen::Vector3d point = poses[overlap.frame].plane.Point(overlap.i, overlap.j);
    // The pair that encloses the point, looked for from where it was.
    int b = overlap.before;
    double low = poses[b].Height(point), high = poses[b + 1].Height(point);
    for (int direction = 0; (low > 0) == (high > 0);)
    {
      const int towards = std::abs(high) < std::abs(low) ? 1 : -1;
      b += towards;
      if (direction * towards < 0 || b < 0 || b + 1 >= seenFrames_.Count() || !seenFrames_.Follow(b, b + 1))
      {
        return kNone;  // the path turns round here, or ends
      }
      direction = towards;
      low = poses[b].Height(point);
      high = poses[b + 1].Height(point);
    }
    const Eigen::Vector3d p = poses[b].Project(point), s = poses[b + 1].Project(point);
    double here = 0, first = 0, second = 0;
    if (std::abs(high - low) > kWidestGap || !pictures_.Sample(overlap.frame, overlap.i, overlap.j, here) ||
        !pictures_.Sample(b, p[0], p[1], first) || !pictures_.Sample(b + 1, s[0], s[1], second))
    {
      return kNone;
    }
    const double share = low / (low - high);
    return static_cast<float>(offset_ + slope_ * ((1 - share) * first + share * second) - here);
  }

  /// Calls add(place, weight, derivatives, difference) for each overlap that counts.
  template <class Add>
  void ForEachRow(const Vector& q, const State& state, Add add) const
  {
    std::array<std::vector<float>, kParameters> after, before;
    for (int p = 0; p < kParameters; ++p)
    {
      if (free_[p])
      {
        after[p] = Differences(q + step_[p] * Vector::Unit(p));
        before[p] = Differences(q - step_[p] * Vector::Unit(p));
      }
    }
    for (std::size_t n = 0; n < overlaps_.size(); ++n)
    {
      Vector row = Vector::Zero();
      for (int p = 0; p < kParameters; ++p)
      {
        row[p] = free_[p] ? (after[p][n] - before[p][n]) / (2 * step_[p]) : 0;
      }
      const double r = state.differences[n];
      if (!std::isnan(r) && row.allFinite())
      {
        add(n, share_ / (scale_ * scale_ + r * r), row, r);
      }
    }
  }

  const SeenFrames& seenFrames_;
  const Pictures& pictures_;
  std::vector<bool> free_;
  std::vector<Overlap> overlaps_;
  std::vector<float> start_;  // differences where the search began
  Vector step_;               // of central differences
  double scale_ = 1;          // s
  double share_ = 1;          // w: of the overlaps that are independent
  double slope_ = 1, offset_ = 0;
};

/// What is taken out, or not, at a time.
enum class Kind
{
  Delay,
  Calibration
};

int FirstOf(Kind kind)
{
  return kind == Kind::Delay ? 0 : 1;
}

int LastOf(Kind kind)
{
  return kind == Kind::Delay ? 1 : kParameters;
}

struct Fit
{
  Vector value = Vector::Zero();
  // Of all parameters at once.
  Vector standardError = Vector::Constant(std::numeric_limits<double>::infinity());
  std::vector<bool> free;  // those that were not left at 0
  int overlaps = 0;

  /// Whether the pictures distinguish a parameter from all others.
  bool IsIdentified(int p) const
  {
    return free[p] && (standardError[p] <= kObservable[p] || std::abs(value[p]) >= kIdentified * standardError[p]);
  }

  /// Whether some number of a kind differs from 0.
  bool Asks(Kind kind) const
  {
    bool asks = false;
    for (int p = FirstOf(kind); p < LastOf(kind); ++p)
    {
      asks = asks || std::abs(value[p]) > kIdentified * standardError[p];
    }
    return asks;
  }
};

/// Coarse to fine.
class Search
{
public:
  Search(const Sweep& seen, const SeenFrames& seenFrames) : seen_(seen), seenFrames_(seenFrames) {}

  /// A fit of no overlaps where there are too few.
  Fit Run()
  {
    Fit fit;
    finest_ = std::max(kFinest, seen_.Plane(0).PixelSize());
    for (int times = kCoarsest; times >= 1; times /= 2)
    {
      const double sigma = times * finest_;
      pictures_ = std::make_unique<Pictures>(seen_, seenFrames_, sigma);
      if (!RunLevel(sigma, fit))
      {
        return Fit();
      }
    }
    LeaveOutUnidentified(fit);
    return fit;
  }

  /// The fit with all numbers of a kind at 0, the others found anew.
  Fit Without(Fit fit, Kind kind) const
  {
    for (int p = FirstOf(kind); p < LastOf(kind); ++p)
    {
      fit.free[p] = false;
      fit.value[p] = 0;
    }
    fit.value = MinimumOf(fit, seenFrames_.FindOverlaps(fit.value));
    return fit;
  }

  /// Steps from other fits to one: each half of the frames judges what the other half says, with the same places at both
  /// ends. With r and s the differences at the two ends, weighing as in the cost, the share that is confirmed is that of
  /// Deciding/PoseCorrection.md: h = 1/2 + sum w (r^2 - s^2) / (2 sum w (r - s)^2). A true step q that halves find with an
  /// error of variance 2 v has h = q^2 / (q^2 + 2 v), so all frames together find q^2 / (q^2 + v) = 2 h / (1 + h) of it.
  std::vector<ConfirmedStep> Judge(const std::vector<Fit>& froms, const Fit& to) const
  {
    const std::vector<Overlap> all = seenFrames_.FindOverlaps(to.value);
    const std::vector<FramePose> poses = seenFrames_.Poses(to.value);
    std::vector<Confirmed> sums(froms.size());
    for (const int half : {0, 1})
    {
      const std::vector<Overlap> finds = Half(all, half), judges = Half(all, 1 - half);
      const Vector end = MinimumOf(to, finds);
      for (std::size_t k = 0; k < froms.size(); ++k)
      {
        AddConfirmed(judges, poses, MinimumOf(froms[k], finds), end, sums[k]);
      }
    }
    std::vector<ConfirmedStep> steps;
    for (const Confirmed& sum : sums)
    {
      steps.push_back(sum.Step());
    }
    return steps;
  }

private:
  static constexpr double kFinest = 0.3;  // mm: the width of the finest smoothing, about a speckle's
  static constexpr int kCoarsest = 8;     // times that: errors of 3 mm and 3 degrees are found from there
  static constexpr int kIterations = 12;  // Gauss-Newton steps at most

  Disagreement Problem(const std::vector<Overlap>& overlaps, double sigma, const std::vector<bool>& free,
                       const Vector& q) const
  {
    return Disagreement(seenFrames_, *pictures_, sigma, overlaps, free, q);
  }

  /// Sums of what a step gains in squares of differences, and of squares of what it changes them by: all, and by cells of
  /// space and frames, whose terms are alike.
  struct Confirmed
  {
    using Sums = Eigen::Vector2d;
    Sums all = Sums::Zero();
    std::map<Cell, Sums> cells;
    std::map<int, Sums> frames;
    double before = 0, after = 0;  // sums of squares

    ConfirmedStep Step() const
    {
      ConfirmedStep step;
      step.isAsked = true;
      const double half = all[1] > 0 ? 0.5 + 0.5 * all[0] / all[1] : 0;
      const double halved = 1 + std::max(half, 0.0);
      step.share = half > 0 ? 2 * half / halved : half;
      step.shareError = 2 / (halved * halved) * std::max(ErrorBy(cells), ErrorBy(frames));
      step.gain = before > 0 && after > 0 ? 10 * std::log10(before / after) : 0;
      return step;
    }

    template <class Key>
    double ErrorBy(const std::map<Key, Sums>& parts) const
    {
      double squares = 0;
      for (const auto& [key, part] : parts)
      {
        squares += std::pow(part[0] - all[0] / all[1] * part[1], 2);
      }
      return all[1] > 0 ? 0.5 * std::sqrt(squares) / all[1] : std::numeric_limits<double>::infinity();
    }
  };

  /// What places say of the step from `start` to `end`.
  void AddConfirmed(const std::vector<Overlap>& places, const std::vector<FramePose>& poses, const Vector& start,
                    const Vector& end, Confirmed& sum) const
  {
    const std::vector<bool> none(kParameters, false);
    // Both times the same places, and a regression of their own.
    const Disagreement seenAtStart = Problem(places, finest_, none, start);
    const Disagreement atEnd = Problem(seenAtStart.Overlaps(), finest_, none, end);
    const Disagreement atStart = Problem(atEnd.Overlaps(), finest_, none, start);
    for (std::size_t n = 0; n < atStart.Overlaps().size(); ++n)
    {
      const Overlap& place = atStart.Overlaps()[n];
      const double r = atStart.Start()[n], s = atEnd.Start()[n], weight = atStart.Weight(r, s);
      const Eigen::Vector2d one(weight * (r * r - s * s), weight * (r - s) * (r - s));
      sum.all += one;
      const Cell cell = CellOf(poses[place.frame].plane.Point(place.i, place.j), kCell);
      sum.cells.try_emplace(cell, Eigen::Vector2d::Zero()).first->second += one;
      sum.frames.try_emplace(place.frame, Eigen::Vector2d::Zero()).first->second += one;
      sum.before += weight * r * r;
      sum.after += weight * s * s;
    }
  }

  /// Of the free numbers, from where the fit is.
  Vector MinimumOf(const Fit& fit, const std::vector<Overlap>& overlaps) const
  {
    const bool isAnyFree = std::count(fit.free.begin(), fit.free.end(), true) > 0;
    return isAnyFree ? Minimum(Problem(overlaps, finest_, fit.free, fit.value), fit.value).first : fit.value;
  }

  static std::pair<Vector, Disagreement::State> Minimum(const Disagreement& problem, Vector q)
  {
    LevenbergMarquardtOptions descent;
    descent.iterations = kIterations;
    Disagreement::State state = problem.Evaluate(q);
    MinimiseByLevenbergMarquardt(problem, descent, q, state);
    return {q, state};
  }

  /// Those of which both frames are of every second block of frames: no frame serves two halves, so that the errors of
  /// single poses cannot speak for the same correction in both.
  static std::vector<Overlap> Half(const std::vector<Overlap>& overlaps, int which)
  {
    constexpr int kBlock = 6;  // frames
    std::vector<Overlap> half;
    for (const Overlap& overlap : overlaps)
    {
      if (overlap.frame / kBlock % 2 == which && overlap.before / kBlock % 2 == which)
      {
        half.push_back(overlap);
      }
    }
    return half;
  }

  /// A parameter that is not identified is left at 0, the least known first. False when there are too few overlaps.
  bool RunLevel(double sigma, Fit& fit)
  {
    const bool hasTimes = seenFrames_.ThePath().Speed() > 0;
    fit.free.assign(kParameters, true);
    fit.free[0] = hasTimes;
    for (bool isFirst = true, isDone = false; !isDone; isFirst = false)
    {
      const Disagreement problem = Problem(seenFrames_.FindOverlaps(fit.value), sigma, fit.free, fit.value);
      fit.overlaps = static_cast<int>(problem.Overlaps().size());
      if (problem.Overlaps().size() < kFewestOverlaps)
      {
        return false;
      }
      const auto [q, state] = Minimum(problem, fit.value);
      fit.value = q;
      if (isFirst)
      {
        continue;  // overlaps are looked for once more, now that it is better known where they are
      }
      const Vector errors = kSystematic * problem.Covariance(q, state).diagonal().cwiseSqrt();
      if (std::count(fit.free.begin(), fit.free.end(), true) == (hasTimes ? kParameters : kParameters - 1))
      {
        fit.standardError = errors;
      }
      int worst = 0;
      Vector excess = errors.cwiseQuotient(kObservable * (sigma / finest_));
      for (int p = 0; p < kParameters; ++p)
      {
        const bool isIdentified = std::abs(q[p]) >= kIdentified * errors[p] && excess[p] <= kLeastKnown;
        excess[p] = fit.free[p] && !isIdentified ? excess[p] : 0;
      }
      isDone = !(excess.maxCoeff(&worst) > 1);
      if (!isDone)
      {
        fit.free[worst] = false;
        fit.value[worst] = 0;
      }
    }
    if (!hasTimes)
    {
      fit.standardError[0] = std::numeric_limits<double>::infinity();
    }
    return true;
  }

  /// A parameter that is known only while others are 0 is not identified, so it is left at 0 as well. The others are
  /// found anew.
  void LeaveOutUnidentified(Fit& fit) const
  {
    for (;;)
    {
      int worst = -1;
      for (int p = 0; p < kParameters; ++p)
      {
        const auto excess = [&](int q) { return fit.standardError[q] / kObservable[q]; };
        if (fit.free[p] && !fit.IsIdentified(p) && (worst < 0 || excess(p) > excess(worst)))
        {
          worst = p;
        }
      }
      if (worst < 0)
      {
        return;
      }
      fit.free[worst] = false;
      fit.value[worst] = 0;
      fit.value = MinimumOf(fit, seenFrames_.FindOverlaps(fit.value));
    }
  }

  const Sweep& seen_;
  const SeenFrames& seenFrames_;
  double finest_ = kFinest;  // mm
  std::unique_ptr<Pictures> pictures_;
};

/// What steps that are taken take out.
Vector ParametersOf(const ConstantErrors& errors)
{
  Vector q = Vector::Zero();
  if (errors.delayStep.isTaken)
  {
    q[0] = errors.delay.value;
  }
  for (int axis = 0; axis < 3 && errors.calibrationStep.isTaken; ++axis)
  {
    q[1 + axis] = errors.shift[axis].value;
    q[4 + axis] = errors.rotation[axis].value;
  }
  return q;
}

std::vector<Eigen::Matrix4d> CorrectedPoses(const Sweep& sweep, const Vector& q)
{
  const Path path(sweep);
  std::vector<Eigen::Matrix4d> poses;
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    poses.push_back(Followed(sweep.imageToReference[k], path.Recorded(k), path.Corrected(k, q)));
  }
  return poses;
}

/// What is known before anything was compared.
ConstantErrors Unknown()
{
  ConstantErrors out;
  out.delay.standardError = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis)
  {
    out.shift[axis].standardError = out.rotation[axis].standardError = std::numeric_limits<double>::infinity();
  }
  out.evidence = "no place is seen a second time, from another direction or after the probe had been away";
  return out;
}

/// Numbers of a kind, as the fit has them.
void SetNumbers(const Fit& fit, Kind kind, ConstantErrors& out)
{
  const std::array<ConstantError*, kParameters> numbers = {
      &out.delay, &out.shift[0], &out.shift[1], &out.shift[2], &out.rotation[0], &out.rotation[1], &out.rotation[2]};
  for (int p = FirstOf(kind); p < LastOf(kind); ++p)
  {
    *numbers[p] = {fit.value[p], fit.standardError[p], fit.IsIdentified(p)};
  }
}

/// In standard errors of its share. Where it bends poses too little it is never taken.
double SurenessOf(const ConfirmedStep& step)
{
  return step.bending < kLeastBending ? -std::numeric_limits<double>::infinity() : (step.share - 0.5) / step.shareError;
}

/// Judges both kinds. Of those that are not confirmed the least goes first, and the other is found anew and judged by itself.
void TakeConfirmedSteps(const Sweep& sweep, const Search& search, Fit fit, ConstantErrors& out)
{
  const auto stepOf = [&out](Kind kind) -> ConfirmedStep&
  { return kind == Kind::Delay ? out.delayStep : out.calibrationStep; };
  std::vector<Kind> asked;
  for (const Kind kind : {Kind::Delay, Kind::Calibration})
  {
    SetNumbers(fit, kind, out);
    if (fit.Asks(kind))
    {
      asked.push_back(kind);
    }
  }
  if (asked.size() == 1)
  {
    fit = search.Without(fit, asked[0] == Kind::Delay ? Kind::Calibration : Kind::Delay);
  }
  while (!asked.empty())
  {
    std::vector<Fit> froms;
    for (const Kind kind : asked)
    {
      froms.push_back(search.Without(fit, kind));
    }
    const std::vector<ConfirmedStep> steps = search.Judge(froms, fit);
    const auto poses = CorrectedPoses(sweep, fit.value);
    for (std::size_t k = 0; k < asked.size(); ++k)
    {
      ConfirmedStep& step = stepOf(asked[k]) = steps[k];
      step.bending = MeasurePoseError(poses, CorrectedPoses(sweep, froms[k].value), sweep.width, sweep.height).bending;
      step.isTaken = SurenessOf(step) > kSure;
    }
    const auto least = std::min_element(asked.begin(), asked.end(),
                                        [&](Kind a, Kind b) { return SurenessOf(stepOf(a)) < SurenessOf(stepOf(b)); });
    if (stepOf(*least).isTaken)
    {
      break;
    }
    fit = froms[least - asked.begin()];
    asked.erase(least);
  }
  for (const Kind kind : asked)
  {
    SetNumbers(fit, kind, out);
  }
}

std::string StepText(const char* what, const ConfirmedStep& step)
{
  return std::string(what) + ", frames that took no part confirm" + Format(" %.2f", step.share) +
         Format(" +- %.2f of it", step.shareError) + Format(" (%+.2f dB)", step.gain) +
         (step.bending < kLeastBending ? ", but it moves frames against each other by less than 0.1 mm" : "") +
         (step.isTaken ? "" : ", not taken");
}

std::string EvidenceText(const ConstantErrors& errors)
{
  const std::string delay = errors.delayStep.isAsked ? StepText("a delay", errors.delayStep) : "";
  const std::string calibration =
      errors.calibrationStep.isAsked ? StepText("an error of calibration", errors.calibrationStep) : "";
  const std::string both = delay + (delay.empty() || calibration.empty() ? "" : "; ") + calibration;
  return !both.empty() ? both
                       : "no delay and no error of calibration differs from 0 by more than " +
                             std::to_string(static_cast<int>(kIdentified)) + " standard errors";
}

}  // namespace

ConstantErrors EstimateConstantErrors(const Sweep& sweep, const std::vector<int>& frames)
{
  sweep.ValidateLayout();
  ConstantErrors out = Unknown();
  if (frames.empty())
  {
    return out;
  }
  const auto [least, most] = std::minmax_element(frames.begin(), frames.end());
  Require(*least >= 0 && *most < sweep.NumberOfFrames(), "ConstantErrors: there is no frame ",
          *least < 0 ? *least : *most, " among ", sweep.NumberOfFrames(), ".");
  const SeenFrames seenFrames(sweep, frames);
  if (seenFrames.FindOverlaps(Vector::Zero()).size() < kFewestOverlaps)
  {
    return out;
  }
  const Sweep seen = sweep.Subset(frames);
  Search search(seen, seenFrames);
  const Fit fit = search.Run();
  out.comparisons = fit.overlaps;
  if (fit.overlaps == 0)
  {
    out.evidence = "too few places are seen a second time in light";
    return out;
  }

  TakeConfirmedSteps(sweep, search, fit, out);
  out.evidence = EvidenceText(out);
  return out;
}

std::string Describe(const ConstantErrors& errors)
{
  const Vector q = ParametersOf(errors);
  const auto three = [&q](int first)
  { return Format("%.2f, ", q[first]) + Format("%.2f, ", q[first + 1]) + Format("%.2f", q[first + 2]); };
  std::string out = q[0] != 0 ? "poses taken" + Format(" %.1f ms later", 1000 * q[0]) : "";
  if (!q.tail<6>().isZero(0))
  {
    out += std::string(out.empty() ? "" : ", ") + "image moved on the probe by (" + three(1) + ") mm and (" + three(4) +
           ") degrees";
  }
  return out.empty() ? "none" : out;
}

std::vector<Eigen::Matrix4d> WithoutConstantErrors(const Sweep& sweep, const ConstantErrors& errors)
{
  return errors.IsSignificant() ? CorrectedPoses(sweep, ParametersOf(errors)) : sweep.imageToReference;
}

}  // namespace bigus
