// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/ImageLoss.h"

namespace bigus
{

std::vector<std::uint8_t> CountedPixels(const Sweep& sweep)
{
  std::vector<std::uint8_t> counted(sweep.mask ? sweep.PixelsPerFrame() : 0);
  for (std::size_t pixel = 0; pixel < counted.size(); ++pixel)
  {
    counted[pixel] = sweep.IsLit(pixel);
  }
  return counted;
}

template <class Real>
double ImageLoss::Evaluate(const Loss& loss, double weight, const Real* image, const Real* truth, std::size_t stride,
                           Real* derivative) const
{
  double sum = 0;
  if (loss.dssim > 0 || loss.contrast > 0)
  {
    sum += windows_.Evaluate(loss, weight, image, truth, stride, derivative);
  }
  if (loss.ffl > 0)
  {
    sum += spectrum_.Evaluate(weight * loss.ffl, image, truth, stride, derivative);
  }
  return sum;
}

template double ImageLoss::Evaluate(const Loss&, double, const float*, const float*, std::size_t, float*) const;
template double ImageLoss::Evaluate(const Loss&, double, const double*, const double*, std::size_t, double*) const;

}  // namespace bigus
