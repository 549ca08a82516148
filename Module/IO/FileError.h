// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What is wrong with a file.
#pragma once

#include <new>
#include <string>

#include "Core/Model/Error.h"

namespace bigus
{

enum class FileFault
{
  NotFound,      ///< there is no such file
  CannotOpen,    ///< for reading or writing
  Unrecognized,  ///< a file of a kind that is not read or written
  Truncated,     ///< it ends too early
  Format,        ///< it holds something it should not
  NoName,        ///< no name was given
  DiskFull,      ///< writing failed
  User,          ///< what the caller asked for will not do
  Unknown
};

class FileError : public Error
{
public:
  FileError(FileFault fault, const std::string& message) : Error(message), fault_(fault) {}

  FileFault Fault() const { return fault_; }

private:
  FileFault fault_;
};

/// The file holds something it should not.
inline FileError FormatError(const std::string& message)
{
  return FileError(FileFault::Format, message);
}

/// The file ends too early.
inline FileError TruncationError(const std::string& message)
{
  return FileError(FileFault::Truncated, message);
}

/// Throws FileError unless `holds`, as Require of Core/Model/Error.h does.
template <class... Parts>
void Require(FileFault fault, bool holds, const Parts&... message)
{
  if (!holds)
  {
    throw FileError(fault, MessageText(message...));
  }
}

/// The same for a file that holds something it should not.
template <class... Parts>
void RequireFormat(bool holds, const Parts&... message)
{
  Require(FileFault::Format, holds, message...);
}

/// The text to report an exception by, whatever it is.
inline std::string MessageOf(const std::exception& error)
{
  return dynamic_cast<const std::bad_alloc*>(&error) ? "there is not enough memory for what the file holds"
                                                     : error.what();
}

}  // namespace bigus
