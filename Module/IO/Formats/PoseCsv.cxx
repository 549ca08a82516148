// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/PoseCsv.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "Core/Numerics/Format.h"
#include "Core/Numerics/Statistics.h"
#include "IO/FileError.h"
#include "IO/Formats/HeaderFields.h"
#include "IO/Formats/PngFile.h"
#include "IO/Formats/SequenceHeaders.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::size_t kMostCsvColumns = 1000;

// One line's cells. Cells may be quoted with ", "" inside standing for one; they cannot contain line ends.
std::vector<std::string> CsvCells(const std::string& fileName, const std::string& line, char separator)
{
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i)
  {
    const char c = line[i];
    if (quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"')
    {
      cells.back() += '"';
      ++i;
    }
    else if (c == '"')
    {
      quoted = !quoted;
    }
    else if (c == separator && !quoted)
    {
      RequireFormat(cells.size() < kMostCsvColumns, fileName, ": has more than ", kMostCsvColumns, " columns");
      cells.emplace_back();
    }
    else
    {
      cells.back() += c;
    }
  }
  if (quoted)
  {
    throw FormatError(fileName + ": line " + Quoted(line) + " has a quote that does not end");
  }
  for (std::string& cell : cells)
  {
    cell = std::string(Trimmed(cell));
  }
  return cells;
}

