// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How far what a view shows may be wrong.
#pragma once

#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Core/Model/ViewDependence.h"
#include "Core/StandardError/StandardError.h"
#include "ViewOverlay.h"
#include "vtkSmartPointer.h"

class vtkBigusSliceProp;
class vtkLookupTable;
class vtkPolyData;
class vtkRenderer;

namespace bigus::command
{

/// Its pixels, at rest.
SlicePlane PlaneOf(vtkBigusSliceProp* slice);

class ViewDoubts
{
public:
  /// A field that keeps no standard error leaves no doubts. Throws Error where what it keeps is damaged.
  explicit ViewDoubts(vtkPolyData* field);

  /// Whether the slice is mostly guessed. Renders it.
  bool IsMostlyGuessed(vtkBigusSliceProp* slice) const;
  /// "3 deg beside recorded frames", where echoes depend on the direction that they are seen from; else empty.
  std::string Direction(vtkBigusSliceProp* slice) const;
  /// The slice's intensity at its pixel nearest to (i, j), 1 is white, and its standard error; empty beside the slice.
  std::string At(vtkBigusSliceProp* slice, double i, double j) const;

  /// "mean 0.312 +- 0.004": of the slice inside a polygon of its pixels; empty where no pixel lies in it.
  std::string Inside(vtkBigusSliceProp* slice, const std::vector<Eigen::Vector2d>& polygon) const;

  /// Of what is tinted: where the slice's standard error is above 10 % of white or not known.
  void AddTo(vtkRenderer* renderer, ViewOverlay& overlay) const;
  /// Renders the slice. `place`: from its pixels to the renderer's world.
  void Tint(vtkBigusSliceProp* slice, const Eigen::Matrix4d& place, ViewOverlay& overlay) const;

private:
  std::vector<float> Sigma(vtkBigusSliceProp* slice) const;

  std::unique_ptr<const StandardError> kept_;
  std::optional<RecordedViews> recorded_;
  vtkSmartPointer<vtkLookupTable> tints_;
};

}  // namespace bigus::command
