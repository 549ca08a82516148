// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/StandardError/StandardError.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "Core/Model/Error.h"
#include "Core/Numerics/StateBytes.h"
#include "Core/StandardError/Inside.h"

namespace bigus
{
namespace
{

constexpr int kVersion = 1;

/// What the field leaves of the error of linear interpolation: 0.49 to 0.79 in folds of seven sweeps (README.md).
constexpr double kLeft = 0.7;
constexpr double kFloor = 0.5 / 255 * 0.5 / 255;  // half a grey level
constexpr double kAligned = 0.05;                 // of speckle is another, where a frame looks as the slice does
constexpr double kTile = 32;                      // pixels that share a search

constexpr double kInfinity = std::numeric_limits<double>::infinity();

const std::array<float, 256>& Decoded()
{
  static const std::array<float, 256> table = []
  {
    std::array<float, 256> values{};
    for (int code = 0; code < 256; ++code)
    {
      values[code] = static_cast<float>(std::exp2(code / 10.0 - 20));
    }
    return values;
  }();
  return table;
}

}  // namespace

std::uint8_t CodeOfVariance(double variance)
{
  return static_cast<std::uint8_t>(std::clamp(std::round(10 * (std::log2(std::max(variance, 1e-9)) + 20)), 1.0, 255.0));
}

std::vector<double> BoxSums(const std::vector<double>& values, int width, int height, int half)
{
  std::vector<double> across(values.size()), sums(values.size());
  for (int j = 0; j < height; ++j)
  {
    const double* row = &values[static_cast<std::size_t>(j) * width];
    for (int i = 0; i < width; ++i)
    {
      double sum = 0;
      for (int k = std::max(0, i - half); k <= std::min(width - 1, i + half); ++k)
      {
        sum += row[k];
      }
      across[static_cast<std::size_t>(j) * width + i] = sum;
    }
  }
  for (int j = 0; j < height; ++j)
  {
    double* out = &sums[static_cast<std::size_t>(j) * width];
    for (int k = std::max(0, j - half); k <= std::min(height - 1, j + half); ++k)
    {
      const double* row = &across[static_cast<std::size_t>(k) * width];
      for (int i = 0; i < width; ++i)
      {
        out[i] += row[i];
      }
    }
  }
  return sums;
}

/// What is kept of the frames at a point, mixed by nearness; NaN: not known.
struct StandardError::Terms
{
  double residual, rate, texture;
};

void StandardError::Derive()
{
  frames_.clear();
  bySequence_.clear();
  for (std::size_t k = 0; k < poses_.size(); ++k)
  {
    const SlicePlane plane = SlicePlane::FromImageToReference(poses_[k], width_, height_);
    const bool isFirst = k == 0 || sequences_[k] != sequences_[k - 1];
    const double sign = !isFirst && plane.Normal().dot(frames_.back().normal) < 0 ? -1 : 1;
    Eigen::Matrix3d toFrame = plane.WorldToSlice();
    toFrame.row(2) *= sign;
    frames_.push_back({plane, sign * plane.Normal(), toFrame});
    if (isFirst)
    {
      bySequence_.emplace_back();
    }
    bySequence_.back().push_back(static_cast<int>(k));
  }
}

std::size_t StandardError::Cells() const
{
  return static_cast<std::size_t>(CellColumns()) * ((height_ + cell_ - 1) / cell_);
}

bool StandardError::IsLit(double column, double row) const
{
  return column >= 0 && row >= 0 && column <= width_ - 1 && row <= height_ - 1 &&
         lit_[static_cast<std::size_t>(row + 0.5) * width_ + static_cast<std::size_t>(column + 0.5)] != 0;
}

//------------------------------------------------------------------------------
// The nearest frames

namespace
{

/// A frame that may be nearest somewhere in a tile. Coordinates are affine in the slice's: at + i alongColumns + j alongRows.
struct Candidate
{
  int frame;
  double least;  // mm, bound of the distance from below
  Eigen::Vector3d at, alongColumns, alongRows;

