// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The 3-D scene of `bigus view`: the field as ellipsoids or as a cloud, a slice that the mouse moves, the sweep's frames.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "ViewBox.h"
#include "ViewCell.h"
#include "ViewParts.h"
#include "vtkActor.h"
#include "vtkBigusFieldMapper.h"
#include "vtkBigusFieldVolume.h"
#include "vtkBigusSliceProp.h"
#include "vtkBigusSliceWidget.h"
#include "vtkMatrix4x4.h"
#include "vtkPlane.h"
#include "vtkScalarBarActor.h"
#include "vtkSmartPointer.h"

class vtkPolyData;
class vtkRenderWindowInteractor;

namespace bigus::command
{

class ViewScene
{
public:
  /// `sweep` may be null.
  ViewScene(vtkPolyData* field, const Sweep* sweep, const ViewBox& box, int fontSize);

  ViewCell cell;

  /// The slice that the mouse moves; made for frames of the sweep where there is one.
  vtkBigusSliceProp* Slice() { return slice_; }
  /// Puts it at a plane of its own size and spacing, by value.
  void SetPlane(const Eigen::Matrix4d& plane);
  /// The slice follows the mouse and the widget's keys from now on; `moved` is called when it has.
  void SetInteractor(vtkRenderWindowInteractor* interactor, std::function<void()> moved);

  /// Adds what is shown as "planes".
  void AddPlane(vtkBigusSliceProp* plane);

  /// One of kViewParts; all are shown at first.
  void Show(const std::string& part, bool isShown);
  bool IsShown(const std::string& part) const { return shown_.at(part); }

  /// Takes away what lies before the slice, as seen at the start.
  void SetCut(bool isCut);
  bool IsCut() const { return isCut_; }

  /// From before the middle frame, a little from the side and above, with depth pointing down.
  void LookFromTheStart();

private:
  void AddSweep(const Sweep& sweep);
  void AddLegend(int fontSize);
  void UpdateCut();

  ViewBox box_;
  vtkNew<vtkBigusFieldMapper> ellipsoidMapper_;
  vtkNew<vtkActor> ellipsoids_, outlines_, path_;
  vtkNew<vtkBigusFieldVolume> volume_;
  vtkNew<vtkBigusSliceWidget> sliceWidget_;
  vtkSmartPointer<vtkBigusSliceProp> slice_;
  std::vector<vtkSmartPointer<vtkBigusSliceProp>> planes_;
  vtkNew<vtkScalarBarActor> legend_;
  vtkNew<vtkPlane> cut_;
  bool isCut_ = false;
  std::map<std::string, bool> shown_;
  std::function<void()> moved_;
};

}  // namespace bigus::command
