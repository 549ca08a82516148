// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The phantom against what it promises: speckle statistics, beam widths, anatomy, geometry, trajectory, errors.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <limits>
#include <map>
#include <ostream>
#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "Core/Phantom/Phantom.h"
#include "Support/Errors.h"

namespace bigus
{

/// For the names of tests.
void PrintTo(ProbeKind probe, std::ostream* out)
{
  *out << "probe " << static_cast<int>(probe);
}

namespace
{

using Complex = std::complex<float>;

/// An upright plane: columns along x, rows along depth, its first row centred on (0, y, z).
SlicePlane Upright(double width, double height, double pixel, double y, double z)
{
  SlicePlane plane;
  plane.width = static_cast<int>(std::lround(width / pixel)) + 1;
  plane.height = static_cast<int>(std::lround(height / pixel)) + 1;
  plane.columnStep = {pixel, 0, 0};
  plane.rowStep = {0, pixel, 0};
  plane.origin = {-0.5 * (plane.width - 1) * pixel, y, z};
  return plane;
}

std::vector<Complex> EchoOf(const Phantom& phantom, const SlicePlane& plane)
{
  std::vector<Complex> echo(plane.NumberOfPixels());
  phantom.Echo(plane, echo.data());
  return echo;
}

std::vector<std::uint8_t> FrameOf(const Phantom& phantom, const SlicePlane& plane)
{
  std::vector<std::uint8_t> frame(plane.NumberOfPixels());
  phantom.Frame(plane, frame.data());
  return frame;
}

struct Moments
{
  double n = 0, sum = 0, squares = 0;
  void Add(double v)
  {
    ++n;
    sum += v;
    squares += v * v;
  }
  double Mean() const { return sum / n; }
  double Std() const { return std::sqrt(squares / n - Mean() * Mean()); }
};

PhantomOptions Speckle(ProbeKind probe = ProbeKind::Linear)
{
  PhantomOptions options;
  options.scene = PhantomScene::Speckle;
  options.probe = probe;
  return options;
}

// Rayleigh statistics: mean / standard deviation of the envelope is sqrt(pi / (4 - pi)) = 1.913. Samples are
// taken further apart than the point-spread function reaches, so that each counts.
class SpeckleStatistics : public ::testing::TestWithParam<ProbeKind>
{
};

TEST_P(SpeckleStatistics, EnvelopeIsRayleigh)
{
  const Phantom phantom(Speckle(GetParam()));
  ASSERT_GT(phantom.ScatterersPerResolutionCell(), 10);
  Moments envelope, intensity;
  for (int k = 0; k < 12; ++k)
  {
    // Elevation profiles 6 mm apart share no scatterer that matters.
    SlicePlane plane = phantom.TruePlane(0);
    const double pixel = phantom.Options().pixelSize;
    plane.columnStep = {pixel, 0, 0};
    plane.rowStep = {0, pixel, 0};
    plane.origin = {-0.5 * (plane.width - 1) * pixel, 0, 6.0 * k};
    const auto echo = EchoOf(phantom, plane);
    const auto mask = phantom.Mask(plane);
    for (int j = 2; j < plane.height - 2; j += 4)
    {
      for (int i = 2; i < plane.width - 2; i += 7)
      {
        const std::size_t p = static_cast<std::size_t>(j) * plane.width + i;
        if (mask[p])
        {
          envelope.Add(std::abs(echo[p]));
          intensity.Add(std::norm(echo[p]));
        }
      }
    }
  }
  ASSERT_GT(envelope.n, 15000);  // standard error of the ratio below 1 %
  EXPECT_NEAR(envelope.Mean() / envelope.Std(), 1.91, 0.03 * 1.91);
  EXPECT_NEAR(intensity.Mean() / intensity.Std(), 1.0, 0.05);
  EXPECT_NEAR(intensity.Mean(), 1.0, 0.04);  // parenchyma is the unit
}

std::string ProbeTestName(const ::testing::TestParamInfo<ProbeKind>& probe)
{
  constexpr const char* names[] = {"Linear", "Convex", "Sector"};
  return names[static_cast<int>(probe.param)];
}

INSTANTIATE_TEST_SUITE_P(Probes, SpeckleStatistics,
                         ::testing::Values(ProbeKind::Linear, ProbeKind::Convex, ProbeKind::Sector), ProbeTestName);

TEST(Phantom, SpeckleDecorrelatesOutOfPlaneAsTheGaussianBeamSays)
{
  for (const double sigma : {0.3, 0.8, 2.0})
  {
    PhantomOptions options = Speckle();
    options.elevationSigma = sigma;
    const Phantom phantom(options);
    for (const double share : {0.5, 1.0, 2.0})
    {
      const double distance = share * sigma;
      std::complex<double> product = 0;
      double here = 0, there = 0;
      for (int k = 0; k < 3; ++k)
      {
        const double z = 10 * sigma * k;
        const auto a = EchoOf(phantom, Upright(40, 40, 0.4, 0, z));
        const auto b = EchoOf(phantom, Upright(40, 40, 0.4, 0, z + distance));
        for (std::size_t p = 0; p < a.size(); ++p)
        {
          product += std::complex<double>(a[p]) * std::conj(std::complex<double>(b[p]));
          here += std::norm(a[p]);
          there += std::norm(b[p]);
        }
      }
      const std::complex<double> correlation = product / std::sqrt(here * there);
      EXPECT_NEAR(correlation.real(), std::exp(-distance * distance / (4 * sigma * sigma)), 0.04)
          << "sigma " << sigma << " distance " << distance;
      EXPECT_NEAR(correlation.imag(), 0, 0.04);
    }
  }
}

// A lone point target: the envelope's second moments are the stated widths, wherever the point lies between
// the lines.
TEST(Phantom, PointTargetShowsTheStatedWidths)
{
  for (const ProbeKind probe : {ProbeKind::Linear, ProbeKind::Convex, ProbeKind::Sector})
  {
    for (const double shift : {0.0, 0.037, 0.071})
    {
      PhantomOptions options;
      options.scene = PhantomScene::Points;
      options.probe = probe;
      options.axialSigma = 0.25;
      options.lateralSigma = 0.45;
      options.elevationSigma = 0.7;
      const Phantom phantom(options);
      // The first row at y = -shift for a linear probe. A fan is centred on x = 0: there range runs along y.
      const double pixel = 0.04;
      SlicePlane plane = Upright(6, 28, pixel, -shift, 0);
      plane.origin[0] += shift;
      const auto echo = EchoOf(phantom, plane);

      double sum = 0, xx = 0, yy = 0, x1 = 0, y1 = 0, peak = 0;
      for (int j = 0; j < plane.height; ++j)
      {
        for (int i = 0; i < plane.width; ++i)
        {
          const Eigen::Vector3d at = plane.Point(i, j) - Eigen::Vector3d(0, 25, 0);
          if (std::abs(at[1]) > 2)
          {
            continue;
          }
          const double envelope = std::abs(echo[static_cast<std::size_t>(j) * plane.width + i]);
          sum += envelope;
          x1 += envelope * at[0];
          y1 += envelope * at[1];
          xx += envelope * at[0] * at[0];
          yy += envelope * at[1] * at[1];
          peak = std::max(peak, envelope);
        }
      }
      EXPECT_NEAR(peak, 10, 0.45);  // +20 dB, to 0.4 dB
      EXPECT_NEAR(x1 / sum, 0, 0.01);
      EXPECT_NEAR(y1 / sum, 0, 0.01);
      EXPECT_NEAR(std::sqrt(xx / sum), 0.45, 0.015 * 0.45) << "lateral, probe " << static_cast<int>(probe);
      EXPECT_NEAR(std::sqrt(yy / sum), 0.25, 0.015 * 0.25) << "axial, probe " << static_cast<int>(probe);
    }
  }
}

// In a fan the profile turns with the lines: off the axis it is measured along and across the beam.
TEST(Phantom, PointSpreadTurnsWithTheLinesOfAFan)
{
  PhantomOptions options;
  options.scene = PhantomScene::Points;
  options.probe = ProbeKind::Sector;
  const Phantom phantom(options);
  const SlicePlane plane = Upright(50, 30, 0.05, 0, 0);
  const auto echo = EchoOf(phantom, plane);
  const Eigen::Vector3d target(20, 25, 0);
  const Eigen::Vector3d apex(
      0, -phantom.Options().probeRadius * std::cos(phantom.Options().halfAngle * kRadiansPerDegree), 0);
  const Eigen::Vector3d beam = (target - apex).normalized(), across(beam[1], -beam[0], 0);
  double sum = 0, along2 = 0, across2 = 0, mixed = 0;
  for (std::size_t p = 0; p < echo.size(); ++p)
  {
    const Eigen::Vector3d at = plane.Point(p % plane.width, p / plane.width) - target;
    if (at.norm() < 3)
    {
      const double envelope = std::abs(echo[p]);
      sum += envelope;
      along2 += envelope * std::pow(at.dot(beam), 2);
      across2 += envelope * std::pow(at.dot(across), 2);
      mixed += envelope * at.dot(across) * at.dot(beam);
    }
  }
  EXPECT_NEAR(std::sqrt(along2 / sum), options.axialSigma, 0.02 * options.axialSigma);
  EXPECT_NEAR(std::sqrt(across2 / sum), options.lateralSigma, 0.02 * options.lateralSigma);
  EXPECT_NEAR(mixed / sum, 0, 0.02 * options.axialSigma * options.lateralSigma);
}

TEST(Phantom, PointTargetFadesOutOfPlaneWithTheKnownElevationSigma)
{
  for (const double sigma : {0.3, 0.6, 1.0})  // points stand 10 mm apart: a wider beam would see two at once
  {
    PhantomOptions options;
    options.scene = PhantomScene::Points;
    options.elevationSigma = sigma;
    const Phantom phantom(options);
    const auto envelopeAt = [&](double z)
    {
      const SlicePlane plane = Upright(2, 10, 0.2, 0, z);
      return std::abs(EchoOf(phantom, plane)[25 * static_cast<std::size_t>(plane.width) + plane.width / 2]);
    };
    const double peak = envelopeAt(0);
    double sum = 0, zz = 0;
    for (int k = -16; k <= 16; ++k)
    {
      const double z = 0.25 * sigma * k;
      const double envelope = envelopeAt(z);
      ASSERT_NEAR(envelope / peak, std::exp(-0.5 * z * z / (sigma * sigma)), 1e-4) << "z " << z;
      sum += envelope;
      zz += envelope * z * z;
    }
    EXPECT_NEAR(std::sqrt(zz / sum), sigma, 0.002 * sigma);
  }
}

// The carrier: moving the plane half a wavelength / 2 along the beam turns the phase of a point's echo by 2 pi.
TEST(Phantom, CarrierTurnsTheStatedNumberOfTimes)
{
  PhantomOptions options;
  options.scene = PhantomScene::Points;
  options.frequency = 4;
  const Phantom phantom(options);
  const double wavelength = 1.54 / 4;
  const auto echoAt = [&](double shift)
  {
    const SlicePlane plane = Upright(2, 10, 0.2, shift, 0);
    return EchoOf(phantom, plane)[25 * static_cast<std::size_t>(plane.width) + plane.width / 2];
  };
  const std::complex<double> start = echoAt(0), eighth = echoAt(wavelength / 8), half = echoAt(wavelength / 2);
  EXPECT_NEAR(std::arg(eighth / start), kPi / 2, 1e-3);  // the point comes nearer by a quarter turn both ways
  EXPECT_NEAR(std::arg(half / start), 0, 1e-3);
}

TEST(Phantom, SameBitsForAnyNumberOfThreads)
{
  PhantomOptions options;
  options.frames = 5;
  options.width = 96;
  options.height = 96;
  options.pixelSize = 0.3;
  for (const ProbeKind probe : {ProbeKind::Linear, ProbeKind::Convex})
  {
    options.probe = probe;
    const Phantom phantom(options);
    std::vector<std::vector<std::uint8_t>> results;
    for (const std::size_t threads : {1, 2, 3})
    {
      tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
      const Sweep sweep = phantom.MakeSweep();
      const auto* pixels = static_cast<const std::uint8_t*>(sweep.pixels.get());
      results.emplace_back(pixels, pixels + sweep.NumberOfFrames() * sweep.PixelsPerFrame());
    }
    EXPECT_EQ(results[0], results[1]);
    EXPECT_EQ(results[0], results[2]);
  }
}

TEST(Phantom, SeedChangesScatterersAndHandButNotAnatomy)
{
  PhantomOptions options;
  options.frames = 3;
  const Phantom one(options), again(options);
  options.seed = 2;
  const Phantom two(options);
  const SlicePlane plane = Upright(20, 20, 0.4, 10, 0);
  EXPECT_EQ(FrameOf(one, plane), FrameOf(again, plane));
  EXPECT_NE(FrameOf(one, plane), FrameOf(two, plane));
  EXPECT_EQ(one.TruePlane(1).ImageToReference(), again.TruePlane(1).ImageToReference());
  EXPECT_NE(one.TruePlane(1).ImageToReference(), two.TruePlane(1).ImageToReference());
  EXPECT_EQ(one.TissueAt({-4, 33, 3}), Tissue::Cyst);
  EXPECT_EQ(two.TissueAt({-4, 33, 3}), Tissue::Cyst);
}

TEST(Phantom, AFrameOfTheSweepIsTheTruthAtItsTruePose)
{
  for (const ProbeKind probe : {ProbeKind::Linear, ProbeKind::Convex, ProbeKind::Sector})
  {
    PhantomOptions options;
    options.probe = probe;
    options.frames = 4;
    options.width = 120;
    options.height = 80;
    options.pixelSize = 0.3;
    options.trackingNoise = 0.5;
    options.trackingRotationNoise = 1;
    const Phantom phantom(options);
    const Sweep sweep = phantom.MakeSweep();
    EXPECT_NO_THROW(sweep.Validate());
    ASSERT_EQ(sweep.NumberOfFrames(), 4);
    ASSERT_EQ(sweep.timestamps.size(), 4u);
    EXPECT_DOUBLE_EQ(sweep.timestamps[3], 3 / options.frameRate);
    for (int k = 0; k < 4; ++k)
    {
      // Through a matrix and back, as a user of truth(plane) would hand it in.
      const SlicePlane plane =
          SlicePlane::FromImageToReference(phantom.TruePlane(k).ImageToReference(), sweep.width, sweep.height);
      const auto truth = FrameOf(phantom, plane);
      const auto* frame = static_cast<const std::uint8_t*>(sweep.pixels.get()) + k * sweep.PixelsPerFrame();
      EXPECT_TRUE(std::equal(truth.begin(), truth.end(), frame)) << "frame " << k;
      EXPECT_EQ(sweep.imageToReference[k], phantom.RecordedPlane(k).ImageToReference());
      EXPECT_NE(sweep.imageToReference[k], phantom.TruePlane(k).ImageToReference());
    }
    const Sweep one = phantom.MakeTruth(phantom.TruePlane(2));
    EXPECT_NO_THROW(one.Validate());
    EXPECT_TRUE(std::equal(static_cast<const std::uint8_t*>(one.pixels.get()),
                           static_cast<const std::uint8_t*>(one.pixels.get()) + one.PixelsPerFrame(),
                           static_cast<const std::uint8_t*>(sweep.pixels.get()) + 2 * sweep.PixelsPerFrame()));
    EXPECT_EQ(one.mask != nullptr, probe != ProbeKind::Linear);
  }
}

// Pixels are places: a plane with half the pixels of twice the size shows every second pixel of the other.
TEST(Phantom, TruthDependsOnPlacesNotOnTheGridThatAsks)
{
  for (const ProbeKind probe : {ProbeKind::Linear, ProbeKind::Sector})
  {
    PhantomOptions options;
    options.probe = probe;
    const Phantom phantom(options);
    const SlicePlane fine = Upright(40, 40, 0.25, 0, 2), coarse = Upright(40, 40, 0.5, 0, 2);
    const auto a = EchoOf(phantom, fine), b = EchoOf(phantom, coarse);
    for (int j = 0; j < coarse.height; ++j)
    {
      for (int i = 0; i < coarse.width; ++i)
      {
        const Complex expected = a[static_cast<std::size_t>(2 * j) * fine.width + 2 * i];
        const Complex found = b[static_cast<std::size_t>(j) * coarse.width + i];
        ASSERT_LT(std::abs(expected - found), 1e-3 * (1 + std::abs(expected))) << i << ", " << j;
      }
    }
  }
}

// Echo levels (dB) by tissue, over a stack of upright planes; tissues are told by TissueAt away from their
// borders.
TEST(Phantom, TissuesEchoAsTheyShould)
{
  const Phantom phantom{PhantomOptions()};
  std::map<Tissue, Moments> intensity;
  Moments shadow;
  for (int k = -6; k <= 6; ++k)
  {
    const SlicePlane plane = Upright(46, 46, 0.25, 0, 2.0 * k);
    const auto echo = EchoOf(phantom, plane);
    for (int j = 0; j < plane.height; ++j)
    {
      for (int i = 0; i < plane.width; ++i)
      {
        const double value = std::norm(echo[static_cast<std::size_t>(j) * plane.width + i]);
        const Eigen::Vector3d at = plane.Point(i, j);
        const Tissue tissue = phantom.TissueAt(at);
        bool inside = true;
        for (int axis = 0; axis < 3; ++axis)
        {
          // Three standard deviations of the profile: what leaks in from brighter neighbours is gone.
          const double reach[3] = {1.4, 0.7, 2.4};
          for (const double sign : {-1.0, 1.0})
          {
            inside = inside && phantom.TissueAt(at + sign * reach[axis] * Eigen::Vector3d::Unit(axis)) == tissue;
          }
        }
        if (tissue == Tissue::Boundary && at[1] < 11.3)
        {
          intensity[tissue].Add(value);
        }
        else if (inside && (tissue != Tissue::Parenchyma || (at[0] > 5 && at[1] < 10)))
        {
          intensity[tissue].Add(value);  // parenchyma: where nothing above it attenuates differently
        }
        if (at[1] > 22 && std::abs(at[0] + 17) < 1.5)
        {
          shadow.Add(value);
        }
      }
    }
  }
  const auto level = [&](Tissue tissue) { return 10 * std::log10(intensity.at(tissue).Mean() + 1e-12); };
  for (const Tissue tissue : {Tissue::Parenchyma, Tissue::Vessel, Tissue::Cyst, Tissue::Boundary, Tissue::Tumour})
  {
    ASSERT_GT(intensity[tissue].n, 50) << static_cast<int>(tissue);
  }
  const double parenchyma = level(Tissue::Parenchyma);
  EXPECT_NEAR(parenchyma, 0, 1);
  EXPECT_LT(level(Tissue::Vessel), parenchyma - 15);
  EXPECT_LT(level(Tissue::Cyst), parenchyma - 30);
  EXPECT_GT(level(Tissue::Boundary), parenchyma + 8);
  EXPECT_NEAR(level(Tissue::Tumour), parenchyma + 6.7, 2);
  EXPECT_LT(10 * std::log10(shadow.Mean()), parenchyma - 20);
}

TEST(Phantom, FluidBrightensWhatLiesBehindIt)
{
  const Phantom phantom{PhantomOptions()};
  Moments behind, beside;
  for (int k = -2; k <= 2; ++k)
  {
    const SlicePlane plane = Upright(46, 46, 0.25, 0, 3 + k);
    const auto echo = EchoOf(phantom, plane);
    for (int j = 0; j < plane.height; ++j)
    {
      for (int i = 0; i < plane.width; ++i)
      {
        const Eigen::Vector3d at = plane.Point(i, j);
        if (phantom.TissueAt(at) == Tissue::Parenchyma && at[1] > 40 && at[1] < 42)
        {
          const double value = std::norm(echo[static_cast<std::size_t>(j) * plane.width + i]);
          if (std::abs(at[0] + 4) < 3)
          {
            behind.Add(value);
          }
          else if (at[0] > 3.5 && at[0] < 6.5)
          {
            beside.Add(value);
          }
        }
      }
    }
  }
  EXPECT_GT(behind.Mean(), 1.8 * beside.Mean());  // 10 mm of fluid spare 5 dB
}

TEST(Phantom, GreyLevelsFollowTheStatedDynamicRange)
{
  PhantomOptions options = Speckle();
  options.dynamicRange = 40;
  options.whiteLevel = 10;
  const Phantom phantom(options);
  const SlicePlane plane = Upright(20, 20, 0.2, 0, 0);
  const auto echo = EchoOf(phantom, plane);
  const auto frame = FrameOf(phantom, plane);
  for (std::size_t p = 0; p < frame.size(); ++p)
  {
    const double decibels = 20 * std::log10(std::abs(std::complex<double>(echo[p])) + 1e-30) - 10;
    const double expected = 255 * std::min(1.0, std::max(0.0, 1 + decibels / 40));
    ASSERT_NEAR(frame[p], expected, 0.501);
  }
}

TEST(Phantom, NothingIsLitOutsideTheFan)
{
  for (const ProbeKind probe : {ProbeKind::Convex, ProbeKind::Sector})
  {
    PhantomOptions options = Speckle(probe);
    options.frames = 1;
    options.tilt = 0;
    options.wander = 0;
    const Phantom phantom(options);
    const Sweep sweep = phantom.MakeSweep();
    const auto* pixels = static_cast<const std::uint8_t*>(sweep.pixels.get());
    ASSERT_TRUE(sweep.mask);
    const double radius = phantom.Options().probeRadius, half = phantom.Options().halfAngle * kRadiansPerDegree;
    const double apex = -radius * std::cos(half), last = 255 * 0.2 - apex;
    std::size_t lit = 0, dark = 0;
    for (int j = 0; j < sweep.height; ++j)
    {
      for (int i = 0; i < sweep.width; ++i)
      {
        const std::size_t p = static_cast<std::size_t>(j) * sweep.width + i;
        const double x = (i - 0.5 * (sweep.width - 1)) * 0.2, y = j * 0.2 - apex;
        const double range = std::hypot(x, y), angle = std::abs(std::atan2(x, y));
        if (range < radius - 0.01 || range > last + 0.01 || angle > half + 1e-3)
        {
          ASSERT_EQ((*sweep.mask)[p], 0);
          ASSERT_EQ(pixels[p], 0);
          ++dark;
        }
        else if (range > radius + 0.01 && range < last - 0.01 && angle < half - 1e-3)
        {
          ASSERT_EQ((*sweep.mask)[p], 1);
          lit += pixels[p] > 0;
        }
      }
    }
    EXPECT_GT(lit, sweep.PixelsPerFrame() / 3);
    EXPECT_GT(dark, sweep.PixelsPerFrame() / 5);
  }
  EXPECT_FALSE(Phantom(Speckle()).MakeTruth(Upright(5, 5, 0.2, 0, 0)).mask);
}

TEST(Phantom, TrajectoryTravelsUnevenlyAndTilts)
{
  PhantomOptions options;
  options.frames = 400;
  const Phantom phantom(options);
  std::vector<Eigen::Vector3d> faces;
  double steepest = 0;
  for (int k = 0; k < 400; ++k)
  {
    const SlicePlane plane = phantom.TruePlane(k);
    EXPECT_EQ(plane.ImageToReference(), phantom.RecordedPlane(k).ImageToReference());
    EXPECT_NEAR(plane.columnStep.norm(), 0.2, 1e-12);
    EXPECT_NEAR(plane.rowStep.norm(), 0.2, 1e-12);
    EXPECT_NEAR(plane.columnStep.dot(plane.rowStep), 0, 1e-12);
    faces.push_back(plane.Point(127.5, 0));
    steepest = std::max(steepest, std::acos(std::min(1.0, plane.Normal()[2])) / kRadiansPerDegree);
    EXPECT_LE(std::abs(faces.back()[0]), 0.5);
    EXPECT_LE(std::abs(faces.back()[1]), 0.5);
  }
  EXPECT_GT(steepest, 1);
  EXPECT_LT(steepest, 3 * std::sqrt(2.0) + 0.1);
  EXPECT_NEAR(faces.back()[2] - faces.front()[2], 399 * 0.5, 1e-9);
  EXPECT_NEAR(faces.back()[2], -faces.front()[2], 1e-9);
  Moments spacing;
  for (int k = 1; k < 400; ++k)
  {
    const double step = faces[k][2] - faces[k - 1][2];
    EXPECT_GT(step, 0);
    spacing.Add(step);
  }
  EXPECT_NEAR(spacing.Mean(), 0.5, 1e-9);
  EXPECT_GT(spacing.Std(), 0.05);

  options.sweepAngle = 90;  // +z turns to +x
  const Phantom crossing(options);
  for (const int k : {0, 123, 399})
  {
    const Eigen::Vector3d face = crossing.TruePlane(k).Point(127.5, 0);
    EXPECT_LT((face - Eigen::Vector3d(faces[k][2], faces[k][1], -faces[k][0])).norm(), 1e-9);
  }
}

TEST(Phantom, TrackingNoiseHasTheStatedSize)
{
  PhantomOptions options;
  options.frames = 3000;
  options.trackingNoise = 0.4;
  options.trackingRotationNoise = 0.7;
  const Phantom phantom(options);
  Moments shift, turn;
  double lagged = 0;
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  for (int k = 0; k < options.frames; ++k)
  {
    const SlicePlane actual = phantom.TruePlane(k), recorded = phantom.RecordedPlane(k);
    const Eigen::Vector3d offset = recorded.Point(127.5, 0) - actual.Point(127.5, 0);
    Eigen::Matrix3d a, r;
    a << actual.columnStep.normalized(), actual.rowStep.normalized(), actual.Normal();
    r << recorded.columnStep.normalized(), recorded.rowStep.normalized(), recorded.Normal();
    const Eigen::AngleAxisd rotation(r * a.transpose());
    for (int axis = 0; axis < 3; ++axis)
    {
      shift.Add(offset[axis]);
      turn.Add(rotation.angle() * rotation.axis()[axis] / kRadiansPerDegree);
    }
    lagged += offset.dot(before);
    before = offset;
  }
  // 9000 numbers: standard error 0.75 % of the standard deviation, 1.1 % on the mean; four of them allowed.
  EXPECT_NEAR(shift.Std(), 0.4, 0.03 * 0.4);
  EXPECT_NEAR(turn.Std(), 0.7, 0.03 * 0.7);
  EXPECT_NEAR(shift.Mean(), 0, 0.045 * 0.4);
  EXPECT_NEAR(turn.Mean(), 0, 0.045 * 0.7);
  EXPECT_NEAR(lagged / shift.squares, 0, 0.045);
}

// ---- Errors of the tracker ----

/// Poses only: what is asked for here needs no picture.
PhantomOptions Tracked(int frames)
{
  PhantomOptions options;
  options.frames = frames;
  return options;
}

/// Of one pose from another: where the middle of the image's first row is shown, and how it is turned.
struct Displacement
{
  Eigen::Vector3d shift;     // mm
  Eigen::Vector3d rotation;  // degrees
};
Displacement Between(const SlicePlane& actual, const SlicePlane& recorded)
{
  Eigen::Matrix3d a, r;
  a << actual.columnStep.normalized(), actual.rowStep.normalized(), actual.Normal();
  r << recorded.columnStep.normalized(), recorded.rowStep.normalized(), recorded.Normal();
  const Eigen::AngleAxisd turn(r * a.transpose());
  return {recorded.Point(127.5, 0) - actual.Point(127.5, 0), turn.angle() / kRadiansPerDegree * turn.axis()};
}

/// Of the recorded pose from the true one.
Displacement DisplacementOf(const Phantom& phantom, int k)
{
  return Between(phantom.TruePlane(k), phantom.RecordedPlane(k));
}

// Written down when the tracker had no error but noise: what was added since changes nothing until it is asked for.
TEST(Phantom, PosesWithoutFurtherErrorsAreAsTheyWere)
{
  PhantomOptions options = Tracked(12);
  options.width = options.height = 64;
  options.trackingNoise = 0.3;
  options.trackingRotationNoise = 0.5;
  options.sweepAngle = 37;
  Eigen::Matrix4d recorded;
  recorded << 0.15852364751372716, -0.0034713989488682033, 0.6094711348431805, -5.508541485915422,  //
      0.005380856343372943, 0.19992334867194803, -0.006521197755565119, -0.1931728294274002,        //
      -0.12182487251770698, 0.004313240676394146, 0.7927814388422565, 4.180114515002121,            //
      0, 0, 0, 1;
  EXPECT_LT((Phantom(options).RecordedPlane(7).ImageToReference() - recorded).cwiseAbs().maxCoeff(), 1e-13);
}

TEST(Phantom, NoiseIsCorrelatedOverAsManyFramesAsAskedFor)
{
  PhantomOptions options = Tracked(4000);
  options.trackingNoise = 0.3;
  options.noiseCorrelation = 5;
  const Phantom phantom(options);
  std::vector<double> shift;
  for (int k = 0; k < options.frames; ++k)
  {
    shift.push_back(DisplacementOf(phantom, k).shift[1]);
  }
  const auto product = [&shift](int apart)
  {
    double sum = 0;
    for (std::size_t k = apart; k < shift.size(); ++k)
    {
      sum += shift[k] * shift[k - apart];
    }
    return sum / static_cast<double>(shift.size() - apart);
  };
  // 4000 frames count as 4000 (1 - r) / (1 + r) = 400 independent ones: three errors of a variance of 0.09 and of a
  // correlation are 0.02 and 0.15.
  EXPECT_NEAR(product(0), 0.09, 0.02);
  EXPECT_NEAR(product(1) / product(0), std::exp(-0.2), 0.03);
  EXPECT_NEAR(product(5) / product(0), std::exp(-1.0), 0.15);
  // As strong from the first frame on.
  Moments first;
  options.frames = 1;
  for (options.seed = 1; options.seed <= 400; ++options.seed)
  {
    const Phantom one(options);
    for (int axis = 0; axis < 3; ++axis)
    {
      first.Add(DisplacementOf(one, 0).shift[axis]);
    }
  }
  EXPECT_NEAR(first.Std(), 0.3, 0.02);
}

// A probe that shakes is where its pictures are taken, and the tracker says so.
TEST(Phantom, AShakingProbeIsSeenAndTracked)
{
  PhantomOptions still = Tracked(2000), shaking = still;
  shaking.shake = 0.3;
  shaking.shakeRotation = 0.5;
  shaking.shakeCorrelation = 5;
  const Phantom a(still), b(shaking);
  std::vector<double> shifts;
  Moments turns;
  for (int k = 0; k < still.frames; ++k)
  {
    EXPECT_EQ(b.TruePlane(k).ImageToReference(), b.RecordedPlane(k).ImageToReference());
    const Displacement shake = Between(a.TruePlane(k), b.TruePlane(k));
    shifts.push_back(shake.shift[1]);
    turns.Add(shake.rotation[0]);
  }
  double square = 0, next = 0;
  for (int k = 1; k < still.frames; ++k)
  {
    square += shifts[k] * shifts[k];
    next += shifts[k] * shifts[k - 1];
  }
  // 2000 pictures count as 200 independent ones: three errors of a standard deviation are 15 %.
  EXPECT_NEAR(std::sqrt(square / still.frames), 0.3, 0.045);
  EXPECT_NEAR(turns.Std(), 0.5, 0.075);
  EXPECT_NEAR(next / square, std::exp(-0.2), 0.05);
  // Poses that lag behind are those of another time of the same shaking.
  shaking.trackingDelay = 2 / shaking.frameRate;
  const Phantom late(shaking);
  EXPECT_LT((late.RecordedPlane(9).ImageToReference() - b.TruePlane(7).ImageToReference()).cwiseAbs().maxCoeff(),
            1e-12);
}

TEST(Phantom, DriftIsSlowAndKeepsItsBounds)
{
  PhantomOptions options = Tracked(400);
  options.trackingDrift = 3;
  options.trackingRotationDrift = 2;
  const Phantom phantom(options);
  Moments shift, turn;
  Displacement before = DisplacementOf(phantom, 0);
  for (int k = 1; k < options.frames; ++k)
  {
    const Displacement here = DisplacementOf(phantom, k);
    for (int axis = 0; axis < 3; ++axis)
    {
      ASSERT_LE(std::abs(here.shift[axis]), 3);
      // Small angles only nearly add up, axis by axis.
      ASSERT_LE(std::abs(here.rotation[axis]), 2 * 1.01);
      shift.Add(here.shift[axis]);
      turn.Add(here.rotation[axis]);
      // The fastest of the sines has one and a half periods in the sweep: 2 pi 1.5 / 400 of the bound in a frame.
      ASSERT_LE(std::abs(here.shift[axis] - before.shift[axis]), 3 * 0.024);
      ASSERT_LE(std::abs(here.rotation[axis] - before.rotation[axis]), 2 * 0.025);
    }
    before = here;
  }
  EXPECT_GT(shift.Std(), 0.5);
  EXPECT_GT(turn.Std(), 0.3);
}

TEST(Phantom, OutliersAreAsManyAndAsFarOffAsAskedFor)
{
  PhantomOptions options = Tracked(200);
  options.outlierShare = 0.05;
  options.outlierSize = 3;
  const Phantom phantom(options);
  int outliers = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int k = 0; k < options.frames; ++k)
  {
    const Displacement error = DisplacementOf(phantom, k);
    EXPECT_NEAR(error.rotation.norm(), 0, 1e-5);
    if (error.shift.norm() > 1e-9)
    {
      EXPECT_NEAR(error.shift.norm(), 3, 1e-9);
      mean += error.shift / 10;
      ++outliers;
    }
  }
  EXPECT_EQ(outliers, 10);
  EXPECT_LT(mean.norm(), 2);  // not all on one side
}

TEST(Phantom, ADelayShowsEarlierPoses)
{
  PhantomOptions options = Tracked(40);
  options.trackingDelay = 3 / options.frameRate;
  const Phantom late(options);
  for (int k = 3; k < options.frames; ++k)
  {
    EXPECT_LT((late.RecordedPlane(k).ImageToReference() - late.TruePlane(k - 3).ImageToReference()).norm(), 1e-9);
  }
  EXPECT_GT((late.RecordedPlane(0).origin - late.TruePlane(0).origin).norm(), 0.5);  // the hand moved before, too
  options.trackingDelay = -2.5 / options.frameRate;
  const Phantom early(options);
  for (int k = 3; k < options.frames - 4; ++k)
  {
    // Half way between two pictures: within what a path with these accelerations bends.
    const Eigen::Vector3d between = 0.5 * (early.TruePlane(k + 2).origin + early.TruePlane(k + 3).origin);
    EXPECT_LT((early.RecordedPlane(k).origin - between).norm(), 0.02);
  }
}

TEST(Phantom, QuantisedPosesAreMultiples)
{
  PhantomOptions options = Tracked(50);
  options.trackingQuantum = 0.25;
  options.trackingRotationQuantum = 0.5;
  const Phantom phantom(options);
  for (int k = 0; k < options.frames; ++k)
  {
    const SlicePlane recorded = phantom.RecordedPlane(k);
    Eigen::Matrix3d axes;
    axes << recorded.columnStep.normalized(), recorded.rowStep.normalized(), recorded.Normal();
    const Eigen::AngleAxisd turn(axes);
    const Eigen::Vector3d position = recorded.Point(127.5, 0) / 0.25;
    const Eigen::Vector3d rotation = turn.angle() / kRadiansPerDegree * turn.axis() / 0.5;
    for (int axis = 0; axis < 3; ++axis)
    {
      EXPECT_NEAR(position[axis], std::round(position[axis]), 1e-6);
      EXPECT_NEAR(rotation[axis], std::round(rotation[axis]), 1e-6);
    }
    const Displacement error = DisplacementOf(phantom, k);
    EXPECT_LE(error.shift.cwiseAbs().maxCoeff(), 0.125 + 1e-9);
    EXPECT_LE(error.rotation.cwiseAbs().maxCoeff(), 0.26);
  }
}

TEST(Phantom, DroppedFramesLeaveGapsInTheTimestamps)
{
  PhantomOptions options = Tracked(300);
  options.droppedShare = 0.25;
  const Phantom phantom(options);
  ASSERT_EQ(phantom.Timestamps().size(), 300u);
  int longest = 0;
  for (int k = 1; k < options.frames; ++k)
  {
    const double pictures = (phantom.Timestamps()[k] - phantom.Timestamps()[k - 1]) * options.frameRate;
    EXPECT_NEAR(pictures, std::round(pictures), 1e-6);
    EXPECT_GE(pictures, 0.99);
    longest = std::max(longest, static_cast<int>(std::lround(pictures)));
  }
  EXPECT_GE(longest, 2);
  const double taken = phantom.Timestamps().back() * options.frameRate + 1;
  EXPECT_NEAR(1 - 300 / taken, 0.25, 0.08);  // standard error 0.022
  const double path = phantom.TruePlane(299).Point(127.5, 0)[2] - phantom.TruePlane(0).Point(127.5, 0)[2];
  EXPECT_NEAR(path, (taken - 1) * options.frameSpacing, 1e-6);  // the hand goes on while pictures are lost
}

TEST(Phantom, AStepperTakesEqualSteps)
{
  PhantomOptions options = Tracked(60);
  options.speedVariation = options.tilt = options.wander = 0;
  const Phantom phantom(options);
  for (int k = 1; k < options.frames; ++k)
  {
    const SlicePlane here = phantom.RecordedPlane(k), before = phantom.RecordedPlane(k - 1);
    EXPECT_EQ(here.origin - before.origin, Eigen::Vector3d(0, 0, 0.5));
    EXPECT_EQ(here.columnStep, before.columnStep);
    EXPECT_EQ(here.rowStep, before.rowStep);
  }
}

TEST(Phantom, SeveralPassesGoThereAndBack)
{
  PhantomOptions options = Tracked(91);
  options.passes = 3;
  options.speedVariation = 0;
  const Phantom phantom(options);
  const auto z = [&](int k) { return phantom.TruePlane(k).Point(127.5, 0)[2]; };
  EXPECT_NEAR(z(0), -7.5, 1e-9);  // a third of 90 steps of 0.5 mm is a pass
  EXPECT_NEAR(z(30), 7.5, 1e-9);
  EXPECT_NEAR(z(60), -7.5, 1e-9);
  EXPECT_NEAR(z(90), 7.5, 1e-9);
  for (int k = 1; k <= 30; ++k)
  {
    EXPECT_GT(z(k), z(k - 1));
    EXPECT_LT(z(30 + k), z(30 + k - 1));
    EXPECT_LT(std::abs(z(k) - z(k - 1)), 0.5 * kPi / 2 + 1e-9);  // a cosine is at most so much faster than its mean
  }
}

TEST(Phantom, ACalibrationErrorIsTheSameMotionOfTheImageInEveryFrame)
{
  PhantomOptions options = Tracked(30);
  options.tilt = 20;
  options.width = 101;
  options.height = 61;
  options.calibrationShift = {1, -2, 0.5};
  options.calibrationRotation = {0, 0, 90 / 4.0};
  const Phantom phantom(options);
  const double c = std::cos(kPi / 8), s = std::sin(kPi / 8);
  for (int k = 0; k < options.frames; ++k)
  {
    const SlicePlane actual = phantom.TruePlane(k), recorded = phantom.RecordedPlane(k);
    // Turned about the normal through the centre (10 mm across and 6 mm down), then moved along the image's axes.
    const Eigen::Vector3d x = actual.columnStep.normalized(), y = actual.rowStep.normalized();
    const Eigen::Vector3d centre = actual.Point(50, 30) + x - 2 * y + 0.5 * actual.Normal();
    EXPECT_LT((recorded.Point(50, 30) - centre).norm(), 1e-9);
    EXPECT_LT((recorded.columnStep - 0.2 * (c * x + s * y)).norm(), 1e-9);
    EXPECT_LT((recorded.rowStep - 0.2 * (c * y - s * x)).norm(), 1e-9);
  }
}

TEST(Phantom, StopsWhenAskedTo)
{
  PhantomOptions options;
  options.frames = 50;
  options.width = 32;
  options.height = 32;
  const Phantom phantom(options);
  std::vector<double> shares;
  const Sweep none = phantom.MakeSweep(
      [&](double share)
      {
        shares.push_back(share);
        return share < 0.3;
      });
  EXPECT_EQ(none.NumberOfFrames(), 0);
  EXPECT_GE(shares.back(), 0.3);
  EXPECT_LT(shares.back(), 1.0);
}

TEST(Phantom, OptionsOutOfRangeAreNamed)
{
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto message = [](auto&& change) -> std::string
  {
    PhantomOptions options;
    options.probe = ProbeKind::Convex;
    change(options);
    return bigus::test::Message([&] { Phantom phantom(options); });
  };
  EXPECT_EQ(message([](PhantomOptions&) {}), "");
  const auto nameOf = [](const std::string& member) { return member.substr(0, member.find('[')); };
#define BIGUS_EXPECT_NAMED(member, value)                                                                   \
  EXPECT_NE(message([&](PhantomOptions& o) { o.member = value; }).find(nameOf(#member)), std::string::npos) \
      << #member << " = " << value
  BIGUS_EXPECT_NAMED(frames, 0);
  BIGUS_EXPECT_NAMED(frames, 100001);
  BIGUS_EXPECT_NAMED(width, -5);
  BIGUS_EXPECT_NAMED(width, 100000);
  BIGUS_EXPECT_NAMED(height, 0);
  BIGUS_EXPECT_NAMED(pixelSize, 0);
  BIGUS_EXPECT_NAMED(pixelSize, nan);
  BIGUS_EXPECT_NAMED(probeRadius, 1);
  BIGUS_EXPECT_NAMED(halfAngle, 90);
  BIGUS_EXPECT_NAMED(frequency, 0);
  BIGUS_EXPECT_NAMED(axialSigma, 0);
  BIGUS_EXPECT_NAMED(lateralSigma, 100);
  BIGUS_EXPECT_NAMED(elevationSigma, 0);
  BIGUS_EXPECT_NAMED(elevationSigma, nan);
  BIGUS_EXPECT_NAMED(scattererDensity, 0);
  BIGUS_EXPECT_NAMED(attenuation, -1);
  BIGUS_EXPECT_NAMED(dynamicRange, 0);
  BIGUS_EXPECT_NAMED(whiteLevel, 1000);
  BIGUS_EXPECT_NAMED(frameSpacing, -1);
  BIGUS_EXPECT_NAMED(speedVariation, 1);
  BIGUS_EXPECT_NAMED(tilt, 90);
  BIGUS_EXPECT_NAMED(wander, -0.1);
  BIGUS_EXPECT_NAMED(sweepAngle, nan);
  BIGUS_EXPECT_NAMED(shake, 11);
  BIGUS_EXPECT_NAMED(shakeRotation, -1);
  BIGUS_EXPECT_NAMED(shakeCorrelation, nan);
  BIGUS_EXPECT_NAMED(frameRate, 0);
  BIGUS_EXPECT_NAMED(trackingNoise, -1);
  BIGUS_EXPECT_NAMED(trackingRotationNoise, 21);
  BIGUS_EXPECT_NAMED(passes, 0);
  BIGUS_EXPECT_NAMED(droppedShare, 1);
  BIGUS_EXPECT_NAMED(noiseCorrelation, -1);
  BIGUS_EXPECT_NAMED(trackingDrift, -1);
  BIGUS_EXPECT_NAMED(trackingRotationDrift, nan);
  BIGUS_EXPECT_NAMED(outlierShare, 0.6);
  BIGUS_EXPECT_NAMED(outlierSize, -1);
  BIGUS_EXPECT_NAMED(trackingDelay, 2);
  BIGUS_EXPECT_NAMED(trackingQuantum, -1);
  BIGUS_EXPECT_NAMED(trackingRotationQuantum, 30);
  BIGUS_EXPECT_NAMED(calibrationShift[2], 101);
  BIGUS_EXPECT_NAMED(calibrationRotation[0], nan);
#undef BIGUS_EXPECT_NAMED
  // Each in range, together too much: refused before anything is allocated.
  EXPECT_NE(message([](PhantomOptions& o) { o.width = o.height = 8192, o.pixelSize = 5; }).find("too large"),
            std::string::npos);
}

TEST(Phantom, PlanesNoProbeCouldSeeAreRefused)
{
  const Phantom phantom{PhantomOptions()};
  const auto refused = [&](auto&& change)
  {
    SlicePlane plane = Upright(4, 4, 0.2, 0, 0);
    change(plane);
    std::vector<std::uint8_t> image(21 * 21, 77);
    EXPECT_THROW(phantom.Frame(plane, image.data()), Error);
    EXPECT_THROW(phantom.MakeTruth(plane), Error);
    EXPECT_THROW(phantom.Mask(plane), Error);
    EXPECT_EQ(image, std::vector<std::uint8_t>(21 * 21, 77));
  };
  refused([](SlicePlane& p) { p.rowStep = {0.05, 0.2, 0}; });       // sheared
  refused([](SlicePlane& p) { p.rowStep = p.columnStep; });         // singular
  refused([](SlicePlane& p) { p.width = 0; });                      // empty
  refused([](SlicePlane& p) { p.origin[1] = std::nan(""); });       // not finite
  refused([](SlicePlane& p) { p.origin[2] = 1e9; });                // far beyond any tracker
  refused([](SlicePlane& p) { p.width = p.height = 2000000000; });  // absurd
  refused([](SlicePlane& p) { p.columnStep *= 1e5, p.rowStep *= 1e5; });
}

}  // namespace
}  // namespace bigus
