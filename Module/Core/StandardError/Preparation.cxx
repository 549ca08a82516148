// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a training leaves behind for its field's standard error.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "Core/Engine/ViewEngine.h"
#include "Core/Evaluation/FrameInSpace.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Poses/Trajectory.h"
#include "Core/StandardError/Inside.h"
#include "Core/StandardError/StandardError.h"

namespace bigus
{
namespace
{

constexpr std::size_t kMostBytes = std::size_t(4) << 20;
/// Of the local variance that is speckle, which is another from another direction; the rest is structure.
constexpr double kSpeckle = 0.8;     // where the sweep does not tell
constexpr std::size_t kShares = 16;  // frames that tell how much is speckle, at most; more tell little more
constexpr double kOther = 4;         // mm between frames, five of the beam's 0.8 mm: their speckle is another
constexpr int kNeighbours = 6;       // on either side, from which a frame is predicted
constexpr std::size_t kAtOnce = 16;  // frames in memory
constexpr int kFewestSquares = 20;   // of one size, whose means tell how alike errors are

/// Errors as they are, and their means over squares with sides of 2, 4, 8, ... pixels.
struct SquaresOfOneSize
{
  double means = 0, pixels = 0;  // sums over squares: of the squared mean, and of the mean square
  double count = 0;

  void operator+=(const SquaresOfOneSize& other)
  {
    means += other.means;
    pixels += other.pixels;
    count += other.count;
  }
};

/// Of squares that are known (1, else 0) to their last pixel.
std::vector<SquaresOfOneSize> MeansOverSquares(const std::vector<double>& errors, const std::vector<double>& known,
                                               int width, int height)
{
  std::vector<SquaresOfOneSize> sizes;
  std::vector<double> sum(errors.size()), square(errors.size()), count = known;
  for (std::size_t p = 0; p < errors.size(); ++p)
  {
    sum[p] = known[p] * errors[p];
    square[p] = sum[p] * errors[p];
  }
  for (double pixels = 4; width >= 2 && height >= 2; pixels *= 4, width /= 2, height /= 2)
  {
    const auto halve = [&](std::vector<double>& values)
    {
      for (std::size_t j = 0, p = 0; j < static_cast<std::size_t>(height / 2); ++j)
      {
        for (std::size_t i = 0; i < static_cast<std::size_t>(width / 2); ++i, ++p)
        {
          const double* const at = &values[2 * j * width + 2 * i];
          values[p] = at[0] + at[1] + at[width] + at[width + 1];
        }
      }
      values.resize(static_cast<std::size_t>(width / 2) * (height / 2));
    };
    halve(sum);
    halve(square);
    halve(count);
    SquaresOfOneSize size;
    for (std::size_t p = 0; p < sum.size(); ++p)
    {
      if (count[p] == pixels)
      {
        size += {sum[p] * sum[p] / (pixels * pixels), square[p] / pixels, 1};
      }
    }
    sizes.push_back(size);
  }
  return sizes;
}

/// The training frames less what directions add to the field's picture of them.
Sweep AsUsual(Engine& engine, const GaussianField& field, const ViewDependence& view, const Sweep& sweep,
              const std::vector<int>& training)
{
  Sweep usual = sweep.ReducedOf(training, 1);
  const std::size_t size = sweep.PixelsPerFrame();
  const auto pixels = std::make_shared<std::vector<float>>(size * training.size());
  std::vector<float> image(size);
  const auto add = [&](double sign, SeenField& seen)
  {
    for (std::size_t k = 0; k < training.size(); ++k)
    {
      const SlicePlane plane = sweep.Plane(training[k]);
      seen.LookFrom(plane);
      engine.Render(plane, ViewOutput::Intensity, image.data());
      float* const frame = pixels->data() + k * size;
      std::transform(image.begin(), image.end(), frame, frame,
                     [&](float value, float sum) { return sum + sign * value; });
    }
  };
  SeenField alike(engine, field, nullptr);
  add(1, alike);
  SeenField seen(engine, field, &view);
  add(-1, seen);
  for (std::size_t k = 0; k < training.size(); ++k)
  {
    sweep.CopyFrame(training[k], image.data());
    float* const frame = pixels->data() + k * size;
    std::transform(image.begin(), image.end(), frame, frame, std::plus<>());
  }
  usual.pixelType = Sweep::PixelType::Float32;
  usual.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return usual;
}

}  // namespace

/// Measures one training frame after another.
class StandardError::Preparation
{
public:
  /// `usual`: null, or the training frames as they would be without what the field knows of directions.
  Preparation(StandardError& kept, const Sweep& sweep, const std::vector<int>& training, const Sweep* usual)
      : kept_(kept)
  {
    for (const int frame : training)
    {
      if (usual)
      {
        usual_.emplace_back(*usual, static_cast<int>(frames_.size()));
      }
      frames_.emplace_back(sweep, frame);
    }
    const std::size_t cells = kept.Cells() * training.size();
    kept.codes_.assign(cells, {});
    between_.assign(cells, 0);
    apart_.assign(cells, -1);
    kept.usualTurn_.assign(training.size(), 0);
    kept.speckle_.assign(training.size(), static_cast<float>(kSpeckle));
    beside_.resize(training.size());
    share_.assign(training.size(), -1);
    seen_.resize(training.size());
    squares_.resize(training.size());
    residuals_.resize(training.size());
  }

