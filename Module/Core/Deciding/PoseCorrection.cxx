// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Deciding/PoseCorrection.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "Core/Deciding/DecisionRules.h"
#include "Core/Model/PoseAxes.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/OpenCv.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Poses/FramePrediction.h"
#include "Core/Poses/PoseRefinement.h"
#include "Core/Training/Stopwatch.h"

namespace bigus
{
namespace
{

constexpr std::size_t kTests = 48;  // frames that are predicted, evenly chosen
// Predicted from neighbours, from those one further, and from frames of which the probe came back to this one's place.
constexpr int kLags = 3;
constexpr int kNeighbourLags = 2;

/// Octaves of a residual in which poses are compared. The finest octave, which is blurring by one pixel, is left out:
/// what frames show there depends on sampling and on what is fixed to the probe more than on poses. What is wider than
/// the last is brightness.
constexpr int kBands = 4;
constexpr int kFirstBand = 1;

constexpr double kLeastCover = 0.25;  // of the lit pixels, that both neighbours must show
constexpr double kGreyLevel = 1.0 / 255;

constexpr std::array<double, 5> kStrengths{0.5, 1, 2, 4, 8};

/// dB that twice the strength must predict frames better. Smoothing also takes from the true path, slowly, which
/// neighbours hardly see: the phantom with noise of 0.2 mm and 0.3 degrees gains 0.03 dB by strength 2, where its error
/// at the corners grows from 0.33 to 0.35 of the recorded one. The liver sweep gains 0.11, 0.07 and 0.03 dB.
constexpr double kStrongerGain = 0.05;

/// The likelihood that twice the strength may take from the poses (Trajectory.h). Neighbours see little of what smoothing
/// takes from slow turns, and along the beam, where pictures are finest, it may help while it harms all else: made-up
/// sweeps there and back lose 1.6 to 1.9 by strength 4, which their pictures confirm, and are 0.09 mm worse at the
/// corners; by strength 2 they lose 0.4 and are as good as by 1. The liver sweep loses 0.14 and 0.45.
constexpr double kMostLostLikelihood = 0.75;

/// One frame predicted from one before and one after it, by their places among the pictures.
struct Test
{
  int frame, before, after;
};

/// Predicted frames less the frame, NaN where a neighbour shows nothing or the edge is near; empty where there is no test.
using Residuals = std::array<cv::Mat, kLags>;
Residuals ResidualsOf(const FramePictures& pictures, const std::array<Test, kLags>& tests,
                      const std::vector<SlicePlane>& planes)
{
  const auto& frames = pictures.frames;
  Residuals residuals;
  for (int lag = 0; lag < kLags; ++lag)
  {
    const Test& test = tests[lag];
    if (test.frame >= 0)
    {
      residuals[lag] = PredictPicture(pictures.inner, planes[test.frame], planes[test.before], frames[test.before],
                                      planes[test.after], frames[test.after]) -
                       frames[test.frame];
    }
  }
  return residuals;
}

/// Each is what blurring removes of what is left: by 1 pixel, then by 2, 4, 8. What has been blurred by 2 more needs half as
/// many pixels a side, so from then on every picture is halved and blurred by 2 of its own.
using Bands = std::array<cv::Mat, kBands>;
Bands BandsOf(cv::Mat picture)
{
  Bands bands;
  for (int band = 0; band < kBands; ++band)
  {
    const double sigma = band == 0 ? 1 : 2;
    cv::Mat low;
    cv::GaussianBlur(picture, low, cv::Size(), sigma, sigma, cv::BORDER_CONSTANT);
    bands[band] = picture - low;
    picture = low;
    if (band > 0 && band + 1 < kBands)
    {
      cv::resize(low, picture, cv::Size((low.cols + 1) / 2, (low.rows + 1) / 2), 0, 0, cv::INTER_AREA);
    }
  }
  return bands;
}

/// What a test says of new poses against the recorded ones, in a band. With r and r' the residuals at recorded and at new
/// poses (PoseCorrection.md), d = r - r' is what the new poses change. Squares are in units of the band's level, the mean of |r|^2 and
/// |r'|^2.
struct Finding
{
  double gained = 0;    // |r|^2 - |r'|^2
  double changed = 0;   // |d|^2
  double decibels = 0;  // 10 log10(|r|^2 / |r'|^2)
};
constexpr int kFindings = kLags * (kBands - kFirstBand);
struct Findings
{
  std::array<Finding, kFindings> of;
  std::array<bool, kLags> isSound{};
};

/// From residuals at recorded and at corrected poses, of pictures with so many lit pixels.
Findings Find(const Residuals& recorded, const Residuals& corrected, double pixels)
{
  Findings findings;
  for (int lag = 0; lag < kLags; ++lag)
  {
    if (recorded[lag].empty())
    {
      continue;
    }
    cv::Mat before = recorded[lag].clone(), after = corrected[lag].clone();
    int seen = 0;
    for (std::size_t p = 0; p < before.total(); ++p)
    {
      float &r = before.ptr<float>()[p], &s = after.ptr<float>()[p];
      const bool both = !std::isnan(r) && !std::isnan(s);
      seen += both ? 1 : 0;
      r = both ? r : 0.0f;
      s = both ? s : 0.0f;
    }
    if (!(seen > kLeastCover * pixels))
    {
      continue;
    }
    findings.isSound[lag] = true;
    const Bands r = BandsOf(before), s = BandsOf(after);
    for (int band = kFirstBand; band < kBands; ++band)
    {
      // Rounding to grey levels keeps an empty picture from dividing by nothing.
      const double share = static_cast<double>(r[band].total()) / static_cast<double>(before.total());
      const double rounding = share * seen * kGreyLevel * kGreyLevel / 12;
      const double squares = r[band].dot(r[band]) + rounding, left = s[band].dot(s[band]) + rounding;
      const cv::Mat d = r[band] - s[band];
      const double level = 0.5 * (squares + left);
      Finding& finding = findings.of[lag * (kBands - kFirstBand) + band - kFirstBand];
      finding = {(squares - left) / level, d.dot(d) / level, 10 * std::log10(squares / left)};
    }
  }
  return findings;
}

/// A mean and its standard error.
struct Estimate
{
  double mean = 0, error = 0;
};

/// The standard error of a sum whose terms' errors are given in the order of the frames. Neighbouring tests share
/// frames, so their errors are correlated: the sum of squares and of products of those up to two apart, weighing less
/// the further apart (Newey and West 1987).
double ErrorOfSum(const std::vector<double>& errors)
{
  constexpr int kApart = 2;
  double sum = 0;
  for (std::size_t k = 0; k < errors.size(); ++k)
  {
    sum += errors[k] * errors[k];
    for (std::size_t lag = 1; lag <= kApart && k + lag < errors.size(); ++lag)
    {
      sum += 2 * (1 - static_cast<double>(lag) / (kApart + 1)) * errors[k] * errors[k + lag];
    }
  }
  return std::sqrt(std::max(sum, 0.0));
}

/// The share a of the change of poses that pictures confirm: 1 if the new poses are the true ones, 0 if the recorded ones
/// are. r' + (1 - a) d is the residual at poses that are changed by the share a, and its square is least for
///   a = 1/2 + (|r|^2 - |r'|^2) / (2 |d|^2).
/// Every band of every lag tells one. They are combined by the inverse squares of their standard errors, to which what
/// bands differ by beyond chance is added: with few frames a standard error may be small by luck.
Estimate ConfirmedShare(const std::vector<Findings>& tests)
{
  constexpr double kBandsDiffer = 0.15;
  std::vector<double> errors(tests.size(), 0.0);
  double sum = 0, weights = 0;
  for (int k = 0; k < kFindings; ++k)
  {
    double gained = 0, changed = 0;
    for (const Findings& test : tests)
    {
      gained += test.of[k].gained;
      changed += test.of[k].changed;
    }
    if (!(changed > 0))
    {
      continue;
    }
    std::vector<double> own(tests.size());
    for (std::size_t t = 0; t < tests.size(); ++t)
    {
      own[t] = 0.5 * (tests[t].of[k].gained - gained / changed * tests[t].of[k].changed) / changed;
    }
    const double error = ErrorOfSum(own), weight = 1 / (error * error + kBandsDiffer * kBandsDiffer);
    sum += weight * (0.5 + 0.5 * gained / changed);
    weights += weight;
    for (std::size_t t = 0; t < tests.size(); ++t)
    {
      errors[t] += weight * own[t];
    }
  }
  return weights > 0 ? Estimate{sum / weights, ErrorOfSum(errors) / weights} : Estimate{};
}

/// dB by which frames are predicted better at new poses than at those of `over` (null: the recorded ones), mean over
/// tests, lags and bands.
Estimate GainOf(const std::vector<Findings>& tests, const std::vector<Findings>* over)
{
  std::vector<double> gains;
  for (std::size_t t = 0; t < tests.size(); ++t)
  {
    double sum = 0;
    int count = 0;
    for (int k = 0; k < kFindings; ++k)
    {
      const int lag = k / (kBands - kFirstBand);
      if (tests[t].isSound[lag] && (!over || (*over)[t].isSound[lag]))
      {
        sum += tests[t].of[k].decibels - (over ? (*over)[t].of[k].decibels : 0.0);
        ++count;
      }
    }
    if (count > 0)
    {
      gains.push_back(sum / count);
    }
  }
  Estimate gain;
  for (double value : gains)
  {
    gain.mean += value / static_cast<double>(gains.size());
  }
  for (double& value : gains)
  {
    value = (value - gain.mean) / static_cast<double>(gains.size());
  }
  gain.error = ErrorOfSum(gains);
  return gain;
}

/// New poses, and what pictures say of them.
struct Candidate
{
  Trajectory trajectory;
  double strength = 0;
  std::vector<Findings> findings;
  Estimate share, gain;

