// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Labels carried by a field: against closed formulas, and against what the phantom's anatomy is.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Core/Engine/ViewEngine.h"
#include "Core/Labels/LabelVolumes.h"
#include "Core/Labels/Labels.h"
#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"

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

Drawn Draw(int step)
{
  PhantomOptions options;
  options.frames = 25;
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

/// Dice of all labels together, over pixels.
double MeanDice(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b)
{
  return (Dice(a, b, 1) + Dice(a, b, 2) + Dice(a, b, 3) + Dice(a, b, 4)) / 4;
}

}  // namespace

TEST(Labels, AShareIsTheRatioOfTwoSums)
{
  const GaussianField field = Lattice({0, 0, 0}, {9, 9, 4});
  FieldLabels labels{{{7, "left"}}, {}, {}, {}};
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
  GaussianField raised = field;
  raised.reflectivities = labels.Raised(0);
  engine->SetField(raised);
  engine->SetAccuracy({0});
  std::vector<float> share(plane.NumberOfPixels());
  ShareOf(PlanesOn(*engine, ViewOutput::Scattering))({plane}, {0, 0, 14, 14}, share.data(), nullptr);

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
  }
}

TEST(Labels, WeightsThatMadePicturesAreFound)
{
  const Drawn drawn = Draw(1);
  const GaussianField field = FieldOf(drawn);
  FieldLabels made{{{1, "ball"}}, {}, {}, {}};
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
  const FieldLabels found = FitLabels(field, drawn.sweep, given, {8, "cpu"});
  LabelledField again(field, found, "cpu");
  std::vector<std::uint8_t> pictures(given.pixels.size());
  for (const int frame : given.frames)
  {
    again.Render(drawn.sweep.Plane(frame), &pictures[frame * drawn.sweep.PixelsPerFrame()]);
  }
  EXPECT_GT(Dice(pictures, given.pixels, 1), 0.99);
}

TEST(Labels, FramesBetweenAreMetBetterThanByNeighboursAndByAVolume)
{
  const Drawn all = Draw(1);
  const GaussianField field = FieldOf(all);
  const LabelFrames training = Draw(4).labels;
  std::vector<int> between;
  for (int frame = 2; frame < 24; frame += 4)
  {
    between.push_back(frame);
  }
  const FieldLabels found = FitLabels(field, all.sweep, training, {4, "cpu"});
  double ours = 0, nearest = 0, compounding = 0;
  for (const LabelScore& score : ScoreLabels(field, found, all.sweep, training, all.labels.Subset(between), "cpu"))
  {
    ours += score.field;
    nearest += score.nearest;
    compounding += score.compounding;
    // All meet the bone, a straight cylinder along the sweep, to a tenth of a pixel.
    EXPECT_GT(score.field, std::max(score.nearest, score.compounding) - 0.005) << score.label.name;
  }
  EXPECT_GT(ours / 4, nearest / 4 + 0.04);
  EXPECT_GT(ours / 4, compounding / 4 + 0.01);
}

TEST(Labels, PlanesAcrossShowTheAnatomy)
{
  const Drawn drawn = Draw(4);
  const GaussianField field = FieldOf(drawn);
  const FieldLabels found = FitLabels(field, drawn.sweep, drawn.labels, {4, "cpu"});
  LabelledField shows(field, found, "cpu");
  for (const double degrees : {30.0, 60.0, 90.0})
  {
    const double angle = degrees * 3.14159265358979323846 / 180;
    SlicePlane plane;
    plane.width = 36;
    plane.height = 90;
    plane.columnStep = 0.5 * Eigen::Vector3d(std::cos(angle), 0, std::sin(angle));
    plane.rowStep = {0, 0.5, 0};
    plane.origin = Eigen::Vector3d(0, 2, 0) - 17.5 * plane.columnStep;
    std::vector<std::uint8_t> map(plane.NumberOfPixels());
    shows.Render(plane, map.data());
    const std::vector<std::uint8_t> truth = drawn.phantom.Labels(plane);
    // A border that is off by half a pixel all round costs a shape of ten pixels a tenth.
    EXPECT_GT(MeanDice(map, truth), 0.9) << degrees << " degrees";
  }
}

TEST(Labels, VolumesLieWithinTheirStandardErrors)
{
  // An ellipsoid of half axes 6.5, 5.5 and 7 mm about (-4, 33, 3), drawn on frames of other hands, 1.5 to 2.5 mm apart.
  const double truth = 4.0 / 3 * 3.14159265358979323846 * 6.5 * 5.5 * 7;
  std::vector<double> errors;
  for (int seed = 1; seed <= 12; ++seed)
  {
    PhantomOptions options;
    options.seed = seed;
    options.width = 60;
    options.height = 60;
    options.pixelSize = 0.8;
    options.frameSpacing = 1.5 + 0.25 * (seed % 5);
    options.frames = static_cast<int>(30 / options.frameSpacing);
    options.trackingNoise = 0.2;
    const Phantom phantom(options);
    Sweep sweep;
    sweep.width = sweep.height = 60;
    auto pixels = std::make_shared<std::vector<std::uint8_t>>(sweep.PixelsPerFrame() * options.frames, 100);
    sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
    LabelFrames drawn{{{2, "cyst"}}, {}, {}};
    for (int frame = 0; frame < options.frames; ++frame)
    {
      sweep.imageToReference.push_back(phantom.RecordedPlane(frame).ImageToReference());
      drawn.frames.push_back(frame);
      for (const std::uint8_t value : phantom.Labels(phantom.TruePlane(frame)))
      {
        drawn.pixels.push_back(value == 2 ? 2 : 0);
      }
    }
    const GaussianField field = Lattice({-14, 20, -8}, {6, 45, 14});
    const FieldLabels found = FitLabels(field, sweep, drawn, {4, "cpu"});
    const LabelVolume volume = MeasureLabels(field, found, sweep, drawn, 0.2, "cpu").front();
    RecordProperty("volume" + std::to_string(seed),
                   std::to_string(volume.volume) + " " + std::to_string(volume.standardError));
    errors.push_back((volume.volume - truth) / volume.standardError);
  }
  // Of 12 normal errors, 3 or more lie beyond two sigma with a probability of 0.02.
  EXPECT_LE(std::count_if(errors.begin(), errors.end(), [](double error) { return std::abs(error) > 2; }), 2);
}

TEST(Labels, BitsDoNotDependOnTheNumberOfThreads)
{
  const Drawn drawn = Draw(8);
  const GaussianField field = FieldOf(drawn);
  const FieldLabels two = FitLabels(field, drawn.sweep, drawn.labels, {2, "cpu"});
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(FitLabels(field, drawn.sweep, drawn.labels, {2, "cpu"}).weights, two.weights);
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
  const FieldLabels found = FitLabels(FieldOf(drawn), drawn.sweep, drawn.labels, {0, "cpu"});
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
  LabelledField shows(field, FitLabels(field, drawn.sweep, drawn.labels, {0, "cpu"}), "cpu");
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
  EXPECT_THROW(FitLabels(GaussianField(), drawn.sweep, drawn.labels), Error);
  FieldLabels weights{drawn.labels.labels, std::vector<float>(4 * field.Size(), 0.5f), {}, {}};
  weights.weights[5] = 1.5f;
  EXPECT_THROW(weights.Validate(field.Size()), Error);
  weights.weights[5] = std::nanf("");
  EXPECT_THROW(weights.Validate(field.Size()), Error);
}

}  // namespace bigus::labels_test
