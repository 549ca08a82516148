// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/AtomicFile.h"

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "IO/FileError.h"

namespace bigus
{

AtomicFile::AtomicFile(const std::string& fileName) : fileName_(fileName)
{
  // The name is unique among the writers of this process and, by the clock, very likely among all; opening in
  // mode "x" refuses it should it exist after all.
  static std::atomic<unsigned> counter{0};
  const auto clock = std::chrono::steady_clock::now().time_since_epoch().count();
  for (int attempt = 0; attempt < 10 && !file_; ++attempt)
  {
    temporaryName_ = fileName + ".part-" + std::to_string(clock) + "-" + std::to_string(counter++);
    file_ = std::fopen(temporaryName_.c_str(), "wbx");
    if (!file_ && errno != EEXIST)
    {
      break;
    }
  }
  if (!file_)
  {
    throw FileError(vtkErrorCode::CannotOpenFileError, fileName + ": cannot be written: " + std::strerror(errno) +
                                                           "; check that the folder exists and can be written to");
  }
}

AtomicFile::~AtomicFile()
{
  if (file_)
  {
    std::fclose(file_);
  }
  if (!committed_)
  {
    std::error_code ignored;
    std::filesystem::remove(temporaryName_, ignored);
  }
}

void AtomicFile::Fail(const std::string& what)
{
  throw FileError(vtkErrorCode::OutOfDiskSpaceError,
                  fileName_ + ": " + what + ": " + std::strerror(errno) + "; nothing was written");
}

void AtomicFile::Write(const void* bytes, std::size_t count)
{
  if (count > 0 && std::fwrite(bytes, 1, count, file_) != count)
  {
    Fail("writing failed");
  }
}

std::uint64_t AtomicFile::Position()
{
  const long position = std::ftell(file_);
  if (position < 0)
  {
    Fail("writing failed");
  }
  return static_cast<std::uint64_t>(position);
}

void AtomicFile::Seek(std::uint64_t position)
{
  if (std::fseek(file_, static_cast<long>(position), SEEK_SET) != 0)
  {
    Fail("writing failed");
  }
}

void AtomicFile::Close()
{
  std::FILE* file = file_;
  file_ = nullptr;
  if (std::fclose(file) != 0)
  {
    Fail("writing failed");
  }
}

void AtomicFile::Commit()
{
  Close();
  std::error_code error;
  std::filesystem::rename(temporaryName_, fileName_, error);
  if (error)
  {
    throw FileError(vtkErrorCode::CannotOpenFileError,
                    fileName_ + ": cannot be written: " + error.message() + "; nothing was written");
  }
  committed_ = true;
}

}  // namespace bigus