  /// T and V of training frame k, of which the field shows `image`, and how well its neighbours predict it.
  void Measure(std::size_t k, const float* image)
  {
    const int width = kept_.width_;
    std::vector<double> lit(kept_.lit_.begin(), kept_.lit_.end()), frame(lit.size()), errors(lit.size()),
        squares(lit.size());
    for (std::size_t p = 0; p < lit.size(); ++p)
    {
      frame[p] = Pixel(frames_[k], p);
      errors[p] = frame[p] - image[p];
      squares[p] = errors[p] * errors[p];
      if (!usual_.empty())
      {
        seen_[k].own += lit[p] * squares[p];
        seen_[k].ownSeen += lit[p] * std::pow(Pixel(usual_[k], p) - image[p], 2);
      }
    }
    residuals_[k] = MeansOverSquares(errors, lit, width, kept_.height_);
    const std::vector<double> texture = WindowVariances(frame, lit, width, kept_.height_, kHalfWindow);
    ForCells(k, WindowMeans(squares, lit), lit,
             [this](std::size_t cell, double mean) { kept_.codes_[cell].residual = CodeOfVariance(mean); });
    ForCells(k, texture, lit,
             [this](std::size_t cell, double mean) { kept_.codes_[cell].texture = CodeOfVariance(mean); });
    Predict(k, frame, texture);
    if (k % (1 + frames_.size() / kShares) == 0)
    {
      share_[k] = Share(k, frame, texture);
    }
  }

  /// R, when all frames are measured: errors of interpolation by what m is there, but not less than half the usual m, since
  /// frames that nearly coincide tell of no rate.
  void Finish()
  {
    std::vector<double> usual;
    std::copy_if(apart_.begin(), apart_.end(), std::back_inserter(usual), [](double m) { return m >= 0; });
    if (usual.empty())
    {
      return;
    }
    const double least = std::max(0.5 * Median(std::move(usual)), 1e-9);
    for (std::size_t cell = 0; cell < apart_.size(); ++cell)
    {
      kept_.codes_[cell].rate = apart_[cell] >= 0 ? CodeOfVariance(between_[cell] / std::max(apart_[cell], least)) : 0;
    }
    KeepTurns();
    KeepSquares();
    if (!usual_.empty())
    {
      KeepSeen();
    }
  }

private:
  static std::vector<SquaresOfOneSize> Sum(const std::vector<std::vector<SquaresOfOneSize>>& frames)
  {
    std::vector<SquaresOfOneSize> all(frames.front().size());
    for (const std::vector<SquaresOfOneSize>& frame : frames)
    {
      for (std::size_t size = 0; size < all.size(); ++size)
      {
        all[size] += frame[size];
      }
    }
    return all;
  }

