// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How far a slice of a field may be from what a probe would show there. README.md has the model.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"
#include "Core/Model/ViewDependence.h"
#include "Core/Slicing/OutputGrid.h"

namespace bigus
{

/// What a training knows of its field's errors, and what follows for any plane: for each pixel the standard deviation of
/// a recorded frame there about the slice, in units of intensity (1 is white). Planes rolled in themselves by
/// more than 4 degrees, and a probe of another frequency than 5 MHz, are not covered. Beams run down the columns, or where
/// the frames show a fan (FindApex) from its apex; a slice's fan hangs from the middle of its first row as the frames' does.
class StandardError
{
public:
  /// Looks at the field's residuals on the training frames, and at how well these predict each other. `sweep`: at the poses
  /// that the field was trained at, with the mask of what a probe lights (Sweep::LitBy); `training`: in ascending order;
  /// `trackerNoise`: mm, at least 0 (TrackerNoise); `view`: what the field knows of directions, null for nothing. Takes about
  /// as long as rendering every training frame five times. Throws Error for frames that are not there.
  StandardError(const GaussianField& field, const Sweep& sweep, const std::vector<int>& training, double trackerNoise,
                const std::string& engine = "auto", const ViewDependence* view = nullptr);

  /// What ToBytes gave. Withstands any damage: throws Error.
  explicit StandardError(std::string_view bytes);

  /// Three bytes for every cell of 4 x 4 pixels of each training frame, or of 8 x 8, 16 x 16 and so on where that takes more
  /// than 4 MiB, and poses and lit area. Numbers have this machine's order of bytes.
  std::string ToBytes() const;

  /// Pixels around one that its standard error depends on.
  int Margin(const SlicePlane& plane) const;

  /// `image`: intensities of the slice in that window of `plane`, row by row. `sigma` gets as many floats; NaN where the
  /// frames do not tell: outside the lit area, before the first frame and behind the last. What lies outside the window is
  /// not looked at, so that parts of a plane agree bit for bit with the whole where windows are wider by Margin, but not than
  /// the plane. The same for every number of threads.
  void Evaluate(const SlicePlane& plane, const Engine::Window& window, const float* image, float* sigma) const
  {
    Evaluate(plane, window, image, sigma, NearnessOf(plane));
  }
  void Evaluate(const SlicePlane& plane, const float* image, float* sigma) const
  {
    Evaluate(plane, {0, 0, plane.width, plane.height}, image, sigma);
  }

  /// Of part of a grid, slice by slice, with the bits that the whole has there. `render` fills the intensities of another
  /// part of the grid, one slice deep, and returns false to stop; then this returns false, too. `isVolume`: directions do not
  /// count in what it renders, wherever its slices lie.
  bool Evaluate(const GridPart& grid, const std::function<bool(const Extent&, float*)>& render, float* sigma,
                bool isVolume = false) const;

  /// Whether the slice `image` tells little of what a probe would show: its standard error is larger than it varies itself
  /// (and than two grey levels), or most of what it shows lies where the frames do not tell. Judged at some 10,000 pixels.
  bool IsMostlyGuessed(const SlicePlane& plane, const float* image) const;

  /// The standard error of the mean of a slice over pixels (`where`: those that are not 0; null: all) of which `sigma`, that
  /// of each of them (Evaluate), is known: errors of pixels beside each other are alike. It is what a mean over a square of
  /// as much area keeps of them (README.md). NaN where none is known, and of fields that kept no squares. Of a volume `plane`
  /// is the first of so many `slices`, `step` mm apart, and `sigma` and `where` have them one after another.
  double OfMean(const SlicePlane& plane, const float* sigma, const unsigned char* where = nullptr, int slices = 1,
                double step = 0) const;

  /// Of the standard error of one pixel, what that of a mean over a square with sides of so many mm is; empty for fields that
  /// kept no squares.
  struct Square
  {
    double side, share;
  };
  std::vector<Square> Squares() const;

  /// For every pixel how far the frames before and behind it let a slice wander, mm: README.md's m. NaN where not known.
  std::vector<float> Apart(const SlicePlane& plane) const;

private:
  /// A frame's plane; its coordinates (column, row, mm along the normal) are toFrame (x - origin). Normals of one sequence
  /// point one way along it.
  struct Frame
  {
    SlicePlane plane;
    Eigen::Vector3d normal;
    Eigen::Matrix3d toFrame;
    Eigen::Vector3d apex;  // of a fan
  };
  /// How a place is seen; of length 1.
  struct View
  {
    Eigen::Vector3d normal, beam;
  };
  struct Beside;
  struct Candidate;
  struct Tile;
  struct Terms;
  struct Shown;
  struct Line;
  struct Set;
  class CellReader;
  class FanTurns;
  class LineFinder;
  class Preparation;

