// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numeric>

#include "Core/Engine/ViewEngine.h"
#include "Core/Model/Error.h"
#include "Core/StandardError/Inside.h"
#include "Core/StandardError/StandardError.h"

namespace bigus
{
namespace
{

constexpr std::size_t kMostPixels = 300000;  // of all frames, evenly chosen; sorting more tells little more

/// The mean, over fractions of 2 to 100 % of the pixels, of the root mean square error of those with the smallest keys.
double ErrorLeft(const std::vector<float>& key, const std::vector<float>& error)
{
  std::vector<std::size_t> order(key.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&key](std::size_t a, std::size_t b) { return key[a] < key[b]; });
  double squares = 0, sum = 0;
  std::size_t done = 0;
  constexpr int kFractions = 50;
  for (int k = 1; k <= kFractions; ++k)
  {
    const std::size_t end = std::max<std::size_t>(1, key.size() * k / kFractions);
    for (; done < end; ++done)
    {
      squares += static_cast<double>(error[order[done]]) * error[order[done]];
    }
    sum += std::sqrt(squares / static_cast<double>(done)) / kFractions;
  }
  return sum;
}

/// What is scored, a number for each pixel that counts.
struct Samples
{
  std::vector<float> errors, model, distance, texture;
  std::size_t lit = 0;
  std::vector<MeanErrorScore> means;
};

double MeanSquare(const std::vector<float>& values)
{
  double sum = 0;
  for (const float value : values)
  {
    sum += static_cast<double>(value) * value;
  }
  return sum / static_cast<double>(values.size());
}

double Correlation(const std::vector<float>& a, const std::vector<float>& b)
{
  const auto count = static_cast<double>(a.size());
  const double meanA = std::accumulate(a.begin(), a.end(), 0.0) / count;
  const double meanB = std::accumulate(b.begin(), b.end(), 0.0) / count;
  double both = 0, squaresA = 0, squaresB = 0;
  for (std::size_t k = 0; k < a.size(); ++k)
  {
    both += (a[k] - meanA) * (b[k] - meanB);
    squaresA += (a[k] - meanA) * (a[k] - meanA);
    squaresB += (b[k] - meanB) * (b[k] - meanB);
  }
  return both / std::sqrt(squaresA * squaresB);
}

StandardErrorScores Compare(const std::vector<float>& sigmas, const std::vector<float>& errors)
{
  StandardErrorScores scores;
  const auto count = static_cast<double>(errors.size());
  for (std::size_t k = 0; k < errors.size(); ++k)
  {
    scores.within1 += (errors[k] <= sigmas[k] ? 1 : 0) / count;
    scores.within2 += (errors[k] <= 2 * sigmas[k] ? 1 : 0) / count;
  }
  const double squares = MeanSquare(errors), rmse = std::sqrt(squares), oracle = ErrorLeft(errors, errors);
  scores.varianceRatio = MeanSquare(sigmas) / squares;
  const auto [least, most] = std::minmax_element(sigmas.begin(), sigmas.end());
  const bool ranks = *least < *most && rmse > oracle;
  scores.correlation = ranks ? Correlation(sigmas, errors) : 0;
  scores.sparsification = ranks ? (ErrorLeft(sigmas, errors) - oracle) / (rmse - oracle) : 1;
  return scores;
}

std::vector<StandardErrorBin> Bins(const std::vector<float>& sigmas, const std::vector<float>& errors)
{
  std::map<int, StandardErrorBin> bins;  // sums of squares at first
  for (std::size_t k = 0; k < errors.size(); ++k)
  {
    StandardErrorBin& bin = bins[static_cast<int>(std::floor(2 * std::log2(sigmas[k])))];
    bin.sigma += static_cast<double>(sigmas[k]) * sigmas[k];
    bin.error += static_cast<double>(errors[k]) * errors[k];
    ++bin.count;
  }
  std::vector<StandardErrorBin> all;
  for (const auto& [key, bin] : bins)
  {
    all.push_back({std::sqrt(bin.sigma / bin.count), std::sqrt(bin.error / bin.count), bin.count});
  }
  return all;
}

/// Compare for a plain model that knows its variances but for one factor.
StandardErrorScores CompareScaled(std::vector<float> sigmas, const std::vector<float>& errors)
{
  const double square = MeanSquare(sigmas);
  const double factor = square > 0 ? std::sqrt(MeanSquare(errors) / square) : 0;
  for (float& sigma : sigmas)
  {
    sigma = static_cast<float>(factor * sigma);
  }
  return Compare(sigmas, errors);
}

/// Errors of a slice's means over squares, and what they are said to be.
class MeanScorer
{
public:
  /// `error`: of every pixel; `sigma`: NaN where it does not count.
  void Add(const StandardError& standardError, const SlicePlane& plane, const std::vector<float>& error,
           const std::vector<float>& sigma)
  {
    for (Size& size : sizes_)
    {
      SlicePlane square = plane;
      square.width = square.height = size.pixels;
      size.side = size.pixels * std::sqrt(plane.columnStep.cross(plane.rowStep).norm());
      std::vector<float> part(static_cast<std::size_t>(size.pixels) * size.pixels);
      for (int top = 0; top + size.pixels <= plane.height; top += size.pixels)
      {
        for (int left = 0; left + size.pixels <= plane.width; left += size.pixels)
        {
          double sum = 0;
          for (std::size_t p = 0; p < part.size(); ++p)
          {
            const std::size_t at = (top + p / size.pixels) * plane.width + left + p % size.pixels;
            part[p] = sigma[at];
            sum += error[at];
          }
          const double stated = standardError.OfMean(square, part.data());
          if (std::none_of(part.begin(), part.end(), [](float value) { return std::isnan(value); }) &&
              !std::isnan(stated))
          {
            size.stated += stated * stated;
            size.squares += std::pow(sum / static_cast<double>(part.size()), 2);
            ++size.count;
          }
        }
      }
    }
  }

