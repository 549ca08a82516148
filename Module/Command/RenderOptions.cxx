// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "RenderOptions.h"

#include <CLI/CLI.hpp>
#include <Eigen/LU>
#include <algorithm>

#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "vtkBigusFieldToImage.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

constexpr double kReach = 3;  // standard deviations

bool Meets(const GaussianField& field, const PointGrid& grid)
{
  const Eigen::Matrix3d toGrid = grid.steps.inverse();
  const Eigen::Array3d last = Eigen::Array3i(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1).cast<double>();
  const Eigen::Array3d step = grid.steps.colwise().norm().transpose().array();
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    const Eigen::Array3d at = toGrid * (field.means[i] - grid.origin);
    const Eigen::Array3d reach = kReach * field.scales[i].maxCoeff() / step;
    if ((at >= -reach).all() && (at <= last + reach).all())
    {
      return true;
    }
  }
  return false;
}

/// Of the label that the field calls so, or whose value that is.
int ValueOf(const std::string& name, const std::vector<Label>& labels)
{
  std::string known;
  for (const Label& label : labels)
  {
    if (label.name == name || std::to_string(label.value) == name)
    {
      return label.value;
    }
    known += (known.empty() ? "" : ", ") + label.name + " (" + std::to_string(label.value) + ")";
  }
  throw Error("--label: the field has no label " + name + "; " +
              (known.empty() ? "'bigus label' gives it some." : "it has " + known + "."));
}

}  // namespace

void AddRenderOptions(CLI::App& app, RenderOptions& options, const std::string& elements)
{
  const auto choice =
      [&app](const char* name, std::string& value, const std::string& help, const std::vector<std::string>& values)
  {
    app.add_option(name, value, help)
        ->check(CLI::IsMember(values).description(""))
        ->type_name(CLI::detail::join(values, "|"))
        ->capture_default_str();
  };
  app.add_option("FIELD", options.field, "Field: .vtp or .ply")
      ->check(FileToRead(kFieldEndingsToRead))
      ->required()
      ->type_name("");
  choice("--mode", options.mode, "What a pixel is; scattering: signed, before compression, float",
         {"intensity", "scattering"});
  choice("--type", options.type, elements + " of intensity: uchar (0 to 255) or float (0 to 1)", {"uchar", "float"});
  app.add_option(
         "--label", options.label,
         "Show how much of each pixel has this label of the field, a name or a value, instead: 0 to 1, its border "
         "at 0.5")
      ->type_name("LABEL")
      ->excludes("--mode");
  app.add_option("--engine", options.engine, "What computes: auto, or a name from 'bigus info --devices'")
      ->type_name("NAME")
      ->capture_default_str();
}

void Configure(vtkBigusFieldToImage* filter, vtkPolyData* field, const RenderOptions& options)
{
  filter->SetInputData(field);
  filter->SetEngine(options.engine.c_str());
  filter->SetOutputMode(options.IsScattering() ? vtkBigusFieldToImage::ScatteringField
                                               : vtkBigusFieldToImage::Intensity);
  if (!options.label.empty())
  {
    filter->SetLabelValue(ValueOf(options.label, LabelNamesOf(field)));
    filter->SetOutputModeToLabelShare();
  }
  filter->SetOutputScalarType(options.IsBytes() ? VTK_UNSIGNED_CHAR : VTK_FLOAT);
}

void RequireStandardError(vtkPolyData* field, const RenderOptions& options)
{
  Require(!StandardErrorOf(field).empty(), "--standard-error: ", options.field,
          " does not hold what it rests on; train it again, into a .vtp and without --no-standard-error.");
}

bool NoteMisses(vtkPolyData* field, const std::vector<PointGrid>& grids, WorldSystem world, Console& console)
{
  const GaussianField gaussians = FieldFromPolyData(field);
  const auto meetsAny = [&gaussians](const std::vector<PointGrid>& all)
  { return std::any_of(all.begin(), all.end(), [&](const PointGrid& grid) { return Meets(gaussians, grid); }); };
  if (meetsAny(grids))
  {
    return true;
  }
  std::vector<PointGrid> turned = grids;
  for (PointGrid& grid : turned)  // RAS and LPS differ by half a turn about the third axis
  {
    grid.origin.head<2>() *= -1;
    grid.steps.topRows<2>() *= -1;
  }
  console.Note(std::string("bigus: warning: what was asked for does not meet the field, so it is black.") +
               (meetsAny(turned) ? std::string(" It would meet it in the other patient system: --world-system ") +
                                       (world == WorldSystem::Ras ? "lps" : "ras") + "."
                                 : ""));
  return false;
}

}  // namespace bigus::command
