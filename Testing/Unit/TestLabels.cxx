// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Labels carried by a field: against closed formulas, and against what the phantom's anatomy is.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iostream>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Core/Engine/ViewEngine.h"
#include "Core/Evaluation/Compounding.h"
#include "Core/Labels/Labels.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "Core/Phantom/Phantom.h"
#include "Support/Random.h"

namespace bigus::labels_test
{
namespace
{

constexpr double kScale = 0.8;  // mm

/// Round Gaussians on a lattice of 1.2 mm over a box.
GaussianField Lattice(const Eigen::Vector3d& first, const Eigen::Vector3d& last)
{
  GaussianField field;
  const double step = 1.2;
  for (double z = first[2]; z <= last[2]; z += step)
  {
    for (double y = first[1]; y <= last[1]; y += step)
    {
      for (double x = first[0]; x <= last[0]; x += step)
      {
        field.means.emplace_back(x, y, z);
        field.scales.emplace_back(kScale, kScale, kScale);
        field.rotations.emplace_back(1, 0, 0, 0);
        field.reflectivities.push_back(0.3 * std::sin(3 * x + 5 * y + 7 * z));
      }
    }
  }
  field.beam.elevationSigma = 0.5;
  return field;
}

/// The phantom's sweep without its pixels, which labels do not look at, and what a person would draw on every `step`th frame.
struct Drawn
{
  Phantom phantom;
  Sweep sweep;
  LabelFrames labels;
};

Drawn Draw(int step, int frames = 25)
{
  PhantomOptions options;
  options.frames = frames;
  options.width = 100;
  options.height = 100;
  options.pixelSize = 0.5;
  options.frameSpacing = 0.5;
  Drawn drawn{Phantom(options), {}, {}};
  drawn.sweep.width = options.width;
  drawn.sweep.height = options.height;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(drawn.sweep.PixelsPerFrame() * options.frames, 100);
  drawn.sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  for (int frame = 0; frame < options.frames; ++frame)
  {
    drawn.sweep.imageToReference.push_back(drawn.phantom.TruePlane(frame).ImageToReference());
    if (frame % step == 0)
    {
      const std::vector<std::uint8_t> picture = drawn.phantom.Labels(drawn.phantom.TruePlane(frame));
      drawn.labels.frames.push_back(frame);
      drawn.labels.pixels.insert(drawn.labels.pixels.end(), picture.begin(), picture.end());
    }
  }
  drawn.labels.labels = WithNames({{1, "vessel"}, {2, "cyst"}, {3, "bone"}, {4, "tumour"}}, {});
  return drawn;
}

GaussianField FieldOf(const Drawn&)
{
  return Lattice({-27, -2, -13}, {27, 52, 13});
}

/// How well the field meets a label, and two ways without it: the nearest drawn frame, and a compounded volume.
struct Score : LabelScore
{
  double nearest = 0, compounding = 0;
};

/// At each point what the nearest drawn frame shows, of those that it projects onto at right angles.
std::vector<std::uint8_t> NearestMaps(const Sweep& sweep, const LabelFrames& drawn,
                                      const std::vector<SlicePlane>& planes)
{
  std::vector<std::uint8_t> maps;
  std::vector<std::pair<SlicePlane, Eigen::Matrix3d>> frames;
  for (const int frame : drawn.frames)
  {
    frames.emplace_back(sweep.Plane(frame), sweep.Plane(frame).WorldToSlice());
  }
  for (const SlicePlane& plane : planes)
  {
    for (std::size_t p = 0; p < plane.NumberOfPixels(); ++p)
    {
      double smallest = std::numeric_limits<double>::infinity();
      maps.push_back(0);
      for (std::size_t f = 0; f < frames.size(); ++f)
      {
        const auto& [own, toSlice] = frames[f];
        const Eigen::Vector3d ijz = toSlice * (plane.Point(p % plane.width, p / plane.width) - own.origin);
        if (std::abs(ijz[2]) < smallest && ijz[0] >= -0.5 && ijz[0] <= own.width - 0.5 && ijz[1] >= -0.5 &&
            ijz[1] <= own.height - 0.5)
        {
          const int i = std::clamp(static_cast<int>(std::lround(ijz[0])), 0, own.width - 1),
                    j = std::clamp(static_cast<int>(std::lround(ijz[1])), 0, own.height - 1);
          smallest = std::abs(ijz[2]);
          maps.back() = drawn.pixels[(f * own.height + j) * own.width + i];
        }
      }
    }
  }
  return maps;
}

/// The label whose compounded pictures are brightest at each point, or none where what is left of 1 is more.
std::vector<std::uint8_t> CompoundedMaps(const Sweep& sweep, const LabelFrames& drawn,
                                         const std::vector<SlicePlane>& planes)
{
  std::vector<std::uint8_t> maps;
  std::vector<float> largest, left;
  for (const SlicePlane& plane : planes)
  {
    maps.resize(maps.size() + plane.NumberOfPixels());
  }
  largest.assign(maps.size(), 0);
  left.assign(maps.size(), 1);
  for (const Label& label : drawn.labels)
  {
    Sweep frames;
    frames.width = sweep.width;
    frames.height = sweep.height;
    auto mask = std::make_shared<std::vector<std::uint8_t>>();
    for (const std::uint8_t value : drawn.pixels)
    {
      mask->push_back(value == label.value ? 255 : 0);
    }
    frames.pixels = std::shared_ptr<const void>(mask, mask->data());
    for (const int frame : drawn.frames)
    {
      frames.imageToReference.push_back(sweep.imageToReference[frame]);
    }
    const Compounding volume(frames, AllFrames(frames));
    std::size_t at = 0;
    for (const SlicePlane& plane : planes)
    {
      std::vector<float> shares(plane.NumberOfPixels());
      volume.Predict(plane, shares.data());
      for (const float share : shares)
      {
        left[at] -= share;
        maps[at] = share > largest[at] ? static_cast<std::uint8_t>(label.value) : maps[at];
        largest[at] = std::max(largest[at], share);
        ++at;
      }
    }
  }
  for (std::size_t p = 0; p < maps.size(); ++p)
  {
    maps[p] = largest[p] >= left[p] ? maps[p] : 0;
  }
  return maps;
}

std::vector<Score> AllScores(const GaussianField& field, const FieldLabels& labels, const Sweep& sweep,
                             const LabelFrames& drawn, const std::vector<SlicePlane>& planes,
                             const std::vector<std::uint8_t>& truth)
{
  const auto nearest = NearestMaps(sweep, drawn, planes), compounded = CompoundedMaps(sweep, drawn, planes);
  std::vector<Score> scores;
  for (const LabelScore& score : ScoreLabels(field, labels, planes, truth, "cpu"))
  {
    scores.push_back({score, Dice(nearest, truth, score.label.value), Dice(compounded, truth, score.label.value)});
    std::cout << score.label.name << ": " << score.dice << ", nearest " << scores.back().nearest << ", compounded "
              << scores.back().compounding << "\n";
  }
  return scores;
}

/// Of the labels that the planes show.
double Mean(const std::vector<Score>& scores, double Score::*value)
{
  double sum = 0, count = 0;
  for (const Score& score : scores)
  {
    const bool isShown = std::isfinite(score.length);
    sum += isShown ? score.*value : 0;
    count += isShown;
  }
  return sum / count;
}

std::vector<SlicePlane> PlanesOf(const Sweep& sweep, const std::vector<int>& frames)
{
  std::vector<SlicePlane> planes;
  for (const int frame : frames)
  {
    planes.push_back(sweep.Plane(frame));
  }
  return planes;
}

/// A plane turned about the depth axis, whose middle column lies at x, in the middle of the sweep. It stays inside it.
SlicePlane Across(double degrees, double x)
{
  const double angle = degrees * kRadiansPerDegree;
  SlicePlane plane;
  plane.width = static_cast<int>(20 / std::sin(angle));
  plane.height = 90;
  plane.columnStep = 0.5 * Eigen::Vector3d(std::cos(angle), 0, std::sin(angle));
  plane.rowStep = {0, 0.5, 0};
  plane.origin = Eigen::Vector3d(x, 2, 0) - 0.5 * (plane.width - 1) * plane.columnStep;
  return plane;
}

}  // namespace

TEST(Labels, AShareIsTheRatioOfTwoSums)
{
  const GaussianField field = Lattice({0, 0, 0}, {9, 9, 4});
  FieldLabels labels{{{7, "left"}}, {}, {}};
  for (const Eigen::Vector3d& mean : field.means)
  {
    labels.weights.push_back(static_cast<float>(std::clamp(1 - mean.x() / 9, 0.0, 1.0)));
  }
  SlicePlane plane;
  plane.origin = {1, 2, 1.7};
  plane.columnStep = {0.5, 0, 0};
  plane.rowStep = {0, 0.5, 0};
  plane.width = plane.height = 14;

  const auto engine = Engine::Create("cpu");
  engine->SetField(labels.CarriersOf(field, 7));
  engine->SetAccuracy({0});
  std::vector<float> share(plane.NumberOfPixels());
  ShareOf(PlanesOn(*engine, ViewOutput::Scattering))({plane}, {0, 0, 14, 14}, share.data(), nullptr);

  FieldLabels two{{{7, "left"}, {9, "nowhere"}}, {}, {}};
  for (const float weight : labels.weights)
  {
    two.weights.insert(two.weights.end(), {weight, 0.0f});
  }
  LabelledField shows(field, two, "cpu");
  std::vector<std::uint8_t> map(plane.NumberOfPixels()), part(5 * 9);
  shows.Render(plane, map.data());
  shows.Render(plane, {6, 3, 5, 9}, part.data());

  // A round Gaussian of scale s at distance z through a beam of sigma b, rho away in the plane, weighs
  // exp(-z^2 / (2 (s^2 + b^2)) - rho^2 / (2 s^2)), up to what all have in common.
  const double thick = kScale * kScale + 0.25;
  for (int p = 0; p < 14 * 14; ++p)
  {
    const Eigen::Vector3d x = plane.Point(p % 14, p / 14);
    double sum = 0, all = 0;
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      const Eigen::Vector3d d = x - field.means[i];
      const double m = std::exp(-d.z() * d.z() / (2 * thick) - d.head<2>().squaredNorm() / (2 * kScale * kScale));
      sum += m * labels.weights[i];
      all += m;
    }
    // Sums of floats of some 500 terms: 1e-5 is ten times what they lose.
    EXPECT_NEAR(share[p], sum / all, 1e-5) << "pixel " << p;
    // Footprints of pictures end where they are not seen, at 1e-4 of white.
    if (std::abs(sum / all - 0.5) > 1e-3)
    {
      EXPECT_EQ(map[p], sum / all > 0.5 ? 7 : 0) << "pixel " << p;
    }
  }
  EXPECT_EQ(std::count(map.begin(), map.end(), 9), 0);
  EXPECT_GT(std::count(map.begin(), map.end(), 7), 14);
  for (int p = 0; p < 5 * 9; ++p)
  {
    EXPECT_EQ(part[p], map[(3 + p / 5) * 14 + 6 + p % 5]) << "pixel " << p << " of a window";
  }
}

