// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldTensors.h"

#include "Core/Model/GaussianField.h"
#include "Data/Arrays.h"
#include "Data/FieldData.h"
#include "PipelineSupport.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"

vtkStandardNewMacro(vtkBigusFieldTensors);

void vtkBigusFieldTensors::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Tensor: " << this->GetTensorAsString() << "\n";
}

const char* vtkBigusFieldTensors::GetTensorAsString()
{
  return this->Tensor == Covariance ? "Covariance" : "StandardDeviation";
}

int vtkBigusFieldTensors::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  return 1;
}

int vtkBigusFieldTensors::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkPolyData* output = vtkPolyData::GetData(outputs);
  const auto work = [&]
  {
    vtkPolyData* input = vtkPolyData::GetData(inputs[0]);
    const bigus::GaussianField field = bigus::FieldFromPolyData(input);
    const auto tensors = bigus::NewArray<vtkDoubleArray>(this->GetTensorAsString(), 9, field.Size());
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      const Eigen::Matrix3d axes = bigus::RotationMatrix(field.rotations[i]);
      const Eigen::Vector3d& s = field.scales[i];
      const Eigen::Vector3d diagonal = this->Tensor == Covariance ? s.cwiseProduct(s).eval() : s;
      const Eigen::Matrix3d tensor = axes * diagonal.asDiagonal() * axes.transpose();  // symmetric: rows are columns
      tensors->SetTypedTuple(i, tensor.data());
    }
    output->ShallowCopy(input);
    output->GetPointData()->SetTensors(tensors);
  };
  return bigus::Execute(this, outputs, work);
}
