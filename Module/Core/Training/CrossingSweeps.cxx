// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/CrossingSweeps.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "Core/Engine/Engine.h"
#include "Core/Engine/Exchange.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Training/Report.h"
#include "Core/Training/Seeding.h"
#include "Core/Training/Stopwatch.h"
#include "Core/Training/Targets.h"
#include "Core/Training/ViewTraining.h"

namespace bigus
{
namespace
{

/// Frames of a sequence below which it is not trained by itself.
constexpr std::size_t kFewestFrames = 12;
/// Directions, in units of their size, that differ by less are one.
constexpr double kSameDirection = 0.01;

/// A part of a field's log, as if the training had gone on.
void Append(Fitted& to, const Fitted& from, double begun)
{
  for (TrainingRecord record : from.log)
  {
    record.iteration += to.iterations;
    record.seconds += begun;
    to.log.push_back(record);
  }
  to.iterations += from.iterations;
}

TrainingPlan PlanOfShare(TrainingPlan plan, double share)
{
  plan.gaussians = std::max<std::size_t>(1, static_cast<std::size_t>(share * static_cast<double>(plan.gaussians)));
  plan.iterations = std::max(1, static_cast<int>(share * plan.iterations));
  plan.densification.cap = static_cast<std::size_t>(share * static_cast<double>(plan.densification.cap));
  return plan;
}

/// The fields of all sequences, one behind the other.
struct Joined
{
  Fitted fitted;
  std::vector<int> sequenceOfGaussian, sequenceOfFrame;
  std::string device;
};

/// The states of all sequences' loops, "" of those that have not begun. A loop that ended is kept, too.
class StatesOfSequences
{
public:
  StatesOfSequences(std::size_t sequences, const Keeping& keeping, std::string_view state)
      : keeping_(keeping), states_(sequences)
  {
    if (!state.empty())
    {
      StateReader from(state);
      std::generate(states_.begin(), states_.end(), [&from] { return std::string(from.Text()); });
      from.End();
    }
  }

  void BeginOrResume(std::size_t sequence, TrainingLoop& loop)
  {
    if (keeping_.keep)
    {
      loop.SetKeeping({keeping_.due, [this, sequence](const auto& write) { Keep(sequence, write); }});
    }
    if (states_[sequence].empty())
    {
      loop.Begin(loop.SeedStart());
    }
    else
    {
      loop.Resume(states_[sequence]);
    }
  }

private:
  void Keep(std::size_t sequence, const std::function<void(StateWriter&)>& write)
  {
    StateWriter own;
    write(own);
    states_[sequence] = own.Take();
    keeping_.keep(
        [this](StateWriter& to)
        {
          for (const std::string& state : states_)
          {
            to.Text(state);
          }
        });
  }

