// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/VirtualPlanes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <type_traits>

#include "Core/Model/PixelMemory.h"
#include "Core/Model/SweepGeometry.h"

namespace bigus
{
namespace
{

/// Planes made between two questions whether to go on: less than a second of work for the largest frames.
constexpr std::size_t kPlanesAtOnce = 16;

/// Where planes are made: between places k and k + 1 of the frames.
struct Gap
{
  std::size_t k;
  FramesAround around;
};

/// Where the sweep breaks no plane is made, and what lies beyond a break says nothing.
std::vector<Gap> GapsOf(const Sweep& sweep, const std::vector<int>& frames)
{
  const std::vector<double> wide = GapsBetween(sweep, frames), longest = LongestGaps(sweep, frames);
  const auto isBreak = [&](std::size_t k) { return wide[k] > longest[k]; };
  std::vector<Gap> gaps;
  for (std::size_t k = 0; k + 1 < frames.size(); ++k)
  {
    if (isBreak(k))
    {
      continue;
    }
    FramesAround around = FramesAround::Gap(sweep, frames, k);
    if (around.before != FramesAround::kNone && isBreak(k - 1))
    {
      around.before = FramesAround::kNone;
    }
    if (around.after != FramesAround::kNone && isBreak(k + 1))
    {
      around.after = FramesAround::kNone;
    }
    gaps.push_back({k, around});
  }
  return gaps;
}

/// Makes the pixels of `out`: those of `frames`, then those of `perGap` planes in every gap.
struct PlaneMaker
{
  const Sweep& sweep;
  const std::vector<int>& frames;
  const std::vector<Gap>& gaps;
  int perGap;
  const FrameInterpolation& interpolation;
  Sweep& out;  // with all poses

  template <class Pixel>
  void FillGap(std::size_t gap, Pixel* values) const
  {
    const std::size_t pixels = sweep.PixelsPerFrame(), first = frames.size() + gap * perGap;
    std::vector<std::vector<float>> images(perGap, std::vector<float>(pixels));
    std::vector<float*> to;
    std::vector<PlaneInGap> between;
    for (int v = 0; v < perGap; ++v)
    {
      to.push_back(images[v].data());
      between.push_back({out.Plane(static_cast<int>(first) + v), (v + 1) / (perGap + 1.0)});
    }
    InterpolateFrames(sweep, gaps[gap].around, between, interpolation, to);
    for (int v = 0; v < perGap; ++v)
    {
      std::transform(images[v].begin(), images[v].end(), values + (first + v) * pixels,
                     [](float value)
                     { return static_cast<Pixel>(std::is_integral_v<Pixel> ? std::round(255.0f * value) : value); });
    }
  }

  /// False where goOn said no.
  template <class Pixel>
  bool Fill(const std::function<bool(double)>& goOn)
  {
    const std::size_t pixels = sweep.PixelsPerFrame();
    const auto* recorded = static_cast<const Pixel*>(sweep.pixels.get());
    const auto values = AllocatePixels<Pixel>(pixels * out.imageToReference.size());
    tbb::parallel_for(std::size_t(0), frames.size(),
                      [&](std::size_t k)
                      { std::copy_n(recorded + frames[k] * pixels, pixels, values.get() + k * pixels); });
    const std::size_t atOnce = std::max<std::size_t>(1, kPlanesAtOnce / std::max(perGap, 1));
    for (std::size_t first = 0; first < gaps.size(); first += atOnce)
    {
      if (goOn && !goOn(static_cast<double>(first) / static_cast<double>(gaps.size())))
      {
        return false;
      }
      tbb::parallel_for(first, std::min(first + atOnce, gaps.size()),
                        [&](std::size_t gap) { FillGap(gap, values.get()); });
    }
    out.pixels = values;
    return true;
  }
};

}  // namespace

std::shared_ptr<const Sweep> AddVirtualPlanes(const Sweep& sweep, const std::vector<int>& frames, int perGap,
                                              const FrameInterpolation& interpolation,
                                              const std::function<bool(double)>& goOn)
{
  auto out = std::make_shared<Sweep>();
  out->width = sweep.width;
  out->height = sweep.height;
  out->pixelType = sweep.pixelType;
  out->mask = sweep.mask;
  for (int frame : frames)
  {
    out->imageToReference.push_back(sweep.imageToReference[frame]);
    out->timestamps.push_back(static_cast<double>(out->timestamps.size()));
  }
  const std::vector<Gap> gaps = GapsOf(sweep, frames);
  for (const auto& [k, around] : gaps)
  {
    const SlicePlane from = sweep.Plane(around.first), to = sweep.Plane(around.second);
    for (int v = 1; v <= perGap; ++v)
    {
      const double share = v / (perGap + 1.0);
      out->imageToReference.push_back(PlaneBetween(from, to, share).ImageToReference());
      out->timestamps.push_back(static_cast<double>(k) + share);
    }
  }
  PlaneMaker maker{sweep, frames, gaps, perGap, interpolation, *out};
  const bool isDone =
      sweep.pixelType == Sweep::PixelType::UInt8 ? maker.Fill<std::uint8_t>(goOn) : maker.Fill<float>(goOn);
  return isDone ? out : nullptr;
}

}  // namespace bigus
