// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Grids, slabs, bands and background, against closed forms. Testing/Filters compares the same with vtkImageReslice.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Slicing/Pixels.h"
#include "Support/Errors.h"
#include "Support/Fields.h"

namespace
{

using bigus::Bands;
using bigus::Extent;
using bigus::GivenGrid;
using bigus::GridPart;
using bigus::OutputGrid;
using bigus::PixelBand;
using bigus::ResliceSettings;
using bigus::Slab;
using bigus::SlicePlane;
using bigus::test::Message;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

OutputGrid Unasked()
{
  ADD_FAILURE() << "nothing had to be derived";
  return {};
}

// 4 x 6 x 11 indices with unlike steps; one axis runs backwards.
OutputGrid Box()
{
  return {{0.5, -2, 3}, {10, 20, 30}, {1, 4, 0, 5, -2, 8}};
}

Eigen::Vector3d CentreOf(const OutputGrid& grid)
{
  Eigen::Vector3d centre;
  for (int axis = 0; axis < 3; ++axis)
  {
    centre[axis] = grid.origin[axis] + grid.spacing[axis] * (grid.extent[2 * axis] + grid.extent[2 * axis + 1]) / 2.0;
  }
  return centre;
}

Eigen::Matrix4d TurnedAxes(double degrees)
{
  const double angle = degrees * std::acos(-1.0) / 180;
  Eigen::Matrix4d axes = Eigen::Matrix4d::Identity();
  axes.topLeftCorner<2, 2>() << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  axes.topRightCorner<3, 1>() << 3, -7, 11;
  return axes;
}

// Pixels whose value is a linear function of their place, and whose coverage is another.
float ValueAt(const Eigen::Vector3d& place)
{
  return static_cast<float>(place.dot(Eigen::Vector3d(1, 16, 256)));
}

void RenderPlaces(const std::vector<SlicePlane>& planes, const bigus::Engine::Window& window, float* image,
                  float* coverage)
{
  for (const SlicePlane& plane : planes)
  {
    for (int row = 0; row < window.rows; ++row)
    {
      for (int column = 0; column < window.columns; ++column)
      {
        const float value = ValueAt(plane.Point(window.firstColumn + column, window.firstRow + row));
        *image++ = value;
        if (coverage)
        {
          *coverage++ = -value;
        }
      }
    }
  }
}

struct Rendered
{
  std::vector<float> image, coverage;
  std::vector<double> fractions;
};

Rendered Render(const Extent& whole, const Extent& extent, const Slab& slab = {}, bool followsClock = true)
{
  Rendered found;
  Bands bands(followsClock);
  const auto keep = [&](const PixelBand& band)
  {
    EXPECT_EQ(band.first, static_cast<std::int64_t>(found.image.size()));
    found.image.insert(found.image.end(), band.image, band.image + band.count);
    found.coverage.insert(found.coverage.end(), band.coverage, band.coverage + band.count);
    found.fractions.push_back(band.fraction);
    return true;
  };
  EXPECT_TRUE(bands.Run({Eigen::Matrix4d::Identity(), whole, extent}, true, slab, RenderPlaces, keep));
  return found;
}

}  // namespace

TEST(OutputGrid, WhatIsGivenStays)
{
  const GivenGrid given{Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(4, 5, 6), Extent{0, 7, 1, 8, 2, 9}};
  const OutputGrid grid = bigus::ResliceGrid(given, {TurnedAxes(30)}, Unasked);
  EXPECT_EQ(grid.spacing, *given.spacing);
  EXPECT_EQ(grid.origin, *given.origin);
  EXPECT_EQ(grid.extent, *given.extent);
  ResliceSettings flat;
  flat.dimensionality = 2;
  const OutputGrid slice = bigus::ResliceGrid(given, flat, Unasked);
  EXPECT_EQ(slice.extent, (Extent{0, 7, 1, 8, 0, 0}));
  EXPECT_EQ(slice.origin, Eigen::Vector3d(4, 5, 0));
}

TEST(OutputGrid, WithoutAxesItIsTheInputs)
{
  const OutputGrid in = Box(), grid = bigus::ResliceGrid({}, {}, Box);
  EXPECT_EQ(grid.extent, in.extent);
  EXPECT_EQ(grid.spacing, in.spacing.cwiseAbs());
  EXPECT_LT((CentreOf(grid) - CentreOf(in)).norm(), 1e-12);
}