  Eigen::Vector3d operator()(int i, int j) const { return at + i * alongColumns + j * alongRows; }
};

constexpr double kOnFrame = 1e-4;   // mm: on the frame itself
constexpr double kRounding = 1e-6;  // mm, of a bound

}  // namespace

/// `found` has one element for each pixel of the window. What a pixel gets does not depend on tile or window: the smallest
/// distance, of equals the first frame.
void StandardError::Find(const SlicePlane& plane, const Engine::Window& window, const std::vector<int>& among,
                         std::vector<Beside>& found) const
{
  std::vector<Candidate> all;
  for (const int k : among)
  {
    const Frame& frame = frames_[k];
    all.push_back({k, 0, frame.toFrame * (plane.origin - frame.plane.origin), frame.toFrame * plane.columnStep,
                   frame.toFrame * plane.rowStep});
  }
  const int tile = static_cast<int>(kTile);
  const int across = (window.columns + tile - 1) / tile, down = (window.rows + tile - 1) / tile;
  const auto search = [&](int number)
  {
    const int left = window.firstColumn + number % across * tile, top = window.firstRow + number / across * tile;
    const int right = std::min(left + tile, window.firstColumn + window.columns) - 1;
    const int bottom = std::min(top + tile, window.firstRow + window.rows) - 1;
    for (int side = 0; side < 2; ++side)
    {
      const double sign = side == 0 ? 1 : -1;
      std::vector<Candidate> candidates;
      for (const Candidate& one : all)
      {
        Eigen::Vector3d low = Eigen::Vector3d::Constant(kInfinity), high = -low;
        for (const auto& [i, j] : {std::pair(left, top), {right, top}, {left, bottom}, {right, bottom}})
        {
          low = low.cwiseMin(one(i, j));
          high = high.cwiseMax(one(i, j));
        }
        const double farthest = side == 0 ? high[2] : -low[2];
        if (farthest >= -kOnFrame - kRounding && high[0] >= 0 && high[1] >= 0 && low[0] <= width_ - 1 &&
            low[1] <= height_ - 1)
        {
          candidates.push_back(one);
          candidates.back().least = (side == 0 ? low[2] : -high[2]) - kRounding;
        }
      }
      std::sort(candidates.begin(), candidates.end(),
                [](const Candidate& a, const Candidate& b)
                { return std::pair(a.least, a.frame) < std::pair(b.least, b.frame); });
      for (int j = top; j <= bottom; ++j)
      {
        for (int i = left; i <= right; ++i)
        {
          Beside& beside =
              found[static_cast<std::size_t>(j - window.firstRow) * window.columns + i - window.firstColumn];
          for (const Candidate& one : candidates)
          {
            if (one.least > beside.distance[side])
            {
              break;
            }
            const Eigen::Vector3d place = one(i, j);
            const double z = sign * place[2];
            const double distance = z <= kOnFrame ? 0 : z;
            if (z >= (side == 0 ? -kOnFrame : kOnFrame) &&
                std::pair(distance, one.frame) < std::pair(beside.distance[side], beside.frame[side]) &&
                IsLit(place[0], place[1]))
            {
              beside.frame[side] = one.frame;
              beside.distance[side] = distance;
              beside.column[side] = static_cast<float>(place[0]);
              beside.row[side] = static_cast<float>(place[1]);
            }
          }
        }
      }
    }
  };
  tbb::parallel_for(0, across * down, search);
}

/// Of several sequences the one whose frames lie nearest around the point.
std::vector<StandardError::Beside> StandardError::Nearest(const SlicePlane& plane, const Engine::Window& window) const
{
  std::vector<Beside> nearest(static_cast<std::size_t>(window.columns) * window.rows);
  for (const std::vector<int>& frames : bySequence_)
  {
    std::vector<Beside> found(nearest.size());
    Find(plane, window, frames, found);
    for (std::size_t p = 0; p < nearest.size(); ++p)
    {
      const bool isBetter = found[p].IsKnown() && (!nearest[p].IsKnown() || found[p].Apart() < nearest[p].Apart());
      nearest[p] = isBetter ? found[p] : nearest[p];
    }
  }
  return nearest;
}

std::vector<float> StandardError::Apart(const SlicePlane& plane) const
{
  std::vector<float> apart;
  for (const Beside& beside : Nearest(plane, {0, 0, plane.width, plane.height}))
  {
    apart.push_back(beside.IsKnown() ? static_cast<float>(beside.Apart()) : std::numeric_limits<float>::quiet_NaN());
  }
  return apart;
}

//------------------------------------------------------------------------------
// Any plane

/// 1 - (1 - sin turn) exp(-(direction / angle)^2) for each frame: `direction` between the beams, the columns of plane and
/// frame, and `turn` about them.
std::vector<double> StandardError::Turned(const SlicePlane& plane) const
{
  constexpr double kAngle = 2.5 * 3.14159265358979323846 / 180;  // sqrt 2 / (2 k sigma_E): 5 MHz, beam of 0.8 mm
  const Eigen::Vector3d beam = plane.rowStep.normalized(), normal = plane.Normal();
  std::vector<double> turned;
  for (const Frame& frame : frames_)
  {
    const double direction = std::acos(std::clamp(beam.dot(frame.plane.rowStep.normalized()), -1.0, 1.0)) / kAngle;
    const double cosine = normal.dot(frame.normal), along = beam.dot(frame.normal);
    const double sine = std::sqrt(std::clamp(1 - cosine * cosine - along * along, 0.0, 1.0));
    turned.push_back(1 - (1 - sine) * std::exp(-direction * direction));
  }
  return turned;
}

/// The same beyond what R has: how much was another where it was measured, at that frame.
std::vector<double> StandardError::TurnedFurther(const SlicePlane& plane) const
{
  std::vector<double> turned = Turned(plane);
  for (std::size_t k = 0; k < turned.size(); ++k)
  {
    turned[k] = std::clamp((turned[k] - usualTurn_[k]) / (1 - usualTurn_[k]), 0.0, 1.0);
  }
  return turned;
}

StandardError::Terms StandardError::Read(const Beside& beside) const
{
  const int columns = CellColumns(), rows = static_cast<int>(Cells() / columns);
  std::array<double, 3> sums{}, weights{};
  for (int side = 0; side < 2; ++side)
  {
    const double nearness = side == 0 ? beside.Nearness() : 1 - beside.Nearness();
    if (beside.frame[side] < 0 || nearness == 0)
    {
      continue;
    }
    const double x = std::clamp((beside.column[side] + 0.5) / cell_ - 0.5, 0.0, columns - 1.0);
    const double y = std::clamp((beside.row[side] + 0.5) / cell_ - 0.5, 0.0, rows - 1.0);
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    for (int corner = 0; corner < 4; ++corner)
    {
      const int di = corner % 2, dj = corner / 2;
      const double weight = nearness * (di ? x - i : 1 - x + i) * (dj ? y - j : 1 - y + j);
      if (weight > 0)
      {
        const std::size_t cell = beside.frame[side] * Cells() + static_cast<std::size_t>(j + dj) * columns + i + di;
        const std::array<std::uint8_t, 3> codes{residual_[cell], rate_[cell], texture_[cell]};
        for (int k = 0; k < 3; ++k)
        {
          sums[k] += codes[k] ? weight * Decoded()[codes[k]] : 0;
          weights[k] += codes[k] ? weight : 0;
        }
      }
    }
  }
  return {sums[0] / weights[0], sums[1] / weights[1], sums[2] / weights[2]};  // 0 / 0: not known
}

namespace
{

/// Half a side of the window in which the slice's own texture is measured: as many mm as in a frame.
int HalfWindow(double framePixel, double slicePixel)
{
  return static_cast<int>(std::clamp(std::round(kHalfWindow * framePixel / slicePixel), 1.0, 16.0));
}

/// |grad I|^2 per mm^2, one-sided at the window's edges.
double SquaredGradient(const float* image, const Engine::Window& window, int i, int j, double column, double row)
{
  const auto slope = [&](int at, int count, int step)
  {
    const float* here = image + static_cast<std::size_t>(j) * window.columns + i;
    const int before = at > 0 ? 1 : 0, after = at + 1 < count ? 1 : 0;
    return before + after == 0 ? 0.0
                               : (here[after * step] - here[-before * step]) / static_cast<double>(before + after);
  };
  const double x = slope(i, window.columns, 1) / column, y = slope(j, window.rows, window.columns) / row;
  return x * x + y * y;
}

}  // namespace

int StandardError::Margin(const SlicePlane& plane) const
{
  return HalfWindow(frames_.front().plane.PixelSize(), plane.PixelSize());
}

/// A slice to be judged.
struct StandardError::Shown
{
  const SlicePlane& plane;
  const Engine::Window& window;
  const float* image;
  std::vector<double> own;     // local variance of the image
  std::vector<double> turned;  // beyond each frame
};

/// sigma^2 by the frames beside pixel (i, j) of the window; NaN where they do not tell.
double StandardError::Variance(const Shown& shown, const Beside& at, int i, int j) const
{
  if (!at.IsKnown())
  {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const Terms terms = Read(at);
  const double t = at.Nearness();
  const int nearest = at.frame[t >= 0.5 ? 0 : 1];
  const double w = shown.turned[nearest];
  const double between = at.distance[0] == 0 ? 0 : kLeft * terms.rate * at.Apart();
  const double along = (1 - 2 * t * (1 - t)) * terms.residual + between;
  const double own = shown.own[static_cast<std::size_t>(j) * shown.window.columns + i];
  const double across = w > 0 ? speckle_[nearest] * (own + terms.texture) : 0;
  const double moved = trackerNoise_ == 0
                           ? 0
                           : trackerNoise_ * trackerNoise_ *
                                 SquaredGradient(shown.image, shown.window, i, j, shown.plane.columnStep.norm(),
                                                 shown.plane.rowStep.norm());
  const double variance = (1 - w) * along + w * across + moved;
  return variance < kFloor ? kFloor : variance;
}

void StandardError::Evaluate(const SlicePlane& plane, const Engine::Window& window, const float* image,
                             float* sigma) const
{
  const std::size_t count = static_cast<std::size_t>(window.columns) * window.rows;
  std::vector<std::vector<Beside>> ofSequences;
  std::vector<double> known(count, 0);
  for (const std::vector<int>& frames : bySequence_)
  {
    std::vector<Beside> beside(count);
    Find(plane, window, frames, beside);
    for (std::size_t p = 0; p < count; ++p)
    {
      known[p] = beside[p].IsKnown() ? 1 : known[p];
    }
    ofSequences.push_back(std::move(beside));
  }
  Shown shown{plane, window, image, std::vector<double>(count, 0), TurnedFurther(plane)};
  if (std::any_of(shown.turned.begin(), shown.turned.end(), [](double w) { return w > 0; }))
  {
    shown.own = WindowVariances({image, image + count}, known, window.columns, window.rows, Margin(plane));
  }
  std::fill(sigma, sigma + count, std::numeric_limits<float>::quiet_NaN());
  const auto take = [&](const std::vector<Beside>& beside)
  {
    tbb::parallel_for(0, window.rows,
                      [&](int j)
                      {
                        for (int i = 0; i < window.columns; ++i)
                        {
                          const std::size_t p = static_cast<std::size_t>(j) * window.columns + i;
                          const auto found = static_cast<float>(std::sqrt(Variance(shown, beside[p], i, j)));
                          sigma[p] = std::fmin(sigma[p], found);  // of a number and NaN the number
                        }
                      });
  };
  for (const std::vector<Beside>& beside : ofSequences)
  {
    take(beside);
  }
  for (const std::vector<int>& frames : bySequence_)
  {
    std::vector<int> aligned;
    std::copy_if(frames.begin(), frames.end(), std::back_inserter(aligned),
                 [&shown](int k) { return shown.turned[k] < kAligned; });
    if (!aligned.empty() && aligned.size() < frames.size())
    {
      std::vector<Beside> beside(count);
      Find(plane, window, aligned, beside);
      take(beside);
    }
  }
}

bool StandardError::IsMostlyGuessed(const SlicePlane& plane, const float* image) const
{
  constexpr double kJudged = 100;                          // pixels along a side
  constexpr double kBlack = 0.5 / 255, kSeen = 2 / 255.0;  // no picture shows less; no eye sees less
  const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(plane.width) * plane.height) / kJudged));
  SlicePlane coarse = plane;
  coarse.width = (plane.width + step - 1) / step;
  coarse.height = (plane.height + step - 1) / step;
  coarse.columnStep *= step;
  coarse.rowStep *= step;
  std::vector<float> thin;
  for (int j = 0; j < plane.height; j += step)
  {
    for (int i = 0; i < plane.width; i += step)
    {
      thin.push_back(image[static_cast<std::size_t>(j) * plane.width + i]);
    }
  }
  std::vector<float> sigma(thin.size());
  Evaluate(coarse, thin.data(), sigma.data());
  double shown = 0, known = 0, variance = 0, sum = 0, squares = 0;
  for (std::size_t p = 0; p < thin.size(); ++p)
  {
    const double value = thin[p];
    shown += value > kBlack || !std::isnan(sigma[p]) ? 1 : 0;
    if (!std::isnan(sigma[p]))
    {
      known += 1;
      variance += static_cast<double>(sigma[p]) * sigma[p];
      sum += value;
      squares += value * value;
    }
  }
  return 2 * known < shown || (known > 0 && variance > std::max(squares - sum * sum / known, known * kSeen * kSeen));
}

