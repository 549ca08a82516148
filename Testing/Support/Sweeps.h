// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Small sweeps: black, random, or rendered from a known field.
#pragma once

#include <memory>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Sweep.h"
#include "Support/Fields.h"

namespace bigus::test
{

/// `frames` planes of width x height pixels of `pixel` mm, `spacing` mm apart, centred on the origin; black.
inline std::shared_ptr<Sweep> BlackSweep(int frames, int width, int height, double pixel, double spacing)
{
  auto sweep = std::make_shared<Sweep>();
  sweep->width = width;
  sweep->height = height;
  sweep->pixelType = Sweep::PixelType::Float32;
  for (int f = 0; f < frames; ++f)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 0) = pose(1, 1) = pixel;
    pose(0, 3) = -0.5 * pixel * (width - 1);
    pose(1, 3) = -0.5 * pixel * (height - 1);
    pose(2, 3) = spacing * (f - 0.5 * (frames - 1));
    sweep->imageToReference.push_back(pose);
  }
  auto pixels = std::make_shared<std::vector<float>>(sweep->PixelsPerFrame() * frames, 0.0f);
  sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

/// One frame's intensities.
inline std::vector<float> FrameOf(const Sweep& sweep, int frame)
{
  std::vector<float> image(sweep.PixelsPerFrame());
  sweep.CopyFrame(frame, image.data());
  return image;
}

/// The sweep's pixels, for writing.
inline float* Pixels(Sweep& sweep)
{
  return static_cast<float*>(const_cast<void*>(sweep.pixels.get()));
}

/// Frames of random float intensities in [low, high] at the given planes, all of one size.
inline std::shared_ptr<Sweep> RandomSweep(Random& random, const std::vector<SlicePlane>& planes, double low,
                                          double high)
{
  auto sweep = std::make_shared<Sweep>();
  sweep->width = planes[0].width;
  sweep->height = planes[0].height;
  sweep->pixelType = Sweep::PixelType::Float32;
  auto pixels = std::make_shared<std::vector<float>>();
  for (const SlicePlane& plane : planes)
  {
    sweep->imageToReference.push_back(plane.ImageToReference());
    for (std::size_t i = 0; i < plane.NumberOfPixels(); ++i)
    {
      pixels->push_back(static_cast<float>(random.Uniform(low, high)));
    }
  }
  sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

/// A field, and frames that it might be trained on.
struct Problem
{
  GaussianField field;
  std::shared_ptr<Sweep> sweep;
};

/// Gaussians of both signs and of 0.2 to 2 mm in a ball of `radius` mm, so that some pixels are black, and random frames
/// through its middle.
inline Problem RandomProblem(std::uint64_t seed, std::size_t gaussians, double radius, int frames, double pixel,
                             int width, int height)
{
  Random random(seed);
  Problem problem;
  problem.field = RandomField(random, gaussians, radius, 0.2, 2.0, 0.5);
  std::vector<SlicePlane> planes;
  for (int k = 0; k < frames; ++k)
  {
    planes.push_back(RandomPlane(random, random.Vector(radius / 4), pixel, width, height));
  }
  problem.sweep = RandomSweep(random, planes, 0.0, 1.0);
  return problem;
}

/// 24 frames, unless said of 48 x 40 pixels, showing 300 soft Gaussians of both signs on a bright ground.
inline std::shared_ptr<Sweep> RenderedSweep(int width = 48, int height = 40)
{
  Random random(3);
  auto sweep = BlackSweep(24, width, height, 0.4, 0.4);
  GaussianField field = RandomField(random, 300, 8.0, 0.7, 2.0, 0.3);
  field.means.push_back({0, 0, 0});
  field.scales.push_back({12, 12, 12});
  field.rotations.push_back({1, 0, 0, 0});
  field.reflectivities.push_back(0.8);
  const auto engine = Engine::Create("cpu");
  engine->SetField(field);
  for (int f = 0; f < sweep->NumberOfFrames(); ++f)
  {
    engine->Render(sweep->Plane(f), ViewOutput::Intensity, Pixels(*sweep) + f * sweep->PixelsPerFrame());
  }
  return sweep;
}

}  // namespace bigus::test
