// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One cell of the window of `bigus view`: a renderer, a caption in its upper left corner, and where it is flat what measures.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <string>

#include "ViewMeasure.h"
#include "vtkActor2D.h"
#include "vtkLineSource.h"
#include "vtkNew.h"
#include "vtkRenderer.h"
#include "vtkTextActor.h"

class vtkPolyDataMapper2D;
class vtkRenderWindow;
class vtkTextProperty;

namespace bigus::command
{

using Color = std::array<double, 3>;
constexpr Color kBackdrop = {0.20, 0.22, 0.25}, kDark = {0.06, 0.07, 0.085}, kText = {0.85, 0.87, 0.90},
                kAccent = {0.35, 0.85, 0.75};

/// The part of the window that a cell fills, 0 to 1, from its lower left corner.
struct Viewport
{
  double left, bottom, right, top;
};

struct ViewCell
{
  vtkNew<vtkRenderer> renderer;
  vtkNew<vtkTextActor> caption;
  vtkNew<vtkLineSource> ruler;  ///< of a flat view, in its lower left corner: a round length
  vtkNew<vtkActor2D> rulerLine;
  vtkNew<vtkTextActor> rulerLength;
  vtkNew<vtkTextActor> mark;  ///< of a flat view: what grows to the right and down
  ViewMeasure measure;
  Color color = kText;  ///< of the caption, from Place on
  std::string text;     ///< of the caption, without a doubt

  void Place(vtkRenderWindow* window, const Viewport& viewport, int fontSize);
  void SetCaption(const std::string& text);
  /// Adds what is doubtful about the picture, until there is another caption; nothing takes it away.
  void SetDoubt(const std::string& words);

  /// Looks along `normal`, without perspective and with `down` downwards, so that a rectangle of width x height mm about
  /// `centre` fills the cell, with a ruler.
  void LookAt(const Eigen::Vector3d& centre, const Eigen::Vector3d& normal, const Eigen::Vector3d& down, double width,
              double height);

private:
  void Rule();
};

/// What draws lines of the world over a picture, for an actor.
vtkPolyDataMapper2D* DrawInWorld(vtkActor2D* lines, const Color& color, double width);

/// Light on dark, plain.
void StyleText(vtkTextProperty* text, int fontSize);

}  // namespace bigus::command