  std::vector<MeanErrorScore> Scores() const
  {
    std::vector<MeanErrorScore> scores;
    for (const Size& size : sizes_)
    {
      if (size.squares > 0)
      {
        scores.push_back({size.side, size.stated / size.squares, size.count});
      }
    }
    return scores;
  }

private:
  struct Size
  {
    int pixels;
    double side = 0, stated = 0, squares = 0;
    int count = 0;
  };
  std::array<Size, 3> sizes_{{{8}, {32}, {128}}};
};

Samples SampleFrames(const StandardError& standardError, const GaussianField& field, const Sweep& sweep,
                     const std::vector<int>& frames, const std::string& engineName, const ViewDependence* view)
{
  const std::unique_ptr<Engine> engine = Engine::Create(engineName);
  SeenField seen(*engine, field, view);
  const std::size_t pixels = sweep.PixelsPerFrame(), stride = 1 + pixels * frames.size() / kMostPixels;
  std::vector<float> truth(pixels), image(pixels), sigma(pixels);
  Samples samples;
  MeanScorer means;
  std::size_t next = 0;
  for (const int frame : frames)
  {
    const SlicePlane plane = sweep.Plane(frame);
    sweep.CopyFrame(frame, truth.data());
    seen.LookFrom(plane);
    engine->Render(plane, ViewOutput::Intensity, image.data());
    standardError.Evaluate(plane, image.data(), sigma.data());
    const std::vector<float> apart = standardError.Apart(plane);
    std::vector<double> known(pixels);
    std::transform(sigma.begin(), sigma.end(), known.begin(), [](float value) { return std::isnan(value) ? 0 : 1; });
    const std::vector<double> texture =
        WindowVariances({image.begin(), image.end()}, known, plane.width, plane.height, kHalfWindow);
    for (; next < pixels; next += stride)
    {
      samples.lit += sweep.IsLit(next) ? 1 : 0;
      if (sweep.IsLit(next) && known[next] > 0)
      {
        samples.errors.push_back(std::abs(truth[next] - image[next]));
        samples.model.push_back(sigma[next]);
        samples.distance.push_back(std::sqrt(apart[next]));
        samples.texture.push_back(static_cast<float>(std::sqrt(texture[next])));
      }
    }
    next -= pixels;
    for (std::size_t p = 0; p < pixels; ++p)
    {
      truth[p] -= image[p];
      sigma[p] = sweep.IsLit(p) ? sigma[p] : std::numeric_limits<float>::quiet_NaN();
    }
    means.Add(standardError, plane, truth, sigma);
  }
  samples.means = means.Scores();
  return samples;
}

}  // namespace

StandardErrorReport ScoreStandardError(const StandardError& standardError, const GaussianField& field,
                                       const Sweep& sweep, const std::vector<int>& frames, const std::string& engine,
                                       const ViewDependence* view)
{
  const Samples samples = SampleFrames(standardError, field, sweep, frames, engine, view);
  const double square = samples.errors.empty() ? 0 : MeanSquare(samples.errors);
  Require(square > 0, samples.errors.empty()
                          ? "The standard error is known at no pixel of the frames to score: none lies "
                            "between training frames."
                          : "The frames to score are as the field shows them: there is no error to tell.");
  StandardErrorReport report;
  report.model = Compare(samples.model, samples.errors);
  report.constant = CompareScaled(std::vector<float>(samples.errors.size(), 1), samples.errors);
  report.distance = CompareScaled(samples.distance, samples.errors);
  report.texture = CompareScaled(samples.texture, samples.errors);
  report.reliability = Bins(samples.model, samples.errors);
  report.means = samples.means;
  report.rmse = std::sqrt(square);
  report.known = static_cast<double>(samples.errors.size()) / static_cast<double>(samples.lit);
  return report;
}

}  // namespace bigus
