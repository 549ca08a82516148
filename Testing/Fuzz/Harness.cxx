// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Fuzz/Harness.h"

#include <tbb/global_control.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>

#include "Command.h"
#include "Fuzz/Structured.h"
#include "Pipeline.h"
#include "vtkBigusSequenceReader.h"

namespace bigus::fuzz
{
namespace
{

constexpr std::size_t kLongestMessage = 16384;  // characters; names from a file are shortened, lists are cut

/// A folder that goes away with the process, save when that is killed.
class Folder
{
public:
  Folder()
  {
    const char* memory = "/dev/shm";
    const std::filesystem::path root =
        access(memory, W_OK) == 0 ? std::filesystem::path(memory) : std::filesystem::temp_directory_path();
    path = root / ("bigus-fuzz-" + std::to_string(getpid()));
    std::filesystem::create_directories(path);
  }
  ~Folder()
  {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  std::filesystem::path path;
};

/// Takes what is written to a stream.
class Caught
{
public:
  explicit Caught(std::ostream& stream) : stream_(stream), before_(stream.rdbuf(text_.rdbuf())) {}
  ~Caught() { stream_.rdbuf(before_); }
  std::string Text() const { return text_.str(); }

private:
  std::ostringstream text_;
  std::ostream& stream_;
  std::streambuf* before_;
};

}  // namespace

void Finding(const std::string& what)
{
  std::fprintf(stderr, "FINDING: %s\n", what.c_str());
  std::abort();
}

std::string PathOf(const std::string& name)
{
  static const Folder folder;
  return (folder.path / name).string();
}

std::string Write(const std::string& name, const std::string& bytes)
{
  const std::string path = PathOf(name);
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

Said RunAsProgram(const std::function<command::ExitCode(command::Console&)>& job)
{
  static command::Console console;
  console.json = true;
  console.bar = command::Console::Bar::Never;
  command::CatchVtkMessages(console);
  command::ExitCode code;
  std::string out, messages;
  {
    const Caught answers(std::cout), notes(std::cerr);
    code = command::RunJob(console, [&job] { return job(console); });
    out = answers.Text();
    messages = notes.Text();
  }
  if (code != command::Success && code != command::InputFault)
  {
    Finding("exit code " + std::to_string(code) + ": " + messages);
  }
  if (code == command::InputFault && (messages.empty() || messages.size() > kLongestMessage))
  {
    Finding("a message of " + std::to_string(messages.size()) + " characters: " + messages.substr(0, 1000));
  }
  // At the start only: fuzzing learns these words and writes them into files, which messages quote.
  for (const char* surprise : {"bigus: Failed for a reason that was not foreseen", "bigus: Not enough memory",
                               "bigus: The job failed without saying why"})
  {
    if (messages.rfind(surprise, 0) == 0)
    {
      Finding(messages);
    }
  }
  if (!out.empty() && !command::Json::accept(out))
  {
    Finding("not JSON: " + out);
  }
  return {out, code == command::InputFault ? messages : std::string()};
}

Said RunInfo(const std::string& path, const std::vector<std::string>& arguments)
{
  // Understanding the arguments takes longer than most files, so each list of them is understood once.
  static std::map<std::vector<std::string>, std::function<command::ExitCode()>> jobs;
  std::vector<std::string> words = arguments;
  words.push_back(path);
  auto& job = jobs[words];
  if (!job)
  {
    static std::vector<std::unique_ptr<command::Program>> programs;
    programs.push_back(std::make_unique<command::Program>());
    command::Program& program = *programs.back();
    program.console.json = true;
    program.console.bar = command::Console::Bar::Never;
    command::AddInfo(program);
    std::vector<std::string> reversed(words.rbegin(), words.rend());  // as CLI11 takes them
    reversed.push_back("info");
    program.app.parse(reversed);
    job = program.job;
  }
  return RunAsProgram([&job](command::Console&) { return job(); });
}

Said ReadAsSequence(const std::string& path, const std::string& config)
{
  const Said info = config.empty() ? RunInfo(path) : RunInfo(path, {"--config", config});
  if (info.answer.empty())
  {
    return info;
  }
  command::SequenceOptions options;
  options.path = path;
  options.chain.config = config;
  options.chain.assumeStatus = true;
  const bool hasPoses = info.refusal.empty() && info.answer.find("\"kind\": \"sequence\"") != std::string::npos;
  RunAsProgram(
      [&options, hasPoses](command::Console& console)
      {
        if (hasPoses)
        {
          Inspect(command::ReadSweep(options, console));
          return command::Success;
        }
        const auto reader = command::NewSequenceReader(options);
        reader->RequirePosesOff();
        command::Update(reader, console, "Reading");
        return command::Success;
      });
  return info;
}

void ReadAsPlanes(const command::PlaneOptions& options)
{
  RunAsProgram(
      [&options](command::Console& console)
      {
        if (const std::string wrong = WrongSlices(command::ReadPlanes(options, console).planes); !wrong.empty())
        {
          Finding(wrong);
        }
        return command::Success;
      });
}

}  // namespace bigus::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size)
{
  // Work for two threads is so small here that waking the other one takes longer than all of it.
  static const tbb::global_control oneThread(tbb::global_control::max_allowed_parallelism, 1);
  bigus::fuzz::TryInput(std::string(reinterpret_cast<const char*>(bytes), size));
  return 0;
}

/// What the environment variable ASAN_OPTIONS does not say. Half of the time of an execution went into the stack kept with
/// every allocation and into fresh pages, because freed ones were kept back until they filled 256 MB. VTK keeps singletons
/// for the life of a process, so leaks are not looked for.
extern "C" const char* __asan_default_options()
{
  return "detect_leaks=0:allocator_may_return_null=0:malloc_context_size=1:quarantine_size_mb=8";
}
