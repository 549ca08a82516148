// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How well a field predicts frames.
#pragma once

#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/Sweep.h"

namespace bigus::test
{

/// Mean PSNR of a field over some frames of a sweep, dB.
inline double PsnrOn(const GaussianField& field, const Sweep& sweep, const std::vector<int>& frames,
                     const std::string& engineName = "reference")
{
  const auto engine = Engine::Create(engineName);
  engine->SetField(field);
  std::vector<float> image(sweep.PixelsPerFrame()), truth(sweep.PixelsPerFrame());
  double sum = 0;
  for (int frame : frames)
  {
    engine->Render(sweep.Plane(frame), ViewOutput::Intensity, image.data());
    sweep.CopyFrame(frame, truth.data());
    sum += Psnr(image.data(), truth.data(), image.size()) / static_cast<double>(frames.size());
  }
  return sum;
}

}  // namespace bigus::test
