// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussians in blocks, as the fast engines hold them: neighbours in space, projected and updated together. Private to
// Core and Cuda.
#pragma once

#include "Core/Formula/Adam.h"

namespace bigus
{

/// Gaussians of a block. Enough for any SIMD width, few enough that a plane does not touch many in vain.
constexpr int kBlock = 128;

/// Positions are relative to the block's own centre, so float keeps them exact to a ten-millionth of the block.
/// Structure of arrays, in lanes.
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

/// Sums over a footprint's pixels, in the order of Moments: rows of a MomentBlock.
enum MomentRow
{
  kMoment0,
  kMoment1,
  kMoment2,
  kMoment11,
  kMoment12,
  kMoment22,
  kMomentError,
  kMomentRows
};

/// A gradient in the order of Parameter, and how many frames contributed.
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

/// No image has more rows or columns than this: float must count them.
constexpr int kLargestImage = 1 << 24;

/// Aspect ratio from which float parameters lose too much, 1e-7 of the ratio: such a needle is projected in double.
constexpr double kSharp = 128;
constexpr double kLogSharp = 4.852030263919617;  // ln kSharp

/// mm; beyond, squares leave float's range.
constexpr double kSmallestScale = 1e-9, kLargestScale = 1e7;

/// exp of it is a little above T's smallest normal number: footprints keep clear of denormals.
template <class T>
constexpr T kLowestExponent = sizeof(T) == 4 ? T(-85) : T(-700);

/// k^2 where nothing is to be left out: what lies beyond underflows.
template <class T>
constexpr T kWholeCut = sizeof(T) == 4 ? T(180) : T(1480);

/// Pixels: a footprint whose centre lies further away than it can be counted from has no pixel.
constexpr double kFarthestPixel = 1e9;

/// A recurrence along a column serves only where the column's curvature is at most this times -kLowestExponent: see
/// RatiosHold in Footprint-inl.h.
constexpr double kSteepestRecurrence = 0.32;

}  // namespace bigus