TEST(Labels, WeightsThatMadePicturesAreFound)
{
  const Drawn drawn = Draw(1);
  const GaussianField field = FieldOf(drawn);
  FieldLabels made{{{1, "ball"}}, {}, {}};
  for (const Eigen::Vector3d& mean : field.means)
  {
    made.weights.push_back((mean - Eigen::Vector3d(0, 25, 0)).norm() < 8 ? 1.0f : 0.0f);
  }
  LabelledField shows(field, made, "cpu");
  LabelFrames given{made.labels, AllFrames(drawn.sweep), {}};
  given.pixels.resize(drawn.sweep.PixelsPerFrame() * given.frames.size());
  for (const int frame : given.frames)
  {
    shows.Render(drawn.sweep.Plane(frame), &given.pixels[frame * drawn.sweep.PixelsPerFrame()]);
  }
  const FieldLabels found = FitLabels(field, drawn.sweep, given, {"cpu", {}, 8});
  LabelledField again(field, found, "cpu");
  std::vector<std::uint8_t> pictures(given.pixels.size());
  for (const int frame : given.frames)
  {
    again.Render(drawn.sweep.Plane(frame), &pictures[frame * drawn.sweep.PixelsPerFrame()]);
  }
  EXPECT_GT(Dice(pictures, given.pixels, 1), 0.99);
}

