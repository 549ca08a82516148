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
#include <optional>
#include <string>
#include <utility>

#include "Core/Deciding/DecisionRules.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/OpenCv.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Poses/FramePrediction.h"
#include "Core/Poses/PoseRefinement.h"
#include "Core/Poses/Revisits.h"
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

/// Strengths that are tried, each with the steps from it to the next.
constexpr std::array<double, 9> kLadder{0.5, 1, 2, 4, 8, 16, 32, 64, 128};

// Up to strength 1 poses themselves ask for smoothing, so that pictures need only not object: they must confirm more than
// kLeastConfirmed, and one standard error. Beyond, poses object, because a tracker's noise is not white, and pictures must
// ask for most of the step: where they confirm 0.9 to 1.2 of it the truth confirms a half, since they see little of its slow
// part.
constexpr double kMostOfAStep = 0.75;
constexpr double kSureOfAStep = 1.5;     // standard errors above kLeastConfirmed
constexpr double kLeastStepGain = 0.02;  // dB; below, nothing is at stake
constexpr std::size_t kRungsAhead = 3;   // a weak rung may lie between strong ones

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

/// What a test says of new poses against others. With r and r' the residuals at the others and at the new ones
/// (PoseCorrection.md), d = r - r' is what the new poses change. Squares are in units of a band's level, the mean of |r|^2 and
/// |r'|^2. Means over bands and lags.
struct Comparison
{
  double gained = 0;    // |r|^2 - |r'|^2
  double changed = 0;   // |d|^2
  double decibels = 0;  // 10 log10(|r|^2 / |r'|^2)
  int count = 0;        // of bands and lags that say something
};

