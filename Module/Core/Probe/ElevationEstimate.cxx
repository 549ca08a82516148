// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Probe/ElevationEstimate.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/LevenbergMarquardt.h"

// With u, v the intensities (squared envelopes) of two points of fully developed speckle, each of mean 1,
// whose complex echoes have coherence rho, the joint density is e^(-u-v) sum_k x^k L_k(u) L_k(v), x = |rho|^2
// (Kibble 1941; Downton 1970). ln u has the Laguerre coefficients -1/k (k > 0), so
//
//   cov(ln u, ln v) = sum_k x^k / k^2 = Li2(x),   var(ln u) = Li2(1) = pi^2 / 6
//
// and logarithmic compression keeps this ratio whatever its gain. For Gaussian profiles all that moves one
// point against the other multiplies x:
//
//   x = exp(-d^2 / (2 sigma^2) - ex^2 / (2 sx^2) - ey^2 / (2 sy^2) - tilts)
//
// d the distance of the planes, e the offset in the plane, s the in-plane size of speckle (measured within
// frames). A plane turned by an angle about its rows sees another phase of the carrier across the beam's
// thickness: x falls by another factor exp(-(2 k sigma angle)^2 / 2), k the wave number. A turn about its
// columns does so where beams are not along them, a turn in the plane with the lateral size of speckle for
// sigma. k is fitted too.
//
// Everything is a series in k, and each term is Gaussian, so averages have closed forms: over unknown
// misregistration and over the detrending of patches.

namespace bigus
{
namespace
{

// Where no reason is given, a value was chosen, not measured.

// Terms of the series that are summed. The rest of Li2(1) is 1 %; away from x = 1 nothing is left.
constexpr int kTerms = 96;
constexpr double kVarianceOfLog = 1.6449340668482264;  // Li2(1) = pi^2 / 6

// Bins of distance are geometric: the first ends at 0.05 * 1.25 mm, the last at 0.05 * 1.25^30 = 40 mm.
constexpr double kBinRatio = 1.25;
constexpr double kNearestBin = 0.05;  // mm
constexpr int kBins = 30;

// What is compared: a second or two of one core at most.
constexpr std::size_t kMostFrames = 400;  // neighbours must stay neighbours: of a long sweep the middle is taken
constexpr int kStartsPerLag = 200;        // pairs looked at for each difference of frame numbers
constexpr std::size_t kPairsPerBin = 48;  // those least turned against each other
constexpr std::size_t kPatchesPerPair = 400;
constexpr std::size_t kFramesForSpeckle = 24;   // frames in which the size of speckle is measured
constexpr std::size_t kPatchesForShifts = 100;  // patches by which two frames are matched
constexpr int kBlocks = 8;                      // parts of the sweep, left out in turn for the standard error
// cos 15 degrees: planes turned by more share too little for a patch of one to be compared with the other's.
constexpr double kLeastCosine = 0.966;
constexpr double kFarthestShift = 1e6;  // pixels: beyond every image, and still a whole number that an int holds

// Patches.
constexpr double kMaximumBlackShare = 0.02;  // of a patch's pixels: where speckle is darkest, it is clamped
constexpr int kFirstPatch = 16;              // pixels a side, before the size of speckle is known
constexpr int kSpecklesPerSide = 6;          // 36 speckles a patch: detrending takes little, its correction is small
constexpr int kSmallestPatch = 8, kLargestPatch = 32;  // pixels a side
constexpr double kVarianceRatio = 3;                   // of a patch to the median patch, either way: else it is an edge

// The size of speckle, from the first lag at which the correlation is below kHalfLeft, by halving an interval.
constexpr double kHalfLeft = 0.6;                           // the steep part of the curve
constexpr double kSmallestSpeckle = 0.3;                    // pixels: finer speckle has no correlation at lag 1
constexpr double kLargestShare = 0.35;                      // of a patch's side: coarser texture is a trend in it
constexpr double kNearSmallest = 1.1, kNearLargest = 0.95;  // so near to these ends the interval did not hold it
constexpr int kSizeRounds = 4, kHalvings = 14;              // 2^-14 of the interval is 0.001 pixels

// Frames misplaced in their planes.
constexpr int kReach = 3;                   // pixels to each side; a match at the rim is none
constexpr double kLeastCorrelation = 0.25;  // of two frames that are matched: below, a maximum may be chance
// A pose weighs as a deviation ten times that of a step between two frames: 1 / 10^2.
constexpr double kPosePull = 0.01;
constexpr int kShiftSweeps = 200;  // of Gauss-Seidel; that many frames hear of each other
constexpr int kHeightSteps = 10;   // of damped Jacobi, in each of kHeightRounds fits
constexpr int kHeightRounds = 3;
constexpr double kJacobiDamping = 0.5;  // neighbours that both take the whole step overshoot

// What an estimate needs.
constexpr std::size_t kFewestFrames = 4;
constexpr std::size_t kFewestPairs = 6;          // as many as the model has parameters
constexpr std::size_t kFewestPatches = 50;       // lit, for the median of their variances
constexpr std::size_t kFewestPatchesOfCell = 8;  // the ratio of sums is biased by its denominator's noise
constexpr double kLeastBest = 0.1;               // correlation of the nearest planes: below, there is no curve to fit
constexpr double kReachOfCurve = 1.2;    // sigmas: one plane must be nearer and one farther, or only a part is seen
constexpr double kLargestError = 0.15;   // standard error in sigmas
constexpr double kLargestTurning = 0.1;  // sigmas: what the phase of turned planes may change the answer by
constexpr double kOffBound = 0.01;       // a carrier that is nearer to its bound was stopped there

int BinOf(double distance)
{
  return distance <= kNearestBin ? 0 : static_cast<int>(std::log(distance / kNearestBin) / std::log(kBinRatio));
}

// ---- patches ----

/// Sums over one or more pairs of patches, each less its own linear trend.
struct Products
{
  double covariance = 0, varianceA = 0, varianceB = 0;
  std::size_t patches = 0;

