// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How a run ends: exit codes, and the exceptions that lead to them.
#pragma once

#include <exception>
#include <string>

#include "Core/Model/Error.h"

namespace bigus::command
{

/// What the program returns to the shell.
enum ExitCode
{
  Success = 0,
  UsageFault = 1,   ///< an option that does not exist, or a value out of its range
  InputFault = 2,   ///< a file that is missing, broken, or unfit for the job
  OutputFault = 3,  ///< a file that cannot be written
  Stopped = 128     ///< plus the number of the signal that ended it, as shells count: 130 by SIGINT, 143 by SIGTERM
};

/// The message with the options that cure what the library complains about. It speaks of settings, because it does not
/// know of options.
std::string WithRemedy(const std::string& message);

/// An output that cannot be written. Every other Error counts as bad input.
class OutputError : public Error
{
public:
  using Error::Error;
};

/// Throws OutputError unless `holds`, as Require of Core/Model/Error.h does.
template <class... Parts>
void RequireOutput(bool holds, const Parts&... message)
{
  if (!holds)
  {
    throw OutputError(MessageText(message...));
  }
}

/// Thrown where a job stops because it was interrupted and has nothing to save.
class Interrupted : public std::exception
{
};

/// From here on the signals are noted by which people, terminals, pipes and batch systems end programs: SIGINT, SIGTERM,
/// SIGHUP, SIGPIPE, SIGALRM, SIGUSR1, SIGUSR2 and SIGXCPU, but for those that the process was started to ignore.
void ListenToSignals();
/// True once the process got one of them. A second one ends it at once, but for SIGPIPE.
bool IsInterrupted();
/// What a process returns that was interrupted.
ExitCode InterruptedCode();

}  // namespace bigus::command
