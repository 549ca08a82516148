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
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/StateBytes.h"
#include "Core/Probe/Fan.h"
#include "Core/StandardError/Inside.h"

namespace bigus
{
namespace
{

constexpr int kVersion = 3;  // 1 had no squares; 2, still written where they do not count, no directions

/// What the field leaves of the error of linear interpolation: 0.49 to 0.79 in folds of seven sweeps (README.md).
constexpr double kLeft = 0.7;
constexpr double kFloor = 0.5 / 255 * 0.5 / 255;  // half a grey level
constexpr double kAligned = 0.05;                 // of speckle is another, where a frame looks as the slice does
constexpr int kTile = 32;                         // pixels along a side that share a search
constexpr int kBlock = 8;                         // and that are lit or dark together

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
    double* out = &across[static_cast<std::size_t>(j) * width];
    for (int k = -half; k <= half; ++k)
    {
      for (int i = std::max(0, -k); i < std::min(width, width - k); ++i)
      {
        out[i] += row[i + k];
      }
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
  litSums_.assign(static_cast<std::size_t>(width_ + 1) * (height_ + 1), 0);
  for (int row = 0; row < height_; ++row)
  {
    int sum = 0;
    for (int column = 0; column < width_; ++column)
    {
      const std::size_t above = static_cast<std::size_t>(row) * (width_ + 1) + column + 1;
      sum += lit_[static_cast<std::size_t>(row) * width_ + column] != 0 ? 1 : 0;
      litSums_[above + width_ + 1] = litSums_[above] + sum;
    }
  }
  const SlicePlane image = SlicePlane::FromImageToReference(poses_.front(), width_, height_);
  const Eigen::Vector2d pixel(image.columnStep.norm(), image.rowStep.norm());
  if (const auto apex = FindApex(lit_, width_, height_, pixel[0], pixel[1]))
  {
    apex_ = (*apex - Eigen::Vector2d(0.5 * (width_ - 1), 0)).cwiseProduct(pixel);
  }
  for (std::size_t k = 0; k < poses_.size(); ++k)
  {
    const SlicePlane plane = SlicePlane::FromImageToReference(poses_[k], width_, height_);
    const bool isFirst = k == 0 || sequences_[k] != sequences_[k - 1];
    const double sign = !isFirst && plane.Normal().dot(frames_.back().normal) < 0 ? -1 : 1;
    Eigen::Matrix3d toFrame = plane.WorldToSlice();
    toFrame.row(2) *= sign;
    frames_.push_back({plane, sign * plane.Normal(), toFrame, ApexOf(plane)});
    if (isFirst)
    {
      bySequence_.emplace_back();
    }
    bySequence_.back().push_back(static_cast<int>(k));
  }
  Sweep recorded;
  recorded.width = width_;
  recorded.height = height_;
  recorded.imageToReference = poses_;
  recorded.sequences = sequences_;
  gap_ = MeasureGeometry(recorded, AllFrames(recorded)).usualSpacing;
  if (seen_)
  {
    views_ = RecordedViews::Of(recorded, AllFrames(recorded));
  }
}

std::size_t StandardError::Cells() const
{
  return static_cast<std::size_t>(CellColumns()) * ((height_ + cell_ - 1) / cell_);
}

/// Whether IsLit may be true of a place in that rectangle, with a pixel to spare.
bool StandardError::MayBeLit(double firstColumn, double lastColumn, double firstRow, double lastRow) const
{
  const auto place = [](double at, int size)
  { return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(size))); };
  const int left = place(firstColumn - 1, width_), right = place(lastColumn + 3, width_);
  const int top = place(firstRow - 1, height_), bottom = place(lastRow + 3, height_);
  const auto sum = [this](int column, int row)
  { return litSums_[static_cast<std::size_t>(row) * (width_ + 1) + column]; };
  return left < right && top < bottom && sum(right, bottom) - sum(left, bottom) - sum(right, top) + sum(left, top) > 0;
}

//------------------------------------------------------------------------------
// The nearest frames

namespace
{

constexpr double kOnFrame = 1e-4;   // mm: on the frame itself
constexpr double kRounding = 1e-6;  // mm, of a bound

}  // namespace

/// A frame that may be nearest somewhere. Coordinates are affine in the slice's: at + i alongColumns + j alongRows.
struct StandardError::Candidate
{
  int frame;
  double least;  // mm, bound of the distance in a tile from below
  Eigen::Vector3d at, alongColumns, alongRows;

  Eigen::Vector3d operator()(int i, int j) const { return at + i * alongColumns + j * alongRows; }
  /// One of them.
  double operator()(int i, int j, int axis) const { return at[axis] + i * alongColumns[axis] + j * alongRows[axis]; }
};

/// Pixels that share a search.
struct StandardError::Tile
{
  int left, top, right, bottom;  // the last ones belong to it

  std::size_t Pixels() const { return static_cast<std::size_t>(right - left + 1) * (bottom - top + 1); }
};

