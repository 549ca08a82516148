// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/Trajectory.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "Core/Model/Error.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/SmoothingSpline.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr double kLongestStep = 1000;  // median steps of time, beyond which a clock was set and did not run
constexpr int kFewestInStroke = 5;     // poses of a stroke: two make a line, and three tell noise from it
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr int kFewestToEstimate = 8;  // poses of all strokes: with fewer, noise and smoothness cannot be told apart

/// Noise at the image's corners, in pixels, below which poses are exact: a shift by a twentieth of a pixel changes no
/// image that one could tell. Then only outliers are moved.
constexpr double kLeastNoise = 0.05;

/// Pixels at the corners by which a pose must be off to be an outlier: among exact poses small things stand out.
constexpr double kLeastOutlier = 0.5;

// ---- stepped motion ----

constexpr double kSameStep = 1e-3;    // mm at the corners, between steps that are equal; files round poses to 1e-5
constexpr double kStepsOfAMotor = 8;  // stepped: there are this many times more steps than different ones, at least

// ---- strokes ----

constexpr int kWindow = 5;            // poses before and after a gap from which lines are drawn to its middle
constexpr double kJumpOverNoise = 8;  // a jump is as wide as so many times the median distance between those lines
constexpr double kJumpOverStep = 4;   // and so many steps, of those that are usual or of those beside it
constexpr double kSteadyTurn = 0.5;   // usual steps a frame, before and after: slower turns are smooth by themselves

// ---- noise and smoothness ----

// drive = q / sigma^2 in a median step's time: from curves of 300 frames to no smoothing at all
constexpr double kLeastDrive = 1e-8, kMostDrive = 1e4;
constexpr double kDriveStep = 0.5;  // of log10(drive), between the values tried first
constexpr int kDriveRefinements = 5;
constexpr int kRobustRounds = 6;
constexpr double kMostEstimated = 4000;  // poses that smoothness is estimated from: more say little more

/// Squared deviation of a pose in units of the noise, six numbers each of variance 1, up to which it counts in full:
/// 1.4 % of sound poses lie above. Beyond, its weight falls with the square.
constexpr double kFullWeight = 16;
constexpr double kOutlier = 36;     // from here on a pose is reported as an outlier; 2 in a million sound ones are
constexpr double kRounding = 1e-9;  // mm, and of quaternions: files round more
constexpr double kLeastWeight = 1e-6;
constexpr double kSuspect = 5;  // median errors of prediction, from which a pose begins with little weight
constexpr double kSuspectWeight = 1e-3;

/// A ridge that keeps the pivot at the image where orientations hold no noise, mm.
constexpr double kFarthestPivot = 1000;

using Points = Eigen::Matrix<double, 9, 1>;  // three corners of an image, mm

struct Pose
{
  Eigen::Matrix3d axes;  // along the rows, across them in the plane, along the normal
  Eigen::Vector3d centre;
};

/// What is smoothed: all poses, and when they were taken.
struct Path
{
  std::vector<double> times;  // in median steps
  std::vector<Pose> poses;
  std::vector<Points> points;                // corners at pixels (0, 0), (width - 1, 0) and (0, height - 1)
  std::vector<std::pair<int, int>> strokes;  // first frame and the one after the last
  int usable = 0;                            // poses of all strokes that are smoothed

  int Size() const { return static_cast<int>(times.size()); }
};

std::vector<double> TimesOf(const Sweep& sweep, FrameClock clock)
{
  std::vector<double> times(sweep.imageToReference.size()), steps;
  for (std::size_t k = 0; k < times.size(); ++k)
  {
    times[k] = clock == FrameClock::Times ? sweep.timestamps[k] : static_cast<double>(k);
    if (k > 0)
    {
      steps.push_back(times[k] - times[k - 1]);
    }
  }
  const double first = times[0], unit = steps.empty() ? 1.0 : Median(steps);
  for (double& time : times)
  {
    time = (time - first) / unit;
  }
  return times;
}

/// The distance between points, root mean square over the three.
double Distance(const Points& a, const Points& b)
{
  return (a - b).norm() / std::sqrt(3.0);
}

