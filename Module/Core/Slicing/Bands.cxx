// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Slicing/Bands.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

constexpr double kBandSeconds = 0.03;
constexpr double kMostBandPixels = 4.0e6;

// How much plane i of a slab counts.
float PlaneWeight(const Slab& slab, int i)
{
  if (slab.planes == 1 || slab.mode == Slab::Min || slab.mode == Slab::Max)
  {
    return 1;
  }
  const float share = slab.mode == Slab::Sum ? 1.0f : 1.0f / static_cast<float>(slab.planes - slab.trapezoid);
  return slab.trapezoid && (i == 0 || i == slab.planes - 1) ? 0.5f * share : share;
}

// Adds plane i, count pixels, to what the slab's earlier planes gave.
void JoinPlane(const Slab& slab, int i, const float* plane, float* joined, std::size_t count)
{
  const float weight = PlaneWeight(slab, i);
  for (std::size_t pixel = 0; pixel < count; ++pixel)
  {
    const float value = weight * plane[pixel];
    joined[pixel] = i == 0                   ? value
                    : slab.mode == Slab::Min ? std::min(joined[pixel], value)
                    : slab.mode == Slab::Max ? std::max(joined[pixel], value)
                                             : joined[pixel] + value;
  }
}

}  // namespace

void ViewSettings::Validate() const
{
  Require(tolerance >= 0 && tolerance <= 1, "The tolerance is ", tolerance, "; it must lie between 0 and 1.");
  Require(elevationSigma <= GaussianField::kLargestScale && std::isfinite(elevationSigma), "The elevation sigma is ",
          elevationSigma, "; give mm up to 1e12, 0 for a thin plane, or a negative number for the field's.");
}

void Slab::Validate() const
{
  Require(std::isfinite(spacing),
          "SlabSliceSpacingFraction is not finite; 1 puts a slab's planes one OutputSpacing apart.");
}

RenderPlanes PlanesOn(Engine& engine, ViewOutput output)
{
  return [&engine, output](const std::vector<SlicePlane>& planes, const Engine::Window& window, float* image,
                           float* coverage)
  {
    if (planes.size() > 1)
    {
      engine.RenderStack(planes, output, image, coverage);
    }
    else
    {
      engine.Render(planes[0], window, output, image, coverage);
    }
  };
}

// One call of Run.
class Bands::Pass
{
public:
  Pass(Bands& bands, const GridPart& grid, bool coverage, const Slab& slab, const RenderPlanes& render,
       const std::function<bool(const PixelBand&)>& receive)
      : bands_(bands), grid_(grid), isCovered_(coverage), slab_(slab), render_(render), receive_(receive)
  {
  }

  bool Run()
  {
    for (int k = grid_.extent[4]; k <= grid_.extent[5];)
    {
      // Whole planes together, if there is time for several; else a plane in bands of rows.
      const int planes = PlanesTogether(k);
      if (!(planes > 1 ? Deliver(k, planes, {0, 0, columns_, rows_}) : DeliverRows(k)))
      {
        return false;
      }
      k += std::max(1, planes);
    }
    return true;
  }

private:
  int PlanesTogether(int k) const
  {
    const Extent& whole = grid_.whole;
    const bool isWhole = std::equal(whole.begin(), whole.begin() + 4, grid_.extent.begin());
    const double planePixels = static_cast<double>(columns_) * rows_;
    return isWhole ? std::min(static_cast<int>(bands_.pixelsPerBand_ / planePixels), grid_.extent[5] - k + 1) : 1;
  }

  bool DeliverRows(int k)
  {
    for (int row = grid_.extent[2]; row <= grid_.extent[3];)
    {
      const int wanted = static_cast<int>(std::min(1e9, bands_.pixelsPerBand_ / columns_));
      const int rows = std::clamp(wanted, 1, grid_.extent[3] - row + 1);
      if (!Deliver(k, 1, {grid_.extent[0] - grid_.whole[0], row - grid_.whole[2], columns_, rows}))
      {
        return false;
      }
      row += rows;
    }
    return true;
  }

  // A window of the planes from k on, rendered and passed on.
  bool Deliver(int k, int planes, const Engine::Window& window)
  {
    const std::size_t count = static_cast<std::size_t>(planes) * window.columns * window.rows;
    bands_.image_.resize(count);
    bands_.coverage_.resize(isCovered_ ? count : 0);
    float* covered = isCovered_ ? bands_.coverage_.data() : nullptr;
    const auto before = std::chrono::steady_clock::now();
    if (slab_.planes == 1)
    {
      RenderAt(k, 0, planes, window, bands_.image_.data(), covered);
    }
    else
    {
      RenderSlab(k, planes, window, count);
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count();
    // Aim at kBandSeconds from what this band took; a plane that is nearly free says little about the next.
    if (bands_.followsClock_)
    {
      bands_.pixelsPerBand_ =
          std::clamp(count * std::clamp(kBandSeconds / std::max(seconds, 1e-6), 0.1, 8.0), 1.0, kMostBandPixels);
    }
    const auto pixels = static_cast<std::int64_t>(count);
    const double fraction = (static_cast<double>(first_) + pixels) / total_;
    const PixelBand band{first_, pixels, bands_.image_.data(), covered, fraction};
    first_ += pixels;
    return receive_(band);
  }

  void RenderSlab(int k, int planes, const Engine::Window& window, std::size_t count)
  {
    bands_.planeImage_.resize(count);
    bands_.planeCoverage_.resize(bands_.coverage_.size());
    for (int i = 0; i < slab_.planes; ++i)
    {
      const double offset = (i - 0.5 * (slab_.planes - 1)) * slab_.spacing;
      RenderAt(k, offset, planes, window, bands_.planeImage_.data(),
               isCovered_ ? bands_.planeCoverage_.data() : nullptr);
      JoinPlane(slab_, i, bands_.planeImage_.data(), bands_.image_.data(), count);
      for (std::size_t pixel = 0; pixel < bands_.coverage_.size(); ++pixel)
      {
        bands_.coverage_[pixel] =
            i == 0 ? bands_.planeCoverage_[pixel] : std::max(bands_.coverage_[pixel], bands_.planeCoverage_[pixel]);
      }
    }
  }

  // `offset`: in steps from the slices' middle.
  void RenderAt(int k, double offset, int planes, const Engine::Window& window, float* image, float* coverage)
  {
    std::vector<SlicePlane> stack;
    for (int i = 0; i < planes; ++i)
    {
      stack.push_back(grid_.PlaneAt(k + i + offset));
      stack.back().Validate("Output slice " + std::to_string(std::lround(k + i + offset)));
    }
    render_(stack, window, image, coverage);
  }

  Bands& bands_;
  const GridPart& grid_;
  const bool isCovered_;
  const Slab& slab_;
  const RenderPlanes& render_;
  const std::function<bool(const PixelBand&)>& receive_;
  const int columns_ = grid_.extent[1] - grid_.extent[0] + 1, rows_ = grid_.extent[3] - grid_.extent[2] + 1;
  const double total_ = ExtentSize(grid_.extent);
  std::int64_t first_ = 0;
};

bool Bands::Run(const GridPart& grid, bool coverage, const Slab& slab, const RenderPlanes& render,
                const std::function<bool(const PixelBand&)>& receive)
{
  return Pass(*this, grid, coverage, slab, render, receive).Run();
}

}  // namespace bigus