/// Of a sweep drawn on every `step`th frame, on every so many frames from `first` on.
std::vector<Score> ScoresOfEvery(int step, int frames, int first, int apart)
{
  const Drawn all = Draw(1, frames);
  const GaussianField field = FieldOf(all);
  const LabelFrames training = Draw(step, frames).labels;
  std::vector<int> heldOut;
  for (int frame = first; frame < frames; frame += apart)
  {
    heldOut.push_back(frame);
  }
  std::cout << "one in " << step << "\n";
  return AllScores(field, FitLabels(field, all.sweep, training, {"cpu"}), all.sweep, training,
                   PlanesOf(all.sweep, heldOut), all.labels.Subset(heldOut).pixels);
}

TEST(Labels, FramesBetweenAreMetBetterThanByNeighboursAndByAVolume)
{
  for (const int step : {4, 8})
  {
    const auto scores = ScoresOfEvery(step, 25, step / 2, step);
    for (const Score& score : scores)
    {
      EXPECT_GT(score.dice, std::max(score.nearest, score.compounding)) << score.label.name;
    }
    EXPECT_GT(Mean(scores, &Score::dice), Mean(scores, &Score::nearest) + 0.04);
    EXPECT_GT(Mean(scores, &Score::dice), Mean(scores, &Score::compounding) + 0.01);
  }
}

