// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/Seeding.h"

#include <tbb/combinable.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <utility>

#include "Core/Model/Error.h"
#include "Core/Model/Sequences.h"
#include "Core/Numerics/Statistics.h"
#include "Core/Training/SeedShapes.h"

namespace bigus
{
namespace
{

/// OpenCV's cornerHarris: pixels of the block, of the derivative's aperture, and k in det(M) - k tr(M)^2, all as usual.
constexpr int kHarrisBlock = 2, kHarrisAperture = 3;
constexpr double kHarrisK = 0.04;
/// Added to a response whose mean is 1: without it flat speckle would get no seeds.
constexpr float kHarrisFloor = 0.1f;

/// Density kPerIntensity I + kDark: thirteen times as many seeds in white as in dark places.
constexpr float kPerIntensity = 0.3f, kDark = 0.025f;

/// Cells of the density grid for one seed: fine enough to follow structure, coarse enough for millions of seeds.
constexpr double kCellsPerSeed = 12.0;
constexpr int kLargestBlock = 16;  // pixels: no coarser, however few the seeds

/// Error diffusion: what a cell owes goes to its neighbour in the row, to the next row, and the rest to the next frame,
/// in about equal parts, since the grid has three dimensions.
constexpr double kToSide = 0.35, kBelow = 0.3;
/// It rounds up at 0.7 less a random number below 0.4, 0.5 on average: a threshold that wavers breaks up the regular
/// worms of plain error diffusion.
constexpr double kRounding = 0.3, kWaver = 0.4;

/// Median gaps that a seed's own gap counts at the least: where the hand stood still seeds would be flat.
constexpr double kLeastGap = 0.25;
/// Pixels: planes nearer than this are one, but for a good tracker's noise (0.01 mm, beside pixels of 0.2 mm).
constexpr double kOnePlane = 0.05;

/// The same for the equal scales of random seeds: one scale over the cube root of V.
constexpr double kIsotropicScale = 0.5;
/// The product of a seed's three scales over the volume V that is its share: a box of two deviations a side fills V.
constexpr double kVolumeShare = 0.125;
/// Elevation scale in gaps, and what the in-plane scale is multiplied by. Where planes are near, seeds reach their
/// neighbours; where they are far, frames share too little for that.
constexpr double kSparseReach = 0.5, kDenseReach = 1.6;
constexpr double kSparseInPlane = 1.0, kDenseInPlane = 0.8;

/// A repeatable number in [0, 1) from the standard engine, the same on every library.
double Uniform(std::mt19937_64& random)
{
  return static_cast<double>(random() >> 11) * 0x1p-53;
}

/// What all frames together show.
struct Brightness
{
  std::vector<std::uint8_t> lit;  // [height][width]: whether the mask keeps the pixel and some frame lights it
  double mean = 0;                // intensity
};

Brightness MeasureBrightness(const Sweep& sweep, const std::vector<int>& frames)
{
  const std::size_t pixels = sweep.PixelsPerFrame();
  std::vector<double> sums(frames.size(), 0.0);
  tbb::combinable<std::vector<std::uint8_t>> litByThread([pixels] { return std::vector<std::uint8_t>(pixels, 0); });
  tbb::parallel_for(std::size_t(0), frames.size(),
                    [&](std::size_t f)
                    {
                      std::vector<float> frame(pixels);
                      std::vector<std::uint8_t>& seen = litByThread.local();
                      sweep.CopyFrame(frames[f], frame.data());
                      for (std::size_t p = 0; p < pixels; ++p)
                      {
                        sums[f] += frame[p];
                        seen[p] |= frame[p] > 0;
                      }
                    });
  Brightness found{std::vector<std::uint8_t>(pixels, 0)};
  litByThread.combine_each(
      [&](const std::vector<std::uint8_t>& seen)
      {
        for (std::size_t p = 0; p < pixels; ++p)
        {
          found.lit[p] |= seen[p] && sweep.IsLit(p);
        }
      });
  for (const double sum : sums)
  {
    found.mean += sum / static_cast<double>(pixels * frames.size());
  }
  Require(std::count(found.lit.begin(), found.lit.end(), 1) != 0, "Seeding: all ", frames.size(),
          " frames are black inside the mask, so there is nothing to learn. Check the clip region and the file.");
  return found;
}

/// Blocks of pixels, frame by frame, with the seeding density summed over each.
struct DensityGrid
{
  int block, columns, rows;
  std::vector<float> mass;     // [frames][rows][columns]
  std::vector<int> litPixels;  // [rows][columns]

