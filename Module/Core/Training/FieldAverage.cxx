// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/FieldAverage.h"

#include <tbb/parallel_for.h>

#include <cstddef>

namespace bigus
{

void FieldAverage::Add(const GaussianField& field)
{
  if (++count == 1)
  {
    mean = field;
    return;
  }
  const double share = 1.0 / count;
  tbb::parallel_for(std::size_t(0), field.Size(),
                    [&](std::size_t i)
                    {
                      mean.means[i] += share * (field.means[i] - mean.means[i]);
                      mean.scales[i] += share * (field.scales[i] - mean.scales[i]);
                      mean.reflectivities[i] += share * (field.reflectivities[i] - mean.reflectivities[i]);
                      Eigen::Vector4d& rotation = mean.rotations[i];
                      const Eigen::Vector4d& next = field.rotations[i];
                      // Of q and -q the nearer one, so the mean is never zero.
                      rotation += share * (next.dot(rotation) < 0 ? Eigen::Vector4d(-next - rotation)
                                                                  : Eigen::Vector4d(next - rotation));
                    });
}

}  // namespace bigus
