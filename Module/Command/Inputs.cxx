// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Inputs.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <map>
#include <numeric>
#include <sstream>

#include "Command.h"
#include "Core/Numerics/Checksum.h"
#include "Core/Poses/PoseDoubts.h"
#include "Core/Trainer/Provenance.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "Data/SweepData.h"
#include "Files.h"
#include "IO/Poses.h"
#include "IO/SequenceFile.h"
#include "Pipeline.h"
#include "vtkAbstractArray.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusFieldWriter.h"
#include "vtkBigusPoseReader.h"
#include "vtkBigusSequenceReader.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkTable.h"

namespace bigus::command
{

namespace
{

const char* const sequenceGroup = "How the sequence is read";
const char* const planeGroup = "Which planes";

void AddChainOptions(CLI::App& app, PoseChain& chain, const char* group)
{
  app.add_option("--config", chain.config, "Plus configuration with transforms the sequence lacks (ImageToProbe)")
      ->check(FileToRead(".xml"))
      ->type_name("PLUS.xml")
      ->group(group);
  app.add_option("--image-to", chain.to, "Coordinate frame the poses lead to")
      ->type_name("NAME")
      ->capture_default_str()
      ->group(group);
  app.add_option("--image-from", chain.from, "Coordinate frame the poses lead from")
      ->type_name("NAME")
      ->capture_default_str()
      ->group(group);
  app.add_option("--pixel-spacing", chain.pixelSpacing,
                 "The size of a pixel along columns and rows, where the transforms do not say it; pixel (0, 0) stays")
      ->expected(2)
      ->delimiter(',')
      ->check(PositiveNumber())
      ->type_name("MM MM")
      ->group(group);
  app.add_flag("--assume-status", chain.assumeStatus, "Accept transforms that carry no status")->group(group);
}

/// What the readers of sequences and of poses have in common.
template <class Reader>
void SetFileAndChain(Reader* reader, const std::string& path, const PoseChain& chain)
{
  RequireFile(path);
  reader->SetFileName(path.c_str());
  reader->SetFromFrame(chain.from.c_str());
  reader->SetToFrame(chain.to.c_str());
  if (!chain.pixelSpacing.empty())
  {
    reader->SetImageSpacing(chain.pixelSpacing[0], chain.pixelSpacing[1]);
  }
  reader->SetAssumeMissingStatusOK(chain.assumeStatus);
  if (!chain.config.empty())
  {
    RequireFile(chain.config);
    reader->SetConfigFileName(chain.config.c_str());
  }
}

void NoteRejected(vtkBigusSequenceReader* reader, const std::string& path, Console& console)
{
  if (reader->GetNumberOfRejectedFrames() > 0)
  {
    console.Note(path + ": " + reader->GetRejectionSummary());
  }
}

/// Square pixels of another size on the same plane, its upper left corner kept.
SlicePlane WithSteps(SlicePlane plane, const Eigen::Vector3d& columnStep, const Eigen::Vector3d& rowStep)
{
  plane.origin += 0.5 * (columnStep - plane.columnStep + rowStep - plane.rowStep);
  plane.columnStep = columnStep;
  plane.rowStep = rowStep;
  return plane;
}

SlicePlane Adapted(SlicePlane plane, const PlaneOptions& options)
{
  const bool known = plane.width > 0 && plane.height > 0;
  if (options.spacing > 0)
  {
    const double columnSide = plane.columnStep.norm(), rowSide = plane.rowStep.norm();
    const auto pixels = [&options](int count, double side)
    { return static_cast<int>(std::min(std::max(std::round(count * side / options.spacing), 1.0), 1e6)); };
    if (known)
    {
      plane.width = pixels(plane.width, columnSide);
      plane.height = pixels(plane.height, rowSide);
    }
    plane = WithSteps(plane, plane.columnStep * (options.spacing / columnSide),
                      plane.rowStep * (options.spacing / rowSide));
  }
  if (options.reduce > 1)
  {
    plane.width /= options.reduce;
    plane.height /= options.reduce;
    plane = WithSteps(plane, plane.columnStep * options.reduce, plane.rowStep * options.reduce);
    if (known && (plane.width < 1 || plane.height < 1))
    {
      throw Error("--reduce " + std::to_string(options.reduce) + " leaves no pixel of the planes.");
    }
  }
  if (!options.size.empty())
  {
    plane.width = options.size[0];
    plane.height = options.size[1];
  }
  else if (!known)
  {
    throw Error(options.poses + " does not say how large the planes are: give --size WIDTH HEIGHT.");
  }
  return plane;
}

}  // namespace

std::vector<int> ParseFrames(const std::string& list, int count)
{
  const auto fault = [&list, count]() -> Error
  {
    return Error("--frames '" + list + "': expected numbers and ranges such as 0,4,10-20, from 0 to " +
                 std::to_string(count - 1) + ".");
  };
  std::vector<int> frames;
  const char* at = list.data();
  const char* end = at + list.size();
  while (true)
  {
    int first = 0;
    auto [stop, error] = std::from_chars(at, end, first);
    int last = first;
    if (error == std::errc() && stop != end && *stop == '-')
    {
      const auto upper = std::from_chars(stop + 1, end, last);
      stop = upper.ptr;
      error = upper.ec;
    }
    if (error != std::errc() || first < 0 || last < first || last >= count)
    {
      throw fault();
    }
    for (int frame = first; frame <= last; ++frame)
    {
      frames.push_back(frame);
    }
    if (stop == end)
    {
      return frames;
    }
    if (*stop != ',')
    {
      throw fault();
    }
    at = stop + 1;
  }
}

vtkSmartPointer<vtkImageData> ChosenFrames(vtkImageData* stack, const std::vector<int>& frames)
{
  const int* size = stack->GetDimensions();
  const vtkIdType pixels = vtkIdType(size[0]) * size[1], count = size[2];
  auto chosen = vtkSmartPointer<vtkImageData>::New();
  chosen->SetDimensions(size[0], size[1], static_cast<int>(frames.size()));
  chosen->AllocateScalars(stack->GetScalarType(), 1);
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    chosen->GetPointData()->GetScalars()->InsertTuples(static_cast<vtkIdType>(k) * pixels, pixels, frames[k] * pixels,
                                                       stack->GetPointData()->GetScalars());
  }
  vtkFieldData* all = stack->GetFieldData();
  for (int a = 0; a < all->GetNumberOfArrays(); ++a)
  {
    vtkAbstractArray* array = all->GetAbstractArray(a);
    if (array->GetNumberOfTuples() != count || std::string(array->GetName()) == "Mask")  // which has a value a pixel
    {
      chosen->GetFieldData()->AddArray(array);
      continue;
    }
    vtkSmartPointer<vtkAbstractArray> part;
    part.TakeReference(array->NewInstance());
    part->SetName(array->GetName());
    part->SetNumberOfComponents(array->GetNumberOfComponents());
    for (const int frame : frames)
    {
      part->InsertNextTuple(frame, array);
    }
    chosen->GetFieldData()->AddArray(part);
  }
  return chosen;
}

