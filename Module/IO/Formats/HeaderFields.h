// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the text headers of tracked sequences share, whichever format they are in.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "Core/Model/Error.h"
#include "IO/SequenceFile.h"

namespace bigus
{

/// A text header longer than this, bytes, is refused: a million frames have 256 bytes each.
constexpr std::uint64_t longestHeader = 256u << 20;

/// Throws FileError: the file's name, then `message`.
[[noreturn]] void Refuse(const SequenceFile& file, const std::string& message);

/// Refuses the file unless `holds`, as Require of Core/Model/Error.h does.
template <class... Parts>
void RequireHeader(const SequenceFile& file, bool holds, const Parts&... message)
{
  if (!holds)
  {
    Refuse(file, MessageText(message...));
  }
}

/// Whether a status says that there is a pose, or a picture. The same words as in Python's sources.py.
bool IsSound(const std::string& status);

/// The field of that name; null when there is none.
const std::string* Find(const Fields& fields, const std::string& name);

/// The field of that name. Throws FileError when there is none.
const std::string& Require(const SequenceFile& file, const Fields& fields, const std::string& name);

/// The whole numbers, from 1 on, in a field. Throws FileError.
std::vector<std::int64_t> RequireSizes(const SequenceFile& file, const std::string& name, const std::string& text);

/// Takes as many channels as a pixel has: 1 for grey, 3 or 4 for colours. Throws FileError for another number, and unless
/// colours are of unsigned char.
void SetChannels(SequenceFile& file, std::int64_t channels);

/// Sets width, height and frames. Throws FileError when there are too many.
void SetSizes(SequenceFile& file, std::int64_t width, std::int64_t height, std::int64_t frames);

/// Takes the size of a pixel that a field states, unless it is none.
void SetSpacing(SequenceFile& file, const std::string& field, double i, double j);

/// Fields as they come: one of a frame (Seq_Frame0012_Name) goes to that frame, any other to the file.
class FieldCollector
{
public:
  /// Throws FileError when the name begins like one of a frame and is none.
  void Add(const SequenceFile& file, std::string_view key, std::string_view value);

  /// Moves the fields of frames into the file, whose number of frames is known. Throws FileError when they do not fit.
  void MoveInto(SequenceFile& file);

  Fields fields;

private:
  std::map<std::int64_t, Fields> perFrame_;
};

/// What is left to do when a header has been understood: checks that the data can hold the pixels it claims and that
/// they are B-mode, and takes the orientation and the fields of frames over. Throws FileError.
void FinishHeader(SequenceFile& file, FieldCollector& collected);

}  // namespace bigus