std::vector<StandardError::Candidate> StandardError::Candidates(const SlicePlane& plane,
                                                                const std::vector<int>& among) const
{
  std::vector<Candidate> all;
  for (const int k : among)
  {
    const Frame& frame = frames_[k];
    all.push_back({k, 0, frame.toFrame * (plane.origin - frame.plane.origin), frame.toFrame * plane.columnStep,
                   frame.toFrame * plane.rowStep});
  }
  return all;
}

/// Those that may be nearest on one side somewhere in the tile, by their bounds.
std::vector<StandardError::Candidate> StandardError::Within(const Tile& tile, int side,
                                                            const std::vector<Candidate>& all) const
{
  std::vector<Candidate> candidates;
  for (const Candidate& one : all)
  {
    Eigen::Vector3d low = Eigen::Vector3d::Constant(kInfinity), high = -low;
    for (const auto& [i, j] :
         {std::pair(tile.left, tile.top), {tile.right, tile.top}, {tile.left, tile.bottom}, {tile.right, tile.bottom}})
    {
      low = low.cwiseMin(one(i, j));
      high = high.cwiseMax(one(i, j));
    }
    const double farthest = side == 0 ? high[2] : -low[2];
    if (farthest >= -kOnFrame - kRounding && MayBeLit(low[0], high[0], low[1], high[1]))
    {
      candidates.push_back(one);
      candidates.back().least = (side == 0 ? low[2] : -high[2]) - kRounding;
    }
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b)
            { return std::pair(a.least, a.frame) < std::pair(b.least, b.frame); });
  return candidates;
}

/// What is beside the pixels of a tile, row by row. What a pixel gets does not depend on the tile: the smallest distance, of
/// equals the first frame.
void StandardError::Find(const Tile& tile, const std::vector<Candidate>& all, std::vector<Beside>& found) const
{
  found.assign(tile.Pixels(), {});
  const int width = tile.right - tile.left + 1;
  for (int side = 0; side < 2; ++side)
  {
    const std::vector<Candidate> candidates = Within(tile, side, all);
    for (int top = tile.top; top <= tile.bottom; top += kBlock)
    {
      for (int left = tile.left; left <= tile.right; left += kBlock)
      {
        const Tile block{left, top, std::min(left + kBlock - 1, tile.right), std::min(top + kBlock - 1, tile.bottom)};
        FindInBlock(block, side, candidates, &found[(top - tile.top) * width + left - tile.left], width);
      }
    }
  }
}

/// In a part of a tile, of whose rows `found` has the first pixels. Most frames do not light a dark part.
void StandardError::FindInBlock(const Tile& block, int side, const std::vector<Candidate>& candidates, Beside* found,
                                int width) const
{
  const double sign = side == 0 ? 1 : -1, least = side == 0 ? -kOnFrame : kOnFrame;
  double farthest = kInfinity;  // of what was found
  for (const Candidate& one : candidates)
  {
    if (one.least > farthest)
    {
      break;
    }
    if (!MayLight(one, block))
    {
      continue;
    }
    farthest = 0;
    for (int j = block.top; j <= block.bottom; ++j)
    {
      Beside* beside = found + (j - block.top) * width;
      for (int i = block.left; i <= block.right; ++i, ++beside)
      {
        const double z = sign * one(i, j, 2);
        const double distance = z <= kOnFrame ? 0 : z;
        if (z >= least && (distance < beside->distance[side] ||
                           (distance == beside->distance[side] && one.frame < beside->frame[side])))
        {
          const double column = one(i, j, 0), row = one(i, j, 1);
          if (IsLit(column, row))
          {
            beside->frame[side] = one.frame;
            beside->distance[side] = distance;
            beside->column[side] = static_cast<float>(column);
            beside->row[side] = static_cast<float>(row);
          }
        }
        farthest = std::max(farthest, beside->distance[side]);
      }
    }
  }
}

/// Whether a pixel of the tile may have its foot in the frame's lit area.
bool StandardError::MayLight(const Candidate& one, const Tile& tile) const
{
  const auto bounds = [&](int axis)
  {
    const double across = (tile.right - tile.left) * one.alongColumns[axis],
                 down = (tile.bottom - tile.top) * one.alongRows[axis], first = one(tile.left, tile.top, axis);
    return std::pair(first + std::min(across, 0.0) + std::min(down, 0.0),
                     first + std::max(across, 0.0) + std::max(down, 0.0));
  };
  const auto [left, right] = bounds(0);
  const auto [top, bottom] = bounds(1);
  return MayBeLit(left, right, top, bottom);
}

/// Calls at(tile) for all tiles of a window, in parallel.
template <class At>
void StandardError::ForTiles(const Engine::Window& window, const At& at)
{
  const int across = (window.columns + kTile - 1) / kTile, down = (window.rows + kTile - 1) / kTile;
  tbb::parallel_for(0, across * down,
                    [&](int number)
                    {
                      const int left = window.firstColumn + number % across * kTile;
                      const int top = window.firstRow + number / across * kTile;
                      at(Tile{left, top, std::min(left + kTile, window.firstColumn + window.columns) - 1,
                              std::min(top + kTile, window.firstRow + window.rows) - 1});
                    });
}

