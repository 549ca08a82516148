// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Console.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>

#include "IO/Text.h"

namespace bigus::command
{

double SecondsSince(std::chrono::steady_clock::time_point start)
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::string XmlEscaped(const std::string& text)
{
  std::string escaped;
  for (const char c : text)
  {
    escaped += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : std::string(1, c);
  }
  return escaped;
}

std::string FormatDuration(double seconds)
{
  const long total = std::lround(std::min(std::max(seconds, 0.0), 3.6e6));
  char text[32];
  if (total >= 3600)
  {
    std::snprintf(text, sizeof text, "%ld:%02ld:%02ld", total / 3600, total / 60 % 60, total % 60);
  }
  else
  {
    std::snprintf(text, sizeof text, "%ld:%02ld", total / 60, total % 60);
  }
  return text;
}

std::string Words(const std::string& pattern, const Json& values)
{
  std::string text;
  for (std::size_t at = 0; at < pattern.size();)
  {
    const std::size_t open = pattern.find('{', at), close = pattern.find('}', open);
    text += pattern.substr(at, open - at);
    if (close == std::string::npos)
    {
      break;
    }
    const std::string field = pattern.substr(open + 1, close - open - 1);
    const std::size_t colon = field.find(':');
    const Json& value = values.at(Json::json_pointer("/" + field.substr(0, colon)));
    if (colon != std::string::npos)
    {
      const double scale = field.back() == 'M' ? 1e-6 : 1;
      text += FormatNumber(value.get<double>() * scale, field[colon + 1] - '0');
    }
    else
    {
      text += value.is_string() ? value.get<std::string>() : value.dump();
    }
    at = close + 1;
  }
  return text;
}

std::string NoiseText(double translation, double rotation, double corner)
{
  if (std::isnan(translation))
  {
    return "unknown, too few poses on one path";
  }
  return FormatNumber(translation, 3) + " mm and " + FormatNumber(rotation, 3) + " degrees on each axis, " +
         FormatNumber(corner, 3) + " mm at the image's corners";
}

void Console::Print(const std::string& line)
{
  const std::lock_guard lock(mutex_);
  EndProgress();
  if (!json)
  {
    std::cout << Printable(line) << '\n' << std::flush;
  }
}

void Console::Print(const std::string& pattern, const Json& values)
{
  Print(Words(pattern, values));
}

void Console::Note(const std::string& line)
{
  const std::lock_guard lock(mutex_);
  EndProgress();
  std::cerr << Printable(line) << '\n' << std::flush;
}

void Console::Report(const Json& object)
{
  const std::lock_guard lock(mutex_);
  EndProgress();
  if (json)
  {
    // Text from files may not be UTF-8; it is replaced, not refused.
    std::cout << object.dump(2, ' ', false, Json::error_handler_t::replace) << '\n' << std::flush;
  }
}

namespace
{

/// Columns of the terminal that stderr is; enough for a bar where it is none.
std::size_t TerminalWidth()
{
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 ? size.ws_col : 120;
}

}  // namespace

bool Console::ShowsBar() const
{
  return bar == Bar::Always || (bar == Bar::WhenTerminal && isatty(STDERR_FILENO));
}

void Console::Progress(const std::string& job, double fraction, const std::string& text)
{
  const std::lock_guard lock(mutex_);
  if (bar == Bar::Tags && !json)
  {
    Tag(job, fraction, text);
  }
  if (bar == Bar::Never || bar == Bar::Tags)
  {
    return;
  }
  const Clock::time_point now = Clock::now();
  if (job != job_)
  {
    EndProgress();
    job_ = job;
    start_ = now;
    drawn_ = {};
  }
  fraction = std::isfinite(fraction) ? std::min(std::max(fraction, 0.0), 1.0) : 0.0;
  const double ofJob = SecondsSince(start_);
  std::string rest = FormatNumber(100 * fraction, 0) + " %  " + FormatDuration(SecondsSince(begin_));
  if (!text.empty())
  {
    rest += ", " + text;
  }
  else if (fraction > 0 && fraction < 1)
  {
    rest += ", " + FormatDuration(ofJob * (1 - fraction) / fraction) + " left";
  }

  if (!ShowsBar())
  {
    // A log: rare whole lines.
    if (now - std::max(start_, drawn_) >= std::chrono::seconds(10))
    {
      drawn_ = now;
      std::cerr << job << ": " << rest << '\n' << std::flush;
    }
    return;
  }
  const bool brief = bar == Bar::WhenTerminal && !open_ && now - start_ < std::chrono::milliseconds(500);
  if (brief || (now - drawn_ < std::chrono::milliseconds(100) && fraction < 1))
  {
    return;
  }
  drawn_ = now;
  open_ = true;

  // A line that wrapped could not be drawn over. What is told comes before the bar.
  const std::size_t room = TerminalWidth() - 1;
  const std::size_t width = room >= 110 ? 30 : room >= 95 ? 10 : 0;
  std::string line = job + " ";
  if (width > 0)
  {
    const auto filled = static_cast<std::size_t>(fraction * static_cast<double>(width));
    line += "[" + std::string(filled, '#') + std::string(width - filled, '.') + "] ";
  }
  line += rest;
  std::cerr << '\r' << line.substr(0, room) << "\x1b[K" << std::flush;  // the last: what a longer line left behind
}

// https://www.slicer.org/wiki/Documentation/Nightly/Developers/SlicerExecutionModel: a filter is a job here.
void Console::Tag(const std::string& job, double fraction, const std::string& text)
{
  const Clock::time_point now = Clock::now();
  if (job != job_)
  {
    EndProgress();
    job_ = job;
    start_ = now;
    drawn_ = {};
    open_ = true;
    std::cout << "<filter-start>\n<filter-name>" << job << "</filter-name>\n<filter-comment>" << job
              << "</filter-comment>\n</filter-start>\n";
  }
  if (now - drawn_ < std::chrono::milliseconds(100) && fraction < 1)
  {
    return;
  }
  drawn_ = now;
  if (!text.empty())
  {
    std::cout << "<filter-comment>" << XmlEscaped(text) << "</filter-comment>\n";
  }
  std::cout << "<filter-progress>" << FormatNumber(std::isfinite(fraction) ? std::clamp(fraction, 0.0, 1.0) : 0.0, 4)
            << "</filter-progress>\n"
            << std::flush;
}

void Console::EndProgress()
{
  const std::lock_guard lock(mutex_);
  if (open_ && bar == Bar::Tags)
  {
    std::cout << "<filter-end>\n<filter-name>" << job_ << "</filter-name>\n<filter-time>"
              << FormatNumber(SecondsSince(start_), 2) << "</filter-time>\n</filter-end>\n"
              << std::flush;
    open_ = false;
  }
  if (open_)
  {
    std::cerr << '\n' << std::flush;
    open_ = false;
  }
  job_.clear();
}

}  // namespace bigus::command
