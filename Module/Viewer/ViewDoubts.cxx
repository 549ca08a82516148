// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewDoubts.h"

#include <algorithm>

#include "Data/StandardErrorData.h"
#include "vtkBigusReslice.h"
#include "vtkBigusSliceProp.h"
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkPolyData.h"

namespace bigus::command
{

SlicePlane PlaneOf(vtkBigusSliceProp* slice)
{
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose;
  std::copy_n(slice->GetPlane()->GetData(), 16, pose.data());
  const double* const origin = slice->GetSliceOrigin();
  pose.col(3) += origin[0] * pose.col(0) + origin[1] * pose.col(1);
  pose.col(0) *= slice->GetSliceSpacing()[0];
  pose.col(1) *= slice->GetSliceSpacing()[1];
  return SlicePlane::FromImageToReference(pose, slice->GetSliceSize()[0], slice->GetSliceSize()[1]);
}

ViewDoubts::ViewDoubts(vtkPolyData* field)
{
  const std::string bytes = StandardErrorOf(field);
  kept_ = bytes.empty() ? nullptr : std::make_unique<const StandardError>(bytes);
}

std::string ViewDoubts::About(vtkBigusSliceProp* slice) const
{
  if (!kept_)
  {
    return {};
  }
  slice->UpdateSlice();
  const auto* const image = static_cast<const float*>(slice->GetReslice()->GetOutput()->GetScalarPointer());
  return kept_->IsMostlyGuessed(PlaneOf(slice), image) ? "mostly guessed" : "";
}

}  // namespace bigus::command
