// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Evaluation/Compounding.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>

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

/// Voxels of a pixel's size in the space that frames sweep, times kRoom, because a box holds more: 5 times as much at most of
/// the sweeps that were looked at, and without end where one pose strays. A gap counts up to kWidest pixels, so that what is
/// kept stays in proportion to what was recorded.
std::size_t MostVoxels(const Sweep& sweep, const std::vector<int>& training)
{
  constexpr double kRoom = 6, kWidest = 16;
  constexpr std::size_t kAlways = std::size_t(1) << 18;
  const double pixel = MeasureGeometry(sweep, training).pixelSize;
  const std::vector<double> gaps = GapsBetween(sweep, training), longest = LongestGaps(sweep, training);
  double layers = 1;
  for (std::size_t k = 0; k < longest.size(); ++k)
  {
    layers += std::clamp(std::min(gaps[k], longest[k]) / pixel, 1.0, kWidest);
  }
  return std::max(kAlways, static_cast<std::size_t>(kRoom * layers * static_cast<double>(sweep.PixelsPerFrame())));
}

struct FrameInVoxels
{
  FrameInSpace pixels;
  Eigen::Vector3d origin, columnStep, rowStep;  // in voxels
};

/// Rows [begin, end) of a grid, counted through its layers, and what pixels added up to in their voxels.
struct Slab
{
  struct Accumulator
  {
    double sum = 0, weight = 0;
  };

  Eigen::Vector3i size;  // of the grid
  int begin, end;
  std::vector<Accumulator> voxels;  // [end - begin][columns]

  /// Adds pixel (i, j), which lies at p (voxels), to the eight voxels around it, those of other slabs left out.
  void Add(const Eigen::Vector3d& p, const FrameInSpace& pixels, int i, int j)
  {
    const int x = std::min(static_cast<int>(p[0]), size[0] - 2);
    const int y = std::min(static_cast<int>(p[1]), size[1] - 2);
    const int z = std::min(static_cast<int>(p[2]), size[2] - 2);
    const double value = pixels.Pixel(i, j);
    const double fx = p[0] - x, fy = p[1] - y, fz = p[2] - z;
    for (int corner = 0; corner < 4; ++corner)
    {
      const int row = (z + corner / 2) * size[1] + y + corner % 2;
      if (row < begin || row >= end)
      {
        continue;
      }
      const double weight = (corner / 2 ? fz : 1 - fz) * (corner % 2 ? fy : 1 - fy);
      Accumulator* const at = &voxels[static_cast<std::size_t>(row - begin) * size[0] + x];
      at[0].sum += weight * (1 - fx) * value;
      at[0].weight += weight * (1 - fx);
      at[1].sum += weight * fx * value;
      at[1].weight += weight * fx;
    }
  }

  /// Adds what is lit (null: all) of row j of a frame. Pixels that touch its layers are those with
  /// first - 1 < z < last + 1: an interval of the row, found a pixel too wide on either side.
  void AddRow(const FrameInVoxels& frame, int j, int width, const std::uint8_t* lit)
  {
    const Eigen::Vector3d start = frame.origin + j * frame.rowStep;
    double first = 0, last = width - 1.0;
    const double dz = frame.columnStep[2];
    const int below = begin / size[1] - 1, above = (end - 1) / size[1] + 1;
    if (dz != 0)
    {
      const double low = (below - start[2]) / dz, high = (above - start[2]) / dz;
      first = std::max(first, std::floor(std::min(low, high)) - 1);
      last = std::min(last, std::ceil(std::max(low, high)) + 1);
    }
    else if (start[2] <= below || start[2] >= above)
    {
      return;
    }
    for (int i = static_cast<int>(std::min<double>(first, width)); i <= last; ++i)
    {
      if (lit && !lit[i])
      {
        continue;
      }
      // The frames' own bounds made the grid: rounding alone can leave it.
      Add((start + i * frame.columnStep).cwiseMax(0.0), frame.pixels, i, j);
    }
  }
};