std::string FileName(const std::string& path)
{
  return std::filesystem::path(path).filename().string();
}

void RequireFile(const std::string& path)
{
  std::error_code ignored;
  Require(std::filesystem::exists(path, ignored), "There is no file '", path, "'.");
  Require(!std::filesystem::is_directory(path, ignored), "'", path, "' is a folder; name a file.");
}

void AddSequenceOptions(CLI::App& app, SequenceOptions& options, const std::string& name, const std::string& help)
{
  app.add_option(name, options.path, help)->check(FileToRead(kSequenceEndings))->required()->type_name("");
  AddChainOptions(app, options.chain, sequenceGroup);
  app.add_option("--image-folder", options.imageFolder, "Where the PNG images of a CSV are; default: beside it")
      ->type_name("FOLDER")
      ->group(sequenceGroup);
  app.add_option("--image-pattern", options.imagePattern, "Their names when the CSV has none, such as frame_%04d.png")
      ->type_name("PATTERN")
      ->group(sequenceGroup);
  app.add_option("--pixel-range", options.pixelRange,
                 "The pixel that is shown as white; default: 4095 where 16-bit pixels use 12 bits, and so on; 255 for "
                 "float pixels of that range")
      ->check(PositiveNumber())
      ->type_name("MAX")
      ->group(sequenceGroup);
  CLI::Option* rectangle =
      app.add_option("--clip-rectangle", options.clipRectangle, "Blacken what is outside: column, row, columns, rows")
          ->expected(4)
          ->delimiter(',')
          ->check(WholeNumberIn(0, 32768))
          ->type_name("I J W H")
          ->group(sequenceGroup);
  app.add_option("--clip-fan", options.clipFan,
                 "Blacken what is outside: apex i j, inner and outer radius (pixels), first and last angle (degrees "
                 "from +j towards +i)")
      ->expected(6)
      ->delimiter(',')
      ->check(NumberIn(-1e6, 1e6))
      ->type_name("I J R0 R1 A0 A1")
      ->excludes(rectangle)
      ->group(sequenceGroup);
}

