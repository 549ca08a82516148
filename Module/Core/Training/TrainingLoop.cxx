// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/TrainingLoop.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "Core/Model/PixelMemory.h"
#include "Core/Training/Batches.h"
#include "Core/Training/Densification.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/Judging.h"
#include "Core/Training/Seeding.h"

namespace bigus
{
namespace
{

/// Share of the progress bar that seeding takes.
constexpr double kSeedingShare = 0.1;

/// Seconds told as left at the end, because 0 says that it is not known.
constexpr double kNoTime = 1e-3;

}  // namespace

TrainingLoop::TrainingLoop(std::shared_ptr<const Sweep> sweep, std::vector<int> frames, TrainingPlan plan,
                           ProgressCallback progress, std::shared_ptr<const Sweep> withVirtualPlanes,
                           Exchange& exchange)
    : exchange_(exchange),
      sweep_(std::move(sweep)),
      frames_(std::move(frames)),
      plan_(std::move(plan)),
      report_(plan_, std::move(progress), exchange),
      engine_(exchange.CreateEngine(plan_.engine)),
      targets_(sweep_, frames_, plan_, *engine_, report_, std::move(withVirtualPlanes))
{
  engine_->SetAccuracy({plan_.tolerance, true});
  report_.Proceed(TrainingProgress::Phase::Seeding, 0.0);
}

/// By what the sides of frames are divided in the first stage of a training of so many Gaussians. Reduced frames would
/// take the detail from a field to continue from, which has it.
int TrainingLoop::FirstCoarsenessFor(std::size_t gaussians) const
{
  return plan_.continued || !HasFirstStage(plan_) ? 1 : FirstCoarseness(*sweep_, frames_.size(), gaussians);
}

Start TrainingLoop::SeedStart()
{
  targets_.SetFrames(FirstCoarsenessFor(plan_.gaussians));
  Start start;
  start.field = Seed(targets_.Images(), frames_, Beam{plan_.elevationSigma},
                     {plan_.seeding, plan_.gaussians, plan_.seed, plan_.sparse});
  engine_->SetField(start.field);
  ScaleReflectivities(*engine_, targets_.Images(), frames_, start.field);
  // Only the reflectivities are the engine's: it rounds places.
  start.field.reflectivities = engine_->GetField().reflectivities;
  return start;
}

/// Gives the field to the engine, and returns it as the engine rounds it.
GaussianField TrainingLoop::Load(Start start)
{
  engine_->SetField(start.field);
  if (!start.seeded)
  {
    return std::move(start.field);
  }
  GaussianField field = engine_->GetField();
  if (!plan_.signedReflectivity)
  {
    for (double& r : field.reflectivities)
    {
      r = std::max(r, 0.0);
    }
    engine_->SetField(field);
  }
  return field;
}

/// What the stage trains on.
void TrainingLoop::SetTargets()
{
  if (course_.isFirstStage)
  {
    targets_.SetFrames(course_.coarseness);
  }
  else
  {
    targets_.SetPlanes(course_.second);
  }
}

void TrainingLoop::Begin(Start start)
{
  course_ = Course();
  {
    const GaussianField field = Load(std::move(start));
    course_.rates = FirstRates(plan_, field);
    course_.cap = plan_.densification.cap > 0 ? plan_.densification.cap : 2 * field.Size();
    course_.coarseness = FirstCoarsenessFor(field.Size());
  }
  course_.isFirstStage = HasFirstStage(plan_);
  course_.second.planes = !course_.isFirstStage && plan_.iterations > 0 ? plan_.virtualPlanes : 0;
  SetTargets();
  if (plan_.densification.interval > 0)
  {
    engine_->ResetScores();
  }
}

CourseBounds TrainingLoop::Bounds() const
{
  return {plan_, std::min(sweep_->width, sweep_->height), frames_.size(), !exchange_.IsAlone()};
}

void TrainingLoop::Resume(std::string_view state)
{
  StateReader from(LoadPart(state, exchange_));
  course_ = LoadCourse(Bounds(), from);
  engine_->LoadState(from);
  from.End();
  StateReader::Require(engine_->FieldSize() > 0, "a field of no Gaussian");
  StateReader::Require(course_.average.count == 0 || course_.average.mean.Size() == engine_->GetPart().field.Size(),
                       "the average of another field");
  SetTargets();
  if (course_.corrections > 0)
  {
    targets_.Correct(course_.corrected);
    targets_.Images().Validate();
  }
}

void TrainingLoop::Save(StateWriter& to) const
{
  StateWriter own;
  SaveCourse(course_, Bounds(), own);
  engine_->SaveState(own);
  SaveParts(own.Take(), exchange_, to);
}

void TrainingLoop::Keep() const
{
  if (keeping_.keep)
  {
    keeping_.keep([this](StateWriter& to) { Save(to); });
  }
}

void TrainingLoop::Replan(TrainingPlan plan)
{
  plan_ = std::move(plan);
  if (plan_.timeLimit > 0)
  {
    plan_.timeLimit += report_.Seconds();
  }
}

/// A run's batches, and since when it is timed.
struct TrainingLoop::Lap
{
  Batches batches;
  double begun = 0;       // s, of the first step, as if no time had passed between runs
  double stageBegun = 0;  // s, of this run's part of the stage, for its pace
  int stageFirst = 0;     // steps taken before
};

Fitted TrainingLoop::Run(const std::vector<int>& validationFrames, double until)
{
  Lap lap{Batches(targets_.Frames(), plan_.batch, plan_.seed), report_.Seconds() - course_.trainingTime,
          report_.Seconds(), course_.iteration};
  lap.batches.Skip(course_.iteration - (course_.isFirstStage ? 0 : course_.firstStage));
  bool isFinished = HasEnded() && !report_.IsAborted();
  while (!isFinished && !report_.IsAborted())
  {
    const double fraction = FractionDone(plan_, course_.iteration + 1, report_.Seconds(), lap.begun);
    if (fraction >= until || (course_.isFirstStage && fraction >= kFirstStage && !EnterSecondStage(lap)))
    {
      break;
    }
    CorrectFrames(fraction);
    const int before = course_.iteration;
    const Moment now = TakeStep(lap, fraction);
    isFinished = HasEnded();
    if (course_.iteration / LogInterval(plan_) > before / LogInterval(plan_) || isFinished)
    {
      AddLogLine(validationFrames, now);
    }
    Tell(lap, fraction);
    if (keeping_.due && !isFinished && !report_.IsAborted() && keeping_.due())
    {
      Keep();
    }
  }
  if (!isFinished && course_.iteration > 0)
  {
    Keep();
  }
  TakeAverage(validationFrames);
  return Result(isFinished);
}

/// All steps were taken, or those to where validation said stop.
bool TrainingLoop::HasEnded() const
{
  return course_.iteration >= plan_.iterations || (course_.endsAt > 0 && course_.iteration >= course_.endsAt);
}

/// False when the caller said stop while virtual planes were made.
bool TrainingLoop::EnterSecondStage(Lap& lap)
{
  course_.first = engine_->GetPart();
  const double secondsOfPass = (report_.Seconds() - lap.begun) / course_.passes;
  const std::optional<SecondStage> second = targets_.SetPlanesInTime(secondsOfPass, secondsOfSecondStage_);
  if (!second)
  {
    return false;
  }
  course_.isFirstStage = false;
  course_.firstStage = course_.iteration;
  course_.second = *second;
  lap.batches = Batches(targets_.Frames(), plan_.batch, plan_.seed);
  lap.stageBegun = report_.Seconds();
  lap.stageFirst = course_.iteration;
  return true;
}

/// When it is time for it.
void TrainingLoop::CorrectFrames(double fraction)
{
  if (plan_.frameGains && course_.corrections < kCorrections.size() && fraction >= kCorrections[course_.corrections])
  {
    ++course_.corrections;
    course_.corrected = FindCorrections(*engine_, *sweep_, frames_);
    targets_.Correct(course_.corrected);
  }
}

/// Trains on the next batch. Returns where training was, with the batch's share of a pass.
Moment TrainingLoop::TakeStep(Lap& lap, double fraction)
{
  const std::vector<int> batch = lap.batches.Next();
  if (PixelBytesInFiles() > 0)
  {
    targets_.Images().Prefetch(Batches(lap.batches).Next());  // the batch after this one
  }
  course_.passes += static_cast<double>(batch.size()) / static_cast<double>(targets_.Frames().size());
  const Moment now = Now(fraction);
  const double rate = RateLeft(plan_, frames_.size(), now), steps = StepsInAll(plan_, now);
  course_.lossSum += Step(batch, steps, plan_.loss, Scaled(course_.rates, rate));
  ++course_.lossCount;
  ++course_.iteration;
  if (IsDensified(plan_, course_.iteration, fraction))
  {
    DensificationOptions options = plan_.densification;
    options.cap = course_.cap;
    Densify(*engine_, plan_.pixelSize, options);
  }
  if ((IsLastPart(fraction) || course_.endsAt > 0) && IsAveraged(course_.iteration, steps))
  {
    course_.average.Add(engine_->GetPart().field);
  }
  TrainingRecord& line = report_.Now().record;
  line.iteration = course_.iteration;
  line.loss = course_.lossSum / course_.lossCount;
  line.gaussians = engine_->FieldSize();
  line.rate = rate;
  return now;
}

/// The loss of a step of the batch, or of several on parts of it where there are few steps in all.
double TrainingLoop::Step(const std::vector<int>& batch, double stepsInAll, const Loss& loss,
                          const LearningRates& rates)
{
  const std::size_t parts = PartsOfBatch(stepsInAll, batch.size());
  double sum = 0;
  for (std::size_t part = 0; part < parts; ++part)
  {
    const auto at = [&](std::size_t k)
    { return batch.begin() + static_cast<std::ptrdiff_t>(k * batch.size() / parts); };
    sum += engine_->TrainStep({at(part), at(part + 1)}, loss, rates, targets_.Limits());
  }
  return sum / static_cast<double>(parts);
}

void TrainingLoop::AddLogLine(const std::vector<int>& validationFrames, const Moment& now)
{
  TrainingRecord& line = report_.Now().record;
  line.seconds = report_.Seconds();
  line.validationPsnr.reset();
  if (!validationFrames.empty())
  {
    line.validationPsnr = MeanPsnr(*engine_, *sweep_, validationFrames);
  }
  course_.log.push_back(line);
  course_.lossSum = 0;
  course_.lossCount = 0;
  if (line.validationPsnr)
  {
    const bool isBetter = course_.Note(*line.validationPsnr, *engine_, plan_.patience);
    if (!isBetter && !IsLastPart(now.fraction) && course_.endsAt == 0)
    {
      course_.endsAt = EndAfter(plan_, course_.iteration, StepsInAll(plan_, now));
    }
  }
}

void TrainingLoop::Tell(const Lap& lap, double fraction)
{
  const double pace = (report_.Seconds() - lap.stageBegun) / (course_.iteration - lap.stageFirst);
  const int coarseness = targets_.Coarseness();
  const double left = SecondsLeft(plan_, frames_.size(), coarseness, Now(fraction), pace);
  report_.Now().secondsLeft = std::max(left, kNoTime);
  secondsOfSecondStage_ = SecondsOfSecondStage(plan_, coarseness, pace);
  report_.Proceed(TrainingProgress::Phase::Training, kSeedingShare + (1 - kSeedingShare) * fraction);
  course_.trainingTime = report_.Seconds() - lap.begun;
}

/// The mean of the last part's fields is the engine's then, and judged as others were.
void TrainingLoop::TakeAverage(const std::vector<int>& validationFrames)
{
  if (course_.average.count > 0)
  {
    engine_->SetPart(course_.average.mean);
    if (course_.best)
    {
      course_.Note(MeanPsnr(*engine_, *sweep_, validationFrames), *engine_, plan_.patience);
    }
  }
}

Fitted TrainingLoop::Result(bool isFinished) const
{
  Fitted fitted;
  fitted.log = course_.log;
  fitted.iterations = course_.iteration;
  fitted.finished = isFinished;
  fitted.field = course_.best ? engine_->Gather(*course_.best) : engine_->GetField();
  if (plan_.iterations > 0)
  {
    RemoveInvisible(fitted.field, plan_.tolerance);
  }
  fitted.aborted = report_.IsAborted();
  return fitted;
}

GaussianField TrainingLoop::Settle(const std::vector<int>& validationFrames)
{
  const Stopwatch watch;
  const double begun = report_.Seconds() - course_.trainingTime;
  const Moment now = Now(FractionDone(plan_, course_.iteration, report_.Seconds(), begun));
  const double rate = RateLeft(plan_, frames_.size(), now);
  Batches batches(targets_.Frames(), plan_.batch, plan_.seed);
  FieldAverage average;
  double done = 0;
  for (int k = 1; done < 1; ++k)
  {
    done = SettlingDone(k, exchange_.OfFirst(watch.Seconds()));
    Step(batches.Next(), plan_.iterations, plan_.loss, Scaled(course_.rates, rate * SettlingRate(done)));
    if (IsSettled(done))
    {
      average.Add(engine_->GetPart().field);
    }
  }
  engine_->SetPart(average.mean);
  GaussianField field = engine_->GetField();
  // The second stage begins with larger steps, which take a field back at first.
  if (const std::optional<FieldPart>& before = course_.best ? course_.best : course_.first)
  {
    const std::vector<int> judges = course_.best ? validationFrames : Judges(frames_);
    const double psnr = MeanPsnr(*engine_, *sweep_, judges);
    engine_->SetPart(before->field);
    if (MeanPsnr(*engine_, *sweep_, judges) >= psnr)
    {
      field = engine_->Gather(*before);
    }
  }
  RemoveInvisible(field, plan_.tolerance);
  return field;
}

}  // namespace bigus
