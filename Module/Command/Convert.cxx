// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus convert: fields between .vtp and .ply, any tracked sequence to .igs.mha.
#include <memory>
#include <numeric>

#include "Command.h"
#include "Files.h"
#include "Inputs.h"
#include "Outputs.h"
#include "vtkBigusFieldReader.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

struct Options
{
  SequenceOptions input;
  std::string output;
};

ExitCode Convert(Console& console, const Options& options)
{
  const std::string& input = options.input.path;
  const std::string& output = options.output;
  RequireFile(input);
  RequireDistinct({input, options.input.chain.config}, {output});
  RequireWritable(output);

  vtkNew<vtkBigusFieldReader> fieldReader;
  if (fieldReader->CanReadFile(input.c_str()))
  {
    RequireFieldName(output);
    const vtkSmartPointer<vtkPolyData> field = ReadFieldData(input, console);
    WriteFieldData(field, output, console);
    console.Print(output + ": " + std::to_string(field->GetNumberOfPoints()) + " Gaussians");
    console.Report({{"output", output}, {"kind", "field"}, {"gaussians", field->GetNumberOfPoints()}});
    return Success;
  }

  RequireStackName(output);
  const vtkSmartPointer<vtkImageData> sequence = ReadSequence(options.input, console);
  const int frames = sequence->GetDimensions()[2];
  std::vector<int> numbers(frames);
  std::iota(numbers.begin(), numbers.end(), 0);
  if (HasSuffix(output, ".png") && sequence->GetScalarType() != VTK_UNSIGNED_CHAR)
  {
    throw OutputError("Cannot write '" + output + "': PNG holds 8-bit intensities; name it .igs.mha or .nrrd.");
  }
  const std::vector<std::string> files = WriteStack(sequence, output, numbers, console);
  console.Print(NameOf(files) + ": " + std::to_string(frames) + (frames == 1 ? " frame" : " frames"));
  console.Report({{"output", files}, {"kind", "sequence"}, {"frames", frames}});
  return Success;
}

}  // namespace

void AddConvert(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app = program.app.add_subcommand(
      "convert",
      "Rewrite a field or a sequence in another format\n"
      "  bigus convert field.vtp field.ply                           for viewers of Gaussian splats\n"
      "  bigus convert plus.mha sweep.igs.mha --config Plus.xml      poses resolved to ImageToReference\n"
      "Rejected frames of a sequence are left out.");
  AddSequenceOptions(*app, options->input, "INPUT", "Field (.vtp .ply) or sequence (.mha .mhd .nrrd .csv)");
  app->add_option("OUTPUT", options->output, "Field: .vtp or .ply; sequence: .igs.mha, .nrrd or .png (numbered)")
      ->required()
      ->type_name("");

  RunWhenChosen(app, program, [options](Console& console) { return Convert(console, *options); });
}

}  // namespace bigus::command
