// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Text as files hold it: numbers that do not depend on the locale, and lines of bounded length.
#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "Core/Numerics/Format.h"  // ExactNumber

namespace bigus
{

std::string_view Trimmed(std::string_view text);
std::string Lowercase(std::string_view text);

/// Without the byte order mark that some programs begin UTF-8 with.
std::string WithoutMark(std::string text);

/// The words between blanks.
std::vector<std::string_view> Words(std::string_view text);

/// Text with "?" in place of what a terminal would obey or cannot show: control characters but tabs and ends of lines, those
/// of Latin-1 (U+0080 to U+009F) and those that turn the direction of writing (U+202A to 202E, 2066 to 2069) included, and
/// bytes that are no UTF-8.
std::string Printable(std::string_view text);

/// Text from a file made fit for a message: printable, and at most 60 bytes in one line; Quoted adds quotation marks.
std::string Shortened(std::string_view text);
std::string Quoted(std::string_view text);

/// Whole-text conversions; blanks around the number are ignored. "nan" and "inf" are numbers. False, with
/// `value` unchanged, when the text is anything else or out of range.
bool ParseNumber(std::string_view text, double& value);
bool ParseNumber(std::string_view text, std::int64_t& value);

/// Exactly `count` numbers between blanks.
bool ParseNumbers(std::string_view text, std::size_t count, double* values);

/// Whether `a` comes before `b` in natural order, in which runs of digits count as numbers: frame_2 before frame_10.
bool InNaturalOrder(const std::string& a, const std::string& b);

/// Deflate cannot shrink anything by more than this factor: compressed data of n bytes hold at most n times
/// as many.
constexpr std::uint64_t deflateLimit = 1032;

/// An opened regular file. Throws FileError naming the file when it cannot be opened or is no regular file.
class InputFile
{
public:
  explicit InputFile(const std::string& fileName);

  const std::string& Name() const { return name_; }
  std::uint64_t Size() const { return size_; }
  std::uint64_t Position() const { return position_; }
  std::uint64_t Remaining() const { return size_ - position_; }

  void Seek(std::uint64_t position);

  /// Reads up to `count` bytes and returns how many there were.
  std::size_t Read(void* bytes, std::size_t count);

  /// The next line without its end (LF or CR LF), the first without a byte order mark; false at the end of the file. Throws FileError when the
  /// line is longer than so many bytes.
  bool ReadLine(std::string& line, std::size_t longest = 64 * 1024);

private:
  std::string name_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::uint64_t position_ = 0;
};

/// The first bytes of a file, at most `count`; empty when it cannot be read.
std::string FileBeginning(const std::string& fileName, std::size_t count);

/// Whether `text` stands in a file before `end`, or before its own end where that never comes; false when it cannot be read.
bool HasBefore(const std::string& fileName, std::string_view text, std::string_view end);

/// The whole of a small text file. Throws FileError when it is larger than `limit` bytes.
std::string ReadTextFile(const std::string& fileName, std::uint64_t limit);

/// The path of a companion file that `owner` names as `relative`: inside `folder`, or FileError. Absolute
/// names, ".." and links that lead out of the folder are refused, so that a header cannot make us read other
/// files.
std::string CompanionFile(const std::string& owner, const std::string& folder, const std::string& relative);

/// The folder that a file lies in; "." when the name has none.
std::string FolderOf(const std::string& fileName);

}  // namespace bigus
