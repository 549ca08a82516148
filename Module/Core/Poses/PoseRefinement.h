// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Poses that pictures correct: every frame is aligned to what its neighbours, and frames that came back to its place
// later, predict without it, and all alignments are reconciled at once. Private to Core.
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// Alignments of frames to two others between which they lie, at the poses of a sweep; none where the probe never comes
/// back. Shifts and the turn in the image's own plane are told, and by frames that came back the shift along its normal.
class PoseRefinement
{
public:
  /// A frame's motion, mm: along its rows, across them in its plane, the turn in it times half a diagonal, and along its
  /// normal.
  static constexpr int kNumbers = 4;
  using Motion = Eigen::Matrix<double, kNumbers, 1>;
  using Matrix = Eigen::Matrix<double, kNumbers, kNumbers>;

  /// Looks at the pixels of `frames` (ascending) alone. `stroke` is Trajectory's.
  PoseRefinement(const Sweep& sweep, const std::vector<int>& frames, const std::vector<int>& stroke);

  /// Three of `frames`, by their places in it: one lies between the others.
  struct Comparison
  {
    int frame, before, after;
    bool isRevisit;  ///< the probe came back: the three do not follow each other
  };
  const std::vector<Comparison>& Comparisons() const { return comparisons_; }
  int NumberOfRevisits() const;

  /// Poses of all frames of the sweep. Comparisons in which a frame takes part that `isLeftOut` names (by its place in
  /// `frames`; empty: none) do not count. Such a frame, and one that is not among `frames`, moves as those around it on
  /// the path do. The same for every number of threads.
  std::vector<Eigen::Matrix4d> Poses(const std::vector<char>& isLeftOut = {}) const;

private:
  /// What a comparison says: the frame's own motion that makes it agree, and the inverse of its covariance. Neighbours
  /// say nothing along the normal.
  struct Alignment
  {
    Motion motion = Motion::Zero();
    Matrix information = Matrix::Zero();
    double share = 0.5;  ///< of the frame after in the prediction
  };
  void FindNeighbours();
  void Align();
  /// One comparison at one blur, going on from the motion that is known. `own` is the frame's picture at `at`.
  void AlignOne(const Comparison& comparison, const cv::Mat& own, const SlicePlane& at,
                const std::function<cv::Mat(const SlicePlane&)>& predict, double blur, double leastCover,
                Alignment& out) const;
  /// The motion of `other`, seen in the plane of `frame`, as a matrix on other's own motion.
  Matrix Seen(int frame, int other) const;
  class NormalEquations;
  void AddPrior(NormalEquations& equations) const;
  /// Motions of `frames` on which all alignments and the prior agree best.
  Eigen::VectorXd Reconcile(const std::vector<char>& isLeftOut) const;
  /// Frames between those that were aligned move as they do.
  Motion MotionOf(int frame, const Eigen::VectorXd& motions) const;

  const Sweep& sweep_;
  std::vector<int> frames_, stroke_;
  std::vector<SlicePlane> planes_;  // of frames_
  double lever_ = 1;                // mm
  std::vector<Comparison> comparisons_;
  std::vector<Alignment> alignments_;
};

}  // namespace bigus
