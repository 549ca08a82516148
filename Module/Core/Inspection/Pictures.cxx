// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Inspection/Pictures.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "Core/Model/PixelMemory.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

/// Pixels: the longer side of small pictures at the most. Blocks average noise, and are not larger than grains of speckle
/// by far (480 pixels: 10).
constexpr int kSmallSide = 48;

constexpr float kLevels = 255;
// Pixels: of 256 the roughness wavers by a tenth, so that speckle's 1.2 is not noise's 2; of 64 by a fifth.
constexpr std::size_t kFewestOfRoughness = 256;
constexpr float kLit = 4;  // grey levels of a small picture: less is black that was compressed

constexpr std::size_t kLookedAt = 24;  // frames
constexpr double kMostWhite = 0.1;     // of the pixels that are not black
constexpr double kDimmest = 0.15;      // of white

cv::Mat WithoutMean(const cv::Mat& image, int window)
{
  cv::Mat mean;
  // Isolated: of a part of a picture, what is beside it has no part in the mean.
  cv::blur(image, mean, {window, window}, {-1, -1}, cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED);
  return image - mean;
}

double MeanSquareOf(const cv::Mat& image)
{
  return image.empty() ? 0 : image.dot(image) / static_cast<double>(image.total());
}

/// Root mean square difference of two frames' pixels in units of theirs.
template <class Pixel, class Sum>
double ChangeBetween(const Pixel* a, const Pixel* b, std::size_t rows, std::size_t columns)
{
  double squares = 0;
  for (std::size_t y = 0; y < rows; ++y, a += columns, b += columns)
  {
    Sum row = 0;
    for (std::size_t x = 0; x < columns; ++x)
    {
      const Sum difference = Sum(a[x]) - Sum(b[x]);
      row += difference * difference;
    }
    squares += static_cast<double>(row);
  }
  return std::sqrt(squares / static_cast<double>(rows * columns));
}

double ChangeBetween(const Sweep& sweep, int from, int to)
{
  const std::size_t rows = sweep.height, columns = sweep.width, one = from * rows * columns,
                    other = to * rows * columns;
  if (sweep.pixelType == Sweep::PixelType::UInt8)
  {
    const auto* pixels = static_cast<const std::uint8_t*>(sweep.pixels.get());
    return ChangeBetween<std::uint8_t, std::int64_t>(pixels + one, pixels + other, rows, columns);
  }
  const auto* pixels = static_cast<const float*>(sweep.pixels.get());
  return kLevels * ChangeBetween<float, double>(pixels + one, pixels + other, rows, columns);
}

/// 0 of fewer than kFewestOfRoughness pixels.
double Roughness(const cv::Mat& image)
{
  if (image.total() < kFewestOfRoughness)
  {
    return 0;
  }
  const double spread = MeanSquareOf(WithoutMean(image, 9));
  return spread > 0 && image.cols > 1
             ? MeanSquareOf(image.colRange(1, image.cols) - image.colRange(0, image.cols - 1)) / spread
             : 0;
}

/// The columns of a band, and rows from `first` to `last`, of an image with as many columns as halves of bands, or more.
cv::Mat PartOf(const cv::Mat& image, std::size_t band, int first, int last)
{
  const int half = static_cast<int>(kBands) + 1;
  const int from = static_cast<int>(band) * image.cols / half, to = static_cast<int>(band + 2) * image.cols / half;
  return image(cv::Range(first, std::max(last, first + 1)), cv::Range(from, to));
}

/// The first row of every column of small pictures in which some frame is lit; the height where none is.
std::vector<int> TopsOf(const Pictures& pictures)
{
  std::vector<int> tops(pictures.width, pictures.height);
  for (const std::vector<float>& small : pictures.small)
  {
    for (int x = 0; x < pictures.width; ++x)
    {
      for (int y = 0; y < tops[x]; ++y)
      {
        if (small[static_cast<std::size_t>(y) * pictures.width + x] > kLit)
        {
          tops[x] = y;
        }
      }
    }
  }
  return tops;
}

