// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Scene.h"

#include <vtkDataArray.h>
#include <vtkImageData.h>
#include <vtkMetaImageReader.h>
#include <vtkNew.h>
#include <vtkPointData.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <functional>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Phantom/PhantomOptionList.h"
#include "Core/Training/OptionList.h"
#include "Data/SweepData.h"
#include "JobFields.h"
#include "vtkBigusSequenceReader.h"

using bigus::Error;
using bigus::Phantom;
using bigus::PhantomOptions;
using bigus::Sweep;
namespace fs = std::filesystem;
using Json = nlohmann::json;

Json WithoutTracker(Json description)
{
  for (const char* name : {"tracking_noise", "tracking_rotation_noise", "tracking_drift", "tracking_rotation_drift",
                           "outlier_share", "outlier_size", "tracking_delay", "tracking_quantum",
                           "tracking_rotation_quantum", "calibration_shift", "calibration_rotation"})
  {
    description.erase(name);
  }
  return description;
}

namespace
{

fs::path ExistingFile(const fs::path& folder, const std::string& name)
{
  const fs::path path = folder / name;
  if (!fs::is_regular_file(path))
  {
    throw Error("There is no file '" + path.string() + "'; say with --data where the data are.");
  }
  return path;
}

/// A sweep whose 8-bit pixels are `bytes`.
void SetPixels(Sweep& sweep, std::vector<std::uint8_t> bytes)
{
  const auto pixels = std::make_shared<const std::vector<std::uint8_t>>(std::move(bytes));
  sweep.pixelType = Sweep::PixelType::UInt8;
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
}

Sweep ReadSweep(JobFields& fields, const fs::path& data)
{
  const std::string file = ExistingFile(data, fields.Required<std::string>("file")).string();
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName(file.c_str());
  reader->AutoMaskOff();  // it looks at every frame, the held-out ones too
  std::string config;
  fields.Read("config", config);
  if (!config.empty())
  {
    reader->SetConfigFileName(ExistingFile(data, config).string().c_str());
  }
  std::array<double, 6> fan{};
  if (fields.Has("clip_fan"))
  {
    fields.Read("clip_fan", fan);
    reader->SetClipModeToFan();
    reader->SetFanApex(fan[0], fan[1]);
    reader->SetFanRadii(fan[2], fan[3]);
    reader->SetFanAngles(fan[4], fan[5]);
  }
  reader->Update();
  if (reader->GetErrorCode() != 0)
  {
    throw Error("'" + file + "' could not be read.");
  }
  return *bigus::SweepFromImage(reader->GetOutput()).sweep;
}

PhantomOptions ReadPhantomOptions(const Json& object)
{
  PhantomOptions options;
  JobFields fields(object, "phantom");
  const std::map<std::string, bigus::PhantomScene> scenes = {{"organ", bigus::PhantomScene::Organ},
                                                             {"speckle", bigus::PhantomScene::Speckle}};
  const std::map<std::string, bigus::ProbeKind> probes = {
      {"linear", bigus::ProbeKind::Linear}, {"convex", bigus::ProbeKind::Convex}, {"sector", bigus::ProbeKind::Sector}};
  std::string scene = "organ", probe = "linear";
  fields.Read("scene", scene);
  fields.Read("probe", probe);
  if (scenes.count(scene) == 0 || probes.count(probe) == 0)
  {
    throw Error("phantom: there is no scene '" + scene + "' or no probe '" + probe + "'.");
  }
  options.scene = scenes.at(scene);
  options.probe = probes.at(probe);
  bigus::ForEachPhantomOption(options, [&fields](const bigus::PhantomNumber& number, auto& value)
                              { fields.Read(bigus::SpellOption(number.name, '_'), value); });
  fields.Done();
  return options;
}

/// A phantom's sweep; pixels, which take seconds to minutes, come from the cache when they are there.
Sweep MakePhantom(const Json& description, const fs::path& cache)
{
  const Phantom phantom(ReadPhantomOptions(description));
  if (cache.empty())
  {
    return phantom.MakeSweep();
  }
  char name[64];
  std::snprintf(name, sizeof name, "phantom-%016zx.pixels",
                std::hash<std::string>()(WithoutTracker(description).dump()));
  const fs::path file = cache / name;
  Sweep sweep;
  const bigus::SlicePlane first = phantom.RecordedPlane(0);
  sweep.width = first.width;
  sweep.height = first.height;
  sweep.timestamps = phantom.Timestamps();
  for (int frame = 0; frame < phantom.Options().frames; ++frame)
  {
    sweep.imageToReference.push_back(phantom.RecordedPlane(frame).ImageToReference());
  }
  const std::size_t size = sweep.PixelsPerFrame() * sweep.imageToReference.size();
  if (fs::exists(file) && fs::file_size(file) == size)
  {
    std::vector<std::uint8_t> bytes(size);
    std::ifstream(file, std::ios::binary).read(reinterpret_cast<char*>(bytes.data()), size);
    SetPixels(sweep, std::move(bytes));
    if (phantom.Options().probe != bigus::ProbeKind::Linear)
    {
      sweep.mask = std::make_shared<const std::vector<std::uint8_t>>(phantom.Mask(phantom.TruePlane(0)));
    }
    return sweep;
  }
  sweep = phantom.MakeSweep();
  fs::create_directories(cache);
  const fs::path unfinished = file.string() + ".part";
  std::ofstream out(unfinished, std::ios::binary);
  out.write(static_cast<const char*>(sweep.pixels.get()), size);
  out.close();
  if (!out)
  {
    throw Error("'" + unfinished.string() + "' could not be written.");
  }
  fs::rename(unfinished, file);
  return sweep;
}

/// The z-planes of a cube of voxels, pixel for voxel.
Sweep SlicesOfVolume(JobFields& fields, const fs::path& data)
{
  const std::string file = ExistingFile(data, fields.Required<std::string>("volume")).string();
  const auto offset = fields.Required<std::array<int, 3>>("offset");
  const int size = fields.Required<int>("size");
  vtkNew<vtkMetaImageReader> reader;
  reader->SetFileName(file.c_str());
  reader->Update();
  vtkImageData* volume = reader->GetOutput();
  const auto* voxels = static_cast<const std::uint8_t*>(volume->GetScalarPointer());
  int dimensions[3];
  double spacing[3];
  volume->GetDimensions(dimensions);
  volume->GetSpacing(spacing);
  if (!voxels || volume->GetScalarType() != VTK_UNSIGNED_CHAR || volume->GetNumberOfScalarComponents() != 1)
  {
    throw Error("'" + file + "' is no volume of bytes.");
  }
  Sweep sweep;
  sweep.width = sweep.height = size;
  std::vector<std::uint8_t> bytes;
  for (int axis = 0; axis < 3; ++axis)
  {
    if (offset[axis] < 0 || size < 1 || offset[axis] + size > dimensions[axis])
    {
      throw Error("volume: a cube of " + std::to_string(size) + " voxels from voxel " + std::to_string(offset[axis]) +
                  " on does not fit the " + std::to_string(dimensions[axis]) + " of '" + file + "'.");
    }
  }
  for (int k = 0; k < size; ++k)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose.diagonal().head<3>() = Eigen::Vector3d(spacing[0], spacing[1], 1);
    pose(2, 3) = k * spacing[2];
    sweep.imageToReference.push_back(pose);
    for (int j = 0; j < size; ++j)
    {
      const std::size_t row =
          (static_cast<std::size_t>(offset[2] + k) * dimensions[1] + offset[1] + j) * dimensions[0] + offset[0];
      bytes.insert(bytes.end(), voxels + row, voxels + row + size);
    }
  }
  SetPixels(sweep, std::move(bytes));
  return sweep;
}