  double Variance() const { return 0.5 * (varianceA + varianceB); }
  double Correlation() const { return Variance() > 0 ? covariance / Variance() : 0; }
  void Add(const Products& p)
  {
    covariance += p.covariance;
    varianceA += p.varianceA;
    varianceB += p.varianceB;
    patches += p.patches;
  }
};

class Images
{
public:
  explicit Images(const Sweep& sweep) : sweep_(sweep), unlit_((sweep.width + 1) * (sweep.height + 1ull), 0)
  {
    const std::size_t stride = sweep.width + 1;
    for (int y = 0; y < sweep.height; ++y)
    {
      for (int x = 0; x < sweep.width; ++x)
      {
        unlit_[(y + 1) * stride + x + 1] = unlit_[(y + 1) * stride + x] + unlit_[y * stride + x + 1] -
                                           unlit_[y * stride + x] +
                                           !sweep.IsLit(static_cast<std::size_t>(y) * sweep.width + x);
      }
    }
  }

  /// Whether the patch with this first pixel lies inside the image, all lit.
  bool IsLit(int x, int y, int size) const
  {
    if (x < 0 || y < 0 || x + size > sweep_.width || y + size > sweep_.height)
    {
      return false;
    }
    const std::size_t stride = sweep_.width + 1, top = y * stride + x, bottom = (y + size) * stride + x;
    return unlit_[bottom + size] + unlit_[top] == unlit_[bottom] + unlit_[top + size];
  }

  /// Compares two lit patches. False when one is clamped: it has a white pixel, or too many black ones.
  bool Compare(int frameA, int xa, int ya, int frameB, int xb, int yb, int size, Products& result) const
  {
    return sweep_.pixelType == Sweep::PixelType::UInt8
               ? Compare<std::uint8_t>(frameA, xa, ya, frameB, xb, yb, size, 255, result)
               : Compare<float>(frameA, xa, ya, frameB, xb, yb, size, 1, result);
  }

private:
  template <class Pixel>
  bool Compare(int frameA, int xa, int ya, int frameB, int xb, int yb, int size, Pixel white, Products& result) const
  {
    const auto first = [&](int frame, int x, int y)
    {
      return static_cast<const Pixel*>(sweep_.pixels.get()) + sweep_.PixelsPerFrame() * frame +
             static_cast<std::size_t>(y) * sweep_.width + x;
    };
    const Pixel* a = first(frameA, xa, ya);
    const Pixel* b = first(frameB, xb, yb);
    const double middle = 0.5 * (size - 1);
    double sa = 0, sb = 0, xsa = 0, xsb = 0, ysa = 0, ysb = 0, aa = 0, bb = 0, ab = 0;
    int black = 0, saturated = 0;
    for (int y = 0; y < size; ++y, a += sweep_.width, b += sweep_.width)
    {
      double rowA = 0, rowB = 0;
      for (int x = 0; x < size; ++x)
      {
        const double u = a[x], v = b[x], dx = x - middle;
        black += (a[x] <= 0) + (b[x] <= 0);
        saturated += (a[x] >= white) + (b[x] >= white);
        rowA += u;
        rowB += v;
        xsa += dx * u;
        xsb += dx * v;
        aa += u * u;
        bb += v * v;
        ab += u * v;
      }
      sa += rowA;
      sb += rowB;
      ysa += (y - middle) * rowA;
      ysb += (y - middle) * rowB;
    }
    const double n = static_cast<double>(size) * size, nx = n * (n - 1) / 12;
    if (saturated > 0 || black > kMaximumBlackShare * 2 * n)
    {
      return false;
    }
    const auto detrended = [&](double uv, double u, double v, double xu, double xv, double yu, double yv)
    { return (uv - u * v / n - (xu * xv + yu * yv) / nx) / n; };
    result.covariance = detrended(ab, sa, sb, xsa, xsb, ysa, ysb);
    result.varianceA = detrended(aa, sa, sa, xsa, xsa, ysa, ysa);
    result.varianceB = detrended(bb, sb, sb, xsb, xsb, ysb, ysb);
    result.patches = 1;
    return true;
  }

  const Sweep& sweep_;
  std::vector<std::uint32_t> unlit_;  // [height + 1][width + 1] unlit pixels above and to the left
};

/// First pixels of lit patches, side by side, at most kPatchesPerPair of them.
std::vector<Eigen::Vector2i> PlacePatches(const Sweep& sweep, const Images& images, int size)
{
  std::vector<Eigen::Vector2i> all, some;
  for (int y = 0; y + size <= sweep.height; y += size)
  {
    for (int x = 0; x + size <= sweep.width; x += size)
    {
      if (images.IsLit(x, y, size))
      {
        all.emplace_back(x, y);
      }
    }
  }
  const std::size_t step = (all.size() + kPatchesPerPair - 1) / kPatchesPerPair;
  for (std::size_t p = 0; p < all.size(); p += step)
  {
    some.push_back(all[p]);
  }
  return some;
}

/// Patches that are fully developed speckle all have about the same variance, as compression turns gain into
/// offset; those far off the median are edges or flat.
struct SpeckleRange
{
  double low = -1, high = std::numeric_limits<double>::infinity();