  /// What means keep of errors between frames, and what the largest are of the field's own on frames.
  void KeepSquares()
  {
    const std::vector<SquaresOfOneSize> between = Sum(squares_), own = Sum(residuals_);
    for (std::size_t size = 0; size < between.size(); ++size)
    {
      if (between[size].count < kFewestSquares || own[size].count < kFewestSquares || !(between[size].means > 0))
      {
        break;
      }
      kept_.squares_.push_back(
          static_cast<float>(std::sqrt(std::min(between[size].means / between[size].pixels, 1.0))));
      kept_.bias_ = static_cast<float>(std::sqrt(own[size].means / own[size].count));
    }
  }

  /// How much speckle was another where R was measured, and how much speckle there can be at all: frames that are turned by
  /// w differ by 2 w of it.
  void KeepTurns()
  {
    FromBeside all;
    for (const FromBeside& one : beside_)
    {
      all.turned += one.turned;
      all.squares += one.squares;
      all.texture += one.texture;
      all.count += one.count;
    }
    double shares = 0, known = 0;
    for (const double share : share_)
    {
      shares += share >= 0 ? share : 0;
      known += share >= 0 ? 1 : 0;
    }
    const double speckle = known > 0 ? shares / known : kSpeckle;
    for (std::size_t k = 0; k < beside_.size(); ++k)
    {
      const FromBeside& one = beside_[k].count > 0 ? beside_[k] : all;  // the first and the last lie between no others
      kept_.usualTurn_[k] = static_cast<float>(std::min(one.turned / one.count, kMostTurn));
      const double most = 2 * one.turned / one.count * one.texture;
      kept_.speckle_[k] = static_cast<float>(one.squares < speckle * most ? one.squares / most : speckle);
    }
  }

  /// Of errors on frames and between them, the share that is left where directions count.
  void KeepSeen()
  {
    FromDirections all;
    for (const FromDirections& one : seen_)
    {
      all.own += one.own;
      all.ownSeen += one.ownSeen;
      all.between += one.between;
      all.betweenSeen += one.betweenSeen;
    }
    const auto share = [](double seen, double usual)
    { return static_cast<float>(usual > 0 ? std::min(seen / usual, 1.0) : 1); };
    kept_.seen_ = {share(all.ownSeen, all.own), share(all.betweenSeen, all.between)};
  }

  double Pixel(const FrameInSpace& frame, std::size_t p) const
  {
    return frame.Pixel(static_cast<int>(p % kept_.width_), static_cast<int>(p / kept_.width_));
  }

  /// Means over windows of what counts (1, else 0).
  std::vector<double> WindowMeans(std::vector<double> values, const std::vector<double>& counted) const
  {
    for (std::size_t p = 0; p < values.size(); ++p)
    {
      values[p] *= counted[p];
    }
    values = BoxSums(values, kept_.width_, kept_.height_, kHalfWindow);
    const std::vector<double> counts = BoxSums(counted, kept_.width_, kept_.height_, kHalfWindow);
    for (std::size_t p = 0; p < values.size(); ++p)
    {
      values[p] /= std::max(counts[p], 1.0);
    }
    return values;
  }

  /// The mean over every cell of frame k that has something that counts.
  template <class Store>
  void ForCells(std::size_t k, const std::vector<double>& values, const std::vector<double>& counted, Store store) const
  {
    std::vector<double> sums(kept_.Cells(), 0), counts(kept_.Cells(), 0);
    for (std::size_t p = 0; p < values.size(); ++p)
    {
      const std::size_t i = p % kept_.width_ / kept_.cell_, j = p / kept_.width_ / kept_.cell_;
      sums[j * kept_.CellColumns() + i] += counted[p] * values[p];
      counts[j * kept_.CellColumns() + i] += counted[p];
    }
    for (std::size_t cell = 0; cell < sums.size(); ++cell)
    {
      if (counts[cell] > 0)
      {
        store(k * kept_.Cells() + cell, sums[cell] / counts[cell]);
      }
    }
  }

