// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Whether pictures change as poses say that the probe moves. Where they do not, it is only said.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "Core/Inspection/Rules.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr std::size_t kRun = 512;     // frames in a row, in the middle of the sweep
constexpr int kFine = 7;              // blocks
constexpr double kAlikeEnough = 0.2;  // correlation of neighbours
// How many times as far as across a picture its detail reaches along the path. Sweeps that are right have 0.6 to 3.5 (liver,
// brain, spine, wires: 1.1 to 2.2), for a beam is as thick as it is wide, or somewhat thicker.
constexpr double kShort = 0.3, kLong = 10;
constexpr double kShortAtCentre =
    0.6;  // where the probe rocks about the skin, the centre moves and the corner does not
constexpr int kLags[] = {1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64};  // frames

// Order.
constexpr std::size_t kChained = 256;  // frames, evenly spread: their distances are measured in pairs
constexpr double kJumps = 0.125;       // of the way to the farthest frame; a stroke of a probe has more frames than 8
// Strokes of one direction have less than half of their path in the jumps between, and the shortest way through n shuffled
// frames is n / 3 times as short. Of names in the order of their letters (1, 10, 2) single frames lie off the path: FindLostTracking.
constexpr double kTangled = 3, kMostlyJumps = 0.6;
constexpr double kAlikeByChain = 1.2;  // times what neighbours in the chain differ by

// Sliding.
constexpr int kSmooth = 4;        // frames before and after, over which the path is averaged: trackers have noise
constexpr double kSlides = 0.75;  // blocks, from which on a picture that slides is another
constexpr double kFollows = 0.7;  // of the correlation of pictures as they are: less when they are moved as poses say
constexpr double kSureOf = 4;     // standard errors
constexpr std::size_t kFewPairs = 8;

/// The way at which a correlation has fallen to `half`, between the ways that are given; nothing where it has not.
std::optional<double> WayTo(double half, const std::vector<double>& ways, const std::vector<double>& alike)
{
  for (std::size_t k = 1; k < ways.size(); ++k)
  {
    if (alike[k] < half)
    {
      return ways[k - 1] + (ways[k] - ways[k - 1]) * (alike[k - 1] - half) / (alike[k - 1] - alike[k]);
    }
  }
  return std::nullopt;
}

/// What changes along a sweep, of the frames from `first` on.
struct Changing
{
  std::size_t first = 0;
  std::vector<cv::Mat> details;  // without the mean of all frames and broad brightness
  double square = 0;             // mean
};

Changing ChangesOf(const Pictures& pictures)
{
  const std::size_t count = std::min(pictures.small.size(), kRun), first = (pictures.small.size() - count) / 2;
  cv::Mat mean = cv::Mat::zeros(pictures.height, pictures.width, CV_32F);
  for (std::size_t k = first; k < first + count; ++k)
  {
    mean += ImageOf(pictures, k) / static_cast<double>(count);
  }
  Changing changing{first, {}, 0};
  for (std::size_t k = first; k < first + count; ++k)
  {
    const cv::Mat change = ImageOf(pictures, k) - mean;
    cv::Mat broad;
    cv::blur(change, broad, {kFine, kFine}, {-1, -1}, cv::BORDER_REFLECT_101);
    const cv::Mat detail = change - broad;
    changing.details.push_back(detail);
    changing.square += detail.dot(detail) / static_cast<double>(count * detail.total());
  }
  return changing;
}

/// How far detail reaches across pictures, in blocks along columns or rows: the way to a correlation of a half.
double ReachAcross(const Changing& changing, bool alongRows)
{
  std::vector<double> ways, alike;
  for (int shift = 0; shift < kFine; ++shift)
  {
    double sum = 0, count = 0;
    for (const cv::Mat& detail : changing.details)
    {
      const int length = alongRows ? detail.cols : detail.rows;
      const auto part = [&](int from, int to)
      { return alongRows ? detail.colRange(from, to) : detail.rowRange(from, to); };
      sum += part(shift, length).dot(part(0, length - shift));
      count += static_cast<double>(part(shift, length).total());
    }
    ways.push_back(shift);
    alike.push_back(sum / (count * changing.square));
  }
  return WayTo(0.5, ways, alike).value_or(kFine);
}

/// How alike pictures are some frames apart, and the median ways between, mm.
struct Along
{
  std::vector<double> centre, corner;  // of the image, and of its pixel (0, 0), which no rotation of the matrix moves
  std::vector<double> alike;           // correlation
};

