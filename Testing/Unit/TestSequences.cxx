// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Several sequences of one patient in one field: joined without a seam.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "Core/Deciding/PoseCorrection.h"
#include "Core/Engine/Engine.h"
#include "Core/Evaluation/Baselines.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Poses/PoseError.h"
#include "Core/Trainer/Provenance.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/VirtualPlanes.h"
#include "Support/Errors.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::Join;
using bigus::Phantom;
using bigus::PhantomOptions;
using bigus::Sweep;
using bigus::test::Message;
using Shared = std::shared_ptr<const Sweep>;

/// Frames 1 mm apart of 12 x 12 pixels, all of one intensity.
Shared Flat(int frames, float value, double firstZ)
{
  auto sweep = bigus::test::BlackSweep(frames, 12, 12, 0.5, 1);
  std::fill_n(bigus::test::Pixels(*sweep), sweep->PixelsPerFrame() * frames, value);
  for (int k = 0; k < frames; ++k)
  {
    sweep->imageToReference[k](2, 3) = firstZ + k;
  }
  return sweep;
}

Shared Cut(const Sweep& sweep, int first, int count)
{
  return std::make_shared<const Sweep>(sweep.Range(first, count));
}

TEST(Sequences, FramesKeepOrderPixelsPosesAndTheirSequence)
{
  const Shared a = Flat(3, 0.25f, 0), b = Flat(2, 0.75f, 50);
  const Shared joined = Join({a, b});
  ASSERT_NO_THROW(joined->Validate());
  ASSERT_EQ(joined->NumberOfFrames(), 5);
  EXPECT_EQ(joined->sequences, (std::vector<int>{0, 0, 0, 1, 1}));
  for (int k = 0; k < 5; ++k)
  {
    EXPECT_EQ(joined->imageToReference[k], k < 3 ? a->imageToReference[k] : b->imageToReference[k - 3]);
    EXPECT_EQ(bigus::test::FrameOf(*joined, k), bigus::test::FrameOf(k < 3 ? *a : *b, k < 3 ? k : k - 3));
  }
  EXPECT_EQ(joined->Subset({1, 2, 4}).sequences, (std::vector<int>{0, 0, 1}));
  EXPECT_EQ(joined->Reduced(2).sequences, joined->sequences);
  EXPECT_EQ(bigus::test::FrameOf(joined->Range(2, 2), 1), bigus::test::FrameOf(*b, 0));
  EXPECT_EQ(Join({a}), a) << "one sequence is not copied";
  EXPECT_NE(Message([&] { joined->Range(3, 3); }).find("frame 5"), std::string::npos);
}

TEST(Sequences, BytesAndFloatsAreTheSameIntensities)
{
  auto bytes = std::make_shared<Sweep>(*Flat(2, 0, 0));
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(2 * bytes->PixelsPerFrame(), std::uint8_t(51));
  bytes->pixelType = Sweep::PixelType::UInt8;
  bytes->pixels = std::shared_ptr<const void>(pixels, pixels->data());
  EXPECT_EQ(Join({bytes, bytes})->pixelType, Sweep::PixelType::UInt8);
  const Shared mixed = Join({bytes, Flat(2, 0.5f, 9)});
  EXPECT_EQ(bigus::test::FrameOf(*mixed, 1)[7], 51 / 255.0f);
  EXPECT_EQ(bigus::test::FrameOf(*mixed, 3)[7], 0.5f);
}

TEST(Sequences, APixelIsLitWhereAnySequenceLightsIt)
{
  auto a = std::make_shared<Sweep>(*Flat(1, 0.5f, 0)), b = std::make_shared<Sweep>(*Flat(1, 0.5f, 5));
  std::vector<std::uint8_t> left(a->PixelsPerFrame(), 1), neither(a->PixelsPerFrame(), 1);
  left[0] = left[1] = 0;
  neither[1] = neither[2] = 0;
  a->mask = std::make_shared<const std::vector<std::uint8_t>>(left);
  b->mask = std::make_shared<const std::vector<std::uint8_t>>(neither);
  const Shared joined = Join({a, b});
  EXPECT_TRUE(joined->IsLit(0));
  EXPECT_FALSE(joined->IsLit(1));
  EXPECT_TRUE(joined->IsLit(2));
  EXPECT_EQ(bigus::test::FrameOf(*joined, 0)[0], 0) << "what its own mask hides";
  EXPECT_EQ(bigus::test::FrameOf(*joined, 1)[0], 0.5f);
}