  std::size_t Cells() const { return static_cast<std::size_t>(columns) * rows; }
};

/// Root of the Harris corner response det(M) - k tr(M)^2, negative values set to 0, divided by its mean over the frame,
/// plus kHarrisFloor.
void HarrisDensity(const Sweep& sweep, const std::vector<float>& image, std::vector<float>& density)
{
  const cv::Mat input(sweep.height, sweep.width, CV_32F, const_cast<float*>(image.data()));
  cv::Mat response;
  cv::cornerHarris(input, response, kHarrisBlock, kHarrisAperture, kHarrisK);
  double sum = 0;
  for (std::size_t p = 0; p < density.size(); ++p)
  {
    // The response is of fourth order in contrast; its root keeps one bright specular line from taking every seed.
    density[p] = std::sqrt(std::max(response.ptr<float>()[p], 0.0f));
    sum += density[p];
  }
  const float mean = static_cast<float>(sum / static_cast<double>(density.size()));
  for (float& value : density)
  {
    value = (mean > 0 ? value / mean : 0.0f) + kHarrisFloor;
  }
}

/// Density of one pixel where placement follows intensity.
float IntensityDensity(float intensity)
{
  return kPerIntensity * intensity + kDark;
}

DensityGrid MakeDensity(const Sweep& sweep, const std::vector<int>& frames, const SeedingOptions& options,
                        const std::vector<std::uint8_t>& lit)
{
  const std::size_t litPixels = static_cast<std::size_t>(std::count(lit.begin(), lit.end(), 1));
  DensityGrid grid;
  const double pixelsPerSeed =
      static_cast<double>(litPixels) * static_cast<double>(frames.size()) / static_cast<double>(options.count);
  grid.block = std::clamp(static_cast<int>(std::lround(std::sqrt(pixelsPerSeed / kCellsPerSeed))), 1, kLargestBlock);
  grid.columns = (sweep.width + grid.block - 1) / grid.block;
  grid.rows = (sweep.height + grid.block - 1) / grid.block;
  const std::size_t cells = grid.Cells();
  grid.mass.assign(cells * frames.size(), 0.0f);
  grid.litPixels.assign(cells, 0);
  const auto cellOf = [&grid](int x, int y)
  { return static_cast<std::size_t>(y / grid.block) * grid.columns + x / grid.block; };
  for (int y = 0; y < sweep.height; ++y)
  {
    for (int x = 0; x < sweep.width; ++x)
    {
      grid.litPixels[cellOf(x, y)] += lit[static_cast<std::size_t>(y) * sweep.width + x];
    }
  }
  tbb::parallel_for(std::size_t(0), frames.size(),
                    [&](std::size_t f)
                    {
                      std::vector<float> image(sweep.PixelsPerFrame()), density(image.size(), 1.0f);
                      sweep.CopyFrame(frames[f], image.data());
                      if (options.placement == SeedPlacement::Harris)
                      {
                        HarrisDensity(sweep, image, density);
                      }
                      else if (options.placement == SeedPlacement::Intensity)
                      {
                        std::transform(image.begin(), image.end(), density.begin(), IntensityDensity);
                      }
                      std::size_t p = 0;
                      for (int y = 0; y < sweep.height; ++y)
                      {
                        float* mass = &grid.mass[f * cells + cellOf(0, y)];
                        for (int left = 0; left < sweep.width; left += grid.block, ++mass)
                        {
                          const std::size_t next = p + std::min(grid.block, sweep.width - left);
                          for (; p < next; ++p)
                          {
                            *mass += lit[p] ? density[p] : 0.0f;
                          }
                        }
                      }
                    });
  return grid;
}

/// Seeds of every cell by independent draws: systematic positions over the cumulative mass would not be random.
std::vector<int> Draw(const DensityGrid& grid, std::size_t count, std::mt19937_64& random)
{
  std::vector<int> counts(grid.mass.size(), 0);
  std::vector<double> cumulative(grid.mass.size());
  std::partial_sum(grid.mass.begin(), grid.mass.end(), cumulative.begin(), std::plus<double>());
  for (std::size_t k = 0; k < count; ++k)
  {
    const double at = Uniform(random) * cumulative.back();
    ++counts[std::min<std::size_t>(std::upper_bound(cumulative.begin(), cumulative.end(), at) - cumulative.begin(),
                                   counts.size() - 1)];
  }
  return counts;
}

/// Turns expected numbers of seeds in a cell into counts whose local sums stay close to expectation, by error
/// diffusion, in alternating direction along rows. This makes seeds evenly spread (blue noise).
std::vector<int> Diffuse(const DensityGrid& grid, std::size_t frames, double seedsPerMass, std::mt19937_64& random)
{
  const std::size_t cells = grid.Cells();
  std::vector<int> counts(cells * frames);
  std::vector<double> error(cells, 0.0), next(cells, 0.0);  // what this and the next frame still owe
  for (std::size_t f = 0; f < frames; ++f)
  {
    std::fill(next.begin(), next.end(), 0.0);
    for (int y = 0; y < grid.rows; ++y)
    {
      const int step = (y + static_cast<int>(f)) % 2 ? -1 : 1;
      for (int k = 0; k < grid.columns; ++k)
      {
        const int x = step > 0 ? k : grid.columns - 1 - k;
        const std::size_t cell = static_cast<std::size_t>(y) * grid.columns + x;
        const double expected = grid.mass[f * cells + cell] * seedsPerMass;
        const double owed = expected + error[cell];
        // An empty cell gets nothing.
        const int count =
            expected > 0 ? std::max(0, static_cast<int>(std::floor(owed + kRounding + kWaver * Uniform(random)))) : 0;
        counts[f * cells + cell] = count;
        const double left = owed - count;
        const bool hasSide = x + step >= 0 && x + step < grid.columns, hasBelow = y + 1 < grid.rows;
        double given = 0;
        if (hasSide)
        {
          error[cell + step] += kToSide * left;
          given += kToSide;
        }
        if (hasBelow)
        {
          error[cell + grid.columns] += kBelow * left;
          given += kBelow;
        }
        next[cell] += (1.0 - given) * left;
      }
    }
    error.swap(next);
  }
  return counts;
}

/// Counts whose local sums stay close to expectation, and `count` in all.
std::vector<int> DrawEvenly(const DensityGrid& grid, std::size_t frames, std::size_t count, double seedsPerMass,
                            std::mt19937_64& random)
{
  std::vector<int> counts = Diffuse(grid, frames, seedsPerMass, random);
  // Diffusion comes within a few seeds of the number asked for; the rest is added or taken at random cells.
  std::size_t have = std::accumulate(counts.begin(), counts.end(), std::size_t(0));
  while (have != count)
  {
    const std::size_t cell = static_cast<std::size_t>(Uniform(random) * static_cast<double>(counts.size()));
    if (have < count && grid.mass[cell] > 0)
    {
      ++counts[cell];
      ++have;
    }
    else if (have > count && counts[cell] > 0)
    {
      --counts[cell];
      --have;
    }
  }
  return counts;
}

/// Sows frame after frame: where seeds lie, how large they are, which way up and how bright.
struct Seeder
{
  const Sweep& sweep;
  const std::vector<int>& frames;
  const SeedingOptions& options;
  const std::vector<std::uint8_t>& lit;
  const DensityGrid& grid;
  const std::vector<int>& counts;  // of seeds, [frames][rows][columns]
  double seedsPerMass;
  double usualGap;                  // mm between frames
  std::vector<double> longestGaps;  // to the next frame, that are no breaks
  std::mt19937_64& random;
  GaussianField field = {};  // of the size asked for
  SeedPlaces places = {};