  bool IsConfirmed() const { return share.mean - kLeastConfirmed > kLeastStandardErrors * share.error; }
  bool IsBetterThan(const Candidate& other, double decibels) const
  {
    const Estimate difference = GainOf(findings, &other.findings);
    return difference.mean > std::max(decibels, difference.error);
  }
};

/// Which frames are predicted from which, by their places in `frames`: those of one stroke only.
std::vector<std::array<Test, kLags>> TestsOf(const std::vector<int>& frames, const std::vector<int>& stroke)
{
  const int n = static_cast<int>(frames.size());
  std::vector<std::array<Test, kLags>> all;
  for (int k = 1; k + 1 < n; ++k)
  {
    std::array<Test, kLags> tests;
    tests.fill({-1, -1, -1});
    for (int lag = 1; lag <= kNeighbourLags; ++lag)
    {
      const bool exists = k - lag >= 0 && k + lag < n && stroke[frames[k - lag]] == stroke[frames[k + lag]];
      tests[lag - 1] = exists ? Test{k, k - lag, k + lag} : Test{-1, -1, -1};
    }
    if (tests[0].frame >= 0)
    {
      all.push_back(tests);
    }
  }
  const std::size_t count = std::min(kTests, all.size());
  std::vector<std::array<Test, kLags>> some;
  for (std::size_t k = 0; k < count; ++k)
  {
    some.push_back(all[(2 * k + 1) * all.size() / (2 * count)]);
  }
  return some;
}

/// Thrown where the caller's progress function says stop.
struct Stopped
{
};

/// Looks at pictures, once for all candidates.
class Evidence
{
public:
  Evidence(const Sweep& sweep, const std::vector<int>& frames, const std::vector<int>& stroke,
           const std::function<bool(double)>& progress)
      : sweep_(sweep), tests_(TestsOf(frames, stroke)), progress_(progress)
  {
    // Only frames that a test needs are looked at.
    std::vector<int> place(frames.size(), -1);
    for (const auto& tests : tests_)
    {
      for (const Test& test : tests)
      {
        for (const int k : {test.frame, test.before, test.after})
        {
          if (k >= 0)
          {
            place[k] = 0;
          }
        }
      }
    }
    for (std::size_t k = 0; k < frames.size(); ++k)
    {
      if (place[k] == 0)
      {
        place[k] = static_cast<int>(frames_.size());
        frames_.push_back(frames[k]);
      }
    }
    for (auto& tests : tests_)
    {
      for (Test& test : tests)
      {
        if (test.frame >= 0)
        {
          test = {place[test.frame], place[test.before], place[test.after]};
        }
      }
    }
    if (!frames_.empty())
    {
      pictures_ = PicturesOf(sweep, frames_);
      recorded_.resize(tests_.size());
      ForResidualsAt(sweep.imageToReference,
                     [&](std::size_t t, Residuals residuals) { recorded_[t] = std::move(residuals); });
    }
  }

