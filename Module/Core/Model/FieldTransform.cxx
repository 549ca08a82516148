// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/FieldTransform.h"

#include <sstream>
#include <string>

#include "Core/Model/Error.h"

namespace bigus
{

namespace
{

constexpr double kEven = 1e-6;  // share by which lengths may differ; matrices in files are rounded to about this

}  // namespace

GaussianField Transformed(GaussianField field, const Eigen::Matrix4d& transform)
{
  Require(transform.allFinite(), "The transform of a field holds a value that is not finite.");
  Require((transform.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() <= 1e-12,
          "The transform of a field is perspective: its last row must be 0 0 0 1.");
  const Eigen::Matrix3d linear = transform.topLeftCorner<3, 3>();
  const Eigen::JacobiSVD<Eigen::Matrix3d> parts(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& stretch = parts.singularValues();  // largest first
  Require(stretch[2] > 0 && stretch[0] - stretch[2] <= kEven * stretch[0],
          "The transform of a field stretches space by ", stretch[0], " in one direction and by ", stretch[2],
          " in another; give one that turns, moves, mirrors and scales evenly.");
  const double scale = stretch[1];
  const Eigen::Matrix3d turn = parts.matrixU() * parts.matrixV().transpose();  // Q, exact to rounding
  // A Gaussian is its own mirror image through its centre, so -Q turns it as Q does.
  const Eigen::Matrix3d rotation = turn.determinant() < 0 ? Eigen::Matrix3d(-turn) : turn;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    field.means[i] = linear * field.means[i] + transform.topRightCorner<3, 1>();
    field.scales[i] *= scale;
    field.rotations[i] = Quaternion(rotation * RotationMatrix(field.rotations[i]));
  }
  field.beam.elevationSigma *= scale;
  field.beam.probeElevationSigma *= scale;
  for (Eigen::Vector3d& normal : field.beam.trainedNormals)
  {
    normal = (turn * normal).normalized();
  }
  field.Validate();
  return field;
}

void Keep(GaussianField& field, const std::function<bool(std::size_t)>& isKept)
{
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    if (isKept(i))
    {
      kept.push_back(i);
    }
  }
  field = field.Pick(kept);
}

std::string TransformText(const std::string& before, const Eigen::Matrix4d& transform)
{
  std::ostringstream text;
  text.precision(17);
  text << before << (before.empty() ? "" : "; then ");
  for (int i = 0; i < 16; ++i)
  {
    text << (i ? " " : "") << transform(i / 4, i % 4);
  }
  return text.str();
}

void RefuseTransform(const std::string& property, const std::string& kind, const std::string& what)
{
  throw Error(property + " is a " + kind + ", which may bend " + what +
              "; give a linear transform, for example a vtkTransform.");
}

}  // namespace bigus