void AddReduceOption(CLI::App& app, int& reduce)
{
  app.add_option("--reduce", reduce, "Average N x N pixels first; poses follow")
      ->check(WholeNumberIn(1, 256))
      ->type_name("N")
      ->capture_default_str();
}

vtkSmartPointer<vtkBigusSequenceReader> NewSequenceReader(const SequenceOptions& options)
{
  auto reader = vtkSmartPointer<vtkBigusSequenceReader>::New();
  SetFileAndChain(reader.Get(), options.path, options.chain);
  if (!options.imageFolder.empty())
  {
    reader->SetImageFolder(options.imageFolder.c_str());
  }
  if (!options.imagePattern.empty())
  {
    reader->SetImagePattern(options.imagePattern.c_str());
  }
  reader->SetPixelRange(options.pixelRange);
  // The automatic mask looks at every frame: with it, held-out frames would have a say in training.
  reader->AutoMaskOff();
  if (!options.clipRectangle.empty())
  {
    reader->SetClipModeToRectangle();
    reader->SetClipRectangle(options.clipRectangle[0], options.clipRectangle[1], options.clipRectangle[2],
                             options.clipRectangle[3]);
  }
  if (!options.clipFan.empty())
  {
    reader->SetClipModeToFan();
    reader->SetFanApex(options.clipFan[0], options.clipFan[1]);
    reader->SetFanRadii(options.clipFan[2], options.clipFan[3]);
    reader->SetFanAngles(options.clipFan[4], options.clipFan[5]);
  }
  return reader;
}

vtkSmartPointer<vtkImageData> ReadSequence(const SequenceOptions& options, Console& console)
{
  const auto reader = NewSequenceReader(options);
  Update(reader, console, "Reading");
  NoteRejected(reader, options.path, console);
  return reader->GetOutput();
}

void NoteDoubts(vtkImageData* sequence, const std::string& path, Console& console)
{
  Sweep poses;
  poses.width = sequence->GetDimensions()[0];
  poses.height = sequence->GetDimensions()[1];
  vtkDataArray* matrices = sequence->GetFieldData()->GetArray("ImageToReference");
  for (vtkIdType k = 0; k < matrices->GetNumberOfTuples(); ++k)
  {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose;
    matrices->GetTuple(k, pose.data());
    poses.imageToReference.push_back(pose);
  }
  for (const std::string& doubt : DoubtsAboutPoses(poses, AllFrames(poses)))
  {
    console.Note("bigus: warning: " + path + ": " + doubt);
  }
}

Json FindingsJson(const std::vector<Finding>& findings, const std::vector<int>& numbers)
{
  Json rows = Json::array();
  for (const Finding& finding : findings)
  {
    rows.push_back({{"kind", NameOf(finding.kind)},
                    {"frames", finding.frames.size()},
                    {"pixels", finding.pixels},
                    {"applied", finding.isApplied},
                    {"text", Describe(finding, numbers)}});
  }
  return rows;
}

std::shared_ptr<const Sweep> ReadSweep(const SequenceOptions& options, Console& console)
{
  const vtkSmartPointer<vtkImageData> image = ReadSequence(options, console);
  NoteDoubts(image, options.path, console);
  const std::shared_ptr<const Sweep> sweep = SweepFromImage(image).sweep;
  return options.reduce > 1 ? std::make_shared<const Sweep>(sweep->Reduced(options.reduce)) : sweep;
}

CLI::Option* AddWorldSystemOption(CLI::App& app, WorldSystem& world)
{
  const std::map<std::string, WorldSystem> names = {{"ras", WorldSystem::Ras}, {"lps", WorldSystem::Lps}};
  return app
      .add_option("--world-system,--markup-system", world,
                  "The patient system that the field's world stands for: decides where markups, "
                  "volumes and ITK transforms lie")
      ->transform(CLI::CheckedTransformer(names, CLI::ignore_case).description(""))
      ->type_name("ras|lps")
      ->default_str("ras");
}

