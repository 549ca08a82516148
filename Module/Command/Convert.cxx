// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus convert: fields between .vtp, .pvtp and .ply, any tracked sequence to .igs.mha.
#include <cmath>
#include <memory>
#include <numeric>

#include "Command.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "Files.h"
#include "IO/FieldFile.h"
#include "IO/Formats/LinearTransform.h"
#include "Inputs.h"
#include "Outputs.h"
#include "Pipeline.h"
#include "vtkBigusTransformField.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkPolyData.h"
#include "vtkTransform.h"

namespace bigus::command
{

namespace
{

struct ConvertOptions
{
  SequenceOptions input;
  std::string output;
  std::string frames;     ///< of a sequence, as in "0,4,10-20"; empty: all
  std::string transform;  ///< file; empty: none
  bool inverse = false;
  WorldSystem world = WorldSystem::Ras;
  int pieces = FieldChunks::kUsual;  ///< of a .pvtp
  bool round = false;
  bool strip = false;
};

/// The way of a field's points, in the coordinates of its world.
vtkSmartPointer<vtkTransform> FieldTransform(const ConvertOptions& options)
{
  RequireFile(options.transform);
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix =
      ReadObjectMatrix(options.transform, options.world == WorldSystem::Lps);
  auto transform = vtkSmartPointer<vtkTransform>::New();
  transform->SetMatrix(matrix.data());
  if (options.inverse)
  {
    Require(std::abs(matrix.determinant()) > 0, options.transform, ": the transform has no inverse.");
    transform->Inverse();
  }
  return transform;
}

/// Times often count from a date; what computes with them looks at their differences.
void BeginTimesAtZero(vtkImageData* sequence)
{
  vtkDataArray* times = sequence->GetFieldData()->GetArray("Timestamp");
  if (!times)
  {
    return;
  }
  const double first = times->GetRange()[0];
  for (vtkIdType k = 0; k < times->GetNumberOfTuples(); ++k)
  {
    times->SetComponent(k, 0, times->GetComponent(k, 0) - first);
  }
}

ExitCode Convert(Console& console, const ConvertOptions& options)
{
  const std::string& input = options.input.path;
  const std::string& output = options.output;
  RequireFile(input);
  const std::vector<std::string> outputs = FilesOfField(output, options.pieces);
  RequireDistinct({input, options.input.chain.config, options.transform}, outputs);
  for (const std::string& file : outputs)
  {
    RequireWritable(file);
  }

  if (IsPolyData(input))
  {
    if (!options.frames.empty())
    {
      throw Error("--frames chooses frames of a sequence, and '" + input + "' is a field.");
    }
    RequireFieldName(output, true);
    vtkSmartPointer<vtkPolyData> field = ReadFieldData(input, console);
    if (!options.transform.empty())
    {
      vtkNew<vtkBigusTransformField> mover;
      mover->SetInputData(field);
      mover->SetTransform(FieldTransform(options));
      Update(mover, console, "Moving");
      field = mover->GetOutput();
    }
    if (options.strip)
    {
      ReplaceProvenance(field, {});
      ReplaceStandardError(field, {});  // it has the poses
    }
    WriteFieldData(field, output, options.round, console, options.pieces);
    console.Print(output + ": " + std::to_string(field->GetNumberOfPoints()) + " Gaussians");
    console.Report({{"output", output}, {"kind", "field"}, {"gaussians", field->GetNumberOfPoints()}});
    return Success;
  }

  Require(options.transform.empty() && !options.round, options.round ? "--round rounds" : "--transform moves",
          " fields (.vtp, .ply), and '", input, "' is none.");
  RequireStackName(output);
  vtkSmartPointer<vtkImageData> sequence = ReadSequence(options.input, console);
  NoteDoubts(sequence, options.input.path, console);
  std::vector<int> numbers(sequence->GetDimensions()[2]);
  std::iota(numbers.begin(), numbers.end(), 0);
  if (!options.frames.empty())
  {
    numbers = ParseFrames(options.frames, static_cast<int>(numbers.size()));
    sequence = ChosenFrames(sequence, numbers);
  }
  if (options.strip)
  {
    BeginTimesAtZero(sequence);
  }
  const std::size_t frames = numbers.size();
  RequireOutput(!HasSuffix(output, ".png") || sequence->GetScalarType() == VTK_UNSIGNED_CHAR, "Cannot write '", output,
                "': PNG holds 8-bit intensities; name it .igs.mha or .nrrd.");
  const std::vector<std::string> files = WriteStack(sequence, output, numbers, console);
  console.Print(NameOf(files) + ": " + std::to_string(frames) + (frames == 1 ? " frame" : " frames"));
  console.Report({{"output", files}, {"kind", "sequence"}, {"frames", frames}});
  return Success;
}

}  // namespace

void AddConvert(Program& program)
{
  auto options = std::make_shared<ConvertOptions>();
  CLI::App* app = program.app.add_subcommand(
      "convert",
      "Rewrite a field or a sequence in another format\n"
      "  bigus convert field.vtp field.ply                           for viewers of Gaussian splats\n"
      "  bigus convert plus.mha sweep.igs.mha --config Plus.xml      poses resolved to ImageToReference\n"
      "  bigus convert sweep.igs.mha middle.igs.mha --frames 20-59   a part of a sweep\n"
      "  bigus convert field.vtp placed.vtp --transform patient.tfm  moved as 3D Slicer would move it\n"
      "  bigus convert field.vtp stranger.vtp --strip                nothing but what shows it\n"
      "  bigus convert field.vtp field.pvtp --pieces 16              an index and 16 files, for several processes\n"
      "Rejected frames of a sequence are left out.");
  AddSequenceOptions(*app, options->input, "INPUT", "Field (.vtp .pvtp .ply) or sequence (.mha .mhd .nrrd .csv)");
  app->add_option("OUTPUT", options->output, "Field: .vtp, .pvtp or .ply; sequence: .igs.mha, .nrrd or .png (numbered)")
      ->required()
      ->type_name("");
  app->add_option("--pieces", options->pieces,
                  "Of a .pvtp: files to split the field into, so that processes read it piecewise; a power of two")
      ->check(WholeNumberIn(1, FieldChunks::kMost))
      ->type_name("N")
      ->capture_default_str();
  app->add_option(
         "--frames", options->frames,
         "Of a sequence: only these frames, such as 0,4,10-20, counted from 0 without those that are rejected, in the "
         "order given")
      ->type_name("LIST");
  app->add_flag("--round", options->round,
                "Of a field: drop the digits that no picture shows (by less than 0.01 dB), as 'train' does");
  app->add_flag(
      "--strip", options->strip,
      "Of a field: without its provenance and standard error. Of a sequence: times begin at 0. Nothing else of a header is ever "
      "taken along");
  const char* const group = "Moving a field";
  CLI::Option* transform =
      app->add_option(
             "--transform", options->transform,
             "Turn, move, mirror or scale the field. An ITK or 3D Slicer transform moves it as Slicer moves what "
             "is under it; 16 numbers, row by row, map its points")
          ->type_name("FILE.tfm|FILE.h5|FILE.txt")
          ->group(group);
  app->add_flag("--inverse", options->inverse, "The other way round")->needs(transform)->group(group);
  AddWorldSystemOption(*app, options->world)->needs(transform)->group(group);

  RunWhenChosen(app, program, [options](Console& console) { return Convert(console, *options); });
}

}  // namespace bigus::command
