// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/FrameCorrections.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "Core/Model/PixelMemory.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

/// The gains that are believed, and the offset, in intensity: beyond them something else is wrong with the frame.
constexpr double kSmallestGain = 0.5, kLargestGain = 2.0, kLargestOffset = 0.1;

/// Frames to either side that make the smooth curve which belongs to the scene.
constexpr int kReach = 4;

/// Gain 1 weighs as much as this share of the frame's own contrast: a frame that the field hardly explains keeps its
/// brightness.
constexpr double kPriorOnGain = 0.1;

/// The frame's pixels without the gain and the offset that were found for it.
void Undo(double gain, double offset, float* pixels, std::size_t size)
{
  for (float* value = pixels; value != pixels + size; ++value)
  {
    if (*value > 0)  // black is where the scanner showed nothing
    {
      *value = static_cast<float>(std::clamp((*value - offset) / gain, 0.0, 1.0));
    }
  }
}

/// Sums over the lit pixels of two images.
struct PixelSums
{
  double x = 0, y = 0, xx = 0, yy = 0, xy = 0, n = 0;
};
PixelSums SumsOf(const Sweep& sweep, const float* a, const float* b)
{
  PixelSums m;
  for (std::size_t p = 0; p < sweep.PixelsPerFrame(); ++p)
  {
    if (sweep.IsLit(p))
    {
      m.x += a[p];
      m.y += b[p];
      m.xx += static_cast<double>(a[p]) * a[p];
      m.yy += static_cast<double>(b[p]) * b[p];
      m.xy += static_cast<double>(a[p]) * b[p];
      m.n += 1;
    }
  }
  return m;
}

/// A first guess at frames' gains, from neighbours alone. The ratio of neighbours' contrasts counts as far as they
/// correlate. Of its running product a smooth curve belongs to the scene, and what is left to the frames. The first of
/// `pixels` are those of one sequence.
void LevelWithNeighbours(const Sweep& poses, std::size_t frames, float* pixels)
{
  const std::size_t size = poses.PixelsPerFrame();
  std::vector<double> logGains(frames, 0.0);
  for (std::size_t k = 0; k + 1 < frames; ++k)
  {
    const auto [x, y, xx, yy, xy, n] = SumsOf(poses, pixels + k * size, pixels + (k + 1) * size);
    const double varX = n * xx - x * x, varY = n * yy - y * y, covariance = n * xy - x * y;
    const bool alike = varX > 0 && varY > 0 && covariance > 0;
    logGains[k + 1] = logGains[k] + (alike ? covariance / std::sqrt(varX * varY) * 0.5 * std::log(varY / varX) : 0.0);
  }
  for (std::size_t k = 0; k < frames; ++k)
  {
    double sum = 0, weights = 0;
    for (int step = -kReach; step <= kReach; ++step)
    {
      const auto other = static_cast<std::ptrdiff_t>(k) + step;
      if (other >= 0 && other < static_cast<std::ptrdiff_t>(frames))
      {
        const double weight = kReach + 1 - std::abs(step);
        sum += weight * logGains[other];
        weights += weight;
      }
    }
    Undo(std::clamp(std::exp(logGains[k] - sum / weights), kSmallestGain, kLargestGain), 0, pixels + k * size, size);
  }
}

/// Gives `sweep`, which begins with the recorded `frames`, these frames' pixels as `change` makes them of the recorded
/// ones; those after them stay as they are.
void WithPixels(Sweep& sweep, const Sweep& recorded, const std::vector<int>& frames,
                const std::function<void(float*)>& change)
{
  const std::size_t size = sweep.PixelsPerFrame();
  const auto pixels = AllocatePixels<float>(size * sweep.imageToReference.size());
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    float* image = pixels.get() + k * size;
    static_cast<std::size_t>(k) < frames.size() ? recorded.CopyFrame(frames[k], image) : sweep.CopyFrame(k, image);
  }
  change(pixels.get());
  sweep.pixelType = Sweep::PixelType::Float32;
  sweep.pixels = pixels;
}

}  // namespace

std::shared_ptr<const Sweep> Levelled(const Sweep& recorded, const std::vector<int>& frames, const Sweep& present)
{
  auto levelled = std::make_shared<Sweep>(present);
  WithPixels(*levelled, recorded, frames,
             [&](float* pixels)
             {
               for (const std::vector<int>& own : BySequence(recorded, frames))
               {
                 LevelWithNeighbours(*levelled, own.size(), pixels);
                 pixels += own.size() * recorded.PixelsPerFrame();
               }
             });
  return levelled;
}

Corrections FindCorrections(Engine& engine, const Sweep& recorded, const std::vector<int>& frames)
{
  const std::size_t size = recorded.PixelsPerFrame();
  Corrections found;
  std::vector<float> image(size), pixels(size);
  for (const int frame : frames)
  {
    engine.Render(recorded.Plane(frame), ViewOutput::Intensity, image.data());
    recorded.CopyFrame(frame, pixels.data());
    const auto [x, y, xx, yy, xy, n] = SumsOf(recorded, image.data(), pixels.data());
    const double variance = n > 0 ? xx / n - x / n * (x / n) : 0.0;
    const double covariance = n > 0 ? xy / n - x / n * (y / n) : 0.0;
    const double prior = kPriorOnGain * variance;
    const double gain =
        variance > 0 ? std::clamp((covariance + prior) / (variance + prior), kSmallestGain, kLargestGain) : 1.0;
    found.gains.push_back(gain);
    found.offsets.push_back(n > 0 ? std::clamp(y / n - gain * x / n, -kLargestOffset, kLargestOffset) : 0.0);
  }
  const double meanGain = Mean(found.gains), meanOffset = Mean(found.offsets);
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    found.gains[k] /= meanGain;
    found.offsets[k] -= meanOffset;
  }
  return found;
}

std::shared_ptr<const Sweep> Corrected(const Corrections& found, const Sweep& recorded, const std::vector<int>& frames,
                                       const Sweep& present)
{
  auto corrected = std::make_shared<Sweep>(present);
  const std::size_t size = corrected->PixelsPerFrame();
  WithPixels(*corrected, recorded, frames,
             [&](float* pixels)
             {
               for (std::size_t k = 0; k < frames.size(); ++k)
               {
                 Undo(found.gains[k], found.offsets[k], pixels + k * size, size);
               }
             });
  return corrected;
}

}  // namespace bigus