/// Calls with(index of the pixel in the window, index in the tile) for each pixel of a tile.
template <class With>
void StandardError::ForPixels(const Tile& tile, const Engine::Window& window, const With& with)
{
  std::size_t inTile = 0;
  for (int j = tile.top - window.firstRow; j <= tile.bottom - window.firstRow; ++j)
  {
    for (int i = tile.left - window.firstColumn; i <= tile.right - window.firstColumn; ++i)
    {
      with(static_cast<std::size_t>(j) * window.columns + i, inTile++);
    }
  }
}

std::vector<StandardError::Beside> StandardError::Nearest(const SlicePlane& plane, const std::vector<int>& among) const
{
  const Engine::Window whole{0, 0, plane.width, plane.height};
  const std::vector<Candidate> candidates = Candidates(plane, among);
  std::vector<Beside> nearest(static_cast<std::size_t>(plane.width) * plane.height);
  ForTiles(whole,
           [&](const Tile& tile)
           {
             std::vector<Beside> found;
             Find(tile, candidates, found);
             ForPixels(tile, whole, [&](std::size_t p, std::size_t inTile) { nearest[p] = found[inTile]; });
           });
  return nearest;
}

/// Of several sequences by the one whose frames lie nearest around the point.
std::vector<float> StandardError::Apart(const SlicePlane& plane) const
{
  std::vector<float> apart(static_cast<std::size_t>(plane.width) * plane.height,
                           std::numeric_limits<float>::quiet_NaN());
  for (const std::vector<int>& frames : bySequence_)
  {
    const std::vector<Beside> nearest = Nearest(plane, frames);
    for (std::size_t p = 0; p < apart.size(); ++p)
    {
      apart[p] = nearest[p].IsKnown() ? std::fmin(apart[p], static_cast<float>(nearest[p].Apart())) : apart[p];
    }
  }
  return apart;
}

//------------------------------------------------------------------------------
// Any plane

/// Where the beams of a plane of any size meet: its probe is at the middle of its first row.
Eigen::Vector3d StandardError::ApexOf(const SlicePlane& plane) const
{
  const Eigen::Vector3d middle = plane.Point(0.5 * (plane.width - 1), 0);
  return apex_ ? middle + (*apex_)[0] * plane.columnStep.normalized() + (*apex_)[1] * plane.rowStep.normalized()
               : middle;
}

namespace
{

/// The correlation of speckle on a logarithmic scale by that of its intensities, 0 to 1: 6 / pi^2 times the sum of x^n / n^2.
double OfLogarithms(double x)
{
  constexpr int kSteps = 512;
  static const std::vector<double> table = []
  {
    std::vector<double> values;
    for (int k = 0; k <= kSteps; ++k)
    {
      const double at = static_cast<double>(k) / kSteps, low = std::min(at, 1 - at);
      double sum = 0, power = 1;
      for (int n = 1; n <= 50; ++n)
      {
        power *= low;
        sum += power / (n * n);
      }
      // Near 1 the sum is slow: those of x and of 1 - x make pi^2 / 6 - ln x ln(1 - x).
      const double mixed = low > 0 ? std::log(low) * std::log1p(-low) : 0;
      values.push_back(at <= 0.5 ? 6 / (kPi * kPi) * sum : 1 - 6 / (kPi * kPi) * (mixed + sum));
    }
    return values;
  }();
  const int k = std::min(static_cast<int>(x * kSteps), kSteps - 1);
  return table[k] + (x * kSteps - k) * (table[k + 1] - table[k]);
}

}  // namespace

/// How much speckle is another when seen along a plane's beam, not a frame's. Echoes of scatterers in a
/// beam, which is kAspect times as thick as wide, add up to it. In units of the thickness their profiles are
/// exp(-x^T P x / 2) across the frame's beam and exp(-x^T Q x / 2) across the plane's, and a place d aside of the beam has
/// another phase. With S = P + Q the intensities correlate by 4 sqrt(|P| |Q|) / |S| exp(-2 d^T S^-1 d).
double StandardError::Another(const View& frame, const View& plane)
{
  constexpr double kAngle = 2.5 * kRadiansPerDegree;  // sqrt 2 / (2 k sigma_E): 5 MHz, beam of 0.8 mm
  constexpr double kAspect = 2, kThin = kAspect * kAspect;
  const Eigen::Vector3d width = frame.normal.cross(frame.beam);
  const double across = plane.beam.dot(width) / kAngle, beside = plane.beam.dot(frame.normal) / kAngle;
  const double sine = plane.normal.dot(width), cosine = plane.normal.dot(frame.normal);
  const double sine2 = sine * sine / std::max(sine * sine + cosine * cosine, 1e-18), cosine2 = 1 - sine2;
  const double mixed = (1 - kThin) * sine * cosine / std::max(sine * sine + cosine * cosine, 1e-18);
  const double alongWidth = kThin + kThin * cosine2 + sine2, alongThickness = 1 + cosine2 + kThin * sine2;
  const double determinant = alongWidth * alongThickness - mixed * mixed;
  const double phase =
      2 * (alongThickness * across * across - 2 * mixed * across * beside + alongWidth * beside * beside) / determinant;
  return plane.beam.dot(frame.beam) > 0 ? 1 - OfLogarithms(4 * kThin / determinant * std::exp(-phase)) : 1;
}

