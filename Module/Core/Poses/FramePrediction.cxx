// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/FramePrediction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace bigus
{
namespace
{

constexpr int kEdge = 3;  // pixels inside the lit area that a picture's edge must not reach

/// What a frame's plane meets along a direction: pixel i, j of the other plane and the distance to it, all of them
/// linear in the frame's own pixel.
struct Meeting
{
  Eigen::Vector3d first, perColumn, perRow;
};
Meeting Meet(const SlicePlane& plane, const Eigen::Vector3d& direction, const SlicePlane& other)
{
  const Eigen::Matrix3d t = other.WorldToSlice();
  const Eigen::Vector3d d = t * direction;
  const auto along = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d
  {
    const double steps = -v[2] / d[2];
    return {v[0] + steps * d[0], v[1] + steps * d[1], steps};
  };
  return {along(t * (plane.origin - other.origin)), along(t * plane.columnStep), along(t * plane.rowStep)};
}

}  // namespace

FramePictures PicturesOf(const Sweep& sweep, const std::vector<int>& frames)
{
  FramePictures pictures;
  pictures.reduction =
      static_cast<int>(std::ceil(std::sqrt(static_cast<double>(sweep.PixelsPerFrame()) / kPicturePixels) - 1e-9));
  const Sweep small = sweep.ReducedOf(frames, std::min({pictures.reduction, sweep.width, sweep.height}));
  std::vector<int> all(frames.size());
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    all[k] = static_cast<int>(k);
    cv::Mat picture(small.height, small.width, CV_32F);
    small.CopyFrame(all[k], picture.ptr<float>());
    pictures.frames.push_back(picture);
  }
  const Sweep lit = small.LitBy(all);
  cv::Mat mask(small.height, small.width, CV_8U);
  for (std::size_t p = 0; p < small.PixelsPerFrame(); ++p)
  {
    mask.data[p] = lit.IsLit(p) ? 1 : 0;
  }
  const int side = 2 * kEdge + 1;
  cv::erode(mask, pictures.inner, cv::Mat::ones(side, side, CV_8U), cv::Point(-1, -1), 1, cv::BORDER_CONSTANT,
            cv::Scalar(0));
  pictures.pixels = cv::countNonZero(pictures.inner);
  return pictures;
}

SlicePlane PicturePlane(const Sweep& sweep, const Eigen::Matrix4d& pose, int reduction)
{
  SlicePlane plane = SlicePlane::FromImageToReference(pose, sweep.width / reduction, sweep.height / reduction);
  plane.origin = plane.Point(0.5 * (reduction - 1), 0.5 * (reduction - 1));
  plane.columnStep *= reduction;
  plane.rowStep *= reduction;
  return plane;
}

cv::Mat PredictPicture(const cv::Mat& inner, const SlicePlane& plane, const SlicePlane& beforePlane,
                       const cv::Mat& before, const SlicePlane& afterPlane, const cv::Mat& after)
{
  Eigen::Vector3d direction = beforePlane.Normal() + afterPlane.Normal();
  if (!(direction.norm() > 0.1))
  {
    direction = beforePlane.Normal();
  }
  direction.normalize();
  const std::array<Meeting, 2> meetings = {Meet(plane, direction, beforePlane), Meet(plane, direction, afterPlane)};
  const std::array<const cv::Mat*, 2> sources = {&before, &after};
  cv::Mat predicted(inner.size(), CV_32F, cv::Scalar(std::numeric_limits<float>::quiet_NaN()));
  for (int y = 0; y < inner.rows; ++y)
  {
    for (int x = 0; x < inner.cols; ++x)
    {
      if (!inner.at<unsigned char>(y, x))
      {
        continue;
      }
      std::array<double, 2> value{}, distance{};
      bool seen = true;
      for (int side = 0; side < 2 && seen; ++side)
      {
        const Eigen::Vector3d at = meetings[side].first + x * meetings[side].perColumn + y * meetings[side].perRow;
        seen = at[0] >= 0 && at[1] >= 0 && at[0] < inner.cols - 1 && at[1] < inner.rows - 1;
        if (!seen)
        {
          break;
        }
        const int i = static_cast<int>(at[0]), j = static_cast<int>(at[1]);
        const double u = at[0] - i, v = at[1] - j;
        seen = inner.at<unsigned char>(j, i) != 0 && inner.at<unsigned char>(j + 1, i + 1) != 0;
        const float* upper = sources[side]->ptr<float>(j) + i;
        const float* lower = sources[side]->ptr<float>(j + 1) + i;
        value[side] = (1 - v) * ((1 - u) * upper[0] + u * upper[1]) + v * ((1 - u) * lower[0] + u * lower[1]);
        distance[side] = std::abs(at[2]);
      }
      if (seen)
      {
        const double sum = distance[0] + distance[1], share = sum > 0 ? distance[0] / sum : 0.5;
        predicted.at<float>(y, x) = static_cast<float>((1 - share) * value[0] + share * value[1]);
      }
    }
  }
  return predicted;
}

}  // namespace bigus