void AddPlaneOptions(CLI::App& app, PlaneOptions& options, const std::string& name, const std::string& framesName,
                     const std::string& help, bool required)
{
  app.add_option(name, options.poses, help)
      ->required(required)
      ->check(FileToRead(".mrk.json,.tfm,.h5,.txt," + std::string(kSequenceEndings)))
      ->type_name("SEQUENCE|CSV|MARKUP.mrk.json|TRANSFORM.tfm")
      ->group(planeGroup);
  app.add_option(framesName, options.frames,
                 "Only these, counted from 0 among the usable ones: 0,4,10-20; PNG names have the same numbers")
      ->type_name("LIST")
      ->group(planeGroup);
  app.add_option("--size", options.size, "Pixels across and down; needed when the file does not say")
      ->expected(2)
      ->delimiter(',')
      ->check(WholeNumberIn(1, 65536))
      ->type_name("W H")
      ->group(planeGroup);
  app.add_option("--spacing", options.spacing, "Side of a (square) pixel; default: as in the file, 0.5 for markups")
      ->check(PositiveNumber())
      ->type_name("MM")
      ->group(planeGroup);
  app.add_option("--reduce", options.reduce, "Pixels N times as large, as after 'train --reduce N'")
      ->check(WholeNumberIn(1, 256))
      ->type_name("N")
      ->capture_default_str()
      ->group(planeGroup);
  AddWorldSystemOption(app, options.world)->group(planeGroup);
  AddChainOptions(app, options.chain, planeGroup);
}

Sweep ReadPosesOnly(const SequenceOptions& options)
{
  RequireFile(options.path);
  ImageOptions images;
  images.folder = options.imageFolder;
  images.pattern = options.imagePattern;
  images.wanted = !images.folder.empty() || !images.pattern.empty();  // else a CSV says itself how large frames are
  const SequenceFile file = ReadSequenceFile(options.path, images);
  PoseTable table;
  ResolvePoses(file, PoseOptionsOf(options.chain), table);
  table.RequireFrames(options.path);
  Sweep sweep;
  bool allTimed = true;
  for (std::size_t k = 0; k < table.frames.size(); ++k)
  {
    if (table.frames[k].accepted)
    {
      sweep.imageToReference.push_back(table.frames[k].imageToReference);
      sweep.timestamps.push_back(table.timestamps[k]);
      allTimed = allTimed && std::isfinite(table.timestamps[k]);
      sweep.width = file.width > 0 ? file.width : file.sizes[k][0];
      sweep.height = file.height > 0 ? file.height : file.sizes[k][1];
    }
  }
  sweep.timestamps.resize(allTimed ? sweep.timestamps.size() : 0);
  return sweep;
}

Planes ReadPlanes(const PlaneOptions& options, Console& console)
{
  vtkNew<vtkBigusPoseReader> reader;
  SetFileAndChain(reader.Get(), options.poses, options.chain);
  if (options.spacing > 0)
  {
    reader->SetPixelSpacing(options.spacing);
  }
  if (options.world == WorldSystem::Lps)
  {
    reader->SetWorldCoordinateSystemToLPS();
  }
  Update(reader, console, "Reading");

  vtkTable* table = reader->GetOutput();
  auto column = [table](const char* name) { return vtkDataArray::SafeDownCast(table->GetColumnByName(name)); };
  vtkDataArray* poses = column("ImageToReference");
  vtkDataArray* sizes = column("Size");
  vtkDataArray* times = column("Timestamp");

  std::vector<int> chosen(table->GetNumberOfRows());
  std::iota(chosen.begin(), chosen.end(), 0);
  if (!options.frames.empty())
  {
    chosen = ParseFrames(options.frames, static_cast<int>(chosen.size()));
  }
  Require(!chosen.empty(), options.poses, " holds no plane.");
  Planes result;
  result.rejected = reader->GetNumberOfRejectedPoses();
  if (result.rejected > 0)
  {
    console.Note(options.poses + ": " + reader->GetRejectionSummary());
  }
  std::size_t pixels = 0;
  for (const int i : chosen)
  {
    double row[16];
    poses->GetTuple(i, row);
    const Eigen::Matrix4d pose = Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(row);
    const SlicePlane plane = Adapted(SlicePlane::FromImageToReference(pose, static_cast<int>(sizes->GetComponent(i, 0)),
                                                                      static_cast<int>(sizes->GetComponent(i, 1))),
                                     options);
    plane.Validate(options.poses + ", plane " + std::to_string(i));
    if (!result.planes.empty() && (plane.width != result.planes[0].width || plane.height != result.planes[0].height))
    {
      throw Error(options.poses + ": planes 0 and " + std::to_string(i) +
                  " differ in size; give --size WIDTH HEIGHT, or pick some with --frames.");
    }
    pixels += plane.NumberOfPixels();
    Require(pixels <= (std::size_t(1) << 31),
            "The planes have more than 2^31 pixels: choose fewer with --frames, or a smaller --size.");
    result.planes.push_back(plane);
    result.numbers.push_back(i);
    if (times)
    {
      result.timestamps.push_back(times->GetTuple1(i));
    }
  }
  return result;
}

