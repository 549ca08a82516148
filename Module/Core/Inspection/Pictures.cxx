// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Inspection/Pictures.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace bigus
{
namespace
{

/// Pixels: the longer side of small pictures at the most. Blocks average noise, and are not larger than grains of speckle
/// by far (480 pixels: 10).
constexpr int kSmallSide = 48;

constexpr float kLevels = 255;

cv::Mat WithoutMean(const cv::Mat& image, int window)
{
  cv::Mat mean;
  cv::blur(image, mean, {window, window}, {-1, -1}, cv::BORDER_REFLECT_101);
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

double Roughness(const cv::Mat& image)
{
  const double spread = MeanSquareOf(WithoutMean(image, 9));
  return spread > 0 && image.cols > 1
             ? MeanSquareOf(image.colRange(1, image.cols) - image.colRange(0, image.cols - 1)) / spread
             : 0;
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
                      if (k > 0)
                      {
                        pictures.change[k] = ChangeBetween(sweep, frames[k - 1], frames[k]);
                      }
                    });
  return pictures;
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
  const cv::Mat image(pictures.height, pictures.width, CV_32F, const_cast<float*>(pictures.small[k].data()));
  return std::sqrt(2 * MeanSquareOf(WithoutMean(image, 5)));
}

}  // namespace bigus
