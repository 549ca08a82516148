// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/FrameInterpolation.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

constexpr int kBands = 4;           // octaves; what is below them is the same in both frames
constexpr double kFirstBlur = 0.8;  // pixels: the blur that the finest octave is without; it doubles with each
constexpr int kWindow = 65;         // pixels over which a band's correlation is taken
constexpr double kDecay = 1.5;  // exponent of the share in rho^(share^kDecay): 1 for an exponential, 2 for a Gaussian
constexpr double kAlike = 1 - 1e-6;   // correlation that equal pictures count with, because at 1 the weights are 0 / 0
constexpr double kNothing = 1e-10;    // power of a band, (1e-5 of white)^2, below which there is no contrast to mix
constexpr double kMostContrast = 4;   // gain that keeps contrast; two frames with nothing in common ask for 1.4
constexpr double kLeastNormal = 0.5;  // length of the sum of two normals, below which frames face opposite ways
constexpr std::size_t kScored = 12;   // frames that a score looks at

// Farneback's optical flow, in pictures no wider than kFlowColumns, because flow is smooth, and blurred, because
// speckle is noise to it. The polynomial's size and width are the pair that OpenCV recommends.
constexpr int kFlowColumns = 320, kFlowBlurSize = 5;
constexpr double kFlowBlur = 1.0;     // pixels
constexpr double kFlowPyramid = 0.5;  // a level of the pyramid over the one before
constexpr int kFlowLevels = 4;
constexpr int kFlowWindow = 41;         // pixels of those pictures
constexpr int kFlowIterations = 3;      // on each level
constexpr int kFlowPolynomialSize = 7;  // pixels
constexpr double kFlowPolynomialWidth = 1.5;

