// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus voxelize: the field as a plain volume.
#include <algorithm>
#include <cmath>
#include <memory>

#include "Command.h"
#include "Files.h"
#include "IO/Formats/Markups.h"
#include "IO/Formats/VolumeGrid.h"
#include "Inputs.h"
#include "Outputs.h"
#include "Pipeline.h"
#include "RenderOptions.h"
#include "vtkBigusVoxelizer.h"
#include "vtkImageData.h"
#include "vtkMatrix3x3.h"
#include "vtkNew.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

constexpr int kMostVoxels = 32768;  // along an axis: as many as are read

struct VoxelizeOptions
{
  RenderOptions render;
  std::string output, standardError;
  double spacing = 0, elevationSigma = 0;
  std::vector<double> origin;
  std::vector<int> size;
  std::string like, region;  ///< files
  WorldSystem world = WorldSystem::Ras;
};

void SetGrid(vtkBigusVoxelizer* voxelizer, const VolumeGrid& grid)
{
  const Eigen::Vector3d spacing = grid.steps.colwise().norm();
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> direction = grid.steps.colwise().normalized();
  voxelizer->SetOutputDimensions(grid.size.data());
  voxelizer->SetOutputOrigin(grid.origin.data());
  voxelizer->SetOutputSpacing(spacing.data());
  voxelizer->SetOutputDirection(direction.data());
}

/// Cubes of `spacing` mm that fill the box; 0: `most` of them along its longest side.
VolumeGrid GridOf(const MarkupBox& box, double spacing, int most)
{
  spacing = spacing > 0 ? spacing : box.size.maxCoeff() / most;
  VolumeGrid grid;
  grid.steps = spacing * box.axes;
  grid.origin = box.centre;
  for (int k = 0; k < 3; ++k)
  {
    const double voxels = std::max(1.0, std::round(box.size[k] / spacing));
    Require(voxels <= kMostVoxels, "--spacing: the region would be ", FormatNumber(voxels, 0),
            " voxels long; use a larger spacing.");
    grid.size[k] = static_cast<int>(voxels);
    grid.origin -= 0.5 * (grid.size[k] - 1) * grid.steps.col(k);
  }
  return grid;
}

/// The grid that options ask for, or as much of it as they say.
void SetGrid(vtkBigusVoxelizer* voxelizer, const VoxelizeOptions& options)
{
  if (options.spacing > 0)
  {
    voxelizer->SetOutputSpacing(options.spacing, options.spacing, options.spacing);
  }
  if (!options.origin.empty())
  {
    voxelizer->SetOutputOrigin(options.origin.data());
  }
  if (!options.size.empty())
  {
    voxelizer->SetOutputDimensions(options.size.data());
  }
  if (!options.like.empty())
  {
    RequireFile(options.like);
    SetGrid(voxelizer, ReadVolumeGrid(options.like, options.world == WorldSystem::Lps));
  }
  if (!options.region.empty())
  {
    RequireFile(options.region);
    SetGrid(voxelizer, GridOf(ReadMarkupBox(options.region, options.world == WorldSystem::Lps), options.spacing,
                              voxelizer->GetMaximumDimension()));
  }
}

