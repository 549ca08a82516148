// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Paths, and writing so that a file is either whole or not there.
#pragma once

#include <functional>
#include <ostream>
#include <string>
#include <vector>

namespace bigus::command
{

/// Whether `path` ends in `suffix` (such as ".igs.mha"), upper or lower case.
bool HasSuffix(const std::string& path, const std::string& suffix);

/// Throws OutputError unless a file can be made at `path`. Nothing is left behind, and a file that is there
/// stays. Asked before long work, so that an hour of training does not end at a missing folder.
void RequireWritable(const std::string& path);

/// Throws OutputError when an output is the same file as an input or as another output, through whatever path
/// or link. Empty paths stand for options not given.
void RequireDistinct(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

/// `write` fills a temporary file in the same folder, which then takes the name `path`. On failure the
/// temporary file is removed and OutputError thrown.
void WriteAtomically(const std::string& path, const std::function<void(std::ostream&)>& write);
/// The same for many files, `write` being told which one it fills. They take their names when all are complete, so that
/// a full disk or an interrupt leaves none of them, and a name that cannot be given takes those before it back.
void WriteTogether(const std::vector<std::string>& paths, const std::function<void(std::size_t, std::ostream&)>& write);

/// "slice.png" and 7 of 120 to "slice_007.png": one name a frame, as wide as the last number.
std::string NumberedPath(const std::string& path, int number, int count);

}  // namespace bigus::command
