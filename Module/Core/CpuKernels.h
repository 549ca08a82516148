// The CPU engine's inner loops, over blocks of Gaussians and over footprints, in float and in double. Compiled for
// each SIMD instruction set by Highway and chosen at run time. Private to Core.
#pragma once

#include <cstddef>
#include <cstdint>

#include "Loss.h"
#include "Optimizer.h"
#include "Splat.h"

namespace bigus
{

/// Gaussians that are neighbours in space, projected and updated together: structure of arrays, in lanes. Enough for
/// any SIMD width, few enough that a plane does not touch many in vain.
constexpr int kBlock = 128;

/// Positions are relative to the block's own centre, so float keeps them exact to a ten-millionth of the block.
template <class T>
struct alignas(64) GaussianBlock
{
  T mean[3][kBlock];      // mm
  T logScale[3][kBlock];  // ln mm
  T rotation[4][kBlock];  // unit quaternion w, x, y, z
  T reflectivity[kBlock];
};

template <class T>
struct alignas(64) AdamBlock
{
  T first[kParametersPerGaussian][kBlock], second[kParametersPerGaussian][kBlock];
  T updates[kBlock];
};

/// A gradient as AdamState orders it: mean, log-scale, rotation, reflectivity; and how many frames contributed.
template <class T>
struct alignas(64) GradientBlock
{
  T values[kParametersPerGaussian][kBlock];
  T visits[kBlock];
};

/// Sums of Engine::Scores.
template <class T>
struct alignas(64) ScoreBlock
{
  T error[kBlock], descent[3][kBlock], visits[kBlock];
};

/// What bounds a block's effect: the box of its means, its largest scale (mm) and reflectivity.
template <class T>
struct BlockBounds
{
  T low[3], high[3];
  T logScale, magnitude;
};

/// A footprint in an image, w(p) = exp(logAmplitude - |U (p - m)|^2 / 2), clipped to the pixels to be computed. Its
/// centre m = (column + mu, row + mv) is kept as a pixel and a fraction, |mu| <= 1/2 and -1 < mv <= 0: so float loses
/// nothing in a large image.
template <class T>
struct VisibleSplat
{
  T u11, u12, u22;
  T mu, mv;
  T logAmplitude;
  T value;      // what the footprint is multiplied with: the reflectivity
  T cut;        // k^2: pixels with |U (p - m)|^2 <= k^2 are evaluated, others may be
  T rowFactor;  // exp(-(u12^2 + u22^2)); see Recurrence in CpuKernels.cxx
  std::int32_t column, row;
  std::int32_t columnBegin, columnEnd, rowBegin, rowEnd;  // half-open, in pixels of the plane
  std::uint16_t gaussian;                                 // index in its block
  std::uint16_t reach;                                    // rows a recurrence may run from its start; 0: direct
};

/// Rows in memory: pixel (column, row) of the plane is data[(row - firstRow) * stride + column - firstColumn]. Each row
/// is followed by kRowPadding numbers that kernels may read and write.
constexpr int kRowPadding = 64;
template <class T>
struct PixelRows
{
  T* data;
  int firstColumn, firstRow;
  std::size_t stride;

  /// Where column 0 of the plane would lie in that row.
  T* Row(int row) const { return data + static_cast<std::ptrdiff_t>(row - firstRow) * stride - firstColumn; }
};

/// exp of it is a little above T's smallest normal number: footprints keep clear of denormals.
template <class T>
constexpr T kLowestExponent = sizeof(T) == 4 ? T(-85) : T(-700);

/// How a block is to be projected. A footprint ends where magnitude * w < tolerance; tolerance 0 ends it where T would
/// underflow.
template <class T>
struct ProjectionTask
{
  View<T> view;                     // origin relative to the block's centre, at pixel (firstColumn, firstRow)
  std::int32_t originColumn, originRow;
  int columnBegin, columnEnd, rowBegin, rowEnd;  // pixels to be computed
  T tolerance;
  T commonMagnitude;  // 0: every Gaussian's own |r|
  const T* values;    // [kBlock] what footprints are multiplied with; null: the reflectivities
  bool direct;        // no recurrences
  T lowestExponent = kLowestExponent<T>;  // of the type in which footprints are evaluated
};

template <class T>
struct alignas(64) MomentBlock
{
  T values[7][kBlock];  // in the order of Moments
};

/// The kernels, compiled for one instruction set.
template <class T>
struct Kernels
{
  /// How many Gaussians of a block come near enough to a plane to reach `tolerance` there: at least those that
  /// projectBlock would keep.
  int (*countInSlab)(const GaussianBlock<T>& block, int count, const View<T>& view, T tolerance);

  /// The Gaussians of a block that a view sees, in their order; `out` holds kBlock. Returns how many.
  int (*projectBlock)(const GaussianBlock<T>& block, int count, const ProjectionTask<T>& task, VisibleSplat<T>* out);

  /// image += value * w (or += w, for coverage) over rows [rowBegin, rowEnd).
  void (*addFootprints)(const VisibleSplat<T>* splats, std::size_t count, int rowBegin, int rowEnd,
                        const PixelRows<T>& image, bool coverage);

  /// moments[m][i]: sums over splat i's footprint of derivative * w * powers of eta. The last, sum |derivative| w, only
  /// withError.
  void (*gatherMoments)(const VisibleSplat<T>* splats, int count, const PixelRows<T>& derivative, bool withError,
                        MomentBlock<T>& moments);

  /// Chain rule: adds what `count` splats of one view give to the gradient of their Gaussians, and to the scores if not
  /// null.
  void (*addAdjoints)(const GaussianBlock<T>& block, const View<T>& view, const VisibleSplat<T>* splats, int count,
                      const MomentBlock<T>& moments, GradientBlock<T>& gradient, ScoreBlock<T>* scores);

  /// One Adam step for the Gaussians with gradient.visits > 0. Returns how many of them were guarded.
  int (*updateBlock)(GaussianBlock<T>& block, AdamBlock<T>& state, const GradientBlock<T>& gradient, int count,
                     const AdamStep& step);

  BlockBounds<T> (*boundsOf)(const GaussianBlock<T>& block, int count);

  /// out[i] = 1 - exp(-gamma max(scattering[i], 0)). Both may be read up to kRowPadding numbers beyond `count`.
  void (*toIntensity)(const T* scattering, std::size_t count, T gamma, float* out);

  /// Replaces scattering by weights * dL/dS and returns the sum of weights * L. Arrays are read and written up to
  /// kRowPadding numbers beyond `count`; weights should be 0 there.
  double (*toDerivative)(LossKind kind, T gamma, const T* truth, const T* weights, std::size_t count, T* scattering);

  const char* instructionSet;  // name, for reports
};

/// The best this machine has. Chosen at the call.
template <class T>
Kernels<T> KernelsOfThisMachine();
template <>
Kernels<float> KernelsOfThisMachine();
template <>
Kernels<double> KernelsOfThisMachine();

}  // namespace bigus
