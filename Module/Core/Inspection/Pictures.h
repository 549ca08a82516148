// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Frames made small, to be compared with each other.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// A quarter of a picture's width, in which a probe may have lost the skin alone. Each overlaps the next by half. Depth begins
/// where a column is lit in some frame.
struct Band
{
  double near =
      0;  ///< mean grey level from an eighth of the height down to a fourth: a shadow begins below what throws it
  double deep = 0;  ///< and from there on
  double roughness = 0;
};
constexpr std::size_t kBands = 7;

/// Grey levels of 255 throughout.
struct Pictures
{
  int width = 0, height = 0;
  std::vector<std::vector<float>> small;  ///< [frames][height * width], means of square blocks
  std::vector<double> brightness;         ///< [frames] mean below the first quarter of the depth, where nothing rings
  /// [frames] mean square difference of neighbouring columns over that of pixels and the mean of 9 x 9 around them: 2 for
  /// white noise, 0.1 to 1 for speckle, and 0 for a black frame. Of the second quarter of the depth.
  std::vector<double> roughness;
  std::vector<std::array<Band, kBands>> bands;  ///< [frames]
  std::vector<double>
      change;  ///< [frames] root mean square difference to the frame before, pixel by pixel; 0 of the first
};

/// `frames` in the order in which they are compared.
Pictures MakePictures(const Sweep& sweep, const std::vector<int>& frames);

/// What grey levels a sweep has, by some of its frames.
struct GreyLevels
{
  /// Level of 255 that no more than one of a hundred thousand pixels exceeds, of dark ones to 1/65535 of the brightest; 0:
  /// all are black.
  double brightest = 0;
  double white = 0;  ///< share of 254 and 255 of what is not black

  bool IsDim() const;        ///< pixels may have fewer bits than their type
  bool IsSaturated() const;  ///< white hides what is there
};
GreyLevels SurveyLevels(const Sweep& sweep, const std::vector<int>& frames);

/// The sweep with its brightest pixels white, so that grey levels are worth what they are in other sweeps.
Sweep Brightened(const Sweep& sweep, const GreyLevels& levels);

/// A frame in full size, in grey levels; CV_8U.
cv::Mat LevelsOf(const Sweep& sweep, int frame);

/// A small picture, its pixels shared; CV_32F.
cv::Mat ImageOf(const Pictures& pictures, std::size_t k);

/// Cosine of the angle between two pictures as vectors; 0 where one is 0.
double Correlation(const cv::Mat& a, const cv::Mat& b);

/// Correlation of what a band of two pictures shows below the first eighth of the depth; 0 where one is flat.
double AlikeIn(std::size_t band, const Pictures& pictures, std::size_t a, std::size_t b);

/// Root mean square difference of two small pictures.
double Difference(const Pictures& pictures, std::size_t a, std::size_t b);

/// Root mean square difference that two pictures would have whose speckle has nothing in common, were both like this one:
/// sqrt(2) times what is left without the mean of 5 x 5 around each pixel.
double UnrelatedDifference(const Pictures& pictures, std::size_t k);

}  // namespace bigus