constexpr double kLevels = 65534;  // of intensity in a voxel

/// A part of a grid of voxels, 0 where empty, around all pasted ones of some layers; sticks through it.
class Sticks
{
public:
  Sticks(const std::uint16_t* voxels, const Eigen::Vector3i& size, int firstLayer, int endLayer, int longest)
      : voxels_(voxels), size_(size), longest_(longest)
  {
    FindBounds(firstLayer, endLayer);
    ahead_.resize(static_cast<std::size_t>(count_[0]) * count_[1] * count_[2]);
    behind_.resize(ahead_.size());
  }

  /// Fills holes of layers [begin, end), which lie in this part, in `filled`, a copy of them.
  void Fill(int begin, int end, std::vector<std::uint16_t>& filled)
  {
    if (count_[0] == 0)
    {
      return;  // a gap: its layers are many where one pose strays
    }
    const std::size_t layer = static_cast<std::size_t>(size_[0]) * size_[1];
    std::vector<std::uint16_t> shortest(filled.size(), std::numeric_limits<std::uint16_t>::max());  // squared, voxels
    for (int d = 14; d < 27; ++d)  // half of the 26 neighbours: a stick has two ends
    {
      const Eigen::Vector3i step(d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1);
      Measure(step, ahead_);
      Measure(-step, behind_);
      const std::ptrdiff_t offset = (static_cast<std::ptrdiff_t>(step[2]) * size_[1] + step[1]) * size_[0] + step[0];
      ForRows(std::max(begin, first_[2]), std::min(end, first_[2] + count_[2]),
              [&](int y, int z)
              {
                const std::size_t row = Row(y, z), own = Grid(first_[0], y, z);
                for (int x = 0; x < count_[0]; ++x)
                {
                  const int a = ahead_[row + x], b = behind_[row + x], squared = (a + b) * (a + b) * step.squaredNorm();
                  const std::size_t here = own + x - layer * begin;
                  if (a > 0 && b > 0 && a + b <= longest_ && voxels_[own + x] == 0 && squared < shortest[here])
                  {
                    const std::uint16_t* hole = voxels_ + own + x;
                    shortest[here] = static_cast<std::uint16_t>(squared);
                    filled[here] = static_cast<std::uint16_t>(
                        (b * hole[a * offset] + a * hole[-b * offset] + (a + b) / 2) / (a + b));
                  }
                }
              });
    }
  }

private:
  std::size_t Grid(int x, int y, int z) const { return (static_cast<std::size_t>(z) * size_[1] + y) * size_[0] + x; }
  std::size_t Row(int y, int z) const
  {
    return (static_cast<std::size_t>(z - first_[2]) * count_[1] + (y - first_[1])) * count_[0];
  }

  template <class Function>
  void ForRows(int begin, int end, Function function) const
  {
    tbb::parallel_for(0, std::max(0, end - begin) * count_[1],
                      [&](int k) { function(first_[1] + k % count_[1], begin + k / count_[1]); });
  }

  void FindBounds(int firstLayer, int endLayer)
  {
    std::vector<std::array<int, 4>> ofLayer(endLayer - firstLayer);  // first and last x and y
    tbb::parallel_for(firstLayer, endLayer,
                      [&](int z)
                      {
                        std::array<int, 4> bounds{size_[0], -1, size_[1], -1};
                        for (int y = 0; y < size_[1]; ++y)
                        {
                          const std::uint16_t* row = voxels_ + Grid(0, y, z);
                          const auto isPasted = [](std::uint16_t voxel) { return voxel != 0; };
                          const int first = static_cast<int>(std::find_if(row, row + size_[0], isPasted) - row);
                          if (first < size_[0])
                          {
                            int last = size_[0] - 1;
                            while (row[last] == 0)
                            {
                              --last;
                            }
                            bounds = {std::min(bounds[0], first), std::max(bounds[1], last), std::min(bounds[2], y), y};
                          }
                        }
                        ofLayer[z - firstLayer] = bounds;
                      });
    std::array<int, 4> all{size_[0], -1, size_[1], -1};
    for (const std::array<int, 4>& one : ofLayer)
    {
      all = {std::min(all[0], one[0]), std::max(all[1], one[1]), std::min(all[2], one[2]), std::max(all[3], one[3])};
    }
    first_ = {all[0], all[2], firstLayer};
    count_ = {std::max(0, all[1] - all[0] + 1), std::max(0, all[3] - all[2] + 1), endLayer - firstLayer};
  }

