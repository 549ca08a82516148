// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Whole fields: where planes lie, what reflectivities do, and sizes from nothing to as much as fits.

#include <algorithm>
#include <fstream>
#include <limits>

#include "Stability/HardCases.h"

namespace
{

using namespace bigus;
using namespace bigus::test;

class Fields : public EngineTest
{
protected:
  const double unit_ = UnitRoundoff(GetParam());

  /// The largest |dS| at every `stride`-th pixel, and over what rounding allows there: |r_i| times what each
  /// splat may be off by there, the roundings of the sum, and of the image.
  struct Difference
  {
    double error = 0, excess = 0;
  };
  Difference Compare(const GaussianField& field, const SlicePlane& plane, const std::vector<float>& values,
                     double dropped, std::size_t stride = 1) const
  {
    const std::vector<ExactSplat> splats = ExactSplats(field, plane);
    // What is below the smallest normal float, 1e-38, may be left out, of a footprint and of the image:
    // exp(-85) = 1e-37.
    double smallest = 1e-37;
    std::vector<double> displacements;
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      displacements.push_back(Displacement(field, i, plane, unit_));
      smallest += 2e-37 * std::abs(field.reflectivities[i]);
    }
    Difference difference;
    for (std::size_t pixel = 0; pixel < plane.NumberOfPixels(); pixel += stride)
    {
      Long exact = 0, magnitude = 0;
      double allowed = dropped + smallest;
      for (std::size_t i = 0; i < field.Size(); ++i)
      {
        const Long w = splats[i].Weight(pixel % plane.width, pixel / plane.width);
        const double r = field.reflectivities[i];
        exact += r * w;
        magnitude += std::abs(r) * w;
        allowed += std::abs(r) * SplatErrorAt(splats[i], w, displacements[i], unit_);
      }
      allowed += static_cast<double>(magnitude) * unit_ * static_cast<double>(field.Size()) +
                 static_cast<double>(std::abs(exact)) * kFloatRounding;
      const double error = static_cast<double>(std::abs(values[pixel] - exact));
      difference.error = std::max(difference.error, error);
      // One that is not finite is beyond any bound; a maximum alone would lose it.
      difference.excess = std::max(difference.excess, std::isfinite(error) ? error / allowed : HUGE_VAL);
    }
    return difference;
  }
};

/// 200 Gaussians in a ball of 8 mm.
GaussianField Ball(Random& random)
{
  GaussianField field = RandomField(random, 200, 8, 0.2, 1, 0.3);
  for (Eigen::Vector3d& mean : field.means)
  {
    mean *= std::min(1.0, 8 / mean.norm());
  }
  return field;
}

TEST_P(Fields, PlanesThroughAndTangent)
{
  Random random(21);
  const GaussianField field = Ball(random);
  engine_->SetField(field);
  // The largest Gaussian and the beam give deviations of about a millimetre: 8 mm is the ball, 9 to 14 its
  // last tails, and the ends of footprints.
  for (const double distance : {0.0, 4.0, 8.0, 9.0, 10.0, 12.0, 14.0})
  {
    Difference worst;
    std::size_t nonFinite = 0;
    for (const double tolerance : {0.0, 1e-4})
    {
      engine_->SetAccuracy({tolerance});
      for (int k = 0; k < 4; ++k)
      {
        SlicePlane plane = RandomPlane(random, {0, 0, 0}, 0.3, 40, 30);
        plane.origin += (k % 2 ? distance : -distance) * plane.Normal();
        const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Scattering);
        nonFinite += CountNonFinite(image.values) + CountNonFinite(image.coverage);
        const Difference here = Compare(field, plane, image.values, tolerance / field.transfer.gamma);
        worst = {std::max(worst.error, here.error), std::max(worst.excess, here.excess)};
      }
    }
    Conclude("planes", "ball of 8 mm at " + std::to_string(static_cast<int>(distance)) + " mm, dS", GetParam(),
             worst.error, worst.excess, nonFinite);
  }
}

