// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The window of `bigus view`: a 3-D scene, three planes at right angles, and a recorded frame beside the rendered one.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "Core/Model/Sweep.h"
#include "ViewControls.h"
#include "ViewDoubts.h"
#include "ViewFrames.h"
#include "ViewLabels.h"
#include "ViewPlanes.h"
#include "ViewScene.h"
#include "vtkNew.h"
#include "vtkRenderWindow.h"
#include "vtkRenderWindowInteractor.h"

namespace bigus::command
{

class Console;

struct ViewSettings
{
  std::string name;                ///< of the field, for captions and names of saved files
  int width = 1440, height = 900;  ///< pixels
  bool offScreen = false;
};

class ViewWindow
{
public:
  /// `sweep` may be null: then there is no recorded frame. Call RequireDisplay before.
  ViewWindow(vtkPolyData* field, std::shared_ptr<const Sweep> sweep, const ViewSettings& settings, Console& console);

  /// Shows this frame, counted from 0 among the usable ones.
  void ShowFrame(int frame);
  ViewScene& Scene() { return scene_; }

  /// Of the frame shown: PSNR of the rendered image against the recorded one, over lit pixels, dB. NaN without one.
  double FramePsnr() const;
  /// Names of the views at rest whose pictures are mostly guessed.
  std::vector<std::string> Guessed() const { return guessed_; }
  /// Writes what the window shows: .png.
  void WriteScreenshot(const std::string& path);
  /// Serves mouse and keys until the window is closed or the process is told to end.
  void Run();

private:
  void LayOut();
  void Fit();
  void Render(bool isMoving);
  void Judge();
  void ShowOverlays(bool isStill);
  std::string About(const ViewCell* cell, const std::vector<Eigen::Vector3d>& points);
  bool OnKey(vtkObject*, unsigned long, void*);
  bool OnWheel(vtkObject*, unsigned long event, void*);
  bool OnButton(vtkObject*, unsigned long event, void*);
  bool OnChar(vtkObject*, unsigned long, void*) { return true; }
  bool OnTimer(vtkObject*, unsigned long, void*);
  bool OnResize(vtkObject*, unsigned long, void*);
  bool OnSlider(vtkObject*, unsigned long, void*);
  bool OnThickness(vtkObject*, unsigned long, void*);
  bool OnPlaneKey(const std::string& key);
  void ShowMoved();
  ViewCell* FlatUnderMouse();
  void Save(bool isSlice);
  void WriteSlice(const std::string& path);
  vtkRenderer* UnderMouse();

  ViewSettings settings_;
  Console& console_;
  std::shared_ptr<const Sweep> sweep_;
  int frame_ = 0, fontSize_;

  vtkNew<vtkRenderWindow> window_;
  vtkNew<vtkRenderWindowInteractor> interactor_;
  vtkNew<vtkRenderer> backdrop_;  // shows between the cells
  ViewScene scene_;
  ViewPlanes planes_;
  ViewDoubts doubts_;
  ViewLabels labels_;
  std::vector<std::string> guessed_;
  std::unique_ptr<ViewFrames> frames_;
  ViewControls controls_;
  bool isAtFrame_ = false;  // the slice lies at frame_
  bool areCrossingsShown_ = true, areDoubtsShown_ = false, areOutlinesShown_ = true;
  std::vector<Eigen::Matrix4d> kept_;  // planes
  std::size_t shownKept_ = 0;          // counted from 1; 0: none
  bool isCoarse_ = false;              // the last picture was drawn in a hurry
  std::chrono::steady_clock::time_point coarseSince_;
};

}  // namespace bigus::command
