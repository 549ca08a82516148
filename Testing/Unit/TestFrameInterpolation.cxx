// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Pictures between two frames, against what they must be where that is known.
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <functional>

#include "Core/Model/Error.h"
#include "Core/Training/FrameInterpolation.h"
#include "Core/Training/Targets.h"
#include "Core/Training/VirtualPlanes.h"
#include "Support/Sweeps.h"

namespace bigus
{
namespace
{

using Path = FrameInterpolation::Path;
using Decay = FrameInterpolation::Decay;

constexpr int kWidth = 64, kHeight = 56;
constexpr double kPixel = 0.4, kSpacing = 0.8;  // mm

const std::vector<FrameInterpolation> kEvery = {{Path::Normals, false},
                                                {Path::Normals, true, Decay::Rough},
                                                {Path::Probe, false, Decay::Smooth},
                                                {Path::Probe, true}};

/// A thousandth of the octaves' amplitude, at most 0.5 here: what frames are taken not to have in common.
constexpr double kNoiseOfFrames = 1e-3 * 0.5;

/// Parallel frames of a picture of (column, row, frame).
std::shared_ptr<Sweep> Frames(int count, const std::function<double(double, double, int)>& picture)
{
  auto sweep = test::BlackSweep(count, kWidth, kHeight, kPixel, kSpacing);
  for (int f = 0; f < count; ++f)
  {
    for (int j = 0; j < kHeight; ++j)
    {
      for (int i = 0; i < kWidth; ++i)
      {
        test::Pixels(*sweep)[(static_cast<std::size_t>(f) * kHeight + j) * kWidth + i] =
            static_cast<float>(picture(i, j, f));
      }
    }
  }
  return sweep;
}

/// Something with structure at all scales.
double Texture(double i, double j)
{
  return 0.5 + 0.2 * std::sin(0.31 * i + 0.2 * j) + 0.1 * std::cos(1.1 * i - 0.7 * j) + 0.1 * std::sin(0.05 * i * j);
}

std::vector<float> Between(const Sweep& sweep, int a, int b, double share, const FrameInterpolation& how)
{
  std::vector<float> image(sweep.PixelsPerFrame());
  FramesAround around;
  around.first = a;
  around.second = b;
  InterpolateFrames(sweep, around, {{PlaneBetween(sweep.Plane(a), sweep.Plane(b), share), share}}, how, {image.data()});
  return image;
}

/// The largest difference from a picture, `margin` pixels inside the edge.
double LargestError(const std::vector<float>& image, const std::function<double(double, double)>& truth, int margin = 0)
{
  double worst = 0;
  for (int j = margin; j < kHeight - margin; ++j)
  {
    for (int i = margin; i < kWidth - margin; ++i)
    {
      worst = std::max(worst, std::abs(image[static_cast<std::size_t>(j) * kWidth + i] - truth(i, j)));
    }
  }
  return worst;
}

SlicePlane Sheared(const Eigen::Vector3d& at)
{
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  Eigen::Matrix3d steps = Eigen::Matrix3d::Identity();
  steps.col(0) = Eigen::Vector3d(0.2, 0, 0);
  steps.col(1) = Eigen::Vector3d(0.03, 0.17, 0);  // ten degrees off the perpendicular
  pose.block<3, 3>(0, 0) = turn * steps;
  pose.block<3, 1>(0, 3) = at;
  return SlicePlane::FromImageToReference(pose, kWidth, kHeight);
}

TEST(FrameInterpolation, NamesReadBack)
{
  for (const FrameInterpolation& how : kEvery)
  {
    const FrameInterpolation again = FrameInterpolation::Parse(how.ToString());
    EXPECT_EQ(again.path, how.path);
    EXPECT_EQ(again.flow, how.flow);
    EXPECT_EQ(again.decay, how.decay);
  }
  for (const char* wrong :
       {"", "normal", "Probe", "flow", "probe+flow+flow", "probe+smooth+flow", "normals+medium", "normals "})
  {
    EXPECT_THROW(FrameInterpolation::Parse(wrong), bigus::Error) << wrong;
  }
}

TEST(PlaneBetween, KeepsShearUnderTranslation)
{
  const SlicePlane from = Sheared({1, -2, 3}), to = Sheared({1.4, -1.5, 4.1});
  for (double share : {0.0, 0.25, 0.5, 1.0})
  {
    const SlicePlane between = PlaneBetween(from, to, share);
    for (int i : {0, kWidth - 1})
    {
      for (int j : {0, kHeight - 1})
      {
        const Eigen::Vector3d expected = (1 - share) * from.Point(i, j) + share * to.Point(i, j);
        EXPECT_LT((between.Point(i, j) - expected).norm(), 1e-9) << share << ' ' << i << ' ' << j;
      }
    }
  }
}

TEST(PlaneBetween, TurnsByHalfTheAngleAndKeepsSizes)
{
  const SlicePlane from = Sheared({0, 0, 0});
  SlicePlane to = from;
  const Eigen::Vector3d axis = Eigen::Vector3d(0.3, -1, 0.2).normalized();
  const Eigen::AngleAxisd whole(0.4, axis), half(0.2, axis);
  to.columnStep = whole * from.columnStep;
  to.rowStep = whole * from.rowStep;
  to.origin = whole * from.origin;
  const SlicePlane between = PlaneBetween(from, to, 0.5);
  EXPECT_LT((between.columnStep - half * from.columnStep).norm(), 1e-12);
  EXPECT_LT((between.rowStep - half * from.rowStep).norm(), 1e-12);
  const double i = 0.5 * (kWidth - 1), j = 0.5 * (kHeight - 1);
  EXPECT_LT((between.Point(i, j) - 0.5 * (from.Point(i, j) + to.Point(i, j))).norm(), 1e-12);
}

TEST(FrameInterpolation, TwoEqualFramesGiveThatFrame)
{
  const auto sweep = Frames(2, [](double i, double j, int) { return Texture(i, j); });
  for (const FrameInterpolation& how : kEvery)
  {
    for (double share : {0.2, 0.5})
    {
      EXPECT_LT(LargestError(Between(*sweep, 0, 1, share, how), Texture), kNoiseOfFrames)
          << how.ToString() << ' ' << share;
    }
  }
}

TEST(FrameInterpolation, AtAFrameItIsThatFrame)
{
  const auto sweep = Frames(2, [](double i, double j, int f) { return Texture(i + 9 * f, j * (1 + f)); });
  for (const Path path : {Path::Normals, Path::Probe})
  {
    EXPECT_LT(LargestError(Between(*sweep, 0, 1, 0, {path, false}), Texture), kNoiseOfFrames);
    EXPECT_LT(
        LargestError(Between(*sweep, 0, 1, 1, {path, false}), [](double i, double j) { return Texture(i + 9, 2 * j); }),
        kNoiseOfFrames);
  }
}

TEST(FrameInterpolation, ARampInElevationStaysARamp)
{
  const auto sweep = Frames(2, [](double i, double, int f) { return 0.2 + 0.4 * f + 0.002 * i; });
  for (const FrameInterpolation& how : kEvery)
  {
    for (double share : {0.25, 0.5, 0.8})
    {
      EXPECT_LT(LargestError(
                    Between(*sweep, 0, 1, share, how),
                    [share](double i, double) { return 0.2 + 0.4 * share + 0.002 * i; }, 2),
                1e-4)
          << how.ToString() << ' ' << share;
    }
  }
}

TEST(FrameInterpolation, AParabolaInElevationStaysAParabola)
{
  // Slopes at the inner frames are those of parabolas through three frames; the picture is smooth within the frames, so
  // that its octaves are empty.
  const auto bend = [](double f) { return 0.2 + 0.3 * f - 0.06 * f * f; };
  const auto sweep = Frames(4, [&](double, double, int f) { return bend(f); });
  for (const Path path : {Path::Normals, Path::Probe})
  {
    for (double share : {0.25, 0.5, 0.8})
    {
      std::vector<float> image(sweep->PixelsPerFrame());
      InterpolateFrames(*sweep, FramesAround::Gap(*sweep, {0, 1, 2, 3}, 1),
                        {{PlaneBetween(sweep->Plane(1), sweep->Plane(2), share), share}}, {path}, {image.data()});
      EXPECT_LT(LargestError(image, [&](double, double) { return bend(1 + share); }), 1e-5) << share;
    }
  }
}

TEST(FrameInterpolation, OuterFramesHelpWhereFramesChangeSmoothly)
{
  // White noise within frames, blurred along them by a Gaussian of 1.4 frames: a correlation of exp(-d^2 / 8).
  constexpr int kFrames = 31, kReach = 5;
  test::Random random(3);
  std::vector<std::vector<double>> noise(kFrames + 2 * kReach, std::vector<double>(kWidth * kHeight));
  for (auto& layer : noise)
  {
    std::generate(layer.begin(), layer.end(), [&] { return random.Uniform(-0.3, 0.3); });
  }
  const auto sweep = Frames(kFrames,
                            [&](double i, double j, int f)
                            {
                              double sum = 0.5;
                              for (int k = -kReach; k <= kReach; ++k)
                              {
                                sum +=
                                    0.5 * std::exp(-k * k / 4.0) *
                                    noise[f + kReach + k][static_cast<std::size_t>(j) * kWidth + static_cast<int>(i)];
                              }
                              return std::clamp(sum, 0.0, 1.0);
                            });
  // Frames 0, 2, 4 ... are known; those between them are the truth.
  const auto meanSquare = [&](bool outer, Decay decay)
  {
    double sum = 0;
    for (int f = 3; f + 3 < kFrames; f += 2)
    {
      FramesAround around;
      around.first = f - 1;
      around.second = f + 1;
      around.before = outer ? f - 3 : FramesAround::kNone;
      around.after = outer ? f + 3 : FramesAround::kNone;
      std::vector<float> image(sweep->PixelsPerFrame());
      InterpolateFrames(*sweep, around, {{sweep->Plane(f), 0.5}}, {Path::Normals, false, decay}, {image.data()});
      for (std::size_t p = 0; p < image.size(); ++p)
      {
        const double d = image[p] - test::Pixels(*sweep)[f * image.size() + p];
        sum += d * d;
      }
    }
    return sum;
  };
  // The error of the best linear estimate has 0.030 of the variance from two frames of that process, 0.010 from four.
  EXPECT_LT(meanSquare(true, Decay::Smooth), 0.75 * meanSquare(false, Decay::Smooth));
  EXPECT_LT(meanSquare(true, Decay::Smooth), meanSquare(true, Decay::Rough));
}

TEST(FrameInterpolation, TiltedFramesMeetAlongTheirNormals)
{
  // Intensity is linear in world x; the second frame is tilted by 0.1 about y and 0.8 mm further.
  const auto sweep = Frames(2, [](double, double, int) { return 0; });
  Eigen::Matrix4d tilt = Eigen::Matrix4d::Identity();
  tilt.block<3, 3>(0, 0) = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()).toRotationMatrix();
  tilt(2, 3) = 3;
  sweep->imageToReference[1] = tilt * sweep->imageToReference[1];
  const auto world = [](const Eigen::Vector3d& x) { return 0.5 + 0.02 * x[0]; };
  for (int f : {0, 1})
  {
    for (int j = 0; j < kHeight; ++j)
    {
      for (int i = 0; i < kWidth; ++i)
      {
        test::Pixels(*sweep)[(static_cast<std::size_t>(f) * kHeight + j) * kWidth + i] =
            static_cast<float>(world(sweep->Plane(f).Point(i, j)));
      }
    }
  }
  const SlicePlane plane = PlaneBetween(sweep->Plane(0), sweep->Plane(1), 0.5);
  const std::vector<float> image = Between(*sweep, 0, 1, 0.5, {Path::Normals, false});
  EXPECT_LT(LargestError(
                image, [&](double i, double j) { return world(plane.Point(i, j)); }, 4),
            1e-3);
}

TEST(FrameInterpolation, FlowMovesABlobHalfTheWay)
{
  // A blob of sigma 4 pixels, 5 pixels further in the second frame.
  const auto blob = [](double i, double j, double at)
  { return 0.1 + 0.7 * std::exp(-((i - at) * (i - at) + (j - 28) * (j - 28)) / 32); };
  const auto sweep = Frames(2, [&](double i, double j, int f) { return blob(i, j, 29 + 5 * f); });
  const auto truth = [&](double i, double j) { return blob(i, j, 31.5); };
  const auto rms = [&](const std::vector<float>& image)
  {
    double sum = 0;
    for (int j = 0; j < kHeight; ++j)
    {
      for (int i = 0; i < kWidth; ++i)
      {
        const double d = image[static_cast<std::size_t>(j) * kWidth + i] - truth(i, j);
        sum += d * d;
      }
    }
    return std::sqrt(sum / (kWidth * kHeight));
  };
  for (const Path path : {Path::Normals, Path::Probe})
  {
    const double still = rms(Between(*sweep, 0, 1, 0.5, {path, false}));
    const double moved = rms(Between(*sweep, 0, 1, 0.5, {path, true}));
    // The picture is the mean of two with flow and one without, so a third of the error stays.
    EXPECT_LT(moved, 0.5 * still);
    FrameInterpolation alone{path, true, Decay::Medium, true};  // to keep contrast, it is not
    EXPECT_LT(rms(Between(*sweep, 0, 1, 0.5, alone)), 0.35 * still);
  }
}

TEST(FrameInterpolation, PlanesOfAGapAreMadeTogetherAsOneByOne)
{
  // The blob of the test before, 8 pixels further in the second frame; flow is found once, in the middle.
  const auto blob = [](double i, double j, double at)
  { return 0.1 + 0.7 * std::exp(-((i - at) * (i - at) + (j - 28) * (j - 28)) / 32); };
  const auto sweep = Frames(2, [&](double i, double j, int f) { return blob(i, j, 27 + 8 * f); });
  FramesAround around;
  around.second = 1;
  std::vector<PlaneInGap> planes;
  for (const double share : {0.25, 0.5, 0.75})
  {
    planes.push_back({PlaneBetween(sweep->Plane(0), sweep->Plane(1), share), share});
  }
  for (const bool flow : {false, true})
  {
    std::vector<std::vector<float>> images(3, std::vector<float>(sweep->PixelsPerFrame()));
    const FrameInterpolation how{Path::Normals, flow};
    InterpolateFrames(*sweep, around, planes, how, {images[0].data(), images[1].data(), images[2].data()});
    for (int n = 0; n < 3; ++n)
    {
      // All planes show the same pixels of both frames here, so they have the same flow.
      EXPECT_EQ(images[n], Between(*sweep, 0, 1, planes[n].share, how)) << n;
    }
  }
}

TEST(FrameInterpolation, SpeckleThatFramesDoNotShareIsSmoothedUnlessContrastIsKept)
{
  test::Random random(5);
  const auto sweep = Frames(2, [&](double, double, int) { return random.Uniform(0.2, 0.8); });
  const auto deviation = [](const std::vector<float>& image)
  {
    double sum = 0, square = 0;
    for (float value : image)
    {
      sum += value;
      square += static_cast<double>(value) * value;
    }
    const double n = static_cast<double>(image.size());
    return std::sqrt(square / n - sum / n * (sum / n));
  };
  const double given = deviation({test::Pixels(*sweep), test::Pixels(*sweep) + sweep->PixelsPerFrame()});
  EXPECT_LT(deviation(Between(*sweep, 0, 1, 0.5, {Path::Normals})), 0.4 * given);
  EXPECT_NEAR(deviation(Between(*sweep, 0, 1, 0.5, {Path::Normals, false, Decay::Medium, true})), given, 0.03 * given);
  // Poses half a pixel apart: sampled between pixels, white noise loses half of its power, and gets it back.
  sweep->imageToReference[1].block<3, 1>(0, 3) +=
      0.5 * sweep->imageToReference[1].block<3, 1>(0, 0) + 0.5 * sweep->imageToReference[1].block<3, 1>(0, 1);
  EXPECT_NEAR(deviation(Between(*sweep, 0, 1, 0.5, {Path::Normals, false, Decay::Medium, true})), given, 0.05 * given);
}

TEST(FrameInterpolation, SameBitsForAnyNumberOfThreads)
{
  test::Random random(9);
  const auto sweep =
      Frames(8, [&](double i, double j, int f) { return std::min(1.0, Texture(i + f, j) * random.Uniform(0.5, 1)); });
  std::vector<int> frames = {0, 1, 2, 3, 4, 5, 6, 7};
  for (const FrameInterpolation& how : kEvery)
  {
    const auto made = [&](int threads)
    {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      const auto planes = AddVirtualPlanes(*sweep, frames, 2, how);
      EXPECT_EQ(planes->NumberOfFrames(), 8 + 2 * 7);
      const float* pixels = static_cast<const float*>(planes->pixels.get());
      return std::make_pair(std::vector<float>(pixels, pixels + 22 * planes->PixelsPerFrame()),
                            *ScoreInterpolation(*sweep, frames, how));
    };
    EXPECT_EQ(made(1), made(3)) << how.ToString();
  }
}

TEST(FrameInterpolation, OppositeFramesDoNotCrash)
{
  // The second frame seen from behind; and both in one place.
  const auto sweep = Frames(2, [](double i, double j, int) { return Texture(i, j); });
  sweep->imageToReference[1].col(0) *= -1;
  const auto together = Frames(2, [](double i, double j, int) { return Texture(i, j); });
  together->imageToReference[1] = together->imageToReference[0];
  const auto across = Frames(2, [](double i, double j, int) { return Texture(i, j); });
  across->imageToReference[1].block<3, 3>(0, 0) =
      Eigen::AngleAxisd(EIGEN_PI / 2, Eigen::Vector3d::UnitY()) * across->imageToReference[1].block<3, 3>(0, 0);
  for (const auto& hard : {sweep, together, across})
  {
    for (const FrameInterpolation& how : kEvery)
    {
      for (float value : Between(*hard, 0, 1, 0.5, how))
      {
        ASSERT_TRUE(value >= 0 && value <= 1) << how.ToString() << ' ' << value;
      }
    }
  }
}

TEST(FrameInterpolation, AnOuterFrameSeenFromItsEdgeSaysNothing)
{
  // The first of four frames is turned by 90 degrees, so that no line along the normals meets it.
  const auto sweep = Frames(4, [](double i, double j, int) { return Texture(i, j); });
  const FramesAround three = FramesAround::Gap(*sweep, {1, 2, 3}, 0), four = FramesAround::Gap(*sweep, {0, 1, 2, 3}, 1);
  sweep->imageToReference[0].block<3, 3>(0, 0) =
      Eigen::AngleAxisd(EIGEN_PI / 2, Eigen::Vector3d::UnitY()) * sweep->imageToReference[0].block<3, 3>(0, 0);
  const PlaneInGap middle{PlaneBetween(sweep->Plane(1), sweep->Plane(2), 0.5), 0.5};
  std::vector<float> with(sweep->PixelsPerFrame()), without(with.size());
  InterpolateFrames(*sweep, four, {middle}, {Path::Normals}, {with.data()});
  InterpolateFrames(*sweep, three, {middle}, {Path::Normals}, {without.data()});
  EXPECT_EQ(with, without);
}

TEST(FrameInterpolation, AScoreNeedsThreeFrames)
{
  const auto sweep = Frames(5, [](double i, double j, int f) { return Texture(i + 0.1 * f, j); });
  EXPECT_THROW(ScoreInterpolation(*sweep, {0, 1}, {}), bigus::Error);
  EXPECT_THROW(ScoreInterpolation(*sweep, {}, {}), bigus::Error);
  // Slowly changing frames are predicted well; frames that have nothing to do with each other are not.
  EXPECT_GT(*ScoreInterpolation(*sweep, {0, 1, 2}, {}), 40);
  const auto unlike = Frames(3, [](double i, double j, int f) { return Texture(i * (1 + f), j + 20 * f); });
  EXPECT_LT(*ScoreInterpolation(*unlike, {0, 1, 2}, {}), 25);
  EXPECT_FALSE(ScoreInterpolation(*sweep, {0, 1, 2}, {}, [] { return false; }));
}

TEST(VirtualPlanes, BreaksInTheSweepGetNone)
{
  auto sweep = Frames(6, [](double i, double j, int) { return Texture(i, j); });
  for (int f = 3; f < 6; ++f)
  {
    sweep->imageToReference[f](2, 3) += 20;  // mm
  }
  EXPECT_EQ(AddVirtualPlanes(*sweep, {0, 1, 2, 3, 4, 5}, 1)->NumberOfFrames(), 6 + 4);
}

TEST(VirtualPlanes, PixelsStayBytesWhereTheyWereBytes)
{
  const auto sweep = Frames(4, [](double i, double j, int f) { return Texture(i + f, j); });
  auto bytes = std::make_shared<std::vector<std::uint8_t>>(4 * sweep->PixelsPerFrame());
  Sweep eightBit = *sweep;
  for (std::size_t p = 0; p < bytes->size(); ++p)
  {
    (*bytes)[p] = static_cast<std::uint8_t>(std::lround(255 * test::Pixels(*sweep)[p]));
    test::Pixels(*sweep)[p] = static_cast<float>((*bytes)[p]) / 255.0f;  // the same pictures, as float
  }
  eightBit.pixelType = Sweep::PixelType::UInt8;
  eightBit.pixels = std::shared_ptr<const void>(bytes, bytes->data());
  const auto small = AddVirtualPlanes(eightBit, {0, 1, 3}, 2), large = AddVirtualPlanes(*sweep, {0, 1, 3}, 2);
  ASSERT_EQ(small->NumberOfFrames(), 3 + 2 * 2);
  EXPECT_EQ(small->timestamps, std::vector<double>({0, 1, 2, 1 / 3.0, 2 / 3.0, 1 + 1 / 3.0, 1 + 2 / 3.0}));
  EXPECT_EQ(small->pixelType, Sweep::PixelType::UInt8);
  EXPECT_EQ(large->pixelType, Sweep::PixelType::Float32);
  std::vector<float> a(sweep->PixelsPerFrame()), b(a.size());
  for (int k = 0; k < small->NumberOfFrames(); ++k)
  {
    small->CopyFrame(k, a.data());
    large->CopyFrame(k, b.data());
    for (std::size_t p = 0; p < a.size(); ++p)
    {
      ASSERT_NEAR(a[p], b[p], k < 3 ? 0 : 0.5 / 255 + 1e-6) << k;  // half a level, where planes are virtual
    }
  }
}

/// Where the planes of a pass lie along the sweep, in spacings of frames from the first.
std::vector<double> PlacesOfAPass(bool isSparse)
{
  const auto sweep = test::BlackSweep(4, kWidth, kHeight, kPixel, kSpacing);
  TrainingPlan plan;
  plan.virtualPlanes = 2;
  plan.sparse = isSparse;
  const std::unique_ptr<Engine> engine = Engine::Create("cpu");
  Report report(plan, {}, Exchange::Alone());
  Targets targets(sweep, {0, 2, 3}, plan, *engine, report, nullptr);  // frame 1 is held out
  EXPECT_TRUE(targets.SetPlanes({plan.virtualPlanes}));
  std::vector<double> places;
  for (const int frame : targets.Frames())
  {
    places.push_back((targets.Images().imageToReference[frame](2, 3) - sweep->imageToReference[0](2, 3)) / kSpacing);
  }
  return places;
}

TEST(Targets, APassHasSparseFramesTwiceAndAllElseOnce)
{
  const std::vector<double> sparse = {0, 0, 2 / 3., 4 / 3., 2, 2, 7 / 3., 8 / 3., 3, 3},
                            dense = {0, 2 / 3., 4 / 3., 2, 7 / 3., 8 / 3., 3};
  for (const auto& [expected, found] : {std::pair(sparse, PlacesOfAPass(true)), {dense, PlacesOfAPass(false)}})
  {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t k = 0; k < found.size(); ++k)
    {
      EXPECT_NEAR(found[k], expected[k], 1e-9) << k;
    }
  }
}

}  // namespace
}  // namespace bigus
