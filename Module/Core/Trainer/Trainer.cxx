// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Trainer/Trainer.h"

#include <algorithm>
#include <functional>
#include <tuple>
#include <utility>

#include "Core/Deciding/DecisionRules.h"
#include "Core/Deciding/Decisions.h"
#include "Core/Engine/Exchange.h"
#include "Core/Model/Error.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/OpenCv.h"
#include "Core/Trainer/Checkpointer.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/OptionList.h"
#include "Core/Training/TrainingLoop.h"

namespace bigus
{
namespace
{

/// The most of a limited time that deciding takes; training gets the larger part.
constexpr double kDecidingTime = 1.0 / 5;

/// Seconds of a time limit below which nothing is tried: a fifth of it would end amid the first comparison.
constexpr double kLeastTimeToTry = 30;

/// Seconds that deciding takes for a second of the training that is left after the first stage, where the number of
/// Gaussians is open and where it is given; for what is told of the time left. Brain and spine sweep: 0.45 and 0.49; liver
/// sweep with a given number: 0.1.
constexpr double kDecidingShare = 0.45, kDecidingShareGiven = 0.1;

/// Gaussians that are trained for a second of a time limit at the most. With more each is seen too seldom. In 10 s and
/// 20 s two threads take the liver sweep (full size) to 38.7 dB with 200,000 and 40.1 dB with 300,000.
constexpr double kGaussiansPerSecond = 20000;

/// Seconds that a time limit leaves to training at the least, since 0 would mean no limit. So short that none is left for
/// a step of a training whose checkpoint says that the limit has passed.
constexpr double kLeastTime = 1e-9;

/// The option that may be another when a training goes on.
const std::string kTimeLimit = "TimeLimit";

/// Refuses what no field can be seeded from: a single plane says nothing about space, equal pixels nothing at all.
void RequireSomethingToLearn(const Sweep& sweep, const std::vector<int>& frames)
{
  if (frames.size() < 2)
  {
    throw Error(
        "Trainer: there is one frame to train on; a field needs at least two, at different places. (A field that "
        "exists already can be continued with one.)");
  }
  std::vector<float> image(sweep.PixelsPerFrame());
  sweep.CopyFrame(frames[0], image.data());
  const float level = image[0];
  for (int frame : frames)
  {
    sweep.CopyFrame(frame, image.data());
    if (std::any_of(image.begin(), image.end(), [level](float value) { return value != level; }))
    {
      return;
    }
  }
  throw Error("Trainer: " +
              (level == 0 ? std::string("all frames are black")
                          : "every pixel of all frames is " + std::to_string(level) + " (of 1)") +
              ", so there is nothing to learn. Check the file, the clip region and the pixel type.");
}

/// Takes the tracker's noise out of the poses of all frames, by pixels of `frames` alone, and reports it. Every sequence
/// is corrected as if it were alone, because it is a motion and a registration of its own. Poses are kept where `goOn`
/// says stop.
std::shared_ptr<const Sweep> Correct(std::shared_ptr<const Sweep> sweep, const std::vector<int>& frames,
                                     TrainerOptions& options, std::vector<Decision>& decisions,
                                     const std::function<bool()>& goOn)
{
  const std::vector<std::vector<int>> sequences = BySequence(*sweep, AllFrames(*sweep));
  auto corrected = std::make_shared<Sweep>(*sweep);
  std::vector<double> strengths;
  bool isChanged = false, isOpen = false;
  for (std::size_t k = 0; k < sequences.size(); ++k)
  {
    const int first = sequences[k].front();
    const Sweep sequence = sweep->Range(first, static_cast<int>(sequences[k].size()));
    std::vector<int> own;
    for (const int frame : frames)
    {
      if (sweep->SequenceOf(frame) == sweep->SequenceOf(first))
      {
        own.push_back(frame - first);
      }
    }
    PoseCorrection correction =
        CorrectPoses(sequence, own, {options.poseSmoothing}, [&goOn](double) { return goOn(); });
    if (correction.aborted)
    {
      options.poseSmoothing = 0;
      return sweep;
    }
    // What pictures change where the tracker has no noise to take out is found by leaving the choice to them once more: a
    // strength of 0 keeps every pose.
    isOpen = isOpen || (correction.strength == 0 && correction.trajectory.IsChanged());
    strengths.push_back(correction.strength);
    if (sequences.size() > 1)
    {
      correction.decision.what += " of sequence " + std::to_string(k + 1);
    }
    decisions.push_back(correction.decision);
    isChanged = isChanged || correction.trajectory.IsChanged();
    std::copy(correction.trajectory.imageToReference.begin(), correction.trajectory.imageToReference.end(),
              corrected->imageToReference.begin() + first);
  }
  // One option stands for all sequences, so it is settled where all chose the same.
  if (!isOpen && std::count(strengths.begin(), strengths.end(), strengths[0]) == std::ptrdiff_t(strengths.size()))
  {
    options.poseSmoothing = strengths[0];
  }
  return isChanged ? corrected : sweep;
}

/// The options with the plan's choices.
TrainerOptions Settled(TrainerOptions options, const TrainingPlan& plan)
{
  options.gaussians = plan.gaussians;
  options.elevationSigma = plan.elevationSigma;
  options.probeElevationSigma = plan.probeElevationSigma;
  options.virtualPlanes = plan.virtualPlanes;
  options.interpolation = plan.interpolation;
  options.iterations = plan.iterations;
  options.loss = plan.loss;
  return options;
}

/// All but the time limit, which may be another when a training goes on.
NamedTexts TextsOf(const TrainerOptions& options)
{
  NamedTexts texts;
  for (const OptionText& option : ListOptions(options))
  {
    if (option.info.name != kTimeLimit)
    {
      texts.emplace_back(option.info.name, option.value);
    }
  }
  return texts;
}

/// The sweep at the poses that were settled, with all options and decisions.
std::shared_ptr<const Sweep> Restore(const Settlement& settled, const std::shared_ptr<const Sweep>& sweep,
                                     TrainerOptions& options, std::vector<Decision>& decisions)
{
  for (const auto& [name, value] : settled.options)
  {
    SetOption(options, name, value);
  }
  options.Validate();
  decisions = settled.decisions;
  auto posed = std::make_shared<Sweep>(*sweep);
  if (settled.imageToReference.size() != posed->imageToReference.size())
  {
    throw Error("The checkpoint has poses of " + std::to_string(settled.imageToReference.size()) +
                " frames; there are " + std::to_string(posed->imageToReference.size()) +
                ". Begin anew, without the checkpoint.");
  }
  posed->imageToReference = settled.imageToReference;
  posed->ValidateLayout();
  return posed;
}

/// Throws Error in all processes unless they were asked for the same training.
void RequireSameTraining(Exchange& exchange, NamedTexts identity, double timeLimit)
{
  identity.emplace_back(kTimeLimit, NumberText(timeLimit));
  std::string mine;
  for (const auto& [name, text] : identity)
  {
    mine += name + ": " + text + "\n";
  }
  const std::vector<std::string> all = exchange.Gather(mine);
  for (std::size_t rank = 1; rank < all.size(); ++rank)
  {
    if (all[rank] == all[0])
    {
      continue;
    }
    const auto differ = std::mismatch(all[0].begin(), all[0].end(), all[rank].begin(), all[rank].end()).first;
    const std::string same(all[0].begin(), differ);
    const std::size_t begin = same.rfind('\n') + 1;  // 0 in the first line
    const auto line = [begin](const std::string& text) { return text.substr(begin, text.find('\n', begin) - begin); };
    throw Error(
        "Trainer: processes that train together need the same sequence, options, program and instructions. The "
        "first has '" +
        line(all[0]) + "', and process " + std::to_string(rank) + " has '" + line(all[rank]) + "'.");
  }
}

}  // namespace

TrainingResult Train(std::shared_ptr<const Sweep> sweep, const TrainerOptions& options, const GaussianField* start,
                     const ProgressCallback& progress, const Checkpoints& checkpoints, Exchange* exchange)
try
{
  const Stopwatch call;
  options.Validate();
  sweep->Validate();
  if (exchange && exchange->Size() == 1)
  {
    exchange = nullptr;
  }
  NamedTexts identity;
  if (exchange || checkpoints.save || !checkpoints.resume.empty())
  {
    identity = IdentityOf(*sweep, options, start);
  }
  if (exchange)
  {
    RequireSameTraining(*exchange, identity, options.timeLimit);
  }
  Checkpointer keeper(checkpoints, std::move(identity), exchange);
  const Stopwatch watch(call.Seconds() + keeper.Seconds());

  std::vector<int> frames, heldOut;  // no structured binding, which Clang's lambdas cannot see
  std::tie(frames, heldOut) = SplitHoldOut(*sweep, AllFrames(*sweep), options.holdOut);
  std::vector<int> validation;
  if (options.validation > 0)
  {
    std::tie(frames, validation) = SplitHoldOut(*sweep, frames, options.validation);
  }
  if (frames.empty())
  {
    throw Error("Trainer: with a hold-out of " + std::to_string(options.holdOut) + " and validation of " +
                std::to_string(options.validation) + ", none of the " + std::to_string(sweep->NumberOfFrames()) +
                " frames is left to train on.");
  }
  if (!start)
  {
    RequireSomethingToLearn(*sweep, frames);
  }
  else if (start->Size() == 0)
  {
    throw Error("Trainer: the field to continue from holds no Gaussian.");
  }
  sweep = std::make_shared<const Sweep>(sweep->LitBy(frames));

  double fraction = 0;              // of the whole, which never falls
  double lastLeft = 0, lastAt = 0;  // seconds left when that was last known
  double decidingShare = 0;         // of what is left then, while trials are still to come
  bool aborted = false;
  const auto passOn = [&](TrainingProgress now)
  {
    now.record.seconds = watch.Seconds();
    now.secondsLeft *= 1 + decidingShare;
    if (options.timeLimit > 0)
    {
      const double left = std::max(0.0, options.timeLimit - now.record.seconds);
      now.secondsLeft = now.secondsLeft > 0 ? std::min(now.secondsLeft, left) : left;
    }
    if (now.secondsLeft > 0)
    {
      lastLeft = now.secondsLeft;
      lastAt = now.record.seconds;
    }
    else if (lastLeft > 0)
    {
      now.secondsLeft = std::max(1.0, lastLeft - (now.record.seconds - lastAt));
    }
    if (now.secondsLeft > 0)
    {
      fraction = std::max(fraction, now.record.seconds / (now.record.seconds + now.secondsLeft));
    }
    now.fraction = fraction;
    aborted = aborted || (progress && !progress(now));
    aborted = exchange ? exchange->Any(aborted) : aborted;
    return !aborted;
  };
  // With a time limit what is done depends on it, so processes go by the clock of the first.
  const auto spent = [&] { return exchange ? exchange->OfFirst(watch.Seconds()) : watch.Seconds(); };
  TrainingResult result;
  TrainerOptions asked = options;
  if (keeper.Settled())
  {
    sweep = Restore(*keeper.Settled(), sweep, asked, result.decisions);
  }
  else
  {
    const bool isJudged = asked.automatic && LongestSequence(*sweep, frames).size() >= kFewestFrames;
    if (asked.poseSmoothing ? asked.automatic || *asked.poseSmoothing > 0 : isJudged)
    {
      sweep = Correct(sweep, frames, asked, result.decisions, [&passOn] { return passOn({}); });
    }
    else
    {
      asked.poseSmoothing = 0;
    }
    if (start && !asked.elevationSigma)
    {
      asked.elevationSigma = start->beam.elevationSigma;
    }
    if (start && !asked.probeElevationSigma)
    {
      asked.probeElevationSigma = start->beam.probeElevationSigma;
    }
  }
  result.imageToReference = sweep->imageToReference;
  TrainingPlan plan = PlanByGeometry(asked, *sweep, frames);
  plan.continued = start != nullptr;
  const auto boundGaussians = [&]
  {
    if (options.timeLimit > 0 && !asked.gaussians && !start)
    {
      plan.gaussians =
          std::min(plan.gaussians,
                   std::max<std::size_t>(1000, static_cast<std::size_t>(kGaussiansPerSecond * options.timeLimit)));
    }
  };
  boundGaussians();
  const auto leave = [&](double seconds)
  {
    if (options.timeLimit > 0)
    {
      plan.timeLimit = std::max(options.timeLimit - spent() - seconds, kLeastTime);
    }
  };
  std::unique_ptr<TrainingLoop> loop;
  const auto begin = [&]
  {
    loop = std::make_unique<TrainingLoop>(sweep, frames, plan, passOn, nullptr, exchange);
    loop->SetKeeping(keeper.KeepingOfTraining());
    if (const std::string state = keeper.TakeTraining(); !state.empty())
    {
      loop->Resume(state);
    }
    else if (start)
    {
      Start first{*start, false};
      first.field.beam = Beam{plan.elevationSigma};
      loop->Begin(std::move(first));
    }
    else
    {
      loop->Begin(loop->SeedAndSolve());
    }
  };
  Fitted fitted;
  // A field to continue from was decided on before, and so was a training that goes on after that.
  if (options.automatic && !start && options.iterations.value_or(1) > 0 && !keeper.Settled())
  {
    if (options.timeLimit > 0 && options.timeLimit < kLeastTimeToTry)
    {
      result.decisions.push_back({"the rest", "by geometry", "the time limit is too short to try anything", 0});
    }
    else
    {
      // The first stage comes before trials, because it rests on few of the choices, and its field is what a caller gets
      // who stops amid them. Where they choose what it rests on otherwise, it is done again.
      const TrainingPlan byGeometry = plan;
      if (TrainingLoop::HasFirstStage(plan))
      {
        leave(kDecidingTime * options.timeLimit);
        decidingShare = asked.gaussians ? kDecidingShareGiven : kDecidingShare;
        begin();
        fitted = loop->Run(validation, TrainingLoop::Until::FirstStage);
      }
      const double ahead = lastLeft, training = ahead / (1 + std::exchange(decidingShare, 0));
      const double decidingFrom = watch.Seconds(), begun = options.timeLimit > 0 ? spent() : 0;
      std::vector<Decision> decisions = Decide(
          *sweep, frames, asked, plan,
          [&](TrainingProgress now)
          {
            now.secondsLeft = std::max(training, ahead - (watch.Seconds() - decidingFrom));
            return passOn(now) && (options.timeLimit == 0 || spent() - begun < kDecidingTime * options.timeLimit);
          },
          keeper, exchange);
      result.decisions.insert(result.decisions.end(), decisions.begin(), decisions.end());
      boundGaussians();
      if (aborted && loop)
      {
        plan.gaussians = byGeometry.gaussians;  // as the field that is returned
        plan.elevationSigma = byGeometry.elevationSigma;
      }
      else if (plan.gaussians != byGeometry.gaussians || plan.elevationSigma != byGeometry.elevationSigma)
      {
        loop.reset();
      }
    }
  }
  result.settled = Settled(asked, plan);
  if (aborted)
  {
    keeper.Close();
  }
  else if (!keeper.Settled())
  {
    keeper.Settle({TextsOf(result.settled), result.decisions, result.imageToReference}, loop != nullptr);
    keeper.Save();
  }
  leave(0);
  if (!loop)
  {
    begin();
    fitted = loop->Run(validation);
  }
  else if (!aborted)
  {
    loop->Replan(plan);
    fitted = loop->Run(validation);
  }
  if (aborted && !fitted.finished && fitted.iterations > 0)
  {
    fitted.field = loop->Settle(validation);
  }
  if (start && fitted.iterations > 0)
  {
    GaussianField before = *start;
    before.beam = Beam{plan.elevationSigma};
    fitted.field = loop->Nearer(std::move(fitted.field), before);
  }
  result.field = std::move(fitted.field);
  // Set last, because training itself needs the beam of its own planes only.
  result.field.beam.probeElevationSigma = plan.probeElevationSigma;
  if (plan.probeElevationSigma > plan.elevationSigma)
  {
    std::vector<Eigen::Vector3d>& normals = result.field.beam.trainedNormals;
    normals = DistinctNormals(*sweep, frames);
    if (start)
    {
      normals.insert(normals.end(), start->beam.trainedNormals.begin(), start->beam.trainedNormals.end());
    }
  }
  result.log = std::move(fitted.log);
  result.iterations = fitted.iterations;
  result.device = loop->engine().Device();
  result.processes = exchange ? exchange->Size() : 1;
  result.trainingFrames = std::move(frames);
  result.validationFrames = std::move(validation);
  result.heldOutFrames = std::move(heldOut);
  result.aborted = aborted && !fitted.finished;  // a stop after the last step stopped nothing
  result.finished = fitted.finished;
  result.seconds = watch.Seconds();
  return result;
}
catch (const cv::Exception& exception)
{
  ThrowAsCores(exception);
}

}  // namespace bigus
