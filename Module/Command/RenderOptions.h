// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What `slice` and `voxelize` have in common: which field, what a pixel of it shows, and what computes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "Command.h"
#include "Inputs.h"

class vtkBigusFieldToImage;
class vtkPolyData;

namespace CLI
{
class App;
}

namespace bigus::command
{

struct RenderOptions
{
  std::string field;  ///< path
  std::string mode = "intensity", type = "uchar", engine = "auto";
  std::string label;  ///< name or value: its share is shown; empty: the field itself

  bool IsScattering() const { return mode == "scattering"; }
  /// Whether pixels are written as 8 bits; the scattering field never is.
  bool IsBytes() const { return type == "uchar" && !IsScattering(); }
};

/// Adds the positional argument FIELD and --mode, --type (of `elements`: "Pixels" or "Voxels") and --engine.
void AddRenderOptions(CLI::App& app, RenderOptions& options, const std::string& elements);

/// Sets input, mode, type and engine of a filter. Throws Error where the field does not have the label.
void Configure(vtkBigusFieldToImage* filter, vtkPolyData* field, const RenderOptions& options);

/// Throws Error where the field does not hold what --standard-error rests on.
void RequireStandardError(vtkPolyData* field, const RenderOptions& options);

/// Points that are rendered: the first, the steps along each axis as columns, mm, and how many. A plane is one point deep.
struct PointGrid
{
  Eigen::Vector3d origin;
  Eigen::Matrix3d steps;
  std::array<int, 3> size;
};

/// Whether any of the grids comes within three standard deviations of a Gaussian. Where none does, says that all is black,
/// and whether it would not be in the other patient system.
bool NoteMisses(vtkPolyData* field, const std::vector<PointGrid>& grids, WorldSystem world, Console& console);

}  // namespace bigus::command