/// Whether there are few different steps from a pose to the next: a motor makes them, no hand does.
bool IsStepped(const Path& path, const Sweep& sweep)
{
  const double right = sweep.width - 1.0, down = sweep.height - 1.0;
  const SlicePlane image = sweep.Plane(0);
  const Eigen::Vector3d across = image.columnStep.norm() * right * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d along = path.poses[0].axes.transpose() * (image.rowStep * down);
  // By their first number: equal steps differ there by sqrt(3) kSameStep at the most.
  std::multimap<double, Points> different;
  constexpr double reach = 2 * kSameStep;
  const std::size_t steps = path.poses.size() - 1;
  for (std::size_t k = 0; k < steps; ++k)
  {
    // The next image seen from this one.
    const Eigen::Matrix3d turn = path.poses[k].axes.transpose() * path.poses[k + 1].axes;
    const Eigen::Vector3d shift = path.poses[k].axes.transpose() * (path.poses[k + 1].centre - path.poses[k].centre);
    Points step;
    step << shift, shift + turn * across - across, shift + turn * along - along;
    if (std::none_of(different.lower_bound(step[0] - reach), different.upper_bound(step[0] + reach),
                     [&step](const auto& known) { return Distance(known.second, step) < kSameStep; }))
    {
      different.emplace(step[0], step);
      if (kStepsOfAMotor * static_cast<double>(different.size()) > static_cast<double>(steps))
      {
        return false;
      }
    }
  }
  return true;
}

/// A line through poses [begin, end), coordinate by coordinate: the median of the slopes between any two, and the
/// median height (Theil and Sen), so that one pose far off changes nothing.
struct Line
{
  Points at, slope;
};
Line LineThrough(const Path& path, int begin, int end, double time)
{
  Line line;
  std::vector<double> slopes, heights;
  for (int c = 0; c < 9; ++c)
  {
    slopes.clear();
    heights.clear();
    for (int a = begin; a < end; ++a)
    {
      for (int b = a + 1; b < end; ++b)
      {
        slopes.push_back((path.points[b][c] - path.points[a][c]) / (path.times[b] - path.times[a]));
      }
    }
    line.slope[c] = Median(slopes);
    for (int a = begin; a < end; ++a)
    {
      heights.push_back(path.points[a][c] + line.slope[c] * (time - path.times[a]));
    }
    line.at[c] = Median(heights);
  }
  return line;
}

/// Cuts where lines through the poses before and after a gap do not meet, or lead against each other.
std::vector<std::pair<int, int>> StrokesOf(const Path& path)
{
  const int n = path.Size();
  std::vector<int> cuts = {0};
  if (n >= 2 * kWindow)
  {
    std::vector<double> apart(n, 0.0), slower(n, 0.0), faster(n, 0.0), steps(n - 2 * kWindow + 1);
    std::vector<char> turnsBack(n, 0);
    tbb::parallel_for(kWindow, n - kWindow + 1,
                      [&](int k)
                      {
                        const double time = 0.5 * (path.times[k - 1] + path.times[k]);
                        const Line before = LineThrough(path, k - kWindow, k, time),
                                   after = LineThrough(path, k, k + kWindow, time);
                        apart[k] = Distance(before.at, after.at);
                        slower[k] = std::min(before.slope.norm(), after.slope.norm()) / std::sqrt(3.0);
                        faster[k] = std::max(before.slope.norm(), after.slope.norm()) / std::sqrt(3.0);
                        turnsBack[k] = before.slope.dot(after.slope) < 0;
                        steps[k - kWindow] = before.slope.norm() / std::sqrt(3.0);
                      });
    const std::vector<double> inner(apart.begin() + kWindow, apart.end() - kWindow + 1);
    const double noise = Median(inner), step = UsualStep(steps);
    int turn = -1;  // of those that follow each other the one where lines meet best
    for (int k = kWindow; k + kWindow <= n; ++k)
    {
      const auto near = apart.begin() + k;
      const bool isWidest = *std::max_element(near - 2, near + 3) == apart[k];
      if (isWidest && apart[k] > kJumpOverNoise * noise && apart[k] > kJumpOverStep * std::max(step, faster[k]))
      {
        cuts.push_back(k);
      }
      // Where the probe turns back, lines meet best at the turn. Natural turns are slow and smooth by themselves.
      const bool turns = turnsBack[k] && slower[k] > kSteadyTurn * step && slower[k] * kWindow > kJumpOverNoise * noise;
      if (turns && (turn < 0 || apart[k] < apart[turn]))
      {
        turn = k;
      }
      if (turn >= 0 && (!turns || k + kWindow == n))
      {
        cuts.push_back(turn);
        turn = -1;
      }
    }
    std::sort(cuts.begin(), cuts.end());
    cuts.erase(std::unique(cuts.begin(), cuts.end()), cuts.end());
  }
  cuts.push_back(n);
  std::vector<std::pair<int, int>> strokes;
  for (std::size_t k = 0; k + 1 < cuts.size(); ++k)
  {
    strokes.emplace_back(cuts[k], cuts[k + 1]);
  }
  return strokes;
}

