// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// XML of files that may be hostile, read by pugixml.
#pragma once

#include <pugixml.hpp>
#include <string>
#include <string_view>

namespace bigus
{

/// A document of elements and attributes, in UTF-8 or what it begins as, such as UTF-16. Comments, processing instructions, a document type and sections of text are
/// skipped. Of entities the five that XML has and numbers are replaced; any other stays as it stands, so no text grows.
/// At most 1,000,000 tags are read, and elements 100 deep. Throws FormatError: `complaint`, ": ", what is wrong and the
/// byte where.
pugi::xml_document ParseXml(std::string_view text, const std::string& complaint);

}  // namespace bigus
