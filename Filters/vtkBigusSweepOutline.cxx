// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusSweepOutline.h"

#include <vector>

#include "Core/Model/Sweep.h"
#include "Data/Arrays.h"
#include "Data/SweepData.h"
#include "PipelineSupport.h"
#include "vtkCellArray.h"
#include "vtkCellData.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"

vtkStandardNewMacro(vtkBigusSweepOutline);

namespace
{

/// Pixel (i, j) of a frame, mm.
vtkIdType InsertPixel(vtkPoints* points, const Eigen::Matrix4d& imageToReference, double i, double j)
{
  const Eigen::Vector4d x = imageToReference * Eigen::Vector4d(i, j, 0, 1);
  return points->InsertNextPoint(x.data());
}

/// `Frame` and `Timestamp` of the sweep's frames `chosen`.
void AddFrameArrays(vtkFieldData* data, const bigus::ImportedSweep& imported, const std::vector<int>& chosen)
{
  const auto frames = bigus::NewArray<vtkIntArray>("Frame", 1, static_cast<vtkIdType>(chosen.size()));
  for (std::size_t n = 0; n < chosen.size(); ++n)
  {
    frames->SetValue(n, imported.frames[chosen[n]]);
  }
  data->AddArray(frames);
  if (!imported.sweep->timestamps.empty())
  {
    const auto times = bigus::NewArray<vtkDoubleArray>("Timestamp", 1, static_cast<vtkIdType>(chosen.size()));
    for (std::size_t n = 0; n < chosen.size(); ++n)
    {
      times->SetValue(n, imported.sweep->timestamps[chosen[n]]);
    }
    data->AddArray(times);
  }
}

void FillOutlines(const bigus::ImportedSweep& imported, int stride, vtkPolyData* output)
{
  const bigus::Sweep& sweep = *imported.sweep;
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> lines;
  std::vector<int> chosen;
  const int last = sweep.NumberOfFrames() - 1;
  for (int k = 0; k <= last; ++k)
  {
    if (k % stride != 0 && k != last)
    {
      continue;
    }
    chosen.push_back(k);
    const Eigen::Matrix4d& pose = sweep.imageToReference[k];
    const vtkIdType first = InsertPixel(points, pose, 0, 0);
    InsertPixel(points, pose, sweep.width - 1, 0);
    InsertPixel(points, pose, sweep.width - 1, sweep.height - 1);
    InsertPixel(points, pose, 0, sweep.height - 1);
    lines->InsertNextCell({first, first + 1, first + 2, first + 3, first});
  }
  output->SetPoints(points);
  output->SetLines(lines);
  AddFrameArrays(output->GetCellData(), imported, chosen);
}

void FillPath(const bigus::ImportedSweep& imported, vtkPolyData* output)
{
  const bigus::Sweep& sweep = *imported.sweep;
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> lines;
  std::vector<int> all;
  const bool hasLine = sweep.NumberOfFrames() > 1;
  if (hasLine)
  {
    lines->InsertNextCell(sweep.NumberOfFrames());
  }
  for (int k = 0; k < sweep.NumberOfFrames(); ++k)
  {
    all.push_back(k);
    const vtkIdType point = InsertPixel(points, sweep.imageToReference[k], 0.5 * (sweep.width - 1), 0);
    if (hasLine)
    {
      lines->InsertCellPoint(point);
    }
  }
  output->SetPoints(points);
  output->SetLines(lines);
  AddFrameArrays(output->GetPointData(), imported, all);
}

}  // namespace

vtkBigusSweepOutline::vtkBigusSweepOutline()
{
  this->SetNumberOfOutputPorts(2);
}

void vtkBigusSweepOutline::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "FrameStride: " << this->FrameStride << "\n";
}

vtkPolyData* vtkBigusSweepOutline::GetPathOutput()
{
  return vtkPolyData::SafeDownCast(this->GetOutputDataObject(1));
}

int vtkBigusSweepOutline::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkImageData");
  return 1;
}

int vtkBigusSweepOutline::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  return 1;
}

int vtkBigusSweepOutline::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkPolyData* outlines = vtkPolyData::GetData(outputs, 0);
  vtkPolyData* path = vtkPolyData::GetData(outputs, 1);
  outlines->Initialize();
  path->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    const bigus::ImportedSweep imported = bigus::SweepFromImage(vtkImageData::GetData(inputs[0]));
    FillOutlines(imported, this->FrameStride, outlines);
    FillPath(imported, path);
    return 1;
  }
  catch (const std::exception& error)
  {
    bigus::ForgetRequests(outputs);
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UserError);
    return 0;
  }
}