/// Mean of the pixels of a band that lie from `first` to `last` rows below the top of their column; 0 of none.
double MeanBelow(const Pictures& pictures, const std::vector<int>& tops, std::size_t k, std::size_t band, int first,
                 int last)
{
  const int half = static_cast<int>(kBands) + 1;
  double sum = 0;
  int count = 0;
  for (int x = static_cast<int>(band) * pictures.width / half; x < static_cast<int>(band + 2) * pictures.width / half;
       ++x)
  {
    for (int y = tops[x] + first; y < std::min(tops[x] + last, pictures.height); ++y, ++count)
    {
      sum += pictures.small[k][static_cast<std::size_t>(y) * pictures.width + x];
    }
  }
  return count > 0 ? sum / count : 0;
}

void MeasureBands(Pictures& pictures)
{
  const std::vector<int> tops = TopsOf(pictures);
  const int height = pictures.height;
  for (std::size_t k = 0; k < pictures.small.size() && pictures.width > static_cast<int>(kBands); ++k)
  {
    for (std::size_t b = 0; b < kBands; ++b)
    {
      Band& band = pictures.bands[k][b];
      band.near = MeanBelow(pictures, tops, k, b, height / 8, std::max(height / 4, height / 8 + 1));
      band.deep = MeanBelow(pictures, tops, k, b, height / 4, height);
    }
  }
}

}  // namespace

Pictures MakePictures(const Sweep& sweep, const std::vector<int>& frames)
{
  // At least 2 x 2 pixels a block, so that small pictures take no more memory than the sweep's bytes.
  const int longest = std::max(sweep.width, sweep.height);
  const int block = std::min({std::max(2, (longest + kSmallSide - 1) / kSmallSide), sweep.width, sweep.height});
  Pictures pictures;
  pictures.width = sweep.width / block;
  pictures.height = sweep.height / block;
  pictures.small.resize(frames.size());
  pictures.brightness.resize(frames.size());
  pictures.roughness.resize(frames.size());
  pictures.bands.resize(frames.size());
  pictures.change.resize(frames.size());
  tbb::parallel_for(std::size_t(0), frames.size(),
                    [&](std::size_t k)
                    {
                      cv::Mat image(sweep.height, sweep.width, CV_32F), small;
                      sweep.CopyFrame(frames[k], image.ptr<float>());
                      image *= kLevels;
                      const cv::Rect whole(0, 0, pictures.width * block, pictures.height * block);
                      cv::resize(image(whole), small, {pictures.width, pictures.height}, 0, 0, cv::INTER_AREA);
                      pictures.small[k].assign(small.ptr<float>(), small.ptr<float>() + small.total());
                      pictures.brightness[k] = cv::mean(small.rowRange(pictures.height / 4, pictures.height))[0];
                      pictures.roughness[k] =
                          Roughness(image.rowRange(sweep.height / 4, std::max(sweep.height / 2, 1)));
                      for (std::size_t b = 0; b < kBands && pictures.width > static_cast<int>(kBands); ++b)
                      {
                        pictures.bands[k][b].roughness = Roughness(PartOf(image, b, image.rows / 4, image.rows / 2));
                      }
                      if (k > 0)
                      {
                        pictures.change[k] = ChangeBetween(sweep, frames[k - 1], frames[k]);
                      }
                    });
  MeasureBands(pictures);
  return pictures;
}

bool GreyLevels::IsDim() const
{
  return brightest > 0 && brightest < kDimmest * kLevels;
}

bool GreyLevels::IsSaturated() const
{
  return white > kMostWhite;
}

namespace
{

/// The brightest level by counts of levels 0 to counts.size() - 1: one that no more than one of a hundred thousand exceeds.
std::size_t BrightestOf(const std::vector<std::size_t>& counts)
{
  const std::size_t all = std::accumulate(counts.begin(), counts.end(), std::size_t(0));
  std::size_t level = counts.size(), above = 0;
  while (level > 0 && 100000 * above <= all)
  {
    above += counts[--level];
  }
  return level;
}

/// The same of pixels as they are, for those of which a byte would leave little: 8 bits that were stored in 16, for one.
double BrightestAsIs(const Sweep& sweep, const std::vector<int>& frames)
{
  constexpr std::size_t kFine = 65536;
  std::vector<float> image(sweep.PixelsPerFrame());
  float top = 0;
  for (const int frame : frames)
  {
    sweep.CopyFrame(frame, image.data());
    top = std::max(top, *std::max_element(image.begin(), image.end()));
  }
  std::vector<std::size_t> counts(kFine, 0);
  for (const int frame : frames)
  {
    sweep.CopyFrame(frame, image.data());
    for (const float value : image)
    {
      ++counts[top > 0 ? static_cast<std::size_t>(std::lround(double(value) / top * (kFine - 1))) : 0];
    }
  }
  return static_cast<double>(kLevels) * top * static_cast<double>(BrightestOf(counts)) / (kFine - 1);
}

}  // namespace