  double NearnessOf(const SlicePlane& plane) const { return seen_ ? views_.Nearness(plane) : 0; }
  void Evaluate(const SlicePlane& plane, const Engine::Window& window, const float* image, float* sigma,
                double nearness) const;
  void Derive();
  std::size_t Cells() const;
  int CellColumns() const { return (width_ + cell_ - 1) / cell_; }
  bool IsLit(double column, double row) const
  {
    return column >= 0 && row >= 0 && column <= width_ - 1 && row <= height_ - 1 &&
           lit_[static_cast<std::size_t>(static_cast<int>(row + 0.5)) * width_ + static_cast<int>(column + 0.5)] != 0;
  }
  bool MayBeLit(double firstColumn, double lastColumn, double firstRow, double lastRow) const;
  Eigen::Vector3d ApexOf(const SlicePlane& plane) const;
  static double Another(const View& frame, const View& plane);
  std::vector<double> Turned(const SlicePlane& plane) const;
  View ViewAt(int frame, const Eigen::Vector3d& place) const;
  View ViewOf(const Beside& beside, int side) const;
  static double Further(double turned, double usual);
  std::vector<Candidate> Candidates(const SlicePlane& plane, const std::vector<int>& among) const;
  std::vector<Set> Sets(const SlicePlane& plane, const std::vector<double>& turned) const;
  std::vector<Candidate> Within(const Tile& tile, int side, const std::vector<Candidate>& all) const;
  void Find(const Tile& tile, const std::vector<Candidate>& all, std::vector<Beside>& found) const;
  void FindInBlock(const Tile& block, int side, const std::vector<Candidate>& candidates, Beside* found,
                   int width) const;
  bool MayLight(const Candidate& one, const Tile& tile) const;
  template <class At>
  static void ForTiles(const Engine::Window& window, const At& at);
  template <class With>
  static void ForPixels(const Tile& tile, const Engine::Window& window, const With& with);
  std::vector<Beside> Nearest(const SlicePlane& plane, const std::vector<int>& among) const;
  std::vector<double> OwnVariances(const Shown& shown, const Tile& tile, const std::vector<Line>& lines) const;
  void TakeLeast(const Shown& shown, const Tile& tile, const std::vector<Line>& lines, float* sigma) const;
  double FanTurn(const Shown& shown, int frame, int other, int column, int row) const;
  void FindLines(const Shown& shown, const Tile& tile, const std::vector<Set>& sets, std::vector<Line>& lines) const;

  int width_ = 0, height_ = 0, cell_ = 4;
  static constexpr double kMostNoise = 1e6;  // mm; a path that leaps by more tells no more
  double trackerNoise_ = 0;                  // mm
  std::vector<Eigen::Matrix4d> poses_;
  std::vector<int> sequences_;
  std::vector<float> speckle_;    // [frames] share of local variance that is another when turned
  std::vector<float> usualTurn_;  // [frames] how much speckle is another where R was measured
  /// Of the errors on frames, and between them, what is left where directions count (a = 1).
  struct Seen
  {
    float residual, rate;
  };
  std::optional<Seen> seen_;       // null: the field knows nothing of directions
  RecordedViews views_;            // with seen_
  std::vector<float> squares_;     // shares of sigma in means over 2, 4, 8, ... pixels a side
  float bias_ = 0;                 // of the field, in means over the largest of them
  double gap_ = 0;                 // mm from a frame to the next that is usual
  std::vector<std::uint8_t> lit_;  // [height][width]
  /// Coded (CodeOfVariance); 0: not known.
  struct Codes
  {
    std::uint8_t residual = 0, rate = 0, texture = 0;
  };
  std::vector<Codes> codes_;   // [frames][cell rows][cell columns]
  std::vector<Frame> frames_;  // what Derive makes of the above
  std::vector<std::vector<int>> bySequence_;
  std::vector<int> litSums_;             // [height + 1][width + 1] lit pixels above and left
  std::optional<Eigen::Vector2d> apex_;  // of a fan: mm right of the middle of the first row, and below it
};

/// mm, standard deviation of the tracker's noise that is left in a place, when poses were smoothed by `strength`
/// (TrajectoryOptions; 0: they are as recorded): of frames ordered by times or by numbers, whichever finds less; 0 where it is
/// not known.
double TrackerNoise(const Sweep& tracked, double strength);

/// What a standard error says beside the errors that there are.
struct StandardErrorScores
{
  double varianceRatio = 0;  ///< mean predicted variance over mean squared error; 1 is right
  double within1 = 0;        ///< share of pixels whose error is at most sigma
  double within2 = 0;        ///< at most 2 sigma: 0.95 where errors are normal
  double correlation = 0;    ///< Pearson's, of sigma and error
  double sparsification =
      0;  ///< area under the curve of the error left when pixels go by sigma: 0 as if by the error, 1 by chance
};

/// Pixels whose sigma differs by less than a factor of the root of 2: root mean squares of what is said and of errors.
struct StandardErrorBin
{
  double sigma = 0;
  double error = 0;
  int count = 0;  ///< of pixels
};

/// The standard errors of means over squares of pixels beside their errors.
struct MeanErrorScore
{
  double side = 0;           ///< of the squares, mm
  double varianceRatio = 0;  ///< as above; 1 is right
  int count = 0;             ///< of squares
};

/// The model beside plain ones, which get the scale that suits the scored frames best: their variance ratio is 1.
struct StandardErrorReport
{
  StandardErrorScores model;
  StandardErrorScores constant;
  StandardErrorScores distance;               ///< a random walk between the frames, of one rate everywhere
  StandardErrorScores texture;                ///< the slice's own 7 x 7 variance
  std::vector<StandardErrorBin> reliability;  ///< of the model, by growing sigma; none is empty
  std::vector<MeanErrorScore> means;          ///< over squares with sides of 8, 32 and 128 pixels, where there are some
  double rmse = 0;                            ///< of intensity
  double known = 0;                           ///< share of the lit pixels of which sigma is known, and which count
};

/// Of the field's slices at these frames of `sweep`, which had no part in it; `view`: what it knows of directions. Throws Error when nothing is known there.
StandardErrorReport ScoreStandardError(const StandardError& error, const GaussianField& field, const Sweep& sweep,
                                       const std::vector<int>& frames, const std::string& engine = "auto",
                                       const ViewDependence* view = nullptr);

}  // namespace bigus