TEST_P(Fields, PlanesThatMissTheFieldAreBlack)
{
  Random random(22);
  engine_->SetField(Ball(random));
  std::size_t lit = 0, nonFinite = 0;
  for (const double tolerance : {0.0, 1e-4})
  {
    engine_->SetAccuracy({tolerance});
    for (const double distance : {50.0, 1e4, 1e6})
    {
      const SlicePlane plane = RandomPlane(random, {distance, distance, -distance}, 0.2, 20, 20);
      const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Intensity);
      nonFinite += CountNonFinite(image.values) + CountNonFinite(image.coverage);
      lit += std::count_if(image.values.begin(), image.values.end(), [](float v) { return v != 0; });
    }
  }
  ConcludeFinite("planes", "50 mm to 1 km away, pixels lit", GetParam(), static_cast<double>(lit), nonFinite);
  EXPECT_EQ(lit, 0u);
}

// Offsets, times the precision of a thin Gaussian, leave the range of double, one way along rows and the other along columns.
TEST(Reference, APlaneBeyondAnyReachIsBlack)
{
  GaussianField field;
  field.Resize(1);
  field.means[0] = {2, 2, 2};
  field.scales[0] = {1e-12, 1.5, 1.5};
  field.rotations[0] = {1, 0, 0, 0};
  field.reflectivities[0] = 0.5;
  field.beam.elevationSigma = 0;
  SlicePlane plane;
  plane.width = 15;
  plane.height = 13;
  plane.columnStep = {-0.63125, -1.03125, -1.03125};
  plane.rowStep = {-1.03125, -0.63125, -1.03125};
  plane.origin = {-1.03125, -1e300, 1.609375};
  const auto engine = Engine::Create("reference");
  engine->SetField(field);
  const RenderedPlane image = RenderWhole(*engine, plane, ViewOutput::Intensity);
  EXPECT_EQ(CountNonFinite(image.values) + CountNonFinite(image.coverage), 0u);
  EXPECT_TRUE(std::all_of(image.values.begin(), image.values.end(), [](float v) { return v == 0; }));
}

// Two Gaussians as far on either side keep their block's middle at the plane, so no block is left out as a whole.
TEST_P(Fields, PairsFarOnEitherSideOfThePlaneAreNotSeen)
{
  Random random(28);
  std::size_t lit = 0, nonFinite = 0;
  for (const double distance : {1e6, 1e8, 1e9, 1e10, 9e11})
  {
    for (int axis = 0; axis < 3; ++axis)
    {
      GaussianField field = RandomField(random, 2, 1, 0.2, 2, 0.5);
      field.means[0] = distance * Eigen::Vector3d::Unit(axis);
      field.means[1] = -field.means[0];
      engine_->SetField(field);
      SlicePlane plane;
      plane.width = 24;
      plane.height = 20;
      const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Intensity);
      nonFinite += CountNonFinite(image.values) + CountNonFinite(image.coverage);
      lit += std::count_if(image.values.begin(), image.values.end(), [](float v) { return v != 0; });
      engine_->SetFrames(RandomSweep(random, {plane, plane}, 0.2, 0.8));
      EXPECT_TRUE(std::isfinite(engine_->TrainStep({0, 1}, Loss(), {1, 1, 1, 1}, {})));
    }
  }
  ConcludeFinite("coordinates", "pairs 1e6 to 9e11 mm away, pixels lit", GetParam(), static_cast<double>(lit),
                 nonFinite);
  EXPECT_EQ(lit, 0u);
}

TEST_P(Fields, APatientFarFromTheTrackersOriginLooksTheSame)
{
  Random random(23);
  GaussianField field = RandomField(random, 400, 8, 0.2, 2, 0.5);
  SlicePlane plane = RandomPlane(random, {0, 0, 0}, 0.25, 60, 50);
  const Eigen::Vector3d far(1e5, -1e5, 5e4);  // mm: a hundred metres
  for (Eigen::Vector3d& mean : field.means)
  {
    mean += far;
  }
  plane.origin += far;
  engine_->SetField(field);
  const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Scattering);
  const Difference difference = Compare(field, plane, image.values, Accuracy().tolerance / field.transfer.gamma, 7);
  const std::size_t nonFinite = CountNonFinite(image.values) + CountNonFinite(image.coverage);
  Conclude("coordinates", "400 Gaussians 1e5 mm away, dS", GetParam(), difference.error, difference.excess, nonFinite);
}