/// Two pictures of one plane and how far the plane lies from the first, as a share, pixel by pixel.
struct Pair
{
  cv::Mat first, second, share;
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

Pair PairAlongNormals(const Sweep& sweep, int a, int b, const SlicePlane& plane, double share)
{
  const SlicePlane first = sweep.Plane(a), second = sweep.Plane(b);
  Eigen::Vector3d direction = first.Normal() + second.Normal();
  if (direction.norm() < kLeastNormal)
  {
    direction = first.Normal();
  }
  direction.normalize();
  const Meeting toFirst = Meet(plane, direction, first), toSecond = Meet(plane, direction, second);
  Pair pair{Sample(Picture(sweep, a), toFirst.i, toFirst.j), Sample(Picture(sweep, b), toSecond.i, toSecond.j),
            cv::Mat(sweep.height, sweep.width, CV_32F)};
  for (int y = 0; y < sweep.height; ++y)
  {
    for (int x = 0; x < sweep.width; ++x)
    {
      const float u = toFirst.distance.at<float>(y, x), v = toSecond.distance.at<float>(y, x);
      const bool inFirst = Inside(toFirst, x, y, sweep.width, sweep.height);
      const bool inSecond = Inside(toSecond, x, y, sweep.width, sweep.height);
      pair.share.at<float>(y, x) = inFirst != inSecond ? (inFirst ? 0.0f : 1.0f)
                                   : u + v > 0         ? u / (u + v)
                                                       : static_cast<float>(share);
    }
  }
  return pair;
}

/// The displacement from `from` to `to`, mean of both directions, in pixels.
cv::Mat Flow(const cv::Mat& from, const cv::Mat& to)
{
  const double scale = std::min(1.0, static_cast<double>(kFlowColumns) / from.cols);
  const auto prepare = [scale](const cv::Mat& picture)
  {
    cv::Mat small, bytes;
    cv::resize(picture, small, cv::Size(), scale, scale, cv::INTER_AREA);
    cv::GaussianBlur(small, small, cv::Size(kFlowBlurSize, kFlowBlurSize), kFlowBlur);
    small.convertTo(bytes, CV_8U, 255.0);
    return bytes;
  };
  const cv::Mat first = prepare(from), second = prepare(to);
  cv::Mat forth, back;
  const auto flowOf = [](const cv::Mat& a, const cv::Mat& b, cv::Mat& out)
  {
    cv::calcOpticalFlowFarneback(a, b, out, kFlowPyramid, kFlowLevels, kFlowWindow, kFlowIterations,
                                 kFlowPolynomialSize, kFlowPolynomialWidth, 0);
  };
  flowOf(first, second, forth);
  flowOf(second, first, back);
  cv::Mat flow = 0.5 * (forth - back);
  cv::resize(flow, flow, from.size(), 0, 0, cv::INTER_LINEAR);
  return flow * (1.0 / scale);
}

/// Both pictures of a pair moved along the flow, each to the plane between.
Pair MovedByFlow(const Pair& pair)
{
  const cv::Mat flow = Flow(pair.first, pair.second);
  std::array<cv::Mat, 4> maps;  // i and j in the first picture, i and j in the second
  for (cv::Mat& map : maps)
  {
    map.create(flow.size(), CV_32F);
  }
  for (int y = 0; y < flow.rows; ++y)
  {
    for (int x = 0; x < flow.cols; ++x)
    {
      const cv::Vec2f step = flow.at<cv::Vec2f>(y, x);
      const float share = pair.share.at<float>(y, x);
      for (int k = 0; k < 2; ++k)
      {
        const float start = static_cast<float>(k == 0 ? x : y);
        maps[k].at<float>(y, x) = start - share * step[k];
        maps[2 + k].at<float>(y, x) = start + (1 - share) * step[k];
      }
    }
  }
  return {Sample(pair.first, maps[0], maps[1]), Sample(pair.second, maps[2], maps[3]), pair.share};
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

/// The mix of both pictures, band by band. The best linear estimate from two values of equal deviation and correlation
/// rho, which correlate with the truth by p and q, has the weights
///
///   (p - rho q) / (1 - rho^2)   and   (q - rho p) / (1 - rho^2).
///
/// To keep contrast, `recorded` are the two frames as they were recorded. Then bands are mixed by the shares 1 - s and
/// s and get the power that recorded bands have around the same pixel, because sampling between pixels and mixing take
/// from it.
cv::Mat Mix(const Pair& pair, const std::array<cv::Mat, 2>* recorded)
{
  cv::Mat first = pair.first, second = pair.second, mix = cv::Mat::zeros(first.size(), CV_32F);
  std::array<cv::Mat, 2> whole;
  if (recorded)
  {
    whole = *recorded;
  }
  for (int band = 0; band < kBands; ++band)
  {
    const double sigma = kFirstBlur * (1 << band);
    const cv::Mat u = TakeBand(first, sigma), v = TakeBand(second, sigma);
    const cv::Mat uu = LocalMean(u, u), vv = LocalMean(v, v), uv = LocalMean(u, v);
    std::array<cv::Mat, 2> power;
    if (recorded)
    {
      for (int k = 0; k < 2; ++k)
      {
        const cv::Mat wholeBand = TakeBand(whole[k], sigma);
        power[k] = LocalMean(wholeBand, wholeBand);
      }
    }
    for (int y = 0; y < mix.rows; ++y)
    {
      for (int x = 0; x < mix.cols; ++x)
      {
        const double a = std::max(0.0f, uu.at<float>(y, x)), b = std::max(0.0f, vv.at<float>(y, x));
        const double ab = uv.at<float>(y, x), s = pair.share.at<float>(y, x);
        double ofFirst, ofSecond;
        if (recorded)
        {
          const double left = (1 - s) * (1 - s) * a + s * s * b + 2 * s * (1 - s) * ab;
          const double wanted = (1 - s) * power[0].at<float>(y, x) + s * power[1].at<float>(y, x);
          const double gain = left > kNothing && wanted > 0 ? std::min(std::sqrt(wanted / left), kMostContrast) : 1.0;
          ofFirst = gain * (1 - s);
          ofSecond = gain * s;
        }
        else
        {
          const double deviations = std::sqrt(a * b);
          const double rho = deviations > kNothing ? std::clamp(ab / deviations, 0.0, kAlike) : 0.0;
          const double p = std::pow(rho, std::pow(s, kDecay)), q = std::pow(rho, std::pow(1 - s, kDecay));
          ofFirst = (p - rho * q) / (1 - rho * rho);
          ofSecond = (q - rho * p) / (1 - rho * rho);
        }
        mix.at<float>(y, x) += static_cast<float>(ofFirst * u.at<float>(y, x) + ofSecond * v.at<float>(y, x));
      }
    }
  }
  return mix + first + pair.share.mul(second - first);
}

}  // namespace

FrameInterpolation FrameInterpolation::Parse(const std::string& name)
{
  for (const Path path : {Path::Normals, Path::Probe})
  {
    for (const bool flow : {false, true})
    {
      if (const FrameInterpolation candidate{path, flow}; candidate.ToString() == name)
      {
        return candidate;
      }
    }
  }
  throw Error("Interpolation: there is no \"" + name.substr(0, 60) +
              "\"; it is normals, normals+flow, probe or probe+flow.");
}

std::string FrameInterpolation::ToString() const
{
  return std::string(path == Path::Normals ? "normals" : "probe") + (flow ? "+flow" : "");
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

void InterpolateFrames(const Sweep& sweep, int a, int b, const SlicePlane& plane, double share,
                       const FrameInterpolation& interpolation, float* image)
{
  const std::array<cv::Mat, 2> recorded = {Picture(sweep, a), Picture(sweep, b)};
  const Pair pair = interpolation.path == FrameInterpolation::Path::Normals
                        ? PairAlongNormals(sweep, a, b, plane, share)
                        : Pair{recorded[0], recorded[1], cv::Mat(sweep.height, sweep.width, CV_32F, cv::Scalar(share))};
  cv::Mat mix;
  if (interpolation.keepContrast)
  {
    mix = Mix(interpolation.flow ? MovedByFlow(pair) : pair, &recorded);
  }
  else
  {
    mix = Mix(pair, nullptr);
    if (interpolation.flow)  // the mean of two estimates is the better one; their mean texture is neither's
    {
      mix = 0.5 * (mix + Mix(MovedByFlow(pair), nullptr));
    }
  }
  for (int y = 0; y < mix.rows; ++y)
  {
    std::transform(mix.ptr<float>(y), mix.ptr<float>(y) + mix.cols, image + static_cast<std::size_t>(y) * mix.cols,
                   [](float value) { return std::clamp(value, 0.0f, 1.0f); });
  }
}

double ScoreInterpolation(const Sweep& sweep, const std::vector<int>& frames, const FrameInterpolation& interpolation)
{
  if (frames.size() < 3)
  {
    throw Error("Interpolation: a score needs three frames, not " + std::to_string(frames.size()) + ".");
  }
  const std::size_t inner = frames.size() - 2, scored = std::min(kScored, inner);
  std::vector<double> psnr(scored);
  tbb::parallel_for(std::size_t(0), scored,
                    [&](std::size_t n)
                    {
                      const std::size_t k = 1 + (2 * n + 1) * inner / (2 * scored);
                      const SlicePlane plane = sweep.Plane(frames[k]);
                      const auto distance = [&](int other)
                      {
                        const SlicePlane from = sweep.Plane(other);
                        const double i = 0.5 * (plane.width - 1), j = 0.5 * (plane.height - 1);
                        return (plane.Point(i, j) - from.Point(i, j)).norm();
                      };
                      const double u = distance(frames[k - 1]), v = distance(frames[k + 1]);
                      std::vector<float> image(sweep.PixelsPerFrame()), truth(image.size());
                      InterpolateFrames(sweep, frames[k - 1], frames[k + 1], plane, u + v > 0 ? u / (u + v) : 0.5,
                                        interpolation, image.data());
                      sweep.BlackenUnlit(image.data());
                      sweep.CopyFrame(frames[k], truth.data());
                      psnr[n] = Psnr(image.data(), truth.data(), image.size());
                    });
  double sum = 0;
  for (double value : psnr)
  {
    sum += value;
  }
  return sum / static_cast<double>(scored);
}

}  // namespace bigus