/// A column's name as it is compared: letters and digits, in lower case.
std::string Plain(const std::string& name)
{
  std::string plain = Lowercase(name);
  plain.erase(std::remove_if(plain.begin(), plain.end(),
                             [](char c) { return !((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')); }),
              plain.end());
  return plain;
}

// The same words as in Python's sources.py.
bool IsSound(const std::string& cell)
{
  static const std::set<std::string> words = {"ok", "valid", "good", "tracked", "visible", "true", "yes", "1"};
  return words.count(Lowercase(cell)) > 0;
}

/// Whether a column says by 1 or 0 if there is a pose.
bool IsFlag(const std::string& plainName)
{
  const std::string name = plainName.substr(plainName.rfind("is", 0) == 0 ? 2 : 0);
  return name == "valid" || name == "tracked" || name == "visible" || name == "ok";
}

/// Seconds of a unit that follows the name of a column of times; 0 where nothing follows, nothing for another name.
std::optional<double> TimeUnitOf(const std::string& plainName)
{
  static const std::map<std::string, double> units = {
      {"", 0},      {"s", 1},       {"sec", 1},      {"secs", 1},      {"seconds", 1},
      {"ms", 1e-3}, {"msec", 1e-3}, {"msecs", 1e-3}, {"millis", 1e-3}, {"milliseconds", 1e-3},
      {"us", 1e-6}, {"usec", 1e-6}, {"usecs", 1e-6}, {"micros", 1e-6}, {"microseconds", 1e-6},
      {"ns", 1e-9}, {"nsec", 1e-9}, {"nsecs", 1e-9}, {"nanos", 1e-9},  {"nanoseconds", 1e-9}};
  for (const std::string name : {"timestamps", "timestamp", "times", "time", "ts", "t", "stamps", "stamp"})
  {
    const auto unit = plainName.rfind(name, 0) == 0 ? units.find(plainName.substr(name.size())) : units.end();
    if (unit != units.end())
    {
      return unit->second;
    }
  }
  return std::nullopt;
}

constexpr double kShortestStep = 2e-4, kLongestStep = 10;  // s between the poses of a tracker, on the median

/// Seconds of the unit in which a tracker may have such a rate; 1 where there is none, or nothing to tell it by.
double UnitByRate(std::vector<double> times, double& step)
{
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  std::adjacent_difference(times.begin(), times.end(), times.begin());
  if (times.size() < 2)
  {
    return 1;
  }
  std::sort(times.begin() + 1, times.end());
  step = Quantile({times.begin() + 1, times.end()}, 0.5);
  for (const double unit : {1.0, 1e-3, 1e-6, 1e-9})
  {
    if (kShortestStep <= unit * step && unit * step <= kLongestStep)
    {
      return unit;
    }
  }
  return 1;
}

std::string NameOfUnit(double unit)
{
  return unit == 1e-3 ? "milliseconds" : unit == 1e-6 ? "microseconds" : "nanoseconds";
}

/// Times of a column that does not say its unit become seconds.
void TakeTimesByRate(SequenceFile& file)
{
  std::vector<double> times;
  double time = 0, step = 0;
  for (const Fields& fields : file.frames)
  {
    if (const std::string* text = Find(fields, "Timestamp"); text && ParseNumber(*text, time) && std::isfinite(time))
    {
      times.push_back(time);
    }
  }
  const double unit = UnitByRate(times, step);
  for (Fields& fields : file.frames)
  {
    if (const auto text = fields.find("Timestamp");
        unit != 1 && text != fields.end() && ParseNumber(text->second, time))
    {
      text->second = ExactNumber(unit * time);
    }
  }
  if (unit != 1)
  {
    file.timesNote = file.fileName + ": the times are taken for " + NameOfUnit(unit) + ", because they are " +
                     Format("%.4g", step) + " apart";
  }
}

std::string WithPoint(std::string number)
{
  std::replace(number.begin(), number.end(), ',', '.');
  return number;
}

// The pattern with its one %d or %0Nd replaced.
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

/// Finds the pictures of all rows. `named` are those that the rows name.
void SetImages(SequenceFile& file, const PoseCsv& table, const std::vector<std::string>& named,
               const ImageOptions& options)
{
  const std::string folder = options.folder.empty() ? FolderOf(file.fileName) : options.folder;
  if (!options.pattern.empty())
  {
    for (int frame = 0; frame < file.numberOfFrames; ++frame)
    {
      file.images.push_back((std::filesystem::path(folder) / ImageName(file, options.pattern, frame)).string());
    }
  }
  else if (table.HasColumn("image"))
  {
    for (const std::string& name : named)
    {
      file.images.push_back(CompanionFile(file.fileName, folder, name));
    }
  }
  else if (options.wanted && !options.folder.empty())
  {
    file.images = PngFilesOf(folder);
    RequireHeader(file, file.images.size() == file.frames.size(), "has ", file.frames.size(), " poses, but ", folder,
                  " has ", file.images.size(), " PNG files");
  }
  else if (options.wanted)
  {
    Refuse(file, "has no column image; add one, or give an image folder or pattern");
  }
}

/// Takes size and type of the first picture and refuses others. Those of frames without a sound pose are not shown, and
/// may be missing.
void TakeSize(SequenceFile& file)
{
  const PngHeader first = ReadPngHeader(file.images[0]);
  file.width = first.width;
  file.height = first.height;
  file.elementType = first.elementType;
  file.channels = first.channels;
  for (std::size_t row = 1; row < file.images.size(); ++row)
  {
    if (file.frames[row].at("ImageToReferenceTransformStatus") == "OK")
    {
      RequirePng(file.images[row], first);
    }
  }
}

}  // namespace

bool LooksLikePoseCsv(const std::string& beginning)
{
  std::string_view rest = beginning;
  while (!rest.empty() && PoseCsv::IsBeforeHeader(rest.substr(0, rest.find('\n'))))
  {
    rest.remove_prefix(std::min(rest.find('\n'), rest.size() - 1) + 1);
  }
  const std::string line = Lowercase(rest.substr(0, rest.find_first_of("\r\n")));
  return line.find("m00") != std::string::npos && line.find_first_of(",;\t") != std::string::npos;
}

PoseCsv::PoseCsv(const std::string& fileName, std::string header) : fileName_(fileName)
{
  if (header.rfind("\xef\xbb\xbf", 0) == 0)
  {
    header.erase(0, 3);  // a byte order mark
  }
  header.erase(0, IsComment(header) ? 1 : 0);
  for (const char mark : {';', '\t'})
  {
    separator_ = header.find(mark) == std::string::npos ? separator_ : mark;
  }
  names_ = CsvCells(fileName_, header, separator_);
  for (std::size_t i = 0; i < names_.size(); ++i)
  {
    columns_.emplace(Lowercase(names_[i]), i);
    const std::optional<double> unit = TimeUnitOf(Plain(names_[i]));
    if (unit && (time_ == kNone || Lowercase(names_[i]) == "timestamp"))
    {
      time_ = i;
      timeUnit_ = *unit;
    }
  }
  const bool lastRow = HasColumn("m30") || HasColumn("m31") || HasColumn("m32") || HasColumn("m33");
  for (int i = 0; i < (lastRow ? 16 : 12); ++i)
  {
    const std::string name = "m" + std::to_string(i / 4) + std::to_string(i % 4);
    const auto found = columns_.find(name);
    RequireFormat(found != columns_.end(), fileName_, ": has no column ", name,
                  "; a pose takes m00 to m33, or m00 to m23 without the last row");
    matrix_.push_back(found->second);
  }
}

bool PoseCsv::IsBeforeHeader(std::string_view line)
{
  line = line.substr(line.substr(0, 3) == "\xef\xbb\xbf" ? 3 : 0);  // a byte order mark
  const std::string text = Lowercase(Trimmed(line));
  const bool isHeader =
      text.find("m00") != std::string::npos && text.find("m23") != std::string::npos;  // numpy's has a #
  return text.empty() || (text[0] == '#' && !isHeader) || text.rfind("sep=", 0) == 0;
}

PoseCsv::Row PoseCsv::Parse(const std::string& line, std::size_t number) const
{
  Row row;
  row.cells = CsvCells(fileName_, line, separator_);
  RequireFormat(row.cells.size() == names_.size(), fileName_, ": row ", number, " has ", row.cells.size(),
                " cells, the header ", names_.size());
  const auto cell = [&](const char* name) -> const std::string*
  {
    const auto found = columns_.find(name);
    return found == columns_.end() ? nullptr : &row.cells[found->second];
  };
  std::string& pose = row.fields["ImageToReferenceTransform"];
  for (const std::size_t column : matrix_)
  {
    pose += WithPoint(row.cells[column]) + " ";
  }
  if (matrix_.size() == 12)
  {
    pose += "0 0 0 1";
  }
  row.fields["ImageToReferenceTransformStatus"] = StatusOf(row.cells, number);
  if (time_ != kNone)
  {
    std::string& text = row.fields["Timestamp"] = WithPoint(row.cells[time_]);
    if (double time = 0; timeUnit_ != 0 && timeUnit_ != 1 && ParseNumber(text, time))
    {
      text = ExactNumber(timeUnit_ * time);
    }
  }
  for (int side = 0; side < 2; ++side)
  {
    const char* const name = side == 0 ? "width" : "height";
    const std::string* text = cell(name);
    std::int64_t pixels = 0;
    if (text && (!ParseNumber(*text, pixels) || pixels < 1 || pixels > largestSide))
    {
      throw FormatError(fileName_ + ": row " + std::to_string(number) + " has " + name + " " + Quoted(*text) +
                        "; 1 to " + std::to_string(largestSide) + " pixels are expected");
    }
    row.size[static_cast<std::size_t>(side)] = static_cast<int>(pixels);
  }
  const std::string* image = cell("image");
  row.image = image ? *image : "";
  return row;
}

std::string PoseCsv::StatusOf(const std::vector<std::string>& cells, std::size_t number) const
{
  for (std::size_t column = 0; column < names_.size(); ++column)
  {
    const std::string name = Plain(names_[column]), &cell = cells[column];
    const bool isStatus = name == "status";
    if (!isStatus && !IsFlag(name))
    {
      continue;
    }
    const bool isNumber = !cell.empty() && cell.find_first_not_of("+-.0123456789") == std::string::npos;
    if (isNumber && (isStatus || (cell != "0" && cell != "1")))
    {
      throw FormatError(
          fileName_ + ": row " + std::to_string(number) + ", column " + names_[column] + ": " + Quoted(cell) +
          (isStatus ? "; a word is expected, OK where there is a pose: numbers mean one thing or the other. "
                      "Call the column valid where 1 means so"
                    : "; 0 or 1 is expected"));
    }
    if (!IsSound(cell))
    {
      return isStatus ? cell : name + " " + cell;
    }
  }
  return "OK";
}

std::vector<std::pair<std::string, std::string>> PoseCsv::OtherColumns(const Row& row) const
{
  std::vector<std::pair<std::string, std::string>> others;
  for (std::size_t column = 0; column < names_.size(); ++column)
  {
    const std::string name = Lowercase(names_[column]);
    const bool isRead = std::count(matrix_.begin(), matrix_.end(), column) > 0 || name == "image" || name == "width" ||
                        name == "height";
    const bool isSaid = column == time_ || Plain(name) == "status" || IsFlag(Plain(name));
    if (!isSaid && (!isRead || columns_.at(name) != column))
    {
      others.emplace_back(names_[column], row.cells[column]);
    }
  }
  return others;
}

void ReadPoseCsv(SequenceFile& file, InputFile& input, const ImageOptions& options)
{
  file.format = "CSV of poses";
  file.orientation = "MF";
  file.encoding = Encoding::Png;

  std::string line;
  while (input.ReadLine(line) && PoseCsv::IsBeforeHeader(line))
  {
    if (const auto comment = line.find('#'); comment != std::string::npos)
    {
      file.comments.emplace_back(Trimmed(std::string_view(line).substr(comment + 1)));
    }
  }
  const PoseCsv table(file.fileName, line);
  std::vector<std::string> named;
  while (input.ReadLine(line))
  {
    if (PoseCsv::IsComment(line))
    {
      file.comments.emplace_back(Trimmed(std::string_view(line).substr(1)));
      continue;
    }
    if (Trimmed(line).empty())
    {
      continue;
    }
    const std::size_t number = file.frames.size();
    PoseCsv::Row row = table.Parse(line, number);
    if (number == 0)
    {
      file.otherColumns = table.OtherColumns(row);
    }
    RequireHeader(file, static_cast<std::int64_t>(number) < mostFrames && input.Position() <= longestHeader,
                  "has more than ", mostFrames, " rows or 256 MiB");
    file.sizes.push_back(row.size);
    named.push_back(std::move(row.image));
    file.frames.push_back(std::move(row.fields));
  }
  Require(FileFault::Truncated, !file.frames.empty(), file.fileName, ": has a header line but no poses");
  file.numberOfFrames = static_cast<int>(file.frames.size());
  if (table.TimeUnit() == 0)
  {
    TakeTimesByRate(file);
  }

  SetImages(file, table, named, options);
  if (options.wanted)
  {
    TakeSize(file);
  }
  else if (!file.images.empty() && !table.HasColumn("width") && !table.HasColumn("height"))
  {
    for (std::size_t row = 0; row < file.images.size(); ++row)
    {
      const PngHeader header = ReadPngHeader(file.images[row]);
      file.sizes[row] = {header.width, header.height};
    }
  }
}

}  // namespace bigus
