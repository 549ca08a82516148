// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Small pictures of frames, and what two frames predict of a plane between them. Private to Core.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// Some frames of a sweep, reduced to at most `most` pixels each.
struct FramePictures
{
  std::vector<cv::Mat> frames;  // of CV_32F
  cv::Mat inner;                // CV_8U: 1 where lit, away from what is not
  int reduction = 1;
  double pixels = 0;  // of the inner area
};

/// Pictures of 40,000 pixels hold what is 1/100 of the image wide, and larger.
constexpr double kPicturePixels = 4e4;

FramePictures PicturesOf(const Sweep& sweep, const std::vector<int>& frames);

/// The plane of a picture of the frame at `pose`.
SlicePlane PicturePlane(const Sweep& sweep, const Eigen::Matrix4d& pose, int reduction);

/// What two pictures at their planes say of a third plane, pixel by pixel along their mean normal and linear in
/// distance; NaN where one of them shows nothing or the edge is near. CV_32F.
cv::Mat PredictPicture(const cv::Mat& inner, const SlicePlane& plane, const SlicePlane& beforePlane,
                       const cv::Mat& before, const SlicePlane& afterPlane, const cv::Mat& after);

}  // namespace bigus