/// From residuals at both, of pictures with so many lit pixels, by lags from `first` to before `end`.
Comparison Compare(const Residuals& recorded, const Residuals& corrected, double pixels, int first, int end)
{
  Comparison sum;
  for (int lag = first; lag < end; ++lag)
  {
    if (recorded[lag].empty())
    {
      continue;
    }
    cv::Mat before = recorded[lag].clone(), after = corrected[lag].clone();
    int seen = 0;
    float *const residuals = before.ptr<float>(), *const corrections = after.ptr<float>();
    for (std::size_t p = 0, count = before.total(); p < count; ++p)
    {
      float &r = residuals[p], &s = corrections[p];
      const bool both = !std::isnan(r) && !std::isnan(s);
      seen += both ? 1 : 0;
      r = both ? r : 0.0f;
      s = both ? s : 0.0f;
    }
    if (!(seen > kLeastCover * pixels))
    {
      continue;
    }
    const Bands r = BandsOf(before), s = BandsOf(after);
    for (int band = kFirstBand; band < kBands; ++band)
    {
      // Rounding to grey levels keeps an empty picture from dividing by nothing.
      const double share = static_cast<double>(r[band].total()) / static_cast<double>(before.total());
      const double rounding = share * seen * kGreyLevel * kGreyLevel / 12;
      const double squares = r[band].dot(r[band]) + rounding, left = s[band].dot(s[band]) + rounding;
      const cv::Mat d = r[band] - s[band];
      const double level = 0.5 * (squares + left);
      sum.gained += (squares - left) / level;
      sum.changed += d.dot(d) / level;
      sum.decibels += 10 * std::log10(squares / left);
      ++sum.count;
    }
  }
  const int count = std::max(sum.count, 1);
  return {sum.gained / count, sum.changed / count, sum.decibels / count, sum.count};
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

/// The share a of the change of poses that pictures confirm: 1 if the new poses are the true ones, 0 if the others are.
/// r' + (1 - a) d is the residual at poses that are changed by the share a, and its square is least for
///   a = 1/2 + (|r|^2 - |r'|^2) / (2 |d|^2).
Estimate ConfirmedShare(const std::vector<Comparison>& tests)
{
  double gained = 0, changed = 0;
  for (const Comparison& test : tests)
  {
    gained += test.gained;
    changed += test.changed;
  }
  if (!(changed > 0))
  {
    return {};
  }
  std::vector<double> errors;
  for (const Comparison& test : tests)
  {
    errors.push_back(0.5 * (test.gained - gained / changed * test.changed) / changed);
  }
  return {0.5 + 0.5 * gained / changed, ErrorOfSum(errors)};
}

/// dB by which frames are predicted better, mean over tests that say something.
Estimate GainOf(const std::vector<Comparison>& tests)
{
  std::vector<double> gains;
  for (const Comparison& test : tests)
  {
    if (test.count > 0)
    {
      gains.push_back(test.decibels);
    }
  }
  if (gains.empty())
  {
    return {};
  }
  const double mean = Mean(gains);
  for (double& value : gains)
  {
    value = (value - mean) / static_cast<double>(gains.size());
  }
  return {mean, ErrorOfSum(gains)};
}

/// Poses, and the residual of every test at them.
struct Candidate
{
  Trajectory trajectory;
  double strength = 0;
  std::vector<Residuals> residuals;
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
  return EvenlySpread(all, kTests);
}

/// Predicts frames also from those of another time that lie nearest around them.
void AddRevisits(const Sweep& sweep, const std::vector<int>& frames, const std::vector<int>& stroke,
                 std::vector<std::array<Test, kLags>>& tests)
{
  std::vector<SlicePlane> planes;
  for (const int frame : frames)
  {
    planes.push_back(sweep.Plane(frame));
  }
  std::vector<int> before(frames.size(), -1);
  for (const Revisit& revisit : FindRevisits(planes, frames, stroke).found)
  {
    int& nearest = before[revisit.frame];
    nearest = nearest < 0 ? revisit.before : nearest;
  }
  for (auto& test : tests)
  {
    if (const int k = test[0].frame; before[k] >= 0)
    {
      test[kNeighbourLags] = {k, before[k], before[k] + 1};
    }
  }
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
    AddRevisits(sweep, frames, stroke, tests_);
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
    }
  }

  std::size_t NumberOfTests() const { return tests_.size(); }

  /// Looks at pictures once.
  Candidate At(Trajectory trajectory, double strength) const
  {
    constexpr double kUsualLooks = 8;  // the recorded poses, two clocks, and as many strengths as white noise asks for
    if (progress_ && !progress_(std::min(looks_++ / kUsualLooks, 1.0)))
    {
      throw Stopped();
    }
    Candidate candidate{std::move(trajectory), strength, std::vector<Residuals>(tests_.size())};
    std::vector<SlicePlane> planes;
    for (const int frame : frames_)
    {
      planes.push_back(PicturePlane(sweep_, candidate.trajectory.imageToReference[frame], pictures_.reduction));
    }
    tbb::parallel_for(std::size_t(0), tests_.size(),
                      [&](std::size_t t) { candidate.residuals[t] = ResidualsOf(pictures_, tests_[t], planes); });
    return candidate;
  }

  /// What pictures say of the step from one candidate to another.
  PoseStep Judge(const Candidate& from, const Candidate& to) const
  {
    const std::vector<Comparison> tests = Compared(from, to, 0, kNeighbourLags);
    const Estimate share = ConfirmedShare(tests), gain = GainOf(tests);
    PoseStep step{from.strength, to.strength, share.mean, share.error, gain.mean, gain.error};
    const std::vector<Comparison> again = Compared(from, to, kNeighbourLags, kLags);
    if (static_cast<std::size_t>(std::count_if(again.begin(), again.end(),
                                               [](const Comparison& c) { return c.count > 0; })) >= kFewestFrames)
    {
      const Estimate sharesAgain = ConfirmedShare(again);
      step.revisitShare = sharesAgain.mean;
      step.revisitError = sharesAgain.error;
    }
    return step;
  }

private:
  std::vector<Comparison> Compared(const Candidate& from, const Candidate& to, int firstLag, int endLag) const
  {
    std::vector<Comparison> tests(tests_.size());
    tbb::parallel_for(std::size_t(0), tests_.size(),
                      [&](std::size_t t)
                      { tests[t] = Compare(from.residuals[t], to.residuals[t], pictures_.pixels, firstLag, endLag); });
    return tests;
  }

  const Sweep& sweep_;
  std::vector<std::array<Test, kLags>> tests_;
  std::vector<int> frames_;
  FramePictures pictures_;
  const std::function<bool(double)>& progress_;
  mutable int looks_ = 0;
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

