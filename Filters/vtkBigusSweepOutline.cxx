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
#include "vtkSmartPointer.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkStructuredGrid.h"

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

std::vector<int> Chosen(const bigus::Sweep& sweep, int stride)
{
  std::vector<int> chosen;
  const int last = sweep.NumberOfFrames() - 1;
  for (int k = 0; k <= last; ++k)
  {
    if (k % stride == 0 || k == last)
    {
      chosen.push_back(k);
    }
  }
  return chosen;
}

void FillOutlines(const bigus::ImportedSweep& imported, const std::vector<int>& chosen, vtkPolyData* output)
{
  const bigus::Sweep& sweep = *imported.sweep;
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> lines;
  for (const int k : chosen)
  {
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

void FillPixels(const bigus::ImportedSweep& imported, const std::vector<int>& chosen, vtkDataArray* recorded,
                vtkStructuredGrid* output)
{
  const bigus::Sweep& sweep = *imported.sweep;
  const vtkIdType count = static_cast<vtkIdType>(sweep.width) * sweep.height;
  vtkNew<vtkPoints> points;
  points->Allocate(count * static_cast<vtkIdType>(chosen.size()));
  const auto pixels = vtkSmartPointer<vtkDataArray>::Take(recorded->NewInstance());
  pixels->SetName("Recorded");
  pixels->SetNumberOfTuples(count * static_cast<vtkIdType>(chosen.size()));
  vtkIdType done = 0;
  for (const int k : chosen)
  {
    for (int j = 0; j < sweep.height; ++j)
    {
      for (int i = 0; i < sweep.width; ++i)
      {
        InsertPixel(points, sweep.imageToReference[k], i, j);
      }
    }
    pixels->InsertTuples(done, count, count * imported.frames[k], recorded);
    done += count;
  }
  output->SetDimensions(sweep.width, sweep.height, static_cast<int>(chosen.size()));
  output->SetPoints(points);
  output->GetPointData()->SetScalars(pixels);
  AddFrameArrays(output->GetFieldData(), imported, chosen);
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
  this->SetNumberOfOutputPorts(3);
}

void vtkBigusSweepOutline::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "FrameStride: " << this->FrameStride << "\n";
  os << indent << "GeneratePixels: " << (this->GeneratePixels ? "On\n" : "Off\n");
}

vtkStructuredGrid* vtkBigusSweepOutline::GetPixelsOutput()
{
  return vtkStructuredGrid::SafeDownCast(this->GetOutputDataObject(2));
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

int vtkBigusSweepOutline::FillOutputPortInformation(int port, vtkInformation* info)
{
  info->Set(vtkDataObject::DATA_TYPE_NAME(), port == 2 ? "vtkStructuredGrid" : "vtkPolyData");
  return 1;
}

int vtkBigusSweepOutline::RequestInformation(vtkInformation*, vtkInformationVector** inputs,
                                             vtkInformationVector* outputs)
{
  // A grid tells its size before its pixels are there; it has fewer frames where some turn out to be rejected.
  int extent[6] = {0, -1, 0, -1, 0, -1};
  if (this->GeneratePixels)
  {
    int whole[6];
    inputs[0]->GetInformationObject(0)->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole);
    const int last = whole[5] - whole[4];
    extent[1] = whole[1] - whole[0];
    extent[3] = whole[3] - whole[2];
    extent[5] = last / this->FrameStride + (last % this->FrameStride != 0);
  }
  outputs->GetInformationObject(2)->Set(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), extent, 6);
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
  vtkStructuredGrid* pixels = vtkStructuredGrid::GetData(outputs, 2);
  const auto work = [&]
  {
    vtkImageData* image = vtkImageData::GetData(inputs[0]);
    const bigus::ImportedSweep imported = bigus::SweepFromImage(image);
    const std::vector<int> chosen = Chosen(*imported.sweep, this->FrameStride);
    FillOutlines(imported, chosen, outlines);
    FillPath(imported, path);
    if (this->GeneratePixels)
    {
      FillPixels(imported, chosen, image->GetPointData()->GetScalars(), pixels);
    }
  };
  return bigus::Execute(this, outputs, work);
}
