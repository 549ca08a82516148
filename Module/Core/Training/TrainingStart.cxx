// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How a training begins or goes on; what it does then is in TrainingLoop.cxx.
#include <algorithm>
#include <utility>

#include "Core/Engine/Exchange.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/Seeding.h"
#include "Core/Training/TrainingLoop.h"

namespace bigus
{

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

void TrainingLoop::Replan(TrainingPlan plan)
{
  plan_ = std::move(plan);
  if (plan_.timeLimit > 0)
  {
    plan_.timeLimit += report_.Seconds();
  }
}

}  // namespace bigus
