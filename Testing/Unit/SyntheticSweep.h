// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A small sweep rendered from a known field: parallel planes along z, for tests of seeding and training.
#pragma once

#include <memory>

#include "Core/Engine/Engine.h"
#include "Gradient/RandomField.h"

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

/// The sweep's pixels, for writing.
inline float* Pixels(Sweep& sweep)
{
  return static_cast<float*>(const_cast<void*>(sweep.pixels.get()));
}

/// 24 frames of 48 x 40 pixels showing 300 soft Gaussians of both signs on a bright ground.
inline std::shared_ptr<Sweep> RenderedSweep()
{
  Random random(3);
  auto sweep = BlackSweep(24, 48, 40, 0.4, 0.4);
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