  bool Holds(const Products& p) const
  {
    return p.varianceA > low && p.varianceA < high && p.varianceB > low && p.varianceB < high;
  }
};

// ---- the model ----

/// sum over p, q of b_p b_q exp(-k (p - q + lag)^2 / (2 s^2)) for the unit vectors b proportional to 1 and to
/// p, less its mean: what a trend of that form takes of the k-th term along one axis.
std::pair<double, double> TrendTerms(int size, double k, double s, int lag)
{
  const double n = size, norm = n * (n * n - 1) / 12, middle = 0.5 * (size - 1);
  double constant = 0, linear = 0;
  for (int difference = -(size - 1); difference < size; ++difference)
  {
    double products = 0;
    const int from = std::max(0, difference), to = std::min(size, size + difference);
    for (int p = from; p < to; ++p)
    {
      products += (p - middle) * (p - difference - middle);
    }
    const double e = difference + lag, kernel = std::exp(-0.5 * k * e * e / (s * s));
    constant += (to - from) * kernel;
    linear += products * kernel;
  }
  return {constant / n, linear / norm};
}

/// Share of every term that detrending takes from patches of this size that are `lag` apart.
using TrendShares = std::array<double, kTerms + 1>;
TrendShares MakeTrendShares(int size, const Eigen::Vector2d& speckle, const Eigen::Vector2i& lag)
{
  TrendShares shares{};
  for (int k = 1; k <= kTerms; ++k)
  {
    const auto x = TrendTerms(size, k, speckle.x(), lag.x()), y = TrendTerms(size, k, speckle.y(), lag.y());
    shares[k] = (x.first * y.first + x.second * y.first + x.first * y.second) / (static_cast<double>(size) * size);
  }
  return shares;
}

double DetrendedVariance(const TrendShares& shares)
{
  double variance = kVarianceOfLog;
  for (int k = 1; k <= kTerms; ++k)
  {
    variance -= shares[k] / (k * k);
  }
  return variance;
}

/// Correlation of detrended patches of one frame that are `lag` pixels apart.
double CorrelationWithin(int size, const Eigen::Vector2d& speckle, const Eigen::Vector2i& lag)
{
  const TrendShares shares = MakeTrendShares(size, speckle, lag);
  const double exponent = 0.5 * (lag.cast<double>().array() / speckle.array()).square().sum();
  double sum = 0;
  for (int k = 1; k <= kTerms; ++k)
  {
    sum += (std::exp(-k * exponent) - shares[k]) / (k * k);
  }
  return sum / DetrendedVariance(MakeTrendShares(size, speckle, {0, 0}));
}

/// Patches of a pair of frames at about one distance.
struct Cell
{
  int block = 0;
  int a = 0, b = 0;                                       // which frames
  double distance = 0;                                    // mm, mean, signed
  double squaredDistance = 0;                             // mm^2, mean
  Eigen::Array3d squaredTurn = Eigen::Array3d::Zero();    // rad^2, about the axes of rows, columns and normal
  Eigen::Array2d offset = Eigen::Array2d::Zero();         // pixels, mean: of the point from the nearest pixel
  Eigen::Array2d squaredOffset = Eigen::Array2d::Zero();  // pixels^2, mean: the nearest pixel is not the very point
  Products products;
};

enum Parameter
{
  Falloff,    // 1 / (2 (sigma^2 + jitter)), 1 / mm^2
  Carrier,    // (2 k)^2 / 2, k the wave number, 1 / mm^2
  Sideways,   // mean squared sine of the beams' angle to the columns: 0 for a linear probe
  Rotation,   // share of the phase that a turn in the plane adds
  Jitter,     // variance of the misplacement of two planes on each axis, mm^2
  Amplitude,  // correlation of a plane with itself, below 1 when images have noise of their own
  Parameters
};
using Vector = Eigen::Matrix<double, Parameters, 1>;
using Matrix = Eigen::Matrix<double, Parameters, Parameters>;

class Model
{
public:
  Model(int size, const Eigen::Vector2d& speckle, const Eigen::Vector2d& pixel)
      : speckle_(speckle),
        pixel_(pixel),
        shares_(MakeTrendShares(size, speckle, {0, 0})),
        variance_(DetrendedVariance(shares_))
  {
    // Where a sweep turns as it advances, turns and distances cannot be told apart: what turns may do is
    // bounded by physics. Diagnostic ultrasound has 2 to 20 MHz, k = 2 pi frequency / 1.54 mm/us; fans reach
    // 45 degrees.
    const auto carrier = [](double frequency) { return 0.5 * std::pow(4 * kPi * frequency / 1.54, 2); };
    low_ << 0.5 / (100 * 100), carrier(2), 0, 0, 0, 0.05;
    high_ << 0.5 / (0.01 * 0.01), carrier(20), 0.25, 1, speckle.cwiseProduct(pixel).squaredNorm(), 1;
  }

  const Vector& Low() const { return low_; }
  const Vector& High() const { return high_; }

  /// The correlation expected of a cell, and its derivatives.
  double operator()(const Cell& cell, const Vector& p, Vector& derivative, double* bySquaredDistance = nullptr) const
  {
    const double thickness = 0.5 / p[Falloff];  // mm^2
    const double sideways = pixel_.x() * pixel_.x() * speckle_.x() * speckle_.x();
    const double byColumn = thickness * cell.squaredTurn[1], byNormal = sideways * cell.squaredTurn[2];
    const double phase = thickness * cell.squaredTurn[0] + p[Sideways] * byColumn + p[Rotation] * byNormal;  // mm^2
    const double exponent = p[Falloff] * cell.squaredDistance + p[Carrier] * phase;
    // A Gaussian offset of variance v (in units of s^2) turns the k-th term into (1 + k v)^(-1/2).
    const Eigen::Array3d slope(1 / (pixel_.x() * pixel_.x() * speckle_.x() * speckle_.x()),
                               1 / (pixel_.y() * pixel_.y() * speckle_.y() * speckle_.y()), 2 * p[Falloff]);
    Eigen::Array3d offset = slope * p[Jitter];
    offset[0] += cell.squaredOffset[0] / (speckle_.x() * speckle_.x());
    offset[1] += cell.squaredOffset[1] / (speckle_.y() * speckle_.y());

    const double x = std::exp(-exponent);
    double power = 1, sum = 0, byExponent = 0, byJitter = 0, byFalloff = 0;
    for (int k = 1; k <= kTerms; ++k)
    {
      power *= x;
      if (power < 1e-7 * k)
      {
        break;
      }
      const Eigen::Array3d blur = 1 + k * offset;
      const double weight = power / (k * k), kept = weight / std::sqrt(blur.prod());
      const double term = kept - weight * shares_[k];
      sum += term;
      byExponent -= k * term;
      byJitter -= 0.5 * k * kept * (slope / blur).sum();
      byFalloff -= k * kept * p[Jitter] / blur[2];
    }
    const double scale = p[Amplitude] / variance_;
    const double tilted = p[Carrier] * thickness * (cell.squaredTurn[0] + p[Sideways] * cell.squaredTurn[1]);
    derivative[Falloff] = scale * (byExponent * (cell.squaredDistance - tilted / p[Falloff]) + byFalloff);
    if (bySquaredDistance)
    {
      *bySquaredDistance = scale * byExponent * p[Falloff];
    }
    derivative[Carrier] = scale * byExponent * phase;
    derivative[Sideways] = scale * byExponent * p[Carrier] * byColumn;
    derivative[Rotation] = scale * byExponent * p[Carrier] * byNormal;
    derivative[Jitter] = scale * byJitter;
    derivative[Amplitude] = sum / variance_;
    return scale * sum;
  }

private:
  Eigen::Vector2d speckle_, pixel_;  // in-plane size of speckle in pixels, pixel in mm
  TrendShares shares_;
  double variance_;
  Vector low_, high_;  // bounds of the parameters
};

// ---- the fit ----

struct Fit
{
  Vector parameters = Vector::Zero();
  double cost = std::numeric_limits<double>::infinity();

