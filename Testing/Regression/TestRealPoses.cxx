// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What is decided about the poses of real sweeps, half resolution, and that the decision helps frames that had no part
// in it.
#include <string>

#include "Core/Deciding/PoseCorrection.h"
#include "Core/Engine/Engine.h"
#include "Core/Evaluation/Baselines.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Trainer/Trainer.h"
#include "Data/SweepData.h"
#include "Support/TestSupport.h"
#include "vtkBigusSequenceReader.h"
#include "vtkNew.h"

namespace bigus::test
{
namespace
{

Sweep Read(const std::string& path, const std::string& config = "")
{
  vtkNew<vtkBigusSequenceReader> reader;
  reader->SetFileName(path.c_str());
  if (!config.empty())
  {
    reader->SetConfigFileName(config.c_str());
  }
  reader->Update();
  return SweepFromImage(reader->GetOutput()).sweep->Reduced(2);
}

/// dB that interpolation between training frames predicts held-out frames better at corrected poses.
double HeldOutGain(const Sweep& sweep, int holdOut, PoseCorrection& correction)
{
  const auto [frames, heldOut] = SplitHoldOut(sweep.NumberOfFrames(), holdOut);
  correction = CorrectPoses(sweep, frames);
  const auto score = [frames = frames, heldOut = heldOut](const Sweep& at)
  {
    return ScoreFrames(at, heldOut,
                       [&](int frame, float* image) { PredictPoseInterpolation(at, frames, frame, image); })
        .psnr;
  };
  return score(AtCorrectedPoses(sweep, correction)) - score(sweep);
}

TEST(RealPoses, LiverIsSmoothedByFramesNumbers)
{
  BIGUS_REQUIRE_DATA(path, "liver-sweep/liver_sweep.igs.mha");
  PoseCorrection found;
  EXPECT_GT(HeldOutGain(Read(path), 8, found), 0.9) << found.decision.evidence;
  EXPECT_GE(found.strength, 1);
  EXPECT_EQ(found.trajectory.clock, FrameClock::Numbers);
  EXPECT_NEAR(found.trajectory.rotationNoise, 0.08, 0.03);
}

TEST(RealPoses, WirePhantomsAreSmoothed)
{
  const std::string folder = "nwire-fcal/fCal_Test_";
  for (const std::string name : {"Calibration", "Validation"})
  {
    BIGUS_REQUIRE_DATA(path, folder + name + "_3NWires_fCal2.0.igs.mha");
    BIGUS_REQUIRE_DATA(config, "nwire-fcal/PlusDeviceSet_fCal_Sim_VolumeReconstruction.xml");
    PoseCorrection found;
    EXPECT_GT(HeldOutGain(Read(path, config), 8, found), 5) << found.decision.evidence;
    EXPECT_GE(found.strength, 1);
  }
}

// Little is at stake there, so that what is chosen depends on what is held out. Interpolation between frames loses up to
// 0.21 dB by it, as it does at strength 1.
TEST(RealPoses, SpineIsSmoothedLittleWhateverIsHeldOut)
{
  BIGUS_REQUIRE_DATA(path, "spine-phantom/SpinePhantomFreehand.igs.mha");
  BIGUS_REQUIRE_DATA(config, "spine-phantom/PlusDeviceSet_SpinePhantomFreehandReconstructionOnly.xml");
  const Sweep sweep = Read(path, config);
  for (const int holdOut : {3, 4, 5, 8})
  {
    PoseCorrection found;
    EXPECT_GE(HeldOutGain(sweep, holdOut, found), -0.25) << holdOut << ": " << found.decision.evidence;
    EXPECT_LE(found.strength, 4) << holdOut << ": " << found.decision.evidence;
  }
}

TEST(RealPoses, BrainIsLeftAsTrackedWhateverIsHeldOut)
{
  BIGUS_REQUIRE_DATA(path, "brain-sweep/us_brain_sweep.igs.mha");
  const Sweep sweep = Read(path);
  for (const int holdOut : {0, 3, 4, 5})
  {
    const PoseCorrection found = CorrectPoses(sweep, SplitHoldOut(sweep.NumberOfFrames(), holdOut).first);
    EXPECT_EQ(found.trajectory.imageToReference, sweep.imageToReference) << holdOut << ": " << found.decision.evidence;
  }
}

/// PSNR of the held-out frames where `poses` put them.
double HeldOutAt(const std::vector<Eigen::Matrix4d>& poses, const Sweep& sweep, const TrainingResult& result)
{
  Sweep posed = sweep;
  posed.imageToReference = poses;
  const auto engine = Engine::Create("auto");
  engine->SetField(result.field);
  return ScoreFrames(posed, result.heldOutFrames,
                     [&](int frame, float* image) { engine->Render(posed.Plane(frame), ViewOutput::Intensity, image); })
      .psnr;
}

// The tracker errs, and the hand went on smoothly: what lies between two frames is met better at the same pixel than along
// their normals. Planes across, where interpolation along the normals is all there is to compare with, say -0.15 dB.
TEST(RealPoses, VirtualPlanesOfTheSpineFollowTheProbe)
{
  BIGUS_REQUIRE_DATA(path, "spine-phantom/SpinePhantomFreehand.igs.mha");
  BIGUS_REQUIRE_DATA(config, "spine-phantom/PlusDeviceSet_SpinePhantomFreehandReconstructionOnly.xml");
  const auto sweep = std::make_shared<const Sweep>(Read(path, config).Reduced(2));
  TrainerOptions options;
  options.holdOut = 4;
  options.gaussians = 3000;
  options.viewDependence = false;
  const auto score = [&sweep](const TrainingResult& result)
  { return HeldOutAt(sweep->imageToReference, *sweep, result); };
  const TrainingResult decided = Train(sweep, options);
  EXPECT_EQ(decided.settled.interpolation->path, FrameInterpolation::Path::Probe);
  options.interpolation = FrameInterpolation{FrameInterpolation::Path::Normals, true};
  EXPECT_GT(score(decided), score(Train(sweep, options)) + 0.1);
}

// Of this split frames' predictions confirm 0.51 +- 0.25 of smoothing, which tells nothing, and fields do. It is better even
// where the tracker put the frames held out.
TEST(RealPoses, FieldsDecideOnTheSpineWherePicturesCannot)
{
  BIGUS_REQUIRE_DATA(path, "spine-phantom/SpinePhantomFreehand.igs.mha");
  BIGUS_REQUIRE_DATA(config, "spine-phantom/PlusDeviceSet_SpinePhantomFreehandReconstructionOnly.xml");
  const auto sweep = std::make_shared<const Sweep>(Read(path, config).Reduced(2));
  TrainerOptions options;
  options.holdOut = 4;
  options.gaussians = 20000;
  options.viewDependence = false;
  const TrainingResult decided = Train(sweep, options);
  EXPECT_EQ(decided.settled.poseSmoothing, 1);
  EXPECT_NE(decided.decisions[0].evidence.find("in a trial"), std::string::npos) << decided.decisions[0].evidence;
  options.poseSmoothing = 0;
  const TrainingResult tracked = Train(sweep, options);
  EXPECT_GT(HeldOutAt(decided.imageToReference, *sweep, decided),
            HeldOutAt(tracked.imageToReference, *sweep, tracked) + 0.3);
  EXPECT_GT(HeldOutAt(sweep->imageToReference, *sweep, decided), HeldOutAt(sweep->imageToReference, *sweep, tracked));
}

}  // namespace
}  // namespace bigus::test
