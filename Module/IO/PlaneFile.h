// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Slice planes in files, without VTK: poses of sequences and CSVs, 3D Slicer's planes, lines and linear transforms.
#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "IO/Poses.h"

namespace bigus
{

struct FilePlane
{
  Eigen::Matrix4d imageToReference;
  int width = 0;  ///< pixels; 0 where the file does not say
  int height = 0;
  int sourceFrame = 0;
  double timestamp = 0;  ///< seconds; NaN where there is none
};

struct PlaneFile
{
  std::vector<FilePlane> planes;
  int rejected = 0;
  std::string rejections;  ///< the sentence on those left out
};

/// Fills `file` as far as it gets. `options` are for sequences and CSVs; `spacing`, mm a pixel, for planes and lines of 3D
/// Slicer; `worldIsLps` (else RAS) for all of 3D Slicer's files. Throws FileError.
void ReadPlanes(const std::string& fileName, const PoseOptions& options, double spacing, bool worldIsLps,
                PlaneFile& file);

}  // namespace bigus
