// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What subcommands read, and the options that say how: tracked sequences, slice planes, fields.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "Console.h"
#include "Core/Inspection/Inspection.h"
#include "Core/Model/FieldChunks.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"
#include "IO/Poses.h"
#include "vtkSmartPointer.h"

class vtkBigusSequenceReader;
class vtkImageData;
class vtkPolyData;

namespace CLI
{
class App;
class Option;
}  // namespace CLI

namespace bigus::command
{

/// "0,4,10-20" to indices below `count`, in the order given. Throws Error.
std::vector<int> ParseFrames(const std::string& list, int count);
/// These frames of a stack of images, in that order, with what its field data say of each: poses, times, sequences.
vtkSmartPointer<vtkImageData> ChosenFrames(vtkImageData* stack, const std::vector<int>& frames);

/// The last part of a path.
std::string FileName(const std::string& path);

/// How a sequence's poses are found.
struct PoseChain
{
  std::string config;  ///< Plus XML with transforms the sequence lacks
  std::string from = "Image", to = "Reference";
  std::vector<double> pixelSpacing;  ///< mm along columns and rows, instead of the transforms'; empty: theirs
  bool assumeStatus = false;         ///< accept transforms without a status field
};

struct SequenceOptions
{
  std::string path;
  PoseChain chain;
  std::string imageFolder, imagePattern;  ///< where a CSV's PNG images are
  std::vector<int> clipRectangle;         ///< column, row, columns, rows
  std::vector<double> clipFan;            ///< apex i, j, inner and outer radius in pixels, first and last angle
  double pixelRange = 0;                  ///< the pixel shown as white; 0: found from the pixels
  int reduce = 1;                         ///< box-average so many pixels squared
};
/// Adds the positional argument `name` and the options above, but for --reduce.
void AddSequenceOptions(CLI::App& app, SequenceOptions& options, const std::string& name, const std::string& help);
void AddReduceOption(CLI::App& app, int& reduce);

/// A reader with everything in `options` set but the mask, which is off.
vtkSmartPointer<vtkBigusSequenceReader> NewSequenceReader(const SequenceOptions& options);

/// Reads a sequence as the image stack all filters take; says on stderr which frames were rejected.
vtkSmartPointer<vtkImageData> ReadSequence(const SequenceOptions& options, Console& console);

/// Says what is doubtful about the poses of a sequence, for commands that do not inspect it.
void NoteDoubts(vtkImageData* sequence, const std::string& path, Console& console);

/// What an inspection found, a row a finding. `numbers` says how each frame of the sweep is called.
Json FindingsJson(const std::vector<Finding>& findings, const std::vector<int>& numbers);

/// The same as a sweep, reduced.
std::shared_ptr<const Sweep> ReadSweep(const SequenceOptions& options, Console& console);

/// What x, y and z of the field's world mean for a patient: right, anterior, superior, as 3D Slicer shows tracked
/// sequences, or left, posterior, superior, as MetaImage and ITK count.
enum class WorldSystem
{
  Ras,
  Lps
};
/// Adds --world-system.
CLI::Option* AddWorldSystemOption(CLI::App& app, WorldSystem& world);

struct PlaneOptions
{
  std::string poses;  ///< sequence, CSV or markup planes
  PoseChain chain;
  std::vector<int> size;  ///< width, height; empty = what the file says
  double spacing = 0;     ///< mm per pixel; 0 = what the file says
  std::string frames;     ///< "0,4,10-20"; empty = all
  int reduce = 1;
  WorldSystem world = WorldSystem::Ras;
};
/// Adds `--poses` and `--frames`, under the names given, and the other options above.
void AddPlaneOptions(CLI::App& app, PlaneOptions& options, const std::string& name, const std::string& framesName,
                     const std::string& help, bool required);

/// The planes asked for, all of one size. A plane's upper left corner stays where it is whatever --size,
/// --spacing and --reduce say.
struct Planes
{
  std::vector<SlicePlane> planes;
  std::vector<int> numbers;        ///< counted from 0 among the usable ones, as --frames does
  std::vector<double> timestamps;  ///< seconds, or empty
  int rejected = 0;                ///< frames of the file that have no usable pose
};
/// Size, poses and times of a sequence's usable frames; no pixel is read.
Sweep ReadPosesOnly(const SequenceOptions& options);

/// Says on stderr which frames were rejected.
Planes ReadPlanes(const PlaneOptions& options, Console& console);

/// Throws OutputError unless the name ends in .vtp or .ply, or in .pvtp where a field in pieces may be written.
void RequireFieldName(const std::string& path, bool mayBePieces = false);
vtkSmartPointer<vtkPolyData> ReadFieldData(const std::string& path, Console& console);
GaussianField ReadField(const std::string& path, Console& console);
/// What was done to the poses that the field was trained at, of all its sequences; empty where it does not say.
std::string TrainedPoses(vtkPolyData* field);
/// What the command line says of transforms, as the parsers take it.
PoseOptions PoseOptionsOf(const PoseChain& chain);
/// Where a field was trained on several sequences, its provenance has one checksum for each, between blanks.
/// A checksum of a file's poses, as hexadecimal digits: it tells a sweep again without its name. Empty for a file that is
/// neither a sequence nor a CSV of poses.
std::string ChecksumOfPoses(const std::string& path, const PoseChain& chain);
/// Says on stderr when `sequence` has the poses of the one that the field was trained on, and these were corrected: then
/// planes as tracked are not those that the field was trained at.
void NoteTrackedPlanes(vtkPolyData* field, const std::string& sequence, const PoseChain& chain, Console& console);
/// `isRounded`: without the digits that no picture shows (Core/Model/FieldRounding.h). `pieces`: of a .pvtp.
void WriteFieldData(vtkPolyData* field, const std::string& path, bool isRounded, Console& console,
                    int pieces = FieldChunks::kUsual);

/// Throws Error when there is no file at `path`.
void RequireFile(const std::string& path);

}  // namespace bigus::command
