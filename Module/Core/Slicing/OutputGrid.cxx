// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Slicing/OutputGrid.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

constexpr double kMinimumSpacing = 1e-6, kMaximumSpacing = 1e6;  // mm
constexpr double kOneAstrayIn = 1000;                            // Gaussians, on each side of the bounds
constexpr double kLargestIndex = 1e9;                            // fits an int; so large an output is refused later
constexpr double kAffine = 1e-12;     // by which a matrix's last row may differ from 0 0 0 1, as a share of its last
constexpr double kUnitLength = 1e-6;  // by which a unit vector's length may differ from 1
constexpr double kFlat = 1e-3;        // determinant below which the axes lie nearly in one plane

// Halves go away from 0, as in vtkImageReslice.
int Rounded(double value)
{
  return static_cast<int>(value + (value >= 0 ? 0.5 : -0.5));
}

// Indices from the first to the last along an axis.
double Steps(const Extent& extent, int axis)
{
  return static_cast<double>(extent[2 * axis + 1]) - extent[2 * axis];
}

// The middle between the first and the last index along an axis, times two.
double TwiceMiddle(const Extent& extent, int axis)
{
  return static_cast<double>(extent[2 * axis]) + extent[2 * axis + 1];
}

Eigen::Vector3d CentreOf(const OutputGrid& grid)
{
  Eigen::Vector3d centre;
  for (int j = 0; j < 3; ++j)
  {
    centre[j] = grid.origin[j] + 0.5 * TwiceMiddle(grid.extent, j) * grid.spacing[j];
  }
  return centre;
}

// The box around a grid's corners after a transform.
Eigen::AlignedBox3d BoundsFrom(const OutputGrid& grid, const Eigen::Matrix4d& transform)
{
  Eigen::AlignedBox3d box;
  for (int corner = 0; corner < 8; ++corner)
  {
    Eigen::Vector3d point;
    for (int j = 0; j < 3; ++j)
    {
      point[j] = grid.origin[j] + grid.extent[2 * j + (corner >> j & 1)] * grid.spacing[j];
    }
    box.extend((transform * point.homogeneous()).hnormalized());
  }
  return box;
}

// The grid is turned to the output's axes as vtkImageReslice does: spacing and size are averaged with the squares of the
// direction cosines as weights, and the centre is kept. Weights of the identity leave it as it stands.
OutputGrid DerivedGrid(const GivenGrid& given, const ResliceSettings& settings, const OutputGrid& in)
{
  const Eigen::Matrix4d turn = settings.turnsInput ? settings.axes : Eigen::Matrix4d::Identity();
  const Eigen::Vector4d centre = turn.inverse() * CentreOf(in).homogeneous();
  Require(centre.allFinite() && settings.axes.inverse().allFinite(),
          "ResliceAxes cannot be inverted, so there is no default output geometry; set "
          "OutputSpacing, OutputOrigin and OutputExtent, or mend the axes.");
  const Eigen::AlignedBox3d crop = settings.crops
                                       ? BoundsFrom(in, OutputToWorld(settings.axes, settings.transform).inverse())
                                       : Eigen::AlignedBox3d();
  OutputGrid grid;
  for (int i = 0; i < 3; ++i)
  {
    const Eigen::Array3d weight = turn.block<3, 1>(0, i).array().square();
    const double sum = weight.sum();
    double length = 0, first = 0;
    for (int j = 0; j < 3; ++j)
    {
      length += weight[j] * Steps(in.extent, j) * std::abs(in.spacing[j]);
      first += weight[j] * in.extent[2 * j];
    }
    length = settings.crops ? crop.sizes()[i] : length / (sum * std::sqrt(sum));
    grid.spacing[i] = given.spacing ? (*given.spacing)[i] : (weight * in.spacing.array().abs()).sum() / sum;
    int& begin = grid.extent[2 * i];
    int& end = grid.extent[2 * i + 1];
    begin = given.extent ? (*given.extent)[2 * i] : Rounded(std::clamp(first / sum, -kLargestIndex, kLargestIndex));
    end = given.extent ? (*given.extent)[2 * i + 1]
                       : Rounded(begin + std::min(std::abs(length / grid.spacing[i]), kLargestIndex));
    grid.origin[i] = given.origin     ? (*given.origin)[i]
                     : settings.crops ? crop.min()[i] - begin * grid.spacing[i]
                                      : centre[i] - 0.5 * TwiceMiddle(grid.extent, i) * grid.spacing[i];
  }
  return grid;
}

}  // namespace

