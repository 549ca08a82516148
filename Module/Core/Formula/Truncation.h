// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What may be left out of an image: how much each Gaussian may drop, and the grid on which overlaps are counted. For
// host and device. Private to Core and Cuda.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "Core/Formula/BlockReach.h"
#include "Core/Formula/Scalars.h"

namespace bigus
{

/// What footprints are found for, which says how they are cut.
enum class FootprintsFor
{
  Rendering,  ///< each ends where its own |r| w falls below its share
  Training    ///< the same, but |r| counts as at least Truncation::leastMagnitude
};

/// How much may be dropped, on S. Unless the tolerance is on each splat, all that is dropped at any pixel adds up to at
/// most the tolerance. With N Gaussians, floor = tolerance / (2 N): contributions below it add up to at most half the
/// tolerance. The other half goes to the Gaussians that can contribute more than the floor to a pixel. They are counted,
/// with their block's whole reach, on tiles (OverlapGrid). Each drops at most tolerance / (2 n) where at most n overlap.
struct Truncation
{
  double tolerance;
  bool isShared;              // the tolerance bounds the sum, not each splat
  double floor;               // least contribution that is counted; the tolerance where it is not shared
  double leastMagnitude;      // |r| counts as at least this
  double logLeast, logFloor;  // logarithms of them

  /// In training a Gaussian is cut as if |r| were at least 7.4 times the tolerance, so that two standard deviations of
  /// it (e^2 = 7.4) are always seen. Else one whose r comes to lie within the tolerance of 0, as some do in every step,
  /// would be left out from then on, and with it the gradient that could bring it back.
  static double LeastMagnitude(double tolerance) { return max(7.4 * tolerance, 1e-30); }

  static Truncation For(FootprintsFor purpose, double tolerance, bool perSplat, std::size_t gaussians)
  {
    Truncation out{};
    out.tolerance = tolerance;
    out.isShared = !perSplat && tolerance > 0 && gaussians > 0;
    out.floor = out.isShared ? tolerance / (2.0 * static_cast<double>(gaussians)) : tolerance;
    out.leastMagnitude = purpose == FootprintsFor::Rendering ? 0.0 : LeastMagnitude(tolerance);
    out.logLeast = std::log(out.leastMagnitude);
    out.logFloor = std::log(out.floor);
    return out;
  }

  /// What a Gaussian may drop where at most `most` overlap.
  BIGUS_FORMULA double Share(std::uint32_t most) const { return isShared ? 0.5 * tolerance / most : tolerance; }

  /// ln of the largest magnitude that a Gaussian of a block stands for.
  BIGUS_FORMULA double LogMagnitude(const BlockPlace& place) const { return max(place.logMagnitude, logLeast); }
};

/// Square tiles of an image on which Gaussians are counted.
struct OverlapGrid
{
  static constexpr int kFinest = 32;  // pixels along a tile's side: footprints are about as large
  static constexpr int kMost = 128;   // tiles along a side of the image: the counts stay in the cache

  int side, columns, rows;

  static OverlapGrid For(int width, int height)
  {
    const int side = max(kFinest, max((width + kMost - 1) / kMost, (height + kMost - 1) / kMost));
    return {side, (width + side - 1) / side, (height + side - 1) / side};
  }

  /// The tiles that a box of pixels touches, as a box of tiles.
  BIGUS_FORMULA PixelBox TilesOf(const PixelBox& box) const
  {
    const std::int64_t up = side - 1;
    return {TileAt(box.columnBegin, columns), TileAt(box.columnEnd + up, columns), TileAt(box.rowBegin, rows),
            TileAt(box.rowEnd + up, rows)};
  }
  BIGUS_FORMULA std::int64_t TileAt(std::int64_t pixel, std::int64_t tiles) const
  {
    return min(max(pixel, std::int64_t(0)) / side, tiles);
  }
};

}  // namespace bigus
