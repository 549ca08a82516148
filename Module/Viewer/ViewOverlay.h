// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A picture that lies over what a flat view shows of a slice.
#pragma once

#include <Eigen/Dense>

#include "vtkImageSlice.h"
#include "vtkImageSliceMapper.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"

class vtkImageData;
class vtkRenderer;
class vtkScalarsToColors;

namespace bigus::command
{

class ViewOverlay
{
public:
  /// Hidden at first.
  void AddTo(vtkRenderer* renderer, vtkScalarsToColors* colors);
  /// `place`: from its pixels to the renderer's world.
  void Show(vtkImageData* image, const Eigen::Matrix4d& place);
  void Hide() { picture_->VisibilityOff(); }

private:
  vtkNew<vtkImageSliceMapper> mapper_;
  vtkNew<vtkImageSlice> picture_;
  vtkNew<vtkMatrix4x4> place_;
};

}  // namespace bigus::command
