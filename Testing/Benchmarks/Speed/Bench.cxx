// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus-bench: how fast and how exact this build is on this machine, beside what one would use otherwise. Its options and
// exit codes are those of bigus.
#include "Command.h"
#include "Files.h"
#include "SpeedReport.h"

namespace
{

using namespace bigus::command;

struct Options : bigus::bench::SpeedOptions
{
  std::string csv;
};

ExitCode Bench(Console& console, Options& options)
{
  options.frontier = !options.csv.empty();
  if (options.frontier)
  {
    RequireWritable(options.csv);
  }
  Json json;
  const bigus::bench::SpeedReport report = bigus::bench::MeasureSpeed(options, console, json);
  if (options.frontier)
  {
    WriteAtomically(options.csv, [&report](std::ostream& file) { file << report.frontierCsv; });
  }
  console.Report(json);
  return Success;
}

void AddOptions(CLI::App& app, Options& options)
{
  app.add_option("WORKLOAD", options.workloads, "machine, evaluation, render, train-pass, frontier; default: all")
      ->check(CLI::IsMember({"machine", "evaluation", "render", "train-pass", "frontier"}).description(""))
      ->type_name("");
  app.add_flag("--quick", options.quick, "Fewer rounds, fields and frames");
  app.add_option("--repeats", options.repeats, "Rounds of which medians are taken; default: 9, or 3 if quick")
      ->check(NumberIn(1, 1000))
      ->type_name("N");
  app.add_option("--csv", options.csv, "Also write the frontier as a table")->type_name("FILE");
  app.add_option("--share", options.share,
                 "Share of all numbers of Gaussians, to try things out; ratios do not count then")
      ->check(NumberIn(0.001, 1))
      ->type_name("SHARE")
      ->capture_default_str();
}

}  // namespace

int main(int argumentCount, char** arguments)
{
  Program program;
  Options options;
  program.app.name("bigus-bench");
  program.app.description(
      "Measure speed and error on this machine\n"
      "  bigus-bench --quick                       everything, in about half a minute\n"
      "  bigus-bench render train-pass --json      two workloads, for machines\n"
      "  bigus-bench frontier --csv frontier.csv   speed against error\n"
      "machine: measured peaks. evaluation: the footprint kernel alone. render: slices of made-up fields\n"
      "beside a plain loop and vtkImageSlabReslice. train-pass: one pass of training, beside PyTorch where\n"
      "Python has it. frontier: time beside error for every tolerance. All threads means --threads. Close\n"
      "other programs before you compare.");
  AddOptions(program.app, options);
  AddCommonOptions(program, argumentCount, arguments);
  program.job = [&] { return Bench(program.console, options); };
  try
  {
    program.app.parse(argumentCount, arguments);
  }
  catch (const CLI::Success& request)  // --help
  {
    return program.app.exit(request);
  }
  catch (const CLI::ParseError& error)
  {
    return Fail(program.console, UsageFault, std::string(error.what()) + "\nRun 'bigus-bench --help'.");
  }
  return RunChosenJob(program);
}
