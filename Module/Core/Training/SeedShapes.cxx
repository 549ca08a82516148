// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/SeedShapes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "Core/Model/Sequences.h"

namespace bigus
{
namespace
{

/// The surroundings of a seed, as a Gaussian: its standard deviation in usual in-plane scales of seeds. Half of it is
/// what frames are smoothed by before they are differentiated. On the liver sweep 0.6 gives 0.05 dB more after 10 passes
/// than 1 and 0.1 dB more than 1.6.
constexpr double kSurroundings = 0.6;
constexpr double kBeforeGradient = 0.5;

/// The longest axis over the shortest: seeds are to be moved, and a needle sees little. Between 3 and 6 nothing changes.
constexpr double kMostStretch = 4;

/// Gradients below this (intensity a scale, squared) are rounding.
constexpr double kFlat = 1e-12;

/// Sobel's derivative over 3 pixels divided by the sum of its weights: per pixel.
constexpr double kSobel = 1.0 / 8;

/// Frames of a row that one thread looks at: each is smoothed once, and so are the two beside the row.
constexpr std::size_t kRow = 16;

/// How frames are looked at: what is averaged over two pixels and more needs no more pixels than that.
struct Looking
{
  int reduction;  ///< pixels of the frame to one of the pictures, along each side
  double sigma;   ///< of the surroundings, in pixels of the pictures

  explicit Looking(double surroundings)
      : reduction(std::max(1, static_cast<int>(surroundings))), sigma(surroundings / reduction)
  {
  }

  cv::Mat Smoothed(const Sweep& sweep, int frame) const
  {
    std::vector<float> image(sweep.PixelsPerFrame());
    sweep.CopyFrame(frame, image.data());
    const cv::Mat whole(sweep.height, sweep.width, CV_32F, image.data());
    cv::Mat small, smooth;
    const cv::Size size((sweep.width + reduction - 1) / reduction, (sweep.height + reduction - 1) / reduction);
    cv::resize(whole, small, size, 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(small, smooth, cv::Size(), kBeforeGradient * sigma);
    return smooth;
  }
};

/// Products of a frame's derivatives, averaged over the surroundings of every pixel of a smaller picture.
struct StructureTensor
{
  cv::Mat xx, xy, yy, xz, yz, zz;

  /// `before` and `after` lie `apart` frames apart; they may be the frame itself.
  StructureTensor(const cv::Mat& here, const cv::Mat& before, const cv::Mat& after, std::size_t apart,
                  const Looking& looking)
  {
    const auto averaged = [&looking](const cv::Mat& product)
    {
      cv::Mat mean;
      cv::GaussianBlur(product, mean, cv::Size(), looking.sigma);
      return mean;
    };
    cv::Mat dx, dy, dz = cv::Mat::zeros(here.size(), CV_32F);
    cv::Sobel(here, dx, CV_32F, 1, 0, 3, kSobel / looking.reduction);
    cv::Sobel(here, dy, CV_32F, 0, 1, 3, kSobel / looking.reduction);
    if (apart > 0)
    {
      dz = (after - before) / static_cast<double>(apart);
    }
    xx = averaged(dx.mul(dx));
    xy = averaged(dx.mul(dy));
    yy = averaged(dy.mul(dy));
    xz = averaged(dx.mul(dz));
    yz = averaged(dy.mul(dz));
    zz = averaged(dz.mul(dz));
  }
};

/// V diag(1 / l) V^T over the cube root of its determinant.
Eigen::Matrix3d Stretch(const Eigen::Matrix3d& tensor)
{
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(tensor);
  const double least = std::max(solver.eigenvalues()[2] / (kMostStretch * kMostStretch), kFlat);  // they ascend
  Eigen::Vector3d variances = solver.eigenvalues().cwiseMax(least).cwiseInverse();
  variances /= std::cbrt(variances.prod());
  return solver.eigenvectors() * variances.asDiagonal() * solver.eigenvectors().transpose();
}

struct Shaper
{
  const Sweep& sweep;
  const std::vector<int>& frames;
  const SeedPlaces& places;
  double reach;
  Looking looking;
  GaussianField& field;

  void ShapeFrame(std::size_t f, const StructureTensor& structure)
  {
    const double pixel = sweep.Plane(frames[f]).columnStep.norm();
    for (std::size_t k = places.first[f]; k < places.first[f + 1]; ++k)
    {
      const int x = places.pixels[k].x() / looking.reduction, y = places.pixels[k].y() / looking.reduction;
      const auto at = [x, y](const cv::Mat& picture) { return static_cast<double>(picture.at<float>(y, x)); };
      Eigen::Matrix3d tensor;
      tensor << at(structure.xx), at(structure.xy), at(structure.xz), at(structure.xy), at(structure.yy),
          at(structure.yz), at(structure.xz), at(structure.yz), at(structure.zz);
      const double scale = field.scales[k][0] / pixel;
      const Eigen::Vector3d units(scale, scale, reach);
      const Eigen::Matrix3d stretch = Stretch(units.asDiagonal() * tensor * units.asDiagonal());
      const Eigen::Matrix3d covariance = field.scales[k].asDiagonal() * stretch * field.scales[k].asDiagonal();
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
      Eigen::Matrix3d axes = solver.eigenvectors();
      if (axes.determinant() < 0)
      {
        axes.col(0) = -axes.col(0);
      }
      field.scales[k] = solver.eigenvalues().cwiseMax(0).cwiseSqrt().cwiseMax(GaussianField::kSmallestScale);
      field.rotations[k] = Quaternion(RotationMatrix(field.rotations[k]) * axes);
    }
  }

  /// Frames at places [begin, end), each smoothed once.
  void ShapeFrames(std::size_t begin, std::size_t end)
  {
    cv::Mat before, here, after;  // empty: not smoothed
    for (std::size_t f = begin; f < end; ++f)
    {
      const Neighbours around = NeighboursOf(sweep, frames, frames[f]);
      const bool hasBefore = around.before.has_value(), hasAfter = around.after.has_value();
      if (here.empty())
      {
        here = looking.Smoothed(sweep, frames[f]);
      }
      if (hasBefore && before.empty())
      {
        before = looking.Smoothed(sweep, *around.before);
      }
      if (hasAfter)
      {
        after = looking.Smoothed(sweep, *around.after);
      }
      if (places.first[f] < places.first[f + 1])
      {
        ShapeFrame(f, StructureTensor(here, hasBefore ? before : here, hasAfter ? after : here,
                                      std::size_t(hasBefore) + hasAfter, looking));
      }
      before = here;
      here = hasAfter ? after : cv::Mat();
    }
  }
};

}  // namespace

void ShapeSeeds(const Sweep& sweep, const std::vector<int>& frames, const SeedPlaces& places, double reach,
                GaussianField& field)
{
  double sum = 0;
  for (std::size_t f = 0; f < frames.size(); ++f)
  {
    const double pixel = sweep.Plane(frames[f]).columnStep.norm();
    for (std::size_t k = places.first[f]; k < places.first[f + 1]; ++k)
    {
      sum += field.scales[k][0] / pixel;
    }
  }
  // At least what a derivative needs.
  const double surroundings =
      std::max(1.0, kSurroundings * sum / static_cast<double>(std::max<std::size_t>(1, field.Size())));
  Shaper shaper{sweep, frames, places, reach, Looking(surroundings), field};
  tbb::parallel_for(std::size_t(0), (frames.size() + kRow - 1) / kRow,
                    [&](std::size_t row)
                    { shaper.ShapeFrames(row * kRow, std::min((row + 1) * kRow, frames.size())); });
}

}  // namespace bigus
