// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/FieldData.h"

#include <cstring>

#include "Core/Model/Error.h"
#include "Data/Arrays.h"
#include "Data/FieldShape.h"
#include "Data/LabelData.h"
#include "Data/Provenance.h"
#include "vtkCellArray.h"
#include "vtkDemandDrivenPipeline.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkIdTypeArray.h"
#include "vtkInformation.h"
#include "vtkInformationIntegerKey.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"
#include "vtkUnsignedCharArray.h"

namespace bigus
{
namespace
{

constexpr const char* kStandardErrorArray = "StandardError";

// Where the field's numbers are. The arrays are null when there is no point.
struct FieldArrays
{
  vtkIdType size = 0;
  vtkDataArray* points = nullptr;
  vtkDataArray* scales = nullptr;
  vtkDataArray* rotations = nullptr;
  vtkDataArray* reflectivities = nullptr;
  GaussianField none;  // no Gaussians, but the beam and the transfer function
};

// What a field may say of the probe: its thickness, and the normals of the planes trained on.
void ReadProbeBeam(vtkFieldData* data, const std::string& owner, Beam& beam)
{
  if (vtkDataArray* sigma = FindArray(data, owner, "ProbeElevationSigma", 1, 1, false))
  {
    beam.probeElevationSigma = sigma->GetTuple1(0);
  }
  vtkDataArray* normals = data ? data->GetArray("TrainedNormals") : nullptr;
  const vtkIdType count = normals ? normals->GetNumberOfTuples() : 0;
  RequireFewTrainedNormals(owner, count);
  if (normals)
  {
    FindArray(data, owner, "TrainedNormals", 3, count, true);
    beam.trainedNormals.resize(static_cast<std::size_t>(count));
    for (vtkIdType k = 0; k < count; ++k)
    {
      normals->GetTuple(k, beam.trainedNormals[k].data());
    }
  }
}

// The arrays of the right shape, or Error.
FieldArrays FindArrays(vtkPolyData* polyData)
{
  const std::string owner = "Gaussian field";
  Require(polyData, owner, ": there is no input; connect a field (vtkPolyData).");
  FieldArrays found;
  found.size = polyData->GetNumberOfPoints();
  const bool required = found.size > 0;
  vtkFieldData* data = polyData->GetFieldData();
  if (vtkDataArray* version = FindArray(data, owner, "FormatVersion", 1, 1, false))
  {
    RequireFieldFormatVersion(owner, version->GetTuple1(0));
  }
  if (vtkDataArray* gamma = FindArray(data, owner, "Gamma", 1, 1, required))
  {
    found.none.transfer.gamma = gamma->GetTuple1(0);
  }
  if (vtkDataArray* sigma = FindArray(data, owner, "ElevationSigma", 1, 1, required))
  {
    found.none.beam.elevationSigma = sigma->GetTuple1(0);
  }
  ReadProbeBeam(data, owner, found.none.beam);
  if (required)
  {
    vtkPointData* arrays = polyData->GetPointData();
    found.points = polyData->GetPoints()->GetData();
    found.scales = FindArray(arrays, owner, "Scale", 3, found.size, true);
    found.rotations = FindArray(arrays, owner, "Rotation", 4, found.size, true);
    found.reflectivities = FindArray(arrays, owner, "Reflectivity", 1, found.size, true);
  }
  return found;
}

void AddScalar(vtkFieldData* data, const char* name, double value)
{
  const auto array = NewArray<vtkDoubleArray>(name, 1, 1);
  array->SetValue(0, value);
  data->AddArray(array);
}

// The array itself when it holds doubles, else a copy that does.
vtkSmartPointer<vtkDoubleArray> AsDoubles(vtkDataArray* array, const char* name)
{
  vtkSmartPointer<vtkDoubleArray> doubles = vtkDoubleArray::SafeDownCast(array);
  if (!doubles)
  {
    doubles = vtkSmartPointer<vtkDoubleArray>::New();
    doubles->DeepCopy(array);
    doubles->SetName(name);
  }
  return doubles;
}

// Makes `polyData` the field of these arrays.
void Assemble(vtkPolyData* polyData, vtkDataArray* coordinates, vtkDataArray* scales, vtkDataArray* rotations,
              vtkDataArray* reflectivities, const Beam& beam, const TransferFunction& transfer)
{
  vtkNew<vtkPoints> points;
  points->SetData(coordinates);
  const vtkIdType n = points->GetNumberOfPoints();
  vtkNew<vtkCellArray> vertices;
  vertices->AllocateExact(n, n);
  for (vtkIdType i = 0; i < n; ++i)
  {
    vertices->InsertNextCell(1, &i);
  }
  polyData->Initialize();
  polyData->SetPoints(points);
  polyData->SetVerts(vertices);
  polyData->GetPointData()->AddArray(scales);
  polyData->GetPointData()->AddArray(rotations);
  polyData->GetPointData()->SetScalars(reflectivities);
  AddScalar(polyData->GetFieldData(), "Gamma", transfer.gamma);
  AddScalar(polyData->GetFieldData(), "ElevationSigma", beam.elevationSigma);
  if (beam.probeElevationSigma > 0)
  {
    AddScalar(polyData->GetFieldData(), "ProbeElevationSigma", beam.probeElevationSigma);
  }
  if (!beam.trainedNormals.empty())
  {
    const auto normals = NewArray<vtkDoubleArray>("TrainedNormals", 3, beam.trainedNormals.size());
    for (std::size_t k = 0; k < beam.trainedNormals.size(); ++k)
    {
      normals->SetTypedTuple(k, beam.trainedNormals[k].data());
    }
    polyData->GetFieldData()->AddArray(normals);
  }
  const auto version = NewArray<vtkIntArray>("FormatVersion", 1, 1);
  version->SetValue(0, kFieldFormatVersion);
  polyData->GetFieldData()->AddArray(version);
}

}  // namespace

GaussianField FieldFromPolyData(vtkPolyData* polyData)
{
  const FieldArrays arrays = FindArrays(polyData);
  GaussianField field = arrays.none;
  field.Resize(static_cast<std::size_t>(arrays.size));
  for (vtkIdType i = 0; i < arrays.size; ++i)
  {
    arrays.points->GetTuple(i, field.means[i].data());
    arrays.scales->GetTuple(i, field.scales[i].data());
    arrays.rotations->GetTuple(i, field.rotations[i].data());
    field.reflectivities[i] = arrays.reflectivities->GetTuple1(i);
  }
  field.Validate();
  return field;
}

std::optional<ViewDependence> ViewFromPolyData(vtkPolyData* polyData)
{
  const std::string owner = "Gaussian field";
  if (!polyData || !polyData->GetPointData()->GetArray("ViewTerm"))
  {
    return std::nullopt;
  }
  const vtkIdType n = polyData->GetNumberOfPoints();
  vtkFieldData* const data = polyData->GetFieldData();
  RequireViewVersion(owner, FindArray(data, owner, "ViewVersion", 1, 1, true)->GetTuple1(0));
  vtkDataArray* const terms = FindArray(polyData->GetPointData(), owner, "ViewTerm", 3, n, true);
  const vtkIdType count = data->GetArray("ViewPoses") ? data->GetArray("ViewPoses")->GetNumberOfTuples() : 1;
  vtkDataArray* const poses = FindArray(data, owner, "ViewPoses", 16, count, true);
  using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  using Pose = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  ViewDependence view;
  Rotation mean;
  FindArray(data, owner, "ViewMean", 9, 1, true)->GetTuple(0, mean.data());
  view.views.mean = mean;
  double steps[3];
  FindArray(data, owner, "ViewSteps", 3, 1, true)->GetTuple(0, steps);
  view.views.unit = steps[0];
  view.views.angleStep = steps[1];
  view.views.elevationStep = steps[2];
  for (vtkIdType k = 0; k < count; ++k)
  {
    Pose pose;
    poses->GetTuple(k, pose.data());
    view.views.poses.emplace_back(pose);
  }
  view.terms.resize(static_cast<std::size_t>(n));
  for (vtkIdType i = 0; i < n; ++i)
  {
    terms->GetTuple(i, view.terms[i].data());
  }
  view.Validate(view.terms.size());
  return view;
}

void ViewToPolyData(const ViewDependence& view, vtkPolyData* polyData)
{
  const RecordedViews& views = view.views;
  const auto terms = NewArray<vtkDoubleArray>("ViewTerm", 3, static_cast<vtkIdType>(view.terms.size()));
  for (std::size_t i = 0; i < view.terms.size(); ++i)
  {
    terms->SetTypedTuple(static_cast<vtkIdType>(i), view.terms[i].data());
  }
  polyData->GetPointData()->AddArray(terms);
  const auto version = NewArray<vtkIntArray>("ViewVersion", 1, 1);
  version->SetValue(0, kViewVersion);
  const auto mean = NewArray<vtkDoubleArray>("ViewMean", 9, 1);
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = views.mean;
  mean->SetTypedTuple(0, rows.data());
  const auto steps = NewArray<vtkDoubleArray>("ViewSteps", 3, 1);
  const double values[3] = {views.unit, views.angleStep, views.elevationStep};
  steps->SetTypedTuple(0, values);
  const auto poses = NewArray<vtkDoubleArray>("ViewPoses", 16, static_cast<vtkIdType>(views.poses.size()));
  for (std::size_t k = 0; k < views.poses.size(); ++k)
  {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = views.poses[k];
    poses->SetTypedTuple(static_cast<vtkIdType>(k), pose.data());
  }
  polyData->GetFieldData()->AddArray(version);
  polyData->GetFieldData()->AddArray(mean);
  polyData->GetFieldData()->AddArray(steps);
  polyData->GetFieldData()->AddArray(poses);
}

void FieldToPolyData(const GaussianField& field, vtkPolyData* polyData)
{
  const vtkIdType n = static_cast<vtkIdType>(field.Size());
  const auto points = NewArray<vtkDoubleArray>("Points", 3, n);
  const auto scales = NewArray<vtkDoubleArray>("Scale", 3, n);
  const auto rotations = NewArray<vtkDoubleArray>("Rotation", 4, n);
  const auto reflectivities = NewArray<vtkDoubleArray>("Reflectivity", 1, n);
  for (vtkIdType i = 0; i < n; ++i)
  {
    points->SetTypedTuple(i, field.means[i].data());
    scales->SetTypedTuple(i, field.scales[i].data());
    rotations->SetTypedTuple(i, field.rotations[i].data());
    reflectivities->SetValue(i, field.reflectivities[i]);
  }
  Assemble(polyData, points, scales, rotations, reflectivities, field.beam, field.transfer);
}

std::string StandardErrorOf(vtkDataObject* data)
{
  vtkAbstractArray* const found = data->GetFieldData()->GetAbstractArray(kStandardErrorArray);
  auto* const bytes = vtkUnsignedCharArray::SafeDownCast(found);
  if (found && (!bytes || bytes->GetNumberOfComponents() != 1))
  {
    throw Error("Gaussian field: the array StandardError is of " + std::to_string(found->GetNumberOfComponents()) +
                " components of " + found->GetDataTypeAsString() + "; it holds unsigned char of 1. Remove it.");
  }
  return bytes ? std::string(reinterpret_cast<const char*>(bytes->GetPointer(0)),
                             static_cast<std::size_t>(bytes->GetNumberOfValues()))
               : std::string();
}

void ReplaceStandardError(vtkDataObject* data, const std::string& bytes)
{
  data->GetFieldData()->RemoveArray(kStandardErrorArray);
  if (!bytes.empty())
  {
    const auto array = NewArray<vtkUnsignedCharArray>(kStandardErrorArray, 1, static_cast<vtkIdType>(bytes.size()));
    std::memcpy(array->GetPointer(0), bytes.data(), bytes.size());
    data->GetFieldData()->AddArray(array);
  }
}

void ShareField(vtkPolyData* from, vtkPolyData* to)
{
  const FieldArrays arrays = FindArrays(from);
  arrays.none.Validate();
  Eigen::Vector3d mean, scale;
  Eigen::Vector4d rotation;
  for (vtkIdType i = 0; i < arrays.size; ++i)
  {
    arrays.points->GetTuple(i, mean.data());
    arrays.scales->GetTuple(i, scale.data());
    arrays.rotations->GetTuple(i, rotation.data());
    ValidateGaussian(static_cast<std::size_t>(i), mean, scale, rotation, arrays.reflectivities->GetTuple1(i));
  }
  const std::vector<std::string> provenance = ProvenanceOf(from);
  const std::optional<ViewDependence> view = ViewFromPolyData(from);
  const std::optional<FieldLabels> labels = LabelsFromPolyData(from);
  if (arrays.size == 0)
  {
    FieldToPolyData(arrays.none, to);
  }
  else
  {
    const auto points = AsDoubles(arrays.points, "Points");
    const auto scales = AsDoubles(arrays.scales, "Scale");
    const auto rotations = AsDoubles(arrays.rotations, "Rotation");
    const auto reflectivities = AsDoubles(arrays.reflectivities, "Reflectivity");
    Assemble(to, points, scales, rotations, reflectivities, arrays.none.beam, arrays.none.transfer);
  }
  if (view)
  {
    ViewToPolyData(*view, to);
  }
  if (labels)
  {
    LabelsToPolyData(*labels, to);
  }
  ReplaceProvenance(to, provenance);
}

namespace
{

/// Goes downstream as far as filters let it: ParaView puts one of its own behind every reader.
class DownstreamKey : public vtkInformationIntegerKey
{
public:
  DownstreamKey() : vtkInformationIntegerKey("CHUNKS_OF_PIECES", "BigusField") {}

  void CopyDefaultInformation(vtkInformation* request, vtkInformation* from, vtkInformation* to) override
  {
    if (request->Has(vtkDemandDrivenPipeline::REQUEST_INFORMATION()))
    {
      this->ShallowCopy(from, to);
    }
  }
};

}  // namespace

void WriteChunks(const FieldChunks& chunks, vtkPolyData* part)
{
  vtkNew<vtkIdTypeArray> array;
  array->SetName(kChunksArray);
  array->InsertNextValue(chunks.total);
  array->InsertNextValue(chunks.first);
  for (const std::size_t size : chunks.sizes)
  {
    array->InsertNextValue(static_cast<vtkIdType>(size));
  }
  part->GetFieldData()->AddArray(array);
}

vtkInformationIntegerKey* ChunksOfPiecesKey()
{
  static vtkInformationIntegerKey* const key = new DownstreamKey;  // deleted by VTK's manager of keys
  return key;
}

}  // namespace bigus
