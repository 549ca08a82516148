// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A path clicked onto a flat view, with its length and the area inside.
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <string>
#include <vector>

#include "vtkActor2D.h"
#include "vtkNew.h"
#include "vtkPolyData.h"
#include "vtkTextActor.h"

class vtkRenderer;

namespace bigus::command
{

class ViewMeasure
{
public:
  /// For a renderer whose camera has no perspective and whose world is in mm.
  void Place(vtkRenderer* renderer, int fontSize);

  /// Says something of a place, or of what lies inside of three and more, mm.
  using About = std::function<std::string(const std::vector<Eigen::Vector3d>&)>;

  /// The path goes on to the place under pixel (x, y) of the window. Returns its words: of one point what `about` says of
  /// it, else the length along the points, mm, and from three points on the area that they enclose, mm^2, and what `about`
  /// says of that.
  std::string Add(int x, int y, const About& about);
  /// The same for the place where a button was released; nothing where that is where it was pressed.
  std::string AddIfDragged(int x, int y, const About& about);
  void Clear();

private:
  void Draw();
  std::string Words() const;

  vtkRenderer* renderer_ = nullptr;
  std::vector<Eigen::Vector3d> points_;  // mm
  std::string about_;                    // the only one, or what lies inside
  int pressedX_ = 0, pressedY_ = 0;      // pixels
  vtkNew<vtkPolyData> path_;
  vtkNew<vtkActor2D> line_;
  vtkNew<vtkTextActor> label_;
};

}  // namespace bigus::command
