// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/LabelData.h"

#include <algorithm>
#include <cmath>
#include <numeric>
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
const std::string kOwner = "Labels";

void AddWeights(vtkDataArray* array, std::vector<float>& weights)
{
  for (const double weight : vtk::DataArrayValueRange(array))
  {
    weights.push_back(static_cast<float>(weight));
  }
}

/// The number in the file of each frame, [frames]; those that are not told are counted from `first`.
std::vector<int> SourceFrames(vtkImageData* stack, int first = 0)
{
  const int count = stack->GetDimensions()[2];
  std::vector<int> numbers(static_cast<std::size_t>(count));
  std::iota(numbers.begin(), numbers.end(), first);
  if (vtkDataArray* const source = FindArray(stack->GetFieldData(), kOwner, "SourceFrame", 1, count, false))
  {
    for (int k = 0; k < count; ++k)
    {
      numbers[k] = static_cast<int>(source->GetTuple1(k));
    }
  }
  return numbers;
}

void RequirePictures(vtkImageData* pictures, vtkImageData* sweep)
{
  vtkDataArray* const scalars = pictures ? pictures->GetPointData()->GetScalars() : nullptr;
  Require(scalars && sweep,
          "Labels: there is no picture; connect the sweep and an image with one slice of labels a frame.");
  Require(scalars->GetNumberOfComponents() == 1, "Labels: the pictures have ", scalars->GetNumberOfComponents(),
          " components; they hold one whole number from 0 to 255 a pixel.");
  const int *size = pictures->GetDimensions(), *frames = sweep->GetDimensions();
  if (!IsPartOfPictures(pictures, sweep) && (size[0] != frames[0] || size[1] != frames[1]))
  {
    throw Error("Labels: the pictures have " + std::to_string(size[0]) + " x " + std::to_string(size[1]) +
                " pixels and the sweep's frames " + std::to_string(frames[0]) + " x " + std::to_string(frames[1]) +
                "; label pictures have the size of the frames, or say where they were cropped from "
                "(Segmentation_ReferenceImageExtentOffset).");
  }
}

/// Throws Error where a part of the pictures reaches beyond the frames of the sweep's file, as far as these numbers tell.
void RequireWithin(const int part[6], const int frames[6], int lastNumber)
{
  const auto range = [](int first, int last) { return std::to_string(first) + " to " + std::to_string(last); };
  Require(part[0] >= frames[0] && part[1] <= frames[1] && part[2] >= frames[2] && part[3] <= frames[3] &&
              part[4] >= 0 && part[5] <= lastNumber,
          "Labels: the pictures were cropped to columns ", range(part[0], part[1]), ", rows ", range(part[2], part[3]),
          " and frames ", range(part[4], part[5]), ", and the sweep has columns ", range(frames[0], frames[1]),
          ", rows ", range(frames[2], frames[3]), " and frames up to ", lastNumber,
          "; give labels that were drawn on this sweep.");
}

}  // namespace

