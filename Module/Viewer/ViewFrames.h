// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A frame as it was recorded, the field at the same pose, and their difference.
#pragma once

#include <array>
#include <limits>
#include <memory>

#include "Core/Model/Sweep.h"
#include "ViewCell.h"
#include "ViewOverlay.h"
#include "vtkImageSlice.h"
#include "vtkImageSliceMapper.h"
#include "vtkSmartPointer.h"

class vtkBigusSliceProp;
class vtkImageData;
class vtkLookupTable;

namespace bigus::command
{

class ViewFrames
{
public:
  /// `slice` shows the field in pixels of the sweep's frames.
  ViewFrames(std::shared_ptr<const Sweep> sweep, vtkBigusSliceProp* slice);

  struct Cell : ViewCell
  {
    vtkNew<vtkImageSliceMapper> mapper;
    vtkNew<vtkImageSlice> picture;
  };
  Cell recorded, rendered, difference;
  ViewOverlay doubt, outlines;  ///< of the rendered one
  /// The size of a pixel of the pictures, mm.
  Eigen::Vector2d PixelSize() { return {recorded.picture->GetScale()[0], recorded.picture->GetScale()[1]}; }
  std::array<Cell*, 3> Cells() { return {&recorded, &rendered, &difference}; }

  /// The slice has moved to the pose of this frame.
  void ShowFrame(int frame);
  /// The slice has moved from the frames: shows the nearest one, and tells how far it is.
  void ShowNearest();
  /// Of the frame shown: PSNR of the rendered image against the recorded one, over lit pixels, dB. NaN without one.
  double Psnr() const { return psnr_; }
  /// Fits the pictures into their cells.
  void Fit();

private:
  void Show(int frame);

  std::shared_ptr<const Sweep> sweep_;
  vtkBigusSliceProp* slice_;
  vtkSmartPointer<vtkImageData> recordedImage_, differenceImage_;
  vtkSmartPointer<vtkLookupTable> differenceTable_;
  double psnr_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace bigus::command
