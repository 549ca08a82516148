// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Labels/Labels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>

#include "Core/Engine/ViewEngine.h"
#include "Core/Evaluation/Compounding.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"

namespace bigus
{
namespace
{

/// Coverage, a tenth of the (2 pi)^(3/2) 0.7^3 that carriers of a label's own have: with less only far tails reach a pixel,
/// behind the ends of a sweep, and their ratio tells nothing.
constexpr float kSeen = 0.54f;

/// Label pictures as frames to interpolate: `level` of every pixel's value.
template <class Level>
Sweep AsFrames(const Sweep& sweep, const LabelFrames& given, const Level& level)
{
  Sweep frames;
  frames.width = sweep.width;
  frames.height = sweep.height;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(given.pixels.size());
  std::transform(given.pixels.begin(), given.pixels.end(), pixels->begin(), level);
  frames.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  for (const int frame : given.frames)
  {
    frames.imageToReference.push_back(sweep.imageToReference[frame]);
    frames.sequences.push_back(sweep.SequenceOf(frame));
  }
  return frames;
}

/// What the nearest label picture shows at a point, of those that it projects onto at right angles.
std::uint8_t NearestLabel(const std::vector<SlicePlane>& frames, const std::vector<Eigen::Matrix3d>& toFrames,
                          const LabelFrames& given, const Eigen::Vector3d& point)
{
  double smallest = std::numeric_limits<double>::infinity();
  std::uint8_t value = 0;
  for (std::size_t f = 0; f < frames.size(); ++f)
  {
    const SlicePlane& frame = frames[f];
    const Eigen::Vector3d ijz = toFrames[f] * (point - frame.origin);
    const auto i = std::llround(ijz[0]), j = std::llround(ijz[1]);
    if (std::abs(ijz[2]) < smallest && i >= 0 && j >= 0 && i < frame.width && j < frame.height)
    {
      smallest = std::abs(ijz[2]);
      value = given.pixels[(f * frame.height + j) * frame.width + i];
    }
  }
  return value;
}

std::vector<std::uint8_t> NearestMaps(const Sweep& sweep, const LabelFrames& training,
                                      const std::vector<SlicePlane>& planes)
{
  std::vector<SlicePlane> frames;
  std::vector<Eigen::Matrix3d> toFrames;
  for (const int frame : training.frames)
  {
    frames.push_back(sweep.Plane(frame));
    toFrames.push_back(frames.back().WorldToSlice());
  }
  std::vector<std::uint8_t> maps;
  for (const SlicePlane& plane : planes)
  {
    for (std::size_t p = 0; p < plane.NumberOfPixels(); ++p)
    {
      maps.push_back(NearestLabel(frames, toFrames, training, plane.Point(p % plane.width, p / plane.width)));
    }
  }
  return maps;
}

/// What a volume compounded of each label's pictures shows there.
std::vector<std::uint8_t> CompoundedMaps(const Sweep& sweep, const LabelFrames& training,
                                         const std::vector<SlicePlane>& planes)
{
  std::vector<Compounding> volumes;
  for (const Label& label : training.labels)
  {
    const int own = label.value;
    const Sweep frames =
        AsFrames(sweep, training, [own](std::uint8_t value) { return std::uint8_t(value == own ? 255 : 0); });
    volumes.emplace_back(frames, AllFrames(frames));
  }
  std::vector<std::uint8_t> maps;
  for (const SlicePlane& plane : planes)
  {
    const std::size_t n = plane.NumberOfPixels();
    std::vector<float> shares(volumes.size() * n);
    for (std::size_t k = 0; k < volumes.size(); ++k)
    {
      volumes[k].Predict(plane, &shares[k * n]);
    }
    maps.resize(maps.size() + n);
    MapLabels(training.labels, shares.data(), n, &maps[maps.size() - n]);
  }
  return maps;
}

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

/// Extends a box by pixels above 0.
void ExtendByLit(const float* image, int columns, int rows, Eigen::AlignedBox2i& box)
{
  for (int row = 0; row < rows; ++row, image += columns)
  {
    const auto isLit = [](float value) { return value > 0; };
    const float* const first = std::find_if(image, image + columns, isLit);
    if (first != image + columns)
    {
      const auto last =
          std::find_if(std::make_reverse_iterator(image + columns), std::make_reverse_iterator(image), isLit);
      box.extend(Eigen::Vector2i(first - image, row));
      box.extend(Eigen::Vector2i(last.base() - image - 1, row));
    }
  }
}

/// What is measured of a label on a picture, in pixels.
struct Extent
{
  double area = 0, outline = 0, width = 0, height = 0;
};

/// The outline by Crofton's formula: pi / 4 of the pixels' sides that lie between in and out.
Extent ExtentOf(const std::uint8_t* map, const SlicePlane& plane, int value)
{
  const auto isIn = [&](int i, int j)
  {
    return i >= 0 && j >= 0 && i < plane.width && j < plane.height &&
           map[static_cast<std::size_t>(j) * plane.width + i] == value;
  };
  Extent extent;
  Eigen::AlignedBox2d box;
  for (int j = 0; j <= plane.height; ++j)
  {
    for (int i = 0; i <= plane.width; ++i)
    {
      const bool isHere = isIn(i, j);
      extent.area += isHere;
      extent.outline += kPi / 4 * ((isHere != isIn(i - 1, j)) + (isHere != isIn(i, j - 1)));
      if (isHere)
      {
        box.extend(Eigen::Vector2d(i, j));
      }
    }
  }
  if (!box.isEmpty())
  {
    extent.width = box.sizes()[0] + 1;
    extent.height = box.sizes()[1] + 1;
  }
  return extent;
}

std::vector<Extent> ExtentsOf(const std::vector<SlicePlane>& planes, const std::uint8_t* map, int value)
{
  std::vector<Extent> extents;
  for (const SlicePlane& plane : planes)
  {
    extents.push_back(ExtentOf(map, plane, value));
    map += plane.NumberOfPixels();
  }
  return extents;
}

/// Fills in how far lengths and areas are off.
void Measure(const std::vector<SlicePlane>& planes, const std::uint8_t* shown, const std::uint8_t* truth,
             LabelScore& score)
{
  const std::vector<Extent> is = ExtentsOf(planes, truth, score.label.value);
  const std::vector<Extent> told = ExtentsOf(planes, shown, score.label.value);
  double lengths = 0, areas = 0, count = 0, largest = 0;
  for (const Extent& one : is)
  {
    largest = std::max(largest, one.area);
  }
  for (std::size_t k = 0; k < planes.size(); ++k)
  {
    if (is[k].area > 0 && is[k].area >= 0.5 * largest)
    {
      const double pixel = planes[k].PixelSize();
      const double width = told[k].width - is[k].width, height = told[k].height - is[k].height;
      const double off = pixel * (told[k].area - is[k].area) / is[k].outline;
      lengths += pixel * pixel * (width * width + height * height) / 2;
      areas += off * off;
      ++count;
    }
  }
  score.length = std::sqrt(lengths / count);
  score.area = std::sqrt(areas / count);
}

}  // namespace

std::vector<Label> WithNames(std::vector<Label> names, const std::vector<std::uint8_t>& pixels)
{
  std::array<bool, kLargestLabel + 1> isThere{};
  for (const std::uint8_t value : pixels)
  {
    isThere[value] = true;
  }
  for (const Label& label : names)
  {
    isThere[std::clamp(label.value, 0, kLargestLabel)] = false;
  }
  for (int value = 1; value <= kLargestLabel; ++value)
  {
    if (isThere[value])
    {
      names.push_back({value, "Label " + std::to_string(value), UsualColor(value)});
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
    if (frames[f] < 0 || frames[f] >= sweep.NumberOfFrames() || (f > 0 && frames[f] <= frames[f - 1]))
    {
      throw Error("Labels: frame " + std::to_string(frames[f]) + " is out of order or not one of the " +
                  std::to_string(sweep.NumberOfFrames()) + " frames of the sweep.");
    }
  }
  Require(WithNames(labels, pixels).size() == labels.size(), "Labels: the pixels have a value that no label has.");
}

std::vector<int> LabelFrames::Drawn() const
{
  const std::size_t n = frames.empty() ? 0 : pixels.size() / frames.size();
  std::vector<int> drawn, all(frames.size());
  std::iota(all.begin(), all.end(), 0);
  for (const int place : all)
  {
    const auto first = pixels.begin() + n * place;
    if (std::any_of(first, first + n, [](std::uint8_t value) { return value != 0; }))
    {
      drawn.push_back(place);
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

void MapLabels(const std::vector<Label>& labels, const float* shares, std::size_t pixels, std::uint8_t* map)
{
  for (std::size_t p = 0; p < pixels; ++p)
  {
    float largest = 0, sum = 0;
    int value = 0;
    for (std::size_t k = 0; k < labels.size(); ++k)
    {
      const float share = shares[k * pixels + p];
      sum += share;
      if (share > largest)
      {
        largest = share;
        value = labels[k].value;
      }
    }
    map[p] = static_cast<std::uint8_t>(largest >= 1 - sum ? value : 0);
  }
}

std::unique_ptr<Engine> NewLabelEngine(const std::string& name)
{
  std::unique_ptr<Engine> engine = Engine::Create(name);
  Require(ViewEngine::Of(*engine), "Labels: the engine '", name, "' cannot fit them; take cpu.");
  return engine;
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
  Eigen::AlignedBox2i seen;
  for (std::size_t k = 0; k < own_.size(); ++k)
  {
    float* const share = &shares[k * pixels];
    if (own_[k])
    {
      own_[k]->Render(plane, window, ViewOutput::Scattering, share, nullptr);
    }
    ExtendByLit(share, window.columns, window.rows, seen);
  }
  if (!seen.isEmpty())
  {
    const Eigen::Vector2i first = seen.min(), size = seen.sizes() + Eigen::Vector2i::Ones();
    std::vector<float> covered(static_cast<std::size_t>(size.x()) * size.y());
    all_->Render(plane, {window.firstColumn + first.x(), window.firstRow + first.y(), size.x(), size.y()},
                 ViewOutput::Scattering, covered.data(), nullptr);
    for (std::size_t p = 0; p < covered.size(); ++p)
    {
      const std::size_t at = (first.y() + p / size.x()) * columns + first.x() + p % size.x();
      for (std::size_t k = 0; k < own_.size(); ++k)
      {
        float& share = shares[k * pixels + at];
        share = covered[p] > kSeen ? std::clamp(share / covered[p], 0.0f, 1.0f) : 0.0f;
      }
    }
  }
  MapLabels(labels_, shares.data(), pixels, map);
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

std::vector<LabelScore> ScoreLabels(const GaussianField& field, const FieldLabels& labels, const Sweep& sweep,
                                    const LabelFrames& training, const std::vector<SlicePlane>& planes,
                                    const std::vector<std::uint8_t>& truth, const std::string& engine)
{
  training.Validate(sweep);
  LabelledField labelled(field, labels, engine);
  std::vector<std::uint8_t> shown;
  for (const SlicePlane& plane : planes)
  {
    shown.resize(shown.size() + plane.NumberOfPixels());
    labelled.Render(plane, &shown[shown.size() - plane.NumberOfPixels()]);
  }
  Require(truth.size() == shown.size(), "Labels: there are ", truth.size(), " pixels of truth for planes of ",
          shown.size(), ".");
  const std::vector<std::uint8_t> nearest = NearestMaps(sweep, training, planes);
  const std::vector<std::uint8_t> compounded = CompoundedMaps(sweep, training, planes);
  std::vector<LabelScore> scores;
  for (const Label& label : labels.labels)
  {
    scores.push_back({label, Dice(shown, truth, label.value), Dice(nearest, truth, label.value),
                      Dice(compounded, truth, label.value)});
    Measure(planes, shown.data(), truth.data(), scores.back());
  }
  return scores;
}

}  // namespace bigus