Along CompareAlong(const Sweep& sweep, const std::vector<int>& frames, const Changing& changing)
{
  const std::vector<cv::Mat>& details = changing.details;
  Along along;
  for (std::size_t lag : kLags)
  {
    std::vector<double> centre, corner;
    double sum = 0;
    for (std::size_t k = 0; k + lag < details.size(); ++k)
    {
      const SlicePlane one = sweep.Plane(frames[changing.first + k]),
                       other = sweep.Plane(frames[changing.first + k + lag]);
      centre.push_back((CentreOf(other) - CentreOf(one)).norm());
      corner.push_back((other.origin - one.origin).norm());
      sum += details[k].dot(details[k + lag]) / static_cast<double>(details[k].total());
    }
    if (!centre.empty())
    {
      along.alike.push_back(sum / (static_cast<double>(centre.size()) * changing.square));
      along.centre.push_back(ShareBelow(std::move(centre), 0.5));
      along.corner.push_back(ShareBelow(std::move(corner), 0.5));
    }
  }
  return along;
}

/// Speckle reaches about as far out of the plane as across it, whatever the probe.
std::optional<Finding> DoubtScale(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames,
                                  const Changing& changing)
{
  const Along along = CompareAlong(sweep, frames, changing);
  if (along.alike.empty() || along.alike[0] < kAlikeEnough)
  {
    return std::nullopt;
  }
  const SlicePlane plane = sweep.Plane(frames[changing.first]);
  const double across = std::sqrt(ReachAcross(changing, true) * plane.columnStep.norm() * sweep.width / pictures.width *
                                  ReachAcross(changing, false) * plane.rowStep.norm() * sweep.height / pictures.height);
  // Noise makes neighbours less alike, so that pictures seem to change too soon: their own correlation is the measure.
  const double half = 0.5 * along.alike[0];
  const std::optional<double> corner = WayTo(half, along.corner, along.alike),
                              centre = WayTo(half, along.centre, along.alike);
  const double late = along.alike[0] < 0.5 ? 0 : WayTo(0.5, along.centre, along.alike).value_or(along.centre.back());
  const bool isShort = corner && *corner < kShort * across && *centre < kShortAtCentre * across;
  if (!isShort && late <= kLong * across)
  {
    return std::nullopt;
  }
  const std::string said = Format("%.2g mm along the path change pictures as much as ", isShort ? *corner : late) +
                           Format("%.2g mm across them: translations may be ", across) +
                           (isShort ? "in centimetres, and must be in millimetres (--units cm of bigus.convert); or "
                                      "pixels are given too large, or tissue moves by itself"
                                    : "ten times too long, or pixels are given too small");
  return Finding{FindingKind::Poses, {}, 0, false, said};
}

/// Where the probe is, without most of the tracker's noise: means over frames around each.
struct SmoothPath
{
  std::vector<Eigen::Vector3d> centres, columns, rows;  // mm, and mm a pixel
};

SmoothPath SmoothPathOf(const Sweep& sweep, const std::vector<int>& frames, const Changing& changing)
{
  const int count = static_cast<int>(changing.details.size());
  SmoothPath path;
  for (int k = kSmooth; k + kSmooth < count; ++k)
  {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero(), column = centre, row = centre;
    for (int j = k - kSmooth; j <= k + kSmooth; ++j)
    {
      const SlicePlane plane = sweep.Plane(frames[changing.first + static_cast<std::size_t>(j)]);
      centre += CentreOf(plane) / (2 * kSmooth + 1);
      column += plane.columnStep / (2 * kSmooth + 1);
      row += plane.rowStep / (2 * kSmooth + 1);
    }
    path.centres.push_back(centre);
    path.columns.push_back(column);
    path.rows.push_back(row);
  }
  return path;
}

/// Correlation of what both show where `to` is moved by so many blocks; nothing where less than a quarter is left.
std::optional<double> AlikeMoved(const cv::Mat& from, const cv::Mat& to, const Eigen::Vector2d& blocks)
{
  const int left = static_cast<int>(std::ceil(std::abs(blocks[0]))),
            top = static_cast<int>(std::ceil(std::abs(blocks[1])));
  const cv::Rect both(blocks[0] > 0 ? left : 0, blocks[1] > 0 ? top : 0, from.cols - left, from.rows - top);
  if (both.width <= 0 || both.height <= 0 || 4 * static_cast<std::size_t>(both.area()) < from.total())
  {
    return std::nullopt;
  }
  cv::Mat moved;
  cv::warpAffine(to, moved, cv::Matx23d(1, 0, blocks[0], 0, 1, blocks[1]), to.size(), cv::INTER_LINEAR);
  return Correlation(from(both), moved(both));
}