/// A rectangle of every frame (8-bit pixels): column, row, columns, rows.
Sweep Cropped(const Sweep& sweep, const std::array<int, 4>& rectangle)
{
  const auto [column, row, columns, rows] = rectangle;
  if (column < 0 || row < 0 || columns < 1 || rows < 1 || column + columns > sweep.width || row + rows > sweep.height ||
      sweep.pixelType != Sweep::PixelType::UInt8 || sweep.mask)
  {
    throw Error("crop: the rectangle does not fit the frames, or they are not plain bytes.");
  }
  Sweep cropped = sweep;
  cropped.width = columns;
  cropped.height = rows;
  std::vector<std::uint8_t> bytes;
  const auto* pixels = static_cast<const std::uint8_t*>(sweep.pixels.get());
  for (int frame = 0; frame < sweep.NumberOfFrames(); ++frame)
  {
    for (int j = row; j < row + rows; ++j)
    {
      const auto* first = pixels + (static_cast<std::size_t>(frame) * sweep.height + j) * sweep.width + column;
      bytes.insert(bytes.end(), first, first + columns);
    }
    Eigen::Matrix4d& pose = cropped.imageToReference[frame];
    pose.col(3) += column * pose.col(0) + row * pose.col(1);
  }
  SetPixels(cropped, std::move(bytes));
  return cropped;
}

Sweep ReadScene(JobFields& fields, const SceneFolders& folders)
{
  if (fields.Has("file"))
  {
    return ReadSweep(fields, folders.data);
  }
  if (fields.Has("volume"))
  {
    return SlicesOfVolume(fields, folders.data);
  }
  std::vector<std::shared_ptr<const Sweep>> sweeps;
  for (const Json& description : fields.Required<std::vector<Json>>("phantoms"))
  {
    sweeps.push_back(std::make_shared<const Sweep>(MakePhantom(description, folders.cache)));
  }
  if (sweeps.empty())
  {
    throw Error("sweep: 'phantoms' is empty.");
  }
  return *Join(sweeps);
}

}  // namespace

std::shared_ptr<const Sweep> MakeScene(const Json& scene, const SceneFolders& folders)
{
  JobFields fields(scene, "sweep");
  Sweep sweep = ReadScene(fields, folders);
  if (fields.Has("crop"))
  {
    sweep = Cropped(sweep, fields.Required<std::array<int, 4>>("crop"));
  }
  int reduce = 1;
  fields.Read("reduce", reduce);
  fields.Done();
  return std::make_shared<const Sweep>(sweep.Reduced(reduce));
}

std::vector<Eigen::Matrix4d> TruePoses(const Json& scene)
{
  std::vector<Eigen::Matrix4d> poses;
  if (!scene.contains("phantoms") || scene.contains("crop"))
  {
    return poses;
  }
  const int block = scene.value("reduce", 1);
  for (const Json& description : scene.at("phantoms"))
  {
    const Phantom phantom(ReadPhantomOptions(description));
    for (int frame = 0; frame < phantom.Options().frames; ++frame)
    {
      Eigen::Matrix4d pose = phantom.TruePlane(frame).ImageToReference();
      pose.col(3) += 0.5 * (block - 1) * (pose.col(0) + pose.col(1));  // as Sweep::Reduced
      pose.leftCols<2>() *= block;
      poses.push_back(pose);
    }
  }
  return poses;
}
