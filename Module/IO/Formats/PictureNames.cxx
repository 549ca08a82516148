// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/PictureNames.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include "IO/Formats/HeaderFields.h"
#include "IO/Formats/PngFile.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

namespace fs = std::filesystem;

[[noreturn]] void RefuseCell(const SequenceFile& file, const PictureColumn& column, std::size_t row,
                             const std::string& what)
{
  Refuse(file, "row " + std::to_string(row) + ", column " + Shortened(column.title) + ": " + Quoted(column.cells[row]) +
                   what + ". Rename the column where it holds something else");
}

/// The whole number from 0 on that a cell holds; -1 for another one.
std::int64_t NumberIn(std::string cell)
{
  std::replace(cell.begin(), cell.end(), ',', '.');
  double number = -1;
  return ParseNumber(cell, number) && number >= 0 && number < 2147483648.0 && number == std::floor(number)
             ? static_cast<std::int64_t>(number)
             : -1;
}

/// Of every row; empty unless all have one.
std::vector<std::int64_t> NumbersOfRows(const PictureColumn& column)
{
  std::vector<std::int64_t> numbers;
  for (const std::string& cell : column.cells)
  {
    numbers.push_back(NumberIn(cell));
  }
  const bool areNumbers = std::count(numbers.begin(), numbers.end(), -1) == 0;
  return areNumbers ? numbers : std::vector<std::int64_t>();
}

/// The last number in a picture's name; -1 without one.
std::int64_t NumberOfName(const std::string& path)
{
  const std::string digits = "0123456789", name = fs::path(path).stem().string();
  const std::size_t end = name.find_last_of(digits);
  std::int64_t number = -1;
  if (end != std::string::npos)
  {
    const std::size_t before = name.find_last_not_of(digits, end);
    const std::size_t begin = before == std::string::npos ? 0 : before + 1;
    ParseNumber(std::string_view(name).substr(begin, end - begin + 1), number);
  }
  return number;
}

/// The pattern with its one %d or %0Nd replaced.
std::string ImageName(const SequenceFile& file, const std::string& pattern, std::int64_t number)
{
  const auto percent = pattern.find('%');
  auto end = percent;
  while (end != std::string::npos && ++end < pattern.size() && pattern[end] >= '0' && pattern[end] <= '9')
  {
  }
  std::int64_t digits = 0;
  const std::string width = end == std::string::npos ? "" : pattern.substr(percent + 1, end - percent - 1);
  if (end == std::string::npos || end >= pattern.size() || pattern[end] != 'd' ||
      pattern.find('%', end) != std::string::npos ||
      (!width.empty() && (width[0] != '0' || !ParseNumber(width, digits) || digits > 20)))
  {
    Refuse(file, "image pattern " + Quoted(pattern) + "; one %d or %04d, where the number goes, is expected");
  }
  std::string text = std::to_string(number);
  text.insert(0, text.size() < static_cast<std::size_t>(digits) ? static_cast<std::size_t>(digits) - text.size() : 0,
              '0');
  return pattern.substr(0, percent) + text + pattern.substr(end + 1);
}

/// The pictures that rows count, among those of a folder in their order. Where the numbers all are in the pictures' names
/// they mean these; else they count from 0, or from 1 where there is no 0 and the last picture.
void CountPictures(SequenceFile& file, const PictureColumn& column, const std::vector<std::int64_t>& numbers,
                   const std::vector<std::string>& pictures)
{
  const auto count = static_cast<std::int64_t>(pictures.size());
  std::map<std::int64_t, std::size_t> places;
  for (std::size_t k = 0; k < pictures.size(); ++k)
  {
    places.emplace(NumberOfName(pictures[k]), k);
  }
  const std::string name = file.fileName + ": the numbers of the column " + Shortened(column.title);
  const auto isPlaced = [&places](std::int64_t number) { return places.count(number) > 0; };
  if (places.size() == pictures.size() && std::all_of(numbers.begin(), numbers.end(), isPlaced))
  {
    for (const std::int64_t number : numbers)
    {
      file.images.push_back(pictures[places.at(number)]);
    }
    if (static_cast<std::int64_t>(places.at(numbers[0])) != numbers[0])
    {
      file.notes.push_back(name + " are those of the pictures' names: " + std::to_string(numbers[0]) + " is " +
                           Shortened(fs::path(file.images[0]).filename().string()));
    }
    return;
  }
  const auto [least, largest] = std::minmax_element(numbers.begin(), numbers.end());
  const std::int64_t first = *least > 0 && *largest == count ? 1 : 0;
  if (*least == 1)
  {
    file.notes.push_back(name + " begin with 1 and " + (first == 1 ? "reach " : "do not reach ") +
                         std::to_string(count) + ", the number of pictures, so they were counted from " +
                         std::to_string(first));
  }
  for (std::size_t row = 0; row < numbers.size(); ++row)
  {
    if (numbers[row] - first >= count)
    {
      RefuseCell(file, column, row,
                 " names none of the " + std::to_string(count) +
                     " PNG files, neither by the numbers in their names nor counted from 0");
    }
    file.images.push_back(pictures[static_cast<std::size_t>(numbers[row] - first)]);
  }
}

