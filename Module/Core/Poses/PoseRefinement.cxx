// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/PoseRefinement.h"

#include <tbb/parallel_for.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "Core/Numerics/Constants.h"
#include "Core/Poses/Alignment.h"
#include "Core/Poses/FramePrediction.h"
#include "Core/Poses/Revisits.h"

namespace bigus
{
namespace
{

using FrameMotion = PoseRefinement::Motion;
using Information = PoseRefinement::Matrix;
constexpr int kNumbers = PoseRefinement::kNumbers;

// ---- which frames are compared ----

constexpr std::array<int, 2> kLags{1, 2};  // frames on each side on the path that predict one

// ---- how they are aligned ----

constexpr std::array<double, 3> kBlurs{4, 2, 1};  // pixels of small pictures, coarse to fine
constexpr double kWidest = 4;                     // times the blur: what is wider is brightness
constexpr int kSteps = 6;                         // Gauss-Newton steps at each blur
constexpr double kWeakPull = 1;                   // mm: keeps what pictures do not tell
constexpr double kFarthest = 3;                   // mm: what moves farther has lost its way
constexpr double kProbe = 0.05;                   // mm to either side, for the slope along the normal
constexpr double kLeastMove = 0.005;              // mm: a step that is shorter is the last
constexpr double kLeastCover = 0.25;              // of the lit pixels
constexpr double kLeastCorrelation = 0.2;
constexpr double kRobust = 2;  // root mean square differences at which a pixel counts half
constexpr double kAlike = 12;  // pixels that say the same, at a blur of 1: 4 pi sigma^2

constexpr double kLeastSquare = 1e-12;  // of a difference of intensities: keeps equal pictures from dividing by nothing

// mm, standard deviation: what pictures change by besides motion, however well they fit. Results hardly depend on
// either from half to three times as much.
constexpr double kNeighbourError = 0.03;
constexpr double kRevisitError = 0.1;

// ---- how alignments are reconciled ----

// How far poses may move, standard deviations at the image's centre and, by its rotation, half a diagonal from it.
constexpr double kDrift = 0.5;  // mm of any pose
constexpr double kStep = 0.05;  // mm from one frame of the sweep to the next

constexpr int kRounds = 5;           // of robust weights of comparisons
constexpr double kSuspiciousAt = 3;  // standard errors at which a comparison counts half

SlicePlane MovedBy(const SlicePlane& plane, const FrameMotion& motion, double lever)
{
  return Moved(plane, {motion[0], motion[1], motion[3]}, {0, 0, motion[2] / lever / kRadiansPerDegree});
}

/// Smooths pictures where they show something, and takes away what is wider.
class BandFilter
{
public:
  BandFilter(const cv::Mat& inner, double sigma) : inner_(inner), sigma_(sigma)
  {
    cv::Mat weight;
    inner.convertTo(weight, CV_32F);
    weights_ = cv::max(Blurred(weight, sigma), 1e-3);
    wideWeights_ = cv::max(Blurred(weight, kWidest * sigma), 1e-3);
  }

  cv::Mat operator()(const cv::Mat& picture) const
  {
    cv::Mat shown = cv::Mat::zeros(picture.size(), CV_32F);
    picture.copyTo(shown, inner_);
    return Blurred(shown, sigma_) / weights_ - Blurred(shown, kWidest * sigma_) / wideWeights_;
  }

private:
  static cv::Mat Blurred(const cv::Mat& picture, double sigma)
  {
    cv::Mat blurred;
    cv::GaussianBlur(picture, blurred, {}, sigma, sigma, cv::BORDER_CONSTANT);
    return blurred;
  }

