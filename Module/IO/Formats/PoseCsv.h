// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Rows of a CSV of poses, one at a time, so that a table can be followed while it grows. README.md lists the columns.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "IO/Formats/PictureNames.h"
#include "IO/SequenceFile.h"

namespace bigus
{

class PoseCsv
{
public:
  struct Row
  {
    Fields fields;  ///< the pose ImageToReference, its status and Timestamp, as a sequence names them
    std::array<int, 2> size = {0, 0};  ///< width and height where stated, else 0
    std::string image;                 ///< which picture it belongs to; empty where no column says so
    std::vector<std::string> cells;    ///< all of them
  };

  /// From the first line. Throws FileError, which names the file, when a column of the pose is missing.
  PoseCsv(const std::string& fileName, std::string header);

  /// Whether a line may come before the header: blank, a comment, or a spreadsheet's note of its separator.
  static bool IsBeforeHeader(std::string_view line);

  /// Whether a line that is not blank holds no row.
  static bool IsComment(const std::string& line);

  /// Whether a line, which may be the first below the header, holds units and no pose.
  bool HoldsUnits(const std::string& line) const;

  /// Whether a line, which may be a comment, has as many cells as rows.
  bool LooksLikeRow(const std::string& line) const;

  /// Throws FileError for a line that is no row of this table. `number` counts rows from 0.
  Row Parse(const std::string& line, std::size_t number) const;

  bool HasColumn(const std::string& name) const { return columns_.count(name) != 0; }
  bool HasTimes() const { return time_ != kNone; }

  /// The column, without cells, that says which picture a row belongs to.
  const PictureColumn& Pictures() const { return pictures_; }

  /// Seconds of the unit that the column of times names, in which rows have them; 0 where it names none.
  double TimeUnit() const { return timeUnit_; }

  /// Names and cells of the columns that nothing is read from.
  std::vector<std::pair<std::string, std::string>> OtherColumns(const Row& row) const;

private:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  /// "OK", or what the row says of its pose.
  std::string StatusOf(const std::vector<std::string>& cells, std::size_t number) const;

  std::string fileName_;
  char separator_ = ',';  // or ; or a tab, beside which a comma is one of decimals
  std::vector<std::string> names_;
  std::map<std::string, std::size_t> columns_;  // by lower-case name; of two of one name the first
  std::vector<std::size_t> matrix_;             // columns of the pose, 12 or 16
  PictureColumn pictures_;
  std::size_t time_ = kNone;  // column of times
  double timeUnit_ = 1;
};

}  // namespace bigus