/// Poses whose motion lies within the picture say how it slides. Where it does not, and is more alike as it is, the motion has
/// a wrong direction.
std::optional<Finding> DoubtDirection(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames,
                                      const Changing& changing)
{
  const SmoothPath path = SmoothPathOf(sweep, frames, changing);
  for (const std::size_t lag : kLags)
  {
    std::vector<double> ways, still, less;
    for (std::size_t k = 0; k + lag < path.centres.size(); ++k)
    {
      const Eigen::Vector3d way = path.centres[k + lag] - path.centres[k];
      const Eigen::Vector2d blocks(
          way.dot(path.columns[k]) / path.columns[k].squaredNorm() * pictures.width / sweep.width,
          way.dot(path.rows[k]) / path.rows[k].squaredNorm() * pictures.height / sweep.height);
      const cv::Mat &from = changing.details[k + kSmooth], &to = changing.details[k + kSmooth + lag];
      const std::optional<double> moved = AlikeMoved(from, to, blocks);
      ways.push_back(blocks.norm());
      if (moved)
      {
        still.push_back(AlikeMoved(from, to, {0, 0}).value_or(0));
        less.push_back(still.back() - *moved);
      }
    }
    if (still.size() < kFewPairs)
    {
      return std::nullopt;
    }
    if (ShareBelow(ways, 0.5) < kSlides)
    {
      continue;
    }
    const double alike = Mean(still), loss = Mean(less);
    if (alike < kAlikeEnough)
    {
      return std::nullopt;
    }
    // Pairs that share frames tell little more than those that do not.
    const double error =
        std::sqrt(MeanSquare(less, loss) * static_cast<double>(lag) / static_cast<double>(less.size()));
    if (alike - loss > kFollows * alike || loss < kSureOf * error)
    {
      continue;
    }
    const double pixel = sweep.Plane(frames[changing.first]).PixelSize() * sweep.width / pictures.width;
    return Finding{
        FindingKind::Poses,
        {},
        0,
        false,
        "by the poses pictures slide " + Format("%.2g", ShareBelow(ways, 0.5) * pixel) + " mm in their own plane in " +
            std::to_string(lag) + (lag == 1 ? " frame" : " frames") + ", and they do not: their correlation is " +
            Format("%.2f", alike) + ", and " + Format("%.2f", alike - loss) +
            " where they are moved so. Transforms may lead the other way, have rows for columns or a quaternion's "
            "numbers in another order, the calibration's axes may not be the picture's, or tissue moves with the "
            "probe"};
  }
  return std::nullopt;
}

/// From the one that is farthest from the first on, always the nearest that is left: as a probe would pass them.
std::vector<std::size_t> ChainOf(const Sweep& sweep, const std::vector<int>& frames, std::vector<std::size_t> left)
{
  std::vector<std::size_t> chain;
  for (int from = frames[left[0]]; !left.empty(); from = frames[chain.back()])
  {
    const auto nearer = [&](std::size_t a, std::size_t b)
    { return Moved(sweep, from, frames[a]) < Moved(sweep, from, frames[b]); };
    const auto next = chain.empty() ? std::max_element(left.begin(), left.end(), nearer)
                                    : std::min_element(left.begin(), left.end(), nearer);
    chain.push_back(*next);
    left.erase(next);
  }
  return chain;
}

/// Where most of the path is jumps over much of the sweep, and pictures change less along the shortest way, frames are listed
/// in a wrong order. Strokes of a probe that comes back have few jumps, and none within a stroke.
std::optional<Finding> DoubtListing(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames)
{
  std::vector<std::size_t> places(frames.size());
  std::iota(places.begin(), places.end(), std::size_t(0));
  const std::vector<std::size_t> listed = EvenlySpread(places, kChained), chain = ChainOf(sweep, frames, listed);
  const double jump = kJumps * Moved(sweep, frames[listed[0]], frames[chain[0]]);
  double asListed = 0, byChain = 0, jumps = 0, alongJumps = 0, alongChain = 0, count = 0;
  for (std::size_t k = 1; k < listed.size(); ++k)
  {
    const double step = Moved(sweep, frames[listed[k - 1]], frames[listed[k]]);
    asListed += step;
    byChain += Moved(sweep, frames[chain[k - 1]], frames[chain[k]]);
    alongChain += Difference(pictures, chain[k - 1], chain[k]);
    if (step > jump)
    {
      jumps += step;
      alongJumps += Difference(pictures, listed[k - 1], listed[k]);
      ++count;
    }
  }
  if (count == 0 || asListed < kTangled * byChain || jumps < kMostlyJumps * asListed ||
      alongJumps / count < kAlikeByChain * alongChain / static_cast<double>(listed.size() - 1))
  {
    return std::nullopt;
  }
  return Finding{FindingKind::Poses,
                 {},
                 0,
                 false,
                 "frames may be listed in a wrong order: the probe's path is " + Format("%.0f", asListed) +
                     " mm long as listed and " + Format("%.0f", byChain) +
                     " mm from each frame to the nearest, along which pictures change less"};
}

}  // namespace

std::optional<Finding> DoubtMotion(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames)
{
  if (std::optional<Finding> listing = DoubtListing(sweep, pictures, frames))
  {
    return listing;
  }
  const Changing changing = std::min(pictures.width, pictures.height) < 2 * kFine ? Changing() : ChangesOf(pictures);
  if (!(changing.square > 0))
  {
    return std::nullopt;
  }
  std::optional<Finding> scale = DoubtScale(sweep, pictures, frames, changing);
  return scale ? scale : DoubtDirection(sweep, pictures, frames, changing);
}

}  // namespace bigus
