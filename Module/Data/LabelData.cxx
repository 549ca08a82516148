// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/LabelData.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "Core/Model/Error.h"
#include "Data/Arrays.h"
#include "vtkDataArrayRange.h"
#include "vtkDoubleArray.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkIntArray.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"
#include "vtkStringArray.h"

namespace bigus
{
namespace
{

constexpr const char* kWeight = "LabelWeight";
constexpr const char* kPoints = "LabelPoints";
constexpr const char* kPointWeight = "LabelPointWeight";
constexpr const char* kNames = "LabelNames";
constexpr const char* kValues = "LabelValues";
constexpr const char* kColors = "LabelColors";
constexpr const char* kNumbers = "SourceFrame";
const std::string kOwner = "Labels";

void AddWeights(vtkDataArray* array, std::vector<float>& weights)
{
  for (const double weight : vtk::DataArrayValueRange(array))
  {
    weights.push_back(static_cast<float>(weight));
  }
}

/// The number in the file of each frame of a stack; counted from 0 where they are not told.
std::vector<int> SourceFrames(vtkImageData* stack)
{
  std::vector<int> numbers(static_cast<std::size_t>(stack->GetDimensions()[2]));
  vtkDataArray* const source = FindArray(stack->GetFieldData(), kOwner, kNumbers, 1, stack->GetDimensions()[2], false);
  for (std::size_t k = 0; k < numbers.size(); ++k)
  {
    numbers[k] = static_cast<int>(source ? source->GetTuple1(static_cast<vtkIdType>(k)) : static_cast<double>(k));
  }
  return numbers;
}

/// The number in the sweep's file of the frame that each picture is of. `theirs`: those of the sweep's frames.
std::vector<int> NumbersOfPictures(vtkImageData* pictures, const std::vector<int>& theirs)
{
  std::vector<int> own = SourceFrames(pictures);
  const bool areAll = own.size() == theirs.size(), areNumbered = pictures->GetFieldData()->GetArray(kNumbers);
  const auto inFile = 1 + static_cast<std::int64_t>(*std::max_element(theirs.begin(), theirs.end()));
  Require(areNumbered || areAll || static_cast<std::int64_t>(own.size()) == inFile, "Labels: there are ", own.size(),
          " pictures for ", inFile, " frames; say which frames they are of (--frames, SourceFrame).");
  const bool isOther = !areNumbered || std::find(own.begin(), own.end(), theirs.front()) == own.end();
  return areAll && isOther ? theirs : own;  // others are counted from 1
}

void RequirePictures(vtkImageData* pictures, vtkImageData* sweep)
{
  vtkDataArray* const scalars = pictures ? pictures->GetPointData()->GetScalars() : nullptr;
  Require(scalars && sweep && sweep->GetDimensions()[2] > 0,
          "Labels: there is no picture; connect the sweep and an image with one slice of labels a frame.");
  Require(scalars->GetNumberOfComponents() == 1, "Labels: the pictures have ", scalars->GetNumberOfComponents(),
          " components; they hold one whole number from 0 to 255 a pixel.");
}

/// Pictures that do not begin at the first pixel of the first frame were cropped: they lie where their extent says in the
/// pictures of all frames up to `last`, which are empty beside them.
vtkSmartPointer<vtkImageData> Uncropped(vtkImageData* pictures, vtkImageData* sweep, int last)
{
  const int *own = pictures->GetExtent(), *frames = sweep->GetExtent();
  if (pictures->GetFieldData()->GetArray(kNumbers) || (own[0] == 0 && own[2] == 0 && own[4] == 0))
  {
    return pictures;
  }
  const auto range = [own](int axis)
  { return std::to_string(own[2 * axis]) + " to " + std::to_string(own[2 * axis + 1]); };
  Require(own[0] >= 0 && own[1] <= frames[1] && own[2] >= 0 && own[3] <= frames[3] && own[4] >= 0 && own[5] <= last,
          "Labels: the pictures were cropped to columns ", range(0), ", rows ", range(1), " and frames ", range(2),
          ", and the sweep has columns up to ", frames[1], ", rows up to ", frames[3], " and frames up to ", last,
          "; give labels that were drawn on this sweep.");
  auto whole = vtkSmartPointer<vtkImageData>::New();
  whole->SetExtent(0, frames[1], 0, frames[3], 0, last);
  whole->AllocateScalars(pictures->GetScalarType(), 1);
  whole->GetPointData()->GetScalars()->Fill(0);
  whole->CopyAndCastFrom(pictures, pictures->GetExtent());
  whole->GetFieldData()->ShallowCopy(pictures->GetFieldData());
  return whole;
}

}  // namespace

std::vector<Label> LabelNamesOf(vtkDataObject* data)
{
  vtkFieldData* const arrays = data->GetFieldData();
  vtkDataArray* const values = arrays->GetArray(kValues);
  if (!values)
  {
    return {};
  }
  const vtkIdType count = values->GetNumberOfTuples();
  Require(count <= kLargestLabel, "Labels: LabelValues holds ", count, " values; at most 255 are read.");
  FindArray(arrays, kOwner, kValues, 1, count, true);
  auto* const names = vtkStringArray::SafeDownCast(arrays->GetAbstractArray(kNames));
  vtkDataArray* const colors = FindArray(arrays, kOwner, kColors, 3, count, false);
  std::vector<Label> labels(static_cast<std::size_t>(count));
  for (vtkIdType k = 0; k < count; ++k)
  {
    Label& label = labels[k];
    label.value = static_cast<int>(values->GetTuple1(k));
    label.name = names && k < names->GetNumberOfValues() ? std::string(names->GetValue(k)) : std::string();
    label.name = label.name.empty() ? "Label " + std::to_string(label.value) : label.name;
    label.color = UsualColor(label.value);
    if (colors)
    {
      colors->GetTuple(k, label.color.data());
    }
  }
  ValidateLabels(labels);
  return labels;
}

void ReplaceLabelNames(vtkDataObject* data, const std::vector<Label>& labels)
{
  const auto count = static_cast<vtkIdType>(labels.size());
  const auto names = NewArray<vtkStringArray>(kNames, 1, count);
  const auto values = NewArray<vtkIntArray>(kValues, 1, count);
  const auto colors = NewArray<vtkDoubleArray>(kColors, 3, count);
  for (vtkIdType k = 0; k < count; ++k)
  {
    names->SetValue(k, labels[k].name);
    values->SetValue(k, labels[k].value);
    colors->SetTypedTuple(k, labels[k].color.data());
  }
  data->GetFieldData()->AddArray(names);
  data->GetFieldData()->AddArray(values);
  data->GetFieldData()->AddArray(colors);
}

std::optional<FieldLabels> LabelsFromPolyData(vtkPolyData* polyData)
{
  if (!polyData || !polyData->GetPointData()->GetArray(kWeight))
  {
    return std::nullopt;
  }
  FieldLabels labels{LabelNamesOf(polyData), {}, {}};
  const auto count = static_cast<int>(labels.labels.size());
  const vtkIdType n = polyData->GetNumberOfPoints();
  vtkFieldData* const data = polyData->GetFieldData();
  const vtkIdType m = data->GetArray(kPoints) ? data->GetArray(kPoints)->GetNumberOfTuples() : 0;
  AddWeights(FindArray(polyData->GetPointData(), kOwner, kWeight, count, n, true), labels.weights);
  if (m > 0)
  {
    AddWeights(FindArray(data, kOwner, kPointWeight, count, m, true), labels.weights);
    vtkDataArray* const points = FindArray(data, kOwner, kPoints, 4, m, true);
    labels.points.resize(static_cast<std::size_t>(m));
    for (vtkIdType i = 0; i < m; ++i)
    {
      points->GetTuple(i, labels.points[i].data());
    }
  }
  labels.Validate(static_cast<std::size_t>(n));
  return labels;
}

void LabelsToPolyData(const FieldLabels& labels, vtkPolyData* polyData)
{
  const auto count = static_cast<int>(labels.labels.size());
  const vtkIdType n = polyData->GetNumberOfPoints();
  const auto m = static_cast<vtkIdType>(labels.points.size());
  const auto weights = NewArray<vtkFloatArray>(kWeight, count, n);
  const auto pointWeights = NewArray<vtkFloatArray>(kPointWeight, count, m);
  const auto points = NewArray<vtkDoubleArray>(kPoints, 4, m);
  const auto middle = labels.weights.begin() + static_cast<std::ptrdiff_t>(n) * count;
  std::copy(labels.weights.begin(), middle, weights->GetPointer(0));
  std::copy(middle, labels.weights.end(), pointWeights->GetPointer(0));
  for (vtkIdType i = 0; i < m; ++i)
  {
    points->SetTypedTuple(i, labels.points[i].data());
  }
  polyData->GetPointData()->AddArray(weights);
  polyData->GetFieldData()->AddArray(pointWeights);
  polyData->GetFieldData()->AddArray(points);
  ReplaceLabelNames(polyData, labels.labels);
}

LabelFrames LabelFramesFromImage(vtkImageData* drawn, vtkImageData* sweep, const std::vector<int>& frames)
{
  RequirePictures(drawn, sweep);
  const std::vector<int> theirs = SourceFrames(sweep);
  const vtkSmartPointer<vtkImageData> pictures =
      Uncropped(drawn, sweep, *std::max_element(theirs.begin(), theirs.end()));
  const int *size = pictures->GetDimensions(), *sides = sweep->GetDimensions();
  Require(size[0] == sides[0] && size[1] == sides[1], "Labels: the pictures have ", size[0], " x ", size[1],
          " pixels and the sweep's frames ", sides[0], " x ", sides[1],
          "; label pictures have the size of the frames, or say where they were cropped from "
          "(Segmentation_ReferenceImageExtentOffset).");
  const std::vector<int> own = NumbersOfPictures(pictures, theirs);
  const vtkIdType n = static_cast<vtkIdType>(sweep->GetDimensions()[0]) * sweep->GetDimensions()[1];
  vtkDataArray* const scalars = pictures->GetPointData()->GetScalars();
  LabelFrames given;
  for (std::size_t f = 0; f < frames.size(); ++f)
  {
    const auto at = std::find(own.begin(), own.end(), theirs[frames[f]]);
    if (at == own.end())
    {
      continue;
    }
    given.frames.push_back(static_cast<int>(f));
    for (vtkIdType p = (at - own.begin()) * n, end = p + n; p < end; ++p)
    {
      const double value = scalars->GetTuple1(p);
      Require(value >= 0 && value <= kLargestLabel && value == std::floor(value), "Labels: the picture of frame ", *at,
              " has the pixel ", value, "; labels are whole numbers from 0 (none) to 255.");
      given.pixels.push_back(static_cast<std::uint8_t>(value));
    }
  }
  given.labels = WithNames(LabelNamesOf(pictures), given.pixels);
  return given;
}

}  // namespace bigus
