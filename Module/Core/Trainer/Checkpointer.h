// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What of a training is kept so that it can go on after its program has ended, and the bytes that hold it. Private to
// Core.
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "Core/Deciding/Decision.h"
#include "Core/Deciding/TrialKeeper.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/Stopwatch.h"
#include "Core/Training/TrainingLoop.h"

namespace bigus
{

class Exchange;

/// Names and texts: the options of a training, say.
using NamedTexts = std::vector<std::pair<std::string, std::string>>;

/// All that decides what a training ends with: the program's version, the engine and its instructions, the sequence, the
/// field to continue from, and every option but the time limit, which may be another when a training goes on.
NamedTexts IdentityOf(const Sweep& sweep, const TrainerOptions& options, const GaussianField* start);

/// What deciding ends with.
struct Settlement
{
  NamedTexts options;  ///< as ListOptions spells them, less the time limit
  std::vector<Decision> decisions;
  std::vector<Eigen::Matrix4d> imageToReference;  ///< of all frames
};

/// Keeps the scores of finished trials until all is decided, then what was decided; the state of the training's own loop,
/// whose first stage comes before trials; and that of the trial that is under way. Everything else follows from these
/// and is done again.
class Checkpointer : public TrialKeeper
{
public:
  /// What is referred to must outlive this. Throws Error when there is a state to go on from and it is damaged or of a
  /// training with another identity. All processes of the `exchange` have one and make the same calls; `checkpoints` of the
  /// first count.
  Checkpointer(const Checkpoints& checkpoints, NamedTexts identity, Exchange& exchange);

  /// Seconds that the training took before.
  double Seconds() const { return seconds_; }

  const TrialScores* FindTrial(const std::string& name) const override;
  void NoteTrial(const std::string& name, const TrialScores& scores) override;
  std::string TakeTrial(const std::string& name) override;
  Keeping KeepingOfTrial(const std::string& name) override;

  const std::optional<Settlement>& Settled() const { return settled_; }
  /// What the training's own loop has done is kept if it goes on with it.
  void Settle(Settlement settlement, bool keepsTraining);

  /// As TakeTrial and KeepingOfTrial, of the training's own loop.
  std::string TakeTraining();
  Keeping KeepingOfTraining();

  /// Writes all that is known.
  void Save();
  /// Writes what is not written yet, and nothing from then on: what comes is of no use to a training that goes on.
  void Close();

private:
  Keeping KeepIn(std::function<void(std::string)> take);
  bool IsDue();
  void Write();
  void Load(std::string_view bytes);
  void RequireSameTraining(const NamedTexts& then) const;

  const Checkpoints& checkpoints_;
  Exchange& exchange_;
  bool isKept_;  // by the first process
  NamedTexts identity_;
  double seconds_ = 0;
  Stopwatch watch_;
  double saved_ = 0;                         // s, when
  bool isClosed_ = false, isSaved_ = false;  // saved: nothing was noted since
  std::map<std::string, TrialScores> trials_;
  std::optional<Settlement> settled_;
  std::string training_;            // the state of the training's own loop
  std::string trial_, trialState_;  // the trial under way
};

}  // namespace bigus
