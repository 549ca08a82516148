// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Which of VTK's error codes says what is wrong with a file.
#pragma once

#include "IO/FileError.h"
#include "vtkErrorCode.h"

namespace bigus
{

/// The code to report an exception by, whatever it is.
inline unsigned long ErrorCodeOf(const std::exception& error)
{
  if (const auto* fileError = dynamic_cast<const FileError*>(&error))
  {
    switch (fileError->Fault())
    {
      case FileFault::NotFound:
        return vtkErrorCode::FileNotFoundError;
      case FileFault::CannotOpen:
        return vtkErrorCode::CannotOpenFileError;
      case FileFault::Unrecognized:
        return vtkErrorCode::UnrecognizedFileTypeError;
      case FileFault::Truncated:
        return vtkErrorCode::PrematureEndOfFileError;
      case FileFault::Format:
        return vtkErrorCode::FileFormatError;
      case FileFault::NoName:
        return vtkErrorCode::NoFileNameError;
      case FileFault::DiskFull:
        return vtkErrorCode::OutOfDiskSpaceError;
      case FileFault::User:
        return vtkErrorCode::UserError;
      case FileFault::Unknown:
        break;
    }
    return vtkErrorCode::UnknownError;
  }
  const bool unsound = dynamic_cast<const Error*>(&error);  // what the file holds is no sweep and no field
  return unsound ? vtkErrorCode::FileFormatError : vtkErrorCode::UnknownError;
}

}  // namespace bigus
