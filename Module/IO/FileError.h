// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What is wrong with a file, and which of VTK's error codes says so.
#pragma once

#include <new>
#include <string>

#include "Core/Model/Error.h"
#include "vtkErrorCode.h"

namespace bigus
{

class FileError : public Error
{
public:
  FileError(unsigned long code, const std::string& message) : Error(message), code_(code) {}

  /// One of vtkErrorCode::ErrorIds.
  unsigned long Code() const { return code_; }

private:
  unsigned long code_;
};

/// The file holds something it should not.
inline FileError FormatError(const std::string& message)
{
  return FileError(vtkErrorCode::FileFormatError, message);
}

/// The file ends too early.
inline FileError TruncationError(const std::string& message)
{
  return FileError(vtkErrorCode::PrematureEndOfFileError, message);
}

/// The code and the text to report an exception by, whatever it is.
inline unsigned long ErrorCodeOf(const std::exception& error)
{
  if (const auto* fileError = dynamic_cast<const FileError*>(&error))
  {
    return fileError->Code();
  }
  const bool unsound = dynamic_cast<const Error*>(&error);  // what the file holds is no sweep and no field
  return unsound ? vtkErrorCode::FileFormatError : vtkErrorCode::UnknownError;
}

inline std::string MessageOf(const std::exception& error)
{
  return dynamic_cast<const std::bad_alloc*>(&error) ? "there is not enough memory for what the file holds"
                                                     : error.what();
}

}  // namespace bigus