TEST(Sequences, OtherSizesAreRefusedWithBoth)
{
  const std::string message = Message([] { Join({Flat(2, 0, 0), bigus::test::BlackSweep(2, 12, 14, 0.5, 1)}); });
  for (const char* part : {"sequence 1", "12 x 12", "sequence 2", "12 x 14", "Crop or pad"})
  {
    EXPECT_NE(message.find(part), std::string::npos) << message;
  }
  EXPECT_NE(Message([] { Join({}); }), "");
}

TEST(Sequences, EachIsHeldOutFromByItsOwnNumbers)
{
  const Shared joined = Join({Flat(6, 0, 0), Flat(5, 0, 10)});
  const auto [training, heldOut] = bigus::SplitHoldOut(*joined, AllFrames(*joined), 4);
  EXPECT_EQ(heldOut, (std::vector<int>{2, 8}));  // 2 of either
  EXPECT_EQ(training.size(), 9u);
  const auto [rest, validation] = bigus::SplitHoldOut(*joined, training, 3);
  EXPECT_EQ(validation, (std::vector<int>{1, 5, 7}));  // second and fifth of 0 1 3 4 5, second of 6 7 9 10
  EXPECT_EQ(LongestSequence(*joined, training), (std::vector<int>{0, 1, 3, 4, 5}));
}

TEST(Sequences, NothingIsMadeOrPredictedBetweenTwo)
{
  const Shared joined = Join({Flat(4, 0.2f, 0), Flat(3, 0.8f, 4)});  // as near to each other as frames are
  const auto planes = bigus::AddVirtualPlanes(*joined, AllFrames(*joined), 2);
  EXPECT_EQ(planes->NumberOfFrames(), 7 + 2 * (3 + 2));
  for (int k = 0; k < planes->NumberOfFrames(); ++k)
  {
    const float value = bigus::test::FrameOf(*planes, k)[40];
    EXPECT_LT(std::min(std::abs(value - 0.2f), std::abs(value - 0.8f)), 1e-4f) << k;
  }
  std::vector<float> image(joined->PixelsPerFrame());
  const std::vector<int> training = {0, 1, 2, 3, 5, 6};
  bigus::PredictNeighbourAverage(*joined, training, 4, image.data());
  EXPECT_FLOAT_EQ(image[40], 0.8f);
  bigus::PredictPoseInterpolation(*joined, training, 4, image.data());
  EXPECT_FLOAT_EQ(image[40], 0.8f);
  // A plane between the two is enclosed by neither.
  bigus::SlicePlane between = joined->Plane(3);
  between.origin.z() = 3.5;
  std::vector<std::uint8_t> enclosed(image.size());
  bigus::FindEnclosed(*joined, AllFrames(*joined), between, enclosed.data());
  EXPECT_EQ(std::count(enclosed.begin(), enclosed.end(), 1), 0);
}

PhantomOptions SmallSequences(int frames)
{
  PhantomOptions world;
  world.frames = frames;
  world.width = world.height = 96;
  world.pixelSize = 0.3;
  return world;
}

TEST(Sequences, PosesAreCorrectedInEachAloneAndNotSmearedOverAnOffset)
{
  PhantomOptions world = SmallSequences(64);
  world.trackingNoise = 0.2;
  world.trackingRotationNoise = 0.3;
  const Phantom phantom(world);
  const Sweep whole = phantom.MakeSweep();
  // The second half was recorded after the reference marker had slipped, by less than three steps of the probe.
  const Eigen::Vector3d slip(0.6, -0.4, 1.2);
  auto second = std::make_shared<Sweep>(whole.Range(32, 32));
  std::vector<Eigen::Matrix4d> truth;
  for (int k = 0; k < 64; ++k)
  {
    truth.push_back(phantom.TruePlane(k).ImageToReference());
    if (k >= 32)
    {
      truth[k].block<3, 1>(0, 3) += slip;
      second->imageToReference[k - 32].block<3, 1>(0, 3) += slip;
    }
  }
  const Shared first = Cut(whole, 0, 32), joined = Join({first, second});

  bigus::TrainerOptions options;
  options.holdOut = 8;
  options.gaussians = 500;
  options.iterations = 10;
  options.virtualPlanes = 0;
  options.elevationSigma = 0.5;
  options.probeElevationSigma = 0.8;
  options.interpolation = bigus::FrameInterpolation{};
  const bigus::TrainingResult trained = Train(joined, options);

  // The same bits as each alone.
  std::vector<Eigen::Matrix4d> alone;
  for (const Shared& sequence : {first, Shared(second)})
  {
    const auto [frames, heldOut] = bigus::SplitHoldOut(32, 8);
    const bigus::PoseCorrection found = bigus::CorrectPoses(*sequence, frames);
    ASSERT_TRUE(found.trajectory.IsChanged()) << found.decision.evidence;
    alone.insert(alone.end(), found.trajectory.imageToReference.begin(), found.trajectory.imageToReference.end());
  }
  EXPECT_EQ(trained.imageToReference, alone);
  EXPECT_EQ(trained.heldOutFrames, (std::vector<int>{4, 12, 20, 28, 36, 44, 52, 60}));

  // Beside the seam frames lie where they were, which a path through both cannot keep.
  const auto errorBesideTheSeam = [&](const std::vector<Eigen::Matrix4d>& poses)
  {
    double sum = 0;
    for (int k = 30; k < 34; ++k)
    {
      sum += bigus::CornerDistance(poses[k], truth[k], 96, 96) / 4;
    }
    return sum;
  };
  Sweep asOne = *joined;
  asOne.sequences.clear();
  const std::vector<Eigen::Matrix4d> through =
      bigus::SmoothTrajectory(asOne, {1, bigus::FrameClock::Times}).imageToReference;
  EXPECT_LT(errorBesideTheSeam(trained.imageToReference), errorBesideTheSeam(joined->imageToReference));
  EXPECT_LT(errorBesideTheSeam(trained.imageToReference), 0.7 * errorBesideTheSeam(through));

  // What was done is told for each, and names no file.
  std::vector<std::string> lines;
  AddTrainingProvenance(lines, trained, *joined, false);
  const auto value = [&lines](const std::string& key)
  {
    const auto found = std::find_if(lines.begin(), lines.end(),
                                    [&key](const std::string& line) { return line.rfind(key + "=", 0) == 0; });
    return found == lines.end() ? std::string("missing") : found->substr(key.size() + 1);
  };
  EXPECT_EQ(value("sequences"), "2");
  EXPECT_NE(value("poses.sequence1").find("corrected by"), std::string::npos);
  EXPECT_NE(value("poses.sequence2").find("corrected by"), std::string::npos);
  EXPECT_NE(value("decision.poses of sequence 2"), "missing");
}

