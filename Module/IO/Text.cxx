// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Text.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <system_error>
#include <tuple>

#include "IO/FileError.h"

namespace bigus
{
namespace
{

bool IsBlank(char c)
{
  return c == ' ' || c == '\t' || c == '\r' || c == '\n';
}

template <class Number>
bool ParseWhole(std::string_view text, Number& value)
{
  text = Trimmed(text);
  if (text.size() > 1 && text[0] == '+' && text[1] != '-')
  {
    text.remove_prefix(1);
  }
  Number parsed{};
  const auto result = std::from_chars(text.data(), text.data() + text.size(), parsed);
  if (text.empty() || result.ec != std::errc() || result.ptr != text.data() + text.size())
  {
    return false;
  }
  value = parsed;
  return true;
}

/// Of the character of UTF-8 that the text begins with; 0 for bytes that are none, because what shows messages, such as
/// Python, refuses them.
std::size_t Utf8Bytes(std::string_view text)
{
  const auto byte = [text](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  const unsigned char lead = text.empty() ? 0xFF : byte(0);
  if (lead < 0x80)
  {
    return 1;
  }
  const std::size_t bytes = lead >= 0xC2 && lead < 0xE0   ? 2
                            : lead >= 0xE0 && lead < 0xF0 ? 3
                            : lead >= 0xF0 && lead < 0xF5 ? 4
                                                          : 0;
  if (bytes > text.size())
  {
    return 0;
  }
  for (std::size_t k = 1; k < bytes; ++k)
  {
    if ((byte(k) & 0xC0) != 0x80)
    {
      return 0;
    }
  }
  // Longer forms than needed, halves of UTF-16 and numbers beyond Unicode's.
  const unsigned char second = bytes > 2 ? byte(1) : 0;
  const bool isWrong = (lead == 0xE0 && second < 0xA0) || (lead == 0xED && second > 0x9F) ||
                       (lead == 0xF0 && second < 0x90) || (lead == 0xF4 && second > 0x8F);
  return isWrong ? 0 : bytes;
}

/// Whether a terminal obeys a character of UTF-8 instead of showing it.
bool IsControl(std::string_view character)
{
  const auto byte = [character](std::size_t k) { return static_cast<unsigned char>(character[k]); };
  switch (character.size())
  {
    case 1:
      return (byte(0) < 32 && byte(0) != '\t' && byte(0) != '\n') || byte(0) == 127;
    case 2:
      return byte(0) == 0xC2 && byte(1) < 0xA0;
    case 3:
      return byte(0) == 0xE2 && ((byte(1) == 0x80 && byte(2) >= 0xAA && byte(2) <= 0xAE) ||
                                 (byte(1) == 0x81 && byte(2) >= 0xA6 && byte(2) <= 0xA9));
    default:
      return false;
  }
}

}  // namespace

std::string_view Trimmed(std::string_view text)
{
  while (!text.empty() && IsBlank(text.front()))
  {
    text.remove_prefix(1);
  }
  while (!text.empty() && IsBlank(text.back()))
  {
    text.remove_suffix(1);
  }
  return text;
}

std::string Lowercase(std::string_view text)
{
  std::string lower(text);
  for (char& c : lower)
  {
    if (c >= 'A' && c <= 'Z')
    {
      c = static_cast<char>(c - 'A' + 'a');
    }
  }
  return lower;
}

std::string WithoutMark(std::string text)
{
  text.erase(0, text.rfind("\xef\xbb\xbf", 0) == 0 ? 3 : 0);
  return text;
}

std::vector<std::string_view> Words(std::string_view text)
{
  std::vector<std::string_view> words;
  std::size_t i = 0;
  while (i < text.size())
  {
    while (i < text.size() && IsBlank(text[i]))
    {
      ++i;
    }
    const std::size_t begin = i;
    while (i < text.size() && !IsBlank(text[i]))
    {
      ++i;
    }
    if (i > begin)
    {
      words.push_back(text.substr(begin, i - begin));
    }
  }
  return words;
}

std::string Printable(std::string_view text)
{
  std::string printable;
  printable.reserve(text.size());
  std::size_t bytes = 0;
  for (std::size_t at = 0; at < text.size(); at += std::max<std::size_t>(bytes, 1))
  {
    bytes = Utf8Bytes(text.substr(at));
    if (bytes > 0 && !IsControl(text.substr(at, bytes)))
    {
      printable.append(text, at, bytes);
    }
    else
    {
      printable += '?';
    }
  }
  return printable;
}

std::string Shortened(std::string_view text)
{
  constexpr std::size_t kLongest = 60;
  std::string line = Printable(text.substr(0, 4 * kLongest));
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c == '\t' || c == '\n'; }, '?');
  std::size_t at = 0;
  while (at < line.size())
  {
    const std::size_t bytes = Utf8Bytes(std::string_view(line).substr(at));
    if (at + bytes > kLongest)
    {
      return line.substr(0, at) + "...";
    }
    at += bytes;
  }
  return line;
}

