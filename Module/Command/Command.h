// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the subcommands share: how each joins the program, and how numbers are checked.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "Console.h"
#include "Exit.h"

namespace bigus::command
{

/// One subcommand is chosen by the arguments; it leaves its work in `job`, which Run runs.
struct Program
{
  CLI::App app;
  Console console;
  std::function<ExitCode()> job;
};

void AddInfo(Program& program);
void AddPhantom(Program& program);
void AddPoses(Program& program);
void AddTrain(Program& program);
void AddSlice(Program& program);
void AddVoxelize(Program& program);
void AddMetrics(Program& program);
void AddConvert(Program& program);
void AddBench(Program& program);
void AddView(Program& program);

/// The whole program: understands the arguments and does what they ask for.
ExitCode Run(int argumentCount, char** arguments);

/// Says what went wrong, to people or to machines. Returns `code`.
ExitCode Fail(Console& console, ExitCode code, const std::string& message);

/// Runs `job`. Whatever it throws becomes an exit code and one message, on stderr and in JSON.
ExitCode RunJob(Console& console, const std::function<ExitCode()>& job);

/// Makes `work` the program's job where the arguments choose the subcommand `app`.
void RunWhenChosen(CLI::App* app, Program& program, std::function<ExitCode(Console&)> work);

/// An option's value must be a finite number from `low` to `high`, both included.
CLI::Validator NumberIn(double low, double high);

/// The same for a value above zero, up to 1e6.
CLI::Validator PositiveNumber();

}  // namespace bigus::command
