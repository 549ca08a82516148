// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/FrameInterpolation.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"
#include "Core/Model/Sequences.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr int kBands = 4;             // octaves; what is below them is the same in all frames
constexpr double kFirstBlur = 0.8;    // pixels: the blur that the finest octave is without; it doubles with each
constexpr int kHalved = 2;            // octaves from here on are kept in half the size
constexpr int kCell = 16;             // pixels a side of a cell: correlations of windows four times as wide vary slowly
constexpr int kWindow = 4;            // cells a side of the window over which a band's correlation is taken
constexpr double kAlike = 1 - 1e-6;   // correlation that equal pictures count with
constexpr double kNothing = 1e-10;    // power of a band, (1e-5 of white)^2, below which there is no contrast to mix
constexpr double kMostContrast = 4;   // gain that keeps contrast; two frames with nothing in common ask for 1.4
constexpr double kLeastNormal = 0.5;  // length of the sum of two normals, below which frames face opposite ways
constexpr std::size_t kScored = 12;   // frames that a score looks at
constexpr std::size_t kScoredAtOnce = 4;

// Share of a band's power that frames do not have in common at any distance. It keeps the equations regular.
constexpr double kNoise = 1e-3;

// Gaps to the two inner frames: a frame further out that comes nearer than this to them says nothing new there.
constexpr double kLeastStep = 0.1;

// Optical flow in pictures no wider than kFlowColumns, because flow is smooth.
constexpr int kFlowColumns = 320;
// Farneback's, of blurred pictures, because speckle is noise to it. The polynomial's size and width are the pair that
// OpenCV recommends.
constexpr int kFlowBlurSize = 5;
constexpr double kFlowBlur = 1.0;     // pixels
constexpr double kFlowPyramid = 0.5;  // a level of the pyramid over the one before
constexpr int kFlowLevels = 4;
constexpr int kFlowWindow = 41;         // pixels of those pictures
constexpr int kFlowIterations = 3;      // on each level
constexpr int kFlowPolynomialSize = 7;  // pixels
constexpr double kFlowPolynomialWidth = 1.5;
// Dense inverse search by OpenCV's preset FAST, but down to single pixels. Patches do not pass their flow on to their
// neighbours, because the result would depend on the number of threads.
constexpr int kFinestFlow = 0;

constexpr int kFrames = 4;  // around a plane: before, first, second, after
constexpr int kFirst = 1, kSecond = 2;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// Where the frames around a plane lie at one of its pixels: signed distances from the plane, in units of the distance
/// between the first and the second. Not a number where a frame says nothing.
using Positions = std::array<double, kFrames>;

/// What each frame weighs.
using Weights = std::array<double, kFrames>;

/// Pictures of one plane from the frames around it, and where the frames lie at pixel (x, y). Pictures are empty where
/// there is no frame.
struct Views
{
  std::array<cv::Mat, kFrames> picture;
  std::function<Positions(int x, int y)> positions;
};

/// A picture's octaves, finest first, and what is below them. From kHalved on they have half the size.
struct Octaves
{
  std::array<cv::Mat, kBands> bands;
  cv::Mat rest;
};

cv::Mat Picture(const Sweep& sweep, int frame)
{
  cv::Mat picture(sweep.height, sweep.width, CV_32F);
  sweep.CopyFrame(frame, picture.ptr<float>());
  return picture;
}

/// Where lines along `direction` from a plane's pixels meet `target`: in its pixels, and the signed distance in mm. Both
/// are planes, so it is linear in the pixel. Not a number where the direction lies in the target.
struct Meeting
{
  Eigen::Vector3d origin, perColumn, perRow;

  Meeting(const SlicePlane& plane, const Eigen::Vector3d& direction, const SlicePlane& target)
  {
    // T (x - o) = (i, j, z): a point x goes to x + t d with t = -z / (T d)_z.
    const Eigen::Matrix3d t = target.WorldToSlice();
    const Eigen::Vector3d d = t * direction;
    Eigen::Matrix3d meet = Eigen::Matrix3d::Identity();
    meet.col(2) = Eigen::Vector3d(-d[0], -d[1], -1) / d[2];
    origin = meet * (t * (plane.origin - target.origin));
    perColumn = meet * (t * plane.columnStep);
    perRow = meet * (t * plane.rowStep);
  }

