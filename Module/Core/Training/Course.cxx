// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/Course.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>

#include "Core/Engine/FieldState.h"
#include "Core/Training/Schedule.h"

namespace bigus
{
namespace
{

/// PSNR of equal images is infinite; a state holds finite numbers only.
constexpr double kEqualImages = std::numeric_limits<double>::max();

/// Writes what it is shown. Loading has the same methods, so what a state holds, in which order and within which bounds
/// is said once, in Visit.
class Saving
{
public:
  explicit Saving(StateWriter& to) : to_(to) {}

  template <class T>
  void Number(const T& value)
  {
    to_.Number(value);
  }
  template <class T>
  void NumberIn(T /*least*/, T /*most*/, const T& value)
  {
    to_.Number(value);
  }
  void Flag(const bool& value) { to_.Flag(value); }
  void Psnr(const double& psnr) { to_.Number(std::min(psnr, kEqualImages)); }
  void Psnr(const std::optional<double>& psnr)
  {
    to_.Flag(psnr.has_value());
    Psnr(psnr.value_or(0));
  }
  void Array(const std::vector<double>& values) { to_.Array(values); }
  void Field(const GaussianField& field) { SaveField(field, to_); }
  void Kept(const std::optional<FieldPart>& kept, bool /*isOfSeveral*/)
  {
    to_.Flag(kept.has_value());
    if (kept)
    {
      SaveField(kept->field, to_);
      to_.Array(kept->places);
    }
  }
  void Size(const std::vector<TrainingRecord>& log) { to_.Number<std::uint64_t>(log.size()); }
  void Require(bool /*isSound*/, const char* /*found*/) {}

private:
  StateWriter& to_;
};

class Loading
{
public:
  explicit Loading(StateReader& from) : from_(from) {}

  template <class T>
  void Number(T& value)
  {
    value = from_.Number<T>();
  }
  template <class T>
  void NumberIn(T least, T most, T& value)
  {
    value = from_.NumberIn(least, most);
  }
  void Flag(bool& value) { value = from_.Flag(); }
  void Psnr(double& psnr)
  {
    Number(psnr);
    psnr = psnr == kEqualImages ? std::numeric_limits<double>::infinity() : psnr;
  }
  void Psnr(std::optional<double>& psnr)
  {
    double value = 0;
    const bool isKnown = from_.Flag();
    Psnr(value);
    psnr = isKnown ? std::optional(value) : std::nullopt;
  }
  void Array(std::vector<double>& values) { values = from_.Array<double>(); }
  void Field(GaussianField& field) { field = LoadField(from_); }
  /// Of several processes one may have no Gaussian.
  void Kept(std::optional<FieldPart>& kept, bool isOfSeveral)
  {
    if (from_.Flag())
    {
      kept = FieldPart{LoadField(from_), from_.Array<std::uint32_t>()};
      Require(kept->places.size() == (isOfSeveral ? kept->field.Size() : 0), "places of other Gaussians");
      Require(isOfSeveral || kept->field.Size() > 0, "a field of no Gaussian");
    }
  }
  void Size(std::vector<TrainingRecord>& log)
  {
    constexpr std::size_t kLineBytes = sizeof(int) + 4 * sizeof(double) + sizeof(std::uint64_t) + 1;
    log.resize(from_.Count(kLineBytes));
  }
  void Require(bool isSound, const char* found) { StateReader::Require(isSound, found); }

private:
  StateReader& from_;
};

template <class Archive, class Log>
void VisitLog(Archive& archive, Log& log)
{
  archive.Size(log);
  for (auto& line : log)
  {
    archive.Number(line.iteration);
    archive.Number(line.seconds);
    archive.Number(line.loss);
    archive.Psnr(line.validationPsnr);
    archive.Number(line.gaussians);
    archive.Number(line.rate);
  }
}

/// `AnyCourse` is Course, const where it is saved.
template <class Archive, class AnyCourse>
void Visit(Archive archive, const CourseBounds& bounds, AnyCourse& course)
{
  const TrainingPlan& plan = bounds.plan;
  archive.NumberIn(1, std::max(plan.iterations, 1), course.iteration);
  archive.NumberIn(0, course.iteration, course.firstStage);
  archive.NumberIn(1, bounds.side, course.coarseness);
  archive.NumberIn(0, plan.virtualPlanes, course.second.planes);
  archive.NumberIn(1, bounds.side, course.second.coarseness);
  archive.NumberIn(1, course.second.planes > 0 ? 1 : bounds.side, course.second.pixelStep);
  archive.Flag(course.second.flow);
  archive.NumberIn(0.0, 1e9, course.passes);
  archive.Flag(course.isFirstStage);
  archive.NumberIn(0.0, GaussianField::kLargestCoordinate, course.rates.mean);
  archive.NumberIn(0.0, 1.0, course.rates.logScale);  // OptionList.h
  archive.NumberIn(0.0, 1.0, course.rates.rotation);
  archive.NumberIn(0.0, 10 * GaussianField::kLargestReflectivity, course.rates.reflectivity);
  archive.Number(course.cap);
  archive.Number(course.trainingTime);
  archive.Number(course.lossSum);
  archive.NumberIn(0, course.iteration, course.lossCount);
  archive.NumberIn(std::size_t(0), plan.frameGains ? kCorrections.size() : 0, course.corrections);
  archive.Array(course.corrected.gains);
  archive.Array(course.corrected.offsets);
  const std::size_t corrected = course.corrections > 0 ? bounds.frames : 0;
  archive.Require(course.corrected.gains.size() == corrected && course.corrected.offsets.size() == corrected,
                  "corrections of other frames");
  VisitLog(archive, course.log);
  archive.Kept(course.best, bounds.isOfSeveral);
  archive.Psnr(course.bestPsnr);
  archive.NumberIn(0, plan.patience, course.sinceBest);
  archive.NumberIn(0, plan.iterations, course.endsAt);
  archive.NumberIn(0, course.iteration, course.average.count);
  if (course.average.count > 0)
  {
    archive.Field(course.average.mean);
  }
  archive.Kept(course.first, bounds.isOfSeveral);
}

}  // namespace

bool Course::Note(double psnr, const Engine& engine, int patience)
{
  if (!best || psnr > bestPsnr)
  {
    best = engine.GetPart();
    bestPsnr = psnr;
    sinceBest = 0;
    return true;
  }
  sinceBest = std::min(sinceBest + 1, patience);  // the last part goes on when they are used up
  return sinceBest < patience;
}

void SaveCourse(const Course& course, const CourseBounds& bounds, StateWriter& to)
{
  Visit(Saving(to), bounds, course);
}

Course LoadCourse(const CourseBounds& bounds, StateReader& from)
{
  Course course;
  Visit(Loading(from), bounds, course);
  return course;
}

void SaveParts(std::string own, Exchange& exchange, StateWriter& to)
{
  const std::vector<std::string> all = exchange.Gather(std::move(own));
  to.Number<std::uint64_t>(all.size());
  for (const std::string& part : all)
  {
    to.Text(part);
  }
}

std::string_view LoadPart(std::string_view state, Exchange& exchange)
{
  StateReader all(state);
  const auto processes = static_cast<std::uint64_t>(exchange.Size());
  const auto here = static_cast<std::uint64_t>(exchange.Rank());
  StateReader::Require(all.Number<std::uint64_t>() == processes, "the parts of another number of processes");
  std::string_view own;
  for (std::uint64_t rank = 0; rank < processes; ++rank)
  {
    const std::string_view part = all.Text();
    own = rank == here ? part : own;
  }
  all.End();
  return own;
}

}  // namespace bigus
