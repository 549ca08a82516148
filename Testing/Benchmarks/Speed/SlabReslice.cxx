// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "SlabReslice.h"

#include <cmath>

#include "Core/Engine/Engine.h"
#include "Exit.h"
#include "Workloads.h"
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"

namespace bigus::bench
{

vtkSmartPointer<vtkImageData> SampleField(GaussianField field, const Eigen::Vector3d& box, command::Console& console)
{
  const Eigen::Vector3i size = box.cast<int>();
  const Eigen::Vector3d origin = -0.5 * kWorkloadPixel * (size.cast<double>() - Eigen::Vector3d::Ones());
  auto volume = vtkSmartPointer<vtkImageData>::New();
  volume->SetDimensions(size.data());
  volume->SetSpacing(kWorkloadPixel, kWorkloadPixel, kWorkloadPixel);
  volume->SetOrigin(origin.data());
  volume->AllocateScalars(VTK_FLOAT, 1);

  field.beam.elevationSigma = 0;
  const auto engine = Engine::Create("cpu");
  engine->SetField(field);
  SlicePlane plane;
  plane.width = size[0];
  plane.height = size[1];
  plane.columnStep *= kWorkloadPixel;
  plane.rowStep *= kWorkloadPixel;
  for (int k = 0; k < size[2]; ++k)
  {
    plane.origin = origin + k * kWorkloadPixel * Eigen::Vector3d::UnitZ();
    engine->Render(plane, ViewOutput::Scattering,
                   static_cast<float*>(volume->GetScalarPointer()) + k * plane.NumberOfPixels());
    console.Progress("Voxelizing", (k + 1.0) / size[2]);
    if (command::IsInterrupted())
    {
      throw command::Interrupted();
    }
  }
  console.EndProgress();
  return volume;
}

vtkSmartPointer<vtkImageSlabReslice> NewSlabReslice(vtkImageData* volume, const SlicePlane& plane,
                                                    double elevationSigma)
{
  auto reslice = vtkSmartPointer<vtkImageSlabReslice>::New();
  reslice->SetInputData(volume);
  vtkNew<vtkMatrix4x4> axes;
  for (int row = 0; row < 3; ++row)
  {
    axes->SetElement(row, 0, plane.columnStep[row] / kWorkloadPixel);
    axes->SetElement(row, 1, plane.rowStep[row] / kWorkloadPixel);
    axes->SetElement(row, 2, plane.Normal()[row]);
    axes->SetElement(row, 3, plane.origin[row]);
  }
  reslice->SetResliceAxes(axes);
  reslice->SetOutputSpacing(kWorkloadPixel, kWorkloadPixel, kWorkloadPixel);
  reslice->SetOutputOrigin(0, 0, 0);
  reslice->SetOutputExtent(0, plane.width - 1, 0, plane.height - 1, 0, 0);
  reslice->SetInterpolationModeToLinear();
  reslice->SetBlendModeToMean();
  // A box of this thickness has the beam's variance. VTK rounds the number of samples down: hence 0.999.
  const double thickness = std::sqrt(12.0) * elevationSigma;
  reslice->SetSlabThickness(thickness);
  reslice->SetSlabResolution(0.999 * thickness / 8);
  reslice->SetNumberOfThreads(1);
  reslice->SetEnableSMP(false);
  return reslice;
}

}  // namespace bigus::bench
