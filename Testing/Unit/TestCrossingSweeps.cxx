// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sweeps that cross: which do, how a Gaussian counts where its own sweep looks, and what that gains on held-out frames.

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "Core/Engine/ViewEngine.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/CrossingSweeps.h"
#include "Core/Training/Judging.h"
#include "Support/Fields.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::GaussianField;
using bigus::RecordedViews;
using bigus::Sweep;

/// Made once, because that takes longer than what is done with it.
std::shared_ptr<const Sweep> SweepAt(double degrees)
{
  static std::map<double, std::shared_ptr<const Sweep>> known;
  std::shared_ptr<const Sweep>& sweep = known[degrees];
  if (sweep)
  {
    return sweep;
  }
  bigus::PhantomOptions made;
  made.width = made.height = 40;
  made.pixelSize = 0.4;
  made.frames = 32;
  made.sweepAngle = degrees;
  return sweep = std::make_shared<const Sweep>(bigus::Phantom(made).MakeSweep());
}

std::shared_ptr<const Sweep> Crossing(double degrees)
{
  return bigus::Join({SweepAt(0), SweepAt(degrees)});
}

bool DoCross(const Sweep& sweep)
{
  return bigus::SequencesCross(sweep, AllFrames(sweep));
}

TEST(CrossingSweeps, CrossEachOtherAndNotThemselves)
{
  EXPECT_TRUE(DoCross(*Crossing(90)));
  EXPECT_TRUE(DoCross(*Crossing(-45)));
  EXPECT_FALSE(DoCross(*Crossing(15)));
  EXPECT_FALSE(DoCross(*SweepAt(0)));
  std::vector<int> few = AllFrames(*Crossing(90));
  few.resize(32 + 6);
  EXPECT_FALSE(bigus::SequencesCross(*Crossing(90), few)) << "6 frames tell little by themselves";
  // Frames of one sequence are not taken apart.
  Sweep turning = *Crossing(90);
  turning.sequences.clear();
  EXPECT_FALSE(DoCross(turning));
}

/// Far from where sweeps meet there is only one, and a Gaussian there looks alike from anywhere.
TEST(CrossingSweeps, AGaussianCountsWhereItsOwnSweepLooks)
{
  const std::shared_ptr<const Sweep> sweep = Crossing(90);
  const std::vector<int> frames = AllFrames(*sweep);
  const RecordedViews views = RecordedViews::Of(*sweep, frames);
  std::vector<int> sequenceOfView(frames.size());
  std::transform(frames.begin(), frames.end(), sequenceOfView.begin(), [&](int frame) { return frame < 32 ? 0 : 1; });
  GaussianField field;
  field.Resize(2);
  field.means = {{0.3, 8, -0.4}, {0, 8, 0.5}};  // where they meet
  field.reflectivities = {0.7, -0.4};
  const GaussianField given = field;
  const bigus::ViewDependence view = bigus::Apart(field, {0, 1}, views, sequenceOfView);
  const bigus::ViewedReflectivities at(field, view);
  for (const int frame : {12, 16, 20, 44, 48, 52})
  {
    const std::vector<double> r = at.At(sweep->Plane(frame), 1);
    const bool isFirst = frame < 32;
    EXPECT_NEAR(r[0], isFirst ? 0.7 : 0, 0.05) << frame;
    EXPECT_NEAR(r[1], isFirst ? 0 : -0.4, 0.03) << frame;
  }
  // Without a direction each counts by its sweep's share of the planes there, which is near a half.
  EXPECT_NEAR(field.reflectivities[0] / given.reflectivities[0], 0.5, 0.2);

  std::vector<int> one(frames.size(), 0);
  field = given;
  const bigus::ViewDependence same = bigus::Apart(field, {0, 0}, views, one);
  EXPECT_NEAR(field.reflectivities[0], 0.7, 1e-12);
  EXPECT_LT(same.terms[0].norm(), 1e-9) << "of one sequence nothing is set apart";
}

struct Trained
{
  bigus::TrainingResult result;
  double psnr = 0;  // of frames held out
};

bigus::TrainerOptions Options(bool viewDependence)
{
  bigus::TrainerOptions options;
  options.holdOut = 8;
  options.gaussians = 6000;
  options.iterations = 240;
  options.poseSmoothing = 0;
  options.probeElevationSigma = 0.8;
  options.viewDependence = viewDependence;
  return options;
}

