// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Puts ParaView's XML together when the project is built:
//
//     bigusMakePluginXml PLUGIN.xml SHARED PROXY.xml...
//
// A line @Name@ of a proxy stands for the lines of SHARED/Name.xml; @TrainerOptions@ and @PhantomOptions@ stand for a
// property for each option of Core/Training/OptionList.h and each number of Core/Phantom/PhantomOptionList.h.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Phantom/PhantomOptionList.h"
#include "Core/Training/OptionList.h"

namespace
{

using bigus::OptionText;

// What the panel shows first, in this order; the rest are advanced properties.
constexpr std::array<const char*, 9> kFirst = {"Automatic", "TimeLimit", "Gaussians",      "Iterations",   "HoldOut",
                                               "Preset",    "Seed",      "ElevationSigma", "PoseSmoothing"};

// ParaView draws a slider for a whole number with a range. Where its steps are far apart it is in the way, and an IdType has
// no range.
constexpr double kMostOnSlider = 1e7;

std::string Escaped(const std::string& text)
{
  std::string escaped;
  for (const char c : text)
  {
    escaped += c == '&' ? "&amp;" : c == '<' ? "&lt;" : std::string(1, c);
  }
  return escaped;
}

std::vector<std::string> Split(const std::string& text, char separator)
{
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);)
  {
    parts.push_back(part);
  }
  return parts;
}

/// "a|b[+c]" to a, a+c, b, b+c.
std::vector<std::string> Choices(const std::string& values)
{
  const std::vector<std::string> parts = Split(values, '[');
  std::vector<std::string> choices = Split(parts.front(), '|');
  for (std::size_t k = 1; k < parts.size(); ++k)
  {
    std::vector<std::string> longer;
    for (const std::string& choice : choices)
    {
      longer.push_back(choice);
      for (const std::string& ending : Split(parts[k].substr(0, parts[k].find(']')), '|'))
      {
        longer.push_back(choice + ending);
      }
    }
    choices = longer;
  }
  return choices;
}

std::string Meaning(const OptionText& option)
{
  const bool isNumber = option.kind == OptionText::Kind::Number;
  std::string text = option.info.help;
  text += *option.info.open ? std::string(isNumber ? "; -1: " : "; auto: ") + option.info.open : "";
  return text + (isNumber ? " (" + option.values + ")." : ".");
}

std::string NumberProperty(const OptionText& option, const std::string& attributes, const std::string& meaning)
{
  const double least = option.mayBeOpen ? -1 : option.info.zeroIsNone ? 0 : option.info.least;
  const bool isLong = option.isWhole && option.info.most > kMostOnSlider;
  const std::string kind = isLong ? "IdType" : option.isWhole ? "Int" : "Double";
  std::string text = "<" + kind + "VectorProperty " + attributes + " default_values=\"" +
                     (option.value == "auto" ? "-1" : option.value) + "\">\n";
  if (!isLong)
  {
    text += "  <" + kind + "RangeDomain name=\"range\" min=\"" + bigus::NumberText(least) + "\" max=\"" +
            bigus::NumberText(option.info.most) + "\"/>\n";
  }
  return text + meaning + "</" + kind + "VectorProperty>\n";
}

std::string TextProperty(const OptionText& option, const std::string& attributes, const std::string& meaning)
{
  std::string text = "<StringVectorProperty " + attributes + " default_values=\"" + option.value + "\">\n";
  if (!option.values.empty())
  {
    text += "  <StringListDomain name=\"list\">\n";
    text += option.mayBeOpen ? "    <String value=\"auto\"/>\n" : "";
    for (const std::string& choice : Choices(option.values))
    {
      text += "    <String value=\"" + choice + "\"/>\n";
    }
    text += "  </StringListDomain>\n";
  }
  return text + meaning + "</StringVectorProperty>\n";
}

std::string Property(const OptionText& option, bool isAdvanced, std::size_t elements = 1)
{
  const std::string name = option.info.name;
  const std::string attributes = "name=\"" + name + "\" command=\"Set" + name + "\" number_of_elements=\"" +
                                 std::to_string(elements) + "\"" + (isAdvanced ? " panel_visibility=\"advanced\"" : "");
  const std::string meaning = "  <Documentation>" + Escaped(Meaning(option)) + "</Documentation>\n";
  switch (option.kind)
  {
    case OptionText::Kind::Switch:
      if (option.mayBeOpen)
      {
        return "<IntVectorProperty " + attributes +
               " default_values=\"-1\">\n  <EnumerationDomain name=\"enum\">\n    <Entry text=\"auto\" value=\"-1\"/>\n"
               "    <Entry text=\"on\" value=\"1\"/>\n    <Entry text=\"off\" value=\"0\"/>\n  </EnumerationDomain>\n" +
               meaning + "</IntVectorProperty>\n";
      }
      return "<IntVectorProperty " + attributes + " default_values=\"" + (option.value == "on" ? "1" : "0") +
             "\">\n  <BooleanDomain name=\"bool\"/>\n" + meaning + "</IntVectorProperty>\n";
    case OptionText::Kind::Number:
      return NumberProperty(option, attributes, meaning);
    case OptionText::Kind::Text:
      return TextProperty(option, attributes, meaning);
  }
  return "";
}

