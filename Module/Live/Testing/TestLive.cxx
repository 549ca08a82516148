// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field that follows the probe.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <thread>

#include "Core/Evaluation/Evaluation.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"
#include "Live/LiveSession.h"
#include "Live/LiveTraining.h"
#include "Support/Errors.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::LiveFrame;
using bigus::LiveOptions;
using bigus::LiveSession;
using bigus::LiveTraining;

LiveOptions Small()
{
  LiveOptions options;
  options.training.engine = "cpu";
  options.window = 16;
  return options;
}

LiveFrame FrameOf(const bigus::Sweep& sweep, int frame, double time)
{
  LiveFrame live;
  live.width = sweep.width;
  live.height = sweep.height;
  live.imageToReference = sweep.imageToReference[frame];
  live.timestamp = time;
  for (const float intensity : bigus::test::FrameOf(sweep, frame))
  {
    live.pixels.push_back(static_cast<std::uint8_t>(std::lround(255 * intensity)));
  }
  return live;
}

/// Hands over the frames named, one after another, with steps after each.
void Follow(LiveTraining& training, const bigus::Sweep& sweep, const std::vector<int>& frames, int steps)
{
  double time = 0;
  for (const int frame : frames)
  {
    EXPECT_TRUE(training.Add(FrameOf(sweep, frame, ++time)));
    for (int step = 0; step < steps; ++step)
    {
      training.Step();
    }
  }
}

TEST(Live, AFieldThatFollowedTheProbeShowsFramesItHasNotSeen)
{
  const auto sweep = bigus::test::RenderedSweep();
  const auto [frames, heldOut] = bigus::SplitHoldOut(sweep->NumberOfFrames(), 4);
  LiveTraining training(Small());
  Follow(training, *sweep, frames, 20);
  for (int step = 0; step < 100; ++step)
  {
    EXPECT_TRUE(training.Step());
  }
  const double live = bigus::ScoreField(training.Field(), *sweep, heldOut, "reference").psnr;
  EXPECT_GT(live, bigus::ScoreBaselines(*sweep, frames, heldOut).nearest.psnr);

  const bigus::TrainingResult finished = training.Finish(60).training;  // ends when all its steps are taken
  EXPECT_GT(bigus::ScoreField(finished.field, *sweep, heldOut, "reference").psnr, live);
  EXPECT_EQ(training.NumberOfGaussians(), finished.field.Size());
}

TEST(Live, TheSameCallsGiveTheSameBitsForAnyNumberOfThreads)
{
  const auto sweep = bigus::test::RenderedSweep();
  std::vector<bigus::GaussianField> fields;
  for (const int threads : {1, 3})
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    LiveTraining training(Small());
    Follow(training, *sweep, bigus::AllFrames(*sweep), 3);
    fields.push_back(training.Field());
  }
  EXPECT_EQ(fields[0].means, fields[1].means);
  EXPECT_EQ(fields[0].scales, fields[1].scales);
  EXPECT_EQ(fields[0].rotations, fields[1].rotations);
  EXPECT_EQ(fields[0].reflectivities, fields[1].reflectivities);
}

TEST(Live, AProbeThatStaysOrComesBackAddsFewGaussians)
{
  const auto sweep = bigus::test::RenderedSweep();
  std::vector<int> there = bigus::AllFrames(*sweep), more;
  LiveTraining training(Small());
  Follow(training, *sweep, there, 4);
  const std::size_t once = training.NumberOfGaussians();
  double time = 100;
  for (int frame = sweep->NumberOfFrames() - 1; frame >= 0; --frame)  // back
  {
    for (int stay = 0; stay < 3; ++stay)
    {
      training.Add(FrameOf(*sweep, frame, ++time));
      training.Step();
    }
  }
  EXPECT_GT(once, 800u);  // as many as lit pixels / 44
  EXPECT_LT(training.NumberOfGaussians(), once + once / 4);
}

TEST(Live, FramesThatSayNothingNewArePassedOver)
{
  const auto sweep = bigus::test::RenderedSweep();
  LiveTraining training(Small());
  EXPECT_TRUE(training.Add(FrameOf(*sweep, 0, 1)));
  EXPECT_FALSE(training.Add(FrameOf(*sweep, 1, 1)));    // repeated
  EXPECT_FALSE(training.Add(FrameOf(*sweep, 1, 0.5)));  // late
  LiveFrame black = FrameOf(*sweep, 1, 2);
  std::fill(black.pixels.begin(), black.pixels.end(), 0);
  EXPECT_FALSE(training.Add(black));
  EXPECT_TRUE(training.Add(FrameOf(*sweep, 1, 2)));
  EXPECT_EQ(training.NumberOfFrames(), 2u);
  EXPECT_FALSE(training.HasField());
  EXPECT_FALSE(training.Step());
  EXPECT_EQ(training.Field().Size(), 0u);
  std::vector<float> image(sweep->PixelsPerFrame(), 1.0f);
  training.Render(sweep->Plane(0), bigus::ViewOutput::Intensity, image.data());
  EXPECT_EQ(image, std::vector<float>(image.size(), 0.0f));
  EXPECT_THROW(training.Finish(1), bigus::Error);
}

