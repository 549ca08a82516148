// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus serve: a field in the browser. The page is served by the Python package (bigus.serve), which takes over this process.
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>

#include "Command.h"
#include "Exit.h"
#include "Files.h"
#include "Inputs.h"

namespace bigus::command
{

namespace
{

struct Options
{
  std::string field, sequence, host = "127.0.0.1";
  int port = 8765;
  std::vector<std::string> names;
  bool token = false;
};

/// How the address of a field that grows begins.
constexpr const char* kOfServer = "igtl://";

/// Python puts neither the working directory nor folders of the environment on its path, so that nobody's json.py runs.
constexpr const char* kIsolated = "-I";

/// The first argument holds folders that are looked at last, so that the package of a virtual environment wins.
constexpr const char* kStart =
    "import sys; sys.path.extend(folder for folder in sys.argv.pop(1).split(':') if folder); "
    "from bigus.serve import main; sys.exit(main())";

/// The folders beside this program that hold the Python package, in a build tree and where it is installed; with ":" between.
std::string PackageFolders()
{
  std::error_code failure;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", failure);
  const std::filesystem::path prefix = program.parent_path().parent_path();
  std::string folders;
  for (const char* folder : {"python", BIGUS_PYTHON_FOLDER})
  {
    const std::filesystem::path candidate = prefix / folder;
    if (!failure && *folder && std::filesystem::is_directory(candidate / "bigus", failure))
    {
      folders += (folders.empty() ? "" : ":") + candidate.string();
    }
    failure.clear();
  }
  return folders;
}

/// Does not return where Python can be started.
ExitCode Serve(Console& console, const Options& options, int threads)
{
  if (options.field.compare(0, std::strlen(kOfServer), kOfServer) != 0)  // the package understands the rest of it
  {
    RequireFile(options.field);
  }
  if (!options.sequence.empty())
  {
    RequireFile(options.sequence);
  }
  const char* chosen = std::getenv("BIGUS_PYTHON");
  const std::string python = chosen && *chosen ? chosen : BIGUS_PYTHON_PROGRAM;
  std::vector<std::string> words = {python, kIsolated, "-c", kStart, PackageFolders()};
  for (const std::string& name : options.names)
  {
    words.insert(words.end(), {"--name", name});
  }
  words.insert(words.end(),
               {"--host", options.host, "--port", std::to_string(options.port), "--threads", std::to_string(threads)});
  if (options.token)
  {
    words.push_back("--token");
  }
  if (console.json)
  {
    words.push_back("--json");
  }
  words.push_back("--");  // a file's name may begin with a hyphen
  words.push_back(options.field);
  if (!options.sequence.empty())
  {
    words.push_back(options.sequence);
  }
  std::vector<char*> arguments;
  for (std::string& word : words)
  {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  execvp(python.c_str(), arguments.data());
  throw Error("'" + python + "' cannot be started (" + std::strerror(errno) +
              "). The page is served by the Python package; BIGUS_PYTHON names a Python that has it, and aiohttp.");
}

void AddServe(Program& program)
{
  auto options = std::make_shared<Options>();
  CLI::App* app = program.app.add_subcommand(
      "serve",
      "See a field in the browser, slice by slice, with its sweep beside it\n"
      "  bigus serve field.vtp sweep.igs.mha\n"
      "  bigus serve igtl://localhost:18945                    a field that grows: bigus live ... --listen 18945\n"
      "Prints the address of a page where a plane is moved. Only this machine reaches it, unless --host says otherwise;\n"
      "then the address holds a token. Ctrl-C ends it. With --json, stdout holds a line of JSON for each phase: reading,\n"
      "ready with the url, ending. It needs Python with aiohttp: BIGUS_PYTHON names it, such as env/bin/python.");
  app->add_option("FIELD", options->field,
                  "Field: .vtp, .pvtp or .ply, or igtl://HOST:PORT of a running live --listen PORT")
      ->required()
      ->type_name("");
  app->add_option("SEQUENCE", options->sequence, "The sweep that it was trained on")->type_name("");
  app->add_option("--host", options->host, "Address to listen at; default: 127.0.0.1, this machine only")
      ->type_name("ADDRESS");
  app->add_option("--port", options->port, "Port to listen at; 0: any that is free")
      ->check(WholeNumberIn(0, 65535))
      ->type_name("N")
      ->capture_default_str();
  app->add_option("--name", options->names, "A name, beside addresses, by which browsers know this machine; repeatable")
      ->allow_extra_args(false)
      ->type_name("NAME");
  app->add_flag("--token", options->token, "Ask for a token on this machine, too");
  const CLI::Option* threads = program.app.get_option("--threads");
  RunWhenChosen(app, program,
                [options, threads](Console& console) { return Serve(console, *options, threads->as<int>()); });
}

[[maybe_unused]] const std::size_t row =
    AddVerb({90, "bigus serve field.vtp sweep.igs.mha", "both in the browser", AddServe});

}  // namespace

}  // namespace bigus::command
