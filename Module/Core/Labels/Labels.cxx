// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Labels/Labels.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "Core/Engine/ViewEngine.h"
#include "Core/Evaluation/Baselines.h"
#include "Core/Evaluation/Compounding.h"
#include "Core/Model/Error.h"

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

/// What the nearest label picture shows at each plane of `heldOut`.
std::vector<std::uint8_t> NearestMaps(const Sweep& sweep, const LabelFrames& training, const LabelFrames& heldOut)
{
  const Sweep frames = AsFrames(sweep, training, [](std::uint8_t value) { return value; });
  std::vector<std::uint8_t> maps;
  std::vector<float> image(sweep.PixelsPerFrame());
  for (const int frame : heldOut.frames)
  {
    PredictNearest(frames, AllFrames(frames), sweep.Plane(frame), image.data());
    for (const float value : image)
    {
      maps.push_back(static_cast<std::uint8_t>(std::lround(value * 255)));
    }
  }
  return maps;
}

/// What a volume compounded of each label's pictures shows there.
std::vector<std::uint8_t> CompoundedMaps(const Sweep& sweep, const LabelFrames& training, const LabelFrames& heldOut)
{
  const std::size_t n = sweep.PixelsPerFrame(), labels = training.labels.size();
  std::vector<float> shares(heldOut.frames.size() * labels * n);
  for (std::size_t k = 0; k < labels; ++k)
  {
    const int own = training.labels[k].value;
    const Sweep frames =
        AsFrames(sweep, training, [own](std::uint8_t value) { return std::uint8_t(value == own ? 255 : 0); });
    const Compounding volume(frames, AllFrames(frames));
    for (std::size_t f = 0; f < heldOut.frames.size(); ++f)
    {
      volume.Predict(sweep.Plane(heldOut.frames[f]), &shares[(f * labels + k) * n]);
    }
  }
  std::vector<std::uint8_t> maps(heldOut.frames.size() * n);
  for (std::size_t f = 0; f < heldOut.frames.size(); ++f)
  {
    MapLabels(training.labels, &shares[f * labels * n], n, &maps[f * n]);
  }
  return maps;
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
  if (labels.empty() || frames.empty())
  {
    throw Error("Labels: there is no label in any frame; draw one, or say which frames hold labels.");
  }
  if (pixels.size() != frames.size() * sweep.PixelsPerFrame())
  {
    throw Error("Labels: there are " + std::to_string(pixels.size()) + " pixels for " + std::to_string(frames.size()) +
                " frames of " + std::to_string(sweep.width) + " x " + std::to_string(sweep.height) +
                "; label pictures have the size of the sweep's.");
  }
  for (std::size_t f = 0; f < frames.size(); ++f)
  {
    if (frames[f] < 0 || frames[f] >= sweep.NumberOfFrames() || (f > 0 && frames[f] <= frames[f - 1]))
    {
      throw Error("Labels: frame " + std::to_string(frames[f]) + " is out of order or not one of the " +
                  std::to_string(sweep.NumberOfFrames()) + " frames of the sweep.");
    }
  }
  if (WithNames(labels, pixels).size() != labels.size())
  {
    throw Error("Labels: the pixels have a value that no label has.");
  }
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
  if (!ViewEngine::Of(*engine))
  {
    throw Error("Labels: the engine '" + name + "' cannot fit and show them; take cpu.");
  }
  return engine;
}

LabelledField::LabelledField(const GaussianField& field, const FieldLabels& labels, const std::string& engine)
    : labels_(labels), engine_(NewLabelEngine(engine))
{
  labels.Validate(field.Size());
  engine_->SetField(labels.Carriers(field));
}

void LabelledField::Render(const SlicePlane& plane, const Engine::Window& window, std::uint8_t* map)
{
  const std::size_t pixels = static_cast<std::size_t>(window.columns) * window.rows;
  std::vector<float> shares(labels_.labels.size() * pixels);
  const RenderPlanes render = ShareOf(PlanesOn(*engine_, ViewOutput::Scattering));
  for (std::size_t k = 0; k < labels_.labels.size(); ++k)
  {
    ViewEngine::Of(*engine_)->SetReflectivities(labels_.Raised(k));
    render({plane}, window, &shares[k * pixels], nullptr);
  }
  MapLabels(labels_.labels, shares.data(), pixels, map);
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
                                    const LabelFrames& training, const LabelFrames& heldOut, const std::string& engine)
{
  training.Validate(sweep);
  heldOut.Validate(sweep);
  LabelledField labelled(field, labels, engine);
  std::vector<std::uint8_t> shown(heldOut.pixels.size());
  for (std::size_t f = 0; f < heldOut.frames.size(); ++f)
  {
    labelled.Render(sweep.Plane(heldOut.frames[f]), &shown[f * sweep.PixelsPerFrame()]);
  }
  const std::vector<std::uint8_t> nearest = NearestMaps(sweep, training, heldOut);
  const std::vector<std::uint8_t> compounded = CompoundedMaps(sweep, training, heldOut);
  std::vector<LabelScore> scores;
  for (const Label& label : labels.labels)
  {
    scores.push_back({label, Dice(shown, heldOut.pixels, label.value), Dice(nearest, heldOut.pixels, label.value),
                      Dice(compounded, heldOut.pixels, label.value)});
  }
  return scores;
}

}  // namespace bigus