std::vector<double> WindowVariances(const std::vector<double>& values, const std::vector<double>& known, int width,
                                    int height, int half)
{
  std::vector<double> first(values.size()), second(values.size());
  for (std::size_t p = 0; p < values.size(); ++p)
  {
    first[p] = known[p] * values[p];
    second[p] = first[p] * values[p];
  }
  const std::vector<double> counts = BoxSums(known, width, height, half);
  first = BoxSums(first, width, height, half);
  second = BoxSums(second, width, height, half);
  for (std::size_t p = 0; p < values.size(); ++p)
  {
    const double mean = counts[p] > 0 ? first[p] / counts[p] : 0;
    second[p] = counts[p] > 0 ? std::max(second[p] / counts[p] - mean * mean, 0.0) : 0;
  }
  return second;
}

//------------------------------------------------------------------------------
// Bytes

std::string StandardError::ToBytes() const
{
  StateWriter out;
  out.Number<std::uint32_t>(kVersion);
  out.Number<std::uint32_t>(width_);
  out.Number<std::uint32_t>(height_);
  out.Number<std::uint32_t>(cell_);
  out.Number(trackerNoise_);
  out.Array(sequences_);
  out.Array(speckle_);
  out.Array(usualTurn_);
  for (const Eigen::Matrix4d& pose : poses_)
  {
    out.Numbers(pose.data(), 16);
  }
  std::vector<std::uint8_t> bits((lit_.size() + 7) / 8, 0);
  for (std::size_t p = 0; p < lit_.size(); ++p)
  {
    bits[p / 8] |= static_cast<std::uint8_t>((lit_[p] != 0) << p % 8);
  }
  out.Array(bits);
  out.Array(residual_);
  out.Array(rate_);
  out.Array(texture_);
  return out.Take();
}