  /// For every voxel the number of steps to the next pasted one, below longest_; 0: there is none. One step further than
  /// from the voxel a step on.
  void Measure(const Eigen::Vector3i& step, std::vector<std::uint8_t>& steps) const
  {
    const auto inOrder = [](int first, int count, int direction, auto visit)
    {
      for (int k = 0; k < count; ++k)
      {
        visit(direction > 0 ? first + count - 1 - k : first + k);
      }
    };
    const auto row = [&](int y, int z)
    {
      std::uint8_t* out = &steps[Row(y, z)];
      const int v = y + step[1], w = z + step[2];
      if (v < first_[1] || v >= first_[1] + count_[1] || w < first_[2] || w >= first_[2] + count_[2])
      {
        std::fill_n(out, count_[0], std::uint8_t(0));
        return;
      }
      const std::uint8_t* next = &steps[Row(v, w)] + step[0];
      const std::uint16_t* pasted = voxels_ + Grid(first_[0], v, w) + step[0];
      const auto most = static_cast<std::uint8_t>(longest_ - 1);
      const auto one = [&](int x)
      {
        const std::uint8_t further = next[x] > 0 && next[x] < most ? next[x] + 1 : 0;
        out[x] = pasted[x] != 0 ? 1 : further;
      };
      const int begin = step[0] < 0 ? 1 : 0, end = count_[0] - (step[0] > 0 ? 1 : 0);
      if (step[1] == 0 && step[2] == 0)
      {
        inOrder(begin, end - begin, step[0], one);
      }
      else
      {
        for (int x = begin; x < end; ++x)
        {
          one(x);
        }
      }
      out[step[0] < 0 ? 0 : count_[0] - 1] *= step[0] == 0 ? 1 : 0;
    };
    if (step[2] != 0)
    {
      inOrder(first_[2], count_[2], step[2], [&](int z) { ForRows(z, z + 1, [&](int y, int) { row(y, z); }); });
    }
    else
    {
      tbb::parallel_for(first_[2], first_[2] + count_[2],
                        [&](int z) { inOrder(first_[1], count_[1], step[1], [&](int y) { row(y, z); }); });
    }
  }

  const std::uint16_t* voxels_;
  Eigen::Vector3i size_;
  int longest_;
  Eigen::Vector3i first_, count_;
  std::vector<std::uint8_t> ahead_, behind_;
};

}  // namespace

