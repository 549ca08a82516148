// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the rendering tests share: a window that draws off screen, and its pixels.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>

#include "Filters/FilterTestSupport.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkRenderWindow.h"
#include "vtkRenderer.h"
#include "vtkSmartPointer.h"
#include "vtkUnsignedCharArray.h"

namespace bigus::test
{

/// Skips a test where nothing can be drawn: VTK of Debian 12 aborts without an X server, off screen, too.
#define BIGUS_NEEDS_DISPLAY()                                                \
  do                                                                         \
  {                                                                          \
    if (!std::getenv("DISPLAY"))                                             \
    {                                                                        \
      GTEST_SKIP() << "rendering needs an X server; none is set in DISPLAY"; \
    }                                                                        \
  } while (false)

/// A window off screen with one renderer, without smoothing, so that pixels can be compared.
struct Scene
{
  explicit Scene(int width = 300, int height = 240)
  {
    this->window->SetOffScreenRendering(true);
    this->window->SetMultiSamples(0);
    this->window->SetSize(width, height);
    this->window->AddRenderer(this->renderer);
  }

  /// What the window shows: rows from the bottom, RGB.
  vtkSmartPointer<vtkUnsignedCharArray> Pixels()
  {
    this->window->Render();
    auto pixels = vtkSmartPointer<vtkUnsignedCharArray>::New();
    const int* size = this->window->GetSize();
    this->window->GetPixelData(0, 0, size[0] - 1, size[1] - 1, 0, pixels);
    return pixels;
  }

  vtkNew<vtkRenderer> renderer;
  vtkNew<vtkRenderWindow> window;
};

}  // namespace bigus::test
