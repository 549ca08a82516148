// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusConvert.h"

#include <algorithm>
#include <cstring>
#include <locale>
#include <sstream>

#include "Core/Model/Error.h"
#include "vtkCellArray.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkStringArray.h"
#include "vtkUnsignedCharArray.h"
#include "vtkUnsignedShortArray.h"

namespace bigus
{
namespace
{

// Every numeric array goes through this check, so that all errors read alike. Null when optional and absent.
vtkDataArray* FindArray(vtkFieldData* data, const std::string& owner, const char* name, int components,
                        vtkIdType tuples, bool required)
{
  vtkAbstractArray* found = data->GetAbstractArray(name);
  if (!found)
  {
    if (required)
    {
      throw Error(owner + ": the array " + name + " is missing; it needs " + std::to_string(tuples) + " tuples of " +
                  std::to_string(components) + ".");
    }
    return nullptr;
  }
  vtkDataArray* array = vtkDataArray::SafeDownCast(found);
  if (!array)
  {
    throw Error(owner + ": the array " + name + " holds " + found->GetDataTypeAsString() + "; it must be numeric.");
  }
  if (array->GetNumberOfComponents() != components || array->GetNumberOfTuples() != tuples)
  {
    throw Error(owner + ": the array " + name + " has " + std::to_string(array->GetNumberOfTuples()) + " tuples of " +
                std::to_string(array->GetNumberOfComponents()) + "; expected " + std::to_string(tuples) + " of " +
                std::to_string(components) + ".");
  }
  return array;
}

std::shared_ptr<const void> Alias(vtkDataArray* array)
{
  vtkSmartPointer<vtkDataArray> keep = array;
  return std::shared_ptr<const void>(array->GetVoidPointer(0), [keep](const void*) {});
}

std::shared_ptr<const void> ShortsAsFloats(vtkUnsignedShortArray* array)
{
  const std::size_t n = static_cast<std::size_t>(array->GetNumberOfValues());
  auto floats = std::make_shared<std::vector<float>>(n);
  std::transform(array->GetPointer(0), array->GetPointer(0) + n, floats->begin(),
                 [](unsigned short value) { return static_cast<float>(value / 65535.0); });
  return std::shared_ptr<const void>(floats, floats->data());
}

vtkNew<vtkDoubleArray> NewDoubles(const char* name, int components, vtkIdType tuples)
{
  vtkNew<vtkDoubleArray> array;
  array->SetName(name);
  array->SetNumberOfComponents(components);
  array->SetNumberOfTuples(tuples);
  return array;
}

void AddScalar(vtkFieldData* data, const char* name, double value)
{
  vtkNew<vtkDoubleArray> array = NewDoubles(name, 1, 1);
  array->SetValue(0, value);
  data->AddArray(array);
}

}  // namespace

ImportedSweep SweepFromImage(vtkImageData* image)
{
  const std::string owner = "Sweep";
  if (!image || image->GetNumberOfPoints() == 0)
  {
    throw Error(owner + ": the image has no pixels; connect a tracked sequence.");
  }
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  if (!scalars)
  {
    throw Error(owner + ": the image has no active scalars, so there are no pixels.");
  }
  if (scalars->GetNumberOfComponents() != 1)
  {
    throw Error(owner + ": pixels have " + std::to_string(scalars->GetNumberOfComponents()) +
                " components; one grey value each is expected. Convert colour to grey first.");
  }
  if (scalars->GetNumberOfTuples() != image->GetNumberOfPoints())
  {
    throw Error(owner + ": the scalars have " + std::to_string(scalars->GetNumberOfTuples()) + " values for " +
                std::to_string(image->GetNumberOfPoints()) + " pixels.");
  }

  int size[3];
  int extent[6];
  image->GetDimensions(size);
  image->GetExtent(extent);
  vtkFieldData* data = image->GetFieldData();

  Sweep sweep;
  sweep.width = size[0];
  sweep.height = size[1];

  vtkDataArray* poses = FindArray(data, owner, "ImageToReference", 16, size[2], true);
  for (int k = 0; k < size[2]; ++k)
  {
    double row[16];
    poses->GetTuple(k, row);
    Eigen::Matrix4d pose = Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(row);
    pose.col(3) += extent[0] * pose.col(0) + extent[2] * pose.col(1);  // our pixel (0, 0) is VTK's (x0, y0)
    sweep.imageToReference.push_back(pose);
  }
  if (vtkDataArray* times = FindArray(data, owner, "Timestamp", 1, size[2], false))
  {
    for (int k = 0; k < size[2]; ++k)
    {
      sweep.timestamps.push_back(times->GetTuple1(k));
    }
  }
  const vtkIdType framePixels = static_cast<vtkIdType>(size[0]) * size[1];
  if (vtkDataArray* mask = FindArray(data, owner, "Mask", 1, framePixels, false))
  {
    auto lit = std::make_shared<std::vector<std::uint8_t>>(framePixels);
    for (vtkIdType i = 0; i < framePixels; ++i)
    {
      (*lit)[i] = mask->GetTuple1(i) != 0;
    }
    sweep.mask = lit;
  }

  if (vtkUnsignedCharArray::SafeDownCast(scalars))
  {
    sweep.pixelType = Sweep::PixelType::UInt8;
    sweep.pixels = Alias(scalars);
  }
  else if (vtkFloatArray::SafeDownCast(scalars))
  {
    sweep.pixelType = Sweep::PixelType::Float32;
    sweep.pixels = Alias(scalars);
  }
  else if (auto* shorts = vtkUnsignedShortArray::SafeDownCast(scalars))
  {
    sweep.pixelType = Sweep::PixelType::Float32;
    sweep.pixels = ShortsAsFloats(shorts);
  }
  else
  {
    throw Error(owner + ": pixels are of type " + scalars->GetDataTypeAsString() +
                "; unsigned char, unsigned short, or float in [0, 1] are expected. Use vtkImageShiftScale first.");
  }

  ImportedSweep imported;
  vtkDataArray* status = FindArray(data, owner, "Status", 1, size[2], false);
  for (int k = 0; k < size[2]; ++k)
  {
    if (!status || status->GetTuple1(k) != 0)
    {
      imported.frames.push_back(k);
    }
  }
  if (imported.frames.empty())
  {
    throw Error(owner + ": all " + std::to_string(size[2]) +
                " frames are marked as rejected (Status 0); no frame has a usable pose.");
  }
  if (static_cast<int>(imported.frames.size()) < size[2])
  {
    sweep = sweep.Subset(imported.frames);
  }
  sweep.Validate();
  imported.sweep = std::make_shared<const Sweep>(std::move(sweep));
  return imported;
}

void SweepToImage(const Sweep& sweep, vtkImageData* image)
{
  const int frames = sweep.NumberOfFrames();
  const bool bytes = sweep.pixelType == Sweep::PixelType::UInt8;
  image->Initialize();
  image->SetExtent(0, sweep.width - 1, 0, sweep.height - 1, 0, frames - 1);
  image->AllocateScalars(bytes ? VTK_UNSIGNED_CHAR : VTK_FLOAT, 1);
  image->GetPointData()->GetScalars()->SetName("Intensity");
  std::memcpy(image->GetScalarPointer(), sweep.pixels.get(), frames * sweep.PixelsPerFrame() * (bytes ? 1 : 4));

  vtkFieldData* data = image->GetFieldData();
  vtkNew<vtkDoubleArray> poses = NewDoubles("ImageToReference", 16, frames);
  for (int k = 0; k < frames; ++k)
  {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = sweep.imageToReference[k];
    poses->SetTypedTuple(k, pose.data());
  }
  data->AddArray(poses);
  if (!sweep.timestamps.empty())
  {
    vtkNew<vtkDoubleArray> times = NewDoubles("Timestamp", 1, frames);
    std::copy(sweep.timestamps.begin(), sweep.timestamps.end(), times->GetPointer(0));
    data->AddArray(times);
  }
  if (sweep.mask)
  {
    vtkNew<vtkUnsignedCharArray> mask;
    mask->SetName("Mask");
    mask->SetNumberOfValues(static_cast<vtkIdType>(sweep.mask->size()));
    std::copy(sweep.mask->begin(), sweep.mask->end(), mask->GetPointer(0));
    data->AddArray(mask);
  }
}

GaussianField FieldFromPolyData(vtkPolyData* polyData)
{
  const std::string owner = "Gaussian field";
  if (!polyData)
  {
    throw Error(owner + ": there is no input; connect a field (vtkPolyData).");
  }
  const vtkIdType n = polyData->GetNumberOfPoints();
  const bool required = n > 0;
  vtkFieldData* data = polyData->GetFieldData();
  GaussianField field;

  if (vtkDataArray* version = FindArray(data, owner, "FormatVersion", 1, 1, false))
  {
    if (version->GetTuple1(0) != 1)
    {
      throw Error(owner + ": the format version is " + std::to_string(version->GetTuple1(0)) +
                  "; this program reads version 1. A newer BIGUS is needed.");
    }
  }
  if (vtkDataArray* gamma = FindArray(data, owner, "Gamma", 1, 1, required))
  {
    field.transfer.gamma = gamma->GetTuple1(0);
  }
  if (vtkDataArray* sigma = FindArray(data, owner, "ElevationSigma", 1, 1, required))
  {
    field.beam.elevationSigma = sigma->GetTuple1(0);
  }
  if (n > 0)
  {
    vtkPointData* arrays = polyData->GetPointData();
    vtkDataArray* scales = FindArray(arrays, owner, "Scale", 3, n, true);
    vtkDataArray* rotations = FindArray(arrays, owner, "Rotation", 4, n, true);
    vtkDataArray* reflectivities = FindArray(arrays, owner, "Reflectivity", 1, n, true);
    field.Resize(static_cast<std::size_t>(n));
    for (vtkIdType i = 0; i < n; ++i)
    {
      polyData->GetPoint(i, field.means[i].data());
      scales->GetTuple(i, field.scales[i].data());
      rotations->GetTuple(i, field.rotations[i].data());
      field.reflectivities[i] = reflectivities->GetTuple1(i);
    }
  }
  field.Validate();
  return field;
}

void FieldToPolyData(const GaussianField& field, vtkPolyData* polyData)
{
  const vtkIdType n = static_cast<vtkIdType>(field.Size());
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  points->SetNumberOfPoints(n);
  vtkNew<vtkDoubleArray> scales = NewDoubles("Scale", 3, n);
  vtkNew<vtkDoubleArray> rotations = NewDoubles("Rotation", 4, n);
  vtkNew<vtkDoubleArray> reflectivities = NewDoubles("Reflectivity", 1, n);
  vtkNew<vtkCellArray> vertices;
  vertices->AllocateExact(n, n);
  for (vtkIdType i = 0; i < n; ++i)
  {
    points->SetPoint(i, field.means[i].data());
    scales->SetTypedTuple(i, field.scales[i].data());
    rotations->SetTypedTuple(i, field.rotations[i].data());
    reflectivities->SetValue(i, field.reflectivities[i]);
    vertices->InsertNextCell(1, &i);
  }

  polyData->Initialize();
  polyData->SetPoints(points);
  polyData->SetVerts(vertices);
  polyData->GetPointData()->AddArray(scales);
  polyData->GetPointData()->AddArray(rotations);
  polyData->GetPointData()->SetScalars(reflectivities);
  vtkFieldData* data = polyData->GetFieldData();
  AddScalar(data, "Gamma", field.transfer.gamma);
  AddScalar(data, "ElevationSigma", field.beam.elevationSigma);
  vtkNew<vtkIntArray> version;
  version->SetName("FormatVersion");
  version->InsertNextValue(1);
  data->AddArray(version);
}

void SetProvenance(vtkDataObject* data, const std::string& key, const std::string& value)
{
  auto* lines = vtkStringArray::SafeDownCast(data->GetFieldData()->GetAbstractArray("Provenance"));
  vtkNew<vtkStringArray> updated;  // never edit an array that another data object may share
  updated->SetName("Provenance");
  for (vtkIdType i = 0; lines && i < lines->GetNumberOfValues(); ++i)
  {
    if (lines->GetValue(i).rfind(key + "=", 0) != 0)
    {
      updated->InsertNextValue(lines->GetValue(i));
    }
  }
  updated->InsertNextValue(key + "=" + value);
  data->GetFieldData()->AddArray(updated);
}

void SetTrainingProvenance(vtkDataObject* data, const TrainingResult& result)
{
  const TrainerOptions& settled = result.settled;
  const auto set = [data](const char* key, const std::string& value) { SetProvenance(data, key, value); };
  const auto yes = [](bool value) { return std::string(value ? "yes" : "no"); };
  set("seed", std::to_string(settled.seed));
  set("iterations", std::to_string(result.iterations));
  set("aborted", yes(result.aborted));
  set("loss", settled.loss.ToString());
  if (settled.finalLoss)
  {
    set("finalLoss", settled.finalLoss->ToString());
  }
  std::ostringstream sigma;
  sigma.imbue(std::locale::classic());
  sigma << *settled.elevationSigma;
  set("elevationSigma", sigma.str());
  set("gaussians", std::to_string(result.field.Size()));
  set("signedReflectivity", yes(settled.signedReflectivity));
  set("virtualPlanes", std::to_string(*settled.virtualPlanes));
  set("interpolation", settled.interpolation->ToString());
  set("frameGains", yes(settled.frameGains));
  set("poseRefinement", yes(settled.poseRefinement));
  for (const Decision& decision : result.decisions)
  {
    SetProvenance(data, "decision." + decision.what, decision.choice + " (" + decision.evidence + ")");
  }
}

std::string GetProvenance(vtkDataObject* data, const std::string& key)
{
  auto* lines = vtkStringArray::SafeDownCast(data->GetFieldData()->GetAbstractArray("Provenance"));
  for (vtkIdType i = 0; lines && i < lines->GetNumberOfValues(); ++i)
  {
    const std::string line = lines->GetValue(i);
    if (line.rfind(key + "=", 0) == 0)
    {
      return line.substr(key.size() + 1);
    }
  }
  return "";
}

}  // namespace bigus
