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
  const XmlElement root = ParseXml(
      "\xEF\xBB\xBF<?xml version=\"1.0\"?>\n<!DOCTYPE a [<!ELEMENT a (b)>]><!-- <no> -->\n"
      "<a one='1' two = \"&lt;&amp;&quot;&#65;&#x20ac;\"\n three='x\ty'>text <![CDATA[<b>]]>&unread;"
      "<b/><c.d-e:f k=\"1\"><b k='2'></b ></c.d-e:f><!-- > --><b k='3'/></a>\n",
      "file");
  EXPECT_EQ(root.name, "a");
  EXPECT_EQ(root.Value("one"), "1");
  EXPECT_EQ(root.Value("two"), "<&\"A\u20ac");
  EXPECT_EQ(root.Value("three"), "x y");
  EXPECT_EQ(root.Attribute("four"), nullptr);
  ASSERT_EQ(root.children.size(), 3u);
  ASSERT_NE(root.Child("c.d-e:f"), nullptr);
  EXPECT_EQ(root.Child("c.d-e:f")->children[0].Value("k"), "2");
  EXPECT_EQ(root.Child("b"), &root.children[0]);
  EXPECT_EQ(root.children[2].Value("k"), "3");
}

TEST(Xml, RefusesWhatIsNone)
{
  std::string deep, wide = "<a>";
  for (int k = 0; k < 100; ++k)
  {
    deep += "<a>";
  }
  for (int k = 0; k < 1000000; ++k)
  {
    wide += "<a/>";
  }
  for (const std::string& text : {std::string(""),
                                  std::string(" text"),
                                  std::string("<"),
                                  std::string("<a"),
                                  std::string("<a>"),
                                  std::string("<a></b>"),
                                  std::string("<a></a"),
                                  std::string("<a b></a>"),
                                  std::string("<a b=c/>"),
                                  std::string("<a b='c/>"),
                                  std::string("<a b='<'/>"),
                                  std::string("<a b='1'c='2'/>"),
                                  std::string("<a b='&no;'/>"),
                                  std::string("<a b='&amp'/>"),
                                  std::string("<a b='&#0;'/>"),
                                  std::string("<a b='&#x110000;'/>"),
                                  std::string("<a b='&#99999999999999999999;'/>"),
                                  std::string("<!-- <a/>"),
                                  std::string("<?xml <a/>"),
                                  std::string("<!DOCTYPE a [ <a/>"),
                                  std::string("<a><![CDATA[</a>"),
                                  std::string("<1a/>").replace(1, 1, "!"),
                                  std::string("<a\0/>", 5),
                                  deep + "<a/>",
                                  wide})
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