  std::size_t NumberOfTests() const { return tests_.size(); }

  Candidate Judge(Trajectory trajectory, double strength) const
  {
    constexpr double kMostCandidates = 2 + kStrengths.size();  // two clocks, and every strength
    if (progress_ && !progress_(std::min(judged_++ / kMostCandidates, 1.0)))
    {
      throw Stopped();
    }
    Candidate candidate;
    candidate.strength = strength;
    candidate.findings.resize(tests_.size());
    ForResidualsAt(trajectory.imageToReference, [&](std::size_t t, const Residuals& residuals)
                   { candidate.findings[t] = Find(recorded_[t], residuals, pictures_.pixels); });
    candidate.share = ConfirmedShare(candidate.findings);
    candidate.gain = GainOf(candidate.findings, nullptr);
    candidate.trajectory = std::move(trajectory);
    return candidate;
  }

private:
  /// Calls use(test, its residuals at these poses) for every test, on all threads.
  template <class Use>
  void ForResidualsAt(const std::vector<Eigen::Matrix4d>& poses, Use use) const
  {
    std::vector<SlicePlane> planes;
    for (const int frame : frames_)
    {
      planes.push_back(PicturePlane(sweep_, poses[frame], pictures_.reduction));
    }
    tbb::parallel_for(std::size_t(0), tests_.size(),
                      [&](std::size_t t) { use(t, ResidualsOf(pictures_, tests_[t], planes)); });
  }