/// For each frame, by its columns and the plane's: a fan's middle beams.
std::vector<double> StandardError::Turned(const SlicePlane& plane) const
{
  const View view{plane.Normal(), plane.rowStep.normalized()};
  std::vector<double> turned;
  for (const Frame& frame : frames_)
  {
    turned.push_back(Another({frame.normal, frame.plane.rowStep.normalized()}, view));
  }
  return turned;
}

/// Of a frame at a place in its plane, in a fan.
StandardError::View StandardError::ViewAt(int frame, const Eigen::Vector3d& place) const
{
  return {frames_[frame].normal, (place - frames_[frame].apex).normalized()};
}

/// Of the frame on a side of a place, in a fan.
StandardError::View StandardError::ViewOf(const Beside& beside, int side) const
{
  return ViewAt(beside.frame[side], frames_[beside.frame[side]].plane.Point(beside.column[side], beside.row[side]));
}

/// How much is another beyond what R has.
double StandardError::Further(double turned, double usual)
{
  return std::clamp((turned - usual) / (1 - usual), 0.0, 1.0);
}

/// Reads at one point after the other: those beside each other mostly lie between the same cells.
class StandardError::CellReader
{
public:
  explicit CellReader(const StandardError& kept)
      : kept_(kept), columns_(kept.CellColumns()), rows_((kept.height_ + kept.cell_ - 1) / kept.cell_)
  {
  }

  /// `before`: how much the frame before weighs (Nearness).
  Terms operator()(const Beside& beside, double before)
  {
    Eigen::Array4f sums = Eigen::Array4f::Zero(), unknown = sums;
    for (int side = 0; side < 2; ++side)
    {
      const double nearness = side == 0 ? before : 1 - before;
      if (beside.frame[side] < 0 || nearness == 0)
      {
        continue;
      }
      const float x = Place(beside.column[side], columns_), y = Place(beside.row[side], rows_);
      const int i = static_cast<int>(x), j = static_cast<int>(y);
      const Four& cells = Around(side, beside.frame[side], i, j);
      const float right = x - i, lower = static_cast<float>(nearness) * (y - j),
                  upper = static_cast<float>(nearness) - lower;
      const std::array<float, 4> shares{upper * (1 - right), upper * right, lower * (1 - right), lower * right};
      for (int k = 0; k < 4; ++k)
      {
        sums += shares[k] * cells.values[k];
      }
      if (cells.hasUnknown)
      {
        for (int k = 0; k < 4; ++k)
        {
          unknown += shares[k] * cells.unknown[k];
        }
      }
    }
    if ((unknown > 0).any())
    {
      // Of the shares, which make 1, those of what is known; none where they are what rounding leaves.
      const Eigen::Array4f known = 1 - unknown;
      sums = (known > kRounding).select(sums / known, std::numeric_limits<float>::quiet_NaN());
    }
    return {sums[0], sums[1], sums[2]};
  }

private:
  static constexpr float kRounding = 1e-6f;

  /// Cells around a point: of each residual, rate and texture, 0 where they are not known, and 1 where they are not.
  struct Four
  {
    std::size_t first = std::numeric_limits<std::size_t>::max();
    bool hasUnknown = false;
    std::array<Eigen::Array4f, 4> values, unknown;
  };

  float Place(float pixel, int count) const
  {
    return std::clamp((pixel + 0.5f) / static_cast<float>(kept_.cell_) - 0.5f, 0.0f, static_cast<float>(count - 1));
  }

  const Four& Around(int side, int frame, int i, int j)
  {
    Four& cells = around_[(2 * (i + frame) + side) % around_.size()];
    const std::size_t first = (static_cast<std::size_t>(frame) * rows_ + j) * columns_ + i;
    if (cells.first != first)
    {
      cells.first = first;
      const int right = i + 1 < columns_ ? 1 : 0, down = j + 1 < rows_ ? columns_ : 0;  // none beyond the last
      const std::array<std::size_t, 4> at{first, first + right, first + down, first + down + right};
      for (int k = 0; k < 4; ++k)
      {
        const Codes& codes = kept_.codes_[at[k]];
        const std::array<float, 256>& decoded = Decoded();
        cells.values[k] = {decoded[codes.residual], decoded[codes.rate], decoded[codes.texture], 0};
        cells.unknown[k] = {codes.residual ? 0.0f : 1.0f, codes.rate ? 0.0f : 1.0f, codes.texture ? 0.0f : 1.0f, 0};
        cells.values[k] *= 1 - cells.unknown[k];
      }
      cells.hasUnknown = std::any_of(cells.unknown.begin(), cells.unknown.end(),
                                     [](const Eigen::Array4f& of) { return (of > 0).any(); });
    }
    return cells;
  }