TEST(OutputGrid, AQuarterTurnSwapsAxes)
{
  const Eigen::Matrix4d axes = TurnedAxes(90);
  const OutputGrid in = Box(), grid = bigus::ResliceGrid({}, {axes}, Box);
  EXPECT_LT((grid.spacing - Eigen::Vector3d(2, 0.5, 3)).norm(), 1e-12);
  EXPECT_EQ(grid.extent, (Extent{0, 5, 1, 4, -2, 8}));
  const Eigen::Vector3d centre = (axes * CentreOf(grid).homogeneous()).head<3>();
  EXPECT_LT((centre - CentreOf(in)).norm(), 1e-12);
}

TEST(OutputGrid, HalvesOfAnIndexAreRoundedAwayFromZero)
{
  // Between two axes the first index is the mean of -3 and 0, and of 3 and 0: vtkImageReslice gives -2 and 2.
  ResliceSettings diagonal;
  diagonal.axes.topLeftCorner<2, 2>() << 1, -1, 1, 1;
  const auto first = [&](int begin)
  {
    const auto input = [begin] { return OutputGrid{{1, 1, 1}, {0, 0, 0}, {begin, begin + 8, 0, 8, 0, 0}}; };
    return bigus::ResliceGrid({}, diagonal, input).extent[0];
  };
  EXPECT_EQ(first(-3), -2);
  EXPECT_EQ(first(3), 2);
}

TEST(OutputGrid, ACropHoldsTheInputsCorners)
{
  const auto square = [] { return OutputGrid{{1, 1, 1}, {0, 0, 0}, {0, 10, 0, 10, 0, 0}}; };
  ResliceSettings settings{TurnedAxes(45)};
  settings.crops = true;
  const OutputGrid grid = bigus::ResliceGrid({}, settings, square);
  EXPECT_EQ(grid.extent, (Extent{0, 14, 0, 14, 0, 0}));  // the diagonal is 14.14 mm
  // The corner (0, 0, 0) is the lowest along y, and (0, 10, 0) the lowest along x, both seen from (3, -7, 11).
  const double r = std::sqrt(0.5);
  EXPECT_NEAR(grid.origin[0], r * (0 - 3) + r * (0 + 7), 1e-12);
  EXPECT_NEAR(grid.origin[1], -r * (10 - 3) + r * (0 + 7), 1e-12);
  EXPECT_NEAR(grid.origin[2], -11, 1e-12);
}

TEST(OutputGrid, OverOneGaussianReachesThreeStandardDeviations)
{
  bigus::GaussianField field;
  EXPECT_TRUE(bigus::BoundsAlong(field, Eigen::Matrix3d::Identity()).isEmpty());
  EXPECT_EQ(bigus::GridOver(bigus::BoundsAlong(field, Eigen::Matrix3d::Identity()), 50).extent, Extent{});
  field.Resize(1);
  field.means[0] = {1, 2, 3};
  field.scales[0] = {1, 2, 4};
  const Eigen::AlignedBox3d box = bigus::BoundsAlong(field, Eigen::Matrix3d::Identity());
  EXPECT_LT((box.min() - Eigen::Vector3d(-2, -4, -9)).norm(), 1e-12);
  EXPECT_LT((box.max() - Eigen::Vector3d(4, 8, 15)).norm(), 1e-12);
  const OutputGrid grid = bigus::GridOver(box, 25);
  EXPECT_LT((grid.spacing - Eigen::Vector3d::Ones()).norm(), 1e-12);  // 24 mm in 24 steps
  EXPECT_EQ(grid.extent, (Extent{0, 6, 0, 12, 0, 24}));
  EXPECT_LT((grid.origin - box.min()).norm(), 1e-12);
}

/// Of 3000 Gaussians three may be outside on each side, whichever processes have them.
TEST(OutputGrid, AFewThatAreAstrayDoNotMakeTheGridLarge)
{
  bigus::GaussianField field;
  field.Resize(3000);
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    field.means[i] = {0.01 * static_cast<double>(i % 1000), 0, 0};
    field.scales[i].setConstant(1);
  }
  field.means[7] = {-500, 0, 0};
  field.scales[1500].setConstant(100);
  field.means[2999] = {0, 900, 0};
  const Eigen::AlignedBox3d box = bigus::BoundsAlong(field, Eigen::Matrix3d::Identity());
  EXPECT_LT((box.min() - Eigen::Vector3d(-3, -3, -3)).norm(), 1e-12);
  // Beyond it along x: the wide one and both at 9.99.
  EXPECT_LT((box.max() - Eigen::Vector3d(9.98 + 3, 3, 3)).norm(), 1e-12);
}