Path PathOf(const Sweep& sweep, FrameClock clock)
{
  Path path;
  path.times = TimesOf(sweep, clock);
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    const SlicePlane plane = sweep.Plane(k);
    plane.Validate("frame " + std::to_string(k));
    path.poses.push_back({AxesOf(plane), CentreOf(plane)});
    Points points;
    points << plane.Point(0, 0), plane.Point(sweep.width - 1, 0), plane.Point(0, sweep.height - 1);
    path.points.push_back(points);
  }
  path.strokes = StrokesOf(path);
  return path;
}

/// The body's point c for which c's recorded places are least noisy: noise of the orientation at the place that is
/// tracked moves the image's centre, but not that place. Third differences of the path hold noise and little else, so
/// c minimises the sum of |D p + D R c|^2 over them, each weighing less the larger it is.
Eigen::Vector3d PivotOf(const Path& path)
{
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  constexpr int kRounds = 10;
  std::vector<double> sizes;
  for (int round = 0; round < kRounds; ++round)
  {
    const double typical = Median(sizes);
    if (round > 0 && !(typical > 0))
    {
      break;
    }
    Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double noise = 0;
    std::vector<double> found;
    for (const auto& [begin, end] : path.strokes)
    {
      for (int k = begin; k + 3 < end; ++k)
      {
        const auto& p = path.poses;
        const Eigen::Matrix3d turn = p[k + 3].axes - 3 * p[k + 2].axes + 3 * p[k + 1].axes - p[k].axes;
        const Eigen::Vector3d shift = p[k + 3].centre - 3 * p[k + 2].centre + 3 * p[k + 1].centre - p[k].centre;
        const double size = (shift + turn * pivot).norm();
        const double weight = round == 0 ? 1.0 : 1 / std::max(size, typical);
        matrix += weight * turn.transpose() * turn;
        right -= weight * turn.transpose() * shift;
        noise += weight * size * size;
        found.push_back(size);
      }
    }
    if (found.empty())
    {
      break;
    }
    matrix.diagonal().array() += noise / static_cast<double>(found.size()) / (kFarthestPivot * kFarthestPivot);
    sizes = std::move(found);
    const Eigen::Vector3d next = matrix.ldlt().solve(right);
    if (!next.allFinite())
    {
      break;
    }
    pivot = next;
  }
  return pivot;
}

/// One of the two motions: places of the pivot (3 numbers a pose) or orientations as unit quaternions (4 numbers, of
/// which noise moves 3). Both are smoothed number by number. That depends neither on the choice of axes in the world nor
/// on those of the probe, and a path of quaternions has no seam.
struct Motion
{
  std::vector<Eigen::MatrixXd> values;  // of every stroke
  int freedoms = 3;
  double drive = 0, noise = 0;        // noise: standard deviation of each number
  std::vector<SmoothedCurve> curves;  // of every stroke
};

struct Weighted
{
  std::vector<std::vector<double>> times, weights;  // of every stroke
};

/// -2 ln L of a drive, sigma chosen best, which is set.
double Cost(Motion& motion, const Weighted& data, double drive)
{
  double squares = 0, logDeterminant = 0, count = 0;
  for (std::size_t s = 0; s < motion.values.size(); ++s)
  {
    const SmoothedCurve curve = Smooth(data.times[s], motion.values[s], data.weights[s], drive);
    squares += curve.squares;
    logDeterminant += motion.freedoms * curve.logDeterminant;
    count += motion.freedoms * (static_cast<double>(data.times[s].size()) - 2);
  }
  const double variance = std::max(squares / count, 1e-30);
  motion.drive = drive;
  motion.noise = std::sqrt(variance);
  return count * std::log(variance) + logDeterminant;
}

