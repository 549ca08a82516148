// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Command.h"

#include <cmath>
#include <iostream>
#include <new>
#include <utility>

#include "IO/Text.h"

namespace bigus::command
{

ExitCode Fail(Console& console, ExitCode code, const std::string& message)
{
  console.Note("bigus: " + message);
  console.Report({{"error", message}, {"exit_code", static_cast<int>(code)}});
  return code;
}

ExitCode RunJob(Console& console, const std::function<ExitCode()>& job)
{
  try
  {
    const ExitCode code = job();
    RequireOutput(std::cout.flush() || IsInterrupted(),
                  "Cannot write to stdout: the disk is full or the reader is gone.");
    return code;
  }
  catch (const Interrupted&)
  {
    return Fail(console, InterruptedCode(), "Interrupted: nothing was written.");
  }
  catch (const OutputError& error)
  {
    return Fail(console, OutputFault, error.what());
  }
  catch (const Error& error)
  {
    return Fail(console, InputFault, WithRemedy(error.what()));
  }
  catch (const std::bad_alloc&)
  {
    return Fail(console, InputFault,
                "Not enough memory for this job: use --reduce, fewer Gaussians or a smaller output.");
  }
  catch (const std::exception& error)  // of a library
  {
    return Fail(console, InputFault, std::string("Failed for a reason that was not foreseen: ") + error.what());
  }
}

void RunWhenChosen(CLI::App* app, Program& program, std::function<ExitCode(Console&)> work)
{
  app->callback([&program, work = std::move(work)]
                { program.job = [&program, work] { return work(program.console); }; });
}

namespace
{

CLI::Validator Number(double low, double high, bool whole)
{
  const auto plain = [](double bound) { return FormatNumber(bound, bound == std::floor(bound) ? 0 : 2); };
  const auto check = [low, high, whole, plain](const std::string& text) -> std::string
  {
    double value = 0;
    if (ParseNumber(text, value) && value >= low && value <= high && (!whole || value == std::floor(value)))
    {
      return {};
    }
    return "'" + text + "' is not a " + (whole ? "whole " : "") + "number from " + plain(low) + " to " + plain(high);
  };
  return CLI::Validator(check, "", std::string(whole ? kWhole : kReal) + " " + plain(low) + " " + plain(high));
}

}  // namespace

CLI::Validator Named(const std::string& name)
{
  return CLI::Validator([](const std::string&) { return std::string(); }, "", name);
}

CLI::Validator NumberIn(double low, double high)
{
  return Number(low, high, false);
}

CLI::Validator WholeNumberIn(double low, double high)
{
  return Number(low, high, true);
}

CLI::Validator PositiveNumber()
{
  const auto check = [](const std::string& text) -> std::string
  {
    double value = 0;
    if (ParseNumber(text, value) && value > 0 && value <= 1e6)
    {
      return {};
    }
    return "'" + text + "' is not a number above 0 (and at most 1e6)";
  };
  return CLI::Validator(check, "", kReal);
}

CLI::Validator FileToRead(const std::string& endings)
{
  return Named("file input " + endings);
}

CLI::Validator FileToWrite(const std::string& endings)
{
  return Named("file output " + endings);
}

CLI::Validator VolumeToRead(const std::string& endings)
{
  return Named("image input " + endings);
}

CLI::Validator VolumeToWrite(const std::string& endings)
{
  return Named("image output " + endings);
}

}  // namespace bigus::command