  double Sigma() const { return std::sqrt(std::max(0.5 / parameters[Falloff] - parameters[Jitter], 0.0)); }
};

/// Least squares over the cells outside one block, each weighing its number of patches, inside the bounds.
class FitProblem
{
public:
  FitProblem(const std::vector<Cell>& cells, const Model& model, const Vector& low, const Vector& high, int leftOut)
      : cells_(cells), model_(model), low_(low), high_(high), leftOut_(leftOut)
  {
  }

  Vector Bounded(const Vector& p) const { return p.cwiseMax(low_).cwiseMin(high_); }

  Fit Evaluate(const Vector& p) const
  {
    Fit fit;
    fit.parameters = p;
    fit.cost = 0;
    ForEachResidual(p,
                    [&](double weight, double residual, const Vector&) { fit.cost += weight * residual * residual; });
    return fit;
  }

  std::pair<Matrix, Vector> Linearise(const Vector& p, const Fit&) const
  {
    Matrix hessian = Matrix::Zero();
    Vector gradient = Vector::Zero();
    ForEachResidual(p,
                    [&](double weight, double residual, const Vector& derivative)
                    {
                      hessian += weight * derivative * derivative.transpose();
                      gradient += weight * residual * derivative;
                    });
    // Parameters that a bound stops, and those that nothing depends on, stay.
    for (int k = 0; k < Parameters; ++k)
    {
      const bool atLow = p[k] <= low_[k] && gradient[k] > 0;
      const bool atHigh = p[k] >= high_[k] && gradient[k] < 0;
      if (atLow || atHigh || !(hessian(k, k) > 0))
      {
        hessian.row(k).setZero();
        hessian.col(k).setZero();
        hessian(k, k) = 1;
        gradient[k] = 0;
      }
    }
    return {hessian, gradient};
  }

  bool IsConverged(const Vector& /*from*/, const Vector& /*to*/, double costFrom, double costTo) const
  {
    return std::abs(costFrom - costTo) < 1e-9 * costFrom;
  }

private:
  template <class Visit>
  void ForEachResidual(const Vector& p, Visit&& visit) const
  {
    Vector derivative;
    for (const Cell& cell : cells_)
    {
      if (cell.block != leftOut_)
      {
        const double residual = model_(cell, p, derivative) - cell.products.Correlation();
        visit(static_cast<double>(cell.products.patches), residual, derivative);
      }
    }
  }

  const std::vector<Cell>& cells_;
  const Model& model_;
  const Vector &low_, &high_;
  int leftOut_;
};

Fit Descend(const std::vector<Cell>& cells, const Model& model, const Vector& low, const Vector& high,
            const Vector& start, int leftOut)
{
  const FitProblem problem(cells, model, low, high, leftOut);
  LevenbergMarquardtOptions descent;
  descent.attempts = 12;  // up to a damping of 1e8 and more
  Vector parameters = start;
  Fit fit = problem.Evaluate(start);
  MinimiseByLevenbergMarquardt(problem, descent, parameters, fit);
  return fit;
}

// ---- geometry ----

/// How plane B lies before plane A, seen along the mean of their normals.
struct Relation
{
  Eigen::Vector2d origin;      // pixel of B that A's pixel (0, 0) falls on
  Eigen::Matrix2d map;         // pixels of B a pixel of A
  double distance;             // mm at A's pixel (0, 0)
  Eigen::Vector2d slope;       // mm a pixel of A
  Eigen::Array3d squaredTurn;  // rad^2
  bool valid = false;          // turned by less than 15 degrees

  Relation(const SlicePlane& a, const SlicePlane& b)
  {
    const Eigen::Vector3d na = a.Normal(), nb = b.Normal(), normal = (na + nb).normalized();
    const Eigen::Vector3d row = a.columnStep.normalized(), column = na.cross(row);
    const Eigen::Vector3d turnedRow = b.columnStep.normalized();
    const double aboutColumn = nb.dot(row), aboutRow = nb.dot(column), aboutNormal = turnedRow.dot(column);
    squaredTurn = Eigen::Array3d(aboutRow, aboutColumn, aboutNormal).square();
    valid = na.dot(nb) > kLeastCosine && turnedRow.dot(row) > kLeastCosine;
    if (!valid)
    {
      return;
    }
    const Eigen::Matrix3d toB = b.WorldToSlice();
    const auto meet = [&](double i, double j)
    {
      const Eigen::Vector3d point = a.Point(i, j);
      const double along = nb.dot(b.origin - point) / nb.dot(normal);
      const Eigen::Vector3d pixel = toB * (point + along * normal - b.origin);
      return Eigen::Vector3d(pixel.x(), pixel.y(), along);
    };
    const Eigen::Vector3d p = meet(0, 0), pi = meet(1, 0) - p, pj = meet(0, 1) - p;
    origin = p.head<2>();
    map << pi.head<2>(), pj.head<2>();
    distance = p.z();
    slope = {pi.z(), pj.z()};
  }

