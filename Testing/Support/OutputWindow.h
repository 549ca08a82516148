// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// VTK's output window, whose text can be asked for; ParaView's is another one of the same kind.
#pragma once

#include <string>
#include <utility>

#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkOutputWindow.h"
#include "vtkSmartPointer.h"

namespace bigus::test
{

/// Stands in for VTK's window while it lives.
class OutputWindow
{
public:
  OutputWindow() { vtkOutputWindow::SetInstance(window_); }
  ~OutputWindow() { vtkOutputWindow::SetInstance(before_); }
  OutputWindow(const OutputWindow&) = delete;
  OutputWindow& operator=(const OutputWindow&) = delete;

  /// What was shown since the last call.
  std::string Take() { return std::exchange(window_->text, {}); }

private:
  class Window : public vtkOutputWindow
  {
  public:
    static Window* New() { VTK_STANDARD_NEW_BODY(Window); }
    vtkTypeMacro(Window, vtkOutputWindow);
    void DisplayText(const char* shown) override { text += shown; }
    std::string text;
  };

  vtkSmartPointer<vtkOutputWindow> before_ = vtkOutputWindow::GetInstance();
  vtkNew<Window> window_;
};

}  // namespace bigus::test
