// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Console.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <locale>
#include <nlohmann/json.hpp>
#include <sstream>

namespace bigus::command
{

double SecondsSince(std::chrono::steady_clock::time_point start)
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
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

std::string FormatNumber(double value, int decimals)
{
  if (std::isnan(value))
  {
    return "-";
  }
  if (std::isinf(value))
  {
    return value > 0 ? "infinite" : "-infinite";
  }
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.setf(std::ios::fixed);
  text.precision(decimals);
  text << value;
  return text.str();
}

void Console::Print(const std::string& line)
{
  EndProgress();
  if (!json)
  {
    std::cout << line << '\n' << std::flush;
  }
}

void Console::Note(const std::string& line)
{
  EndProgress();
  std::cerr << line << '\n' << std::flush;
}

void Console::Report(const Json& object)
{
  EndProgress();
  if (json)
  {
    // Text from files may not be UTF-8; it is replaced, not refused.
    std::cout << object.dump(2, ' ', false, Json::error_handler_t::replace) << '\n' << std::flush;
  }
}

bool Console::ShowsBar() const
{
  return bar == Bar::Always || (bar == Bar::WhenTerminal && isatty(STDERR_FILENO));
}

void Console::Progress(const std::string& job, double fraction, const std::string& text)
{
  if (!ShowsBar())
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
  const bool brief = bar == Bar::WhenTerminal && !open_ && now - start_ < std::chrono::milliseconds(500);
  if (brief || (now - drawn_ < std::chrono::milliseconds(100) && fraction < 1))
  {
    return;
  }
  drawn_ = now;
  open_ = true;

  const double elapsed = SecondsSince(start_);
  const int width = 30;
  const int filled = static_cast<int>(fraction * width);
  std::ostringstream line;
  line << '\r' << job << " [" << std::string(filled, '#') << std::string(width - filled, '.') << "] "
       << FormatNumber(100 * fraction, 0) << " %  " << FormatDuration(elapsed);
  if (!text.empty())
  {
    line << ", " << text;
  }
  else if (fraction > 0 && fraction < 1)
  {
    line << ", " << FormatDuration(elapsed * (1 - fraction) / fraction) << " left";
  }
  line << "\x1b[K";  // what a longer line left behind
  std::cerr << line.str() << std::flush;
}

void Console::EndProgress()
{
  if (open_)
  {
    std::cerr << '\n' << std::flush;
    open_ = false;
  }
  job_.clear();
}

}  // namespace bigus::command
