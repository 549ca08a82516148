// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Slicing/Pixels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Model/FrameDistance.h"
#include "Core/Numerics/Constants.h"

namespace bigus
{

void CheckPixelType(const std::string& type, ViewOutput output)
{
  Require(type == "float" || type == "unsigned char", "OutputScalarType is ", type,
          "; float and unsigned char are possible.");
  Require(output != ViewOutput::Scattering || type == "float",
          "The scattering field is signed and unbounded; set OutputScalarType to float.");
}

void Seen::Validate() const
{
  Require(threshold >= 0, "CoverageThreshold is ", threshold, "; it must be at least 0.");
}

void Seen::FillBackground(const PixelBand& band, bool isBytes) const
{
  const float least = static_cast<float>(threshold);
  const float background = static_cast<float>(isBytes ? level / 255 : level);
  for (std::int64_t pixel = 0; pixel < band.count; ++pixel)
  {
    band.image[pixel] = band.coverage[pixel] > least ? band.image[pixel] : background;
  }
}

void Seen::ForEachRun(const PixelBand& band, const Extent& extent,
                      const std::function<void(int, int, int, int)>& run) const
{
  const float least = static_cast<float>(threshold);
  const std::int64_t columns = extent[1] - extent[0] + 1;
  const std::int64_t rows = extent[3] - extent[2] + 1;
  for (std::int64_t start = 0; start < band.count; start += columns)
  {
    const std::int64_t line = (band.first + start) / columns;
    const int y = extent[2] + static_cast<int>(line % rows);
    const int z = extent[4] + static_cast<int>(line / rows);
    const float* coverage = band.coverage + start;
    for (int x = 0; x < columns; ++x)
    {
      const int begin = x;
      while (x < columns && coverage[x] > least)
      {
        ++x;
      }
      if (x > begin)
      {
        run(extent[0] + begin, extent[0] + x - 1, y, z);
      }
    }
  }
}

Eigen::AlignedBox3d FieldSpread::Box() const
{
  Eigen::AlignedBox3d box = centres;
  if (count > 0)
  {
    const Eigen::Vector3d pad = Eigen::Vector3d::Constant(scales.mean() / count);
    box.min() -= pad;
    box.max() += pad;
  }
  return box;
}

double FieldSpread::MeanCoverage() const
{
  return count > 0 ? std::pow(2 * kPi, 1.5) * volume / Box().volume() : 0;
}

FieldSpread SpreadOf(const GaussianField& field)
{
  FieldSpread spread;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    spread.centres.extend(field.means[i]);
    spread.volume += field.scales[i].prod();
    spread.scales += field.scales[i];
  }
  spread.count = static_cast<double>(field.Size());
  return spread;
}

void ToBytes(const float* values, std::int64_t count, unsigned char* bytes)
{
  std::transform(values, values + count, bytes,
                 [](float value) -> unsigned char
                 { return value > 0 ? static_cast<unsigned char>(std::min(255 * value + 0.5f, 255.0f)) : 0; });
}

void GridDistances(const Sweep& sweep, const Eigen::Matrix4d& indexToWorld, const Extent& extent, float* distances)
{
  const std::vector<int> frames = AllFrames(sweep);
  const GridPart grid{indexToWorld, extent, extent};
  for (int k = extent[4]; k <= extent[5]; ++k)
  {
    const SlicePlane plane = grid.PlaneAt(k);
    DistanceToFrames(sweep, frames, plane, distances);
    distances += plane.NumberOfPixels();
  }
}

}  // namespace bigus