double Compounding::VoxelSizeForMemory(const Sweep& sweep, const std::vector<int>& training, std::size_t bytes)
{
  CheckTraining(sweep, training);
  const Box box(sweep, training);
  const double limit = static_cast<double>(bytes / sizeof(Voxel));
  Require(limit >= 8, "Compounding: ", bytes, " bytes hold no grid; the coarsest takes 16 (8 voxels).");
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
  Require(voxelSize >= 0 && std::isfinite(voxelSize), "Compounding: the voxel size is ", voxelSize,
          " mm; it must be positive, or 0 to choose one.");
  const Box box(sweep, training);
  const double limit = static_cast<double>(maximumVoxels);
  voxelSize_ = voxelSize > 0 ? voxelSize : ChooseVoxelSize(sweep, training, maximumVoxels);
  const Eigen::Vector3d size = box.Voxels(voxelSize_);
  Require(size.prod() <= limit && size.maxCoeff() <= std::numeric_limits<int>::max(), "Compounding: voxels of ",
          voxelSize_, " mm make a grid of ", size.prod(), " voxels, but ", maximumVoxels,
          " are allowed; choose larger voxels.");
  origin_ = box.lowest;
  size_ = size.cast<int>();
  voxels_.assign(static_cast<std::size_t>(size.prod()), 0);
  Paste(sweep, training);
  // A break in the sweep is no gap. The nearest of 13 directions is at most 27.2 degrees from a gap's own: 1 / cos = 1.13.
  const SweepGeometry geometry = MeasureGeometry(sweep, training);
  double gap = std::min(geometry.largestSpacing, kBreak * geometry.usualSpacing);
  const std::vector<double> gaps = GapsBetween(sweep, training), longest = LongestGaps(sweep, training);
  for (std::size_t k = 0; k < longest.size(); ++k)
  {
    gap = gaps[k] <= longest[k] ? std::max(gap, gaps[k]) : gap;
  }
  FillHoles(static_cast<int>(std::clamp(std::ceil(1.13 * gap / voxelSize_), 9.0, 64.0)));
}

/// Each thread owns a slab of rows, of whole layers where they are small, whose voxels add up pixels in order of frame and
/// row.
void Compounding::Paste(const Sweep& sweep, const std::vector<int>& training)
{
  std::vector<FrameInVoxels> frames;
  for (int frame : training)
  {
    const SlicePlane plane = sweep.Plane(frame);
    frames.push_back({FrameInSpace(sweep, frame), (plane.origin - origin_) / voxelSize_, plane.columnStep / voxelSize_,
                      plane.rowStep / voxelSize_});
  }
  // Sixteen slabs at least, whose sums take the less memory; of a large grid more, because each walks all frames.
  const std::size_t layer = static_cast<std::size_t>(size_[0]) * size_[1];
  const std::size_t voxels = std::clamp(voxels_.size() / 16, std::size_t(1) << 16, std::size_t(1) << 20);
  const int all = size_[1] * size_[2];
  const int rows = static_cast<int>(layer <= voxels ? std::min<std::size_t>(voxels / layer * size_[1], all)
                                                    : std::max<std::size_t>(voxels / size_[0], 1));
  tbb::parallel_for(
      0, (all + rows - 1) / rows,
      [&](int number)
      {
        const int begin = number * rows,
                  end = static_cast<int>(std::min<std::int64_t>(std::int64_t(begin) + rows, all));
        Slab slab{size_, begin, end, std::vector<Slab::Accumulator>(static_cast<std::size_t>(end - begin) * size_[0])};
        for (const FrameInVoxels& frame : frames)
        {
          for (int j = 0; j < sweep.height; ++j)
          {
            slab.AddRow(frame, j, sweep.width,
                        sweep.mask ? sweep.mask->data() + static_cast<std::size_t>(j) * sweep.width : nullptr);
          }
        }
        for (std::size_t k = 0; k < slab.voxels.size(); ++k)
        {
          const auto& [sum, weight] = slab.voxels[k];
          if (weight > 1e-6)
          {
            voxels_[static_cast<std::size_t>(begin) * size_[0] + k] =
                static_cast<Voxel>(1 + std::lround(kLevels * sum / weight));
          }
        }
      });
}

/// A stick has pasted voxels at its ends, never filled ones: a slab of layers is filled into a copy, which takes its place
/// when the next one, as thick as a stick is long, is filled too.
void Compounding::FillHoles(int longest)
{
  const int thickness = std::max(longest, 32);
  const std::size_t layer = static_cast<std::size_t>(size_[0]) * size_[1];
  std::vector<Voxel> before;
  for (int first = 0; first < size_[2]; first += thickness)
  {
    const int end = std::min(size_[2], first + thickness);
    std::vector<Voxel> slab(voxels_.begin() + layer * first, voxels_.begin() + layer * end);
    Sticks(voxels_.data(), size_, std::max(0, first - longest), std::min(size_[2], end + longest), longest)
        .Fill(first, end, slab);
    std::copy(before.begin(), before.end(), voxels_.begin() + layer * std::max(0, first - thickness));
    before.swap(slab);
  }
  std::copy(before.begin(), before.end(), voxels_.end() - before.size());
}