  Eigen::Vector3d At(int x, int y) const { return origin + x * perColumn + y * perRow; }

  /// What the plane shows of the target's picture.
  cv::Mat Sample(const cv::Mat& picture) const
  {
    const cv::Mat map =
        (cv::Mat_<double>(2, 3) << perColumn[0], perRow[0], origin[0], perColumn[1], perRow[1], origin[1]);
    cv::Mat out = cv::Mat::zeros(picture.size(), CV_32F);
    if (cv::checkRange(map))
    {
      cv::warpAffine(picture, out, map, out.size(), cv::INTER_CUBIC | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
    }
    return out;
  }
};

/// Whether a place in pixels is inside a frame's image.
bool IsInside(const Eigen::Vector3d& at, const Sweep& sweep)
{
  return at[0] >= -0.5 && at[0] <= sweep.width - 0.5 && at[1] >= -0.5 && at[1] <= sweep.height - 0.5;
}

/// Without outer frames that come too near to the inner two.
Positions Apart(Positions positions)
{
  if (!(positions[0] < positions[kFirst] - kLeastStep))
  {
    positions[0] = kUnknown;
  }
  if (!(positions[kFrames - 1] > positions[kSecond] + kLeastStep))
  {
    positions[kFrames - 1] = kUnknown;
  }
  return positions;
}

/// Frames sampled along lines parallel to the mean normal of the inner two.
Views ViewsAlongNormals(const Sweep& sweep, const std::array<int, kFrames>& frames, const SlicePlane& plane,
                        double share)
{
  const SlicePlane first = sweep.Plane(frames[kFirst]);
  Eigen::Vector3d direction = first.Normal() + sweep.Plane(frames[kSecond]).Normal();
  if (direction.norm() < kLeastNormal)
  {
    direction = first.Normal();
  }
  direction.normalize();
  Views views;
  std::array<std::optional<Meeting>, kFrames> meetings;
  for (int k = 0; k < kFrames; ++k)
  {
    if (frames[k] != FramesAround::kNone)
    {
      meetings[k].emplace(plane, direction, sweep.Plane(frames[k]));
      views.picture[k] = meetings[k]->Sample(Picture(sweep, frames[k]));
    }
  }
  views.positions = [&sweep, meetings, share](int x, int y)
  {
    const Eigen::Vector3d a = meetings[kFirst]->At(x, y), b = meetings[kSecond]->At(x, y);
    const double u = std::abs(a[2]), v = std::abs(b[2]);
    const bool inFirst = IsInside(a, sweep), inSecond = IsInside(b, sweep);
    const double s = inFirst != inSecond ? (inFirst ? 0.0 : 1.0) : u + v > 0 ? u / (u + v) : share;
    Positions positions{kUnknown, -s, 1 - s, kUnknown};
    if (inFirst && inSecond && u + v > 0)
    {
      for (const int k : {0, kFrames - 1})
      {
        const Eigen::Vector3d at = meetings[k] ? meetings[k]->At(x, y) : Eigen::Vector3d::Constant(kUnknown);
        if (IsInside(at, sweep))
        {
          positions[k] = (k == 0 ? -1 : 1) * std::abs(at[2]) / (u + v);
        }
      }
    }
    return Apart(positions);
  };
  return views;
}

/// Frames pixel for pixel, at the distances that the probe moved (PathLength).
Views ViewsAlongProbe(const Sweep& sweep, const std::array<int, kFrames>& frames, double share)
{
  const auto way = [&](int a, int b) { return PathLength(sweep, {frames[a], frames[b]}); };
  const double gap = way(kFirst, kSecond);
  const auto gaps = [&](int a, int b) { return gap > 0 ? way(b, a) / gap : 1; };
  Views views;
  Positions positions{kUnknown, -share, 1 - share, kUnknown};
  for (int k = 0; k < kFrames; ++k)
  {
    if (frames[k] != FramesAround::kNone)
    {
      views.picture[k] = Picture(sweep, frames[k]);
      positions[k] = k == 0 ? -share - gaps(kFirst, 0) : k == kFrames - 1 ? 1 - share + gaps(k, kSecond) : positions[k];
    }
  }
  views.positions = [positions = Apart(positions)](int, int) { return positions; };
  return views;
}

Views ViewsOf(const Sweep& sweep, const FramesAround& around, const PlaneInGap& at, FrameInterpolation::Path path)
{
  const std::array<int, kFrames> frames = {around.before, around.first, around.second, around.after};
  return path == FrameInterpolation::Path::Normals ? ViewsAlongNormals(sweep, frames, at.plane, at.share)
                                                   : ViewsAlongProbe(sweep, frames, at.share);
}

/// A displacement in pixels from one picture to another, both of bytes.
using FindFlow = cv::Mat (*)(const cv::Mat& from, const cv::Mat& to);

cv::Mat FarnebackFlow(const cv::Mat& from, const cv::Mat& to)
{
  cv::Mat a, b, flow;
  cv::GaussianBlur(from, a, cv::Size(kFlowBlurSize, kFlowBlurSize), kFlowBlur);
  cv::GaussianBlur(to, b, cv::Size(kFlowBlurSize, kFlowBlurSize), kFlowBlur);
  cv::calcOpticalFlowFarneback(a, b, flow, kFlowPyramid, kFlowLevels, kFlowWindow, kFlowIterations, kFlowPolynomialSize,
                               kFlowPolynomialWidth, 0);
  return flow;
}

cv::Mat InverseSearchFlow(const cv::Mat& from, const cv::Mat& to)
{
  const auto search = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_FAST);
  search->setFinestScale(kFinestFlow);
  search->setUseSpatialPropagation(false);
  search->setUseMeanNormalization(false);
  cv::Mat flow;
  search->calc(from, to, flow);
  return flow;
}

