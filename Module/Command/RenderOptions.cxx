// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "RenderOptions.h"

#include <CLI/CLI.hpp>

#include "Command.h"
#include "vtkBigusFieldToImage.h"
#include "vtkPolyData.h"

namespace bigus::command
{

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
  filter->SetOutputScalarType(options.IsBytes() ? VTK_UNSIGNED_CHAR : VTK_FLOAT);
}

}  // namespace bigus::command