/// The middle of every stroke, as long as the same share of it: kMostEstimated poses of the whole path.
std::pair<Motion, Weighted> MiddlesOf(const Motion& motion, const Weighted& data, double poses)
{
  Motion middles;
  middles.freedoms = motion.freedoms;
  Weighted weighted;
  for (std::size_t s = 0; s < motion.values.size(); ++s)
  {
    const auto rows = motion.values[s].rows();
    const auto kept =
        std::min(rows, static_cast<Eigen::Index>(std::ceil(kMostEstimated / poses * static_cast<double>(rows))) + 2);
    const Eigen::Index begin = (rows - kept) / 2;
    middles.values.push_back(motion.values[s].middleRows(begin, kept));
    weighted.times.emplace_back(data.times[s].begin() + begin, data.times[s].begin() + begin + kept);
    weighted.weights.emplace_back(data.weights[s].begin() + begin, data.weights[s].begin() + begin + kept);
  }
  return {std::move(middles), std::move(weighted)};
}

/// The exponent of the drive of most likelihood, in powers of ten.
double LikeliestDrive(Motion& motion, const Weighted& data)
{
  double best = 0, lowest = 0, step = kDriveStep;
  bool first = true;
  const auto consider = [&](double exponent)
  {
    const double cost = Cost(motion, data, std::pow(10.0, exponent));
    if (first || cost < lowest)
    {
      first = false;
      lowest = cost;
      best = exponent;
    }
  };
  const double low = std::log10(kLeastDrive), high = std::log10(kMostDrive);
  for (double exponent = low; exponent <= high + 1e-9; exponent += step)
  {
    consider(exponent);
  }
  for (int k = 0; k < kDriveRefinements; ++k)
  {
    step /= 2;
    const double middle = best;
    consider(std::max(middle - step, low));
    consider(std::min(middle + step, high));
  }
  return best;
}

/// Noise and smoothness of most likelihood. Of a long path the smoothness is that of a part.
void Estimate(Motion& motion, const Weighted& data)
{
  double poses = 0, exponent = 0;
  for (const std::vector<double>& times : data.times)
  {
    poses += static_cast<double>(times.size());
  }
  if (poses > kMostEstimated)
  {
    auto [middles, weighted] = MiddlesOf(motion, data, poses);
    exponent = LikeliestDrive(middles, weighted);
  }
  else
  {
    exponent = LikeliestDrive(motion, data);
  }
  Cost(motion, data, std::pow(10.0, exponent));
}

double DriveAt(const Motion& motion, double strength)
{
  return std::max(motion.drive / (strength * strength), kLeastDrive);
}

void SmoothAll(Motion& motion, const Weighted& data, double strength)
{
  motion.curves.clear();
  for (std::size_t s = 0; s < motion.values.size(); ++s)
  {
    motion.curves.push_back(Smooth(data.times[s], motion.values[s], data.weights[s], DriveAt(motion, strength)));
  }
}

/// Squared deviation of a pose from what the others say, in units of the noise.
double Deviation(const Motion& motion, std::size_t stroke, int row)
{
  const SmoothedCurve& curve = motion.curves[stroke];
  const double left = std::max(1 - curve.leverage[row], 1e-9);
  const double squares = (motion.values[stroke].row(row) - curve.values.row(row)).squaredNorm();
  const double noise = std::max(motion.noise, kRounding);
  return squares / (noise * noise * left);
}

/// How far pose k lies from what two of its four neighbours say, whichever two say it best, mm.
double PredictionError(const Path& path, const std::pair<int, int>& stroke, int k)
{
  double least = -1;
  for (int a = std::max(stroke.first, k - 2); a < std::min(stroke.second, k + 3); ++a)
  {
    for (int b = a + 1; b < std::min(stroke.second, k + 3); ++b)
    {
      if (a != k && b != k)
      {
        const double share = (path.times[k] - path.times[a]) / (path.times[b] - path.times[a]);
        const double error = Distance(path.points[a] + share * (path.points[b] - path.points[a]), path.points[k]);
        least = least < 0 ? error : std::min(least, error);
      }
    }
  }
  return std::max(least, 0.0);
}

