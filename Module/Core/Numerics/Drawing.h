// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What pages to look at are drawn with. Private to Core.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "Core/Numerics/Page.h"

namespace bigus::drawing
{

constexpr int kWidth = 1200, kMargin = 24, kLine = 22;  // pixels
constexpr std::size_t kLetters = 132;                   // of a line over the whole width
const cv::Scalar kPaper(255, 255, 255), kInk(40, 40, 40);

void Write(cv::Mat& page, const std::string& text, int x, int y, double size = 0.45, const cv::Scalar& colour = kInk);

/// Words in lines of at most `letters`.
std::vector<std::string> Lines(const std::string& text, std::size_t letters);

/// Of CV_8UC3, red first.
Page PageOf(const cv::Mat& page);

}  // namespace bigus::drawing
