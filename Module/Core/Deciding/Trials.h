// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Short trainings on a part of the sweep, scored on frames of it that they do not see. Private to Core.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Core/Deciding/TrialKeeper.h"
#include "Core/Evaluation/CrossPlanes.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/FrameInterpolation.h"
#include "Core/Training/TrainingPlan.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

/// Mean gain of one trial over another and the standard error of that mean, paired frame by frame.
struct Gain
{
  double mean = 0, error = 0;  ///< dB
  bool mostGain = false;       ///< at least half of the validation frames gain: one frame does not decide
  double across = 0;           ///< dB, mean gain on planes across the frames
  double anywhere = 0;         ///< dB, gain at a plane at random, see Trials

  /// "+0.12 +- 0.03 dB, across +0.05 dB, anywhere +0.20 dB".
  std::string ToString() const;
};

/// Runs trials and remembers them: equal choices are trained once.
///
/// What a field errs at a plane at random is between what it errs at a frame that it was trained on, s, and at a
/// validation frame, v, which lies amid a gap twice as wide as the sweep's. What changes from frame to frame at random is
/// known at d1 and d2 mm from two frames with a variance in proportion to m = d1 d2 / (d1 + d2). So at a distance drawn at
/// random the mean squared error is s + (v - s) E[m] / m_v, with the mean over all gaps g of the sweep
///
///     E[m] = (1/6) sum g^2 / sum g,
///
/// g / 6 for even gaps, where m_v = g / 2 and the share of v is a third.
class Trials
{
public:
  /// Of `frames`, which are of one sequence of the sweep, the middle ones are tried on, for a training on `trained` frames.
  /// `asked` is what the caller set; it bounds what a trial may do. Finished trials and the one under way are kept by
  /// `keeper`. `poses` names those that the sweep is at, where trials are made at several. Of `exchange` see TrainingLoop.
  /// What is referred to must outlive this, but for the sweep.
  Trials(const Sweep& sweep, const std::vector<int>& frames, std::size_t trained, const TrainerOptions& asked,
         const ProgressCallback& progress, TrialKeeper& keeper, Exchange& exchange, std::string poses = {});

  /// What `candidate` gains over `best` after so many passes; nothing when the callback said stop.
  std::optional<Gain> Compare(const TrainingPlan& candidate, const TrainingPlan& best, double passes);

  /// What these poses gain over those of `others`. Each predicts validation frames where its own poses put them.
  std::optional<Gain> ComparePoses(Trials& others, const TrainingPlan& plan, double passes);

  /// How well an interpolation predicts frames from their neighbours: mean PSNR, dB; nothing when the callback said
  /// stop. Costs no training.
  std::optional<double> Predict(const FrameInterpolation& interpolation);

  /// Asks the callback; false from when it first said stop.
  bool Proceed();
  bool Stopped() const { return stopped_; }

private:
  /// A plane across the frames and what all frames, those for validation included, show there by interpolation.
  struct AcrossTruth
  {
    CrossPlane cross;
    std::vector<float> image;
  };
  TrialScores Score(const TrainingPlan& plan, double passes);
  TrialScores Train(TrainingPlan plan, double passes, const std::string& name);
  void MakeAcross();
  void MeasureShares();
  double Anywhere(const TrialScores& scores) const;
  std::shared_ptr<const Sweep> WithVirtualPlanes(const TrainingPlan& plan);

  const TrainerOptions& asked_;
  const ProgressCallback& progress_;
  TrialKeeper& keeper_;
  Exchange& exchange_;
  std::string poses_;                   // begins the names of trials
  std::shared_ptr<const Sweep> sweep_;  // what is tried on
  std::vector<int> training_, validation_;
  std::vector<double> shares_;  // E[m] / m_v of each validation frame, 0 to 1
  std::vector<AcrossTruth> across_;
  double pixelSize_ = 0;  // mm, of sweep_
  double share_ = 1;
  std::map<std::pair<int, std::string>, std::shared_ptr<const Sweep>> withVirtualPlanes_;
  int trained_ = 0;
  bool stopped_ = false;
};

}  // namespace bigus
