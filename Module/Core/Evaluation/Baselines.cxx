// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Evaluation/Baselines.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Model/SweepGeometry.h"

namespace bigus
{
namespace
{

constexpr int none = -1;

/// Checks what every predictor relies on.
void CheckTraining(const Sweep& sweep, const std::vector<int>& training)
{
  if (training.empty())
  {
    throw Error("Baselines: there is no training frame to predict from.");
  }
  for (std::size_t k = 0; k < training.size(); ++k)
  {
    if (training[k] < 0 || training[k] >= sweep.NumberOfFrames() || (k > 0 && training[k] <= training[k - 1]))
    {
      throw Error("Baselines: training frame " + std::to_string(training[k]) + " is out of order or not one of the " +
                  std::to_string(sweep.NumberOfFrames()) + " frames.");
    }
  }
}

/// Weights of the pixels at -1, 0, 1, 2 for a point at t, 0 to 1, between the middle two: Keys' cubic
/// convolution (1981) with a = -1/2.
std::array<double, 4> KeysWeights(double t)
{
  const double t2 = t * t, t3 = t2 * t;
  return {0.5 * (-t3 + 2 * t2 - t), 0.5 * (3 * t3 - 5 * t2 + 2), 0.5 * (-3 * t3 + 4 * t2 + t), 0.5 * (t3 - t2)};
}

/// One frame as a function in space.
class FrameInSpace
{
public:
  FrameInSpace(const Sweep& sweep, int frame, PixelInterpolation sampling = PixelInterpolation::Linear)
      : width_(sweep.width),
        height_(sweep.height),
        first_(static_cast<std::size_t>(frame) * sweep.PixelsPerFrame()),
        bytes_(sweep.pixelType == Sweep::PixelType::UInt8 ? static_cast<const std::uint8_t*>(sweep.pixels.get())
                                                          : nullptr),
        floats_(static_cast<const float*>(sweep.pixels.get())),
        sampling_(sampling),
        plane_(sweep.Plane(frame)),
        toSlice_(plane_.WorldToSlice())
  {
  }

  const SlicePlane& Plane() const { return plane_; }

  float Pixel(int i, int j) const
  {
    const std::size_t p = first_ + static_cast<std::size_t>(j) * width_ + i;
    return bytes_ ? static_cast<float>(bytes_[p]) / 255.0f : floats_[p];
  }

  /// (i, j, z) of a point: pixel coordinates of its foot on the plane, and its signed distance in mm.
  Eigen::Vector3d Project(const Eigen::Vector3d& point) const { return toSlice_ * (point - plane_.origin); }

  /// (i, j, z) of a vector in mm.
  Eigen::Vector3d Direction(const Eigen::Vector3d& vector) const { return toSlice_ * vector; }

  bool Contains(const Eigen::Vector3d& ijz) const
  {
    return ijz[0] >= -0.5 && ijz[0] <= width_ - 0.5 && ijz[1] >= -0.5 && ijz[1] <= height_ - 0.5;
  }

  /// Between pixels; the outermost half pixel repeats the edge.
  double Sample(const Eigen::Vector3d& ijz) const
  {
    const double u = std::clamp(ijz[0], 0.0, width_ - 1.0);
    const double v = std::clamp(ijz[1], 0.0, height_ - 1.0);
    return sampling_ == PixelInterpolation::Linear ? Bilinear(u, v) : Bicubic(u, v);
  }

private:
  double Bilinear(double u, double v) const
  {
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    const int iNext = std::min(i + 1, width_ - 1), jNext = std::min(j + 1, height_ - 1);
    const double fu = u - i, fv = v - j;
    return (1 - fv) * ((1 - fu) * Pixel(i, j) + fu * Pixel(iNext, j)) +
           fv * ((1 - fu) * Pixel(i, jNext) + fu * Pixel(iNext, jNext));
  }