/// The displacement from `from` to `to`, mean of both directions, in pixels.
cv::Mat Flow(const cv::Mat& from, const cv::Mat& to, FindFlow find)
{
  const double scale = std::min(1.0, static_cast<double>(kFlowColumns) / from.cols);
  const auto prepare = [scale](const cv::Mat& picture)
  {
    cv::Mat small, bytes;
    cv::resize(picture, small, cv::Size(), scale, scale, cv::INTER_AREA);
    small.convertTo(bytes, CV_8U, 255.0);
    return bytes;
  };
  const cv::Mat first = prepare(from), second = prepare(to);
  cv::Mat flow = 0.5 * (find(first, second) - find(second, first));
  cv::resize(flow, flow, from.size(), 0, 0, cv::INTER_LINEAR);
  return flow * (1.0 / scale);
}

/// All pictures moved along the flow between the inner two, each to the plane.
Views MovedByFlow(const Views& views, const cv::Mat& flow)
{
  Views moved;
  moved.positions = views.positions;
  std::array<cv::Mat, kFrames> i, j;
  for (int k = 0; k < kFrames; ++k)
  {
    i[k].create(flow.size(), CV_32F);
    j[k].create(flow.size(), CV_32F);
  }
  for (int y = 0; y < flow.rows; ++y)
  {
    for (int x = 0; x < flow.cols; ++x)
    {
      const cv::Vec2f step = flow.at<cv::Vec2f>(y, x);
      const Positions positions = views.positions(x, y);
      for (int k = 0; k < kFrames; ++k)
      {
        const auto known = static_cast<float>(std::isnan(positions[k]) ? 0.0 : positions[k]);
        i[k].at<float>(y, x) = static_cast<float>(x) + known * step[0];
        j[k].at<float>(y, x) = static_cast<float>(y) + known * step[1];
      }
    }
  }
  for (int k = 0; k < kFrames; ++k)
  {
    if (!views.picture[k].empty())
    {
      cv::remap(views.picture[k], moved.picture[k], i[k], j[k], cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    }
  }
  return moved;
}

/// Takes octaves out of a picture: each is what blurring removes of what is left. The picture is halved once it is so
/// blurred that it can be.
Octaves Split(cv::Mat picture)
{
  Octaves octaves;
  double sigma = kFirstBlur;
  for (int band = 0; band < kBands; ++band, sigma *= 2)
  {
    cv::Mat low;
    cv::GaussianBlur(picture, low, cv::Size(), sigma, sigma, cv::BORDER_REPLICATE);
    if (band + 1 == kHalved)
    {
      cv::Mat half, again;
      cv::resize(low, half, cv::Size((low.cols + 1) / 2, (low.rows + 1) / 2), 0, 0, cv::INTER_AREA);
      cv::resize(half, again, low.size(), 0, 0, cv::INTER_LINEAR);
      octaves.bands[band] = picture - again;
      picture = half;
      sigma /= 2;
    }
    else
    {
      octaves.bands[band] = picture - low;
      picture = low;
    }
  }
  octaves.rest = picture;
  return octaves;
}

/// The cells that weights are found for: at the middle of each, and interpolated between.
struct Cells
{
  cv::Size size;                     ///< of the grid
  std::vector<Positions> positions;  ///< [rows][columns] of the frames at their middles

  Cells(const Views& views, cv::Size picture)
      : size((picture.width + kCell - 1) / kCell, (picture.height + kCell - 1) / kCell)
  {
    for (int y = 0; y < size.height; ++y)
    {
      for (int x = 0; x < size.width; ++x)
      {
        positions.push_back(views.positions(std::min(x * kCell + kCell / 2, picture.width - 1),
                                            std::min(y * kCell + kCell / 2, picture.height - 1)));
      }
    }
  }
};

/// The mean of a product of two bands in a window of kWindow cells a side around the middle of every cell, as far as it
/// lies in the picture. Cells are of `side` pixels.
std::vector<double> LocalMeans(const cv::Mat& a, const cv::Mat& b, cv::Size cells, int side)
{
  const int block = side / 2;  // windows consist of whole blocks
  const cv::Size blocks((a.cols + block - 1) / block, (a.rows + block - 1) / block);
  cv::Mat sums = cv::Mat::zeros(blocks, CV_64F), integral;
  std::vector<float> columns(a.cols);
  for (int y = 0; y < blocks.height; ++y)
  {
    std::fill(columns.begin(), columns.end(), 0.0f);
    for (int row = y * block; row < std::min((y + 1) * block, a.rows); ++row)
    {
      const float *u = a.ptr<float>(row), *v = b.ptr<float>(row);
      for (int x = 0; x < a.cols; ++x)
      {
        columns[x] += u[x] * v[x];
      }
    }
    for (int x = 0; x < a.cols; ++x)
    {
      sums.at<double>(y, x / block) += columns[x];
    }
  }
  cv::integral(sums, integral, CV_64F);
  std::vector<double> means;
  for (int y = 0; y < cells.height; ++y)
  {
    for (int x = 0; x < cells.width; ++x)
    {
      const int left = std::max(2 * x + 1 - kWindow, 0), right = std::min(2 * x + 1 + kWindow, blocks.width);
      const int top = std::max(2 * y + 1 - kWindow, 0), bottom = std::min(2 * y + 1 + kWindow, blocks.height);
      const double pixels = static_cast<double>(std::min(right * block, a.cols) - left * block) *
                            (std::min(bottom * block, a.rows) - top * block);
      means.push_back((integral.at<double>(bottom, right) - integral.at<double>(bottom, left) -
                       integral.at<double>(top, right) + integral.at<double>(top, left)) /
                      pixels);
    }
  }
  return means;
}

/// |p_i - p_j|^e and |p_i|^e of the frames at one pixel: what correlations rest on beside rho.
struct Distances
{
  Eigen::Matrix<double, kFrames, kFrames> between;
  Eigen::Matrix<double, kFrames, 1> toPlane;  ///< not a number where a frame says nothing

  Distances(const Positions& positions, double exponent)
  {
    for (int a = 0; a < kFrames; ++a)
    {
      toPlane[a] = std::pow(std::abs(positions[a]), exponent);
      for (int b = 0; b < a; ++b)
      {
        between(a, b) = std::pow(std::abs(positions[a] - positions[b]), exponent);
      }
    }
  }
};

/// Weights of the best linear estimate, K w = k. K_ij = rho^(|p_i - p_j|^e) + noise and k_i = rho^(|p_i|^e) are the
/// correlations between frames and with the plane, rho that of frames one gap apart.
Weights BestLinear(const Distances& distances, double rho)
{
  const double decay = std::log(rho);  // rho 0: minus infinity
  const auto correlation = [decay](double distance) { return distance > 0 ? std::exp(decay * distance) : 1.0; };
  Eigen::Matrix<double, kFrames, kFrames> between = Eigen::Matrix<double, kFrames, kFrames>::Identity();
  Eigen::Matrix<double, kFrames, 1> with = Eigen::Matrix<double, kFrames, 1>::Zero();
  for (int a = 0; a < kFrames; ++a)
  {
    if (std::isnan(distances.toPlane[a]))
    {
      continue;
    }
    with[a] = correlation(distances.toPlane[a]);
    between(a, a) += kNoise;
    for (int b = 0; b < a; ++b)
    {
      if (!std::isnan(distances.toPlane[b]))
      {
        between(a, b) = correlation(distances.between(a, b));  // LLT reads the lower half
      }
    }
  }
  const Eigen::Matrix<double, kFrames, 1> solved = between.llt().solve(with);
  Weights weights;
  std::copy_n(solved.data(), kFrames, weights.begin());
  return weights;
}

/// Weights of a cubic through the inner two frames: slopes are those of the parabola through three frames or, where
/// there is no third, of the line.
Weights Cubic(const Positions& p)
{
  const double h = p[kSecond] - p[kFirst];
  if (!(h > 0))
  {
    return {0, 0.5, 0.5, 0};
  }
  const double s = -p[kFirst] / h, s2 = s * s, s3 = s2 * s;
  Weights weights{0, 2 * s3 - 3 * s2 + 1, -2 * s3 + 3 * s2, 0};
  // Adds `factor` times the slope at an inner frame, times h.
  const auto addSlope = [&](double factor, int inner, int outer)
  {
    weights[kFirst] -= factor;
    weights[kSecond] += factor;
    if (!std::isnan(p[outer]))
    {
      // With the outer frame at a distance g beyond the inner one: (slope - secant) = (outer secant - secant) h / (g + h).
      const double g = std::abs(p[inner] - p[outer]), share = factor * h / (g + h), sign = outer == 0 ? -1 : 1;
      weights[kFirst] += share;
      weights[kSecond] -= share;
      weights[outer] += sign * share * h / g;
      weights[inner] -= sign * share * h / g;
    }
  };
  addSlope(s3 - 2 * s2 + s, kFirst, 0);
  addSlope(s3 - s2, kSecond, kFrames - 1);
  return weights;
}

/// Adds the weighted sum of `pictures` to `sum`. Weights are those of cells of `side` pixels, interpolated between.
void AddWeighted(const std::array<const cv::Mat*, kFrames>& pictures, const std::vector<Weights>& weights,
                 cv::Size cells, int side, cv::Mat& sum)
{
  cv::Mat map(cells, CV_32F), whole;
  for (int k = 0; k < kFrames; ++k)
  {
    if (pictures[k] != nullptr)
    {
      std::transform(weights.begin(), weights.end(), map.ptr<float>(),
                     [k](const Weights& found) { return static_cast<float>(found[k]); });
      cv::resize(map, whole, cells * side, 0, 0, cv::INTER_LINEAR);
      sum += whole(cv::Rect(cv::Point(), sum.size())).mul(*pictures[k]);
    }
  }
}

/// The frames' pictures mixed octave by octave. `ofBand(band, side)` gives the weights of all cells, which have `side`
/// pixels there, and ofRest(cell) those of what is below the last octave.
template <class OfBand, class OfRest>
cv::Mat Mix(const std::array<std::optional<Octaves>, kFrames>& frames, const Cells& cells, const OfBand& ofBand,
            const OfRest& ofRest)
{
  std::array<const cv::Mat*, kFrames> pictures{};
  const auto choose = [&](const auto& part)
  {
    for (int k = 0; k < kFrames; ++k)
    {
      pictures[k] = frames[k] ? &part(*frames[k]) : nullptr;
    }
  };
  cv::Mat whole = cv::Mat::zeros(frames[kFirst]->bands[0].size(), CV_32F);
  cv::Mat half = cv::Mat::zeros(frames[kFirst]->rest.size(), CV_32F);
  for (int band = 0; band < kBands; ++band)
  {
    const int side = band < kHalved ? kCell : kCell / 2;
    choose([band](const Octaves& octaves) -> const cv::Mat& { return octaves.bands[band]; });
    AddWeighted(pictures, ofBand(band, side), cells.size, side, band < kHalved ? whole : half);
  }
  std::vector<Weights> weights;
  for (const Positions& positions : cells.positions)
  {
    weights.push_back(ofRest(positions));
  }
  choose([](const Octaves& octaves) -> const cv::Mat& { return octaves.rest; });
  AddWeighted(pictures, weights, cells.size, kCell / 2, half);
  cv::Mat again;
  cv::resize(half, again, whole.size(), 0, 0, cv::INTER_LINEAR);
  return whole + again;
}

std::array<std::optional<Octaves>, kFrames> SplitAll(const std::array<cv::Mat, kFrames>& pictures)
{
  std::array<std::optional<Octaves>, kFrames> all;
  for (int k = 0; k < kFrames; ++k)
  {
    if (!pictures[k].empty())
    {
      all[k] = Split(pictures[k]);
    }
  }
  return all;
}

/// The best linear estimate, octave by octave, under the correlation that the inner two have in a window. What is below
/// the last octave follows a cubic.
cv::Mat Estimate(const Views& views, double exponent)
{
  const Cells cells(views, views.picture[kFirst].size());
  std::vector<Distances> distances;
  for (const Positions& positions : cells.positions)
  {
    distances.emplace_back(positions, exponent);
  }
  const auto frames = SplitAll(views.picture);
  const auto ofBand = [&](int band, int side)
  {
    const cv::Mat &u = frames[kFirst]->bands[band], &v = frames[kSecond]->bands[band];
    const std::vector<double> uu = LocalMeans(u, u, cells.size, side), vv = LocalMeans(v, v, cells.size, side),
                              uv = LocalMeans(u, v, cells.size, side);
    std::vector<Weights> weights;
    for (std::size_t cell = 0; cell < distances.size(); ++cell)
    {
      const double deviations = std::sqrt(std::max(uu[cell], 0.0) * std::max(vv[cell], 0.0));
      const double rho = deviations > kNothing ? std::clamp(uv[cell] / deviations, 0.0, kAlike) : 0.0;
      weights.push_back(BestLinear(distances[cell], rho));
    }
    return weights;
  };
  return Mix(frames, cells, ofBand, Cubic);
}

/// The inner two mixed octave by octave by the shares 1 - s and s. Octaves get the power that those of the frames as they
/// were `recorded` have around the same pixel, because sampling between pixels and mixing take from it.
cv::Mat MixKeepingContrast(const Views& views, const std::array<cv::Mat, 2>& recorded)
{
  const Cells cells(views, views.picture[kFirst].size());
  const auto frames = SplitAll({cv::Mat(), views.picture[kFirst], views.picture[kSecond], cv::Mat()});
  const std::array<Octaves, 2> whole = {Split(recorded[0]), Split(recorded[1])};
  const auto ofRest = [](const Positions& positions) { return Weights{0, positions[kSecond], -positions[kFirst], 0}; };
  const auto ofBand = [&](int band, int side)
  {
    const auto means = [&](const cv::Mat& a, const cv::Mat& b) { return LocalMeans(a, b, cells.size, side); };
    const cv::Mat &u = frames[kFirst]->bands[band], &v = frames[kSecond]->bands[band];
    const std::vector<double> uu = means(u, u), vv = means(v, v), uv = means(u, v);
    const std::vector<double> first = means(whole[0].bands[band], whole[0].bands[band]),
                              second = means(whole[1].bands[band], whole[1].bands[band]);
    std::vector<Weights> weights;
    for (std::size_t cell = 0; cell < uu.size(); ++cell)
    {
      Weights found = ofRest(cells.positions[cell]);
      const double a = found[kFirst], b = found[kSecond];
      const double left = a * a * uu[cell] + b * b * vv[cell] + 2 * a * b * uv[cell];
      const double wanted = a * first[cell] + b * second[cell];
      const double gain = left > kNothing && wanted > 0 ? std::min(std::sqrt(wanted / left), kMostContrast) : 1.0;
      found[kFirst] *= gain;
      found[kSecond] *= gain;
      weights.push_back(found);
    }
    return weights;
  };
  return Mix(frames, cells, ofBand, ofRest);
}

double Exponent(FrameInterpolation::Decay decay)
{
  using Decay = FrameInterpolation::Decay;
  return decay == Decay::Rough ? 1.0 : decay == Decay::Smooth ? 1.9 : 1.5;
}

const char* Suffix(FrameInterpolation::Decay decay)
{
  using Decay = FrameInterpolation::Decay;
  return decay == Decay::Rough ? "+rough" : decay == Decay::Smooth ? "+smooth" : "";
}

}  // namespace