TEST_P(Fields, ReflectivitiesOver24OrdersAndCancellingPairs)
{
  for (const bool pairs : {false, true})
  {
    Random random(24);
    Difference worst;
    std::size_t nonFinite = 0;
    for (int k = 0; k < 20; ++k)
    {
      GaussianField field = RandomField(random, 60, 6, 0.5, 2, 0.3);
      field.transfer.gamma = random.LogUniform(0.1, 2);
      for (std::size_t i = 0; i < field.Size(); ++i)
      {
        field.reflectivities[i] = (random.Uniform() < 0.5 ? -1 : 1) * random.LogUniform(1e-12, 1e12);
        if (pairs && i % 2)
        {
          field.means[i] = field.means[i - 1];
          field.scales[i] = field.scales[i - 1];
          field.rotations[i] = -field.rotations[i - 1];  // the same turn
          field.reflectivities[i] = -field.reflectivities[i - 1];
        }
      }
      const SlicePlane plane = RandomPlane(random, {0, 0, 0}, 0.3, 40, 30);
      engine_->SetAccuracy({k % 2 ? 1e-4 : 0.0});
      engine_->SetField(field);
      const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Scattering);
      const Difference here = Compare(field, plane, image.values, k % 2 ? 1e-4 / field.transfer.gamma : 0.0, 3);
      // The field's own unit: what its largest Gaussian alone adds.
      double largest = 0;
      for (const double r : field.reflectivities)
      {
        largest = std::max(largest, std::abs(r));
      }
      worst = {std::max(worst.error, here.error / largest), std::max(worst.excess, here.excess)};
      const RenderedPlane intensity = RenderWhole(*engine_, plane, ViewOutput::Intensity);
      nonFinite += CountNonFinite(image.values) + CountNonFinite(image.coverage) + CountNonFinite(intensity.values);
      for (const float value : intensity.values)
      {
        ASSERT_TRUE(value >= 0 && value <= 1) << value;
      }
    }
    Conclude("reflectivity",
             pairs ? "1e-12 to 1e12 in cancelling pairs, dS / largest r" : "1e-12 to 1e12, dS / largest r", GetParam(),
             worst.error, worst.excess, nonFinite);
  }
}

TEST_P(Fields, NoGaussian)
{
  GaussianField field;
  engine_->SetField(field);
  EXPECT_EQ(engine_->FieldSize(), 0u);
  EXPECT_EQ(engine_->GetField().Size(), 0u);
  Random random(25);
  const SlicePlane plane = RandomPlane(random, {0, 0, 0}, 0.3, 21, 17);
  const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Intensity);
  EXPECT_EQ(image.values, std::vector<float>(plane.NumberOfPixels(), 0.0f));
  EXPECT_EQ(image.coverage, std::vector<float>(plane.NumberOfPixels(), 0.0f));

  engine_->SetFrames(RandomSweep(random, {plane, plane}, 0.2, 0.8));
  engine_->ResetScores();
  EXPECT_TRUE(std::isfinite(engine_->Backpropagate({0, 1}, Loss::Parse("l2"))));
  EXPECT_TRUE(engine_->GetGradient().means.empty());
  engine_->Step({1, 1, 1, 1}, {});
  EXPECT_TRUE(std::isfinite(engine_->TrainStep({0, 1}, Loss(), {1, 1, 1, 1}, {})));
  EXPECT_TRUE(engine_->GetScores().error.empty());
  EXPECT_EQ(engine_->GuardedUpdates(), 0u);
  ConcludeFinite("numbers", "0 Gaussians", GetParam(), 0, CountNonFinite(image.values));
}