void RequireFieldName(const std::string& path, bool mayBePieces)
{
  const bool isEnding = !std::filesystem::path(path).has_extension();  // ".vtp" is a name and no extension
  if (isEnding || (!HasSuffix(path, ".vtp") && !HasSuffix(path, ".ply") && !(mayBePieces && HasSuffix(path, ".pvtp"))))
  {
    throw OutputError("Cannot write '" + path + "': the name of a field must end in .vtp" +
                      (mayBePieces ? ", .pvtp" : "") + " or .ply, and have something before that, such as field.vtp.");
  }
}

vtkSmartPointer<vtkPolyData> ReadFieldData(const std::string& path, Console& console)
{
  RequireFile(path);
  vtkNew<vtkBigusFieldReader> reader;
  reader->SetFileName(path.c_str());
  Update(reader, console, "Reading");
  return reader->GetOutput();
}

GaussianField ReadField(const std::string& path, Console& console)
{
  return FieldFromPolyData(ReadFieldData(path, console));
}

std::string TrainedPoses(vtkPolyData* field)
{
  return GetProvenance(field, "poses");
}

PoseOptions PoseOptionsOf(const PoseChain& chain)
{
  PoseOptions options;
  options.fromFrame = chain.from;
  options.toFrame = chain.to;
  options.configFileName = chain.config;
  if (!chain.pixelSpacing.empty())
  {
    options.imageSpacing = {chain.pixelSpacing[0], chain.pixelSpacing[1]};
  }
  options.assumeMissingStatusOK = chain.assumeStatus;
  return options;
}

std::string ChecksumOfPoses(const std::string& path, const PoseChain& chain)
{
  ImageOptions images;
  images.wanted = false;
  PoseTable table;
  try
  {
    ResolvePoses(ReadSequenceFile(path, images), PoseOptionsOf(chain), table);
  }
  catch (const Error&)
  {
    return "";  // whoever needs the poses says what is wrong
  }
  Checksum checksum;
  for (const FramePose& frame : table.frames)
  {
    if (frame.accepted)
    {
      checksum.Add(frame.imageToReference.data(), sizeof(double) * 16);
    }
  }
  return checksum.Text();
}

void NoteTrackedPlanes(vtkPolyData* field, const std::string& sequence, const PoseChain& chain, Console& console)
{
  std::istringstream recorded(GetProvenance(field, "recordedPoses"));
  const std::vector<std::string> checksums{std::istream_iterator<std::string>(recorded), {}};
  const auto found = std::find(checksums.begin(), checksums.end(), ChecksumOfPoses(sequence, chain));
  if (found == checksums.end())
  {
    return;
  }
  const std::string poses =
      checksums.size() == 1 ? TrainedPoses(field)
                            : GetProvenance(field, "poses.sequence" + std::to_string(found - checksums.begin() + 1));
  if (poses.empty() || poses == kAsTracked)
  {
    return;
  }
  console.Note("The field was trained at poses of " + FileName(sequence) + " that were " + poses +
               "; these planes are as tracked. For the frames' own planes give the poses that 'train --write-poses' "
               "wrote.");
}

void WriteFieldData(vtkPolyData* field, const std::string& path, bool isRounded, Console& console, int pieces)
{
  vtkNew<vtkBigusFieldWriter> writer;
  writer->SetInputData(field);
  writer->SetRounding(isRounded);
  writer->SetNumberOfPieces(pieces);
  writer->SetFileName(path.c_str());
  Write(writer, console, "Writing");
}

}  // namespace bigus::command