/// Both motions, and what every pose counts in them.
struct Motions
{
  Motion places, turns;
  Weighted data;

  void SmoothAll(double strength)
  {
    ForBoth([&](Motion& motion) { bigus::SmoothAll(motion, data, strength); });
  }

  /// At once: neither knows of the other.
  template <class Work>
  void ForBoth(const Work& work)
  {
    tbb::parallel_for(0, 2, [&](int k) { work(k == 0 ? places : turns); });
  }
};

/// Poses of all strokes. Those that their neighbours predict badly begin with little weight.
Motions MotionsOf(const Path& path, const Eigen::Vector3d& pivot)
{
  Motions motions;
  std::vector<double> errors;
  for (const auto& [begin, end] : path.strokes)
  {
    Eigen::MatrixXd place(end - begin, 3), turn(end - begin, 4);
    for (int k = begin; k < end; ++k)
    {
      place.row(k - begin) = (path.poses[k].centre + path.poses[k].axes * pivot).transpose();
      Eigen::Vector4d quaternion = Eigen::Quaterniond(path.poses[k].axes).coeffs();
      if (k > begin && quaternion.dot(turn.row(k - begin - 1)) < 0)
      {
        quaternion = -quaternion;
      }
      turn.row(k - begin) = quaternion.transpose();
      errors.push_back(PredictionError(path, {begin, end}, k));
    }
    motions.places.values.push_back(std::move(place));
    motions.turns.values.push_back(std::move(turn));
    motions.data.times.emplace_back(path.times.begin() + begin, path.times.begin() + end);
    motions.data.weights.emplace_back(end - begin, 1.0);
  }
  const double suspect = kSuspect * Median(errors);
  auto error = errors.begin();
  for (auto& weights : motions.data.weights)
  {
    for (double& weight : weights)
    {
      weight = suspect > 0 && *error > suspect ? kSuspectWeight : 1.0;
      ++error;
    }
  }
  return motions;
}

/// Noise and smoothness of both motions, with weights that follow from how far poses lie from the curves. Returns the
/// squared deviation of every pose, in units of the noise.
std::vector<double> EstimateRobustly(const Path& path, Motions& motions)
{
  std::vector<double> deviations(path.times.size(), 0.0);
  for (int round = 0; round < kRobustRounds; ++round)
  {
    motions.ForBoth([&motions](Motion& motion) { Estimate(motion, motions.data); });
    motions.SmoothAll(1);
    for (std::size_t s = 0; s < path.strokes.size(); ++s)
    {
      std::vector<double>& weights = motions.data.weights[s];
      for (std::size_t row = 0; row < weights.size(); ++row)
      {
        const int r = static_cast<int>(row);
        const double deviation = Deviation(motions.places, s, r) + Deviation(motions.turns, s, r);
        const double ratio = deviation > kFullWeight ? kFullWeight / deviation : 1.0;
        weights[row] = std::max(ratio * ratio, kLeastWeight);
        deviations[path.strokes[s].first + r] = deviation;
      }
    }
  }
  return deviations;
}

/// sigma_corner^2 = 3 sigma_p^2 + 2 sigma_R^2 l^2, l^2 the mean square of the corners' distance from the pivot.
void SetNoise(const Path& path, const Motions& motions, const Sweep& sweep, Trajectory& trajectory)
{
  double lever = 0;
  const SlicePlane image = sweep.Plane(0);
  for (int corner = 0; corner < 4; ++corner)
  {
    const Eigen::Vector3d point = image.Point((corner & 1) * (sweep.width - 1.0), (corner >> 1) * (sweep.height - 1.0));
    const Eigen::Vector3d fromCentre = path.poses[0].axes.transpose() * (point - path.poses[0].centre);
    lever += (fromCentre - trajectory.pivot).squaredNorm() / 4;
  }
  const double place = motions.places.noise;
  const double turned = 2 * motions.turns.noise;  // a turn by an angle moves a quaternion by half of it
  trajectory.translationNoise = trajectory.translationLeft = place;
  trajectory.rotationNoise = turned / kRadiansPerDegree;
  trajectory.cornerNoise = std::sqrt(3 * place * place + 2 * turned * turned * lever);
}

