// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Which picture a row of a table belongs to, by the names or numbers in it. README.md has the rule; the same as in Python's
// sources.py.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "IO/SequenceFile.h"

namespace bigus
{

/// The column of a table that says which picture a row belongs to.
struct PictureColumn
{
  std::string title;               ///< as the file has it; empty: there is no such column
  bool mayBeNames = false;         ///< of files; else its cells are numbers
  std::size_t column = 0;          ///< where it stands
  std::vector<std::string> cells;  ///< [rows]
};

/// The first of the names that is there, with its place and without cells.
PictureColumn FindPictureColumn(const std::vector<std::string>& titles);

/// A column's name as it is compared: letters and digits, in lower case.
std::string PlainName(const std::string& title);

/// Fills the file's images where pictures are given or named, and says in its notes how numbers were taken. Throws FileError
/// that names row, column and cell.
void TakePictures(SequenceFile& file, const PictureColumn& column, const ImageOptions& options);

}  // namespace bigus
