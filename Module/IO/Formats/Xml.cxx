// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/Xml.h"

#include <algorithm>
#include <cstddef>
#include <new>

#include "IO/FileError.h"

namespace bigus
{
namespace
{

constexpr int kDeepest = 100;                  // elements in each other; files of Plus have less than 20
constexpr std::ptrdiff_t kMostTags = 1000000;  // each takes some hundred bytes of memory, however short it is

/// Stops at what lies too deep. pugixml walks and parses without recursion, whatever a file nests.
struct DepthCheck : pugi::xml_tree_walker
{
  std::ptrdiff_t at = 0;

  bool for_each(pugi::xml_node& node) override
  {
    at = node.offset_debug();
    return depth() < kDeepest;
  }
};

}  // namespace

pugi::xml_document ParseXml(std::string_view text, const std::string& complaint)
{
  const auto wrong = [&complaint](const std::string& what, std::ptrdiff_t at)
  { return FormatError(complaint + ": " + what + " at byte " + std::to_string(at)); };
  // Before parsing, because every tag becomes nodes.
  if (std::count(text.begin(), text.end(), '<') > kMostTags)
  {
    throw wrong("more than " + std::to_string(kMostTags) + " tags", static_cast<std::ptrdiff_t>(text.size()));
  }
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(
      text.data(), text.size(), pugi::parse_escapes | pugi::parse_wconv_attribute, pugi::encoding_auto);
  if (result.status == pugi::status_out_of_memory)
  {
    throw std::bad_alloc();
  }
  if (!result)
  {
    throw wrong(result.description(), result.offset);
  }
  if (DepthCheck check; !document.traverse(check))
  {
    throw wrong("more than " + std::to_string(kDeepest) + " elements in each other", check.at);
  }
  return document;
}

}  // namespace bigus
