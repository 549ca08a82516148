// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Three planes at right angles through a field, each in a cell of its own, which move along their normals.
#pragma once

#include <array>
#include <string>

#include "ViewBox.h"
#include "ViewCell.h"
#include "ViewOverlay.h"
#include "vtkBigusSliceProp.h"
#include "vtkMatrix4x4.h"

namespace bigus::command
{

/// A plane through the field, moved along its normal.
struct PlaneView : ViewCell
{
  std::string name, axis;                   ///< for the caption: what is seen, and along what it moves
  Eigen::Vector3d across, down, normal;     ///< unit vectors
  Eigen::Vector3d origin, along;            ///< the caption tells how far from the origin, mm, along this unit vector
  Eigen::Vector3d centre;                   ///< of the box, mm
  double width = 0, height = 0, depth = 0;  ///< of the box, along the vectors above, mm
  double offset = 0;                        ///< along the normal from the centre, mm
  vtkNew<vtkMatrix4x4> plane;               ///< of both slices
  vtkNew<vtkBigusSliceProp> slice;          ///< in this cell
  vtkNew<vtkBigusSliceProp> inScene;        ///< the same for the 3-D scene

  /// Where another plane cuts this one.
  struct Crossing
  {
    vtkNew<vtkLineSource> line;
    vtkNew<vtkActor2D> actor;
    const PlaneView* other = nullptr;
  };
  std::array<Crossing, 2> crossings;
  ViewOverlay doubt, outlines;

  /// Moves by so many mm, and stays in the box. What was measured goes.
  void Move(double distance);
  /// Fits the picture into the cell, after a change of either.
  void Fit();
};

class ViewPlanes
{
public:
  /// `isSweep`: the box lies along a sweep.
  ViewPlanes(vtkPolyData* field, const ViewBox& box, bool isSweep);

  std::array<PlaneView, 3> views;

  /// The one in a renderer, or null.
  PlaneView* In(vtkRenderer* renderer);
  /// Draws the crossings where the planes are now.
  void Cross();
  void ShowCrossings(bool isShown);
};

}  // namespace bigus::command