  cv::Mat inner_, weights_, wideWeights_;
  double sigma_;
};

/// Least squares of a frame's motion, robust.
struct Equations
{
  Information hessian = Information::Zero();
  FrameMotion pull = FrameMotion::Zero();
  double noise = 0;        // mean square difference, robust
  double correlation = 0;  // of the two pictures
  int count = 0;           // of pixels
};
/// Of a picture at `plane` and what is predicted of it there. `across` is the slope of the prediction along the normal,
/// for each mm, or empty.
Equations Linearise(const cv::Mat& own, const cv::Mat& predicted, const cv::Mat& across, const SlicePlane& plane,
                    double lever)
{
  const double dx = plane.columnStep.norm(), dy = plane.rowStep.norm();
  const bool hasAcross = !across.empty();
  const auto forEach = [&](auto use)
  {
    for (int y = 1; y + 1 < own.rows; ++y)
    {
      const float* above = predicted.ptr<float>(y - 1);
      const float* row = predicted.ptr<float>(y);
      const float* below = predicted.ptr<float>(y + 1);
      const float* truth = own.ptr<float>(y);
      const float* slopes = hasAcross ? across.ptr<float>(y) : nullptr;
      for (int x = 1; x + 1 < own.cols; ++x)
      {
        const double alongRow = row[x + 1] - row[x - 1], alongColumn = below[x] - above[x],
                     gz = hasAcross ? slopes[x] : 0.0;
        if (!std::isnan(alongRow) && !std::isnan(alongColumn) && !std::isnan(gz) && !std::isnan(row[x]))
        {
          use(x, y, row[x], truth[x], alongRow, alongColumn, gz);
        }
      }
    }
  };
  Equations found;
  double squares = 0, pp = 0, qq = 0, pq = 0;
  forEach(
      [&](int, int, double p, double q, double, double, double)
      {
        squares += (p - q) * (p - q);
        pp += p * p;
        qq += q * q;
        pq += p * q;
        ++found.count;
      });
  found.correlation = pp > 0 && qq > 0 ? pq / std::sqrt(pp * qq) : 0;
  const double scale = kRobust * kRobust * squares / std::max(found.count, 1) + kLeastSquare;
  double weights = 0;
  forEach(
      [&](int x, int y, double p, double q, double alongRow, double alongColumn, double gz)
      {
        const double gx = alongRow / (2 * dx), gy = alongColumn / (2 * dy);
        const double right = (x - 0.5 * (own.cols - 1)) * dx, down = (y - 0.5 * (own.rows - 1)) * dy;
        const FrameMotion gradient(gx, gy, (right * gy - down * gx) / lever, gz);
        const double weight = 1 / (1 + (p - q) * (p - q) / scale);
        found.hessian += weight * gradient * gradient.transpose();
        found.pull += weight * (q - p) * gradient;
        weights += weight;
        found.noise += weight * (p - q) * (p - q);
      });
  found.noise = found.noise / std::max(weights, 1.0) + kLeastSquare;
  return found;
}

}  // namespace

/// Of all motions, sparse, block by block.
class PoseRefinement::NormalEquations
{
public:
  explicit NormalEquations(int frames) : right(Eigen::VectorXd::Zero(kNumbers * frames)) {}

  void Add(int a, int b, const Information& block)
  {
    for (int i = 0; i < kNumbers; ++i)
    {
      for (int j = 0; j < kNumbers; ++j)
      {
        entries_.emplace_back(kNumbers * a + i, kNumbers * b + j, block(i, j));
      }
    }
  }

  Eigen::VectorXd Solve() const
  {
    Eigen::SparseMatrix<double> matrix(right.size(), right.size());
    matrix.setFromTriplets(entries_.begin(), entries_.end());
    return Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(right);
  }