TEST_P(Fields, OneGaussianAndOnePixel)
{
  Random random(26);
  Difference worst;
  std::size_t nonFinite = 0;
  for (int k = 0; k < 200; ++k)
  {
    const SlicePlane plane = RandomPlane(random, random.Vector(3), 0.3, 1, 1);
    GaussianField field = RandomField(random, 1, 3, 0.3, 3, 0.3);
    PlaceInView(field, 0, plane, 0, 0, {random.Uniform(-2, 2), random.Uniform(-2, 2)}, random.Uniform(-2, 2));
    engine_->SetAccuracy({k % 2 ? 1e-4 : 0.0});
    engine_->SetField(field);
    const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Scattering);
    const Difference here = Compare(field, plane, image.values, k % 2 ? 1e-4 / field.transfer.gamma : 0.0);
    worst = {std::max(worst.error, here.error), std::max(worst.excess, here.excess)};
    engine_->SetFrames(RandomSweep(random, {plane}, 0, 1));
    engine_->TrainStep({0}, Loss::Parse("l2"), {0.1, 0.1, 0.1, 0.1}, {});
    nonFinite += CountNonFinite(image.values) + CountNonFinite(image.coverage) + CountNonFinite(engine_->GetField());
  }
  Conclude("numbers", "1 Gaussian, 1 x 1 pixel, dS", GetParam(), worst.error, worst.excess, nonFinite);
}

/// Bytes that may be used without swapping; 0 where the system does not say.
double FreeMemory()
{
  std::ifstream file("/proc/meminfo");
  for (std::string name; file >> name;)
  {
    double kilobytes = 0;
    if (name == "MemAvailable:" && file >> kilobytes)
    {
      return 1024 * kilobytes;
    }
  }
  return 0;
}

#define BIGUS_NEEDS_MEMORY(gigabytes) \
  if (FreeMemory() < (gigabytes)*1e9) \
  GTEST_SKIP() << "needs " << (gigabytes) << " GB of free memory; there are " << FreeMemory() / 1e9

#define BIGUS_NEEDS_SPEED() \
  if (IsEmulated(GetParam())) GTEST_SKIP() << "takes minutes on an emulated device"

TEST_P(Fields, SixteenMillionGaussians)
{
  BIGUS_NEEDS_SPEED();
  BIGUS_NEEDS_MEMORY(8);
  // A jittered grid of 256^3, one a millimetre; a small oblique plane sees about a thousand of them.
  constexpr std::size_t kSide = 256;
  GaussianField field;
  field.Resize(kSide * kSide * kSide);
  field.beam.elevationSigma = 0.3;
  std::uint64_t bits = 27;
  const auto uniform = [&bits]  // in [0, 1): a linear congruential generator is random enough, and fast
  {
    bits = bits * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(bits >> 11) * 0x1p-53;
  };
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    field.means[i] = {static_cast<double>(i % kSide) + uniform(), static_cast<double>(i / kSide % kSide) + uniform(),
                      static_cast<double>(i / kSide / kSide) + uniform()};
    field.scales[i] = {0.2 + 0.2 * uniform(), 0.2 + 0.2 * uniform(), 0.2 + 0.2 * uniform()};
    field.rotations[i] = {1, uniform(), uniform(), uniform()};
    field.reflectivities[i] = uniform() - 0.3;
  }
  Random random(27);
  const SlicePlane plane = RandomPlane(random, {101.3, 87.7, 140.2}, 0.25, 48, 40);
  // Those further than the image's half diagonal and 12 deviations (0.5 mm each) add less than 2^24 exp(-72).
  const double reach = 0.125 * std::hypot(48, 40 * 1.25) + 6;
  const Eigen::Vector3d centre = plane.Point(23.5, 19.5);
  GaussianField near;
  near.beam = field.beam;
  near.transfer = field.transfer;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    if ((field.means[i] - centre).norm() < reach)
    {
      near.means.push_back(field.means[i]);
      near.scales.push_back(field.scales[i]);
      near.rotations.push_back(field.rotations[i]);
      near.reflectivities.push_back(field.reflectivities[i]);
    }
  }
  engine_->SetAccuracy({1e-4});
  engine_->SetField(field);
  ASSERT_EQ(engine_->FieldSize(), std::size_t(1) << 24);
  const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Scattering);
  // Positions are relative to the middle of 256 mm, which the bound learns from two Gaussians in the corners.
  near.means.insert(near.means.end(), {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(256, 256, 256)});
  near.Resize(near.means.size());
  const Difference difference = Compare(near, plane, image.values, 1e-4 / field.transfer.gamma, 5);
  const std::size_t nonFinite = CountNonFinite(image.values) + CountNonFinite(image.coverage);
  Conclude("numbers", "2^24 Gaussians, dS", GetParam(), difference.error, difference.excess, nonFinite);
}

