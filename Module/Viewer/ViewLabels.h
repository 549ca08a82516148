// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The outlines of what has labels, in their colours.
#pragma once

#include <memory>
#include <string>

#include "Core/Labels/Labels.h"
#include "ViewOverlay.h"
#include "vtkSmartPointer.h"

class vtkBigusSliceProp;
class vtkLookupTable;
class vtkPolyData;

namespace bigus::command
{

class ViewLabels
{
public:
  /// A field without labels has no outlines. Throws Error where labels are damaged.
  explicit ViewLabels(vtkPolyData* field);

  void AddTo(vtkRenderer* renderer, ViewOverlay& overlay) const;
  /// `place`: from the slice's pixels to the renderer's world.
  void Outline(vtkBigusSliceProp* slice, const Eigen::Matrix4d& place, ViewOverlay& overlay) const;
  /// The label at the slice's pixel nearest to (i, j); empty where it has none.
  std::string At(vtkBigusSliceProp* slice, double i, double j) const;

private:
  std::unique_ptr<LabelledField> field_;  // null without labels
  vtkSmartPointer<vtkLookupTable> colors_;
};

}  // namespace bigus::command
