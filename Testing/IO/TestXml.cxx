// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The XML that files of Plus and VTK have, and one error for every way to be bad.
#include <gtest/gtest.h>

#include "IO/FileError.h"
#include "IO/Formats/Xml.h"

namespace bigus::test
{
namespace
{

TEST(Xml, ElementsAttributesAndEntities)
{
  const pugi::xml_document document = ParseXml(
      "\xEF\xBB\xBF<?xml version=\"1.0\"?>\n<!DOCTYPE a [<!ELEMENT a (b)>]><!-- <no> -->\n"
      "<a one='1' two = \"&lt;&amp;&quot;&#65;&#x20ac;\"\n three='x\ty'>text <![CDATA[<b>]]>&unread;"
      "<b/><c.d-e:f k=\"1\"><b k='2'></b ></c.d-e:f><!-- > --><b k='3'/></a>\n",
      "file");
  const pugi::xml_node root = document.document_element();
  EXPECT_STREQ(root.name(), "a");
  EXPECT_STREQ(root.attribute("one").value(), "1");
  EXPECT_STREQ(root.attribute("two").value(), "<&\"A\u20ac");
  EXPECT_STREQ(root.attribute("three").value(), "x y");
  EXPECT_FALSE(root.attribute("four"));
  EXPECT_STREQ(root.child("c.d-e:f").first_child().attribute("k").value(), "2");
  EXPECT_FALSE(root.child("b").attribute("k"));
  EXPECT_STREQ(root.child("b").next_sibling("b").attribute("k").value(), "3");
}

std::string Utf16(const std::string& text, bool isBigEndian, bool isMarked)
{
  std::string wide = !isMarked ? "" : isBigEndian ? "\xFE\xFF" : "\xFF\xFE";
  for (const char c : text)
  {
    wide += isBigEndian ? std::string{'\0', c} : std::string{c, '\0'};
  }
  return wide;
}

TEST(Xml, InUtf16)
{
  for (const bool isBigEndian : {false, true})
  {
    for (const bool isMarked : {false, true})
    {
      const std::string text = Utf16("<?xml version='1.0' encoding='UTF-16'?><a b='c'/>", isBigEndian, isMarked);
      EXPECT_STREQ(ParseXml(text, "file").document_element().attribute("b").value(), "c");
      EXPECT_THROW(ParseXml(text.substr(0, text.size() - 3), "file"), FileError);
    }
  }
}

// With entities a small file may ask for much memory: here none makes a text longer than it stands.
TEST(Xml, ExpandsNoEntities)
{
  const std::string declared = "<!DOCTYPE a [<!ENTITY b 'bbbbbbbbbbbb'><!ENTITY c '&b;&b;&b;&b;'>]>";
  for (const std::string text : {"&c;", "&no;", "&amp", "&", "&#0;", "&#x110000;", "&#99999999999999999999;", "&#xx;"})
  {
    const pugi::xml_document document = ParseXml(declared + "<a b='" + text + "'/>", "file");
    const std::string value = document.document_element().attribute("b").value();
    EXPECT_LE(value.size(), text.size()) << text;
    EXPECT_TRUE(text.find('#') != std::string::npos || value == text) << value;
  }
}

TEST(Xml, RefusesWhatIsNone)
{
  std::string deep = "<a/>", wide = "<a>";
  for (int k = 0; k < 100; ++k)
  {
    deep = "<a>" + deep + "</a>";
  }
  for (int k = 0; k < 1000000; ++k)
  {
    wide += "<a/>";
  }
  wide += "</a>";
  for (const std::string& text :
       {std::string(""), std::string(" text"), std::string("<"), std::string("<a"), std::string("<a>"),
        std::string("<a></b>"), std::string("<a></a"), std::string("<a b></a>"), std::string("<a b=c/>"),
        std::string("<a b='c/>"), std::string("<a b='1'c='2'/>"), std::string("<!-- <a/>"), std::string("<?xml <a/>"),
        std::string("<!DOCTYPE a [ <a/>"), std::string("<a><![CDATA[</a>"), std::string("<1a/>").replace(1, 1, "!"),
        std::string("<a\0/>", 5), deep, wide})
  {
    try
    {
      ParseXml(text, "file.xml: not XML");
      ADD_FAILURE() << text.substr(0, 80);
    }
    catch (const FileError& error)
    {
      EXPECT_EQ(std::string(error.what()).rfind("file.xml: not XML: ", 0), 0u) << error.what();
      EXPECT_EQ(error.Fault(), FileFault::Format);
    }
  }
}

}  // namespace
}  // namespace bigus::test