  double DistanceAt(const Eigen::Vector2d& pixel) const { return distance + slope.dot(pixel); }
};

struct Pair
{
  int a, b;  // positions in the list of frames
  int block;
  double turn;  // rad^2
};

/// Pairs of frames, near and far: for each bin of distance (at the image's centre) those least turned.
std::vector<Pair> ChoosePairs(const Sweep& sweep, const std::vector<int>& frames)
{
  const int n = static_cast<int>(frames.size());
  const Eigen::Vector2d centre(0.5 * (sweep.width - 1), 0.5 * (sweep.height - 1));
  std::vector<std::vector<Pair>> bins(kBins);
  for (int lag = 1; lag < n; lag = std::max(lag + 1, lag * 6 / 5))
  {
    const int step = (n - lag + kStartsPerLag - 1) / kStartsPerLag;
    for (int k = 0; k + lag < n; k += step)
    {
      const Relation relation(sweep.Plane(frames[k]), sweep.Plane(frames[k + lag]));
      const int bin = relation.valid ? BinOf(std::abs(relation.DistanceAt(centre))) : kBins;
      if (bin < kBins)
      {
        bins[bin].push_back(
            {k, k + lag, static_cast<int>((2ll * k + lag) * kBlocks / (2 * n)), relation.squaredTurn.sum()});
      }
    }
  }
  std::vector<Pair> pairs;
  for (std::vector<Pair>& bin : bins)
  {
    std::stable_sort(bin.begin(), bin.end(), [](const Pair& p, const Pair& q) { return p.turn < q.turn; });
    bin.resize(std::min(bin.size(), kPairsPerBin));
    pairs.insert(pairs.end(), bin.begin(), bin.end());
  }
  return pairs;
}

// ---- speckle within frames ----

struct Speckle
{
  SpeckleRange range;
  Eigen::Vector2d size = Eigen::Vector2d::Zero();  // pixels, see x above
  std::string problem;
};

/// Compares patches with their surroundings, in some of the frames.
struct PatchSamples
{
  const Images& images;
  const std::vector<int>& frames;
  const std::vector<Eigen::Vector2i> patches;
  const int size;

  /// What is left of the correlation at a lag (pixels). `variances` gets those of all patches, where it is given.
  double Correlation(const Eigen::Vector2i& lag, const SpeckleRange& range,
                     std::vector<double>* variances = nullptr) const
  {
    const std::size_t step = (frames.size() + kFramesForSpeckle - 1) / kFramesForSpeckle;
    Products sum;
    for (std::size_t k = 0; k < frames.size(); k += step)
    {
      for (const Eigen::Vector2i& p : patches)
      {
        Products products;
        const Eigen::Vector2i q = p + lag;
        if (images.IsLit(q.x(), q.y(), size) &&
            images.Compare(frames[k], p.x(), p.y(), frames[k], q.x(), q.y(), size, products) && range.Holds(products))
        {
          sum.Add(products);
          if (variances)
          {
            variances->push_back(products.varianceA);
          }
        }
      }
    }
    return sum.Correlation();
  }
};

/// The range of variances around the median of those that are not flat, or a problem.
Speckle FindRange(const PatchSamples& samples, double greyLevel)
{
  Speckle speckle;
  std::vector<double> variances;
  samples.Correlation({0, 0}, {}, &variances);
  if (variances.size() < kFewestPatches)
  {
    const std::string size = std::to_string(samples.size);
    speckle.problem = "only " + std::to_string(variances.size()) + " patches of " + size + " x " + size +
                      " pixels are lit and neither black nor white";
    return speckle;
  }
  const auto flat =
      std::partition(variances.begin(), variances.end(), [&](double v) { return v > greyLevel * greyLevel; });
  if (2 * (flat - variances.begin()) < variances.end() - variances.begin())
  {
    speckle.problem = "the images have no speckle (most patches vary by less than one grey level)";
    return speckle;
  }
  const auto middle = variances.begin() + (flat - variances.begin()) / 2;
  std::nth_element(variances.begin(), middle, flat);
  const double median = *middle;
  speckle.range = {median / kVarianceRatio, median * kVarianceRatio};
  return speckle;
}

/// On each axis the size that explains what is left at the first lag at which that is less than kHalfLeft.
Eigen::Vector2d SizeOfSpeckle(const PatchSamples& samples, const SpeckleRange& range, double largest)
{
  std::array<Eigen::Vector2i, 2> lags;
  std::array<double, 2> left;
  for (int axis = 0; axis < 2; ++axis)
  {
    for (int lag = 1; lag <= samples.size / 2; ++lag)
    {
      lags[axis] = lag * Eigen::Vector2i::Unit(axis);
      left[axis] = samples.Correlation(lags[axis], range);
      if (left[axis] < kHalfLeft)
      {
        break;
      }
    }
  }
  Eigen::Vector2d size(1, 1);
  for (int round = 0; round < kSizeRounds; ++round)
  {
    for (int axis = 0; axis < 2; ++axis)
    {
      double low = kSmallestSpeckle, high = largest;
      for (int halving = 0; halving < kHalvings; ++halving)
      {
        size[axis] = 0.5 * (low + high);
        (CorrelationWithin(samples.size, size, lags[axis]) < left[axis] ? low : high) = size[axis];
      }
    }
  }
  return size;
}

Speckle MeasureSpeckle(const Sweep& sweep, const Images& images, const std::vector<int>& frames, int size)
{
  const PatchSamples samples{images, frames, PlacePatches(sweep, images, size), size};
  Speckle speckle = FindRange(samples, sweep.pixelType == Sweep::PixelType::UInt8 ? 1 : 1 / 255.0);
  if (!speckle.problem.empty())
  {
    return speckle;
  }
  const double largest = kLargestShare * size;
  speckle.size = SizeOfSpeckle(samples, speckle.range, largest);
  const bool isTooFine = speckle.size.minCoeff() < kNearSmallest * kSmallestSpeckle;
  if (isTooFine || speckle.size.maxCoeff() > kNearLargest * largest)
  {
    speckle.problem = std::string("texture is ") + (isTooFine ? "finer than a pixel" : "too coarse to be speckle");
  }
  return speckle;
}

/// Compares a pair's patches, each with the nearest whole-pixel patch of the other plane.
/// `moved` pixels farther than the poses say.
std::vector<Cell> ComparePair(const Sweep& sweep, const Images& images, int a, int b, const Eigen::Vector2d& moved,
                              const std::vector<Eigen::Vector2i>& patches, int size, const SpeckleRange& range)
{
  const Relation relation(sweep.Plane(a), sweep.Plane(b));
  const double spread = (static_cast<double>(size) * size - 1) / 12;  // pixels^2, of a patch along an axis
  const Eigen::Matrix2d drift = relation.map - Eigen::Matrix2d::Identity();
  std::vector<Cell> cells(2 * kBins);
  for (const Eigen::Vector2i& patch : patches)
  {
    const Eigen::Vector2d centre = patch.cast<double>().array() + 0.5 * (size - 1);
    const Eigen::Vector2d shift = relation.origin + relation.map * centre - centre + moved;
    if (!(shift.cwiseAbs().maxCoeff() < kFarthestShift))
    {
      continue;
    }
    const Eigen::Vector2d whole(std::floor(shift.x() + 0.5), std::floor(shift.y() + 0.5));
    const Eigen::Vector2i other = patch + whole.cast<int>();
    const double distance = relation.DistanceAt(centre);
    const double squaredDistance = distance * distance + spread * relation.slope.squaredNorm();
    const int bin = BinOf(std::sqrt(squaredDistance));
    Products products;
    if (bin >= kBins || !images.IsLit(other.x(), other.y(), size) ||
        !images.Compare(a, patch.x(), patch.y(), b, other.x(), other.y(), size, products) || !range.Holds(products))
    {
      continue;
    }
    Cell& cell = cells[distance < 0 ? kBins + bin : bin];
    cell.distance += distance;
    cell.squaredDistance += squaredDistance;
    cell.offset += (shift - whole).array();
    cell.squaredOffset += (shift - whole).array().square() + spread * drift.rowwise().squaredNorm().array();
    cell.products.Add(products);
  }
  std::vector<Cell> filled;
  for (Cell& cell : cells)
  {
    if (cell.products.patches >= kFewestPatchesOfCell)
    {
      cell.squaredTurn = relation.squaredTurn;
      cell.distance /= cell.products.patches;
      cell.squaredDistance /= cell.products.patches;
      cell.offset /= cell.products.patches;
      cell.squaredOffset /= cell.products.patches;
      filled.push_back(cell);
    }
  }
  return filled;
}

// ---- misplaced frames ----

/// Pixels that a frame lies beside its pose, from the frame that it is matched with; empty where speckle does not tell.
using Step = std::optional<Eigen::Vector2d>;

/// `correlation(x, y)` of two frames moved by whole pixels, climbed from (0, 0); then the vertex of parabolas through the
/// highest and its neighbours.
template <class Correlation>
Step Climb(Correlation&& correlation)
{
  int x = 0, y = 0;
  for (bool climbing = true; climbing;)
  {
    climbing = false;
    for (const auto& [dx, dy] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}})
    {
      if (std::abs(x + dx) <= kReach && std::abs(y + dy) <= kReach && correlation(x + dx, y + dy) > correlation(x, y))
      {
        x += dx;
        y += dy;
        climbing = true;
      }
    }
  }
  if (correlation(x, y) < kLeastCorrelation || std::abs(x) == kReach || std::abs(y) == kReach)
  {
    return {};
  }
  const auto vertex = [&](double low, double middle, double high)
  { return 0.5 * (low - high) / (low - 2 * middle + high); };
  const Eigen::Vector2d sub(vertex(correlation(x - 1, y), correlation(x, y), correlation(x + 1, y)),
                            vertex(correlation(x, y - 1), correlation(x, y), correlation(x, y + 1)));
  if (!(sub.allFinite() && sub.cwiseAbs().maxCoeff() <= 0.5))
  {
    return {};
  }
  return Step(Eigen::Vector2d(x, y) + sub);
}