  const Keeping& keeping_;
  std::vector<std::string> states_;
};

std::optional<Joined> TrainEach(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& frames,
                                const std::vector<int>& validationFrames, const TrainingPlan& plan,
                                const ProgressCallback& progress, const Keeping& keeping, std::string_view state)
{
  const Stopwatch watch;
  Joined joined;
  const std::vector<std::vector<int>> sequences = BySequence(*sweep, frames);
  StatesOfSequences states(sequences.size(), keeping, state);
  for (std::size_t s = 0; s < sequences.size(); ++s)
  {
    const std::vector<int>& some = sequences[s];
    if (LevelOf(*sweep, some))
    {
      joined.sequenceOfFrame.resize(joined.sequenceOfFrame.size() + some.size(), static_cast<int>(s));
      continue;  // it teaches nothing
    }
    std::vector<int> validation;
    std::copy_if(validationFrames.begin(), validationFrames.end(), std::back_inserter(validation),
                 [&](int frame) { return sweep->SequenceOf(frame) == sweep->SequenceOf(some[0]); });
    const double begun = watch.Seconds();
    const auto tell = [&](TrainingProgress now)
    {
      // The others, and all of them together in half as many steps, take as long for each frame.
      const double later = static_cast<double>(1.5 * frames.size() - joined.sequenceOfFrame.size() - some.size());
      now.secondsLeft += (watch.Seconds() - begun + now.secondsLeft) * later / static_cast<double>(some.size());
      return !progress || progress(now);
    };
    TrainingLoop loop(sweep, some, PlanOfShare(plan, static_cast<double>(some.size()) / frames.size()), tell);
    states.BeginOrResume(s, loop);
    const Fitted fitted = loop.Run(validation);
    if (fitted.aborted)
    {
      return std::nullopt;
    }
    loop.Keep();
    if (joined.fitted.field.Size() == 0)
    {
      joined.fitted.field.beam = fitted.field.beam;
      joined.fitted.field.transfer = fitted.field.transfer;
    }
    joined.fitted.field.Append(fitted.field);
    Append(joined.fitted, fitted, begun);
    joined.sequenceOfGaussian.resize(joined.fitted.field.Size(), static_cast<int>(s));
    joined.sequenceOfFrame.resize(joined.sequenceOfFrame.size() + some.size(), static_cast<int>(s));
    joined.device = loop.engine().Device();
  }
  joined.fitted.finished = true;
  return joined;
}

}  // namespace

bool SequencesCross(const Sweep& sweep, const std::vector<int>& frames)
{
  const std::vector<std::vector<int>> sequences = BySequence(sweep, frames);
  return sequences.size() > 1 && FramesCross(sweep, frames) &&
         std::all_of(sequences.begin(), sequences.end(),
                     [&sweep](const std::vector<int>& some)
                     { return some.size() >= kFewestFrames && !FramesCross(sweep, some); });
}

ViewDependence Apart(GaussianField& field, const std::vector<int>& sequenceOfGaussian, const RecordedViews& views,
                     const std::vector<int>& sequenceOfView)
{
  const std::vector<Eigen::Vector3d> directions = views.Directions();
  ViewDependence view{views, std::vector<Eigen::Vector3d>(field.Size())};
  // With weights g_k of the planes, 1_k whether a plane is of the Gaussian's sequence, p = sum g 1 and c = sum g delta:
  // r_i = r p and q = r C^-1 sum g (1 - p) (delta - c), where C = sum g (delta - c) (delta - c)^T.
  const auto setApart = [&](std::size_t i)
  {
    const std::vector<double> weights = views.WeightsAt(field.means[i]);
    double share = 0;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero(), ofOwn = mean;
    Eigen::Matrix3d squares = kSameDirection * kSameDirection * Eigen::Matrix3d::Identity();
    for (std::size_t k = 0; k < directions.size(); ++k)
    {
      const Eigen::Vector3d weighted = weights[k] * directions[k];
      mean += weighted;
      squares += weighted * directions[k].transpose();
      if (sequenceOfView[k] == sequenceOfGaussian[i])
      {
        share += weights[k];
        ofOwn += weighted;
      }
    }
    const Eigen::Matrix3d covariance = squares - mean * mean.transpose();
    const double r = field.reflectivities[i];
    view.terms[i] = r * covariance.ldlt().solve(ofOwn - share * mean);
    field.reflectivities[i] = r * share;
  };
  tbb::parallel_for(std::size_t(0), field.Size(), setApart);
  return view;
}

std::optional<TrainedApart> TrainApart(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& frames,
                                       const std::vector<int>& validationFrames, const TrainingPlan& plan,
                                       const ProgressCallback& progress, const Keeping& keeping, std::string_view state)
{
  std::optional<Joined> joined = TrainEach(sweep, frames, validationFrames, plan, progress, keeping, state);
  if (!joined || joined->fitted.field.Size() == 0)
  {
    return std::nullopt;
  }
  Fitted& fitted = joined->fitted;
  const ViewDependence first =
      Apart(fitted.field, joined->sequenceOfGaussian, RecordedViews::Of(*sweep, frames), joined->sequenceOfFrame);
  const std::unique_ptr<Engine> engine = Engine::Create("cpu");
  Report report(plan, progress, Exchange::Alone());
  Targets targets(sweep, frames, plan, *engine, report, nullptr);
  if (!targets.SetPlanes({plan.virtualPlanes}))
  {
    return std::nullopt;
  }
  const ViewTargets of = {WithCountedPixels(targets.Images(), plan.ignoreMasked), targets.Frames(), targets.Limits()};
  std::optional<ViewedField> viewed =
      TrainViews(*engine, of, plan, fitted.field, first,
                 [&report] { return report.Proceed(TrainingProgress::Phase::Training, 1); });
  if (!viewed)
  {
    return std::nullopt;
  }
  fitted.field = std::move(viewed->field);
  return TrainedApart{std::move(fitted), std::move(viewed->view), joined->device};
}

}  // namespace bigus