std::string Quoted(std::string_view text)
{
  return '"' + Shortened(text) + '"';
}

bool ParseNumber(std::string_view text, double& value)
{
  return ParseWhole(text, value);
}

bool ParseNumber(std::string_view text, std::int64_t& value)
{
  return ParseWhole(text, value);
}

bool ParseNumbers(std::string_view text, std::size_t count, double* values)
{
  const auto words = Words(text);
  if (words.size() != count)
  {
    return false;
  }
  for (std::size_t i = 0; i < count; ++i)
  {
    if (!ParseNumber(words[i], values[i]))
    {
      return false;
    }
  }
  return true;
}

bool InNaturalOrder(const std::string& a, const std::string& b)
{
  // The text up to the next digits, then their number as how many digits it has and which.
  const auto take = [](std::string_view& rest)
  {
    constexpr std::string_view digits = "0123456789";
    const std::string_view text = rest.substr(0, rest.find_first_of(digits));
    rest.remove_prefix(text.size());
    std::string_view number = rest.substr(0, rest.find_first_not_of(digits));
    rest.remove_prefix(number.size());
    number.remove_prefix(std::min(number.find_first_not_of('0'), number.size()));
    return std::make_tuple(text, number.size(), number);
  };
  std::string_view restA = a;
  std::string_view restB = b;
  while (!restA.empty() && !restB.empty())
  {
    const auto partA = take(restA);
    const auto partB = take(restB);
    if (partA != partB)
    {
      return partA < partB;
    }
  }
  return restA.empty() != restB.empty() ? restA.empty() : a < b;  // 01 before 1, so that every two names have an order
}

InputFile::InputFile(const std::string& fileName) : name_(fileName)
{
  std::error_code error;
  const auto status = std::filesystem::status(fileName, error);
  Require(FileFault::NotFound, std::filesystem::exists(status), fileName, ": there is no such file");
  Require(FileFault::CannotOpen, std::filesystem::is_regular_file(status), fileName, ": not a regular file");
  size_ = std::filesystem::file_size(fileName, error);
  stream_.open(fileName, std::ios::binary);
  Require(FileFault::CannotOpen, !error && stream_, fileName, ": cannot be opened for reading");
}

void InputFile::Seek(std::uint64_t position)
{
  position_ = std::min(position, size_);
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(position_));
}

std::size_t InputFile::Read(void* bytes, std::size_t count)
{
  stream_.read(static_cast<char*>(bytes), static_cast<std::streamsize>(count));
  const auto got = static_cast<std::size_t>(stream_.gcount());
  position_ = std::min(position_ + got, size_);
  return got;
}

