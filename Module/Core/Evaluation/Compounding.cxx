// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Evaluation/Compounding.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "Core/Evaluation/FrameInSpace.h"
#include "Core/Model/Error.h"
#include "Core/Model/SweepGeometry.h"

namespace bigus
{
namespace
{

constexpr double kRounding = 1e-6;  // voxels: a point on the grid's border stays on it

/// The box around the frames' pixel centres, in voxels of any size: x, y, z of a grid that holds it.
struct Box
{
  Eigen::Vector3d lowest = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d highest = -lowest;

  Box(const Sweep& sweep, const std::vector<int>& frames)
  {
    for (int frame : frames)
    {
      const SlicePlane plane = sweep.Plane(frame);
      for (int corner = 0; corner < 4; ++corner)
      {
        const Eigen::Vector3d x = plane.Point(corner % 2 * (sweep.width - 1.0), corner / 2 * (sweep.height - 1.0));
        lowest = lowest.cwiseMin(x);
        highest = highest.cwiseMax(x);
      }
    }
  }

  /// In double: sizes of hostile poses fit no integer. One voxel more than the floor, and one for the trilinear corner.
  Eigen::Vector3d Voxels(double size) const { return ((highest - lowest) / size).array().floor() + 2; }
};

struct FrameInVoxels
{
  FrameInSpace pixels;
  Eigen::Vector3d origin, columnStep, rowStep;  // in voxels
};

/// Layers [begin, end) of a grid, and what pixels added up to in its voxels.
struct Slab
{
  struct Accumulator
  {
    double sum = 0, weight = 0;
  };

  Eigen::Vector3i size;  // of the grid
  int begin, end;
  std::vector<Accumulator> voxels;  // [end - begin][rows][columns]

  /// Adds pixel (i, j), which lies at p (voxels), to the eight voxels around it, those of other slabs left out.
  void Add(const Eigen::Vector3d& p, const FrameInSpace& pixels, int i, int j)
  {
    const int x = std::min(static_cast<int>(p[0]), size[0] - 2);
    const int y = std::min(static_cast<int>(p[1]), size[1] - 2);
    const int z = std::min(static_cast<int>(p[2]), size[2] - 2);
    if (z + 1 < begin || z >= end)
    {
      return;
    }
    const double value = pixels.Pixel(i, j);
    const double fx = p[0] - x, fy = p[1] - y, fz = p[2] - z;
    for (int layer = std::max(z, begin); layer < std::min(z + 2, end); ++layer)
    {
      const double wz = layer > z ? fz : 1 - fz;
      Accumulator* row = &voxels[(static_cast<std::size_t>(layer - begin) * size[1] + y) * size[0] + x];
      const auto add = [value](Accumulator& to, double weight)
      {
        to.sum += weight * value;
        to.weight += weight;
      };
      add(row[0], wz * (1 - fy) * (1 - fx));
      add(row[1], wz * (1 - fy) * fx);
      add(row[size[0]], wz * fy * (1 - fx));
      add(row[size[0] + 1], wz * fy * fx);
    }
  }

