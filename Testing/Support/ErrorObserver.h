// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a VTK algorithm complains of, caught instead of printed.
#pragma once

#include <string>
#include <vector>

#include "vtkAlgorithm.h"
#include "vtkCallbackCommand.h"
#include "vtkExecutive.h"
#include "vtkNew.h"

namespace bigus::test
{

/// Collects the errors of one algorithm. Those of its executive, which repeats that the algorithm failed, are
/// kept off the screen but not collected.
class ErrorObserver
{
public:
  explicit ErrorObserver(vtkAlgorithm* algorithm) : algorithm_(algorithm)
  {
    collect_->SetClientData(&errors_);
    collect_->SetCallback(
        [](vtkObject*, unsigned long, void* errors, void* text)
        { static_cast<std::vector<std::string>*>(errors)->emplace_back(static_cast<const char*>(text)); });
    ignore_->SetCallback([](vtkObject*, unsigned long, void*, void*) {});
    algorithm->AddObserver(vtkCommand::ErrorEvent, collect_);
    algorithm->AddObserver(vtkCommand::WarningEvent, collect_);
    algorithm->GetExecutive()->AddObserver(vtkCommand::ErrorEvent, ignore_);
  }

  ~ErrorObserver()
  {
    algorithm_->RemoveObserver(collect_);
    algorithm_->GetExecutive()->RemoveObserver(ignore_);
  }
  ErrorObserver(const ErrorObserver&) = delete;
  ErrorObserver& operator=(const ErrorObserver&) = delete;

  const std::vector<std::string>& Errors() const { return errors_; }

  /// All of them, for messages and searches.
  std::string Text() const
  {
    std::string text;
    for (const std::string& error : errors_)
    {
      text += error;
    }
    return text;
  }

  void Clear() { errors_.clear(); }

private:
  vtkAlgorithm* algorithm_;
  std::vector<std::string> errors_;
  vtkNew<vtkCallbackCommand> collect_;
  vtkNew<vtkCallbackCommand> ignore_;
};

}  // namespace bigus::test
