// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Labels/Labels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/OpenCv.h"

namespace bigus
{
namespace
{

/// Coverage, a tenth of the (2 pi)^(3/2) 0.7^3 that carriers of a label's own have: with less only far tails reach a pixel,
/// behind the ends of a sweep, and their ratio tells nothing.
constexpr float kSeen = 0.54f;

/// The carriers that have some of a label, of that reflectivity.
GaussianField SomeOf(const GaussianField& carriers, const FieldLabels& labels, std::size_t label)
{
  GaussianField some;
  some.beam = carriers.beam;
  some.transfer = carriers.transfer;
  for (std::size_t i = 0; i < carriers.Size(); ++i)
  {
    const float weight = labels.weights[i * labels.labels.size() + label];
    if (weight > 0)
    {
      some.means.push_back(carriers.means[i]);
      some.scales.push_back(carriers.scales[i]);
      some.rotations.push_back(carriers.rotations[i]);
      some.reflectivities.push_back(weight);
    }
  }
  return some;
}

/// What is measured of a label on a picture, in pixels.
struct Extent
{
  double area, outline;
  cv::Rect box;
};

/// The outline by Crofton's formula: pi / 4 of the pixels' sides that lie between in and out.
Extent ExtentOf(const SlicePlane& plane, const std::uint8_t* map, int value)
{
  const cv::Mat inside = MaskOf(map, plane.width, plane.height, value);
  cv::Mat all;
  cv::copyMakeBorder(inside, all, 1, 1, 1, 1, cv::BORDER_CONSTANT, 0);
  const int sides = cv::countNonZero(all.rowRange(1, all.rows) != all.rowRange(0, all.rows - 1)) +
                    cv::countNonZero(all.colRange(1, all.cols) != all.colRange(0, all.cols - 1));
  return {double(cv::countNonZero(inside)), kPi / 4 * sides, cv::boundingRect(inside)};
}

/// Fills in how far lengths and areas are off, on planes that show at least half as much as the one that shows most.
void Measure(const std::vector<SlicePlane>& planes, const std::uint8_t* shown, const std::uint8_t* truth,
             LabelScore& score)
{
  double lengths = 0, areas = 0, count = 0, most = 0;
  std::vector<Extent> is;
  for (const SlicePlane& plane : planes)
  {
    is.push_back(ExtentOf(plane, truth, score.label.value));
    most = std::max(most, is.back().area);
    truth += plane.NumberOfPixels();
  }
  for (std::size_t k = 0; k < planes.size(); shown += planes[k++].NumberOfPixels())
  {
    if (is[k].area > 0 && is[k].area >= 0.5 * most)
    {
      const Extent told = ExtentOf(planes[k], shown, score.label.value);
      const double pixel = planes[k].PixelSize(), off = pixel * (told.area - is[k].area) / is[k].outline;
      const cv::Size wrong = told.box.size() - is[k].box.size();
      lengths += pixel * pixel * (wrong.width * wrong.width + wrong.height * wrong.height) / 2;
      areas += off * off;
      ++count;
    }
  }
  score.length = std::sqrt(lengths / count);
  score.area = std::sqrt(areas / count);
}

}  // namespace

void ValidateLabels(const std::vector<Label>& labels)
{
  int before = 0;
  for (const Label& label : labels)
  {
    Require(label.value > before && label.value <= kLargestLabel, "Labels: the value ", label.value, " after ", before,
            "; values ascend from 1 to 255.");
    before = label.value;
    Require(!label.name.empty(), "Labels: the label of value ", label.value, " has no name.");
    for (const double part : label.color)
    {
      Require(part >= 0 && part <= 1, "Labels: the colour of '", label.name, "' has the part ", part,
              "; red, green and blue lie between 0 and 1.");
    }
  }
}

std::array<double, 3> UsualColor(int value)
{
  // Hues a golden section of the circle apart are never close to those of the next few.
  const double hue = 6 * std::fmod(0.618034 * (value - 1), 1.0);
  std::array<double, 3> color{};
  for (int k = 0; k < 3; ++k)
  {
    const double at = std::fmod(hue + 6 - 2 * k, 6.0);  // 0 where this part is full
    color[k] = 0.9 * std::clamp(2 - std::min(at, 6 - at), 0.0, 1.0);
  }
  return color;
}

void FieldLabels::Validate(std::size_t gaussians) const
{
  ValidateLabels(labels);
  Require(weights.size() == (gaussians + points.size()) * labels.size(), "Labels: there are ", weights.size(),
          " weights for ", gaussians, " Gaussians, ", points.size(), " points and ", labels.size(), " labels.");
  for (std::size_t i = 0; i < weights.size(); ++i)
  {
    Require(weights[i] >= 0 && weights[i] <= 1, "Labels: weight ", i, " is ", weights[i],
            "; it must lie between 0 and 1.");
  }
  for (std::size_t i = 0; i < points.size(); ++i)
  {
    ValidateGaussian(i, points[i].head<3>(), Eigen::Vector3d::Constant(points[i][3]), {1, 0, 0, 0}, 1);
  }
}

GaussianField FieldLabels::Carriers(const GaussianField& field) const
{
  GaussianField carriers = field;
  carriers.Resize(field.Size() + points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
  {
    carriers.means[field.Size() + i] = points[i].head<3>();
    carriers.scales[field.Size() + i].setConstant(points[i][3]);
    carriers.rotations[field.Size() + i] = {1, 0, 0, 0};
  }
  std::fill(carriers.reflectivities.begin(), carriers.reflectivities.end(), 1.0);
  return carriers;
}

GaussianField FieldLabels::CarriersOf(const GaussianField& field, int value) const
{
  const auto found =
      std::find_if(labels.begin(), labels.end(), [value](const Label& label) { return label.value == value; });
  Require(found != labels.end(), "LabelValue: the field has no label of the value ", value, ".");
  GaussianField carriers = Carriers(field);
  for (std::size_t i = 0; i < carriers.Size(); ++i)
  {
    carriers.reflectivities[i] = 1.0 + weights[i * labels.size() + static_cast<std::size_t>(found - labels.begin())];
  }
  return carriers;
}

FieldLabels Transformed(FieldLabels labels, const Eigen::Matrix4d& transform)
{
  const double scale = std::cbrt(std::abs(transform.topLeftCorner<3, 3>().determinant()));
  for (Eigen::Vector4d& point : labels.points)
  {
    // As floats, so that to turn a field leaves them what they are.
    point << (transform * point.head<3>().homogeneous()).head<3>().eval(), static_cast<float>(scale * point[3]);
  }
  return labels;
}

std::vector<Label> WithNames(std::vector<Label> names, const std::vector<std::uint8_t>& pixels)
{
  std::array<bool, kLargestLabel + 1> isNamed{true};  // as 0, which needs no name
  for (const Label& label : names)
  {
    isNamed[std::clamp(label.value, 0, kLargestLabel)] = true;
  }
  for (const std::uint8_t value : pixels)
  {
    if (!isNamed[value])
    {
      names.push_back({value, "Label " + std::to_string(value), UsualColor(value)});
      isNamed[value] = true;
    }
  }
  std::sort(names.begin(), names.end(), [](const Label& a, const Label& b) { return a.value < b.value; });
  return names;
}

void LabelFrames::Validate(const Sweep& sweep) const
{
  ValidateLabels(labels);
  Require(!labels.empty() && !frames.empty(),
          "Labels: there is no label in any frame; draw one, or say which frames hold labels.");
  Require(pixels.size() == frames.size() * sweep.PixelsPerFrame(), "Labels: there are ", pixels.size(), " pixels for ",
          frames.size(), " frames of ", sweep.width, " x ", sweep.height,
          "; label pictures have the size of the sweep's.");
  for (std::size_t f = 0; f < frames.size(); ++f)
  {
    const int before = f > 0 ? frames[f - 1] : -1;
    Require(frames[f] > before && frames[f] < sweep.NumberOfFrames(), "Labels: frame ", frames[f],
            " is out of order or not one of the ", sweep.NumberOfFrames(), " frames of the sweep.");
  }
  Require(WithNames(labels, pixels).size() == labels.size(), "Labels: the pixels have a value that no label has.");
  // Labels are regions: where two pixels side by side have labels, these are mostly the same.
  std::size_t both = 0, same = 0;
  for (std::size_t i = 1; i < pixels.size(); ++i)
  {
    const bool isPair = i % sweep.width != 0 && pixels[i - 1] != 0 && pixels[i] != 0;
    both += isPair;
    same += isPair && pixels[i - 1] == pixels[i];
  }
  Require(2 * same >= both, "Labels: of ", both, " pairs of pixels side by side that both have a label, only ", same,
          " have the same one. That is a picture, not labels; give a label map, 0 where there is none.");
}

std::vector<int> LabelFrames::Drawn() const
{
  const std::size_t n = frames.empty() ? 0 : pixels.size() / frames.size();
  std::vector<int> drawn, all;
  for (auto first = pixels.begin(); all.size() < frames.size(); first += n)
  {
    all.push_back(static_cast<int>(all.size()));
    if (std::any_of(first, first + n, [](std::uint8_t value) { return value != 0; }))
    {
      drawn.push_back(all.back());
    }
  }
  return !drawn.empty() && 2 * drawn.size() < static_cast<std::size_t>(drawn.back() - drawn.front() + 1) ? drawn : all;
}

LabelFrames LabelFrames::Subset(const std::vector<int>& places) const
{
  const std::size_t n = frames.empty() ? 0 : pixels.size() / frames.size();
  LabelFrames subset{labels, {}, {}};
  for (const int place : places)
  {
    subset.frames.push_back(frames[place]);
    subset.pixels.insert(subset.pixels.end(), pixels.begin() + n * place, pixels.begin() + n * (place + 1));
  }
  return subset;
}

RenderPlanes ShareOf(const RenderPlanes& render)
{
  return [render, own = std::vector<float>()](const std::vector<SlicePlane>& planes, const Engine::Window& window,
                                              float* image, float* coverage) mutable
  {
    const std::size_t pixels = planes.size() * window.columns * window.rows;
    own.resize(coverage ? 0 : pixels);
    float* const covered = coverage ? coverage : own.data();
    render(planes, window, image, covered);
    for (std::size_t p = 0; p < pixels; ++p)
    {
      image[p] = covered[p] > kSeen ? std::clamp(image[p] / covered[p] - 1, 0.0f, 1.0f) : 0.0f;
    }
  };
}

LabelledField::LabelledField(const GaussianField& field, const FieldLabels& labels, const std::string& engine)
    : labels_(labels.labels), all_(Engine::Create(engine))
{
  labels.Validate(field.Size());
  const GaussianField carriers = labels.Carriers(field);
  all_->SetField(carriers);
  for (std::size_t k = 0; k < labels_.size(); ++k)
  {
    const GaussianField some = SomeOf(carriers, labels, k);
    own_.push_back(some.Size() > 0 ? Engine::Create(engine) : nullptr);
    if (own_.back())
    {
      own_.back()->SetField(some);
    }
  }
}

void LabelledField::Render(const SlicePlane& plane, const Engine::Window& window, std::uint8_t* map)
{
  const auto columns = static_cast<std::size_t>(window.columns), pixels = columns * window.rows;
  std::vector<float> shares(own_.size() * pixels, 0.0f);
  cv::Rect seen;
  for (std::size_t k = 0; k < own_.size(); ++k)
  {
    if (own_[k])
    {
      own_[k]->Render(plane, window, ViewOutput::Scattering, &shares[k * pixels], nullptr);
      seen |= cv::boundingRect(cv::Mat(window.rows, window.columns, CV_32F, &shares[k * pixels]) > 0);
    }
  }
  std::fill_n(map, pixels, std::uint8_t(0));
  if (seen.empty())
  {
    return;
  }
  std::vector<float> covered(static_cast<std::size_t>(seen.area()));
  all_->Render(plane, {window.firstColumn + seen.x, window.firstRow + seen.y, seen.width, seen.height},
               ViewOutput::Scattering, covered.data(), nullptr);
  for (std::size_t p = 0; p < covered.size(); ++p)
  {
    const std::size_t at = (seen.y + p / seen.width) * columns + seen.x + p % seen.width;
    float largest = 0, sum = 0;
    for (std::size_t k = 0; k < own_.size() && covered[p] > kSeen; ++k)
    {
      const float share = std::clamp(shares[k * pixels + at] / covered[p], 0.0f, 1.0f);
      sum += share;
      if (share > largest)
      {
        largest = share;
        map[at] = static_cast<std::uint8_t>(labels_[k].value);
      }
    }
    map[at] = largest >= 1 - sum ? map[at] : 0;
  }
}

void LabelledField::Render(const GridPart& grid, std::uint8_t* map)
{
  const Engine::Window window{grid.extent[0] - grid.whole[0], grid.extent[2] - grid.whole[2],
                              grid.extent[1] - grid.extent[0] + 1, grid.extent[3] - grid.extent[2] + 1};
  for (int k = grid.extent[4]; k <= grid.extent[5]; ++k)
  {
    Render(grid.PlaneAt(k), window, map);
    map += static_cast<std::ptrdiff_t>(window.columns) * window.rows;
  }
}

double Dice(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b, int value)
{
  std::size_t both = 0, sum = 0;
  for (std::size_t p = 0; p < std::min(a.size(), b.size()); ++p)
  {
    both += a[p] == value && b[p] == value;
    sum += (a[p] == value) + (b[p] == value);
  }
  return sum == 0 ? 1 : 2 * static_cast<double>(both) / static_cast<double>(sum);
}

std::vector<LabelScore> ScoreLabels(const GaussianField& field, const FieldLabels& labels,
                                    const std::vector<SlicePlane>& planes, const std::vector<std::uint8_t>& truth,
                                    const std::string& engine)
{
  LabelledField labelled(field, labels, engine);
  std::vector<std::uint8_t> shown;
  for (const SlicePlane& plane : planes)
  {
    shown.resize(shown.size() + plane.NumberOfPixels());
    labelled.Render(plane, &shown[shown.size() - plane.NumberOfPixels()]);
  }
  Require(truth.size() == shown.size(), "Labels: there are ", truth.size(), " pixels of truth for planes of ",
          shown.size(), ".");
  std::vector<LabelScore> scores;
  for (const Label& label : labels.labels)
  {
    scores.push_back({label, Dice(shown, truth, label.value)});
    Measure(planes, shown.data(), truth.data(), scores.back());
  }
  return scores;
}

}  // namespace bigus