/// What is left in smoothed places of noise s^2: the variance s^2 h, h the share that a place keeps of its own record, and
/// s^2 the likeliest of poses about a path of that smoothness. It exceeds the tracker's where the path is smoother than
/// the sweep says.
double TranslationLeft(const Motion& places)
{
  double leverage = 0, squares = 0, count = 0;
  for (const SmoothedCurve& curve : places.curves)
  {
    leverage += curve.leverage.sum();
    squares += curve.squares;
    count += static_cast<double>(curve.leverage.size());
  }
  const double strokes = static_cast<double>(places.curves.size());
  return std::sqrt(squares / (places.freedoms * (count - 2 * strokes)) * leverage / count);
}

/// Moves every pose to the smoothed one.
void PutBack(const Path& path, const Motions& motions, const Sweep& sweep, Trajectory& trajectory)
{
  for (std::size_t s = 0; s < path.strokes.size(); ++s)
  {
    for (int k = path.strokes[s].first; k < path.strokes[s].second; ++k)
    {
      const int row = k - path.strokes[s].first;
      const Eigen::Vector4d quaternion = motions.turns.curves[s].values.row(row).transpose().normalized();
      const Eigen::Matrix3d axes = Eigen::Quaterniond(quaternion).toRotationMatrix();
      const Eigen::Vector3d centre = motions.places.curves[s].values.row(row).transpose() - axes * trajectory.pivot;
      const Eigen::Matrix3d turn = axes * path.poses[k].axes.transpose();
      Eigen::Matrix4d& pose = trajectory.imageToReference[k];
      pose.topLeftCorner<3, 3>() = (turn * pose.topLeftCorner<3, 3>()).eval();
      pose.topRightCorner<3, 1>() = (centre + turn * (pose.topRightCorner<3, 1>() - path.poses[k].centre)).eval();
      trajectory.displacement[k] = CornerDistance(pose, sweep.imageToReference[k], sweep.width, sweep.height);
      trajectory.rotation[k] = std::abs(Eigen::AngleAxisd(turn).angle()) / kRadiansPerDegree;
    }
  }
}

/// The trajectory at a strength above 0. `found` has its noise and outliers, and the recorded poses.
Trajectory Smoothed(const Path& path, Motions& motions, const Sweep& sweep, const Trajectory& found, double strength)
{
  Trajectory smooth = found;
  motions.SmoothAll(strength);
  PutBack(path, motions, sweep, smooth);
  const bool isExact = found.cornerNoise < kLeastNoise * sweep.Plane(0).PixelSize();
  smooth.translationLeft = isExact ? found.translationNoise : TranslationLeft(motions.places);
  for (std::size_t k = 0; isExact && k < found.isOutlier.size(); ++k)
  {
    if (!found.isOutlier[k])
    {
      smooth.imageToReference[k] = sweep.imageToReference[k];
      smooth.displacement[k] = smooth.rotation[k] = 0;
    }
  }
  return smooth;
}

/// Poses as recorded, before anything is known of them but their order and strokes.
Trajectory RecordedTrajectory(const Sweep& sweep, FrameClock clock)
{
  const int n = sweep.NumberOfFrames();
  Trajectory recorded;
  recorded.imageToReference = sweep.imageToReference;
  recorded.displacement.assign(n, 0.0);
  recorded.rotation.assign(n, 0.0);
  recorded.isOutlier.assign(n, 0);
  recorded.stroke.assign(n, 0);
  recorded.clock = clock == FrameClock::Times && HasUsableTimes(sweep) ? FrameClock::Times : FrameClock::Numbers;
  recorded.translationNoise = recorded.translationLeft = recorded.rotationNoise = recorded.cornerNoise = kUnknown;
  return recorded;
}

