// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the options of the program are, as text for people and for shells: help as wide as the terminal, completion, a man page.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace bigus::command
{

/// CLI11's help in lines of the terminal's width (of COLUMNS where that is set, else 80 columns, 40 at least). Examples stay in
/// one line, so that they can be copied; of subcommands the list holds the first line.
class HelpFormatter : public CLI::Formatter
{
public:
  HelpFormatter();
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
  std::string make_option_name(const CLI::Option* option, bool isPositional) const override;
  std::string make_subcommand(const CLI::App* app) const override;
  std::string make_option(const CLI::Option* option, bool isPositional) const override;
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_desc(const CLI::Option* option) const override;
  std::string make_description(const CLI::App* app) const override;
  std::string make_footer(const CLI::App* app) const override;

private:
  std::size_t width_;
};

/// Adds `bigus completion bash|zsh|man`, which prints what a shell needs to complete commands and options, or the man page in
/// roff. The list of commands in help does not have it.
void AddCompletion(CLI::App& app);

}  // namespace bigus::command