TEST_P(Fields, SixteenThousandPixelsSquare)
{
  BIGUS_NEEDS_SPEED();
  BIGUS_NEEDS_MEMORY(8);
  constexpr int kSide = 16384;
  Random random(28);
  const SlicePlane plane = FlatPlane(kSide, kSide, 0.01, 0.01);
  GaussianField field = RandomField(random, 200, 80, 0.02, 2, 0.1);
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    PlaceInView(field, i, plane, random.Uniform(0, kSide), random.Uniform(0, kSide), {0, 0}, random.Uniform(-1, 1));
  }
  PlaceInView(field, 0, plane, kSide - 1, kSide - 1, {0, 0}, 0);  // the last pixel of all
  field.scales[1] = {100, 60, 1};                                 // one as large as the image: 1e4 pixels
  PlaceInView(field, 1, plane, 0.3 * kSide, 0.6 * kSide, {0, 0}, 0);
  field.reflectivities[0] = field.reflectivities[1] = 1;
  engine_->SetAccuracy({1e-4});
  engine_->SetField(field);
  std::vector<float> values(plane.NumberOfPixels(), std::nanf(""));
  engine_->Render(plane, ViewOutput::Scattering, values.data());
  const std::size_t nonFinite = CountNonFinite(values);
  // 2^28 - 1 = 3 5 29 43 113 127: a stride that ends on the very last pixel, where a splat was put.
  const Difference difference = Compare(field, plane, values, 1e-4 / field.transfer.gamma, 3 * 29 * 43 * 113);
  ASSERT_GT(ExactSplat(field, 0, plane).Weight(kSide - 1, kSide - 1), 0.1);
  Conclude("images", "16384 x 16384 pixels, dS", GetParam(), difference.error, difference.excess, nonFinite);
}