std::string TrainerOptions()
{
  const auto place = [](const OptionText& option)
  { return std::find(kFirst.begin(), kFirst.end(), std::string(option.info.name)) - kFirst.begin(); };
  std::vector<OptionText> options = bigus::ListOptions();
  std::stable_sort(options.begin(), options.end(),
                   [&place](const OptionText& a, const OptionText& b) { return place(a) < place(b); });
  std::string text;
  for (const OptionText& option : options)
  {
    text += Property(option, place(option) == static_cast<std::ptrdiff_t>(kFirst.size()));
  }
  return text;
}

std::string PhantomProperties()
{
  const bigus::PhantomOptions defaults;
  constexpr std::array<const char*, 5> kShown = {"Seed", "PixelSize", "FrameSpacing", "TrackingNoise",
                                                 "TrackingRotationNoise"};
  std::string text;
  bigus::ForEachPhantomNumber(
      defaults,
      [&](const bigus::PhantomNumber& number, const auto& value)
      {
        using T = std::decay_t<decltype(value)>;
        OptionText option;
        option.info = {number.name, number.group, number.help, number.least,
                       number.most, number.unit,  "",          number.zeroIsProbes};
        option.kind = OptionText::Kind::Number;
        option.values = bigus::NumberText(number.least) + " to " + bigus::NumberText(number.most) +
                        (*number.unit ? " " : "") + number.unit;
        option.isWhole = std::is_integral_v<T>;
        std::size_t elements = 1;
        if constexpr (std::is_arithmetic_v<T>)
        {
          option.value = bigus::NumberText(static_cast<double>(value));
        }
        else
        {
          elements = value.size();
          for (const double one : value)
          {
            option.value += (option.value.empty() ? "" : " ") + bigus::NumberText(one);
          }
        }
        text += Property(option, std::find(kShown.begin(), kShown.end(), std::string(number.name)) == kShown.end(),
                         elements);
      });
  return text;
}

/// The text with `indent` before every line, comments left out and every @Name@ replaced by what it stands for.
std::string Filled(std::istream&& text, const std::string& indent, const std::filesystem::path& shared)
{
  std::string filled;
  for (std::string line; std::getline(text, line);)
  {
    const std::size_t begin = line.find_first_not_of(' ');
    if (begin == std::string::npos || line.compare(begin, 4, "<!--") == 0)
    {
      continue;
    }
    if (line[begin] != '@')
    {
      filled += indent + line + "\n";
      continue;
    }
    const std::string name = line.substr(begin + 1, line.find('@', begin + 1) - begin - 1);
    const std::string deeper = indent + line.substr(0, begin);
    if (name == "TrainerOptions" || name == "PhantomOptions")
    {
      filled += Filled(std::istringstream(name[0] == 'T' ? TrainerOptions() : PhantomProperties()), deeper, shared);
      continue;
    }
    std::ifstream part(shared / (name + ".xml"));
    if (!part)
    {
      throw bigus::Error("There is no file '" + (shared / (name + ".xml")).string() + "', which @" + name + "@ names.");
    }
    filled += Filled(std::move(part), deeper, shared);
  }
  return filled;
}

void MakePluginXml(const std::string& output, const std::filesystem::path& shared,
                   const std::vector<std::filesystem::path>& proxies)
{
  std::string sources, filters;
  for (const std::filesystem::path& path : proxies)
  {
    std::ifstream proxy(path);
    if (!proxy)
    {
      throw bigus::Error("There is no file '" + path.string() + "'.");
    }
    const std::string filled = Filled(std::move(proxy), "    ", shared);
    (filled.find("<InputProperty") == std::string::npos ? sources : filters) += filled;
  }
  // ParaView makes its menus Sources and Filters from the two groups.
  const std::string text =
      "<!-- Made from the proxies and from Core/Training/OptionList.h: what is changed here is lost. -->\n"
      "<ServerManagerConfiguration>\n  <ProxyGroup name=\"sources\">\n" +
      sources + "  </ProxyGroup>\n  <ProxyGroup name=\"filters\">\n" + filters +
      "  </ProxyGroup>\n</ServerManagerConfiguration>\n";
  std::ofstream file(output);
  if (!(file << text << std::flush))
  {
    throw bigus::Error("Cannot write '" + output + "'.");
  }
}

}  // namespace

int main(int count, char** arguments)
{
  if (count < 4)
  {
    std::cerr << "usage: bigusMakePluginXml PLUGIN.xml SHARED PROXY.xml...\n";
    return 1;
  }
  try
  {
    MakePluginXml(arguments[1], arguments[2], {arguments + 3, arguments + count});
    return 0;
  }
  catch (const std::exception& error)
  {
    std::cerr << "bigusMakePluginXml: " << error.what() << '\n';
    return 1;
  }
}
