// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Help.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <sstream>
#include <vector>

namespace bigus::command
{

namespace
{

constexpr std::size_t kLeastWidth = 40, kUsualWidth = 80, kColumn = 30;  // columns; where meanings begin

std::size_t Width()
{
  const char* const columns = std::getenv("COLUMNS");
  winsize size{};
  std::size_t width = columns ? std::strtoul(columns, nullptr, 10) : 0;
  if (width == 0)
  {
    width = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 ? size.ws_col : kUsualWidth;
  }
  return std::max(width, kLeastWidth);
}

/// The text in lines of at most `width` columns, words longer than that excepted; all but the first begin with `indent` blanks.
std::string Wrapped(const std::string& text, std::size_t width, std::size_t indent)
{
  std::istringstream words(text);
  std::string word, wrapped;
  std::size_t column = indent;
  while (words >> word)
  {
    if (!wrapped.empty())
    {
      const bool isFull = column + 1 + word.size() > width;
      wrapped += isFull ? "\n" + std::string(indent, ' ') : " ";
      column = isFull ? indent : column + 1;
    }
    wrapped += word;
    column += word.size();
  }
  return wrapped;
}

/// Lines of their own, each wrapped but for those that begin with a blank: examples.
std::string WrappedLines(const std::string& text, std::size_t width)
{
  std::istringstream lines(text);
  std::string line, wrapped;
  while (std::getline(lines, line))
  {
    wrapped += (line.rfind(' ', 0) == 0 ? line : Wrapped(line, width, 0)) + "\n";
  }
  return wrapped;
}

template <class Options>
std::string Names(const Options& options)
{
  std::string names;
  for (const CLI::Option* option : options)
  {
    names += (names.empty() ? "" : ", ") + option->get_name();
  }
  return names;
}

std::vector<const CLI::App*> Commands(const CLI::App& app)
{
  return app.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

std::string FirstLine(const CLI::App& command)
{
  const std::string whole = command.get_description();
  return whole.substr(0, whole.find('\n'));
}

/// Options with names, those of the whole program at the end.
std::vector<const CLI::Option*> NamedOptions(const CLI::App& command)
{
  const auto isNamed = [](const CLI::Option* option)
  { return option->nonpositional() && !option->get_group().empty(); };
  std::vector<const CLI::Option*> options = command.get_options(isNamed);
  if (command.get_parent())
  {
    for (const CLI::Option* option : command.get_parent()->get_options(isNamed))
    {
      options.push_back(option);
    }
  }
  return options;
}

std::vector<std::string> Spellings(const CLI::Option& option)
{
  std::vector<std::string> spellings;
  for (const std::string& name : option.get_lnames())
  {
    spellings.push_back("--" + name);
  }
  return spellings;
}

/// The words that an option's value is one of, "" where it is anything else: names in small letters with bars between.
std::string Choices(const CLI::Option& option)
{
  std::string type = option.get_type_name();
  const bool isChoice = type.find('|') != std::string::npos &&
                        type.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789-|") == std::string::npos;
  std::replace(type.begin(), type.end(), '|', ' ');
  return isChoice ? type : "";
}

std::string BashCompletion(const CLI::App& app)
{
  std::ostringstream text;
  std::string commands = "help";
  for (const CLI::App* command : Commands(app))
  {
    commands += " " + command->get_name();
  }
  text << "_bigus() {\n"
          "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} words=\n"
          "  if ((COMP_CWORD == 1)) || [[ ${COMP_WORDS[1]} == help ]]; then\n"
          "    COMPREPLY=($(compgen -W '"
       << commands << "' -- \"$word\"))\n    return\n  fi\n  case \"${COMP_WORDS[1]} $before\" in\n";
  for (const CLI::App* command : Commands(app))
  {
    for (const CLI::Option* option : NamedOptions(*command))
    {
      for (const std::string& name : Choices(*option).empty() ? std::vector<std::string>() : Spellings(*option))
      {
        text << "    '" << command->get_name() << " " << name << "') words='" << Choices(*option) << "' ;;\n";
      }
    }
  }
  text << "  esac\n  if [[ -z $words && $word == -* ]]; then\n    case ${COMP_WORDS[1]} in\n";
  for (const CLI::App* command : Commands(app))
  {
    text << "      " << command->get_name() << ") words='";
    for (const CLI::Option* option : NamedOptions(*command))
    {
      for (const std::string& name : Spellings(*option))
      {
        text << name << " ";
      }
    }
    text << "' ;;\n";
  }
  text << "    esac\n  fi\n"
          "  [[ -z $words ]] || COMPREPLY=($(compgen -W \"$words\" -- \"$word\"))  # else file names\n"
          "}\ncomplete -o default -F _bigus bigus\n";
  return text.str();
}

/// In single quotes within square brackets, as zsh's _arguments has meanings.
std::string ForZsh(const std::string& text)
{
  std::string quoted;
  for (const char c : text)
  {
    quoted += c == '\''                                       ? "'\\''"
              : c == '[' || c == ']' || c == ':' || c == '\\' ? std::string("\\") + c
                                                              : std::string(1, c);
  }
  return quoted;
}

std::string ZshCompletion(const CLI::App& app)
{
  std::ostringstream text;
  text << "#compdef bigus\n_bigus() {\n  local -a commands\n  commands=(\n";
  for (const CLI::App* command : Commands(app))
  {
    text << "    '" << command->get_name() << ":" << ForZsh(FirstLine(*command)) << "'\n";
  }
  text
      << "  )\n  if ((CURRENT == 2)) || [[ $words[2] == help ]]; then\n    _describe command commands\n    return\n  fi\n"
         "  case $words[2] in\n";
  for (const CLI::App* command : Commands(app))
  {
    text << "    " << command->get_name() << ") _arguments";
    for (const CLI::Option* option : NamedOptions(*command))
    {
      const std::string choices = Choices(*option);
      const bool hasValue = option->get_type_size() != 0;
      for (const std::string& name : Spellings(*option))
      {
        text << " \\\n      '" << name << "[" << ForZsh(option->get_description()) << "]"
             << (hasValue
                     ? ":" + ForZsh(option->get_type_name()) + ":" + (choices.empty() ? "_files" : "(" + choices + ")")
                     : "")
             << "'";
      }
    }
    text << " \\\n      '*:file:_files' ;;\n";
  }
  text << "  esac\n}\ncompdef _bigus bigus\n";
  return text.str();
}

/// A line of text in roff: no character is a command, and hyphens are those of options.
std::string ForRoff(const std::string& text)
{
  std::string escaped = text.rfind('.', 0) == 0 || text.rfind('\'', 0) == 0 ? "\\&" : "";
  for (const char c : text)
  {
    escaped += c == '\\' ? "\\e" : c == '-' ? "\\-" : std::string(1, c);
  }
  return escaped;
}

void WriteRoff(std::ostream& text, const CLI::App& app, const HelpFormatter& help)
{
  std::istringstream lines(app.get_description());
  for (std::string line; std::getline(lines, line);)
  {
    text << (line.rfind(' ', 0) == 0 ? ".PP\n.nf\n" : "") << ForRoff(line) << "\n"
         << (line.rfind(' ', 0) == 0 ? ".fi\n" : "");
  }
  for (const CLI::Option* option : app.get_options([](const CLI::Option* any) { return !any->get_group().empty(); }))
  {
    const bool isPositional = !option->nonpositional();
    text << ".TP\n.B " << ForRoff(help.make_option_name(option, isPositional) + help.make_option_opts(option)) << "\n"
         << ForRoff(help.make_option_desc(option)) << "\n";
  }
}

std::string ManPage(const CLI::App& app)
{
  std::ostringstream text;
  text
      << ".TH BIGUS 1\n.SH NAME\nbigus \\- tracked ultrasound sweeps to fields of Gaussians, and slices of them at any plane\n"
         ".SH SYNOPSIS\n.B bigus\nCOMMAND [OPTIONS] ...\n.SH DESCRIPTION\n";
  const HelpFormatter help;
  WriteRoff(text, app, help);
  for (const CLI::App* command : Commands(app))
  {
    text << ".SH bigus " << ForRoff(command->get_name()) << "\n";
    WriteRoff(text, *command, help);
  }
  text << ".SH EXIT STATUS\n";
  std::istringstream footer(app.get_footer());
  for (std::string line; std::getline(footer, line);)
  {
    text << ForRoff(line) << "\n";
  }
  return text.str();
}

}  // namespace

HelpFormatter::HelpFormatter() : width_(Width())
{
  column_width(kColumn);
}

std::string HelpFormatter::make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const
{
  return CLI::detail::find_and_replace(Formatter::make_help(app, std::move(name), mode), "\n\n\n", "\n\n");
}

/// Without the mark of flags that say no.
std::string HelpFormatter::make_option_name(const CLI::Option* option, bool isPositional) const
{
  return CLI::detail::find_and_replace(Formatter::make_option_name(option, isPositional), "{false}", "");
}

std::string HelpFormatter::make_subcommand(const CLI::App* app) const
{
  std::string name = "  " + app->get_name();
  name.resize(std::max(kColumn, name.size() + 1), ' ');
  return name + Wrapped(FirstLine(*app), width_, name.size()) + "\n";
}

std::string HelpFormatter::make_option(const CLI::Option* option, bool isPositional) const
{
  std::string name = "  " + make_option_name(option, isPositional) + make_option_opts(option);
  if (name.size() + 1 < kColumn)
  {
    name.resize(kColumn, ' ');
  }
  else
  {
    name += "\n" + std::string(kColumn, ' ');
  }
  return name + Wrapped(make_option_desc(option), width_, kColumn) + "\n";
}

/// Its value and default; what it goes with is a sentence of the meaning.
std::string HelpFormatter::make_option_opts(const CLI::Option* option) const
{
  if (option->get_type_size() == 0)
  {
    return "";
  }
  const std::string& value = option->get_default_str();
  return (option->get_type_name().empty() ? "" : " " + option->get_type_name()) + (value.empty() ? "" : "=" + value) +
         (option->get_expected_max() == CLI::detail::expected_max_vector_size ? " ..." : "") +
         (option->get_required() ? " REQUIRED" : "");
}

std::string HelpFormatter::make_option_desc(const CLI::Option* option) const
{
  const std::string with = Names(option->get_needs()), without = Names(option->get_excludes());
  return option->get_description() + (with.empty() ? "" : "; with " + with) +
         (without.empty() ? "" : "; not with " + without);
}

std::string HelpFormatter::make_description(const CLI::App* app) const
{
  return WrappedLines(app->get_description(), width_);
}

std::string HelpFormatter::make_footer(const CLI::App* app) const
{
  return WrappedLines(app->get_footer(), width_);
}

void AddCompletion(CLI::App& app)
{
  CLI::App* const completion =
      app.add_subcommand("completion", "What a shell needs to complete commands and options, or the man page");
  completion->group("");
  const auto shell = std::make_shared<std::string>();
  completion->add_option("SHELL", *shell, "bash, zsh or man")->required()->check(CLI::IsMember({"bash", "zsh", "man"}));
  completion->callback(
      [&app, shell]
      {
        std::cout << (*shell == "bash" ? BashCompletion(app) : *shell == "zsh" ? ZshCompletion(app) : ManPage(app));
        throw CLI::Success();
      });
}

}  // namespace bigus::command
