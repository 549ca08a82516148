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
#include "Core/Engine/ViewEngine.h"
#include "Core/Model/Error.h"
#include "Core/Model/Sequences.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Format.h"
#include "Core/Numerics/OpenCv.h"
#include "Core/Trainer/Budget.h"
#include "Core/Trainer/Checkpointer.h"
#include "Core/Training/CrossingSweeps.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/Judging.h"
#include "Core/Training/OptionList.h"
#include "Core/Training/Seeding.h"
#include "Core/Training/TrainingLoop.h"
#include "Core/Training/ViewTraining.h"

namespace bigus
{
namespace
{

/// Seconds that deciding takes for a second of the training that is left after the first stage, where the number of
/// Gaussians is open and where it is given; for what is told of the time left. Brain and spine sweep: 0.45 and 0.49; liver
/// sweep with a given number: 0.1.
constexpr double kDecidingShare = 0.45, kDecidingShareGiven = 0.1;

/// Gaussians that are trained for a second of a time limit at the most. With more each is seen too seldom. In 10 s and
/// 20 s two threads take the liver sweep (full size) to 38.7 dB with 200,000 and 40.1 dB with 300,000.
constexpr double kGaussiansPerSecond = 20000;
constexpr std::size_t kFewestInLimitedTime = 1000;

/// Share of training that comes before trials where these may choose another number of Gaussians, since all of it is done
/// again then. Who stops a training of the brain sweep amid trials gets 26.26 dB by it (full size, held-out frames), and
/// 26.24 after all of the first stage, which takes three times as long.
constexpr double kBeforeOpenTrials = kFirstStage / 3;

/// The option that may be another when a training goes on.
const std::string kTimeLimit = "TimeLimit";

/// Refuses what no field can be seeded from: a single plane says nothing about space, equal pixels nothing at all.
void RequireSomethingToLearn(const Sweep& sweep, const std::vector<int>& frames)
{
  Require(frames.size() >= 2,
          "Trainer: there is one frame to train on; a field needs at least two, at different places. (A field that "
          "exists already can be continued with one.)");
  if (const std::optional<float> level = LevelOf(sweep, frames))
  {
    throw Error("Trainer: " +
                (*level == 0 ? std::string("all frames are black")
                             : "every pixel of all frames is " + std::to_string(*level) + " (of 1)") +
                ", so there is nothing to learn. Check the file, the clip region and the pixel type.");
  }
}

/// Takes the tracker's noise out of the poses of all frames, by pixels of `frames` alone, and reports it. Every sequence
/// is corrected as if it were alone, because it is a motion and a registration of its own. Of what pictures cannot tell
/// `decide` says the last word. Poses are kept where `goOn` says stop.
std::shared_ptr<const Sweep> Correct(std::shared_ptr<const Sweep> sweep, const std::vector<int>& frames,
                                     TrainerOptions& options, std::vector<Decision>& decisions,
                                     const std::function<bool()>& goOn,
                                     const std::function<PoseCorrection(const Sequence&, PoseCorrection)>& decide)
{
  const std::vector<Sequence> sequences = SequencesOf(*sweep, frames);
  auto corrected = std::make_shared<Sweep>(*sweep);
  std::vector<double> strengths;
  bool isChanged = false, isOpen = false;
  for (const Sequence& sequence : sequences)
  {
    PoseCorrection correction =
        CorrectPoses(sequence.sweep, sequence.frames, {options.poseSmoothing}, [&goOn](double) { return goOn(); });
    if (correction.aborted)
    {
      options.poseSmoothing = 0;
      return sweep;
    }
    if (correction.IsUndecided())
    {
      correction = decide(sequence, std::move(correction));
    }
    // Where nothing is smoothed but pictures aligned frames, the option stays open, because 0 would also forbid the
    // alignment.
    isOpen = isOpen || (correction.strength == 0 && correction.trajectory.IsChanged());
    strengths.push_back(correction.strength);
    if (sequences.size() > 1)
    {
      correction.decision.what += " of sequence " + std::to_string(strengths.size());
    }
    decisions.push_back(correction.decision);
    isChanged = isChanged || correction.trajectory.IsChanged();
    std::copy(correction.trajectory.imageToReference.begin(), correction.trajectory.imageToReference.end(),
              corrected->imageToReference.begin() + sequence.first);
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
  Require(settled.imageToReference.size() == posed->imageToReference.size(), "The checkpoint has poses of ",
          settled.imageToReference.size(), " frames; there are ", posed->imageToReference.size(),
          ". Begin anew, without the checkpoint.");
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

/// What says that a training is the same; empty where nobody asks. Throws Error in all processes unless they agree.
NamedTexts AgreedIdentity(const Sweep& sweep, const TrainerOptions& options, const GaussianField* start,
                          const Checkpoints& checkpoints, Exchange& exchange)
{
  if (exchange.IsAlone() && !checkpoints.save && checkpoints.resume.empty())
  {
    return {};
  }
  NamedTexts identity = IdentityOf(sweep, options, start);
  RequireSameTraining(exchange, identity, options.timeLimit);
  return identity;
}

/// What checkpoints call the question about directions, and the training of each sequence by itself.
constexpr const char* kViewTrial = "view dependence";
constexpr const char* kEachSequence = "each sequence by itself";

/// What is known of directions; none where nobody asks. Clang 14 wants its defaults outside Training.
struct Directions
{
  bool areWorth = false;
  std::string evidence = "given";
  double seconds = 0;
};

/// What Train does, step by step, and what the steps hand on.
class Training
{
public:
  /// The options and the sweep are valid; the rest is as for Train, but for an `exchange` of one process, which is Alone().
  Training(const InspectedSweep& inspected, const TrainerOptions& options, const GaussianField* start,
           const ProgressCallback& progress, const Checkpoints& checkpoints, Exchange& exchange,
           const Stopwatch& sinceCall)
      : options_(options),
        start_(start),
        exchange_(exchange),
        sweep_(inspected.sweep),
        asked_(options),
        keeper_(checkpoints, AgreedIdentity(*sweep_, options, start, checkpoints, exchange), exchange),
        budget_(options.timeLimit, sinceCall.Seconds() + keeper_.Seconds(), progress, exchange)
  {
    result_.heldOutFrames = inspected.heldOut;
  }

  void SetApart();
  void CorrectPoses();
  void Plan();
  void FirstStage();
  void Decide();
  TrainingResult Finish();

private:
  bool IsDeciding() const;
  void BoundGaussians();
  void MakeLoop();
  void Try();
  void Settle();
  void TrainToTheEnd();
  void AskForDirections();
  std::optional<ViewEvidence> FindEvidence();
  bool TrainSequencesApart();
  void LearnDirections();
  void SetBeam(GaussianField& field) const;

  const TrainerOptions& options_;
  const GaussianField* start_;
  Exchange& exchange_;
  std::shared_ptr<const Sweep> sweep_;
  TrainerOptions asked_;  // the options, with what poses and the field to continue from settle
  Checkpointer keeper_;
  Budget budget_;
  TrainingPlan plan_;
  std::unique_ptr<TrainingLoop> loop_;
  Fitted fitted_;
  std::optional<Directions> directions_;
  bool isStoppedShort_ = false;  // while directions were asked for or learnt, which no step of the loop tells
  TrainingResult result_;
};

/// Frames that validate and that are trained on, among those that are not held out; what none of the last lights is seen by nobody.
void Training::SetApart()
{
  std::vector<int>&frames = result_.trainingFrames, &validation = result_.validationFrames;
  const std::vector<int> all = AllFrames(*sweep_);
  std::set_difference(all.begin(), all.end(), result_.heldOutFrames.begin(), result_.heldOutFrames.end(),
                      std::back_inserter(frames));
  if (options_.validation > 0)
  {
    std::tie(frames, validation) = SplitHoldOut(*sweep_, frames, options_.validation);
  }
  Require(!frames.empty(), "Trainer: with a hold-out of ", options_.holdOut, " and validation of ", options_.validation,
          ", none of the ", sweep_->NumberOfFrames(), " frames is left to train on.");
  if (!start_)
  {
    RequireSomethingToLearn(*sweep_, frames);
  }
  else if (start_->Size() == 0)
  {
    throw Error("Trainer: the field to continue from holds no Gaussian.");
  }
  sweep_ = std::make_shared<const Sweep>(sweep_->LitBy(frames));
}

void Training::CorrectPoses()
{
  if (keeper_.Settled())
  {
    sweep_ = Restore(*keeper_.Settled(), sweep_, asked_, result_.decisions);
  }
  else
  {
    const bool isJudged = asked_.automatic && LongestSequence(*sweep_, result_.trainingFrames).size() >= kFewestFrames;
    if (asked_.poseSmoothing ? asked_.automatic || *asked_.poseSmoothing > 0 : isJudged)
    {
      const auto decide = [this](const Sequence& sequence, PoseCorrection found)
      {
        const auto tell = [this](const TrainingProgress& now) { return budget_.Tell(now); };
        return IsDeciding() && !budget_.IsLimited()
                   ? DecidePoses(sequence, std::move(found), asked_, tell, keeper_, exchange_)
                   : found;
      };
      sweep_ = Correct(
          sweep_, result_.trainingFrames, asked_, result_.decisions, [this] { return budget_.Tell({}); }, decide);
    }
    else
    {
      asked_.poseSmoothing = 0;
    }
  }
  result_.imageToReference = sweep_->imageToReference;
}

void Training::Plan()
{
  if (start_ && !keeper_.Settled())
  {
    asked_.elevationSigma = asked_.elevationSigma.value_or(start_->beam.elevationSigma);
    asked_.probeElevationSigma = asked_.probeElevationSigma.value_or(start_->beam.probeElevationSigma);
  }
  plan_ = PlanByGeometry(asked_, *sweep_, result_.trainingFrames);
  plan_.continued = start_ != nullptr;
  BoundGaussians();
}

void Training::BoundGaussians()
{
  if (budget_.IsLimited() && !asked_.gaussians && !start_)
  {
    const auto most = static_cast<std::size_t>(kGaussiansPerSecond * budget_.Limit());
    plan_.gaussians = std::min(plan_.gaussians, std::max(kFewestInLimitedTime, most));
  }
}

/// A field to continue from was decided on before, and so was a training that goes on after that.
bool Training::IsDeciding() const
{
  return options_.automatic && !start_ && options_.iterations.value_or(1) > 0 && !keeper_.Settled();
}

/// The loop goes on from the checkpoint, from the field to continue from, or begins with seeds.
void Training::MakeLoop()
{
  loop_ = std::make_unique<TrainingLoop>(
      sweep_, result_.trainingFrames, plan_, [this](const TrainingProgress& now) { return budget_.Tell(now); }, nullptr,
      exchange_);
  loop_->SetKeeping(keeper_.KeepingOfTraining());
  if (const std::string state = keeper_.TakeTraining(); !state.empty())
  {
    loop_->Resume(state);
  }
  else if (start_)
  {
    Start first{*start_, false};
    first.field.beam = Beam{plan_.elevationSigma};
    loop_->Begin(std::move(first));
  }
  else
  {
    loop_->Begin(loop_->SeedStart());
  }
}

/// The first stage comes before trials, because it rests on few of the choices, and its field is what a caller gets who
/// stops amid them. Where they choose what it rests on otherwise, it is done again, so where that is likely only its
/// beginning comes before them.
void Training::FirstStage()
{
  if (IsDeciding() && !budget_.IsTooShortToTry() && HasFirstStage(plan_))
  {
    plan_.timeLimit = budget_.Left(true);
    budget_.ExpectTrials(asked_.gaussians ? kDecidingShareGiven : kDecidingShare);
    MakeLoop();
    const bool isOpen = !asked_.gaussians && !budget_.IsLimited();
    fitted_ = loop_->Run(result_.validationFrames, isOpen ? kBeforeOpenTrials : kFirstStage);
    fitted_.finished = false;  // also where validation ends it here: all is yet to be decided
  }
}

void Training::Decide()
{
  if (IsDeciding() && budget_.IsTooShortToTry())
  {
    result_.decisions.push_back({"the rest", "by geometry", "the time limit is too short to try anything", 0});
  }
  else if (IsDeciding())
  {
    Try();
  }
  Settle();
}

void Training::Try()
{
  const TrainingPlan byGeometry = plan_;
  const std::vector<Decision> decisions =
      bigus::Decide(*sweep_, result_.trainingFrames, asked_, plan_, budget_.OfTrials(), keeper_, exchange_);
  result_.decisions.insert(result_.decisions.end(), decisions.begin(), decisions.end());
  BoundGaussians();
  if (budget_.IsAborted() && loop_)
  {
    plan_.gaussians = byGeometry.gaussians;  // as the field that is returned
    plan_.elevationSigma = byGeometry.elevationSigma;
  }
  else if (plan_.gaussians != byGeometry.gaussians || plan_.elevationSigma != byGeometry.elevationSigma)
  {
    loop_.reset();
  }
}

/// All is decided: the result says so, and a checkpoint keeps it.
void Training::Settle()
{
  result_.settled = Settled(asked_, plan_);
  if (budget_.IsAborted())
  {
    keeper_.Close();
  }
  else if (!keeper_.Settled())
  {
    keeper_.Settle({TextsOf(result_.settled), result_.decisions, result_.imageToReference}, loop_ != nullptr);
    keeper_.Save();
  }
}

/// The rest of the training, or all of it. Who stops it gets a field that has settled, and one that is no worse than that
/// which was continued.
void Training::TrainToTheEnd()
{
  plan_.timeLimit = budget_.Left(false);
  if (!loop_)
  {
    MakeLoop();
    fitted_ = loop_->Run(result_.validationFrames);
  }
  else if (!budget_.IsAborted())
  {
    loop_->Replan(plan_);
    fitted_ = loop_->Run(result_.validationFrames);
  }
  if (budget_.IsAborted() && !fitted_.finished && fitted_.iterations > 0)
  {
    fitted_.field = loop_->Settle(result_.validationFrames);
  }
  if (start_ && fitted_.iterations > 0)
  {
    GaussianField before = *start_;
    before.beam = Beam{plan_.elevationSigma};
    fitted_.field = Nearer(loop_->engine(), *sweep_, result_.trainingFrames, std::move(fitted_.field), before);
  }
}

/// The probe's beam, and the directions of planes where training itself has a thinner one. Set last, because training
/// needs the beam of its own planes only.
void Training::SetBeam(GaussianField& field) const
{
  field.beam.probeElevationSigma = plan_.probeElevationSigma;
  if (plan_.probeElevationSigma > plan_.elevationSigma)
  {
    std::vector<Eigen::Vector3d>& normals = field.beam.trainedNormals;
    normals = DistinctNormals(*sweep_, result_.trainingFrames);
    if (start_)
    {
      normals.insert(normals.end(), start_->beam.trainedNormals.begin(), start_->beam.trainedNormals.end());
    }
  }
}

/// Whether echoes depend on the direction: recorded frames say so, or the caller does.
void Training::AskForDirections()
{
  const bool isAsked = asked_.viewDependence ? *asked_.viewDependence : asked_.automatic && !start_;
  result_.settled.viewDependence = false;
  if (!isAsked || budget_.IsAborted() || plan_.iterations == 0)
  {
    return;
  }
  if (budget_.IsLimited())
  {
    if (asked_.viewDependence)
    {
      result_.decisions.push_back({"view dependence", "off", "not with a time limit", 0});
    }
    return;
  }
  if (asked_.viewDependence)
  {
    directions_.emplace();
    directions_->areWorth = RecordedViews::Of(*sweep_, result_.trainingFrames).unit > 0;
    return;
  }
  const Stopwatch watch;
  if (const std::optional<ViewEvidence> found = FindEvidence())
  {
    directions_ = {found->IsWorth(),
                   "a short training with it gains " + FormatNumber(found->gain, 2) + " (" +
                       FormatNumber(found->error, 2) + ") on frames that it has not seen",
                   watch.Seconds()};
  }
}

/// Asked once: a checkpoint keeps it.
std::optional<ViewEvidence> Training::FindEvidence()
{
  const TrialScores* const known = keeper_.FindTrial(kViewTrial);
  if (known && known->frames.size() > 1)
  {
    return ViewEvidence::Of(known->frames);
  }
  std::optional<ViewEvidence> found = AskForViews(sweep_, result_.trainingFrames, plan_,
                                                  [this] {
                                                    return budget_.Tell({TrainingProgress::Phase::Training, 0, 0, {}});
                                                  });
  if (found)
  {
    keeper_.NoteTrial(kViewTrial, {found->gains, {}, {}});
    keeper_.Save();
  }
  isStoppedShort_ = budget_.IsAborted();
  return found;
}

/// Where sequences cross and directions count each is trained by itself, under a thin beam, because what the others show
/// of its neighbourhood is another picture then. False where that is not so, or the caller said stop.
bool Training::TrainSequencesApart()
{
  if (!directions_ || !directions_->areWorth || start_ || plan_.frameGains ||
      !SequencesCross(*sweep_, result_.trainingFrames))
  {
    return false;
  }
  TrainingPlan plan = plan_;
  plan.elevationSigma = options_.elevationSigma.value_or(0);  // asked_ has what was decided for all together
  const Stopwatch watch;
  const std::string state = keeper_.TakeTrial(kEachSequence);
  std::optional<TrainedApart> trained = TrainApart(
      sweep_, result_.trainingFrames, result_.validationFrames, plan,
      [this](const TrainingProgress& now) { return budget_.Tell(now); }, keeper_.KeepingOfTrial(kEachSequence), state);
  if (!trained)
  {
    isStoppedShort_ = budget_.IsAborted();
    return false;
  }
  plan_ = plan;
  result_.settled.elevationSigma = plan.elevationSigma;
  fitted_ = std::move(trained->fitted);
  result_.view = std::move(trained->view);
  result_.device = trained->device;
  directions_->evidence += "; sequences cross, so each was trained by itself first, elevation sigma " +
                           FormatNumber(plan.elevationSigma, 3) + " mm";
  directions_->seconds += watch.Seconds();
  return true;
}

/// Trains the finished field on with what depends on the direction, where that counts. A stop amid it loses this alone.
void Training::LearnDirections()
{
  if (!directions_ || !directions_->areWorth || fitted_.iterations == 0)
  {
    return;
  }
  isStoppedShort_ = budget_.IsAborted();
  if (fitted_.finished)
  {
    loop_->Keep();  // a training that goes on from here has only this before it
  }
  if (isStoppedShort_)
  {
    return;
  }
  const Stopwatch watch;
  const bool isThere = ViewEngine::Of(loop_->engine()) != nullptr;
  const std::unique_ptr<Engine> other = isThere ? nullptr : Engine::Create("cpu");
  const Targets& targets = loop_->targets();
  const ViewTargets of = {WithCountedPixels(targets.Images(), plan_.ignoreMasked), targets.Frames(), targets.Limits()};
  const ViewDependence first{RecordedViews::Of(*sweep_, result_.trainingFrames), {}};
  if (std::optional<ViewedField> viewed =
          TrainViews(isThere ? loop_->engine() : *other, of, plan_, fitted_.field, first,
                     [this] {
                       return budget_.Tell({TrainingProgress::Phase::Training, 0, 0, {}});
                     }))
  {
    fitted_.field = std::move(viewed->field);
    result_.view = std::move(viewed->view);
  }
  else
  {
    isStoppedShort_ = true;
  }
  directions_->seconds += watch.Seconds();
}

TrainingResult Training::Finish()
{
  AskForDirections();
  if (!TrainSequencesApart())
  {
    TrainToTheEnd();
    LearnDirections();
    result_.device = loop_->engine().Device();
  }
  if (directions_)
  {
    result_.settled.viewDependence = result_.view.has_value();
    result_.decisions.push_back(
        {"view dependence", result_.view ? "on" : "off", directions_->evidence, directions_->seconds});
  }
  result_.field = std::move(fitted_.field);
  SetBeam(result_.field);
  result_.log = std::move(fitted_.log);
  result_.iterations = fitted_.iterations;
  result_.processes = exchange_.Size();
  result_.finished = fitted_.finished && !isStoppedShort_;
  result_.aborted = budget_.IsAborted() && !result_.finished;  // a stop after the last step stopped nothing
  result_.seconds = budget_.Seconds();
  return std::move(result_);
}

/// The result of a training on what an inspection left, with frames numbered as in what was recorded.
TrainingResult Renumbered(TrainingResult result, InspectedSweep inspected)
{
  for (std::vector<int>* list : {&result.trainingFrames, &result.validationFrames, &result.heldOutFrames})
  {
    std::transform(list->begin(), list->end(), list->begin(), [&](int frame) { return inspected.frames[frame]; });
  }
  std::vector<Eigen::Matrix4d> poses = inspected.recorded->imageToReference;
  for (std::size_t k = 0; k < inspected.frames.size(); ++k)
  {
    poses[inspected.frames[k]] = result.imageToReference[k];
  }
  result.imageToReference = std::move(poses);
  result.findings = std::move(inspected.findings);
  return result;
}

}  // namespace

TrainingResult Train(InspectedSweep inspected, const TrainerOptions& options, const GaussianField* start,
                     const ProgressCallback& progress, const Checkpoints& checkpoints, Exchange& exchange)
try
{
  const Stopwatch sinceCall;
  options.Validate();
  Exchange& others = exchange.IsAlone() ? Exchange::Alone() : exchange;
  Training training(inspected, options, start, progress, checkpoints, others, sinceCall);
  training.SetApart();
  training.CorrectPoses();
  training.Plan();
  training.FirstStage();
  training.Decide();
  return Renumbered(training.Finish(), std::move(inspected));
}
catch (const cv::Exception& exception)
{
  ThrowAsCores(exception);
}

TrainingResult Train(std::shared_ptr<const Sweep> sweep, const TrainerOptions& options, const GaussianField* start,
                     const ProgressCallback& progress, const Checkpoints& checkpoints, Exchange& exchange)
{
  options.Validate();
  sweep->Validate();
  return Train(Inspect(std::move(sweep), options.keep, options.holdOut), options, start, progress, checkpoints,
               exchange);
}

}  // namespace bigus