  double Bicubic(double u, double v) const
  {
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    const std::array<double, 4> across = KeysWeights(u - i), down = KeysWeights(v - j);
    double sum = 0;
    for (int n = 0; n < 4; ++n)
    {
      const int row = std::clamp(j + n - 1, 0, height_ - 1);
      for (int m = 0; m < 4; ++m)
      {
        sum += down[n] * across[m] * Pixel(std::clamp(i + m - 1, 0, width_ - 1), row);
      }
    }
    return std::clamp(sum, 0.0, 1.0);
  }

  int width_, height_;
  std::size_t first_;
  const std::uint8_t* bytes_;
  const float* floats_;
  PixelInterpolation sampling_;
  SlicePlane plane_;
  Eigen::Matrix3d toSlice_;
};

/// Linear interpolation between two frames, along the mean of their normals: exact where intensity is linear
/// in space, however the frames are tilted.
class FramePair
{
public:
  FramePair(const FrameInSpace& a, const FrameInSpace& b) : a_(a), b_(b)
  {
    const Eigen::Vector3d na = a.Plane().Normal(), nb = b.Plane().Normal();
    direction_ = (na.dot(nb) < 0 ? Eigen::Vector3d(na - nb) : Eigen::Vector3d(na + nb)).normalized();
    alongA_ = a.Direction(direction_);
    alongB_ = b.Direction(direction_);
  }

  /// The mean of the normals, of length 1.
  const Eigen::Vector3d& Direction() const { return direction_; }

  /// Where the line through a point meets the two planes.
  struct Feet
  {
    Eigen::Vector3d a, b;  // (i, j, 0) on each
    double toA, toB;       // mm along the line, signed
    bool inA, inB;         // whether that is inside the image
    double Gap() const { return std::abs(toA) + std::abs(toB); }
  };

  Feet Find(const Eigen::Vector3d& point) const
  {
    Feet feet;
    const Eigen::Vector3d p = a_.Project(point), q = b_.Project(point);
    feet.toA = -p[2] / alongA_[2];
    feet.toB = -q[2] / alongB_[2];
    feet.a = p + feet.toA * alongA_;
    feet.b = q + feet.toB * alongB_;
    feet.inA = a_.Contains(feet.a);
    feet.inB = b_.Contains(feet.b);
    return feet;
  }