TEST(Labels, OtherWaysOnTheWholePhantom)
{
  // What `bigus label --hold-out 3` is compared with on the page.
  PhantomOptions options;
  options.frames = 60;
  options.width = options.height = 256;
  Drawn all{Phantom(options), {}, {}};
  all.sweep.width = options.width;
  all.sweep.height = options.height;
  for (int frame = 0; frame < options.frames; ++frame)
  {
    all.sweep.imageToReference.push_back(all.phantom.TruePlane(frame).ImageToReference());
    const std::vector<std::uint8_t> picture = all.phantom.Labels(all.phantom.TruePlane(frame));
    all.labels.frames.push_back(frame);
    all.labels.pixels.insert(all.labels.pixels.end(), picture.begin(), picture.end());
  }
  all.labels.labels = WithNames({}, all.labels.pixels);
  const auto [fitted, heldOut] = SplitHoldOut(options.frames, 3);
  const LabelFrames drawn = all.labels.Subset(fitted);
  const std::vector<SlicePlane> planes = PlanesOf(all.sweep, heldOut);
  const std::vector<std::uint8_t> truth = all.labels.Subset(heldOut).pixels;
  const auto nearest = NearestMaps(all.sweep, drawn, planes), compounded = CompoundedMaps(all.sweep, drawn, planes);
  for (const Label& label : drawn.labels)
  {
    const double byNearest = Dice(nearest, truth, label.value), byVolume = Dice(compounded, truth, label.value);
    std::cout << label.name << ": nearest " << byNearest << ", compounded " << byVolume << "\n";
    EXPECT_TRUE(0.9 < byNearest && byNearest < byVolume && byVolume < 0.995) << label.name;
  }
}

TEST(Labels, WhatASweepsEndCutsGoesOnToIt)
{
  // Drawn on frames 0, 8, 16 and 24 of 30, whose next would be behind the end. The bone goes all along, the cyst gets
  // thinner ever faster, and the tumour ends before the sweep does.
  const auto scores = ScoresOfEvery(8, 30, 25, 1);
  for (const Score& score : scores)
  {
    EXPECT_GT(score.dice, std::max(score.nearest, score.compounding)) << score.label.name;
  }
  EXPECT_GT(scores[1].dice, 0.95);
  EXPECT_GT(scores[2].dice, 0.95);
}

