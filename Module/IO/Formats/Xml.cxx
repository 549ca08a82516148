// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/Xml.h"

#include <algorithm>
#include <cstdint>

#include "IO/FileError.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::size_t kDeepest = 100;           // elements in each other; files of Plus have less than 20
constexpr std::size_t kMostElements = 1000000;  // each takes some hundred bytes of memory, however short its tag is

bool IsBlank(char c)
{
  return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

/// Any byte above 127 may be part of a name in UTF-8.
bool IsNameByte(char c)
{
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == ':' ||
         c == '-' || c == '.' || static_cast<unsigned char>(c) > 127;
}

/// `code` in UTF-8; nothing for what is no character.
std::string Utf8(std::int64_t code)
{
  std::string text;
  const auto add = [&text](std::int64_t byte) { text += static_cast<char>(static_cast<unsigned char>(byte)); };
  if (code < 1 || code > 0x10FFFF)
  {
    return text;
  }
  if (code < 0x80)
  {
    add(code);
    return text;
  }
  const int continuations = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
  constexpr std::int64_t kLead[] = {0, 0xC0, 0xE0, 0xF0};
  add(kLead[continuations] | code >> (6 * continuations));
  for (int k = continuations - 1; k >= 0; --k)
  {
    add(0x80 | ((code >> (6 * k)) & 0x3F));
  }
  return text;
}

class XmlParser
{
public:
  XmlParser(std::string_view text, const std::string& complaint) : text_(text), complaint_(complaint) {}

  XmlElement Parse()
  {
    constexpr std::string_view kUtf8Mark = "\xEF\xBB\xBF";
    Take(kUtf8Mark);
    SkipToTag(false);
    XmlElement root;
    std::vector<XmlElement*> open;  // a pointer stays good, because only the last one's children grow
    bool closed = ParseTag(root);
    open.push_back(&root);
    for (std::size_t elements = 1; !open.empty();)
    {
      if (closed)
      {
        open.pop_back();
        closed = false;
        continue;
      }
      SkipToTag(true);
      if (Take("</"))
      {
        if (ParseName() != open.back()->name)
        {
          throw Wrong("an end tag does not belong to <" + Shortened(open.back()->name) + ">");
        }
        SkipBlanks();
        Require(">", "an end tag is not closed");
        open.pop_back();
        continue;
      }
      if (++elements > kMostElements || open.size() >= kDeepest)
      {
        throw Wrong("more than " + std::to_string(kMostElements) + " elements, or more than " +
                    std::to_string(kDeepest) + " in each other");
      }
      XmlElement& child = open.back()->children.emplace_back();
      closed = ParseTag(child);
      open.push_back(&child);
    }
    return root;
  }

private:
  FileError Wrong(const std::string& what) const
  {
    return FormatError(complaint_ + ": " + what + " at byte " + std::to_string(at_));
  }

  bool Take(std::string_view wanted)
  {
    const bool is = text_.substr(at_, wanted.size()) == wanted;
    at_ += is ? wanted.size() : 0;
    return is;
  }

  void Require(std::string_view wanted, const char* otherwise)
  {
    if (!Take(wanted))
    {
      throw Wrong(otherwise);
    }
  }

  void SkipBlanks()
  {
    while (at_ < text_.size() && IsBlank(text_[at_]))
    {
      ++at_;
    }
  }

  void SkipPast(std::string_view end, const char* otherwise)
  {
    const std::size_t found = text_.find(end, at_);
    if (found == std::string_view::npos)
    {
      throw Wrong(otherwise);
    }
    at_ = found + end.size();
  }

  /// A document type may hold declarations in brackets.
  void SkipDocumentType()
  {
    int brackets = 0;
    for (; at_ < text_.size() && (brackets > 0 || text_[at_] != '>'); ++at_)
    {
      brackets += text_[at_] == '[' ? 1 : text_[at_] == ']' ? -1 : 0;
    }
    Require(">", "a document type is not closed");
  }

  /// To the next tag of an element; text before it is allowed inside of an element only.
  void SkipToTag(bool isInside)
  {
    for (;;)
    {
      if (isInside)
      {
        at_ = std::min(text_.find('<', at_), text_.size());
      }
      else
      {
        SkipBlanks();
      }
      if (at_ >= text_.size() || text_[at_] != '<')
      {
        throw Wrong(isInside ? "an element is not closed" : "there is no element");
      }
      if (Take("<!--"))
      {
        SkipPast("-->", "a comment is not closed");
      }
      else if (Take("<?"))
      {
        SkipPast("?>", "an instruction is not closed");
      }
      else if (isInside && Take("<![CDATA["))
      {
        SkipPast("]]>", "a section of text is not closed");
      }
      else if (!isInside && Take("<!DOCTYPE"))
      {
        SkipDocumentType();
      }
      else
      {
        return;
      }
    }
  }

  std::string ParseName()
  {
    const std::size_t begin = at_;
    while (at_ < text_.size() && IsNameByte(text_[at_]))
    {
      ++at_;
    }
    if (at_ == begin)
    {
      throw Wrong("a name is expected");
    }
    return std::string(text_.substr(begin, at_ - begin));
  }

  /// A start tag with its attributes; true when the element ends with it.
  bool ParseTag(XmlElement& element)
  {
    Require("<", "an element is expected");
    element.name = ParseName();
    for (;;)
    {
      const std::size_t before = at_;
      SkipBlanks();
      if (Take("/>"))
      {
        return true;
      }
      if (Take(">"))
      {
        return false;
      }
      if (at_ == before)
      {
        throw Wrong("a tag is not closed");
      }
      std::string name = ParseName();
      SkipBlanks();
      Require("=", "an attribute has no value");
      SkipBlanks();
      element.attributes.emplace_back(std::move(name), ParseValue());
    }
  }

  std::string ParseValue()
  {
    const char quote = at_ < text_.size() ? text_[at_] : '\0';
    const std::size_t end = quote == '"' || quote == '\'' ? text_.find(quote, at_ + 1) : std::string_view::npos;
    if (end == std::string_view::npos)
    {
      throw Wrong("an attribute's value is not in quotation marks");
    }
    std::string value;
    for (++at_; at_ < end;)
    {
      const char c = text_[at_++];
      if (c == '<')
      {
        throw Wrong("an attribute's value holds <");
      }
      value += c == '&' ? ParseEntity(end) : std::string(1, IsBlank(c) ? ' ' : c);
    }
    at_ = end + 1;
    return value;
  }

  /// What stands between & and ; begins at at_.
  std::string ParseEntity(std::size_t end)
  {
    const std::size_t semicolon = text_.find(';', at_);
    if (semicolon >= end)
    {
      throw Wrong("an entity is not closed");
    }
    const std::string entity(text_.substr(at_, semicolon - at_));
    at_ = semicolon + 1;
    constexpr std::pair<const char*, const char*> kKnown[] = {
        {"lt", "<"}, {"gt", ">"}, {"amp", "&"}, {"quot", "\""}, {"apos", "'"}};
    for (const auto& [name, text] : kKnown)
    {
      if (entity == name)
      {
        return text;
      }
    }
    const bool isHexadecimal = entity.rfind("#x", 0) == 0;
    const std::size_t first = isHexadecimal ? 2 : 1;
    std::int64_t code = entity.rfind("#", 0) == 0 && entity.size() > first ? 0 : -1;
    for (std::size_t k = first; code >= 0 && k < entity.size(); ++k)
    {
      const char c = entity[k];
      const int digit = c >= '0' && c <= '9'                    ? c - '0'
                        : isHexadecimal && c >= 'a' && c <= 'f' ? c - 'a' + 10
                        : isHexadecimal && c >= 'A' && c <= 'F' ? c - 'A' + 10
                                                                : -1;
      code = digit < 0 || code > 0x10FFFF ? -1 : code * (isHexadecimal ? 16 : 10) + digit;
    }
    const std::string character = Utf8(code);
    if (character.empty())
    {
      throw Wrong("the entity " + Quoted(entity) + " is not known");
    }
    return character;
  }

  std::string_view text_;
  const std::string& complaint_;
  std::size_t at_ = 0;
};

}  // namespace

const XmlElement* XmlElement::Child(std::string_view wanted) const
{
  const auto found = std::find_if(children.begin(), children.end(),
                                  [wanted](const XmlElement& child) { return child.name == wanted; });
  return found == children.end() ? nullptr : &*found;
}

const std::string* XmlElement::Attribute(std::string_view wanted) const
{
  const auto found =
      std::find_if(attributes.begin(), attributes.end(), [wanted](const auto& a) { return a.first == wanted; });
  return found == attributes.end() ? nullptr : &found->second;
}

std::string XmlElement::Value(std::string_view wanted) const
{
  const std::string* value = Attribute(wanted);
  return value ? *value : "";
}

XmlElement ParseXml(std::string_view text, const std::string& complaint)
{
  return XmlParser(text, complaint).Parse();
}

}  // namespace bigus
