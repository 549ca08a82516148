// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the filter tests share: fields to look at, the model written out plainly, and errors counted.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "Core/Model/GaussianField.h"
#include "vtkAlgorithm.h"
#include "vtkBigusConvert.h"
#include "vtkCommand.h"
#include "vtkErrorCode.h"
#include "vtkExecutive.h"
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"

namespace bigus::test
{

/// Uniform numbers, the same on every machine.
class Numbers
{
public:
  explicit Numbers(std::uint64_t seed) : generator_(seed) {}
  double Between(double low, double high)
  {
    return low + (high - low) * static_cast<double>(generator_() >> 11) * 0x1p-53;
  }
  Eigen::Vector3d Vector(double low, double high)
  {
    const double x = Between(low, high), y = Between(low, high);
    return {x, y, Between(low, high)};
  }
  Eigen::Vector4d Quaternion()
  {
    const Eigen::Vector3d v = Vector(-1, 1);
    return {Between(-1, 1) + 1.5, v[0], v[1], v[2]};
  }
  Eigen::Matrix3d Rotation() { return RotationMatrix(Quaternion()); }

private:
  std::mt19937_64 generator_;
};

/// Gaussians of all shapes and signs in a box of +-10 mm.
inline GaussianField RandomField(std::size_t size, std::uint64_t seed)
{
  Numbers numbers(seed);
  GaussianField field;
  field.Resize(size);
  for (std::size_t i = 0; i < size; ++i)
  {
    field.means[i] = numbers.Vector(-10, 10);
    field.scales[i] = numbers.Vector(0.4, 2.5);
    field.rotations[i] = numbers.Quaternion();
    field.reflectivities[i] = numbers.Between(-0.3, 1);
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

/// Collects the errors of a filter, and keeps those of its executive quiet.
class ErrorLog
{
public:
  explicit ErrorLog(vtkAlgorithm* filter)
  {
    own_->messages = &messages_;
    filter->AddObserver(vtkCommand::ErrorEvent, own_);
    filter->GetExecutive()->AddObserver(vtkCommand::ErrorEvent, executive_);
  }
  const std::vector<std::string>& Messages() const { return messages_; }

private:
  struct Listener : vtkCommand
  {
    static Listener* New() { return new Listener; }
    void Execute(vtkObject*, unsigned long, void* text) override
    {
      if (messages)
      {
        messages->push_back(static_cast<const char*>(text));
      }
    }
    std::vector<std::string>* messages = nullptr;
  };
  std::vector<std::string> messages_;
  vtkNew<Listener> own_, executive_;
};

/// Updates the filter, which must fail with exactly one error that holds all of `parts`, and leave the output
/// empty.
inline void ExpectOneError(vtkAlgorithm* filter, const std::vector<std::string>& parts)
{
  ErrorLog log(filter);
  filter->Update();
  ASSERT_EQ(log.Messages().size(), 1u) << "for an error about " << parts[0];
  for (const std::string& part : parts)
  {
    EXPECT_NE(log.Messages()[0].find(part), std::string::npos) << "no '" << part << "' in: " << log.Messages()[0];
  }
  EXPECT_NE(filter->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
  if (auto* data = vtkDataSet::SafeDownCast(filter->GetOutputDataObject(0)))
  {
    EXPECT_EQ(data->GetNumberOfPoints(), 0);
  }
  filter->RemoveObservers(vtkCommand::ErrorEvent);
  filter->GetExecutive()->RemoveObservers(vtkCommand::ErrorEvent);
}

}  // namespace bigus::test
