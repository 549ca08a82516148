// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/PoseCsv.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <utility>

#include "Core/Numerics/Format.h"
#include "IO/FileError.h"
#include "IO/Formats/HeaderFields.h"
#include "IO/Formats/PngFile.h"
#include "IO/Formats/SequenceHeaders.h"
#include "IO/SequenceTimes.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::size_t kMostCsvColumns = 1000;
constexpr int kMostTitles = 20;  // lines before the names of the columns that are neither blank nor comments

/// Whether a line names a pose's columns. The first line that may does so by one of them, to be told what it lacks.
bool NamesPose(std::string_view line, bool isFirst)
{
  const std::string names = Lowercase(line);
  return names.find("m00") != std::string::npos && (isFirst || names.find("m23") != std::string::npos) &&
         names.find_first_of(",;\t") != std::string::npos;
}

/// Whether a line begins with what a spreadsheet writes where it has no number.
bool BeginsWithNoNumber(std::string_view line)
{
  const std::string beginning = Lowercase(line.substr(0, 8));
  const auto isIt = [&beginning](const char* word) { return beginning.rfind(word, 0) == 0; };
  return isIt("#n/a") || isIt("#num!") || isIt("#value!") || isIt("#ref!") || isIt("#div/0!") || isIt("#null!") ||
         isIt("#name?");
}

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

/// Whether a column says by 1 or 0 if there is a pose.
bool IsFlag(const std::string& plainName)
{
  const std::string name = plainName.substr(plainName.rfind("is", 0) == 0 ? 2 : 0);
  return name == "valid" || name == "tracked" || name == "visible" || name == "ok";
}

/// Seconds of a unit that follows the name of a column of times; 0 where nothing follows, nothing for another name.
std::optional<double> TimeUnitOf(const std::string& plainName)
{
  for (const std::string name : {"timestamps", "timestamp", "times", "time", "ts", "t", "stamps", "stamp"})
  {
    const auto unit = plainName.rfind(name, 0) == 0 ? UnitOfTime(plainName.substr(name.size())) : std::nullopt;
    if (unit)
    {
      return unit;
    }
  }
  return std::nullopt;
}

std::string WithPoint(std::string number)
{
  std::replace(number.begin(), number.end(), ',', '.');
  return number;
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

/// Without times nothing but the pictures says in which order rows come.
void OrderByPicture(SequenceFile& file)
{
  std::vector<std::size_t> order(file.frames.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(),
                   [&file](std::size_t a, std::size_t b) { return InNaturalOrder(file.images[a], file.images[b]); });
  const auto take = [&order](auto& values)
  {
    auto ordered = values;
    for (std::size_t k = 0; k < order.size(); ++k)
    {
      ordered[k] = std::move(values[order[k]]);
    }
    values = std::move(ordered);
  };
  take(file.frames);
  take(file.images);
  take(file.sizes);
}

/// The line of the columns' names. Lines before it are comments or titles.
std::string HeaderLine(SequenceFile& file, InputFile& input)
{
  std::string line;
  int titles = 0;
  for (int number = 1; input.ReadLine(line); ++number)
  {
    const auto comment = line.find('#');
    if (PoseCsv::IsBeforeHeader(line))
    {
      if (comment != std::string::npos)
      {
        file.comments.emplace_back(Trimmed(std::string_view(line).substr(comment + 1)));
      }
      continue;
    }
    if (NamesPose(line, titles == 0))
    {
      break;
    }
    ++titles;
    file.comments.emplace_back(Trimmed(line));
    file.notes.push_back(file.fileName + ": line " + std::to_string(number) +
                         " stands before the names of the columns and was skipped: " + Quoted(Trimmed(line)));
  }
  return line;
}

/// The rows, and what each says of its picture. Comments and units among them are said.
void ReadRows(SequenceFile& file, InputFile& input, const PoseCsv& table, std::vector<std::string>& pictureCells)
{
  int skipped = 0;  // comments that look like rows
  for (std::string line; input.ReadLine(line);)
  {
    const std::size_t number = file.frames.size();
    const bool isUnits = number == 0 && !Trimmed(line).empty() && !PoseCsv::IsComment(line) && table.HoldsUnits(line);
    if (PoseCsv::IsComment(line) || isUnits)
    {
      skipped += !isUnits && table.LooksLikeRow(line);
      file.comments.emplace_back(Trimmed(std::string_view(line).substr(isUnits ? 0 : 1)));
    }
    if (isUnits)
    {
      file.notes.push_back(file.fileName +
                           ": the line below the names of the columns holds units and no pose, and was skipped");
    }
    if (isUnits || PoseCsv::IsComment(line) || Trimmed(line).empty())
    {
      continue;
    }
    PoseCsv::Row row = table.Parse(line, number);
    if (number == 0)
    {
      file.otherColumns = table.OtherColumns(row);
    }
    RequireHeader(file, static_cast<std::int64_t>(number) < mostFrames && input.Position() <= longestHeader,
                  "has more than ", mostFrames, " rows or 256 MiB");
    file.sizes.push_back(row.size);
    pictureCells.push_back(std::move(row.image));
    file.frames.push_back(std::move(row.fields));
  }
  Require(FileFault::Truncated, !file.frames.empty(), file.fileName, ": has a header line but no poses");
  if (skipped > 0)
  {
    file.notes.push_back(file.fileName + ": " + std::to_string(skipped) +
                         " lines that have as many cells as rows begin with # and were skipped as comments");
  }
}

}  // namespace

