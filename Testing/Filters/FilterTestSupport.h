// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the filter tests share: fields to look at, the model written out plainly, and images compared.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "Core/Model/GaussianField.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "Data/SweepData.h"
#include "Support/ErrorObserver.h"
#include "Support/Random.h"
#include "vtkAlgorithm.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"

// A lean build of VTK may leave the streamer out.
#if __has_include("vtkImageDataStreamer.h")
#include "vtkImageDataStreamer.h"
#define BIGUS_WITH_STREAMER 1
#endif

namespace bigus::test
{

inline Eigen::Matrix3d RandomRotation(Random& random)
{
  return RotationMatrix(random.UnitQuaternion());
}
inline Eigen::Matrix3d RandomRotation(std::uint64_t seed)
{
  Random random(seed);
  return RandomRotation(random);
}

/// Gaussians of all shapes and signs in a box of +-10 mm.
inline GaussianField RandomField(std::size_t size, std::uint64_t seed)
{
  Random random(seed);
  GaussianField field;
  field.Resize(size);
  for (std::size_t i = 0; i < size; ++i)
  {
    field.means[i] = random.Vector(-10, 10);
    field.scales[i] = random.Vector(0.4, 2.5);
    field.rotations[i] = random.UnitQuaternion();
    field.reflectivities[i] = random.Uniform(-0.3, 1);
  }
  field.beam.elevationSigma = 0.6;
  field.transfer.gamma = 0.7;
  return field;
}

inline vtkSmartPointer<vtkPolyData> ToPolyData(const GaussianField& field)
{
  auto polyData = vtkSmartPointer<vtkPolyData>::New();
  FieldToPolyData(field, polyData);
  return polyData;
}

/// S at a point, seen by an infinitely thin plane: the sum of all Gaussians, straight from its definition.
inline double ThinScattering(const GaussianField& field, const Eigen::Vector3d& x)
{
  double s = 0;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    const Eigen::Vector3d local = RotationMatrix(field.rotations[i]).transpose() * (x - field.means[i]);
    s += field.reflectivities[i] * std::exp(-0.5 * local.cwiseQuotient(field.scales[i]).squaredNorm());
  }
  return s;
}

inline Eigen::Matrix4d RigidMatrix(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& origin)
{
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.block<3, 3>(0, 0) = rotation;
  matrix.block<3, 1>(0, 3) = origin;
  return matrix;
}

inline vtkSmartPointer<vtkMatrix4x4> ToVtk(const Eigen::Matrix4d& matrix)
{
  auto out = vtkSmartPointer<vtkMatrix4x4>::New();
  for (int row = 0; row < 4; ++row)
  {
    for (int column = 0; column < 4; ++column)
    {
      out->SetElement(row, column, matrix(row, column));
    }
  }
  return out;
}

inline float FloatAt(vtkImageData* image, int i, int j, int k)
{
  return *static_cast<float*>(image->GetScalarPointer(i, j, k));
}

inline float LargestValue(vtkImageData* image)
{
  double range[2];
  image->GetScalarRange(range);
  return static_cast<float>(std::max(std::abs(range[0]), std::abs(range[1])));
}

/// The pixels of `part` are, bit for bit, those of `whole` at the same indices.
inline ::testing::AssertionResult SameBits(vtkImageData* part, vtkImageData* whole)
{
  int extent[6];
  part->GetExtent(extent);
  if (part->GetScalarType() != whole->GetScalarType() || part->GetNumberOfPoints() == 0)
  {
    return ::testing::AssertionFailure() << "types differ, or there are no pixels";
  }
  for (int k = extent[4]; k <= extent[5]; ++k)
  {
    for (int j = extent[2]; j <= extent[3]; ++j)
    {
      for (int i = extent[0]; i <= extent[1]; ++i)
      {
        if (std::memcmp(part->GetScalarPointer(i, j, k), whole->GetScalarPointer(i, j, k), part->GetScalarSize()))
        {
          return ::testing::AssertionFailure()
                 << "pixel (" << i << ", " << j << ", " << k << ") is " << part->GetScalarComponentAsDouble(i, j, k, 0)
                 << " here and " << whole->GetScalarComponentAsDouble(i, j, k, 0) << " in the whole";
        }
      }
    }
  }
  return ::testing::AssertionSuccess();
}

/// Updates the filter, which must fail with exactly one error that holds all of `parts`, and leave the output
/// empty.
inline void ExpectOneError(vtkAlgorithm* filter, const std::vector<std::string>& parts)
{
  const ErrorObserver observer(filter);
  filter->Update();
  ASSERT_EQ(observer.Errors().size(), 1u) << "for an error about " << parts[0];
  for (const std::string& part : parts)
  {
    EXPECT_NE(observer.Errors()[0].find(part), std::string::npos) << "no '" << part << "' in: " << observer.Errors()[0];
  }
  EXPECT_NE(filter->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
  if (auto* data = vtkDataSet::SafeDownCast(filter->GetOutputDataObject(0)))
  {
    EXPECT_EQ(data->GetNumberOfPoints(), 0);
  }
}

}  // namespace bigus::test
