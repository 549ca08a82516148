// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Writing image stacks (one image a plane, with its pose) and volumes in the formats the command offers.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "Core/Inspection/Page.h"
#include "Core/Model/SlicePlane.h"
#include "vtkSmartPointer.h"

class vtkDataArray;
class vtkImageData;

namespace bigus::command
{

class Console;
enum class WorldSystem;

/// An image stack as filters and writers take it, with the planes' poses, pixels not set yet; 8-bit or float.
vtkSmartPointer<vtkImageData> NewStack(const std::vector<SlicePlane>& planes, const std::vector<double>& timestamps,
                                       bool bytes);

/// Copies the pixels of an image of one slice, of the stack's type, into image `k` of the stack.
void SetImage(vtkImageData* stack, int k, vtkImageData* image);

/// Throws OutputError unless the name ends in .mha (.igs.mha), .nrrd or .png.
void RequireStackName(const std::string& path);
/// .mha and .nrrd: one sequence with poses. .png: 8-bit; one image as it is named, more with numbers
/// (`numbers`, one an image) before the ending. Returns the names of the files.
std::vector<std::string> WriteStack(vtkImageData* stack, const std::string& path, const std::vector<int>& numbers,
                                    Console& console);

/// A column of a CSV: its name, and one number a row.
using CsvColumn = std::pair<std::string, std::vector<double>>;

/// Throws OutputError unless the name ends in .mha (.igs.mha), .nrrd or .csv.
void RequirePosesName(const std::string& path);
/// .mha and .nrrd: the sequence with its poses. .csv: width, height, m00 to m33 and, where the stack has it, timestamp,
/// one row a frame, as `slice --poses` and the readers take it; then `columns`.
void WritePoses(vtkImageData* stack, const std::string& path, const std::vector<CsvColumn>& columns, Console& console);
/// Such a CSV of `poses`, 16 components a row, of images of width x height pixels.
void WritePosesCsv(vtkDataArray* poses, int width, int height, const std::string& path,
                   const std::vector<CsvColumn>& columns);

/// For messages: the file's name, or the first and last of many.
std::string NameOf(const std::vector<std::string>& files);

/// A page as PNG.
void WritePage(const Page& page, const std::string& path);

/// Throws OutputError unless the name ends in .mha, .nrrd or .vti.
void RequireVolumeName(const std::string& path);
/// A volume with its origin, spacing and direction.
void WriteVolume(vtkImageData* volume, const std::string& path, WorldSystem world, Console& console);

}  // namespace bigus::command