TEST(Live, UnsoundFramesAreRefusedAndChangeNothing)
{
  const auto sweep = bigus::test::RenderedSweep();
  const std::vector<int> frames = bigus::AllFrames(*sweep);
  LiveTraining sound(Small()), disturbed(Small());
  Follow(sound, *sweep, frames, 1);
  double time = 0;
  for (const int frame : frames)
  {
    disturbed.Add(FrameOf(*sweep, frame, ++time));
    disturbed.Step();
    LiveFrame small = FrameOf(*sweep, frame, time + 0.5);
    small.width -= 1;
    EXPECT_THROW(disturbed.Add(small), bigus::Error);
    small.pixels.resize(static_cast<std::size_t>(small.width) * small.height);
    EXPECT_THROW(disturbed.Add(small), bigus::Error);
    LiveFrame none = FrameOf(*sweep, frame, time + 0.5);
    none.width = none.height = 0;
    none.pixels.clear();
    EXPECT_THROW(disturbed.Add(none), bigus::Error);
    LiveFrame nowhere = FrameOf(*sweep, frame, time + 0.5);
    nowhere.imageToReference(1, 3) = std::nan("");
    EXPECT_THROW(disturbed.Add(nowhere), bigus::Error);
    LiveFrame flat = FrameOf(*sweep, frame, time + 0.5);
    flat.imageToReference.col(0).setZero();
    EXPECT_THROW(disturbed.Add(flat), bigus::Error);
    EXPECT_THROW(disturbed.Add(FrameOf(*sweep, frame, std::numeric_limits<double>::infinity())), bigus::Error);
  }
  EXPECT_EQ(disturbed.Field().means, sound.Field().means);
  EXPECT_EQ(disturbed.Field().reflectivities, sound.Field().reflectivities);
}

TEST(Live, FramesAndGaussiansStayBelowTheirMaximum)
{
  const auto sweep = bigus::test::RenderedSweep();
  LiveOptions options = Small();
  options.maximumFrames = 18;
  options.maximumGaussians = 1000;
  LiveTraining training(options);
  // Frames 3 and 4 lie twice as near to each other as all others: of the frames before the window one of them goes first.
  bigus::Sweep uneven = *sweep;
  uneven.imageToReference[4](2, 3) = 0.5 * (uneven.imageToReference[3](2, 3) + uneven.imageToReference[4](2, 3));
  Follow(training, uneven, bigus::AllFrames(uneven), 1);
  EXPECT_LE(training.NumberOfGaussians(), 1000u);
  const bigus::Sweep kept = training.Frames();
  EXPECT_EQ(kept.NumberOfFrames(), 18);
  EXPECT_EQ(kept.imageToReference.front(), uneven.imageToReference.front());
  EXPECT_EQ(kept.imageToReference.back(), uneven.imageToReference.back());
  for (const Eigen::Matrix4d& pose : kept.imageToReference)
  {
    EXPECT_NE(pose, uneven.imageToReference[4]);
  }
}

// What pictures may take is counted in whole frames: two of each that is kept, four of each of the window's planes (a frame
// and one midway to the next), and those that wait.
TEST(Live, LargePicturesKeepFewerFramesOrAreRefused)
{
  const auto sweep = bigus::test::RenderedSweep();
  constexpr int kWindow = 16, kKept = 18, kOthers = 4 * 2 * kWindow + 64;
  const auto bytesFor = [&sweep](int kept) { return double(sweep->PixelsPerFrame()) * (2 * kept + kOthers); };
  LiveOptions options = Small();
  options.window = kWindow;
  options.memory = bytesFor(kKept);
  EXPECT_EQ(options.KeptFrames(sweep->width, sweep->height), std::size_t(kKept));
  EXPECT_EQ(options.KeptFrames(1, 1), options.maximumFrames);
  LiveTraining training(options);
  Follow(training, *sweep, bigus::AllFrames(*sweep), 0);
  EXPECT_EQ(training.NumberOfFrames(), std::size_t(kKept));

  options.memory = bytesFor(kWindow) - 1;
  LiveTraining without(options);
  bigus::test::ExpectRefused([&] { without.Add(FrameOf(*sweep, 0, 1)); }, {"48 x 40 pixels", "--memory"});
  EXPECT_EQ(without.NumberOfFrames(), 0u);
  LiveSession session(options);
  EXPECT_THROW(session.RequireRoom(sweep->width, sweep->height), bigus::Error);
  EXPECT_NO_THROW(session.RequireRoom(sweep->width, sweep->height - 1));
}

