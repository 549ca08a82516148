// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/FramePrediction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace bigus
{
namespace
{

constexpr int kEdge = 3;  // pixels inside the lit area that a picture's edge must not reach

/// What a plane meets along a direction in a picture: its pixel i, j and the distance to it, linear in the plane's own pixel.
struct Meeting
{
  std::vector<Eigen::Vector3d> columns;  // of the plane's first row
  Eigen::Vector3d perRow;
  const cv::Mat& picture;
};
Meeting Meet(const SlicePlane& plane, const Eigen::Vector3d& direction, const SlicePlane& other, const cv::Mat& picture)
{
  const Eigen::Matrix3d t = other.WorldToSlice();
  const Eigen::Vector3d d = t * direction;
  const auto along = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d
  {
    const double steps = -v[2] / d[2];
    return {v[0] + steps * d[0], v[1] + steps * d[1], steps};
  };
  const Eigen::Vector3d first = along(t * (plane.origin - other.origin)), perColumn = along(t * plane.columnStep);
  std::vector<Eigen::Vector3d> columns;
  for (int x = 0; x < picture.cols; ++x)
  {
    columns.emplace_back(first + x * perColumn);
  }
  return {std::move(columns), along(t * plane.rowStep), picture};
}

/// What the picture shows where pixel (x, y) meets it, and how far that is; false where it shows nothing or the edge is near.
/// `reach`: the largest pixel numbers.
bool Look(const Meeting& meeting, const cv::Mat& inner, int x, const Eigen::Vector3d& row, const Eigen::Vector2d& reach,
          double& value, double& distance)
{
  const Eigen::Vector3d at = meeting.columns[x] + row;
  if (!(at[0] >= 0 && at[1] >= 0 && at[0] < reach[0] && at[1] < reach[1]))
  {
    return false;
  }
  const int i = static_cast<int>(at[0]), j = static_cast<int>(at[1]);
  if (!inner.ptr(j)[i] || !inner.ptr(j + 1)[i + 1])
  {
    return false;
  }
  const double u = at[0] - i, v = at[1] - j;
  const float* upper = meeting.picture.ptr<float>(j) + i;
  const float* lower = meeting.picture.ptr<float>(j + 1) + i;
  value = (1 - v) * ((1 - u) * upper[0] + u * upper[1]) + v * ((1 - u) * lower[0] + u * lower[1]);
  distance = std::abs(at[2]);
  return true;
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
  const Meeting one = Meet(plane, direction, beforePlane, before), other = Meet(plane, direction, afterPlane, after);
  const Eigen::Vector2d reach(inner.cols - 1, inner.rows - 1);
  cv::Mat predicted(inner.size(), CV_32F, cv::Scalar(std::numeric_limits<float>::quiet_NaN()));
  for (int y = 0; y < inner.rows; ++y)
  {
    const unsigned char* const isInner = inner.ptr(y);
    float* const out = predicted.ptr<float>(y);
    const Eigen::Vector3d rowOfOne = y * one.perRow, rowOfOther = y * other.perRow;
    for (int x = 0; x < inner.cols; ++x)
    {
      double a = 0, b = 0, farA = 0, farB = 0;
      if (isInner[x] && Look(one, inner, x, rowOfOne, reach, a, farA) &&
          Look(other, inner, x, rowOfOther, reach, b, farB))
      {
        const double sum = farA + farB, share = sum > 0 ? farA / sum : 0.5;
        out[x] = static_cast<float>((1 - share) * a + share * b);
      }
    }
  }
  return predicted;
}

}  // namespace bigus
