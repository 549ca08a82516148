// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How large what has a label is, and how sure that is.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "Core/Labels/Labels.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/OpenCv.h"

namespace bigus
{
namespace
{

/// Of systematic sections through shapes without edges along the sweep (Gundersen, Jensen, Kieu and Nielsen 1999, eq 13), where
/// 3 C_0 - 4 C_1 + C_2 = 1/2 sum (A_(f+1) - 2 A_f + A_(f-1))^2.
constexpr double kSmooth = 1.0 / 480;
constexpr double kLeastGap = 1e-3;  // mm: frames of one place are as far apart
constexpr double kMostVoxels = 4e6;
/// Where sections tell so many times what voxels do, the probe came by twice.
constexpr double kTwice = 1.3;

/// What one frame shows of a label.
struct Section
{
  double area, noise;  // mm^2; variance by its pixels, mm^4
  double column, row;  // of its centre
  double gap;          // mm to the next
};

/// A border pixel is in or out by chance: a twelfth of a pixel's squared area each.
Section SectionOf(const std::uint8_t* picture, const SlicePlane& plane, int value)
{
  const double pixel = plane.PixelSize() * plane.PixelSize();
  const cv::Mat inside = MaskOf(picture, plane.width, plane.height, value);
  cv::Mat inner;
  cv::erode(inside, inner, cv::getStructuringElement(cv::MORPH_CROSS, {3, 3}), {-1, -1}, 1, cv::BORDER_CONSTANT, 0);
  const cv::Moments sums = cv::moments(inside, true);
  const double some = std::max(sums.m00, 1.0);
  return {pixel * sums.m00, pixel * pixel / 12 * (sums.m00 - cv::countNonZero(inner)), sums.m10 / some, sums.m01 / some,
          0};
}

/// Variance of the volume between sections of one sequence, mm^6; README.md has the equations.
double VarianceOf(const std::vector<Section>& sections, double trackerNoise)
{
  double between = 0, uneven = 0, noise = 0, moved = 0;
  for (std::size_t f = 1; f + 1 < sections.size(); ++f)
  {
    const Section &before = sections[f - 1], &here = sections[f], &after = sections[f + 1];
    const double h = std::max(before.gap, kLeastGap), g = std::max(here.gap, kLeastGap), largest = std::max(h, g);
    const double bend = (after.area - here.area) / g - (here.area - before.area) / h;
    const double byChance =
        after.noise / (g * g) + here.noise * (1 / g + 1 / h) * (1 / g + 1 / h) + before.noise / (h * h);
    between += (bend * bend - byChance) * largest * largest * largest * largest;
    uneven += bend * (h * h - h * g + g * g) / 12;
    noise += (h + g) * (h + g) / 4 * here.noise;
    const double change = 0.5 * (after.area - before.area);
    moved += change * change;
  }
  return std::max(0.0, kSmooth * between) + uneven * uneven + noise + trackerNoise * trackerNoise * moved;
}

/// Trapezoids between sections of all sequences, mm^3, and their standard error.
LabelVolume VolumeBySections(const Sweep& sweep, const LabelFrames& drawn, const Label& label, double trackerNoise)
{
  LabelVolume sum{label, 0, 0};
  const std::uint8_t* picture = drawn.pixels.data();
  std::ptrdiff_t seen = 0;
  bool isKnown = true;
  for (const std::vector<int>& own : BySequence(sweep, drawn.frames))
  {
    std::vector<Section> sections;
    for (std::size_t f = 0; f < own.size(); ++f, picture += sweep.PixelsPerFrame())
    {
      sections.push_back(SectionOf(picture, sweep.Plane(own[f]), label.value));
      if (f > 0)
      {
        // Planes may be tilted, so they are as far apart as they are where the label is.
        Section &before = sections[f - 1], &now = sections[f];
        const Section& at = before.area > now.area ? before : now;
        before.gap = GapBetween(sweep, own[f - 1], own[f], at.column, at.row);
        sum.volume += 0.5 * before.gap * (before.area + now.area);
      }
    }
    sum.standardError += VarianceOf(sections, trackerNoise);
    const auto here =
        std::count_if(sections.begin(), sections.end(), [](const Section& section) { return section.area > 0; });
    seen += here;
    isKnown = isKnown && (here == 0 || sections.size() > 2);
  }
  sum.standardError = seen < 3 || !isKnown ? std::numeric_limits<double>::quiet_NaN() : std::sqrt(sum.standardError);
  return sum;
}

/// The voxels of each value, of about a pixel, together, mm^3.
std::array<double, kLargestLabel + 1> VoxelsOf(GaussianField field, const FieldLabels& labels, double pixel,
                                               const std::string& engine)
{
  field.beam = Beam{0};
  const GaussianField carriers = labels.Carriers(field);
  Eigen::AlignedBox3d box;
  double widest = pixel;
  for (std::size_t at = 0; at < labels.weights.size(); ++at)
  {
    if (labels.weights[at] >= 0.5)
    {
      box.extend(carriers.means[at / labels.labels.size()]);
      widest = std::max(widest, carriers.scales[at / labels.labels.size()].maxCoeff());
    }
  }
  std::array<double, kLargestLabel + 1> sums{};
  if (box.isEmpty())
  {
    return sums;
  }
  const Eigen::Vector3d rim = Eigen::Vector3d::Constant(std::min(widest, 10 * pixel));
  box = Eigen::AlignedBox3d(box.min() - rim, box.max() + rim);
  const double step = std::max(pixel, std::cbrt(box.volume() / kMostVoxels));
  const Eigen::Array3i sizes = (box.sizes().array() / step).cast<int>() + 1;
  SlicePlane plane{box.min(), step * Eigen::Vector3d::UnitX(), step * Eigen::Vector3d::UnitY(), sizes[0], sizes[1]};
  LabelledField shown(field, labels, engine);
  std::vector<std::uint8_t> map(plane.NumberOfPixels());
  for (int z = 0; z < sizes[2]; ++z, plane.origin.z() += step)
  {
    shown.Render(plane, map.data());
    for (const std::uint8_t value : map)
    {
      sums[value] += step * step * step;
    }
  }
  return sums;
}

}  // namespace

std::vector<LabelVolume> MeasureLabels(const GaussianField& field, const FieldLabels& labels, const Sweep& sweep,
                                       const LabelFrames& drawn, double trackerNoise, const std::string& engine)
{
  drawn.Validate(sweep);
  labels.Validate(field.Size());
  const auto voxels = VoxelsOf(field, labels, sweep.Plane(drawn.frames[0]).PixelSize(), engine);
  std::vector<LabelVolume> volumes;
  for (const Label& label : labels.labels)
  {
    volumes.push_back(VolumeBySections(sweep, drawn, label, trackerNoise));
    if (volumes.back().volume > kTwice * voxels[label.value])
    {
      volumes.back() = {label, voxels[label.value], std::numeric_limits<double>::quiet_NaN()};
    }
  }
  return volumes;
}

}  // namespace bigus