  /// A lit pixel of a cell that has seeds; it has one, since its mass is positive.
  Eigen::Vector2i LitPixel(std::size_t cell)
  {
    int x, y;
    do
    {
      x = static_cast<int>(cell % grid.columns) * grid.block + static_cast<int>(Uniform(random) * grid.block);
      y = static_cast<int>(cell / grid.columns) * grid.block + static_cast<int>(Uniform(random) * grid.block);
    } while (x >= sweep.width || y >= sweep.height || !lit[static_cast<std::size_t>(y) * sweep.width + x]);
    return {x, y};
  }

  /// A place for pixel (i, j) of a frame, half a gap to either side along the sweep, on the way to the neighbour's pose;
  /// and the gap, mm.
  std::pair<Eigen::Vector3d, double> PlaceAlong(std::size_t f, const Neighbours& around, double i, double j)
  {
    const int frame = frames[f];
    const double along = Uniform(random) - 0.5;
    const std::optional<int> neighbour = along < 0 ? around.before : around.after;
    const Eigen::Vector3d inPlane = sweep.Plane(frame).Point(i, j);
    const double distance = neighbour ? GapBetween(sweep, frame, *neighbour, i, j) : 0.0;
    if (!neighbour || !(distance <= longestGaps[along < 0 ? f - 1 : f]))
    {
      return {inPlane, usualGap};
    }
    return {inPlane + std::abs(along) * (sweep.Plane(*neighbour).Point(i, j) - inPlane),
            std::max(distance, kLeastGap * usualGap)};
  }

  /// Sizes from the volume (mm^3) that is the seed's share; see README.md of this folder.
  Eigen::Vector3d ScalesOf(double volume, double gap) const
  {
    if (options.placement == SeedPlacement::Random)
    {
      return Eigen::Vector3d::Constant(kIsotropicScale * std::cbrt(volume));
    }
    const double elevation = (options.sparse ? kSparseReach : kDenseReach) * gap;
    const double inPlane =
        (options.sparse ? kSparseInPlane : kDenseInPlane) * std::sqrt(kVolumeShare * volume / elevation);
    return {inPlane, inPlane, elevation};
  }