  const Sweep& sweep_;
  std::vector<std::array<Test, kLags>> tests_;
  std::vector<int> frames_;
  FramePictures pictures_;
  std::vector<Residuals> recorded_;
  const std::function<bool(double)>& progress_;
  mutable int judged_ = 0;
};

std::string NoiseText(const Trajectory& trajectory)
{
  if (!trajectory.IsNoiseKnown())
  {
    return "tracker's noise unknown, too few poses on one path";
  }
  const auto outliers = std::count(trajectory.isOutlier.begin(), trajectory.isOutlier.end(), 1);
  return "tracker's noise" + Format(" %.3f mm", trajectory.translationNoise) +
         Format(" and %.3f degrees", trajectory.rotationNoise) +
         (outliers > 0 ? ", " + std::to_string(outliers) + (outliers == 1 ? " outlier" : " outliers") : "");
}

std::string EvidenceText(const Candidate& candidate)
{
  return Format("strength %g", candidate.strength) +
         (candidate.trajectory.clock == FrameClock::Times ? " by recorded times" : " by frames' numbers") +
         ": pictures confirm" + Format(" %.2f", candidate.share.mean) +
         Format(" +- %.2f of it", candidate.share.error) + " and predict neighbours" +
         Format(" %+.2f", candidate.gain.mean) + Format(" +- %.2f dB", candidate.gain.error);
}

std::string ChoiceText(const Trajectory& trajectory, double strength)
{
  if (!trajectory.IsChanged())
  {
    return "as tracked";
  }
  return Format("smoothed by %.3g", strength) + Format(" (%.2f mm)", Mean(trajectory.displacement));
}

/// Paths of every strength, and what pictures say of one of them.
struct Paths
{
  std::vector<Trajectory> ofStrength;
  Candidate judged;
};

/// By recorded times, where there are any, unless frames' numbers predict frames better.
Paths ChooseClock(const Sweep& sweep, const Evidence& evidence, const std::vector<double>& strengths, std::size_t which)
{
  const auto judged = [&](std::vector<Trajectory> paths)
  {
    Candidate candidate = evidence.Judge(paths[which], strengths[which]);
    return Paths{std::move(paths), std::move(candidate)};
  };
  Paths byTimes = judged(SmoothTrajectories(sweep, FrameClock::Times, strengths));
  if (byTimes.ofStrength[which].clock == FrameClock::Numbers)
  {
    return byTimes;
  }
  Paths byNumbers = judged(SmoothTrajectories(sweep, FrameClock::Numbers, strengths));
  return byNumbers.judged.IsBetterThan(byTimes.judged, kLeastGain) ? byNumbers : byTimes;
}

/// From strength 1 up while that predicts frames clearly better and poses allow it, or down while what there is does not
/// convince.
Candidate Choose(const Sweep& sweep, const Evidence& evidence)
{
  const std::vector<double> strengths(kStrengths.begin(), kStrengths.end());
  const auto first = std::find(strengths.begin(), strengths.end(), 1.0);
  std::size_t which = static_cast<std::size_t>(first - strengths.begin());
  auto [paths, best] = ChooseClock(sweep, evidence, strengths, which);
  while (!best.IsConfirmed() && which > 0)
  {
    --which;
    best = evidence.Judge(paths[which], strengths[which]);
  }
  while (best.strength >= 1 && which + 1 < strengths.size())
  {
    ++which;
    if (paths[which].lostLikelihood > kMostLostLikelihood)
    {
      break;
    }
    Candidate stronger = evidence.Judge(paths[which], strengths[which]);
    if (!stronger.IsBetterThan(best, kStrongerGain) || !stronger.IsConfirmed())
    {
      break;
    }
    best = std::move(stronger);
  }
  return best;
}

double DegreesBetween(Eigen::Matrix4d a, Eigen::Matrix4d b)
{
  MakeThirdAxis(a, true);
  MakeThirdAxis(b, true);
  const Eigen::Matrix3d turn = a.topLeftCorner<3, 3>() * b.topLeftCorner<3, 3>().inverse();
  return Eigen::AngleAxisd(turn).angle() / kRadiansPerDegree;
}

/// How far poses are from the sweep's.
void MeasureChange(const Sweep& sweep, Trajectory& trajectory)
{
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    const Eigen::Matrix4d &now = trajectory.imageToReference[k], &before = sweep.imageToReference[k];
    trajectory.displacement[k] = CornerDistance(now, before, sweep.width, sweep.height);
    trajectory.rotation[k] = DegreesBetween(now, before);
  }
}

/// What is the same in every frame, at poses without noise.
void TakeOutConstantErrors(const Sweep& sweep, const std::vector<int>& frames, PoseCorrection& correction)
{
  const Sweep smooth = AtCorrectedPoses(sweep, correction);
  correction.constant = EstimateConstantErrors(smooth, frames);
  if (!correction.constant.isSignificant)
  {
    return;
  }
  correction.trajectory.imageToReference = WithoutConstantErrors(smooth, correction.constant);
  MeasureChange(sweep, correction.trajectory);
}

// ---- refinement ----

/// Frames judge a refinement in which they took no part: every fourth in turn.
constexpr int kFolds = 4;

/// dB that these frames must gain. Sweeps that do not come back gain up to 0.06 dB by alignment to neighbours while
/// their poses become worse: neighbours tell how three frames lie to each other, and small errors of that add up.
constexpr double kLeastRefinementGain = 0.1;

/// Of every frame the first comparison of each lag, revisits last.
std::vector<std::array<Test, kLags>> TestsOf(const std::vector<PoseRefinement::Comparison>& comparisons,
                                             std::size_t frames)
{
  std::vector<std::array<Test, kLags>> tests(frames);
  for (auto& of : tests)
  {
    of.fill({-1, -1, -1});
  }
  for (const auto& c : comparisons)
  {
    const int lag = c.isRevisit ? kNeighbourLags : c.after - c.frame - 1;
    if (tests[c.frame][lag].frame < 0)
    {
      tests[c.frame][lag] = {c.frame, c.before, c.after};
    }
  }
  return tests;
}

/// What each frame says of a refinement in which it took no part.
std::vector<Findings> JudgeInFolds(const Sweep& sweep, const std::vector<int>& frames, const PoseRefinement& refinement,
                                   const std::vector<Eigen::Matrix4d>& poses)
{
  const FramePictures pictures = PicturesOf(sweep, frames);
  const auto planesAt = [&](const std::vector<Eigen::Matrix4d>& at)
  {
    std::vector<SlicePlane> planes;
    for (const int frame : frames)
    {
      planes.push_back(PicturePlane(sweep, at[frame], pictures.reduction));
    }
    return planes;
  };
  const int n = static_cast<int>(frames.size());
  const auto tests = TestsOf(refinement.Comparisons(), frames.size());
  const std::vector<SlicePlane> before = planesAt(poses);
  std::vector<Findings> findings(n);
  for (int fold = 0; fold < kFolds; ++fold)
  {
    std::vector<char> isLeftOut(n);
    for (int k = 0; k < n; ++k)
    {
      isLeftOut[k] = k % kFolds == fold;
    }
    const std::vector<SlicePlane> after = planesAt(refinement.Poses({}, isLeftOut));
    tbb::parallel_for(0, n,
                      [&](int k)
                      {
                        if (isLeftOut[k])
                        {
                          findings[k] = Find(ResidualsOf(pictures, tests[k], before),
                                             ResidualsOf(pictures, tests[k], after), pictures.pixels);
                        }
                      });
  }
  return findings;
}

/// Aligns frames to what others predict of their places (Poses/PoseRefinement.h), where frames that take no part are
/// then predicted better. What is said of it in words.
std::string Refine(const Sweep& sweep, const std::vector<int>& frames, PoseCorrection& correction)
{
  Trajectory& trajectory = correction.trajectory;
  const Sweep now = AtCorrectedPoses(sweep, correction);
  const PoseRefinement refinement(now, frames, trajectory.stroke);
  if (refinement.Comparisons().empty())
  {
    return "";
  }
  const std::vector<Findings> findings = JudgeInFolds(sweep, frames, refinement, now.imageToReference);
  const Estimate gain = GainOf(findings, nullptr), share = ConfirmedShare(findings);
  correction.isRefined = share.mean - kLeastConfirmed > kLeastStandardErrors * share.error &&
                         gain.mean > std::max(kLeastRefinementGain, gain.error);
  if (correction.isRefined)
  {
    trajectory.imageToReference = refinement.Poses({});
    MeasureChange(sweep, trajectory);
  }
  return "aligned to others, frames that took no part confirm" + Format(" %.2f", share.mean) +
         Format(" +- %.2f", share.error) + Format(" and gain %+.2f", gain.mean) + Format(" +- %.2f dB", gain.error) +
         " (" + std::to_string(refinement.NumberOfRevisits()) + " comparisons with where the probe came back)";
}

}  // namespace

