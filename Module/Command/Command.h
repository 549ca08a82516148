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

/// What every program and command can be told.
struct CommonOptions
{
  bool progress = false;
  int threads = 0;             ///< 0: all cores
  std::string instructionSet;  ///< empty: the best, or that of the environment
  double memory = 0;           ///< GB; 0: no limit
};

/// What is chosen by the arguments leaves its work in `job`, which RunChosenJob runs.
struct Program
{
  CLI::App app;
  Console console;
  CommonOptions options;
  std::function<ExitCode()> job;
};

/// A subcommand.
struct Verb
{
  int place;            ///< in the first tour that help begins with, and in its list
  const char* example;  ///< of the tour
  const char* meaning;
  void (*add)(Program&);
};

/// The table of subcommands. What is linked into the program may add rows before main begins; it returns the table's size.
std::size_t AddVerb(const Verb& verb);

void AddInfo(Program& program);
void AddPhantom(Program& program);
void AddCheck(Program& program);
void AddPoses(Program& program);
void AddTrain(Program& program);
void AddSlice(Program& program);
void AddLabel(Program& program);
void AddVoxelize(Program& program);
void AddMetrics(Program& program);
void AddConvert(Program& program);

/// The whole program: understands the arguments and does what they ask for.
ExitCode Run(int argumentCount, char** arguments);

/// The options that every program and command has. The arguments are looked at for --json, so that a wrong command line is
/// reported in JSON too, however early parsing stops.
void AddCommonOptions(Program& program, int argumentCount, char** arguments);

/// Does what the arguments asked for, as the common options say.
ExitCode RunChosenJob(Program& program);

/// Says what went wrong, to people or to machines. Returns `code`.
ExitCode Fail(Console& console, ExitCode code, const std::string& message);

/// Runs `job`. Whatever it throws becomes an exit code and one message, on stderr and in JSON.
ExitCode RunJob(Console& console, const std::function<ExitCode()>& job);

/// Makes `work` the program's job where the arguments choose the subcommand `app`.
void RunWhenChosen(CLI::App* app, Program& program, std::function<ExitCode(Console&)> work);

/// An option's value must be a finite number from `low` to `high`, both included; whole for WholeNumberIn.
CLI::Validator NumberIn(double low, double high);
CLI::Validator WholeNumberIn(double low, double high);

/// The same for a value above zero, up to 1e6.
CLI::Validator PositiveNumber();

// Checks carry a name that says what the value is, for 3D Slicer to show (ModuleDescription): "double" or "integer" and the
// range, where there is one, those of numbers, "file" or "image" with channel and endings those below, which let every text pass.
constexpr const char* kWhole = "integer";
constexpr const char* kReal = "double";

/// A check that has the name and lets every text pass, for an option that is checked where its value is used.
CLI::Validator Named(const std::string& name);

/// The value names a file that is read or written, whose name ends in one of `endings`, such as ".vtp,.ply"; the first is
/// what 3D Slicer takes for files of its own.
CLI::Validator FileToRead(const std::string& endings);
CLI::Validator FileToWrite(const std::string& endings);
/// The same of volumes, which 3D Slicer has in its scene.
CLI::Validator VolumeToRead(const std::string& endings);
CLI::Validator VolumeToWrite(const std::string& endings);

constexpr const char* kFieldEndings = ".vtp,.ply";
constexpr const char* kFieldEndingsToRead = ".vtp,.pvtp,.ply";
constexpr const char* kSequenceEndings = ".mha,.nrrd,.mhd,.nhdr,.csv";
constexpr const char* kVolumeEndings = ".nrrd,.mha,.vti";

}  // namespace bigus::command