/// How far frame b lies from where its pose says, seen from frame a.
Step StepBetween(const Sweep& sweep, const Images& images, int a, int b, const std::vector<Eigen::Vector2i>& patches,
                 int size, const Speckle& speckle)
{
  if (!Relation(sweep.Plane(a), sweep.Plane(b)).valid)
  {
    return {};
  }
  Eigen::Vector2d rounded = Eigen::Vector2d::Zero();  // what comparing whole pixels left out
  std::array<double, (2 * kReach + 1) * (2 * kReach + 1)> known;
  known.fill(2);
  const Step step = Climb(
      [&](int x, int y)
      {
        double& c = known[(y + kReach) * (2 * kReach + 1) + x + kReach];
        if (c == 2)
        {
          Products sum;
          for (const Cell& cell : ComparePair(sweep, images, a, b, {x, y}, patches, size, speckle.range))
          {
            sum.Add(cell.products);
            rounded = cell.offset;
          }
          c = sum.Correlation();
        }
        return c;
      });
  return step ? Step(*step - rounded) : step;
}

/// Shifts on which the steps to the next frame and the one after ([2 frames], each weighs 1) and the poses (kPosePull, at 0)
/// agree best: Gauss-Seidel.
std::vector<Eigen::Vector2d> AddUp(const std::vector<Step>& steps)
{
  const std::size_t n = steps.size() / 2;
  std::vector<Eigen::Vector2d> shifts(n, Eigen::Vector2d::Zero());
  for (int round = 0; round < kShiftSweeps; ++round)
  {
    for (std::size_t k = 0; k < n; ++k)
    {
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      double weight = kPosePull;
      for (std::size_t lag = 1; lag <= 2; ++lag)
      {
        if (k + lag < n && steps[2 * k + lag - 1])
        {
          sum += shifts[k + lag] - *steps[2 * k + lag - 1];
          weight += 1;
        }
        if (k >= lag && steps[2 * (k - lag) + lag - 1])
        {
          sum += shifts[k - lag] + *steps[2 * (k - lag) + lag - 1];
          weight += 1;
        }
      }
      shifts[k] = sum / weight;
    }
  }
  return shifts;
}

/// Where speckle says frames lie in their planes, pixels beside their poses, one a frame: neighbours are
/// matched, and the steps between them add up, pulled to the poses.
std::vector<Eigen::Vector2d> MeasureShifts(const Sweep& sweep, const Images& images, const std::vector<int>& frames,
                                           const std::vector<Eigen::Vector2i>& patches, int size,
                                           const Speckle& speckle)
{
  std::vector<Eigen::Vector2i> some;
  for (std::size_t p = 0; p < patches.size(); p += (patches.size() + kPatchesForShifts - 1) / kPatchesForShifts)
  {
    some.push_back(patches[p]);
  }
  std::vector<Step> steps(2 * frames.size());
  tbb::parallel_for(std::size_t(0), steps.size(),
                    [&](std::size_t k)
                    {
                      const std::size_t a = k / 2, b = a + 1 + k % 2;
                      if (b < frames.size())
                      {
                        steps[k] = StepBetween(sweep, images, frames[a], frames[b], some, size, speckle);
                      }
                    });
  return AddUp(steps);
}