TEST(Live, OptionsOutOfRangeAreNamed)
{
  const auto fault = [](const std::function<void(LiveOptions&)>& spoil) -> std::string
  {
    LiveOptions options = Small();
    spoil(options);
    try
    {
      LiveTraining training(options);
    }
    catch (const bigus::Error& error)
    {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(fault([](LiveOptions& o) { o.window = 4; }).find("window"), std::string::npos);
  EXPECT_NE(fault([](LiveOptions& o) { o.batch = 17; }).find("batch"), std::string::npos);
  EXPECT_NE(fault([](LiveOptions& o) { o.maximumFrames = 3; }).find("maximumFrames"), std::string::npos);
  EXPECT_NE(fault([](LiveOptions& o) { o.maximumGaussians = 0; }).find("maximumGaussians"), std::string::npos);
  EXPECT_NE(fault([](LiveOptions& o) { o.memory = std::nan(""); }).find("memory"), std::string::npos);
  EXPECT_NE(fault([](LiveOptions& o) { o.training.holdOut = 4; }).find("held out"), std::string::npos);
  EXPECT_EQ(fault([](LiveOptions&) {}), "");
}

TEST(Live, ASessionServesSlicesToSeveralWhileFramesArrive)
{
  const auto sweep = bigus::test::RenderedSweep();
  LiveSession session(Small());
  std::vector<std::thread> viewers;
  for (int viewer = 0; viewer < 2; ++viewer)
  {
    viewers.emplace_back(
        [&session, &sweep]
        {
          std::vector<float> image(sweep->PixelsPerFrame());
          for (int slice = 0; slice < 50; ++slice)
          {
            session.Render(sweep->Plane(slice % sweep->NumberOfFrames()), bigus::ViewOutput::Intensity, image.data());
            EXPECT_TRUE(std::all_of(image.begin(), image.end(), [](float value) { return value >= 0 && value <= 1; }));
          }
        });
  }
  for (int frame = 0; frame < sweep->NumberOfFrames(); ++frame)
  {
    session.Add(FrameOf(*sweep, frame, frame));
  }
  LiveFrame bad = FrameOf(*sweep, 0, 100);
  bad.imageToReference.setZero();
  session.Add(bad);
  session.Add(FrameOf(*sweep, 0, 3));  // late
  for (std::thread& viewer : viewers)
  {
    viewer.join();
  }
  int calls = 0;
  const bigus::LiveResult result = session.Finish(1,
                                                  [&calls](const bigus::TrainingProgress&)
                                                  {
                                                    ++calls;
                                                    return true;
                                                  });
  EXPECT_GT(calls, 0);
  const LiveSession::State state = session.GetState();
  EXPECT_EQ(state.frames, static_cast<std::size_t>(sweep->NumberOfFrames()));
  EXPECT_EQ(state.refused, 1u);
  EXPECT_NE(state.lastError.find("live frame"), std::string::npos);
  EXPECT_EQ(state.passedOver, 1u);
  EXPECT_EQ(state.dropped, 0u);
  EXPECT_EQ(state.waiting, 0u);

  // What is served is the field that is handed out.
  const bigus::GaussianField field = session.Field();
  EXPECT_EQ(field.Size(), result.training.field.Size());
  EXPECT_EQ(result.sweep->NumberOfFrames(), sweep->NumberOfFrames());
  std::vector<float> served(sweep->PixelsPerFrame()), rendered(served.size());
  session.Render(sweep->Plane(12), bigus::ViewOutput::Intensity, served.data());
  const auto engine = bigus::Engine::Create("reference");
  engine->SetField(field);
  engine->Render(sweep->Plane(12), bigus::ViewOutput::Intensity, rendered.data());
  EXPECT_GT(bigus::Psnr(served.data(), rendered.data(), served.size()), 50);
}

TEST(Live, ASessionEndsWhileItWorks)
{
  const auto sweep = bigus::test::RenderedSweep();
  LiveSession session(Small());
  for (int frame = 0; frame < sweep->NumberOfFrames(); ++frame)
  {
    session.Add(FrameOf(*sweep, frame, frame));
  }
  EXPECT_THROW(
      {
        LiveSession none(Small());
        none.Finish(1);
      },
      bigus::Error);
}

TEST(Live, ASliceThatCannotBeIsAnErrorOfItsOwn)
{
  LiveSession session(Small());
  bigus::SlicePlane flat;
  flat.rowStep = flat.columnStep;
  float pixel = 0;
  EXPECT_THROW(session.Render(flat, bigus::ViewOutput::Intensity, &pixel), bigus::Error);
  flat.rowStep = {0, 1, 0};
  EXPECT_NO_THROW(session.Render(flat, bigus::ViewOutput::Intensity, &pixel));
}

}  // namespace