/// A rod of 1.5 mm radius that leans by so many mm a mm along the sweep, drawn on frames 4 mm apart of a probe that is turned and
/// sways by more than the rod is thick. Dice on the planes half way between them.
double DiceOfRod(double lean)
{
  const auto isIn = [lean](const Eigen::Vector3d& x)
  { return Eigen::Vector2d(x.x() - lean * x.z(), x.y() - 12).norm() < 1.5; };
  const auto drawOn = [&isIn](const SlicePlane& plane, std::vector<std::uint8_t>& pixels)
  {
    for (std::size_t p = 0; p < plane.NumberOfPixels(); ++p)
    {
      pixels.push_back(isIn(plane.Point(p % plane.width, p / plane.width)));
    }
  };
  SlicePlane plane;
  plane.width = plane.height = 70;
  Sweep sweep;
  sweep.width = sweep.height = 70;
  LabelFrames drawn{{{1, "rod"}}, {}, {}};
  std::vector<SlicePlane> planes;
  std::vector<std::uint8_t> truth;
  for (int k = 0; k < 9; ++k)
  {
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.05 * (k % 3), Eigen::Vector3d::UnitZ()).matrix();
    plane.columnStep = turn * Eigen::Vector3d(0.4, 0, 0);
    plane.rowStep = turn * Eigen::Vector3d(0, 0.4, 0);
    plane.origin = Eigen::Vector3d(-14 + 2 * (k % 3), 0, 2 * k - 8);
    sweep.imageToReference.push_back(plane.ImageToReference());
    if (k % 2 == 0)
    {
      drawn.frames.push_back(k);
      drawOn(plane, drawn.pixels);
    }
    else
    {
      planes.push_back(plane);
      drawOn(plane, truth);
    }
  }
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(sweep.PixelsPerFrame() * 9, 100);
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  const GaussianField field = Lattice({-16, -2, -10}, {18, 30, 10});
  return ScoreLabels(field, FitLabels(field, sweep, drawn, {"cpu"}), planes, truth, "cpu").front().dice;
}

TEST(Labels, WhatMovesByMoreThanItsWidthIsFollowedBetweenDrawnFrames)
{
  const double straight = DiceOfRod(0), leaning = DiceOfRod(0.9);
  std::cout << "straight " << straight << ", leaning " << leaning << "\n";
  EXPECT_GT(straight, 0.9);
  EXPECT_GT(leaning, 0.5);  // thinner than it is, and at its place
}

/// Rods at the pictures' left edge, half of them outside, where the field has no Gaussians.
TEST(Labels, WhatThePicturesEdgeCutsHasNoHoles)
{
  Sweep sweep;
  sweep.width = sweep.height = 70;
  std::vector<SlicePlane> planes;
  for (int k = 0; k < 7; ++k)
  {
    Eigen::Matrix4d pose = Eigen::Vector4d(0.4, 0.4, 1, 1).asDiagonal();
    pose(2, 3) = 2 * k;
    sweep.imageToReference.push_back(pose);
    planes.push_back(sweep.Plane(k));
  }
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(sweep.PixelsPerFrame() * planes.size(), 100);
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  const GaussianField field = Lattice({20, 24, 0}, {28, 28, 12});
  for (double radius = 2; radius <= 8; radius += 0.5)
  {
    LabelFrames drawn{{{1, "rod"}}, bigus::AllFrames(sweep), {}};
    for (const SlicePlane& plane : planes)
    {
      for (std::size_t p = 0; p < plane.NumberOfPixels(); ++p)
      {
        const Eigen::Vector3d at = plane.Point(p % plane.width, p / plane.width);
        drawn.pixels.push_back((at.head<2>() - Eigen::Vector2d(0, 14)).norm() < radius);
      }
    }
    const FieldLabels found = FitLabels(field, sweep, drawn, {"cpu"});
    EXPECT_GT(ScoreLabels(field, found, planes, drawn.pixels, "cpu").front().dice, 0.97) << radius << " mm";
  }
}

