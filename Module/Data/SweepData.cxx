// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/SweepData.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Model/PixelMemory.h"
#include "Data/Arrays.h"
#include "vtkDoubleArray.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkIntArray.h"
#include "vtkPointData.h"
#include "vtkSmartPointer.h"
#include "vtkUnsignedCharArray.h"
#include "vtkUnsignedShortArray.h"

namespace bigus
{
namespace
{

std::shared_ptr<const void> Alias(vtkDataArray* array)
{
  vtkSmartPointer<vtkDataArray> keep = array;
  return std::shared_ptr<const void>(array->GetVoidPointer(0), [keep](const void*) {});
}

std::shared_ptr<const void> ShortsAsFloats(vtkUnsignedShortArray* array)
{
  const std::size_t n = static_cast<std::size_t>(array->GetNumberOfValues());
  const auto floats = AllocatePixels<float>(n);
  std::transform(array->GetPointer(0), array->GetPointer(0) + n, floats.get(),
                 [](unsigned short value) { return static_cast<float>(value / 65535.0); });
  return floats;
}

std::shared_ptr<const std::vector<std::uint8_t>> MaskOf(vtkDataArray* array)
{
  auto mask = std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(array->GetNumberOfTuples()));
  if (auto* bytes = vtkUnsignedCharArray::SafeDownCast(array))  // what our reader makes
  {
    std::transform(bytes->GetPointer(0), bytes->GetPointer(0) + mask->size(), mask->begin(),
                   [](unsigned char value) { return value != 0; });
  }
  else
  {
    vtkIdType next = 0;
    std::generate(mask->begin(), mask->end(), [&] { return array->GetTuple1(next++) != 0; });
  }
  return mask;
}

int AveragedOf(vtkFieldData* data, const std::string& owner)
{
  constexpr double kMost = 65536;
  vtkDataArray* averaged = FindArray(data, owner, "Averaged", 1, 1, false);
  const double side = averaged ? averaged->GetTuple1(0) : 1;
  return side > 1 ? static_cast<int>(std::min(side, kMost)) : 1;  // not a number: 1
}

/// The image's grey values. Throws Error where it has none.
vtkDataArray* PixelsOf(vtkImageData* image, const std::string& owner)
{
  Require(image && image->GetNumberOfPoints() != 0, owner, ": the image has no pixels; connect a tracked sequence.");
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  Require(scalars, owner, ": the image has no active scalars, so there are no pixels.");
  Require(scalars->GetNumberOfComponents() == 1, owner, ": pixels have ", scalars->GetNumberOfComponents(),
          " components; one grey value each is expected. Convert colour to grey first.");
  Require(scalars->GetNumberOfTuples() == image->GetNumberOfPoints(), owner, ": the scalars have ",
          scalars->GetNumberOfTuples(), " values for ", image->GetNumberOfPoints(), " pixels.");
  return scalars;
}

/// Shares the pixels with VTK, but for those of 16 bits.
void SetPixels(vtkDataArray* scalars, const std::string& owner, Sweep& sweep)
{
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
}

}  // namespace

ImportedSweep SweepFromImage(vtkImageData* image)
{
  const std::string owner = "Sweep";
  vtkDataArray* scalars = PixelsOf(image, owner);
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
    sweep.mask = MaskOf(mask);
  }

  sweep.averaged = AveragedOf(data, owner);
  SetPixels(scalars, owner, sweep);

  ImportedSweep imported;
  vtkDataArray* status = FindArray(data, owner, "Status", 1, size[2], false);
  for (int k = 0; k < size[2]; ++k)
  {
    if (!status || status->GetTuple1(k) != 0)
    {
      imported.frames.push_back(k);
    }
  }
  Require(!imported.frames.empty(), owner, ": all ", size[2],
          " frames are marked as rejected (Status 0); no frame has a usable pose.");
  if (static_cast<int>(imported.frames.size()) < size[2])
  {
    sweep = sweep.Subset(imported.frames);
  }
  sweep.Validate();
  imported.sweep = std::make_shared<const Sweep>(std::move(sweep));
  return imported;
}

ImportedSweep SweepFromImages(const std::vector<vtkImageData*>& images)
{
  ImportedSweep all;
  std::vector<std::shared_ptr<const Sweep>> sequences;
  int earlier = 0;  // frames of the images before
  for (std::size_t k = 0; k < images.size(); ++k)
  {
    try
    {
      const ImportedSweep one = SweepFromImage(images[k]);
      sequences.push_back(one.sweep);
      std::transform(one.frames.begin(), one.frames.end(), std::back_inserter(all.frames),
                     [earlier](int frame) { return earlier + frame; });
      earlier += images[k]->GetDimensions()[2];
    }
    catch (const Error& error)
    {
      throw Error((images.size() > 1 ? "Sequence " + std::to_string(k + 1) + ": " : "") + error.what());
    }
  }
  all.sweep = Join(sequences);
  return all;
}

void FillImagePoses(const std::vector<vtkImageData*>& images, const ImportedSweep& imported,
                    const std::vector<Eigen::Matrix4d>& poses, vtkDoubleArray* array)
{
  array->Initialize();
  array->SetNumberOfComponents(16);
  array->SetName("ImageToReference");
  std::vector<vtkImageData*> imageOf;  // of each frame
  for (vtkImageData* image : images)
  {
    vtkDataArray* recorded = image->GetFieldData()->GetArray("ImageToReference");
    imageOf.insert(imageOf.end(), static_cast<std::size_t>(recorded->GetNumberOfTuples()), image);
    for (vtkIdType frame = 0; frame < recorded->GetNumberOfTuples(); ++frame)
    {
      array->InsertNextTuple(recorded->GetTuple(frame));
    }
  }
  for (std::size_t k = 0; k < poses.size(); ++k)
  {
    if (poses[k] != imported.sweep->imageToReference[k])
    {
      int extent[6];
      imageOf[imported.frames[k]]->GetExtent(extent);
      Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = poses[k];
      pose.col(3) -= extent[0] * pose.col(0) + extent[2] * pose.col(1);  // VTK's (x0, y0) is our pixel (0, 0)
      array->SetTypedTuple(imported.frames[k], pose.data());
    }
  }
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
  const auto poses = NewArray<vtkDoubleArray>("ImageToReference", 16, frames);
  for (int k = 0; k < frames; ++k)
  {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = sweep.imageToReference[k];
    poses->SetTypedTuple(k, pose.data());
  }
  data->AddArray(poses);
  if (!sweep.timestamps.empty())
  {
    const auto times = NewArray<vtkDoubleArray>("Timestamp", 1, frames);
    std::copy(sweep.timestamps.begin(), sweep.timestamps.end(), times->GetPointer(0));
    data->AddArray(times);
  }
  if (sweep.averaged > 1)
  {
    const auto averaged = NewArray<vtkIntArray>("Averaged", 1, 1);
    averaged->SetValue(0, sweep.averaged);
    data->AddArray(averaged);
  }
  if (sweep.mask)
  {
    const auto mask = NewArray<vtkUnsignedCharArray>("Mask", 1, static_cast<vtkIdType>(sweep.mask->size()));
    std::copy(sweep.mask->begin(), sweep.mask->end(), mask->GetPointer(0));
    data->AddArray(mask);
  }
}

}  // namespace bigus
