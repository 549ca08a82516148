// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusTransformField.h"

#include <algorithm>

#include "Core/Model/FieldTransform.h"
#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "Data/Provenance.h"
#include "PipelineSupport.h"
#include "vtkErrorCode.h"
#include "vtkHomogeneousTransform.h"
#include "vtkInformation.h"
#include "vtkInformationIntegerKey.h"
#include "vtkInformationVector.h"
#include "vtkMatrix4x4.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"

vtkStandardNewMacro(vtkBigusTransformField);
vtkCxxSetObjectMacro(vtkBigusTransformField, Transform, vtkAbstractTransform);

vtkBigusTransformField::~vtkBigusTransformField()
{
  this->SetTransform(nullptr);
}

void vtkBigusTransformField::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Transform: " << this->Transform << "\n";
}

vtkMTimeType vtkBigusTransformField::GetMTime()
{
  const vtkMTimeType own = this->Superclass::GetMTime();
  return this->Transform ? std::max(own, this->Transform->GetMTime()) : own;
}

int vtkBigusTransformField::RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  outputs->GetInformationObject(0)->Remove(bigus::ChunksOfPiecesKey());
  return 1;
}

int vtkBigusTransformField::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  return 1;
}

int vtkBigusTransformField::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkPolyData* output = vtkPolyData::GetData(outputs);
  const auto work = [&]
  {
    vtkPolyData* input = vtkPolyData::GetData(inputs[0]);
    if (!this->Transform)
    {
      bigus::ShareField(input, output);
      return;
    }
    auto* homogeneous = vtkHomogeneousTransform::SafeDownCast(this->Transform);
    if (!homogeneous)
    {
      bigus::RefuseTransform("Transform", this->Transform->GetClassName(), "space");
    }
    homogeneous->Update();
    const double* elements = homogeneous->GetMatrix()->GetData();
    const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(elements);
    bigus::FieldToPolyData(bigus::Transformed(bigus::FieldFromPolyData(input), matrix), output);
    if (const auto view = bigus::ViewFromPolyData(input))
    {
      bigus::ViewToPolyData(bigus::Transformed(*view, matrix), output);
    }
    if (const auto labels = bigus::LabelsFromPolyData(input))
    {
      bigus::LabelsToPolyData(bigus::Transformed(*labels, matrix), output);
    }
    bigus::ReplaceProvenance(output, bigus::ProvenanceOf(input));
    bigus::SetProvenance(output, "transform", bigus::TransformText(bigus::GetProvenance(input, "transform"), matrix));
  };
  return bigus::Execute(this, outputs, work);
}