double Compounding::Value(const Eigen::Vector3d& point) const
{
  const Eigen::Vector3d last = (size_.array() - 1).cast<double>();
  Eigen::Vector3d p = (point - origin_) / voxelSize_;
  if (!((p.array() >= -kRounding).all() && (p.array() <= last.array() + kRounding).all()))
  {
    return 0;
  }
  p = p.cwiseMax(0.0);
  const int x = std::min(static_cast<int>(p[0]), size_[0] - 2);
  const int y = std::min(static_cast<int>(p[1]), size_[1] - 2);
  const int z = std::min(static_cast<int>(p[2]), size_[2] - 2);
  const double fx = p[0] - x, fy = p[1] - y, fz = p[2] - z;
  double sum = 0, weights = 0;
  for (int corner = 0; corner < 8; ++corner)
  {
    const int dx = corner % 2, dy = corner / 2 % 2, dz = corner / 4;
    if (const Voxel voxel = voxels_[Index(x + dx, y + dy, z + dz)])
    {
      const double weight = (dx ? fx : 1 - fx) * (dy ? fy : 1 - fy) * (dz ? fz : 1 - fz);
      sum += weight * (voxel - 1);
      weights += weight;
    }
  }
  return weights > kRounding ? sum / (weights * kLevels) : 0;
}

void Compounding::Predict(const SlicePlane& plane, float* image) const
{
  ForEachPixel(plane, image, [&](const Eigen::Vector3d& point) { return Value(point); });
}

namespace
{

constexpr int kLeastJudged = 64;  // pixels, of a side

/// A rectangle of a frame's pixels.
struct Part
{
  int column, row, width, height;

  /// The same, wider by so many pixels on all sides, as far as the frame goes.
  Part Wider(int pixels, const Sweep& sweep) const
  {
    const int left = std::max(0, column - pixels), top = std::max(0, row - pixels);
    return {left, top, std::min(sweep.width, column + width + pixels) - left,
            std::min(sweep.height, row + height + pixels) - top};
  }
};

/// Speckle grows with depth, so that the parts to judge lie one below another: number 0 at the top of what is lit, 4 at its
/// bottom, each a quarter of it high, and in its middle a quarter as wide; at least kLeastJudged pixels.
Part PartToJudge(const Sweep& sweep, int number)
{
  const auto isLit = [&](int i, int j) { return sweep.IsLit(static_cast<std::size_t>(j) * sweep.width + i); };
  /// First and count of those among `all` that hold.
  const auto range = [](int all, auto holds)
  {
    int first = 0, last = all - 1;
    while (first < last && !holds(first))
    {
      ++first;
    }
    while (last > first && !holds(last))
    {
      --last;
    }
    return std::pair(first, last - first + 1);
  };
  const auto side = [](int all) { return std::min(all, std::max(kLeastJudged, all / 4)); };
  const auto [top, rows] = range(sweep.height,
                                 [&](int j)
                                 {
                                   int i = 0;
                                   while (i < sweep.width && !isLit(i, j))
                                   {
                                     ++i;
                                   }
                                   return i < sweep.width;
                                 });
  Part part{0, 0, 0, side(rows)};
  part.row = top + (rows - part.height) * number / 4;
  const int middle = part.row + part.height / 2;
  const auto [left, columns] = range(sweep.width, [&](int i) { return isLit(i, middle); });
  part.width = side(columns);
  part.column = left + (columns - part.width) / 2;
  return part;
}

/// These frames, and of each what lies in a part.
Sweep Cut(const Sweep& sweep, const std::vector<int>& frames, const Part& part)
{
  Sweep cut;
  cut.width = part.width;
  cut.height = part.height;
  cut.pixelType = Sweep::PixelType::Float32;
  auto pixels = std::make_shared<std::vector<float>>();
  auto mask = std::make_shared<std::vector<std::uint8_t>>();
  std::vector<float> whole(sweep.PixelsPerFrame());
  for (const int frame : frames)
  {
    sweep.CopyFrame(frame, whole.data());
    cut.imageToReference.push_back(sweep.imageToReference[frame]);
    cut.imageToReference.back().col(3) = sweep.imageToReference[frame] * Eigen::Vector4d(part.column, part.row, 0, 1);
    cut.sequences.push_back(sweep.SequenceOf(frame));
    for (int j = 0; j < part.height; ++j)
    {
      const auto row = whole.begin() + static_cast<std::ptrdiff_t>(part.row + j) * sweep.width + part.column;
      pixels->insert(pixels->end(), row, row + part.width);
    }
  }
  for (int p = 0; p < part.width * part.height; ++p)
  {
    const std::size_t at =
        static_cast<std::size_t>(part.row + p / part.width) * sweep.width + part.column + p % part.width;
    mask->push_back(sweep.IsLit(at) ? 1 : 0);
  }
  cut.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  cut.mask = mask;
  return cut;
}

/// A part of a training frame, to be predicted from the frames beside it, of which a little more is used because they
/// need not lie straight above one another.
struct Judged
{
  Sweep frame, beside;

