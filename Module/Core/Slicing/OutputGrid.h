// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where the pixels of a slice and the voxels of a volume lie, by the names and rules of vtkImageReslice.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <functional>
#include <optional>

#include "Core/Engine/Exchange.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"

namespace bigus
{

/// The first and the last index along each of three axes; the last is included.
using Extent = std::array<int, 6>;

/// Index (i, j, k) lies at origin + spacing (i, j, k), mm along the grid's own axes.
struct OutputGrid
{
  Eigen::Vector3d spacing = Eigen::Vector3d::Ones();
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Extent extent{};
};

/// What a caller sets of a grid. The rest is derived from another grid, which is asked for only then.
struct GivenGrid
{
  std::optional<Eigen::Vector3d> spacing, origin;
  std::optional<Extent> extent;  ///< of voxels it begins at 0

  bool IsWhole() const { return spacing && origin && extent; }
};
using InputGrid = std::function<OutputGrid()>;

/// Throws Error unless what is given of spacing and origin (mm) can be worked with.
void CheckGiven(const GivenGrid& given);

/// Number of indices in an extent, as a double because that cannot overflow.
double ExtentSize(const Extent& extent);

/// Throws Error when the extent asked for has more indices than `maximum`.
void CheckOutputSize(const Extent& extent, long long maximum);

/// The box along the columns of `axes` (unit vectors) that holds every Gaussian to three standard deviations, mm, but for one
/// in 1000 that reach farthest on each side: training leaves a few that are large or astray. That of the empty field is
/// empty. With an `exchange`, of a field whose parts its processes have; all of them get the same box.
Eigen::AlignedBox3d BoundsAlong(const GaussianField& field, const Eigen::Matrix3d& axes,
                                Exchange& exchange = Exchange::Alone());

/// The grid of cubic voxels in a box, with `maximumDimension` of them along its longest side. An empty box gets one at 0.
OutputGrid GridOver(const Eigen::AlignedBox3d& bounds, int maximumDimension);

constexpr int kDefaultDimension = 256;  // pixels along the longest side of a field, where no geometry is given

/// How a slice's grid lies in the input's coordinates.
struct ResliceSettings
{
  Eigen::Matrix4d axes = Eigen::Matrix4d::Identity();
  std::optional<Eigen::Matrix4d> transform = std::nullopt;  ///< after the axes
  bool turnsInput = true;  ///< the input's grid is turned to the axes before it gives defaults
  bool crops = false;      ///< a default size and place is that of the input after axes and transform
  int dimensionality = 3;  ///< axes above have one index, at 0
};

/// The grid of a reslice. Throws Error.
OutputGrid ResliceGrid(const GivenGrid& given, const ResliceSettings& settings, const InputGrid& input);

/// From a grid's place along its axes, mm, to the field's frame. Throws Error unless that is affine.
Eigen::Matrix4d OutputToWorld(const Eigen::Matrix4d& axes, const std::optional<Eigen::Matrix4d>& transform);

/// From a grid's index to the field's frame, mm.
Eigen::Matrix4d IndexToWorld(const Eigen::Matrix4d& outputToWorld, const Eigen::Vector3d& spacing,
                             const Eigen::Vector3d& origin);

/// The grid of a volume whose axes are the columns of `direction`; its origin is in the field's frame. `field`: the grid
/// over the field along these axes. Throws Error.
OutputGrid VoxelGrid(const GivenGrid& given, const Eigen::Matrix3d& direction, const InputGrid& field);

/// Part of a grid in space.
struct GridPart
{
  Eigen::Matrix4d indexToWorld;  ///< (i, j, k, 1) to mm, affine
  Extent whole, extent;          ///< the second lies in the first

  /// The plane of the whole grid at index k, which may lie between two slices. It begins at the whole's first pixel, so
  /// that any part of a grid has the same bits.
  SlicePlane PlaneAt(double k) const;
};

}  // namespace bigus