  const StandardError& kept_;
  int columns_, rows_;
  std::array<Four, 64> around_;  // of the last places; neighbours along a row or from frame to frame do not meet
};

namespace
{

/// Half a side of the window in which the slice's own texture is measured: as many mm as in a frame.
int HalfWindow(double framePixel, double slicePixel)
{
  return static_cast<int>(std::clamp(std::round(kHalfWindow * framePixel / slicePixel), 1.0, 16.0));
}

/// |grad I|^2 per mm^2, one-sided at the window's edges.
double SquaredGradient(const float* image, const Engine::Window& window, int i, int j, const Eigen::Vector2d& perMm)
{
  const float* here = image + static_cast<std::size_t>(j) * window.columns + i;
  const auto slope = [here](int at, int count, int step)
  {
    const int before = at > 0 ? 1 : 0, after = at + 1 < count ? 1 : 0;
    return (here[after * step] - here[-before * step]) * (before + after == 2 ? 0.5 : 1.0);
  };
  const double x = slope(i, window.columns, 1) * perMm[0], y = slope(j, window.rows, window.columns) * perMm[1];
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
  std::vector<double> turned;  // beyond each frame, by its columns
  Eigen::Vector3d normal, apex;
  Eigen::Vector2d perMm;          // pixels, along columns and rows
  double residual = 1, rate = 1;  // what directions leave of these
};

/// What is another at a pixel of a fan, beyond what R of the frame beside it has. R of neighbours has what is another between
/// them, which differs from beam to beam; where the place lies between others, the frame's mean must do.
double StandardError::FanTurn(const Shown& shown, int frame, int other, int column, int row) const
{
  const Eigen::Vector3d place = shown.plane.Point(column, row);
  const auto viewOf = [&](int k)
  {
    const Frame& of = frames_[k];
    return ViewAt(k, place - of.normal.dot(place - of.plane.origin) * of.normal);
  };
  const View here = viewOf(frame);
  const bool areNeighbours = other >= 0 && std::abs(other - frame) == 1;
  const double usual = areNeighbours ? std::min(Another(here, viewOf(other)), kMostTurn) : usualTurn_[frame];
  return Further(Another(here, {shown.normal, (place - shown.apex).normalized()}), usual);
}

/// FanTurn around the pixels of a tile: at every fourth pixel of the plane, wherever the tile lies, and linear between these
/// where they are alike.
class StandardError::FanTurns
{
public:
  FanTurns(const StandardError& kept, const Shown& shown, const Tile& tile)
      : kept_(kept), shown_(shown), left_(tile.left / kStep), top_(tile.top / kStep)
  {
  }

  double operator()(const Beside& beside, int side, int column, int row)
  {
    Places& places = Of(beside.frame[side], beside.frame[1 - side]);
    const int i = column / kStep - left_, j = row / kStep - top_;
    const float a = At(places, i, j), b = At(places, i + 1, j), c = At(places, i, j + 1), d = At(places, i + 1, j + 1);
    if (std::max({a, b, c, d}) - std::min({a, b, c, d}) > kAlike)
    {
      return kept_.FanTurn(shown_, places.frame, places.other, column, row);
    }
    const float x = static_cast<float>(column % kStep) / kStep, y = static_cast<float>(row % kStep) / kStep;
    return (1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d);
  }

private:
  static constexpr int kStep = 4;
  static constexpr float kAlike = 0.1f;  // then what is linear is right to some hundredths
  static constexpr int kAcross = kTile / kStep + 2;
  /// For a frame and the one on the other side.
  struct Places
  {
    int frame, other;
    std::array<float, kAcross * kAcross> turns;  // less than 0: not known yet
  };

  /// Mostly those of the pixel before, or those that came after them in the row above.
  Places& Of(int frame, int other)
  {
    for (std::size_t k = 0; k < places_.size(); ++k)
    {
      Places& places = places_[last_];
      if (places.frame == frame && places.other == other)
      {
        return places;
      }
      last_ = last_ + 1 < places_.size() ? last_ + 1 : 0;
    }
    last_ = places_.size();
    places_.push_back({frame, other, {}});
    places_.back().turns.fill(-1);
    return places_.back();
  }

  float At(Places& places, int i, int j) const
  {
    float& turn = places.turns[j * kAcross + i];
    if (turn < 0)
    {
      turn = static_cast<float>(
          kept_.FanTurn(shown_, places.frame, places.other, (left_ + i) * kStep, (top_ + j) * kStep));
    }
    return turn;
  }

  const StandardError& kept_;
  const Shown& shown_;
  int left_, top_;
  std::vector<Places> places_;
  std::size_t last_ = 0;
};

/// sigma^2 = at + slope * the image's own variance around the pixel; NaN: not known.
struct StandardError::Line
{
  float at = std::numeric_limits<float>::quiet_NaN(), slope = 0;
};

/// The lines of one pixel of a tile after the other.
class StandardError::LineFinder
{
public:
  LineFinder(const StandardError& kept, const Shown& shown, const Tile& tile)
      : kept_(kept), shown_(shown), read_(kept), turns_(kept, shown, tile)
  {
  }