  Judged(const Sweep& sweep, const std::vector<int>& training, int number)
  {
    constexpr int kFrames = 4;  // on either side
    const int count = static_cast<int>(training.size());
    const int own = 1 + static_cast<int>(static_cast<std::int64_t>(count - 3) * number / 4);
    std::vector<int> around(training.begin() + std::max(0, own - kFrames),
                            training.begin() + std::min(count, own + kFrames + 1));
    around.erase(std::find(around.begin(), around.end(), training[own]));
    const Part part = PartToJudge(sweep, number);
    frame = Cut(sweep, {training[own]}, part);
    beside = Cut(sweep, around, part.Wider(std::max(part.width, part.height) / 4, sweep));
  }

  double SquaredError(double voxelSize, std::size_t maximumVoxels) const
  {
    std::vector<float> image(frame.PixelsPerFrame()), truth(image.size());
    Compounding(beside, AllFrames(beside), voxelSize, maximumVoxels).Predict(frame.Plane(0), image.data());
    frame.CopyFrame(0, truth.data());
    double squares = 0;
    for (std::size_t p = 0; p < image.size(); ++p)
    {
      squares += frame.IsLit(p) ? (image[p] - truth[p]) * (image[p] - truth[p]) : 0;
    }
    return squares;
  }
};

}  // namespace

double Compounding::ChooseVoxelSize(const Sweep& sweep, const std::vector<int>& training, std::size_t maximumVoxels)
{
  const double pixel = MeasureGeometry(sweep, training).pixelSize;
  const std::size_t most = std::min(maximumVoxels, MostVoxels(sweep, training));
  const double fits = VoxelSizeForMemory(sweep, training, most * sizeof(Voxel));
  if (training.size() < 3)
  {
    return std::max(pixel, fits);
  }
  std::vector<Judged> judged;
  for (int number = 0; number < 5; ++number)
  {
    judged.emplace_back(sweep, training, number);
  }
  double best = std::max(pixel, fits), least = std::numeric_limits<double>::infinity();
  for (int coarser = 4; coarser >= 0; --coarser)
  {
    const double size = std::max(pixel * std::pow(2.0, 0.5 * coarser), fits);
    double squares = 0;
    for (const Judged& one : judged)
    {
      squares += one.SquaredError(size, maximumVoxels);
    }
    if (squares >= least)
    {
      break;
    }
    least = squares;
    best = size;
  }
  return best;
}

}  // namespace bigus
