// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// https://github.com/commontk/CTK/blob/master/Libs/CommandLineModules/Core/Resources/ctkCmdLineModule.xsd is the schema.
#include "ModuleDescription.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <sstream>

#include "Command.h"

namespace bigus::command
{

namespace
{

// What each name stands for. Slicer finds programs by their files' names.
constexpr std::array<std::pair<const char*, const char*>, 5> kModules{{{"BigusTrain", "train"},
                                                                       {"BigusSlice", "slice"},
                                                                       {"BigusVoxelize", "voxelize"},
                                                                       {"BigusLabel", "label"},
                                                                       {"BigusPoses", "poses"}}};

constexpr const char* kMainGroup = "Options";    // CLI11's name for options without a group
constexpr const char* kShorthand = "Short for";  // begins the help of flags that repeat another option
constexpr const char* kMachineGroup = "Computing";
constexpr const char* kOfScene =
    "_transform";                        // ends the name of an option's second form, whose file Slicer writes itself
constexpr double kLongestSlider = 1000;  // the largest number that Slicer shows as a slider, by giving its range
// Options of the program that a module has, too; the others say how messages look.
constexpr std::array<const char*, 3> kProgramOptions{"threads", "simd", "memory"};

std::string Element(const std::string& name, const std::string& text)
{
  return "<" + name + ">" + XmlEscaped(text) + "</" + name + ">\n";
}

/// "hold-out" to "hold_out".
std::string Identifier(std::string name)
{
  std::replace(name.begin(), name.end(), '-', '_');
  return CLI::detail::to_lower(name);
}

/// "hold-out" to "Hold out".
std::string Label(std::string name)
{
  name = CLI::detail::to_lower(name);
  std::replace(name.begin(), name.end(), '-', ' ');
  name[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(name[0])));
  return name;
}

/// The unit that the name of a value is, " (mm)"; nothing where it is none.
std::string UnitOf(const std::string& type)
{
  constexpr std::array<std::pair<const char*, const char*>, 4> kUnits{
      {{"MM", " (mm)"}, {"MM MM", " (mm)"}, {"S", " (s)"}, {"GB", " (GB)"}}};
  const auto found = std::find_if(kUnits.begin(), kUnits.end(), [&](const auto& unit) { return type == unit.first; });
  return found == kUnits.end() ? "" : found->second;
}

/// "on|off" to on and off; empty for anything but names with bars between.
std::vector<std::string> Names(const std::string& type)
{
  const bool plain = std::all_of(type.begin(), type.end(),
                                 [](unsigned char c) { return std::islower(c) || std::isdigit(c) || c == '|'; });
  return plain && type.find('|') != std::string::npos ? CLI::detail::split(type, '|') : std::vector<std::string>();
}

/// What the option's checks say of its value (see OptionKind): its words, empty where none says anything.
std::vector<std::string> KindOf(const CLI::Option& option)
{
  auto& checks = const_cast<CLI::Option&>(option);  // CLI11 gives its checks only for changing
  for (int k = 0;; ++k)
  {
    try
    {
      if (const std::string& name = checks.get_validator(k)->get_name(); !name.empty())
      {
        return CLI::detail::split(name, ' ');
      }
    }
    catch (const CLI::OptionNotFound&)
    {
      return {};
    }
  }
}

/// Whether the option is the list of files at the end of the command line. In the XML it has a flag, because Slicer refuses to
/// run while what has none is empty.
bool IsList(const CLI::Option& option)
{
  return option.get_positional() && option.get_expected_max() > 1;
}

/// The files of one value, with commas between. A name that holds commas stands in double quotes.
std::vector<std::string> SplitFiles(const std::string& value)
{
  std::vector<std::string> files(1);
  bool isQuoted = false;
  for (const char c : value)
  {
    if (c == '"')
    {
      isQuoted = !isQuoted;
    }
    else if (c == ',' && !isQuoted)
    {
      files.emplace_back();
    }
    else
    {
      files.back() += c;
    }
  }
  files.erase(std::remove(files.begin(), files.end(), ""), files.end());
  return files;
}

/// One option, or nothing where Slicer shall not show it.
std::string Describe(const CLI::Option& option, int& positionals)
{
  const std::string& help = option.get_description();
  const bool isPositional = option.get_positional();
  if (help.rfind(kShorthand, 0) == 0 || (!isPositional && option.get_lnames().empty()))
  {
    return {};
  }
  const std::string name = isPositional ? option.get_name(true) : option.get_lnames().front();
  const bool isList = IsList(option);
  const std::vector<std::string> kind = KindOf(option);
  const std::vector<std::string> names = Names(option.get_type_name());
  const bool isNumber = !kind.empty() && (kind[0] == kWhole || kind[0] == kReal);
  const bool isFile = kind.size() == 3 && !isNumber;
  // A number that may be left out is text, because Slicer gives no number that is none.
  const std::string value = option.get_default_str();
  double number = 0;
  const bool hasNumber = CLI::detail::lexical_cast(value, number);

  std::string tag = "string", attributes;
  if (option.get_expected_max() == 0)
  {
    tag = "boolean";
  }
  else if (isFile)
  {
    tag = kind[0];
    attributes = std::string(isList ? " multiple=\"true\"" : "") + " fileExtensions=\"" + kind[2] + "\"" +
                 (tag == "image" ? " type=\"scalar\"" : "");
  }
  else if (option.get_expected_max() > 1 && !kind.empty())  // a list of words is text
  {
    tag = kind.at(0) + "-vector";
  }
  else if (!names.empty())
  {
    tag = "string-enumeration";
  }
  else if (isNumber && hasNumber)
  {
    tag = kind[0];
  }

  std::string text = "<" + tag + attributes + ">\n" + Element("name", Identifier(name));
  text += isPositional && !isList ? Element("index", std::to_string(positionals++))
                                  : Element("longflag", "--" + Identifier(name));
  text += Element("description", help) + Element("label", Label(name) + UnitOf(option.get_type_name()));
  if (tag == "boolean")
  {
    text += Element("default", "false");
  }
  else if (!value.empty() && tag != "integer-vector" && tag != "double-vector")
  {
    text += Element("default", value);
  }
  if (isFile)
  {
    text += Element("channel", kind[1]);
  }
  for (const std::string& element : names)
  {
    text += Element("element", element);
  }
  if ((tag == kWhole || tag == kReal) && kind.size() == 3 && std::stod(kind[2]) <= kLongestSlider)
  {
    text += "<constraints>\n" + Element("minimum", kind[1]) + Element("maximum", kind[2]) + "</constraints>\n";
  }
  text += "</" + tag + ">\n";
  // What a file of a linear transform says, a transform of the scene says, too.
  if (isFile && kind[2].find(".tfm") != std::string::npos)
  {
    text += "<transform fileExtensions=\".tfm,.h5\">\n" + Element("name", Identifier(name) + kOfScene) +
            Element("longflag", "--" + Identifier(name) + kOfScene) + Element("description", help) +
            Element("label", Label(name) + ", a transform of the scene") + Element("channel", kind[1]) +
            "</transform>\n";
  }
  return text;
}

}  // namespace