TEST_P(Fields, MoreThan2To31PairsOfPixelsAndSplats)
{
  BIGUS_NEEDS_SPEED();
  // 600 round Gaussians of some 2000 pixels, each bright at each of 2048 x 2048 pixels: 2.5e9 pairs, forwards
  // and backwards. Being round and face on, they are products of one factor a column and one a row, which
  // makes the exact image and the exact dL/dr cheap.
  constexpr int kSide = 2048, kCount = 600;
  Random random(29);
  const SlicePlane plane = FlatPlane(kSide, kSide, 0.1, 0.1);
  GaussianField field;
  field.Resize(kCount);
  field.beam.elevationSigma = 0;
  field.transfer.gamma = 0.5;
  std::vector<std::vector<double>> columns, rows;
  std::vector<double> exact(plane.NumberOfPixels(), 0.0);
  double pairs = 0;
  for (int i = 0; i < kCount; ++i)
  {
    const double scale = random.Uniform(150, 250);
    field.scales[i].setConstant(scale);
    field.means[i] = {random.Uniform(-50, 50), random.Uniform(-50, 50), 0};
    field.reflectivities[i] = random.Uniform(0.5, 1) * 4 / kCount;
    columns.emplace_back(kSide);
    rows.emplace_back(kSide);
    for (int p = 0; p < kSide; ++p)
    {
      columns[i][p] = std::exp(-0.5 * std::pow((plane.origin[0] + 0.1 * p - field.means[i][0]) / scale, 2));
      rows[i][p] = std::exp(-0.5 * std::pow((plane.origin[1] + 0.1 * p - field.means[i][1]) / scale, 2));
    }
    // Nowhere on the image is it below a hundred times its share of the tolerance.
    const double least = *std::min_element(columns[i].begin(), columns[i].end()) *
                         *std::min_element(rows[i].begin(), rows[i].end()) * field.reflectivities[i];
    ASSERT_GT(least, 100 * 1e-4 / field.transfer.gamma / kCount);
    pairs += static_cast<double>(plane.NumberOfPixels());
    for (int row = 0; row < kSide; ++row)
    {
      const double factor = rows[i][row] * field.reflectivities[i];
      for (int column = 0; column < kSide; ++column)
      {
        exact[static_cast<std::size_t>(row) * kSide + column] += factor * columns[i][column];
      }
    }
  }
  ASSERT_GT(pairs, 0x1p31);

  engine_->SetAccuracy({1e-4});
  engine_->SetField(field);
  const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Scattering);
  // S is below 4. A splat's own error, as everywhere; the sum rounds 600 times.
  const double allowed = 1e-4 / field.transfer.gamma + 4 * (FlatError(unit_) + 600 * unit_ + kFloatRounding);
  double worst = 0;
  for (std::size_t pixel = 0; pixel < exact.size(); ++pixel)
  {
    worst = std::max(worst, std::abs(image.values[pixel] - exact[pixel]));
  }
  std::size_t nonFinite = CountNonFinite(image.values) + CountNonFinite(image.coverage);
  char name[48];
  std::snprintf(name, sizeof(name), "%.3g pairs forwards, dS", pairs);
  Conclude("pairs", name, GetParam(), worst, worst / allowed, nonFinite);

  // Backwards: a black frame, so that every pixel pulls the same way and a lost part would show.
  auto sweep = std::make_shared<Sweep>();
  sweep->width = sweep->height = kSide;
  sweep->pixelType = Sweep::PixelType::UInt8;
  const auto pixels = std::make_shared<std::vector<std::uint8_t>>(plane.NumberOfPixels(), std::uint8_t(0));
  sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
  sweep->imageToReference.push_back(plane.ImageToReference());
  engine_->SetFrames(sweep);
  engine_->Backpropagate({0}, Loss::Parse("l2"));
  const FieldGradient gradient = engine_->GetGradient();
  double worstGradient = 0;
  for (int i = 0; i < kCount; i += 60)
  {
    double sum = 0;
    for (int row = 0; row < kSide; ++row)
    {
      double line = 0;
      for (int column = 0; column < kSide; ++column)
      {
        const double s = exact[static_cast<std::size_t>(row) * kSide + column];
        const double fade = std::exp(-0.5 * s);
        line += 2 * (1 - fade) * 0.5 * fade * columns[i][column];
      }
      sum += line * rows[i][row];
    }
    sum /= static_cast<double>(plane.NumberOfPixels());
    worstGradient = std::max(worstGradient, std::abs(gradient.reflectivities[i] / sum - 1));
  }
  nonFinite = CountNonFinite(gradient);
  std::snprintf(name, sizeof(name), "%.3g pairs backwards, dL/dr relative", pairs);
  // A sum of n terms of one sign in arithmetic u errs by at most n u. The kernels' vectors are of 4 floats at
  // least and start afresh at every row: 512 + 2048 additions in series. What S was off by comes on top.
  const double allowedGradient = 2560 * unit_ + 4 * allowed;
  Conclude("pairs", name, GetParam(), worstGradient, worstGradient / allowedGradient, nonFinite);
}

INSTANTIATE_TEST_SUITE_P(Engines, Fields, ::testing::ValuesIn(FastEngines()), EngineTestName);

}  // namespace
