// The CPU engine's two inner loops: footprints into an image, and an image back into moments. Compiled for
// each SIMD instruction set by Highway and chosen at run time. Private to Core.
#pragma once

#include <cstddef>
#include <cstdint>

#include "Splat.h"

namespace bigus
{

/// A splat that a view keeps, clipped to the pixels to be computed.
struct VisibleSplat
{
  Splat<float> splat;
  float value;  ///< what the footprint is multiplied with: the reflectivity
  float logAmplitude;
  float cut;  ///< k^2: only pixels with |U (p - m)|^2 <= k^2 are evaluated
  std::uint32_t gaussian;
  std::int32_t columnBegin, columnEnd, rowBegin, rowEnd;  ///< half-open, in pixels of the plane
  std::int32_t firstRow;  ///< where the footprint itself begins, before clipping
  float rowFactor;        ///< c, see above
  bool direct;
};

constexpr int kRecurrenceRows = 16;

/// Rows in memory: pixel (column, row) of the plane is data[(row - firstRow) * stride + column -
/// firstColumn]. Each row is followed by kRowPadding floats that kernels may read and write.
constexpr int kRowPadding = 64;
struct PixelRows
{
  float* data;
  int firstColumn, firstRow;
  std::size_t stride;

  /// Where column 0 of the plane would lie in that row.
  float* Row(int row) const { return data + (row - firstRow) * stride - firstColumn; }
};

/// scattering += value * w and, if coverage.data is not null, coverage += w over rows [rowBegin, rowEnd).
void AddFootprints(const VisibleSplat* splats, std::size_t count, int rowBegin, int rowEnd,
                   const PixelRows& scattering, const PixelRows& coverage);

/// moments[i] = sums over splat i's footprint of derivative * w * powers of eta.
void GatherMoments(const VisibleSplat* splats, std::size_t count, const PixelRows& derivative,
                   Moments<float>* moments);

/// Name of the instruction set in use, for reports.
const char* SimdName();

}  // namespace bigus
