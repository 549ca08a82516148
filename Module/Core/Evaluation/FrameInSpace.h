// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the baselines share: a frame as a function in space, and pixels one after another. Private to Core.
#pragma once

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "Core/Evaluation/Baselines.h"
#include "Core/Model/Error.h"

namespace bigus
{

constexpr int kNoFrame = -1;

/// Checks what every predictor relies on.
inline void CheckTraining(const Sweep& sweep, const std::vector<int>& training)
{
  Require(!training.empty(), "Baselines: there is no training frame to predict from.");
  for (std::size_t k = 0; k < training.size(); ++k)
  {
    if (training[k] < 0 || training[k] >= sweep.NumberOfFrames() || (k > 0 && training[k] <= training[k - 1]))
    {
      throw Error("Baselines: training frame " + std::to_string(training[k]) + " is out of order or not one of the " +
                  std::to_string(sweep.NumberOfFrames()) + " frames.");
    }
  }
}

/// Weights of the pixels at -1, 0, 1, 2 for a point at t, 0 to 1, between the middle two: Keys' cubic convolution
/// (1981) with a = -1/2.
inline std::array<double, 4> KeysWeights(double t)
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

}  // namespace bigus
