// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the command says and where: answers on stdout, messages and progress on stderr, one JSON object for
// machines.
#pragma once

#include <chrono>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "Core/Numerics/Format.h"

namespace bigus::command
{

/// Keys keep the order they were written in. Numbers that are not finite become null.
using Json = nlohmann::ordered_json;

/// Its calls may come from several threads.
class Console
{
public:
  enum class Bar
  {
    WhenTerminal,  ///< when stderr is a terminal
    Always,
    Never,
    Tags  ///< elements of XML on stdout instead, as 3D Slicer reads progress of its modules
  };
  bool json = false;            ///< --json: stdout carries one JSON object, the answer, and nothing else
  Bar bar = Bar::WhenTerminal;  ///< --progress, --no-progress

  /// A line of the answer for people, on stdout; nothing with --json. What a terminal would obey is not shown, here and in
  /// Note: names and provenance come from files.
  void Print(const std::string& line);
  /// The same of values of the answer, by Words.
  void Print(const std::string& pattern, const Json& values);
  /// A line about what is going on, on stderr.
  void Note(const std::string& line);
  /// The answer for machines; printed only with --json.
  void Report(const Json& object);

  /// Draws a bar, at most ten times a second and as wide as the terminal at most; on a terminal only for jobs that take
  /// longer than half a second. It tells the time since the program's start and, without a text of the job's own, how long
  /// the job will take. Without a terminal a line is written every ten seconds.
  void Progress(const std::string& job, double fraction, const std::string& text = "");
  /// Ends the bar's line. Note and Print do it themselves.
  void EndProgress();

private:
  using Clock = std::chrono::steady_clock;
  bool ShowsBar() const;
  void Tag(const std::string& job, double fraction, const std::string& text);

  std::recursive_mutex mutex_;
  std::string job_;
  Clock::time_point begin_ = Clock::now();  ///< of the program
  Clock::time_point start_, drawn_;         ///< of the job, of its last drawing
  bool open_ = false;
};

/// Seconds from `start` to now.
double SecondsSince(std::chrono::steady_clock::time_point start);

/// Text as it stands between tags of XML.
std::string XmlEscaped(const std::string& text);

/// "0:07", "12:34", "1:02:03".
std::string FormatDuration(double seconds);

/// A line for people with what `values` holds in it, so that a number is written down once for people and machines: "{psnr:2}
/// dB" is the value at "psnr" with two decimals, "{bytes:1M}" that at "bytes" in millions, "{device}" what needs no decimals;
/// "/" leads into objects inside. Throws what nlohmann::json throws for a name that is not there.
std::string Words(const std::string& pattern, const Json& values);

/// A tracker's noise, as Trajectory has it: mm and degrees on each axis, mm at the image's corners; or that it is unknown.
std::string NoiseText(double translation, double rotation, double corner);

}  // namespace bigus::command