std::string LastPart(const std::string& name)
{
  return name.substr(name.find_last_of("/\\") + 1);
}

/// The picture of a name in a folder. With and without its ending; of one in other folders, where the user gave this folder,
/// its last part counts.
std::string PictureOfName(const SequenceFile& file, const PictureColumn& column, std::size_t row,
                          const std::string& folder, bool isGiven)
{
  const std::string& name = column.cells[row];
  std::error_code error;
  std::vector<std::string> names = {name, name + ".png"};
  if (isGiven)
  {
    names.insert(names.end(), {LastPart(name), LastPart(name) + ".png"});
  }
  for (const std::string& candidate : names)
  {
    const fs::path path(candidate);
    const bool isInside = !candidate.empty() && candidate.find('\0') == std::string::npos && path.is_relative() &&
                          std::find(path.begin(), path.end(), fs::path("..")) == path.end();
    if (isInside && fs::is_regular_file(fs::path(folder) / path, error))
    {
      return CompanionFile(file.fileName, folder, candidate);
    }
  }
  if (name.empty() || fs::path(name).is_absolute() || name.find("..") != std::string::npos)
  {
    CompanionFile(file.fileName, folder, name);  // says why it is none
  }
  RefuseCell(file, column, row, " names no PNG file in " + folder + "; one of their names is expected");
}

void RequireDifferent(const SequenceFile& file, const PictureColumn& column)
{
  std::set<std::string> seen;
  for (std::size_t row = 0; row < file.images.size(); ++row)
  {
    if (!seen.insert(file.images[row]).second)
    {
      RefuseCell(file, column, row, " names a picture twice: a row before it has the same");
    }
  }
}

/// The names of pictures that a pattern makes of the rows' numbers, or else of 0, 1 and so on.
void TakePattern(SequenceFile& file, const PictureColumn& column, const std::vector<std::int64_t>& numbers,
                 const std::string& folder, const std::string& pattern)
{
  for (std::size_t row = 0; row < file.frames.size(); ++row)
  {
    const std::string name = ImageName(file, pattern, numbers.empty() ? static_cast<std::int64_t>(row) : numbers[row]);
    if (column.mayBeNames && numbers.empty() && LastPart(column.cells[row]) != LastPart(name))
    {
      RefuseCell(file, column, row, ", but the image pattern gives it " + Quoted(name) + "; leave the pattern out");
    }
    file.images.push_back((fs::path(folder) / name).string());
  }
}

}  // namespace

std::string PlainName(const std::string& title)
{
  std::string plain = Lowercase(title);
  plain.erase(std::remove_if(plain.begin(), plain.end(),
                             [](char c) { return !((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')); }),
              plain.end());
  return plain;
}

PictureColumn FindPictureColumn(const std::vector<std::string>& titles)
{
  static const std::vector<std::pair<std::string, bool>> names = {
      {"image", true},       {"file", true},        {"filename", true},     {"picture", true},
      {"frame", false},      {"frameindex", false}, {"framenumber", false}, {"frameid", false},
      {"imageindex", false}, {"index", false},      {"id", false}};
  for (const auto& [name, mayBeNames] : names)
  {
    for (std::size_t column = 0; column < titles.size(); ++column)
    {
      if (PlainName(titles[column]) == name)
      {
        return {titles[column], mayBeNames, column, {}};
      }
    }
  }
  return {};
}

void TakePictures(SequenceFile& file, const PictureColumn& column, const ImageOptions& options)
{
  const std::string folder = options.folder.empty() ? FolderOf(file.fileName) : options.folder;
  const std::vector<std::int64_t> numbers = NumbersOfRows(column);
  const bool isGiven = !options.folder.empty(), isNamed = column.mayBeNames && numbers.empty();
  if (!column.title.empty() && numbers.empty() && !isNamed && (!options.pattern.empty() || (options.wanted && isGiven)))
  {
    const auto wrong = std::find_if(column.cells.begin(), column.cells.end(),
                                    [](const std::string& cell) { return NumberIn(cell) < 0; });
    RefuseCell(file, column, static_cast<std::size_t>(wrong - column.cells.begin()),
               "; a frame's number, counted from 0, is expected");
  }
  if (!options.pattern.empty())
  {
    TakePattern(file, column, numbers, folder, options.pattern);
  }
  else if (isNamed)
  {
    for (std::size_t row = 0; row < column.cells.size(); ++row)
    {
      file.images.push_back(PictureOfName(file, column, row, folder, isGiven));
    }
  }
  else if (!numbers.empty() && options.wanted && (isGiven || column.mayBeNames))
  {
    CountPictures(file, column, numbers, PngFilesOf(folder));
  }
  else if (options.wanted && isGiven)
  {
    file.images = PngFilesOf(folder);
    RequireHeader(file, file.images.size() == file.frames.size(), "has ", file.frames.size(), " poses, but ", folder,
                  " has ", file.images.size(), " PNG files. A column image can say which belongs to a row");
  }
  else if (options.wanted)
  {
    Refuse(file, "has no column image; add one, or give an image folder or pattern");
  }
  if (options.wanted && !column.title.empty())
  {
    RequireDifferent(file, column);
  }
}

}  // namespace bigus
