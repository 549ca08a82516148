// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The list of the trainer's options: what it says is what TrainerOptions does, and what the documentation says.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Training/OptionList.h"
#include "Support/SourceFolder.h"

namespace
{

using bigus::ListOptions;
using bigus::NumberText;
using bigus::OptionText;
using bigus::SetOption;
using bigus::TrainerOptions;

std::string ValueOf(const TrainerOptions& options, const std::string& name)
{
  for (const OptionText& option : ListOptions(options))
  {
    if (option.info.name == name)
    {
      return option.value;
    }
  }
  return "no such option";
}

/// What SetOption says to it; empty when it takes it.
std::string Refusal(const std::string& name, const std::string& value)
{
  try
  {
    TrainerOptions options;
    SetOption(options, name, value);
    return "";
  }
  catch (const bigus::Error& error)
  {
    return error.what();
  }
}

TEST(OptionList, EveryOptionReadsBackAsItWasWritten)
{
  std::set<std::string> names;
  for (const OptionText& option : ListOptions())
  {
    const std::string name = option.info.name;
    EXPECT_TRUE(names.insert(name).second) << name << " is there twice";
    EXPECT_GT(std::string(option.info.help).size(), 10u) << name;
    TrainerOptions options;
    SetOption(options, name, option.value);
    EXPECT_EQ(ValueOf(options, name), option.value);
    options.Validate();
    EXPECT_EQ(option.mayBeOpen, Refusal(name, "auto").empty() && name != "Engine") << name;
    if (option.kind == OptionText::Kind::Number)
    {
      for (const double bound : {option.info.least, option.info.most})
      {
        SetOption(options, name, NumberText(bound));
        EXPECT_EQ(ValueOf(options, name), NumberText(bound)) << name;
        options.Validate();
      }
    }
    if (option.kind == OptionText::Kind::Switch)
    {
      SetOption(options, name, option.value == "on" ? "off" : "on");
      EXPECT_NE(ValueOf(options, name), option.value) << name;
    }
  }
  EXPECT_GT(names.size(), 30u);
}

TEST(OptionList, ValuesReachTheMembers)
{
  TrainerOptions options;
  SetOption(options, "Gaussians", "5e4");
  SetOption(options, "ElevationSigma", "0.55");
  SetOption(options, "Seeding", "harris");
  SetOption(options, "Preset", "texture");
  SetOption(options, "Loss", "0.8*l1+0.2*dssim");
  SetOption(options, "Interpolation", "probe+flow");
  SetOption(options, "SignedReflectivity", "off");
  SetOption(options, "Seed", "9007199254740992");
  EXPECT_EQ(options.gaussians, 50000u);
  EXPECT_EQ(options.elevationSigma, 0.55);
  EXPECT_EQ(options.seeding, bigus::SeedPlacement::Harris);
  EXPECT_EQ(options.preset, bigus::Preset::Texture);
  EXPECT_EQ(options.loss->dssim, 0.2);
  EXPECT_EQ(options.interpolation->path, bigus::FrameInterpolation::Path::Probe);
  EXPECT_FALSE(options.signedReflectivity);
  EXPECT_EQ(options.seed, std::uint64_t(1) << 53);
  SetOption(options, "Gaussians", "auto");
  EXPECT_FALSE(options.gaussians);
}

TEST(OptionList, WhatIsOutOfRangeIsRefusedWithNameValueAndRange)
{
  for (const OptionText& option : ListOptions())
  {
    const std::string name = option.info.name, words = bigus::SpellOption(name);
    std::set<std::string> wrong = {"", "x1"};
    if (option.kind == OptionText::Kind::Number)
    {
      wrong.insert({NumberText(option.info.zeroIsNone ? 1 : option.info.least - 1), NumberText(2 * option.info.most),
                    "nan", "inf", "1 2", "1,5"});
    }
    for (const std::string& value : wrong)
    {
      if (name != "Engine")  // whose names are those of the engines present
      {
        const std::string said = Refusal(name, value);
        EXPECT_EQ(said.find(words), 0u) << name << " took '" << value << "': " << said;
        EXPECT_NE(said.find(value), std::string::npos) << said;
        if (name != "Interpolation")  // which has a text of its own
        {
          EXPECT_NE(said.find(option.values), std::string::npos) << said;
        }
      }
    }
  }
  EXPECT_EQ(Refusal("VirtualPlanes", "9"), "virtual planes is 9; it must be 0 to 8 or auto.");
  EXPECT_EQ(Refusal("Batch", "2.5"), "batch is 2.5; it must be 1 to 4096.");
  EXPECT_NE(Refusal("Colour", "blue").find("Colour"), std::string::npos);
}

TEST(OptionList, NamesHaveTheirSpellings)
{
  EXPECT_EQ(bigus::SpellOption("VirtualPlanes"), "virtual planes");
  EXPECT_EQ(bigus::SpellOption("VirtualPlanes", '-'), "virtual-planes");
  EXPECT_EQ(bigus::SpellOption("Seed", '_'), "seed");
}

TEST(OptionList, NumbersReadBackExactly)
{
  for (const double value : {0.1, 1e-4, 1e-6, 1.0 / 3, 67108864.0, 1e9, 9007199254740992.0, -2.5})
  {
    EXPECT_EQ(std::stod(NumberText(value)), value);
  }
  EXPECT_EQ(NumberText(1e7), "10000000");
  EXPECT_EQ(NumberText(1e-4), "0.0001");
}

std::string Replace(std::string text, char what, const std::string& by)
{
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
  {
    text.replace(at, 1, by);
  }
  return text;
}

/// From its first heading on the page is made from the list. BIGUS_FIX=1 in the environment writes it.
TEST(OptionList, ThePageOfOptionsIsTheList)
{
  std::string table, group;
  for (const OptionText& option : ListOptions())
  {
    if (group != option.info.group)
    {
      group = option.info.group;
      table += "\n## " + group + "\n\n| option | default | values | meaning |\n|---|---|---|---|\n";
    }
    const std::string meaning =
        option.info.help + (*option.info.open ? "; auto: " + std::string(option.info.open) : "");
    // Markdown would take a bar for the next cell, and two stars for emphasis.
    table += "| `" + std::string(option.info.name) + "` | " + option.value + " | " + Replace(option.values, '|', ", ") +
             " | " + Replace(meaning, '*', "\\*") + " |\n";
  }
  const std::filesystem::path path = bigus::test::SourceFolder() / "Module/Core/Training/Options.md";
  std::ifstream file(path);
  const std::string page{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const std::string made = page.substr(0, page.find("\n## ")) + table;
  if (page != made && std::getenv("BIGUS_FIX"))
  {
    std::ofstream(path) << made;
    return;
  }
  EXPECT_EQ(page, made) << "BIGUS_FIX=1 writes Module/Core/Training/Options.md anew.";
}

/// Of a text, without what is only there for its layout in a comment.
std::string Words(const std::string& text)
{
  std::istringstream in(text);
  std::string words, word;
  while (in >> word)
  {
    words += word == "*" ? "" : (words.empty() ? "" : " ") + word;
  }
  return words;
}

/// The comments of the trainer's properties, made from the list: when this fails, put what it prints there.
TEST(OptionList, ThePropertiesOfTheTrainerAreTheList)
{
  std::ifstream file(bigus::test::SourceFolder() / "Filters/vtkBigusTrainer.h");
  const std::string header{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  for (const OptionText& option : ListOptions())
  {
    const std::string name = option.info.name;
    std::size_t at = header.find("OptionMacro(" + name + ")");
    at = at == std::string::npos ? header.find("OptionMacro(" + name + ",") : at;
    ASSERT_NE(at, std::string::npos) << "Filters/vtkBigusTrainer.h has no property " << name;
    const std::size_t end = header.rfind("*/", at), begin = header.rfind("/**", end);
    const std::string values = option.values.empty() ? "" : " Values: " + Replace(option.values, '|', ", ") + ".";
    const std::string open = *option.info.open ? ", " + std::string(option.info.open) : "";
    EXPECT_EQ(Words(header.substr(begin + 3, end - begin - 3)),
              Words(std::string(option.info.help) + "." + values + " Default: " + option.value + open + "."))
        << name;
    EXPECT_EQ(Words(header.substr(end + 2, header.find("OptionMacro", end) - end - 2)).rfind("vtkBigus", 0), 0u)
        << name;
  }
}

}  // namespace
