// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Label weights of Gaussians, from label pictures of frames.
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "Core/Engine/ViewEngine.h"
#include "Core/Evaluation/Baselines.h"
#include "Core/Labels/Labels.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/OpenCv.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Slicing/Pixels.h"

namespace bigus
{
namespace
{

constexpr std::size_t kTogether = 8;     // frames walked over at once
constexpr double kMostCandidates = 1e6;  // a lattice with more becomes coarser
/// Of the mean coverage: what footprints may leave out of it at a pixel. A share is off by at most twice that.
constexpr double kTolerance = 1e-3;

constexpr float kFade = 4;   // pixels on either side of a border over which a label fades
constexpr float kReach = 8;  // pixels up to which distances count: a label that ends between frames does so as gently
constexpr double kFollowed = 16;  // pixels up to which distances tell how a shape has moved from frame to frame
constexpr double kFine = 2;       // pixels between further carriers along borders
constexpr double kFinest = 0.7;   // the same where drawn frames lie closer
constexpr double kCoarse = 2;     // times that, inside; 4 left holes where a picture's edge cuts a label
constexpr double kOverlap = 0.7;  // a carrier's standard deviation, of the distance to the next

float Soft(float distance)
{
  return std::clamp(0.5f + 0.5f * distance / kFade, 0.0f, 1.0f);
}

/// Pixels from each pixel to the border of a mask, positive inside.
cv::Mat SignedDistances(const cv::Mat& inside)
{
  cv::Mat distances, away;
  cv::distanceTransform(inside, distances, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::distanceTransform(~inside, away, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  // Distances count from centres of pixels, and the border lies half a pixel before the next one's.
  cv::subtract(distances, 0.5, distances, inside);
  cv::subtract(away, 0.5, away, ~inside);
  return distances - away;
}

/// Where the pixels of one plane meet another along the mean of their normals: (i, j, 1) to (i, j).
Eigen::Matrix<double, 2, 3, Eigen::RowMajor> AlongNormals(const SlicePlane& from, const SlicePlane& to)
{
  const double side = from.Normal().dot(to.Normal()) < 0 ? -1 : 1;
  const Eigen::Vector3d along = from.Normal() + side * to.Normal();
  const Eigen::Matrix3d toSlice = to.WorldToSlice();
  const auto meet = [&](double i, double j) -> Eigen::Vector2d
  {
    const Eigen::Vector3d p = toSlice * (from.Point(i, j) - to.origin), step = toSlice * along;
    return (p - p[2] / step[2] * step).head<2>();
  };
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> affine;
  affine << meet(1, 0) - meet(0, 0), meet(0, 1) - meet(0, 0), meet(0, 0);
  return affine;
}

/// How a shape has moved from one plane to another, by optical flow of its signed distances.
PixelMoves MovesOf(const SlicePlane& from, const cv::Mat& distances, const SlicePlane& to, const cv::Mat& next)
{
  auto affine = AlongNormals(from, to);
  PixelMoves found;
  if (!affine.allFinite())
  {
    return found;
  }
  const auto bytesOf = [](const cv::Mat& all)
  {
    cv::Mat bytes = cv::min(cv::max(all, -kFollowed), kFollowed);  // a picture that is filled has no border
    bytes.convertTo(bytes, CV_8U, 127.5 / kFollowed, 127.5);
    return bytes;
  };
  cv::Mat warped, flow;
  cv::warpAffine(bytesOf(next), warped, cv::Mat(2, 3, CV_64F, affine.data()), distances.size(),
                 cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  const cv::Mat here = bytesOf(distances);
  const cv::Rect box = cv::boundingRect(here | warped);
  const int levels = 4, window = 31, iterations = 5, size = 7;  // size and width: the pair that OpenCV recommends
  const double pyramid = 0.5, width = 1.5;
  cv::calcOpticalFlowFarneback(here(box), warped(box), flow, pyramid, levels, window, iterations, size, width,
                               cv::OPTFLOW_FARNEBACK_GAUSSIAN);
  found = {box.x, box.y, box.width, box.height, {}};
  found.moves.assign(flow.ptr<float>(), flow.ptr<float>() + 2 * box.area());
  return found;
}

/// Distances on the plane `of`, where pixels of `plane` come from by so many times their moves.
cv::Mat AlongMoves(const SlicePlane& plane, const PixelMoves& moves, double times, const SlicePlane& of,
                   const cv::Mat& distances)
{
  const auto affine = AlongNormals(plane, of);
  cv::Mat places(distances.size(), CV_32FC2), found;
  for (int p = 0; p < plane.width * plane.height; ++p)
  {
    const int i = p % plane.width, j = p / plane.width;
    const Eigen::Vector2d from = affine * (Eigen::Vector2d(i, j) + times * moves.At(i, j)).homogeneous();
    places.at<cv::Vec2f>(j, i) = cv::Vec2d(from[0], from[1]);
  }
  cv::remap(distances, found, places, {}, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return found;
}

/// A label's signed distances in its frames as a sweep to interpolate: 1/2 at a border, 0 and 1 kReach pixels away.
/// Behind the last drawn frame of a sequence, and before the first, one has no label. Where the sweep ends there, too,
/// one lies between, as far away as the frame before, on which the label goes on as it came.
class Shapes
{
public:
  Shapes(const Sweep& sweep, const LabelFrames& given) : sweep_(sweep), given_(given)
  {
    shapes_.width = sweep.width;
    shapes_.height = sweep.height;
    shapes_.pixelType = Sweep::PixelType::Float32;
    int place = 0;
    for (const std::vector<int>& own : BySequence(sweep, given.frames))
    {
      AddEnd(own.front(), own[own.size() > 1 ? 1 : 0], -1);
      for (const int frame : own)
      {
        Add(place++, frame, Eigen::Vector3d::Zero(), sweep.SequenceOf(frame));
      }
      AddEnd(own.back(), own[own.size() > 1 ? own.size() - 2 : 0], 1);
    }
  }

  /// Takes the shapes of one label. `soft` gets its soft pictures of the frames given, 0 to 255. False where no frame
  /// has it.
  bool Take(int value, std::uint8_t* soft)
  {
    const auto count = static_cast<int>(pictures_.size());
    levels_.create(count * sweep_.height, sweep_.width, CV_32F);
    std::vector<cv::Mat> shown(pictures_.size());  // signed distances; empty where a frame does not show it
    for (int f = 0; f < count; ++f)
    {
      const cv::Mat inside = pictures_[f] < 0 ? cv::Mat() : ShownOn(f, value);
      if (cv::countNonZero(inside) > 0)
      {
        shown[f] = SignedDistances(inside);
        SetLevels(f, shown[f]);
        cv::Mat bytes(inside.size(), CV_8U, soft + sweep_.PixelsPerFrame() * pictures_[f]);
        shown[f].convertTo(bytes, CV_8U, 127.5 / kFade, 127.5);
      }
      if (f > 0)
      {
        const bool isFollowed = !shown[f - 1].empty() && !shown[f].empty();
        moves_.push_back(isFollowed ? MovesOf(shapes_.Plane(f - 1), shown[f - 1], shapes_.Plane(f), shown[f])
                                    : PixelMoves());
      }
    }
    if (std::all_of(shown.begin(), shown.end(), [](const cv::Mat& shape) { return shape.empty(); }))
    {
      return false;
    }
    FillAbsent(shown);
    for (int f = 0; f < count; ++f)
    {
      if (pictures_[f] == kGoesOn)
      {
        FillEnd(shown, f);
      }
    }
    shapes_.pixels = std::shared_ptr<const void>(std::make_shared<cv::Mat>(levels_), levels_.data);
    return true;
  }

  /// Signed distances of points, pixels, positive inside.
  std::vector<float> DistancesAt(const std::vector<Eigen::Vector3d>& points) const
  {
    std::vector<float> distances = PoseInterpolationAt(shapes_, AllFrames(shapes_), points, moves_);
    for (float& distance : distances)
    {
      distance = (distance - 0.5f) * 2 * kReach;
    }
    return distances;
  }

  /// Where the label was drawn, and as far as the frames beside.
  Eigen::AlignedBox3d Box(int value) const
  {
    Eigen::AlignedBox3d box;
    for (std::size_t f = 0; f < pictures_.size(); ++f)
    {
      const cv::Rect own = pictures_[f] < 0 ? cv::Rect() : cv::boundingRect(ShownOn(f, value));
      for (std::size_t near = f - (f > 0); !own.empty() && near < std::min(f + 2, pictures_.size()); ++near)
      {
        const SlicePlane plane = shapes_.Plane(static_cast<int>(near));
        for (int corner = 0; corner < 4; ++corner)
        {
          box.extend(plane.Point(own.x + corner % 2 * (own.width - 1), own.y + corner / 2 * (own.height - 1)));
        }
      }
    }
    return box;
  }

  /// mm between neighbouring drawn frames, median.
  double Gap() const
  {
    std::vector<double> gaps;
    for (std::size_t f = 1; f < pictures_.size(); ++f)
    {
      gaps.push_back(Between(static_cast<int>(f), static_cast<int>(f - 1)));
    }
    std::sort(gaps.begin(), gaps.end());
    return Quantile(gaps, 0.5);
  }

private:
  static constexpr int kNoPicture = -1, kGoesOn = -2;

  static Eigen::Vector3d Centre(const SlicePlane& plane)
  {
    return plane.Point(0.5 * (plane.width - 1), 0.5 * (plane.height - 1));
  }

  double Between(int f, int g) const { return (Centre(shapes_.Plane(f)) - Centre(shapes_.Plane(g))).norm(); }  // mm

  /// Behind the last frame (`side` 1) or before the first: one without a label, as far away as `next`, or as a label
  /// fades where there is no such. Where the sweep ends before another could have been drawn, nothing says that the
  /// label does, so twice as far, behind one on which it goes on.
  void AddEnd(int frame, int next, int side)
  {
    const SlicePlane plane = sweep_.Plane(frame);
    const int beyond = frame + (next == frame ? side : frame - next);
    const Eigen::Vector3d step = next == frame ? Eigen::Vector3d(side * kFade * plane.PixelSize() * plane.Normal())
                                               : Eigen::Vector3d(Centre(plane) - Centre(sweep_.Plane(next)));
    const bool isCut =
        beyond < 0 || beyond >= sweep_.NumberOfFrames() || sweep_.SequenceOf(beyond) != sweep_.SequenceOf(frame);
    const int sequence = sweep_.SequenceOf(frame);
    if (!isCut)
    {
      return Add(kNoPicture, frame, step, sequence);
    }
    // Of another sequence, what has no label ends it half way, but bends nothing before.
    for (const bool isFar : {side == -1, side == 1})
    {
      isFar ? Add(kNoPicture, frame, 2 * step, ~sequence)
            : Add(kGoesOn, frame, step.dot(plane.Normal()) * plane.Normal(), sequence);
    }
  }

  void Add(int picture, int frame, const Eigen::Vector3d& shift, int sequence)
  {
    pictures_.push_back(picture);
    shapes_.imageToReference.push_back(sweep_.imageToReference[frame]);
    shapes_.imageToReference.back().topRightCorner<3, 1>() += shift;
    shapes_.sequences.push_back(sequence);
  }

  /// Where the picture shows a label.
  cv::Mat ShownOn(std::size_t f, int value) const
  {
    return MaskOf(&given_.pixels[sweep_.PixelsPerFrame() * pictures_[f]], sweep_.width, sweep_.height, value);
  }

  cv::Mat LevelsOf(int f) { return levels_.rowRange(f * sweep_.height, (f + 1) * sweep_.height); }

  void SetLevels(int f, const cv::Mat& distances)
  {
    cv::Mat levels = LevelsOf(f);
    distances.convertTo(levels, CV_32F, 0.5 / kReach, 0.5);
    cv::min(levels, 1, levels);
    cv::max(levels, 0, levels);
  }

  /// Where a frame has no label it ends half way to it, where it is deepest.
  void FillAbsent(const std::vector<cv::Mat>& shown)
  {
    const auto depthOf = [&shown](std::size_t f)
    {
      double depth = 0;
      if (f < shown.size() && !shown[f].empty())
      {
        cv::minMaxLoc(shown[f], nullptr, &depth);
      }
      return std::min(static_cast<float>(depth), kReach);  // a picture that is filled has no border
    };
    for (std::size_t f = 0; f < shown.size(); ++f)
    {
      if (!shown[f].empty())
      {
        continue;
      }
      float depth = 0;
      for (std::size_t away = 1; away < shown.size() && depth == 0; ++away)
      {
        depth = std::max(depthOf(f - away), depthOf(f + away));  // none before the first, where f - away wraps
      }
      LevelsOf(static_cast<int>(f)).setTo(0.5f - 0.5f * depth / kReach);
    }
  }

  /// Where a label goes on behind the end `f` of a sweep: along its last moves, thinner by as much as it became, and by more
  /// where that was on the rise. What grew does not go on growing. Half way to none where only the last frame has it.
  void FillEnd(const std::vector<cv::Mat>& shown, int f)
  {
    const int side = f > 0 && pictures_[f - 1] >= 0 ? -1 : 1, last = f + side, before = last + side;
    const int first = std::clamp(before + side, 0, static_cast<int>(shown.size()) - 1);
    PixelMoves& moves = moves_[std::min(f, last)];
    if (!shown[last].empty() && !shown[before].empty())
    {
      moves = MovesOf(shapes_.Plane(last), shown[last], shapes_.Plane(before), shown[before]);
    }
    if (moves.moves.empty())
    {
      cv::Mat levels = LevelsOf(f);
      cv::addWeighted(LevelsOf(last), 0.5, LevelsOf(f - side), 0.5, 0, levels);
      return;
    }
    const auto cameFrom = [&](double steps, int frame)
    { return AlongMoves(shapes_.Plane(last), moves, steps, shapes_.Plane(frame), shown[frame]); };
    cv::Mat moved = cameFrom(1, last), was = cameFrom(2, before), change = moved - was;
    cv::GaussianBlur(change, change, {}, kReach);
    cv::Mat next = cv::min(change, 0);
    const double gaps = Between(first, before) / Between(before, last);
    if (!shown[first].empty() && gaps > 0.5 && gaps < 2)  // the slope that the parabola through the three ends with
    {
      cv::Mat earlier = (was - cameFrom(2 + gaps, first)) / gaps;
      cv::GaussianBlur(earlier, earlier, {}, kReach);
      next = cv::min(next, change + (change - earlier) / (1 + gaps));
    }
    SetLevels(f, moved + next);
    for (float& move : moves.moves)
    {
      move *= static_cast<float>(side);
    }
  }

  const Sweep& sweep_;
  const LabelFrames& given_;
  std::vector<int> pictures_;      // [frames of shapes_] place in given_
  cv::Mat levels_;                 // [frames of shapes_ * height][width]
  std::vector<PixelMoves> moves_;  // [frames of shapes_ but the last]
  Sweep shapes_;
};

/// The corners of a lattice over a box.
std::vector<Eigen::Vector3d> LatticeOver(const Eigen::AlignedBox3d& box, double step)
{
  const Eigen::Array<std::int64_t, 3, 1> counts = (box.sizes().array() / step).cast<std::int64_t>() + 1;
  std::vector<Eigen::Vector3d> points(static_cast<std::size_t>(counts.prod()));
  for (std::int64_t at = 0; at < counts.prod(); ++at)
  {
    points[at] =
        box.min() + step * Eigen::Vector3d(at % counts[0], at / counts[0] % counts[1], at / counts[0] / counts[1]);
  }
  return points;
}

/// Further carriers of a label, a fine lattice along its border and a coarse one inside it.
void AddPoints(const Shapes& shapes, int value, double pixel, FieldLabels& labels)
{
  Eigen::AlignedBox3d box = shapes.Box(value);
  const Eigen::Vector3d rim = Eigen::Vector3d::Constant(kFade * pixel);
  box = Eigen::AlignedBox3d(box.min() - rim, box.max() + rim);
  const double fine =
      std::max({std::min(kFine * pixel, shapes.Gap()), kFinest * pixel, std::cbrt(box.volume() / kMostCandidates)});
  for (const bool isFine : {true, false})
  {
    const double step = isFine ? fine : kCoarse * fine, width = static_cast<float>(kOverlap * step);
    const std::vector<Eigen::Vector3d> candidates = LatticeOver(box, step);
    const std::vector<float> distances = shapes.DistancesAt(candidates);
    for (std::size_t i = 0; i < candidates.size(); ++i)
    {
      if (isFine ? std::abs(distances[i]) <= kFade : distances[i] >= kFade)
      {
        labels.points.emplace_back(candidates[i].x(), candidates[i].y(), candidates[i].z(), width);
      }
    }
  }
}

/// Carriers, with weights by what lies between the frames, and the soft pictures to fit them to,
/// [labels][frames][height][width].
FieldLabels Interpolated(const GaussianField& field, const Sweep& sweep, const LabelFrames& given,
                         std::vector<std::uint8_t>& soft)
{
  const std::size_t labels = given.labels.size(), pixels = given.pixels.size();
  FieldLabels start{given.labels, {}, {}};
  soft.assign(labels * pixels, 0);
  std::vector<Shapes> shapes(labels, Shapes(sweep, given));
  std::vector<bool> isThere;
  for (std::size_t k = 0; k < labels; ++k)
  {
    isThere.push_back(shapes[k].Take(given.labels[k].value, &soft[k * pixels]));
    if (isThere[k])
    {
      AddPoints(shapes[k], given.labels[k].value, sweep.Plane(given.frames[0]).PixelSize(), start);
    }
  }
  const std::vector<Eigen::Vector3d> places = start.Carriers(field).means;
  start.weights.assign(places.size() * labels, 0.0f);
  for (std::size_t k = 0; k < labels; ++k)
  {
    const std::vector<float> distances = isThere[k] ? shapes[k].DistancesAt(places) : std::vector<float>();
    for (std::size_t i = 0; i < distances.size(); ++i)
    {
      start.weights[i * labels + k] = Soft(distances[i]);
    }
  }
  return start;
}

/// Least squares of shares against label pictures, by simultaneous iterations:
///   w_i += sum_p m_i(p) (y(p) - y'(p)) / C(p)  /  sum_p m_i(p) / C(p),   y' = sum_i w_i m_i / C,   C = sum_i m_i,
/// which never go away from the solution, since the rows of diag(1/C) A sum to 1.
class Fit
{
public:
  Fit(const GaussianField& carriers, const Sweep& sweep, const LabelFrames& given,
      const std::vector<std::uint8_t>& soft, const std::string& engine)
      : sweep_(sweep), given_(given), soft_(soft), engine_(Engine::Create(engine)), walker_(ViewEngine::Of(*engine_))
  {
    Require(walker_, "Labels: the engine '", engine, "' cannot fit them; take cpu.");
    engine_->SetFrames(std::make_shared<const Sweep>(sweep));
    engine_->SetField(carriers);
    // Of S, that is gamma times as much of I.
    const double share = kTolerance * carriers.transfer.gamma * SpreadOf(carriers).MeanCoverage();
    engine_->SetAccuracy({std::min(share, 1.0)});
  }

  /// One pass over all frames; false when `goOn`, told of every few, says stop.
  bool Improve(FieldLabels& now, const std::function<bool(double)>& goOn)
  {
    const std::size_t labels = now.labels.size(), n = now.weights.size() / labels;
    std::vector<double> changes(now.weights.size(), 0.0), seen(n, 0.0);
    for (std::size_t first = 0; first < given_.frames.size(); first += kTogether)
    {
      const std::size_t last = std::min(first + kTogether, given_.frames.size());
      const std::vector<int> frames(given_.frames.begin() + first, given_.frames.begin() + last);
      inverse_.resize(frames.size() * sweep_.PixelsPerFrame());
      std::vector<float> weights(frames.size() * n, 1.0f);
      Gather(
          frames, weights, [this](std::size_t f, int row, float* line) { Invert(f, row, line); }, 1, seen.data());
      for (std::size_t k = 0; k < labels; ++k)
      {
        for (std::size_t at = 0; at < weights.size(); ++at)
        {
          weights[at] = now.weights[at % n * labels + k];
        }
        const std::uint8_t* const soft = &soft_[k * given_.pixels.size() + first * sweep_.PixelsPerFrame()];
        const auto compare = [&](std::size_t f, int row, float* line) { Compare(soft, f, row, line); };
        Gather(frames, weights, compare, labels, &changes[k]);
      }
      if (!goOn(static_cast<double>(last) / given_.frames.size()))
      {
        return false;
      }
    }
    for (std::size_t at = 0; at < changes.size(); ++at)
    {
      if (seen[at / labels] > 0)
      {
        const auto change = static_cast<float>(changes[at] / seen[at / labels]);
        now.weights[at] = std::clamp(now.weights[at] + change, 0.0f, 1.0f);
      }
    }
    return true;
  }

private:
  /// Adds to every `stride`th of the sums what the Gaussians' footprints have of the changed pixels of all frames.
  void Gather(const std::vector<int>& frames, const std::vector<float>& weights, const ViewEngine::ChangeRow& change,
              std::size_t stride, double* sums)
  {
    walker_->Walk(frames, weights, change, &gathered_);
    const std::size_t n = weights.size() / frames.size();
    for (std::size_t at = 0; at < gathered_.size(); ++at)
    {
      sums[at % n * stride] += gathered_[at];
    }
  }

  /// C to 1 / C, which is kept.
  void Invert(std::size_t f, int row, float* line)
  {
    for (int i = 0; i < sweep_.width; ++i)
    {
      const std::size_t pixel = static_cast<std::size_t>(row) * sweep_.width + i;
      line[i] = line[i] > 0 && sweep_.IsLit(pixel) ? 1 / line[i] : 0.0f;
      inverse_[f * sweep_.PixelsPerFrame() + pixel] = line[i];
    }
  }

  /// sum_i w_i m_i to (y - y') / C.
  void Compare(const std::uint8_t* soft, std::size_t f, int row, float* line) const
  {
    const std::size_t begin = f * sweep_.PixelsPerFrame() + static_cast<std::size_t>(row) * sweep_.width;
    for (int i = 0; i < sweep_.width; ++i)
    {
      const float inverse = inverse_[begin + i];
      line[i] = (soft[begin + i] / 255.0f - line[i] * inverse) * inverse;
    }
  }

  const Sweep& sweep_;
  const LabelFrames& given_;
  const std::vector<std::uint8_t>& soft_;
  std::unique_ptr<Engine> engine_;
  ViewEngine* walker_;
  std::vector<float> inverse_, gathered_;
};

}  // namespace

FieldLabels FitLabels(const GaussianField& field, const Sweep& sweep, const LabelFrames& given, const LabelFit& fit)
{
  field.Validate();
  given.Validate(sweep);
  Require(field.Size() != 0, "Labels: the field has no Gaussian to carry them.");
  try
  {
    std::vector<std::uint8_t> soft;
    FieldLabels labels = Interpolated(field, sweep, given, soft);
    Fit fitting(labels.Carriers(field), sweep, given, soft, fit.engine);
    for (int k = 0; k < fit.iterations; ++k)
    {
      const auto goOn = [&](double share) { return !fit.progress || fit.progress((k + share) / fit.iterations); };
      if (!fitting.Improve(labels, goOn))
      {
        return {};
      }
    }
    return labels;
  }
  catch (const cv::Exception& exception)
  {
    ThrowAsCores(exception);
  }
}

}  // namespace bigus
