// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A grid of planes rendered piece by piece, so that an abort is heard in time; thin planes or slabs.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Slicing/OutputGrid.h"

namespace bigus
{

/// How a field is shown.
struct ViewSettings
{
  std::string engine = "auto";
  double elevationSigma = -1;  ///< mm, of every plane; negative: the field's beam (Core/Model/Beam.h)
  double tolerance = 1e-4;     ///< on the intensity of a pixel; 0 leaves nothing out

  /// Throws Error unless the numbers are in range.
  void Validate() const;
};

/// A thick slice: several parallel planes, joined pixel by pixel into one. What vtkImageReslice calls a slab.
struct Slab
{
  enum Mode
  {
    Min,
    Max,
    Mean,
    Sum
  };
  int planes = 1;          ///< 1 is a single plane, as it is
  double spacing = 1;      ///< between the planes, in steps between two slices of the grid
  Mode mode = Mean;        ///< how pixels are joined; coverage is always the largest of the planes'
  bool trapezoid = false;  ///< the first and last plane count half in Mean and Sum

  /// Throws Error unless the spacing is finite.
  void Validate() const;
};

/// Some whole rows of one slice, or several whole slices.
struct PixelBand
{
  std::int64_t first, count;  ///< pixels, counted from the start of the extent asked for
  float* image;               ///< [count], may be changed
  const float* coverage;      ///< [count], or null when not asked for
  double fraction;            ///< of the whole work, after this band
};

/// Renders one window of one plane, or several whole planes of one size.
using RenderPlanes = std::function<void(const std::vector<SlicePlane>& planes, const Engine::Window& window,
                                        float* image, float* coverage)>;

/// The same on one engine.
RenderPlanes PlanesOn(Engine& engine, ViewOutput output);

class Bands
{
public:
  /// `followsClock`: bands become as large as about 30 ms allow, else they stay at 65536 pixels.
  explicit Bands(bool followsClock = true) : followsClock_(followsClock) {}

  /// Renders a part of a grid. Every slice k is a slab of its own, whose middle lies there. What a pixel gets does not
  /// depend on the part. `receive` takes the bands in order and returns false to stop; then Run returns false, too.
  /// Throws Error when a plane cannot be rendered.
  bool Run(const GridPart& grid, bool coverage, const Slab& slab, const RenderPlanes& render,
           const std::function<bool(const PixelBand&)>& receive);

private:
  class Pass;

  bool followsClock_;
  double pixelsPerBand_ = 65536;
  std::vector<float> image_, coverage_;            // of a band, kept because memory that is new is slow
  std::vector<float> planeImage_, planeCoverage_;  // of one plane of a slab
};

}  // namespace bigus