  /// By the frames beside pixel (i, j) of the window.
  Line operator()(const Beside& beside, int i, int j)
  {
    if (!beside.IsKnown())
    {
      return {};
    }
    const double t = beside.Nearness();
    const Terms terms = read_(beside, t);
    const int side = t >= 0.5 ? 0 : 1, nearest = beside.frame[side];
    const double w = kept_.apex_ ? turns_(beside, side, i + shown_.window.firstColumn, j + shown_.window.firstRow)
                                 : shown_.turned[nearest];
    const double between = beside.distance[0] == 0 ? 0 : shown_.rate * kLeft * terms.rate * t * beside.distance[0];
    const double along = (1 - 2 * t * (1 - t)) * shown_.residual * terms.residual + between;
    const double noise = kept_.trackerNoise_;
    const double moved =
        noise == 0 ? 0 : noise * noise * SquaredGradient(shown_.image, shown_.window, i, j, shown_.perMm);
    const double slope = w > 0 ? w * kept_.speckle_[nearest] : 0;
    return {static_cast<float>((1 - w) * along + (w > 0 ? slope * terms.texture : 0) + moved),
            static_cast<float>(slope)};
  }

private:
  const StandardError& kept_;
  const Shown& shown_;
  CellReader read_;
  FanTurns turns_;
};

/// Frames that are asked together.
struct StandardError::Set
{
  std::vector<Candidate> candidates;
  bool isAligned;  ///< those of the set before that look as the slice does
};

/// The frames of each sequence, and of each those that look as the slice does, where others do not: where these lie farther
/// off they may still tell more.
std::vector<StandardError::Set> StandardError::Sets(const SlicePlane& plane, const std::vector<double>& turned) const
{
  std::vector<Set> sets;
  for (const std::vector<int>& frames : bySequence_)
  {
    sets.push_back({Candidates(plane, frames), false});
    std::vector<int> aligned;
    std::copy_if(frames.begin(), frames.end(), std::back_inserter(aligned),
                 [&turned](int k) { return turned[k] < kAligned; });
    if (!aligned.empty() && aligned.size() < frames.size())
    {
      sets.push_back({Candidates(plane, aligned), true});
    }
  }
  return sets;
}

/// For the pixels of a tile a line by each set, set after set. Where all that lies beside a tile is aligned, those that are
/// tell nothing else.
void StandardError::FindLines(const Shown& shown, const Tile& tile, const std::vector<Set>& sets,
                              std::vector<Line>& lines) const
{
  const Engine::Window& window = shown.window;
  const std::size_t count = static_cast<std::size_t>(window.columns) * window.rows;
  const auto isAligned = [&shown](int frame) { return frame < 0 || shown.turned[frame] < kAligned; };
  LineFinder lineOf(*this, shown, tile);
  std::vector<Beside> found, before;
  for (std::size_t k = 0; k < sets.size(); ++k)
  {
    if (sets[k].isAligned &&
        std::all_of(found.begin(), found.end(),
                    [&](const Beside& beside) { return isAligned(beside.frame[0]) && isAligned(beside.frame[1]); }))
    {
      continue;
    }
    std::swap(found, before);
    Find(tile, sets[k].candidates, found);
    std::size_t inTile = 0;
    for (int j = tile.top - window.firstRow; j <= tile.bottom - window.firstRow; ++j)
    {
      Line* line = &lines[k * count + static_cast<std::size_t>(j) * window.columns + tile.left - window.firstColumn];
      for (int i = tile.left - window.firstColumn; i <= tile.right - window.firstColumn; ++i, ++inTile, ++line)
      {
        if (!sets[k].isAligned || found[inTile].frame != before[inTile].frame)
        {
          *line = lineOf(found[inTile], i, j);
        }
      }
    }
  }
}

/// The image's own variance around the pixels of a tile, row by row: of what is known, within the margin and the window.
std::vector<double> StandardError::OwnVariances(const Shown& shown, const Tile& tile,
                                                const std::vector<Line>& lines) const
{
  const Engine::Window& window = shown.window;
  const int margin = Margin(shown.plane);
  const Tile around{std::max(tile.left - margin, window.firstColumn), std::max(tile.top - margin, window.firstRow),
                    std::min(tile.right + margin, window.firstColumn + window.columns - 1),
                    std::min(tile.bottom + margin, window.firstRow + window.rows - 1)};
  const std::size_t count = static_cast<std::size_t>(window.columns) * window.rows;
  std::vector<double> values(around.Pixels()), known(around.Pixels(), 0);
  ForPixels(around, window,
            [&](std::size_t p, std::size_t inTile)
            {
              values[inTile] = shown.image[p];
              for (std::size_t n = p; n < lines.size(); n += count)
              {
                known[inTile] = std::isnan(lines[n].at) ? known[inTile] : 1;
              }
            });
  const int width = around.right - around.left + 1, height = around.bottom - around.top + 1;
  const std::vector<double> all = WindowVariances(values, known, width, height, margin);
  std::vector<double> own;
  for (int j = tile.top; j <= tile.bottom; ++j)
  {
    const auto row = all.begin() + static_cast<std::ptrdiff_t>(j - around.top) * width - around.left;
    own.insert(own.end(), row + tile.left, row + tile.right + 1);
  }
  return own;
}

/// The least sigma of all lines at the pixels of a tile.
void StandardError::TakeLeast(const Shown& shown, const Tile& tile, const std::vector<Line>& lines, float* sigma) const
{
  const std::size_t count = static_cast<std::size_t>(shown.window.columns) * shown.window.rows;
  bool slopes = false;
  ForPixels(tile, shown.window,
            [&](std::size_t p, std::size_t)
            {
              for (std::size_t n = p; n < lines.size(); n += count)
              {
                slopes = slopes || lines[n].slope > 0;
              }
            });
  const std::vector<double> own = slopes ? OwnVariances(shown, tile, lines) : std::vector<double>(tile.Pixels(), 0);
  ForPixels(tile, shown.window,
            [&](std::size_t p, std::size_t inTile)
            {
              float least = std::numeric_limits<float>::quiet_NaN();
              for (std::size_t n = p; n < lines.size(); n += count)
              {
                const float variance = lines[n].at + lines[n].slope * static_cast<float>(own[inTile]);
                least = least <= variance || std::isnan(variance) ? least : variance;
              }
              sigma[p] = std::sqrt(least < kFloor ? kFloor : least);
            });
}

void StandardError::Evaluate(const SlicePlane& plane, const Engine::Window& window, const float* image, float* sigma,
                             double nearness) const
{
  const std::size_t count = static_cast<std::size_t>(window.columns) * window.rows;
  const Seen seen = seen_.value_or(Seen{1, 1});
  Shown shown{plane,
              window,
              image,
              Turned(plane),
              plane.Normal(),
              ApexOf(plane),
              {1 / plane.columnStep.norm(), 1 / plane.rowStep.norm()}};
  shown.residual = 1 - nearness * (1 - seen.residual);
  shown.rate = 1 - nearness * (1 - seen.rate);
  for (std::size_t k = 0; k < shown.turned.size(); ++k)
  {
    shown.turned[k] = Further(shown.turned[k], usualTurn_[k]);
  }
  const std::vector<Set> sets = Sets(plane, shown.turned);
  std::vector<Line> lines(sets.size() * count);
  ForTiles(window, [&](const Tile& tile) { FindLines(shown, tile, sets, lines); });
  ForTiles(window, [&](const Tile& tile) { TakeLeast(shown, tile, lines, sigma); });
}

std::vector<StandardError::Square> StandardError::Squares() const
{
  const SlicePlane& plane = frames_.front().plane;
  double side = std::sqrt(plane.columnStep.norm() * plane.rowStep.norm());
  std::vector<Square> squares;
  for (const float share : squares_)
  {
    side *= 2;
    squares.push_back({side, share});
  }
  return squares;
}

namespace
{

/// What a mean over a square keeps of the standard error of a pixel. Between known sides the logarithm follows that of the
/// side; beyond the largest, squares are independent of each other.
double ShareKept(const std::vector<StandardError::Square>& squares, double side)
{
  StandardError::Square smaller{squares.front().side / 2, 1};
  if (side <= smaller.side)
  {
    return 1;
  }
  for (const StandardError::Square& larger : squares)
  {
    if (side <= larger.side)
    {
      const double part = std::log(side / smaller.side) / std::log(larger.side / smaller.side);
      return smaller.share * std::pow(larger.share / smaller.share, part);
    }
    smaller = larger;
  }
  return smaller.share * smaller.side / side;
}

}  // namespace

double StandardError::OfMean(const SlicePlane& plane, const float* sigma, const unsigned char* where, int slices,
                             double step) const
{
  double variance = 0, count = 0;
  std::vector<char> taken(slices, 0);
  const std::size_t pixels = static_cast<std::size_t>(plane.width) * plane.height;
  for (std::size_t p = 0; p < pixels * slices; ++p)
  {
    if ((!where || where[p]) && !std::isnan(sigma[p]))
    {
      variance += static_cast<double>(sigma[p]) * sigma[p];
      count += 1;
      taken[p / pixels] = 1;
    }
  }
  if (count == 0 || squares_.empty())
  {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const auto depth = std::count(taken.begin(), taken.end(), 1);
  const double area = count * plane.columnStep.cross(plane.rowStep).norm() / static_cast<double>(depth);
  const double share = ShareKept(Squares(), std::sqrt(area));
  const double gaps = gap_ > 0 ? std::max(static_cast<double>(depth - 1) * step / gap_, 1.0) : 1;
  return std::sqrt(variance / count * share * share / gaps + static_cast<double>(bias_) * bias_);
}

bool StandardError::Evaluate(const GridPart& grid, const std::function<bool(const Extent&, float*)>& render,
                             float* sigma, bool isVolume) const
{
  const Extent &extent = grid.extent, &whole = grid.whole;
  for (int k = extent[4]; k <= extent[5]; ++k)
  {
    // Pixels around the extent have a say in it, as far as the whole goes.
    const SlicePlane plane = grid.PlaneAt(k);
    const int margin = Margin(plane);
    Extent part = {0, 0, 0, 0, k, k};
    for (int axis = 0; axis < 2; ++axis)
    {
      part[2 * axis] = std::max(whole[2 * axis], extent[2 * axis] - margin);
      part[2 * axis + 1] = std::min(whole[2 * axis + 1], extent[2 * axis + 1] + margin);
    }
    const Engine::Window window{part[0] - whole[0], part[2] - whole[2], part[1] - part[0] + 1, part[3] - part[2] + 1};
    std::vector<float> image(static_cast<std::size_t>(window.columns) * window.rows), found(image.size());
    if (!render(part, image.data()))
    {
      return false;
    }
    Evaluate(plane, window, image.data(), found.data(), isVolume ? 0 : NearnessOf(plane));
    for (int j = extent[2]; j <= extent[3]; ++j)
    {
      const float* row = &found[static_cast<std::size_t>(j - part[2]) * window.columns + extent[0] - part[0]];
      sigma = std::copy_n(row, extent[1] - extent[0] + 1, sigma);
    }
  }
  return true;
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
  first = BoxSums(first, width, height, half);
  second = BoxSums(second, width, height, half);
  const bool areAllKnown = std::all_of(known.begin(), known.end(), [](double value) { return value == 1; });
  const std::vector<double> counts = areAllKnown ? std::vector<double>() : BoxSums(known, width, height, half);
  const auto within = [half](int at, int size) { return std::min(size - 1, at + half) - std::max(0, at - half) + 1; };
  std::size_t p = 0;
  for (int j = 0; j < height; ++j)
  {
    for (int i = 0; i < width; ++i, ++p)
    {
      const double count = areAllKnown ? within(i, width) * within(j, height) : counts[p];
      const double mean = first[p] / count;
      second[p] = count > 0 ? std::max(second[p] / count - mean * mean, 0.0) : 0;
    }
  }
  return second;
}

//------------------------------------------------------------------------------
// Bytes

std::string StandardError::ToBytes() const
{
  StateWriter out;
  out.Number<std::uint32_t>(seen_ ? kVersion : 2);
  out.Number<std::uint32_t>(width_);
  out.Number<std::uint32_t>(height_);
  out.Number<std::uint32_t>(cell_);
  out.Number(trackerNoise_);
  out.Array(sequences_);
  out.Array(speckle_);
  out.Array(usualTurn_);
  out.Array(squares_);
  out.Number(bias_);
  if (seen_)
  {
    out.Number(seen_->residual);
    out.Number(seen_->rate);
  }
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
  for (std::uint8_t Codes::*const code : {&Codes::residual, &Codes::rate, &Codes::texture})
  {
    std::vector<std::uint8_t> all;
    std::transform(codes_.begin(), codes_.end(), std::back_inserter(all), [&](const Codes& of) { return of.*code; });
    out.Array(all);
  }
  return out.Take();
}

StandardError::StandardError(std::string_view bytes)
try
{
  StateReader in(bytes);
  const auto version = in.NumberIn<std::uint32_t>(1, kVersion);
  width_ = static_cast<int>(in.NumberIn<std::uint32_t>(1, 1 << 15));
  height_ = static_cast<int>(in.NumberIn<std::uint32_t>(1, 1 << 15));
  cell_ = static_cast<int>(in.NumberIn<std::uint32_t>(1, 1 << 15));
  trackerNoise_ = in.NumberIn<double>(0, kMostNoise);
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
  if (version > 1)
  {
    squares_ = in.Array<float>();
    bias_ = in.NumberIn<float>(0, 1);
  }
  if (version > 2)
  {
    seen_ = Seen{1, 1};
    seen_->residual = in.NumberIn<float>(0, 1);
    seen_->rate = in.NumberIn<float>(0, 1);
  }
  StateReader::Require(
      squares_.size() <= 15 && std::all_of(squares_.begin(), squares_.end(), [](float x) { return x > 0 && x <= 1; }),
      "shares of squares");
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
  for (std::uint8_t Codes::*const code : {&Codes::residual, &Codes::rate, &Codes::texture})
  {
    const auto all = in.Array<std::uint8_t>();
    StateReader::Require(all.size() == Cells() * poses_.size(), "cells of another number");
    codes_.resize(all.size());
    for (std::size_t cell = 0; cell < all.size(); ++cell)
    {
      codes_[cell].*code = all[cell];
    }
  }
  in.End();
  Derive();
}
catch (const Error&)
{
  throw Error("Gaussian field: the array StandardError is damaged, or of a newer BIGUS; remove it, or train again.");
}

}  // namespace bigus
