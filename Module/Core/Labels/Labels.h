// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Labels drawn on frames, carried by the Gaussians of a field to any plane. README.md has the equations.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Labels/FieldLabels.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"
#include "Core/Slicing/Bands.h"

namespace bigus
{

/// `names`, and "Label 3" and so on for values in the pixels that have none there; ascending.
std::vector<Label> WithNames(std::vector<Label> names, const std::vector<std::uint8_t>& pixels);

/// A label picture of some of a sweep's frames.
struct LabelFrames
{
  std::vector<Label> labels;         ///< in ascending order of their values
  std::vector<int> frames;           ///< of the sweep, ascending
  std::vector<std::uint8_t> pixels;  ///< [frames][height][width] value of a label, or 0

  /// Throws Error unless these are frames of `sweep`, there is a picture of its size for each, at least one label, and every
  /// value in the pixels is one's.
  void Validate(const Sweep& sweep) const;

  /// The places of the pictures that count. Where most of those between the first and the last with a label have none, only
  /// some frames were drawn on, and an empty picture says nothing; else it says that nothing is there.
  std::vector<int> Drawn() const;

  /// The frames at these places of `frames`.
  LabelFrames Subset(const std::vector<int>& places) const;
};

/// How labels are fitted.
struct LabelFit
{
  std::string engine = "auto";
  std::function<bool(double)> progress = {};  ///< gets the share done; false stops, and the result is empty
  int iterations = 4;                         ///< 0: what lies between the labelled frames, not fitted
};

/// Fits weights to label pictures, shapes of Gaussians as they are. `sweep`: at the poses that the field was trained at.
/// The same bits for any number of threads. Throws Error for frames that do not fit the sweep, and for an engine that cannot
/// fit labels.
FieldLabels FitLabels(const GaussianField& field, const Sweep& sweep, const LabelFrames& given,
                      const LabelFit& fit = {});

/// What a field with reflectivities 1 + w shows of the label: S / coverage - 1, from 0 to 1, and 0 where hardly a Gaussian
/// reaches. `render`: the scattering of that field.
RenderPlanes ShareOf(const RenderPlanes& render);

/// The label pictures of a labelled field at planes: sums over all carriers where a label is, and over those of each.
class LabelledField
{
public:
  /// Throws Error where labels are not the field's, and as Engine::Create.
  LabelledField(const GaussianField& field, const FieldLabels& labels, const std::string& engine = "auto");

  const std::vector<Label>& Labels() const { return labels_; }

  /// `map` gets window.rows * window.columns values.
  void Render(const SlicePlane& plane, const Engine::Window& window, std::uint8_t* map);
  void Render(const SlicePlane& plane, std::uint8_t* map) { Render(plane, {0, 0, plane.width, plane.height}, map); }
  /// Every slice of a part of a grid, one after the other.
  void Render(const GridPart& grid, std::uint8_t* map);

private:
  std::vector<Label> labels_;
  std::unique_ptr<Engine> all_;               // of reflectivity 1
  std::vector<std::unique_ptr<Engine>> own_;  // [labels] those that have some of it, of that reflectivity; null: none
};

/// Dice 2 |A and B| / (|A| + |B|) of one label over all pictures; 1 where neither has it.
double Dice(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b, int value);

/// Of one label, how well the field meets it at planes that had no part.
struct LabelScore
{
  Label label;
  double dice = 0;
  /// How far what is measured on the field's pictures is off, root mean square over the planes that truly show the label: mm of
  /// a length across it, along rows or columns, and mm by which an area is off for each mm of its outline. README.md tells how
  /// they become standard errors. Not a number where no plane shows it.
  double length = 0, area = 0;
};

/// Scores the labels of a field at planes whose `truth` is [planes][height][width].
std::vector<LabelScore> ScoreLabels(const GaussianField& field, const FieldLabels& labels,
                                    const std::vector<SlicePlane>& planes, const std::vector<std::uint8_t>& truth,
                                    const std::string& engine = "auto");

struct LabelVolume
{
  Label label;
  double volume = 0;  ///< mm^3
  /// mm^3; README.md says of what. Not a number where fewer than three frames have the label, or a sweep has it that was drawn on
  /// fewer.
  double standardError = 0;
};

/// Of each label that was fitted to these pictures. `trackerNoise`: mm, at least 0, of a frame's place along its normal
/// (TrackerNoise of Core/StandardError).
std::vector<LabelVolume> MeasureLabels(const GaussianField& field, const FieldLabels& labels, const Sweep& sweep,
                                       const LabelFrames& drawn, double trackerNoise,
                                       const std::string& engine = "auto");

}  // namespace bigus
