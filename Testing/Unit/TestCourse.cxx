// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The bytes of what a training keeps between steps.
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "Core/Engine/Exchange.h"
#include "Core/Engine/FieldState.h"
#include "Core/Model/Error.h"
#include "Core/Training/Course.h"

namespace
{

using bigus::Course;
using bigus::CourseBounds;
using bigus::Exchange;
using bigus::GaussianField;
using bigus::StateReader;
using bigus::StateWriter;
using bigus::TrainingPlan;

GaussianField Field(double r)
{
  GaussianField field;
  field.Resize(1);
  field.means[0] = {1, 2, 3};
  field.scales[0] = {0.5, 0.6, 0.7};
  field.rotations[0] = {1, 0, 0, 0};
  field.reflectivities[0] = r;
  return field;
}

TrainingPlan Plan()
{
  TrainingPlan plan;
  plan.iterations = 100;
  plan.virtualPlanes = 3;
  plan.patience = 5;
  plan.frameGains = true;
  return plan;
}

Course Full()
{
  Course course;
  course.iteration = 60;
  course.firstStage = 25;
  course.coarseness = 2;
  course.second = {3, 1, 1, false};
  course.passes = 12.5;
  course.rates = {0.1, 0.2, 0.3, 0.4};
  course.cap = 77;
  course.trainingTime = 4.5;
  course.lossSum = 0.75;
  course.lossCount = 6;
  course.corrections = 1;
  course.corrected = {{1.5, 0.5}, {0.25, -0.25}};
  course.log = {{10, 1.5, 0.25, std::numeric_limits<double>::infinity(), 9, 0.5},
                {20, 2.5, 0.125, std::nullopt, 8, 0.25}};
  course.best = bigus::FieldPart{Field(1), {}};
  course.bestPsnr = 31;
  course.sinceBest = 2;
  course.endsAt = 90;
  course.average.count = 3;
  course.average.mean = Field(2);
  return course;
}

std::string Bytes(const Course& course, const CourseBounds& bounds)
{
  StateWriter to;
  SaveCourse(course, bounds, to);
  return to.Take();
}

// The format, written out once more; a change of it needs another number in Checkpointer.cxx.
std::string FullByHand()
{
  StateWriter to;
  for (const int number : {60, 25, 2, 3, 1, 1})
  {
    to.Number(number);
  }
  to.Flag(false);
  to.Number(12.5);
  to.Flag(false);
  for (const double rate : {0.1, 0.2, 0.3, 0.4})
  {
    to.Number(rate);
  }
  to.Number(std::uint64_t(77));
  to.Number(4.5);
  to.Number(0.75);
  to.Number(6);
  to.Number(std::uint64_t(1));
  to.Array(std::vector<double>{1.5, 0.5});
  to.Array(std::vector<double>{0.25, -0.25});
  to.Number(std::uint64_t(2));
  to.Number(10);
  to.Number(1.5);
  to.Number(0.25);
  to.Flag(true);
  to.Number(std::numeric_limits<double>::max());  // in place of infinity
  to.Number(std::uint64_t(9));
  to.Number(0.5);
  to.Number(20);
  to.Number(2.5);
  to.Number(0.125);
  to.Flag(false);
  to.Number(0.0);
  to.Number(std::uint64_t(8));
  to.Number(0.25);
  to.Flag(true);
  bigus::SaveField(Field(1), to);
  to.Array(std::vector<std::uint32_t>());
  to.Number(31.0);
  to.Number(2);
  to.Number(90);
  to.Number(3);
  bigus::SaveField(Field(2), to);
  to.Flag(false);
  return to.Take();
}

TEST(Course, HasTheBytesOfItsFormatAndComesBackFromThem)
{
  const TrainingPlan plan = Plan();
  const CourseBounds bounds{plan, 48, 2, false};
  const std::string bytes = Bytes(Full(), bounds);
  EXPECT_EQ(bytes, FullByHand());
  StateReader from(bytes);
  const Course back = LoadCourse(bounds, from);
  from.End();
  EXPECT_EQ(Bytes(back, bounds), bytes);
  EXPECT_EQ(back.log[0].validationPsnr, std::numeric_limits<double>::infinity());
  EXPECT_FALSE(back.log[1].validationPsnr);
}

TEST(Course, EveryCutIsRefused)
{
  const TrainingPlan plan = Plan();
  const CourseBounds bounds{plan, 48, 2, false};
  const std::string bytes = Bytes(Full(), bounds);
  for (std::size_t size = 0; size < bytes.size(); ++size)
  {
    StateReader from(std::string_view(bytes).substr(0, size));
    EXPECT_THROW(LoadCourse(bounds, from), bigus::Error) << size << " bytes";
  }
}

TEST(Course, NumbersOfAnotherPlanAreRefused)
{
  const TrainingPlan plan = Plan();
  const std::string bytes = Bytes(Full(), {plan, 48, 2, false});
  const auto load = [&bytes](const TrainingPlan& other, int side, std::size_t frames)
  {
    StateReader from(bytes);
    return LoadCourse({other, side, frames, false}, from);
  };
  EXPECT_NO_THROW(load(plan, 48, 2));
  EXPECT_THROW(load(plan, 1, 2), bigus::Error) << "frames are reduced by more than their side";
  EXPECT_THROW(load(plan, 48, 3), bigus::Error) << "gains of two frames";
  TrainingPlan shorter = plan, fewer = plan, sooner = plan;
  shorter.iterations = 59;
  fewer.virtualPlanes = 2;
  sooner.patience = 1;
  EXPECT_THROW(load(shorter, 48, 2), bigus::Error);
  EXPECT_THROW(load(fewer, 48, 2), bigus::Error);
  EXPECT_THROW(load(sooner, 48, 2), bigus::Error);
}

TEST(Course, OfSeveralProcessesEachGetsItsOwnPart)
{
  StateWriter alone;
  bigus::SaveParts("mine", Exchange::Alone(), alone);
  const std::string one = alone.Take();
  EXPECT_EQ(bigus::LoadPart(one, Exchange::Alone()), "mine");
  StateWriter two;
  two.Number(std::uint64_t(2));
  two.Text("mine");
  two.Text("theirs");
  const std::string both = two.Take();
  EXPECT_THROW(bigus::LoadPart(both, Exchange::Alone()), bigus::Error);
}

}  // namespace
