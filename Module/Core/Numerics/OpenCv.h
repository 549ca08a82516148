// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What OpenCV throws, as Core's callers know it, and pictures as it knows them. Private to Core.
#pragma once

#include <cstdint>
#include <new>
#include <opencv2/core.hpp>
#include <string>

#include "Core/Model/Error.h"

namespace bigus
{

/// Throws what a function of Core may throw instead: std::bad_alloc for want of memory, and Error for everything else.
[[noreturn]] inline void ThrowAsCores(const cv::Exception& exception)
{
  if (exception.code == cv::Error::StsNoMem)
  {
    throw std::bad_alloc();
  }
  throw Error("OpenCV: " + exception.err);
}

/// 255 where a picture of bytes has this value, else 0.
inline cv::Mat MaskOf(const std::uint8_t* picture, int width, int height, int value)
{
  return cv::Mat(height, width, CV_8U, const_cast<std::uint8_t*>(picture)) == value;
}

}  // namespace bigus
