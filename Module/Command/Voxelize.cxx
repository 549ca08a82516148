// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus voxelize: the field as a plain volume.
#include <memory>

#include "Command.h"
#include "Files.h"
#include "Inputs.h"
#include "Outputs.h"
#include "Pipeline.h"
#include "RenderOptions.h"
#include "vtkBigusVoxelizer.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

struct Options
{
  RenderOptions render;
  std::string output;
  double spacing = 0, elevationSigma = 0;
  std::vector<double> origin;
  std::vector<int> size;
  WorldSystem world = WorldSystem::Ras;
};

ExitCode Voxelize(Console& console, const Options& options)
{
  RequireVolumeName(options.output);
  RequireDistinct({options.render.field}, {options.output});
  RequireWritable(options.output);
  const vtkSmartPointer<vtkPolyData> field = ReadFieldData(options.render.field, console);

  vtkNew<vtkBigusVoxelizer> voxelizer;
  Configure(voxelizer, field, options.render);
  voxelizer->SetElevationSigma(options.elevationSigma);
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
  const auto start = std::chrono::steady_clock::now();
  Update(voxelizer, console, "Sampling");
  const double seconds = SecondsSince(start);
  vtkImageData* volume = voxelizer->GetOutput();
  WriteVolume(volume, options.output, options.world, console);

  const int* size = volume->GetDimensions();
  const double* spacing = volume->GetSpacing();
  const double* origin = volume->GetOrigin();
  console.Print(options.output + ": " + std::to_string(size[0]) + " x " + std::to_string(size[1]) + " x " +
                std::to_string(size[2]) + " voxels of " + FormatNumber(spacing[0], 3) + " mm, " +
                FormatNumber(seconds, 1) + " s on " + voxelizer->GetDevice());
  console.Report({{"output", options.output},
                  {"size", {size[0], size[1], size[2]}},
                  {"spacing", {spacing[0], spacing[1], spacing[2]}},
                  {"world_system", options.world == WorldSystem::Ras ? "ras" : "lps"},
                  {"origin", {origin[0], origin[1], origin[2]}},
                  {"seconds", seconds},
                  {"device", voxelizer->GetDevice()}});
  return Success;
}

}  // namespace

void AddVoxelize(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app = program.app.add_subcommand("voxelize",
                                             "Turn a field into a plain volume\n"
                                             "  bigus voxelize field.vtp -o volume.mha --spacing 0.5\n"
                                             "Without --origin and --size the volume holds the whole field.");
  app->add_option("-o,--output", options->output, "Volume to write: .mha, .nrrd or .vti")->required()->type_name("OUT");
  app->add_option("--spacing", options->spacing, "Side of a voxel; default: 256 voxels along the longest side")
      ->check(PositiveNumber())
      ->type_name("MM");
  app->add_option("--origin", options->origin, "Centre of the first voxel")
      ->expected(3)
      ->check(NumberIn(-1e6, 1e6))
      ->type_name("X Y Z");
  app->add_option("--size", options->size, "Voxels along each axis")
      ->expected(3)
      ->check(NumberIn(1, 65536))
      ->type_name("I J K");
  app->add_option("--elevation-sigma", options->elevationSigma,
                  "Beam thickness along z; 0 (default) samples the field itself")
      ->check(NumberIn(0, 100))
      ->type_name("MM");
  AddWorldSystemOption(*app, options->world);
  AddRenderOptions(*app, options->render, "Voxels");
  RunWhenChosen(app, program, [options](Console& console) { return Voxelize(console, *options); });
}

}  // namespace bigus::command
