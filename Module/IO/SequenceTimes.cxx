// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/SequenceTimes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "Core/Numerics/Format.h"
#include "Core/Numerics/Statistics.h"
#include "IO/Formats/HeaderFields.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr double kShortestStep = 2e-4, kLongestStep = 10;  // s between the poses of a tracker, on the median

std::string NameOfUnit(double unit)
{
  return unit == 1e-3 ? "milliseconds" : unit == 1e-6 ? "microseconds" : "nanoseconds";
}

/// Its finite times.
std::vector<double> FiniteTimesOf(const SequenceFile& file)
{
  std::vector<double> times;
  double time = 0;
  for (const Fields& fields : file.frames)
  {
    if (const std::string* text = Find(fields, "Timestamp"); text && ParseNumber(*text, time) && std::isfinite(time))
    {
      times.push_back(time);
    }
  }
  return times;
}

}  // namespace

std::optional<double> UnitOfTime(const std::string& name)
{
  static const std::map<std::string, double> units = {
      {"", 0},      {"s", 1},       {"sec", 1},      {"secs", 1},      {"seconds", 1},
      {"ms", 1e-3}, {"msec", 1e-3}, {"msecs", 1e-3}, {"millis", 1e-3}, {"milliseconds", 1e-3},
      {"us", 1e-6}, {"usec", 1e-6}, {"usecs", 1e-6}, {"micros", 1e-6}, {"microseconds", 1e-6},
      {"ns", 1e-9}, {"nsec", 1e-9}, {"nsecs", 1e-9}, {"nanos", 1e-9},  {"nanoseconds", 1e-9}};
  const auto unit = units.find(name);
  return unit == units.end() ? std::nullopt : std::optional(unit->second);
}

double UnitByRate(std::vector<double> times, double& step)
{
  times.erase(std::remove_if(times.begin(), times.end(), [](double time) { return !std::isfinite(time); }),
              times.end());
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  std::adjacent_difference(times.begin(), times.end(), times.begin());
  if (times.size() < 2)
  {
    return 1;
  }
  std::sort(times.begin() + 1, times.end());
  step = Quantile({times.begin() + 1, times.end()}, 0.5);
  for (const double unit : {1.0, 1e-3, 1e-6, 1e-9})
  {
    if (kShortestStep <= unit * step && unit * step <= kLongestStep)
    {
      return unit;
    }
  }
  return 1;
}

std::string StatedUnitOf(const std::vector<double>& times)
{
  double step = 0;
  return UnitByRate(times, step) == 1 ? "" : "s";
}

void TakeTimesInSeconds(SequenceFile& file)
{
  if (const std::string* stated = Find(file.fields, "TimestampUnit"); stated && file.timeUnit == 0)
  {
    file.timeUnit = UnitOfTime(Lowercase(*stated)).value_or(0);
  }
  double unit = file.timeUnit, step = 0;
  if (unit == 0)
  {
    unit = UnitByRate(FiniteTimesOf(file), step);
    if (unit != 1)
    {
      file.notes.push_back(file.fileName + ": the times are taken for " + NameOfUnit(unit) + ", because they are " +
                           Format("%.4g", step) + " apart");
    }
  }
  double time = 0;
  for (Fields& fields : file.frames)
  {
    if (const auto text = fields.find("Timestamp");
        unit != 1 && text != fields.end() && ParseNumber(text->second, time))
    {
      text->second = ExactNumber(unit * time);
    }
  }
  file.timeUnit = 1;
}

}  // namespace bigus
