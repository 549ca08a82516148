// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The options of every program and command, what a run is interrupted by, and how it ends.
#include <tbb/global_control.h>

#include <csignal>
#include <cstdint>
#include <cstring>
#include <memory>

#include "Command.h"
#include "Core/Engine/InstructionSets.h"
#include "Core/Model/PixelMemory.h"
#include "Pipeline.h"

namespace bigus::command
{

void AddCommonOptions(Program& program, int argumentCount, char** arguments)
{
  CommonOptions& options = program.options;
  CLI::App& app = program.app;
  for (int i = 1; i < argumentCount; ++i)
  {
    program.console.json = program.console.json || std::strcmp(arguments[i], "--json") == 0;
  }
  CatchVtkMessages(program.console);

  app.add_flag("--json", "Print one JSON object on stdout, nothing else");
  app.add_flag("--progress,!--no-progress", options.progress,
               "Draw the progress bar always, or never; else on a terminal");
  app.add_option("--threads", options.threads, "Threads to use; 0 takes all cores. Results do not depend on it")
      ->check(WholeNumberIn(0, 4096))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--simd", options.instructionSet,
                 "Use no better instructions than these; here: " + CLI::detail::join(InstructionSets(), ", ") +
                     ". A published field comes back bit for bit with the set it was trained with")
      ->type_name("NAME");
  app.add_option("--memory", options.memory,
                 "Keep no more than about so many GB resident: pixels of sweeps that fill half of it lie in files in "
                 "$TMPDIR, or else /var/tmp; 0 sets no limit. Results do not depend on it")
      ->check(NumberIn(0, 1e6))
      ->type_name("GB")
      ->capture_default_str();
}

ExitCode RunChosenJob(Program& program)
{
  const CommonOptions& options = program.options;
  Console& console = program.console;
  if (program.app.count("--progress") > 0)
  {
    console.bar = options.progress ? Console::Bar::Always : Console::Bar::Never;
  }
  try
  {
    if (!options.instructionSet.empty())
    {
      UseInstructionSet(options.instructionSet);
    }
    else
    {
      UseInstructionSetOfEnvironment();
    }
    if (program.app.count("--memory") > 0)
    {
      LimitPixelMemory(static_cast<std::uint64_t>(options.memory * 1e9));
    }
  }
  catch (const Error& error)
  {
    return Fail(console, UsageFault, error.what());
  }
  std::unique_ptr<tbb::global_control> limit;
  if (options.threads > 0)
  {
    limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, options.threads);
  }
  ListenToSignals();
  std::signal(SIGXFSZ, SIG_IGN);  // a file that grows too large fails to be written, with a message
  return RunJob(console, program.job);
}

}  // namespace bigus::command