TEST(Labels, PlanesAcrossShowTheAnatomyBetterThanNeighboursAndAVolume)
{
  const Drawn drawn = Draw(4);
  const GaussianField field = FieldOf(drawn);
  const FieldLabels found = FitLabels(field, drawn.sweep, drawn.labels, {"cpu"});
  for (const double degrees : {30.0, 60.0, 90.0})
  {
    std::vector<SlicePlane> planes;
    std::vector<std::uint8_t> truth;
    for (double x = -16; x <= 16; x += 2)
    {
      planes.push_back(Across(degrees, x));
      const std::vector<std::uint8_t> picture = drawn.phantom.Labels(planes.back());
      truth.insert(truth.end(), picture.begin(), picture.end());
    }
    std::cout << degrees << " degrees\n";
    const auto scores = AllScores(field, found, drawn.sweep, drawn.labels, planes, truth);
    for (const Score& score : scores)
    {
      EXPECT_GT(score.dice, std::max(score.nearest, score.compounding)) << degrees << " degrees, " << score.label.name;
    }
    // A border that is off by half a pixel all round costs a shape of ten pixels a tenth.
    EXPECT_GT(Mean(scores, &Score::dice), 0.9) << degrees << " degrees";
    EXPECT_GT(Mean(scores, &Score::dice), Mean(scores, &Score::nearest) + 0.02) << degrees << " degrees";
    EXPECT_GT(Mean(scores, &Score::dice), Mean(scores, &Score::compounding)) << degrees << " degrees";
  }
}

/// A cyst, an ellipsoid of half axes 6.5, 5.5 and 7 mm about (-4, 33, 3), drawn on frames of one hand after another, tracked to
/// 0.2 mm. `isDrawn` says on which.
constexpr double kTracked = 0.2;
const Eigen::Vector3d kCyst(-4, 33, 3), kHalfAxes(6.5, 5.5, 7);

Drawn DrawCyst(int seed, const std::function<bool(int)>& isDrawn)
{
  PhantomOptions options;
  options.seed = seed;
  options.width = 60;
  options.height = 60;
  options.pixelSize = 0.8;
  options.frameSpacing = 1.5 + 0.25 * (seed % 5);
  options.frames = static_cast<int>(30 / options.frameSpacing);
  options.trackingNoise = kTracked;
  Drawn drawn{Phantom(options), {}, {{{2, "cyst"}}, {}, {}}};
  drawn.sweep.width = drawn.sweep.height = 60;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(drawn.sweep.PixelsPerFrame() * options.frames, 100);
  drawn.sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  for (int frame = 0; frame < options.frames; ++frame)
  {
    drawn.sweep.imageToReference.push_back(drawn.phantom.RecordedPlane(frame).ImageToReference());
    if (isDrawn(frame))
    {
      drawn.labels.frames.push_back(frame);
      for (const std::uint8_t value : drawn.phantom.Labels(drawn.phantom.TruePlane(frame)))
      {
        drawn.labels.pixels.push_back(value == 2 ? 2 : 0);
      }
    }
  }
  return drawn;
}

GaussianField FieldAboutCyst()
{
  return Lattice({-14, 20, -8}, {6, 45, 14});
}

TEST(Labels, VolumesLieWithinTheirStandardErrors)
{
  const double truth = 4.0 / 3 * kPi * kHalfAxes.prod();
  const std::vector<std::function<bool(int)>> ways = {[](int) { return true; },
                                                      [](int frame) { return frame % 3 != 2; }};
  for (const auto& isDrawn : ways)  // all frames, or two of three
  {
    std::vector<double> errors;
    for (int seed = 1; seed <= 12; ++seed)
    {
      const Drawn drawn = DrawCyst(seed, isDrawn);
      const FieldLabels found = FitLabels(FieldAboutCyst(), drawn.sweep, drawn.labels, {"cpu"});
      const LabelVolume volume =
          MeasureLabels(FieldAboutCyst(), found, drawn.sweep, drawn.labels, kTracked, "cpu").front();
      std::cout << volume.volume << " +- " << volume.standardError << "\n";
      errors.push_back((volume.volume - truth) / volume.standardError);
    }
    // Of 12 normal errors, 3 or more lie beyond two sigma with a probability of 0.02.
    EXPECT_LE(std::count_if(errors.begin(), errors.end(), [](double error) { return std::abs(error) > 2; }), 2);
  }
}