/// Beyond strength 1: whether frames of other times at the same places confirm less than half of a step, by one standard error.
/// Neighbours see little of what bends slowly, those more; so neither such a step nor a larger one is taken.
bool AreRevisitsAgainst(const PoseStep& step)
{
  return step.from > 0 && step.revisitShare + step.revisitError < kLeastConfirmed;
}

std::string StepText(const PoseStep& step)
{
  return Format("pictures confirm %.2f", step.share) + Format(" +- %.2f of the step", step.shareError) +
         Format(" from strength %g", step.from) + Format(" to %g", step.to) + Format(" (%+.2f dB)", step.gain) +
         (AreRevisitsAgainst(step) ? Format(", those of other times at its places %.2f", step.revisitShare) +
                                         Format(" +- %.2f", step.revisitError)
                                   : "");
}

/// The last step that was taken and the first that was not.
std::string EvidenceText(const std::vector<PoseStep>& steps, FrameClock clock)
{
  std::string text = clock == FrameClock::Times ? "by recorded times" : "by frames' numbers";
  const auto taken = std::find_if(steps.rbegin(), steps.rend(), [](const PoseStep& step) { return step.isTaken; });
  text += taken != steps.rend() ? ", " + StepText(*taken) : "";
  const auto refused = std::find_if(taken.base(), steps.end(), [](const PoseStep& step) { return !step.isTaken; });
  return text + (refused != steps.end() ? ", " + StepText(*refused) + ", which is not taken" : "");
}

std::string ChoiceText(const Trajectory& trajectory, double strength)
{
  if (!trajectory.IsChanged())
  {
    return "as tracked";
  }
  return Format("smoothed by %.3g", strength) + Format(" (%.2f mm)", Mean(trajectory.displacement));
}

/// Smooth paths by both clocks. What does not depend on the strength is found once.
class Paths
{
public:
  explicit Paths(const Sweep& sweep) : sweep_(sweep), isTimed_(HasUsableTimes(sweep)) {}

  Trajectory At(FrameClock clock, double strength)
  {
    std::optional<TrajectorySmoother>& smoother = clock == FrameClock::Times && isTimed_ ? byTimes_ : byNumbers_;
    if (!smoother)
    {
      smoother.emplace(sweep_, clock);
    }
    return smoother->At(strength);
  }

private:
  const Sweep& sweep_;
  bool isTimed_;
  std::optional<TrajectorySmoother> byTimes_, byNumbers_;
};

/// By recorded times, where there are any, unless frames' numbers predict frames better.
Candidate ChooseClock(Paths& paths, const Evidence& evidence, double strength)
{
  Candidate byTimes = evidence.At(paths.At(FrameClock::Times, strength), strength);
  if (byTimes.trajectory.clock == FrameClock::Numbers)
  {
    return byTimes;
  }
  Candidate byNumbers = evidence.At(paths.At(FrameClock::Numbers, strength), strength);
  const PoseStep step = evidence.Judge(byTimes, byNumbers);
  return step.gain > std::max(kLeastGain, step.gainError) ? byNumbers : byTimes;
}