void CheckGiven(const GivenGrid& given)
{
  for (int axis = 0; axis < 3; ++axis)
  {
    const double spacing = given.spacing ? (*given.spacing)[axis] : 1, size = std::abs(spacing);
    Require(size >= kMinimumSpacing && size <= kMaximumSpacing, "OutputSpacing along axis ", axis, " is ", spacing,
            " mm; it must lie between 1e-6 and 1e6 mm.");
    Require(!given.origin || std::isfinite((*given.origin)[axis]), "OutputOrigin along axis ", axis, " is not finite.");
  }
}

double ExtentSize(const Extent& extent)
{
  double size = 1;
  for (int axis = 0; axis < 3; ++axis)
  {
    size *= std::max(0.0, Steps(extent, axis) + 1);
  }
  return size;
}

void CheckOutputSize(const Extent& extent, long long maximum)
{
  if (ExtentSize(extent) > static_cast<double>(maximum))
  {
    throw Error("The output asked for is " + std::to_string(extent[1] - extent[0] + 1) + " x " +
                std::to_string(extent[3] - extent[2] + 1) + " x " + std::to_string(extent[5] - extent[4] + 1) +
                " pixels, more than MaximumOutputPixels (" + std::to_string(maximum) +
                "). Make it smaller or its spacing larger, or stream it in pieces.");
  }
}

Eigen::AlignedBox3d BoundsAlong(const GaussianField& field, const Eigen::Matrix3d& axes, Exchange& exchange)
{
  // Where Gaussians begin along each axis and, with the other sign, where they end: outermost are the smallest.
  std::array<std::vector<double>, 6> ends;
  const Eigen::Matrix3d toGrid = axes.inverse();
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    const Eigen::Vector3d centre = toGrid * field.means[i];
    // Row norms of R diag(s) are the standard deviations along the axes.
    const Eigen::Matrix3d spread = toGrid * RotationMatrix(field.rotations[i]) * field.scales[i].asDiagonal();
    const Eigen::Vector3d reach = 3 * spread.rowwise().norm();
    for (int axis = 0; axis < 3; ++axis)
    {
      ends[axis].push_back(centre[axis] - reach[axis]);
      ends[3 + axis].push_back(-(centre[axis] + reach[axis]));
    }
  }
  double count = static_cast<double>(field.Size());
  exchange.Sum(&count, 1);
  if (!(count > 0))
  {
    return {};
  }
  const auto out = static_cast<std::size_t>(count / kOneAstrayIn);
  Eigen::Matrix<double, 6, 1> bounds;
  for (int side = 0; side < 6; ++side)
  {
    // The outermost of all are among each part's outermost.
    std::vector<double>& here = ends[side];
    std::partial_sort(here.begin(), here.begin() + static_cast<std::ptrdiff_t>(std::min(out + 1, here.size())),
                      here.end());
    here.resize(std::min(out + 1, here.size()));
    std::vector<double> all;
    for (const std::string& bytes :
         exchange.Gather({reinterpret_cast<const char*>(here.data()), here.size() * sizeof(double)}))
    {
      const std::size_t before = all.size();
      all.resize(before + bytes.size() / sizeof(double));
      std::memcpy(all.data() + before, bytes.data(), bytes.size());
    }
    std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(out), all.end());
    bounds[side] = all[out];
  }
  return {bounds.head<3>(), -bounds.tail<3>()};
}

OutputGrid GridOver(const Eigen::AlignedBox3d& bounds, int maximumDimension)
{
  OutputGrid grid;
  if (bounds.isEmpty())
  {
    return grid;
  }
  const Eigen::Vector3d low = bounds.min(), high = bounds.max();
  const Eigen::Vector3d size = high - low;
  // The limits keep numbers of any field inside an int; an absurd grid is refused later, with its size.
  const double spacing = std::clamp(size.maxCoeff() / (maximumDimension - 1), kMinimumSpacing, kMaximumSpacing);
  const Eigen::Vector3d steps = (size / spacing).array().round().min(kLargestIndex);
  grid.spacing.setConstant(spacing);
  grid.origin = 0.5 * (low + high) - 0.5 * spacing * steps;
  for (int axis = 0; axis < 3; ++axis)
  {
    grid.extent[2 * axis + 1] = static_cast<int>(steps[axis]);
  }
  return grid;
}