/// Through the middle of the cyst, turned about the depth axis.
SlicePlane ThroughCyst(double degrees)
{
  const double angle = degrees * kRadiansPerDegree;
  SlicePlane plane;
  plane.width = plane.height = 80;
  plane.columnStep = 0.25 * Eigen::Vector3d(std::cos(angle), 0, std::sin(angle));
  plane.rowStep = {0, 0.25, 0};
  plane.origin = kCyst - 39.5 * (plane.columnStep + plane.rowStep);
  return plane;
}

TEST(Labels, LengthsAndAreasLieWithinTheirStandardErrors)
{
  const GaussianField field = FieldAboutCyst();
  double lengths = 0, areas = 0, bias = 0;
  int beyond = 0, count = 0;
  for (int seed = 1; seed <= 8; ++seed)
  {
    const Drawn all = DrawCyst(seed, [](int) { return true; });
    const LabelFrames even = DrawCyst(seed, [](int frame) { return frame % 2 == 0; }).labels;
    const LabelFrames odd = DrawCyst(seed, [](int frame) { return frame % 2 == 1; }).labels;
    const auto fit = [&](const LabelFrames& drawn) { return FitLabels(field, all.sweep, drawn, {"cpu"}); };
    const LabelScore stated = ScoreLabels(field, fit(even), PlanesOf(all.sweep, odd.frames), odd.pixels, "cpu").front();
    const FieldLabels found = fit(all.labels);
    LabelledField shows(field, found, "cpu");
    for (const double degrees : {0.0, 30.0, 60.0, 90.0})
    {
      const SlicePlane plane = ThroughCyst(degrees);
      std::vector<std::uint8_t> truth = all.phantom.Labels(plane), map(plane.NumberOfPixels());
      std::replace_if(
          truth.begin(), truth.end(), [](std::uint8_t value) { return value != 2; }, 0);
      const LabelScore off = ScoreLabels(field, found, {plane}, truth, "cpu").front();
      shows.Render(plane, map.data());
      bias += static_cast<double>(std::count(map.begin(), map.end(), 2)) / std::count(truth.begin(), truth.end(), 2);
      lengths += off.length * off.length / (stated.length * stated.length);
      areas += off.area * off.area / (stated.area * stated.area);
      beyond += (off.length > 2 * stated.length) + (off.area > 2 * stated.area);
      ++count;
    }
  }
  lengths = std::sqrt(lengths / count);
  areas = std::sqrt(areas / count);
  std::cout << "of what is stated, errors are (root mean square) " << lengths << " for lengths and " << areas
            << " for areas; areas are " << bias / count << " of the truth; " << beyond << " of " << 2 * count
            << " lie beyond two\n";
  // The planes of a sweep err together. The mean square of 8 normal errors is above 1.5^2 with a probability of 0.02. Half the
  // frames were held out, so what is stated is of gaps twice as wide, and may be too much; of four times it would be useless.
  EXPECT_LT(std::max(lengths, areas), 1.5);
  EXPECT_GT(std::min(lengths, areas), 0.25);
  EXPECT_LE(beyond, 7);                // of 64 normal ones with a probability of 0.98
  EXPECT_NEAR(bias / count, 1, 0.05);  // a fifth of the frames' pixels all round
}

TEST(Labels, BitsDoNotDependOnTheNumberOfThreads)
{
  const Drawn drawn = Draw(8);
  const GaussianField field = FieldOf(drawn);
  const FieldLabels two = FitLabels(field, drawn.sweep, drawn.labels, {"cpu", {}, 2});
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(FitLabels(field, drawn.sweep, drawn.labels, {"cpu", {}, 2}).weights, two.weights);
}