  double Mix(const Feet& feet) const
  {
    if (!feet.inA || !feet.inB)
    {
      return feet.inA ? a_.Sample(feet.a) : feet.inB ? b_.Sample(feet.b) : 0.0;
    }
    const double share = feet.Gap() > 0 ? std::abs(feet.toA) / feet.Gap() : 0.5;
    return (1 - share) * a_.Sample(feet.a) + share * b_.Sample(feet.b);
  }

private:
  FrameInSpace a_, b_;
  Eigen::Vector3d direction_;
  Eigen::Vector3d alongA_, alongB_;  // 1 mm along the line, in each frame's (i, j, z)
};

/// The training frames next to index `frame`, none where there is none.
std::pair<int, int> Neighbours(const std::vector<int>& training, int frame)
{
  const auto after = std::upper_bound(training.begin(), training.end(), frame);
  const auto before = std::lower_bound(training.begin(), training.end(), frame);
  return {before == training.begin() ? none : *(before - 1), after == training.end() ? none : *after};
}

template <class Function>
void ForEachPixel(const SlicePlane& plane, float* image, Function intensity)
{
  tbb::parallel_for(0, plane.height,
                    [&](int j)
                    {
                      for (int i = 0; i < plane.width; ++i)
                      {
                        image[static_cast<std::size_t>(j) * plane.width + i] =
                            static_cast<float>(intensity(plane.Point(i, j)));
                      }
                    });
}

}  // namespace

void PredictNearest(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane, float* image)
{
  CheckTraining(sweep, training);
  if (plane.width != sweep.width || plane.height != sweep.height)
  {
    throw Error("Nearest frame: the plane has " + std::to_string(plane.width) + " x " + std::to_string(plane.height) +
                " pixels, but the frames have " + std::to_string(sweep.width) + " x " + std::to_string(sweep.height) +
                "; a frame can only be copied pixel for pixel.");
  }
  int nearest = none;
  double smallest = std::numeric_limits<double>::infinity();
  for (int frame : training)
  {
    const SlicePlane other = sweep.Plane(frame);
    double squares = 0;
    for (int corner = 0; corner < 4; ++corner)
    {
      const double i = corner % 2 * (plane.width - 1.0), j = corner / 2 * (plane.height - 1.0);
      squares += (other.Point(i, j) - plane.Point(i, j)).squaredNorm();
    }
    if (nearest == none || squares < smallest)
    {
      smallest = squares;
      nearest = frame;
    }
  }
  sweep.CopyFrame(nearest, image);
}

void PredictNeighbourAverage(const Sweep& sweep, const std::vector<int>& training, int frame, float* image)
{
  CheckTraining(sweep, training);
  const auto [before, after] = Neighbours(training, frame);
  sweep.CopyFrame(before == none ? after : before, image);
  if (before != none && after != none)
  {
    std::vector<float> other(sweep.PixelsPerFrame());
    sweep.CopyFrame(after, other.data());
    std::transform(other.begin(), other.end(), image, image, [](float a, float b) { return 0.5f * (a + b); });
  }
}

void PredictPoseInterpolation(const Sweep& sweep, const std::vector<int>& training, int frame, float* image,
                              PixelInterpolation sampling)
{
  CheckTraining(sweep, training);
  const auto [before, after] = Neighbours(training, frame);
  const FramePair pair(FrameInSpace(sweep, before == none ? after : before, sampling),
                       FrameInSpace(sweep, after == none ? before : after, sampling));
  ForEachPixel(sweep.Plane(frame), image, [&](const Eigen::Vector3d& x) { return pair.Mix(pair.Find(x)); });
}

void PredictPoseInterpolation(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane,
                              float* image, PixelInterpolation sampling)
{
  CheckTraining(sweep, training);
  std::vector<FrameInSpace> frames;
  std::vector<FramePair> pairs;          // pairs[k] are frames k and k + 1
  std::vector<Eigen::Vector3d> normals;  // all to the same side
  for (int frame : training)
  {
    frames.emplace_back(sweep, frame, sampling);
    Eigen::Vector3d normal = frames.back().Plane().Normal();
    if (!normals.empty())
    {
      pairs.emplace_back(frames[frames.size() - 2], frames.back());
      normal *= normal.dot(normals.back()) < 0 ? -1.0 : 1.0;
    }
    normals.push_back(normal);
  }
  ForEachPixel(plane, image,
               [&](const Eigen::Vector3d& x)
               {
                 double smallest = std::numeric_limits<double>::infinity();
                 double intensity = 0;
                 double before = 0;  // signed distance from the frame before
                 for (std::size_t k = 0; k < frames.size(); ++k)
                 {
                   const double distance = normals[k].dot(x - frames[k].Plane().origin);
                   const double gap = std::abs(before) + std::abs(distance);
                   if (k > 0 && before * distance <= 0 && gap < smallest)
                   {
                     const FramePair::Feet feet = pairs[k - 1].Find(x);
                     if (feet.inA || feet.inB)
                     {
                       smallest = gap;
                       intensity = pairs[k - 1].Mix(feet);
                     }
                   }
                   before = distance;
                 }
                 if (std::isfinite(smallest))
                 {
                   return intensity;
                 }
                 for (const FrameInSpace& frame : frames)
                 {
                   const Eigen::Vector3d p = frame.Project(x);
                   if (std::abs(p[2]) < smallest && frame.Contains(p))
                   {
                     smallest = std::abs(p[2]);
                     intensity = frame.Sample(p);
                   }
                 }
                 return intensity;
               });
}

void PredictCubicInterpolation(const Sweep& sweep, const std::vector<int>& training, int frame, float* image)
{
  CheckTraining(sweep, training);
  const auto [before, after] = Neighbours(training, frame);
  if (before == none || after == none)
  {
    PredictPoseInterpolation(sweep, training, frame, image, PixelInterpolation::Cubic);
    return;
  }
  const auto inSpace = [&](int index) { return FrameInSpace(sweep, index, PixelInterpolation::Cubic); };
  const FrameInSpace a = inSpace(before), b = inSpace(after);
  const FramePair pair(a, b);
  const int first = Neighbours(training, before).first, last = Neighbours(training, after).second;
  const std::optional<FrameInSpace> outerA = first == none ? std::nullopt : std::optional(inSpace(first));
  const std::optional<FrameInSpace> outerB = last == none ? std::nullopt : std::optional(inSpace(last));

  // Where the line through x along `direction` meets a frame.
  struct Knot
  {
    double t = 0, value = 0;  // mm along the line; intensity there
    bool seen = false;
  };
  const Eigen::Vector3d direction = pair.Direction();
  const auto meet = [&direction](const FrameInSpace& plane, const Eigen::Vector3d& x)
  {
    const Eigen::Vector3d along = plane.Direction(direction);
    const Eigen::Vector3d p = plane.Project(x);
    const double t = -p[2] / along[2];
    const Eigen::Vector3d foot = p + t * along;
    return plane.Contains(foot) ? Knot{t, plane.Sample(foot), true} : Knot{};
  };
  // The derivative at `at` of the parabola through three knots; the middle one's neighbours lie on its two
  // sides.
  const auto slope = [](const Knot& from, const Knot& at, const Knot& to)
  {
    const double h = at.t - from.t, k = to.t - at.t;
    return ((at.value - from.value) * k / h + (to.value - at.value) * h / k) / (h + k);
  };
  ForEachPixel(sweep.Plane(frame), image,
               [&](const Eigen::Vector3d& x)
               {
                 const Knot knotA = meet(a, x), knotB = meet(b, x);
                 const double gap = knotB.t - knotA.t;
                 const double share = -knotA.t / gap;  // of the way from a to b
                 if (!knotA.seen || !knotB.seen || !(share >= 0 && share <= 1))
                 {
                   return pair.Mix(pair.Find(x));
                 }
                 const double chord = (knotB.value - knotA.value) / gap;
                 double slopeA = chord, slopeB = chord;
                 if (outerA)
                 {
                   const Knot outer = meet(*outerA, x);
                   slopeA = outer.seen && (knotA.t - outer.t) * gap > 0 ? slope(outer, knotA, knotB) : chord;
                 }
                 if (outerB)
                 {
                   const Knot outer = meet(*outerB, x);
                   slopeB = outer.seen && (outer.t - knotB.t) * gap > 0 ? slope(knotA, knotB, outer) : chord;
                 }
                 // Cubic Hermite.
                 const double s = share, r = 1 - share;
                 const double value = r * r * (1 + 2 * s) * knotA.value + s * s * (1 + 2 * r) * knotB.value +
                                      gap * s * r * (r * slopeA - s * slopeB);
                 return std::clamp(value, 0.0, 1.0);
               });
}

namespace
{

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

