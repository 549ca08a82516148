// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Whether what a view shows was mostly guessed.
#pragma once

#include <memory>
#include <string>

#include "Core/StandardError/StandardError.h"

class vtkBigusSliceProp;
class vtkPolyData;

namespace bigus::command
{

/// Its pixels, at rest.
SlicePlane PlaneOf(vtkBigusSliceProp* slice);

class ViewDoubts
{
public:
  /// A field that keeps no standard error leaves no doubts. Throws Error where what it keeps is damaged.
  explicit ViewDoubts(vtkPolyData* field);

  /// "mostly guessed", or nothing. Renders the slice.
  std::string About(vtkBigusSliceProp* slice) const;

private:
  std::unique_ptr<const StandardError> kept_;
};

}  // namespace bigus::command