bool LooksLikePoseCsv(const std::string& beginning)
{
  std::string_view rest = beginning;
  for (int titles = 0; !rest.empty() && titles <= kMostTitles;)
  {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    if (!PoseCsv::IsBeforeHeader(line))
    {
      if (NamesPose(line, titles == 0))
      {
        return true;
      }
      ++titles;
    }
    rest.remove_prefix(std::min(line.size() + 1, rest.size()));
  }
  return false;
}

PoseCsv::PoseCsv(const std::string& fileName, std::string header) : fileName_(fileName)
{
  header = WithoutMark(std::move(header));
  header.erase(0, IsComment(header) ? 1 : 0);
  for (const char mark : {';', '\t'})
  {
    separator_ = header.find(mark) == std::string::npos ? separator_ : mark;
  }
  names_ = CsvCells(fileName_, header, separator_);
  for (std::size_t i = 0; i < names_.size(); ++i)
  {
    columns_.emplace(Lowercase(names_[i]), i);
    const std::optional<double> unit = TimeUnitOf(PlainName(names_[i]));
    if (unit && (time_ == kNone || Lowercase(names_[i]) == "timestamp"))
    {
      time_ = i;
      timeUnit_ = *unit;
    }
  }
  pictures_ = FindPictureColumn(names_);
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
  const std::string text = Lowercase(Trimmed(WithoutMark(std::string(line))));
  const bool isHeader =
      text.find("m00") != std::string::npos && text.find("m23") != std::string::npos;  // numpy's has a #
  return text.empty() || (text[0] == '#' && !isHeader) || text.rfind("sep=", 0) == 0;
}

bool PoseCsv::IsComment(const std::string& line)
{
  return !line.empty() && line[0] == '#' && !BeginsWithNoNumber(line);
}

bool PoseCsv::HoldsUnits(const std::string& line) const
{
  static const std::set<std::string> units = {"um",  "mm",     "cm",      "m",     "deg",   "degree",  "degrees",
                                              "rad", "radian", "radians", "s",     "sec",   "seconds", "ms",
                                              "us",  "ns",     "px",      "pixel", "pixels"};
  static const std::set<std::string> nothing = {"", "-", "--", "?", "na", "n/a", "none"};
  int found = 0;
  for (const std::string& cell : CsvCells(fileName_, line, separator_))
  {
    const std::size_t begin = std::min(cell.find_first_not_of("()[] "), cell.size());
    const std::string word = Lowercase(cell.substr(begin, cell.find_last_not_of("()[] ") + 1 - begin));
    found += units.count(word) > 0;
    if (units.count(word) + nothing.count(word) == 0)
    {
      return false;
    }
  }
  return found > 0;
}

bool PoseCsv::LooksLikeRow(const std::string& line) const
{
  return names_.size() > 1 &&
         static_cast<std::size_t>(std::count(line.begin(), line.end(), separator_)) == names_.size() - 1;
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
  row.image = pictures_.title.empty() ? "" : row.cells[pictures_.column];
  return row;
}

std::string PoseCsv::StatusOf(const std::vector<std::string>& cells, std::size_t number) const
{
  for (std::size_t column = 0; column < names_.size(); ++column)
  {
    const std::string name = PlainName(names_[column]), &cell = cells[column];
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
    const bool isRead = std::count(matrix_.begin(), matrix_.end(), column) > 0 || name == "width" || name == "height";
    const bool isPicture = !pictures_.title.empty() && column == pictures_.column;
    const bool isSaid = isPicture || column == time_ || PlainName(name) == "status" || IsFlag(PlainName(name));
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

  const PoseCsv table(file.fileName, HeaderLine(file, input));
  PictureColumn pictures = table.Pictures();
  ReadRows(file, input, table, pictures.cells);
  file.numberOfFrames = static_cast<int>(file.frames.size());
  file.timeUnit = table.TimeUnit() == 0 ? 0 : 1;  // rows with a unit are seconds

  TakePictures(file, pictures, options);
  if (options.wanted && !pictures.title.empty() && !table.HasTimes())
  {
    OrderByPicture(file);
  }
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
