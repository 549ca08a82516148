// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What OpenCV throws, as Core's callers know it. Private to Core.
#pragma once

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

}  // namespace bigus