FrameInterpolation FrameInterpolation::Parse(const std::string& name)
{
  for (const Path path : {Path::Normals, Path::Probe})
  {
    for (const bool flow : {false, true})
    {
      for (const Decay decay : {Decay::Rough, Decay::Medium, Decay::Smooth})
      {
        if (const FrameInterpolation candidate{path, flow, decay}; candidate.ToString() == name)
        {
          return candidate;
        }
      }
    }
  }
  throw Error("Interpolation: there is no \"" + name.substr(0, 60) +
              "\"; it is normals or probe, then +flow or not, then +rough, +smooth or neither.");
}

std::string FrameInterpolation::ToString() const
{
  return std::string(path == Path::Normals ? "normals" : "probe") + (flow ? "+flow" : "") + Suffix(decay);
}

FramesAround FramesAround::Gap(const Sweep& sweep, const std::vector<int>& frames, std::size_t gap)
{
  FramesAround around;
  around.first = frames[gap];
  around.second = frames[gap + 1];
  around.before = NeighboursOf(sweep, frames, around.first).before.value_or(kNone);
  around.after = NeighboursOf(sweep, frames, around.second).after.value_or(kNone);
  return around;
}

SlicePlane PlaneBetween(const SlicePlane& from, const SlicePlane& to, double share)
{
  const double i = 0.5 * (from.width - 1), j = 0.5 * (from.height - 1);
  const Eigen::Matrix3d first = AxesOf(from), second = AxesOf(to);
  const Eigen::Matrix3d r = Eigen::Quaterniond(first).slerp(share, Eigen::Quaterniond(second)).toRotationMatrix();
  // Steps are mixed in the planes' own frames, so that shear stays what it is.
  const auto mix = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) -> Eigen::Vector3d
  { return r * ((1 - share) * (first.transpose() * a) + share * (second.transpose() * b)); };
  SlicePlane plane = from;
  plane.columnStep = mix(from.columnStep, to.columnStep);
  plane.rowStep = mix(from.rowStep, to.rowStep);
  plane.origin = (1 - share) * from.Point(i, j) + share * to.Point(i, j) - i * plane.columnStep - j * plane.rowStep;
  return plane;
}

