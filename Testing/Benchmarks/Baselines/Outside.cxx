// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Outside.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "Core/Model/Error.h"

using bigus::Require;
using bigus::SlicePlane;

namespace
{

std::string Line(const SlicePlane& plane)
{
  std::ostringstream line;
  line.precision(std::numeric_limits<double>::max_digits10);
  line << plane.width << ' ' << plane.height;
  for (const Eigen::Vector3d& vector : {plane.origin, plane.columnStep, plane.rowStep})
  {
    line << ' ' << vector.x() << ' ' << vector.y() << ' ' << vector.z();
  }
  return line.str();
}

void WriteTraining(const std::filesystem::path& folder, const bigus::Sweep& sweep, const std::vector<int>& training)
{
  std::ofstream planes(folder / "training.txt"), pixels(folder / "training.f32", std::ios::binary);
  std::vector<float> image(sweep.PixelsPerFrame());
  for (const int frame : training)
  {
    planes << Line(sweep.Plane(frame)) << '\n';
    sweep.CopyFrame(frame, image.data());
    for (std::size_t p = 0; p < image.size(); ++p)
    {
      image[p] = sweep.IsLit(p) ? image[p] : std::numeric_limits<float>::quiet_NaN();
    }
    pixels.write(reinterpret_cast<const char*>(image.data()),
                 static_cast<std::streamsize>(image.size() * sizeof(float)));
  }
  planes.close();
  pixels.close();
  Require(planes && pixels, "method: the training frames cannot be written to '", folder.string(), "'.");
}

}  // namespace

Outside::Outside(const std::filesystem::path& folder, const bigus::Sweep& sweep, const std::vector<int>& training)
    : isPredicted_(std::filesystem::exists(folder / "predicted.f32")), name_(folder.string())
{
  if (isPredicted_)
  {
    pictures_.open(folder / "predicted.f32", std::ios::binary);
  }
  else
  {
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    WriteTraining(folder, sweep, training);
  }
  asked_.open(folder / "asked.txt", isPredicted_ ? std::ios::in : std::ios::out | std::ios::trunc);
  Require(asked_.is_open() && (!isPredicted_ || pictures_.is_open()), "method: 'asked.txt' or 'predicted.f32' in '",
          name_, "' cannot be opened.");
}

void Outside::Predict(const SlicePlane& plane, float* image)
{
  ++count_;
  const std::string line = Line(plane);
  if (!isPredicted_)
  {
    asked_ << line << std::endl;
    std::fill(image, image + plane.NumberOfPixels(), 0.0f);
    return;
  }
  std::string asked;
  Require(std::getline(asked_, asked) && asked == line, "method: plane ", count_, " in '", name_,
          "/asked.txt' is not the one that this job asks for; empty the folder and run the job twice anew.");
  pictures_.read(reinterpret_cast<char*>(image), static_cast<std::streamsize>(plane.NumberOfPixels() * sizeof(float)));
  Require(static_cast<bool>(pictures_), "method: '", name_, "/predicted.f32' ends within picture ", count_,
          "; it needs one of float32 for each plane of asked.txt.");
  Require(std::all_of(image, image + plane.NumberOfPixels(), [](float value) { return std::isfinite(value); }),
          "method: '", name_, "/predicted.f32' has a pixel in picture ", count_, " that is no number.");
}
