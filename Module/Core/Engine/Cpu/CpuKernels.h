// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CPU engine's inner loops, over blocks of Gaussians and over footprints, in float and in double. Compiled for each
// SIMD instruction set by Highway and chosen at run time. Private to Core.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "Core/Formula/GaussianBlock.h"
#include "Core/Formula/PixelLoss.h"
#include "Core/Formula/Splat.h"

namespace bigus
{

/// What bounds a block's effect: the box of its means, its largest ln s and |r|; and the largest ln of an aspect ratio.
template <class T>
struct BlockBounds
{
  T low[3], high[3];
  T logScale, magnitude, logAspect;
};

/// Whole numbers that lie in lanes beside T.
template <class T>
using Whole = std::conditional_t<sizeof(T) == 4, std::int32_t, std::int64_t>;

/// A footprint in an image, w(p) = exp(logAmplitude - |U (p - m)|^2 / 2), clipped to the pixels to be computed. Its
/// centre m = (column + mu, row + mv) is kept as a pixel and a fraction, |mu| <= 1/2 and -1 < mv <= 0: so float loses
/// nothing in a large image.
enum SplatReal
{
  kU11,
  kU12,
  kU22,
  kMu,
  kMv,
  kLogAmplitude,
  kCut,        // k^2: pixels with |U (p - m)|^2 <= k^2 are evaluated, others may be
  kRowFactor,  // exp(-(u12^2 + u22^2))
  kShift,      // of the recurrence that starts at the centre: see RecurrenceStart
  kConstant,
  kSlope,
  kSplatReals
};
enum SplatWhole
{
  kColumn,
  kRow,
  kColumnBegin,  // half-open, in pixels of the plane
  kColumnEnd,
  kRowBegin,
  kRowEnd,
  kReach,     // rows a recurrence may run from its start, kOneStretch where that is the whole footprint; 0: direct
  kGaussian,  // index in its block
  kSplatWholes
};
constexpr int kOneStretch = 1;

/// Footprints in memory: number `field` of splat i is reals[field * stride + i], or wholes[...]. Vectors are read beyond
/// `count`, so there is room for one behind the last.
template <class T>
struct SplatRows
{
  const T* reals;
  const Whole<T>* wholes;
  std::ptrdiff_t stride;
  int count;

  const T* operator[](SplatReal field) const { return reals + field * stride; }
  const Whole<T>* operator[](SplatWhole field) const { return wholes + field * stride; }
  T At(SplatReal field, int i) const { return (*this)[field][i]; }
  int At(SplatWhole field, int i) const { return static_cast<int>((*this)[field][i]); }
};

/// The splats of a block as they come out of vectors, with room for what vectors write beyond.
template <class T>
struct alignas(64) SplatBuffer
{
  static constexpr int kStride = kBlock + 16;
  T reals[kSplatReals][kStride];
  Whole<T> wholes[kSplatWholes][kStride];
  int rowBegin, rowEnd;  // of all of them

  SplatRows<T> Rows(int count) const { return {reals[0], wholes[0], kStride, count}; }
};

/// Rows in memory: pixel (column, row) of the plane is data[(row - firstRow) * stride + column - firstColumn]. Each row
/// is followed by kRowPadding numbers that kernels may read and write.
constexpr int kRowPadding = 16;  // as many as the longest vector
template <class T>
struct PixelRows
{
  T* data;
  int firstColumn, firstRow;
  std::size_t stride;

  /// Where column 0 of the plane would lie in that row.
  T* Row(int row) const { return data + static_cast<std::ptrdiff_t>(row - firstRow) * stride - firstColumn; }
};

/// What exponents of footprints are multiplied by: in float they are powers of 2, which are reduced by a subtraction.
template <class T>
constexpr T kExponentUnit = sizeof(T) == 4 ? T(1.44269504088896341) : T(1);

/// How a block is to be projected. The view's origin pixel lies within kLargestImage / 4 of pixel (0, 0), so that sums
/// of whole numbers stay exact. A footprint ends where magnitude * w < tolerance; tolerance 0 ends it where T would
/// underflow.
template <class T>
struct ProjectionTask
{
  View<T> view;  // relative to the block's centre, its origin at pixel (originColumn, originRow)
  std::int32_t originColumn, originRow;
  int columnBegin, columnEnd, rowBegin, rowEnd;  // pixels to be computed
  T slab;                                        // mm^2: no Gaussian of the block with mu_z^2 beyond matters
  T tolerance;
  T leastMagnitude;                       // every Gaussian's own |r|, but at least this
  bool direct;                            // no recurrences
  T lowestExponent = kLowestExponent<T>;  // of the type in which footprints are evaluated, which may be another
  T exponentUnit = kExponentUnit<T>;      // of that type
};

template <class T>
struct alignas(64) MomentBlock
{
  T values[kMomentRows][kBlock];
};

/// The kernels, compiled for one instruction set.
template <class T>
struct Kernels
{
  /// How many Gaussians of a block have mu_z^2 <= slab.
  int (*countInSlab)(const GaussianBlock<T>& block, int count, const View<T>& view, T slab);

  /// The Gaussians of a block that a view sees, in their order. Returns how many.
  int (*projectBlock)(const GaussianBlock<T>& block, int count, const ProjectionTask<T>& task, SplatBuffer<T>& out);

  /// image += value * w over rows [rowBegin, rowEnd); values[kBlock] by Gaussian, null for 1.
  void (*addFootprints)(const SplatRows<T>& splats, const T* values, int rowBegin, int rowEnd,
                        const PixelRows<T>& image);

  /// moments[m][i]: sums over splat i's footprint of derivative * w * powers of eta. The last, sum
  /// |derivative| w, only withError.
  void (*gatherMoments)(const SplatRows<T>& splats, const PixelRows<T>& derivative, bool withError,
                        MomentBlock<T>& moments);

  /// Chain rule: adds what the splats of one view give to the gradient of their Gaussians, and to the scores if not
  /// null.
  void (*addAdjoints)(const GaussianBlock<T>& block, const View<T>& view, const SplatRows<T>& splats,
                      const MomentBlock<T>& moments, GradientBlock<T>& gradient, ScoreBlock<T>* scores);

  /// One Adam step for the Gaussians with gradient.visits > 0. Returns how many of them were guarded.
  int (*updateBlock)(GaussianBlock<T>& block, AdamBlock<T>& state, const GradientBlock<T>& gradient, int count,
                     const AdamStep& step);

  BlockBounds<T> (*boundsOf)(const GaussianBlock<T>& block, int count);

  /// out[i] = 1 - exp(-gamma max(scattering[i], 0)); they may be the same. Arrays are read and written up to
  /// kRowPadding numbers beyond `count`.
  void (*toIntensity)(const T* scattering, std::size_t count, T gamma, T* out);

  /// Replaces scattering by dL/dS and returns the sum of L, see PixelLoss-inl.h; `others` may be null for 0. Arrays are
  /// read and written up to kRowPadding numbers beyond `count`; weights and others should be 0 there.
  double (*toDerivative)(T l1, T l2, T gamma, const T* truth, const T* weights, const T* others, std::size_t count,
                         T* scattering);
};

/// The best this machine has. Chosen at the call.
template <class T>
Kernels<T> KernelsOfThisMachine();
template <>
Kernels<float> KernelsOfThisMachine();
template <>
Kernels<double> KernelsOfThisMachine();

}  // namespace bigus