void InterpolateFrames(const Sweep& sweep, const FramesAround& around, const std::vector<PlaneInGap>& planes,
                       const FrameInterpolation& interpolation, const std::vector<float*>& images)
{
  std::vector<cv::Mat> flows;
  if (interpolation.flow)
  {
    const Views middle = ViewsOf(sweep, around, planes[planes.size() / 2], interpolation.path);
    const cv::Mat &from = middle.picture[kFirst], &to = middle.picture[kSecond];
    flows.push_back(Flow(from, to, FarnebackFlow));
    if (!interpolation.keepContrast)
    {
      flows.push_back(Flow(from, to, InverseSearchFlow));
    }
  }
  const auto interpolate = [&](std::size_t n)
  {
    const Views views = ViewsOf(sweep, around, planes[n], interpolation.path);
    cv::Mat mix;
    if (interpolation.keepContrast)
    {
      mix = MixKeepingContrast(interpolation.flow ? MovedByFlow(views, flows[0]) : views,
                               {Picture(sweep, around.first), Picture(sweep, around.second)});
    }
    else
    {
      const double exponent = Exponent(interpolation.decay);
      mix = Estimate(views, exponent);
      // The mean of several estimates has less error than any; its texture is none of theirs.
      for (const cv::Mat& flow : flows)
      {
        mix += Estimate(MovedByFlow(views, flow), exponent);
      }
      mix /= 1.0 + static_cast<double>(flows.size());
    }
    for (int y = 0; y < mix.rows; ++y)
    {
      std::transform(mix.ptr<float>(y), mix.ptr<float>(y) + mix.cols,
                     images[n] + static_cast<std::size_t>(y) * mix.cols,
                     [](float value) { return std::clamp(value, 0.0f, 1.0f); });
    }
  };
  tbb::parallel_for(std::size_t(0), planes.size(), interpolate);
}

