// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus slice: the field seen at any planes.
#include <memory>
#include <numeric>

#include "Command.h"
#include "Core/Engine/Engine.h"
#include "Files.h"
#include "Inputs.h"
#include "Outputs.h"
#include "vtkImageData.h"

namespace bigus::command
{

namespace
{

struct Options
{
  std::string field, output, coverage, mode = "intensity", type = "uchar", engine = "auto";
  PlaneOptions planes;
  double elevationSigma = -1;  ///< mm; negative = the field's
  bool lit = false;            ///< black where no frame of the sequence is lit
};

/// The sequence whose planes these are, masked where none of its frames is lit.
Sweep LitSweep(const PlaneOptions& options, const SlicePlane& plane, Console& console)
{
  SequenceOptions sequence;
  sequence.path = options.poses;
  sequence.chain = options.chain;
  sequence.reduce = options.reduce;
  const std::shared_ptr<const Sweep> sweep = ReadSweep(sequence, console);
  if (sweep->width != plane.width || sweep->height != plane.height)
  {
    throw Error("--lit: slices are " + std::to_string(plane.width) + " x " + std::to_string(plane.height) +
                " pixels, but the images of " + options.poses + " " + std::to_string(sweep->width) + " x " +
                std::to_string(sweep->height) + "; their sizes must agree.");
  }
  std::vector<int> all(sweep->NumberOfFrames());
  std::iota(all.begin(), all.end(), 0);
  return sweep->LitBy(all);
}

/// round(255 I); I lies in [0, 1).
void ToBytes(const std::vector<float>& image, unsigned char* bytes)
{
  for (std::size_t i = 0; i < image.size(); ++i)
  {
    bytes[i] = static_cast<unsigned char>(255.0f * image[i] + 0.5f);
  }
}

ExitCode Slice(Console& console, Options& options)
{
  const bool scattering = options.mode == "scattering";
  const bool bytes = options.type == "uchar" && !scattering;
  RequireDistinct({options.field, options.planes.poses, options.planes.chain.config},
                  {options.output, options.coverage});
  RequireStackName(options.output);
  RequireWritable(options.output);
  if (!options.coverage.empty())
  {
    RequireStackName(options.coverage);
    RequireWritable(options.coverage);
  }
  for (const std::string& path : {options.output, options.coverage})
  {
    if (HasSuffix(path, ".png") && (!bytes || path == options.coverage))
    {
      throw OutputError("Cannot write '" + path + "': PNG holds 8-bit intensities; name it .mha or .nrrd.");
    }
  }

  const std::unique_ptr<Engine> engine = Engine::Create(options.engine);
  GaussianField field = ReadField(options.field, console);
  if (options.elevationSigma >= 0)
  {
    field.beam.elevationSigma = options.elevationSigma;
  }
  const Planes planes = ReadPlanes(options.planes, console);
  const int count = static_cast<int>(planes.planes.size());
  const Sweep probe = options.lit ? LitSweep(options.planes, planes.planes[0], console) : Sweep();

  engine->SetAccuracy({1e-4});  // on intensity: a fortieth of a grey level
  engine->SetField(field);

  const auto stack = NewStack(planes.planes, planes.timestamps, bytes);
  const auto coverage = options.coverage.empty() ? nullptr : NewStack(planes.planes, planes.timestamps, false);
  const std::size_t pixels = planes.planes[0].NumberOfPixels();
  std::vector<float> image(pixels);
  const auto start = std::chrono::steady_clock::now();
  for (int k = 0; k < count; ++k)
  {
    float* covered = coverage ? static_cast<float*>(coverage->GetScalarPointer()) + k * pixels : nullptr;
    float* target = bytes ? image.data() : static_cast<float*>(stack->GetScalarPointer()) + k * pixels;
    engine->Render(planes.planes[k], scattering ? ViewOutput::Scattering : ViewOutput::Intensity, target, covered);
    probe.BlackenUnlit(target);
    if (bytes)
    {
      ToBytes(image, static_cast<unsigned char*>(stack->GetScalarPointer()) + k * pixels);
    }
    console.Progress("Slicing", (k + 1.0) / count);
    if (IsInterrupted())
    {
      throw Interrupted();
    }
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  const std::vector<std::string> files = WriteStack(stack, options.output, planes.numbers, console);
  if (coverage)
  {
    WriteStack(coverage, options.coverage, planes.numbers, console);
  }
  console.Print(NameOf(files) + ": " + std::to_string(count) + (count == 1 ? " slice of " : " slices of ") +
                std::to_string(planes.planes[0].width) + " x " + std::to_string(planes.planes[0].height) + " pixels, " +
                FormatNumber(1000 * seconds / count, 1) + " ms each on " + engine->Device());
  console.Report({{"output", files},
                  {"slices", count},
                  {"rejected", planes.rejected},
                  {"width", planes.planes[0].width},
                  {"height", planes.planes[0].height},
                  {"elevation_sigma", field.beam.elevationSigma},
                  {"seconds", seconds},
                  {"device", engine->Device()}});
  return Success;
}

}  // namespace

void AddSlice(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app =
      program.app.add_subcommand("slice",
                                 "See a field at any planes\n"
                                 "  bigus slice field.vtp --poses sweep.igs.mha -o again.igs.mha\n"
                                 "  bigus slice field.vtp --poses plane.mrk.json --spacing 0.2 -o slice.png\n"
                                 "A plane that misses the field gives a black image.");
  app->add_option("FIELD", options->field, "Field: .vtp or .ply")->required()->type_name("");
  app->add_option("-o,--output", options->output,
                  "Images to write: .mha or .nrrd (with poses), .png (numbered if many)")
      ->required()
      ->type_name("OUT");
  AddPlaneOptions(*app, options->planes, "--poses", "--frames",
                  "Planes: those of a sequence, a CSV of poses, markup planes", true);
  app->add_option("--elevation-sigma", options->elevationSigma,
                  "Beam thickness, standard deviation; 0 an infinitely thin plane; default: the field's")
      ->check(NumberIn(0, 100))
      ->type_name("MM");
  app->add_flag("--lit", options->lit,
                "Black where no frame of the SEQUENCE is lit, as the probe's own pictures are and held-out "
                "frames are scored; reads its images")
      ->excludes(app->get_option("--size"), app->get_option("--spacing"));
  app->add_option("--mode", options->mode, "intensity (default), or scattering: signed, before compression, float")
      ->check(CLI::IsMember({"intensity", "scattering"}).description(""))
      ->type_name("MODE");
  app->add_option("--type", options->type, "Pixels of intensity: uchar (default, 0 to 255) or float (0 to 1)")
      ->check(CLI::IsMember({"uchar", "float"}).description(""))
      ->type_name("TYPE");
  app->add_option("--coverage", options->coverage,
                  "Also write the footprints' sum, 0 where no Gaussian is: .mha, .nrrd")
      ->type_name("OUT");
  app->add_option("--engine", options->engine, "What computes: auto, or a name from 'bigus info --devices'")
      ->type_name("NAME")
      ->capture_default_str();

  Console& console = program.console;
  app->callback([&program, &console, options]
                { program.job = [&console, options] { return Slice(console, *options); }; });
}

}  // namespace bigus::command
