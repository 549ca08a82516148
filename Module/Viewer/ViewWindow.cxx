// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewWindow.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "Console.h"
#include "Exit.h"
#include "Files.h"
#include "Outputs.h"
#include "vtkBigusReslice.h"
#include "vtkInteractorStyleTrackballCamera.h"
#include "vtkPNGWriter.h"
#include "vtkPolyData.h"
#include "vtkUnsignedCharArray.h"
#include "vtkWindowToImageFilter.h"

namespace bigus::command
{

namespace
{

constexpr int kSamples = 4;                              // a pixel, against jagged edges
constexpr int kRowsOfText = 58;                          // that the window is high
constexpr int kSmallestFont = 8;                         // points
constexpr double kMovingRate = 15;                       // pictures a second while something moves
constexpr double kStillRate = 1e-4;                      // as VTK's interactor: a still picture takes the time it needs
constexpr auto kStill = std::chrono::milliseconds(400);  // after the last key a picture is drawn in full
constexpr unsigned long kTick = 100;                     // ms between looks at what there is to do
constexpr double kWheelStep = 1;                         // mm
// The slice's widget has its observers at 0.5, VTK's style at 0.
constexpr float kBeforeWidgets = 1, kAfterWidgets = 0.25;

/// The first name stem-1ending, stem-2ending, ... that no file has.
std::string FreeName(const std::string& stem, const std::string& ending)
{
  int number = 1;
  const auto name = [&] { return stem + "-" + std::to_string(number) + ending; };
  while (std::filesystem::exists(name()))
  {
    ++number;
  }
  return name();
}

}  // namespace

//------------------------------------------------------------------------------
// Building it

ViewWindow::ViewWindow(vtkPolyData* field, std::shared_ptr<const Sweep> sweep, const ViewSettings& settings,
                       Console& console)
    : settings_(settings),
      console_(console),
      sweep_(std::move(sweep)),
      fontSize_(std::max(kSmallestFont, settings.height / kRowsOfText)),
      scene_(field, sweep_.get(), BoxOfField(field, sweep_.get()), fontSize_),
      planes_(field, BoxOfField(field, sweep_.get()), sweep_ != nullptr),
      doubts_(field),
      labels_(field)
{
  interactor_->SetRenderWindow(window_);
  vtkNew<vtkInteractorStyleTrackballCamera> style;
  interactor_->SetInteractorStyle(style);
  interactor_->SetDesiredUpdateRate(kMovingRate);

  vtkBigusSliceProp* slice = scene_.Slice();
  if (sweep_)
  {
    slice->SetSliceSize(sweep_->width, sweep_->height);
    frames_ = std::make_unique<ViewFrames>(sweep_, slice);
    doubts_.AddTo(frames_->rendered.renderer, frames_->doubt);
    labels_.AddTo(frames_->rendered.renderer, frames_->outlines);
  }
  else
  {
    vtkBigusSliceProp* first = planes_.views[0].slice;
    slice->SetSliceSize(first->GetSliceSize()[0], first->GetSliceSize()[1]);
    slice->SetSliceSpacing(first->GetSliceSpacing()[0], first->GetSliceSpacing()[1]);
    slice->SetSliceOrigin(first->GetSliceOrigin()[0], first->GetSliceOrigin()[1]);
    slice->GetPlane()->DeepCopy(planes_.views[0].plane);
  }
  for (PlaneView& view : planes_.views)
  {
    scene_.AddPlane(view.inScene);
    doubts_.AddTo(view.renderer, view.doubt);
    labels_.AddTo(view.renderer, view.outlines);
    view.slice->SetProperty(slice->GetProperty());  // one window and level for all
    view.inScene->SetProperty(slice->GetProperty());
  }
  scene_.SetInteractor(interactor_, [this] { ShowMoved(); });
  scene_.cell.SetCaption(settings_.name + "   " + std::to_string(field->GetNumberOfPoints()) +
                         " Gaussians\n? lists the keys");
  LayOut();
  controls_.Add(scene_.cell.renderer, interactor_, fontSize_, sweep_ ? sweep_->NumberOfFrames() : 0,
                scene_.Slice()->GetBeamSigma());
  controls_.slider->AddObserver(vtkCommand::InteractionEvent, this, &ViewWindow::OnSlider);
  controls_.thickness->AddObserver(vtkCommand::InteractionEvent, this, &ViewWindow::OnThickness);
  planes_.Cross();
  if (sweep_)
  {
    ShowFrame(0);
  }
  scene_.SetCut(true);
  Fit();
  scene_.LookFromTheStart();

  interactor_->AddObserver(vtkCommand::KeyPressEvent, this, &ViewWindow::OnKey, kBeforeWidgets);
  interactor_->AddObserver(vtkCommand::CharEvent, this, &ViewWindow::OnChar, kBeforeWidgets);
  for (const auto event : {vtkCommand::MouseWheelForwardEvent, vtkCommand::MouseWheelBackwardEvent})
  {
    interactor_->AddObserver(event, this, &ViewWindow::OnWheel, kAfterWidgets);
  }
  for (const auto event : {vtkCommand::LeftButtonPressEvent, vtkCommand::LeftButtonReleaseEvent,
                           vtkCommand::MiddleButtonPressEvent, vtkCommand::RightButtonPressEvent})
  {
    interactor_->AddObserver(event, this, &ViewWindow::OnButton, kAfterWidgets);
  }
  interactor_->AddObserver(vtkCommand::TimerEvent, this, &ViewWindow::OnTimer);
  interactor_->AddObserver(vtkCommand::ConfigureEvent, this, &ViewWindow::OnResize);
}

/// The scene on the left, the three planes beside it, and with a sweep the frame on the right.
void ViewWindow::LayOut()
{
  window_->SetOffScreenRendering(settings_.offScreen);
  window_->SetMultiSamples(kSamples);
  window_->SetSize(settings_.width, settings_.height);
  window_->SetWindowName(("BIGUS: " + settings_.name).c_str());
  backdrop_->SetBackground(kBackdrop.data());
  backdrop_->InteractiveOff();
  window_->AddRenderer(backdrop_);
  const double left = sweep_ ? 0.5 : 0.66, middle = sweep_ ? 0.75 : 1;
  scene_.cell.Place(window_, {0, 0, left, 1}, fontSize_);
  for (int k = 0; k < 3; ++k)
  {
    const double bottom = (2 - k) / 3.0, top = (3 - k) / 3.0;
    planes_.views[k].Place(window_, {left, bottom, middle, top}, fontSize_);
    if (frames_)
    {
      frames_->Cells()[k]->Place(window_, {middle, bottom, 1, top}, fontSize_);
    }
  }
}

//------------------------------------------------------------------------------
// Showing

void ViewWindow::ShowFrame(int frame)
{
  frame_ = std::clamp(frame, 0, sweep_->NumberOfFrames() - 1);
  scene_.SetPlane(sweep_->Plane(frame_).ImageToReference());
  frames_->ShowFrame(frame_);
  controls_.sliderLooks->SetValue(frame_);
  isAtFrame_ = true;
  controls_.thicknessLooks->SetValue(scene_.Slice()->GetBeamSigma());
}

/// The slice lies elsewhere now.
void ViewWindow::ShowMoved()
{
  isAtFrame_ = false;
  if (frames_)
  {
    frames_->ShowNearest();
  }
}

double ViewWindow::FramePsnr() const
{
  return frames_ ? frames_->Psnr() : std::numeric_limits<double>::quiet_NaN();
}

/// Pictures fill their cells also after the window has changed its size.
void ViewWindow::Fit()
{
  for (PlaneView& view : planes_.views)
  {
    view.Fit();
  }
  if (frames_)
  {
    frames_->Fit();
  }
}

/// While something moves, draws what can be drawn quickly. The rest follows when it stays (OnTimer).
void ViewWindow::Render(bool isMoving)
{
  isCoarse_ = isMoving;
  coarseSince_ = std::chrono::steady_clock::now();
  window_->SetDesiredUpdateRate(isMoving ? kMovingRate : kStillRate);
  if (!isMoving)
  {
    Judge();
  }
  ShowOverlays(!isMoving);
  window_->Render();
}

/// Over every slice on a flat view, while nothing moves.
void ViewWindow::ShowOverlays(bool isStill)
{
  const auto show =
      [&](vtkBigusSliceProp* slice, const Eigen::Matrix4d& place, ViewOverlay& doubt, ViewOverlay& outlines)
  {
    doubt.Hide();
    outlines.Hide();
    if (isStill && areDoubtsShown_)
    {
      doubts_.Tint(slice, place, doubt);
    }
    if (isStill && areOutlinesShown_)
    {
      labels_.Outline(slice, place, outlines);
    }
  };
  for (PlaneView& view : planes_.views)
  {
    show(view.slice, PlaneOf(view.slice).ImageToReference(), view.doubt, view.outlines);
  }
  if (frames_)
  {
    const Eigen::Vector2d pixel = frames_->PixelSize();
    show(scene_.Slice(), Eigen::Vector4d(pixel[0], pixel[1], 1, 1).asDiagonal(), frames_->doubt, frames_->outlines);
  }
}

/// The intensity, and the label, at a point of a flat view that shows a slice.
std::string ViewWindow::About(const ViewCell* cell, const std::vector<Eigen::Vector3d>& points)
{
  vtkBigusSliceProp* slice = nullptr;
  std::vector<Eigen::Vector2d> pixels;
  for (PlaneView& view : planes_.views)
  {
    if (&view == cell)
    {
      slice = view.slice;
      const SlicePlane plane = PlaneOf(slice);
      for (const Eigen::Vector3d& point : points)
      {
        const Eigen::Vector3d from = point - plane.origin;
        pixels.emplace_back(from.dot(plane.columnStep) / plane.columnStep.squaredNorm(),
                            from.dot(plane.rowStep) / plane.rowStep.squaredNorm());
      }
    }
  }
  if (frames_ && cell == &frames_->rendered)
  {
    slice = scene_.Slice();
    for (const Eigen::Vector3d& point : points)
    {
      pixels.emplace_back(point.head<2>().cwiseQuotient(frames_->PixelSize()));
    }
  }
  if (!slice)
  {
    return {};
  }
  if (pixels.size() > 1)
  {
    return doubts_.Inside(slice, pixels);
  }
  const std::string label = labels_.At(slice, pixels[0][0], pixels[0][1]);
  return doubts_.At(slice, pixels[0][0], pixels[0][1]) + (label.empty() ? "" : ", " + label);
}

void ViewWindow::Judge()
{
  guessed_.clear();
  const auto judge = [this](ViewCell& cell, vtkBigusSliceProp* slice, const std::string& name)
  {
    const std::string direction = doubts_.Direction(slice);
    if (doubts_.IsMostlyGuessed(slice))
    {
      cell.SetDoubt("mostly guessed" + (direction.empty() ? "" : ", " + direction));
      guessed_.push_back(name);
    }
    else
    {
      cell.SetDoubt(direction);
    }
  };
  for (PlaneView& view : planes_.views)
  {
    judge(view, view.slice, view.name);
  }
  if (frames_)
  {
    judge(frames_->rendered, scene_.Slice(), "slice");
  }
}

void ViewWindow::Run()
{
  interactor_->Initialize();
  Render(false);
  interactor_->CreateRepeatingTimer(kTick);
  interactor_->Start();
}

//------------------------------------------------------------------------------
// Events; those that return true are not passed on

vtkRenderer* ViewWindow::UnderMouse()
{
  const int* at = interactor_->GetEventPosition();
  return interactor_->FindPokedRenderer(at[0], at[1]);
}

bool ViewWindow::OnTimer(vtkObject*, unsigned long, void*)
{
  if (IsInterrupted())
  {
    interactor_->TerminateApp();
  }
  else if (isCoarse_ && std::chrono::steady_clock::now() - coarseSince_ > kStill)
  {
    Render(false);
  }
  return false;
}

bool ViewWindow::OnResize(vtkObject*, unsigned long, void*)
{
  Fit();
  return false;
}

bool ViewWindow::OnSlider(vtkObject*, unsigned long, void*)
{
  ShowFrame(static_cast<int>(std::lround(controls_.sliderLooks->GetValue())));
  return false;
}

/// One thickness for every slice. While it is not touched each plane has the field's own there.
bool ViewWindow::OnThickness(vtkObject*, unsigned long, void*)
{
  const double sigma = controls_.thicknessLooks->GetValue();
  scene_.Slice()->GetReslice()->SetElevationSigma(sigma);
  for (PlaneView& view : planes_.views)
  {
    view.slice->GetReslice()->SetElevationSigma(sigma);
    view.inScene->GetReslice()->SetElevationSigma(sigma);
  }
  if (isAtFrame_)
  {
    frames_->ShowFrame(frame_);
  }
  Render(true);
  return false;
}

/// On a plane it moves the plane, on the scene VTK's style zooms.
bool ViewWindow::OnWheel(vtkObject*, unsigned long event, void*)
{
  vtkRenderer* const under = UnderMouse();
  if (PlaneView* view = planes_.In(under))
  {
    view->Move(event == vtkCommand::MouseWheelForwardEvent ? kWheelStep : -kWheelStep);
    planes_.Cross();
    Render(true);
  }
  return under != scene_.cell.renderer;
}

ViewCell* ViewWindow::FlatUnderMouse()
{
  vtkRenderer* const under = UnderMouse();
  if (PlaneView* view = planes_.In(under))
  {
    return view;
  }
  if (frames_)
  {
    for (ViewCell* cell : frames_->Cells())
    {
      if (cell->renderer == under)
      {
        return cell;
      }
    }
  }
  return nullptr;
}

/// Only the scene turns; on flat views the left button measures, and the right one ends that.
bool ViewWindow::OnButton(vtkObject*, unsigned long event, void*)
{
  if (ViewCell* cell = FlatUnderMouse())
  {
    const int* at = interactor_->GetEventPosition();
    const auto about = [&](const std::vector<Eigen::Vector3d>& points) { return About(cell, points); };
    const std::string words = event == vtkCommand::LeftButtonPressEvent ? cell->measure.Add(at[0], at[1], about)
                              : event == vtkCommand::LeftButtonReleaseEvent
                                  ? cell->measure.AddIfDragged(at[0], at[1], about)
                                  : "";
    if (event == vtkCommand::RightButtonPressEvent)
    {
      cell->measure.Clear();
    }
    if (!words.empty())
    {
      console_.Note(words);
    }
    Render(true);
  }
  return event != vtkCommand::LeftButtonReleaseEvent && UnderMouse() != scene_.cell.renderer;
}

/// Keys of kept planes; true where it was one.
bool ViewWindow::OnPlaneKey(const std::string& key)
{
  if (key == "k")
  {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(scene_.Slice()->GetPlane()->GetData());
    kept_.push_back(rows);
    shownKept_ = kept_.size();
  }
  else if (key == "n" && !kept_.empty())
  {
    shownKept_ = shownKept_ % kept_.size() + 1;
    scene_.SetPlane(kept_[shownKept_ - 1]);
    ShowMoved();
  }
  else if (key == "BackSpace" && shownKept_ > 0)
  {
    kept_.erase(kept_.begin() + static_cast<std::ptrdiff_t>(shownKept_ - 1));
    shownKept_ = 0;
  }
  else
  {
    return false;
  }
  controls_.ListKept(kept_.size(), shownKept_);
  return true;
}

bool ViewWindow::OnKey(vtkObject*, unsigned long, void*)
{
  const char* const symbol = interactor_->GetKeySym();
  const std::string key = symbol ? symbol : "";
  const bool isPlain = !interactor_->GetShiftKey() && !interactor_->GetControlKey();
  const std::size_t part = key.size() == 1 ? key[0] - '1' : kViewParts.size();
  if (key == "q" || key == "Escape")
  {
    interactor_->TerminateApp();
  }
  else if (isPlain && (key == "Left" || key == "Right" || key == "Home" || key == "End" || key == "f"))
  {
    if (sweep_)
    {
      ShowFrame(key == "Left"    ? frame_ - 1
                : key == "Right" ? frame_ + 1
                : key == "Home"  ? 0
                : key == "End"   ? sweep_->NumberOfFrames() - 1
                                 : frame_);
    }
  }
  else if (part < kViewParts.size())
  {
    scene_.Show(kViewParts[part], !scene_.IsShown(kViewParts[part]));
  }
  else if (key == "c")
  {
    scene_.SetCut(!scene_.IsCut());
  }
  else if (key == "g")
  {
    for (PlaneView& view : planes_.views)
    {
      view.slice->SetCoverageVisibility(!view.slice->GetCoverageVisibility());
    }
  }
  else if (key == "l")
  {
    areCrossingsShown_ = !areCrossingsShown_;
    planes_.ShowCrossings(areCrossingsShown_);
  }
  else if (key == "e")
  {
    areDoubtsShown_ = !areDoubtsShown_;
  }
  else if (key == "o")
  {
    areOutlinesShown_ = !areOutlinesShown_;
  }
  else if (key == "r")
  {
    scene_.LookFromTheStart();
  }
  else if (key == "question" || key == "h" || key == "F1")
  {
    controls_.ToggleHelp();
  }
  else if (key == "s" || key == "w")
  {
    Save(key == "w");
    return true;
  }
  else if (!OnPlaneKey(key))
  {
    isCoarse_ = true;  // the slice's widget may take it
    coarseSince_ = std::chrono::steady_clock::now();
    window_->SetDesiredUpdateRate(kMovingRate);
    return false;
  }
  Render(true);
  return true;
}

//------------------------------------------------------------------------------
// Saving

void ViewWindow::Save(bool isSlice)
{
  try
  {
    const std::string stem = std::filesystem::path(settings_.name).stem().string();
    const std::string name = isSlice ? FreeName(stem + "-slice", ".igs.mha") : FreeName(stem + "-view", ".png");
    isSlice ? WriteSlice(name) : WriteScreenshot(name);
    console_.Note("Saved " + name);
  }
  catch (const Error& error)  // a full disk is no reason to lose the window
  {
    console_.Note(std::string("Not saved: ") + error.what());
  }
}

/// The slice of the view under the mouse, or else the scene's, with its pose.
void ViewWindow::WriteSlice(const std::string& path)
{
  PlaneView* const view = planes_.In(UnderMouse());
  vtkBigusSliceProp* const slice = view ? view->slice.Get() : scene_.Slice();
  slice->UpdateSlice();
  const auto stack = NewStack({PlaneOf(slice)}, {}, false);
  SetImage(stack, 0, slice->GetReslice()->GetOutput());
  WriteStack(stack, path, {0}, console_);
}

void ViewWindow::WriteScreenshot(const std::string& path)
{
  Render(false);
  vtkNew<vtkWindowToImageFilter> grab;
  grab->SetInput(window_);
  grab->ReadFrontBufferOff();
  grab->ShouldRerenderOff();
  vtkNew<vtkPNGWriter> writer;
  writer->SetInputConnection(grab->GetOutputPort());
  writer->WriteToMemoryOn();
  writer->Write();
  vtkUnsignedCharArray* png = writer->GetResult();
  WriteAtomically(path, [png](std::ostream& file)
                  { file.write(reinterpret_cast<const char*>(png->GetPointer(0)), png->GetNumberOfValues()); });
}

}  // namespace bigus::command
