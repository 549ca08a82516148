// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "FieldData.h"

#include <Eigen/Dense>

#include "FileError.h"
#include "Text.h"
#include "vtkCellArray.h"
#include "vtkDataArray.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkStringArray.h"

namespace bigus
{
namespace
{

constexpr int formatVersion = 1;

vtkDataArray* RequireArray(vtkFieldData* data, const std::string& what, const char* name, int components,
                           vtkIdType tuples)
{
  vtkDataArray* const array = data->GetArray(name);
  if (!array)
  {
    throw FormatError(what + ": the array " + name + " is missing; this is not a Gaussian field");
  }
  if (array->GetNumberOfComponents() != components || array->GetNumberOfTuples() != tuples)
  {
    throw FormatError(what + ": the array " + name + " has " + std::to_string(array->GetNumberOfTuples()) +
                      " tuples of " + std::to_string(array->GetNumberOfComponents()) + "; " + std::to_string(tuples) +
                      " of " + std::to_string(components) + " are expected");
  }
  return array;
}

vtkDoubleArray* AddArray(vtkFieldData* data, const char* name, int components, vtkIdType tuples)
{
  vtkNew<vtkDoubleArray> array;
  array->SetName(name);
  array->SetNumberOfComponents(components);
  array->SetNumberOfTuples(tuples);
  data->AddArray(array);
  return array;
}

}  // namespace

StoredField FieldFromPolyData(vtkPolyData* polyData, const std::string& what)
{
  StoredField stored;
  GaussianField& field = stored.field;
  vtkFieldData* const fieldData = polyData->GetFieldData();
  const vtkIdType count = polyData->GetNumberOfPoints();

  if (vtkDataArray* const version = fieldData->GetArray("FormatVersion");
      version && version->GetNumberOfValues() > 0 && version->GetComponent(0, 0) != formatVersion)
  {
    throw FormatError(what + ": FormatVersion is " + FormatNumber(version->GetComponent(0, 0)) +
                      "; this program reads " + std::to_string(formatVersion));
  }
  // A field of nothing needs no arrays.
  if (count > 0 || fieldData->GetArray("Gamma"))
  {
    field.transfer.gamma = RequireArray(fieldData, what, "Gamma", 1, 1)->GetComponent(0, 0);
    field.beam.elevationSigma = RequireArray(fieldData, what, "ElevationSigma", 1, 1)->GetComponent(0, 0);
  }
  if (count > 0)
  {
    vtkPointData* const pointData = polyData->GetPointData();
    vtkDataArray* const scale = RequireArray(pointData, what, "Scale", 3, count);
    vtkDataArray* const rotation = RequireArray(pointData, what, "Rotation", 4, count);
    vtkDataArray* const reflectivity = RequireArray(pointData, what, "Reflectivity", 1, count);
    field.Resize(static_cast<std::size_t>(count));
    for (vtkIdType i = 0; i < count; ++i)
    {
      const auto n = static_cast<std::size_t>(i);
      polyData->GetPoint(i, field.means[n].data());
      scale->GetTuple(i, field.scales[n].data());
      rotation->GetTuple(i, field.rotations[n].data());
      field.reflectivities[n] = reflectivity->GetComponent(i, 0);
    }
  }
  if (auto* const provenance = vtkStringArray::SafeDownCast(fieldData->GetAbstractArray("Provenance")))
  {
    for (vtkIdType i = 0; i < provenance->GetNumberOfValues(); ++i)
    {
      stored.provenance.push_back(provenance->GetValue(i));
    }
  }
  try
  {
    field.Validate();
  }
  catch (const Error& error)
  {
    throw FormatError(what + ": " + error.what());
  }
  return stored;
}

void FieldToPolyData(const StoredField& stored, vtkPolyData* polyData)
{
  const GaussianField& field = stored.field;
  const auto count = static_cast<vtkIdType>(field.Size());
  polyData->Initialize();
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  points->SetNumberOfPoints(count);
  vtkDoubleArray* const scale = AddArray(polyData->GetPointData(), "Scale", 3, count);
  vtkDoubleArray* const rotation = AddArray(polyData->GetPointData(), "Rotation", 4, count);
  vtkDoubleArray* const reflectivity = AddArray(polyData->GetPointData(), "Reflectivity", 1, count);
  vtkNew<vtkCellArray> vertices;
  for (vtkIdType i = 0; i < count; ++i)
  {
    const auto n = static_cast<std::size_t>(i);
    points->SetPoint(i, field.means[n].data());
    scale->SetTuple(i, field.scales[n].data());
    rotation->SetTuple(i, field.rotations[n].data());
    reflectivity->SetValue(i, field.reflectivities[n]);
    vertices->InsertNextCell(1, &i);
  }
  polyData->SetPoints(points);
  polyData->SetVerts(vertices);
  polyData->GetPointData()->SetActiveScalars("Reflectivity");

  AddArray(polyData->GetFieldData(), "Gamma", 1, 1)->SetValue(0, field.transfer.gamma);
  AddArray(polyData->GetFieldData(), "ElevationSigma", 1, 1)->SetValue(0, field.beam.elevationSigma);
  vtkNew<vtkIntArray> version;
  version->SetName("FormatVersion");
  version->InsertNextValue(formatVersion);
  polyData->GetFieldData()->AddArray(version);
  if (!stored.provenance.empty())
  {
    vtkNew<vtkStringArray> provenance;
    provenance->SetName("Provenance");
    for (const std::string& line : stored.provenance)
    {
      provenance->InsertNextValue(line);
    }
    polyData->GetFieldData()->AddArray(provenance);
  }
}

}  // namespace bigus