TEST(Sequences, TwoHalvesGiveAFieldAsGoodAsTheWhole)
{
  const int frames = 40, half = 20;
  const Phantom phantom(SmallSequences(frames));
  const Sweep whole = phantom.MakeSweep();
  // The phantom's own pictures half way between frames, where no field was trained, but for the gap between the halves.
  auto truth = std::make_shared<Sweep>();
  truth->width = truth->height = 96;
  for (int k = 0; k + 1 < frames; ++k)
  {
    if (k != half - 1)
    {
      truth->imageToReference.push_back(
          bigus::PlaneBetween(phantom.TruePlane(k), phantom.TruePlane(k + 1), 0.5).ImageToReference());
    }
  }
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(truth->PixelsPerFrame() * truth->NumberOfFrames());
  for (int k = 0; k < truth->NumberOfFrames(); ++k)
  {
    phantom.Frame(truth->Plane(k), pixels->data() + k * truth->PixelsPerFrame());
  }
  truth->pixels = std::shared_ptr<const void>(pixels, pixels->data());
  const auto score = [&](const Shared& sweep, int seed)
  {
    bigus::TrainerOptions options;
    options.automatic = false;
    options.gaussians = 6000;
    options.iterations = 240;
    options.seed = seed;
    const auto engine = bigus::Engine::Create("auto");
    engine->SetField(Train(sweep, options).field);
    std::vector<float> image(truth->PixelsPerFrame()), wanted(image.size());
    double sum = 0;
    for (int k = 0; k < truth->NumberOfFrames(); ++k)
    {
      engine->Render(truth->Plane(k), bigus::ViewOutput::Intensity, image.data());
      truth->CopyFrame(k, wanted.data());
      sum += bigus::Psnr(image.data(), wanted.data(), image.size()) / truth->NumberOfFrames();
    }
    return sum;
  };
  const Shared one = std::make_shared<const Sweep>(whole);
  const Shared two = Join({Cut(whole, 0, half), Cut(whole, half, frames - half)});
  std::vector<double> wholes, halves;
  for (const int seed : {1, 2, 3})
  {
    wholes.push_back(score(one, seed));
    halves.push_back(score(two, seed));
  }
  // What another seed changes is no difference.
  const auto [least, most] = std::minmax_element(wholes.begin(), wholes.end());
  const double mean = std::accumulate(wholes.begin(), wholes.end(), 0.0) / 3;
  const double meanOfHalves = std::accumulate(halves.begin(), halves.end(), 0.0) / 3;
  EXPECT_GT(meanOfHalves, mean - std::max(0.05, *most - *least)) << *least << " to " << *most << " dB";
  RecordProperty("whole_dB", std::to_string(mean));
  RecordProperty("halves_dB", std::to_string(meanOfHalves));
  std::printf("whole %.3f dB, halves %.3f dB\n", mean, meanOfHalves);
}

}  // namespace