  /// Adds row j of a frame. Pixels that touch the slab are those with begin - 1 < z < end: an interval of the row, found
  /// a pixel too wide on either side.
  void AddRow(const FrameInVoxels& frame, int j, int width)
  {
    const Eigen::Vector3d start = frame.origin + j * frame.rowStep;
    double first = 0, last = width - 1.0;
    const double dz = frame.columnStep[2];
    if (dz != 0)
    {
      const double low = (begin - 1 - start[2]) / dz, high = (end - start[2]) / dz;
      first = std::max(first, std::floor(std::min(low, high)) - 1);
      last = std::min(last, std::ceil(std::max(low, high)) + 1);
    }
    else if (start[2] <= begin - 1 || start[2] >= end)
    {
      return;
    }
    for (int i = static_cast<int>(std::min<double>(first, width)); i <= last; ++i)
    {
      // The frames' own bounds made the grid: rounding alone can leave it.
      Add((start + i * frame.columnStep).cwiseMax(0.0), frame.pixels, i, j);
    }
  }
};

}  // namespace

double Compounding::VoxelSizeForMemory(const Sweep& sweep, const std::vector<int>& training, std::size_t bytes)
{
  CheckTraining(sweep, training);
  const Box box(sweep, training);
  const double limit = static_cast<double>(bytes / sizeof(float));
  if (limit < 8)
  {
    throw Error("Compounding: " + std::to_string(bytes) + " bytes hold no grid; the coarsest takes 32 (8 voxels).");
  }
  double low = 0, high = 1.01 * (box.highest - box.lowest).maxCoeff() + 1e-6;  // 8 voxels
  while (high - low > 1e-3 * high)
  {
    const double middle = 0.5 * (low + high);
    (box.Voxels(middle).prod() <= limit ? high : low) = middle;
  }
  return high;
}

Compounding::Compounding(const Sweep& sweep, const std::vector<int>& training, double voxelSize,
                         std::size_t maximumVoxels)
{
  CheckTraining(sweep, training);
  if (!(voxelSize >= 0 && std::isfinite(voxelSize)))
  {
    throw Error("Compounding: the voxel size is " + std::to_string(voxelSize) +
                " mm; it must be positive, or 0 to choose one.");
  }
  const Box box(sweep, training);
  const double limit = static_cast<double>(maximumVoxels);
  voxelSize_ = voxelSize;
  const SweepGeometry geometry = MeasureGeometry(sweep, training);
  if (voxelSize == 0)
  {
    voxelSize_ = std::max(geometry.pixelSize, std::sqrt(geometry.pixelSize * geometry.usualSpacing));
    while (box.Voxels(voxelSize_).prod() > limit && box.Voxels(voxelSize_).maxCoeff() > 2)
    {
      voxelSize_ *= 1.25;
    }
  }
  const Eigen::Vector3d size = box.Voxels(voxelSize_);
  if (!(size.prod() <= limit) || size.maxCoeff() > std::numeric_limits<int>::max())
  {
    throw Error("Compounding: voxels of " + std::to_string(voxelSize_) + " mm make a grid of " +
                std::to_string(size.prod()) + " voxels, but " + std::to_string(maximumVoxels) +
                " are allowed; choose larger voxels.");
  }
  origin_ = box.lowest;
  size_ = size.cast<int>();
  voxels_.assign(static_cast<std::size_t>(size.prod()), 0.0f);
  // As far as half the widest gap between neighbouring planes (a break in the sweep is no gap), at least three voxels.
  const double gap = std::min(geometry.largestSpacing, 4 * geometry.usualSpacing);
  constexpr double kMostPasses = 64;
  FillHoles(Paste(sweep, training), static_cast<int>(std::clamp(std::ceil(0.5 * gap / voxelSize_), 3.0, kMostPasses)));
}

/// Which voxels got a value. Each thread owns a slab of layers, whose voxels add up pixels in order of frame and row.
std::vector<unsigned char> Compounding::Paste(const Sweep& sweep, const std::vector<int>& training)
{
  std::vector<FrameInVoxels> frames;
  for (int frame : training)
  {
    const SlicePlane plane = sweep.Plane(frame);
    frames.push_back({FrameInSpace(sweep, frame), (plane.origin - origin_) / voxelSize_, plane.columnStep / voxelSize_,
                      plane.rowStep / voxelSize_});
  }
  std::vector<unsigned char> filled(voxels_.size(), 0);
  const std::size_t layer = static_cast<std::size_t>(size_[0]) * size_[1];
  const int layers = static_cast<int>(std::clamp<std::size_t>((std::size_t(1) << 20) / layer, 1, size_[2]));
  tbb::parallel_for(0, (size_[2] + layers - 1) / layers,
                    [&](int number)
                    {
                      const int begin = number * layers, end = std::min(begin + layers, size_[2]);
                      Slab slab{size_, begin, end, std::vector<Slab::Accumulator>(layer * (end - begin))};
                      for (const FrameInVoxels& frame : frames)
                      {
                        for (int j = 0; j < sweep.height; ++j)
                        {
                          slab.AddRow(frame, j, sweep.width);
                        }
                      }
                      for (std::size_t k = 0; k < slab.voxels.size(); ++k)
                      {
                        const auto& [sum, weight] = slab.voxels[k];
                        if (weight > 1e-6)
                        {
                          filled[layer * begin + k] = 1;
                          voxels_[layer * begin + k] = static_cast<float>(sum / weight);
                        }
                      }
                    });
  return filled;
}

void Compounding::FillHoles(std::vector<unsigned char> filled, int passes)
{
  const int nx = size_[0], ny = size_[1], nz = size_[2];
  struct Interval
  {
    int first = std::numeric_limits<int>::max(), last = -1;
  };
  std::vector<Interval> rows(static_cast<std::size_t>(ny) * nz);
  for (int pass = 0; pass < passes; ++pass)
  {
    // Most of the box lies outside the sweep: look only near each row's filled voxels.
    tbb::parallel_for(0, nz,
                      [&](int z)
                      {
                        for (int y = 0; y < ny; ++y)
                        {
                          const unsigned char* row = &filled[Index(0, y, z)];
                          const unsigned char* first = std::find(row, row + nx, 1);
                          if (first != row + nx)
                          {
                            int last = nx - 1;
                            while (!row[last])
                            {
                              --last;
                            }
                            rows[static_cast<std::size_t>(z) * ny + y] = {static_cast<int>(first - row), last};
                          }
                        }
                      });
    // Reads only voxels filled before this pass and writes only the others, so the order does not matter.
    std::vector<unsigned char> next = filled;
    tbb::parallel_for(0, nz,
                      [&](int z)
                      {
                        for (int y = 0; y < ny; ++y)
                        {
                          Interval near;
                          for (int v = std::max(0, z - 1); v <= std::min(nz - 1, z + 1); ++v)
                          {
                            for (int u = std::max(0, y - 1); u <= std::min(ny - 1, y + 1); ++u)
                            {
                              const Interval& row = rows[static_cast<std::size_t>(v) * ny + u];
                              near.first = std::min(near.first, row.first);
                              near.last = std::max(near.last, row.last);
                            }
                          }
                          for (int x = std::max(0, near.first - 1);
                               near.last >= 0 && x <= std::min(nx - 1, near.last + 1); ++x)
                          {
                            if (!filled[Index(x, y, z)])
                            {
                              next[Index(x, y, z)] = FillVoxel(filled, x, y, z);
                            }
                          }
                        }
                      });
    filled.swap(next);
  }
}

/// Gives a voxel the mean of its filled neighbours (of 26); false when it has none.
bool Compounding::FillVoxel(const std::vector<unsigned char>& filled, int x, int y, int z)
{
  double sum = 0;
  int count = 0;
  for (int v = std::max(0, z - 1); v <= std::min(size_[2] - 1, z + 1); ++v)
  {
    for (int u = std::max(0, y - 1); u <= std::min(size_[1] - 1, y + 1); ++u)
    {
      for (int t = std::max(0, x - 1); t <= std::min(size_[0] - 1, x + 1); ++t)
      {
        if (filled[Index(t, u, v)])
        {
          sum += voxels_[Index(t, u, v)];
          ++count;
        }
      }
    }
  }
  if (count > 0)
  {
    voxels_[Index(x, y, z)] = static_cast<float>(sum / count);
  }
  return count > 0;
}

void Compounding::Predict(const SlicePlane& plane, float* image) const
{
  const Eigen::Vector3d last = (size_.array() - 1).cast<double>();
  ForEachPixel(plane, image,
               [&](const Eigen::Vector3d& point)
               {
                 Eigen::Vector3d p = (point - origin_) / voxelSize_;
                 if (!((p.array() >= -kRounding).all() && (p.array() <= last.array() + kRounding).all()))
                 {
                   return 0.0;
                 }
                 p = p.cwiseMax(0.0);
                 const int x = std::min(static_cast<int>(p[0]), size_[0] - 2);
                 const int y = std::min(static_cast<int>(p[1]), size_[1] - 2);
                 const int z = std::min(static_cast<int>(p[2]), size_[2] - 2);
                 const double fx = p[0] - x, fy = p[1] - y, fz = p[2] - z;
                 const auto along = [&](int dy, int dz)
                 {
                   const float* v = &voxels_[Index(x, y + dy, z + dz)];
                   return (1 - fx) * v[0] + fx * v[1];
                 };
                 return (1 - fz) * ((1 - fy) * along(0, 0) + fy * along(1, 0)) +
                        fz * ((1 - fy) * along(0, 1) + fy * along(1, 1));
               });
}

}  // namespace bigus