ExitCode Voxelize(Console& console, const VoxelizeOptions& options)
{
  RequireVolumeName(options.output);
  RequireDistinct({options.render.field, options.like, options.region}, {options.output, options.standardError});
  RequireWritable(options.output);
  if (!options.standardError.empty())
  {
    RequireVolumeName(options.standardError);
    RequireWritable(options.standardError);
  }
  const vtkSmartPointer<vtkPolyData> field = ReadFieldData(options.render.field, console);

  if (!options.standardError.empty())
  {
    RequireStandardError(field, options.render);
  }
  vtkNew<vtkBigusVoxelizer> voxelizer;
  Configure(voxelizer, field, options.render);
  voxelizer->SetElevationSigma(options.elevationSigma);
  voxelizer->SetGenerateStandardErrorOutput(!options.standardError.empty());
  SetGrid(voxelizer, options);
  const auto start = std::chrono::steady_clock::now();
  Update(voxelizer, console, "Sampling");
  const double seconds = SecondsSince(start);
  vtkImageData* volume = voxelizer->GetOutput();
  WriteVolume(volume, options.output, options.world, console);
  if (!options.standardError.empty())
  {
    WriteVolume(voxelizer->GetStandardErrorOutput(), options.standardError, options.world, console);
  }

  const int* size = volume->GetDimensions();
  const double* spacing = volume->GetSpacing();
  const double* origin = volume->GetOrigin();
  const Eigen::Matrix3d steps =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(volume->GetDirectionMatrix()->GetData()) *
      Eigen::Map<const Eigen::Vector3d>(spacing).asDiagonal();
  const bool meets = NoteMisses(
      field, {{Eigen::Map<const Eigen::Vector3d>(origin), steps, {size[0], size[1], size[2]}}}, options.world, console);
  const Json answer = {{"output", options.output},
                       {"size", {size[0], size[1], size[2]}},
                       {"spacing", {spacing[0], spacing[1], spacing[2]}},
                       {"world_system", options.world == WorldSystem::Ras ? "ras" : "lps"},
                       {"origin", {origin[0], origin[1], origin[2]}},
                       {"meets_field", meets},
                       {"seconds", seconds},
                       {"device", voxelizer->GetDevice()}};
  console.Print("{output}: {size/0} x {size/1} x {size/2} voxels of {spacing/0:3} mm, {seconds:1} s on {device}",
                answer);
  console.Report(answer);
  return Success;
}

}  // namespace

void AddVoxelize(Program& program)
{
  auto options = std::make_shared<VoxelizeOptions>();
  CLI::App* app = program.app.add_subcommand("voxelize",
                                             "Turn a field into a plain volume\n"
                                             "  bigus voxelize field.vtp -o volume.mha --spacing 0.5\n"
                                             "Without --origin and --size the volume holds the whole field.");
  app->add_option("-o,--output", options->output, "Volume to write: .mha, .nrrd or .vti")
      ->check(VolumeToWrite(kVolumeEndings))
      ->required()
      ->type_name("OUT");
  app->add_option("--spacing", options->spacing, "Side of a voxel; default: 256 voxels along the longest side")
      ->check(PositiveNumber())
      ->type_name("MM");
  app->add_option("--origin", options->origin, "Centre of the first voxel")
      ->expected(3)
      ->delimiter(',')
      ->check(NumberIn(-1e6, 1e6))
      ->type_name("X Y Z");
  app->add_option("--size", options->size, "Voxels along each axis")
      ->expected(3)
      ->delimiter(',')
      ->check(WholeNumberIn(1, kMostVoxels))
      ->type_name("I J K");
  CLI::Option* like =
      app->add_option("--like", options->like,
                      "The grid of this volume: size, spacing, place and directions. Of .nrrd and .mha, "
                      "whose voxels are not read")
          ->check(VolumeToRead(".nrrd,.nhdr,.mha,.mhd"))
          ->type_name("VOLUME")
          ->excludes("--spacing", "--origin", "--size");
  app->add_option("--region", options->region,
                  "The box that a region of interest of 3D Slicer encloses, turned as it is")
      ->check(FileToRead(".mrk.json"))
      ->type_name("ROI.mrk.json")
      ->excludes("--origin", "--size")
      ->excludes(like);
  app->add_option("--elevation-sigma", options->elevationSigma, "Beam thickness along z; 0 samples the field itself")
      ->check(NumberIn(0, 100))
      ->type_name("MM")
      ->capture_default_str();
  app->add_option(
         "--standard-error", options->standardError,
         "Also write how far what a probe would show may be from every voxel, a standard deviation in units of "
         "intensity, NaN where not known. The probe sees along the volume's z slices: .mha, .nrrd or .vti")
      ->check(VolumeToWrite(kVolumeEndings))
      ->type_name("OUT");
  AddWorldSystemOption(*app, options->world);
  AddRenderOptions(*app, options->render, "Voxels");
  RunWhenChosen(app, program, [options](Console& console) { return Voxelize(console, *options); });
}

}  // namespace bigus::command