std::vector<Label> LabelNamesOf(vtkDataObject* data)
{
  vtkFieldData* const arrays = data->GetFieldData();
  vtkDataArray* const values = arrays->GetArray(kValues);
  std::vector<Label> labels;
  if (!values)
  {
    return labels;
  }
  const vtkIdType count = values->GetNumberOfTuples();
  Require(count <= kLargestLabel, "Labels: LabelValues holds ", count, " values; at most 255 are read.");
  FindArray(arrays, kOwner, kValues, 1, count, true);
  auto* const names = vtkStringArray::SafeDownCast(arrays->GetAbstractArray(kNames));
  vtkDataArray* const colors = FindArray(arrays, kOwner, kColors, 3, count, false);
  for (vtkIdType k = 0; k < count; ++k)
  {
    Label label;
    label.value = static_cast<int>(values->GetTuple1(k));
    label.name = names && k < names->GetNumberOfValues() ? std::string(names->GetValue(k)) : std::string();
    label.name = label.name.empty() ? "Label " + std::to_string(label.value) : label.name;
    label.color = UsualColor(label.value);
    if (colors)
    {
      colors->GetTuple(k, label.color.data());
    }
    labels.push_back(label);
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
  FieldLabels labels{LabelNamesOf(polyData), {}, {}, {}};
  const auto count = static_cast<int>(labels.labels.size());
  const vtkIdType n = polyData->GetNumberOfPoints();
  vtkFieldData* const data = polyData->GetFieldData();
  const vtkIdType m = data->GetArray(kPoints) ? data->GetArray(kPoints)->GetNumberOfTuples() : 0;
  AddWeights(FindArray(polyData->GetPointData(), kOwner, kWeight, count, n, true), labels.weights);
  if (m > 0)
  {
    vtkDataArray* const points = FindArray(data, kOwner, kPoints, 4, m, true);
    AddWeights(FindArray(data, kOwner, kPointWeight, count, m, true), labels.weights);
    for (vtkIdType i = 0; i < m; ++i)
    {
      double point[4];
      points->GetTuple(i, point);
      labels.points.emplace_back(point[0], point[1], point[2]);
      labels.scales.push_back(static_cast<float>(point[3]));
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
    const double point[4] = {labels.points[i].x(), labels.points[i].y(), labels.points[i].z(), labels.scales[i]};
    points->SetTypedTuple(i, point);
  }
  polyData->GetPointData()->AddArray(weights);
  polyData->GetFieldData()->AddArray(pointWeights);
  polyData->GetFieldData()->AddArray(points);
  ReplaceLabelNames(polyData, labels.labels);
}

bool IsPartOfPictures(vtkImageData* pictures, vtkImageData* sweep)
{
  const int *size = pictures->GetDimensions(), *frames = sweep->GetDimensions();
  const int *own = pictures->GetExtent(), *theirs = sweep->GetExtent();
  const bool isAtCorner = (own[0] == 0 && own[2] == 0 && own[4] == 0) ||
                          (own[0] == theirs[0] && own[2] == theirs[2] && own[4] == theirs[4]);
  return !pictures->GetFieldData()->GetArray("SourceFrame") &&
         !(isAtCorner && size[0] == frames[0] && size[1] == frames[1]);
}

LabelFrames LabelFramesFromImage(vtkImageData* pictures, vtkImageData* sweep, const std::vector<int>& frames)
{
  RequirePictures(pictures, sweep);
  const bool isPart = IsPartOfPictures(pictures, sweep);
  const std::vector<int> theirs = SourceFrames(sweep);
  const int *extent = pictures->GetExtent(), *whole = sweep->GetExtent();
  std::vector<int> own = SourceFrames(pictures, isPart ? extent[4] : 0);
  if (isPart)
  {
    RequireWithin(extent, whole, *std::max_element(theirs.begin(), theirs.end()));
  }
  else if (own.size() == theirs.size() && std::find(own.begin(), own.end(), theirs.front()) == own.end())
  {
    own = theirs;  // counted from 1
  }
  const int *size = pictures->GetDimensions(), width = sweep->GetDimensions()[0], height = sweep->GetDimensions()[1];
  const std::size_t n = static_cast<std::size_t>(width) * height;
  const std::size_t corner = isPart ? static_cast<std::size_t>(extent[2] - whole[2]) * width + extent[0] - whole[0] : 0;
  vtkDataArray* const scalars = pictures->GetPointData()->GetScalars();
  LabelFrames given;
  for (std::size_t f = 0; f < frames.size(); ++f)
  {
    const auto at = std::find(own.begin(), own.end(), theirs[frames[f]]);
    if (at == own.end() && !isPart)
    {
      continue;
    }
    given.frames.push_back(static_cast<int>(f));
    given.pixels.resize(given.pixels.size() + n, 0);
    std::uint8_t* const picture = &given.pixels[given.pixels.size() - n + corner];
    const vtkIdType first = static_cast<vtkIdType>(at - own.begin()) * size[0] * size[1];
    for (vtkIdType p = 0; at != own.end() && p < static_cast<vtkIdType>(size[0]) * size[1]; ++p)
    {
      const double value = scalars->GetTuple1(first + p);
      if (!(value >= 0 && value <= kLargestLabel && value == std::floor(value)))
      {
        throw Error("Labels: the picture of frame " + std::to_string(theirs[frames[f]]) + " has the pixel " +
                    std::to_string(value) + "; labels are whole numbers from 0 (none) to 255.");
      }
      picture[p / size[0] * width + p % size[0]] = static_cast<std::uint8_t>(value);
    }
  }
  given.labels = WithNames(LabelNamesOf(pictures), given.pixels);
  return given;
}

}  // namespace bigus