  const std::vector<int>& SequenceOf(std::size_t k) const
  {
    return *std::find_if(kept_.bySequence_.begin(), kept_.bySequence_.end(),
                         [k](const std::vector<int>& s) { return s.back() >= static_cast<int>(k); });
  }

  /// Of the local variance of frame k how much is another in a frame so far off that its speckle is; -1: not known.
  double Share(std::size_t k, const std::vector<double>& frame, const std::vector<double>& texture) const
  {
    const auto middle = [this](std::size_t frame)
    { return kept_.frames_[frame].plane.Point(0.5 * (kept_.width_ - 1), 0.5 * (kept_.height_ - 1)); };
    const std::vector<int>& sequence = SequenceOf(k);
    int other = -1;
    double least = 2 * kOther;
    for (const int j : sequence)
    {
      const double distance = std::abs(kept_.frames_[k].normal.dot(middle(j) - middle(k)));
      if (distance >= kOther && distance < least)
      {
        least = distance;
        other = j;
      }
    }
    if (other < 0)
    {
      return -1;
    }
    const std::vector<Beside> beside = kept_.Nearest(kept_.frames_[k].plane, {other});
    std::vector<double> known(frame.size(), 0), sample(frame.size(), 0), difference(frame.size(), 0);
    for (std::size_t p = 0; p < frame.size(); ++p)
    {
      const int side = beside[p].frame[0] >= 0 ? 0 : 1;
      if (kept_.lit_[p] && beside[p].frame[side] >= 0)
      {
        known[p] = 1;
        sample[p] = frames_[other].Sample(Eigen::Vector3d(beside[p].column[side], beside[p].row[side], 0));
        difference[p] = frame[p] - sample[p];
      }
    }
    const auto variances = [&](const std::vector<double>& values)
    { return WindowVariances(values, known, kept_.width_, kept_.height_, kHalfWindow); };
    const std::vector<double> differences = variances(difference), there = variances(sample);
    double sum = 0, squares = 0;
    for (std::size_t p = 0; p < frame.size(); ++p)
    {
      sum += known[p] * (texture[p] + there[p]);
      squares += known[p] * differences[p];
    }
    return sum > 0 ? std::min(squares / sum, 1.0) : -1;
  }

  /// The frame is left out: linear interpolation between its neighbours, where it lies between two.
  void Predict(std::size_t k, const std::vector<double>& frame, const std::vector<double>& texture)
  {
    std::vector<int> among;
    for (const int other : SequenceOf(k))
    {
      if (other != static_cast<int>(k) && std::abs(other - static_cast<int>(k)) <= kNeighbours)
      {
        among.push_back(other);
      }
    }
    const SlicePlane& plane = kept_.frames_[k].plane;
    const std::vector<Beside> beside = kept_.Nearest(plane, among);
    const std::vector<double> turned = kept_.Turned(plane);
    const Eigen::Vector3d normal = plane.Normal(), apex = kept_.ApexOf(plane);
    std::vector<double> known(frame.size(), 0), apart(frame.size(), 0), errors(frame.size(), 0),
        squares(frame.size(), 0);
    FromBeside& sums = beside_[k];
    for (std::size_t p = 0; p < frame.size(); ++p)
    {
      const Beside& at = beside[p];
      if (kept_.lit_[p] && at.frame[0] >= 0 && at.frame[1] >= 0)
      {
        const double t = at.Nearness();
        const auto between = [&](const std::vector<FrameInSpace>& frames)
        {
          const auto sample = [&](int side)
          { return frames[at.frame[side]].Sample(Eigen::Vector3d(at.column[side], at.row[side], 0)); };
          return t * sample(0) + (1 - t) * sample(1);
        };
        errors[p] = frame[p] - between(frames_);
        squares[p] = errors[p] * errors[p];
        if (!usual_.empty())
        {
          seen_[k].between += squares[p];
          seen_[k].betweenSeen += std::pow(Pixel(usual_[k], p) - between(usual_), 2);
        }
        apart[p] = at.Apart();
        known[p] = 1;
        const int side = t >= 0.5 ? 0 : 1;
        const auto beam = [&]
        { return Eigen::Vector3d((plane.Point(p % kept_.width_, p / kept_.width_) - apex).normalized()); };
        sums.turned += kept_.apex_ ? Another(kept_.ViewOf(at, side), {normal, beam()}) : turned[at.frame[side]];
        sums.squares += squares[p];
        sums.texture += texture[p];
        sums.count += 1;
      }
    }
    squares_[k] = MeansOverSquares(errors, known, kept_.width_, kept_.height_);
    ForCells(k, WindowMeans(squares, known), known, [this](std::size_t cell, double mean) { between_[cell] = mean; });
    ForCells(k, WindowMeans(apart, known), known, [this](std::size_t cell, double mean) { apart_[cell] = mean; });
  }