TEST(OutputGrid, VoxelsThatAreGivenKeepToTheFieldsBounds)
{
  const auto over = [] { return OutputGrid{{1, 1, 1}, {-2, -4, -9}, {0, 6, 0, 12, 0, 24}}; };
  const Eigen::Matrix3d direction = TurnedAxes(90).topLeftCorner<3, 3>();
  const OutputGrid usual = bigus::VoxelGrid({}, direction, over);
  EXPECT_EQ(usual.extent, over().extent);
  EXPECT_LT((direction.inverse() * usual.origin - over().origin).norm(), 1e-12);

  const OutputGrid few = bigus::VoxelGrid({{}, {}, Extent{0, 3, 0, 3, 0, 3}}, direction, over);
  EXPECT_LT((few.spacing - Eigen::Vector3d(2, 4, 8)).norm(), 1e-12);
  EXPECT_LT((direction.inverse() * few.origin - over().origin).norm(), 1e-12);

  const OutputGrid fine = bigus::VoxelGrid({Eigen::Vector3d(0.5, 0.5, 0.5), {}, {}}, direction, over);
  EXPECT_EQ(fine.extent, (Extent{0, 12, 0, 24, 0, 48}));

  const Eigen::Vector3d middle = direction * Eigen::Vector3d(1, 2, 3);
  const OutputGrid half = bigus::VoxelGrid({{}, middle, {}}, direction, over);
  EXPECT_EQ(half.extent, (Extent{0, 3, 0, 6, 0, 12}));
}

TEST(OutputGrid, RefusesWhatCannotBe)
{
  const auto grid = [](const GivenGrid& given, const ResliceSettings& settings)
  { return Message([&] { bigus::ResliceGrid(given, settings, Box); }); };
  ResliceSettings settings;
  settings.axes.setZero();
  EXPECT_EQ(grid({}, settings),
            "ResliceAxes cannot be inverted, so there is no default output geometry; set "
            "OutputSpacing, OutputOrigin and OutputExtent, or mend the axes.");
  const int last = std::numeric_limits<int>::max();
  EXPECT_NE(grid({Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero(), Extent{-5, last, 0, 0, 0, 0}}, {})
                .find("from -5 to 2147483647 along axis 0"),
            std::string::npos);
  EXPECT_EQ(Message(
                [] {
                  bigus::CheckGiven({Eigen::Vector3d(1, 0, 1), {}, {}});
                }),
            "OutputSpacing along axis 1 is 0.000000 mm; it must lie between 1e-6 and 1e6 mm.");
  EXPECT_EQ(Message(
                [] {
                  bigus::CheckGiven({{}, Eigen::Vector3d(0, 0, kNaN), {}});
                }),
            "OutputOrigin along axis 2 is not finite.");
  EXPECT_EQ(Message([] { bigus::VoxelGrid({}, 2 * Eigen::Matrix3d::Identity(), Unasked); }),
            "OutputDirection must be a 3 x 3 matrix whose columns are unit vectors that span space.");
  EXPECT_EQ(Message(
                [] {
                  bigus::VoxelGrid({{}, {}, Extent{0, 3, 0, -1, 0, 5}}, Eigen::Matrix3d::Identity(), Box);
                }),
            "OutputDimensions are 4 x 0 x 6; each must be at least 1.");
  EXPECT_EQ(Message([] { bigus::CheckOutputSize({0, 9, 0, 9, 0, 9}, 1000); }), "");
  EXPECT_NE(Message([] { bigus::CheckOutputSize({0, 9, 0, 9, 0, 9}, 999); }).find("10 x 10 x 10"), std::string::npos);
}

