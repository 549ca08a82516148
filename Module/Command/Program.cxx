// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The program: its first tour, its subcommands, and what it says of a wrong command line.
#include <algorithm>
#include <cctype>
#include <iomanip>
#include <iostream>
#include <memory>
#include <sstream>
#include <utility>
#include <vector>

#include "Command.h"
#include "Help.h"
#include "ModuleDescription.h"

namespace bigus::command
{

namespace
{

std::vector<Verb>& Verbs()
{
  static std::vector<Verb> verbs = {
      {10, "bigus phantom -o sweep.igs.mha", "a made-up sweep with known truth", AddPhantom},
      {20, "bigus info sweep.igs.mha", "what is in it", AddInfo},
      {25, "bigus check sweep.igs.mha", "what is wrong with it", AddCheck},
      {30, "bigus poses sweep.igs.mha -o corrected.igs.mha", "without the tracker's noise, no training", AddPoses},
      {40, "bigus train sweep.igs.mha -o field.vtp --write-poses poses.csv", "frames to a Gaussian field", AddTrain},
      {60, "bigus slice field.vtp --poses poses.csv -o again.igs.mha", "the field at the sweep's planes", AddSlice},
      {70, "bigus metrics again.igs.mha sweep.igs.mha", "how alike they are", AddMetrics},
      {90, "bigus label sweep.igs.mha labels.seg.nrrd field.vtp -o labelled.vtp", "labels at any plane", AddLabel},
      {100, "bigus voxelize field.vtp -o volume.mha --spacing 0.5", "a plain volume", AddVoxelize},
      {110, "bigus convert field.vtp field.ply", "for point cloud viewers", AddConvert},
  };
  return verbs;
}

std::string Description(const std::vector<Verb>& verbs)
{
  std::ostringstream text;
  text << "Tracked B-mode ultrasound as signed 3-D Gaussians: train a field on a sweep, see it at any plane.\n"
          "\n"
          "A first tour, without any data:\n";
  for (const Verb& verb : verbs)
  {
    text << "  " << std::left << std::setw(62) << verb.example << "  " << verb.meaning << "\n";
  }
  text
      << "\n"
         "'bigus COMMAND --help' tells all about one command. Lengths are millimetres in the sweep's reference frame;\n"
         "intensities lie in [0, 1].";
  return text.str();
}

const char* const footer =
    "Exit codes: 0 done, 1 wrong usage, 2 bad input, 3 output cannot be written, 130 interrupted\n"
    "(129 by SIGHUP, 143 by SIGTERM; 128 plus its number by any other signal).\n"
    "With --json, stdout holds one JSON object (with an \"error\" when it failed); messages go to stderr.";

/// How many letters are to be changed, left out, put in or swapped with the next to make one word the other.
std::size_t Typos(const std::string& one, const std::string& other)
{
  std::vector<std::vector<std::size_t>> typos(one.size() + 1, std::vector<std::size_t>(other.size() + 1));
  for (std::size_t i = 0; i <= one.size(); ++i)
  {
    for (std::size_t j = 0; j <= other.size(); ++j)
    {
      if (i == 0 || j == 0)
      {
        typos[i][j] = i + j;
        continue;
      }
      const bool isSame = one[i - 1] == other[j - 1];
      typos[i][j] = std::min({typos[i - 1][j] + 1, typos[i][j - 1] + 1, typos[i - 1][j - 1] + (isSame ? 0 : 1)});
      if (i > 1 && j > 1 && one[i - 1] == other[j - 2] && one[i - 2] == other[j - 1])
      {
        typos[i][j] = std::min(typos[i][j], typos[i - 2][j - 2] + 1);
      }
    }
  }
  return typos.back().back();
}

/// The word that was meant by one with at most a typo for three letters; hyphens and case do not count. Else nothing.
std::string Meant(const std::string& given, const std::vector<std::string>& words)
{
  const auto letters = [](const std::string& text)
  {
    std::string plain;
    for (const unsigned char c : text.substr(0, text.find('=')))
    {
      plain += c == '-' || c == '_' ? "" : std::string(1, static_cast<char>(std::tolower(c)));
    }
    return plain;
  };
  std::string meant;
  std::size_t least = letters(given).size() / 3 + 1;
  for (const std::string& word : words)
  {
    const std::size_t typos = Typos(letters(given), letters(word));
    if (typos < least)
    {
      least = typos;
      meant = word;
    }
  }
  return meant;
}

std::string DidYouMean(const std::string& meant, const std::string& word)
{
  return meant.empty() ? "" : "\nDid you mean " + meant + " instead of " + word + "?";
}

/// The fault of a command line, and what may have been meant.
std::string WhatIsWrong(const CLI::App& app, const CLI::ParseError& error)
{
  const std::vector<std::string> unknown = app.remaining(true);
  if (app.get_subcommands().empty() && !unknown.empty())
  {
    std::vector<std::string> commands;
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    {
      commands.push_back(command->get_name());
    }
    return "There is no command or option '" + unknown.front() + "'." +
           DidYouMean(Meant(unknown.front(), commands), unknown.front());
  }
  std::string message = error.what();
  for (const CLI::App* command : app.get_subcommands())
  {
    std::vector<std::string> options;
    for (const CLI::Option* option : command->get_options())
    {
      for (const std::string& name : option->get_lnames())
      {
        options.push_back("--" + name);
      }
    }
    for (const std::string& word : unknown)
    {
      message += word.compare(0, 2, "--") == 0 ? DidYouMean(Meant(word, options), word) : "";
    }
  }
  return message;
}

/// The words of the command line in reverse, as CLI11 takes them: "help train" is "train --help".
std::vector<std::string> WordsOf(int argumentCount, char** arguments)
{
  std::vector<std::string> words(arguments + 1, arguments + argumentCount);
  if (!words.empty() && words.front() == "help")
  {
    words.erase(words.begin());
    words.push_back("--help");
  }
  std::reverse(words.begin(), words.end());
  return words;
}

}  // namespace

std::size_t AddVerb(const Verb& verb)
{
  Verbs().push_back(verb);
  return Verbs().size();
}

ExitCode Run(int argumentCount, char** arguments)
{
  Program program;
  CLI::App& app = program.app;
  Console& console = program.console;
  app.name("bigus");
  std::vector<Verb> verbs = Verbs();
  std::sort(verbs.begin(), verbs.end(), [](const Verb& a, const Verb& b) { return a.place < b.place; });
  app.description(Description(verbs));
  app.footer(footer);
  app.set_version_flag("--version", std::string("bigus ") + BIGUS_VERSION);
  app.require_subcommand(1);
  app.fallthrough();  // --json and the like are understood after the subcommand, too
  app.formatter(std::make_shared<HelpFormatter>());
  AddCommonOptions(program, argumentCount, arguments);

  for (const Verb& verb : verbs)
  {
    verb.add(program);
  }
  for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
  {
    command->footer(
        "Also: --json, --progress, --no-progress, --threads N, --simd NAME, --memory GB; 'bigus --help' explains them.");
  }

  AddCompletion(app);

  const std::string module = ModuleCommand(arguments[0]);
  if (module.empty() && argumentCount == 1)
  {
    std::cerr << app.help();
    return UsageFault;
  }
  try
  {
    if (module.empty())
    {
      app.parse(WordsOf(argumentCount, arguments));
    }
    else
    {
      console.bar = Console::Bar::Tags;
      const CLI::App& command = *app.get_subcommand(module);
      std::vector<std::string> words = ModuleArguments(command, argumentCount, arguments);
      if (std::find(words.begin(), words.end(), "--xml") != words.end())
      {
        console.Print(DescribeModule(app, command));
        return Success;
      }
      std::reverse(words.begin(), words.end());  // as CLI11 takes them
      app.parse(std::move(words));
    }
  }
  catch (const CLI::Success& request)  // --help, --version
  {
    app.exit(request);
    return Success;
  }
  catch (const CLI::ParseError& error)
  {
    const std::vector<CLI::App*> chosen = app.get_subcommands();
    const std::string help = chosen.empty() ? "bigus" : "bigus " + chosen.front()->get_name();
    return Fail(console, UsageFault, WhatIsWrong(app, error) + "\nRun '" + help + " --help'.");
  }
  return RunChosenJob(program);
}

}  // namespace bigus::command