  /// In double: sizes of hostile poses fit no integer. One voxel more than the floor, and one for the
  /// trilinear corner.
  Eigen::Vector3d Voxels(double size) const { return ((highest - lowest) / size).array().floor() + 2; }
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
    voxelSize_ = std::max(geometry.pixelSize, std::sqrt(geometry.pixelSize * geometry.medianSpacing));
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
  // As far as half the widest gap between neighbouring planes (a break in the sweep is no gap), at least
  // three voxels.
  const double gap = std::min(geometry.largestSpacing, 4 * geometry.medianSpacing);
  constexpr double atMost = 64;
  FillHoles(Paste(sweep, training), static_cast<int>(std::clamp(std::ceil(0.5 * gap / voxelSize_), 3.0, atMost)));
}

/// Which voxels got a value. Each thread owns a slab of layers, whose voxels add up pixels in order of frame
/// and row.
std::vector<unsigned char> Compounding::Paste(const Sweep& sweep, const std::vector<int>& training)
{
  struct Frame
  {
    FrameInSpace pixels;
    Eigen::Vector3d origin, columnStep, rowStep;  // in voxels
  };
  std::vector<Frame> frames;
  for (int frame : training)
  {
    const SlicePlane plane = sweep.Plane(frame);
    frames.push_back({FrameInSpace(sweep, frame), (plane.origin - origin_) / voxelSize_, plane.columnStep / voxelSize_,
                      plane.rowStep / voxelSize_});
  }
  std::vector<unsigned char> filled(voxels_.size(), 0);
  const std::size_t layer = static_cast<std::size_t>(size_[0]) * size_[1];
  const int layers = static_cast<int>(std::clamp<std::size_t>((std::size_t(1) << 20) / layer, 1, size_[2]));
  const int slabs = (size_[2] + layers - 1) / layers;
  tbb::parallel_for(
      0, slabs,
      [&](int slab)
      {
        const int begin = slab * layers;
        const int end = std::min(begin + layers, size_[2]);
        struct Accumulator
        {
          double sum = 0, weight = 0;
        };
        std::vector<Accumulator> accumulators(layer * (end - begin));
        for (const Frame& frame : frames)
        {
          for (int j = 0; j < sweep.height; ++j)
          {
            // Pixels that touch the slab are those with begin - 1 < z < end: an interval of the row, found a
            // pixel too wide on either side.
            const Eigen::Vector3d start = frame.origin + j * frame.rowStep;
            double first = 0, last = sweep.width - 1.0;
            const double dz = frame.columnStep[2];
            if (dz != 0)
            {
              const double low = (begin - 1 - start[2]) / dz, high = (end - start[2]) / dz;
              first = std::max(first, std::floor(std::min(low, high)) - 1);
              last = std::min(last, std::ceil(std::max(low, high)) + 1);
            }
            else if (start[2] <= begin - 1 || start[2] >= end)
            {
              continue;
            }
            for (int i = static_cast<int>(std::min<double>(first, sweep.width)); i <= last; ++i)
            {
              // The frames' own bounds made the grid: rounding alone can leave it.
              const Eigen::Vector3d p = (start + i * frame.columnStep).cwiseMax(0.0);
              const int x = std::min(static_cast<int>(p[0]), size_[0] - 2);
              const int y = std::min(static_cast<int>(p[1]), size_[1] - 2);
              const int z = std::min(static_cast<int>(p[2]), size_[2] - 2);
              if (z + 1 < begin || z >= end)
              {
                continue;
              }
              const double value = frame.pixels.Pixel(i, j);
              const double fx = p[0] - x, fy = p[1] - y, fz = p[2] - z;
              for (int dz01 = 0; dz01 < 2; ++dz01)
              {
                if (z + dz01 < begin || z + dz01 >= end)
                {
                  continue;
                }
                const double wz = dz01 ? fz : 1 - fz;
                Accumulator* row =
                    &accumulators[(static_cast<std::size_t>(z + dz01 - begin) * size_[1] + y) * size_[0] + x];
                const auto add = [value](Accumulator& to, double weight)
                {
                  to.sum += weight * value;
                  to.weight += weight;
                };
                add(row[0], wz * (1 - fy) * (1 - fx));
                add(row[1], wz * (1 - fy) * fx);
                add(row[size_[0]], wz * fy * (1 - fx));
                add(row[size_[0] + 1], wz * fy * fx);
              }
            }
          }
        }
        for (std::size_t k = 0; k < accumulators.size(); ++k)
        {
          if (accumulators[k].weight > 1e-6)
          {
            filled[layer * begin + k] = 1;
            voxels_[layer * begin + k] = static_cast<float>(accumulators[k].sum / accumulators[k].weight);
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
                 const Eigen::Vector3d p = (point - origin_) / voxelSize_;
                 if (!((p.array() >= 0).all() && (p.array() <= last.array()).all()))
                 {
                   return 0.0;
                 }
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
