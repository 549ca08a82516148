// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus bench: how fast and how exact this build is on this machine, beside what one would use otherwise.
#include "Command.h"
#include "Files.h"
#include "Testing/Benchmarks/Speed/SpeedReport.h"

namespace bigus::command
{

namespace
{

struct Options : bench::SpeedOptions
{
  std::string csv;
};

class ConsoleListener : public bench::Listener
{
public:
  explicit ConsoleListener(Console& console) : console_(console) {}
  void Print(const std::string& line) override { console_.Print(line); }
  void Note(const std::string& line) override { console_.Note(line); }
  void Progress(const std::string& job, double fraction) override { console_.Progress(job, fraction); }
  void EndProgress() override { console_.EndProgress(); }
  bool IsInterrupted() const override { return command::IsInterrupted(); }

private:
  Console& console_;
};

ExitCode Bench(Console& console, Options& options)
{
  options.frontier = !options.csv.empty();
  if (options.frontier)
  {
    RequireWritable(options.csv);
  }
  ConsoleListener listener(console);
  Json json;
  bench::SpeedReport report;
  try
  {
    report = bench::MeasureSpeed(options, listener, json);
  }
  catch (const bench::Interrupted&)
  {
    throw Interrupted();
  }
  if (options.frontier)
  {
    WriteAtomically(options.csv, [&report](std::ostream& file) { file << report.frontierCsv; });
  }
  console.Report(json);
  return Success;
}

}  // namespace

void AddBench(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app = program.app.add_subcommand(
      "bench",
      "Measure speed and error on this machine\n"
      "  bigus bench --quick                       everything, in about half a minute\n"
      "  bigus bench render train-pass --json      two workloads, for machines\n"
      "  bigus bench frontier --csv frontier.csv   speed against error\n"
      "machine: measured peaks. evaluation: the footprint kernel alone. render: slices of made-up fields\n"
      "beside a plain loop and vtkImageSlabReslice. train-pass: one pass of training, beside PyTorch where\n"
      "Python has it. frontier: time beside error for every tolerance. All threads means --threads. Close\n"
      "other programs before you compare.");
  app->add_option("WORKLOAD", options->workloads, "machine, evaluation, render, train-pass, frontier; default: all")
      ->check(CLI::IsMember({"machine", "evaluation", "render", "train-pass", "frontier"}).description(""))
      ->type_name("");
  app->add_flag("--quick", options->quick, "Fewer rounds, fields and frames");
  app->add_option("--repeats", options->repeats, "Rounds of which medians are taken; default: 9, or 3 if quick")
      ->check(NumberIn(1, 1000))
      ->type_name("N");
  app->add_option("--csv", options->csv, "Also write the frontier as a table")->type_name("FILE");
  app->add_option("--share", options->share,
                  "Share of all numbers of Gaussians, to try things out; ratios do not count then")
      ->check(NumberIn(0.001, 1))
      ->type_name("SHARE")
      ->capture_default_str();

  RunWhenChosen(app, program, [options](Console& console) { return Bench(console, *options); });
}

}  // namespace bigus::command