bool InputFile::ReadLine(std::string& line, std::size_t longest)
{
  line.clear();
  const bool isFirst = position_ == 0;
  std::streambuf* buffer = stream_.rdbuf();
  bool any = false;
  for (;;)
  {
    const int c = buffer->sbumpc();
    if (c == std::char_traits<char>::eof())
    {
      break;
    }
    any = true;
    position_ = std::min(position_ + 1, size_);
    if (c == '\n')
    {
      break;
    }
    if (line.size() >= longest)
    {
      throw FormatError(name_ + ": the header has a line longer than " + std::to_string(longest / 1024) +
                        " KiB; this is not a text header");
    }
    line += static_cast<char>(c);
  }
  if (!line.empty() && line.back() == '\r')
  {
    line.pop_back();
  }
  line.erase(0, isFirst && line.rfind("\xef\xbb\xbf", 0) == 0 ? 3 : 0);
  return any;
}

std::string FileBeginning(const std::string& fileName, std::size_t count)
{
  std::error_code error;
  if (!std::filesystem::is_regular_file(fileName, error))
  {
    return {};
  }
  std::ifstream stream(fileName, std::ios::binary);
  std::string beginning(count, '\0');
  stream.read(beginning.data(), static_cast<std::streamsize>(count));
  beginning.resize(static_cast<std::size_t>(std::max<std::streamsize>(stream.gcount(), 0)));
  return beginning;
}

bool HasBefore(const std::string& fileName, std::string_view text, std::string_view end)
{
  constexpr std::size_t kBlock = 1 << 16;
  std::error_code error;
  std::ifstream stream;
  if (std::filesystem::is_regular_file(fileName, error))
  {
    stream.open(fileName, std::ios::binary);
  }
  const std::size_t overlap = std::max(text.size(), end.size()) - 1;  // what two blocks may share
  std::string block;
  while (stream)
  {
    const std::size_t kept = std::min(overlap, block.size());
    block.erase(0, block.size() - kept);
    block.resize(kept + kBlock);
    stream.read(block.data() + kept, kBlock);
    block.resize(kept + static_cast<std::size_t>(std::max<std::streamsize>(stream.gcount(), 0)));
    const std::size_t found = block.find(text), last = block.find(end);
    if (found != std::string::npos || last != std::string::npos)
    {
      return found < last;
    }
  }
  return false;
}

std::string ReadTextFile(const std::string& fileName, std::uint64_t limit)
{
  InputFile file(fileName);
  RequireFormat(file.Size() <= limit, fileName, ": ", file.Size(), " bytes, more than the ", limit,
                " such a file may have");
  std::string text(file.Size(), '\0');
  text.resize(file.Read(text.data(), text.size()));
  return text;
}

std::string CompanionFile(const std::string& owner, const std::string& folder, const std::string& relative)
{
  namespace fs = std::filesystem;
  const auto refuse = [&](const std::string& why) -> FileError
  {
    return FormatError(owner + ": names the file " + Quoted(relative) + ", " + why + "; companion files must lie in " +
                       folder);
  };
  const fs::path name(relative);
  if (relative.empty() || name.is_absolute() || relative.find('\0') != std::string::npos)
  {
    throw refuse("which is not a relative name");
  }
  if (std::find(name.begin(), name.end(), fs::path("..")) != name.end())
  {
    throw refuse("which leads out of its folder");
  }
  std::error_code error;
  const fs::path root = fs::weakly_canonical(folder, error);
  const fs::path real = error ? fs::path() : fs::weakly_canonical(fs::path(folder) / name, error);
  if (error || std::mismatch(root.begin(), root.end(), real.begin(), real.end()).first != root.end())
  {
    throw refuse("which leads out of its folder");
  }
  const std::string path = (fs::path(folder) / name).string();
  Require(FileFault::NotFound, fs::is_regular_file(path, error), owner, ": names the file ", Quoted(relative),
          ", but there is none in ", folder);
  return path;
}

std::string FolderOf(const std::string& fileName)
{
  const std::string folder = std::filesystem::path(fileName).parent_path().string();
  return folder.empty() ? "." : folder;
}

}  // namespace bigus