std::string ModuleCommand(const std::string& program)
{
  const std::string name = std::filesystem::path(program).filename().string();
  for (const auto& [module, command] : kModules)
  {
    if (name == module)
    {
      return command;
    }
  }
  return {};
}

std::string DescribeModule(const CLI::App& program, const CLI::App& command)
{
  struct Group
  {
    std::string name, options;
  };
  std::vector<Group> groups = {{kMainGroup, ""}};  // in the order of the help; what must be given is in the first
  int positionals = 0;
  const auto add = [&](const CLI::Option& option, const std::string& usual)
  {
    const std::string name = option.get_positional() || option.get_required() ? kMainGroup : usual;
    auto found = std::find_if(groups.begin(), groups.end(), [&](const Group& group) { return group.name == name; });
    if (found == groups.end())
    {
      found = groups.insert(groups.end(), {name, ""});
    }
    found->options += Describe(option, positionals);
  };
  std::vector<const CLI::Option*> options = command.get_options();
  std::stable_partition(options.begin(), options.end(), [](const CLI::Option* one) { return one->get_required(); });
  std::stable_partition(options.begin(), options.end(), [](const CLI::Option* one) { return one->get_positional(); });
  for (const CLI::Option* option : options)
  {
    if (option != command.get_help_ptr())
    {
      add(*option, option->get_lnames() == std::vector<std::string>{"engine"} ? kMachineGroup : option->get_group());
    }
  }
  for (const char* name : kProgramOptions)
  {
    add(*program.get_option(std::string("--") + name), kMachineGroup);
  }

  std::string description;
  std::istringstream lines(command.get_description());
  for (std::string line; std::getline(lines, line);)
  {
    description += line.rfind("  bigus", 0) == 0 ? "" : line + "\n";  // examples for the shell
  }
  std::string xml = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<executable>\n" +
                    Element("category", "Ultrasound.BIGUS") + Element("title", "BIGUS " + Label(command.get_name())) +
                    Element("description", description) + Element("version", BIGUS_VERSION) +
                    Element("license", "BSD-3-Clause") + Element("contributor", "BIGUS authors");
  for (const Group& group : groups)
  {
    const std::string label = group.name == kMainGroup ? "What is done" : group.name;
    xml += group.options.empty()
               ? ""
               : "<parameters" + std::string(group.name == kMainGroup ? "" : " advanced=\"true\"") + ">\n" +
                     Element("label", label) + Element("description", label) + group.options + "</parameters>\n";
  }
  return xml + "</executable>\n";
}

std::vector<std::string> ModuleArguments(const CLI::App& command, int argumentCount, char** arguments)
{
  std::string list;  // the flag of the list of files
  for (const CLI::Option* option : command.get_options())
  {
    list = IsList(*option) ? "--" + Identifier(option->get_name(true)) : list;
  }
  std::vector<std::string> rewritten = {command.get_name()}, files;
  for (int k = 1; k < argumentCount; ++k)
  {
    std::string argument = arguments[k];
    if (argument == list && k + 1 < argumentCount)
    {
      const std::vector<std::string> more = SplitFiles(arguments[++k]);
      files.insert(files.end(), more.begin(), more.end());
      continue;
    }
    if (argument.rfind("--", 0) == 0)
    {
      const std::string ending = kOfScene;
      if (argument.size() > ending.size() &&
          argument.compare(argument.size() - ending.size(), ending.size(), ending) == 0)
      {
        argument.erase(argument.size() - ending.size());
      }
      std::replace(argument.begin(), argument.begin() + std::min(argument.find('='), argument.size()), '_', '-');
    }
    rewritten.push_back(argument);
  }
  rewritten.insert(rewritten.end(), files.begin(), files.end());
  return rewritten;
}

}  // namespace bigus::command