StandardError::StandardError(std::string_view bytes)
try
{
  StateReader in(bytes);
  in.NumberIn<std::uint32_t>(kVersion, kVersion);
  width_ = static_cast<int>(in.NumberIn<std::uint32_t>(1, 1 << 15));
  height_ = static_cast<int>(in.NumberIn<std::uint32_t>(1, 1 << 15));
  cell_ = static_cast<int>(in.NumberIn<std::uint32_t>(1, 1 << 15));
  trackerNoise_ = in.NumberIn<double>(0, 1e6);
  sequences_ = in.Array<int>();
  StateReader::Require(!sequences_.empty() && std::is_sorted(sequences_.begin(), sequences_.end()), "no frame");
  speckle_ = in.Array<float>();
  StateReader::Require(speckle_.size() == sequences_.size() &&
                           std::all_of(speckle_.begin(), speckle_.end(), [](float s) { return s >= 0 && s <= 1; }),
                       "shares of another number");
  usualTurn_ = in.Array<float>();
  StateReader::Require(usualTurn_.size() == sequences_.size() &&
                           std::all_of(usualTurn_.begin(), usualTurn_.end(),
                                       [](float w) { return w >= 0 && w <= static_cast<float>(kMostTurn); }),
                       "turns of another number");
  for (std::size_t k = 0; k < sequences_.size(); ++k)
  {
    Eigen::Matrix4d pose;
    in.Numbers(pose.data(), 16);
    SlicePlane::FromImageToReference(pose, width_, height_).Validate("frame " + std::to_string(k));
    poses_.push_back(pose);
  }
  const auto bits = in.Array<std::uint8_t>();
  const std::size_t pixels = static_cast<std::size_t>(width_) * height_;
  StateReader::Require(bits.size() == (pixels + 7) / 8, "a lit area of another size");
  for (std::size_t p = 0; p < pixels; ++p)
  {
    lit_.push_back(bits[p / 8] >> p % 8 & 1);
  }
  for (std::vector<std::uint8_t>* part : {&residual_, &rate_, &texture_})
  {
    *part = in.Array<std::uint8_t>();
    StateReader::Require(part->size() == Cells() * poses_.size(), "cells of another number");
  }
  in.End();
  Derive();
}
catch (const Error&)
{
  throw Error("Gaussian field: the array StandardError is damaged, or of a newer BIGUS; remove it, or train again.");
}

}  // namespace bigus