Trained TrainedWith(bool viewDependence)
{
  const std::shared_ptr<const Sweep> sweep = Crossing(90);
  Trained trained{bigus::Train(sweep, Options(viewDependence))};
  const auto engine = bigus::Engine::Create("cpu");
  bigus::SeenField seen(*engine, trained.result.field, trained.result.view ? &*trained.result.view : nullptr);
  for (const int frame : trained.result.heldOutFrames)
  {
    seen.LookFrom(sweep->Plane(frame));
    trained.psnr += bigus::MeanPsnr(*engine, *sweep, {frame}) / trained.result.heldOutFrames.size();
  }
  return trained;
}

TEST(CrossingSweeps, HeldOutFramesGainByTrainingEachByItself)
{
  const Trained with = TrainedWith(true), without = TrainedWith(false);
  ASSERT_TRUE(with.result.view);
  EXPECT_GT(with.psnr, without.psnr + 1);
  EXPECT_TRUE(with.result.finished);
  EXPECT_LE(with.result.field.Size(), 6000u);
  EXPECT_EQ(without.result.settled.elevationSigma, 0.8);
  EXPECT_EQ(with.result.settled.elevationSigma, 0.0) << "each sequence by itself cannot tell a beam";
  EXPECT_TRUE(std::is_sorted(with.result.log.begin(), with.result.log.end(),
                             [](const auto& a, const auto& b) { return a.iteration < b.iteration; }));

  // What was settled trains the same field again, with any number of threads.
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const bigus::TrainingResult again = bigus::Train(Crossing(90), with.result.settled);
  EXPECT_TRUE(bigus::test::SameField(with.result.field, again.field));
  EXPECT_EQ(with.result.view->terms, again.view->terms);
}

/// Nothing is kept of sweeps that are trained by themselves, so they are trained again.
TEST(CrossingSweeps, GoOnFromACheckpointWithTheSameBits)
{
  const std::shared_ptr<const Sweep> sweep = Crossing(90);
  std::string kept;
  bigus::Checkpoints checkpoints;
  checkpoints.interval = 0;
  checkpoints.save = [&kept](const std::string& state) { kept = state; };
  int told = 0;
  const auto whole = bigus::Train(sweep, Options(true), nullptr, [&told](const auto&) { return ++told > 0; });
  int left = told * 3 / 4;
  const auto stopped = bigus::Train(
      sweep, Options(true), nullptr, [&left](const auto&) { return --left > 0; }, checkpoints);
  ASSERT_TRUE(stopped.aborted);
  ASSERT_FALSE(kept.empty());
  const auto resumed = bigus::Train(sweep, Options(true), nullptr, {}, {60, {}, kept});
  EXPECT_TRUE(bigus::test::SameField(whole.field, resumed.field));
  EXPECT_EQ(whole.view->terms, resumed.view->terms);
}

/// One that shows nothing teaches nothing, and the other is learned.
TEST(CrossingSweeps, ABlackSweepLeavesTheOther)
{
  const std::shared_ptr<const Sweep> shown = SweepAt(0);
  auto black = bigus::test::BlackSweep(32, 40, 40, 0.4, 0.5);
  black->imageToReference = SweepAt(90)->imageToReference;
  black->timestamps = shown->timestamps;
  bigus::TrainerOptions options = Options(true);
  options.keep = bigus::KeptKinds::Parse("all");
  const bigus::TrainingResult trained = bigus::Train(bigus::Join({shown, black}), options);
  const auto engine = bigus::Engine::Create("cpu");
  bigus::SeenField seen(*engine, trained.field, &*trained.view);
  const Sweep both = *bigus::Join({shown, black});
  for (const int frame : {16, 48})
  {
    seen.LookFrom(both.Plane(frame));
    EXPECT_GT(bigus::MeanPsnr(*engine, both, {frame}), 18) << frame;
  }
}

/// What a caller gets who stops amid them is what was there before, or the seeds after a step.
TEST(CrossingSweeps, WhoSaysStopGetsAField)
{
  for (const int most : {3, 150, 300})
  {
    int told = 0;
    const bigus::TrainingResult stopped = bigus::Train(Crossing(90), Options(true), nullptr,
                                                       [&](const bigus::TrainingProgress&) { return ++told < most; });
    EXPECT_TRUE(stopped.aborted) << most;
    EXPECT_GT(stopped.field.Size(), 0u) << most;
    EXPECT_FALSE(stopped.view) << most;
  }
}

}  // namespace
