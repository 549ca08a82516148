// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/Judging.h"

#include <utility>

#include "Core/Metrics/Metrics.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{

std::vector<double> FramePsnrs(Engine& engine, const Sweep& sweep, const std::vector<int>& frames)
{
  std::vector<float> image(sweep.PixelsPerFrame()), truth(sweep.PixelsPerFrame());
  std::vector<double> psnrs;
  for (int frame : frames)
  {
    sweep.CopyFrame(frame, truth.data());
    engine.Render(sweep.Plane(frame), ViewOutput::Intensity, image.data());
    sweep.BlackenUnlit(image.data());
    psnrs.push_back(Psnr(image.data(), truth.data(), image.size()));
  }
  return psnrs;
}

double MeanPsnr(Engine& engine, const Sweep& sweep, const std::vector<int>& frames)
{
  return Mean(FramePsnrs(engine, sweep, frames));
}

std::vector<int> Judges(const std::vector<int>& frames)
{
  constexpr std::size_t kJudges = 8;
  return EvenlySpread(frames, kJudges);
}

GaussianField Nearer(Engine& engine, const Sweep& sweep, const std::vector<int>& frames, GaussianField a,
                     const GaussianField& b)
{
  const std::vector<int> judges = Judges(frames);
  engine.SetField(a);
  const double psnr = MeanPsnr(engine, sweep, judges);
  engine.SetField(b);
  return MeanPsnr(engine, sweep, judges) > psnr ? b : std::move(a);
}

}  // namespace bigus
