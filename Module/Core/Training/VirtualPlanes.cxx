// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/VirtualPlanes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <type_traits>

#include "Core/Model/PixelMemory.h"
#include "Core/Model/Sequences.h"
#include "Core/Training/GeometryDefaults.h"

namespace bigus
{
namespace
{

/// Planes made between two questions whether to go on: less than a second of work for the largest frames.
constexpr std::size_t kPlanesAtOnce = 16;

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
  std::vector<FramesAround> gaps;
  const double widest = kBreak * MeasureGeometry(sweep, frames).medianSpacing;
  const auto isBreak = [&](int before, int after)
  {
    const SlicePlane from = sweep.Plane(before), to = sweep.Plane(after);
    const Eigen::Vector3d step = to.Point(0.5 * (to.width - 1), 0.5 * (to.height - 1)) -
                                 from.Point(0.5 * (from.width - 1), 0.5 * (from.height - 1));
    return std::abs(step.dot(from.Normal())) > widest;
  };
  for (std::size_t k = 0; k + 1 < frames.size(); ++k)
  {
    const SlicePlane from = sweep.Plane(frames[k]), to = sweep.Plane(frames[k + 1]);
    if (!NeighbourhoodOf(sweep, frames, k).after || isBreak(frames[k], frames[k + 1]))
    {
      continue;
    }
    FramesAround around = FramesAround::Gap(sweep, frames, k);
    if (around.before != FramesAround::kNone && isBreak(around.before, around.first))
    {
      around.before = FramesAround::kNone;
    }
    if (around.after != FramesAround::kNone && isBreak(around.second, around.after))
    {
      around.after = FramesAround::kNone;
    }
    gaps.push_back(around);
    for (int v = 1; v <= perGap; ++v)
    {
      const double share = v / (perGap + 1.0);
      out->imageToReference.push_back(PlaneBetween(from, to, share).ImageToReference());
      out->timestamps.push_back(static_cast<double>(k) + share);
    }
  }
  const std::size_t pixels = sweep.PixelsPerFrame(), planes = out->imageToReference.size();
  const auto fill = [&](auto zero)
  {
    using Pixel = decltype(zero);
    const auto* recorded = static_cast<const Pixel*>(sweep.pixels.get());
    const auto values = AllocatePixels<Pixel>(pixels * planes);
    tbb::parallel_for(std::size_t(0), frames.size(),
                      [&](std::size_t k)
                      { std::copy_n(recorded + frames[k] * pixels, pixels, values.get() + k * pixels); });
    const auto fillGap = [&](std::size_t gap)
    {
      std::vector<std::vector<float>> images(perGap, std::vector<float>(pixels));
      std::vector<float*> to;
      std::vector<PlaneInGap> between;
      const std::size_t first = frames.size() + gap * perGap;
      for (int v = 0; v < perGap; ++v)
      {
        to.push_back(images[v].data());
        between.push_back({out->Plane(static_cast<int>(first) + v), (v + 1) / (perGap + 1.0)});
      }
      InterpolateFrames(sweep, gaps[gap], between, interpolation, to);
      for (int v = 0; v < perGap; ++v)
      {
        std::transform(images[v].begin(), images[v].end(), values.get() + (first + v) * pixels,
                       [](float value)
                       { return static_cast<Pixel>(std::is_integral_v<Pixel> ? std::round(255.0f * value) : value); });
      }
    };
    const std::size_t atOnce = std::max<std::size_t>(1, kPlanesAtOnce / std::max(perGap, 1));
    for (std::size_t first = 0; first < gaps.size(); first += atOnce)
    {
      if (goOn && !goOn(static_cast<double>(first) / static_cast<double>(gaps.size())))
      {
        return false;
      }
      tbb::parallel_for(first, std::min(first + atOnce, gaps.size()), fillGap);
    }
    out->pixels = values;
    return true;
  };
  const bool isDone = sweep.pixelType == Sweep::PixelType::UInt8 ? fill(std::uint8_t(0)) : fill(0.0f);
  return isDone ? out : nullptr;
}

}  // namespace bigus