TEST(OutputGrid, IndicesAreTakenToTheWorldByTheChain)
{
  Eigen::Matrix4d move = Eigen::Matrix4d::Identity();
  move(0, 3) = 100;
  const Eigen::Matrix4d axes = TurnedAxes(90);
  const Eigen::Matrix4d matrix =
      bigus::IndexToWorld(bigus::OutputToWorld(2 * axes, move), Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(10, 20, 30));
  // Index (1, 1, 1) lies at (11, 22, 33) along the axes; x goes to y and y to -x, and the factor 2 is homogeneous.
  const Eigen::Vector4d place = matrix * Eigen::Vector4d(1, 1, 1, 1);
  EXPECT_LT((place - Eigen::Vector4d(-22 + 3 + 100, 11 - 7, 33 + 11, 1)).norm(), 1e-12);

  Eigen::Matrix4d perspective = axes;
  perspective(3, 0) = 0.1;
  EXPECT_NE(Message([&] { bigus::OutputToWorld(perspective, {}); }).find("together are perspective"),
            std::string::npos);
  perspective(3, 0) = kNaN;
  EXPECT_NE(Message([&] { bigus::OutputToWorld(perspective, {}); }).find("not finite"), std::string::npos);
}

TEST(Bands, AnyPartHasThePixelsOfTheWhole)
{
  const Extent whole{-3, 400, 2, 300, 5, 12};
  const Rendered all = Render(whole, whole);
  ASSERT_EQ(all.image.size(), 404u * 299 * 8);
  std::size_t p = 0;
  for (int k = 5; k <= 12; ++k)
  {
    for (int j = 2; j <= 300; ++j)
    {
      for (int i = -3; i <= 400; ++i, ++p)
      {
        ASSERT_EQ(all.image[p], ValueAt({double(i), double(j), double(k)}));
        ASSERT_EQ(all.coverage[p], -all.image[p]);
      }
    }
  }
  EXPECT_TRUE(std::is_sorted(all.fractions.begin(), all.fractions.end()));
  EXPECT_EQ(all.fractions.back(), 1);
  const Rendered part = Render(whole, {10, 11, 7, 9, 6, 6});
  EXPECT_EQ(part.image, (std::vector<float>{ValueAt({10, 7, 6}), ValueAt({11, 7, 6}), ValueAt({10, 8, 6}),
                                            ValueAt({11, 8, 6}), ValueAt({10, 9, 6}), ValueAt({11, 9, 6})}));
  EXPECT_EQ(Render(whole, whole, {}, false).image, all.image);
}

TEST(Bands, WithoutTheClockTheyStayOfOneSize)
{
  const Extent whole{0, 999, 0, 199, 0, 0};
  EXPECT_EQ(Render(whole, whole, {}, false).fractions.size(), 4u);  // 65 of 200 rows are 65000 of 65536 pixels
}

TEST(Bands, StopWhenTold)
{
  int bands = 0;
  const GridPart grid{Eigen::Matrix4d::Identity(), {0, 999, 0, 199, 0, 0}, {0, 999, 0, 199, 0, 0}};
  EXPECT_FALSE(Bands(false).Run(grid, false, {}, RenderPlaces,
                                [&](const PixelBand& band)
                                {
                                  EXPECT_EQ(band.coverage, nullptr);
                                  return ++bands < 2;
                                }));
  EXPECT_EQ(bands, 2);
}

TEST(Bands, RefuseAPlaneThatIsNone)
{
  GridPart grid{Eigen::Matrix4d::Identity(), {0, 1, 0, 1, 7, 7}, {0, 1, 0, 1, 7, 7}};
  grid.indexToWorld.col(1) = grid.indexToWorld.col(0);
  EXPECT_EQ(Message([&] { Bands().Run(grid, false, {}, RenderPlaces, [](const PixelBand&) { return true; }); }),
            "Output slice 7: the image's rows and columns are parallel, so the pose is singular.");
}