OutputGrid ResliceGrid(const GivenGrid& given, const ResliceSettings& settings, const InputGrid& input)
{
  OutputGrid grid = given.IsWhole() ? OutputGrid{*given.spacing, *given.origin, *given.extent}
                                    : DerivedGrid(given, settings, input());
  for (int axis = settings.dimensionality; axis < 3; ++axis)
  {
    grid.extent[2 * axis] = grid.extent[2 * axis + 1] = 0;
    grid.origin[axis] = 0;
  }
  for (int axis = 0; axis < 3; ++axis)
  {
    Require(Steps(grid.extent, axis) + 1 <= std::numeric_limits<int>::max(), "OutputExtent runs from ",
            grid.extent[2 * axis], " to ", grid.extent[2 * axis + 1], " along axis ", axis,
            "; an axis can have at most 2^31 - 1 pixels.");
  }
  return grid;
}

Eigen::Matrix4d OutputToWorld(const Eigen::Matrix4d& axes, const std::optional<Eigen::Matrix4d>& transform)
{
  const Eigen::Matrix4d matrix = transform ? Eigen::Matrix4d(*transform * axes) : axes;
  Require(matrix.allFinite(), "ResliceAxes or ResliceTransform holds a value that is not finite.");
  const Eigen::RowVector4d last = matrix.row(3);
  Require(last[3] != 0 && last.head<3>().cwiseAbs().maxCoeff() <= kAffine * std::abs(last[3]),
          "ResliceAxes and ResliceTransform together are perspective (their last row is not 0 0 0 1); "
          "a slice must stay evenly spaced.");
  return matrix / last[3];
}

Eigen::Matrix4d IndexToWorld(const Eigen::Matrix4d& outputToWorld, const Eigen::Vector3d& spacing,
                             const Eigen::Vector3d& origin)
{
  Eigen::Matrix4d indexToOutput = Eigen::Matrix4d::Identity();
  indexToOutput.diagonal().head<3>() = spacing;
  indexToOutput.col(3).head<3>() = origin;
  return outputToWorld * indexToOutput;
}

OutputGrid VoxelGrid(const GivenGrid& given, const Eigen::Matrix3d& direction, const InputGrid& field)
{
  Require((direction.colwise().norm().array() - 1).abs().maxCoeff() < kUnitLength &&
              std::abs(direction.determinant()) > kFlat,
          "OutputDirection must be a 3 x 3 matrix whose columns are unit vectors that span space.");
  OutputGrid grid{given.spacing.value_or(Eigen::Vector3d::Ones()), given.origin.value_or(Eigen::Vector3d::Zero()),
                  given.extent.value_or(Extent{})};
  if (!given.IsWhole())
  {
    // What was set replaces its part of the grid over the field, the rest keeps to its bounds.
    const OutputGrid over = field();
    const Eigen::Vector3d last(over.extent[1], over.extent[3], over.extent[5]);
    const Eigen::Vector3d size = over.spacing[0] * last;
    const Eigen::Vector3d centre = over.origin + 0.5 * size;
    const Eigen::Vector3d originAlongAxes = direction.inverse() * grid.origin;
    for (int axis = 0; axis < 3; ++axis)
    {
      int& end = grid.extent[2 * axis + 1];
      if (!given.spacing)
      {
        grid.spacing[axis] = given.extent && end > 0 && size[axis] > 0 ? size[axis] / end : over.spacing[axis];
      }
      if (!given.extent)
      {
        const double low = given.origin ? originAlongAxes[axis] : over.origin[axis];
        const double steps = (over.origin[axis] + size[axis] - low) / std::abs(grid.spacing[axis]);
        end = static_cast<int>(std::clamp(std::round(steps), 0.0, kLargestIndex));
      }
    }
    if (!given.origin)
    {
      const Eigen::Vector3d steps(grid.extent[1], grid.extent[3], grid.extent[5]);
      grid.origin = direction * (centre - 0.5 * grid.spacing.cwiseProduct(steps));
    }
  }
  if (std::min({grid.extent[1], grid.extent[3], grid.extent[5]}) < 0)
  {
    throw Error("OutputDimensions are " + std::to_string(grid.extent[1] + 1) + " x " +
                std::to_string(grid.extent[3] + 1) + " x " + std::to_string(grid.extent[5] + 1) +
                "; each must be at least 1.");
  }
  return grid;
}

SlicePlane GridPart::PlaneAt(double k) const
{
  const Eigen::Vector4d start = indexToWorld * Eigen::Vector4d(whole[0], whole[2], k, 1);
  SlicePlane plane;
  plane.origin = start.head<3>();
  plane.columnStep = indexToWorld.block<3, 1>(0, 0);
  plane.rowStep = indexToWorld.block<3, 1>(0, 1);
  plane.width = whole[1] - whole[0] + 1;
  plane.height = whole[3] - whole[2] + 1;
  return plane;
}

}  // namespace bigus