PoseCorrection CorrectPoses(const Sweep& sweep, const std::vector<int>& frames, const PoseCorrectionOptions& options,
                            const std::function<bool(double)>& progress)
try
{
  const Stopwatch watch;
  PoseCorrection correction;
  correction.strength = options.strength.value_or(0);
  // What would change, and what is known of the tracker. A path that is smooth in time need not be so from frame to
  // frame.
  const double strength = options.strength.value_or(1);
  correction.trajectory = SmoothTrajectory(sweep, {strength, FrameClock::Times});
  const bool wouldChange =
      correction.trajectory.IsChanged() || SmoothTrajectory(sweep, {strength, FrameClock::Numbers}).IsChanged();
  const bool isStepped = correction.trajectory.isStepped;
  std::string evidence = isStepped ? "motion in equal steps" : NoiseText(correction.trajectory);
  if (options.strength)
  {
    evidence = "given";
  }
  if (wouldChange && frames.size() >= kFewestFrames)
  {
    const Evidence pictures(sweep, frames, correction.trajectory.stroke, progress);
    if (options.strength)
    {
      correction.trajectory = ChooseClock(sweep, pictures, {correction.strength}, 0).judged.trajectory;
    }
    else if (pictures.NumberOfTests() > 0)
    {
      Candidate best = Choose(sweep, pictures);
      evidence = NoiseText(best.trajectory);
      if (best.trajectory.IsChanged())
      {
        evidence += "; " + EvidenceText(best);
      }
      correction.strength = best.IsConfirmed() ? best.strength : 0;
      correction.trajectory = std::move(best.trajectory);
    }
  }
  else if (wouldChange && !options.strength)
  {
    evidence += "; " + std::to_string(frames.size()) + " frames are too few to compare on";
  }
  if (correction.strength == 0)
  {
    correction.trajectory = SmoothTrajectory(sweep, {0, correction.trajectory.clock});
  }
  std::string choice = ChoiceText(correction.trajectory, correction.strength);
  if (!options.strength || *options.strength > 0)
  {
    if (progress && !progress(1))
    {
      throw Stopped();
    }
    TakeOutConstantErrors(sweep, frames, correction);
    evidence += correction.constant.comparisons > 0 ? "; " + correction.constant.evidence : "";
    choice += correction.constant.isSignificant ? "; " + Describe(correction.constant) : "";
    if (options.isRefined && wouldChange && frames.size() >= kFewestFrames)
    {
      const std::string said = Refine(sweep, frames, correction);
      evidence += said.empty() ? "" : "; " + said;
      choice += correction.isRefined ? Format("; aligned (%.2f mm)", Mean(correction.trajectory.displacement)) : "";
    }
  }
  correction.decision = {"poses", choice, evidence, watch.Seconds()};
  return correction;
}
catch (const cv::Exception& exception)
{
  ThrowAsCores(exception);
}
catch (const Stopped&)
{
  PoseCorrection recorded;
  recorded.trajectory = SmoothTrajectory(sweep, {0, FrameClock::Numbers});
  recorded.aborted = true;
  return recorded;
}

Sweep AtCorrectedPoses(const Sweep& sweep, const PoseCorrection& correction)
{
  Sweep corrected = sweep;
  corrected.imageToReference = correction.trajectory.imageToReference;
  return corrected;
}

}  // namespace bigus