/// Steps up the ladder while pictures confirm them, from strength 1, or 1/2 where that is not confirmed, and to where frames
/// of other times are against it. `steps` gets all that were asked for. Strength 0 where none is taken.
Candidate Choose(Paths& paths, const Evidence& evidence, std::vector<PoseStep>& steps)
{
  std::size_t rung = 1;
  Candidate one = ChooseClock(paths, evidence, kLadder[rung]);
  const FrameClock clock = one.trajectory.clock;
  const auto at = [&](double strength) { return evidence.At(paths.At(clock, strength), strength); };
  Candidate now = at(0);
  bool isEnd = false;
  const auto take = [&](Candidate next, double least, double errors, double gain)
  {
    PoseStep step = evidence.Judge(now, next);
    isEnd = AreRevisitsAgainst(step);
    step.isTaken =
        step.share > least && step.share - kLeastConfirmed > errors * step.shareError && step.gain > gain && !isEnd;
    steps.push_back(step);
    if (step.isTaken)
    {
      now = std::move(next);
    }
    return step.isTaken;
  };
  const double anyGain = -std::numeric_limits<double>::infinity();
  if (!take(std::move(one), kLeastConfirmed, 1, anyGain))
  {
    take(at(kLadder[0]), kLeastConfirmed, 1, anyGain);
    return now;
  }
  for (std::size_t next = rung + 1; !isEnd && next < std::min(kLadder.size(), rung + 1 + kRungsAhead); ++next)
  {
    if (take(at(kLadder[next]), kMostOfAStep, kSureOfAStep, kLeastStepGain))
    {
      rung = next;
    }
  }
  return now;
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
  if (!correction.constant.IsSignificant())
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
std::vector<Comparison> JudgeInFolds(const Sweep& sweep, const std::vector<int>& frames,
                                     const PoseRefinement& refinement, const std::vector<Eigen::Matrix4d>& poses)
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
  std::vector<Comparison> findings(n);
  for (int fold = 0; fold < kFolds; ++fold)
  {
    std::vector<char> isLeftOut(n);
    for (int k = 0; k < n; ++k)
    {
      isLeftOut[k] = k % kFolds == fold;
    }
    const std::vector<SlicePlane> after = planesAt(refinement.Poses(isLeftOut));
    tbb::parallel_for(0, n,
                      [&](int k)
                      {
                        if (isLeftOut[k])
                        {
                          findings[k] = Compare(ResidualsOf(pictures, tests[k], before),
                                                ResidualsOf(pictures, tests[k], after), pictures.pixels, 0, kLags);
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
  const std::vector<Comparison> tests = JudgeInFolds(sweep, frames, refinement, now.imageToReference);
  const Estimate gain = GainOf(tests), share = ConfirmedShare(tests);
  const bool isTaken = share.mean - kLeastConfirmed > kLeastStandardErrors * share.error &&
                       gain.mean > std::max(kLeastRefinementGain, gain.error);
  correction.alignment = {true, share.mean, share.error, gain.mean, 0, isTaken};
  if (isTaken)
  {
    trajectory.imageToReference = refinement.Poses();
    MeasureChange(sweep, trajectory);
  }
  return "aligned to others, frames that took no part confirm" + Format(" %.2f", share.mean) +
         Format(" +- %.2f", share.error) + Format(" and gain %+.2f", gain.mean) + Format(" +- %.2f dB", gain.error) +
         " (" + std::to_string(refinement.NumberOfRevisits()) + " comparisons with where the probe came back)";
}

}  // namespace

bool PoseCorrection::IsUndecided() const
{
  return strength == 0 && !steps.empty() && steps[0].share + 2 * steps[0].shareError > kLeastConfirmed;
}

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
  Paths paths(sweep);
  correction.trajectory = paths.At(FrameClock::Times, strength);
  const bool wouldChange = correction.trajectory.IsChanged() || paths.At(FrameClock::Numbers, strength).IsChanged();
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
      correction.trajectory = ChooseClock(paths, pictures, correction.strength).trajectory;
    }
    else if (pictures.NumberOfTests() > 0)
    {
      Candidate best = Choose(paths, pictures, correction.steps);
      evidence = NoiseText(best.trajectory) + "; " + EvidenceText(correction.steps, best.trajectory.clock);
      correction.strength = best.strength;
      correction.trajectory = std::move(best.trajectory);
    }
  }
  else if (wouldChange && !options.strength)
  {
    evidence += "; " + std::to_string(frames.size()) + " frames are too few to compare on";
  }
  if (correction.strength == 0)
  {
    correction.trajectory = paths.At(correction.trajectory.clock, 0);
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
    choice += correction.constant.IsSignificant() ? "; " + Describe(correction.constant) : "";
    if (options.isRefined && wouldChange && frames.size() >= kFewestFrames)
    {
      const std::string said = Refine(sweep, frames, correction);
      evidence += said.empty() ? "" : "; " + said;
      choice +=
          correction.alignment.isTaken ? Format("; aligned (%.2f mm)", Mean(correction.trajectory.displacement)) : "";
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