TEST(Labels, EmptyPicturesAreLeftOutWhereOnlySomeFramesWereDrawnOn)
{
  LabelFrames frames{{{1, "a"}}, {0, 1, 2, 3, 4, 5, 6}, {0, 1, 0, 0, 0, 1, 0}};  // of one pixel each
  EXPECT_EQ(frames.Drawn(), (std::vector<int>{1, 5}));
  frames.pixels = {0, 1, 1, 0, 1, 1, 0};
  EXPECT_EQ(frames.Drawn().size(), 7u);
  frames.pixels.assign(7, 0);
  EXPECT_EQ(frames.Drawn().size(), 7u);
}

TEST(Labels, BehindTheLastDrawnFrameALabelEndsHalfWayToTheNext)
{
  Drawn drawn = Draw(1);
  drawn.labels = {{{1, "slab"}}, {10, 14}, {}};
  drawn.labels.pixels.assign(2 * drawn.sweep.PixelsPerFrame(), 1);
  const FieldLabels found = FitLabels(FieldOf(drawn), drawn.sweep, drawn.labels, {"cpu", {}, 0});
  LabelledField shows(FieldOf(drawn), found, "cpu");
  std::vector<std::uint8_t> map(drawn.sweep.PixelsPerFrame());
  for (const auto& [frame, isThere] :
       {std::pair(9, 1), std::pair(12, 1), std::pair(15, 1), std::pair(5, 0), std::pair(19, 0)})
  {
    shows.Render(drawn.sweep.Plane(frame), map.data());
    EXPECT_EQ(map[map.size() / 2 + 50], isThere) << "frame " << frame;
  }
}

TEST(Labels, BehindTheEndsOfASweepNothingIsMadeUpOfFarTails)
{
  const Drawn drawn = Draw(1);
  const GaussianField field = Lattice({-27, -2, -6}, {27, 52, 6});  // where the sweep is, and no farther
  LabelledField shows(field, FitLabels(field, drawn.sweep, drawn.labels, {"cpu", {}, 0}), "cpu");
  for (const double z : {-11.0, -10.0, 10.0, 11.0})
  {
    SlicePlane plane;
    plane.origin = {-25, 0, z};
    plane.columnStep = {0.5, 0, 0};
    plane.rowStep = {0, 0.5, 0};
    plane.width = plane.height = 100;
    std::vector<std::uint8_t> map(plane.NumberOfPixels());
    shows.Render(plane, map.data());
    EXPECT_EQ(std::count(map.begin(), map.end(), 0), 100 * 100) << z << " mm";
  }
}

TEST(Labels, WhatDoesNotFitIsRefused)
{
  const Drawn drawn = Draw(8);
  const GaussianField field = FieldOf(drawn);
  const auto refused = [&](LabelFrames given, const std::string& words)
  {
    try
    {
      FitLabels(field, drawn.sweep, given);
      ADD_FAILURE() << "accepted: " << words;
    }
    catch (const Error& error)
    {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  LabelFrames given = drawn.labels;
  given.labels.pop_back();
  refused(given, "no label has");
  given = drawn.labels;
  given.pixels.pop_back();
  refused(given, "100 x 100");
  given = drawn.labels;
  given.frames.back() = 25;
  refused(given, "frame 25");
  given = drawn.labels;
  given.labels[0].name.clear();
  refused(given, "no name");
  given.labels = drawn.labels.labels;
  std::swap(given.labels[0], given.labels[1]);
  refused(given, "ascend");
  given = drawn.labels;
  test::Random random(4);
  for (std::uint8_t& pixel : given.pixels)
  {
    pixel = static_cast<std::uint8_t>(given.labels[static_cast<std::size_t>(random.Uniform(0, 3))].value);
  }
  refused(given, "That is a picture");
  EXPECT_THROW(FitLabels(GaussianField(), drawn.sweep, drawn.labels), Error);
  FieldLabels weights{drawn.labels.labels, std::vector<float>(4 * field.Size(), 0.5f), {}};
  weights.weights[5] = 1.5f;
  EXPECT_THROW(weights.Validate(field.Size()), Error);
  weights.weights[5] = std::nanf("");
  EXPECT_THROW(weights.Validate(field.Size()), Error);
}

}  // namespace bigus::labels_test
