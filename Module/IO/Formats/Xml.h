// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// As much of XML as the files that we read have: elements with attributes.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace bigus
{

struct XmlElement
{
  std::string name;
  std::vector<std::pair<std::string, std::string>> attributes;
  std::vector<XmlElement> children;

  /// The first child of that name; null when there is none.
  const XmlElement* Child(std::string_view wanted) const;

  /// The attribute's value; null when there is none.
  const std::string* Attribute(std::string_view wanted) const;
  /// The attribute's value; empty when there is none.
  std::string Value(std::string_view wanted) const;
};

/// The root element of a document. Text between tags, comments, processing instructions and a document type are skipped;
/// of entities the five that XML has and numbers are known. Throws FormatError: `complaint`, ": ", what is wrong and the
/// byte where. At most 100 elements lie in each other and 1,000,000 in all.
XmlElement ParseXml(std::string_view text, const std::string& complaint);

}  // namespace bigus
