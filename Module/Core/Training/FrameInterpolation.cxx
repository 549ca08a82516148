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

namespace bigus
{
namespace
{

constexpr int kBands = 4;             // octaves; what is below them is the same in all frames
constexpr double kFirstBlur = 0.8;    // pixels: the blur that the finest octave is without; it doubles with each
constexpr int kWindow = 65;           // pixels over which a band's correlation is taken
constexpr int kCell = 16;             // pixels a side of a cell: correlations of windows four times as wide vary slowly
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

/// Two pictures of one plane and how far the plane lies from the first, as a share, pixel by pixel.
struct Pair
{
  cv::Mat first, second, share;
};

/// Pictures of one plane from the frames around it, and where each frame lies, pixel by pixel: its signed distance from
/// the plane, in units of the distance between the first and the second. A frame that shows nothing of a pixel has a
/// position that is not a number there. Empty where there is no frame.
struct Views
{
  std::array<cv::Mat, kFrames> picture, position;

  Pair InnerPair() const { return {picture[kFirst], picture[kSecond], -position[kFirst]}; }
};

/// An orthonormal frame of the plane: along its rows, in the plane across them, along its normal.
Eigen::Matrix3d FrameOf(const SlicePlane& plane)
{
  Eigen::Matrix3d r;
  r.col(0) = plane.columnStep.normalized();
  r.col(2) = plane.Normal();
  r.col(1) = r.col(2).cross(r.col(0));
  return r;
}

cv::Mat Picture(const Sweep& sweep, int frame)
{
  cv::Mat picture(sweep.height, sweep.width, CV_32F);
  sweep.CopyFrame(frame, picture.ptr<float>());
  return picture;
}

/// Where lines along `direction` from the plane's pixels meet `target`, in its pixels, and how far away, mm.
struct Meeting
{
  cv::Mat i, j, distance;
};
Meeting Meet(const SlicePlane& plane, const Eigen::Vector3d& direction, const SlicePlane& target)
{
  // T (x - o) = (i, j, z): a point x goes to x + t d with t = -z / (T d)_z.
  const Eigen::Matrix3d t = target.WorldToSlice();
  const Eigen::Vector3d d = t * direction;
  Meeting meeting;
  for (cv::Mat* map : {&meeting.i, &meeting.j, &meeting.distance})
  {
    map->create(plane.height, plane.width, CV_32F);
  }
  for (int y = 0; y < plane.height; ++y)
  {
    for (int x = 0; x < plane.width; ++x)
    {
      const Eigen::Vector3d p = t * (plane.Point(x, y) - target.origin);
      const double steps = -p[2] / d[2];
      meeting.i.at<float>(y, x) = static_cast<float>(p[0] + steps * d[0]);
      meeting.j.at<float>(y, x) = static_cast<float>(p[1] + steps * d[1]);
      meeting.distance.at<float>(y, x) = static_cast<float>(std::abs(steps));
    }
  }
  return meeting;
}

cv::Mat Sample(const cv::Mat& picture, const cv::Mat& i, const cv::Mat& j)
{
  cv::Mat out;
  cv::remap(picture, out, i, j, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return out;
}

bool Inside(const Meeting& meeting, int x, int y, int width, int height)
{
  const float i = meeting.i.at<float>(y, x), j = meeting.j.at<float>(y, x);
  return i >= -0.5f && i <= static_cast<float>(width) - 0.5f && j >= -0.5f && j <= static_cast<float>(height) - 0.5f;
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
  std::array<Meeting, kFrames> meetings;
  for (int k = 0; k < kFrames; ++k)
  {
    if (frames[k] != FramesAround::kNone)
    {
      meetings[k] = Meet(plane, direction, sweep.Plane(frames[k]));
      views.picture[k] = Sample(Picture(sweep, frames[k]), meetings[k].i, meetings[k].j);
      views.position[k].create(sweep.height, sweep.width, CV_32F);
    }
  }
  const auto inside = [&](int k, int x, int y) { return Inside(meetings[k], x, y, sweep.width, sweep.height); };
  for (int y = 0; y < sweep.height; ++y)
  {
    for (int x = 0; x < sweep.width; ++x)
    {
      const float u = meetings[kFirst].distance.at<float>(y, x), v = meetings[kSecond].distance.at<float>(y, x);
      const bool inFirst = inside(kFirst, x, y), inSecond = inside(kSecond, x, y);
      const float s = inFirst != inSecond ? (inFirst ? 0.0f : 1.0f)
                      : u + v > 0         ? u / (u + v)
                                          : static_cast<float>(share);
      views.position[kFirst].at<float>(y, x) = -s;
      views.position[kSecond].at<float>(y, x) = 1 - s;
      for (const int k : {0, kFrames - 1})
      {
        if (!views.picture[k].empty())
        {
          const bool known = inFirst && inSecond && u + v > 0 && inside(k, x, y);
          const float distance = known ? meetings[k].distance.at<float>(y, x) / (u + v) : 0.0f;
          views.position[k].at<float>(y, x) = !known   ? std::numeric_limits<float>::quiet_NaN()
                                              : k == 0 ? -distance
                                                       : distance;
        }
      }
    }
  }
  return views;
}

/// Frames pixel for pixel, at the distances of their centres.
Views ViewsAlongProbe(const Sweep& sweep, const std::array<int, kFrames>& frames, double share)
{
  const auto centre = [&](int k)
  { return sweep.Plane(frames[k]).Point(0.5 * (sweep.width - 1), 0.5 * (sweep.height - 1)); };
  const double gap = (centre(kSecond) - centre(kFirst)).norm();
  Views views;
  for (int k = 0; k < kFrames; ++k)
  {
    if (frames[k] == FramesAround::kNone)
    {
      continue;
    }
    double position = k <= kFirst ? -share : 1 - share;
    if (k == 0)
    {
      position -= gap > 0 ? (centre(kFirst) - centre(0)).norm() / gap : 1;
    }
    else if (k == kFrames - 1)
    {
      position += gap > 0 ? (centre(k) - centre(kSecond)).norm() / gap : 1;
    }
    views.picture[k] = Picture(sweep, frames[k]);
    views.position[k] = cv::Mat(sweep.height, sweep.width, CV_32F, cv::Scalar(position));
  }
  return views;
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
Views MovedByFlow(const Views& views, FindFlow find)
{
  const cv::Mat flow = Flow(views.picture[kFirst], views.picture[kSecond], find);
  Views moved;
  moved.position = views.position;
  cv::Mat i(flow.size(), CV_32F), j(flow.size(), CV_32F);
  for (int k = 0; k < kFrames; ++k)
  {
    if (views.picture[k].empty())
    {
      continue;
    }
    for (int y = 0; y < flow.rows; ++y)
    {
      for (int x = 0; x < flow.cols; ++x)
      {
        const cv::Vec2f step = flow.at<cv::Vec2f>(y, x);
        const float position = views.position[k].at<float>(y, x), known = std::isnan(position) ? 0.0f : position;
        i.at<float>(y, x) = static_cast<float>(x) + known * step[0];
        j.at<float>(y, x) = static_cast<float>(y) + known * step[1];
      }
    }
    moved.picture[k] = Sample(views.picture[k], i, j);
  }
  return moved;
}

/// Takes an octave out of a picture: what blurring by `sigma` pixels removes. The picture keeps the rest.
cv::Mat TakeBand(cv::Mat& picture, double sigma)
{
  cv::Mat low;
  cv::GaussianBlur(picture, low, cv::Size(), sigma, sigma, cv::BORDER_REPLICATE);
  const cv::Mat band = picture - low;
  picture = low;
  return band;
}

/// The mean of a product of two bands around every pixel.
cv::Mat LocalMean(const cv::Mat& a, const cv::Mat& b)
{
  cv::Mat mean;
  cv::boxFilter(a.mul(b), mean, CV_32F, cv::Size(kWindow, kWindow), cv::Point(-1, -1), true, cv::BORDER_REFLECT_101);
  return mean;
}

/// Weights of the frames around a plane.
using Weights = std::array<double, kFrames>;
/// Their positions; not a number where a frame says nothing.
using Positions = std::array<double, kFrames>;

/// The positions at one pixel, without outer frames that come too near to the inner two.
Positions PositionsAt(const Views& views, int x, int y)
{
  Positions positions;
  for (int k = 0; k < kFrames; ++k)
  {
    positions[k] = views.picture[k].empty() ? std::nan("") : views.position[k].at<float>(y, x);
  }
  if (!(positions[0] < positions[kFirst] - kLeastStep))
  {
    positions[0] = std::nan("");
  }
  if (!(positions[kFrames - 1] > positions[kSecond] + kLeastStep))
  {
    positions[kFrames - 1] = std::nan("");
  }
  return positions;
}

/// Weights of the best linear estimate, K w = k. K_ij = rho^(|p_i - p_j|^e) + noise and k_i = rho^(|p_i|^e) are the
/// correlations between frames and with the plane, rho that of frames one gap apart.
Weights BestLinear(const Positions& positions, double rho, double exponent)
{
  std::array<int, kFrames> known{};
  int count = 0;
  for (int k = 0; k < kFrames; ++k)
  {
    if (!std::isnan(positions[k]))
    {
      known[count++] = k;
    }
  }
  const auto correlation = [&](double distance) { return std::pow(rho, std::pow(std::abs(distance), exponent)); };
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kFrames, kFrames> between(count, count);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kFrames, 1> with(count);
  for (int a = 0; a < count; ++a)
  {
    for (int b = 0; b < count; ++b)
    {
      between(a, b) = correlation(positions[known[a]] - positions[known[b]]) + (a == b ? kNoise : 0.0);
    }
    with[a] = correlation(positions[known[a]]);
  }
  const auto solved = between.llt().solve(with).eval();
  Weights weights{};
  for (int a = 0; a < count; ++a)
  {
    weights[known[a]] = solved[a];
  }
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

/// Adds the weighted sum of `pictures` to `sum`. `weights(x, y)` gives the weights at a pixel; they are found at the
/// middle of every cell and interpolated between.
template <class Find>
void AddWeighted(const std::array<cv::Mat, kFrames>& pictures, const Find& weights, cv::Mat& sum)
{
  const cv::Size cells((sum.cols + kCell - 1) / kCell, (sum.rows + kCell - 1) / kCell);
  std::array<cv::Mat, kFrames> maps;
  for (cv::Mat& map : maps)
  {
    map.create(cells, CV_32F);
  }
  for (int y = 0; y < cells.height; ++y)
  {
    for (int x = 0; x < cells.width; ++x)
    {
      const Weights found =
          weights(std::min(x * kCell + kCell / 2, sum.cols - 1), std::min(y * kCell + kCell / 2, sum.rows - 1));
      for (int k = 0; k < kFrames; ++k)
      {
        maps[k].at<float>(y, x) = static_cast<float>(found[k]);
      }
    }
  }
  for (int k = 0; k < kFrames; ++k)
  {
    if (!pictures[k].empty())
    {
      cv::Mat whole;
      cv::resize(maps[k], whole, cells * kCell, 0, 0, cv::INTER_LINEAR);
      sum += whole(cv::Rect(cv::Point(), sum.size())).mul(pictures[k]);
    }
  }
}

/// The pictures mixed band by band, each by the best linear estimate under the correlation that the inner two have in a
/// window. What is below the last octave follows a cubic.
cv::Mat Estimate(const Views& views, double exponent)
{
  std::array<cv::Mat, kFrames> rest = views.picture;
  cv::Mat sum = cv::Mat::zeros(rest[kFirst].size(), CV_32F);
  for (int band = 0; band < kBands; ++band)
  {
    std::array<cv::Mat, kFrames> bands;
    for (int k = 0; k < kFrames; ++k)
    {
      if (!rest[k].empty())
      {
        bands[k] = TakeBand(rest[k], kFirstBlur * (1 << band));
      }
    }
    const cv::Mat &u = bands[kFirst], &v = bands[kSecond];
    const cv::Mat uu = LocalMean(u, u), vv = LocalMean(v, v), uv = LocalMean(u, v);
    AddWeighted(
        bands,
        [&](int x, int y)
        {
          const double a = std::max(0.0f, uu.at<float>(y, x)), b = std::max(0.0f, vv.at<float>(y, x));
          const double deviations = std::sqrt(a * b);
          const double rho = deviations > kNothing ? std::clamp(uv.at<float>(y, x) / deviations, 0.0, kAlike) : 0.0;
          return BestLinear(PositionsAt(views, x, y), rho, exponent);
        },
        sum);
  }
  AddWeighted(
      rest, [&](int x, int y) { return Cubic(PositionsAt(views, x, y)); }, sum);
  return sum;
}

/// Two pictures mixed band by band by the shares 1 - s and s. Bands get the power that those of the frames as they were
/// `recorded` have around the same pixel, because sampling between pixels and mixing take from it.
cv::Mat MixKeepingContrast(const Pair& pair, const std::array<cv::Mat, 2>& recorded)
{
  cv::Mat first = pair.first, second = pair.second, mix = cv::Mat::zeros(first.size(), CV_32F);
  std::array<cv::Mat, 2> whole = recorded;
  for (int band = 0; band < kBands; ++band)
  {
    const double sigma = kFirstBlur * (1 << band);
    const cv::Mat u = TakeBand(first, sigma), v = TakeBand(second, sigma);
    const cv::Mat uu = LocalMean(u, u), vv = LocalMean(v, v), uv = LocalMean(u, v);
    std::array<cv::Mat, 2> power;
    for (int k = 0; k < 2; ++k)
    {
      const cv::Mat wholeBand = TakeBand(whole[k], sigma);
      power[k] = LocalMean(wholeBand, wholeBand);
    }
    for (int y = 0; y < mix.rows; ++y)
    {
      for (int x = 0; x < mix.cols; ++x)
      {
        const double a = std::max(0.0f, uu.at<float>(y, x)), b = std::max(0.0f, vv.at<float>(y, x));
        const double ab = uv.at<float>(y, x), s = pair.share.at<float>(y, x);
        const double left = (1 - s) * (1 - s) * a + s * s * b + 2 * s * (1 - s) * ab;
        const double wanted = (1 - s) * power[0].at<float>(y, x) + s * power[1].at<float>(y, x);
        const double gain = left > kNothing && wanted > 0 ? std::min(std::sqrt(wanted / left), kMostContrast) : 1.0;
        mix.at<float>(y, x) += static_cast<float>(gain * ((1 - s) * u.at<float>(y, x) + s * v.at<float>(y, x)));
      }
    }
  }
  return mix + first + pair.share.mul(second - first);
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
  const auto ifSame = [&](int frame)
  { return sweep.SequenceOf(frame) == sweep.SequenceOf(frames[gap]) ? frame : kNone; };
  FramesAround around;
  around.first = frames[gap];
  around.second = frames[gap + 1];
  around.before = gap > 0 ? ifSame(frames[gap - 1]) : kNone;
  around.after = gap + 2 < frames.size() ? ifSame(frames[gap + 2]) : kNone;
  return around;
}

SlicePlane PlaneBetween(const SlicePlane& from, const SlicePlane& to, double share)
{
  const double i = 0.5 * (from.width - 1), j = 0.5 * (from.height - 1);
  const Eigen::Matrix3d first = FrameOf(from), second = FrameOf(to);
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

void InterpolateFrames(const Sweep& sweep, const FramesAround& around, const SlicePlane& plane, double share,
                       const FrameInterpolation& interpolation, float* image)
{
  const std::array<int, kFrames> frames = {around.before, around.first, around.second, around.after};
  const Views views = interpolation.path == FrameInterpolation::Path::Normals
                          ? ViewsAlongNormals(sweep, frames, plane, share)
                          : ViewsAlongProbe(sweep, frames, share);
  cv::Mat mix;
  if (interpolation.keepContrast)
  {
    const Views moved = interpolation.flow ? MovedByFlow(views, FarnebackFlow) : views;
    mix = MixKeepingContrast(moved.InnerPair(), {Picture(sweep, around.first), Picture(sweep, around.second)});
  }
  else
  {
    const double exponent = Exponent(interpolation.decay);
    mix = Estimate(views, exponent);
    if (interpolation.flow)  // the mean of several estimates has less error than any; its texture is none of theirs
    {
      mix += Estimate(MovedByFlow(views, FarnebackFlow), exponent);
      mix += Estimate(MovedByFlow(views, InverseSearchFlow), exponent);
      mix /= 3;
    }
  }
  for (int y = 0; y < mix.rows; ++y)
  {
    std::transform(mix.ptr<float>(y), mix.ptr<float>(y) + mix.cols, image + static_cast<std::size_t>(y) * mix.cols,
                   [](float value) { return std::clamp(value, 0.0f, 1.0f); });
  }
}

std::optional<double> ScoreInterpolation(const Sweep& sweep, const std::vector<int>& frames,
                                         const FrameInterpolation& interpolation, const std::function<bool()>& goOn)
{
  std::vector<std::size_t> inner;  // places in `frames` that have a neighbour on either side
  for (std::size_t k = 1; k + 1 < frames.size(); ++k)
  {
    if (sweep.SequenceOf(frames[k - 1]) == sweep.SequenceOf(frames[k + 1]))
    {
      inner.push_back(k);
    }
  }
  if (inner.empty())
  {
    throw Error("Interpolation: a score needs three frames of one sequence; of " + std::to_string(frames.size()) +
                " no three follow each other.");
  }
  const std::size_t scored = std::min(kScored, inner.size());
  std::vector<double> psnr(scored);
  const auto predict = [&](std::size_t n)
  {
    const std::size_t k = inner[(2 * n + 1) * inner.size() / (2 * scored)];
    const SlicePlane plane = sweep.Plane(frames[k]);
    const auto distance = [&](int other)
    {
      const SlicePlane from = sweep.Plane(other);
      const double i = 0.5 * (plane.width - 1), j = 0.5 * (plane.height - 1);
      return (plane.Point(i, j) - from.Point(i, j)).norm();
    };
    const double u = distance(frames[k - 1]), v = distance(frames[k + 1]);
    std::vector<float> image(sweep.PixelsPerFrame()), truth(image.size());
    std::vector<int> others = frames;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    InterpolateFrames(sweep, FramesAround::Gap(sweep, others, k - 1), plane, u + v > 0 ? u / (u + v) : 0.5,
                      interpolation, image.data());
    sweep.BlackenUnlit(image.data());
    sweep.CopyFrame(frames[k], truth.data());
    psnr[n] = Psnr(image.data(), truth.data(), image.size());
  };
  for (std::size_t first = 0; first < scored; first += kScoredAtOnce)
  {
    if (goOn && !goOn())
    {
      return std::nullopt;
    }
    tbb::parallel_for(first, std::min(first + kScoredAtOnce, scored), predict);
  }
  double sum = 0;
  for (double value : psnr)
  {
    sum += value;
  }
  return sum / static_cast<double>(scored);
}

}  // namespace bigus
