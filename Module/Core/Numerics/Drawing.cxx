// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Numerics/Drawing.h"

#include <opencv2/imgproc.hpp>
#include <sstream>

namespace bigus::drawing
{

void Write(cv::Mat& page, const std::string& text, int x, int y, double size, const cv::Scalar& colour)
{
  cv::putText(page, text, {x, y}, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
}

std::vector<std::string> Lines(const std::string& text, std::size_t letters)
{
  std::vector<std::string> lines(1);
  std::istringstream words(text);
  for (std::string word; words >> word;)
  {
    if (!lines.back().empty() && lines.back().size() + 1 + word.size() > letters)
    {
      lines.emplace_back();
    }
    lines.back() += (lines.back().empty() ? "" : " ") + word;
  }
  return lines;
}

Page PageOf(const cv::Mat& page)
{
  return {page.cols, page.rows, std::vector<std::uint8_t>(page.datastart, page.dataend)};
}

}  // namespace bigus::drawing