TEST(Slab, PlanesAreJoined)
{
  // Planes at z - 0.75, z - 0.25, z + 0.25, z + 0.75; all values are whole numbers of 64, so sums are exact.
  const Extent whole{0, 1, 0, 1, 1, 2};
  const auto first = [&](Slab::Mode mode, bool trapezoid) {
    return Render(whole, whole, {4, 0.5, mode, trapezoid}).image[0];
  };
  EXPECT_EQ(first(Slab::Min, false), 0.25f * 256);
  EXPECT_EQ(first(Slab::Max, false), 1.75f * 256);
  EXPECT_EQ(first(Slab::Mean, false), 256);
  EXPECT_EQ(first(Slab::Sum, false), 4 * 256);
  EXPECT_FLOAT_EQ(first(Slab::Mean, true), 256);
  EXPECT_EQ(first(Slab::Sum, true), 3 * 256);
  EXPECT_EQ(Render(whole, whole, {4, 0.5, Slab::Mean, false}).coverage[0], -0.25f * 256);  // the largest
  EXPECT_EQ(Message(
                [] {
                  Slab{3, kNaN}.Validate();
                }),
            "SlabSliceSpacingFraction is not finite; 1 puts a slab's planes one OutputSpacing apart.");
}

TEST(Pixels, BecomeGreyLevels)
{
  const std::vector<float> values{-1, 0, 0.001f, 0.002f, 0.5f, 1, 2, std::numeric_limits<float>::quiet_NaN()};
  std::vector<unsigned char> bytes(values.size());
  bigus::ToBytes(values.data(), static_cast<std::int64_t>(values.size()), bytes.data());
  EXPECT_EQ(bytes, (std::vector<unsigned char>{0, 0, 0, 1, 128, 255, 255, 0}));
  EXPECT_EQ(Message([] { bigus::CheckPixelType("short", bigus::ViewOutput::Intensity); }),
            "OutputScalarType is short; float and unsigned char are possible.");
  EXPECT_NE(Message([] { bigus::CheckPixelType("unsigned char", bigus::ViewOutput::Scattering); }), "");
}

TEST(Pixels, ThatAreNotSeenAreBackground)
{
  std::vector<float> image{1, 2, 3, 4, 5, 6};
  const std::vector<float> coverage{0.2f, 0.6f, 0.7f, 0.5f, 0.9f, 0.1f};
  const PixelBand band{3, 6, image.data(), coverage.data(), 1};  // rows 1 and 2 of three columns
  const bigus::Seen seen{0.5, 51};
  std::vector<std::vector<int>> runs;
  seen.ForEachRun(band, {10, 12, 20, 21, 30, 31}, [&](int a, int b, int y, int z) { runs.push_back({a, b, y, z}); });
  EXPECT_EQ(runs, (std::vector<std::vector<int>>{{11, 12, 21, 30}, {11, 11, 20, 31}}));
  seen.FillBackground(band, true);
  EXPECT_EQ(image, (std::vector<float>{0.2f, 2, 3, 0.2f, 5, 0.2f}));
  EXPECT_TRUE(seen.FillsBackground());
  EXPECT_FALSE(bigus::Seen{}.FillsBackground());
  EXPECT_EQ(Message([] { bigus::Seen{-1}.Validate(); }), "CoverageThreshold is -1.000000; it must be at least 0.");
}

TEST(FieldSpread, TellsWhatThinSlicesAverageInTheBox)
{
  bigus::test::Random random(5);
  const bigus::GaussianField field = bigus::test::RandomField(random, 20, 3, 0.3, 0.8, 0);
  // Planes 0.25 mm apart far beyond the field: a Gaussian's sum over such a lattice is its integral.
  const int side = 96;
  SlicePlane plane;
  plane.width = plane.height = side;
  plane.columnStep *= 0.25;
  plane.rowStep *= 0.25;
  const auto engine = bigus::Engine::Create("reference");
  engine->SetField(field);
  double sum = 0;
  std::vector<float> image(plane.NumberOfPixels()), coverage(image.size());
  for (int k = 0; k < side; ++k)
  {
    plane.origin = Eigen::Vector3d(0, 0, 0.25 * k) - Eigen::Vector3d::Constant(0.125 * side);
    engine->Render(plane, bigus::ViewOutput::Scattering, image.data(), coverage.data());
    sum += std::accumulate(coverage.begin(), coverage.end(), 0.0);
  }
  const bigus::FieldSpread spread = bigus::SpreadOf(field);
  const double integral = sum * 0.25 * 0.25 * 0.25;
  EXPECT_NEAR(spread.MeanCoverage() * spread.Box().volume(), integral, 1e-4 * integral);  // of floats
  EXPECT_TRUE(spread.Box().contains(field.means[7]));
  EXPECT_EQ(bigus::SpreadOf({}).MeanCoverage(), 0);
}