/// Numbers the strokes of the path and leaves out those too short to be smoothed.
void UseLongStrokes(Path& path, std::vector<int>& stroke)
{
  for (std::size_t s = 0; s < path.strokes.size(); ++s)
  {
    std::fill(stroke.begin() + path.strokes[s].first, stroke.begin() + path.strokes[s].second, static_cast<int>(s));
  }
  path.strokes.erase(std::remove_if(path.strokes.begin(), path.strokes.end(),
                                    [](const auto& s) { return s.second - s.first < kFewestInStroke; }),
                     path.strokes.end());
  for (const auto& [begin, end] : path.strokes)
  {
    path.usable += end - begin;
  }
}

}  // namespace

bool HasUsableTimes(const Sweep& sweep)
{
  const std::vector<double>& times = sweep.timestamps;
  if (times.size() != sweep.imageToReference.size() || times.size() < 2)
  {
    return false;
  }
  std::vector<double> steps;
  for (std::size_t k = 0; k < times.size(); ++k)
  {
    if (!std::isfinite(times[k]) || (k > 0 && !(times[k] > times[k - 1])))
    {
      return false;
    }
    if (k > 0)
    {
      steps.push_back(times[k] - times[k - 1]);
    }
  }
  return *std::max_element(steps.begin(), steps.end()) <= kLongestStep * Median(steps);
}

void TrajectoryOptions::Validate() const
{
  Require(strength >= 0 && strength <= 1000, "Trajectory: the strength is ", strength,
          "; it must lie between 0 and 1000.");
}

bool Trajectory::IsChanged() const
{
  return std::any_of(displacement.begin(), displacement.end(), [](double d) { return d > 0; });
}

double CornerDistance(const Eigen::Matrix4d& a, const Eigen::Matrix4d& b, int width, int height)
{
  const Eigen::Matrix4d difference = a - b;
  double sum = 0;
  for (int corner = 0; corner < 4; ++corner)
  {
    const Eigen::Vector4d pixel((corner & 1) * (width - 1.0), (corner >> 1) * (height - 1.0), 0, 1);
    sum += (difference * pixel).head<3>().norm();
  }
  return sum / 4;
}

struct TrajectorySmoother::State
{
  const Sweep& sweep;
  Trajectory found;  // noise and outliers, at the recorded poses
  Path path;
  std::optional<Motions> motions;  // none where poses are kept whatever the strength
};

TrajectorySmoother::TrajectorySmoother(const Sweep& sweep, FrameClock clock)
    : state_(new State{sweep, RecordedTrajectory(sweep, clock), {}, {}})
{
  const int n = sweep.NumberOfFrames();
  Trajectory& found = state_->found;
  if (n < kFewestToEstimate)
  {
    return;
  }
  Path& path = state_->path;
  path = PathOf(sweep, found.clock);
  UseLongStrokes(path, found.stroke);
  found.isStepped = IsStepped(path, sweep);
  if (found.isStepped)
  {
    found.translationNoise = found.translationLeft = found.rotationNoise = found.cornerNoise = 0;
  }
  if (found.isStepped || path.usable < kFewestToEstimate)
  {
    return;
  }
  found.pivot = PivotOf(path);
  Motions& motions = state_->motions.emplace(MotionsOf(path, found.pivot));
  const std::vector<double> deviations = EstimateRobustly(path, motions);
  SetNoise(path, motions, sweep, found);

  // What strength 1 changes tells outliers, and with exact poses they alone are moved.
  const double pixel = sweep.Plane(0).PixelSize();
  Trajectory one = found;
  PutBack(path, motions, sweep, one);
  for (int k = 0; k < n; ++k)
  {
    found.isOutlier[k] = deviations[k] > kOutlier && one.displacement[k] > kLeastOutlier * pixel;
  }
}

TrajectorySmoother::~TrajectorySmoother() = default;

Trajectory TrajectorySmoother::At(double strength)
{
  TrajectoryOptions{strength, state_->found.clock}.Validate();
  return strength > 0 && state_->motions
             ? Smoothed(state_->path, *state_->motions, state_->sweep, state_->found, strength)
             : state_->found;
}

Trajectory SmoothTrajectory(const Sweep& sweep, const TrajectoryOptions& options)
{
  options.Validate();
  return TrajectorySmoother(sweep, options.clock).At(options.strength);
}

}  // namespace bigus