/// The cells as they are when frames lie `heights` mm before their poses.
std::vector<Cell> Raised(std::vector<Cell> cells, const std::vector<double>& heights)
{
  for (Cell& cell : cells)
  {
    const double more = heights[cell.b] - heights[cell.a];
    cell.squaredDistance += (2 * cell.distance + more) * more;
    cell.distance += more;
  }
  return cells;
}

/// The same across the planes, from how well the model fits each frame's pairs. A frame's height is as
/// uncertain beforehand as its place in the plane, of deviation `misplacement`; that keeps the sweep's
/// length. Damped Jacobi steps.
void MeasureHeights(const std::vector<Cell>& cells, const Model& model, const Fit& fit, double misplacement,
                    std::vector<double>& heights)
{
  const double variance = fit.cost / cells.size();  // of a patch's correlation
  const double prior = variance / (misplacement * misplacement);
  Vector unused;
  for (int step = 0; step < kHeightSteps; ++step)
  {
    std::vector<double> gradient(heights.size(), 0.0), curvature(heights.size(), prior);
    for (const Cell& cell : Raised(cells, heights))
    {
      double slope = 0;
      const double residual = cell.products.Correlation() - model(cell, fit.parameters, unused, &slope);
      slope *= 2 * cell.distance;
      const double weight = static_cast<double>(cell.products.patches);
      gradient[cell.b] += weight * residual * slope;
      gradient[cell.a] -= weight * residual * slope;
      curvature[cell.a] += weight * slope * slope;
      curvature[cell.b] += weight * slope * slope;
    }
    for (std::size_t k = 0; k < heights.size(); ++k)
    {
      heights[k] += kJacobiDamping * (gradient[k] - prior * heights[k]) / curvature[k];
    }
  }
}

// ---- the steps of an estimate ----

/// The frames that are used. Throws Error for one that is not there.
std::vector<int> ChooseFrames(const Sweep& sweep, const std::vector<int>& given)
{
  for (const int frame : given)
  {
    Require(frame >= 0 && frame < sweep.NumberOfFrames(), "Elevation estimate: frame ", frame,
            " was asked for, but the frames are 0 to ", sweep.NumberOfFrames() - 1, ".");
  }
  const std::size_t left = given.size() > kMostFrames ? (given.size() - kMostFrames) / 2 : 0;
  return {given.begin() + left, given.end() - left};
}

/// Speckle in patches of `size` pixels a side, which is set to what fits it.
Speckle MeasureSpeckleInFittingPatches(const Sweep& sweep, const Images& images, const std::vector<int>& frames,
                                       int& size)
{
  size = kFirstPatch;
  const Speckle speckle = MeasureSpeckle(sweep, images, frames, size);
  if (!speckle.problem.empty())
  {
    return speckle;
  }
  const int fitting = std::clamp(static_cast<int>(std::lround(kSpecklesPerSide * std::sqrt(speckle.size.prod()))),
                                 kSmallestPatch, kLargestPatch);
  if (fitting == size)
  {
    return speckle;
  }
  size = fitting;
  return MeasureSpeckle(sweep, images, frames, size);
}

/// What is known of the frames before the beam is fitted.
struct Compared
{
  std::vector<Cell> cells;
  std::size_t pairs = 0;  // that have any cell
  double misplacement =
      0;  // mm, root mean square on an axis: how far speckle puts frames beside their poses, in the plane
};

Compared CompareFrames(const Sweep& sweep, const Images& images, const std::vector<int>& frames, int size,
                       const Speckle& speckle)
{
  const std::vector<Pair> pairs = ChoosePairs(sweep, frames);
  const std::vector<Eigen::Vector2i> patches = PlacePatches(sweep, images, size);
  const std::vector<Eigen::Vector2d> shifts = MeasureShifts(sweep, images, frames, patches, size, speckle);
  std::vector<std::vector<Cell>> byPair(pairs.size());
  tbb::parallel_for(std::size_t(0), pairs.size(),
                    [&](std::size_t p)
                    {
                      const Pair& pair = pairs[p];
                      byPair[p] = ComparePair(sweep, images, frames[pair.a], frames[pair.b],
                                              shifts[pair.b] - shifts[pair.a], patches, size, speckle.range);
                      for (Cell& cell : byPair[p])
                      {
                        cell.block = pair.block;
                        cell.a = pair.a;
                        cell.b = pair.b;
                      }
                    });
  Compared out;
  for (const std::vector<Cell>& of : byPair)
  {
    out.cells.insert(out.cells.end(), of.begin(), of.end());
    out.pairs += !of.empty();
  }
  const SlicePlane plane = sweep.Plane(frames[0]);
  const Eigen::Array2d pixel(plane.columnStep.norm(), plane.rowStep.norm());
  for (const Eigen::Vector2d& shift : shifts)
  {
    out.misplacement += 0.5 * (shift.array() * pixel).square().sum() / shifts.size();
  }
  out.misplacement = std::sqrt(out.misplacement);
  return out;
}

/// The best of fits from beams of four thicknesses, at the poses as they are.
Fit FitAsPosed(const std::vector<Cell>& cells, const Model& model)
{
  Fit fit;
  for (const double sigma : {0.2, 0.8, 3.2, 12.8})  // mm
  {
    Vector start;  // beside sigma a small turn of the phase and little misplacement: chosen, as bounds are far apart
    start << 0.5 / (sigma * sigma), 2 * model.Low()[Carrier], 0.05, 0.5, 0.01 * model.High()[Jitter], 0.9;
    const Fit other = Descend(cells, model, model.Low(), model.High(), start, -1);
    fit = other.cost < fit.cost ? other : fit;
  }
  return fit;
}