GreyLevels SurveyLevels(const Sweep& sweep, const std::vector<int>& frames)
{
  std::vector<std::size_t> counts(256, 0);
  const std::vector<int> looked = EvenlySpread(frames, kLookedAt);
  for (const int frame : looked)
  {
    const cv::Mat image = LevelsOf(sweep, frame);
    std::for_each(image.begin<std::uint8_t>(), image.end<std::uint8_t>(),
                  [&counts](std::uint8_t level) { ++counts[level]; });
  }
  const std::size_t all = std::accumulate(counts.begin(), counts.end(), std::size_t(0)), lit = all - counts[0];
  GreyLevels levels;
  levels.brightest = static_cast<double>(BrightestOf(counts));
  if (levels.brightest < kDimmest * kLevels && sweep.pixelType == Sweep::PixelType::Float32)
  {
    levels.brightest = BrightestAsIs(sweep, looked);
  }
  levels.white = lit > 0 ? static_cast<double>(counts[254] + counts[255]) / static_cast<double>(lit) : 0;
  return levels;
}

Sweep Brightened(const Sweep& sweep, const GreyLevels& levels)
{
  const std::size_t pixels = sweep.PixelsPerFrame();
  const std::shared_ptr<float> bright = AllocatePixels<float>(pixels * sweep.NumberOfFrames());
  const auto factor = static_cast<float>(kLevels / levels.brightest);
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    float* const frame = bright.get() + k * pixels;
    sweep.CopyFrame(k, frame);
    std::transform(frame, frame + pixels, frame, [factor](float value) { return std::min(factor * value, 1.0f); });
  }
  Sweep result = sweep;
  result.pixelType = Sweep::PixelType::Float32;
  result.pixels = bright;
  return result;
}

cv::Mat LevelsOf(const Sweep& sweep, int frame)
{
  if (sweep.pixelType == Sweep::PixelType::UInt8)
  {
    const auto* pixels = static_cast<const std::uint8_t*>(sweep.pixels.get()) + frame * sweep.PixelsPerFrame();
    return cv::Mat(sweep.height, sweep.width, CV_8U, const_cast<std::uint8_t*>(pixels)).clone();
  }
  cv::Mat image(sweep.height, sweep.width, CV_32F), levels;
  sweep.CopyFrame(frame, image.ptr<float>());
  image.convertTo(levels, CV_8U, kLevels);
  return levels;
}

double AlikeIn(std::size_t band, const Pictures& pictures, std::size_t a, std::size_t b)
{
  const auto detail = [&](std::size_t k)
  {
    const cv::Mat part = PartOf(ImageOf(pictures, k), band, pictures.height / 8, pictures.height);
    return cv::Mat(part - cv::mean(part));
  };
  return Correlation(detail(a), detail(b));
}

double Correlation(const cv::Mat& a, const cv::Mat& b)
{
  const double sizes = std::sqrt(a.dot(a) * b.dot(b));
  return sizes > 0 ? a.dot(b) / sizes : 0;
}

cv::Mat ImageOf(const Pictures& pictures, std::size_t k)
{
  return {pictures.height, pictures.width, CV_32F, const_cast<float*>(pictures.small[k].data())};
}

double Difference(const Pictures& pictures, std::size_t a, std::size_t b)
{
  double sum = 0;
  const std::vector<float>&one = pictures.small[a], &other = pictures.small[b];
  for (std::size_t p = 0; p < one.size(); ++p)
  {
    const double difference = static_cast<double>(one[p]) - other[p];
    sum += difference * difference;
  }
  return std::sqrt(sum / static_cast<double>(one.size()));
}

double UnrelatedDifference(const Pictures& pictures, std::size_t k)
{
  return std::sqrt(2 * MeanSquareOf(WithoutMean(ImageOf(pictures, k), 5)));
}

}  // namespace bigus
