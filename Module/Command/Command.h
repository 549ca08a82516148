// What the subcommands share: how each joins the program, how numbers are checked, and what ends the program.
#pragma once

#include <CLI/CLI.hpp>
#include <exception>
#include <functional>
#include <string>

#include "Console.h"
#include "Core/Error.h"

namespace bigus::command
{

/// What the program returns to the shell.
enum ExitCode
{
  Success = 0,
  UsageFault = 1,   ///< an option that does not exist, or a value out of its range
  InputFault = 2,   ///< a file that is missing, broken, or unfit for the job
  OutputFault = 3,  ///< a file that cannot be written
  Stopped = 130     ///< interrupted (SIGINT or SIGTERM)
};

/// An output that cannot be written. Every other Error counts as bad input.
class OutputError : public Error
{
public:
  using Error::Error;
};

/// Thrown where a job stops because it was interrupted and has nothing to save.
class Interrupted : public std::exception
{
};

/// True once the process got SIGINT or SIGTERM. A second signal ends it at once.
bool IsInterrupted();

/// One subcommand is chosen by the arguments; it leaves its work in `job`, which main runs.
struct Program
{
  CLI::App app;
  Console console;
  std::function<ExitCode()> job;
};

void AddInfo(Program& program);
void AddPhantom(Program& program);
void AddTrain(Program& program);
void AddSlice(Program& program);
void AddVoxelize(Program& program);
void AddMetrics(Program& program);
void AddConvert(Program& program);

/// Text to a finite number; the whole text counts, with a point as decimal mark whatever the locale. False otherwise.
bool ParseNumber(const std::string& text, double& value);

/// An option's value must be a finite number from `low` to `high`, both included.
CLI::Validator NumberIn(double low, double high);

/// The same for a value above zero, up to 1e6.
CLI::Validator PositiveNumber();

}  // namespace bigus::command