std::optional<double> ScoreInterpolation(const Sweep& sweep, const std::vector<int>& frames,
                                         const FrameInterpolation& interpolation, const std::function<bool()>& goOn)
{
  std::vector<std::size_t> inner;  // places in `frames` that have a neighbour on either side
  for (std::size_t k = 1; k + 1 < frames.size(); ++k)
  {
    const Neighbours around = NeighboursOf(sweep, frames, frames[k]);
    if (around.before && around.after)
    {
      inner.push_back(k);
    }
  }
  Require(!inner.empty(), "Interpolation: a score needs three frames of one sequence; of ", frames.size(),
          " no three follow each other.");
  const std::vector<std::size_t> scored = EvenlySpread(inner, kScored);
  std::vector<double> psnr(scored.size());
  const auto predict = [&](std::size_t n)
  {
    const std::size_t k = scored[n];
    const SlicePlane plane = sweep.Plane(frames[k]);
    const auto distance = [&](int other) { return PathLength(sweep, {other, frames[k]}); };
    const double u = distance(frames[k - 1]), v = distance(frames[k + 1]);
    std::vector<float> image(sweep.PixelsPerFrame()), truth(image.size());
    std::vector<int> others = frames;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    InterpolateFrames(sweep, FramesAround::Gap(sweep, others, k - 1), {{plane, u + v > 0 ? u / (u + v) : 0.5}},
                      interpolation, {image.data()});
    sweep.BlackenUnlit(image.data());
    sweep.CopyFrame(frames[k], truth.data());
    psnr[n] = Psnr(image.data(), truth.data(), image.size());
  };
  for (std::size_t first = 0; first < scored.size(); first += kScoredAtOnce)
  {
    if (goOn && !goOn())
    {
      return std::nullopt;
    }
    tbb::parallel_for(first, std::min(first + kScoredAtOnce, scored.size()), predict);
  }
  return Mean(psnr);
}

}  // namespace bigus
