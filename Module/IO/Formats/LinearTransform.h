// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A linear transform as ITK and 3D Slicer write it (.tfm, .txt, .h5), or as a plain 4 x 4 matrix.
#pragma once

#include <Eigen/Dense>
#include <string>

namespace bigus
{

struct LinearTransform
{
  Eigen::Matrix4d matrix;  ///< maps points, mm
  /// An ITK transform file: between points in LPS, from where a resampled image is to where the input image was. 3D
  /// Slicer writes the same and moves objects by the inverse. Else the file held 16 numbers and says nothing of it.
  bool isItk;
};

/// Reads the text form and the HDF5 form of ITK's linear transforms between 3-D points (Identity, Translation, Scale, Affine,
/// MatrixOffsetTransformBase, Rigid3D, Euler3D, Versor, VersorRigid3D, Similarity3D, ScaleVersor3D, ScaleSkewVersor3D,
/// ComposeScaleSkewVersor3D, and a Composite of them), or 16 numbers row by row. Throws FileError naming what the file has instead.
LinearTransform ReadLinearTransform(const std::string& fileName);

/// How the file moves what is under it, in the patient system `worldIsLps` names (LPS, else RAS): an ITK transform as 3D
/// Slicer shows it, by its inverse; sixteen numbers as they are. Throws FileError, also where there is no inverse.
Eigen::Matrix4d ReadObjectMatrix(const std::string& fileName, bool worldIsLps);

/// Whether a file that begins with these bytes is an ITK transform file.
bool LooksLikeTransform(const std::string& beginning);

}  // namespace bigus