/// Puts the curve that was measured and the one that was fitted into `result`.
void DrawCurve(const std::vector<Cell>& cells, const Model& model, const Fit& fit, ElevationEstimate& result)
{
  struct Point
  {
    double patches = 0, squaredDistance = 0, fitted = 0;
    Products products;
  };
  std::vector<Point> curve(kBins);
  Vector unused;
  for (const Cell& cell : cells)
  {
    const double n = static_cast<double>(cell.products.patches);
    // Raising a frame may carry a cell beyond the last bin.
    Point& point = curve[std::min(BinOf(std::sqrt(std::max(cell.squaredDistance, 0.0))), kBins - 1)];
    point.patches += n;
    point.squaredDistance += n * cell.squaredDistance;
    point.fitted += n * model(cell, fit.parameters, unused);
    point.products.Add(cell.products);
  }
  for (const Point& point : curve)
  {
    if (point.patches > 0)
    {
      result.distance.push_back(std::sqrt(point.squaredDistance / point.patches));
      result.correlation.push_back(point.products.Correlation());
      result.fitted.push_back(point.fitted / point.patches);
    }
  }
}

/// By leaving out a block at a time. It is of the fit that takes poses as they are, which is blind to what the
/// misplacements, fitted to all, may have taken up. `otherwise` where there is but one block.
double StandardError(const std::vector<Cell>& posed, const Model& model, const Fit& fit, double otherwise)
{
  double scatter = 0;
  int parts = 0;
  std::array<double, kBlocks> without;
  for (int block = 0; block < kBlocks; ++block)
  {
    if (std::any_of(posed.begin(), posed.end(), [&](const Cell& cell) { return cell.block == block; }))
    {
      without[parts++] = Descend(posed, model, model.Low(), model.High(), fit.parameters, block).Sigma();
    }
  }
  const double mean = std::accumulate(without.begin(), without.begin() + parts, 0.0) / parts;
  for (int part = 0; part < parts; ++part)
  {
    scatter += (without[part] - mean) * (without[part] - mean);
  }
  return parts > 1 ? std::sqrt(scatter * (parts - 1) / parts) : otherwise;
}

/// What sigma would be if turning changed no phase. Far from the fit, the fit is a guess unless the data tell the carrier.
double SigmaWithoutTurning(const std::vector<Cell>& cells, const Model& model, const Fit& fit)
{
  const bool carrierKnown = fit.parameters[Carrier] > (1 + kOffBound) * model.Low()[Carrier] &&
                            fit.parameters[Carrier] < (1 - kOffBound) * model.High()[Carrier];
  if (carrierKnown)
  {
    return fit.Sigma();
  }
  Vector low = model.Low(), high = model.High(), start = fit.parameters;
  low[Carrier] = high[Carrier] = start[Carrier] = 0;
  return Descend(cells, model, low, high, start, -1).Sigma();
}

/// What is wrong with an estimate; empty: nothing. Without a plane nearer than sigma the fit would rest on the tail
/// alone; without one farther, on a top that noise and misregistration flatten too.
std::string WhyUnreliable(const ElevationEstimate& estimate, double withoutTurning)
{
  const auto text = [](double mm) { return std::to_string(mm).substr(0, 5) + " mm"; };
  const double sigma = estimate.sigma;
  const double best = *std::max_element(estimate.fitted.begin(), estimate.fitted.end());
  if (best < kLeastBest)
  {
    return "planes are too far apart or differ too much: correlation is at most " + std::to_string(best).substr(0, 5);
  }
  if (estimate.distance.front() > kReachOfCurve * sigma)
  {
    return "planes are too far apart: the nearest are " + text(estimate.distance.front()) + ", the fit says " +
           text(sigma);
  }
  if (estimate.distance.back() < kReachOfCurve * sigma)
  {
    return "planes are too near: speckle is still alike at " + text(estimate.distance.back());
  }
  if (!(estimate.standardError < kLargestError * sigma))
  {
    return "parts of the sweep disagree: standard error " + text(estimate.standardError) + " of " + text(sigma);
  }
  if (std::abs(withoutTurning - sigma) > kLargestTurning * sigma)
  {
    return "the probe turns as it advances, and what turning does cannot be told apart: " + text(withoutTurning) +
           " if it does nothing, " + text(sigma) + " if it shifts the phase of the echoes";
  }
  return "";
}

}  // namespace

ElevationEstimate EstimateElevationSigma(const Sweep& sweep, const std::vector<int>& given)
{
  const std::vector<int> frames = ChooseFrames(sweep, given);
  ElevationEstimate result;
  if (frames.size() < kFewestFrames)
  {
    result.reason = "there are only " + std::to_string(frames.size()) + " frames";
    return result;
  }
  const Images images(sweep);
  int size = 0;
  const Speckle speckle = MeasureSpeckleInFittingPatches(sweep, images, frames, size);
  if (!speckle.problem.empty())
  {
    result.reason = speckle.problem;
    return result;
  }
  const Compared compared = CompareFrames(sweep, images, frames, size, speckle);
  result.pairs = compared.pairs;
  if (result.pairs < kFewestPairs)
  {
    result.reason = "only " + std::to_string(result.pairs) + " pairs of frames overlap, nearly parallel";
    return result;
  }

  const SlicePlane plane = sweep.Plane(frames[0]);
  const Model model(size, speckle.size, {plane.columnStep.norm(), plane.rowStep.norm()});
  const Fit posedFit = FitAsPosed(compared.cells, model);
  std::vector<Cell> cells = compared.cells;
  Fit fit = posedFit;
  std::vector<double> heights(frames.size(), 0.0);
  for (int round = 0; round < kHeightRounds && compared.misplacement > 0 && fit.cost > 0; ++round)
  {
    MeasureHeights(compared.cells, model, fit, compared.misplacement, heights);
    cells = Raised(compared.cells, heights);
    fit = Descend(cells, model, model.Low(), model.High(), fit.parameters, -1);
  }
  result.sigma = fit.Sigma();
  DrawCurve(cells, model, fit, result);
  result.standardError = StandardError(compared.cells, model, posedFit, result.sigma);
  result.reason = WhyUnreliable(result, SigmaWithoutTurning(cells, model, fit));
  result.reliable = result.reason.empty();
  return result;
}

}  // namespace bigus
