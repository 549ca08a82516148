// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include "Core/Model/Error.h"
#include "Core/StandardError/StandardError.h"

namespace bigus
{
namespace
{

constexpr std::size_t kMostPixels = 1000000;  // of all frames, evenly chosen; sorting more tells little more

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

}  // namespace

StandardErrorScores ScoreStandardError(const StandardError& standardError, const GaussianField& field,
                                       const Sweep& sweep, const std::vector<int>& frames,
                                       const std::string& engineName)
{
  const std::unique_ptr<Engine> engine = Engine::Create(engineName);
  engine->SetField(field);
  const std::size_t pixels = sweep.PixelsPerFrame();
  const std::size_t stride = 1 + pixels * frames.size() / kMostPixels;
  std::vector<float> truth(pixels), image(pixels), sigma(pixels), errors, sigmas;
  std::size_t lit = 0, next = 0;
  for (const int frame : frames)
  {
    const SlicePlane plane = sweep.Plane(frame);
    sweep.CopyFrame(frame, truth.data());
    engine->Render(plane, ViewOutput::Intensity, image.data());
    standardError.Evaluate(plane, image.data(), sigma.data());
    for (; next < pixels; next += stride)
    {
      lit += sweep.IsLit(next) ? 1 : 0;
      if (sweep.IsLit(next) && !std::isnan(sigma[next]))
      {
        errors.push_back(std::abs(truth[next] - image[next]));
        sigmas.push_back(sigma[next]);
      }
    }
    next -= pixels;
  }
  if (errors.empty())
  {
    throw Error("The standard error is known at no pixel of the frames to score: none lies between training frames.");
  }
  StandardErrorScores scores;
  const auto count = static_cast<double>(errors.size());
  double predicted = 0, squares = 0;
  for (std::size_t k = 0; k < errors.size(); ++k)
  {
    predicted += static_cast<double>(sigmas[k]) * sigmas[k] / count;
    squares += static_cast<double>(errors[k]) * errors[k] / count;
    scores.within1 += (errors[k] <= sigmas[k] ? 1 : 0) / count;
    scores.within2 += (errors[k] <= 2 * sigmas[k] ? 1 : 0) / count;
  }
  scores.rmse = std::sqrt(squares);
  scores.varianceRatio = squares > 0 ? predicted / squares : 0;
  scores.known = count / static_cast<double>(lit);
  const double oracle = ErrorLeft(errors, errors);
  scores.sparsification = scores.rmse > oracle ? (ErrorLeft(sigmas, errors) - oracle) / (scores.rmse - oracle) : 0;
  return scores;
}

}  // namespace bigus