  void SeedFrame(std::size_t f)
  {
    places.first.push_back(places.pixels.size());
    const Neighbours around = NeighboursOf(sweep, frames, frames[f]);
    const SlicePlane plane = sweep.Plane(frames[f]);
    const double area = plane.columnStep.cross(plane.rowStep).norm();
    const Eigen::Vector4d rotation = Quaternion(AxesOf(plane));
    std::vector<float> image(sweep.PixelsPerFrame());
    sweep.CopyFrame(frames[f], image.data());
    for (std::size_t cell = 0; cell < grid.Cells(); ++cell)
    {
      const std::size_t index = f * grid.Cells() + cell;
      for (int k = 0; k < counts[index]; ++k)
      {
        const std::size_t seed = places.pixels.size();
        const Eigen::Vector2i pixel = LitPixel(cell);
        const double i = pixel.x() + Uniform(random) - 0.5, j = pixel.y() + Uniform(random) - 0.5;
        const auto [mean, gap] = PlaceAlong(f, around, i, j);
        const double volume = area * gap * grid.litPixels[cell] / (grid.mass[index] * seedsPerMass);
        field.means[seed] = mean;
        field.scales[seed] = ScalesOf(volume, gap);
        field.rotations[seed] = rotation;
        field.reflectivities[seed] =
            field.transfer.Scattering<double>(image[static_cast<std::size_t>(pixel.y()) * sweep.width + pixel.x()]);
        places.pixels.push_back(pixel);
      }
    }
  }
};

}  // namespace

GaussianField Seed(const Sweep& sweep, const std::vector<int>& frames, const Beam& beam, const SeedingOptions& options)
{
  Require(options.count >= 1 && options.count <= (std::size_t(1) << 26), "Seeding: ", options.count,
          " Gaussians were asked for; give 1 to 67108864.");
  Require(!frames.empty(), "Seeding: there is no frame to seed from.");
  const Brightness brightness = MeasureBrightness(sweep, frames);
  const SweepGeometry geometry = MeasureGeometry(sweep, frames);
  // One frame, or a probe that only slid in its plane: take the beam's own thickness, at least a pixel.
  const double usualGap = geometry.usualSpacing > kOnePlane * geometry.pixelSize
                              ? geometry.usualSpacing
                              : std::max(beam.elevationSigma, geometry.pixelSize);

  std::mt19937_64 random(options.seed);
  const DensityGrid grid = MakeDensity(sweep, frames, options, brightness.lit);
  const double total = std::accumulate(grid.mass.begin(), grid.mass.end(), 0.0);
  const double seedsPerMass = static_cast<double>(options.count) / total;
  const bool isRandom = options.placement == SeedPlacement::Random;
  const std::vector<int> counts = isRandom ? Draw(grid, options.count, random)
                                           : DrawEvenly(grid, frames.size(), options.count, seedsPerMass, random);

  Seeder seeder{
      sweep, frames, options, brightness.lit, grid, counts, seedsPerMass, usualGap, LongestGaps(sweep, frames), random};
  seeder.field.beam = beam;
  seeder.field.transfer = TransferFunction::FromMeanIntensity(brightness.mean);
  seeder.field.Resize(options.count);
  seeder.places.pixels.reserve(options.count);
  for (std::size_t f = 0; f < frames.size(); ++f)
  {
    seeder.SeedFrame(f);
  }
  seeder.places.first.push_back(seeder.places.pixels.size());
  if (!isRandom)
  {
    ShapeSeeds(sweep, frames, seeder.places, options.sparse ? kSparseReach : kDenseReach, seeder.field);
  }
  return std::move(seeder.field);
}

void ScaleReflectivities(Engine& engine, const Sweep& sweep, const std::vector<int>& frames, GaussianField& field)
{
  constexpr std::size_t kSamples = 4;  // frames: one factor needs few
  std::vector<float> scattering(sweep.PixelsPerFrame()), truth(sweep.PixelsPerFrame());
  double product = 0, square = 0;
  for (const int frame : EvenlySpread(frames, kSamples))
  {
    sweep.CopyFrame(frame, truth.data());
    engine.Render(sweep.Plane(frame), ViewOutput::Scattering, scattering.data());
    for (std::size_t p = 0; p < truth.size(); ++p)
    {
      product += field.transfer.Scattering<double>(truth[p]) * scattering[p];
      square += static_cast<double>(scattering[p]) * scattering[p];
    }
  }
  if (product > 0 && square > 0)
  {
    for (double& r : field.reflectivities)
    {
      r *= product / square;
    }
    engine.SetField(field);
  }
}

}  // namespace bigus