  Eigen::VectorXd right;

private:
  std::vector<Eigen::Triplet<double>> entries_;
};

PoseRefinement::PoseRefinement(const Sweep& sweep, const std::vector<int>& frames, const std::vector<int>& stroke)
    : sweep_(sweep), frames_(frames), stroke_(stroke)
{
  for (const int frame : frames_)
  {
    planes_.push_back(sweep.Plane(frame));
  }
  if (!planes_.empty())
  {
    const SlicePlane& plane = planes_[0];
    lever_ = 0.5 * (plane.Point(plane.width - 1, plane.height - 1) - plane.origin).norm();
  }
  FindNeighbours();
  const Revisits revisits = FindRevisits(planes_, frames_, stroke_);
  for (const Revisit& revisit : revisits.found)
  {
    comparisons_.push_back({revisit.frame, revisit.before, revisit.before + 1, true});
  }
  if (!revisits.comesBack)
  {
    // Neighbours alone tell how three frames lie to each other. Small errors of that add up along the path, so poses of
    // a single pass do not become better.
    comparisons_.clear();
  }
  alignments_.resize(comparisons_.size());
  if (!comparisons_.empty())
  {
    Align();
  }
}

int PoseRefinement::NumberOfRevisits() const
{
  return static_cast<int>(
      std::count_if(comparisons_.begin(), comparisons_.end(), [](const Comparison& c) { return c.isRevisit; }));
}

void PoseRefinement::FindNeighbours()
{
  const int n = static_cast<int>(frames_.size());
  for (int k = 0; k < n; ++k)
  {
    for (const int lag : kLags)
    {
      if (k - lag >= 0 && k + lag < n && stroke_[frames_[k - lag]] == stroke_[frames_[k + lag]])
      {
        comparisons_.push_back({k, k - lag, k + lag, false});
      }
    }
  }
}

void PoseRefinement::Align()
{
  const FramePictures pictures = PicturesOf(sweep_, frames_);
  std::vector<SlicePlane> planes;
  for (const int frame : frames_)
  {
    planes.push_back(PicturePlane(sweep_, sweep_.imageToReference[frame], pictures.reduction));
  }
  std::vector<cv::Mat> bands(frames_.size());
  for (const double blur : kBlurs)
  {
    const BandFilter band(pictures.inner, blur);
    tbb::parallel_for(std::size_t(0), bands.size(), [&](std::size_t k) { bands[k] = band(pictures.frames[k]); });
    tbb::parallel_for(std::size_t(0), comparisons_.size(),
                      [&](std::size_t t)
                      {
                        const Comparison& c = comparisons_[t];
                        const auto predict = [&](const SlicePlane& plane) {
                          return PredictPicture(pictures.inner, plane, planes[c.before], bands[c.before],
                                                planes[c.after], bands[c.after]);
                        };
                        AlignOne(c, bands[c.frame], planes[c.frame], predict, blur, kLeastCover * pictures.pixels,
                                 alignments_[t]);
                      });
  }
}

void PoseRefinement::AlignOne(const Comparison& comparison, const cv::Mat& own, const SlicePlane& at,
                              const std::function<cv::Mat(const SlicePlane&)>& predict, double blur, double leastCover,
                              Alignment& out) const
{
  out.information.setZero();
  for (int step = 0;; ++step)
  {
    const SlicePlane plane = MovedBy(at, out.motion, lever_);
    cv::Mat across;
    if (comparison.isRevisit)
    {
      const auto slope = [&](double side) { return predict(Moved(plane, {0, 0, side * kProbe}, {0, 0, 0})); };
      across = (slope(1) - slope(-1)) / (2 * kProbe);
    }
    const Equations found = Linearise(own, predict(plane), across, plane, lever_);
    if (found.count < leastCover || !(found.correlation >= kLeastCorrelation))
    {
      return;
    }
    // In units of the noise; neighbouring pixels say the same.
    const double unit = 1 / (kAlike * blur * blur * found.noise);
    const Information hessian = unit * found.hessian;
    const Information held = hessian + Information::Identity() / (kWeakPull * kWeakPull);
    const FrameMotion move = held.ldlt().solve(unit * found.pull - out.motion / (kWeakPull * kWeakPull));
    if (step == kSteps || move.norm() <= kLeastMove)
    {
      const double error = comparison.isRevisit ? kRevisitError : kNeighbourError;
      const Information least = Information::Identity() / (error * error);
      out.information = hessian - hessian * (hessian + least).ldlt().solve(hessian);
      const Eigen::Vector3d centre = CentreOf(plane), normal = plane.Normal();
      const double before = std::abs(normal.dot(CentreOf(planes_[comparison.before]) - centre));
      const double after = std::abs(normal.dot(CentreOf(planes_[comparison.after]) - centre));
      out.share = before + after > 0 ? before / (before + after) : 0.5;
      return;
    }
    out.motion += move;
    if (out.motion.norm() > kFarthest)
    {
      out.motion.setZero();
      return;
    }
  }
}

Information PoseRefinement::Seen(int frame, int other) const
{
  const Eigen::Matrix3d axes = AxesOf(planes_[frame]).transpose(), there = AxesOf(planes_[other]);
  const Eigen::Vector3d arm = CentreOf(planes_[frame]) - CentreOf(planes_[other]);
  const Eigen::Vector3d turned = axes * there.col(2).cross(arm) / lever_;
  Information seen;
  for (const auto& [column, axis] : {std::pair(0, 0), std::pair(1, 1), std::pair(3, 2)})
  {
    const Eigen::Vector3d shift = axes * there.col(axis);
    seen.col(column) << shift.head<2>(), 0, shift[2];
  }
  seen.col(2) << turned.head<2>(), (axes * there.col(2))[2], turned[2];
  return seen;
}

void PoseRefinement::AddPrior(NormalEquations& equations) const
{
  const Information one = Information::Identity();
  for (int k = 0; k < static_cast<int>(frames_.size()); ++k)
  {
    equations.Add(k, k, one / (kDrift * kDrift));
    if (k > 0 && stroke_[frames_[k]] == stroke_[frames_[k - 1]])
    {
      const double weight = 1 / (kStep * kStep * (frames_[k] - frames_[k - 1]));
      equations.Add(k, k, weight * one);
      equations.Add(k - 1, k - 1, weight * one);
      equations.Add(k, k - 1, -weight * one);
      equations.Add(k - 1, k, -weight * one);
    }
  }
}

Eigen::VectorXd PoseRefinement::Reconcile(const std::vector<char>& isLeftOut) const
{
  const auto isUsed = [&](int k) { return isLeftOut.empty() || !isLeftOut[k]; };
  const int n = static_cast<int>(frames_.size());
  Eigen::VectorXd motions = Eigen::VectorXd::Zero(kNumbers * n);
  for (int round = 0; round < kRounds; ++round)
  {
    NormalEquations equations(n);
    AddPrior(equations);
    for (std::size_t t = 0; t < comparisons_.size(); ++t)
    {
      const Comparison& c = comparisons_[t];
      // An alignment says x_frame - (1 - share) S_before x_before - share S_after x_after.
      const auto& [said, information, share] = alignments_[t];
      const std::array<std::pair<int, Information>, 3> row = {
          std::pair(c.frame, Information::Identity().eval()),
          std::pair(c.before, (-(1 - share) * Seen(c.frame, c.before)).eval()),
          std::pair(c.after, (-share * Seen(c.frame, c.after)).eval())};
      FrameMotion left = said;
      for (const auto& [k, block] : row)
      {
        left -= block * motions.segment<kNumbers>(kNumbers * k);
      }
      const double robust = 1 / (1 + left.dot(information * left) / (kSuspiciousAt * kSuspiciousAt));
      const double weight = round == 0 ? 1.0 : robust;
      if (weight == 0 || !isUsed(c.frame) || !isUsed(c.before) || !isUsed(c.after))
      {
        continue;
      }
      for (const auto& [k, block] : row)
      {
        equations.right.segment<kNumbers>(kNumbers * k) += weight * block.transpose() * information * said;
        for (const auto& [m, other] : row)
        {
          equations.Add(k, m, weight * block.transpose() * information * other);
        }
      }
    }
    motions = equations.Solve();
  }
  return motions;
}

FrameMotion PoseRefinement::MotionOf(int frame, const Eigen::VectorXd& motions) const
{
  const auto motion = [&](int k) { return motions.segment<kNumbers>(kNumbers * k); };
  const int n = static_cast<int>(frames_.size());
  const int next = static_cast<int>(std::lower_bound(frames_.begin(), frames_.end(), frame) - frames_.begin());
  const bool hasAfter = next < n && stroke_[frames_[next]] == stroke_[frame];
  const bool hasBefore = next > 0 && stroke_[frames_[next - 1]] == stroke_[frame];
  if (hasAfter && hasBefore && frames_[next] != frame)
  {
    const double share =
        static_cast<double>(frame - frames_[next - 1]) / static_cast<double>(frames_[next] - frames_[next - 1]);
    return (1 - share) * motion(next - 1) + share * motion(next);
  }
  if (hasAfter || hasBefore)
  {
    return motion(hasAfter ? next : next - 1);
  }
  return FrameMotion::Zero();
}

std::vector<Eigen::Matrix4d> PoseRefinement::Poses(const std::vector<char>& isLeftOut) const
{
  const Eigen::VectorXd motions = Reconcile(isLeftOut);
  std::vector<Eigen::Matrix4d> poses = sweep_.imageToReference;
  for (int frame = 0; frame < sweep_.NumberOfFrames(); ++frame)
  {
    const SlicePlane from = sweep_.Plane(frame);
    poses[frame] = Followed(poses[frame], from, MovedBy(from, MotionOf(frame, motions), lever_));
  }
  return poses;
}

}  // namespace bigus