  StandardError& kept_;
  std::vector<FrameInSpace> frames_, usual_;
  std::vector<double> between_, apart_;  // [frames][cells], apart -1: not known
  /// What frames beside a frame tell of it: sums over pixels that lie between two.
  struct FromBeside
  {
    double turned = 0, squares = 0, texture = 0, count = 0;
  };
  /// Sums of squared errors, without directions and with.
  struct FromDirections
  {
    double own = 0, ownSeen = 0, between = 0, betweenSeen = 0;
  };
  std::vector<FromDirections> seen_;  // [frames]
  std::vector<double> share_;         // [frames] of texture that is speckle, -1: not known
  std::vector<FromBeside> beside_;    // [frames]
  std::vector<std::vector<SquaresOfOneSize>> squares_, residuals_;  // [frames][sizes]
};

StandardError::StandardError(const GaussianField& field, const Sweep& sweep, const std::vector<int>& training,
                             double trackerNoise, const std::string& engineName, const ViewDependence* view)
    : width_(sweep.width), height_(sweep.height), trackerNoise_(std::min(trackerNoise, kMostNoise))
{
  CheckTraining(sweep, training);
  for (const int frame : training)
  {
    poses_.push_back(sweep.imageToReference[frame]);
    sequences_.push_back(sweep.SequenceOf(frame));
  }
  lit_.resize(sweep.PixelsPerFrame());
  for (std::size_t p = 0; p < lit_.size(); ++p)
  {
    lit_[p] = sweep.IsLit(p) ? 1 : 0;
  }
  while (3 * Cells() * training.size() > kMostBytes && cell_ < std::max(width_, height_))
  {
    cell_ *= 2;
  }
  seen_ = view ? std::optional(Seen{1, 1}) : std::nullopt;
  Derive();
  const std::unique_ptr<Engine> engine = Engine::Create(engineName);
  const std::optional<Sweep> usual =
      view ? std::optional(AsUsual(*engine, field, *view, sweep, training)) : std::nullopt;
  Preparation preparation(*this, sweep, training, usual ? &*usual : nullptr);
  engine->SetField(field);
  for (std::size_t first = 0; first < training.size(); first += kAtOnce)
  {
    const std::size_t count = std::min(kAtOnce, training.size() - first);
    std::vector<std::vector<float>> images(count, std::vector<float>(sweep.PixelsPerFrame()));
    for (std::size_t k = 0; k < count; ++k)
    {
      engine->Render(frames_[first + k].plane, ViewOutput::Intensity, images[k].data());
    }
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t k) { preparation.Measure(first + k, images[k].data()); });
  }
  preparation.Finish();
}

double TrackerNoise(const Sweep& tracked, double strength)
{
  double least = std::numeric_limits<double>::infinity();
  for (const FrameClock clock : {FrameClock::Times, FrameClock::Numbers})
  {
    const Trajectory trajectory = SmoothTrajectory(tracked, {strength, clock});
    least = std::min(least, trajectory.IsNoiseKnown() ? trajectory.translationLeft : 0);
  }
  return least;
}

}  // namespace bigus
